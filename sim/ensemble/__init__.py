"""Ensembles of members over a sweep, and the netCDF file they become."""
