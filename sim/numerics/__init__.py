"""The compiled ground: compilation, random numbers, special functions, grids, files."""
