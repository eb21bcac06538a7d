"""Adhesive sliding interfaces: a smooth sphere slides on a soft half-space.

>>> import sim
>>> scene = sim.load("scenarios/pdms_lens.toml")  # doctest: +SKIP
>>> dataset = sim.run(scene)  # doctest: +SKIP
"""

import importlib
from typing import Any

_PUBLIC = {
    "load": "sim.scenario.reader",
    "BadInput": "sim.scenario.reader",
    "run": "sim.ensemble.simulate",
    "open": "sim.ensemble.simulate",
    "Scenario": "sim.scenario.scenario",
    "laws": "",
    "spectrum": "",
    "analysis": "",
    "plots": "",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that importing the package costs nothing."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'sim' has no attribute {name!r}")
    if not _PUBLIC[name]:
        return importlib.import_module(f"sim.{name}")
    return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
