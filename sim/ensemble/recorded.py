"""What can be read off a state, each with unit, long name and symbol."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.engine import State
from sim.parts.contact.control import Grip
from sim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Variable:
    """One recorded quantity.

    ``part`` names the part whose class decides whether members differ; ``read`` takes the scenario
    and a state and gives an array of shape (1,) or (members,).
    """

    name: str
    unit: str
    long_name: str
    symbol: str
    part: str
    read: Callable[[Scenario, State], np.ndarray]


def _until_stopped(read: Callable[[Scenario, State], np.ndarray]) -> Callable[[Scenario, State], np.ndarray]:
    """A reading that is nan once a member's trajectory has stopped at its detachment."""

    def told(scene: Scenario, state: State) -> np.ndarray:
        values = read(scene, state)
        return (
            np.where(np.isnan(state.contact.radius), np.nan, values)
            if scene.contact.after_pull_off == "stop"
            else values
        )

    return told


def _radius(scene: Scenario, state: State) -> np.ndarray:
    return np.nan_to_num(state.contact.radius, nan=0.0)


def _area(scene: Scenario, state: State) -> np.ndarray:
    return np.pi * _radius(scene, state) ** 2


def _stress(scene: Scenario, state: State) -> np.ndarray:
    return state.bonding.stress


def _grip(scene: Scenario, state: State) -> Grip:
    return scene.contact.grip(scene.clock.time(state.step), scene.clock.duration)


def _load(scene: Scenario, state: State) -> np.ndarray:
    return _grip(scene, state).normal_load(state.contact.radius, scene.bodies)


def _indentation(scene: Scenario, state: State) -> np.ndarray:
    return _grip(scene, state).depth(state.contact.radius, scene.bodies)


def _displacement(scene: Scenario, state: State) -> np.ndarray:
    return _grip(scene, state).displacement(state.contact.radius, scene.bodies)


VARIABLES = (
    Variable("speed", "m/s", "sliding speed", "V", "drive", lambda scene, state: state.drive.speed),
    Variable("slider_position", "m", "displacement of the slider", "X", "drive",
          lambda scene, state: state.drive.position),
    Variable("bond_fraction", "1", "bonds over bonds at rest", "N/N_0", "bonds",
          lambda scene, state: state.bonding.fraction),
    Variable("shear_stress", "Pa", "mean shear stress at the interface", "tau_0", "bonds", _stress),
    Variable("fluctuation_energy", "J/m^2", "elastic energy of the shear-stress fluctuations per area",
          "DeltaGamma", "shear", lambda scene, state: state.shear.energy),
    Variable("work_of_adhesion", "J/m^2", "work of adhesion left to the contact", "w", "contact",
          _until_stopped(lambda scene, state: state.contact.work)),
    Variable("contact_radius", "m", "contact radius", "a", "contact", _until_stopped(_radius)),
    Variable("contact_area", "m^2", "contact area", "A", "contact", _until_stopped(_area)),
    Variable("normal_load", "N", "normal load on the sphere, compression positive", "P", "contact",
          _until_stopped(_load)),
    Variable("indentation", "m", "indentation of the sphere", "delta", "contact", _until_stopped(_indentation)),
    Variable("displacement", "m", "displacement of what holds the sphere", "Delta", "contact",
          _until_stopped(_displacement)),
    Variable("friction_force", "N", "friction force, shear stress times contact area", "F", "contact",
          _until_stopped(lambda scene, state: _stress(scene, state) * _area(scene, state))),
    Variable("in_contact", "1", "whether the contact is closed", "", "contact",
          lambda scene, state: (state.contact.radius > 0.0).astype(float)),
    Variable("masked", "1", "whether no work of adhesion is left, so that the contact is Hertz's", "", "contact",
          lambda scene, state: ((state.contact.work <= 0.0) & (state.contact.radius > 0.0)).astype(float)),
    Variable("detachment_time", "s", "time of the last detachment", "t_d", "contact",
          lambda scene, state: state.contact.detached),
    Variable("dissipated_energy", "J", "energy dissipated by the edge and the jumps of the contact", "W", "contact",
          lambda scene, state: state.contact.dissipated),
)  # fmt: skip
