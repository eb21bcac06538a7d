"""Small scenes for the tests: one builder and the depths of every part."""

from copy import deepcopy
from dataclasses import replace

import numpy as np

from sim.ensemble.variables import VARIABLES
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell, Constant, CutOff
from sim.parts.contact import Cohesive, Equilibrium, RateDependent
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import Force, Spring, StageHolds
from sim.parts.exchange import Motion
from sim.parts.shear import models as shear
from sim.parts.shear.process import (
    Constant as ConstantAmplitude,
    Diffusion,
    Onset,
    Slip,
    SlipRate,
    Stress,
    Time,
    Wave,
)
from sim.scenario.scenario import Clock, Ensemble, Scenario
from sim.scenario.sweep import read_sweep
from sim.spectrum.families import Band, Gaussian, Ripple, SelfAffine
from sim.step.state import MemberNoise

SPECTRUM = Band(rms=120e3, longest=120e-6, shortest=60e-6)
CELL = 0.24e-3
#: Recipes of fluctuations on a cell, renewed by slip or in time; amplitudes.
ON_CELL = {"spectrum": SPECTRUM, "cell": CELL}
BY_SLIP, IN_TIME = (
    ON_CELL | {"correlation": Slip(length=5e-6)},
    ON_CELL | {"correlation": Time(time=2e-3)},
)
BY_WAVES = ON_CELL | {"correlation": Wave(waves=2.0)}
ONSET = {"speed": 2e-3, "width": 0.3, "floor": 0.1}

DRIVES = {
    "steady": drive.Steady(speed=2e-3),
    "at rest": drive.Steady(speed=0.0),
    "start": drive.Start(rest=3e-3, speed=4e-3),
    "linear ramp": drive.Ramp(start=-1e-3, stop=5e-3),
    "log ramp": drive.Ramp(start=1e-5, stop=1e-1, scale="log"),
    "table": drive.Table(time=(0.0, 0.003, 0.003, 0.02), speed=(1e-3, 1e-3, 2e-2, 0.0)),
    "holds": drive.Holds(speed=4e-3, slide=2e-3, holds=(1e-3, 3e-3)),
    "spring": Spring(stage=2e-2, stiffness=100.0, start="steady"),
    "spring with mass": Spring(
        stage={"from": 1e-2, "to": -1e-2, "cycles": 1},
        start_after=1e-3,
        stiffness=200.0,
        mass=1e-4,
        damping=0.1,
        viscosity=1e5,
        contact_stiffness="rigid",
    ),
    "spring with unloaded holds": Spring(
        stage=StageHolds(speed=2e-2, slide=2e-3, holds=(2e-3,), while_held="unloaded"),
        stiffness=100.0,
        damping=0.1,
        contact_stiffness="rigid",
    ),
    "force": Force(
        force={"from": 0.0, "to": 3e-3}, damping=0.1, contact_stiffness="rigid"
    ),
}
#: Bonds whose life at rest is 5 ms and that feel their force from a stretch of 10 µm on, 0.2 MPa at the most.
BELL = Bell(zero_force_rate=200.0, bell_force=4e-12)
CUT_OFF = CutOff(stretch=20e-6, rate=50.0)
STRETCHED = {"bond_stiffness": 4e-7, "rebinding_rate": 400.0, "site_density": 1e17}
BONDS = {
    "none": bonds.Unbroken(stress=2e5),
    "steady": bonds.Steady(critical_speed=1e-2, stress=2e5),
    "rate": bonds.Rate(
        critical_speed=1e-2, rebinding_rate=500.0, stress=2e5, start_from="bonded"
    ),
    "rate, carried": bonds.Rate(
        critical_speed=1e-2, rebinding_rate=500.0, stress=2e5, area="carried"
    ),
    "counted": bonds.Counted(
        critical_speed=1e-2,
        rebinding_rate=500.0,
        sites=40,
        stress=2e5,
        start_from="steady",
    ),
    "rate, bell": bonds.FirstMoment(rupture=BELL, **STRETCHED, start_from="bonded"),
    "rate, cut-off, carried": bonds.FirstMoment(
        rupture=CUT_OFF, **STRETCHED, area="carried"
    ),
    "cohort": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=1e-3),
    "cohort, cut-off": bonds.Cohort(
        rupture=CUT_OFF, **STRETCHED, tolerance=1e-2, start_from="empty"
    ),
    "cohort, carried": bonds.Cohort(
        rupture=BELL, **STRETCHED, tolerance=1e-2, start_from="empty", area="carried"
    ),
    "tracked": bonds.Tracked(rupture=BELL, **STRETCHED, sites=30),
    "tracked, constant": bonds.Tracked(
        rupture=Constant(rate=200.0), **STRETCHED, sites=7, start_from="bonded"
    ),
    "auto, few sites": bonds.Auto(rupture=CUT_OFF, **STRETCHED, sites=20),
    "auto, many sites": bonds.Auto(
        critical_speed=1e-2, rebinding_rate=500.0, stress=2e5, sites=10**6
    ),
}
SHEARS = {
    "uniform": shear.Uniform(),
    "mean": shear.Mean(
        spectrum=Gaussian(rms=1e5, length=5e-6), amplitude=Stress(reference=2e5)
    ),
    "modal, time, constant": shear.Modal(**IN_TIME),
    "modal, slip, onset": shear.Modal(**BY_SLIP, amplitude=Onset(**ONSET)),
    "modal, wave, relaxing stress": shear.Modal(
        **BY_WAVES, amplitude=Stress(reference=2e5, relaxing=True)
    ),
    "mapped, diffusion, constant": shear.Mapped(
        **ON_CELL,
        points=12,
        correlation=Diffusion(diffusivity=1e-9),
        amplitude=ConstantAmplitude(),
    ),
    "mapped, stress": shear.Mapped(
        **ON_CELL | {"correlation": Slip(length=1e-5), "points": 13},
        amplitude=Stress(reference=2e5),
    ),
    "banded, slip, onset": shear.Banded(**BY_SLIP, amplitude=Onset(**ONSET)),
    "banded, wave, relaxing stress": shear.Banded(
        **BY_WAVES, tolerance=0.1, amplitude=Stress(reference=2e5, relaxing=True)
    ),
    "banded, relaxing slip rate": shear.Banded(
        **BY_SLIP, amplitude=SlipRate(floor=0.1, relaxing=True)
    ),
    "mean, slip rate": shear.Mean(
        spectrum=SPECTRUM, amplitude=SlipRate(memory_length=2e-6)
    ),
    "modal, slip rate": shear.Modal(**BY_SLIP, amplitude=SlipRate()),
    "modal on a disc": shear.Modal(**IN_TIME, contact="disc"),
    "mean on a disc": shear.Mean(
        spectrum=Gaussian(rms=1e5, length=2e-5), contact="disc", paid_by_adhesion=0.5
    ),
    "auto with correlation": shear.Auto(
        **ON_CELL, correlation=Diffusion(diffusivity=1e-9)
    ),
    "auto without correlation": shear.Auto(spectrum=SPECTRUM),
    "modal ripple": shear.Modal(
        spectrum=Ripple(amplitude=1e5, wavelength=24e-6),
        cell=CELL,
        points=32,
        correlation=Slip(length=1e-5),
    ),
    "modal self-affine": shear.Modal(
        spectrum=SelfAffine(
            rms=1e5, hurst=0.8, longest=120e-6, rolloff=100e-6, shortest=50e-6
        ),
        cell=CELL,
        correlation=Wave(waves=1.0),
        amplitude=Onset(**ONSET, relaxing=True),
    ),
}
CONTACTS = {
    "load": Equilibrium(load=4e-3),
    "tension": Equilibrium(load=-0.3e-3),
    "indentation": Equilibrium(indentation=2e-6),
    "lifted": Equilibrium(indentation=-0.5e-6),
    "machine": Equilibrium(displacement=1e-6, stiffness=2e3, after_pull_off="reattach"),
    "load there and back": Equilibrium(
        load={"from": 4e-3, "to": -1e-3, "cycles": 1}, after_pull_off="reattach"
    ),
    "displacement there and back": Equilibrium(
        displacement={"from": 1e-6, "to": -3e-6, "cycles": 2},
        stiffness=500.0,
        after_pull_off="stop",
        reversible=0.05,
    ),
    "indentation in a table": Equilibrium(
        indentation={"time": [0.0, 5e-3, 1.0], "value": [2e-6, -2e-6, -2e-6]}
    ),
    "rate_dependent": RateDependent(load=4e-3, front_speed=1e-2),
    "rate-dependent cycle": RateDependent(
        indentation={"from": 1e-6, "to": -2e-6, "cycles": 1},
        front_speed=1e-2,
        heal_speed=1e-3,
        after_pull_off="reattach",
    ),
    "partly reversible": Equilibrium(load=4e-3, reversible=0.02),
    "cohesive load there and back": Cohesive(
        load={"from": 4e-3, "to": -1e-3, "cycles": 1},
        range=0.4e-6,
        after_pull_off="reattach",
    ),
    "cohesive displacement there and back": Cohesive(
        displacement={"from": 1e-6, "to": -3e-6, "cycles": 2},
        stiffness=5e3,
        cohesive_stress=3e4,
        after_pull_off="reattach",
    ),
}


def go_together(case):
    """Whether contact and bonds of a case, by the names of its depths, can feel its drive and its fluctuations."""
    part, contact = (
        DRIVES[case.get("drive", "steady")],
        CONTACTS[case.get("contact", "load")],
    )
    fluctuations = SHEARS[case.get("shear", "uniform")]
    if contact.faults(part.solves_motion, fluctuations.contact != "plane", False):
        return False
    population = BONDS[case.get("bonds", "rate, bell")].chosen(1e-8, False)
    return not part.faults(population.stretched, contact.reversible > 0.0)


def scene(members=3, steps=8, **parts):
    """A PDMS lens for a few milliseconds, with the parts given."""
    parts = {"contact": CONTACTS["load"], "seed": 5} | parts
    return Scenario(
        clock=parts.pop("clock", Clock(duration=steps * 1e-3, step=1e-3)),
        solid=parts.pop("solid", Solid(shear_modulus=1.6e6)),
        sphere=Sphere(radius=2e-3),
        adhesion=parts.pop("adhesion", Adhesion(work=42e-3)),
        ensemble=Ensemble(members=members),
        **parts,
    )


READ = {variable.name: variable.read for variable in VARIABLES}


def follow(scenario, noise, state, steps):
    """State at the last of some steps and the trajectory at each, from a state or the start."""
    return scenario.stepper.follow(noise, state, steps)


def march(scenario, members, state=None, keep=True):
    """States of members after every step; without ``keep`` the next step may change a state."""
    noise = MemberNoise.of(scenario.seed, members)
    if state is None:
        state = scenario.stepper.start(noise)
        yield state
    while state.step < scenario.times.steps:
        before = state._replace(bonds=deepcopy(state.bonds)) if keep else state
        steps = range(state.step + 1, state.step + 2)
        state, _ = scenario.stepper.advance(before, noise, steps)
        yield state


def records(scenario, *names):
    """Recorded quantities of all members at every step, each of shape (steps + 1, members or 1)."""
    states = [
        scenario.stepper.trajectory_of(state)
        for state in march(scenario, np.arange(scenario.ensemble.members))
    ]
    return [
        np.array([np.atleast_1d(READ[name](scenario, state)[0]) for state in states])
        for name in names
    ]


#: Sweeps of one axis and of two.
LOADS = {"contact.load": [1e-3, 4e-3]}
LOADS_AND_SHARES = LOADS | {"adhesion.bond_share": [0.5, 1.0]}


def sample(members=3, steps=9, sweep=None, **parts):
    """A small scene whose bonds and fluctuations are random, at each point of a sweep."""
    defaults = {
        "shear": SHEARS["modal, slip, onset"],
        "bonds": BONDS["counted"],
        "contact": CONTACTS["load"],
    }
    return replace(
        scene(members, steps, **(defaults | parts)), sweep=read_sweep(sweep or {})
    )


def one_step(step, *given):
    """A block of one step: time, duration, slip, path, speeds at its ends."""
    return Motion(step, *(np.reshape(value, (1, -1)) for value in given))


def advanced(process, state, motion, bonding, noise):
    """The state of a shear process after one step."""
    return process.advance(state, one_step(*motion[:-1]), bonding, noise)[0]
