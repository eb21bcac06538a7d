"""Files that a page saves: the scenario as TOML, the curves as CSV, and their figure."""

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
from sim.plots.style import BONDS, BOTH, FLUCTUATIONS, REFERENCE
from sim.scenario.files import written
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.study.curves import steady_curves
from sim.units.notation import engineering
from sim.units.quantity import Quantity

#: Shares of the lost area, from the curve of the contact upwards, with their colours.
_LOST = {
    "lost_to_fluctuations": FLUCTUATIONS,
    "lost_to_mean_stress": REFERENCE,
    "lost_to_bonds": BONDS,
}


def toml(
    scenario: Scenario, changed: Mapping[str, float], fixed: Mapping[str, Any]
) -> str:
    """Return a scenario as TOML with some numbers changed [SI], and without its sweep.

    The comments of its file stay. ``fixed`` are values of keys that its file does not have: those of an option, and
    those of the first point of its sweep. A scenario that was made in Python is written as it was resolved.
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


def picture(scenario: Scenario, speeds: Array, kind: str) -> bytes:
    """Return the figure of curves of steady sliding as a file of a kind."""
    file = io.BytesIO()
    figure(scenario, speeds).savefig(file, format=kind)
    return file.getvalue()


def figure(scenario: Scenario, speeds: Array) -> Figure:
    """Draw curves of steady sliding: area with what each mechanism takes of it, energies, and friction."""
    curves = steady_curves(scenario, speeds)
    with mpl.rc_context(style.STYLE):
        result, (area, energy, friction) = style.rows([1.7, 1.0, 1.0])
        x = speeds * style.in_unit(friction.xaxis, "sliding speed $V$", speeds, "m/s")
        lost = [
            name for name in _LOST if name in curves and np.any(curves[name] != 0.0)
        ]
        levels = np.cumsum(
            [100.0 * curves[name].to_numpy() for name in ("area_ratio", *lost)], axis=0
        )
        area.plot(x, levels[0], color=BOTH, label="contact")
        for name, low, high in zip(lost, levels, levels[1:], strict=False):
            look: Any = {"color": _LOST[name], "alpha": 0.3, "linewidth": 0.0}
            area.fill_between(x, low, high, label=name.replace("_", " "), **look)
        area.set_ylabel(r"$A/A_{\mathrm{JKR}}$ (%)")
        scale = style.in_unit(
            energy.yaxis, "energy", np.array([scenario.adhesion.work]), "J/m^2"
        )
        energy.plot(x, scale * curves["work_of_adhesion"], color=BOTH, label="$w$")
        energy.plot(
            x,
            scale * curves["fluctuation_energy"],
            color=FLUCTUATIONS,
            label=r"$\Delta\Gamma$",
        )
        force = style.in_unit(
            friction.yaxis, "friction $F$", curves["friction_force"].to_numpy(), "N"
        )
        friction.plot(x, force * curves["friction_force"], color=BOTH)
        friction.set_xscale("log")
        for panel in (area, energy):
            style.legend(panel)
    return result
