"""Closed forms: half-space elasticity, JKR contact, bond populations; all broadcast over arrays."""

import importlib
from types import ModuleType


def __getattr__(name: str) -> ModuleType:
    if name in ("disc", "halfspace", "jkr", "mixed_mode", "profiles", "reversible", "schallamach", "theories"):
        return importlib.import_module(f"sim.laws.{name}")
    raise AttributeError(f"module 'sim.laws' has no attribute {name!r}")
