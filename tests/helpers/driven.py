"""Scenes of a lens behind a spring or under a force, in units of its bonds, and what a march of them reads."""

import math
from dataclasses import replace

import numpy as np
from helpers.scenes import follow as follow, march
from numpy.testing import assert_allclose

from sim.laws import jkr
from sim.parts.bonds.models import FirstMoment
from sim.parts.bonds.rupture import Bell
from sim.parts.contact import Equilibrium
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import READINGS, Force, Spring
from sim.scenario.scenario import Clock, Ensemble, Scenario
from sim.step.state import MemberNoise as MemberNoise

#: Bonds whose unit of stretch is 10 nm and of time 1 s.
STRETCH, DENSITY, KAPPA = 1e-8, 1e15, 4e-4
BELL = Bell(zero_force_rate=1.0, bell_force=STRETCH * KAPPA)
R, MODULUS = 2e-3, 6.4e6
#: Work of adhesion at which the load is π w R, which the trajectory with a changing area takes.
LOAD = 4e-3
WORK = LOAD / (math.pi * R)


def scenario(
    duration,
    steps,
    drive,
    share=0.0,
    start="steady",
    members=1,
    make=FirstMoment,
    **keys,
):
    """A lens whose bonds, as made of their recipe, carry ``share`` of the work of adhesion."""
    bonds = {
        "rupture": keys.pop("rupture", BELL),
        "rebinding_rate": keys.pop("rebinding", 1.0),
        "start_from": start,
    }
    return Scenario(
        clock=Clock(duration=duration, step=duration / steps),
        solid=Solid(shear_modulus=MODULUS / 4.0),
        sphere=Sphere(radius=R),
        adhesion=Adhesion(work=WORK, bond_share=share),
        contact=Equilibrium(**({"load": LOAD} | keys)),
        bonds=make(**bonds, bond_stiffness=KAPPA, site_density=DENSITY),
        drive=drive,
        ensemble=Ensemble(members=members),
    )


AREA = math.pi * jkr.radius_at_load(LOAD, WORK, R, MODULUS) ** 2
#: Force over displacement of all sites of the contact at rest; force at the unit of stretch; energy.
STIFF = DENSITY * KAPPA * AREA
UNIT, ENERGY = STIFF * STRETCH, STIFF * STRETCH**2
#: Stress of bonds without a stretch at rest [Pa], and strength of the contact with them [N].
COULOMB = 1e5
HELD = COULOMB * AREA


def spring(
    stiffness,
    speed=10.0,
    mass=0.0,
    damping=0.0,
    contact=math.inf,
    viscosity=0.0,
    **keys,
):
    """A spring drive in units of all sites bound: stiffness and k_t over n κ A, speed in stretches a second."""
    held = (
        contact
        if isinstance(contact, str)
        else "rigid"
        if contact == math.inf
        else contact * STIFF
    )
    return Spring(
        stage=speed * STRETCH if isinstance(speed, float) else speed,
        stiffness=stiffness * STIFF,
        mass=mass * STIFF,
        damping=damping * STIFF,
        viscosity=viscosity * DENSITY * KAPPA,
        contact_stiffness=held,
        **keys,
    )


def force(load, **keys):
    return Force(force=load * UNIT, **({"contact_stiffness": "rigid"} | keys))


def marched(scene):
    """States of a single member, and the readings of the drive in each, by name."""
    states = list(march(scene, np.arange(1)))
    readings = np.array(
        [scene.parts.drive.readings(state.drive)[0] for state in states]
    )
    return states, dict(zip(READINGS, readings.T, strict=True))


def residual(read):
    """Largest energy that is missing, over the larger of work and stored energy; no term may exceed ten times that."""
    work, stored = np.abs(read["drive_work"]), read["stored_energy"]
    scale = max(np.max(work), np.max(stored))
    terms = [
        np.abs(values)
        for name, values in read.items()
        if name.startswith("dissipated_by")
    ]
    assert np.max(terms) <= 10.0 * scale
    return np.max(np.abs(read["energy_residual"])) / scale


def reached(states, *names):
    """Some quantities of bonds and drive in the units of the bonds, one row a state."""
    units = {
        "position": STRETCH,
        "body_speed": STRETCH,
        "bound": 1.0,
        "stretch": STRETCH,
    }
    parts = {
        "position": "drive",
        "body_speed": "drive",
        "bound": "bonds",
        "stretch": "bonds",
    }
    return np.array(
        [
            [getattr(getattr(state, parts[n]), n)[0] / units[n] for n in names]
            for state in states
        ]
    )


#: A load that pulls the contact off and comes back, and what the contact does then.
PULLED_OFF = {
    "load": {
        "time": (0.0, 0.95, 1.1, 2.0, 2.0, 9.0),
        "value": (LOAD, LOAD, -LOAD, -LOAD, LOAD, LOAD),
    },
    "after_pull_off": "reattach",
}


def stuck(duration, steps, bonds, drive, share=0.0, members=1, **contact):
    """A lens whose bonds have no stretch; their strength and the unit of length make the unit of stiffness."""
    scene = scenario(
        duration, steps, spring(1.0, mass=1.0), share=share, members=members, **contact
    )
    return replace(scene, bonds=bonds, drive=drive)


def pulled(stiffness=1.0, speed=1.0, mass=0.0, damping=0.0, **keys):
    stiff = HELD / STRETCH
    stage = speed * STRETCH if isinstance(speed, float) else speed
    given = {
        "stage": stage,
        "stiffness": stiffness * stiff,
        "mass": mass * stiff,
        "damping": damping * stiff,
    }
    return Spring(**given, contact_stiffness="rigid", **keys)


def jolted(speed, step, factor=1.0001):
    """A stage in steady motion whose speed, in stretches a second, rises by a factor after a first step."""
    speeds = speed, speed, factor * speed, factor * speed
    return {
        "time": (0.0, step, step, 1e3),
        "value": tuple(value * STRETCH for value in speeds),
    }


def mode_of(signal, step, frequency, modes):
    """Growth rate and frequency of the mode nearest to a frequency in a signal, by linear prediction."""
    changes = np.diff(signal)
    shifted = np.stack([changes[modes - 1 - k : -1 - k] for k in range(modes)], axis=1)
    roots = np.roots([1.0, *-np.linalg.lstsq(shifted, changes[modes:])[0]]).astype(
        complex
    )
    nearest = min(
        np.log(roots[roots.imag > 0.0]) / step,
        key=lambda root: abs(root.imag - frequency),
    )
    return nearest.real, nearest.imag


def check_onset(growth, onset, frequency, near=0.01, rtol=1e-4):
    """Disturbances, of a ``growth`` rate and frequency at a stiffness, neither grow nor fade at the onset alone."""
    rate, turns = growth(onset)
    assert abs(rate) < 1e-4 * frequency
    assert_allclose(turns, frequency, rtol=rtol)
    assert growth((1.0 - near) * onset)[0] > 1e-3
    assert growth((1.0 + near) * onset)[0] < -1e-3
