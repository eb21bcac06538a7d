"""Figures of datasets."""

from sim.plots.kinds import KINDS, draw

__all__ = ["KINDS", "draw"]
