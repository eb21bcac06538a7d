"""Steppers: restart, batch and recording leave every bit as it was; parts know nothing of each other."""

import functools
import itertools
import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from helpers.scenes import (
    BONDS,
    BY_SLIP,
    BY_WAVES,
    CONTACTS,
    DRIVES,
    IN_TIME,
    SHEARS,
    SPECTRUM,
    follow,
    go_together,
    march,
    scene,
)
from numpy.testing import assert_allclose

from sim.parts import shear
from sim.parts.contact.models import Adhesion, Equilibrium
from sim.parts.shear.process import SlipRate
from sim.step.state import MemberNoise, pack, unpack

DEPTHS = {"drive": DRIVES, "bonds": BONDS, "shear": SHEARS, "contact": CONTACTS}


def model(depth):
    """Return the class of a depth, the controlled and reversible keys that it has, and its contact."""
    keys = [
        key
        for key in ("load", "indentation", "displacement", "reversible")
        if getattr(depth, key, None)
    ]
    return (type(depth).__name__, *keys, getattr(depth, "contact", "plane"))


MODELS = {
    part: {name: (part, *model(depth)) for name, depth in depths.items()}
    for part, depths in DEPTHS.items()
}


def every(*parts):
    """Every choice of these parts that go together, by the names of their depths."""
    cases = (
        dict(zip(parts, names, strict=True))
        for names in itertools.product(*(DEPTHS[part] for part in parts))
    )
    return [case for case in cases if go_together(case)]


def pairs_of(case):
    """The pairs of models that a case holds, and its depths."""
    return {
        *itertools.combinations([MODELS[part][name] for part, name in case.items()], 2),
        *case.items(),
    }


@functools.cache
def covering():
    """Few cases that hold every pair of models and every depth: greedily the case with most that is not seen yet."""
    numbers, cases = {}, every(*DEPTHS)
    masks = [
        sum(1 << numbers.setdefault(pair, len(numbers)) for pair in pairs_of(case))
        for case in cases
    ]
    chosen, left = [], (1 << len(numbers)) - 1
    while left:
        best = max(range(len(cases)), key=lambda i: (masks[i] & left).bit_count())
        chosen.append(cases[best])
        left &= ~masks[best]
    return chosen


def same(one, two):
    """True if two states agree to the last bit, nan equal to nan."""
    left, right = pack(one), pack(two)
    return left.keys() == right.keys() and all(
        np.array_equal(left[k], right[k], equal_nan=True) for k in left
    )


def check_case(case, members=3, steps=6, **parts):
    scenario = scene(
        members,
        steps,
        **parts,
        **{part: DEPTHS[part][name] for part, name in case.items()},
    )
    straight = list(march(scenario, np.arange(members)))
    assert len(straight) == steps + 1
    restarted = list(
        march(scenario, np.arange(members), unpack(scenario.parts, pack(straight[2])))
    )
    assert all(same(one, two) for one, two in zip(straight[3:], restarted, strict=True))
    alone = list(march(scenario, np.array([1])))
    for together, single in zip(straight, alone, strict=True):
        member = {
            k: v[1:2] if v.ndim and v.shape[0] == members else v
            for k, v in pack(together).items()
        }
        own = pack(single)
        slips = own["events.slips.log"].shape[1]  # others slip more
        member["events.slips.log"] = member["events.slips.log"][:, :slips]
        assert all(np.array_equal(member[k], v, equal_nan=True) for k, v in own.items())
    check_blocks(scenario, straight, members)
    for state in straight:
        check_waist(scenario, state, members)


def check_blocks(scenario, states, members):
    """Blocks of steps pass what the march passes, and end where it ends, recorded always or at every second step.

    The speed of a driven slider on ``counted`` bonds is recorded as it is before the bonds are drawn at the end of a
    step. The slider goes on with its answer to the draw, which only the states have. That speed is therefore compared
    with the records of single steps.
    """
    noise = MemberNoise.of(scenario.seed, np.arange(members))
    answers = scenario.drive.solves_motion and scenario.bonds.model == "counted"
    singly = [scenario.stepper.trajectory_of(states[0])]
    for state in states[:-1] if answers else ():
        step = state.step + 1
        singly.append(follow(scenario, noise, state, range(step, step + 1))[1])
    for stride in (1, 2):
        some = range(0, len(states), stride)
        end, passed = follow(scenario, noise, None, some)
        marched = [scenario.stepper.trajectory_of(states[step]) for step in some]
        if answers:
            marched = [
                record._replace(speed=singly[step].speed)
                for step, record in zip(some, marched, strict=True)
            ]
        for name, one, *others in zip(passed._fields, passed, *marched, strict=True):
            other = np.concatenate(others)
            assert np.array_equal(one, other, equal_nan=True), name
        assert same(end, states[some[-1]])


def check_waist(scenario, state, members):
    """Shapes follow from the classes; w is the balance of its parts; no contact is smaller than Hertz."""
    values = {
        "bonds": state.bonding.fraction,
        "shear": state.shear.energy,
        "contact": state.contact.radius,
    }
    for part, value in values.items():
        assert value.shape == ((members,) if scenario.varies[part] else (1,)), part
    work = np.broadcast_to(balance_of(scenario, state), state.contact.work.shape)
    # a contact stays as it is when the motion of its slider ends
    goes_on = np.ones(work.shape, bool)
    if scenario.drive.solves_motion:
        goes_on &= np.isfinite(state.drive.position)
    assert_allclose(state.contact.work[goes_on], work[goes_on], rtol=1e-13, atol=1e-16)
    control = scenario.contact.control(
        scenario.times.at(state.step), scenario.clock.duration
    )
    hertz = control.radius(np.zeros(1), scenario.bodies)
    closed = np.isfinite(state.contact.radius)
    if np.isfinite(hertz[0]):
        assert np.all(state.contact.radius[closed] >= hertz * (1 - 1e-12))


def balance_of(scenario, state):
    """w = Δγ φ − χ ΔΓ − α 6 τ0² a/(π E*), an open contact's at a = 0; on a disc ΔΓ is what its amplitude costs."""
    radius = np.nan_to_num(state.contact.radius, nan=0.0)
    stress = state.bonding.strength
    share = 1.0 if scenario.margin is None else scenario.margin(radius)
    paid = scenario.fluctuations.paid_by_adhesion * share * state.shear.energy
    mean = 0.0  # a stress is unknown once nothing holds the body
    if scenario.contact.reversible:
        mean = (
            scenario.contact.reversible
            * 6.0
            * stress**2
            * radius
            / (np.pi * scenario.solid.contact_modulus)
        )
    work, of_bonds = scenario.adhesion.work, scenario.adhesion.bond_share
    return work * (1.0 - of_bonds + of_bonds * state.bonding.fraction) - paid - mean


def check_cases(cases):
    for case in cases:
        try:
            check_case(case)
        except Exception as fault:
            fault.add_note(str(case))
            raise


@pytest.mark.parametrize("name", BONDS)
def test_any_depth_runs_with_any_depth(name):
    check_cases(case for case in covering() if case["bonds"] == name)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("drive", ["spring", "force"])
def test_bonds_followed_one_by_one_go_through_blocks_of_steps_in_a_contact_that_stays(
    drive,
):
    rigid = Adhesion(work=42e-3, bond_share=0.0)
    stays = scene(drive=DRIVES[drive], bonds=BONDS["tracked"], adhesion=rigid)
    assert stays.stepper.longest > 1
    check_case({"drive": drive, "bonds": "tracked"}, adhesion=rigid)


def test_more_fronts_between_bonds_of_one_limit_than_there_is_room_for_are_given_up():
    check_case(
        {
            "drive": "spring",
            "contact": "machine",
            "bonds": "cohort, cut-off",
            "shear": "mapped, stress",
        }
    )


def test_an_open_contact_has_no_area_at_the_largest_stress_that_all_members_share():
    check_case(
        {
            "drive": "steady",
            "contact": "lifted",
            "shear": "banded, slip, onset",
            "bonds": "rate",
        }
    )


DRAWN = {
    "in time": shear.Banded(**IN_TIME),
    "by waves, slip rate": shear.Banded(
        **BY_WAVES, tolerance=0.1, amplitude=SlipRate(memory_length=1e-5, floor=0.1)
    ),
    "by slip, slip rate": shear.Banded(**BY_SLIP, amplitude=SlipRate(floor=0.1)),
    "relaxing in time": shear.Banded(
        **IN_TIME, amplitude=SlipRate(memory_length=1e-5, relaxing=True)
    ),
    "on a disc": shear.Banded(
        **BY_SLIP, amplitude=SlipRate(floor=0.1, relaxing=True), contact="disc"
    ),
    "mean, on a disc": shear.Mean(
        spectrum=SPECTRUM,
        amplitude=SlipRate(memory_length=2e-6),
        contact="disc",
        paid_by_adhesion=0.5,
    ),
}


@pytest.mark.parametrize("contact", ["load", "load there and back"])
@pytest.mark.parametrize(
    ("drive", "bonds"),
    [("spring with mass", "rate"), ("spring", "rate, bell"), ("spring", "cohort")],
)
@pytest.mark.parametrize("name", DRAWN)
def test_the_loop_of_a_drive_draws_the_fluctuations_as_their_process_does(
    name, drive, bonds, contact, monkeypatch
):
    """In blocks, or by single steps; the loop opens and closes the contact as the model of the contact does."""
    of = scene(
        3,
        40,
        drive=DRIVES[drive],
        bonds=BONDS[bonds],
        shear=DRAWN[name],
        contact=CONTACTS[contact],
    )
    states, blocks, reached = list(march(of, np.arange(3))), [], Equilibrium.reached
    is_open = np.isnan([state.contact.radius for state in states])
    check_blocks(of, states, 3)
    changes = np.count_nonzero(np.any(is_open[1:] != is_open[:-1], axis=1))
    assert changes > 1 if contact == "load there and back" else changes == 0

    def by_model(model, *inputs):
        blocks.append(inputs[-1])
        with monkeypatch.context() as plain:
            plain.setattr(Equilibrium, "reached", reached)
            touch = model.advance(*inputs[:-1])
        assert_allclose(blocks[-1], touch.radius, rtol=1e-12)
        return touch

    monkeypatch.setattr(Equilibrium, "reached", by_model)
    follow(of, MemberNoise.of(of.seed, np.arange(3)), None, range(41))
    # a block ends at the end of a phase alone
    assert len(blocks) == len(of.phases.starts)
    assert sum(map(len, blocks)) == 40


def test_counted_bonds_of_a_slider_are_drawn_at_each_step_in_a_contact_that_stays():
    rigid = Adhesion(work=42e-3, bond_share=0.0)
    of = scene(
        3,
        40,
        drive=DRIVES["spring with mass"],
        bonds=BONDS["counted"],
        shear=SHEARS["uniform"],
        adhesion=rigid,
    )
    states = list(march(of, np.arange(3)))
    assert len({float(state.bonding.fraction[0]) for state in states}) > 5
    check_blocks(of, states, 3)


@pytest.mark.verify
@pytest.mark.parametrize("name", BONDS)
def test_every_depth_runs_with_every_depth(name):
    cases = (others | {"bonds": name} for others in every("drive", "contact", "shear"))
    check_cases(filter(go_together, cases))


def test_time_is_never_accumulated():
    scenario = scene(1, 1000)
    assert scenario.times.at(1000) == scenario.clock.duration
    assert math.isclose(scenario.times.at(333), 0.333, rel_tol=1e-15)


@pytest.mark.parametrize(
    "steps", [1000, pytest.param(1_000_000, marks=pytest.mark.verify)]
)
def test_long_marches_do_not_drift(steps):
    scenario = scene(1, steps, drive=DRIVES["steady"], bonds=BONDS["rate"])
    *_, last = march(scenario, np.arange(1))
    rate = 500.0 * (1.0 + 2e-3 / 1e-2)
    exact = 1.0 / 1.2 + (1.0 - 1.0 / 1.2) * math.exp(-rate * scenario.clock.duration)
    assert_allclose(last.bonds.bound, exact, rtol=1e-12)
    assert_allclose(
        last.drive.position, 2e-3 * scenario.clock.duration, rtol=1e-16 * steps + 1e-14
    )


@pytest.mark.parametrize("drive", ["steady", "spring"])
def test_a_state_goes_on_in_another_scene_with_the_same_parts_and_in_the_same_one_to_the_last_bit(
    drive,
):
    parts = {
        "drive": DRIVES[drive],
        "bonds": BONDS["rate, bell"],
        "shear": SHEARS["banded, slip, onset"],
    }
    of, again = (scene(3, 40, **parts, contact=CONTACTS["load"]) for _ in range(2))
    pressed = replace(of, contact=Equilibrium(load=1.5 * of.contact.load))
    noise = MemberNoise.of(of.seed, np.arange(3))
    middle, _ = follow(of, noise, None, range(21))
    ends = [
        stepper.stepper.advance(deepcopy(middle), noise, range(21, 41))
        for stepper in (of, again, pressed)
    ]
    assert same(ends[0][0], ends[1][0])
    assert np.all(ends[2][1].radius > ends[0][1].radius)
