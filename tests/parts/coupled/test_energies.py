"""Energy books of a slider where adhesion returns, the area is renewed, a force jumps and an area collapses."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import driven
from helpers.driven import (
    AREA,
    LOAD,
    MODULUS,
    STIFF,
    UNIT,
    WORK,
    R,
    jkr,
    march,
    marched,
    residual,
    scenario,
    spring,
)
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from sim.parts.bonds.models import Cohort, FirstMoment, Tracked
from sim.parts.bonds.rupture import Bell, Constant
from sim.parts.contact import Equilibrium, RateDependent
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import READINGS, Spring
from sim.parts.shear import Banded, Mean
from sim.parts.shear.process import Slip, SlipRate
from sim.scenario.scenario import Clock, Scenario
from sim.spectrum.families import Gaussian

COHORTS = functools.partial(Cohort, tolerance=1e-5)
SITES = functools.partial(Tracked, sites=36)
CARRIED = functools.partial(Cohort, tolerance=1e-5, area="carried")


def masked(scene, share):
    """Return the scene with a stress that takes a share of the work of adhesion, by ΔΓ = 3√π/16 σ²ξ/G."""
    squared = share * WORK * 16.0 / (3.0 * math.sqrt(math.pi)) * MODULUS / 4.0 / 1e-5
    return replace(
        scene, shear=Mean(spectrum=Gaussian(rms=math.sqrt(squared), length=1e-5))
    )


@pytest.mark.parametrize("load", [0.2, 1.0])
def test_adhesion_that_returns_behind_a_spring_widens_the_area_as_independent_equations_have_it(
    load,
):
    # q = M − N X has no rate of the area in it: q' = −N' X − k M, where the spring gives X = V t − A M/K
    stiffness, speed, share, pace = 0.2, 10.0, 0.3, 2.0
    # all bonds of rest carry the whole work of adhesion
    back = -math.log1p(-share) / pace

    def of(time, q):
        """Return share bound, area and moment."""
        bound = -0.5 * np.expm1(-pace * time)
        work = WORK * np.maximum(2.0 * bound - share, 0.0)
        area = np.pi * jkr.radius_at_load(load * LOAD, work, R, MODULUS) ** 2 / AREA
        return (
            bound,
            area,
            (q + bound * speed * time) / (1.0 + bound * area / stiffness),
        )

    def change(time, q):
        _, area, moment = of(time, q)
        return (
            -np.exp(-pace * time) * (speed * time - area * moment / stiffness) - moment
        )

    course = solve_ivp(
        change, (0.0, 1.0), [0.0], rtol=1e-10, atol=1e-13, dense_output=True
    ).sol
    times, dense = (
        np.linspace(0.0, 1.0, 41),
        back + np.linspace(0.0, math.sqrt(1.0 - back), 4001) ** 2,
    )
    _, areas, moments = of(times, course(times)[0])
    bound, area, moment = of(dense, course(dense)[0])
    for make in (FirstMoment, COHORTS, SITES):
        keys = {
            "share": 1.0,
            "start": "empty",
            "rupture": Constant(rate=1.0),
            "load": load * LOAD,
            "make": make,
        }
        states, read = marched(
            masked(scenario(1.0, 40, spring(stiffness, speed), **keys), share)
        )
        assert residual(read) < 1e-5
        radii = np.array(
            [(state.drive.radius[0], state.contact.radius[0]) for state in states[1:]]
        )
        assert_allclose(radii[:, 0], radii[:, 1], rtol=1e-9)
        if make is not SITES:
            assert_allclose(
                read["spring_force"] / UNIT,
                areas * moments,
                atol=1e-5 * np.max(areas * moments),
            )
        if make is FirstMoment:
            gained = np.trapezoid(0.5 * moment**2 / bound, area)
            assert_allclose(
                read["dissipated_by_area"][-1] / driven.ENERGY, -gained, rtol=1e-5
            )


def test_members_whose_adhesion_goes_and_returns_again_and_again_have_energies_and_no_large_ones():
    load, drive = (
        {"from": 0.05 * LOAD, "to": LOAD, "cycles": 1},
        spring(0.3, contact="half_space"),
    )
    scene = masked(
        scenario(8.0, 80, drive, share=1.0, make=SITES, members=60, load=load), 0.7
    )
    states = list(march(scene, np.arange(60)))
    off = np.diff([state.contact.work <= 0.0 for state in states], axis=0)
    assert np.count_nonzero(np.any(off, axis=0)) > 30
    readings = np.array([scene.parts.drive.readings(state.drive) for state in states])
    for member in range(60):
        assert residual(dict(zip(READINGS, readings[:, member].T, strict=True))) < 1e-5


@pytest.mark.parametrize("body", [{"damping": 0.3}, {"mass": 0.01}, {}])
@pytest.mark.parametrize("contact", [2.0, "half_space"])
def test_slips_at_once_after_events_only_dissipate_if_the_stiffness_of_the_contact_follows_its_area(
    body, contact
):
    drive = spring(0.5, contact=contact, **body)
    states, read = marched(
        scenario(2.0, 100, drive, share=1.0, start="empty", make=SITES)
    )
    assert residual(read) < 1e-5
    assert np.ptp([state.contact.radius[0] for state in states]) > 0.1 * math.sqrt(
        AREA / math.pi
    )
    assert read["dissipated_by_snaps"][-1] > 1e-6 * read["drive_work"][-1]
    assert np.min(np.diff(read["dissipated_by_snaps"])) >= -1e-12 * np.max(
        read["drive_work"]
    )


@pytest.mark.parametrize("make", [FirstMoment, COHORTS, SITES, CARRIED])
@pytest.mark.parametrize("contact", [2.0, "half_space"])
def test_energy_that_a_renewed_area_takes_along_is_that_stored_in_it_with_any_viscosity(
    make, contact
):
    for viscosity in (1e-4, 1.0):
        scene = scenario(
            1.0,
            20,
            spring(0.5, contact=contact, viscosity=viscosity, tolerance=1e-8),
            make=make,
        )
        load = {"from": LOAD, "to": 4.0 * LOAD}
        if make is CARRIED:
            scene = replace(scene, contact=replace(scene.contact, load=load))
        else:
            scene = replace(scene, contact=RateDependent(load=load, front_speed=1e-4))
        states, read = marched(scene)
        assert residual(read) < 1e-5
        if make is FirstMoment and contact == 2.0:
            bound, stretch = driven.reached(states, "bound", "stretch")[:-1].T
            areas = np.array(
                [math.pi * state.contact.radius[0] ** 2 / AREA for state in states[:-1]]
            )
            gained = np.diff(areas, prepend=areas[0]) * 0.5 * stretch**2 / bound
            assert np.max(areas) > 1.1
            assert_allclose(
                read["dissipated_by_area"][1:] / driven.ENERGY,
                -np.cumsum(gained),
                rtol=1e-9,
                atol=1e-15,
            )


@pytest.mark.parametrize("make", [FirstMoment, COHORTS, SITES])
def test_the_loss_of_a_force_that_jumps_is_half_its_change_times_the_slip_at_once(make):
    # at the start, within a clock step and between two; half of the sites stay bound: 1/k_t = 2, with bonds 4
    changes = np.array([0.1, 0.05, -0.2])
    times, values = (
        (0.0, 0.26, 0.26, 0.5, 0.5, 9.0),
        np.repeat(np.cumsum(changes), 2) * UNIT,
    )
    delays = (
        ("mass", 0.0, 4.0),
        ("viscosity", 1e-2 * driven.DENSITY * driven.KAPPA, 2.0),
        ("damping", 1e-2 * STIFF, 0.0),
    )
    for name, delay, gives in delays:
        keys = {"contact_stiffness": 0.5 * STIFF, "tolerance": 1e-8, name: delay}
        drive = driven.Force(force={"time": times, "value": tuple(values)}, **keys)
        _, read = marched(
            scenario(1.0, 10, drive, rupture=Constant(rate=1.0), make=make)
        )
        assert residual(read) < 1e-5
        assert np.isnan(read["runaway_time"]).all()
        assert (
            np.max(np.abs(read["dissipated_by_area"])) < 1e-12 * read["drive_work"][-1]
        )
        if make is not SITES or name == "viscosity":
            lost, snaps = (
                np.cumsum(0.5 * gives * changes**2),
                read["dissipated_by_snaps"][[1, 3, 6]],
            )
            # of the cohorts bound
            assert_allclose(snaps / driven.ENERGY, lost, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_a_contact_that_becomes_masked_in_a_slip_of_no_time_closes_its_energies(
    tolerance,
):
    # ΔΓ in sliding exceeds the work of adhesion: the area jumps to Hertz's as sliding begins
    length, bell = 5.61e-6, Bell(zero_force_rate=5.0, bell_force=2.239e-13)
    field = {
        "spectrum": Gaussian(rms=3.3e5, length=length),
        "cell": 8.0 * length,
        "points": 16,
        "tolerance": 0.05,
    }
    field |= {
        "correlation": Slip(length=length),
        "amplitude": SlipRate(floor=0.3, memory_length=0.5 * length),
    }
    turning = {"time": (0.0, 0.167), "value": (-8.0 * length, 8.0 * length)}
    scene = Scenario(
        seed=1,
        clock=Clock(duration=0.02, step=0.01),
        solid=Solid(shear_modulus=1e6),
        sphere=Sphere(radius=1e-3),
        adhesion=Adhesion(work=0.05, bond_share=1.0),
        contact=Equilibrium(load=3.05e-6, after_pull_off="reattach"),
        bonds=FirstMoment(
            rupture=bell, rebinding_rate=20.0, bond_stiffness=7.98e-7, site_density=1e16
        ),
        drive=Spring(
            stage=turning, stiffness=311.0, damping=6.82e-3, tolerance=tolerance
        ),
        shear=Banded(**field),
    )
    assert residual(marched(scene)[1]) < max(1e-6, 10.0 * tolerance)
