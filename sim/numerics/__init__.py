"""Numerical ground: compilation, random numbers, special functions, grids, files."""
