"""Statistics of a scene without sampling: means marched without noise, spreads by closed cumulants.

ΔΓ of a cell is a weighted sum of independent gamma numbers at any time, whose n-th cumulant is
``(n − 1)! Σ shape wⁿ``. Sites of bonds are independent, so the variance of N of them follows from that of one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv, gammaincinv, ndtr

from sim.engine import balance, march, trajectory_of
from sim.ensemble.variables import VARIABLES
from sim.numerics.noise import Noise
from sim.parts.exchange import Bonding, Gammas, Motion, Motions
from sim.parts.shear.bands import cell_pairs
from sim.parts.shear.process import Amplitude, Correlation, Fluctuation, Renewing, renewed_size
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


def cell_gammas(scenario: Scenario, points: int | None = None) -> Gammas:
    """All mode pairs of the scene's cell, on its own grid or one of so many points; its model's without a cell."""
    part: Any = scenario.fluctuations
    if not part.per_member:
        return scenario.process.gammas
    side = part.side(scenario.setting.cell)
    pairs = cell_pairs(part.spectrum, side, points or part.points, *scenario.solid.effective)
    weight, shape, wavenumber = np.broadcast_arrays(pairs.weight, pairs.count, pairs.wavenumber)
    return Gammas(weight, shape.astype(float), wavenumber)


def memory(terms: Gammas, power: int) -> float:
    """Integral correlation time over that of a mode of 1 rad/m, whose rate goes with \\|q\\| to a power."""
    share = terms.shape * terms.weight**2
    return float(np.sum(share * terms.wavenumber ** (-float(power))) / np.sum(share)) if share.size else math.nan


@dataclass(frozen=True)
class Expected(Renewing):
    """Ensemble mean of a renewing process, of which the state holds the variance of its modes.

    ``tables`` has for each set of terms ``(n − 1)! Σ shape wⁿ`` for n = 1, 2, 3 at each ``wavenumber``; the mean that
    is handed on is that of the first.
    """

    wavenumber: Array
    tables: Sequence[Array]
    constants: Array
    correlation: Correlation
    amplitude: Amplitude

    @classmethod
    def of(cls, sets: Sequence[Gammas], correlation: Correlation, amplitude: Amplitude) -> "Expected":
        """The process for one amplitude of all terms, or where it relaxes one for each wavenumber."""
        waves = np.concatenate([terms.wavenumber for terms in sets])
        near = np.floor(np.log(waves / waves.max()) / _WIDTH) if amplitude.relaxing else np.zeros(waves.size)
        _, place = np.unique(near, return_inverse=True)
        count = np.bincount(place)
        places = np.split(place, np.cumsum([terms.wavenumber.size for terms in sets])[:-1])
        tables = [np.array([factorial * np.bincount(here, terms.shape * terms.weight**n, count.size)
                            for n, factorial in ((1, 1.0), (2, 1.0), (3, 2.0))])
                  for here, terms in zip(places, sets, strict=True)]  # fmt: skip
        constants = np.array([terms.constant for terms in sets])
        return cls(np.bincount(place, waves) / count, tables, constants, correlation, amplitude)

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        size = amplitude if self.amplitude.relaxing else np.ones(1)
        return self._with_energy(amplitude, size**2 * np.ones(self.wavenumber.size), past)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(state.past, motions, bonding.strength)
        energies = []
        sizes = renewed_size(self.amplitude, state, motions, amplitude)
        for now, size, keep, renew in zip(amplitude, sizes, *self._shares(motions), strict=True):
            state = self._with_energy(now, keep[0] ** 2 * state.values + (renew[0] * size) ** 2, past)
            energies.append(state.energy)
        return state, np.array(energies)

    def _with_energy(self, amplitude: Array, values: Array, past: Array) -> Fluctuation:
        state = Fluctuation(values, amplitude, values, past)
        return state._replace(energy=self.cumulants(state)[0, :1])

    def cumulants(self, state: Fluctuation) -> Array:
        """First three cumulants of ΔΓ for each set, shape (sets, 3)."""
        size = state.values if self.amplitude.relaxing else state.amplitude**2 * state.values
        found = np.array([[of_order @ size**n for n, of_order in enumerate(table, 1)] for table in self.tables])
        found[:, 0] += state.amplitude[0] ** 2 * self.constants
        return found


def quiet(scenario: Scenario, sets: Sequence[Gammas]) -> Scenario:
    """A scene whose bonds and fluctuations are their ensemble means: cohorts or a rate equation, and cumulants."""
    bonds, part = table(scenario.population), cast("Any", scenario.fluctuations)
    changes: dict[str, Any] = {}
    if bonds.pop("sites", None):
        mean = {"model": "cohort", "tolerance": REFERENCE} if "rupture" in bonds else {"model": "rate"}
        changes["bonds"] = bonds | mean
    if part.per_member and part.spectrum.bond_made:
        kept = {key: table(part)[key] for key in ("spectrum", "paid_by_adhesion", "contact")}
        changes["shear"] = kept | {"model": "mean"}
    found = scenario.with_values(changes)
    if found.fluctuations.per_member:
        found.__dict__["process"] = Expected.of(sets, part.correlation, part.law)
    return found


class Walk(NamedTuple):
    """A run without noise at its records.

    Attributes
    ----------
    scenario, calm : Scenario
        The scene, and the one that was marched.
    steps : array of int, shape (records,)
        Clock steps of the records.
    means : array, shape (records, 4)
        The ``QUANTITIES`` without noise, in SI.
    strength : array, shape (records,)
        Strength of the bonds [Pa].
    noise : array, shape (records, 2)
        Variances of shear stress [Pa²] and bond fraction [1] of a single site; nan where they are not known.
    cumulants : array, shape (sets, records, 3)
        First three cumulants of ΔΓ for each set of terms.
    """

    scenario: Scenario
    calm: Scenario
    steps: NDArray[np.int_]
    means: Array
    strength: Array
    noise: Array
    cumulants: Array

    @classmethod
    def of(cls, scenario: Scenario, sets: Sequence[Gammas]) -> "Walk":
        """March a scene without noise, the terms of its ΔΓ and of others beside each other."""
        calm, clock, records = quiet(scenario, sets), scenario.clock, []
        process, given, bonds = cast("Any", calm.process), table(calm.population), cast("Any", calm.population)
        every = clock.stride * max(1, -(-clock.records // _MOST_RECORDS))
        for state in march(calm, np.arange(1)):
            if state.step % every and state.step != clock.steps:
                continue
            cumulants = np.outer(np.ones(len(sets)), [float(state.shear.energy[0]), 0.0, 0.0])
            if calm.fluctuations.per_member:
                cumulants = process.cumulants(state.shear)
            now = [np.ravel(READ[name](calm, trajectory_of(calm, state)))[0] for name in QUANTITIES]
            records.append((state.step, now, state.bonding.strength[0], state.bonding.varying[0], cumulants))
        steps, means, strength, varying, sums = (np.array(column) for column in zip(*records, strict=True))
        density, rest = (given["site_density"], bonds.bound_at_rest) if "rupture" in given else (math.nan, 1.0)
        share = np.clip(means[:, 1] * rest, 0.0, 1.0)
        noise = np.stack([density * varying, share * (1.0 - share) / rest**2], axis=1)
        return cls(scenario, calm, steps, means, strength, noise, sums.swapaxes(0, 1))

    @property
    def stretched(self) -> bool:
        """Whether bonds have a stretch, so that their stress is more than their fraction."""
        return "rupture" in table(self.calm.population)

    def statistics(self, which: int, sites: float) -> Array:
        """Statistics of the ``QUANTITIES`` at each record, shape (records, 4, 4), in SI.

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
            skewness of all but ΔΓ; where bonds or ΔΓ follow what differs between members; a radius that depends on
            the past of a fluctuating energy; and the correlation time, which no record has.
        """
        part, finite = self.scenario.fluctuations, math.isfinite(sites)
        mean, variance, third = self.cumulants[which].T
        spread = np.sqrt(variance)
        skewness = np.divide(third, spread**3, out=np.zeros(spread.shape), where=spread > 0.0)
        found = np.full((self.steps.size, 4, 4), np.nan)
        carried = part.per_member and self.calm.population.feeds_back  # with a contact that fluctuates
        if not carried:
            found[:, :2, 0] = self.means[:, :2]
            found[:, :2, 1] = np.sqrt(self.noise / sites) if finite else 0.0
        if not self.stretched:
            found[:, 0] = np.nan
        follows = (finite or carried) and part.reads_stress
        if not follows and part.per_member == self.calm.fluctuations.per_member:
            found[:, 2, :3] = np.stack([mean, spread, skewness], axis=1)
            found[:, 3, :2] = np.nan if carried else self._radii(found[:, 2, :3], found[:, 1, :2])
        return found

    def _radii(self, energy: Array, fraction: Array) -> Array:
        """Mean and standard deviation of the radius at each record, shape (records, 2)."""
        if not np.any(energy[:, 1]) and not np.any(fraction[:, 1]):
            return np.stack([self.means[:, 3], np.zeros(self.steps.size)], axis=1)
        found = np.full((self.steps.size, 2), np.nan)
        for k, (mean, spread, skewness) in enumerate([] if self.scenario.contact.lags else energy):
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
        scene, none, strength = self.calm, np.zeros(1), self.strength[record : record + 1]
        terms = balance(scene, np.maximum(fraction, 0.0), strength, np.maximum(energy, 0.0), none)
        motion = Motion(0, scene.times.at(int(self.steps[record])), 0.0, none, none, none, none)
        return scene.contact.start(motion, scene.times.duration, terms).radius


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
