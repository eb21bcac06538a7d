"""Plan of a measurement: ``sim fit --plan``.

Before a measurement its conditions and errors are known, and the scenario predicts its values. The interval to expect
for a free key is the profile interval of values without errors. All probabilities are shares of simulated data sets.
Curves are those of steady sliding, which has the means of all noise.

Three truths are simulated: the scenario as it is, bonds only and fluctuations only. A single mechanism has the values
that reproduce the curves of the scenario best, because values that are easy to reject would promise too much. The
mechanisms are told apart if the verdict of ``sim.study.mechanisms`` names the truth. Theories of the sheared contact
are left out. The likelihood ratio of a mechanism has the distribution of the data sets that this mechanism made.
"""

import io
import itertools
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from sim.numerics import files
from sim.parts.exchange import Array
from sim.plots import style
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.study import fit as fits, likelihood
from sim.study.converge import Printed
from sim.study.likelihood import LEVEL, Curve, Free, Interval, Measured, Minimum, Problem
from sim.study.mechanisms import PARTS, RARE, WHOLE, WORSE, Search, draws_of, others
from sim.units.errors import BadInput
from sim.units.notation import concise, engineering, in_units, scaled
from sim.units.quantity import Quantity
from sim.units.tables import ERROR, read_measured, units_of
from sim.units.terminal import progress_bar

#: Simulated data sets of each truth, and fewest; speeds of further points by default; points that are simulated.
SIMS, LEAST_SIMS, _SPEEDS, _BEST = 400, 50, 20, 3
#: Least noncentrality that scipy knows, and spread of a number without information, in large changes.
_LEAST, _UNKNOWN = 1e-9, 1e3
_LOOKS = {WHOLE: style.BOTH, "bonds only": style.BONDS, "fluctuations only": style.FLUCTUATIONS}


class Chance(NamedTuple):
    """Probability from a number of simulated data sets, with its standard error."""

    probability: float
    error: float

    @classmethod
    def of(cls, flags: Array) -> "Chance":
        """Return the share of True. Its error counts one more data set of either kind, so that it is never zero."""
        middle = (np.sum(flags) + 1.0) / (len(flags) + 2.0)
        return cls(float(np.mean(flags)), math.sqrt(middle * (1.0 - middle) / len(flags)))

    def __str__(self) -> str:
        return concise(self.probability, self.error)


class Expected(NamedTuple):
    """Interval to expect for a free key [SI], and the probabilities that the data leave its ends open.

    ``interval`` is that of values without errors: ends ``low`` and ``high``, and ``low_open`` and ``high_open``, which
    are True if only a bound of the key sets the end.
    """

    free: Free
    interval: Interval
    low_open: Chance
    high_open: Chance


class Point(NamedTuple):
    """A further point: its conditions [SI], those in words, and the chance of telling the mechanisms apart with it.

    ``estimate`` is the probability for each truth by a non-central chi-square distribution, which only ranks points.
    ``probabilities`` are simulated for the best points, and empty for the others.
    """

    conditions: dict[str, float]
    words: str
    estimate: dict[str, float]
    probabilities: dict[str, Chance]


class Plan(NamedTuple):
    """A planned measurement. Its text is a line for each free key and each truth.

    Attributes
    ----------
    problem : Problem
        Conditions, predicted values and errors.
    numbers : tuple of Expected
        Interval to expect for each free key.
    probabilities : dict of str to Chance
        Probability for each truth that the mechanisms are told apart; empty if the scenario has only one.
    points : tuple of Point
        Further points, the one that raises the mean of these probabilities most first.
    remarks : tuple of str
        Assumptions, a sentence each.
    """

    problem: Problem
    numbers: tuple[Expected, ...]
    probabilities: dict[str, Chance]
    points: tuple[Point, ...]
    remarks: tuple[str, ...]

    @property
    def best(self) -> list[Point]:
        """Return the best further point, and those that are not worse by two standard errors of their difference."""
        probabilities = [(item, [*item.probabilities.values()]) for item in self.points if item.probabilities]
        sums = [
            (item, sum(p for p, _ in chances), math.hypot(*(error for _, error in chances)))
            for item, chances in probabilities
        ]
        return [item for item, total, error in sums if sums[0][1] - total <= 2.0 * math.hypot(error, sums[0][2])]

    @property
    def advice(self) -> str:
        """Return where to measure next, or that no candidate helps; "" without a simulated point."""
        if not self.best:
            return ""
        pairs = [(chance, self.probabilities[truth]) for truth, chance in self.best[0].probabilities.items()]
        error = math.hypot(*(chance.error for pair in pairs for chance in pair))
        if sum(new.probability - old.probability for new, old in pairs) <= 2.0 * error:
            return "no candidate raises these probabilities by more than two standard errors"
        return f"measure next at {' or '.join(point.words for point in self.best)}"

    def __repr__(self) -> str:
        lines = [" ".join(map(str, row.values())) for rows in self.rows for row in rows]
        return "\n".join(filter(None, [*lines, self.advice, *self.remarks]))

    @property
    def rows(self) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
        """Return a row for each free key and for each truth."""
        keys, truths = [], []
        for item in self.numbers:
            value, (low, high, *is_open) = item.free.start, item.interval
            factor, unit = scaled(value, item.free.quantity.unit)
            ends = [f"{factor * end:.4g}" + " (open)" * mark for end, mark in zip((low, high), is_open, strict=True)]
            keys.append({
                "key": item.free.key, "value": engineering(value, item.free.quantity.unit),
                f"{LEVEL:.0%} interval to expect": f"{' to '.join(ends)} {unit}".rstrip(),
                "P(lower end open)": str(item.low_open), "P(upper end open)": str(item.high_open),
            })  # fmt: skip
        for truth, chance in self.probabilities.items():
            further = {
                f"with {point.words}": str(point.probabilities[truth]) for point in self.points if point.probabilities
            }
            truths.append({"truth": truth, "P(told apart)": str(chance)} | further)
        return keys, truths


class _Simulated(NamedTuple):
    """Simulated data sets: chances by truth, likelihood ratios that are rare by mechanism, and those of the scenario.

    ``values`` are the data sets of the scenario as it is, ``sums`` its least sums of squares for them.
    """

    probabilities: dict[str, Chance]
    rare: dict[str, float]
    values: Array
    sums: Array


class _Design:
    """Points of a measurement: what each mechanism predicts there, and its fits to simulated data."""

    def __init__(self, problem: Problem) -> None:
        curves = problem.predicted(problem.start)
        self.problem, self.whole = problem, Search(problem, [problem.start])
        self.parts = {name: Search(other, [other.start]) for name, other in others(problem) if name in PARTS}
        self.expected = {WHOLE: curves}
        for name, search in self.parts.items():
            self.expected[name] = search.problem.predicted(search.exact(curves).x)

    @cached_property
    def penalties(self) -> dict[str, float]:
        """Return the difference of AICc from the whole scenario at the same sum of squares, by mechanism."""
        return {name: item.problem.criterion(0.0) - self.problem.criterion(0.0) for name, item in self.parts.items()}

    def simulated(self, sims: int, seed: int, advance: Callable[[int], None]) -> "_Simulated":
        """Return the results of a number of simulated data sets for each truth."""
        values, sums, rare = dict[str, Array](), dict[str, Array](), dict[str, float]()
        for number, (truth, expected) in enumerate(self.expected.items()):
            drawn = draws_of(self.problem, expected, np.random.default_rng([seed, number]))
            values[truth] = np.array([*itertools.islice(drawn, sims)])
            sums[truth] = np.array([self.whole.least(item).chi_square for item in values[truth]])
            advance(sims)
            if truth in self.parts:
                least = [self.parts[truth].least(item).chi_square for item in values[truth]]
                rare[truth] = float(np.sort(least - sums[truth])[-math.floor(RARE * (sims + 1))])
                advance(sims)
        probabilities = dict[str, Chance]()
        for truth in self.expected:
            is_truth = np.ones(sims, bool)
            for part, search in self.parts.items():
                levels = sums[truth] + max(rare[part], WORSE - self.penalties[part])
                rejected = [not search.reaches(*item) for item in zip(values[truth], levels, strict=True)]
                is_truth &= np.array(rejected) == (part != truth)
                advance(sims)
            probabilities[truth] = Chance.of(is_truth)
        return _Simulated(probabilities, rare, values[WHOLE], sums[WHOLE])

    def estimate(self, rare: dict[str, float]) -> dict[str, float]:
        """Return the probability by a non-central chi-square distribution if these ratios are rare, by truth."""
        result = {}
        for truth, curves in self.expected.items():
            least, chances = self.whole.exact(curves).chi_square, []
            for part in self.parts.keys() - {truth}:
                search, enough = self.parts[part], max(rare[part], WORSE - self.penalties[part])
                away = max(search.exact(curves).chi_square - least, _LEAST)
                freedom = max(len(self.problem.free) - len(search.problem.free), 1)
                chances.append(float(stats.ncx2.sf(enough, freedom, away)))
            result[truth] = min(chances)
        return result


def plan(
    scenario: Scenario, points: Path, free: Iterable[str], candidates: Path | None = None,
    common: dict[str, float] | None = None, sims: int = SIMS, seed: int | None = None,
) -> Plan:  # fmt: skip
    """Return what a planned measurement can tell.

    Parameters
    ----------
    scenario : Scenario
        The truth that is assumed; its sweep is left out.
    points : Path
        CSV table of conditions and standard errors, ``speed [mm/s], contact_area_error [%]``. Its measured values, if
        there are any, are not used.
    free : iterable of str
        Keys to be fitted, each ``"KEY"`` or ``"KEY=LOW:HIGH"``.
    candidates : Path, optional
        CSV table of further points with the same columns. By default, twenty speeds from a tenth of the least to ten
        times the largest, with all other conditions of the table; errors are the median relative errors of the table.
    common : dict, optional
        Relative errors that all points of a variable share.
    sims : int
        Simulated data sets for each truth.
    seed : int, optional
        Of the simulated errors, by default that of the scenario.

    Raises
    ------
    BadInput
        If a key has no effect, the table cannot be read or has no errors, or the drive needs runs.
    """
    base, seed = scenario.with_values({"record": {}}), scenario.seed if seed is None else seed
    if sims < LEAST_SIMS:
        raise BadInput([f"sims: {sims} simulated data sets do not show a probability; give {LEAST_SIMS} or more"])
    if base.drive.solves_motion:
        raise BadInput([f'--plan: drive.model = "{base.drive.model}" needs runs; plan with a prescribed speed'])
    remarks = ["curves are those of steady sliding"]
    if base.is_random:
        remarks = ["the models of the scenario have noise; curves are those of steady sliding with its means"]
    numbers, (table, is_measured) = [fits.free_number(base, text) for text in free], _read(points, base)
    if is_measured:
        remarks.append(f"{points}: measured values are not used; a plan predicts them")
    if faults := [*fits.conflicts(base, numbers, [], [table])]:
        raise BadInput(faults)
    problem = _predicted(base, [table], numbers, common or {})
    likelihood.refuse_undetermined(problem)
    further = _speeds(table) if candidates is None else _rows(_read(candidates, base, table.curves)[0])
    if not further:
        remarks.append(f"{points}: no column has the speed, so no further point is proposed; give --candidates")
    design = _Design(problem)
    if not design.parts:
        further, cause = [], "bonds or fluctuations do not act in the scenario as it is"
        remarks.append(f"no mechanisms are told apart, because {cause}")
    fits_of_design = 1 + len(design.parts) * (3 + len(design.parts)) if design.parts else 1
    total = sims * (fits_of_design * (1 + min(len(further), _BEST)) + 2 * len(numbers))
    with progress_bar(total, "fits of simulated data") as shown:
        first, ranked = design.simulated(sims, seed, shown.advance), list[tuple[Point, _Design]]()
        expected = [_interval(problem, k, first.values, first.sums, shown.advance) for k in range(len(numbers))]
        for row in further:
            beside = _Design(_predicted(base, _joined(table, row, problem), numbers, common or {}))
            conditions = {key: float(values[0]) for key, values in row.conditions.items()}
            point = Point(conditions, _words(base, conditions, table, row), beside.estimate(first.rare), {})
            ranked.append((point, beside))
        ranked.sort(key=lambda item: -sum(item[0].estimate.values()))
        proposed = [point for point, _ in ranked]
        for k, (point, beside) in enumerate(ranked[:_BEST]):
            proposed[k] = point._replace(
                probabilities=beside.simulated(sims, seed + 1 + k, shown.advance).probabilities
            )
    proposed.sort(key=lambda item: -sum(chance.probability for chance in item.probabilities.values()))
    result = Plan(
        problem, tuple(expected), first.probabilities if design.parts else {}, tuple(proposed), tuple(remarks)
    )
    tried = [point.conditions["speed"] for point in proposed] if candidates is None else []
    if any(point.conditions["speed"] in (min(tried), max(tried)) for point in result.best if tried):
        end = "a best speed is the first or last candidate; speeds beyond may be better: give them by --candidates"
        result = result._replace(remarks=(*result.remarks, end))
    return result


def _read(path: Path, scenario: Scenario, template: Sequence[Curve] = ()) -> tuple[Measured, bool]:
    """Return conditions and errors of a table, and True if it has values, too.

    Relative errors are negative numbers. A table without errors has the curves of a template with errors of zero.
    """
    at, units = likelihood.conditions_of(scenario), units_of(path)
    outcomes = {name: item for name, item in likelihood.outcomes_of(scenario).items() if name not in at}
    known = {name: quantity for name, (_, quantity) in at.items()} | outcomes
    for name, quantity in outcomes.items():
        is_share = units.get(name + ERROR) == "%" and quantity.unit != "1"
        known[name + ERROR] = Quantity("1" if is_share else quantity.unit, name + ERROR, above=0)
    columns, _ = read_measured(path, known, {})
    measured = [name for name in columns if name in outcomes]
    planned = [name for name in outcomes if name + ERROR in columns]
    lacking = [name for name in measured if name not in planned]
    for name in lacking or ([] if planned or template else ["contact_area"]):
        cure = f'a plan needs them; add a column "{name}{ERROR} [%]" of numbers above 0'
        raise BadInput([f"{path}: {name} has no standard errors; {cure}"])
    conditions = {at[name][0]: points.values for name, points in columns.items() if name in at}
    rows = len(next(iter(columns.values())).values)
    curves = [] if planned else [Curve(item.name, np.ones(rows), np.zeros(rows)) for item in template]
    for name in planned:
        size = columns[name + ERROR].values
        is_share = units[name + ERROR] == "%" and outcomes[name].unit != "1"
        curves.append(Curve(name, conditions.get("speed", np.ones(rows)), -size if is_share else size))
    for fault in likelihood.faults_of(scenario, conditions, tuple(curves)):
        raise BadInput([f"{path}: {fault}"])
    return Measured(path, scenario.contact.kind, conditions, tuple(curves)), bool(measured)


def _predicted(
    scenario: Scenario, tables: Sequence[Measured], free: Sequence[Free], common: dict[str, float]
) -> Problem:
    """Return the problem of some tables, with the values that the scenario predicts and their errors."""
    problem = likelihood.problem_of(scenario, tables, free, common)
    values = problem.predicted(problem.start)
    sigma = np.where(problem.sigma < 0.0, -problem.sigma * np.abs(values), problem.sigma)
    for number in np.flatnonzero(~(sigma > 0.0)):
        cause = "is predicted as 0 or without a contact, so a relative error is undefined"
        raise BadInput(
            [f"{tables[0].path}: {problem.place(int(number))} {cause}; omit the row, or give an error in units"]
        )
    return replace(problem, values=values, sigma=sigma)


def _rows(table: Measured) -> list[Measured]:
    """Return a table for each row of a table."""
    result = []
    for row in range(table.rows):
        conditions = {key: values[[row]] for key, values in table.conditions.items()}
        curves = [Curve(name, values[[row]], None if errors is None else errors[[row]])
                  for name, values, errors in table.curves]  # fmt: skip
        result.append(table._replace(conditions=conditions, curves=tuple(curves)))
    return result


def _speeds(table: Measured) -> list[Measured]:
    """Return tables of one row at speeds beyond those of a table, with each set of its other conditions."""
    if not np.any(speeds := np.abs(table.conditions.get("speed", np.zeros(1)))):
        return []
    least, most = speeds[speeds > 0.0].min(), speeds.max()
    held = {key: values for key, values in table.conditions.items() if key != "speed"}
    columns = np.array([*held.values()]).reshape(len(held), table.rows)
    places = np.unique(columns, axis=1, return_index=True)[1] if held else [0]
    curves = tuple(Curve(item.name, np.ones(1), np.zeros(1)) for item in table.curves)
    others_at = [{key: values[[place]] for key, values in held.items()} for place in places]
    speeds = np.geomspace(0.1 * least, 10.0 * most, _SPEEDS)
    return [
        table._replace(curves=curves, conditions=item | {"speed": np.array([v])}) for item in others_at for v in speeds
    ]


def _joined(table: Measured, row: Measured, problem: Problem) -> list[Measured]:
    """Return the tables of a plan with a further point; without errors it has the median relative errors of the plan.

    It is a row of the same table if its columns are the same, because a table is computed at once.
    """
    shares = problem.sigma / np.abs(problem.values)
    medians = {name: np.median(shares[problem.of(name)], keepdims=True) for name in problem.names}
    curves = [item if np.any(item.errors) else item._replace(errors=-medians[item.name]) for item in row.curves]
    row = row._replace(curves=tuple(curves))
    if row.names != table.names or row.conditions.keys() != table.conditions.keys():
        return [table, row]
    conditions = {key: np.append(values, row.conditions[key]) for key, values in table.conditions.items()}
    errors = [
        np.append(np.asarray(planned_curve.errors), np.asarray(other.errors))
        for planned_curve, other in zip(table.curves, curves, strict=True)
    ]
    curves = [Curve(name, np.ones(table.rows + 1), item) for name, item in zip(table.names, errors, strict=True)]
    return [table._replace(conditions=conditions, curves=tuple(curves))]


def _words(scenario: Scenario, conditions: dict[str, float], table: Measured, row: Measured) -> str:
    """Return conditions and variables of a further point that are not the same in the whole table, for people."""
    declared = dict(likelihood.conditions_of(scenario).values())
    texts = [
        f"{declared[key].symbol or key} = {engineering(value, declared[key].unit)}"
        for key, value in sorted(conditions.items(), key=lambda item: item[0] != "speed")
        if key == "speed" or key not in table.conditions or np.ptp(table.conditions[key]) > 0.0
    ]
    variables = "" if row.names == table.names else f" ({', '.join(row.names)})"
    return (", ".join(texts) or "the same conditions") + variables


def covariance_at(problem: Problem, x: Array) -> Array:
    """Return the covariance of what is free at a place, finite for numbers without information, too."""
    slopes = likelihood.derivatives(problem, x, range(len(x)))
    widths = np.array([item.width for item in problem.free] + [1.0] * len(problem.common))
    return np.asarray(np.linalg.inv(slopes.T @ slopes + np.diag((_UNKNOWN * widths) ** -2.0)), float)


def _interval(problem: Problem, k: int, values: Array, sums: Array, advance: Callable[[int], None]) -> Expected:
    """Return the interval to expect for a free number, by simulated values and their least sums of squares."""
    item, covariance = problem.free[k], covariance_at(problem, problem.start)
    interval = likelihood.interval(problem, Minimum(problem.start, 0.0, covariance, True), k)
    rise, rest, chances = float(stats.chi2.ppf(LEVEL, 1)), [*problem.free[:k], *problem.free[k + 1 :]], []
    for end in (item.low, item.high):
        held = replace(problem, free=rest, fixed={**problem.fixed, item.key: end})
        search = Search(held, [held.start])
        is_open = [search.reaches(*item) for item in zip(values, sums + rise, strict=True)]
        chances.append(Chance.of(np.array(is_open)))
        advance(len(values))
    return Expected(item, interval, *chances)


def figure(result: Plan) -> Figure:
    """Draw the probability of telling the mechanisms apart over the speed of a further point, for each truth.

    Lines are the estimates, points with errors are simulated, and dots are the probabilities without a further point.
    Points have the other conditions of the best one.
    """
    held = {key: value for key, value in result.points[0].conditions.items() if key != "speed"}
    drawn = [item for item in result.points if {**item.conditions, **held} == item.conditions]
    drawn.sort(key=lambda item: item.conditions.get("speed", 0.0))
    speeds = np.array([item.conditions.get("speed", k) for k, item in enumerate(drawn)])
    scale = style.axis_scale(speeds)
    unit = style.Unit.of(speeds, "m/s" if "speed" in drawn[0].conditions else "1", scale == "log")
    with mpl.rc_context(style.STYLE):
        picture, (panel,) = style.rows([2.1])
        for truth, chance in result.probabilities.items():
            look: Any = {"color": _LOOKS[truth]}
            panel.axhline(chance.probability, linestyle=":", linewidth=0.9, **look)
            panel.plot(unit.factor * speeds, [item.estimate[truth] for item in drawn], "--", linewidth=0.7, **look)
            for place, item in zip(speeds, drawn, strict=True):
                if item.probabilities:
                    bars: Any = style.HOLLOW | look | {"label": truth, "elinewidth": 0.7}
                    panel.errorbar(
                        unit.factor * place,
                        item.probabilities[truth].probability,
                        item.probabilities[truth].error,
                        **bars,
                    )
        panel.plot([], [], ":", color=style.REFERENCE, label="without it")
        panel.plot([], [], "--", color=style.REFERENCE, label="estimate for ranking")
        panel.set_ylim(-0.03, 1.03)
        panel.set_ylabel("P(mechanisms told apart)")
        words = "sliding speed $V$ of the next point" if "speed" in drawn[0].conditions else "number of the next point"
        style.across(panel, unit.factor * speeds, unit.label(words), scale, 0.05)
        style.legend(panel, columns=2)
    return picture


def carried_out(
    scenario: Scenario, points: Path, free: Sequence[str], common: Sequence[str], stem: Path, replaced: bool,
    units: Sequence[str] = (), candidates: Path | None = None, sims: int = SIMS, seed: int | None = None,
) -> list[Printed]:  # fmt: skip
    """Plan, write ``<stem>_plan.json`` and ``.png``, and return the tables to print."""
    outputs = [stem.with_name(f"{stem.name}_plan.{ending}") for ending in ("json", "png")]
    inputs = [*files_read(scenario), points, *([candidates] if candidates else [])]
    for path in outputs:
        files.claim(path, replaced, inputs)
    result = plan(scenario, points, free, candidates, fits.common_errors(common), sims, seed)
    picture = io.BytesIO()
    with in_units(units):
        shown, truths = result.rows
        if result.points:
            figure(result).savefig(picture, format="png")
    contents = [(json.dumps(document(result), indent=2) + "\n").encode(), picture.getvalue()]
    written = outputs[: 2 if result.points else 1]
    for path in outputs[len(written) :]:
        path.unlink(missing_ok=True)  # of an older plan, which may be replaced
    for path, content in zip(written, contents, strict=False):
        with files.output(path) as beside:
            beside.write_bytes(content)
    below = "\n".join(["", *filter(None, [result.advice]), *result.remarks, "", *map(str, written)])
    return [(shown, ""), (truths, below)] if truths else [(shown, below)]


def document(result: Plan) -> dict[str, Any]:
    """Return all numbers of a plan [SI]."""

    def chances(probabilities: dict[str, Chance]) -> dict[str, Any]:
        return {truth: chance._asdict() for truth, chance in probabilities.items()}

    return {
        "numbers": {
            item.free.key: {
                "value": item.free.start, "unit": item.free.quantity.unit, **item.interval._asdict(),
                "probability_low_open": item.low_open._asdict(), "probability_high_open": item.high_open._asdict(),
            }
            for item in result.numbers
        },
        "probabilities": chances(result.probabilities),
        "points": [item._asdict() | {"probabilities": chances(item.probabilities)} for item in result.points],
        "advice": result.advice, "remarks": result.remarks,
    }  # fmt: skip
