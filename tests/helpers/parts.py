"""Parts and functions that most tests use, to import in one line."""

from sim import read as read
from sim.ensemble.simulate import run as run
from sim.laws import jkr as jkr
from sim.parts import drive as drive
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell as Bell
from sim.parts.contact import Equilibrium as Equilibrium, RateDependent as RateDependent
from sim.parts.contact.models import Adhesion as Adhesion
from sim.parts.drive import Force as Force, Spring as Spring
from sim.parts.shear import models as shear
from sim.parts.shear.process import (
    Onset as Onset,
    Slip as Slip,
    Stress as Stress,
    Time as Time,
)
from sim.scenario.reader import load as load
from sim.scenario.scenario import (
    Clock as Clock,
    Ensemble as Ensemble,
    Record as Record,
    read_sweep as read_sweep,
)
from sim.spectrum.families import Band as Band

__all__ = ["bonds", "shear"]
