"""Files that a page saves: the scenario as TOML, and the curves as CSV."""

import json
from collections.abc import Mapping
from typing import Any

import tomlkit

from sim.ensemble.dataset import scenario_json
from sim.parts.exchange import Array
from sim.scenario.files import written
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.study.curves import steady_curves
from sim.units.notation import engineering
from sim.units.quantity import Quantity


def toml(
    scenario: Scenario,
    changed: Mapping[str, float],
    fixed: Mapping[str, Any],
    is_swept: bool = False,
) -> str:
    """Return a scenario as TOML with some numbers changed [SI], and without its sweep unless it ``is_swept``.

    The comments of its file stay. ``fixed`` are values of keys that its file does not have: those of an option. A
    scenario that was made in Python is written as it was resolved.
    """
    text = scenario.source.text
    if not text:
        resolved = scenario_json(scenario.with_values(dict(changed)))
        document = json.loads(
            resolved,
            object_hook=lambda table: {k: v for k, v in table.items() if v is not None},
        )
        return written(document)
    result, known = tomlkit.parse(text), quantities(scenario)
    if not is_swept:
        result.pop("sweep", None)
    fixed = {
        key: value for key, value in fixed.items() if key.partition(".")[0] != "sweep"
    }
    numbers = {
        key: _shortest(value, known[key][0].unit) for key, value in changed.items()
    }
    for key, value in (fixed | numbers).items():
        table: Any = result
        *tables, last = key.split(".")
        for name in tables:
            if not isinstance(table.get(name), dict):
                table[name] = tomlkit.table()
            table = table[name]
        table[last] = value
    return tomlkit.dumps(result)


def _shortest(value: float, unit: str) -> float | str:
    """Return a number as text with a unit if that is exact, else the number in SI."""
    text = (
        engineering(value, unit).replace("µ", "u").replace("²", "^2").replace("³", "^3")
    )
    return text if unit != "1" and Quantity(unit, "").read(text) == value else value


def table(scenario: Scenario, speeds: Array) -> str:
    """Return curves of steady sliding as CSV in SI, with the columns of ``sim.steady_curves``."""
    curves = steady_curves(scenario, speeds)
    names = [f"{name} [{column.attrs['units']}]" for name, column in curves.items()]
    return curves.to_dataframe().to_csv(
        header=names, index_label="speed [m/s]", lineterminator="\n"
    )
