"""Statistics of a scene without sampling: means marched without noise, spreads by closed cumulants.

ΔΓ of a cell is a weighted sum of independent gamma numbers at any time, whose n-th cumulant is
``(n − 1)! Σ shape wⁿ``. Sites of bonds are independent, so the variance of N of them follows from that of one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv, gammaincinv, ndtr

from sim.engine import State, balance, march
from sim.ensemble.recorded import VARIABLES
from sim.numerics.noise import Noise
from sim.parts.exchange import Bonding, Motion
from sim.parts.shear.amplitude import Amplitude
from sim.parts.shear.correlation import Correlation
from sim.parts.shear.mode_pairs import cell_pairs
from sim.parts.shear.process import Fluctuation, _Renewing
from sim.scenario.scenario import Scenario
from sim.study.settings import REFERENCE, table

Array = NDArray[np.float64]

QUANTITIES = ("shear_stress", "bond_fraction", "fluctuation_energy", "contact_radius")
STATISTICS = ("mean", "standard deviation", "skewness", "correlation time")

READ = {variable.name: variable.read for variable in VARIABLES}

#: Most records of a run that are compared.
_MOST_RECORDS = 1000
#: Wavenumbers that differ by less than this share renew at one rate.
_WIDTH = 0.005
#: Values by which ΔΓ and a bond fraction are represented, and the probability that may be without a contact.
_ENERGIES, _FRACTIONS, _RARE = 281, 15, 1e-9
#: Skewness below which a gamma number is normal.
_SYMMETRIC = 1e-4


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
    def of_model(cls, scenario: Scenario) -> "Terms":
        """Terms that the scene's shear model draws."""
        process: Any = scenario.process
        if not scenario.fluctuations.per_member:
            empty = np.empty(0)
            return cls(empty, empty, empty, 2.0 * float(np.sum(process.weights)) if process.pairs else process.energy)
        if scenario.fluctuations.model == "banded":
            return cls(process.bands.weight, 0.5 * process.bands.freedom, process.wavenumber)
        return cls(2.0 * process.weights, np.ones(process.pairs), process.wavenumber)

    @classmethod
    def of_cell(cls, scenario: Scenario, points: int | None = None) -> "Terms":
        """All mode pairs of the scene's cell, on its own grid or one of so many points; its model's without a cell."""
        part: Any = scenario.fluctuations
        if not part.per_member:
            return cls.of_model(scenario)
        cell = part.cell or math.sqrt(math.pi) * scenario.rest_radius
        pairs = cell_pairs(part.spectrum, cell, points or part.points, *scenario.solid.effective)
        weight, shape, wavenumber = np.broadcast_arrays(pairs.weight, pairs.count, pairs.wavenumber)
        return cls(weight, shape.astype(float), wavenumber)

    def memory(self, power: int) -> float:
        """Integral correlation time over that of a mode of 1 rad/m, whose rate goes with \\|q\\| to a power."""
        share = self.shape * self.weight**2
        return float(np.sum(share * self.wavenumber ** (-float(power))) / np.sum(share)) if share.size else math.nan


@dataclass(frozen=True)
class Expected(_Renewing):
    """Ensemble mean of a renewing process, of which the state holds the variance of its modes.

    ``tables`` has for each set of terms ``(n − 1)! Σ shape wⁿ`` for n = 1, 2, 3 at each ``wavenumber``; the mean that
    is handed on is that of the first.
    """

    wavenumber: Array
    tables: tuple[Array, ...]
    constants: tuple[float, ...]
    correlation: Correlation
    amplitude: Amplitude

    @classmethod
    def of(cls, sets: Sequence[Terms], correlation: Correlation, amplitude: Amplitude) -> "Expected":
        """The process for one amplitude of all terms, or where it relaxes one for each wavenumber."""
        waves = np.concatenate([terms.wavenumber for terms in sets])
        near = np.floor(np.log(waves / waves.max()) / _WIDTH) if amplitude.relaxing else np.zeros(waves.size)
        _, place = np.unique(near, return_inverse=True)
        kinds = int(place.max()) + 1
        tables, done = [], 0
        for terms in sets:
            here = place[done : done + terms.weight.size]
            done += terms.weight.size
            sums = [np.bincount(here, terms.shape * terms.weight**n, kinds) for n in (1, 2, 3)]
            tables.append(np.array([sums[0], sums[1], 2.0 * sums[2]]))
        mean = np.bincount(place, waves) / np.bincount(place)
        return cls(mean, tuple(tables), tuple(terms.constant for terms in sets), correlation, amplitude)

    def _empty(self, members: int) -> Array:
        return np.zeros(self.wavenumber.size)

    def _renewed(
        self, values: Array, keep: Array, renew: Array, size: Array, amplitude: Array, step: int, noise: Noise
    ) -> Fluctuation:  # fmt: skip
        after = keep**2 * values + (renew * size) ** 2
        return Fluctuation(self._sized(after, amplitude)[0, :1], amplitude, after)

    def cumulants(self, state: Fluctuation) -> Array:
        """First three cumulants of ΔΓ for each set, shape (sets, 3)."""
        return self._sized(state.values, state.amplitude)

    def _sized(self, variance: Array, amplitude: Array) -> Array:
        size = variance if self.amplitude.relaxing else amplitude**2 * variance
        found = np.array([[of_order @ size**n for n, of_order in enumerate(table, 1)] for table in self.tables])
        found[:, 0] += amplitude[0] ** 2 * np.array(self.constants)
        return found


def quiet(scenario: Scenario, sets: Sequence[Terms]) -> Scenario:
    """A scene whose bonds and fluctuations are their ensemble means: cohorts or a rate equation, and cumulants."""
    bonds, part = table(scenario.population), cast("Any", scenario.fluctuations)
    changes: dict[str, Any] = {}
    if "sites" in bonds:
        del bonds["sites"]
        mean = {"model": "cohort", "tolerance": REFERENCE} if "rupture" in bonds else {"model": "rate"}
        changes["bonds"] = bonds | mean
    if part.per_member and part.spectrum.bond_made:
        kept = ("spectrum", "paid_by_adhesion", "contact")
        changes["shear"] = {key: value for key, value in table(part).items() if key in kept} | {"model": "mean"}
    found = scenario.with_values(changes)
    if found.fluctuations.per_member:
        found.__dict__["process"] = Expected.of(sets, part.correlation, part.amplitude)
    return found


@dataclass(frozen=True, eq=False)
class Walk:
    """A run without noise at its records.

    Attributes
    ----------
    scenario, calm : Scenario
        The scene, and the one that was marched.
    sets : sequence of Terms
        Terms of ΔΓ whose cumulants are followed.
    steps : array of int, shape (records,)
        Clock steps of the records.
    means : array, shape (records, 4)
        The ``QUANTITIES`` without noise, in SI.
    strength : array, shape (records,)
        Strength of the bonds [Pa].
    noise : array, shape (records, 2)
        Variances of shear stress and bond fraction of a single site, in SI; nan where they are not known.
    cumulants : array, shape (sets, records, 3)
        First three cumulants of ΔΓ for each set of terms.
    """

    scenario: Scenario
    calm: Scenario
    sets: Sequence[Terms]
    steps: NDArray[np.int_]
    means: Array
    strength: Array
    noise: Array
    cumulants: Array

    @classmethod
    def of(cls, scenario: Scenario, sets: Sequence[Terms]) -> "Walk":
        """March a scene without noise."""
        calm, clock = quiet(scenario, sets), scenario.clock
        every = clock.stride * max(1, -(-clock.records // _MOST_RECORDS))
        states = [state for state in march(calm, np.arange(1)) if not state.step % every or state.step == clock.steps]
        means = [[READ[name](calm, state)[0] for name in QUANTITIES] for state in states]
        steps = np.array([state.step for state in states])
        cumulants = [_cumulants(calm.process, state.shear, len(sets)) for state in states]
        strength = np.array([state.bonding.strength[0] for state in states])
        noise = _of_sites(calm, states, np.array(means)[:, 1])
        return cls(scenario, calm, sets, steps, np.array(means), strength, noise, np.stack(cumulants, axis=1))

    @property
    def stretched(self) -> bool:
        """Whether bonds have a stretch, so that their stress is more than their fraction."""
        return "rupture" in table(self.calm.population)

    def statistics(self, which: int, sites: float) -> Array:
        """Mean, standard deviation and skewness of the ``QUANTITIES`` at each record, shape (records, 4, 3), in SI.

        Parameters
        ----------
        which : int
            Set of terms of ΔΓ.
        sites : float
            Number of bond sites of a member, infinite for none.

        Returns
        -------
        array
            nan where there is no law: the stress of bonds without a stretch, which is their fraction's; the
            skewness of all but ΔΓ; where bonds or ΔΓ follow what differs between members; and a radius that depends on
            the past of a fluctuating energy.
        """
        part, finite = self.scenario.fluctuations, math.isfinite(sites)
        mean, variance, third = self.cumulants[which].T
        spread = np.sqrt(variance)
        skewness = np.divide(third, spread**3, out=np.zeros(spread.shape), where=spread > 0.0)
        found = np.full((self.steps.size, 4, 3), np.nan)
        carried = part.per_member and self.calm.population.feeds_back  # with a contact that fluctuates
        if not carried:
            found[:, :2, 0] = self.means[:, :2]
            found[:, :2, 1] = np.sqrt(self.noise / sites) if finite else 0.0
        if not self.stretched:
            found[:, 0] = np.nan
        follows = (finite or carried) and part.reads_stress
        if not follows and part.per_member == self.calm.fluctuations.per_member:
            found[:, 2] = np.stack([mean, spread, skewness], axis=1)
            found[:, 3, :2] = np.nan if carried else self._radii(found[:, 2], found[:, 1, :2])
        return found

    def _radii(self, energy: Array, fraction: Array) -> Array:
        """Mean and standard deviation of the radius at each record, shape (records, 2)."""
        still = np.zeros(self.steps.size)
        if not np.any(energy[:, 1]) and not np.any(fraction[:, 1]):
            return np.stack([self.means[:, 3], still], axis=1)
        found = np.full((self.steps.size, 2), np.nan)
        if self.scenario.contact.lags:
            return found
        for k, (mean, spread, skewness) in enumerate(energy):
            x, share = gamma_nodes(skewness, _ENERGIES if spread > 0.0 else 1)
            y, other = gamma_nodes(0.0, _FRACTIONS if fraction[k, 1] > 0.0 else 1)
            bonded = np.repeat(fraction[k, 0] + fraction[k, 1] * y, x.size)
            radius = self._equilibrium(k, np.tile(mean + spread * x, y.size), bonded)
            held = np.outer(other, share).ravel()
            if held[~(radius > 0.0)].sum() > _RARE:
                return np.full(found.shape, np.nan)
            radius = np.nan_to_num(radius)
            center = float(held @ radius)
            found[k] = center, math.sqrt(float(held @ (radius - center) ** 2))
        return found

    def _equilibrium(self, record: int, energy: Array, fraction: Array) -> Array:
        """Equilibrium radius for values of ΔΓ and of the bond fraction [m]; nan without one."""
        scene, none = self.calm, np.zeros(1)
        strength = self.strength[record : record + 1]
        terms = balance(
            scene,
            Bonding(np.maximum(fraction, 0.0), strength, strength),
            Fluctuation(np.maximum(energy, 0.0), none, none),
        )
        motion = Motion(0, scene.times.at(int(self.steps[record])), 0.0, none, none, none, none)
        return scene.contact.start(motion, scene.times.duration, terms).radius


def _cumulants(process: Any, state: Any, sets: int) -> Array:
    """First three cumulants of ΔΓ for each set of terms, shape (sets, 3)."""
    if isinstance(process, Expected):
        return process.cumulants(state)
    return np.outer(np.ones(sets), [float(state.energy[0]), 0.0, 0.0])


def _of_sites(calm: Scenario, states: Sequence[State], fraction: Array) -> Array:
    """Variances of the shear stress [Pa²] and bond fraction [1] of a single site, shape (records, 2)."""
    bonds: Any = calm.population
    given = table(bonds)
    density, rest = (given["site_density"], bonds.bound_at_rest) if "rupture" in given else (math.nan, 1.0)
    varying = np.array([state.bonding.varying[0] for state in states])
    share = np.clip(fraction * rest, 0.0, 1.0)
    return np.stack([density * varying, share * (1.0 - share) / rest**2], axis=1)


def gamma_nodes(skewness: float, count: int) -> tuple[Array, Array]:
    """Values and probabilities of a shifted gamma number of mean 0, variance 1 and a skewness of at least 0.

    Equal steps of the normal number of the same rank: for smooth functions the error falls exponentially with
    ``count``.

    >>> x, share = gamma_nodes(2.0, 200)
    >>> print([f"{share @ x**n:.6f}" for n in (0, 2, 3)])
    ['1.000000', '1.000000', '2.000000']
    """
    z = np.linspace(-7.0, 7.0, count) if count > 1 else np.zeros(1)
    share = np.exp(-0.5 * z**2)
    if skewness > _SYMMETRIC:
        shape = 4.0 / skewness**2
        lower, upper = gammaincinv(shape, ndtr(np.minimum(z, 0.0))), gammainccinv(shape, ndtr(-np.maximum(z, 0.0)))
        z = (np.where(z < 0.0, lower, upper) - shape) / math.sqrt(shape)
    return z, share / share.sum()
