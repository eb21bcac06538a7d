"""Numbers of a scenario calibrated to measured curves: ``sim fit``.

The curves are fitted by steady sliding, which is quick (``sim.study.likelihood``). Then the models of the scenario run
once with the fitted values. Their difference from steady sliding is added as a correction, with the error of their
members. The fit is repeated until it no longer changes. The same noise is drawn each time. Every prediction is a run in
two cases. Steady sliding may not depend on a free key, such as the speed of an edge that lags. Or the drive may solve
the motion of the slider.
"""

import difflib
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
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import stats
from scipy.special import chdtrc

from sim.ensemble.dataset import variable_name
from sim.numerics import files
from sim.parts.exchange import Array
from sim.plots import style
from sim.plots.style import BOTH, HOLLOW, Unit
from sim.scenario.files import parse, written
from sim.scenario.reader import override
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read, quantities
from sim.study import likelihood
from sim.study.converge import Printed
from sim.study.likelihood import (
    LEVEL,
    MOUNT,
    Curve,
    Free,
    Interval,
    Measured,
    Minimum,
    Problem,
    idle,
    with_errors,
)
from sim.study.mechanisms import (
    DRAWS,
    WHOLE,
    Search,
    Verdict,
    compare,
    draws_of,
    share_of_larger,
)
from sim.units.errors import BadInput
from sim.units.notation import concise, engineering, in_units, scaled
from sim.units.quantity import read_option

#: Factor by which a number that is fitted in its logarithm may change at most, where no bounds are given.
_WIDE = 1e4
#: Most runs of the scenario's own models, and the change of every number, over its error, that ends them.
_RUNS, _STAYS = 3, 0.1
#: Correlation beyond which the data hardly separate two keys.
_ALIKE = 0.95
#: Start of another search, over an e-fold or the range of a number; and most rows that are named.
_BESIDE, _MOST_ROWS = 0.5, 3
#: Probability of a chi^2 as large below which a fit is doubted.
POOR = 0.05
#: Ratio of measured and fitted values beyond which a unit is asked for.
_OTHER_UNIT = 100.0
#: Relative precision of a sum of squares of curves that are drawn without a difference.
_FINE = 1e-4
#: Tables of keys that are not physical.
_OTHER = ("clock", "record", "ensemble", "seed")


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
    steady : float
        Value if steady sliding alone were fitted.
    """

    free: Free
    value: float
    error: float
    interval: Interval
    steady: float

    @property
    def texts(self) -> tuple[str, str, str, str]:
        """Return the value, both ends of the interval and their unit as text."""
        ends, value, error = self.interval, self.value, self.error
        is_limit = ends.low_open and not ends.high_open and error > abs(value)
        factor, unit = scaled(ends.high if is_limit else value, self.free.quantity.unit)
        text = (
            f"below {factor * ends.high:.3g}"
            if is_limit
            else concise(factor * value, factor * error)
        )
        marks = (" (bound)" if is_open else "" for is_open in ends[2:])
        low, high = (
            f"{factor * end:.4g}{mark}"
            for end, mark in zip(ends[:2], marks, strict=True)
        )
        return text, low, high, unit


class NoDifference(NamedTuple):
    """Test of one value of a key in all tables.

    Attributes
    ----------
    p_value : float
        Probability of a likelihood ratio as large or larger if the tables had one value; nan if it is not computed.
    chi_square : float
        Rise of the chi^2 by the single value.
    freedom : int
        Degrees of freedom: tables without the first.
    draws : int
        Curves that were drawn for the probability; 0 if the likelihood ratio has a known distribution.
    """

    p_value: float
    chi_square: float
    freedom: int
    draws: int

    def __str__(self) -> str:
        return f"{self.p_value:.2g}" + " (simulated)" * (self.draws > 0)


class Fit(NamedTuple):
    """A calibrated scenario. Its text is a line for each number, and the chi^2.

    Attributes
    ----------
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
    lag : str
        Lag of the scenario's own run behind steady speeds, "" if it is within the errors.
    differences : tuple of Estimate
        Ratios and differences of the values per table to those of the first.
    no_difference : dict of str to NoDifference
        For each key with a value per table the test that all tables have one value.
    """

    scenario: Scenario
    problem: Problem
    best: Minimum
    numbers: tuple[Estimate, ...]
    correlations: Array
    converged: bool
    remarks: tuple[str, ...]
    lag: str = ""
    differences: tuple[Estimate, ...] = ()
    no_difference: Mapping[str, NoDifference] = MappingProxyType({})

    def __repr__(self) -> str:
        texts = (
            (item.free.key, *item.texts) for item in (*self.numbers, *self.differences)
        )
        lines = [
            f"{key} = {value} [{low}, {high}] {unit}".rstrip()
            for key, value, low, high, unit in texts
        ]
        tests = [
            f"{key}: p of no difference {test}"
            for key, test in self.no_difference.items()
        ]
        return "\n".join([*lines, *tests, _quality(self)])

    @property
    def aicc(self) -> float:
        """Akaike's criterion for few points."""
        return self.problem.criterion(self.best.chi_square)

    @property
    def p_value(self) -> float:
        """Probability of a chi^2 as large or larger; nan if the errors were not measured."""
        known = self.problem.freedom > 0 and not self.problem.estimated.any()
        return (
            float(chdtrc(self.problem.freedom, self.best.chi_square))
            if known
            else math.nan
        )

    @property
    def values(self) -> dict[str, float]:
        """Values of the free keys [SI]; a key with a value per table has the name of the table behind it."""
        return {item.free.key: item.value for item in self.numbers}

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
            if key not in ("t", "speed") and not np.ptp(x)
        }
        return stated | {
            item.free.name: item.value
            for item in self.numbers
            if item.free.table in (-1, place)
        }

    @property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenario of each table by its name, with its values and with the conditions of all its rows."""
        values = {
            table.path.stem: self.of_table(k)
            for k, table in enumerate(self.problem.tables)
        }
        return {
            name: self.scenario.with_values(numbers) for name, numbers in values.items()
        }


def fit(
    scenario: Scenario,
    data: Sequence[Path | likelihood.Measured],
    free: Iterable[str],
    common: dict[str, float] | None = None,
    steady: bool = False,
    per_table: Iterable[str] = (),
) -> Fit:
    """Find numbers of a scenario from measured curves.

    Parameters
    ----------
    scenario : Scenario
        The search starts at its values; its sweep is left out.
    data : sequence of Path
        CSV tables (``sim.study.likelihood.read``), or what was read of them, all fitted together.
    free : iterable of str
        Keys, each ``"KEY"`` or ``"KEY=LOW:HIGH"`` with bounds such as ``"1 mm/s:100 mm/s"``.
    common : dict, optional
        Relative errors that all points of a variable share, as of one lens or one camera.
    steady : bool
        True if steady sliding is enough, so that the scenario's own models are not run.
    per_table : iterable of str
        Keys that have a value in each table, as those of ``free``.

    Raises
    ------
    BadInput
        If a key cannot be fitted, a table cannot be read, or the curves depend on some keys only together.
    """
    base = scenario.with_values({"record": {}})
    shared = [free_number(base, text) for text in free]
    split = [free_number(base, text, "--per-table") for text in per_table]
    tables = [
        likelihood.read(path, base) if isinstance(path, Path) else path for path in data
    ]
    if faults := [*conflicts(base, shared, split, tables)]:
        raise BadInput(faults)
    places = itertools.product(split, enumerate(tables))
    split = [
        item._replace(key=f"{item.key} ({table.path.stem})", table=k)
        for item, (k, table) in places
    ]
    problem = likelihood.problem_of(base, tables, shared + split, common or {})
    if steady and base.drive.solves_motion:
        raise BadInput(
            [f'--steady: drive.model = "{base.drive.model}" needs runs; omit --steady']
        )
    if base.drive.solves_motion or (not steady and idle(problem)):
        problem = replace(problem, by_run=True).compared(problem.start)
    likelihood.refuse_undetermined(problem)
    problem, best = _searched(problem)
    alone, steady = best, steady or problem.by_run
    converged = steady and best.converged
    for _ in range(0 if steady else _RUNS):
        before = best.x
        problem, best = with_errors(problem.compared(best.x), best.x)
        if best.covariance is None or np.all(
            np.abs(best.x - before) < _STAYS * np.sqrt(np.diag(best.covariance))
        ):
            converged = alone.converged and best.converged
            break
    return _assembled(scenario, problem, best, alone, converged)


def conflicts(
    scenario: Scenario,
    shared: list[Free],
    split: list[Free],
    tables: Sequence[Measured],
) -> Iterator[str]:
    """Yield the faults of free keys and tables that do not go together."""
    keys, names = (
        [item.key for item in (*shared, *split)],
        [table.path.stem.lower() for table in tables],
    )
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


def _searched(problem: Problem) -> tuple[Problem, Minimum]:
    """The minimum near the scenario's own values; a poor one is sought from both sides of it, by each free number, too.

    A contact that is open has no slope that would lead out of there.
    """
    minima = [with_errors(problem, problem.start)]
    (scattered, best), freedom = minima[0], problem.freedom
    is_poor = freedom > 0 and best.chi_square > freedom + 4.0 * math.sqrt(2.0 * freedom)
    if not problem.by_run and (is_poor or _open(scattered, best).size):
        for (k, item), sign in itertools.product(enumerate(problem.free), (-1.0, 1.0)):
            beside = best.x.copy()
            beside[k] += sign * _BESIDE * item.width
            minima.append(with_errors(problem, beside))
    return min(minima, key=lambda item: item[0].criterion(item[1].chi_square))


def _open(problem: Problem, best: Minimum) -> NDArray[np.int64]:
    """Return the measured numbers of a closed contact at which the contact is open by the fit."""
    return np.flatnonzero(
        (problem.predicted(best.x) == 0.0)
        & (np.abs(problem.values) > 3.0 * problem.sigma)
    )


def _assembled(
    scenario: Scenario, problem: Problem, best: Minimum, alone: Minimum, converged: bool
) -> Fit:
    """Return the fit with its intervals and remarks."""
    count, size, known = len(problem.free), len(best.x), best.covariance is not None
    covariance = (
        np.full((size, size), np.nan) if best.covariance is None else best.covariance
    )
    spread, estimates = (
        np.sqrt(np.diag(covariance)),
        [_estimate(problem, best, alone, k) for k in range(count)],
    )
    alike = (covariance / np.outer(spread, spread))[:count, :count]
    result = Fit(
        scenario, problem, best, tuple(estimates), alike, known and converged, ()
    )
    if not known:
        return result._replace(
            remarks=(
                "the errors could not be computed: the data do not determine all keys",
            )
        )
    split = [item.name for item in problem.free if item.table >= 0]
    places = {
        key: [k for k, item in enumerate(problem.free) if item.name == key]
        for key in split
    }
    result = result._replace(
        scenario=scenario.with_values(result.of_table(0) if split else result.values),
        lag=likelihood.lag(problem, best.x),
        differences=tuple(_between_tables(result, alone, [*places.values()])),
        no_difference={
            key: _no_difference(result, numbers) for key, numbers in places.items()
        },
    )
    return result._replace(remarks=tuple(_remarks(result)))


def _between_tables(
    result: Fit, alone: Minimum, places: list[list[int]]
) -> Iterator[Estimate]:
    """Yield ratios and differences to the first table; a number that is not fitted in its logarithm has no ratio.

    A bound that sets an end of either value's interval sets that of the ratio and of the difference.
    """
    for (first, *rest), is_ratio in itertools.product(places, (True, False)):
        base = result.numbers[first]
        for k in rest if base.free.logarithmic or not is_ratio else ():
            problem, best = likelihood.with_difference(
                result.problem, result.best, k, first, is_ratio
            )
            _, before = likelihood.with_difference(
                result.problem, alone, k, first, is_ratio
            )
            estimate, ends, others = (
                _estimate(problem, best, before, k),
                result.numbers[k].interval,
                base.interval,
            )
            low, high, *is_open = estimate.interval
            is_open = [
                any(marks)
                for marks in zip(is_open, ends[2:], reversed(others[2:]), strict=True)
            ]
            yield estimate._replace(interval=Interval(low, high, *is_open))


def _estimate(problem: Problem, best: Minimum, alone: Minimum, k: int) -> Estimate:
    """Return one free number with its interval, if the errors are known."""
    item, ends, spread = (
        problem.free[k],
        Interval(math.nan, math.nan, True, True),
        math.nan,
    )
    value, unshifted = (item.outer(float(least.x[k])) for least in (best, alone))
    if best.covariance is not None:
        ends, spread = (
            likelihood.interval(problem, best, k),
            math.sqrt(best.covariance[k, k]),
        )
    return Estimate(
        item, value, spread * (value if item.logarithmic else 1.0), ends, unshifted
    )


def _no_difference(result: Fit, places: list[int]) -> NoDifference:
    """Test that numbers of the tables are a single one.

    The likelihood ratio has a chi-square distribution, and an F distribution if errors are estimated. If the interval
    of any number reaches a bound, its distribution is simulated instead: both are fitted to curves of the single value.
    """
    problem, best, freedom = result.problem, result.best, len(places) - 1
    merged, starts = likelihood.with_one_value(problem, best, places)
    single = min(
        (likelihood.minimum(merged, start) for start in starts),
        key=lambda item: item.chi_square,
    )
    rise, is_estimated = (
        max(single.chi_square - best.chi_square, 0.0),
        problem.estimated.any(),
    )
    measured = rise / best.chi_square if is_estimated else rise
    if not any(
        item.interval.low_open or item.interval.high_open for item in result.numbers
    ):
        tail = (
            stats.f.sf(rise / freedom, freedom, problem.freedom)
            if is_estimated
            else stats.chi2.sf(rise, freedom)
        )
        return NoDifference(float(tail), rise, freedom, 0)
    # as precisely as drawn curves are fitted
    if problem.by_run or rise <= _FINE * best.chi_square:
        return NoDifference(math.nan if problem.by_run else 1.0, rise, freedom, 0)
    times = [len(places) if k == places[0] else 1 for k in range(len(single.x))]
    joint, separate = Search(merged, [single.x]), Search(problem, [best.x])

    def ratio(values: Array) -> float:
        shared, drawn_problem = (
            replace(merged, values=values),
            replace(problem, values=values),
        )
        one_value = likelihood.minimum(shared, joint.least(values).x, precision=_FINE)
        # no worse than one value
        starts = [np.repeat(one_value.x, times), separate.least(values).x]
        least = min(
            likelihood.minimum(drawn_problem, start, precision=_FINE).chi_square
            for start in starts
        )
        return (one_value.chi_square - least) / (least if is_estimated else 1.0)

    drawn = draws_of(
        problem,
        merged.predicted(single.x),
        np.random.default_rng([result.scenario.seed, places[0]]),
    )
    p_value, draws = share_of_larger(
        (ratio(values) >= measured for values in drawn), DRAWS
    )
    return NoDifference(p_value, rise, freedom, draws)


def _remarks(result: Fit) -> Iterator[str]:
    """Yield remarks on what the data do not determine and where the fit is poor."""
    problem, fitted = result.problem, np.abs(result.problem.predicted(result.best.x))
    for i, item in enumerate(result.numbers):
        for other, correlation in zip(
            result.numbers[:i], result.correlations[i], strict=False
        ):
            if abs(correlation) > _ALIKE:
                pair = f"{other.free.key} and {item.free.key}"
                yield f"the data hardly separate {pair} (correlation {correlation:.3f})"
        low, high, *open_ends = item.interval
        for word, end, is_open in zip(
            ("lower", "upper"), (low, high), open_ends, strict=True
        ):
            if math.isnan(end):
                yield f"{item.free.key}: the {word} end of its interval could not be computed"
            elif is_open:
                yield f"{item.free.key}: the data do not set the {word} end of its interval; its bound is shown"
    causes = (
        "the model is incomplete, a fixed key is wrong, or the errors are too small"
    )
    if result.lag:
        yield f"{result.lag}; if steady speeds were measured, choose --steady or a slower ramp"
        causes = "such a lag can explain it"
    if result.p_value <= POOR:
        far = f"the residuals exceed the errors (p = {result.p_value:.2g}), so the intervals do not hold"
        yield f"{far}: {causes}"
    for number, name in enumerate(problem.names):
        here = problem.curve == number
        size, least = (
            float(np.median(np.abs(problem.values[here]))),
            float(np.median(fitted[here])),
        )
        if (
            min(size, least) > 0.0
            and not 1.0 / _OTHER_UNIT < size / least < _OTHER_UNIT
        ):
            yield f"{name} is {size / least:.2g} times what is fitted: check its unit, and those of the scenario"
    if (open_rows := _open(problem, result.best)).size:
        places = ", ".join(map(problem.place, open_rows[:_MOST_ROWS]))
        yield f"the fit has an open contact at measured points: {places}"
    if problem.estimated.any():
        effect = (
            ", so p of no difference follows from an F distribution"
            if result.no_difference
            else ""
        )
        yield f"curves without errors: the scatter around the fit is used instead{effect}"
    for key, test in result.no_difference.items():
        if math.isnan(test.p_value):
            yield f"{key}: p of no difference is not computed, because a bound sets an interval; give wider bounds"


def free_number(scenario: Scenario, text: str, option: str = "--free") -> Free:
    """Return the free number of a text ``KEY`` or ``KEY=LOW:HIGH``."""
    key, sign, span = text.partition("=")
    physical = (
        item
        for item in quantities(scenario).items()
        if item[0].partition(".")[0] not in _OTHER
    )
    key, known = (
        key.strip(),
        {name: number for name, number in physical if not number[0].whole},
    )
    if key not in known:
        near = "".join(
            f'; did you mean "{name}"?'
            for name in difflib.get_close_matches(key, known, 1, 0.5)
        )
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
    If tables have values of their own, each has its own colours.
    Over the speed the curve has many speeds; otherwise it joins the rows. If the scenario's own models add to steady
    sliding, that alone is dashed.
    """
    fitted, alone = problem.predicted(best.x), problem.steady(best.x)
    off = (problem.values - fitted) / np.hypot(problem.sigma, problem.noise)
    is_shifted = np.any(np.abs(problem.shift) > _STAYS * problem.sigma)
    lines = [(fitted, "fit", "-"), (alone, "in steady sliding", "--")][
        : 2 if is_shifted else 1
    ]
    along, (conditions, labels) = (
        [_along(table) for table in problem.tables],
        _alike(problem),
    )
    colours, panels = (
        style.shades(len(labels)),
        dict[tuple[str, str], list[tuple[int, int]]](),
    )
    for number, (place, name) in enumerate(
        (k, name) for k, table in enumerate(problem.tables) for name in table.names
    ):
        panels.setdefault((name, along[place].key), []).append((number, place))
    with mpl.rc_context(style.STYLE):
        picture, axes = style.rows([_CURVES, _RESIDUALS] * len(panels), shared=False)
        for (name, key), upper, lower in zip(
            panels, axes[::2], axes[1::2], strict=True
        ):
            drawn, every = (
                panels[name, key],
                np.concatenate([along[place].values for _, place in panels[name, key]]),
            )
            scale, (_, words, si, _) = style.axis_scale(every), along[drawn[0][1]]
            definition = Curve(name, every, None).definition
            x, y = (
                Unit.of(every, si, scale == "log"),
                Unit.of(problem.values[problem.of(name)], definition.unit),
            )
            for (number, place), condition in itertools.product(
                drawn, range(len(labels))
            ):
                alike = np.flatnonzero(conditions[place] == condition)
                if not alike.size:
                    continue
                alike, colour = (
                    alike[np.argsort(along[place].values[alike], kind="stable")],
                    colours[condition],
                )
                at, over = (
                    np.flatnonzero(problem.curve == number)[alike],
                    along[place].values[alike],
                )
                bars: Any = HOLLOW | {"color": colour, "elinewidth": 0.7, "zorder": 3}
                upper.errorbar(
                    x.factor * over,
                    y.factor * problem.values[at],
                    y.factor * problem.sigma[at],
                    **bars,
                )
                lower.plot(x.factor * over, off[at], color=colour, **HOLLOW)
                fine, smooth = over, alone[at]
                if (
                    key == "speed"
                    and np.ptp(over)
                    and (between := problem.between(best.x, place, name, alike))
                ):
                    fine, smooth = between
                # what is added to steady sliding is known at the rows
                for values, _, dashes in lines:
                    line = y.factor * (
                        smooth + np.interp(fine, over, values[at] - alone[at])
                    )
                    mark = "" if np.ptp(over) else "x"
                    upper.plot(
                        x.factor * fine,
                        line,
                        dashes,
                        color=colour,
                        marker=mark,
                        linewidth=0.9,
                        zorder=2,
                    )
            upper.set_ylabel(
                y.label(f"{definition.meaning.partition(',')[0]} ${definition.symbol}$")
            )
            upper.tick_params(labelbottom=False)
            lower.axhline(0.0, **style.GUIDE)
            lower.margins(y=0.15)
            lower.set_ylabel("residual ($\\sigma$)")
            style.across(upper, x.factor * every, "", scale, 0.05)
            style.across(lower, x.factor * every, x.label(words), scale, 0.05)
        axes[0].plot([], [], label="measured", color=BOTH, **HOLLOW)
        for _, label, dashes in lines:
            axes[0].plot([], [], dashes, color=BOTH, label=label, linewidth=0.9)
        for k in (
            np.unique(np.linspace(0, len(labels) - 1, _NAMED).astype(int))
            if len(labels) > 1
            else ()
        ):
            axes[0].plot([], [], color=colours[k], label=labels[k])
        style.legend(axes[0])
    return picture


def _along(table: Measured) -> Along:
    """Return the condition that varies most from row to row; if two do, the speed."""
    varied = {
        name: values
        for name, values in table.conditions.items()
        if np.ptp(values) > 0.0
    }
    if not varied:
        return Along("", "row", "1", np.arange(1.0, table.rows + 1.0))
    key = max(varied, key=lambda name: (len(_levels(varied[name])[0]), name == "speed"))
    column, unit, _ = MOUNT[table.mount]
    known = {
        "mount": (column.replace("_", " "), unit),
        "speed": ("sliding speed $V$", "m/s"),
        "t": ("time $t$", "s"),
    }
    return Along(key, *known.get(key, (key, "1")), varied[key])


def _levels(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the different values in order, nan as the last, and the place of each value among them."""
    least = list[float]()
    for value in np.unique(values).tolist():
        if not least or not value - least[-1] <= _NEAR * abs(least[-1]):
            least.append(value)
    level = np.searchsorted(least, values, "right") - 1
    return np.bincount(level, values) / np.bincount(level), level


def _alike(problem: Problem) -> tuple[list[NDArray[np.int64]], list[str]]:
    """Return for each table the numbers of the conditions of its rows beside that along the axis, and their labels."""
    along, places = (
        [_along(table) for table in problem.tables],
        np.cumsum([table.rows for table in problem.tables]),
    )
    numbers, texts = [np.zeros(places[-1], int)], [[""]]
    if any(item.table >= 0 for item in problem.free):
        numbers = [
            np.repeat(
                np.arange(len(problem.tables)), [table.rows for table in problem.tables]
            )
        ]
        texts = [[table.path.stem for table in problem.tables]]
    for key, (quantity, columns) in problem.conditions().items():
        others = [
            np.where(axis.key == key, np.nan, values)
            for axis, values in zip(along, columns, strict=True)
        ]
        means, level = _levels(np.concatenate(others))
        name, described = (
            variable_name(key),
            {"units": quantity.unit, "symbol": quantity.symbol},
        )
        words = xr.Dataset(coords={name: (name, means[np.isfinite(means)], described)})
        if words.sizes[name] > 1:
            numbers.append(level)
            texts.append(
                [style.swept_value(words, name, k) for k in range(words.sizes[name])]
                + [""]
            )
    kinds, number = np.unique(numbers, axis=1, return_inverse=True)
    labels = [
        ", ".join(filter(None, map(list.__getitem__, texts, column)))
        for column in kinds.T
    ]
    return np.split(number.ravel(), places[:-1]), labels


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
    free: Sequence[str],
    common: Sequence[str],
    stem: Path,
    replace: bool,
    steady: bool,
    judged: bool,
    units: Sequence[str] = (),
    per_table: Sequence[str] = (),
) -> tuple[Fit, list[Printed]]:
    """Fit, compare mechanisms if wanted, write the files, and return the tables to print.

    Arguments are those of ``sim.study.fit.fit``, with ``common`` as texts ``"COLUMN=2 %"``, and the ``units`` of the
    figure. The files are ``<stem>_fit.toml``, ``.json`` and ``.png``. With keys ``per_table`` each table has a scenario
    ``<stem>_fit_<table>.toml``. Older ones are refused unless ``replace`` is True; a scenario is replaced only if a fit
    has written it.
    """
    sizes = common_errors(common)
    endings = [
        *([f"_{path.stem}.toml" for path in data] if per_table else [".toml"]),
        ".json",
        ".png",
    ]
    outputs, inputs = (
        [stem.with_name(f"{stem.name}_fit{ending}") for ending in endings],
        [*files_read(scenario), *data],
    )
    for path in outputs:
        is_scenario = (
            replace
            and path.suffix == ".toml"
            and path.is_file()
            and _MADE.encode() in path.read_bytes()
        )
        if not is_scenario or path.resolve() in [other.resolve() for other in inputs]:
            files.claim(path, replace, inputs)
    tables = [likelihood.read(path, scenario) for path in data]
    with in_units(units):  # before anything is fitted
        for table in tables:
            for unit in (
                _along(table).unit,
                *(curve.definition.unit for curve in table.curves),
            ):
                scaled(1.0, unit)
    result = fit(scenario, tables, free, sizes, steady, per_table)
    verdict = (
        compare(result.problem, result.best, result.scenario.seed) if judged else None
    )
    with in_units(units):
        picture = figure(result.problem, result.best)
    numbers = (
        json.dumps(document(result, data, verdict), indent=2, allow_nan=False) + "\n"
    )
    scenarios = [
        scenario_text(scenario, result, stem.parent, k) for k in range(len(outputs) - 2)
    ]
    for path, text in zip(outputs[:-1], [*scenarios, numbers], strict=True):
        with files.output(path) as beside:
            beside.write_bytes(text.encode())
    style.save(picture, outputs[-1])
    sources = [f"{table.path}: {table.rows} rows, {table.ranges}" for table in tables]
    shown: list[Printed] = [
        (
            _table(result),
            "\n".join(["", _quality(result), *result.remarks, *sources, ""]),
        )
    ]
    if result.differences:
        shown.append((_differences(result), ""))
    if verdict is not None:
        doubt = "; but even the unchanged scenario misses the data, so perhaps none of these is true"
        shown.append(
            (
                _comparison(verdict),
                f"\n{verdict.words}{doubt if result.p_value <= POOR else ''}\n",
            )
        )
    return result, [*shown, ([], "\n".join(map(str, outputs)))]


def _row(heading: str, item: Estimate) -> dict[str, str]:
    """Return the key, the value and the interval of an estimate, in units that suit it."""
    value, low, high, unit = item.texts
    return {
        heading: item.free.key,
        "value": f"{value} {unit}".rstrip(),
        f"{LEVEL:.0%} interval": f"{low} to {high}",
    }


def _table(fit: Fit) -> list[dict[str, str]]:
    """Return one row for each estimate."""
    rows = []
    for item in fit.numbers:
        start, alone = (
            engineering(value, item.free.quantity.unit)
            for value in (item.free.start, item.steady)
        )
        shift = (
            (item.steady - item.value) / item.error if item.error > 0.0 else math.nan
        )
        alone += f" ({shift:+.1f} errors)" if abs(shift) > 0.05 else ""
        rows.append(_row("key", item) | {"start": start, "steady sliding alone": alone})
    return rows


def _differences(fit: Fit) -> list[dict[str, str]]:
    """Return one row for each ratio or difference of values per table; the first of a key has the p of none."""
    tests = {name: str(test) for name, test in fit.no_difference.items()}
    rows = [
        (item.free.name, _row("ratio or difference", item)) for item in fit.differences
    ]
    return [row | {"p of no difference": tests.pop(name, "")} for name, row in rows]


def _quality(fit: Fit) -> str:
    """Return the chi^2 of the fit and, if it has not converged, the cure."""
    likely = f", p = {fit.p_value:.2g}" if math.isfinite(fit.p_value) else ""
    chi_square = f"chi^2 {fit.best.chi_square:.4g} at {fit.problem.freedom} degrees of freedom{likely}"
    cure = (
        "choose --steady or a slower ramp"
        if fit.lag
        else "start nearer, give bounds, or free fewer keys"
    )
    ending = "" if fit.converged else f"\nthe fit has not converged: {cure}"
    return f"{chi_square}, AICc {fit.aicc:.4g}{ending}"


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
    shares = fit.best.x[len(fit.numbers) :]
    numbers, differences = (
        {
            item.free.key: {
                "value": item.value,
                "unit": item.free.quantity.unit,
                "standard_error": item.error,
                **item.interval._asdict(),
                "start": item.free.start,
                "steady_sliding_alone": item.steady,
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
            "keys": [item.free.key for item in fit.numbers],
            "matrix": fit.correlations.tolist(),
        },
        "common_errors": {
            name: size * x
            for (name, size), x in zip(fit.problem.common.items(), shares, strict=True)
        },
        "chi_square": fit.best.chi_square,
        "degrees_of_freedom": fit.problem.freedom,
        "p_value": fit.p_value,
        "aicc": fit.aicc,
        "converged": fit.converged,
        "remarks": fit.remarks,
    }
    if verdict is not None:
        judged = [item._asdict() for item in verdict.judged]
        result["mechanisms"] = {
            "sufficient": verdict.sufficient,
            "words": verdict.words,
            "judged": judged,
        }
    known: dict[str, Any] = json.loads(
        json.dumps(result), parse_constant=lambda _: None
    )
    return known


def scenario_text(scenario: Scenario, fit: Fit, folder: Path, table: int = 0) -> str:
    """Return a scenario file, its opening comment first, with the estimates in a table, for a file in a folder.

    If tables have values of their own, the file has the conditions of all rows of its table, too.
    """
    source, values = (
        scenario.origin,
        fit.of_table(table) if fit.differences else fit.values,
    )
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
    comment = itertools.takewhile(
        lambda line: line.startswith("#"), source.text.splitlines()
    )
    question = "".join(
        f"{line}\n" for line in comment if not line.startswith(_MADE)
    ).removesuffix("#\n")
    opening = f"{question}#\n" if question else ""
    keys = {item.free.name: None for item in fit.numbers}
    of = f" of {fit.problem.tables[table].path.name}" if fit.differences else ""
    return f"{opening}{_MADE}: {', '.join(keys)} are calibrated to measured curves{of}.\n{written(tables)}"


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
