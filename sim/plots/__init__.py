"""Figures of datasets."""

from sim.plots.choices import Choices
from sim.plots.kinds import KINDS, draw

__all__ = ["KINDS", "Choices", "draw"]


def __dir__() -> list[str]:
    return __all__
