"""Scenes in other units of mass and time: no answer depends on them, because the program has no scale of its own.

A change of the unit of mass by 2^±10 takes the shear moduli of the random scenes to 98 Pa and to 3 GPa, with all
forces, energies and masses in proportion, and one of the unit of time by 2^-9 makes all of it 512 times as fast. Powers
of two change no rounding, so that all that is recorded is equal bit for bit, also of a slider that sticks and slips.
(With another unit of length the cube roots of areas are rounded differently.)
"""

import functools
import json
import os

import numpy as np
import pint
import pytest
from helpers.random_scenes import random_scene
from numpy.testing import assert_allclose

import sim
from sim.ensemble.dataset import scenario_json
from sim.scenario.schema import entries

#: Error of a speed that is looked for over its logarithm, 30 at the most, by which its roundings are multiplied.
BY_LOGARITHM = 100.0 * np.finfo(float).eps
#: The least normal number.
TINY = float(np.finfo(float).tiny)


@functools.cache
def registry():
    """Return a registry of units, which takes long to build, when a test first needs it."""
    return pint.UnitRegistry()


@functools.cache
def exponents(unit):
    """Return the exponents of mass and time of a unit; lengths, angles and counts have none."""
    parts = registry().Unit(unit.replace("^", "**")).dimensionality
    return np.array([int(parts.get(f"[{name}]", 0)) for name in ("mass", "time")])


def in_units(scene, powers):
    """Return a scene with every number multiplied by 2 to the power of its exponents times ``powers``."""
    document = json.loads(scenario_json(scene))
    for key, value, quantity in entries(scene):
        if quantity and not quantity.whole:
            *path, name = key.split(".")
            table = functools.reduce(dict.__getitem__, path, document)
            table[name] = np.ldexp(value, exponents(quantity.unit) @ powers).tolist()
    return sim.load(document)


def check_similarity(scene):
    """Run a scene and the same in other units, and compare all that is recorded."""
    plain = sim.run(scene)
    for powers in ((10, 0), (-10, 0), (0, -9)):
        other, compared = sim.run(in_units(scene, powers)), 0
        for name, variable in plain.data_vars.items():
            if variable.dtype.kind == "f":
                back = -exponents(variable.attrs.get("units", "1")) @ powers
                room = BY_LOGARITHM if "speed_" in name else 0.0
                # a number below the least normal one loses bits by another unit
                assert_allclose(
                    np.ldexp(other[name], back), variable, room, TINY, err_msg=name
                )
                compared += 1
        assert compared > 10


@pytest.mark.parametrize("seed", range(8))
def test_an_answer_depends_on_no_unit(seed):
    check_similarity(sim.load(random_scene(seed)))


@pytest.mark.verify
@pytest.mark.parametrize("seed", range(8, int(os.environ.get("SCENES", "300"))))
def test_the_answer_of_a_random_scene_depends_on_no_unit(seed):
    try:
        scene = sim.load(random_scene(seed))
    except sim.BadInput:  # refused, whatever its units
        return
    check_similarity(scene)
