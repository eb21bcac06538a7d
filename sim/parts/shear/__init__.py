"""Fluctuations of the shear stress: the energy ΔΓ that they store, and their maps."""

from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.modal import FixedProcess, ModalProcess
from sim.parts.shear.models import Auto, Banded, Mapped, Mean, Modal, Model, Process, Shear, Uniform
