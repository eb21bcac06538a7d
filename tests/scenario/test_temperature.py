"""A scene at a temperature is a plain scene with other numbers, and its energies are found again from curves."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import constants, stats

import sim
from sim.ensemble.steady import steady_course
from sim.ensemble.variables import READ
from sim.parts.temperature import Arrhenius, Wlf
from sim.scenario.reader import load
from sim.study import likelihood, measurement
from sim.study.fit import free_number
from sim.study.likelihood import minimum, problem_of
from sim.study.measurement import Curve, Measured
from sim.units.errors import BadInput

#: Temperatures [K] of the scenes and of their numbers.
WARM, COLD = 313.15, 293.15
#: Tables that all scenes share.
LENS = {
    "clock": {"duration": "8 ms", "step": "1 ms"},
    "solid": {"shear_modulus": 1.6e6},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "contact": {"model": "equilibrium", "load": "4 mN"},
    "drive": {"model": "steady", "speed": "1 mm/s"},
}
STRETCHED = {"bond_stiffness": 4e-4, "rebinding_rate": 1e5, "site_density": 9e16}
BELL = {"model": "bell", "zero_force_rate": 1e4, "bell_force": 4e-12}
COHORT = {"model": "cohort", "rupture": BELL} | STRETCHED
TWO_STATES = {"critical_speed": 1e-2, "rebinding_rate": 500.0, "stress": 3e5}
RUPTURE, REBINDING, EDGE = 80e3, 50e3, 30e3


def arrhenius(energy):
    return {"model": "arrhenius", "energy": energy}


def at(**laws):
    """The table of a warm scene."""
    return {"value": WARM, "reference": COLD} | laws


def growth(energy, value=WARM):
    """The factor of a rate, written by hand."""
    return math.exp(energy / constants.R * (1.0 / COLD - 1.0 / value))


BOTH = {"rupture": arrhenius(RUPTURE), "rebinding": arrhenius(REBINDING)}
HOT_RUPTURE, HOT_REBINDING = growth(RUPTURE), growth(REBINDING)
THERMAL = WARM / COLD
HOT_WLF = math.exp(math.log(10.0) * 8.86 * (WARM - COLD) / (101.6 + (WARM - COLD)))
HOT_BELL = {
    "bonds.rupture.zero_force_rate": 1e4 * HOT_RUPTURE,
    "bonds.rupture.bell_force": 4e-12 * THERMAL,
    "bonds.rebinding_rate": 1e5 * HOT_REBINDING,
}
#: Tables of each scene, its temperature, and what the plain scene has instead.
SCENES = {
    "cohorts": ({"bonds": COHORT}, BOTH, HOT_BELL),
    "a constant Bell force": (
        {"bonds": COHORT},
        BOTH | {"bell_force": "constant"},
        HOT_BELL | {"bonds.rupture.bell_force": 4e-12},
    ),
    "the first moment, with a slider behind a spring": (
        {
            "bonds": COHORT | {"model": "rate"},
            "drive": {"model": "spring", "stage": 1e-3, "stiffness": 1e3},
        },
        BOTH,
        HOT_BELL,
    ),
    "tracked bonds of a limit": (
        {
            "bonds": {"model": "tracked", "sites": 30}
            | STRETCHED
            | {"rupture": {"model": "cut_off", "stretch": 3e-8, "rate": 1e3}}
        },
        BOTH,
        {
            "bonds.rupture.rate": 1e3 * HOT_RUPTURE,
            "bonds.rebinding_rate": 1e5 * HOT_REBINDING,
        },
    ),
    "bonds that are chosen": (
        {"bonds": COHORT | {"model": "auto", "rupture": BELL}},
        BOTH,
        HOT_BELL,
    ),
    "counted bonds": (
        {"bonds": {"model": "counted", "sites": 40} | TWO_STATES},
        {"rebinding": {"model": "wlf", "c1": 8.86, "c2": 101.6}},
        {
            "bonds.critical_speed": 1e-2 * HOT_WLF,
            "bonds.rebinding_rate": 500.0 * HOT_WLF,
        },
    ),
    "an edge that lags on a solid of another modulus": (
        {
            "bonds": {"model": "rate"} | TWO_STATES,
            "contact": {
                "model": "rate_dependent",
                "load": {"from": "4 mN", "to": "1 mN"},
                "front_speed": 1e-4,
                "heal_speed": 1e-5,
            },
        },
        {
            "rebinding": arrhenius(REBINDING),
            "edge": arrhenius(EDGE),
            "modulus": {"temperature": [COLD, 333.15], "value": [1e6, 5e5]},
        },
        {
            "bonds.critical_speed": 1e-2 * HOT_REBINDING,
            "bonds.rebinding_rate": 500.0 * HOT_REBINDING,
            "contact.front_speed": 1e-4 * growth(EDGE),
            "contact.heal_speed": 1e-5 * growth(EDGE),
            "solid.shear_modulus": 1.6e6 * (7.5e5 / 1e6),
        },
    ),
    "a layer by Young's modulus": (
        {"solid": {"youngs_modulus": 4.8e6, "thickness": 2e-5}},
        {"modulus": {"temperature": [COLD, WARM], "value": [2.0, 1.5]}},
        {"solid.youngs_modulus": 4.8e6 * 0.75},
    ),
}


@pytest.mark.parametrize("case", SCENES)
def test_a_scene_at_a_temperature_is_bit_for_bit_the_plain_scene_with_its_numbers(case):
    tables, laws, numbers = SCENES[case]
    scene = load(LENS | tables | {"temperature": at(**laws)})
    plain = load(LENS | tables, numbers)
    warm, expected = sim.run(scene), sim.run(plain)
    # the plain scene records its own values of these keys
    changed = {key.replace(".", "_") for key in numbers}
    names = [
        name
        for name in expected.variables
        if name not in changed and expected[name].dtype.kind == "f"
    ]
    assert {"contact_radius", "contact_modulus"} <= {*names}
    for name in names:
        np.testing.assert_array_equal(warm[name], expected[name], name)
    for key, value in numbers.items():
        recorded = warm.get(f"{key.replace('.', '_')}_at_temperature")
        assert (recorded is None) == (
            key == "bonds.rupture.bell_force" and "bell_force" in laws
        )
        assert recorded is None or float(recorded) == value
    np.testing.assert_equal(scene.limits._asdict(), plain.limits._asdict())
    # a twin with other numbers differs, and a scene without a temperature has no such columns
    cold = sim.run(load(LENS | tables))
    assert any(not np.array_equal(cold[name], warm[name]) for name in names)
    assert not [name for name in cold.variables if "temperature" in str(name)]


def test_at_the_reference_every_number_is_its_own():
    laws = at(**BOTH, modulus={"temperature": [280.0, 320.0], "value": [3.0, 1.0]})
    scene = load(LENS | {"bonds": COHORT, "temperature": laws | {"value": COLD}})
    assert scene.population == scene.bonds
    assert scene.elastic == scene.solid.elastic


def test_bonds_by_their_critical_speed_have_rates_of_the_reference_first():
    rupture = {"model": "bell", "bell_force": 4e-12, "critical_speed": 3e-3}
    bonds = {"model": "cohort", "bond_stiffness": 4e-4, "rebinding_ratio": 10.0}
    bonds |= {"rupture": rupture | {"stress": 2e5}}
    scene = load(LENS | {"bonds": bonds, "temperature": at(**BOTH)})
    cold, warm = load(LENS | {"bonds": bonds}).population, scene.population
    assert warm.rebinding_rate == cold.rebinding_rate * HOT_REBINDING
    assert warm.rupture.zero_force_rate == cold.rupture.zero_force_rate * HOT_RUPTURE
    assert warm.site_density == cold.site_density
    # the mean stretch is no reason to doubt a maximum that was given
    mean = load(LENS | {"bonds": bonds | {"model": "rate"}, "temperature": at(**BOTH)})
    assert not [text for text in mean.remarks() if "overpredicts" in text]
    # both are recorded, each under its name
    assert scene.derived["bonds.rebinding_rate"][1] == cold.rebinding_rate
    assert (
        scene.derived["bonds.rebinding_rate_at_temperature"][1] == warm.rebinding_rate
    )


def test_the_friction_peak_of_a_ramp_has_the_lag_of_the_bonds_at_the_temperature():
    tables = LENS | {
        "clock": {"duration": "1 s", "step": "1 ms"},
        "drive": {"model": "ramp", "from": 1e-6, "to": 1.0, "scale": "log"},
        "bonds": COHORT
        | {"rebinding_rate": 1e3, "rupture": BELL | {"zero_force_rate": 100.0}},
    }
    numbers = HOT_BELL | {
        "bonds.rupture.zero_force_rate": 100.0 * HOT_RUPTURE,
        "bonds.rebinding_rate": 1e3 * HOT_REBINDING,
    }
    warm = sim.stats(sim.run(load(tables | {"temperature": at(**BOTH)})))
    plain = sim.stats(sim.run(load(tables, numbers)))
    assert str(warm) == str(plain)


def test_laws_are_those_of_arrhenius_and_of_williams_landel_and_ferry():
    # two temperatures give an energy back: E = R ln(k1/k0)/(1/T0 - 1/T1)
    size = Arrhenius(energy=RUPTURE).growth(WARM, COLD)
    assert_allclose(constants.R * size / (1.0 / COLD - 1.0 / WARM), RUPTURE, rtol=1e-12)
    # with other constants, c1 c2/(c2 + d) and c2 + d, WLF is the same about another reference
    law, moved = Wlf(c1=8.86, c2=101.6), Wlf(c1=8.86 * 101.6 / 121.6, c2=121.6)
    assert_allclose(
        moved.growth(353.15, WARM),
        law.growth(353.15, COLD) - law.growth(WARM, COLD),
        rtol=1e-12,
    )


BONDS = {
    "cohort": (COHORT, BOTH),
    "rate": (COHORT | {"model": "rate"}, BOTH),
    "steady": ({"model": "steady", "critical_speed": 1e-2, "stress": 3e5}, None),
}


def friction_at(scene, speeds):
    """Friction in steady sliding at speeds."""
    speed = np.reshape(speeds, (-1, 1))
    course = steady_course(scene, 0.0 * speed, speed)
    return READ["friction_force"](scene, course)[:, 0]


@pytest.mark.parametrize("model", BONDS)
def test_with_equal_energies_and_a_constant_bell_force_heat_shifts_the_speed(model):
    bonds, laws = BONDS[model]
    same = arrhenius(RUPTURE)
    equal = {"rebinding": same} | ({"rupture": same} if laws else {})
    tables = LENS | {"bonds": bonds}
    cold = load(tables)
    warm = load(tables | {"temperature": at(**equal, bell_force="constant")})
    speeds = np.geomspace(1e-5, 1e-1, 9)
    assert_allclose(
        friction_at(warm, speeds * HOT_RUPTURE), friction_at(cold, speeds), rtol=1e-10
    )
    assert not [text for text in warm.remarks() if "master curve" in text]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rebinding": arrhenius(REBINDING)}, "different laws"),
        ({"bell_force": "thermal"}, "Bell force"),
        ({"modulus": {"temperature": [COLD, WARM], "value": [2.0, 1.0]}}, "modulus"),
    ],
)
def test_a_remark_has_the_reason_for_which_no_shift_makes_a_master_curve(
    change, reason
):
    same = {"rupture": arrhenius(RUPTURE), "rebinding": arrhenius(RUPTURE)}
    laws = same | {"bell_force": "constant"} | change
    cold = load(LENS | {"bonds": COHORT})
    warm = load(LENS | {"bonds": COHORT, "temperature": at(**laws)})
    (remark,) = (text for text in warm.remarks() if "master curve" in text)
    assert reason in remark
    assert remark.count(",") == 0  # the only reason
    # no shift at all brings the height of the maximum of the stress or of the contact to that of the reference
    fine = np.geomspace(1e-5, 10.0, 200)
    heights = [friction_at(scene, fine).max() for scene in (cold, warm)]
    assert abs(heights[1] / heights[0] - 1.0) > 0.01


def test_friction_in_proportion_to_the_speed_has_a_master_curve_whatever_the_energies():
    constant = COHORT | {"model": "rate", "rupture": {"model": "constant", "rate": 1e4}}
    cold = load(LENS | {"bonds": constant})
    warm = load(LENS | {"bonds": constant, "temperature": at(**BOTH)})
    speeds = np.geomspace(1e-5, 1e-1, 5)
    ratio = friction_at(warm, speeds[:1]) / friction_at(cold, speeds[:1])
    assert ratio < 0.9
    assert_allclose(
        friction_at(warm, speeds), friction_at(cold, ratio * speeds), rtol=1e-12
    )
    assert not [text for text in warm.remarks() if "master curve" in text]


FAULTS = [
    ({"rupture": arrhenius(1.0)}, {}, "temperature.rebinding", "is missing"),
    (
        BOTH | {"edge": arrhenius(1.0)},
        {},
        "temperature.edge",
        "no effect...front_speed",
    ),
    (
        {"rebinding": arrhenius(1.0)},
        {"contact": {"model": "rate_dependent", "load": 4e-3, "front_speed": 1e-3}},
        "temperature.edge",
        "is missing...contact.front_speed",
    ),
    (
        BOTH,
        {"bonds": {"model": "rate"} | TWO_STATES},
        "temperature.rupture",
        "no effect",
    ),
    (
        BOTH | {"rupture": {"model": "wlf", "c1": 17.4, "c2": 51.6}, "value": "-40 °C"},
        {},
        "temperature",
        "rupture: WLF holds above...241.55 K",
    ),
    (
        BOTH | {"value": "1 K"},
        {},
        "temperature",
        "rupture: changes its rate by more than 1e40",
    ),
    (BOTH | {"value": "20 C"}, {}, "temperature.value", "write °C"),
    (BOTH | {"value": "-300 °C"}, {}, "temperature.value", "above 0 K"),
    (
        BOTH | {"rupture": arrhenius("0.5 eV")},
        {},
        "temperature.rupture.energy",
        "96.5 kJ/mol",
    ),
    (
        BOTH | {"rupture": {"model": "wlf", "c1": 17.4, "c2": "51.6 °C"}},
        {},
        "temperature.rupture.c2",
        "unknown unit",
    ),
    (
        BOTH | {"modulus": {"temperature": [300.0, 320.0], "value": [2.0, 1.0]}},
        {},
        "temperature",
        "modulus: is given from 300 to 320 K, but reference is 293.15 K",
    ),
    (
        BOTH | {"modulus": {"temperature": [320.0, 280.0], "value": [2.0, 1.0]}},
        {},
        "temperature.modulus",
        "must rise",
    ),
    (
        BOTH | {"modulus": {"temperature": [280.0, 320.0], "value": [2.0, 1.0]}},
        {
            "solid": {
                "shear_modulus": 1e6,
                "counter_body": {"shear_modulus": 1e6},
            }
        },
        "temperature.modulus",
        "counter_body",
    ),
    (
        BOTH,
        {
            "bonds": COHORT
            | {
                "rupture": {
                    "model": "catch",
                    "catch_rate": 1e5,
                    "catch_force": 1e-12,
                    "slip_rate": 1e3,
                    "slip_force": 4e-12,
                }
            }
        },
        "bonds.rupture.catch_rate",
        "two barriers",
    ),
    (
        BOTH,
        {
            "bonds": COHORT | {"model": "rate"},
            "drive": {"model": "force", "force": 1e-3, "viscosity": 1e4},
        },
        "drive.viscosity",
        "no law",
    ),
    (
        BOTH,
        {
            "shear": {
                "model": "mean",
                "spectrum": {"model": "gaussian", "rms": 1e5, "length": 4e-6},
                "amplitude": {"model": "onset", "speed": 1e-3, "width": 0.3},
            }
        },
        "shear.amplitude.speed",
        "no law",
    ),
    ({}, {"bonds": {"model": "none", "stress": 1e5}}, "temperature", "changes nothing"),
]


@pytest.mark.parametrize(("laws", "tables", "key", "words"), FAULTS)
def test_what_has_no_law_over_the_temperature_is_refused_by_name(
    laws, tables, key, words
):
    with pytest.raises(BadInput) as refused:
        load(LENS | {"bonds": COHORT} | tables | {"temperature": at() | laws})
    assert any(
        key in problem and all(word in problem for word in words.split("..."))
        for problem in refused.value.problems
    ), refused.value.problems


def test_a_temperature_is_swept_and_the_modulus_read_from_a_file(tmp_path):
    (tmp_path / "dma.csv").write_text(
        "temperature [°C], modulus [MPa]\n0, 2\n40, 1\n", encoding="utf-8"
    )
    path = tmp_path / "x.toml"
    path.write_text(
        """
[clock]
duration = "2 ms"
step = "1 ms"
[solid]
shear_modulus = "1.6 MPa"
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[contact]
load = "4 mN"
model = "equilibrium"
[temperature]
value = "20 °C"
reference = "20 °C"
modulus = { file = "dma.csv" }
[sweep]
"temperature.value" = { from = "0 °C", to = "40 °C", count = 3 }
""",
        encoding="utf-8",
    )
    scene = load(path)
    moduli = [point.elastic.shear_modulus for point in scene.points()]
    assert_allclose(moduli, 1.6e6 * np.array([4.0, 3.0, 2.0]) / 3.0, rtol=1e-12)
    dataset = sim.run(scene)
    assert_allclose(dataset["temperature_value"], [273.15, 293.15, 313.15], rtol=1e-15)
    assert dataset["temperature_value"].attrs["units"] == "K"
    assert dataset["contact_radius"].dims[0] == "temperature_value"


def test_each_point_of_a_sweep_over_temperatures_is_the_plain_scene():
    tables = LENS | {"bonds": COHORT, "temperature": at(**BOTH)}
    swept = {"temperature.value": [WARM, COLD, 333.15]}
    friction = sim.run(load(tables | {"sweep": swept}))["friction_force"]
    for k, value in enumerate(swept["temperature.value"]):
        numbers = {
            "bonds.rupture.zero_force_rate": 1e4 * growth(RUPTURE, value),
            "bonds.rupture.bell_force": 4e-12 * (value / COLD),
            "bonds.rebinding_rate": 1e5 * growth(REBINDING, value),
        }
        plain = sim.run(load(LENS | {"bonds": COHORT}, numbers))["friction_force"]
        np.testing.assert_array_equal(friction.isel(temperature_value=k), plain)


ENERGIES = {"temperature.rupture.energy": 80e3, "temperature.rebinding.energy": 50e3}
TEMPERATURES = np.array([273.15, 293.15, 313.15, 333.15, 353.15])
SPEEDS = np.geomspace(1e-4, 1e-1, 7)


@pytest.fixture(scope="module")
def curves():
    """The exact problem of friction over speed at five temperatures."""
    scene = load(LENS | {"bonds": COHORT, "temperature": at(**BOTH)})
    temperatures = np.repeat(TEMPERATURES, len(SPEEDS))
    speeds = np.tile(SPEEDS, len(TEMPERATURES))
    nothing = np.ones(len(speeds))
    conditions = {"speed": speeds, "temperature.value": temperatures}
    friction = Curve("friction_force", nothing, nothing)
    table = Measured(Path("friction.csv"), "load", conditions, (friction,))
    free = [free_number(scene, key) for key in ENERGIES]
    problem = problem_of(scene, [table], free, {})
    exact = problem.steady(problem.start)
    stated = np.zeros(len(exact), bool)
    return replace(problem, values=exact, sigma=0.03 * exact, estimated=stated)


def test_a_fit_finds_both_energies_from_a_table_with_temperatures(tmp_path, curves):
    conditions = curves.tables[0].conditions
    rows = zip(
        conditions["temperature.value"] - 273.15,
        1e3 * conditions["speed"],
        1e3 * curves.values,
        strict=True,
    )
    path = tmp_path / "friction.csv"
    lines = [
        f"{celsius:.2f}, {speed:.17g}, {force:.17g}, 3"
        for celsius, speed, force in rows
    ]
    header = (
        "temperature [°C], speed [mm/s], friction_force [mN], friction_force_error [%]"
    )
    path.write_text("\n".join([header, *lines]), encoding="utf-8")
    guess = at(rupture=arrhenius(60e3), rebinding=arrhenius(60e3))
    scene = load(LENS | {"bonds": COHORT, "temperature": guess})
    table = measurement.read(path, scene)
    free = [free_number(scene, key) for key in ENERGIES]
    problem = problem_of(scene, [table], free, {})
    best = minimum(problem, problem.start, precision=1e-14)
    # with exact numbers the sum of squares is 0 there alone
    assert_allclose(best.x, [*ENERGIES.values()], rtol=1e-6)


def rise(problem, key, lowest):
    """Rise of the sum of squares with one energy held at its true value and the other one fitted."""
    rest = [item for item in problem.free if item.key != key]
    held = replace(problem, free=rest, fixed={key: ENERGIES[key]})
    return minimum(held, held.start).chi_square - lowest


@pytest.mark.verify
def test_intervals_hold_both_energies_as_often_as_they_say(curves):
    rng, repetitions = np.random.default_rng(49), 1000
    inside = np.empty((repetitions, 2), bool)
    for number in range(repetitions):
        noise = 0.03 * rng.standard_normal(len(curves.values))
        problem = replace(curves, values=curves.values * (1.0 + noise))
        best = minimum(problem, problem.start)
        rises = np.array([rise(problem, key, best.chi_square) for key in ENERGIES])
        # a value lies in the interval of the profile likelihood if its sum of squares is low enough
        inside[number] = rises <= stats.chi2.ppf(likelihood.LEVEL, 1)
        for k, truth in enumerate(ENERGIES.values() if number < 10 else ()):
            low, high, *_ = likelihood.interval(problem, best, k)
            assert inside[number, k] == (low <= truth <= high)
    shares = inside.mean(axis=0)
    assert np.all((shares >= 0.93) & (shares <= 0.97)), shares
