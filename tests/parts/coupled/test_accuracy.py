"""Accuracy of slider and bonds over many steps, its order, and the motions that theory gives beyond the onset."""

import functools

import numpy as np
import pytest
from helpers.driven import (
    DENSITY,
    KAPPA,
    STRETCH,
    UNIT,
    MemberNoise,
    follow,
    scenario,
    spring,
)
from numpy.testing import assert_allclose

from sim.laws.schallamach import Body, first_moment_onset, first_moment_stress
from sim.parts.bonds.models import Cohort, FirstMoment, Tracked
from sim.parts.drive import READINGS, Table

#: Bonds whose stretch, life at rest and stiffness are units and which are remade as fast, at a site of unit area.
UNITS = 1.0, 1.0, 1.0, 1.0, 1.0, 1.0


def followed(scene, every=1):
    """Return the course of a single member at some of its clock steps, and the readings of its drive by name."""
    course = follow(
        scene,
        MemberNoise.of(scene.seed, np.arange(1)),
        None,
        range(0, scene.times.steps + 1, every),
    )[1]
    return course, dict(zip(READINGS, course.driven[:, 0].T, strict=True))


BODY = {"mass": 1e-3, "damping": 1e-3}


@pytest.mark.parametrize(
    ("make", "keys", "steps", "tolerance"),
    [(FirstMoment, {}, 10**5, 1e-6), (FirstMoment, BODY, 10**5, 1e-6)]
    + [
        pytest.param(*case, marks=pytest.mark.verify)
        for case in (
            (FirstMoment, {}, 10**6, 1e-6),
            (FirstMoment, BODY, 10**6, 1e-6),
            *(
                (make, keys, 10**5, tolerance)
                for tolerance in (1e-5, 1e-7)
                for make, keys in (
                    (Cohort, {}),
                    (Cohort, BODY),
                    (Cohort, {"mass": 1e-3, "contact": 0.1}),
                    (functools.partial(Tracked, sites=100), {}),
                )
            ),
        )
    ],
)
def test_the_energies_stay_balanced_over_many_steps(make, keys, steps, tolerance):
    drive = spring(0.02, tolerance=tolerance, **keys)
    _, read = followed(
        scenario(4e-3 * steps, steps, drive, share=0.5, make=make), every=100
    )
    assert make is not FirstMoment or read["substeps"][-1] > steps
    assert np.all(
        np.abs(read["energy_residual"]) <= 10.0 * tolerance * read["drive_work"][-1]
    )


def test_a_slider_follows_smooth_motion_to_order_five():
    for keys in [{}, {"damping": 0.05}, {"mass": 0.05, "damping": 0.05}]:

        def position(steps, tolerance):
            stage = {"time": (0.0, 2.0), "value": (10.0 * STRETCH, 14.0 * STRETCH)}
            drive = spring(0.5, stage, tolerance=tolerance, start="steady", **keys)
            course, read = followed(scenario(2.0, steps, drive, start="steady"))
            return course.position[-1, 0] / STRETCH, read["substeps"][-1]

        exact, off = position(16, 1e-12)[0], []
        for steps in (8, 64):
            last, substeps = position(steps, 1e-2)
            # the first clock step finds its length, all others are one sub-step each
            assert substeps < steps + 8
            off.append(abs(last - exact))
        assert np.log(off[0] / off[1]) / np.log(8.0) > 4.5


def jump(before, after, step, duration):
    """Times and speeds of a jump at the end of a first step."""
    return (0.0, step, step, step + duration), tuple(
        speed * STRETCH for speed in (before, before, after, after)
    )


def stepped(before, after, steps, duration):
    """Stress after a jump of a prescribed speed out of steady sliding, in the unit of all sites at one stretch."""
    times, speeds = jump(before, after, duration / steps, duration)
    scene = scenario(
        times[-1], steps + 1, Table(time=times, speed=speeds), start="steady"
    )
    course = follow(
        scene, MemberNoise.of(scene.seed, np.arange(1)), None, range(1, steps + 2)
    )[1]
    return course.stress[:, 0] / (DENSITY * KAPPA * STRETCH)


@pytest.mark.parametrize(
    ("speed", "expected"),
    [
        (1.0, (0.0168814, 0.0546801, 0.0896829)),
        (10.0, (0.0048029, 0.0015325, -0.0054943)),
    ],
)
def test_a_small_step_of_the_speed_rings_as_linear_theory_has_it(speed, expected):
    # δF/δV = N {p/q + e^(−γt) [−(p/q) cos Ωt + ((1 − γp/q)/Ω) sin Ωt]} with p = β + k − xk, q = k(β + k)(1 + x)
    faster, slower = (
        stepped(speed, (1.0 + small) * speed, 10, 0.5) for small in (1e-3, -1e-3)
    )
    assert_allclose((faster - slower)[[1, 4, 10]] / (2e-3 * speed), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("before", "after", "start", "tops"),
    [
        (1.0, 10.0, 0.2052470338, {0.1561567: 0.4980493020, 0.5213294: 0.24260686}),
        (10.0, 1.0, 0.2594066446, {0.3910328: 0.1496747255}),
    ],
)
def test_a_large_step_of_the_speed_overshoots_behind_a_stiff_spring_as_without_one(
    before, after, start, tops
):
    for time, top in tops.items():
        course = stepped(before, after, 100, time)
        assert_allclose(course[[0, -1]], (start, top), rtol=1e-7)
        times, speeds = jump(before, after, time / 100, time)
        drive = spring(
            4e3, {"time": times, "value": speeds}, start="steady", tolerance=1e-9
        )
        force = (
            followed(scenario(times[-1], 101, drive, start="steady"))[1][
                "spring_force"
            ][1:]
            / UNIT
        )
        assert np.max(np.abs(force - course)) < 10.0 / (4e3 / 0.0390213) * top


def cycle(speed, share, duration, step, tolerance=1e-9):
    """Force of the spring, of a stiffness that is a share of the onset's, over that of steady sliding."""
    drive = spring(
        share * first_moment_onset(speed, *UNITS[:5], Body(1.0)).stiffness,
        speed,
        tolerance=tolerance,
    )
    read = followed(scenario(duration, round(duration / step), drive))[1]
    return read["spring_force"] / UNIT / first_moment_stress(speed, *UNITS[:5])


def test_oscillations_set_in_suddenly_beside_stable_sliding_or_with_the_root_of_the_distance():
    # at 10 and equal rates: alive at 1.01 of the onset's stiffness, dead at 1.02
    below, alive, dead = (
        np.ptp(cycle(10.0, share, 400.0, 0.04)[-500:]) for share in (0.998, 1.01, 1.02)
    )
    assert alive > 0.9 * below
    assert dead < 0.01 * below
    # of the Hopf bifurcation's normal form (Kuznetsov, Elements of Applied Bifurcation Theory, 3.5)
    exact = 6.366370
    far, near = (
        0.5 * np.ptp(cycle(100.0, 1.0 - d, 0.4 / d, 0.05, 1e-11)[-4000:]) / d**0.5
        for d in (4e-4, 2e-4)
    )
    # linearly in the distance; what is left is of its square
    assert_allclose(2.0 * near - far, exact, rtol=4.0 * (1.0 - far / exact) ** 2)
