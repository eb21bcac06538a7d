"""A contact with a range of adhesion in a run: its loop, what is held as the work falls, its limit, what is refused."""

import math

import numpy as np
import pytest
from helpers.scenes import BONDS, BY_SLIP, SHEARS, scene, shear
from numpy.testing import assert_allclose

import sim
from sim.laws import cohesive
from sim.parts.contact import Cohesive, Equilibrium
from sim.parts.contact.balance import Balance
from sim.parts.contact.models import Bodies
from sim.read.observables import charges
from sim.solid import HalfSpace
from sim.units.errors import BadInput

WORK, BODY = 0.4, (1e-7, 4.65e10)
#: A tip in nanonewtons on a half-space of the contact modulus ``BODY[1]``.
TIP = {
    "clock": {"duration": "1 s", "step": "10 ms"},
    "solid": {"shear_modulus": BODY[1] / 4.0},
    "sphere": {"radius": BODY[0]},
    "adhesion": {"work": WORK},
    "drive": {"model": "steady", "speed": "1 um/s"},
    "bonds": {"model": "none", "stress": "1 GPa"},
}
SCALE = (4.5 / math.pi * BODY[0] / WORK / BODY[1] ** 2) ** (1 / 3)


def mounted(number, stiffness, reach):
    """Return the contact table of a loop from contact to beyond the reach and back."""
    depth, stress = 2e-9, number / SCALE
    far = {"from": depth, "to": -3.0 * reach, "cycles": 1}
    mount = {"indentation": far}
    if math.isfinite(stiffness):
        mount = {"displacement": far, "stiffness": stiffness}
    held = {"model": "cohesive", "cohesive_stress": stress}
    return held | mount | {"after_pull_off": "reattach"}


@pytest.mark.parametrize("stiffness", [20.0, 2e3, math.inf])
@pytest.mark.parametrize("number", [0.3, 1.5, 20.0])
def test_a_loop_jumps_in_at_the_reach_and_off_at_the_fold_and_dissipates_their_energies(
    number, stiffness
):
    """The laws have the energies of both jumps, whose difference is the area of the loop."""
    stress = number / SCALE
    reach = WORK / stress
    last = cohesive.pull_off(stiffness, WORK, stress, *BODY)
    farthest = last.indentation + last.load / stiffness
    contact = mounted(number, stiffness, max(reach, -farthest))
    dataset = sim.run(TIP | {"contact": contact})
    first = cohesive.equilibrium(0.0, -reach, stiffness, WORK, stress, *BODY)

    def energy(touch):
        return touch.energy + 0.5 * touch.load**2 / stiffness

    for name, value in (
        ("pull_off_displacement", farthest),
        ("pull_off_load", last.load),
        ("jump_in_displacement", -reach),
        ("jump_in_load", first.load),
        ("dissipated_energy", energy(last) - energy(first)),
    ):
        found = dataset[name].to_numpy().ravel()[-1]
        assert_allclose(found, value, rtol=1e-9, err_msg=name)
    assert dataset["detachments"].item() == 1.0
    base = dataset["displacement"].to_numpy().ravel()
    is_open = dataset["outer_radius"].to_numpy().ravel() == 0.0
    touch = cohesive.equilibrium(0.0, base, stiffness, WORK, stress, *BODY)
    for name, values in (
        ("contact_radius", touch.inner),
        ("outer_radius", touch.outer),
        ("normal_load", touch.load),
    ):
        found = dataset[name].to_numpy().ravel()
        assert_allclose(found[~is_open], values[~is_open], rtol=1e-13, atol=0)
        assert np.all(found[is_open] == 0.0)
    assert np.all(is_open[base < farthest])


def test_friction_acts_where_the_surfaces_touch_and_not_where_they_attract_each_other():
    contact = mounted(0.3, math.inf, 2e-9)
    dataset = sim.run(TIP | {"contact": contact})
    radius = dataset["contact_radius"]
    assert_allclose(dataset["friction_force"], 1e9 * np.pi * radius**2, rtol=1e-14)
    attracted = (dataset["outer_radius"] > 0.0) & (radius == 0.0)
    assert attracted.any()
    assert np.all(dataset["in_contact"].where(attracted, 0.0) == 0.0)
    assert np.all(dataset["normal_load"].where(attracted, -1.0) < 0.0)


def test_range_or_stress_is_held_as_the_work_falls_and_the_contact_differs():
    """At half of the work, no load and lambda = 0.7 at rest the areas differ by 14 and 33 %, as computed apart."""
    stress = 0.7 / SCALE
    distance = cohesive.LENNARD_JONES * WORK / stress
    bodies = Bodies(BODY[0], HalfSpace(BODY[1] / 4.0))
    inner, outer = [], []
    for held in ({"range": distance}, {"cohesive_stress": stress}):
        control = Cohesive(load=0.0, **held).control(0.0, 1.0)
        work = np.array([WORK, 0.5 * WORK])
        inner.append(control.radius(work, bodies) ** 2)
        outer.append(control.outer_radius(inner[-1], bodies, work) ** 2)
    assert_allclose(inner[0][0], inner[1][0], rtol=1e-13)
    differences = [areas[0][1] / areas[1][1] - 1.0 for areas in (inner, outer)]
    assert_allclose(differences, [-0.14, 0.33], atol=0.005)


@pytest.mark.parametrize(
    "fluctuations", [SHEARS["uniform"], shear.Modal(**BY_SLIP)], ids=["none", "modal"]
)
def test_a_short_range_is_the_equilibrium_of_jkr_in_a_run(fluctuations):
    """With fluctuations of each member and bonds that break, and in other respects with the same random numbers."""
    radii = {}
    mount = {"displacement": 1e-6, "stiffness": 2e3}
    for contact in (Equilibrium(**mount), Cohesive(**mount, range=1e-11)):
        run = scene(4, 8, contact=contact, shear=fluctuations, bonds=BONDS["rate"])
        radii[contact.model] = sim.run(run)["contact_radius"]
    # the number is 5e4 and JKR is off by its inverse square
    assert_allclose(radii["cohesive"], radii["equilibrium"], rtol=1e-8)


def test_a_masked_contact_is_hertz_and_does_not_jump_in():
    bodies = Bodies(BODY[0], HalfSpace(BODY[1] / 4.0))
    contact = Cohesive(indentation=1e-9, range=0.3e-9)
    control = contact.control(0.0, 1.0)
    assert_allclose(control.radius(np.array([-0.1]), bodies), math.sqrt(1e-16))
    away = Cohesive(indentation=-1e-10, range=0.3e-9).control(0.0, 1.0)
    assert away.touches(np.array([0.4, 0.0, -0.1])).tolist() == [True, False, False]
    balance = Balance(*np.array([[0.1], [0.2], [0.0]]), None, bodies, 0.4)
    assert_allclose(contact.equilibrium(control, balance), math.sqrt(1e-16))


@pytest.mark.parametrize(
    ("changes", "place", "cure"),
    [
        (
            {"contact": {"range": "1 nm", "cohesive_stress": "1 GPa"}},
            "contact",
            "range",
        ),
        ({"contact": {}}, "contact", "cohesive_stress"),
        ({"contact": {"range": "1 nm", "reversible": 0.5}}, "contact", "reversible"),
        (
            {"drive": {"model": "spring", "stage": 1e-6, "stiffness": 1.0}},
            "contact.model",
            "drive.speed",
        ),
        (
            {
                "shear": {
                    "model": "mean",
                    "spectrum": {"model": "gaussian", "rms": "1 MPa", "length": "1 nm"},
                    "contact": "disc",
                }
            },
            "contact.model",
            "shear.contact",
        ),
        (
            {"solid": {"shear_modulus": "1 GPa", "thickness": "50 nm"}},
            "contact.model",
            "solid.thickness",
        ),
    ],
)
def test_what_a_cohesive_contact_cannot_do_is_refused_by_its_key(changes, place, cure):
    table = {"model": "cohesive", "load": 0.0, "range": "1 nm"}
    if "contact" in changes:
        table = {"model": "cohesive", "load": 0.0} | changes["contact"]
    with pytest.raises(BadInput) as fault:
        sim.load(TIP | changes | {"contact": table})
    assert any(place in text and cure in text for text in fault.value.problems)


def test_a_check_names_the_model_where_jkr_ends_and_is_silent_with_it():
    tip = TIP | {"contact": {"load": 0.0}}
    assert any("cohesive" in text for text in sim.load(tip).remarks())
    contact = {"model": "cohesive", "load": 0.0, "range": "0.3 nm"}
    assert not any(
        "Tabor" in text for text in sim.load(tip | {"contact": contact}).remarks()
    )
    wide = {"sphere": {"radius": "1 m"}, "contact": {"load": 0.0}}
    assert not any("cohesive" in text for text in sim.load(TIP | wide).remarks())


@pytest.mark.parametrize("held", [{"range": 0.4e-6}, {"cohesive_stress": 3e4}])
@pytest.mark.parametrize(
    "mount", [{"load": 4e-3}, {"displacement": 1e-6, "stiffness": 2e3}]
)
def test_what_is_read_with_another_work_of_adhesion_has_the_range_too(mount, held):
    """Without bonds that break, fluctuations take the same share in both orders, one recorded and one computed."""
    contact, field = Cohesive(**mount, **held), shear.Modal(**BY_SLIP)
    dataset = sim.run(scene(4, 8, contact=contact, shear=field, bonds=BONDS["none"]))
    shares = charges(dataset)
    assert np.all(shares["lost_to_fluctuations"] > 0.0)
    first = shares["lost_to_fluctuations_first"]
    assert_allclose(first, shares["lost_to_fluctuations"], rtol=1e-11)
