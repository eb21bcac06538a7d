"""Files that a page saves: the scenario as TOML, the curves as CSV, and their figure."""

import csv
import io
import json
from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
import tomlkit
from matplotlib.figure import Figure

from sim.ensemble.dataset import scenario_json
from sim.parts.exchange import Array
from sim.plots import style
from sim.scenario.files import written
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.study.curves import steady_curves
from sim.units.notation import engineering
from sim.units.quantity import Quantity

#: Kinds of pictures, with their types on the web.
PICTURES = {"png": "image/png", "svg": "image/svg+xml", "pdf": "application/pdf"}


def toml(scenario: Scenario, changed: Mapping[str, float], fixed: Mapping[str, Any]) -> str:
    """Return a scenario as TOML with some numbers changed [SI], and without its sweep.

    The comments of its file stay. ``fixed`` are values of keys that its file does not have: those of an option, and
    those of the first point of its sweep. A scenario that was made in Python is written as it was resolved.
    """
    text = scenario.source.text
    if not text:
        resolved = scenario_json(scenario.with_values(dict(changed)))
        given = json.loads(resolved, object_hook=lambda table: {k: v for k, v in table.items() if v is not None})
        return written(given)
    result, known = tomlkit.parse(text), quantities(scenario)
    result.pop("sweep", None)
    fixed = {key: value for key, value in fixed.items() if key.partition(".")[0] != "sweep"}
    numbers = {key: _shortest(value, known[key][0].unit) for key, value in changed.items()}
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
    text = engineering(value, unit).replace("µ", "u").replace("²", "^2").replace("³", "^3")
    return text if unit != "1" and Quantity(unit, "").read(text) == value else value


def table(scenario: Scenario, speeds: Array) -> str:
    """Return curves of steady sliding as CSV in SI, with the columns of ``sim.steady_curves``."""
    curves = steady_curves(scenario, speeds)
    columns = [curves["speed"], *curves.data_vars.values()]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([f"{column.name} [{column.attrs['units']}]" for column in columns])
    writer.writerows(zip(*(column.to_numpy().tolist() for column in columns), strict=True))
    return file.getvalue()


def picture(scenario: Scenario, speeds: Array, kind: str) -> bytes:
    """Return the figure of curves of steady sliding as a file of one of the ``PICTURES``."""
    file = io.BytesIO()
    figure(scenario, speeds).savefig(file, format=kind)
    return file.getvalue()


def figure(scenario: Scenario, speeds: Array) -> Figure:
    """Draw curves of steady sliding: area with what each mechanism takes of it, energies, and friction."""
    curves = steady_curves(scenario, speeds)
    with mpl.rc_context(style.STYLE):
        result, (area, energy, friction) = style.rows([1.7, 1.0, 1.0])
        unit = style.in_unit(friction.xaxis, "sliding speed $V$", speeds, "m/s")
        x, left = speeds * unit, 100.0 * curves["area_ratio"].to_numpy()
        parts = (
            ("lost_to_fluctuations", "lost to fluctuations", style.FLUCTUATIONS),
            ("lost_to_mean_stress", "lost to the mean stress", style.REFERENCE),
            ("lost_to_bonds", "lost to bonds", style.BONDS),
        )
        area.plot(x, left, color=style.BOTH, label="contact")
        for name, words, colour in parts:
            if name in curves and np.any(curves[name] != 0.0):
                above = left + 100.0 * curves[name].to_numpy()
                area.fill_between(x, left, above, color=colour, alpha=0.3, linewidth=0.0, label=words)
                left = above
        area.set_ylabel(r"$A/A_{\mathrm{JKR}}$ (%)")
        scale = style.in_unit(energy.yaxis, "energy", np.array([scenario.adhesion.work]), "J/m^2")
        lines = ("work_of_adhesion", "$w$", style.BOTH), ("fluctuation_energy", r"$\Delta\Gamma$", style.FLUCTUATIONS)
        for name, words, colour in lines:
            energy.plot(x, scale * curves[name], color=colour, label=words)
        force = style.in_unit(friction.yaxis, "friction $F$", curves["friction_force"].to_numpy(), "N")
        friction.plot(x, force * curves["friction_force"], color=style.BOTH)
        friction.set_xscale("log")
        for panel in (area, energy):
            style.legend(panel)
    return result
