"""One page of a whole run: figures, tables, errors, the scenario and how to repeat it."""

from sim.reports.report import html, written

__all__ = ["html", "written"]
