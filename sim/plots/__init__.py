"""Figures of datasets."""

from sim.plots.kinds import KINDS, draw

__all__ = ["KINDS", "draw"]


def __dir__() -> list[str]:
    return __all__
