"""Memory of fluctuations in the sub-steps of a slider: its integrals, its path, and no dependence on the clock step."""

import dataclasses
import functools
import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from helpers import driven
from helpers.driven import MemberNoise, follow, march
from helpers.scenes import BONDS, BY_SLIP, CELL, SPECTRUM, scene
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

import sim
from sim.laws import jkr
from sim.parts.bonds.models import Cohort, FirstMoment, Tracked
from sim.parts.coupled import coupled, mechanics
from sim.parts.drive import READINGS, Force, Spring
from sim.parts.exchange import NO_DRAWS, Times
from sim.parts.shear import Banded, Mean
from sim.parts.shear.bands import BandedProcess
from sim.parts.shear.process import Slip, SlipRate, Time

#: Square over 12 of the slip between two nodes, 0.49 of half a memory at most: the error where weights are averaged.
ERROR = (0.49 * 0.5) ** 2 / 12.0
LENS = Path(__file__).parents[3] / "scenarios" / "pdms_lens_spring.toml"
FEW_SITES = functools.partial(Tracked, sites=9)


@pytest.mark.parametrize(
    ("make", "correlation", "relaxing"),
    [(FirstMoment, Slip, True), (Cohort, Time, True), (FEW_SITES, Slip, False)],
)
def test_the_memory_within_a_clock_step_is_the_integral_along_the_slip(
    make, correlation, relaxing
):
    # from rest a mass on a spring moves with V (1 − cos ωt), past next to no bonds: 2.5 memories in a clock step
    speed, turn, memory, floor = (
        10.0 * driven.STRETCH,
        2.0 * math.pi,
        2.0 * driven.STRETCH,
        0.3,
    )
    law = correlation(1.5 * memory if correlation is Slip else 0.4)
    amplitude = SlipRate(memory_length=memory, floor=floor, relaxing=relaxing)
    shear = Banded(
        spectrum=SPECTRUM,
        cell=CELL,
        correlation=law,
        amplitude=amplitude,
        paid_by_adhesion=0.0,
    )
    few = {
        "make": lambda **keys: make(**(keys | {"site_density": 1e-7 * driven.DENSITY}))
    }
    lens = driven.scenario(
        1.75, 7, driven.spring(1.0, mass=turn**-2, tolerance=1e-8), **few
    )

    def rates(time, values):
        (a0, a1, a2, renewed), v = values, speed * (1.0 - math.cos(turn * time))
        size = (
            floor**2 + (1.0 - floor**2) * (1.0 - a1 * a1 / (a0 * a2))
            if relaxing
            else 1.0
        )
        rate = 2.0 * v / law.length if correlation is Slip else 2.0 / law.time
        return (
            1.0 - v * a0 / memory,
            v - v * a1 / memory,
            v * v - v * a2 / memory,
            rate * (size - renewed),
        )

    begin, bend = 1e-4, 0.5 * speed * turn**2  # V = bend t² at first
    values = np.array([begin, bend * begin**3 / 3.0, bend**2 * begin**5 / 5.0, 0.0])
    for state in list(march(dataclasses.replace(lens, shear=shear), np.arange(1)))[1:]:
        end = lens.times.at(state.step)
        values = solve_ivp(
            rates, (begin, end), values, "LSODA", rtol=1e-9, atol=1e-30
        ).y[:, -1]
        (a0, a1, a2, renewed), past = values, state.shear.past
        exact = a0, a1 / a0, a2 - a1**2 / a0, renewed
        assert_allclose(
            np.concatenate([past.weight, past.mean, past.spread, past.renewed]),
            exact,
            rtol=ERROR,
        )
        begin, values[3] = end, 0.0  # ΔΓ is drawn


def test_the_path_of_a_body_that_rings_counts_each_of_its_turns():
    # a mass on a spring whose stage stops after half a period: V (1 − cos ωt), then 2V cos ω(t − 1/2)
    speed, turn, step, few = 10.0 * driven.STRETCH, 2.0 * math.pi, 0.35, 1e-7
    stops = {"time": (0.0, 0.5, 0.5, 2.1), "value": (speed, speed, 0.0, 0.0)}
    body = driven.spring(1.0, stops, mass=turn**-2, tolerance=1e-4)
    lens = driven.scenario(
        6.0 * step,
        6,
        body,
        make=lambda **keys: FirstMoment(
            **(keys | {"site_density": few * driven.DENSITY})
        ),
    )
    stepper, noise, steps = lens.stepper, MemberNoise.of(1, np.arange(1)), range(1, 7)
    state = stepper.start(noise)
    motions = coupled.advance(
        lens.parts,
        state.drive,
        state.bonds,
        stepper._around(state.contact, state.shear, steps),
        lens.times,
        steps,
        noise.bonds,
        stepper._ends(state, noise, steps),
    ).motions

    def path(time):
        if time <= 0.5:
            return speed * (time - math.sin(turn * time) / turn)
        swings, rest = divmod(turn * (time - 0.5), math.pi)
        quarters = 2.0 * swings + (
            math.sin(rest) if rest <= 0.5 * math.pi else 2.0 - math.sin(rest)
        )
        return 0.5 * speed + 2.0 * speed / turn * quarters

    exact = np.diff([path(step * k) for k in range(7)])
    assert_allclose(motions.path[:, 0], exact, rtol=few)  # the force of so few bonds


def test_the_path_of_a_speed_with_two_turns_is_the_sum_of_its_three_parts():
    # the speed 6 (s − 1/4)(s − 3/4) has the slips 1/8, −1/8, 1/8
    assert mechanics.path_of(0.125, 1.125, 1.125, 1.0) == 0.375
    assert mechanics.path_of(-0.125, -1.125, -1.125, 1.0) == 0.375
    assert mechanics.path_of(0.5, 0.0, 1.0, 1.0) == 0.5
    assert mechanics.path_of(0.0, -1.0, 1.0, 2.0) == 1.0


def at_once(lens, state, expected, drawn):
    """Slip and path in next to no time, where ΔΓ was ``expected`` and is ``drawn``."""
    shear = state.shear._replace(
        energy=drawn, expected=expected, past=state.shear.past._replace(energy=drawn)
    )
    stepper, noise = lens.stepper, MemberNoise.of(1, np.arange(1))
    around = stepper._around(state.contact, shear, range(1, 2))
    ends = stepper._ends(state, noise, range(1, 2))._replace(follows=False)
    motions = coupled.advance(
        lens.parts,
        state.drive,
        deepcopy(state.bonds),
        around,
        Times(1e-15, 1, 1e-15),
        range(1, 2),
        noise.bonds,
        ends,
    ).motions
    return motions.slip[0, 0], motions.path[0, 0]


@pytest.mark.parametrize("make", [FirstMoment, Cohort, FEW_SITES])
def test_sliding_at_one_speed_over_millions_of_memories_needs_few_sub_steps(make):
    # a force on a viscous contact with next to no bonds: V = Q/(η A), and A0 = l/V
    memory, few = 1e-7 * driven.STRETCH, {"site_density": 1e-9 * driven.DENSITY}
    drive = driven.force(1.0, viscosity=driven.DENSITY * driven.KAPPA)
    lens = driven.scenario(2.0, 2, drive, make=lambda **keys: make(**(keys | few)))
    shear = Mean(
        spectrum=SPECTRUM,
        amplitude=SlipRate(memory_length=memory),
        paid_by_adhesion=0.0,
    )
    end = list(march(dataclasses.replace(lens, shear=shear), np.arange(1)))[-1]
    assert_allclose(end.drive.position, 2.0 * driven.STRETCH, rtol=1e-6)
    assert_allclose(
        [end.shear.past.weight, end.shear.past.mean],
        [[1e-7], [driven.STRETCH]],
        rtol=1e-6,
    )
    assert end.drive.substeps[0] < 2000.0


@pytest.mark.parametrize("bonds", ["rate, bell", "cohort", "tracked"])
def test_the_elastic_answer_to_noise_is_no_path_but_that_to_the_mean_and_to_a_force_is(
    bonds,
):
    shear = Banded(
        **BY_SLIP, amplitude=SlipRate(floor=0.5, relaxing=True), paid_by_adhesion=0.1
    )
    lens = scene(
        1, 8, drive=Spring(stage=2e-2, stiffness=100.0), bonds=BONDS[bonds], shear=shear
    )
    *_, state = march(lens, np.arange(1))
    read = dict(zip(READINGS, lens.parts.drive.readings(state.drive)[0], strict=True))
    assert abs(read["energy_residual"]) < 1e-6 * read["drive_work"]
    low, high = state.shear.expected, 2.0 * state.shear.expected
    (_, still), (noisy, none), (slip, path) = (
        at_once(lens, state, *e) for e in ((low, low), (low, high), (high, high))
    )
    assert path > 100.0 * still
    assert_allclose([noisy, path, none], [slip, slip, still], rtol=1e-6)
    pushed = scene(1, 8, drive=Force(force=1e-4), bonds=BONDS[bonds], shear=shear)
    state = next(march(pushed, np.arange(1)))
    slip, path = at_once(pushed, state, state.shear.energy, state.shear.energy)
    assert_allclose(path, slip, rtol=1e-6)
    assert path > 0.0


def slipping(step, duration, speed, members=1, **keys):
    """The spring-driven lens, in clock steps of some ms."""
    values = {
        "clock.step": f"{step} ms",
        "clock.duration": f"{duration} s",
        "drive.stage": f"{speed} mm/s",
    }
    return sim.load(LENS).with_values(values | {"ensemble.members": members} | keys)


@pytest.mark.parametrize(
    "keys", [{}, {"shear.amplitude.relaxing": False}, {"bonds.model": "cohort"}]
)
def test_the_loop_of_the_drive_draws_the_numbers_of_the_process_bit_for_bit(
    keys, monkeypatch
):
    drawn, advance = [], BandedProcess.advance

    def by_both(process, *inputs):
        *others, course = inputs
        drawn.extend(course.draws.values)
        by_process = advance(process, *others, course._replace(draws=NO_DRAWS))
        by_loop = advance(process, *inputs)
        np.testing.assert_equal(by_loop, by_process)
        return by_loop

    monkeypatch.setattr(BandedProcess, "advance", by_both)
    follow(
        slipping(1.0, 0.1, 20, 2, **keys),
        MemberNoise.of(1, np.arange(2)),
        None,
        range(1, 101),
    )
    assert len(drawn) >= 2


def losses(lens, first):
    """Area over JKR's that fluctuations take from each member after a time; energies must be balanced."""
    members = np.arange(lens.ensemble.members)
    course = follow(
        lens, MemberNoise.of(lens.seed, members), None, range(lens.times.steps + 1)
    )[1]
    read = dict(zip(READINGS, np.moveaxis(course.driven[-1], -1, 0), strict=True))
    assert np.max(np.abs(read["energy_residual"] / read["drive_work"])) < 1e-6
    late = course.time.ravel() >= first
    work = lens.adhesion.work_of_bonds(course.fraction[late])
    bonded = jkr.radius_at_load(
        lens.contact.load, work, lens.sphere.radius, lens.bodies.modulus
    )
    return np.mean(bonded**2 - course.radius[late] ** 2, axis=0) / lens.rest_radius**2


BY_TIME = {
    "shear.correlation": {"model": "time", "time": "0.1 ms"},
    "shear.amplitude.memory_length": "5 um",
}
MEAN = {
    "shear": Mean(
        spectrum=sim.load(LENS).shear.spectrum,
        amplitude=SlipRate(memory_length=5e-6, floor=0.05),
    )
}


@pytest.mark.parametrize(
    "keys",
    [{}]
    + [
        pytest.param(keys, marks=pytest.mark.verify)
        for keys in ({"shear.amplitude.relaxing": False}, BY_TIME, MEAN)
    ],
)
def test_without_noise_a_slip_does_not_depend_on_the_clock_step(keys):
    """The phase of the slips in a clock step moves the loss of one run by 0.4 %, so that many stages are compared."""
    differences = []
    for speed in 20.0 * (1.0 + 0.005 * np.arange(16)):
        coarse, fine = (slipping(step, 1.0, speed, **keys) for step in (1.0, 0.125))
        # next to no noise with so many degrees of freedom
        for lens in (coarse, fine) if keys is not MEAN else ():
            bands = dataclasses.replace(
                lens.process.bands, weight=lens.process.bands.weight / 1e12
            )
            bands = dataclasses.replace(bands, freedom=1e12 * bands.freedom)
            lens.__dict__["process"] = dataclasses.replace(lens.process, bands=bands)
        differences.append(losses(coarse, 0.2) / losses(fine, 0.2) - 1.0)
    assert np.std(differences) / math.sqrt(len(differences) - 1) < 1e-3
    assert abs(np.mean(differences)) < 3e-3


@pytest.mark.verify
@pytest.mark.parametrize(
    ("speed", "limit", "step"),
    [(20, 0.05092, 1.0), (20, 0.05092, 0.0625), (3, 0.05738, 1.0)],
)
def test_the_loss_to_fluctuations_is_that_of_two_independent_codes(speed, limit, step):
    lost = losses(slipping(step, 2.0, speed, members=16), 0.5)
    assert (
        abs(np.mean(lost) / limit - 1.0)
        < 2e-3 + 5.0 * np.std(lost, ddof=1) / math.sqrt(len(lost)) / limit
    )
