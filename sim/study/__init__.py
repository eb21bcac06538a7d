"""Studies: the numbers of the paper; speed against error."""
