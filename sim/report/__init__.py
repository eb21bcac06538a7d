"""One page of a whole run: the question, the answer in numbers, figures, tables, errors, cost and how to repeat it."""

from sim.report.document import html, written

__all__ = ["html", "written"]
