"""Fluctuations that are drawn at the end of each clock step, and the contact then, in the loops over clock steps."""

import math

from sim.numerics.jit import device
from sim.numerics.noise import stream
from sim.parts.contact.balance import SHARE, widest
from sim.parts.coupled import mechanics
from sim.parts.shear.bands import renew_band
from sim.parts.shear.process import shares, unsteadiness
from sim.spectrum.radial import share_of

#: Type of ``Draws``.
DRAWS = (
    "Tuple((float64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], boolean, float64, float64, "
    f"boolean, boolean, Tuple((uint64, uint64, uint64[::1], int64)), float64, {SHARE}))"
)


@device
def _radius(row, time, energy, contact, share):
    """Return the radius in equilibrium with the ``energy`` that fluctuations take for many waves in the contact.

    On a disc it is found as ``balance.widest_crossings`` has it.
    """
    load, base = (
        contact.load + contact.load_rate * time,
        contact.base + contact.base_rate * time,
    )
    mount, body = (load, 0.0, base, 0.0, 0.0), contact[8:12]
    on_disc = len(share[2]) > 0
    fluctuating = 0.0 if on_disc else energy
    bound, moment, tilt, radius = (
        contact.bonded,
        row.moment,
        contact.mean_stress,
        row.radius,
    )
    free = mechanics.Contact(
        contact.bare, *mount, bound, tilt, *body, fluctuating, 0.0, contact.field
    )
    wide, _, _, _ = mechanics.contact_area(row.bound, moment, 0.0, radius, free)
    if not on_disc:
        return wide
    none = mechanics.Contact(0.0, *mount, 0.0, 0.0, *body, 0.0, 0.0, contact.field)
    hertz, _, _, _ = mechanics.contact_area(0.0, 0.0, 0.0, radius, none)
    terms = load, base, contact.bare + bound * row.bound, energy, tilt * moment * moment
    return widest(
        wide,
        hertz,
        (terms, (contact.curvature, contact.modulus, contact.stiffness), share),
    )


@device
def redraw(row, columns, m, k, clock, contact, draws, room, reached):
    """Draw ΔΓ at the end of a clock step, as the process does, and find the radius in equilibrium with it.

    ``row`` is that of member ``m`` in the units of the equations. ``columns`` are the same [SI], with which the next
    step begins. ``contact`` is as at the start of the step, ``room`` for the shares of all factors, shape (2, factors).
    """
    (
        values,
        energies,
        shapes,
        half_weight,
        factors,
        by_slip,
        span,
        mean,
        relaxing,
        answers,
        address,
        paid,
        share,
    ) = draws
    state, field, duration = columns.view(mechanics.ROW)[0], contact.field, clock[k, 5]
    size, energy, expected = 1.0, mean, energies[k, m]
    if field.length < math.inf and not relaxing:
        size = math.sqrt(
            field.floor
            + (1.0 - field.floor) * unsteadiness(state.weight, state.mean, state.spread)
        )
    if shapes.size > 0:
        keep, renew = room[0], room[1]
        passed = (state.path if by_slip else duration) / span
        for i in range(factors.size):
            keep[i], renew[i] = shares(factors[i] * passed)
        if relaxing:
            renew[0] = math.sqrt(state.renewed)
        seed, part, members, first = address
        numbers = stream(seed, part, members[m], first + k, 0)
        energy = 0.0
        for j in range(shapes.size):
            i = j if factors.size > 1 else 0
            x, numbers = renew_band(
                values[m, j], keep[i], renew[i], 1.0, shapes[j], numbers
            )
            values[m, j] = x
            energy += half_weight[j] * x
        if factors.size == 1:
            expected = keep[0] * keep[0] * expected + renew[0] * renew[0] * mean
    energies[k + 1, m], state.energy = energy, energy
    drawn, expected = size * size * energy, size * size * expected
    if row.radius > 0.0:
        state.radius = _radius(row, duration, paid * drawn, contact, share)
        reached[mechanics.RADIUS, k, m] = state.radius
    state.paid = paid
    if len(share[2]) > 0:
        state.paid = paid * (
            share_of(state.radius, share[0], share[1], share[2])
            if state.radius > 0.0
            else 0.0
        )
    state.drawn = state.paid * drawn
    state.felt = state.paid * expected if answers else state.drawn
