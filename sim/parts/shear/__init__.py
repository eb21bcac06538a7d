"""Fluctuations of the shear stress: the energy ΔΓ that they store, and their maps."""

from sim.parts.shear.bands import BandedProcess
from sim.parts.shear.models import (
    Auto,
    Banded,
    Carried,
    Mapped,
    Mean,
    Modal,
    Model,
    Process,
    Shear,
    Uniform,
)
from sim.parts.shear.modes import ModalProcess
