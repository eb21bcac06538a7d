"""Least squares of measured curves: the minimum, its derivatives, and intervals of what is fitted.

A number above zero without an upper bound is fitted in its logarithm. The sum of squares is over errors; a relative
error that curves share, or that the readings of the mount share, is one more number, known to be 0 within its size.
"""

import contextlib
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, stats
from scipy.stats import qmc

from sim.ensemble.steady import Values, jump_into_contact
from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.scenario.schema import changed
from sim.study.measurement import COURSES, MOUNT, Measured
from sim.study.prediction import Group, by_runs, by_steady_sliding, groups_of
from sim.units.errors import BadInput
from sim.units.instrument import Reading, Zero
from sim.units.quantity import Quantity

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
#: Residual of the spring, by which an end is found, at a distance of a standard error; the share of the way to its aim
#: that may be left, and the factor by which it is made stiffer if more is left.
_STIFFNESS, _NEAR_AIM, _STIFFER = 10.0, 0.1, 3.0
#: Places of the profile of a zero, and residual at a distance of a standard error of the spring that holds it.
_PROFILED, _HELD = 8, 1e3
#: Rounds in which errors that nobody gave are found.
_ROUNDS = 4
#: Most evaluations of a minimum, for each number and one more.
_EVALUATIONS = 100
#: Spread of a number without information, in large changes of it.
_UNKNOWN = 1e3
#: Places at which the sum of squares is tried before a search: binary logarithm of their number, the range of each set
#: of them over that of the bounds, and the number of the lowest from which a search starts.
_PLACES, _RANGES, _STARTS = 8, (1.0, 0.25), 8
#: The same if each prediction is a run.
_RUN_PLACES, _RUN_RANGES, _RUN_STARTS = 3, (0.1,), 1
#: Bound of an error that all points share, over its size, and the largest one, below 1.
_MOST_COMMON, _LARGEST_COMMON = 5.0, 0.9
#: Places that are tried around a minimum, their distances from it in standard errors, and searches from the lowest.
_AROUND, _DISTANCES, _BEHIND = 128, (1.0, 4.0), 4
#: Lowest places beyond an end of an interval, and at its bound, from which another explanation is searched.
_ELSEWHERE = 2
#: Most factor between the distance of an end and that of a parabola at which no other explanation is searched.
_PARABOLIC = 1.2
#: Relative precision of a minimum, and of the sums of squares among which the lowest is chosen.
_PRECISION, _COARSE = 1e-8, 1e-3
#: Relative precision of places, if that of the sum of squares is not finer.
_FINEST = 1e-6
#: Cosine of the least angle at which a search starts.
_INSIDE = 0.998


class Free(NamedTuple):
    """A number of the scenario that is to be found between two bounds; ``start`` is the scenario's own.

    A number of one ``table`` has its name behind the key, as in ``"bonds.stress (wet)"``.
    """

    key: str
    quantity: Quantity
    start: float
    low: float
    high: float
    table: int = -1

    @property
    def name(self) -> str:
        """Return the key without the table."""
        return self.key.partition(" (")[0]

    @property
    def logarithmic(self) -> bool:
        # the place of a zero has no size
        return self.low > 0.0 and not self.name.startswith("zero.")

    @property
    def width(self) -> float:
        """Change of the number as it is fitted that is a large one: an e-fold, or its range."""
        return 1.0 if self.logarithmic else self.high - self.low

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
    of a variable share, that of the mount included. ``fixed`` and ``theory`` make another mechanism of the scenario.
    With ``by_run`` each prediction is a run of the scenario's own models, as steady sliding does not depend on all that
    is free. A ``spring`` is one more residual, which draws a quantity to a value. ``whitening`` has the places of
    curves with correlated errors, and the root of their correlations, by which residuals become independent.
    """

    tables: Sequence[Measured]
    groups: Sequence[list[Group]]
    free: Sequence[Free]
    common: dict[str, float]
    values: Array
    sigma: Array
    curve: NDArray[np.int64]
    estimated: NDArray[np.bool_]
    shift: Array
    noise: Array
    fixed: Values = field(default_factory=dict)
    theory: str = ""
    by_run: bool = False
    spring: Callable[[Array], float] | None = None
    whitening: tuple[tuple[slice, Array], ...] = ()

    @property
    def is_rough(self) -> bool:
        """Return True if predictions are known to the tolerance of their steps alone."""
        return self.by_run or any(table.has_history for table in self.tables)

    @property
    def start(self) -> Array:
        return np.array(
            [item.inner(item.start) for item in self.free] + [0.0] * len(self.common)
        )

    @property
    def bounds(self) -> list[tuple[float, float]]:
        ends = [(item.inner(item.low), item.inner(item.high)) for item in self.free]
        most = [min(_MOST_COMMON, _LARGEST_COMMON / x) for x in self.common.values()]
        return ends + [(-end, end) for end in most]

    @property
    def widths(self) -> Array:
        """Return the change of each number that is a large one."""
        return np.array([item.width for item in self.free] + [1.0] * len(self.common))

    def numbers(self, x: Array) -> dict[str, float]:
        """Return the values of the free keys and of those that make the mechanism."""
        return {
            item.key: item.outer(float(value))
            for item, value in zip(self.free, x, strict=False)
        } | {**self.fixed}

    def of_table(self, x: Array, table: int) -> dict[str, float]:
        """Return the values of the keys in a table, and of those that make the mechanism."""
        applied = zip(self.free, x, strict=False)
        return {
            item.name: item.outer(float(value))
            for item, value in applied
            if item.table in (-1, table)
        } | {**self.fixed}

    def groups_at(self, x: Array) -> Sequence[list[Group]]:
        """Return the groups with the common error of the mount."""
        errors = zip(self.common.items(), x[len(self.free) :], strict=False)
        of_mount = [size * e for (name, size), e in errors if name not in self.names]
        if not of_mount:
            return self.groups
        scale = 1.0 / (1.0 + of_mount[0])
        return [[item._replace(scale=scale) for item in table] for table in self.groups]

    def steady(self, x: Array, only: str = "") -> Array:
        """Return all curves in steady sliding, or by runs; or one variable at the rows of all curves."""
        if self.by_run:
            return self.sampled(x)[0]
        result, all_groups = [], self.groups_at(x)
        for k, (table, groups) in enumerate(zip(self.tables, all_groups, strict=True)):
            names = [only] * len(table.curves) if only else table.names
            numbers, columns = self.of_table(x, k), np.empty((len(names), table.rows))
            for group in groups:
                values = by_steady_sliding(group, numbers, names, self.theory)
                columns[:, group.rows] = [values[name] for name in names]
            if early := table.baseline:
                zero = changed(groups[0].scenario, numbers).zero or Zero()
                for column, name in zip(columns, names, strict=True):
                    column[:early] = zero.at(name, table.elapsed[:early])
            result.append(columns.ravel())
        return np.concatenate(result)

    def sampled(self, x: Array) -> Array:
        """Return all curves by the scenario's own models and their standard errors, shape (2, numbers)."""
        runs = [
            by_runs(groups, self.of_table(x, k), table.names, "t" in table.conditions)
            for k, (table, groups) in enumerate(
                zip(self.tables, self.groups_at(x), strict=True)
            )
        ]
        return np.concatenate([rows.reshape(2, -1) for rows in runs], axis=1)

    def predicted(self, x: Array) -> Array:
        """All curves, with the shift and the common errors."""
        result = self.steady(x) + self.shift
        for name in self.common:
            shared = self._shared(x, name)
            result = np.where(self.of(name), result * shared, result)
        return result

    def _shared(self, x: Array, name: str) -> float:
        """Return the factor of a common error on all readings of a variable."""
        errors = zip(self.common.items(), x[len(self.free) :], strict=False)
        return math.prod(1.0 + size * e for (key, size), e in errors if key == name)

    @property
    def jumps(self) -> list[tuple[int, Reading]]:
        """Return the table and the reading of each datum of a jump into contact."""
        return [
            (k, jump) for k, table in enumerate(self.tables) for jump in table.jumps
        ]

    def predicted_jumps(self, x: Array) -> Array:
        """Return the readings at the jumps into contact, by the model, the zeros and the common errors.

        The drift of a zero counts from the first row of the stretch, which the jump precedes.
        """
        result, all_groups = [], self.groups_at(x)
        for k, jump in self.jumps:
            first, kind = all_groups[k][0], self.tables[k].mount
            scenario = changed(first.scenario, self.of_table(x, k))
            zero = scenario.zero or Zero()
            displacement, load = jump_into_contact(scenario)
            if jump.name == "displacement":
                result.append(displacement / first.scale + zero.at(kind, 0.0))
            else:
                load += zero.at(jump.name, 0.0)
                result.append(load * self._shared(x, jump.name))
        return np.array(result)

    def between(
        self, x: Array, table: int, name: str, along: tuple[str, NDArray[np.int64]]
    ) -> tuple[Array, Array]:
        """Return places between sorted rows that differ in one condition alone, and their curve in steady sliding.

        ``along`` are the condition, a time, speed or mount, and the rows.
        """
        (key, rows), measured = along, self.tables[table]
        here = self.groups_at(x)[table]
        group = next(item for item in here if rows[0] in item.rows)
        known = {
            each: measured.conditions[each][rows]
            for each in COURSES
            if each in measured.conditions
        }
        first, last = known[key][[0, -1]]
        spaced = np.geomspace if first > 0.0 else np.linspace
        fine = spaced(first, last, _DRAWN)
        between = {each: np.interp(fine, known[key], known[each]) for each in known}
        curve = measured.curves[0]._replace(values=fine)
        points = measured._replace(conditions=between, curves=(curve,))
        (course,) = groups_of(group.scenario, points)
        course = course._replace(scale=group.scale)
        values = self.of_table(x, table)
        return fine, by_steady_sliding(course, values, [name], self.theory)[name]

    @property
    def curves(self) -> list[tuple[int, str]]:
        """Return the table and the variable of each curve."""
        return [
            (k, name) for k, table in enumerate(self.tables) for name in table.names
        ]

    @property
    def names(self) -> list[str]:
        """Return the names of all curves."""
        return [name for _, name in self.curves]

    def of(self, name: str) -> NDArray[np.bool_]:
        """Return True at the numbers of a variable."""
        return np.array(self.names)[self.curve] == name

    def place(self, number: int) -> str:
        """Return the variable and the row of one of all numbers, and its table if there are several, for people."""
        table, name = self.curves[self.curve[number]]
        row = number - int(np.argmax(self.curve == self.curve[number])) + 1
        stem = f"{self.tables[table].stem}, " * (len(self.tables) > 1)
        return f"{stem}{name}: row {row}"

    def residuals(self, x: Array) -> Array:
        """Deviations over errors, those of the jumps into contact, and the common errors over their sizes."""
        off = (self.values - self.predicted(x)) / np.hypot(self.sigma, self.noise)
        off = np.nan_to_num(off, nan=_OPEN, posinf=_OPEN, neginf=-_OPEN)
        for rows, root in self.whitening:
            off[rows] = linalg.solve_triangular(root, off[rows], lower=True)
        drawn = [] if self.spring is None else [self.spring(x)]
        return np.concatenate([off, self.off_jumps(x), x[len(self.free) :], drawn])

    @functools.cached_property
    def tried(self) -> Array:
        """Return the places of ``spread``, the one with the lowest sum of squares first."""
        places = spread(self)
        return places[
            np.argsort([_sum(self, place) for place in places], kind="stable")
        ]

    def off_jumps(self, x: Array) -> Array:
        """Return the deviations of the jumps into contact over their errors."""
        read = np.array([(jump.value, jump.error) for _, jump in self.jumps])
        values, errors = read.reshape(-1, 2).T
        return np.asarray((values - self.predicted_jumps(x)) / errors)

    @property
    def data(self) -> int:
        """Number of measured numbers, of the curves and of the jumps into contact."""
        return len(self.values) + len(self.jumps)

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return self.data - len(self.free)

    def criterion(self, chi_square: float) -> float:
        """Akaike's criterion for few points, AICc."""
        count = len(self.free) + len({*self.curve[self.estimated].tolist()})
        left = self.data - count - 1
        if left <= 0:
            return math.inf
        size = chi_square + 2.0 * float(np.sum(np.log(self.sigma[self.estimated])))
        return size + 2.0 * count * (1.0 + (count + 1) / left)

    def compared(self, x: Array) -> "Problem":
        """Return this problem with the shift from steady sliding at x to the scenario's own models there."""
        mean, noise = self.sampled(x)
        for number in np.flatnonzero(~np.isfinite(mean)):
            raise BadInput(
                [
                    f"{self.place(int(number))} has no value in a run of the fit: is the contact open there?"
                ]
            )
        return replace(self, shift=mean - self.steady(x), noise=noise)


class Minimum(NamedTuple):
    """A minimum of the sum of squares; ``converged`` if the search ended there.

    ``covariance`` is that of what is free. It is nan after a coarse search, because only the sums of squares of several
    coarse searches are compared.
    """

    x: Array
    chi_square: float
    covariance: Array
    converged: bool


def minimum(problem: Problem, start: Array, precision: float = _PRECISION) -> Minimum:
    """Return the least sum of squares near a start, to a relative precision, and the covariance if it is the finest.

    The search is that of Levenberg and Marquardt (MINPACK) for angles, whose cosines are the places between the bounds.
    An angle of 0 in the middle would make the first steps zero, because they are relative to the angles.
    """
    if not len(start):
        chi_square = float(np.sum(problem.residuals(start) ** 2))
        return Minimum(start, chi_square, np.empty((0, 0)), True)
    is_fine = precision <= _PRECISION
    precision = max(precision, _RUN_PRECISION) if problem.is_rough else precision
    low, high = np.transpose(problem.bounds)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def place(angles: Array) -> Array:
        return middle - half * np.cos(angles)

    result = optimize.least_squares(
        lambda angles: problem.residuals(place(angles)),
        # at a bound no step has an effect
        np.arccos(np.clip((middle - start) / half, -_INSIDE, _INSIDE)),
        method="lm",
        x_scale="jac",
        # a run is known to the tolerance of its steps alone
        diff_step=_RUN_STEP if problem.is_rough else None,
        ftol=precision,
        xtol=min(precision, _FINEST),
        max_nfev=_EVALUATIONS * (len(start) + 1),
    )
    x = place(result.x)
    unknown = np.full((len(x), len(x)), np.nan)
    covariance = covariance_at(problem, x) if is_fine else unknown
    return Minimum(x, 2.0 * result.cost, covariance, result.status > 0)


def covariance_at(problem: Problem, x: Array) -> Array:
    """Return the covariance of what is free at a place, finite for numbers without information, too."""
    slopes = derivatives(problem, x)
    unknown = np.diag((_UNKNOWN * problem.widths) ** -2.0)
    return np.asarray(np.linalg.inv(slopes.T @ slopes + unknown), float)


def lowest(problem: Problem) -> Minimum:
    """Return the lowest of the minima near the scenario's own values and near the lowest of many other places.

    The places fill the bounds evenly, and again a part of them around the scenario's own values. The curves have kinks
    where a contact is masked or opens, so a single search may end beside the minimum.
    """
    count = _RUN_STARTS if problem.by_run else _STARTS
    minima = [minimum(problem, problem.start, _COARSE)]
    for place in problem.tried[:count]:
        with contextlib.suppress(BadInput):
            minima.append(minimum(problem, place, _COARSE))
    best = minimum(problem, min(minima, key=lambda item: item.chi_square).x)
    if problem.by_run or not len(best.x):
        return best
    for _ in range(_ROUNDS):
        minima = [minimum(problem, place, _COARSE) for place in _beside(problem, best)]
        beside = minimum(problem, min(minima, key=lambda item: item.chi_square).x)
        if not beside.chi_square < best.chi_square:
            break
        best = beside
    return best


def _beside(problem: Problem, best: Minimum) -> Array:
    """Return places around a minimum at which the sum of squares is lowest compared with a parabola.

    They lie behind kinks, where another number of contacts is masked or open.
    """
    steps = np.random.default_rng(0).standard_normal((_AROUND, len(best.x)))
    distances = np.linspace(*_DISTANCES, _AROUND)
    steps *= (distances / np.linalg.norm(steps, axis=1))[:, np.newaxis]
    places = best.x + steps @ np.linalg.cholesky(best.covariance).T
    places = np.clip(places, *np.transpose(problem.bounds))
    sums = np.array([_sum(problem, place) for place in places])
    return places[np.argsort(sums - distances**2)[:_BEHIND]]


def _sum(problem: Problem, place: Array) -> float:
    """Return the sum of squares at a place; infinity if a run refuses its values, far from those of the scenario."""
    with contextlib.suppress(BadInput):
        return float(np.sum(problem.residuals(place) ** 2))
    return math.inf


def spread(problem: Problem) -> Array:
    """Return places that fill the bounds of a problem evenly, and a part of the bounds around the start."""
    if not len(problem.start):
        return np.empty((0, 0))
    low, high = np.transpose(problem.bounds)
    count = _RUN_PLACES if problem.by_run else _PLACES
    ranges = _RUN_RANGES if problem.by_run else _RANGES
    # scipy has the name rng since 1.15 only
    sobol = qmc.Sobol(len(low), seed=np.random.default_rng(0))
    off = qmc.scale(sobol.random_base2(count), low, high) - problem.start
    return np.concatenate([problem.start + part * off for part in ranges])


def with_errors(
    problem: Problem, start: Array | None = None
) -> tuple[Problem, Minimum]:
    """Return the minimum near a start, or the lowest, and the problem with errors of the curves that came without.

    Such an error is the scatter around the fit.
    """
    for _ in range(_ROUNDS):
        best = lowest(problem) if start is None else minimum(problem, start)
        start, off = best.x, problem.values - problem.predicted(best.x)
        if not problem.estimated.any():
            break
        sigma, share = problem.sigma.copy(), problem.freedom / problem.data
        for number in np.unique(problem.curve[problem.estimated]):
            here = problem.curve == number
            scatter = math.sqrt(float(np.sum(off[here] ** 2)) / (share * here.sum()))
            sigma[here] = max(scatter, 1e-9 * float(np.abs(problem.values[here]).max()))
        problem = replace(problem, sigma=sigma)
    return problem, best


def idle(problem: Problem) -> list[str]:
    """Free keys that have no effect on the curves."""
    if not problem.free:  # as of a mechanism that has none of the keys
        return []
    sizes = np.sqrt(
        np.sum(derivatives(problem, problem.start)[:, : len(problem.free)] ** 2, axis=0)
    )
    least = _NO_EFFECT * math.sqrt(len(problem.values))
    return [
        item.key for item, size in zip(problem.free, sizes, strict=True) if size < least
    ]


def entangled(problem: Problem) -> list[list[str]]:
    """Return sets of free keys that the curves depend on only together, as on their product."""
    start, count = problem.start, len(problem.free)
    middle = np.mean(problem.bounds, axis=1)
    for share in (0.05, 0.16):  # what holds at two places is no accident of one
        columns = derivatives(problem, start + share * (middle - start))[:, :count]
        norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        _, sizes, rows = np.linalg.svd(columns / norms)
        nothing = (_RUN_NOTHING if problem.by_run else _NOTHING) * sizes[0]
        if not np.any(sizes < nothing):
            return []
    return [
        [
            item.key
            for item, part in zip(problem.free, row, strict=True)
            if abs(part) > 0.1
        ]
        for row in rows[sizes < nothing]
    ]


def refuse_undetermined(problem: Problem) -> None:
    """Raise ``BadInput`` if curves do not depend on a free key, or on some only together."""
    faults, split = [], any(item.table >= 0 for item in problem.free)
    for name, _, table in (key.partition(" (") for key in idle(problem)):
        option, place = (
            ("--per-table", f" in {table[:-1]}") if table else ("--free", "")
        )
        faults.append(
            f"{option} {name}: has no effect on what was measured{place}; fix it"
        )
    for keys in [] if faults else entangled(problem):
        options = "--free" + " and --per-table" * split
        faults.append(
            f"{options} {', '.join(keys)}: the curves depend on them only together; free one of them"
        )
    if faults:
        raise BadInput(faults)


def derivatives(problem: Problem, x: Array) -> Array:
    """Return the derivatives of the residuals over what is free, a column for each."""
    columns = []
    steps = (_RUN_STEP if problem.is_rough else _STEP) * problem.widths
    for k, ((low, high), step) in enumerate(zip(problem.bounds, steps, strict=True)):
        up, down = x.copy(), x.copy()
        up[k], down[k] = min(x[k] + step, high), max(x[k] - step, low)
        columns.append(
            (problem.residuals(up) - problem.residuals(down)) / (up[k] - down[k])
        )
    return np.array(columns).T


class Interval(NamedTuple):
    """Ends of an interval of 95 %, and whether the data or a bound set each."""

    low: float
    high: float
    low_open: bool
    high_open: bool


def interval(
    problem: Problem,
    best: Minimum,
    k: int,
) -> Interval:
    """Return the 95 % interval of a free number."""
    return profile(problem, best, problem.free[k], np.eye(len(best.x))[k])


def profile(
    problem: Problem,
    best: Minimum,
    item: Free,
    weights: Array,
) -> Interval:
    """Return the interval in which the sum of squares, least over all else, stays below its bound (profile likelihood).

    If values beyond an end are not rejected either, because another explanation of the data holds there, the interval
    reaches to the last of them. Such values are searched if the sum of squares is no parabola up to the end, except if
    each prediction is a run or follows a history, because that would take too long.

    Parameters
    ----------
    problem, best : Problem, Minimum
        The fit.
    item : Free
        The quantity, with its bounds.
    weights : array
        Weights of all that is free, as it is fitted, in the quantity, as it is fitted.
    """
    rise = math.sqrt(
        stats.f.ppf(LEVEL, 1, problem.freedom)
        if problem.estimated.any()
        else stats.chi2.ppf(LEVEL, 1)
    )
    (low, low_open), (high, high_open) = (
        _end(problem, best, weights, item.inner(bound), rise)
        for bound in (item.low, item.high)
    )
    return Interval(item.outer(low), item.outer(high), low_open, high_open)


class ZeroProfile(NamedTuple):
    """The least sum of squares over a zero of the instrument, and what each zero makes of the other numbers.

    Attributes
    ----------
    key : str
        Key of the zero.
    values, chi_squares : array, shape (places,)
        Zeros [SI] and the least sum of squares at each.
    numbers : array, shape (places, keys)
        Values of all free keys there [SI].
    """

    key: str
    values: Array
    chi_squares: Array
    numbers: Array


def zero_profile(
    problem: Problem, best: Minimum, k: int, span: Interval
) -> ZeroProfile:
    """Return the profile of a free zero over its interval and half of its width beyond, and at its start.

    Parameters
    ----------
    problem, best : Problem, Minimum
        The fit.
    k : int
        Place of the zero among the free numbers.
    span : Interval
        Its interval.
    """
    item, width = problem.free[k], span.high - span.low
    places = np.linspace(span.low - 0.5 * width, span.high + 0.5 * width, _PROFILED)
    places = np.clip([*places, float(best.x[k]), item.start], item.low, item.high)
    places, result = np.unique(places), dict[float, tuple[float, Array]]()
    middle = int(np.argmin(np.abs(places - best.x[k])))
    stiffness = _HELD / min(math.sqrt(best.covariance[k, k]), item.width)
    # from the minimum outwards, each search from the place before
    for order in (range(middle, len(places)), range(middle, -1, -1)):
        start = best.x.copy()
        for place in order:
            target = float(places[place])
            start[k] = target

            def spring(x: Array, target: float = target) -> float:
                return stiffness * (float(x[k]) - target)

            held = minimum(replace(problem, spring=spring), start)
            start = held.x.copy()
            result[target] = held.chi_square - spring(held.x) ** 2, start.copy()
    sums, ends = zip(*(result[float(place)] for place in places), strict=True)
    numbers = [
        [each.outer(float(x)) for each, x in zip(problem.free, end, strict=False)]
        for end in ends
    ]
    table = np.array(numbers)
    table[:, k] = places  # to which a spring has drawn it but for rounding
    return ZeroProfile(item.key, places, np.array(sums), table)


def _end(
    problem: Problem,
    best: Minimum,
    weights: Array,
    bound: float,
    rise: float,
) -> tuple[float, bool]:
    """Return the end of an interval on the side of a bound, and True if the bound itself is the end."""
    value, start = float(weights @ best.x), best.x
    spread = math.sqrt(weights @ best.covariance @ weights)
    if abs(bound - value) <= _END * spread:
        return bound, True
    for _ in range(_MOST):
        start, is_open = _walk(problem, best, weights, bound, rise, start)
        if is_open:
            return bound, True
        end = float(weights @ start)
        precision = _END * abs(end - value)
        if abs(bound - end) < precision:
            return bound, True
        # a sum of squares that is a parabola has one minimum
        of_parabola = abs(end - value) / (rise * spread)
        if problem.is_rough or 1.0 / _PARABOLIC < of_parabola < _PARABOLIC:
            break
        beyond = _beyond(problem, weights, bound, end, spread)
        further = (float(weights @ beyond.x) - end) * math.copysign(1.0, bound - value)
        is_rejected = beyond.chi_square >= best.chi_square + rise**2
        if is_rejected or further < precision:
            break
        start = beyond.x
    return end, False


def _beyond(
    problem: Problem,
    weights: Array,
    bound: float,
    end: float,
    spread: float,
) -> Minimum:
    """Return the least of the minima between an end of an interval and a bound, searched from the lowest places there.

    A spring that acts on the wrong side of the end alone keeps the searches beyond it. It is stiff over the standard
    error of the quantity, the ``spread``.
    """
    places, side = problem.tried, math.copysign(1.0, bound - end)
    values = places @ weights
    beyond = places[side * (values - end) > 0.0][:_ELSEWHERE]
    # of all other numbers those of the lowest places, at the bound
    off = (bound - values[:_ELSEWHERE]) / (weights @ weights)
    moved = places[:_ELSEWHERE] + off[:, np.newaxis] * weights
    moved = np.clip(moved, *np.transpose(problem.bounds))
    stiffness = _HELD / min(spread, abs(bound - end))

    def spring(x: Array) -> float:
        return stiffness * min(side * (float(weights @ x) - end), 0.0)

    kept = replace(problem, spring=spring)
    minima = [minimum(kept, place, _COARSE) for place in (*beyond, *moved)]
    return min(minima, key=lambda item: item.chi_square)


def _walk(
    problem: Problem,
    best: Minimum,
    weights: Array,
    bound: float,
    rise: float,
    start: Array,
) -> tuple[Array, bool]:
    """Return the place, from a start towards a bound, at which the sum of squares has risen; True if it does nowhere.

    A spring draws the quantity to an aim while all else is fitted. The sum of squares without the spring is then the
    least one for the value that the quantity has there, so that the stiffness of the spring does not matter.
    """
    value = float(weights @ best.x)
    room = abs(bound - value)
    variance = float(weights @ best.covariance @ weights)
    spread = min(math.sqrt(variance), room)
    side, near = math.copysign(1.0, bound - value), abs(float(weights @ start) - value)
    stiffness, along = _STIFFNESS / spread, weights / (weights @ weights)

    @functools.cache
    def above(distance: float) -> float:
        """Return the root of the rise of the sum of squares beyond that of the end; 0 where it is near enough."""
        nonlocal start, stiffness
        root, step = 0.0, side * distance
        for _ in range(_MOST if distance else 0):

            def spring(x: Array, stiffness: float = stiffness) -> float:
                return stiffness * (float(weights @ x) - value - step)

            drawn = replace(problem, spring=spring)
            result = minimum(drawn, start, precision=_END_SQUARES)
            if result.chi_square - best.chi_square >= rise**2:
                # a search that the spring draws may stop on its way; another one begins at the aim
                moved = start + (value + step - float(weights @ start)) * along
                moved = np.clip(moved, *np.transpose(problem.bounds))
                other = minimum(drawn, moved, precision=_END_SQUARES)
                result = min(result, other, key=lambda item: item.chi_square)
            start = result.x
            off = spring(start)
            root = math.sqrt(max(result.chi_square - off**2 - best.chi_square, 0.0))
            if root >= rise or abs(off) < _NEAR_AIM * stiffness * distance:
                break
            stiffness *= _STIFFER
        return 0.0 if abs(root / rise - 1.0) < _END else root - rise

    if near and above(near) >= 0.0:
        return start, False
    far = min(near + rise * spread, room)
    for _ in range(_MOST):
        if (excess := above(far)) >= 0.0:
            if excess > 0.0:
                optimize.brentq(above, near, far, rtol=_END, maxiter=_MOST, disp=False)
            return start, False
        if far == room:
            break
        # the root of a parabola is a line
        further = far * min(1.1 * rise / max(rise + excess, 1e-300), 3.0)
        near, far = far, min(further, room)
    return start, True


def problem_of(
    scenario: Scenario,
    tables: Sequence[Measured],
    free: list[Free],
    common: dict[str, float],
) -> Problem:
    """Return the problem of some tables; ``BadInput`` if they hold fewer numbers than are free."""
    curves = [curve for table in tables for curve in table.curves]
    names = [curve.name for curve in curves]
    has_mount = all("mount" in table.conditions for table in tables)
    known = [*dict.fromkeys(names), *[MOUNT[scenario.contact.kind][0]] * has_mount]
    for name in common.keys() - {*known}:
        raise BadInput([f"--common {name}: no such column; known: {', '.join(known)}"])
    values = np.concatenate([curve.values for curve in curves])
    if len(values) <= len(free):
        cure = "measure more, or free fewer keys"
        raise BadInput(
            [
                f"{tables[0].path}: measured numbers: {len(values)}, free keys: {len(free)}; {cure}"
            ]
        )
    number = np.repeat(np.arange(len(curves)), [len(curve.values) for curve in curves])
    sigma, unknown = list[Array](), list[bool]()
    roots = list[tuple[slice, Array]]()
    for table in tables:
        for c in table.curves:
            noise = table.noise.get(c.name) if c.errors is None else None
            size = noise.sigma if noise else 0.01 * np.abs(c.values).max()
            if noise:
                first = sum(map(len, sigma))
                law = noise.correlation(table.conditions["t"])
                root = np.asarray(np.linalg.cholesky(law), float)
                roots.append((slice(first, first + table.rows), root))
            sigma.append(np.full_like(c.values, size) if c.errors is None else c.errors)
            unknown.append(c.errors is None and not noise)
    return Problem(
        tables=tables,
        groups=[groups_of(scenario, table) for table in tables],
        free=free,
        common=common,
        values=values,
        sigma=np.concatenate(sigma),
        curve=number,
        estimated=np.array(unknown)[number],
        whitening=tuple(roots),
        shift=np.zeros(len(values)),
        noise=np.zeros(len(values)),
    )
