"""What ΔΓ and the contact radius of a scenario are, in closed form: their law at given steps, without noise.

All members share the drive and, but for counted bonds, the bonds; ΔΓ is then a weighted sum of gamma
numbers at every time, and the radius of a contact in equilibrium is a function of it.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.parts.bonds import Cohort, Counted, Rate, Steady, Tracked, Unbroken
from sim.parts.shear.amplitude import Constant
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.modal import FixedProcess, ModalProcess
from sim.parts.shear.mode_pairs import cell_pairs
from sim.parts.shear.process import SmoothProcess
from sim.scenario.scenario import Scenario
from sim.study.estimates import RARE
from sim.study.gamma_sum import GammaSum

Array = NDArray[np.float64]
Steps = NDArray[np.int64]

#: Terms beyond which those of nearly equal weight and wavenumber are taken together, and how near.
_MOST_TERMS, _WIDTH = 20_000, 0.005

#: Values by which the number of counted bonds is represented.
_MOST_COUNTS = 200


@dataclass(frozen=True, eq=False)
class Terms:
    """ΔΓ at amplitude 1 as independent gamma numbers, arrays of shape (terms,).

    Attributes
    ----------
    weight : array
        Energy of each term per unit of its gamma number [J/m^2].
    shape : array
        Shape of the gamma number: how many mode pairs the term stands for.
    wavenumber : array
        \\|q\\| that sets its rate [rad/m].
    constant : float
        Energy that does not fluctuate [J/m^2].
    """

    weight: Array
    shape: Array
    wavenumber: Array
    constant: float = 0.0

    @classmethod
    def of_process(cls, process: Any) -> "Terms | None":
        """What a depth draws; None of a process that is not known."""
        if isinstance(process, SmoothProcess):
            return cls.still(process.energy)
        if isinstance(process, BandedProcess):
            return cls(process.bands.weight, 0.5 * process.bands.freedom, process.bands.wavenumber)
        if isinstance(process, FixedProcess):
            return cls.still(2.0 * float(np.sum(process.weights)))
        if isinstance(process, ModalProcess):
            return cls(2.0 * process.weights, np.ones(process.pairs), process.wavenumber)._merged()
        return None

    @classmethod
    def of_cell(cls, scenario: Scenario, points: int | None = None) -> "Terms":
        """All mode pairs of a scenario's cell, on its own grid or one of so many points; its energy without a cell."""
        part: Any = scenario.fluctuations
        solid = scenario.solid.effective
        if not hasattr(part, "cell"):
            return cls.still(part.process(*solid, math.nan).energy)
        cell = part.cell or math.sqrt(math.pi) * scenario.rest_radius
        pairs = cell_pairs(part.spectrum, cell, points or part.points, *solid)
        weight, shape, wavenumber = np.broadcast_arrays(pairs.weight, pairs.count, pairs.wavenumber)
        if part.mode_amplitudes == "fixed":
            return cls.still(float(np.sum(weight * shape)))
        return cls(weight, shape.astype(float), wavenumber)._merged()

    @classmethod
    def still(cls, energy: float) -> "Terms":
        """An energy without any fluctuation."""
        return cls(np.empty(0), np.empty(0), np.empty(0), energy)

    def _merged(self) -> "Terms":
        """Terms of nearly equal weight and wavenumber as one; mean and variance stay exact."""
        if self.weight.size <= _MOST_TERMS:
            return self
        places = [np.floor(np.log(x / x.max()) / _WIDTH).astype(np.int64) for x in (self.weight, self.wavenumber)]
        _, place = np.unique(places[0] * 2**32 + places[1], return_inverse=True)
        first = np.bincount(place, self.shape * self.weight)
        second = np.bincount(place, self.shape * self.weight**2)
        wavenumber = np.bincount(place, self.shape * self.weight**2 * self.wavenumber) / second
        return Terms(second / first, first * (first / second), wavenumber, self.constant)


@dataclass(frozen=True, eq=False)
class Course:
    """What all members share, at chosen clock steps; arrays of shape (steps,) or (steps, terms).

    ``fraction`` is that of the bonds (of counted ones their mean), ``amplitude`` the factor g,
    ``exponent`` the integral of the rate of a mode of 1 rad/m since t = 0, ``renewal`` that of the rate
    at which counted bonds forget, and ``size`` the variance of each term's amplitude over that at amplitude 1.
    """

    steps: Steps
    fraction: Array
    amplitude: Array
    exponent: Array
    renewal: Array
    size: Array


def course(scenario: Scenario, terms: Terms, steps: Steps, refine: int = 1) -> Course:
    """Walk through a scenario without noise.

    Parameters
    ----------
    scenario : Scenario
        Its clock counts the ``steps``.
    terms : Terms
        Whose sizes are followed where amplitude relaxes.
    steps : array of int
        Increasing clock steps to report.
    refine : int
        Into how many each clock step is divided: the error of a step is of second order.

    Returns
    -------
    Course
        Where nothing relaxes, the walk goes straight from one of the steps to the next.
    """
    part: Any = scenario.fluctuations
    amplitude, correlation = getattr(part, "amplitude", Constant()), getattr(part, "correlation", None)
    bonds, clock = _mean_bonds(scenario.population), scenario.clock
    power = correlation.power if correlation is not None else 0
    walked = _walked(steps, refine, amplitude.relaxing or not isinstance(bonds, Unbroken | Steady))
    wanted = set((steps * refine).tolist())
    rows: list[tuple[float, float, float, float, Array]] = []
    before, exponent, renewal, size, population = 0, 0.0, 0.0, np.ones(1), None
    factor = np.ones(1)
    for step in walked:
        began, ended = (clock.duration * (k / (clock.steps * refine)) for k in (before, step))
        motion = scenario.drive.motion(step, began, ended, clock.duration)
        none: Any = None  # the bonds here draw nothing
        if population is None:
            population = bonds.start(motion, none)
        else:
            population = bonds.advance(population, motion, np.ones(1), none)
        bonding = bonds.bonding(population)
        last, factor = factor, amplitude.factor(motion.speed, bonding.strength)
        passed = float(correlation.exponents(np.ones(1), motion)[0]) if correlation is not None else 0.0
        if not amplitude.relaxing or step == 0:
            size = factor**2
        else:
            decay = 2.0 * passed * terms.wavenumber**power
            size = size * np.exp(-decay) - np.expm1(-decay) * 0.5 * (factor**2 + last**2)
        exponent += passed
        if isinstance(bonds, Rate):
            renewal += bonds.rebinding_rate * (motion.duration + float(motion.path[0]) / bonds.critical_speed)
        before = step
        if step in wanted:
            rows.append((float(bonding.fraction[0]), float(factor[0]), exponent, renewal, size))
    fraction, growths, exponents, renewals = np.array([row[:4] for row in rows]).T
    widest = max(row[4].size for row in rows)
    sizes = np.stack([np.broadcast_to(row[4], widest) for row in rows])
    return Course(steps, fraction, growths, exponents, renewals, sizes)


def _mean_bonds(bonds: Any) -> Any:
    """Bonds whose fraction is the ensemble mean: rate equation and cohorts give that of finite numbers."""
    if isinstance(bonds, Counted):
        shared = ("critical_speed", "rebinding_rate", "stress", "start_from")
        return Rate(**{name: getattr(bonds, name) for name in shared})
    if isinstance(bonds, Tracked):
        stretched = ("rupture", "bond_stiffness", "rebinding_rate", "site_density", "start_from")
        return Cohort(**{name: getattr(bonds, name) for name in stretched})
    return bonds


def _walked(steps: Steps, refine: int, all_of_them: bool) -> list[int]:
    if all_of_them:
        return list(range(int(steps[-1]) * refine + 1))
    return sorted({0, *(steps * refine).tolist()})


@dataclass(frozen=True, eq=False)
class Expectation:
    """The law of ΔΓ and of the radius at the steps of a course.

    Attributes
    ----------
    scenario : Scenario
        Whose law it is.
    terms : Terms
        What ΔΓ is made of.
    course : Course
        What the members share.
    """

    scenario: Scenario
    terms: Terms
    course: Course

    @cached_property
    def tells_energy(self) -> bool:
        """Whether ΔΓ has this law: not where its amplitude follows bonds that differ between members."""
        follows = getattr(getattr(self.scenario.fluctuations, "spectrum", None), "bond_made", False)
        return not follows and not (self.scenario.fluctuations.reads_stress and self.scenario.population.per_member)

    @cached_property
    def tells_radius(self) -> bool:
        """Whether the radius is a function of ΔΓ and the bonds at one time: not where a contact may open for good."""
        known = not self.scenario.population.per_member or isinstance(self.scenario.population, Counted)
        contact = self.scenario.contact
        plain = not contact.changes and contact.reversible == 0.0 and self.scenario.margin is None
        return self.tells_energy and known and plain and never_opens(self.scenario)

    def energy(self, step: int) -> GammaSum:
        """The law of ΔΓ at a step [J/m^2]."""
        place = self._place(step)
        if self.course.size.shape[1] == 1:  # all terms have grown alike
            return self._unit.scaled(float(self.course.size[place, 0]))
        return GammaSum(self.terms.weight * self.course.size[place], self.terms.shape)

    @cached_property
    def _unit(self) -> GammaSum:
        """The law of ΔΓ at amplitude 1."""
        return GammaSum(self.terms.weight, self.terms.shape, self.terms.constant)

    def _place(self, step: int) -> int:
        place = int(np.searchsorted(self.course.steps, step))
        if place >= self.course.steps.size or self.course.steps[place] != step:
            raise KeyError(f"step {step} is none of the course")
        return place

    def fraction(self, step: int) -> tuple[Array, Array]:
        """Values of the bond fraction at a step and their probabilities, shape (values,) each.

        Counted sites are independent, so their number is binomial at every time.
        """
        mean, bonds = float(self.course.fraction[self._place(step)]), self.scenario.population
        if not isinstance(bonds, Counted):
            return np.array([mean]), np.ones(1)
        from scipy.stats import binom  # heavy, and only counted bonds need it

        law = binom(bonds.sites, mean)
        reach = 8.0 * law.std() + 8.0
        low, high = max(0, math.floor(law.mean() - reach)), min(bonds.sites, math.ceil(law.mean() + reach))
        edges = np.unique(np.rint(np.linspace(low - 1, high, min(high - low + 2, _MOST_COUNTS))))
        middle = 0.5 * (edges[1:] + edges[:-1] + 1.0)
        return middle / bonds.sites, np.diff(law.cdf(edges))

    def radius(self, step: int, energy: Array, fraction: ArrayLike | None = None) -> Array:
        """Equilibrium radius for values of ΔΓ [m], with the step's mean bond fraction or others; 0 where it is open."""
        scene = self.scenario
        bonded = scene.adhesion.work_of_bonds(
            self.course.fraction[self._place(step)] if fraction is None else np.asarray(fraction)
        )
        work = np.asarray(bonded - scene.fluctuations.paid_by_adhesion * energy, float)
        found = scene.contact.equilibrium_radius(work, scene.sphere.radius, scene.solid.contact_modulus)
        return np.nan_to_num(found, nan=0.0)

    def radius_spread(self, step: int) -> float:
        """Roughly the standard deviation of the radius [m], counted bonds included: to see where it is largest."""
        law, bonds = self.energy(step), self.scenario.population
        low, high = self.radius(step, law.mean + law.std * np.array([1.0, -1.0]))
        spread = 0.5 * (high - low)
        if isinstance(bonds, Counted):
            part = float(self.course.fraction[self._place(step)])
            off = math.sqrt(part * (1.0 - part) / bonds.sites)
            low, high = self.radius(step, np.full(2, law.mean), [part - off, part + off])
            spread = math.hypot(spread, 0.5 * (high - low))
        return float(spread)

    def statistics(self, step: int, lag: int, window: int) -> Array:
        """The six statistics of ΔΓ and of the radius at a step, shape (2, 6) in SI; nan where there is no closed form.

        The correlation time is the trapezoidal sum over ``window`` lags of ``lag`` steps back from the
        step; it is not told where a lag forgets all but 1/e.
        """
        found = np.full((2, 6), np.nan)
        if not self.tells_energy:
            return found
        law = self.energy(step)
        found[0, :5] = law.mean, law.std, law.skewness, law.quantile(0.01), law.quantile(0.99)
        correlation = [self.correlation(step - j * lag, step) for j in range(1, window + 1)] if law.fluctuates else []
        if correlation and correlation[0] > math.exp(-1.0):
            found[0, 5] = lag * self.scenario.clock.step * (0.5 + math.fsum(correlation) - 0.5 * correlation[-1])
        if self.tells_radius:
            energy, held = law.cells
            fraction, share = self.fraction(step)
            values = self.radius(step, energy[:, np.newaxis], fraction).ravel()
            chance = np.multiply.outer(held, share).ravel()
            found[1, :3] = _moments(values, chance)
            if fraction.size == 1:
                found[1, 3:5] = self.radius(step, found[0, [4, 3]])
            else:
                order = np.argsort(values)
                places = np.searchsorted(np.cumsum(chance[order]), [0.01, 0.99])
                found[1, 3:5] = values[order][np.minimum(places, values.size - 1)]
        return found

    @cached_property
    def _spreads(self) -> Array:
        """Standard deviation of ΔΓ at each step of the course [J/m^2]."""
        return np.sqrt(np.sum(self.terms.shape * (self.terms.weight * self.course.size) ** 2, axis=1))

    def correlation(self, earlier: int, later: int) -> float:
        """Correlation of ΔΓ at two steps; 0 where either does not fluctuate.

        The covariance is ``Σ shape w² e^(−2∫λdt)`` times the sizes of both, or where amplitude relaxes the
        square of the earlier size: what was renewed since is independent.
        """
        i, j = self._place(earlier), self._place(later)
        part: Any = self.scenario.fluctuations
        correlation = getattr(part, "correlation", None)
        spreads = self._spreads[i] * self._spreads[j]
        if correlation is None or not spreads > 0.0:
            return 0.0
        passed = (self.course.exponent[j] - self.course.exponent[i]) * self.terms.wavenumber**correlation.power
        kept = np.exp(-2.0 * passed)
        kept = kept * self.course.size[i] * self.course.size[i if part.amplitude.relaxing else j]
        return float(np.sum(self.terms.shape * self.terms.weight**2 * kept)) / spreads


def never_opens(scenario: Scenario) -> bool:
    """Whether the contact has an equilibrium however much of its adhesion is lost."""
    radius = scenario.contact.equilibrium_radius(np.zeros(1), scenario.sphere.radius, scenario.solid.contact_modulus)
    return scenario.contact.model == "equilibrium" and bool(np.isfinite(radius[0]))


def _moments(values: Array, held: Array) -> tuple[float, float, float]:
    """Mean, standard deviation and skewness of values with their probabilities; rare exceptions do not count."""
    mean = float(values @ held)
    deviation = values - mean
    spread = math.sqrt(float(deviation**2 @ held))
    order = np.argsort(values)
    common = values[order][min(int(np.searchsorted(np.cumsum(held[order]), 0.5)), values.size - 1)]
    differing = float(held[np.abs(values - common) > 1e-9 * abs(common)].sum())
    if differing < RARE or not spread > 1e-12 * abs(mean):
        return mean, 0.0, math.nan
    return mean, spread, float((deviation / spread) ** 3 @ held)
