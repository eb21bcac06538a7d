"""Schallamach bonds: how many there are and what shear stress they carry."""

from sim.parts.bonds.models import Auto, Bonds, Model
from sim.parts.bonds.stretched import Cohort, FirstMoment, Tracked
from sim.parts.bonds.two_state import Counted, Rate, Steady, Unbroken
