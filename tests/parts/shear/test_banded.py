"""The banded process: its law at one time, at two times, through jumps of the speed, and its bits.

Every law is held against that of all modes of the cell: the distribution of Σ w Exp(1) by its
characteristic function, the covariance Σ w² e^(−2∫λdt), and a plain simulation of each mode.
"""

import functools
import itertools
import math
from itertools import product

import numpy as np
import pytest
from helpers.draws import FIVE_SIGMA
from helpers.scenes import (
    CELL,
    SPECTRUM,
    Clock,
    advanced,
    bonds,
    drive,
    march,
    scene,
    shear,
)
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline
from scipy.stats import kstest, ncx2

from sim.numerics.noise import Noise
from sim.parts.exchange import Bonding
from sim.parts.shear.bands import BandedProcess, Bands
from sim.parts.shear.modes import modes
from sim.parts.shear.process import (
    Constant,
    Diffusion,
    Fluctuation,
    Onset,
    Slip,
    Stress,
    Time,
    Wave,
)
from sim.solid import HalfSpace
from sim.spectrum.families import AnisotropicGaussian, Ripple, SelfAffine, VonKarman

G, MEMBERS = 1.6e6, 400
UNLOADED = Bonding(np.ones(1), np.zeros(1), np.zeros(1))

SPECTRA = {
    "band": (SPECTRUM, None, 0.5),
    "self-affine": (
        SelfAffine(150e3, 0.8, longest=100e-6, rolloff=60e-6, shortest=8e-6),
        None,
        0.5,
    ),
    "exponential, nu 0.3": (VonKarman(150e3, 30e-6, 0.5), 41, 0.3),
    "anisotropic, turned": (
        AnisotropicGaussian(150e3, 20e-6, 60e-6, angle=0.4),
        24,
        0.5,
    ),
}


def process_of(name, correlation=None, tolerance=0.01, amplitude=None):
    """The banded process of a spectrum, and the weights [J/m^2] and wavenumbers of all modes it stands for."""
    spectrum, points, poisson_ratio = SPECTRA[name]
    laws = {
        "correlation": correlation or Slip(length=1.0),
        "amplitude": amplitude or Constant(),
    }
    recipe = shear.Banded(
        spectrum=spectrum, **laws, cell=CELL, points=points, tolerance=tolerance
    )
    pairs = modes(spectrum, CELL, points)
    return (
        recipe.process(HalfSpace(G, poisson_ratio), 1.0),
        pairs.energies(HalfSpace(G, poisson_ratio)),
        np.hypot(pairs.qx, pairs.qy),
    )


def moved(step, path=0.0, duration=1.0):
    """A step of given length [m] and duration [s]."""
    return drive.Steady(speed=path / duration).motion(step, 0.0, duration, duration)


def distribution(weights, shapes, at):
    """P(Σ weight Gamma(shape) <= x) at increasing x, from the characteristic function Π (1 − i w t)^(−shape).

    Gil-Pelaez (1951) on the midpoints of steps 2π/period (Davies 1973): off by the probability beyond
    ``period`` − x, here e^-45, and by what |characteristic function| < 1e-14 leaves out.
    """
    weights, shapes = np.broadcast_arrays(
        np.asarray(weights, float), np.asarray(shapes, float)
    )
    largest, deviation = weights.max(), math.sqrt(np.sum(shapes * weights**2))
    period = at[-1] + np.sum(shapes * weights) + 12.0 * deviation + 45.0 * largest
    step, last = 2.0 * math.pi / period, 1.0 / deviation
    while np.sum(0.5 * shapes * np.log1p((weights * last) ** 2)) < 32.0:
        last *= 1.1
    half = np.arange(math.ceil(last / step)) + 0.5
    logarithm = np.zeros(half.size, dtype=complex)
    for weight, shape in zip(weights, shapes, strict=True):
        logarithm -= shape * np.log(1.0 - 1j * weight * step * half)
    return (
        0.5
        - np.sum(
            np.exp(logarithm - 1j * np.multiply.outer(at, step * half)).imag / half,
            axis=1,
        )
        / math.pi
    )


def law_of(weights, shapes=1.0):
    """The distribution function of Σ weight Gamma(shape), tabulated over all that a sample can reach."""
    mean, deviation = np.sum(weights * shapes), math.sqrt(np.sum(weights**2 * shapes))
    table = np.linspace(0.0, mean + 25.0 * deviation, 1200)
    return CubicSpline(table, distribution(weights, shapes, table))


@pytest.mark.parametrize(
    "draws", [20_000, pytest.param(100_000, marks=pytest.mark.verify)]
)
def test_stationary_draws_follow_the_law_of_all_modes(draws):
    noise, detectable = (
        Noise(5, "shear", np.arange(MEMBERS)),
        math.sqrt(math.log(2.0 / FIVE_SIGMA) / (2.0 * draws)),
    )
    for name, tolerance in [*itertools.product(SPECTRA, [0.01]), ("band", 0.1)]:
        process, weights, _ = process_of(name, tolerance=tolerance)
        exact, banded = (
            law_of(weights),
            law_of(process.bands.weight, 0.5 * process.bands.freedom),
        )
        changed = np.max(np.abs(banded(banded.x) - exact(banded.x)))
        assert changed < 0.1 * tolerance
        sample = np.ravel(
            [
                process.start(moved(step), UNLOADED, noise).energy
                for step in range(draws // MEMBERS)
            ]
        )
        assert kstest(sample, banded).pvalue > FIVE_SIGMA
        if tolerance == 0.01:
            # far below what so many draws can see, by Kolmogorov's law
            assert changed < 0.1 * detectable
            assert kstest(sample, exact).pvalue > FIVE_SIGMA
        assert abs(sample.mean() - weights.sum()) < 5.0 * np.sqrt(
            np.sum(weights**2) / draws
        )


def lone(freedom, copies=1000):
    """A process of equal bands of rate 1/s."""
    bands = Bands(np.ones(copies), np.full(copies, freedom), np.ones(copies), {})
    return BandedProcess(bands, {}, Time(time=1.0), Constant())


def stepped(process, start, durations, seed=1):
    """X of 25 members and all bands after steps of given ``durations`` [s] from one value."""
    noise = Noise(seed, "shear", np.arange(25))
    state = Fluctuation(
        np.zeros(25), np.ones(1), np.full((25, len(process.bands.weight)), float(start))
    )
    for step, duration in enumerate(durations, 1):
        state = advanced(process, state, moved(step, 0.0, duration), UNLOADED, noise)
    return state.values.ravel()


def test_a_step_of_any_length_or_division_has_the_noncentral_chi_square_law_and_its_moments():
    for durations, start, freedom in product(
        [(0.4,), (0.2, 0.2), (0.01, 0.09, 0.3)], [0.0, 30.0], [2.0, 2.7, 40.3]
    ):
        keep, renewed = math.exp(-2.0 * 0.4), -math.expm1(-2.0 * 0.4)
        sample = stepped(lone(freedom), start, durations) / renewed
        assert (
            kstest(sample, ncx2.cdf, args=(freedom, keep * start / renewed)).pvalue
            > FIVE_SIGMA
        )
    for ratio, freedom in product([1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6], [2.0, 7.3, 1e5]):
        start = 1.5 * freedom
        keep, renewed = math.exp(-2.0 * ratio), -math.expm1(-2.0 * ratio)
        mean = keep * start + renewed * freedom
        spread = 2.0 * freedom * renewed**2 + 4.0 * renewed * keep * start
        # the fourth cumulant
        fourth = 48.0 * (freedom * renewed**4 + 4.0 * renewed**3 * keep * start)
        for durations in ((ratio,), (0.5 * ratio, 0.5 * ratio)):
            change = stepped(lone(freedom), start, durations) - start
            rounding = 1e-15 * start  # of X itself, where a change is as small
            assert (
                abs(change.mean() - (mean - start))
                < 5.0 * np.sqrt(spread / change.size) + rounding
            )
            assert (
                abs(change.var() - spread)
                < 5.0 * np.sqrt((fourth + 2.0 * spread**2) / change.size) + rounding**2
            )


def two_times(process, step_of, draws, seed=6, members=MEMBERS):
    """ΔΓ at the two ends of one step of all draws, shape (2, draws); ``step_of`` a step's number gives its motion."""
    noise, energies = Noise(seed, "shear", np.arange(members)), []
    for pair in range(draws // members):
        before = process.start(moved(2 * pair), UNLOADED, noise)
        energies.append(
            (
                before.energy,
                advanced(
                    process, before, step_of(2 * pair + 1), UNLOADED, noise
                ).energy,
            )
        )
    return np.concatenate(energies, axis=1)


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_the_joint_law_of_two_times_is_that_of_all_modes(ratio):
    draws = 20_000
    memories = [Wave(waves=0.5)]
    memories += (
        [Time(time=1e-3), Slip(length=2e-6), Diffusion(diffusivity=1e-9)]
        if ratio == 1.0
        else []
    )
    for correlation in memories:
        process, weights, wavenumbers = process_of("band", correlation, tolerance=0.001)
        # the longest wave keeps e^(−ratio) of its amplitude
        longest, kind = wavenumbers.min(), type(correlation)
        path = {Slip: 2e-6, Wave: math.pi / longest}.get(kind, 0.0)
        duration = {Time: 1e-3, Diffusion: 1e9 / longest**2}.get(kind, 1.0)
        exponents = ratio * (wavenumbers / longest) ** correlation.power
        step = functools.partial(moved, path=ratio * path, duration=ratio * duration)
        first, second = two_times(process, step, draws)
        before, after = first - weights.sum(), second - weights.sum()
        exact = np.sum(weights**2 * np.exp(-2.0 * exponents))
        assert abs(np.mean(before * after) - exact) < 5.0 * np.std(
            before * after
        ) / np.sqrt(draws)
        change = (after - before) ** 2
        exact = 2.0 * np.sum(weights**2 * -np.expm1(-2.0 * exponents))
        assert abs(change.mean() - exact) < 5.0 * change.std() / np.sqrt(draws)
        # every mode by itself: Σ w |a|² with complex amplitudes that keep e^(−exponent), both scaled by √2
        rng, products = np.random.default_rng(3), []
        for _ in range(draws // MEMBERS):
            a, fresh = rng.standard_normal((2, 2, MEMBERS, len(weights)))
            later = (
                np.exp(-exponents) * a + np.sqrt(-np.expm1(-2.0 * exponents)) * fresh
            )
            products.append(
                0.25
                * math.prod(np.sum(weights * x**2, axis=(0, 2)) for x in (a, later))
            )
        for share in (0.1, 0.5, 0.9):
            below = np.mean(first * second < np.quantile(products, share))
            assert abs(below - share) < 5.0 * np.sqrt(
                share * (1.0 - share) * 2.0 / draws
            )


def march_energies(part, motion, population=None):
    population = population or bonds.Unbroken(stress=2e5)
    scenario = scene(
        shear=part,
        drive=motion,
        bonds=population,
        clock=Clock(duration=5e-3, step=1e-3),
    )
    states = list(march(scenario, np.arange(3)))
    return states, np.array([state.shear.energy for state in states])


def test_amplitude_multiplies_the_unit_process_or_the_mean_of_the_cell_at_once():
    recipe = {
        "spectrum": SPECTRUM,
        "cell": CELL,
        "correlation": Wave(waves=1.0),
        "tolerance": 0.1,
    }
    population = bonds.Steady(critical_speed=2e-3, stress=4e5)
    for motion in (
        drive.Steady(speed=4e-3),
        drive.Ramp(start=1e-4, stop=2e-2, scale="log"),
    ):
        _, unit = march_energies(shear.Banded(**recipe), motion, population)
        for amplitude in (
            Constant(),
            Onset(speed=2e-3, width=0.3, floor=0.1),
            Stress(reference=1e5),
        ):
            part = shear.Banded(**recipe, amplitude=amplitude)
            states, grown = march_energies(part, motion, population)
            factors = [
                amplitude.factor(state.drive.speed, state.bonding.strength)
                for state in states
            ]
            assert_allclose(grown, unit * np.square(factors), rtol=1e-14, atol=0)


def relaxing(amplitude, motion, times):
    """The weights of all modes, and ΔΓ of draws at some times, shape (times, draws), with a memory of 1 ms."""
    process, weights, _ = process_of(
        "self-affine", Time(time=1e-3), amplitude=amplitude
    )
    noise, energies = Noise(4, "shear", np.arange(MEMBERS)), []
    for run in range(50):
        state = process.start(
            motion.motion(8 * run, 0.0, 0.0, times[-1]), UNLOADED, noise
        )
        energies.append([state.energy])
        for i, ends in enumerate(itertools.pairwise(times), 1):
            state = advanced(
                process,
                state,
                motion.motion(8 * run + i, *ends, times[-1]),
                UNLOADED,
                noise,
            )
            energies[-1].append(state.energy)
    return weights, np.concatenate(energies, axis=1)


def test_relaxing_amplitude_follows_all_modes_after_a_jump_and_the_mean_of_the_ends_of_a_step():
    # g is constant after the jump: equal rates keep the unit field's law, times g0² e^(−2s) + g1² (1 − e^(−2s))
    times = (0.0, 1e-3, 1.2e-3, 1.7e-3, 9e-3)
    jump = drive.Table(time=(0.0, 1e-3, 1e-3, 1.0), speed=(1e-5, 1e-5, 1.0, 1.0))
    weights, samples = relaxing(
        Onset(speed=1e-3, width=0.05, floor=0.5, relaxing=True), jump, times
    )
    law = law_of(weights)
    for time, sample in zip(times, samples, strict=True):
        left = math.exp(-2.0 * max(time - 1e-3, 0.0) / 1e-3)
        size = 0.25 * left + 1.0 * (1.0 - left)
        assert abs(sample.mean() - size * weights.sum()) < 5.0 * size * np.sqrt(
            np.sum(weights**2) / sample.size
        )
        assert kstest(sample / size, law).pvalue > FIVE_SIGMA
    amplitude = Onset(speed=2e-3, width=0.5, floor=0.1, relaxing=True)
    ramp, times = drive.Ramp(start=5e-4, stop=2e-2), np.linspace(0.0, 4e-3, 4)
    weights, samples = relaxing(amplitude, ramp, times)
    squares = [
        amplitude.factor(ramp.motion(1, time, time, 4e-3).speed, 0.0)[0] ** 2
        for time in times
    ]
    sizes = [squares[0]]
    for before, after in itertools.pairwise(squares):
        sizes.append(
            sizes[-1]
            + (-math.expm1(-2.0 * times[1] / 1e-3))
            * (0.5 * (before + after) - sizes[-1])
        )
    for size, sample in zip(sizes, samples, strict=True):
        assert abs(sample.mean() - size * weights.sum()) < 5.0 * size * np.sqrt(
            np.sum(weights**2) / sample.size
        )


def test_a_contact_at_rest_keeps_its_energy_and_bad_input_is_refused_at_its_key():
    part = shear.Banded(spectrum=SPECTRUM, cell=CELL, correlation=Wave(waves=1.0))
    _, energies = march_energies(part, drive.Steady(speed=0.0))
    assert np.all(energies == energies[0])
    part = shear.Banded(
        spectrum=Ripple(amplitude=0.0, wavelength=24e-6),
        cell=CELL,
        correlation=Slip(length=1e-6),
    )
    assert np.all(march_energies(part, drive.Steady(speed=1e-3))[1] == 0.0)
