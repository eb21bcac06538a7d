"""Drives: how fast the slider moves."""

from sim.parts.drive.prescribed import Drive, Ramp, Start, Steady, Table

__all__ = ["Drive", "Ramp", "Start", "Steady", "Table"]
