"""Figures of datasets."""

from sim.plots.kinds import KINDS, Choices, draw

__all__ = ["KINDS", "Choices", "draw"]


def __dir__() -> list[str]:
    return __all__
