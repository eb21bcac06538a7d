"""Numbers of a scenario calibrated to measured curves: ``sim fit``.

The curves are fitted by steady sliding, which is quick (``sim.study.prediction``). Then the models of the scenario run
once with the fitted values. Their difference from steady sliding is added as a correction, with the error of their
members. The fit is repeated until it no longer changes. The same noise is drawn each time. Every prediction is a run in
two cases. Steady sliding may not depend on a free key, such as the speed of an edge that lags. Or the drive may solve
the motion of the slider.
"""

import difflib
import html
import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import stats

from sim.numerics import files
from sim.parts.exchange import Array
from sim.plots import style
from sim.plots.style import BOTH, HOLLOW, Unit
from sim.quantities import QUANTITIES
from sim.scenario.files import parse, written
from sim.scenario.reader import override
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read, quantities
from sim.study import likelihood, measurement
from sim.study.converge import Printed
from sim.study.likelihood import (
    LEVEL,
    Free,
    Interval,
    Minimum,
    Problem,
    ZeroProfile,
    idle,
    with_errors,
)
from sim.study.measurement import MOUNT, Measured
from sim.study.mechanisms import WHOLE, Verdict, compare
from sim.units.errors import BadInput
from sim.units.notation import chance, concise, engineering, in_units, scaled
from sim.units.quantity import Quantity, read_option

#: Names of the documentation; the others serve the commands.
__all__ = ["Estimate", "Fit", "NoDifference", "fit"]

#: Factor by which a number that is fitted in its logarithm may change at most, where no bounds are given.
_WIDE = 1e4
#: Change of another number without bounds at most, over its size.
_AROUND = 10.0
#: Most runs of the scenario's own models, and the change of every number, over its error, that ends them.
_RUNS, _STAYS = 3, 0.1
#: Correlation beyond which the data hardly separate two keys.
_ALIKE = 0.95
#: Most rows of a kind that are named.
_MOST_ROWS = 3
#: Probability of a chi^2 as large, or of as few runs of one sign, below which errors are doubted.
POOR = 0.05
#: Ratio of measured and fitted values beyond which a unit is asked for.
_OTHER_UNIT = 100.0
#: Residual beyond which the best curve does not reach a point.
_FAR = 3.0
#: Tables of keys that are not physical.
_OTHER = ("clock", "record", "ensemble", "seed", "instrument", "jump_in")
#: Rises of chi^2 in the figure of a profile, over that at the ends of an interval.
_SHOWN = 10.0
#: Half width of an interval over the value, beyond which the data hardly fix a value.
_TENTH = 0.1


class Estimate(NamedTuple):
    """Estimate of one free number [SI].

    Attributes
    ----------
    free : Free
        Its ``key``, declaration, start and bounds.
    value, error : float
        Value and standard error.
    interval : Interval
        Ends ``low`` and ``high`` of the 95 % interval; ``low_open``, ``high_open`` are True if a bound set the end.
    """

    free: Free
    value: float
    error: float
    interval: Interval

    @property
    def texts(self) -> tuple[str, str, str]:
        """Return the value with its standard error, the interval, and their unit as text.

        A value has no standard error if the data do not set its interval on both sides.
        """
        low, high, low_open, high_open = self.interval
        factor, unit = scaled(
            high if low_open and not high_open else self.value, self.free.quantity.unit
        )
        is_open = low_open or high_open
        value = concise(factor * self.value, 0.0 if is_open else factor * self.error)
        ends = f"{factor * low:.4g}", f"{factor * high:.4g}"
        if low_open and high_open:
            return value, "not set", unit
        if is_open:
            return value, f"below {ends[1]}" if low_open else f"above {ends[0]}", unit
        return value, " to ".join(ends), unit


class NoDifference(NamedTuple):
    """Test of one value of a key in all tables.

    Attributes
    ----------
    p_value : float
        Probability of a likelihood ratio as large or larger if the tables had one value.
    chi_square : float
        Rise of the chi^2 by the single value.
    freedom : int
        Degrees of freedom: tables without the first.
    is_limit : bool
        True if a bound sets the end of any interval. The probability is then an upper limit, because values at a bound
        differ less by chance.
    """

    p_value: float
    chi_square: float
    freedom: int
    is_limit: bool

    def __str__(self) -> str:
        return "at most " * self.is_limit + f"{self.p_value:.2g}"


class Fit(NamedTuple):
    """A calibrated scenario. Its text and its table in a notebook have all numbers with their intervals.

    Attributes
    ----------
    values, errors, intervals : dict
        Value, standard error, and both ends of the 95 % interval of each free key [SI].
    scenario : Scenario
        The scenario with the numbers found, and with those of the first table if tables have their own.
    problem : Problem
        The curves with their errors: ``values``, ``sigma``, ``freedom``, ``predicted``.
    best : Minimum
        Place of the best fit and its ``chi_square``.
    numbers : tuple of Estimate
        Each free number with ``value``, ``error`` and ``interval``.
    correlations : array
        Correlations of the free numbers.
    converged : bool
        True if the search has ended at a minimum.
    remarks : tuple of str
        Conditions on the numbers, a sentence each.
    differences : tuple of Estimate
        Ratios of the values per table to those of the first, or differences if a number is not above zero.
    no_difference : dict of str to NoDifference
        For each key with a value per table the test that all tables have one value.
    profiles : tuple of ZeroProfile
        For each free zero of the instrument the least chi^2 over it, with the other values there.
    """

    scenario: Scenario
    problem: Problem
    best: Minimum
    numbers: tuple[Estimate, ...]
    correlations: Array
    converged: bool
    remarks: tuple[str, ...]
    differences: tuple[Estimate, ...] = ()
    no_difference: Mapping[str, NoDifference] = MappingProxyType({})
    profiles: tuple[ZeroProfile, ...] = ()

    def __repr__(self) -> str:
        lines = [f"key = value(standard error), {LEVEL:.0%} interval"]
        for item in (*self.numbers, *self.differences):
            value, interval, unit = item.texts
            lines.append(f"{item.free.key} = {value}, {interval} {unit}".rstrip())
        for key, test in self.no_difference.items():
            lines.append(f"{key}: p of no difference {test}")
        attributes = "in SI: .values, .errors, .intervals"
        return "\n".join([*lines, _quality(self), attributes])

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        tables = [rows for rows in (_table(self), _differences(self)) if rows]
        texts = map(html.escape, (_quality(self), *self.remarks))
        return "".join(
            [
                *(DataFrame(rows).to_html(index=False) for rows in tables),
                *(f"<p>{text}</p>" for text in texts),
            ]
        )

    @property
    def aicc(self) -> float:
        """Akaike's criterion for few points."""
        return self.problem.criterion(self.best.chi_square)

    @property
    def p_value(self) -> float:
        """Probability of a chi^2 as large or larger; nan if the errors were not measured."""
        problem = self.problem
        if problem.freedom <= 0 or problem.estimated.any():
            return math.nan
        return float(stats.chi2.sf(self.best.chi_square, problem.freedom))

    @property
    def values(self) -> dict[str, float]:
        """Values of the free keys [SI]; a key with a value per table has the name of the table behind it."""
        return {item.free.key: item.value for item in self.numbers}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the free keys [SI]."""
        return {item.free.key: item.error for item in self.numbers}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Ends of the 95 % intervals of the free keys [SI]; ``numbers`` tell if a bound sets an end."""
        return {item.free.key: item.interval[:2] for item in self.numbers}

    def of_table(self, place: int) -> dict[str, float]:
        """Return the values of the keys in a table [SI], and its conditions but the speed that all rows share."""
        table = self.problem.tables[place]
        held = {
            f"contact.{table.mount}" if key == "mount" else key: x
            for key, x in table.conditions.items()
        }
        stated = {
            key: float(x[0])
            for key, x in held.items()
            if key not in ("t", "speed", "tangential_force") and not np.ptp(x)
        }
        return stated | {
            item.free.name: item.value
            for item in self.numbers
            if item.free.table in (-1, place)
        }

    @property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenario of each table by its name, with its values and with the conditions of all its rows."""
        return {
            table.stem: self.scenario.with_values(self.of_table(k))
            for k, table in enumerate(self.problem.tables)
        }


def fit(
    scenario: Scenario,
    data: Sequence[Path | measurement.Measured],
    free: Iterable[str],
    common: dict[str, float] | None = None,
    steady: bool = False,
    per_table: Iterable[str] = (),
    errors: Sequence[str] = (),
) -> Fit:
    """Find numbers of a scenario from measured curves.

    Parameters
    ----------
    scenario : Scenario
        The search starts at its values; its sweep is left out.
    data : sequence of Path
        CSV tables (``sim.study.measurement.read``), or what was read of them, all fitted together.
    free : iterable of str
        Keys, each ``"KEY"`` or ``"KEY=LOW:HIGH"`` with bounds such as ``"1 mm/s:100 mm/s"``.
    common : dict, optional
        Relative errors that all points of a variable share, as of one lens or one camera. That of the mount, such as
        ``"normal_load"``, is the error of the spring constant behind all loads.
    steady : bool
        True if steady sliding is enough, so that the scenario's own models are not run.
    per_table : iterable of str
        Keys that have a value in each table, as those of ``free``.
    errors : sequence of str
        Standard errors of curves that come without, as ``"2 %"`` of each value, as ``"0.1 mN"``, or of one variable,
        ``"contact_area=2 %"``.

    Raises
    ------
    BadInput
        If a key cannot be fitted, a table cannot be read, or the curves depend on some keys only together.
    """
    free, per_table = list(free), list(per_table)
    scenario = with_zero(scenario, [*free, *per_table])
    base = scenario.with_values({"record": {}})
    shared = [free_number(base, text) for text in free]
    split = [free_number(base, text, "--per-table") for text in per_table]
    tables = [
        measurement.read(path, base, place=(k, len(data)))
        if isinstance(path, Path)
        else path
        for k, path in enumerate(data)
    ]
    if not any(item.key.startswith("zero.load") for item in (*shared, *split)):
        # a baseline tells the zero of the load alone
        tables = [table.in_contact if table.baseline else table for table in tables]
    tables = measurement.with_stated_errors(tables, errors)
    if faults := [*conflicts(base, shared, split, tables)]:
        raise BadInput(faults)
    places = itertools.product(split, enumerate(tables))
    split = [
        item._replace(key=f"{item.key} ({table.stem})", table=k)
        for item, (k, table) in places
    ]
    problem = likelihood.problem_of(base, tables, shared + split, common or {})
    if steady and base.drive.solves_motion:
        raise BadInput(
            [f'--steady: drive.model = "{base.drive.model}" needs runs; omit --steady']
        )
    if any(table.has_history for table in tables):
        # the slider is at rest, so that the history is all that its run has
        steady = True
    elif base.drive.solves_motion or (not steady and idle(problem)):
        problem = replace(problem, by_run=True).compared(problem.start)
    likelihood.refuse_undetermined(problem)
    problem, best = with_errors(problem)
    is_pulled = any("tangential_force" in table.conditions for table in tables)
    steady, first = steady or problem.by_run or is_pulled, best
    converged = steady and best.converged
    for _ in range(0 if steady else _RUNS):
        before = best.x
        problem, best = with_errors(problem.compared(best.x), best.x)
        if np.all(np.abs(best.x - before) < _STAYS * np.sqrt(np.diag(best.covariance))):
            converged = first.converged and best.converged
            break
    return _assembled(scenario, problem, best, converged)


def with_zero(scenario: Scenario, texts: Sequence[str]) -> Scenario:
    """Return a scenario with the table of the instrument's zeros if any of the keys to free is one of them."""
    needed = scenario.zero is None and any(text.startswith("zero.") for text in texts)
    return scenario.with_values({"zero": {}}) if needed else scenario


def conflicts(
    scenario: Scenario,
    shared: list[Free],
    split: list[Free],
    tables: Sequence[Measured],
) -> Iterator[str]:
    """Yield the faults of free keys and tables that do not go together."""
    keys = [item.key for item in (*shared, *split)]
    names = [table.stem.lower() for table in tables]
    for key in {key: None for key in keys if keys.count(key) > 1}:
        yield f"--free{' or --per-table' * bool(split)}: {key} is there twice; give each key once"
    if not keys:
        yield "no key is free; give --free KEY, or --per-table KEY for a value in each table"
    if split and len(tables) < 2:
        yield f"--per-table {split[0].key}: there is one table only, {names[0]}; add tables, or use --free"
    for name in {name: None for name in names if split and names.count(name) > 1}:
        yield f'--per-table: several tables have the name "{name}"; rename their files, because files name the tables'
    conditions = {"mount": f"contact.{scenario.contact.kind}", "speed": "drive.speed"}
    for table, key in itertools.product(tables, keys):
        if key in [conditions.get(name, name) for name in table.conditions]:
            yield f"{table.path}: has values of {key}, which is free; omit them, or do not free this key"


def _assembled(
    scenario: Scenario, problem: Problem, best: Minimum, converged: bool
) -> Fit:
    """Return the fit with its intervals and remarks."""
    count, places = len(problem.free), np.eye(len(best.x))
    estimates = [
        _estimate(problem, best, item, places[k]) for k, item in enumerate(problem.free)
    ]
    spread = np.sqrt(np.diag(best.covariance))
    alike = (best.covariance / np.outer(spread, spread))[:count, :count]
    result = Fit(scenario, problem, best, tuple(estimates), alike, converged, ())
    split = dict.fromkeys(item.name for item in problem.free if item.table >= 0)
    result = result._replace(
        scenario=scenario.with_values(result.of_table(0) if split else result.values),
        differences=tuple(
            each for key in split for each in _between_tables(result, key)
        ),
        no_difference={key: _no_difference(result, key) for key in split},
        profiles=tuple(
            likelihood.zero_profile(problem, best, k, item.interval)
            for k, item in enumerate(estimates)
            if item.free.name.startswith("zero.")
        ),
    )
    return result._replace(remarks=tuple(_remarks(result)))


def _estimate(
    problem: Problem,
    best: Minimum,
    item: Free,
    weights: Array,
) -> Estimate:
    """Return the estimate of a quantity that has some weights in all that is free."""
    value = item.outer(float(weights @ best.x))
    error = math.sqrt(weights @ best.covariance @ weights)
    interval = likelihood.profile(problem, best, item, weights)
    return Estimate(item, value, error * (value if item.logarithmic else 1.0), interval)


def _between_tables(result: Fit, key: str) -> Iterator[Estimate]:
    """Yield the ratios to the first table, or the differences of a number that is not fitted in its logarithm.

    A bound that sets an end of either value's interval sets that of the ratio or difference.
    """
    problem, places = result.problem, np.eye(len(result.best.x))
    first, *rest = (k for k, item in enumerate(problem.free) if item.name == key)
    base = problem.free[first]
    quantity, start, low, high = (
        base.quantity,
        0.0,
        base.low - base.high,
        base.high - base.low,
    )
    if base.logarithmic:
        quantity, start = Quantity("1", "ratio"), 1.0
        low, high = base.low / base.high, base.high / base.low
    sign = "/" if base.logarithmic else "-"
    stems = [table.stem for table in problem.tables]
    for k in rest:
        name = f"{key} ({stems[problem.free[k].table]} {sign} {stems[base.table]})"
        item = Free(name, quantity, start, low, high)
        weights = places[k] - places[first]
        estimate = _estimate(problem, result.best, item, weights)
        marks = result.numbers[k].interval[2:]
        others = reversed(result.numbers[first].interval[2:])
        ends = zip(estimate.interval[2:], marks, others, strict=True)
        is_open = map(any, ends)
        interval = Interval(*estimate.interval[:2], *is_open)
        yield estimate._replace(interval=interval)


def _no_difference(result: Fit, key: str) -> NoDifference:
    """Test that the values of a key in all tables are a single one.

    The likelihood ratio has a chi-square distribution, and an F distribution if errors are estimated.
    """
    problem, best = result.problem, result.best
    free = {
        shared.key: shared
        for item in problem.free
        for shared in [item._replace(key=key, table=-1) if item.name == key else item]
    }
    single = likelihood.lowest(replace(problem, free=[*free.values()]))
    rise = max(single.chi_square - best.chi_square, 0.0)
    freedom = len(problem.free) - len(free)
    law = stats.chi2(freedom)
    if problem.estimated.any():
        law = stats.f(freedom, problem.freedom, scale=freedom)
    is_limit = any(any(item.interval[2:]) for item in result.numbers)
    return NoDifference(float(law.sf(rise)), rise, freedom, is_limit)


def _remarks(result: Fit) -> Iterator[str]:
    """Yield remarks on what the data do not determine and where the fit is poor."""
    problem, fitted = result.problem, result.problem.predicted(result.best.x)
    numbers = enumerate(result.numbers)
    for (i, item), (k, other) in itertools.combinations(numbers, 2):
        if abs(correlation := result.correlations[i, k]) > _ALIKE:
            pair = f"{item.free.key} and {other.free.key}"
            yield f"the data hardly separate {pair} (correlation {correlation:.3f})"
    if result.p_value <= POOR:
        far = f"the best of several searches misses the data by more than their errors ({chance(result.p_value)})"
        causes = (
            "the model is incomplete, a fixed key is wrong, or the errors are too small"
        )
        yield f"{far}, so the intervals do not hold: {causes}"
    yield from _shared(result)
    yield from _loose(result)
    yield from _deciding(result)
    yield from _heavy(result)
    yield from _unreached(problem, result.best)
    yield from _missed_jumps(problem, result.best)
    yield from _one_sided(problem, result.best)
    for number, name in enumerate(problem.names):
        here = problem.curve == number
        size, least = np.median(np.abs([problem.values[here], fitted[here]]), axis=1)
        if size and least and abs(math.log(size / least)) > math.log(_OTHER_UNIT):
            yield f"{name} is {size / least:.2g} times what is fitted: check its unit, and those of the scenario"
    if problem.estimated.any():
        sizes = [
            f"{name} {engineering(problem.sigma[here][0], QUANTITIES[name].unit)}"
            for number, name in enumerate(problem.names)
            if np.all(problem.estimated[here := problem.curve == number])
        ]
        yield (
            "curves without errors: equal absolute errors along each curve are assumed, of the size of the scatter "
            f"around the fit ({', '.join(sizes)}); for proportional ones, give --errors '2 %'"
        )
        if result.no_difference:
            yield "p of no difference follows from an F distribution, because errors are estimated"


def _shared(result: Fit) -> Iterator[str]:
    """Yield the common errors that the fit has found, which its curves contain and its scenario does not."""
    problem, count = result.problem, len(result.numbers)
    errors = np.sqrt(np.diag(result.best.covariance)[count:])
    places = zip(problem.common.items(), result.best.x[count:], errors, strict=True)
    for (name, size), place, error in places:
        share = concise(100.0 * size * abs(place), 100.0 * size * error)
        side = "above" if place > 0.0 else "below"
        of = "its value in the scenario" if name in problem.names else "its true value"
        yield (
            f"{name} is read {share} % {side} {of}, by its common error of {100.0 * size:g} %; the curves of the"
            " figure contain it, and the scenario does not"
        )


def _loose(result: Fit) -> Iterator[str]:
    """Yield the keys of a measured loop that the data fix no better than by a tenth."""
    if not any(table.has_history for table in result.problem.tables):
        return
    for item in result.numbers:
        low, high, *is_open = item.interval
        is_zero = item.free.name.startswith("zero.")
        if not is_zero and (any(is_open) or high - low > 2 * _TENTH * abs(item.value)):
            _, interval, unit = item.texts
            yield f"the data fix {item.free.key} no better than by a tenth: {interval} {unit}".rstrip()


def _deciding(result: Fit) -> Iterator[str]:
    """Yield the physical keys whose value with a zero held at its start lies outside their interval."""
    for profile in result.profiles:
        k = [item.free.key for item in result.numbers].index(profile.key)
        zero = result.numbers[k].free
        held = int(np.argmin(np.abs(profile.values - zero.start)))
        moved = []
        for item, value in zip(result.numbers, profile.numbers[held], strict=True):
            low, high = item.interval[:2]
            is_zero = item.free.name.startswith("zero.")
            if not is_zero and not low <= value <= high:
                text = engineering(float(value), item.free.quantity.unit)
                _, interval, unit = item.texts
                words = f"{item.free.key} is {text}, not {interval} {unit}"
                moved.append(words.rstrip())
        if moved:
            at = engineering(zero.start, zero.quantity.unit)
            yield f"the zero decides: with {zero.key} held at {at}, {'; '.join(moved)}"


def _heavy(result: Fit) -> Iterator[str]:
    """Yield the points that carry more of the chi^2 than a point of a normal law does.

    Each residual is compared with the size of the others by Student's law, with Bonferroni's factor for their number.
    A table whose curve is within its errors has no such point.
    """
    problem = result.problem
    squares = problem.residuals(result.best.x)[: len(problem.values)] ** 2
    total, freedom = float(squares.sum()), problem.freedom - 1
    is_loop = any(table.has_history for table in problem.tables)
    if freedom < 2 or (result.p_value > POOR and not is_loop):
        return
    others = np.maximum(total - squares, 1e-300) / freedom
    p_values = 2.0 * stats.t.sf(np.sqrt(squares / others), freedom) * len(squares)
    rows = np.flatnonzero(p_values <= POOR)
    if rows.size:
        rows = rows[np.argsort(-squares[rows])][:_MOST_ROWS]
        places = ", ".join(
            f"{problem.place(int(row))} ({squares[row] / total:.0%})" for row in rows
        )
        yield f"chi^2 is carried by few points: {places}; look at them, or fit without them"


def _unreached(problem: Problem, best: Minimum) -> Iterator[str]:
    """Yield the points that the best curve does not reach because the contact is open or masked there."""
    off = problem.residuals(best.x)[: len(problem.values)]
    is_open = problem.predicted(best.x) == 0.0
    states = {"open": is_open}
    if not problem.is_rough:
        masked = (problem.steady(best.x, "work_of_adhesion") <= 0.0) & ~is_open
        states["masked, so that adhesion holds no area"] = masked
    for words, state in states.items():
        if (rows := np.flatnonzero(state & (np.abs(off) > _FAR))).size:
            places = ", ".join(map(problem.place, rows[:_MOST_ROWS]))
            more = ", ..." * (rows.size > _MOST_ROWS)
            yield f"the best curve does not reach {rows.size} points, where its contact is {words}: {places}{more}"


def _missed_jumps(problem: Problem, best: Minimum) -> Iterator[str]:
    """Yield the readings at the jump into contact that the best curve misses by more than their errors."""
    for row, off in zip(_jumps(problem, best), problem.off_jumps(best.x), strict=True):
        if abs(off) > _FAR:
            place, read, at = row["jump into contact"], row["reading"], row["fit"]
            cause = "the sphere closes elsewhere than in the model, or the error is too small"
            yield f"the jump into contact is missed by {abs(off):.2g} errors: {place} is {read}, not {at}; {cause}"


def _one_sided(problem: Problem, best: Minimum) -> Iterator[str]:
    """Yield a remark if neighbouring residuals have one sign more often than by chance (an exact test of runs).

    Points of a curve are neighbours along the condition that varies most, under the same other conditions. Independent
    errors change their sign from point to point with a probability of one half, and after a fit more often.
    """
    is_above = problem.residuals(best.x)[: len(problem.values)] > 0.0
    conditions, _ = _alike(problem)
    changes = []
    for number, (table, _) in enumerate(problem.curves):
        order = np.lexsort((_along(problem.tables[table]).values, conditions[table]))
        signs = is_above[problem.curve == number][order]
        changes += [*(signs[1:] != signs[:-1])]
    p_value = stats.binom.cdf(sum(changes), len(changes), 0.5)
    if p_value <= POOR:
        kept = f"{len(changes) - sum(changes)} of {len(changes)}"
        words = f"residuals keep their sign from point to point {kept} times ({chance(p_value)})"
        cause = "errors of neighbouring points are correlated, or the curves have another form"
        yield f"{words}: {cause}, so the intervals are too narrow"


def free_number(scenario: Scenario, text: str, option: str = "--free") -> Free:
    """Return the free number of a text ``KEY`` or ``KEY=LOW:HIGH``."""
    key, sign, span = text.partition("=")
    key, known = key.strip(), dict[str, tuple[Quantity, float]]()
    for name, number in quantities(scenario).items():
        if name.partition(".")[0] not in _OTHER and not number[0].whole:
            known[name] = number
    if key not in known:
        close = difflib.get_close_matches(key, known, 1, 0.5)
        near = "".join(f'; did you mean "{name}"?' for name in close)
        raise BadInput(
            [f"{option} {key[:80]}: is not a physical key of the scenario{near}"]
        )
    quantity, start = known[key]
    low, high = (
        max(quantity.at_least, quantity.above),
        min(quantity.at_most, quantity.below),
    )
    if sign:
        bounds = {
            kind: getattr(quantity, kind)
            for kind in ("above", "at_least", "below", "at_most")
        }
        name = f"{option} {key}=LOW:HIGH, bound"
        low, high = (
            read_option(end, name, quantity.unit, **bounds)
            for end in span.partition(":")[::2]
        )
    elif low >= 0.0 and math.isinf(high):
        low, high = start / _WIDE, start * _WIDE
    elif math.isinf(high - low):
        low, high = start - _AROUND * abs(start), start + _AROUND * abs(start)
    elif low == quantity.above and low == 0.0:
        low = high / _WIDE**2
    if not low <= start <= high or low == high:
        shown = (
            f"{engineering(low, quantity.unit)} to {engineering(high, quantity.unit)}"
        )
        cure = "start inside, or give bounds, KEY=LOW:HIGH, the lower one first"
        raise BadInput(
            [
                f"{option} {key}: the scenario's value does not lie within {shown}; {cure}"
            ]
        )
    return Free(key, quantity, start, low, high)


#: Height of a panel of curves and of that of its residuals [in].
_CURVES, _RESIDUALS = 1.7, 0.8
#: Name and look of a fit, of one whose points are joined and of others.
_FITS: dict[bool, tuple[str, dict[str, Any]]] = {
    False: ("fit", {"linewidth": 0.9}),
    True: ("fit at the points, joined", {"linewidth": 0.5, "linestyle": ":"}),
}
#: Relative difference below which conditions are the same, and most of them that the legend names.
_NEAR, _NAMED = 0.02, 10


class Along(NamedTuple):
    """Condition over which a table is drawn: its key, words, unit, and values at the rows [SI]."""

    key: str
    words: str
    unit: str
    values: Array


def figure(problem: Problem, best: Minimum) -> Figure:
    """Draw each variable over the condition that varies most, with error bars and fit, above its residuals.

    Residuals are in standard errors. Rows of any table with the same other conditions have one colour and one curve.
    If tables have values of their own, each has its own colours. Over time, speed and mount the curve is steady sliding
    at many places. Runs, and scenarios that differ in another key, are too expensive for that: a thin line joins them.
    """
    panels = dict[tuple[str, str], list[Course]]()
    every, labels = courses(problem, best.x)
    for course in every:
        panels.setdefault((course.name, course.along.key), []).append(course)
    colours = style.shades(len(labels))
    with mpl.rc_context(style.STYLE):
        picture, axes = style.rows([_CURVES, _RESIDUALS] * len(panels), shared=False)
        for k, ((name, _), drawn) in enumerate(panels.items()):
            upper, lower = axes[2 * k : 2 * k + 2]
            places = np.concatenate([course.x for course in drawn])
            scale, axis = style.axis_scale(places), drawn[0].along
            x = Unit.of(places, axis.unit, scale == "log")
            definition = QUANTITIES[name]
            y = Unit.of(problem.values[problem.of(name)], definition.unit)
            for course in drawn:
                over, measured = x.factor * course.x, y.factor * course.values
                look: Any = {"color": colours[course.label]}
                bars = HOLLOW | look | {"elinewidth": 0.7, "zorder": 3}
                upper.errorbar(over, measured, y.factor * course.errors, **bars)
                lower.plot(over, course.residuals, **HOLLOW, **look)
                look |= _FITS[course.is_joined][1] | {"zorder": 2}
                look["marker"] = "" if np.ptp(over) else "x"
                upper.plot(x.factor * course.fine, y.factor * course.smooth, **look)
            meaning = definition.meaning.partition(",")[0]
            upper.set_ylabel(y.label(f"{meaning} ${definition.symbol}$"))
            upper.tick_params(labelbottom=False)
            lower.axhline(0.0, **style.GUIDE)
            lower.margins(y=0.15)
            lower.set_ylabel("residual ($\\sigma$)")
            style.across(upper, x.factor * places, "", scale, 0.05)
            style.across(lower, x.factor * places, x.label(axis.words), scale, 0.05)
        axes[0].plot([], [], label="measured", color=BOTH, **HOLLOW)
        for joined, (words, look) in _FITS.items():
            if joined in {course.is_joined for course in every}:
                axes[0].plot([], [], label=words, color=BOTH, **look)
        named = np.linspace(0, len(labels) - 1, _NAMED).astype(int)
        for k in np.unique(named) if len(labels) > 1 else ():
            axes[0].plot([], [], color=colours[k], label=labels[k])
        style.legend(axes[0])
    return picture


class Course(NamedTuple):
    """Points of one variable in one table that share all conditions but the one along which they are drawn [SI].

    ``x`` grows, and ``errors`` are standard errors. Residuals are in standard errors. ``fine`` and ``smooth`` are the
    predicted curve, which ``is_joined`` if it is known at the points alone. ``label`` is the number of the conditions.
    """

    name: str
    along: Along
    label: int
    x: Array
    values: Array
    errors: Array
    residuals: Array
    fine: Array
    smooth: Array
    is_joined: bool


def courses(problem: Problem, x: Array) -> tuple[list[Course], list[str]]:
    """Return the courses of all measured curves with their prediction, and the labels of their conditions."""
    fitted, alone, off = problem.predicted(x), problem.steady(x), problem.residuals(x)
    conditions, labels = _alike(problem)
    result = []
    for number, (table, name) in enumerate(problem.curves):
        along = _along(problem.tables[table])
        is_joined = problem.is_rough or along.key not in measurement.COURSES
        first = np.argmax(problem.curve == number)
        order = np.argsort(along.values, kind="stable")
        for condition in np.unique(conditions[table]):
            rows = order[conditions[table][order] == condition]
            at, places = first + rows, along.values[rows]
            fine, smooth = places, alone[at]
            if not is_joined and fine[0] < fine[-1]:
                fine, smooth = problem.between(x, table, name, (along.key, rows))
            # what is added to steady sliding is known at the rows
            added = np.interp(fine, places, fitted[at] - alone[at])
            points = problem.values[at], problem.sigma[at], off[at]
            course = Course(
                name, along, condition, places, *points, fine, smooth + added, is_joined
            )
            result.append(course)
    return result, labels


def _along(table: Measured) -> Along:
    """Return the condition that varies most from row to row; if two do, the speed."""
    varied = {key: x for key, x in table.conditions.items() if np.ptp(x) > 0.0}
    if table.has_history:
        varied = {"t": table.conditions["t"]}
    if not varied:
        return Along("", "row", "1", np.arange(1.0, table.rows + 1.0))
    first = "speed", "tangential_force"
    key = max(varied, key=lambda key: (len({*_levels(varied[key])}), key in first))
    column, unit, _ = MOUNT[table.mount]
    known = {
        "mount": (column.replace("_", " "), unit),
        "speed": ("sliding speed $V$", "m/s"),
        "t": ("time $t$", "s"),
        "tangential_force": ("tangential force $Q$", "N"),
    }
    return Along(key, *known.get(key, (key, "1")), varied[key])


def _levels(values: Array) -> Array:
    """Return values of which those that are nearly the same are replaced by their mean."""
    order = np.argsort(values)
    before, after = values[order[:-1]], values[order[1:]]
    level = np.zeros(len(values), int)
    level[order[1:]] = np.cumsum(after > before + _NEAR * np.abs(before))
    return (np.bincount(level, values) / np.bincount(level))[level]


def _alike(problem: Problem) -> tuple[list[NDArray[np.int64]], list[str]]:
    """Return for each table the numbers of the conditions of its rows beside that along the axis, and their labels."""
    places = np.repeat(
        np.arange(len(problem.tables)), [table.rows for table in problem.tables]
    )
    split = any(item.table >= 0 for item in problem.free)
    columns: dict[str, Any] = {"": places if split else 0.0 * places}
    declared = dict(measurement.conditions_of(problem.groups[0][0].scenario).values())
    others = {key for table in problem.tables for key in table.conditions} - {"t"}
    for key in sorted(others):
        values = [
            np.full(table.rows, np.inf)
            if _along(table).key == key or (table.has_history and key == "mount")
            else table.conditions.get(key, np.full(table.rows, np.inf))
            for table in problem.tables
        ]
        columns[key] = _levels(np.concatenate(values))
    kinds, number = np.unique([*columns.values()], axis=1, return_inverse=True)
    labels = []
    for kind in kinds.T:
        words = [problem.tables[int(kind[0])].stem] * split
        for key, value, all_of_key in zip(
            sorted(others), kind[1:], kinds[1:], strict=True
        ):
            quantity = declared[key]
            if np.isfinite(value) and np.ptp(all_of_key[np.isfinite(all_of_key)]):
                sign = f"${quantity.symbol}$" if quantity.unit != "1" else key
                words.append(f"{sign} = {engineering(value, quantity.unit)}")
        labels.append(", ".join(words))
    return [number.ravel()[places == k] for k in range(len(problem.tables))], labels


def common_errors(texts: Sequence[str]) -> dict[str, float]:
    """Return relative errors by the variable from texts ``"COLUMN=2 %"``."""
    pairs = [text.partition("=")[::2] for text in texts]
    return {
        name: read_option(size, f"--common {name}", "1", above=0, below=1)
        for name, size in pairs
    }


#: First words of a line of the scenarios that are written here, by which they may be replaced.
_MADE = "# Made by sim fit"


def carried_out(
    scenario: Scenario,
    data: Sequence[Path],
    stem: Path,
    replace: bool,
    judged: bool,
    units: Sequence[str] = (),
    **arguments: Any,
) -> tuple[Fit, list[Printed]]:
    """Fit, compare mechanisms if wanted, write the files, and return the tables to print.

    The ``units`` are those of the figure. Further arguments are those of ``fit``, with ``common`` as texts
    ``"COLUMN=2 %"``. The files are ``<stem>_fit.toml``, ``.json`` and ``.png``. With keys
    ``per_table`` each table has a scenario ``<stem>_fit_<table>.toml``. Older ones are refused unless ``replace`` is
    True; a scenario is replaced only if a fit has written it.
    """
    arguments["common"] = common_errors(arguments["common"])
    split = arguments["per_table"]
    endings = [f"_{path.stem}.toml" for path in data if split] or [".toml"]
    scenario = with_zero(scenario, [*arguments["free"], *split])
    has_zero = any(key.startswith("zero.") for key in (*arguments["free"], *split))
    outputs = [
        stem.with_name(f"{stem.name}_fit{ending}")
        for ending in (*endings, *["_zero.png"] * has_zero, ".json", ".png")
    ]
    inputs = [*files_read(scenario), *data]
    for path in outputs:
        is_scenario = (
            replace
            and path.suffix == ".toml"
            and path.is_file()
            and _MADE.encode() in path.read_bytes()
        )
        if not is_scenario or path.resolve() in [other.resolve() for other in inputs]:
            files.claim(path, replace, inputs)
    tables = [
        measurement.read(path, scenario, place=(k, len(data)))
        for k, path in enumerate(data)
    ]
    if judged and any(table.has_history for table in tables):
        fault = "compares steady sliding, but a table has the history of a loop"
        raise BadInput([f"--compare: {fault}; omit the option"])
    with in_units(units):  # before anything is fitted
        for table in tables:
            for unit in [QUANTITIES[name].unit for name in table.names]:
                scaled(1.0, unit)
            scaled(1.0, _along(table).unit)
    result = fit(scenario, tables, **arguments)
    verdict = None
    if judged:
        verdict = compare(result.problem, result.best, result.scenario.seed)
    with in_units(units):
        picture = figure(result.problem, result.best)
        profiles = zero_figure(result) if has_zero else None
    numbers = json.dumps(document(result, data, verdict), indent=2, allow_nan=False)
    scenarios = [
        scenario_text(scenario, result, stem.parent, k) for k in range(len(endings))
    ]
    *texts_first, last = outputs
    if profiles is not None:
        *texts_first, beside_last = texts_first[: len(endings)] + [
            outputs[-2],
            outputs[-3],
        ]
        style.save(profiles, beside_last)
    for path, text in zip(texts_first, [*scenarios, f"{numbers}\n"], strict=True):
        with files.output(path) as beside:
            beside.write_bytes(text.encode())
    style.save(picture, last)
    below = "\n".join(["", _quality(result), *result.remarks, ""])
    shown: list[Printed] = [(_table(result), below)]
    if result.differences:
        shown.append((_differences(result), ""))
    if result.problem.jumps:
        shown.append((_jumps(result.problem, result.best), ""))
    shown += [(_profile(result, profile), "") for profile in result.profiles]
    if verdict is not None:
        doubt = "; but even the unchanged scenario misses the data, so perhaps none of these is true"
        words = verdict.words + doubt * (result.p_value <= POOR)
        shown.append((_comparison(verdict), f"\n{words}\n"))
    return result, [*shown, ([], "\n".join(map(str, outputs)))]


def _row(heading: str, item: Estimate) -> dict[str, str]:
    """Return the key, the value and the interval of an estimate, in units that suit it."""
    value, interval, unit = item.texts
    return {
        heading: item.free.key,
        "value (standard error)": f"{value} {unit}".rstrip(),
        f"{LEVEL:.0%} interval": f"{interval} {unit}".rstrip(),
    }


def _table(fit: Fit) -> list[dict[str, str]]:
    """Return one row for each estimate."""
    return [
        _row("key", item)
        | {"start": engineering(item.free.start, item.free.quantity.unit)}
        for item in fit.numbers
    ]


def _differences(fit: Fit) -> list[dict[str, str]]:
    """Return one row for each ratio or difference of values per table; the first of a key has the p of none."""
    tests = {name: str(test) for name, test in fit.no_difference.items()}
    return [
        _row("ratio or difference", item)
        | {"p of no difference": tests.pop(item.free.name, "")}
        for item in fit.differences
    ]


def _profile(fit: Fit, profile: ZeroProfile) -> list[dict[str, str]]:
    """Return one row for each place of a zero: the least chi^2 and the other values there."""
    rows = []
    for place, chi_square in enumerate(profile.chi_squares):
        values = {
            item.free.key: engineering(
                float(profile.numbers[place, k]), item.free.quantity.unit
            )
            for k, item in enumerate(fit.numbers)
        }
        first = {profile.key: values.pop(profile.key), "chi^2": f"{chi_square:.4g}"}
        rows.append(first | values)
    return rows


def _jumps(problem: Problem, best: Minimum) -> list[dict[str, str]]:
    """Return one row for each reading at a jump into contact, with that of the best curve."""
    rows = []
    for (k, jump), value in zip(
        problem.jumps, problem.predicted_jumps(best.x).tolist(), strict=True
    ):
        unit = "m" if jump.name == "displacement" else "N"
        factor, shown = scaled(jump.value, unit)
        stem = f"{problem.tables[k].stem}, " * (len(problem.tables) > 1)
        row = {"jump into contact": f"{stem}{jump.name}"}
        row["reading"] = f"{concise(factor * jump.value, factor * jump.error)} {shown}"
        row["fit"] = f"{factor * value:.6g} {shown}"
        rows.append(row)
    return rows


def zero_figure(fit: Fit) -> Figure:
    """Draw for each free zero the least chi^2 over it, with the rise of a 95 % interval, and the physical values there.

    All zeros share the scales of the values, so that the steepness tells which of them decides.
    """
    keys = [item.free.key for item in fit.numbers]
    physical = [k for k, key in enumerate(keys) if not key.startswith("zero.")]
    least = fit.best.chi_square
    rise = float(stats.chi2.ppf(LEVEL, 1))
    with mpl.rc_context(style.STYLE):
        rows, columns = 1 + len(physical), len(fit.profiles)
        picture = Figure(figsize=(3.4 * columns, 1.5 * rows), layout="constrained")
        shared: Any = {"sharex": "col", "sharey": "row", "squeeze": False}
        axes = picture.subplots(rows, columns, **shared)
        places = []
        for profile, panel in zip(fit.profiles, axes[0], strict=True):
            own = fit.numbers[keys.index(profile.key)]
            x = Unit.of(profile.values, own.free.quantity.unit, False)
            places.append(x.factor * profile.values)
            panel.plot(places[-1], profile.chi_squares, ".-", color=BOTH)
            panel.axhline(least + rise, **style.GUIDE)
            for below in axes[:, len(places) - 1]:
                below.axvline(x.factor * own.value, **style.GUIDE)
            axes[-1, len(places) - 1].set_xlabel(x.label(profile.key))
        # far from the minimum chi^2 would hide what it does near it
        axes[0, 0].set_ylim(least - rise, least + _SHOWN * rise)
        axes[0, 0].set_ylabel("$\\chi^2$")
        for k, panels in zip(physical, axes[1:], strict=True):
            values = [profile.numbers[:, k] for profile in fit.profiles]
            unit = fit.numbers[k].free.quantity.unit
            y = Unit.of(np.concatenate(values), unit, False)
            for panel, place, line in zip(panels, places, values, strict=True):
                panel.plot(place, y.factor * line, ".-", color=BOTH)
            name = keys[k].split(".")[-1].replace("_", " ")
            panels[0].set_ylabel(y.label(name))
        return picture


def _quality(fit: Fit) -> str:
    """Return the chi^2 of the fit and, if it has not converged, the cure."""
    likely = f", {chance(fit.p_value)}" if math.isfinite(fit.p_value) else ""
    chi_square = f"chi^2 {fit.best.chi_square:.4g} at {fit.problem.freedom} degrees of freedom{likely}"
    ending = (
        "\nthe fit has not converged: start nearer, give bounds, or free fewer keys"
    )
    aicc = f"AICc {fit.aicc:.4g}" if math.isfinite(fit.aicc) else "too few for AICc"
    return f"{chi_square}, {aicc}" + ending * (not fit.converged)


def _comparison(verdict: Verdict) -> list[dict[str, str]]:
    """Return one row for each mechanism, the best first."""
    least, rows = verdict.judged[0].aicc, []
    for item in verdict.judged:
        drawn = (
            f"{item.p_value:.3g}" if math.isfinite(item.p_value) else "by AICc alone"
        )
        rows.append(
            {
                "mechanism": item.name,
                "chi^2": f"{item.chi_square:.4g}",
                "AICc - least": f"{item.aicc - least:.3g}",
                "p": "reference" if item.name == WHOLE else drawn,
                "rejected": "yes" if item.rejected else "",
            }
        )
    return rows


def document(fit: Fit, data: Sequence[Path], verdict: Verdict | None) -> dict[str, Any]:
    """Return all numbers of a fit [SI]; those that are not known are None."""
    common = fit.problem.common
    shares = zip(common.items(), fit.best.x[len(fit.numbers) :], strict=True)
    numbers, differences = (
        {
            item.free.key: {
                "value": item.value,
                "unit": item.free.quantity.unit,
                "standard_error": item.error,
                **item.interval._asdict(),
                "start": item.free.start,
            }
            for item in items
        }
        for items in (fit.numbers, fit.differences)
    )
    result: dict[str, Any] = {
        "scenario": fit.scenario.source.path,
        "data": [str(path) for path in data],
        "level": LEVEL,
        "numbers": numbers,
        "differences": differences,
        "no_difference": {
            key: test._asdict() for key, test in fit.no_difference.items()
        },
        "correlations": {
            "keys": [*fit.values],
            "matrix": fit.correlations.tolist(),
        },
        "common_errors": {name: size * x for (name, size), x in shares},
        "chi_square": fit.best.chi_square,
        "degrees_of_freedom": fit.problem.freedom,
        "p_value": fit.p_value,
        "aicc": fit.aicc,
        "converged": fit.converged,
        "remarks": fit.remarks,
    }
    if fit.profiles:
        result["zero_profiles"] = [
            {
                "key": item.key,
                "values": item.values.tolist(),
                "chi_squares": item.chi_squares.tolist(),
                "numbers": dict(zip(fit.values, item.numbers.T.tolist(), strict=True)),
            }
            for item in fit.profiles
        ]
    if fit.problem.jumps:
        readings = zip(
            fit.problem.jumps, fit.problem.predicted_jumps(fit.best.x), strict=True
        )
        result["jumps_into_contact"] = [
            {
                "table": fit.problem.tables[k].stem,
                **jump._asdict(),
                "fit": float(value),
            }
            for (k, jump), value in readings
        ]
    if verdict is not None:
        judged = [item._asdict() for item in verdict.judged]
        result["mechanisms"] = verdict._asdict() | {"judged": judged}
    known: dict[str, Any] = json.loads(
        json.dumps(result), parse_constant=lambda _: None
    )
    return known


def scenario_text(scenario: Scenario, fit: Fit, folder: Path, table: int = 0) -> str:
    """Return a scenario file, its opening comment first, with the estimates in a table, for a file in a folder.

    If tables have values of their own, the file has the conditions of all rows of its table, too.
    """
    source = scenario.origin
    values = fit.of_table(table) if fit.differences else fit.values
    units = {key: quantity.unit for key, (quantity, _) in quantities(scenario).items()}
    units |= {f"contact.{scenario.contact.kind}": MOUNT[scenario.contact.kind][1]}
    tables = parse(source.text, source.path)
    numbers = {
        key: value if units[key] == "1" else f"{value:.12g} {units[key]}"
        for key, value in values.items()
    }
    override(tables, source.overrides | numbers)
    above = Path(source.path).parent
    if above.resolve() != folder.resolve():
        _move(tables, above.absolute(), folder.absolute())
    # the paragraphs after the question are on the values before the fit
    comment = itertools.takewhile(
        lambda line: line.startswith("#") and line != "#", source.text.splitlines()
    )
    question = [line for line in comment if not line.startswith(_MADE)]
    keys = dict.fromkeys(item.free.name for item in fit.numbers)
    measured = fit.problem.tables
    result = [f": {', '.join(keys)} are calibrated to measured curves."]
    if fit.differences:
        names = ", ".join(each.path.name for each in measured)
        here = measured[table].path.name
        result = [
            f": {', '.join(keys)} are calibrated to {names} together; these are the values of {here}."
        ]
    for item in fit.numbers:
        if item.free.table in (-1, table):
            value, interval, unit = item.texts
            ends = f"{LEVEL:.0%} interval {interval} {unit}".rstrip()
            result.append(
                f"\n# {item.free.name} = {value} {unit}".rstrip() + f", {ends}"
            )
    texts = *_quality(fit).splitlines(), *fit.remarks
    made = "".join([_MADE, *result, *(f"\n# {text}" for text in texts)])
    opening = "\n".join([*question, "#", ""] if question else [])
    return f"{opening}{made}\n{written(tables)}"


def _move(table: dict[str, Any], above: Path, folder: Path) -> None:
    """Name files from another folder, with the sign between folders that all systems read.

    Both folders are absolute. No way leads from one drive of Windows to another, so there a file has its whole path.
    """
    for key, value in table.items():
        if isinstance(value, dict):
            _move(value, above, folder)
        elif key == "file" and isinstance(value, str):
            path = above / value
            is_near = path.drive == folder.drive
            table[key] = type(path)(
                os.path.relpath(path, folder) if is_near else path
            ).as_posix()
