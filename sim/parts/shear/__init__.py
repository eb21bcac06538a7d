"""Fluctuations of the shear stress: the energy ΔΓ that they store, and their maps."""

from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.measured_map import Carried, Model, Shear
from sim.parts.shear.modal import FixedProcess, ModalProcess
from sim.parts.shear.models import Auto, Banded, Mapped, Mean, Modal, Process, Uniform
