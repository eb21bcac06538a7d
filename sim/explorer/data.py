"""Measured curves on the page: their table, points beside the curves, and chi^2."""

import contextlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from sim.explorer.drawing import listed
from sim.explorer.figures import fitness
from sim.scenario.scenario import Scenario
from sim.study.likelihood import problem_of
from sim.study.measurement import Measured, read
from sim.study.prediction import by_steady_sliding
from sim.units.errors import BadInput

#: Bytes and rows that a table may have.
_MOST_BYTES, _MOST_ROWS = 2_000_000, 5_000


def table_of(
    source: str | Path, name: str, scenario: Scenario, is_plan: bool = False
) -> Measured:
    """Read a table of measured curves, its text or a file, as ``sim fit`` does, or as ``sim fit --plan`` does.

    A plan needs errors alone, and relative ones are those of the values that it predicts.

    Raises
    ------
    BadInput
        If it is too large, or cannot be read.
    """
    with tempfile.TemporaryDirectory(prefix="sim-explore-") as folder:
        path = source if isinstance(source, Path) else Path(folder) / "table.csv"
        if isinstance(source, str):
            path.write_text(source, encoding="utf-8")
        if path.is_file() and path.stat().st_size > _MOST_BYTES:
            raise BadInput(
                [f"{name}: has more than 2 MB; leave out rows, or use sim fit"]
            )
        try:
            table = read(path, scenario, ["contact_area"] if is_plan else ())
        except BadInput as fault:
            raise BadInput(
                [problem.replace(str(path), name) for problem in fault.problems]
            ) from None
    if table.rows > _MOST_ROWS:
        raise BadInput(
            [f"{name}: has more than {_MOST_ROWS} rows; leave out some, or use sim fit"]
        )
    return table._replace(path=Path(name))


def is_plan(source: str | Path, name: str, scenario: Scenario) -> bool:
    """Return True if a table has errors that a plan can read, with or without measured values."""
    with contextlib.suppress(BadInput):
        table = table_of(source, name, scenario, is_plan=True)
        return any(curve.errors is not None for curve in table.curves)
    return False


def compared(scenario: Scenario, table: Measured) -> dict[str, Any]:
    """Return the points of a table with errors and residuals, chi^2, how many numbers it is of, and both in words.

    Points are in SI, those of the area also as shares of JKR's area. Residuals are in standard errors. A curve without
    errors has no residuals and no part in chi^2.
    """
    problem = problem_of(scenario, [table], [], {})
    off = (problem.values - problem.steady(problem.start)) / np.where(
        problem.estimated, np.nan, problem.sigma
    )
    speeds, full = np.empty(table.rows), np.empty(table.rows)
    for group in problem.groups[0]:
        speeds[group.rows] = group.speed[:, 0]
        full[group.rows] = (
            np.pi * by_steady_sliding(group, {}, ["jkr_radius"])["jkr_radius"] ** 2
        )
    points = {}
    for number, curve in enumerate(table.curves):
        here = problem.curve == number
        values = curve.values
        errors = np.where(problem.estimated, np.nan, problem.sigma)[here]
        about = {"x": listed(speeds), "residuals": listed(off[here])}
        name = curve.name
        if name == "contact_radius":  # drawn as its area
            name, errors = "contact_area", 2.0 * np.pi * np.abs(values) * errors
            values = np.pi * values**2
        points[name] = about | {"values": listed(values), "errors": listed(errors)}
        if name == "contact_area":
            points["area_ratio"] = about | {
                "values": listed(values / full),
                "errors": listed(errors / full),
            }
    chi_square, count = float(np.nansum(off**2)), int(np.sum(~problem.estimated))
    return {
        "points": points,
        "chi_square": chi_square,
        "count": count,
        "name": table.path.name,
        "words": "; ".join(filter(None, [fitness(problem), table.remark])),
    }
