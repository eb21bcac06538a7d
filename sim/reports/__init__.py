"""One page of a run, from its question to how to repeat it, and a paragraph of methods."""

from sim.reports.methods import Methods, methods
from sim.reports.report import Page, html, written

__all__ = ["Methods", "Page", "html", "methods", "written"]
