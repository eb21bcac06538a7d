"""The figure of ``sim fit``: measured curves with the fitted ones, and the residuals below."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sim.plots.style import BOTH, GUIDE, HOLLOW, REFERENCE, STYLE, Unit, across, axis_scale, in_units, legend, rows
from sim.study.fitting import Minimum, Problem
from sim.study.measured import HELD, Measured
from sim.units.errors import BadInput

Array = NDArray[np.float64]

#: Height of a curve's panel and of that of its residuals [in].
_CURVE, _RESIDUALS = 1.5, 0.8
#: Words and unit of a condition.
_ALONG = {"speed": ("sliding speed $V$", "m/s"), "t": ("time $t$", "s")}


def figure(problem: Problem, best: Minimum) -> Figure:
    """Each curve over what was varied, with error bars and the fit, above its residuals in standard errors.

    The lines are of many speeds where only the speed was varied, else they join the rows in the order of what was.
    Grey is steady sliding alone, where the scenario's own models add to it.
    """
    fitted, alone = problem.predicted(best.x), problem.steady(best.x)
    off = (problem.values - fitted) / np.hypot(problem.sigma, problem.noise)
    curves = [(table, curve) for table in problem.tables for curve in table.curves]
    with mpl.rc_context(STYLE):
        drawn, panels = rows([_CURVE, _RESIDUALS] * len(curves), shared=False)
        for number, (table, curve) in enumerate(curves):
            here, (upper, lower) = problem.curve == number, panels[2 * number : 2 * number + 2]
            words, si, along = _along(table)
            order, (unit, name, symbol) = np.argsort(along, kind="stable"), curve.described
            x, y = Unit.of(along, si, logarithmic=axis_scale(along) == "log"), Unit.of(curve.values, unit)
            bars: Any = HOLLOW | {"color": BOTH, "elinewidth": 0.7, "zorder": 3, "label": "measured"}
            spread = y.factor * problem.sigma[here]
            upper.errorbar(x.factor * along, y.factor * curve.values, yerr=spread, **bars)
            both = [(fitted, BOTH, "fit")]
            if np.any(problem.shift):
                both.append((alone, REFERENCE, "in steady sliding"))
            fine, smooth = problem.between(best.x, table, curve.name)
            for values, colour, label in both:
                line, over = values[here][order], along[order]
                if fine.size:  # what is added to steady sliding is known at the rows
                    line, over = smooth + np.interp(fine, over, line - alone[here][order]), fine
                upper.plot(x.factor * over, y.factor * line, color=colour, linewidth=0.9, label=label,
                           zorder=2 if colour == BOTH else 1.8)  # fmt: skip
            upper.set_ylabel(y.label(f"{name.partition(',')[0]} ${symbol}$"))
            upper.tick_params(labelbottom=False)
            lower.plot(x.factor * along, off[here], color=BOTH, **HOLLOW)
            lower.axhline(0.0, **GUIDE)
            lower.margins(y=0.15)
            lower.set_ylabel("residual ($\\sigma$)")
            for panel, text in ((upper, ""), (lower, x.label(words))):
                across(panel, x.factor * along, text, axis_scale(along), 0.05)
            if not number:
                legend(upper)
    return drawn


def refuse_units(tables: Sequence[Measured], units: Sequence[str]) -> None:
    """Refuse a unit that no axis of the figure of some tables can have, before anything is fitted."""
    try:
        with in_units(units):
            for table in tables:
                _, si, along = _along(table)
                for values, unit in ((along, si), *((curve.values, curve.described[0]) for curve in table.curves)):
                    Unit.of(values, unit)
    except ValueError as fault:
        raise BadInput([f"--units: {fault}"]) from None


def _along(table: Measured) -> tuple[str, str, Array]:
    """Words, unit and values of what varies from row to row."""
    varied = [(name, values) for name, values in table.conditions.items() if np.ptp(values) > 0.0]
    if not varied:
        return "row", "1", np.arange(1.0, table.rows + 1.0)
    name, values = max(varied, key=lambda one: len(np.unique(one[1])))
    if name == "held":
        name = HELD[table.held]
        return name.replace("_", " "), "N" if table.held == "load" else "m", values
    words, unit = _ALONG.get(name, (name, "1"))
    return words, unit, values
