"""Numbers of a scenario calibrated to measured curves: ``sim fit``.

The curves are fitted by steady sliding, which is quick (``sim.study.predicted``). Then the scenario's own models run
once with what was found; what they add to steady sliding is added to it, with the error that their members leave, and
the fit is made anew, until it stays. The same noise is drawn each time. Where steady sliding does not depend on a key
that is free, such as the speed of an edge that lags, or what slides feels its friction, every prediction is a run.
"""

import contextlib
import difflib
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.study.fitting import Free, Interval, Minimum, Problem, entangled, idle, interval, problem_of, with_errors
from sim.study.measured import read
from sim.study.predicted import groups
from sim.units.errors import BadInput
from sim.units.notation import engineering
from sim.units.quantity import Quantity

Array = NDArray[np.float64]

#: Factor by which a number that is fitted in its logarithm may change at most, where no bounds are given.
_WIDE = 1e4
#: The same of bounds that are given as an example.
_USUAL = 100.0
#: Most runs of the scenario's own models, and the change of every number, over its error, that ends them.
_RUNS, _STAYS = 3, 0.1
#: Correlation beyond which the data hardly tell two numbers apart.
_ALIKE = 0.95
#: Start of another search, over an e-fold or the range of a number; and most rows that are named.
_BESIDE, _NAMED = 0.5, 3
#: Probability of a chi^2 as large below which a fit is doubted.
POOR = 0.05
#: Ratio of measured and fitted values beyond which a unit is asked for.
_OTHER_UNIT = 100.0
#: Tables of keys that are not physical.
_OTHER = ("clock", "record", "ensemble", "seed")


class Found(NamedTuple):
    """What was found of one free number [SI]: its value, standard error, interval, and its value in steady sliding."""

    free: Free
    value: float
    error: float
    interval: Interval
    steady: float


class Fit(NamedTuple):
    """A calibrated scenario.

    ``scenario`` has the ``numbers`` found; ``problem`` and ``best`` are the curves and where they agree best;
    ``correlations`` those of the free numbers; ``remarks`` what to know of them.
    """

    scenario: Scenario
    problem: Problem
    best: Minimum
    numbers: tuple[Found, ...]
    correlations: Array
    converged: bool
    remarks: tuple[str, ...]

    @property
    def aicc(self) -> float:
        """Akaike's criterion for few points."""
        return self.problem.criterion(self.best.chi_square)

    @property
    def p_value(self) -> float:
        """Probability of a chi^2 as large or larger; nan where the errors were not measured."""
        return _likely(self.problem, self.best)

    @property
    def values(self) -> dict[str, float]:
        """Values of the free keys [SI]."""
        return {one.free.key: one.value for one in self.numbers}


def fit(
    scenario: Scenario, data: Sequence[Path], free: Iterable[str], common: dict[str, float] | None = None,
    steady: bool = False,
) -> Fit:  # fmt: skip
    """Find numbers of a scenario from measured curves.

    Parameters
    ----------
    scenario : Scenario
        Its own values are where the search starts; without its sweep.
    data : sequence of Path
        CSV tables (``sim.study.measured.read``), all fitted together.
    free : iterable of str
        Keys, each ``"KEY"`` or ``"KEY=LOW:HIGH"`` with bounds such as ``"1 mm/s:100 mm/s"``.
    common : dict, optional
        Relative errors that all points of a variable share, as of one lens or one camera.
    steady : bool
        Whether steady sliding is enough, so that the scenario's own models are not run.

    Raises
    ------
    BadInput
        If a key is none that can be found, a table cannot be read, or the curves depend on some keys only together.
    """
    base = scenario.with_values({"record": {}})
    chosen = [_free(base, text) for text in free]
    if len({one.key for one in chosen}) < len(chosen):
        raise BadInput(["--free: a key is there twice; give each once"])
    tables = [read(path, base) for path in data]
    problem = problem_of(tables, [groups(base, table) for table in tables], chosen, common or {})
    if steady and base.drive.solves_motion:
        raise BadInput(
            [f'--steady: drive.model = "{base.drive.model}" is answered by its own runs alone; leave it out']
        )
    if base.drive.solves_motion or (not steady and idle(problem)):
        problem = replace(problem, by_run=True).compared(problem.start)
    _refuse_entangled(problem)
    problem, best = _searched(problem)
    alone, converged = best, best.converged
    for _ in range(0 if steady or problem.by_run else _RUNS):
        before = best.x
        problem, best = with_errors(problem.compared(best.x), best.x)
        if best.covariance is None or np.all(np.abs(best.x - before) < _STAYS * np.sqrt(np.diag(best.covariance))):
            break
    else:
        converged = (steady or problem.by_run) and converged
    return _assembled(scenario, problem, best, alone, converged and best.converged)


def _searched(problem: Problem) -> tuple[Problem, Minimum]:
    """The minimum near the scenario's own values; a poor one is sought from both sides of it, by each free number, too.

    A contact that is open has no slope that would lead out of there.
    """
    found = [with_errors(problem, problem.start)]
    if not problem.by_run and (_poor(*found[0]) or _open(*found[0]).size):
        for k, one in enumerate(problem.free):
            for sign in (-1.0, 1.0):
                beside = found[0][1].x.copy()
                beside[k] += sign * _BESIDE * one.width
                found.append(with_errors(problem, beside))
    return min(found, key=lambda one: one[0].criterion(one[1].chi_square))


def _likely(problem: Problem, best: Minimum) -> float:
    known = problem.freedom > 0 and not problem.estimated.any()
    return float(chdtrc(problem.freedom, best.chi_square)) if known else math.nan


def _poor(problem: Problem, best: Minimum) -> bool:
    """Whether the curves lie further off than their errors."""
    freedom = problem.freedom
    return bool(freedom > 0 and best.chi_square > freedom + 4.0 * math.sqrt(2.0 * freedom))


def _open(problem: Problem, best: Minimum) -> NDArray[np.int64]:
    """Measured numbers at which the contact is open by the fit, and was not."""
    return np.flatnonzero((problem.predicted(best.x) == 0.0) & (np.abs(problem.values) > 3.0 * problem.sigma))


def _assembled(scenario: Scenario, problem: Problem, best: Minimum, alone: Minimum, converged: bool) -> Fit:
    """The fit with its intervals, and what to know of it."""
    count = len(problem.free)
    if best.covariance is None:
        said = ("the errors could not be found: the data do not hold some of the numbers",)
        none = Interval(math.nan, math.nan, True, True)
        numbers = [Found(one, one.outer(float(best.x[k])), math.nan, none, one.outer(float(alone.x[k])))
                   for k, one in enumerate(problem.free)]  # fmt: skip
        return Fit(scenario, problem, best, tuple(numbers), np.full((count, count), np.nan), False, said)
    spread = np.sqrt(np.diag(best.covariance))
    found = []
    for k, one in enumerate(problem.free):
        value = one.outer(float(best.x[k]))
        error = spread[k] * (value if one.logarithmic else 1.0)
        found.append(Found(one, value, float(error), interval(problem, best, k), one.outer(float(alone.x[k]))))
    alike = (best.covariance / np.outer(spread, spread))[:count, :count]
    final = scenario.with_values({one.free.key: one.value for one in found})
    return Fit(final, problem, best, tuple(found), alike, converged, tuple(_remarks(problem, best, found, alike)))


def _remarks(problem: Problem, best: Minimum, found: list[Found], alike: Array) -> list[str]:
    said = []
    for i, one in enumerate(found):
        for j in range(i):
            if abs(alike[i, j]) > _ALIKE:
                both = f"{found[j].free.key} and {one.free.key}"
                said.append(f"the data hardly tell {both} apart (correlation {alike[i, j]:.3f})")
        ends = [*zip(("below", "above"), one.interval[:2], one.interval[2:], strict=True)]
        if bound := [word for word, end, is_open in ends if is_open and not math.isnan(end)]:
            said.append(f"{one.free.key}: the data do not bound it {' or '.join(bound)}; its bound is given instead")
        if lost := [word for word, end, _ in ends if math.isnan(end)]:
            said.append(f"{one.free.key}: the end of its interval was not found {' or '.join(lost)}")
    if (p_value := _likely(problem, best)) <= POOR:
        said.append(f"the curves lie further off than their errors (p = {p_value:.2g}): the model lacks something, a")
        said[-1] += (
            " number that is not free is wrong, or the errors are too small; the intervals hold for none of these"
        )
    said += _of_other_units(problem, best)
    if (open_there := _open(problem, best)).size:
        rows = ", ".join(map(problem.place, open_there[:_NAMED]))
        said.append(f"the contact is open by the fit where it was measured: {rows}")
    if problem.estimated.any():
        said.append("curves without errors: their scatter around the fit stands for them")
    return said


def _of_other_units(problem: Problem, best: Minimum) -> list[str]:
    """What to say of curves of which measured and fitted values differ as if one had another unit."""
    said, fitted = [], np.abs(problem.predicted(best.x))
    for number in range(int(problem.curve[-1]) + 1):
        here = problem.curve == number
        size, least = float(np.median(np.abs(problem.values[here]))), float(np.median(fitted[here]))
        if min(size, least) > 0.0 and not 1.0 / _OTHER_UNIT < size / least < _OTHER_UNIT:
            name = problem.place(int(np.argmax(here))).partition(":")[0]
            said.append(f"{name} is {size / least:.2g} times what is fitted: check its unit, and those of the scenario")
    return said


def _free(scenario: Scenario, text: str) -> Free:
    """What a text ``KEY`` or ``KEY=LOW:HIGH`` frees."""
    key, sign, span = text.partition("=")
    key, known = key.strip(), quantities(scenario)
    if key not in known or key.partition(".")[0] in _OTHER or known[key][0].whole:
        physical = [one for one, (quantity, _) in known.items()
                    if one.partition(".")[0] not in _OTHER and not quantity.whole]  # fmt: skip
        near = difflib.get_close_matches(key, physical, 1, 0.5)
        said = "is no physical number of the scenario" + (f'; did you mean "{near[0]}"?' if near else "")
        raise BadInput([f"--free {key[:80]}: {said or 'is not there'}"])
    quantity, start = known[key]
    low, high = max(quantity.at_least, quantity.above), min(quantity.at_most, quantity.below)
    if sign:
        low, high = _span(key, span, quantity, start)
    elif low >= 0.0 and math.isinf(high):
        if not start > 0.0:
            raise BadInput([f"--free {key}: starts at 0; give it a value in the scenario, or bounds, KEY=LOW:HIGH"])
        low, high = start / _WIDE, start * _WIDE
    elif low == quantity.above and low == 0.0:
        low = high / _WIDE**2
    if not low <= start <= high:
        shown = f"{engineering(low, quantity.unit)} to {engineering(high, quantity.unit)}"
        raise BadInput([f"--free {key}: the scenario's value does not lie within {shown}; start inside"])
    return Free(key, quantity, start, low, high)


def _span(key: str, span: str, quantity: Quantity, start: float) -> tuple[float, float]:
    """Bounds in a text ``LOW:HIGH``."""
    ends = span.split(":")
    try:
        low, high = (quantity.read(_number(end)) for end in ends)
    except ValueError as fault:
        said = str(fault) if len(ends) == 2 else "takes two bounds"
        raise BadInput(
            [f'--free {key}={span[:60]}: {said}; write KEY=LOW:HIGH, such as "{key}={_typical(quantity, start)}"']
        ) from None
    if not low < high:
        raise BadInput([f"--free {key}={span[:60]}: the bounds are in the wrong order; write the lower one first"])
    return low, high


def _number(text: str) -> str | float:
    with contextlib.suppress(ValueError):
        return float(text)
    return text.strip()


def _typical(quantity: Quantity, start: float) -> str:
    """Bounds a hundred times below and above a number, or those of the quantity where these are nearer."""
    low, high = sorted((start / _USUAL, start * _USUAL)) if start else (-1.0, 1.0)
    ends = max(low, quantity.at_least), min(high, quantity.at_most, quantity.below)
    return ":".join(engineering(end, quantity.unit) for end in ends)


def _refuse_entangled(problem: Problem) -> None:
    """Refuse keys that have no effect on the curves, or only together."""
    said = "has no effect on what was measured; fix it"
    faults = [f"--free {key}: {said}" for key in idle(problem)]
    for several in [] if faults else entangled(problem):
        names = f"{', '.join(several[:-1])} and {several[-1]}"
        faults.append(f"--free {names}: the curves depend on them only together, as on a product; free one of them")
    if faults:
        raise BadInput(faults)
