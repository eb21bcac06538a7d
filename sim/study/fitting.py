"""Least squares of measured curves: what is free, its minimum, and the intervals that the data leave.

What is above zero and not bounded above is fitted in its logarithm, the rest as it is, within bounds. The sum of
squares is over errors, and over what curves have in common: a relative error of a whole curve is one more number,
known to be 0 within its size.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from sim.study.measured import Measured
from sim.study.predicted import Group, Sampled, Values, asked, by_steady_sliding
from sim.units.errors import BadInput
from sim.units.quantity import Quantity

try:
    import lmfit
except ModuleNotFoundError:
    raise BadInput(["fitting needs lmfit, of an extra: pip install 'sliding-sim[fit]'"]) from None

Array = NDArray[np.float64]

#: Probability of an interval.
LEVEL = 0.95
#: Residual of a row at which the contact is open, in standard errors.
_OPEN = 1e6
#: Step of derivatives, in logarithms or shares of the range, and relative size of a direction that changes nothing.
_STEP, _NOTHING = 1e-4, 1e-5
#: The same, and the precision of a minimum, where each prediction is a run, known to the tolerance of its steps alone.
_RUN_STEP, _RUN_NOTHING, _RUN_PRECISION = 1e-3, 1e-2, 1e-6
#: Change of all rows, in standard errors and over an e-fold, that is none.
_NO_EFFECT = 1e-6
#: Speeds of a line that is drawn.
_DRAWN = 200
#: Precision of the ends of an interval, over its half width, that of the sums of squares there, and most steps to one.
_END, _END_SQUARES, _MOST = 1e-3, 1e-5, 30
#: Rounds in which errors that nobody gave are found.
_ROUNDS = 4
#: Most evaluations of a minimum, for each number and one more.
_EVALUATIONS = 100


class Free(NamedTuple):
    """A number of the scenario that is to be found between two bounds; ``start`` is the scenario's own."""

    key: str
    quantity: Quantity
    start: float
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        return self.low > 0.0

    @property
    def width(self) -> float:
        """Change of the number as it is fitted that is a large one: an e-fold, its range, or its size without one."""
        if self.logarithmic:
            return 1.0
        return max(self.high - self.low if math.isfinite(self.high - self.low) else abs(self.start), 1e-300)

    def inner(self, value: float) -> float:
        """The number as it is fitted."""
        return math.log(value) if self.logarithmic else value

    def outer(self, x: float) -> float:
        return min(max(math.exp(x), self.low), self.high) if self.logarithmic else x


@dataclass(frozen=True)
class Problem:
    """Measured numbers beside those that a scenario predicts for them.

    ``values`` are all curves of all ``tables`` in turn, ``curve`` the number of each one's curve; ``sigma`` their
    standard errors, ``estimated`` where nobody gave them. ``shift`` is what the scenario's own models add to
    steady sliding at each of them, and ``noise`` its standard error. ``common`` are relative errors that all points
    of a variable share. ``fixed`` and ``theory`` make another mechanism of the scenario. With ``by_run`` each
    prediction is a run of the scenario's own models, as steady sliding does not depend on all that is free.
    """

    tables: tuple[Measured, ...]
    groups: tuple[list[Group], ...]
    free: tuple[Free, ...]
    common: dict[str, float]
    values: Array
    sigma: Array
    curve: NDArray[np.int64]
    estimated: NDArray[np.bool_]
    shift: Array
    noise: Array
    fixed: Values
    theory: str = ""
    by_run: bool = False

    @property
    def start(self) -> Array:
        return np.array([one.inner(one.start) for one in self.free] + [0.0] * len(self.common))

    @property
    def bounds(self) -> list[tuple[float, float]]:
        return [(one.inner(one.low), one.inner(one.high)) for one in self.free] + [(-math.inf, math.inf)] * len(
            self.common
        )

    def numbers(self, x: Array) -> dict[str, float]:
        """Values of the free keys and of those that make the mechanism."""
        return {one.key: one.outer(float(number)) for one, number in zip(self.free, x, strict=False)} | dict(self.fixed)

    def steady(self, x: Array) -> Array:
        """All curves in steady sliding, or by runs."""
        numbers, found = self.numbers(x), []
        if self.by_run:
            return self._joined(self.sampled(x))[0]
        for table, several in zip(self.tables, self.groups, strict=True):
            names = [curve.name for curve in table.curves]
            kept = {name: np.empty(table.rows) for name in names}
            for group in several:
                for name, values in by_steady_sliding(group, numbers, names, self.theory).items():
                    kept[name][group.rows] = values
            found += [kept[name] for name in names]
        return np.concatenate(found)

    def sampled(self, x: Array) -> list[Sampled]:
        """The curves of each table by the scenario's own models."""
        numbers, both = self.numbers(x), zip(self.tables, self.groups, strict=True)
        return [asked(several, numbers, [curve.name for curve in table.curves], "t" in table.conditions)
                for table, several in both]  # fmt: skip

    def _joined(self, sampled: Sequence[Sampled]) -> tuple[Array, Array]:
        """Means and standard errors of all curves."""
        both: list[list[Array]] = [[], []]
        for table, found in zip(self.tables, sampled, strict=True):
            for kept, part in zip(both, found, strict=True):
                kept += [part[curve.name] for curve in table.curves]
        return np.concatenate(both[0]), np.concatenate(both[1])

    def predicted(self, x: Array) -> Array:
        """All curves, with the shift and the common errors."""
        found = self.steady(x) + self.shift
        for k, (name, size) in enumerate(self.common.items()):
            found = np.where(self.of(name), found * (1.0 + size * x[len(self.free) + k]), found)
        return found

    def between(self, x: Array, table: Measured, name: str) -> tuple[Array, Array]:
        """Speeds from the least to the largest of a table, and its curve there in steady sliding.

        Without any where more than the speed was varied.
        """
        several = next(groups for one, groups in zip(self.tables, self.groups, strict=True) if one is table)
        speeds = several[0].speed
        if [*table.conditions] != ["speed"] or self.by_run or not np.min(speeds) > 0.0:
            return np.empty(0), np.empty(0)
        fine = np.geomspace(np.min(speeds), np.max(speeds), _DRAWN)[:, np.newaxis]
        group = several[0]._replace(rows=np.arange(_DRAWN), time=0.0 * fine, speed=fine)
        return fine[:, 0], by_steady_sliding(group, self.numbers(x), [name], self.theory)[name]

    def of(self, name: str) -> NDArray[np.bool_]:
        """Where a variable is."""
        names = [curve.name for table in self.tables for curve in table.curves]
        return np.array([one == name for one in names])[self.curve]

    def place(self, number: int) -> str:
        """Variable and row of one of all numbers."""
        name = [curve.name for table in self.tables for curve in table.curves][self.curve[number]]
        return f"{name}: row {number - int(np.argmax(self.curve == self.curve[number])) + 1}"

    def residuals(self, x: Array) -> Array:
        """Deviations over errors, and the common errors over their sizes."""
        off = (self.values - self.predicted(x)) / np.hypot(self.sigma, self.noise)
        return np.append(np.nan_to_num(off, nan=_OPEN, posinf=_OPEN, neginf=-_OPEN), x[len(self.free) :])

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return len(self.values) - len(self.free)

    def criterion(self, chi_square: float) -> float:
        """Akaike's criterion for few points, AICc."""
        count = len(self.free) + len({*self.curve[self.estimated].tolist()})
        size = chi_square + 2.0 * float(np.sum(np.log(self.sigma[self.estimated]))) + 2.0 * count
        left = len(self.values) - count - 1
        return size + 2.0 * count * (count + 1) / left if left > 0 else math.inf

    def compared(self, x: Array) -> "Problem":
        """This problem with the shift from steady sliding at x to what the scenario's own models give there."""
        mean, noise = self._joined(self.sampled(x))
        if not np.all(np.isfinite(mean)):
            said = "has no value in the run with what was found: is the contact open there?"
            raise BadInput([f"{self.place(int(np.flatnonzero(~np.isfinite(mean))[0]))} {said}"])
        return replace(self, shift=mean - self.steady(x), noise=noise)


class Minimum(NamedTuple):
    """A minimum of the sum of squares, with the covariance of what is free (None where it was not asked for)."""

    x: Array
    chi_square: float
    covariance: Array | None
    converged: bool


def minimum(
    problem: Problem, start: Array, held: dict[int, float] | None = None, errors: bool = False, precision: float = 1e-8
) -> Minimum:
    """The least sum of squares near a start, with some numbers held, to a relative precision."""
    held = held or {}
    parameters = lmfit.Parameters()
    for k, (low, high) in enumerate(problem.bounds):
        room = 1e-3 * (high - low) if math.isfinite(high - low) else 0.0  # at a bound no step has an effect
        value = held[k] if k in held else min(max(start[k], low + room), high - room)
        parameters.add(f"p{k}", value=value, min=low, max=high, vary=k not in held)

    def numbers(given: Any) -> Array:
        return np.array([one.value for one in given.values()])

    if len(held) == len(parameters):
        x = numbers(parameters)
        return Minimum(x, float(np.sum(problem.residuals(x) ** 2)), None, True)
    how: dict[str, Any] = {"calc_covar": errors, "scale_covar": False, "max_nfev": _EVALUATIONS * (len(parameters) + 1)}
    if problem.by_run:  # steps of the minimizer's own would be lost in the rounding of a run
        moved, precision = [k for k in range(len(parameters)) if k not in held], _RUN_PRECISION
        how["Dfun"] = lambda given: _derivatives(problem, numbers(given), moved)
    found = lmfit.Minimizer(lambda given: problem.residuals(numbers(given)), parameters, **how).leastsq(
        ftol=precision, xtol=precision
    )
    covariance = getattr(found, "covar", None) if errors else None
    return Minimum(numbers(found.params), float(found.chisqr), covariance, bool(found.success))


def with_errors(problem: Problem, start: Array) -> tuple[Problem, Minimum]:
    """The minimum, and the problem with errors of the curves that came without: the scatter around it."""
    for _ in range(_ROUNDS if problem.estimated.any() else 1):
        best = minimum(problem, start, errors=True)
        start, off = best.x, problem.values - problem.predicted(best.x)
        if not problem.estimated.any():
            break
        sigma, share = problem.sigma.copy(), problem.freedom / len(problem.values)
        for number in np.unique(problem.curve[problem.estimated]):
            here = problem.curve == number
            scatter = math.sqrt(float(np.sum(off[here] ** 2)) / (share * here.sum()))
            sigma[here] = max(scatter, 1e-9 * float(np.abs(problem.values[here]).max()))
        problem = replace(problem, sigma=sigma)
    return problem, best


def idle(problem: Problem) -> list[str]:
    """Free keys that have no effect on the curves."""
    sizes = np.sqrt(np.sum(_derivatives(problem, problem.start, range(len(problem.free))) ** 2, axis=0))
    least = _NO_EFFECT * math.sqrt(len(problem.values))
    return [one.key for one, size in zip(problem.free, sizes, strict=True) if size < least]


def entangled(problem: Problem) -> list[list[str]]:
    """Sets of free keys that the curves depend on only together, as on their product."""
    count, spaces = len(problem.free), []
    for share in (0.05, 0.16):  # off the bounds, and what holds at two places is no accident of one
        inside = [x + share * (0.5 * (low + high) - x) if math.isfinite(high - low) else x
                  for x, (low, high) in zip(problem.start, problem.bounds, strict=True)]  # fmt: skip
        columns = _derivatives(problem, np.array(inside), range(count))
        _, sizes, rows = np.linalg.svd(columns / np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300))
        nothing = (_RUN_NOTHING if problem.by_run else _NOTHING) * sizes[0]
        spaces.append([rows[k] for k in range(count) if k >= len(sizes) or sizes[k] < nothing])
    if not all(spaces):
        return []
    return [[problem.free[k].key for k in range(count) if abs(row[k]) > 0.1] for row in spaces[0]]


def _derivatives(problem: Problem, x: Array, places: Iterable[int]) -> Array:
    """Derivatives of the residuals over what is free, a column for each place in it."""
    columns, share = [], _RUN_STEP if problem.by_run else _STEP
    for k in places:
        low, high = problem.bounds[k]
        step = share * (1.0 if k >= len(problem.free) else problem.free[k].width)
        up, down = x.copy(), x.copy()
        up[k], down[k] = min(x[k] + step, high), max(x[k] - step, low)
        columns.append((problem.residuals(up) - problem.residuals(down)) / (up[k] - down[k]))
    return np.array(columns).T


class Interval(NamedTuple):
    """Ends of an interval of 95 %, and whether the data or a bound set each."""

    low: float
    high: float
    low_open: bool
    high_open: bool


def interval(problem: Problem, best: Minimum, k: int) -> Interval:
    """Where the sum of squares, least over all else, rises by what one number may cost (profile likelihood)."""
    freedom = problem.freedom
    known = stats.f.ppf(LEVEL, 1, freedom) if problem.estimated.any() else stats.chi2.ppf(LEVEL, 1)
    ends = [_end(problem, best, k, sign, math.sqrt(known)) for sign in (-1.0, 1.0)]
    (low, low_open), (high, high_open) = ends
    return Interval(problem.free[k].outer(low), problem.free[k].outer(high), low_open, high_open)


def _end(problem: Problem, best: Minimum, k: int, sign: float, rise: float) -> tuple[float, bool]:
    """One end of an interval, and whether it is only the bound of the number."""
    assert best.covariance is not None
    bound = problem.bounds[k][0 if sign < 0.0 else 1]
    spread = math.sqrt(best.covariance[k, k])
    along = best.covariance[:, k] / spread  # where the rest goes with this number
    room, near, far, start = abs(bound - best.x[k]), 0.0, rise * spread, best.x
    known = {0.0: -rise}

    def above(distance: float) -> float:
        """Root of what the sum of squares has risen there, over the end's; 0 where it is near enough."""
        nonlocal start
        if distance not in known:
            held = bound if distance == room else best.x[k] + sign * distance
            guess = _nearest(problem, (start, best.x + along * (held - best.x[k]) / spread), k, held)
            found = minimum(problem, guess, {k: held}, precision=_END_SQUARES)
            root, start = math.sqrt(max(found.chi_square - best.chi_square, 0.0)), found.x
            known[distance] = 0.0 if abs(root / rise - 1.0) < _END else root - rise
        return known[distance]

    for _ in range(_MOST):
        far = min(far, room)
        if above(far) >= 0.0:
            near = optimize.brentq(above, near, far, rtol=_END, maxiter=_MOST, disp=False)
            return best.x[k] + sign * near, False
        if far == room:
            return bound, True
        # the root of a parabola is a line
        near, far = far, far * min(1.1 * rise / max(rise + above(far), 1e-300), 3.0)
    return math.nan, True


def _nearest(problem: Problem, starts: Iterable[Array], k: int, held: float) -> Array:
    """The start, within all bounds and with one number held, at which the curves are nearest already.

    Where the data do not bound a number, the straight way to it leads out of all that can be.
    """
    low, high = np.transpose(problem.bounds)
    within = [np.clip(np.where(np.arange(len(low)) == k, held, start), low, high) for start in starts]
    return min(within, key=lambda x: float(np.sum(problem.residuals(x) ** 2)))


def problem_of(
    tables: Sequence[Measured], groups: Sequence[list[Group]], free: Sequence[Free], common: dict[str, float]
) -> Problem:
    """The problem of some tables; ``BadInput`` where they hold fewer numbers than are free."""
    curves = [curve for table in tables for curve in table.curves]
    for name in common:
        if name not in {curve.name for curve in curves}:
            raise BadInput([f"--common {name}: no such curve; measured: {', '.join(curve.name for curve in curves)}"])
    values = np.concatenate([curve.values for curve in curves])
    if len(values) <= len(free):
        said = f"{len(values)} measured number{'s' if len(values) > 1 else ''} cannot tell {len(free)} free"
        raise BadInput([f"{tables[0].path}: {said}; measure more, or free fewer keys"])
    guesses = [np.full(len(c.values), 0.01 * max(float(np.abs(c.values).max()), 1e-300)) for c in curves]
    sigma = [guess if curve.errors is None else curve.errors for curve, guess in zip(curves, guesses, strict=True)]
    unknown = [np.full(len(curve.values), curve.errors is None) for curve in curves]
    number = np.repeat(np.arange(len(curves)), [len(curve.values) for curve in curves])
    zero = np.zeros(len(values))
    kept = np.concatenate(sigma), number, np.concatenate(unknown), zero, zero
    return Problem(tuple(tables), tuple(groups), tuple(free), dict(common), values, *kept, {})
