"""The start of a piece of a clock step: a contact keeps its radius only if the ΔΓ drawn leaves no equilibrium."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.laws import jkr
from sim.parts.coupled import mechanics

WORK, RADIUS, MODULUS = 0.03, 1e-3, 4e6
PULL_OFF = 1.5 * math.pi * WORK * RADIUS
HALF = 0.5 * jkr.radius_at_load(0.0, WORK, RADIUS, MODULUS)


def contact(load):
    """JKR's contact under a load, of which neither bonds nor the mean stress take a share."""
    field = mechanics.FieldLaw(*np.zeros(len(mechanics.FieldLaw._fields)))
    numbers = dict.fromkeys(mechanics.Contact._fields, 0.0)
    numbers |= {"bare": WORK, "load": load, "area": math.pi * HALF**2}
    numbers |= {"curvature": 1.0 / RADIUS, "modulus": MODULUS, "field": field}
    return mechanics.Contact(**numbers)


def answered(felt, drawn, piece=0):
    """Return if a sheared interface has slipped at once behind its spring, the contact, and the row then."""
    row = np.rec.array(np.zeros(1, mechanics.ROW))[0]
    energy = np.rec.array(np.zeros(1, mechanics.ENERGY))[0]
    row.bound, row.moment, row.radius, row.spring_force = 1.0, 0.1, HALF, 0.1
    row.felt, row.drawn = felt * WORK, drawn * WORK
    numbers = dict.fromkeys(mechanics.Slider._fields, 0.0)
    slider = mechanics.Slider(**numbers | {"length": 1.0, "stiffness": 2.0})
    here = mechanics.feeling(contact(-0.9 * PULL_OFF), row)
    going, ahead = mechanics.answer(row, piece, slider, here, energy)
    return going, ahead, row


@pytest.mark.parametrize("felt", [0.0, 0.05, 0.11, 0.5])
@pytest.mark.parametrize("drawn", [0.0, 0.05])
def test_a_contact_that_the_draw_holds_has_its_radius_whatever_the_mean_of_the_draws_was(
    felt, drawn
):
    """Under 0.9 of the force at pull-off a contact is held by 0.9 of the work of adhesion, no less."""
    going, ahead, row = answered(felt, drawn)
    assert going and ahead.stays == 0.0
    radius = jkr.radius_at_load(-0.9 * PULL_OFF, (1.0 - drawn) * WORK, RADIUS, MODULUS)
    assert_allclose(row.radius, radius, rtol=1e-12)
    assert_allclose(row.spring_force, (row.radius / HALF) ** 2 * row.moment, rtol=1e-12)


@pytest.mark.parametrize(
    "felt, piece, kept",
    [
        (0.5, 0, HALF),
        (0.11, 1, HALF),
        # that of the mean of the draws
        (0.0, 0, jkr.radius_at_load(-0.9 * PULL_OFF, WORK, RADIUS, MODULUS)),
    ],
)
def test_a_contact_that_nothing_holds_keeps_its_radius_to_the_end_of_the_clock_step(
    felt, piece, kept
):
    going, ahead, row = answered(felt, 0.11, piece)
    assert going and ahead.stays == 1.0
    assert_allclose(row.radius, kept, rtol=1e-12)
