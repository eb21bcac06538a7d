"""Closed forms: half-space elasticity, JKR contact, bond populations; all broadcast over arrays."""

import importlib
from types import ModuleType

__all__ = [
    "cohesive",
    "halfspace",
    "jkr",
    "limits",
    "reversible",
    "schallamach",
    "theories",
]


def __getattr__(name: str) -> ModuleType:
    if name in __all__:
        return importlib.import_module(f"sim.laws.{name}")
    raise AttributeError(f"module 'sim.laws' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
