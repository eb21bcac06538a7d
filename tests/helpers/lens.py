"""A lens on a ramp of the speed, which the statistics are tried on."""

import functools

from helpers.scenes import (
    Adhesion,
    Clock,
    Ensemble,
    Equilibrium,
    Onset,
    Scenario,
    Solid,
    Sphere,
    bonds,
    drive,
    shear,
)

from sim.ensemble.simulate import run
from sim.parts.shear.process import Time
from sim.spectrum.families import Band

RADIUS, WORK, MODULUS, LOAD = 2e-3, 42e-3, 6.4e6, 4e-3
FIELD = {
    "spectrum": Band(rms=150e3, longest=60e-6, shortest=24e-6),
    "cell": 0.24e-3,
    "points": 32,
}


def scene(**changes):
    parts = {
        "clock": Clock(duration=0.4, step=0.02),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=RADIUS),
        "adhesion": Adhesion(work=WORK),
        "contact": Equilibrium(load=LOAD),
        "drive": drive.Ramp(start=1e-5, stop=1e-1, scale="log"),
        "bonds": bonds.Rate(critical_speed=1e-2, rebinding_rate=500.0, stress=3e5),
        "shear": shear.Modal(
            correlation=Time(time=0.01),
            amplitude=Onset(speed=2.5e-3, width=0.3),
            **FIELD,
        ),
        "ensemble": Ensemble(members=6),
        "seed": 2003,
    }
    return Scenario(**{**parts, **changes})


@functools.cache
def ramp():
    """Six members on a ramp from 10 µm/s to 100 mm/s."""
    return run(scene())
