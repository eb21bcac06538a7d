"""Schallamach bonds: how many there are and what shear stress they carry."""
