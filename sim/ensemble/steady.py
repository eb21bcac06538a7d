"""Steady sliding in closed form: contacts that have slid at one speed for ever, and the keys that change them most."""

import functools
import math
from collections.abc import Mapping

import numpy as np

from sim.ensemble.variables import READ
from sim.parts.bonds.models import Model
from sim.parts.contact.balance import Balance
from sim.parts.exchange import Array, Bonding, ContactState, Motion
from sim.scenario.scenario import Scenario
from sim.scenario.schema import changed, quantities
from sim.step.state import Trajectory

#: Values of keys, by their dotted names.
Values = Mapping[str, float]

#: Relative step of a sensitivity; sensitivities below this are none.
_STEP, _NOTHING = 1e-4, 1e-6
#: Tables whose numbers do not matter to steady sliding at a given speed; of the drive only one number does.
_NO_PHYSICS = (
    "clock",
    "ensemble",
    "incipient",
    "instrument",
    "jump_in",
    "record",
    "seed",
    "zero",
)


def steady_course(
    scenario: Scenario, time: Array, speed: Array, stored: Array | None = None
) -> Trajectory:
    """Return contacts that have slid at speeds [m/s] for ever, held as the scenario has it at times [s].

    Shapes are (rows, 1). ``stored`` is ΔΓ at amplitude 1 [J/m²], by default its mean on the infinite plane. With
    several energies, energy, work and radius have the shape (rows, energies).
    """
    motion, bonding, energy, terms = _in_steady_sliding(scenario, time, speed, stored)
    touch = scenario.contact.start(motion, scenario.clock.duration, terms)
    return _trajectory(motion, bonding, energy, touch)


def history_at_rest(scenario: Scenario, time: Array) -> Trajectory:
    """Return the contact of a slider at rest, in equilibrium at the first of some times [s], shape (times, 1).

    From each time to the next the contact follows its mount by its own model, such as an edge that lags.
    """
    duration, contact = scenario.clock.duration, scenario.contact_at_temperature
    first, *_, terms = _in_steady_sliding(scenario, time[:1], 0.0 * time[:1])
    start = contact.start(first, duration, terms)
    moves, *_, terms = _in_steady_sliding(scenario, time[1:], 0.0 * time[1:])
    moves = moves._replace(duration=np.diff(time, axis=0))
    before = type(start)(*(values[0] for values in start))
    after = contact.advance(before, moves, duration, terms)
    touch = type(start)(*map(np.concatenate, zip(start, after, strict=True)))
    motion, bonding, energy, _ = _in_steady_sliding(scenario, time, 0.0 * time)
    return _trajectory(motion, bonding, energy, touch)


def jump_into_contact(scenario: Scenario) -> tuple[float, float]:
    """Return the displacement of the mount at which a free sphere at rest jumps into contact [m], and the load [N].

    The load is that right after the jump, in equilibrium. In JKR's theory the sphere jumps as it touches, at zero. With
    a range of adhesion it jumps at the distance w/σ0.
    """
    at_rest = np.zeros((1, 1))
    *_, terms = _in_steady_sliding(scenario, at_rest, at_rest)
    work = float(np.ravel(terms.bonded - terms.fluctuating)[0])
    displacement = -scenario.contact.jump_in_distance(work)
    there = changed(scenario, {f"contact.{scenario.contact.kind}": displacement})
    load = READ["normal_load"](there, steady_course(there, at_rest, at_rest))
    return displacement, float(np.ravel(load)[0])


def _in_steady_sliding(
    scenario: Scenario, time: Array, speed: Array, stored: Array | None = None
) -> tuple[Motion, Bonding, Array, Balance]:
    """Return sliding, bonds, ΔΓ and terms of the work of adhesion; arguments as of ``steady_course``."""
    result = bonds_at(scenario.population, tuple(speed[:, 0]))
    still = 0.0 * speed
    bonding = type(result)(*(np.reshape(values, (-1, 1)) + still for values in result))
    motion = Motion(0, time, 0.0 * time, still, still, speed, speed)
    shear = scenario.fluctuations
    size = shear.amplitude.factor(speed, bonding.strength) ** 2
    size = bonding.frozen + bonding.varying if shear.spectrum.bond_made else size
    energy = size * (
        scenario.elastic.stored_energy(shear.spectrum) if stored is None else stored
    )
    terms = scenario.work.balance(bonding, energy + still, still)
    viscous = scenario.drive.viscosity * speed
    return motion, bonding._replace(stress=bonding.stress + viscous), energy, terms


def _trajectory(
    motion: Motion, bonding: Bonding, energy: Array, touch: ContactState
) -> Trajectory:
    moving = (
        motion.time,
        0.0 * motion.speed,
        motion.speed,
        bonding.fraction,
        bonding.stress,
        bonding.strength,
        energy,
    )
    return Trajectory(*moving, np.empty((len(motion.speed), 1, 0)), *touch[:5])


# points of a sweep and shares of the energy have the same bonds at the same speeds
@functools.lru_cache(maxsize=64)
def bonds_at(population: Model, speeds: tuple[float, ...]) -> Bonding:
    """Return bonds in steady sliding at speeds [m/s], each distinct speed computed once."""
    distinct, place = np.unique(speeds, return_inverse=True)
    return Bonding(
        *(
            values[place] if values.size > 1 else values
            for values in population.steady(distinct)
        )
    )


def sensitivities(
    scenario: Scenario, time: float, speed: float
) -> dict[str, tuple[float, float]]:
    """Return the sensitivities of contact area and friction in steady sliding to each key, the largest first.

    They are logarithmic derivatives (percent per percent) by differences of the steady laws, central unless the number
    is at its bound. The time of the run [s] and the sliding speed [m/s] are given; the speed counts as the key "speed".
    Keys that change neither area nor friction are left out, as are numbers that are 0 or whole. There is none if the
    contact is open.

    Examples
    --------
    The area of a JKR contact without load goes with the power 4/3 of the radius:

    >>> from sim.parts.contact import Equilibrium
    >>> from sim.parts.contact.models import Adhesion, Solid, Sphere
    >>> from sim.scenario.scenario import Clock
    >>> bodies = Solid(shear_modulus=1e6), Sphere(radius=2e-3), Adhesion(work=0.04)
    >>> lens = Scenario(Clock(duration=1.0, step=0.1), *bodies, Equilibrium(load=0.0))
    >>> print(f"{sensitivities(lens, 0.0, 0.0)['sphere.radius'][0]:.5f}")
    1.33333
    """
    result, ends = (
        {},
        {"speed": [(scenario, speed * (1.0 + h), h) for h in (-_STEP, _STEP)]}
        if speed
        else {},
    )
    for key, (quantity, value) in quantities(scenario).items():
        table = key.partition(".")[0]
        matters = table not in _NO_PHYSICS and table != "drive"
        if value and not quantity.whole and (matters or key == "drive.viscosity"):
            steps = (
                -_STEP,
                _STEP
                if value * (1.0 + _STEP) < min(quantity.at_most, quantity.below)
                else 0.0,
            )
            ends[key] = [
                (changed(scenario, {key: value * (1.0 + h)}), speed, h) for h in steps
            ]
    for key, (before, after) in ends.items():
        rise = _logarithms(*after[:2], time) - _logarithms(*before[:2], time)
        if np.max(np.abs(rise)) > _NOTHING * _STEP:
            area, friction = rise / (math.log1p(after[2]) - math.log1p(before[2]))
            result[key] = float(area), float(friction)
    return dict(sorted(result.items(), key=lambda item: -max(map(abs, item[1]))))


def _logarithms(scenario: Scenario, speed: float, time: float) -> Array:
    """Return the logarithms of area and friction in steady sliding; nan without a contact, and friction's 0 if none."""
    course = steady_course(scenario, np.full((1, 1), time), np.full((1, 1), speed))
    area = (
        2.0 * math.log(float(course.radius[0, 0]))
        if course.radius[0, 0] > 0.0
        else math.nan
    )
    # at rest bonds without a stretch have a strength, but no stress
    stress = float(course.strength[0, 0]) + scenario.drive.viscosity * abs(speed)
    return np.array([area, area + math.log(stress) if stress > 0.0 else 0.0])
