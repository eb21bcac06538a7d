"""Settings of a scene that trade speed for accuracy: the models that it admits, their tolerances, and clock steps."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from scipy import special

from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.scenario.schema import keys, model, tables

_BANDS, _COHORTS = (0.3, 0.1, 0.03, 0.01, 0.003), (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def part_table(part: object) -> dict[str, Any]:
    """Return the keys of a part that have a value, as its table in a scenario file."""
    # its own type, because pydantic before 2.14 does not build the deferred schema of a part of any type
    adapter = TypeAdapter(type(part))
    return dict(adapter.dump_python(part, by_alias=True, exclude_none=True))


def alternatives(scenario: Scenario) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the settings of a scene, simple ones first: the part, and the keys of its table that are changed."""

    def tolerances(table: dict[str, Any], usual: tuple[float, ...]) -> list[float]:
        return sorted({*usual, table.get("tolerance", usual[0])}, reverse=True)

    shear, bonds = part_table(scenario.shear), part_table(scenario.bonds)
    if "correlation" in shear:
        yield "shear", {"model": "mean"}
        for tolerance in tolerances(shear, _BANDS):
            yield "shear", {"model": "banded", "tolerance": tolerance}
        # the same numbers
        yield "shear", {"model": "mapped" if shear["model"] == "mapped" else "modal"}
    if "rebinding_rate" not in bonds:
        return
    is_carried, is_stretched = bonds.get("area") == "carried", "rupture" in bonds
    if not (is_stretched or is_carried):
        yield "bonds", {"model": "steady"}
    yield "bonds", {"model": "rate"}
    for tolerance in tolerances(bonds, _COHORTS) if is_stretched else ():
        yield "bonds", {"model": "cohort", "tolerance": tolerance}
    density = bonds.get("site_density", math.inf)
    sites = bonds.get("sites") or density * math.pi * scenario.rest_radius**2
    last, most = ("tracked", 1e5) if is_stretched else ("counted", 1e9)
    # sites cannot be carried with the area
    if not is_carried and ("sites" in bonds or 0.0 < sites <= most):
        yield "bonds", {"model": last, "sites": round(sites)}


def changed_part(
    scenario: Scenario, part: str, changes: dict[str, Any]
) -> dict[str, Any]:
    """Return the table of a part with some keys changed, without those that its new model does not have."""
    table_now = part_table(getattr(scenario, part))
    declared = {
        key
        for kind in tables(keys(Scenario)[part].annotation).values()
        if model(kind) == changes["model"]
        for key in keys(kind)
    }
    kept = {key: table_now[key] for key in table_now.keys() & declared}
    return kept | changes


def step_values(scenario: Scenario, ratio: float) -> dict[str, float]:
    """Return the clock with its step times a power of two and the same records."""
    clock = scenario.clock
    return {
        "duration": clock.duration,
        "step": clock.step * ratio,
        "record": clock.stride * clock.step,
    }


def students(members: int | Array, numbers: float = 1.0) -> Any:
    """Return Student's two-sided 95 % quantile of a mean over members, or of the largest of some ``numbers``."""
    return special.stdtrit(np.maximum(members - 1.0, 1.0), 1.0 - 0.025 / numbers)
