"""Statements that a person reads, compared with answers by closed forms and integrals of their own."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.answers import Lens, RelaxationCycle, bell_moments
from numpy.testing import assert_allclose
from scipy import integrate, optimize, special

import sim

RADIUS, SHEAR, WORK, LOAD = 2e-3, 1.6e6, 42e-3, 4e-3
LENS = Lens(RADIUS, 4.0 * SHEAR, WORK)
STRESS, CRITICAL = 3e5, 1e-2
#: Relative deviation of a statement without a bound: of sums and roots in another order.
ROUNDING = 1e-9


def scene(**tables):
    """Return a lens of PDMS at 4 mN for two clock steps, with other tables."""
    base = {
        "clock": {"duration": 0.02, "step": 0.01},
        "solid": {"shear_modulus": SHEAR},
        "sphere": {"radius": RADIUS},
        "adhesion": {"work": WORK},
        "contact": {"load": LOAD},
    }
    return sim.load({**base, **tables})


class Answer(NamedTuple):
    """Answers to statements of one scene.

    Attributes
    ----------
    tables : dict
        Tables of the scene.
    expected : dict
        The answer for each quantity, over the sweep and the records if it depends on them.
    """

    tables: dict[str, Any]
    expected: dict[str, Any]


def check(answer, late=False):
    """Compare the statements of a scene with its answers, each within its bound, or exactly without one."""
    run = sim.Run(sim.run(scene(**answer.tables)))
    for name, expected in answer.expected.items():
        statement = run.statistic(name, late=late)
        mean = statement.sel(statistic="mean")
        value = np.broadcast_to(np.asarray(expected, float).T, mean.shape[::-1]).T
        bound = ROUNDING * np.abs(value)
        if "bound" in statement["statistic"]:
            bound = bound + np.nan_to_num(statement.sel(statistic="bound").to_numpy())
        off = np.abs(mean.to_numpy() - value)
        assert np.all(off <= bound), f"{name}: {mean.values} is not {value}"


# --- contacts at rest ---

LOADS = np.array([-0.3e-3, 0.0, 1e-3, 4e-3, 16e-3])
AT_LOADS = LENS.at_load(LOADS)
INDENTATIONS = np.array([-0.5e-6, 0.0, 2e-6])
AT_INDENTATIONS = np.array([LENS.at_displacement(each) for each in INDENTATIONS])
STIFFNESS = 500.0
BEHIND = np.array([LENS.at_displacement(each, STIFFNESS) for each in INDENTATIONS])
POISSON = 0.3
STIFFER = Lens(RADIUS, 2.0 * SHEAR / (1.0 - POISSON), WORK)
YOUNGS, OTHER = 5e6, 0.4
#: Of two elastic bodies the compliances 1/E* add.
SOFTER = Lens(RADIUS, 1.0 / (0.25 / SHEAR + (1.0 - OTHER**2) / YOUNGS), WORK)

AT_REST = {
    "load": Answer(
        {"sweep": {"contact.load": LOADS.tolist()}},
        {
            "contact_radius": AT_LOADS,
            "contact_area": np.pi * AT_LOADS**2,
            "indentation": LENS.indentation_of(AT_LOADS),
            "jkr_radius": AT_LOADS,
            "hertz_radius": LENS.at_load(LOADS, 0.0) * (LOADS > 0.0),
            "area_ratio": 1.0,
        },
    ),
    "indentation": Answer(
        {
            "contact": {"indentation": 0.0},
            "sweep": {"contact.indentation": INDENTATIONS.tolist()},
        },
        {
            "contact_radius": AT_INDENTATIONS,
            "normal_load": LENS.load_of(AT_INDENTATIONS),
        },
    ),
    "displacement behind a stiffness": Answer(
        {
            "contact": {"displacement": 0.0, "stiffness": STIFFNESS},
            "sweep": {"contact.displacement": INDENTATIONS.tolist()},
        },
        {
            "contact_radius": BEHIND,
            "normal_load": LENS.load_of(BEHIND),
            "indentation": LENS.indentation_of(BEHIND),
        },
    ),
    "compressible solid": Answer(
        {"solid": {"shear_modulus": SHEAR, "poisson_ratio": POISSON}},
        {"contact_radius": STIFFER.at_load(LOAD)},
    ),
    "elastic sphere": Answer(
        {
            "solid": {
                "shear_modulus": SHEAR,
                "counter_body": {"youngs_modulus": YOUNGS, "poisson_ratio": OTHER},
            }
        },
        {"contact_radius": SOFTER.at_load(LOAD)},
    ),
}


# --- steady sliding ---

SPEEDS = np.array([1e-4, 1e-3, 1e-2, 1e-1])
OVER_SPEEDS = {
    "drive": {"speed": SPEEDS[0]},
    "sweep": {"drive.speed": SPEEDS.tolist()},
}
STEADY = {"model": "steady", "critical_speed": CRITICAL, "stress": STRESS}
LEFT = 1.0 / (1.0 + SPEEDS / CRITICAL)
SHARE, RMS, LENGTH = 0.6, 150e3, 2e-6
BONDED = WORK * (1.0 - SHARE + SHARE * LEFT)
#: (3√π/16) σ²ξ/G of a Gaussian correlation σ² exp(−r²/ξ²).
ENERGY = 3.0 * math.sqrt(math.pi) / 16.0 * RMS**2 * LENGTH / SHEAR
GAUSSIAN = {"model": "mean", "spectrum": {"model": "gaussian", "rms": RMS}}
GAUSSIAN["spectrum"]["length"] = LENGTH


def area(work):
    return np.pi * LENS.at_load(LOAD, work) ** 2


FULL = area(WORK)
REVERSIBLE = 0.05


def mean_stress_radius(stress):
    """Return the radius if adhesion pays a share of the energy of the mean stress, 6τ²a/(πE*)."""

    def missing(radius):
        paid = REVERSIBLE * 6.0 * stress**2 * radius / (np.pi * LENS.modulus)
        return radius - float(LENS.at_load(LOAD, WORK - paid))

    return optimize.brentq(missing, 1e-6, 1e-3, xtol=1e-18, rtol=1e-14)


STRESSES = np.array([1e4, 3e4, 1e5])
STRESSED = np.pi * np.array([mean_stress_radius(each) for each in STRESSES]) ** 2

SLIDING = {
    "bonds": Answer(
        {"bonds": STEADY, "adhesion": {"work": WORK, "bond_share": SHARE}}
        | OVER_SPEEDS,
        {
            "bond_fraction": LEFT,
            "shear_stress": STRESS * LEFT,
            "work_of_adhesion": BONDED,
            "area_ratio": area(BONDED) / FULL,
            "lost_to_bonds": 1.0 - area(BONDED) / FULL,
            "friction_force": STRESS * LEFT * area(BONDED),
        },
    ),
    "bonds and the mean of the fluctuations": Answer(
        {
            "bonds": STEADY,
            "adhesion": {"work": WORK, "bond_share": SHARE},
            "shear": GAUSSIAN,
        }
        | OVER_SPEEDS,
        {
            "fluctuation_energy": ENERGY,
            "lost_to_fluctuations": (area(BONDED) - area(BONDED - ENERGY)) / FULL,
            "lost_to_fluctuations_first": (FULL - area(WORK - ENERGY)) / FULL,
            "lost_to_bonds_last": (area(WORK - ENERGY) - area(BONDED - ENERGY)) / FULL,
        },
    ),
    "a mean stress that adhesion pays in part": Answer(
        {
            "contact": {"load": LOAD, "reversible": REVERSIBLE},
            "bonds": {"model": "none", "stress": STRESSES[0]},
            "drive": {"speed": 1e-3},
            "sweep": {"bonds.stress": STRESSES.tolist()},
        },
        {"lost_to_mean_stress": (FULL - STRESSED) / FULL},
    ),
}


# --- the energy of a spectrum ---

WAVE, ANGLE = 24e-6, 0.5
FIRST, LAST = 2.0 * np.pi / 60e-6, 2.0 * np.pi / 16e-6
HURST = 0.3


def self_affine_energy():
    """Return ΔΓ of a plateau and a power law, by C(q) = σ²-normalised and (3/16πG) ∫C dq."""
    corner = 2.0 * np.pi / 24e-6

    def density(q):
        return min(1.0, (q / corner) ** (-2.0 - 2.0 * HURST))

    pieces = {"points": [corner], "epsabs": 0.0, "epsrel": 1e-12}
    square = integrate.quad(lambda q: q * density(q), FIRST, LAST, **pieces)[0]
    line = integrate.quad(density, FIRST, LAST, **pieces)[0]
    return 3.0 / (16.0 * np.pi * SHEAR) * 2.0 * np.pi * RMS**2 * line / square


SPECTRA = {
    "band": (
        {"model": "band", "rms": RMS, "longest": 60e-6, "shortest": 16e-6},
        3.0 * RMS**2 / (4.0 * SHEAR * (FIRST + LAST)),
    ),
    "von_karman": (
        {"model": "von_karman", "rms": RMS, "length": LENGTH, "hurst": HURST},
        0.375
        * math.sqrt(math.pi)
        * special.gamma(HURST + 0.5)
        / special.gamma(HURST)
        * RMS**2
        * LENGTH
        / SHEAR,
    ),
    "ripple": (
        {"model": "ripple", "amplitude": RMS, "wavelength": WAVE, "angle": ANGLE},
        RMS**2 * WAVE / (16.0 * np.pi * SHEAR) * (1.0 + math.sin(ANGLE) ** 2),
    ),
    "self_affine": (
        {
            "model": "self_affine",
            "rms": RMS,
            "hurst": HURST,
            "longest": 60e-6,
            "rolloff": 24e-6,
            "shortest": 16e-6,
        },
        self_affine_energy(),
    ),
}
ONSET = {"model": "onset", "speed": 2e-3, "width": 0.3, "floor": 0.1}
SIZE = 0.1 + 0.9 / (1.0 + (SPEEDS / 2e-3) ** (-1.0 / 0.3))
ENERGIES = {
    name: Answer(
        {"shear": {"model": "mean", "spectrum": spectrum}, "drive": {"speed": 1e-3}},
        {"fluctuation_energy": energy},
    )
    for name, (spectrum, energy) in SPECTRA.items()
} | {
    "an onset": Answer(
        {"shear": GAUSSIAN | {"amplitude": ONSET}} | OVER_SPEEDS,
        {"fluctuation_energy": SIZE**2 * ENERGY},
    )
}


# --- bonds with a rupture law ---

FORCE_FREE, BELL_FORCE, BOND, REBINDING, SITES = 200.0, 4e-12, 4e-7, 400.0, 1e17
STRETCHED = {
    "bond_stiffness": BOND,
    "rebinding_rate": REBINDING,
    "site_density": SITES,
}
BELL = {
    "model": "bell",
    "zero_force_rate": FORCE_FREE,
    "bell_force": BELL_FORCE,
}
#: Speed in f_b k0/κ, and rebinding rate in k0.
RATIOS, BETA = BOND * SPEEDS / (FORCE_FREE * BELL_FORCE), REBINDING / FORCE_FREE
AT_RATIOS = special.lambertw(RATIOS).real
#: Bound sites of the first moment: each breaks at the rate ε/W(ε).
BOUND = BETA / (BETA + RATIOS / AT_RATIOS)
AT_REST_BOUND = BETA / (1.0 + BETA)
LIVES, PULLS = np.array([bell_moments(ratio) for ratio in RATIOS]).T
RENEWED = LIVES * BETA / (1.0 + BETA * LIVES)
PULLED = RATIOS * PULLS * BETA / (1.0 + BETA * LIVES)
CONSTANT = {"model": "constant", "rate": FORCE_FREE}
RELAXING = {
    "model": "rate",
    "critical_speed": CRITICAL,
    "rebinding_rate": REBINDING,
    "stress": STRESS,
    "start": "bonded",
}
TIMES, FAST = np.linspace(0.0, 5e-3, 6), 2.0 * CRITICAL
COURSE = 1.0 / 3.0 + 2.0 / 3.0 * np.exp(-3.0 * REBINDING * TIMES)

BONDS = {
    "constant rate, first moment": Answer(
        {"bonds": STRETCHED | {"model": "rate", "rupture": CONSTANT}} | OVER_SPEEDS,
        {
            "bond_fraction": 1.0,
            "shear_stress": SITES * AT_REST_BOUND * BOND * SPEEDS / FORCE_FREE,
        },
    ),
    "Bell, first moment": Answer(
        {"bonds": STRETCHED | {"model": "rate", "rupture": BELL}} | OVER_SPEEDS,
        {
            "bond_fraction": BOUND / AT_REST_BOUND,
            "shear_stress": SITES * BELL_FORCE * AT_RATIOS * BOUND,
        },
    ),
    "without a stretch, from all bonds": Answer(
        {
            "bonds": RELAXING,
            "drive": {"speed": FAST},
            "clock": {"duration": 5e-3, "step": 1e-3},
        },
        {"bond_fraction": COURSE, "shear_stress": STRESS * COURSE},
    ),
}
EXACT = AT_REST | SLIDING | ENERGIES | BONDS


@pytest.mark.parametrize("name", EXACT)
def test_a_statement_of_a_run_without_noise_is_its_closed_form(name):
    check(EXACT[name])


def test_bonds_resolved_by_their_stretch_are_a_renewal_process_within_their_tolerance():
    tolerance = 1e-4
    bonds = STRETCHED | {"model": "cohort", "rupture": BELL, "tolerance": tolerance}
    run = sim.Run(sim.run(scene(bonds=bonds, **OVER_SPEEDS)))
    expected = {
        "bond_fraction": RENEWED / AT_REST_BOUND,
        "shear_stress": SITES * BELL_FORCE * PULLED,
    }
    for name, values in expected.items():
        mean = run.statistic(name, late=True).sel(statistic="mean")
        assert_allclose(mean, values, rtol=tolerance, err_msg=name)
