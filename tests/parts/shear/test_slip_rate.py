"""The amplitude that unsteady sliding makes: closed forms, what is remembered, drives that feel the friction."""

import math
from itertools import product

import numpy as np
import pytest
from helpers.scenes import (
    CELL,
    SPECTRUM,
    Clock,
    Gaussian,
    Slip,
    SlipRate,
    Wave,
    march,
    scene,
)
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.parts.bonds.models import Unbroken
from sim.parts.drive import Ramp, Spring, Steady
from sim.parts.exchange import Motion
from sim.parts.shear import Banded, Mean
from sim.units.errors import BadInput

SPEED, PERIOD, STEPS = 2e-3, 1e-2, 40
TIMES = np.linspace(0.0, PERIOD, STEPS + 1)
#: Slip in a period over the memory length; weights within a period differ by a factor of 1 + SHORT at the most.
SHORT = 1e-6


def moved(path, square, step=PERIOD / STEPS):
    """Motion of given paths [m] and integrals of the squared speed [m²/s] in equal steps."""
    path, square = np.asarray(path)[:, np.newaxis], np.asarray(square)[:, np.newaxis]
    time, still = (
        step * np.arange(1.0, len(path) + 1.0)[:, np.newaxis],
        np.zeros(path.shape),
    )
    spread = np.maximum(square - path**2 / step, 0.0)
    return Motion(1, time, np.full(path.shape, step), path, path, still, still, spread)


def amplitudes(law, *blocks):
    """g at the ends of all steps of some blocks of motions."""
    start = np.zeros(1)
    past, _ = law.started(Motion(0, 0.0, 0.0, start, start, start, start), start)
    ends = []
    for motions in blocks:
        past, amplitude = law.followed(past, motions, start)
        ends.extend(amplitude[:, 0])
    return np.array(ends)


def law(length=SPEED * PERIOD / SHORT, floor=0.0):
    return SlipRate(memory_length=length, floor=floor)


def wave(mean, swing):
    """Paths and integrals of the squared speed of mean + swing cos(2π t/PERIOD)."""
    turn = 2.0 * math.pi / PERIOD
    path = mean * TIMES + swing * np.sin(turn * TIMES) / turn
    square = (mean**2 + 0.5 * swing**2) * TIMES + 2.0 * mean * swing * np.sin(
        turn * TIMES
    ) / turn
    square += 0.25 * swing**2 * np.sin(2.0 * turn * TIMES) / turn
    return np.diff(path), np.diff(square)


def test_unsteady_speeds_have_half_their_square_over_the_mean_square_even_on_coulomb_friction():
    for floor, swing in product([0.0, 0.3], [0.0, 0.1, 0.7, 1.0]):
        (last,) = amplitudes(law(floor=floor), moved(*wave(SPEED, swing * SPEED)))[-1:]
        unsteady = 0.5 * swing**2 / (1.0 + 0.5 * swing**2)
        assert_allclose(
            last**2,
            floor**2 + (1.0 - floor**2) * unsteady,
            rtol=2.0 * SHORT,
            atol=1e-14,
        )
        if swing == 1.0:
            assert_allclose(unsteady, 1.0 / 3.0, rtol=1e-15)
    for share in [0.1, 0.5]:
        path = np.where(
            np.tile(np.arange(STEPS) < share * STEPS, 3), SPEED * PERIOD / STEPS, 0.0
        )
        motions = moved(path, path**2 / (PERIOD / STEPS))
        ends = amplitudes(
            law(), motions, moved(path[:1], path[:1] ** 2 / (PERIOD / STEPS))
        )
        moving = 3 * round(share * STEPS) + 1  # with the step that resumes the sliding
        assert_allclose(ends[-1] ** 2, 1.0 - moving / (3 * STEPS + 1), rtol=6.0 * SHORT)
    # from rest it moves with V (1 − cos ωt), whose unsteadiness over whole periods is a third
    mass, stiffness, stage, strength = 1e-3, 1e3, 1e-3, 1e-3
    period, begins = (
        2.0 * math.pi * math.sqrt(mass / stiffness),
        strength / (stiffness * stage),
    )
    drive = Spring(
        stage=stage,
        stiffness=stiffness,
        mass=mass,
        contact_stiffness="rigid",
        tolerance=1e-10,
    )
    shear = Mean(
        spectrum=Gaussian(rms=1e5, length=5e-6),
        amplitude=law(1e3),
        paid_by_adhesion=0.0,
    )
    bonds = Unbroken(stress=strength / scene(1).contact_area)
    duration = begins + 2.0 * period
    clock = Clock(duration=duration, step=duration / 7)
    states = list(
        march(
            scene(1, clock=clock, drive=drive, bonds=bonds, shear=shear), np.arange(1)
        )
    )
    weight, mean, spread, *_ = (values[0] for values in states[-1].shear.past)
    slip = 2.0 * period * stage
    assert_allclose(
        [weight * mean, spread + weight * mean**2],
        [slip, 1.5 * stage * slip],
        rtol=1e-8,
    )


def test_rest_is_the_limit_of_ever_slower_sliding_and_sliding_at_one_speed_has_the_floor():
    # a stop of T within sliding at V, or before it: A0 = T w + (1 − w w0) l/V, A1 = (1 − w w0) l, A2 = A1 V
    # with w and w0 = e^(−slip/l) of the sliding after and before the stop
    length, step, stop = 1e-6, 1e-4, 2e-2
    for slow in (0.0, 1e-15, 1e-12, 1e-9):
        for before, floor in product((0, 7), (0.0, 0.2)):
            blocks = [
                np.full(before, SPEED * step),
                np.full(round(stop / step), slow * step),
                np.full(30, SPEED * step),
            ]
            ends = amplitudes(
                law(length, floor),
                *(moved(path, path**2 / step, step) for path in blocks if path.size),
            )
            rested = np.minimum(np.arange(1.0, 1.0 + len(ends) - before) * step, stop)
            slid = (
                np.maximum(np.arange(1.0, 1.0 + len(ends) - before) * step - stop, 0.0)
                * SPEED
            )
            moving = -np.expm1(-slid / length - before * SPEED * step / length) * length
            unsteady = 1.0 - moving / (moving + SPEED * rested * np.exp(-slid / length))
            unsteady = np.where(moving > 0.0, unsteady, 0.0)
            exact = floor**2 + (1.0 - floor**2) * unsteady
            assert np.all(ends[:before] ** 2 <= floor**2 + 1e-14)
            # the slow sliding adds 2 u/V and forgets u T/l at the most
            off = 2.0 * slow / SPEED + slow * stop / length
            assert_allclose(ends[before:] ** 2, exact, rtol=1e-12, atol=off + 1e-14)
    for floor in (0.0, 0.2):
        shear = Mean(
            spectrum=Gaussian(rms=1e5, length=5e-6), amplitude=law(1e-6, floor)
        )
        for state in march(
            scene(1, 16, drive=Steady(speed=SPEED), shear=shear), np.arange(1)
        ):
            assert_allclose(state.shear.amplitude, floor, rtol=1e-14, atol=1e-15)


def test_a_step_of_the_speed_is_forgotten_with_the_slip_and_errors_fall_with_its_square():
    # from speed v to r v at once: with w = e^(−s/l), A0 = (w + (1 − w)/r) l/v, A1 = l, A2 = (w + (1 − w) r) l v
    length, ratio, slip = 1e-6, 8.0, np.array([0.1, 0.5, 1.0, 3.0, 9.0]) * 1e-6
    speed, paths = ratio * SPEED, np.diff(slip, prepend=0.0)
    long = moved([60.0 * length], [60.0 * length * SPEED], 60.0 * length / SPEED)
    ends = amplitudes(
        law(length),
        long,
        *(moved([path], [path * speed], path / speed) for path in paths),
    )[1:]
    left = np.exp(-slip / length)
    exact = 1.0 - 1.0 / ((left + (1.0 - left) / ratio) * (left + (1.0 - left) * ratio))
    assert_allclose(ends**2, exact, rtol=1e-12)
    # a speed that rises from v to 5 v in T: A_j = ∫ e^(−(p(T) − p(t))/l) v^j dt; what was before the run does not count
    length, duration, first, last = 3e-6, 2e-3, 1e-3, 5e-3

    def speed(t):
        return first * (last / first) ** (t / duration)

    def to_the_end(t):
        return (last - speed(t)) * duration / math.log(last / first)

    sums = []
    for j in range(3):
        part = quad(
            lambda t, j=j: math.exp(-to_the_end(t) / length) * speed(t) ** j,
            0.0,
            duration,
            epsabs=0.0,
        )[0]
        sums.append(part)
    exact = 1.0 - sums[1] ** 2 / (sums[0] * sums[2])
    errors = []
    for steps in (32, 64, 128):
        clock = Clock(duration=duration, step=duration / steps)
        shear = Mean(
            spectrum=Gaussian(rms=1e5, length=5e-6),
            amplitude=SlipRate(memory_length=length),
        )
        parts = {
            "clock": clock,
            "drive": Ramp(start=first, stop=last, scale="log"),
            "shear": shear,
        }
        *_, state = march(scene(1, **parts), np.arange(1))
        errors.append(state.shear.amplitude[0] ** 2 - exact)
    assert_allclose([errors[0] / errors[1], errors[1] / errors[2]], 4.0, rtol=0.02)
    assert abs(errors[-1]) < 1e-3 * exact


def test_a_field_without_a_length_of_its_own_needs_that_of_its_memory():
    banded = {"spectrum": SPECTRUM, "cell": CELL, "amplitude": SlipRate()}
    assert Banded(**banded, correlation=Slip(length=5e-6)).law.memory_length == 5e-6
    with pytest.raises(ValueError, match="memory_length"):
        Banded(**banded, correlation=Wave(waves=2.0))
    with pytest.raises((ValueError, BadInput), match="memory_length"):
        Mean(spectrum=SPECTRUM, amplitude=SlipRate())
