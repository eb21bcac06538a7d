"""Numbers with units: quantities, tables of them, their course in time, their notation."""
