"""Measured curves on the page: points beside the curves, chi^2, and the table that is kept while the page is open."""

import hashlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from sim.explorer.job import listed
from sim.scenario.scenario import Scenario
from sim.study.likelihood import Measured, by_steady_sliding, problem_of, read
from sim.units.errors import BadInput

#: Bytes and rows that a table may have; tables that are kept.
_MOST_BYTES, _MOST_ROWS, _KEPT = 2_000_000, 5_000, 8


class Tables:
    """Tables that were dropped on a page, by the digest of their text."""

    def __init__(self) -> None:
        self._tables: dict[str, Measured] = {}

    def add(self, text: str, name: str, scenario: Scenario) -> str:
        """Read a table of measured curves as ``sim fit`` does, and return the digest by which it is known.

        Raises
        ------
        BadInput
            If it is too large, or cannot be read.
        """
        if len(text.encode()) > _MOST_BYTES:
            raise BadInput([f"{name}: has more than 2 MB; leave out rows, or use sim fit"])
        digest = hashlib.sha256(text.encode()).hexdigest()
        with tempfile.TemporaryDirectory(prefix="sim-explore-") as folder:
            path = Path(folder) / "table.csv"
            path.write_text(text, encoding="utf-8")
            try:
                table = read(path, scenario)
            except BadInput as fault:
                raise BadInput([problem.replace(str(path), name) for problem in fault.problems]) from None
        if table.rows > _MOST_ROWS:
            raise BadInput([f"{name}: has more than {_MOST_ROWS} rows; leave out some, or use sim fit"])
        self._tables[digest] = table._replace(path=Path(name))
        while len(self._tables) > _KEPT:
            del self._tables[next(iter(self._tables))]
        return digest

    def get(self, digest: Any) -> Measured | None:
        """Return a table by its digest; None if there is none."""
        return self._tables.get(digest) if isinstance(digest, str) else None


def compared(scenario: Scenario, table: Measured) -> dict[str, Any]:
    """Return the points of a table with errors and residuals, chi^2 and how many numbers it is of.

    Points are in SI, those of the area also as shares of JKR's area. Residuals are in standard errors. A curve without
    errors has no residuals and no part in chi^2.
    """
    problem = problem_of(scenario, [table], [], {})
    off = (problem.values - problem.steady(problem.start)) / np.where(problem.estimated, np.nan, problem.sigma)
    speeds, full = np.empty(table.rows), np.empty(table.rows)
    for group in problem.groups[0]:
        speeds[group.rows] = group.speed[:, 0]
        full[group.rows] = np.pi * by_steady_sliding(group, {}, ["jkr_radius"])["jkr_radius"] ** 2
    points = {}
    for number, curve in enumerate(table.curves):
        here = problem.curve == number
        values, errors = curve.values, np.where(problem.estimated, np.nan, problem.sigma)[here]
        about = {"speed": listed(speeds), "residuals": listed(off[here])}
        points[curve.name] = about | {"values": listed(values), "errors": listed(errors)}
        if curve.name == "contact_area":
            points["area_ratio"] = about | {"values": listed(values / full), "errors": listed(errors / full)}
    chi_square, count = float(np.nansum(off**2)), int(np.sum(~problem.estimated))
    return {"points": points, "chi_square": chi_square, "count": count, "name": table.path.name}
