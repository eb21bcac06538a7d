"""Drives: how fast the slider moves, or what moves it."""

from sim.parts.drive.driven import READINGS, Drive, Force, Spring
from sim.parts.drive.prescribed import Ramp, Start, Steady, Table

__all__ = ["READINGS", "Drive", "Force", "Ramp", "Spring", "Start", "Steady", "Table"]
