"""Mechanisms that measured curves prefer: bonds, fluctuations, both, or a theory of the sheared contact.

Each is fitted to the same curves with its keys. The criteria are AICc (Akaike) and the likelihood ratio to the
unchanged scenario. The keys of an omitted mechanism lie on their bounds or do not exist, so the ratio has no chi-square
distribution. Its distribution is simulated: both models are fitted to curves of the poorer one.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sim.parts.exchange import Array
from sim.scenario.schema import quantities
from sim.study.likelihood import Free, Minimum, Problem, idle, minimum, spread
from sim.study.prediction import AT_FORCE
from sim.units.errors import BadInput
from sim.units.notation import chance
from sim.units.quantity import Quantity

#: Most draws of a likelihood ratio; ratios as large as the measured one that are enough (Besag & Clifford 1991);
#: difference of AICc beyond which none is needed.
DRAWS, _ENOUGH, _HOPELESS = 200, 20, 30.0
#: Relative precision of a sum of squares of drawn curves, whose ratios are of order 1.
_FINE = 1e-3
#: Distances of curves that are alike and that differ, in standard errors.
_BESIDE, _APART = 0.3, 3.0
#: Places between the bounds at which a search may start, and how many of them are tried for measured curves.
_SPREAD, _STARTS = 256, 12
#: What rejects a mechanism: probability of a ratio at least as large, and difference of AICc.
RARE, WORSE = 0.05, 4.0

_ALPHA = Free(
    "alpha", Quantity("1", "reversible share", at_least=0, at_most=1), 0.1, 0.0, 1.0
)
_LAMBDA = Free("lambda", Quantity("1", "mixity", at_least=0, at_most=1), 0.5, 0.0, 1.0)
#: Theories by their name in ``sim.laws.theories``, in words.
_THEORIES = {
    "jkr": "JKR, independent of shear",
    "uncorrected": "Menga et al. 2018, uncorrected",
    "savkoor_briggs": "Savkoor & Briggs, full stick",
    "reversible_force": "reversible, force held",
    "reversible_stress": "reversible, stress held",
    "fraction": "a fraction alpha reversible",
    "scaled_angle": "mixed mode, scaled angle",
    "shear_share": "mixed mode, shear share",
    "scaled_tangent": "mixed mode, scaled tangent",
}
#: Numbers of their own that some theories have.
_OWN = {
    "fraction": _ALPHA,
    "scaled_angle": _LAMBDA,
    "shear_share": _LAMBDA,
    "scaled_tangent": _LAMBDA,
}
WHOLE = "the scenario as it is"
#: Parts of it by their names, and what they leave out.
PARTS = {"bonds only": "fluctuations act", "fluctuations only": "bonds act"}


class Judged(NamedTuple):
    """A mechanism fitted: its numbers by name, and how it compares.

    ``p_value`` is the probability of a likelihood ratio to the whole scenario of at least this size if the mechanism
    were true; nan where AICc says enough. ``rejected`` is whether both speak against it, AICc of a part of the scenario
    by comparison with the whole, of a theory with the best.
    """

    name: str
    numbers: dict[str, float]
    chi_square: float
    aicc: float
    p_value: float
    rejected: bool


class Verdict(NamedTuple):
    """The mechanisms in the order of AICc, and what the data say of them, in words.

    ``sufficient`` is the remaining mechanism if the data reject all others, except possibly the unchanged scenario. The
    data then neither show nor exclude further mechanisms. It is "" if several remain.
    """

    judged: tuple[Judged, ...]
    sufficient: str
    words: str


def _size(result: Minimum) -> float:
    return result.chi_square


class Search:
    """Search for the least sums of squares of one mechanism, for many sets of values under the same conditions.

    Each search starts at the known place whose curves are nearest to the values. Known are some starts, places spread
    evenly between the bounds, and every minimum found so far. So a search is short, and a second minimum is not missed.

    Parameters
    ----------
    problem : Problem
        The mechanism with its conditions and errors; its values do not matter.
    starts : sequence of array
        Places that are known before.
    """

    def __init__(self, problem: Problem, starts: Iterable[Array]) -> None:
        self.problem, self.places = problem, [*starts]
        self.given = len(self.places)
        if not problem.by_run:
            self.places += [*spread(problem)[:_SPREAD]]
        # residuals of zeros are curves in standard errors
        self.zeros = replace(problem, values=np.zeros(len(problem.values)))
        self.curves = np.array([self.zeros.residuals(place) for place in self.places])

    def _sums(self, values: Array) -> Array:
        """Return the sums of squares of some values at all known places."""
        scaled = values / np.hypot(self.problem.sigma, self.problem.noise)
        off = self.curves + np.pad(scaled, (0, len(self.problem.common)))
        return np.sum(off**2, axis=1)

    def _from(self, values: Array, starts: Sequence[int]) -> Minimum:
        """Return the least of the minima from some known places, coarsely, and remember it if its curves are new."""
        problem = replace(self.problem, values=values)
        minima = [minimum(problem, self.places[k], precision=_FINE) for k in starts]
        result = min(minima, key=_size)
        curve = self.zeros.residuals(result.x)
        if np.sum((curve - self.curves[starts[0]]) ** 2) >= _BESIDE**2:
            self.places.append(result.x)
            self.curves = np.append(self.curves, [curve], axis=0)
        return result

    def least(self, values: Array) -> Minimum:
        """Return the minimum of the sum of squares for simulated values, coarsely, from the nearest known place."""
        return self._from(values, [int(np.argmin(self._sums(values)))])

    def sums(self, values: Iterable[Array]) -> Array:
        """Return the least sums of squares for several simulated values."""
        return np.array([self.least(item).chi_square for item in values])

    def exact(self, values: Array) -> Minimum:
        """Return the minimum to eight digits, from the given starts and the nearest places that differ."""
        starts = list(range(self.given))
        for k in np.argsort(self._sums(values), kind="stable").tolist():
            apart = np.sum((self.curves[starts] - self.curves[k]) ** 2, axis=1)
            if len(starts) < self.given + _STARTS and np.all(apart > _APART**2):
                starts.append(k)
        problem = replace(self.problem, values=values)
        return minimum(problem, self._from(values, starts).x)

    def reaches(self, values: Array, level: float) -> bool:
        """Return True if the least sum of squares for simulated values is at most a level."""
        return level >= 0.0 and bool(
            np.min(self._sums(values)) <= level
            or self.least(values).chi_square <= level
        )


def draws_of(
    problem: Problem, expected: Array, rng: np.random.Generator
) -> Iterator[Array]:
    """Yield curves with random errors, those that all points of a variable share included."""
    errors = np.hypot(problem.sigma, problem.noise)
    if of_mount := problem.common.keys() - {*problem.names}:
        cure = "--compare and --plan know common errors of curves alone; omit it"
        raise BadInput([f"--common {', '.join(of_mount)}: {cure}"])
    while True:
        values = expected + errors * rng.standard_normal(len(expected))
        for name, size in problem.common.items():
            values[problem.of(name)] *= 1.0 + size * rng.standard_normal()
        yield values


def compare(problem: Problem, best: Minimum, seed: int, draws: int = DRAWS) -> Verdict:
    """Judge mechanisms by the curves of a fit.

    Parameters
    ----------
    problem, best : Problem, Minimum
        Of the scenario as it is, its errors and its shift from steady sliding known.
    seed : int
        Of the drawn curves.
    draws : int
        Curves drawn for each mechanism.
    """
    searches = {WHOLE: Search(problem, [best.x])}
    for name, other in others(problem):
        searches[name] = Search(other, _starts(other))
    minima = [search.exact(problem.values) for search in searches.values()]
    minima[0] = best = min(best, minima[0], key=_size)
    fits = list(zip(searches.items(), minima, strict=True))
    criteria = [
        search.problem.criterion(least.chi_square) for (_, search), least in fits
    ]
    judged = list[Judged]()
    for place, ((name, search), least) in enumerate(fits):
        p_value, is_rejected = math.nan, place > 0
        if place and criteria[place] < min(criteria) + _HOPELESS:
            rng = np.random.default_rng([seed, place])
            p_value = _p_value(search, least, searches[WHOLE], best, rng, draws)
            reference = criteria[0] if name in PARTS else min(criteria)
            is_rejected = p_value <= RARE and criteria[place] - reference >= WORSE
        numbers = search.problem.numbers(least.x), least.chi_square, criteria[place]
        judged.append(Judged(name, *numbers, p_value, is_rejected))
    judged_by_aicc = tuple(sorted(judged, key=lambda item: item.aicc))
    return Verdict(judged_by_aicc, *_verdict(judged))


def _verdict(judged: list[Judged]) -> tuple[str, str]:
    """Return the mechanism that is sufficient, "" if the data cannot tell, and that in words."""
    whole, *others = judged
    left = [item for item in others if not item.rejected]
    if not others:
        return (
            "",
            "there is no other mechanism to compare with; give bonds a stress or a [shear] that fluctuates",
        )
    if math.isinf(whole.aicc):
        return (
            "",
            f"the data cannot tell: AICc of {WHOLE} needs two more points than free keys; measure more",
        )
    if not left:
        return WHOLE, f"the data prefer {WHOLE}: every other mechanism is rejected"
    first, ahead = left[0], whole.aicc - left[0].aicc
    if len(left) > 1 or (first.name not in PARTS and ahead < WORSE):
        names = ", ".join(item.name for item in left)
        return "", f"the data cannot tell: not rejected are {WHOLE}, {names}"
    evidence = f"({chance(first.p_value)}, AICc {-ahead:+.2g} from {WHOLE})"
    words = f"the data prefer {first.name} {evidence} and reject the others"
    if first.name in PARTS:
        words = f"{first.name} is sufficient; the data cannot tell whether {PARTS[first.name]} as well {evidence}"
    return first.name, words


def others(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yield the mechanisms beside the scenario as it is, each with the keys that it has."""
    scene = problem.groups[0][0].scenario
    if problem.groups[0][0].force is not None:
        # the theories have no number of the empirical law
        other = _less(problem, {}, "incipient.")
        for theory in ("jkr", *AT_FORCE):
            free = [*other.free, *filter(None, [_OWN.get(theory)])]
            yield _THEORIES[theory], replace(other, free=free, theory=theory)
        return
    still = dict.fromkeys({"shear.paid_by_adhesion"} & {*quantities(scene)}, 0.0)
    share = {"adhesion.bond_share": 0.0}
    shares = scene.adhesion.bond_share, scene.fluctuations.paid_by_adhesion
    is_stressed = scene.population.steady(np.ones(1)).strength[0] > 0.0
    if is_stressed and still and min(shares) > 0.0:
        yield "bonds only", _less(problem, still, "shear.")
        yield "fluctuations only", _less(problem, share, "adhesion.bond_share")
    # theories are of a load or an indentation, of a parabola on a half-space, of a stress, and of equilibrium
    is_known = (
        scene.contact.kind != "displacement"
        and not scene.bodies.solid.inverse_thickness
    )
    if is_stressed and is_known and not problem.by_run:
        other = _less(problem, still | share, "shear.", "adhesion.bond_share")
        for theory, words in _THEORIES.items():
            free = [*other.free, *filter(None, [_OWN.get(theory)])]
            yield words, replace(other, free=free, theory=theory)


def _less(problem: Problem, fixed: dict[str, float], *without: str) -> Problem:
    """Return a problem with some numbers fixed, and without the keys that these leave without effect."""
    free = [item for item in problem.free if not item.key.startswith(without)]
    result = replace(problem, free=free, fixed=fixed)
    left_out = idle(result)
    return replace(result, free=[item for item in free if item.key not in left_out])


def _starts(problem: Problem) -> Array:
    """Return starts of the search: a theory's own number at several sizes, as most contacts bear only some."""
    if problem.theory not in _OWN:
        return problem.start[np.newaxis]
    starts = np.tile(problem.start, (3, 1))
    starts[:, len(problem.free) - 1] = 0.01, 0.1, 0.5
    return starts


def _p_value(
    poorer: Search,
    least: Minimum,
    whole: Search,
    best: Minimum,
    rng: np.random.Generator,
    draws: int,
) -> float:
    """Return the share of curves made by the poorer mechanism whose likelihood ratio is at least the measured one."""
    measured = least.chi_square - best.chi_square
    # what more acts explains nothing, as precisely as draws are fitted
    if measured <= _FINE * least.chi_square:
        return 1.0
    drawn = draws_of(whole.problem, poorer.problem.predicted(least.x), rng)
    flags = (
        whole.reaches(values, poorer.least(values).chi_square - measured)
        for values in drawn
    )
    return share_of_larger(flags, draws)[0]


def share_of_larger(are_larger: Iterable[bool], draws: int) -> tuple[float, int]:
    """Return the probability of a ratio as large as the measured one, by drawn ratios, and the number of draws.

    If the measured ratio is soon seen to be frequent, no more are drawn.
    """
    larger = 0
    for count, is_larger in enumerate(itertools.islice(are_larger, draws), 1):
        larger += is_larger
        if larger == _ENOUGH:
            return larger / count, count
    return (1 + larger) / (1 + draws), draws
