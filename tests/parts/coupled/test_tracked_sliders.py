"""Slider and bonds followed one by one, solved together, against closed forms, cohorts and their own statistics."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from helpers.direct import areas, gillespie, replay
from helpers.driven import (
    AREA,
    LOAD,
    STRETCH,
    UNIT,
    force,
    march,
    marched,
    reached,
    residual,
    scenario,
    spring,
)
from helpers.scenes import BONDS, DRIVES, IN_TIME, SHEARS, scene
from numpy.testing import assert_allclose

from sim import run
from sim.numerics.noise import PARTS
from sim.parts.bonds.models import Cohort, Tracked
from sim.parts.bonds.rupture import Constant, CutOff
from sim.parts.bonds.tracked import BOUND, MOST_TURNED, SINGLY, SQUARES, SUM, TURNED
from sim.parts.drive import Force
from sim.parts.shear import Banded
from sim.read import stick_slip
from sim.step.state import MemberNoise, pack, unpack


def tracked(duration, steps, drive, sites, **keys):
    """A lens whose bonds are followed one by one."""
    return scenario(
        duration, steps, drive, make=functools.partial(Tracked, sites=sites), **keys
    )


def forces(states):
    """Force a site over the area at rest, in the units of the bonds; one row a state, one column a member."""
    return np.array([state.bonding.stress * AREA / UNIT for state in states])


@pytest.mark.parametrize(
    ("sites", "load", "mean"), [(5, 2.0, 0.776110717635), (10, 5.0, 0.589619750203)]
)
def test_bonds_that_share_a_force_and_are_not_remade_all_break_in_the_time_of_a_pure_death_process(
    sites, load, mean
):
    # i bonds break at the rate i exp(f/i): the mean is the sum of exp(-f/i)/i, its variance that of the squares
    members = np.arange(4000)
    bound, lonely = (
        tracked(8.0, 2, force(load / sites), sites, rebinding=rate)
        for rate in (1e15, 1e-15)
    )
    states = list(march(lonely, members, next(march(bound, members))))
    each = [math.exp(-load / i) / i for i in range(1, sites + 1)]
    assert_allclose(sum(each), mean, rtol=1e-9)
    assert abs(np.mean(states[-1].drive.runaway_time) - mean) < 4.0 * math.sqrt(
        sum(np.square(each)) / len(members)
    )


@pytest.mark.parametrize(
    "rupture",
    [{}, {"rupture": CutOff(stretch=STRETCH)}, {"rupture": Constant(rate=1.0)}],
)
def test_the_energies_of_every_slider_are_balanced_and_bonds_snap_where_nothing_delays_them(
    rupture,
):
    alone = {}, {"damping": 0.01}, {"mass": 1e-3, "damping": 1e-3}
    alone += ({"contact": "half_space", "viscosity": 0.01, "damping": 0.01},)
    for keys in alone + (
        {"contact": 0.2},
        {"contact": 0.2, "viscosity": 0.01},
        {"contact": 0.3, "mass": 1e-2},
    ):
        missing = []
        for tolerance in (1e-6, 1e-8):
            _, read = marched(
                tracked(
                    8.0,
                    8,
                    spring(0.2, tolerance=tolerance, **keys),
                    100,
                    share=0.3,
                    **rupture,
                )
            )
            missing.append(residual(read))
        assert missing[0] < 1e-3
        assert missing[1] < max(0.3 * missing[0], 1e-10)
        slips_at_once = "viscosity" not in keys and ("contact" in keys or not keys)
        assert (
            read["dissipated_by_snaps"][-1] > 1e-12 * read["drive_work"][-1]
        ) == slips_at_once


@pytest.mark.parametrize("rupture", [{}, {"rupture": Constant(rate=1.0)}])
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_the_closed_form_from_event_to_event_is_the_limit_of_short_sub_steps(
    rupture, share
):
    # the area changes with the bonds and with the fluctuations; a load that hardly changes takes the sub-steps
    fluctuating, firm = (
        Banded(**IN_TIME),
        {"damping": 0.3 * UNIT / STRETCH, "tolerance": 1e-10},
    )
    slow, grows = (
        {"stiffness": 0.2, "tolerance": 1e-10},
        {"from": 0.1 * UNIT, "to": UNIT},
    )
    of_spring = (
        {},
        {"damping": 0.05},
        {"contact": 0.2},
        {"contact": 0.2, "damping": 0.3},
    )
    drives = [spring(**slow, **keys) for keys in of_spring] + [
        force(0.5, **firm),
        Force(force=grows, **firm),
    ]
    for drive in drives:
        still, moving = (
            dataclasses.replace(
                tracked(3.0, 6, drive, 20, share=share, load=load, **rupture),
                shear=fluctuating,
            )
            for load in (LOAD, {"from": LOAD, "to": LOAD * (1.0 + 1e-12)})
        )
        (closed, read), (stepped, other) = marched(still), marched(moving)
        ends = [reached(states, "position") for states in (closed, stepped)]
        assert_allclose(*ends, rtol=1e-6, atol=1e-8)
        assert all(
            np.array_equal(*lives)
            for lives in zip(closed[-1].bonds.life, stepped[-1].bonds.life, strict=True)
        )
        assert (
            share > 0.0
            or drive.damping == 0.0
            or read["substeps"][-1] < 0.5 * other["substeps"][-1]
        )
        assert residual(read) < 1e-9


def test_many_bonds_above_the_onset_fluctuate_as_one_over_the_root_of_their_number_about_the_cohorts():
    clock, keys = (2.0, 20), {"start": "steady"}
    drive = spring(0.3, start="steady")
    make = functools.partial(Cohort, tolerance=1e-5)
    mean = forces(
        list(march(scenario(*clock, drive, make=make, **keys), np.arange(1)))
    )[10:, 0]
    spreads, biases = [], []
    cases = (25, 200), (400, 60)
    for sites, members in cases:
        found = forces(
            list(march(tracked(*clock, drive, sites, **keys), np.arange(members)))
        )[10:]
        error = np.std(found, axis=1) / math.sqrt(members)
        spreads.append(np.mean(np.std(found, axis=1)))
        biases.append(np.mean(found.mean(axis=1) - mean))
        assert abs(biases[-1]) < 4.0 * np.mean(error) + 2.0 * np.mean(mean) / sites
    # a spread over M members has a relative error of 1/√(2M) at each of the times
    error = math.sqrt(sum(0.5 / members for _, members in cases))
    assert_allclose(spreads[0] / spreads[1], 4.0, rtol=3.0 * error)


@pytest.mark.verify
def test_above_the_onset_the_mean_force_of_few_bonds_is_off_by_one_over_their_number():
    clock, drive = (2.0, 20), spring(0.3, start="steady")
    make = functools.partial(Cohort, tolerance=1e-6)
    mean = forces(
        list(march(scenario(*clock, drive, make=make, start="steady"), np.arange(1)))
    )[10:].mean()
    off, errors, spreads = [], [], []
    for sites, members in ((25, 8000), (100, 4000)):
        found = forces(
            list(
                march(tracked(*clock, drive, sites, start="steady"), np.arange(members))
            )
        )[10:]
        own = found.mean(axis=0) - mean
        off.append(sites * own.mean())
        errors.append(sites * own.std(ddof=1) / math.sqrt(members))
        spreads.append(math.sqrt(sites) * found.std(axis=1, ddof=1).mean())
    assert off[0] > 3.0 * errors[0]
    assert abs(off[1] - off[0]) < 3.0 * math.hypot(*errors)
    assert_allclose(spreads[0], spreads[1], rtol=1.0 / 25)  # to the next order


@pytest.mark.verify
def test_below_the_onset_period_size_and_peak_of_slips_approach_those_of_the_cohorts():
    # slip events begin and end at clock steps: longer ones spread the slips themselves
    def slips(make, members):
        found = stick_slip(
            run(scenario(30.0, 6000, spring(0.015), make=make, members=members))
        )
        return {name: found[name].value.to_numpy() for name in (*sizes, "slip_spread")}

    sizes = "recurrence_time", "slip_amplitude", "force_drop", "static_friction"
    exact = slips(functools.partial(Cohort, tolerance=1e-5), 1)
    few, many = (
        slips(functools.partial(Tracked, sites=sites), members)
        for sites, members in ((100, 32), (400, 16))
    )
    for name in sizes:
        off = [np.mean(found[name]) - exact[name].item() for found in (few, many)]
        errors = [
            np.std(found[name], ddof=1) / math.sqrt(len(found[name]))
            for found in (few, many)
        ]
        assert abs(off[1]) < abs(off[0]) / 4.0 + 3.0 * math.hypot(
            errors[0] / 4.0, errors[1]
        ), name
    # the sizes of slips spread by one over the root of the number at most, within three standard errors
    spreads = [found["slip_spread"] for found in (few, many)]
    means, errors = zip(
        *((np.mean(s), np.std(s, ddof=1) / math.sqrt(len(s))) for s in spreads),
        strict=True,
    )
    assert (
        exact["slip_spread"].item()
        < 0.01
        < means[1]
        < 0.5 * means[0] + 3.0 * math.hypot(0.5 * errors[0], errors[1])
    )


def test_a_slider_comes_to_rest_within_a_clock_step_in_few_sub_steps():
    """Damping takes all but 1e-11 of the energy of an unloaded interface: later losses are roundings of the sum."""
    drive = DRIVES["spring with unloaded holds"]
    shear = SHEARS["modal, wave, relaxing stress"]
    scenario = scene(1, 3, drive=drive, shear=shear, bonds=BONDS["tracked, constant"])
    *_, before, end = march(scenario, np.arange(1))
    assert end.drive.position < 1e-5 * before.drive.position
    # some ten for each of 20 relaxation times, and again after each event; a balance below rounding took a million
    assert end.drive.substeps < 1e4


def test_a_state_that_has_been_advanced_is_not_advanced_again():
    scene = tracked(1.0, 4, spring(1.0), 10)
    states = march(scene, np.arange(1), keep=False)
    first, _ = next(states), next(states)
    with pytest.raises(RuntimeError, match="already been advanced"):
        list(march(scene, np.arange(1), first))


def addressed(seed, member, sites):
    """Thresholds and waiting times of all sites by numpy's Philox, for a number of their lives."""
    key = np.array([seed, PARTS["bonds"]], dtype=np.uint64)

    @functools.cache
    def draw(life):
        values = np.empty((2, sites))
        for site in range(sites):
            # numpy counts on before it draws; the first life of a bond has its threshold in the second word of lane 1
            lane = int(life == 1)
            counter = np.array([site, life, member, lane], dtype=np.uint64)
            words = np.random.Philox(key=key, counter=counter).random_raw(4)
            uniform = (words[lane : lane + 2] >> np.uint64(12)) * 2.0**-52
            values[:, site] = -np.log1p(-uniform)
        return values

    return draw


@pytest.mark.parametrize("share", [0.3, 1.0])
@pytest.mark.parametrize("sites", [1, 2, 5, 20, 200])
def test_bonds_that_a_growing_contact_turns_back_live_the_lives_of_their_draws(
    sites, share
):
    duration = min(40.0, 2000.0 / sites)
    steps, ends = 40, np.linspace(0.0, duration, 41)[1:]
    drive = spring(0.1, speed=5.0)
    scene = tracked(duration, steps, drive, sites, share=share, start="bonded")
    states = list(march(scene, np.arange(2)))[1:]
    for member in range(2):
        draw = addressed(scene.seed, member, sites)
        x, number = replay(0.1, ([math.inf], [5.0]), areas(sites, share), draw, ends)
        own = [state.drive.position[member] / STRETCH for state in states]
        assert_allclose(own, x, rtol=1e-12, atol=1e-10)
        assert np.array_equal(
            [state.bonds.frame[member, BOUND] for state in states], number
        )


def test_a_stage_that_reverses_turns_more_bonds_than_are_listed_and_they_live_their_lives():
    # sub-steps of the reversal end at events but for a share of 1e-8
    sites, speed, turn = 300, 5.0, 3.0
    course = {
        "time": (0.0, turn, turn, 2.0 * turn),
        "value": (speed, speed, -speed, -speed),
    }
    course["value"] = tuple(value * STRETCH for value in course["value"])
    scene = tracked(
        2.0 * turn,
        60,
        spring(0.1, speed=course, tolerance=1e-10),
        sites,
        share=1.0,
        start="bonded",
    )
    states = list(march(scene, np.arange(1)))[1:]
    stage = [turn, math.inf], [speed, -speed]
    times = np.linspace(0.0, 2.0 * turn, 61)[1:]
    x, number = replay(
        0.1, stage, areas(sites, 1.0), addressed(scene.seed, 0, sites), times
    )
    assert_allclose(
        [state.drive.position[0] / STRETCH for state in states], x, rtol=0, atol=1e-6
    )
    assert np.array_equal([state.bonds.frame[0, BOUND] for state in states], number)
    singly, turned = (
        np.array([state.bonds.frame[0, column] for state in states])
        for column in (SINGLY, TURNED)
    )
    assert singly.any()
    assert not singly[-1]
    assert np.max(turned) > 0


def test_few_bonds_are_turned_at_a_time_so_that_an_event_costs_the_same_on_any_number_of_sites():
    for sites in (20, 2000):
        scene = tracked(
            20.0 / sites + 1.0, 50, spring(0.1, speed=5.0), sites, share=1.0
        )
        states = list(march(scene, np.arange(1), keep=False))
        frames = np.array([state.bonds.frame[0] for state in states])
        assert not frames[:, SINGLY].any()
        assert np.any(frames[:, TURNED] > 0.0)
        assert np.all(frames[:, TURNED] < MOST_TURNED // 4)


def test_the_sums_of_turned_bonds_are_those_of_the_sites_and_go_on_from_a_stored_state():
    scene = tracked(40.0, 40, spring(0.1, speed=5.0), 50, share=1.0)
    noise = MemberNoise.of(scene.seed, np.arange(2))
    once, _ = scene.stepper.follow(noise, None, range(1, 41))
    state, turned = scene.stepper.start(noise), 0.0
    for step in range(1, 41):
        stored = {name: array.copy() for name, array in pack(state).items()}
        state = unpack(scene.parts, stored)
        state, _ = scene.stepper.advance(state, noise, range(step, step + 1))
        bonds = state.bonds
        births = np.where(np.signbit(bonds.due), 0.0, bonds.birth)
        scale = STRETCH * 50
        assert_allclose(
            births.sum(axis=1), bonds.frame[:, SUM], rtol=0, atol=1e-12 * scale
        )
        assert_allclose(
            np.square(births).sum(axis=1),
            bonds.frame[:, SQUARES],
            rtol=0,
            atol=1e-12 * scale * STRETCH * 16,
        )
        turned += bonds.frame[:, TURNED].sum()
    assert turned > 0.0
    for name, array in pack(once).items():
        assert np.array_equal(array, pack(state)[name], equal_nan=True), name


@pytest.mark.parametrize(
    ("sites", "members", "duration"),
    [
        (5, 1000, 4.0),
        (20, 300, 4.0),
        *(
            pytest.param(*case, marks=pytest.mark.verify)
            for case in ((200, 200, 4.0), (2000, 24, 2.0), (20_000, 8, 0.5))
        ),
    ],
)
def test_force_bonds_and_slips_have_the_laws_of_the_direct_method_that_sums_over_all_sites(
    sites, members, duration
):
    stiffness, speed, steps = 0.1, 5.0, round(4 * sites * duration)
    drive = spring(stiffness, speed=speed)
    scene = tracked(duration, steps, drive, sites, share=1.0, start="bonded")
    noise = MemberNoise.of(scene.seed, np.arange(members))
    times = np.linspace(0.0, duration, steps + 1)[1:]
    trajectory = scene.stepper.follow(noise, None, range(1, steps + 1))[1]
    area = areas(sites, 1.0)
    ours = trajectory.position.T / STRETCH, 0.5 * sites * trajectory.fraction.T
    own = [
        gillespie(stiffness, speed, area, times, np.random.default_rng(member))
        for member in range(members)
    ]
    samples = []
    for x, number in (ours, np.swapaxes(own, 0, 1)):
        late = times > 0.5 * duration
        force, slips = (speed * times - x)[:, late], np.diff(x, axis=1)[:, late[1:]]
        values = (force, number[:, late], slips, slips < 0.0)
        samples.append(
            [np.mean(value, axis=1) for value in values]
            + [np.mean(np.square(value), axis=1) for value in values[:3]]
            + [np.mean(force**3, axis=1), np.mean(force * number[:, late], axis=1)]
        )
    for first, second in zip(*samples, strict=True):
        error = math.sqrt((np.var(first, ddof=1) + np.var(second, ddof=1)) / members)
        assert abs(np.mean(first) - np.mean(second)) < 5.0 * error
