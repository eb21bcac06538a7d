"""Schallamach bonds: how many there are and what shear stress they carry."""

from sim.parts.bonds.models import Auto, Bonds, Cohort, Counted, FirstMoment, Model, Rate, Steady, Tracked, Unbroken
