"""Plan of a measurement: ``sim fit --plan``.

Before a measurement its conditions and errors are known, and the scenario predicts its values. The interval to expect
for a free key is the profile interval of values without errors. All probabilities are shares of simulated data sets.
Curves are those of steady sliding, which has the means of all noise.

Three truths are simulated: the scenario as it is, bonds only and fluctuations only. A single mechanism has the values
that reproduce the curves of the scenario best, because values that are easy to reject would promise too much. The
mechanisms are told apart if the verdict of ``sim.study.mechanisms`` names the truth. Theories of the sheared contact
are left out. The likelihood ratio of a mechanism has the distribution of the data sets that this mechanism made.
"""

import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
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
from sim.study import fit as fits, likelihood, measurement
from sim.study.converge import Printed
from sim.study.likelihood import LEVEL, Free, Interval, Minimum, Problem
from sim.study.measurement import Measured
from sim.study.mechanisms import PARTS, RARE, WHOLE, WORSE, Search, draws_of, others
from sim.units.errors import BadInput
from sim.units.notation import concise, engineering, in_units, scaled
from sim.units.tables import ERROR
from sim.units.terminal import progress_bar

#: Names of the documentation; the others serve the commands.
__all__ = ["Chance", "Expected", "Plan", "Point", "plan"]

#: Simulated data sets of each truth, and fewest; speeds of further points by default; points that are simulated.
SIMS, LEAST_SIMS, _SPEEDS, _BEST = 400, 50, 20, 3
#: Least noncentrality that scipy knows.
_LEAST = 1e-9
_LOOKS = {
    WHOLE: style.BOTH,
    "bonds only": style.BONDS,
    "fluctuations only": style.FLUCTUATIONS,
}


class Chance(NamedTuple):
    """Probability from a number of simulated data sets, with its standard error."""

    probability: float
    error: float

    @classmethod
    def of(cls, flags: Array) -> "Chance":
        """Return the share of True. Its error counts one more data set of either kind, so that it is never zero."""
        middle = (np.sum(flags) + 1.0) / (len(flags) + 2.0)
        return cls(
            float(np.mean(flags)), math.sqrt(middle * (1.0 - middle) / len(flags))
        )

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
    def simulated(self) -> list[Point]:
        """Return the further points whose probabilities are simulated, the best first."""
        return [point for point in self.points if point.probabilities]

    @property
    def best(self) -> list[Point]:
        """Return the best further point, and those that are not worse by two standard errors of their difference."""
        points = self.simulated
        best = points[0].probabilities if points else {}
        return [item for item in points if not _is_more(best, item.probabilities)]

    @property
    def advice(self) -> str:
        """Return where to measure next, or that no candidate helps; "" without a simulated point."""
        if not self.best:
            return ""
        if not _is_more(self.best[0].probabilities, self.probabilities):
            return "no candidate raises these probabilities by more than two standard errors"
        return f"measure next at {' or '.join(point.words for point in self.best)}"

    def __repr__(self) -> str:
        each = itertools.chain.from_iterable(self.rows)
        lines = ["; ".join(f"{name}: {row[name]}" for name in row) for row in each]
        return "\n".join(filter(None, [*lines, self.advice, *self.remarks]))

    @property
    def rows(self) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
        """Return a row for each free key and for each truth."""
        keys, truths = list[dict[str, str]](), list[dict[str, str]]()
        for item in self.numbers:
            quantity, (low, high, *is_open) = item.free.quantity, item.interval
            factor, unit = scaled(item.free.start, quantity.unit)
            ends = [
                f"{factor * end:.4g}" + " (open)" * mark
                for end, mark in zip((low, high), is_open, strict=True)
            ]
            keys.append(
                {
                    "key": item.free.key,
                    "value": engineering(item.free.start, quantity.unit),
                    f"{LEVEL:.0%} interval to expect": f"{' to '.join(ends)} {unit}".rstrip(),
                    "P(lower end open)": str(item.low_open),
                    "P(upper end open)": str(item.high_open),
                }
            )
        for truth, chance in self.probabilities.items():
            row = {"truth": truth, "P(told apart)": str(chance)}
            for point in self.simulated:
                row[f"with {point.words}"] = str(point.probabilities[truth])
            truths.append(row)
        return keys, truths


def _is_more(probabilities: dict[str, Chance], others: dict[str, Chance]) -> bool:
    """Return True if the sum of some probabilities exceeds that of others by two standard errors of the difference."""
    (first, first_errors), (last, last_errors) = (
        np.transpose([*item.values()]) for item in (probabilities, others)
    )
    error = np.linalg.norm([first_errors, last_errors])
    return bool(np.sum(first - last) > 2.0 * error)


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
        self.parts = {
            name: Search(other, [other.start])
            for name, other in others(problem)
            if name in PARTS
        }
        self.expected = {WHOLE: curves}
        for name, search in self.parts.items():
            self.expected[name] = search.problem.predicted(search.exact(curves).x)

    def level(self, part: str, rare: dict[str, float]) -> float:
        """Return the rise of the sum of squares from the whole scenario that rejects a mechanism."""
        penalty = self.parts[part].problem.criterion(0.0) - self.problem.criterion(0.0)
        return max(rare[part], WORSE - penalty)

    def simulated(self, sims: int, seed: int) -> "_Simulated":
        """Return the results of a number of simulated data sets for each truth."""
        values, sums, rare = dict[str, Array](), dict[str, Array](), dict[str, float]()
        for number, (truth, expected) in enumerate(self.expected.items()):
            rng = np.random.default_rng([seed, number])
            drawn = itertools.islice(draws_of(self.problem, expected, rng), sims)
            values[truth] = np.array([*drawn])
            sums[truth] = self.whole.sums(values[truth])
            if truth in self.parts:
                ratios = np.sort(self.parts[truth].sums(values[truth]) - sums[truth])
                rare[truth] = float(ratios[-math.floor(RARE * (sims + 1))])
        probabilities = dict[str, Chance]()
        for truth in self.expected:
            is_truth = np.ones(sims, bool)
            for part, search in self.parts.items():
                levels = sums[truth] + self.level(part, rare)
                reached = list(map(search.reaches, values[truth], levels))
                is_truth &= np.array(reached) == (part == truth)
            probabilities[truth] = Chance.of(is_truth)
        return _Simulated(probabilities, rare, values[WHOLE], sums[WHOLE])

    def estimate(self, rare: dict[str, float]) -> dict[str, float]:
        """Return the probability by a non-central chi-square distribution if these ratios are rare, by truth."""
        result = dict[str, float]()
        for truth, curves in self.expected.items():
            least, chances = self.whole.exact(curves).chi_square, list[float]()
            for part in self.parts.keys() - {truth}:
                search, level = self.parts[part], self.level(part, rare)
                away = max(search.exact(curves).chi_square - least, _LEAST)
                fewer = len(self.problem.free) - len(search.problem.free)
                chances.append(float(stats.ncx2.sf(level, max(fewer, 1), away)))
            result[truth] = min(chances)
        return result


def plan(
    scenario: Scenario,
    points: Path | Measured,
    free: Iterable[str],
    candidates: Path | None = None,
    common: dict[str, float] | None = None,
    sims: int = SIMS,
    seed: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Plan:
    """Return what a planned measurement can tell.

    Parameters
    ----------
    scenario : Scenario
        The truth that is assumed; its sweep is left out.
    points : Path or Measured
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
    progress : callable, optional
        Takes the steps of the plan that are done, and all of them, in place of a bar.

    Raises
    ------
    BadInput
        If a key has no effect, the table cannot be read or has no errors, or the drive needs runs.
    """
    if sims < LEAST_SIMS:
        raise BadInput(
            [
                f"sims: {sims} simulated data sets do not show a probability; give {LEAST_SIMS} or more"
            ]
        )
    asked = _asked(scenario, points, free, candidates, common or {})
    design, further = asked.design, asked.further
    problem, seed = design.problem, scenario.seed if seed is None else seed
    count = 1 + len(problem.free) + len(further) + min(len(further), _BEST)
    with progress_bar(count, "steps of the plan") as bar:
        done = itertools.count(1)

        def advance() -> None:
            if progress is None:
                bar.advance(1)
            else:
                progress(next(done), count)

        first = design.simulated(sims, seed)
        advance()
        expected = list[Expected]()
        for k in range(len(problem.free)):
            expected.append(_interval(problem, k, first))
            advance()
        ranked = list[tuple[Point, _Design]]()
        for row in further:
            ranked.append(asked.beside(row, first.rare))
            advance()
        ranked.sort(key=lambda item: -sum(item[0].estimate.values()))
        proposed = [point for point, _ in ranked]
        for k, (point, beside) in enumerate(ranked[:_BEST]):
            chances = beside.simulated(sims, seed + 1 + k).probabilities
            proposed[k] = point._replace(probabilities=chances)
            advance()
    proposed.sort(
        key=lambda item: (
            -sum(chance.probability for chance in item.probabilities.values())
        )
    )
    probabilities = first.probabilities if design.parts else {}
    result = Plan(problem, tuple(expected), probabilities, tuple(proposed), ())
    remarks = [*asked.remarks, *(_at_ends(result) if candidates is None else ())]
    return result._replace(remarks=tuple(remarks))


class _Asked(NamedTuple):
    """Planned points of a plan and their table, rows of further points, and remarks on them."""

    base: Scenario
    table: Measured
    common: dict[str, float]
    design: _Design
    further: list[Measured]
    remarks: list[str]

    def beside(self, row: Measured, rare: dict[str, float]) -> tuple[Point, _Design]:
        """Return a further point with its estimate, and the design of the planned points with it."""
        problem = self.design.problem
        tables = [self.table, _with_errors(row, problem)]
        design = _Design(_predicted(self.base, tables, [*problem.free], self.common))
        conditions = {key: float(value) for key, (value,) in row.conditions.items()}
        words = _words(self.base, self.table, row)
        return Point(conditions, words, design.estimate(rare), {}), design


def _asked(
    scenario: Scenario,
    points: Path | Measured,
    free: Iterable[str],
    candidates: Path | None,
    common: dict[str, float],
) -> _Asked:
    """Return what a plan is asked, see ``plan``.

    Raises
    ------
    BadInput
        If a key has no effect, the table cannot be read or has no errors, or the drive needs runs.
    """
    base = scenario.with_values({"record": {}})
    if base.drive.solves_motion:
        raise BadInput(
            [
                f'--plan: drive.model = "{base.drive.model}" needs runs; plan with a prescribed speed'
            ]
        )
    noise = "the models of the scenario have noise; curves are those of steady sliding with its means"
    remarks = [noise if base.is_random else "curves are those of steady sliding"]
    numbers = [fits.free_number(base, text) for text in free]
    table = _read(points, base)
    if not all(np.isnan(item.values).all() for item in table.curves):
        name = table.path
        remarks.append(f"{name}: measured values are not used; a plan predicts them")
    if faults := [*fits.conflicts(base, numbers, [], [table])]:
        raise BadInput(faults)
    problem = _predicted(base, [table], numbers, common)
    likelihood.refuse_undetermined(problem)
    further = _speeds(table)
    if candidates is not None:
        further = _rows(_read(candidates, base, table.names))
    if not further:
        remarks.append(
            f"{table.path}: no column has the speed, so no further point is proposed;"
            " sim fit --plan --candidates takes some"
        )
    design = _Design(problem)
    if not design.parts:
        further, cause = [], "bonds or fluctuations do not act in the scenario as it is"
        remarks.append(f"no mechanisms are told apart, because {cause}")
    return _Asked(base, table, common, design, further, remarks)


def _at_ends(result: Plan) -> Iterator[str]:
    """Yield a remark if a speed beyond those that are proposed by default may be better than the best of them."""
    if not result.best:
        return
    certain = dict.fromkeys(result.probabilities, Chance(1.0, 0.0))
    speeds = [point.conditions["speed"] for point in result.points]
    best = {point.conditions["speed"] for point in result.best}
    can_rise = _is_more(certain, result.best[0].probabilities)
    if can_rise and best & {min(speeds), max(speeds)}:
        yield (
            "a best speed is the first or last candidate; speeds beyond may be better:"
            " sim fit --plan --candidates takes them"
        )


def _read(
    path: Path | Measured, scenario: Scenario, template: Sequence[str] = ()
) -> Measured:
    """Return conditions and errors of a table. One without curves has the variables of a template, without errors."""
    if isinstance(path, Measured):
        table = path
    else:
        table = measurement.read(path, scenario, template or ["contact_area"])
    for name, values, errors in table.curves:
        if errors is None and not (template and np.isnan(values).all()):
            cure = f'a plan needs them; add a column "{name}{ERROR} [%]" of numbers above 0'
            raise BadInput([f"{table.path}: {name} has no standard errors; {cure}"])
    return table


def _predicted(
    scenario: Scenario,
    tables: Sequence[Measured],
    free: list[Free],
    common: dict[str, float],
) -> Problem:
    """Return the problem of some tables, with the values that the scenario predicts and their errors."""
    problem = likelihood.problem_of(scenario, tables, free, common)
    values, sigma = problem.predicted(problem.start), problem.sigma
    sigma = np.where(sigma < 0.0, -sigma * np.abs(values), sigma)
    for number in np.flatnonzero(~(sigma > 0.0)).tolist():
        cause = (
            "is predicted as 0 or without a contact, so a relative error is undefined"
        )
        cure = "omit the row, or give an error in units"
        raise BadInput([f"{tables[0].path}: {problem.place(number)} {cause}; {cure}"])
    return replace(problem, values=values, sigma=sigma)


def _rows(table: Measured) -> list[Measured]:
    """Return the rows of a table, each as a table."""
    result = list[Measured]()
    for row in np.arange(table.rows)[:, np.newaxis]:
        conditions = {key: values[row] for key, values in table.conditions.items()}
        curves = [
            item._replace(
                values=item.values[row],
                errors=None if item.errors is None else item.errors[row],
            )
            for item in table.curves
        ]
        result.append(table._replace(conditions=conditions, curves=tuple(curves)))
    return result


def _speeds(table: Measured) -> list[Measured]:
    """Return points at speeds beyond those of a table, with each set of its other conditions and without errors."""
    speeds = np.abs(table.conditions.get("speed", np.zeros(1)))
    if not speeds.any():
        return []
    ends = 0.1 * speeds[speeds > 0.0].min(), 10.0 * speeds.max()
    curves = [item._replace(errors=None) for item in table.curves]
    held = dict[Any, Measured]()
    for row in _rows(table._replace(curves=tuple(curves))):
        others = row.conditions | {"speed": np.zeros(1)}
        held[tuple(value.item() for value in others.values())] = row
    return [
        row._replace(conditions=row.conditions | {"speed": np.array([speed])})
        for row in held.values()
        for speed in np.geomspace(*ends, _SPEEDS)
    ]


def _with_errors(row: Measured, problem: Problem) -> Measured:
    """Return a further point; without errors it has the median relative errors of the plan."""
    shares = problem.sigma / np.abs(problem.values)
    curves = [
        item._replace(errors=-np.median(shares[problem.of(item.name)], keepdims=True))
        if item.errors is None
        else item
        for item in row.curves
    ]
    return row._replace(curves=tuple(curves))


def _words(scenario: Scenario, table: Measured, row: Measured) -> str:
    """Return conditions and variables of a further point that are not the same in the whole table, for people."""
    declared = dict(measurement.conditions_of(scenario).values())
    texts = list[str]()
    for key in sorted(row.conditions, key=lambda key: key != "speed"):
        values = table.conditions.get(key, np.array([0.0, 1.0]))
        if key == "speed" or np.ptp(values) > 0.0:
            number = engineering(float(row.conditions[key][0]), declared[key].unit)
            texts.append(f"{declared[key].symbol or key} = {number}")
    variables = "" if row.names == table.names else f" ({', '.join(row.names)})"
    return (", ".join(texts) or "the same conditions") + variables


def _interval(problem: Problem, k: int, simulated: _Simulated) -> Expected:
    """Return the interval to expect for a free number, by the simulated data sets."""
    item, covariance = problem.free[k], likelihood.covariance_at(problem, problem.start)
    exact = Minimum(problem.start, 0.0, covariance, True)
    levels = simulated.sums + float(stats.chi2.ppf(LEVEL, 1))
    rest, chances = [*problem.free[:k], *problem.free[k + 1 :]], list[Chance]()
    for end in (item.low, item.high):
        held = replace(problem, free=rest, fixed={**problem.fixed, item.key: end})
        search = Search(held, [held.start])
        reached = [*map(search.reaches, simulated.values, levels)]
        chances.append(Chance.of(np.array(reached)))
    return Expected(item, likelihood.interval(problem, exact, k), *chances)


def figure(result: Plan) -> Figure:
    """Draw the probability of telling the mechanisms apart over the speed of a further point, for each truth.

    Lines are the estimates, points with errors are simulated, and dots are the probabilities without a further point.
    Points have the other conditions of the best one.
    """
    held = dict(result.points[0].conditions)
    is_speed = held.pop("speed", None) is not None
    drawn = [item for item in result.points if held.items() <= item.conditions.items()]
    drawn.sort(key=lambda item: item.conditions.get("speed", 0.0))
    simulated = [k for k, item in enumerate(drawn) if item.probabilities]
    words, si = ("sliding speed $V$", "m/s") if is_speed else ("number", "1")
    speeds = np.array([item.conditions.get("speed", k) for k, item in enumerate(drawn)])
    scale = style.axis_scale(speeds)
    unit = style.Unit.of(speeds, si, scale == "log")
    x = unit.factor * speeds
    with mpl.rc_context(style.STYLE):
        picture, (panel,) = style.rows([2.1])
        for truth, chance in result.probabilities.items():
            look: Any = {"color": _LOOKS[truth], "linewidth": 0.7}
            estimates = [item.estimate[truth] for item in drawn]
            chances = [drawn[k].probabilities[truth] for k in simulated]
            panel.axhline(chance.probability, linestyle=":", **look)
            panel.plot(x, estimates, "--", **look)
            look |= style.HOLLOW | {"label": truth, "elinewidth": 0.7}
            panel.errorbar(x[simulated], *np.transpose(chances), **look)
        panel.plot([], [], ":", color=style.REFERENCE, label="without it")
        panel.plot([], [], "--", color=style.REFERENCE, label="estimate for ranking")
        panel.set(ylim=(-0.03, 1.03), ylabel="P(mechanisms told apart)")
        style.across(panel, x, unit.label(f"{words} of the next point"), scale, 0.05)
        style.legend(panel)
    return picture


def carried_out(
    scenario: Scenario,
    points: Path,
    stem: Path,
    replaced: bool,
    units: Sequence[str] = (),
    **options: Any,
) -> list[Printed]:
    """Plan with options of ``plan``, write ``<stem>_plan.json`` and ``.png``, and return the tables to print."""
    numbers, drawn = (
        stem.with_name(f"{stem.name}_plan.{ending}") for ending in ("json", "png")
    )
    sources = [*files_read(scenario), points]
    sources += filter(None, [options.get("candidates")])
    for path in (numbers, drawn):
        files.claim(path, replaced, sources)
    options["common"] = fits.common_errors(options["common"])
    result = plan(scenario, points, **options)
    with in_units(units):
        shown, truths = result.rows
        picture = figure(result) if result.points else None
    with files.output(numbers) as beside:
        beside.write_bytes((json.dumps(document(result), indent=2) + "\n").encode())
    outputs = [str(numbers)]
    if picture:
        style.save(picture, drawn)
        outputs.append(str(drawn))
    else:
        drawn.unlink(missing_ok=True)  # of an older plan, which may be replaced
    advice = [result.advice] if result.advice else []
    below = "\n".join(["", *advice, *result.remarks, "", *outputs])
    return [(shown, ""), (truths, below)] if truths else [(shown, below)]


def document(result: Plan) -> dict[str, Any]:
    """Return all numbers of a plan [SI]."""

    def chances(probabilities: dict[str, Chance]) -> dict[str, Any]:
        return {truth: chance._asdict() for truth, chance in probabilities.items()}

    numbers = {
        item.free.key: {
            "value": item.free.start,
            "unit": item.free.quantity.unit,
            **item.interval._asdict(),
            "probability_low_open": item.low_open._asdict(),
            "probability_high_open": item.high_open._asdict(),
        }
        for item in result.numbers
    }
    points = [
        item._asdict() | {"probabilities": chances(item.probabilities)}
        for item in result.points
    ]
    return {
        "numbers": numbers,
        "probabilities": chances(result.probabilities),
        "points": points,
        "advice": result.advice,
        "remarks": result.remarks,
    }
