"""Statements that a person reads, compared with answers by closed forms and integrals of their own."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.answers import GammaSum, Lens, RelaxationCycle, bell_moments, gaussian_cell
from numpy.testing import assert_allclose
from scipy import integrate, optimize, special, stats

import sim
from sim.laws import layer
from sim.read.observables import radius_at_work

RADIUS, SHEAR, WORK, LOAD = 2e-3, 1.6e6, 42e-3, 4e-3
LENS = Lens(RADIUS, 4.0 * SHEAR, WORK)
STRESS, CRITICAL = 3e5, 1e-2
STEP = 0.01
#: Relative deviation of a statement without a bound: of sums and roots in another order.
ROUNDING = 1e-9


def scene(**tables):
    """Return a lens of PDMS at 4 mN for two clock steps, with other tables."""
    base = {
        "clock": in_time(2),
        "solid": {"shear_modulus": SHEAR},
        "sphere": {"radius": RADIUS},
        "adhesion": {"work": WORK},
        "contact": {"load": LOAD},
    }
    return sim.load({**base, **tables})


def in_time(steps, step=STEP):
    """Return the table of a clock of so many steps."""
    return {"duration": steps * step, "step": step}


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


def check(answer, late=False, rounding=ROUNDING):
    """Compare the statements of a scene with its answers, each within its bound, or exactly without one."""
    dataset = sim.run(scene(**answer.tables))
    run, frame = sim.Run(dataset), sim.stats(dataset)
    for name, expected in answer.expected.items():
        statement = run.statistic(name, late=late)
        mean = statement.sel(statistic="mean")
        if name in frame:
            shown = run.statistic(name, late=run.has_one_row_each)
            shown = shown.sel(statistic="mean").to_numpy().ravel()
            # a value of the whole run stands in each row
            shown = shown if shown.size > 1 else shown.item()
            assert_allclose(frame[name], shown, rtol=1e-14, err_msg=name)
        value = np.broadcast_to(np.asarray(expected, float).T, mean.shape[::-1]).T
        bound = rounding * np.abs(value)
        if "bound" in statement["statistic"]:
            bound = bound + np.nan_to_num(statement.sel(statistic="bound").to_numpy())
        off = np.abs(mean.to_numpy() - value)
        is_right = np.where(np.isnan(value), np.isnan(mean), off <= bound)
        assert np.all(is_right), f"{name}: {mean.values} is not {value}"


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


def on_layer(radius, work, thickness):
    """Return load and indentation of a contact of a radius on a layer, in equilibrium with a work of adhesion."""
    e1, e2, g1, g2 = (
        layer.contact_function(which, radius / thickness)
        for which in (layer.E_1, layer.E_2, layer.G_1, layer.G_2)
    )
    missing = np.sqrt(0.5 * np.pi * radius * work / SHEAR)
    depth = (radius**2 * e2 / RADIUS - missing) / e1
    return 8.0 * SHEAR * (depth * radius * g1 - radius**3 * g2 / RADIUS), depth


@pytest.mark.parametrize("mount", ["load", "indentation", "displacement"])
def test_a_contact_on_a_layer_is_read_as_it_was_computed_at_each_thickness(mount):
    stiffness, thicknesses = 1e3, np.array([2e-6, 1e-5, 1e-4])
    held = {"load": LOAD, "indentation": 1e-6, "displacement": 2e-6}
    contact = {mount: held[mount]}
    if mount == "displacement":
        contact["stiffness"] = stiffness
    dataset = sim.run(
        scene(
            solid={"shear_modulus": SHEAR, "thickness": thicknesses[0]},
            contact=contact,
            sweep={"solid.thickness": thicknesses.tolist()},
        )
    )
    radius = dataset["contact_radius"].isel(t=-1).to_numpy()
    load, depth = on_layer(radius, WORK, thicknesses)
    reached = {"load": load, "indentation": depth}
    reached["displacement"] = depth + load / stiffness
    assert_allclose(reached[mount], held[mount], rtol=1e-9, atol=0)
    assert_allclose(dataset["normal_load"].isel(t=-1), load, rtol=1e-9, atol=0)
    assert_allclose(dataset["indentation"].isel(t=-1), depth, rtol=1e-9, atol=0)
    again = radius_at_work(dataset, dataset["adhesion_work"])
    assert_allclose(again.to_numpy().reshape(3, -1)[:, -1], radius, rtol=1e-12, atol=0)
    if mount == "load":
        assert np.all(
            dataset["jkr_pull_off_load"] < 1.01 * -1.5 * np.pi * WORK * RADIUS
        )


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


# --- openings, closings and cycles of the contact ---

#: JKR's units of radius, load and indentation.
MAUGIS = 4.0 * LENS.modulus / 3.0
IN_RADIUS = (np.pi * WORK * RADIUS**2 / MAUGIS) ** (1.0 / 3.0)
IN_LOAD = np.pi * WORK * RADIUS
IN_DEPTH = (np.pi**2 * WORK**2 * RADIUS / MAUGIS**2) ** (1.0 / 3.0)
#: A fold has a double root, which is known to the root of a rounding only.
AT_FOLD = 1e-6
FOLD, FOLD_DEPTH = -1.5 * IN_LOAD, -((1.5) ** (2.0 / 3.0)) / 3.0 * IN_DEPTH
GRIPS, GRIPS_DEPTH = -5.0 / 6.0 * IN_LOAD, -3.0 * 6.0 ** (-2.0 / 3.0) * IN_DEPTH
TOUCHING = LENS.at_load(np.zeros(1)).item()
SOFT = 200.0
OPENS = LENS.limit(SOFT)
#: A sphere that touches at the displacement 0 jumps to the radius (8/3)^(1/3) only if it is held hard.
CLOSED = optimize.brentq(
    lambda a: LENS.displacement_of(a, SOFT), OPENS, RADIUS, xtol=1e-18
)
LOOP = LENS.jump(SOFT, OPENS, 0.0) + LENS.jump(SOFT, 0.0, CLOSED)
CYCLE = {"from": 2e-6, "to": -6e-6, "cycles": 1}

TURNS = {
    "a falling load": Answer(
        {"contact": {"load": {"from": 4e-3, "to": -1e-3}}},
        {
            "pull_off_load": FOLD,
            "pull_off_time": (4e-3 - FOLD) / 5e-3,
            "pull_off_displacement": FOLD_DEPTH,
            "lowest_load": FOLD,
            "ever_detached": 1.0,
            "total_dissipated": np.nan,
        },
    ),
    "a rising load": Answer(
        {"contact": {"load": {"from": -1e-3, "to": 4e-3}}},
        {
            "jump_in_load": 0.0,
            "jump_in_time": 0.2,
            # adhesion less the elastic energy of JKR's contact without a load
            "total_dissipated": 2.0 / 15.0 * 4.0 * SHEAR * TOUCHING**5 / RADIUS**2,
        },
    ),
    "a falling indentation": Answer(
        {"contact": {"indentation": {"from": 2e-6, "to": -3e-6}}},
        {
            "pull_off_load": GRIPS,
            "pull_off_time": (2e-6 - GRIPS_DEPTH) / 5e-6,
            "pull_off_displacement": GRIPS_DEPTH,
            "detachments": 1.0,
            "total_dissipated": LENS.jump(np.inf, 6.0 ** (-1.0 / 3.0) * IN_RADIUS, 0.0),
        },
    ),
    "a cycle behind a stiffness": Answer(
        {
            "contact": {
                "displacement": CYCLE,
                "stiffness": SOFT,
                "after_pull_off": "reattach",
            }
        },
        {
            "pull_off_load": LENS.load_of(OPENS),
            "jump_in_load": LENS.load_of(CLOSED),
            "jump_in_displacement": 0.0,
            "jump_in_time": 0.875,
            "loop_energy": LOOP,
            "loop_dissipation": LOOP,
            "total_dissipated": LOOP,
        },
    ),
}


@pytest.mark.parametrize("step", [0.01, 0.004])
@pytest.mark.parametrize("name", TURNS)
def test_openings_closings_and_cycles_are_those_of_jkr_within_their_bounds(name, step):
    clock = {"clock": {"duration": 1.0, "step": step}}
    check(TURNS[name]._replace(tables=TURNS[name].tables | clock), rounding=AT_FOLD)


# --- a slider behind a spring or under a force ---

NO_SHARE = {"work": WORK, "bond_share": 0.0}
STRENGTH = STRESS * FULL
WEIGHT = 0.1 * STRENGTH / CRITICAL
STICKS = RelaxationCycle(STRENGTH, CRITICAL, WEIGHT, 1000.0, 0.2 * CRITICAL)
#: The same with a dashpot that lets the slider slip within a hundredth of a clock step.
SNAPS = STICKS._replace(damping=0.01 * WEIGHT)
#: A dashpot that is larger than the fall of friction makes sliding steady.
HEAVY, CREEP = 2.0 * STRENGTH / CRITICAL, 0.2
SPRING = {
    "model": "spring",
    "stage": STICKS.stage,
    "stiffness": STICKS.stiffness,
    "contact_stiffness": "rigid",
}


def creeping():
    """Return the bound share N and the speed under a constant force Q of bonds with β = 1.

    In units of all sites, k0 and f_b: (1 − N) = N exp(Q/N), and the speed is Q/N exp(Q/N).
    """
    number = optimize.brentq(
        lambda n: (1.0 - n) - n * math.exp(CREEP / n), 0.25, 0.5, xtol=1e-15
    )
    return number, CREEP / number * math.exp(CREEP / number)


NUMBER, CREEP_SPEED = creeping()
SLIDER = {
    "steady behind a spring": Answer(
        {
            "adhesion": NO_SHARE,
            "bonds": STEADY,
            "drive": SPRING | {"damping": HEAVY},
            "clock": in_time(100),
        },
        {
            "speed": STICKS.stage,
            "friction_force": STRENGTH / 1.2,
            "spring_force": STRENGTH / 1.2 + HEAVY * STICKS.stage,
        },
    ),
    "creep under a force": Answer(
        {
            "adhesion": NO_SHARE,
            "bonds": STRETCHED
            | {"model": "rate", "rupture": BELL, "rebinding_rate": FORCE_FREE},
            "drive": {
                "model": "force",
                "force": CREEP * SITES * BELL_FORCE * FULL,
                "contact_stiffness": "rigid",
            },
            "clock": in_time(100),
        },
        {
            "bond_fraction": 2.0 * NUMBER,
            "speed": CREEP_SPEED * FORCE_FREE * BELL_FORCE / BOND,
        },
    ),
}


@pytest.mark.parametrize("name", SLIDER)
def test_a_slider_that_has_settled_has_the_speed_and_force_of_its_balance(name):
    # with the tolerance of the drive
    check(SLIDER[name], late=True, rounding=1e-6)


@pytest.mark.parametrize(
    ("steps", "cycle"), [(150.3, STICKS), (601.2, STICKS), (150.3, SNAPS)]
)
def test_stick_slip_of_a_massless_slider_is_its_relaxation_cycle_within_its_bounds(
    steps, cycle
):
    """A cycle has no whole number of clock steps, so that events come at all phases of a step.

    With little damping a slip event is much shorter than a clock step.
    """
    step = cycle.recurrence / steps
    answer = Answer(
        {
            "adhesion": NO_SHARE,
            "bonds": STEADY,
            "drive": SPRING | {"damping": cycle.damping},
            "clock": in_time(round(12 * steps), step),
        },
        {
            "recurrence_time": cycle.recurrence,
            "slip_duration": cycle.slip_duration,
            "stick_duration": cycle.stick_duration,
            "slip_amplitude": (STRENGTH - cycle.least) / cycle.stiffness
            + cycle.stage * cycle.slip_duration,
            "static_friction": STRENGTH,
            "force_drop": STRENGTH - cycle.least,
            "kinetic_friction": cycle.mean_force,
            "static_threshold": STRENGTH,
            "slip_count": 6.0,
        },
    )
    check(answer, rounding=1e-6)


# --- speeds at which area is lost ---


def fallen(share):
    """Return the speed at which bonds have taken a share of JKR's area."""

    def missing(speed):
        bonded = WORK / (1.0 + speed / CRITICAL)
        return 1.0 - area(bonded) / FULL - share

    return optimize.brentq(missing, 1e-5, 10.0, xtol=1e-16)


@pytest.mark.parametrize("count", [17, 33])
def test_the_interval_of_a_speed_at_a_loss_holds_the_root_of_the_closed_form(count):
    speeds = {"from": 1e-4, "to": 1.0, "count": count, "scale": "log"}
    tables = {"bonds": STEADY, "drive": {"speed": 1e-3}}
    run = sim.Run(sim.run(scene(sweep={"drive.speed": speeds}, **tables)))
    hertz = area(0.0) / FULL
    for name, share in (
        ("speed_at_5_percent_lost", 0.05),
        ("speed_halfway_to_hertz", 0.5 * (1.0 - hertz)),
    ):
        statement, answer = run.statistic(name), fallen(share)
        low, mean, high = (
            float(statement.sel(statistic=kind)) for kind in ("low", "mean", "high")
        )
        assert low <= answer <= high, (name, low, answer, high)
        assert high - low < 0.1 * answer and low < mean < high


# --- statements with noise, of 200 ensembles ---

ENSEMBLES, MEMBERS = 200, 32
#: Share of the ensembles that state a value: one settled mean of a hundred is taken for a drift.
LEAST_STATED = 0.95
#: Correlation times of a field that a clock step forgets, and of one that lasts.
FORGOTTEN, NEVER = 0.01 * STEP, 1e6
CELL, FIELD_LENGTH, POINTS = 0.24e-3, 15e-6, 32
UNIT, WAVENUMBERS = gaussian_cell(1.0, FIELD_LENGTH, CELL, POINTS, SHEAR)
#: Work of adhesion of the bonds at the speed of the scenes with noise, and the field that takes most of it.
SLOW = 2e-3
OF_BONDS = WORK * (1.0 - SHARE + SHARE / (1.0 + SLOW / CRITICAL))
NOISE = math.sqrt(0.95 * OF_BONDS / np.sum(UNIT))
LAW = GammaSum(NOISE**2 * UNIT)


def field(time, rms=NOISE):
    """Return the table of a Gaussian field on a cell that forgets itself in a time [s]."""
    return {
        "model": "modal",
        "spectrum": {"model": "gaussian", "rms": rms, "length": FIELD_LENGTH},
        "cell": CELL,
        "points": POINTS,
        "correlation": {"model": "time", "time": time},
    }


class Stated(NamedTuple):
    """A statement with noise and its answer.

    Attributes
    ----------
    quantity : str
        Name of the quantity.
    answer : float
        The value that its interval should hold.
    record : int or None
        The record that it is of; None for the second half of the run, or of the whole run.
    late : bool
        True for the mean over the second half.
    value : str
        The statistic.
    """

    quantity: str
    answer: float
    record: int | None = None
    late: bool = False
    value: str = "mean"

    def of(self, dataset):
        """Return value, standard error and ends of the interval in each ensemble."""
        statement = sim.Run(dataset).statistic(self.quantity, late=self.late)
        if self.record is not None:
            statement = statement.isel(t=self.record)
        names = [self.value, "standard error", "low", "high"]
        if self.value != "mean":
            names[1:] = [None, f"{self.value} low", f"{self.value} high"]
        known = set(statement["statistic"].to_numpy().tolist())
        shape = statement.isel(statistic=0).shape
        return [
            statement.sel(statistic=name).to_numpy()
            if name in known
            else np.full(shape, math.nan)
            for name in names
        ]


class Noisy(NamedTuple):
    """A scene with noise, its statements, and the number of members of an ensemble."""

    tables: dict[str, Any]
    stated: tuple[Stated, ...]
    members: int = MEMBERS


def of_work(energy):
    return OF_BONDS - energy


def lost_first(energy):
    return (FULL - area(WORK - energy)) / FULL


def radius(energy):
    return LENS.at_load(LOAD, of_work(energy))


TAU = STRESS / (1.0 + SLOW / CRITICAL)
AREA = LAW.expected(lambda energy: area(of_work(energy)))
MASKED = LAW.above(OF_BONDS)
ALL_BONDS = {"adhesion": {"work": WORK, "bond_share": SHARE}, "bonds": STEADY}
AT_SLOW = {"drive": {"speed": SLOW}}

#: Each record is drawn anew, so statements of different records are independent.
AT_RECORDS = (
    Stated("fluctuation_energy", LAW.mean, 0),
    Stated("work_of_adhesion", OF_BONDS - LAW.mean, 1),
    Stated("contact_radius", LAW.expected(radius), 2),
    Stated("contact_area", AREA, 3),
    Stated("area_ratio", AREA / FULL, 4),
    Stated("friction_force", TAU * AREA, 5),
    Stated("fraction_masked", MASKED, 6),
    Stated("lost_to_fluctuations", (area(OF_BONDS) - AREA) / FULL, 7),
    Stated("lost_to_fluctuations_first", LAW.expected(lost_first), 8),
    Stated(
        "indentation",
        LAW.expected(lambda e: LENS.indentation_of(radius(e), of_work(e))),
        9,
    ),
    Stated("fluctuation_energy", LAW.quantile(0.5), 10, value="50 %"),
    Stated("contact_area", area(OF_BONDS - LAW.quantile(0.5)), 11, value="50 %"),
)
WEAK = GammaSum(0.36 * NOISE**2 * UNIT)
WEAK_AREA = WEAK.expected(lambda energy: area(of_work(energy)))
#: Radius at an indentation over the energy, which is smooth up to the masked contact.
GRID = np.append(np.linspace(0.0, OF_BONDS, 400)[:-1], OF_BONDS)
HELD = [LENS.at_displacement(2e-6, work=max(OF_BONDS - e, 1e-12)) for e in GRID]


def held(energy):
    return np.interp(energy, GRID, HELD)


def load_held(energy):
    return LENS.load_of(held(energy), of_work(energy))


#: A contact under this load is open if the work of adhesion left is below a tenth of all.
PULL = -0.15 * np.pi * RADIUS * OF_BONDS
OPEN = LAW.above(0.9 * OF_BONDS)
COUNT = 40
COUNTS = np.arange(COUNT + 1) / COUNT
BINOMIAL = special.comb(COUNT, np.arange(COUNT + 1)) / 2.0**COUNT
#: A field with which a contact is masked at a clock step with a probability of a few per cent.
RARE = 0.8
CHANCE = GammaSum(RARE * NOISE**2 * UNIT).above(OF_BONDS)
#: First clock step at which less than half of the members have never been masked.
HALF = math.ceil(math.log(0.5) / math.log1p(-CHANCE)) - 1
#: Maskings over the time before them, in 60 clock steps and at the start.
RATE = (1.0 - (1.0 - CHANCE) ** 61) * CHANCE
RATE /= STEP * (1.0 - CHANCE) * (1.0 - (1.0 - CHANCE) ** 60)
MIDDLE = 0.5 * (1.0 + area(0.0) / FULL)
WEAKEST = GammaSum(0.25 * NOISE**2 * UNIT)


def mean_left(speed):
    """Return the mean share of the area at a speed."""
    bonded = WORK * (1.0 - SHARE + SHARE / (1.0 + speed / CRITICAL))
    return WEAKEST.expected(lambda energy: area(bonded - energy)) / FULL


HALFWAY = optimize.brentq(lambda speed: mean_left(speed) - MIDDLE, 1e-4, 1.0)


#: A wave forgets its amplitude over its own length, and its energy, whose variance is w², over half of that.
WAVES_FORGET = np.average(np.pi / (SLOW * WAVENUMBERS), weights=UNIT**2)


NOISY = {
    "a new field at each record": Noisy(
        ALL_BONDS | AT_SLOW | {"shear": field(FORGOTTEN), "clock": in_time(12)},
        AT_RECORDS,
    ),
    # of three members that are often all masked the area has no spread
    "three members": Noisy(
        ALL_BONDS
        | AT_SLOW
        | {"shear": field(FORGOTTEN, 0.6 * NOISE), "clock": in_time(3)},
        (
            Stated("fluctuation_energy", WEAK.mean, 0),
            Stated("contact_area", WEAK_AREA, 1),
            Stated("friction_force", TAU * WEAK_AREA, 2),
        ),
        members=3,
    ),
    "the second half of a stationary run": Noisy(
        ALL_BONDS | AT_SLOW | {"shear": field(4.0 * STEP), "clock": in_time(80)},
        (
            Stated("fluctuation_energy", LAW.mean, late=True),
            Stated("area_ratio", AREA / FULL, late=True),
            Stated("fraction_masked", MASKED, late=True),
            Stated("fluctuation_energy", LAW.quantile(0.05), late=True, value="5 %"),
            Stated("fluctuation_energy", LAW.quantile(0.5), late=True, value="50 %"),
            Stated("fluctuation_energy", LAW.quantile(0.95), late=True, value="95 %"),
            Stated("time_masked", MASKED),
        ),
    ),
    "a field that forgets in ten clock steps": Noisy(
        AT_SLOW | {"shear": field(10.0 * STEP), "clock": in_time(400)},
        # the energy forgets twice as fast as the stress
        (Stated("correlation_time", 5.0 * STEP),),
        members=8,
    ),
    "waves that forget in proportion to their length": Noisy(
        AT_SLOW
        | {
            "shear": field(1.0) | {"correlation": {"model": "wave", "waves": 1.0}},
            "clock": in_time(400, 0.25 * STEP),
        },
        (Stated("correlation_time", WAVES_FORGET),),
        members=8,
    ),
    "one long run": Noisy(
        ALL_BONDS | AT_SLOW | {"shear": field(4.0 * STEP), "clock": in_time(1000)},
        (
            Stated("fluctuation_energy", LAW.mean, late=True),
            Stated("area_ratio", AREA / FULL, late=True),
            Stated("fluctuation_energy", LAW.quantile(0.5), late=True, value="50 %"),
        ),
        members=1,
    ),
    "a held indentation": Noisy(
        ALL_BONDS
        | AT_SLOW
        | {
            "shear": field(FORGOTTEN),
            "contact": {"indentation": 2e-6},
            "clock": in_time(2),
        },
        (
            Stated("normal_load", LAW.expected(load_held), 0),
            Stated("contact_area", np.pi * LAW.expected(lambda e: held(e) ** 2), 1),
        ),
    ),
    "a tension": Noisy(
        ALL_BONDS
        | AT_SLOW
        | {"shear": field(FORGOTTEN), "contact": {"load": PULL}, "clock": in_time(1)},
        (Stated("fraction_detached", OPEN, 0),),
    ),
    "counted bonds": Noisy(
        {
            "bonds": {
                "model": "counted",
                "critical_speed": CRITICAL,
                "rebinding_rate": 1e5,
                "sites": COUNT,
                "stress": STRESS,
            },
            "adhesion": {"work": WORK},
            "drive": {"speed": CRITICAL},
            "clock": in_time(6),
        },
        (
            Stated("bond_fraction", 0.5, 1),
            Stated("shear_stress", 0.5 * STRESS, 2),
            Stated("contact_area", BINOMIAL @ area(WORK * COUNTS), 3),
            Stated(
                "friction_force", BINOMIAL @ (STRESS * COUNTS * area(WORK * COUNTS)), 4
            ),
            Stated("lost_to_bonds", 1.0 - BINOMIAL @ area(WORK * COUNTS) / FULL, 5),
            Stated("bond_fraction", 0.5, 0),
        ),
    ),
    "tracked bonds": Noisy(
        {
            "bonds": STRETCHED | {"model": "tracked", "rupture": BELL, "sites": COUNT},
            "drive": {"speed": SPEEDS[2]},
            "clock": in_time(2, 0.05),
        },
        (
            Stated("bond_fraction", RENEWED[2] / AT_REST_BOUND, 1),
            Stated("shear_stress", SITES * BELL_FORCE * PULLED[2], 2),
        ),
    ),
    "a field that never changes, under a falling load": Noisy(
        ALL_BONDS
        | AT_SLOW
        | {
            "shear": field(NEVER, 0.5 * NOISE),
            "contact": {"load": {"from": -0.2e-3, "to": -0.33e-3}},
            "clock": in_time(200),
        },
        (
            Stated(
                "pull_off_load", -1.5 * np.pi * RADIUS * (OF_BONDS - 0.25 * LAW.mean)
            ),
        ),
    ),
    "a field that may mask the contact at each clock step": Noisy(
        ALL_BONDS
        | AT_SLOW
        | {"shear": field(FORGOTTEN, math.sqrt(RARE) * NOISE), "clock": in_time(60)},
        (Stated("half_masked", HALF * STEP), Stated("masked_rate", RATE)),
    ),
    "a sweep of the speed": Noisy(
        {
            "adhesion": {"work": WORK, "bond_share": SHARE},
            "bonds": STEADY,
            "shear": field(NEVER, 0.5 * NOISE),
            "drive": {"speed": 1e-3},
            "sweep": {
                "drive.speed": {"from": 3e-4, "to": 1.0, "count": 15, "scale": "log"}
            },
            "clock": in_time(1),
        },
        (Stated("speed_halfway_to_hertz", HALFWAY),),
    ),
}


def ensembles(noisy, count):
    """Return a run of so many ensembles, as runs that were joined along a dimension of this name."""
    members = count * noisy.members
    dataset = sim.run(scene(ensemble={"members": members}, **noisy.tables))
    parts = dataset.drop_vars("member").coarsen(member=noisy.members)
    parts = parts.construct(member=("ensemble", "member"))
    modulus = parts["contact_modulus"].expand_dims(ensemble=np.arange(count))
    return parts.assign(contact_modulus=modulus).assign_attrs(
        members=np.int32(noisy.members)
    )


@pytest.mark.parametrize("name", NOISY)
def test_a_mean_statement_of_20_ensembles_is_its_answer_within_five_errors(name):
    count = 20
    dataset = ensembles(NOISY[name], count)
    for stated in NOISY[name].stated:
        values = stated.of(dataset)[0]
        values = values[np.isfinite(values)]
        error = values.std(ddof=1) / math.sqrt(len(values))
        assert len(values) > 0.8 * count, stated
        assert abs(values.mean() - stated.answer) < 5.0 * error, stated


def test_an_ensemble_among_others_has_the_statements_of_its_members_alone():
    noisy = NOISY["a new field at each record"]
    members, dataset = noisy.members, ensembles(noisy, 3)
    whole = sim.run(scene(ensemble={"members": 3 * members}, **noisy.tables))
    alone = whole.isel(member=slice(members, 2 * members))
    alone = alone.assign_attrs(members=np.int32(members))
    for name in ("area_ratio", "fraction_masked", "lost_to_fluctuations"):
        among = sim.Run(dataset).statistic(name).isel(ensemble=1, drop=True)
        assert_allclose(sim.Run(alone).statistic(name), among, rtol=1e-12)


@pytest.mark.verify
def test_brackets_and_intervals_of_200_ensembles_hold_their_answers_as_often_as_they_promise():
    misses, pooled = [], {"bracket": [], "interval": []}
    for noisy in NOISY.values():
        dataset = ensembles(noisy, ENSEMBLES)
        free = noisy.members - 1 if noisy.members > 1 else math.inf
        promised = {"bracket": 2.0 * stats.t.cdf(1.0, free) - 1.0, "interval": 0.95}
        for stated in noisy.stated:
            value, error, low, high = stated.of(dataset)
            held = {
                "bracket": (error, np.abs(value - stated.answer) <= error),
                "interval": (
                    low + high,
                    (low <= stated.answer) & (stated.answer <= high),
                ),
            }
            for kind, (known, holds) in held.items():
                holds = holds[np.isfinite(known)]
                if not holds.size:
                    continue
                assert holds.size >= LEAST_STATED * ENSEMBLES, (kind, stated)
                share, chance = holds.mean(), promised[kind]
                binomial = math.sqrt(chance * (1.0 - chance) / holds.size)
                if abs(share - chance) > 3.5 * binomial:
                    misses.append((kind, share, stated))
                if noisy.members == MEMBERS:
                    pooled[kind].append(share)
    assert not misses
    assert 0.66 < np.mean(pooled["bracket"]) < 0.70, pooled
    assert 0.94 < np.mean(pooled["interval"]) < 0.96, pooled


def test_spread_and_skewness_of_many_members_are_those_of_a_gamma_sum():
    members = 6400
    noisy = NOISY["a new field at each record"]
    run = sim.Run(sim.run(scene(ensemble={"members": members}, **noisy.tables)))
    statement = run.statistic("fluctuation_energy").isel(t=0)

    def error_of(influence):
        """Return the standard error of a moment, by what one member changes of it."""
        square = LAW.expected(
            lambda energy: influence((energy - LAW.mean) / LAW.std) ** 2
        )
        return math.sqrt(square / members)

    skewness = LAW.skewness
    error = LAW.std * error_of(lambda z: 0.5 * (z**2 - 1.0))
    spread = float(statement.sel(statistic="standard deviation"))
    assert abs(spread - LAW.std) < 5.0 * error
    error = error_of(
        lambda z: z**3 - skewness - 1.5 * skewness * (z**2 - 1.0) - 3.0 * z
    )
    assert abs(float(statement.sel(statistic="skewness")) - skewness) < 5.0 * error
    assert statement.sel(statistic="number") == members


def test_a_quantity_that_is_the_same_in_all_members_has_no_skewness():
    masking = ALL_BONDS | AT_SLOW | {"shear": field(FORGOTTEN, 4.0 * NOISE)}
    run = sim.Run(sim.run(scene(ensemble={"members": MEMBERS}, **masking)))
    for late in (False, True):
        ratio = run.statistic("area_ratio", late=late)
        assert_allclose(ratio.sel(statistic="mean"), area(0.0) / FULL, rtol=ROUNDING)
        assert np.all(np.isnan(ratio.sel(statistic="skewness")))
