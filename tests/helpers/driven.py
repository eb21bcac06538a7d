"""Scenes of a lens behind a spring or under a force, in units of its bonds, and what a march of them reads."""

import math

import numpy as np

from sim.engine import march
from sim.laws import jkr
from sim.parts.bonds import FirstMoment
from sim.parts.bonds.rupture import Bell
from sim.parts.contact import Equilibrium
from sim.parts.contact.bodies import Adhesion, Solid, Sphere
from sim.parts.drive import READINGS, Force, Spring
from sim.scenario.clock import Clock, Ensemble
from sim.scenario.scenario import Scenario

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
    rupture=BELL,
    rebinding=1.0,
    start="bonded",
    members=1,
    make=FirstMoment,
    **contact,
):
    """A lens whose bonds, as made of their recipe, carry ``share`` of the work of adhesion."""
    return Scenario(
        clock=Clock(duration=duration, step=duration / steps),
        solid=Solid(shear_modulus=MODULUS / 4.0),
        sphere=Sphere(radius=R),
        adhesion=Adhesion(work=WORK, bond_share=share),
        contact=Equilibrium(**({"load": LOAD} | contact)),
        bonds=make(
            rupture=rupture, bond_stiffness=KAPPA, rebinding_rate=rebinding, site_density=DENSITY, start_from=start
        ),
        drive=drive,
        ensemble=Ensemble(members=members),
    )


def fields(scene):
    """The tables of a scene that a changed copy takes over."""
    names = ("clock", "solid", "sphere", "adhesion", "contact", "bonds", "drive", "ensemble")
    return {name: getattr(scene, name) for name in names}


AREA = math.pi * jkr.radius_at_load(LOAD, WORK, R, MODULUS) ** 2
#: Force over displacement of all sites of the contact at rest; force at the unit of stretch; energy.
STIFF = DENSITY * KAPPA * AREA
UNIT, ENERGY = STIFF * STRETCH, STIFF * STRETCH**2


def spring(stiffness, speed=10.0, mass=0.0, damping=0.0, contact=math.inf, viscosity=0.0, **keys):
    """A spring drive in units of all sites bound: stiffness and k_t over n κ A, speed in stretches a second."""
    return Spring(
        stage=speed * STRETCH if isinstance(speed, float) else speed, stiffness=stiffness * STIFF, mass=mass * STIFF,
        damping=damping * STIFF, viscosity=viscosity * DENSITY * KAPPA,
        contact_stiffness="rigid" if contact == math.inf else contact * STIFF, **keys,
    )  # fmt: skip


def force(load, **keys):
    return Force(force=load * UNIT, **({"contact_stiffness": "rigid"} | keys))


def marched(scene):
    """States of a single member, and the readings of the drive in each, by name."""
    states = list(march(scene, np.arange(1)))
    readings = np.array([scene.parts.drive.readings(state.drive)[0] for state in states])
    return states, dict(zip(READINGS, readings.T, strict=True))


def residual(read):
    """Largest energy that is missing, over all the work of the drive."""
    return np.max(np.abs(read["energy_residual"])) / read["drive_work"][-1]


def reached(states, *names):
    """Some quantities of bonds and drive in the units of the bonds, one row a state."""
    units = {"position": STRETCH, "body_speed": STRETCH, "bound": 1.0, "stretch": STRETCH}
    parts = {"position": "drive", "body_speed": "drive", "bound": "bonds", "stretch": "bonds"}
    return np.array([[getattr(getattr(state, parts[n]), n)[0] / units[n] for n in names] for state in states])
