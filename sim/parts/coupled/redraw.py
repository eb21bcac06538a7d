"""Fluctuations that are drawn at the end of each clock step, and the contact then, in the loops over clock steps."""

import math

from sim.numerics.jit import device
from sim.numerics.noise import stream
from sim.parts.coupled import mechanics
from sim.parts.shear.bands import renew_member
from sim.parts.shear.process import shares, unsteadiness

#: Type of ``Draws``.
DRAWS = (
    "Tuple((float64[:, ::1], float64[::1], float64[::1], float64[::1], float64[::1], boolean, float64, float64, "
    "boolean, boolean, Tuple((uint64, uint64, uint64[::1], int64))))"
)


@device
def redraw(row, columns, m, k, clock, contact, draws, room, reached):
    """Draw ΔΓ at the end of a clock step, as the process does, and find the radius in equilibrium with it.

    ``row`` is that of member ``m`` in the units of the equations. ``columns`` are the same [SI], with which the next
    step begins. ``contact`` is as at the start of the step, ``room`` for the shares of all factors, shape (2, factors).
    Nothing is drawn without ``values``.
    """
    if len(draws[0]) == 0:
        return
    values, last, shapes, half_weight, factors, by_slip, span, mean, relaxing, answers, (seed, part, members, first) = (
        draws
    )
    state = columns.view(mechanics.ROW)[0]
    field, spent = contact.field, (state.path if by_slip else clock[k, 5]) / span
    size, energy, expected = 1.0, mean, last[m]
    if field.length < math.inf and not relaxing:
        size = math.sqrt(field.floor + (1.0 - field.floor) * unsteadiness(state.weight, state.mean, state.spread))
    if shapes.size > 0:
        keep, renew = room[0], room[1]
        for i in range(factors.size):
            keep[i], renew[i] = shares(factors[i] * spent)
        if relaxing:
            renew[0] = math.sqrt(state.renewed)
        numbers = stream(seed, part, members[m], first + k, 0)
        energy = renew_member(values[m], keep, renew, 1.0, shapes, half_weight, numbers)
        if factors.size == 1:
            expected = keep[0] * keep[0] * expected + renew[0] * renew[0] * mean
    last[m], state.energy = energy, energy
    state.drawn = state.paid * (size * size * energy)
    state.felt = state.paid * (size * size * expected) if answers else state.drawn
    if row.radius > 0.0:
        contact = mechanics.later(mechanics.drawn(contact, state, 0), clock[k, 5], 0.0)
        state.radius, _, _, _ = mechanics.contact_area(row.bound, row.moment, 0.0, row.radius, contact)
        reached[mechanics.RADIUS, k, m] = state.radius
