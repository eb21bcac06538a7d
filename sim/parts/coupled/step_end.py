"""Ends of clock steps in the loops over them: fluctuations are drawn there, and the contact opens or closes."""

import math
from typing import NamedTuple

from sim.numerics.jit import device
from sim.numerics.noise import stream
from sim.parts.contact.balance import SHARE, stable_radius
from sim.parts.coupled import mechanics
from sim.parts.exchange import Array, Draws, Flags
from sim.parts.shear.bands import renew_band
from sim.parts.shear.process import shares, unsteadiness
from sim.spectrum.radial import Terms, share_of

#: Types of ``Draws`` and of ``StepEnds``.
DRAWS = (
    "Tuple((float64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], float64, float64, float64, "
    "boolean, boolean, Tuple((uint64, uint64, uint64[::1], int64))))"
)
ENDS = (
    f"Tuple(({DRAWS}, boolean, boolean, boolean, float64[:, ::1], boolean[::1], boolean[::1], float64[::1], float64, "
    f"{SHARE}, float64[:, ::1]))"
)


class StepEnds(NamedTuple):
    """Fluctuations and mount that act at the ends of some clock steps.

    Attributes
    ----------
    draws : Draws
        Fluctuations that are drawn there, without rows if none are.
    follows : bool
        True if the contact is found there.
    jumps : array, shape (steps,)
        True if load or displacement of the base jump there.
    again : bool
        True if a contact that has pulled off closes again as the free sphere touches.
    starts_empty : bool
        True if a contact that closes has no bonds yet, because it carries its bonds with it.
    mounts : array, shape (steps, 2)
        Load [N] and displacement of the base [m] at the end of each step, after a jump there.
    touches : array, shape (steps,)
        True if the free sphere touches then.
    energy : array, shape (members,)
        ΔΓ of fluctuations that are not drawn [J/m²].
    paid : float
        Share of ΔΓ that adhesion pays, waves being short beside the contact [1].
    share : tuple
        Share of that at the edge of a disc: inputs of ``sim.spectrum.radial.share_of``, without cubics on the plane.
    radius : array, shape (steps, members)
        Contact radius at the end of each step [m], nan where it is open: written in place.
    """

    draws: Draws
    follows: bool
    again: bool
    starts_empty: bool
    mounts: Array
    jumps: Flags
    touches: Flags
    energy: Array
    paid: float
    share: Terms
    radius: Array


@device
def _equilibrium(row, bonds, load, base, energy, contact, share):
    """Return the largest stable radius in equilibrium with the ``energy`` that fluctuations take, nan without one.

    ``bonds``: their share bound and the sum of their stretches. The energy is that for many waves in the contact.
    """
    start = row.radius if row.radius > 0.0 else math.sqrt(contact.area / math.pi)
    bonded, tilt = contact.bare + contact.bonded * bonds[0], contact.mean_stress
    tilt *= bonds[1] * bonds[1]
    mount = load, base, contact.stiffness
    body = contact.curvature, contact.modulus, contact.inverse_thickness
    most = bonded if len(share[2]) > 0 else bonded - energy
    work = most, bonded, energy, tilt
    return stable_radius(start, work, mount, body, share)


@device
def _draw(state, m, k, duration, field, draws, room):
    """Draw ΔΓ at the end of a clock step, as its process does; return it and its mean before the draw [J/m²]."""
    (
        values,
        energies,
        shapes,
        half_weight,
        factors,
        by_slip,
        by_time,
        mean,
        relaxing,
        _,
        address,
    ) = draws
    size, energy, expected = 1.0, mean, energies[k, m]
    if field.length < math.inf and not relaxing:
        size = math.sqrt(
            field.floor
            + (1.0 - field.floor) * unsteadiness(state.weight, state.mean, state.spread)
        )
    if shapes.size > 0:
        keep, renew = room[0], room[1]
        passed = by_slip * state.path + by_time * duration
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
    return size * size * energy, size * size * expected


@device
def end_step(row, columns, m, k, duration, contact, ends, room):
    """Draw ΔΓ at the end of a clock step, and find the contact there, with which the next step begins.

    ``row`` is that of member ``m`` in the units of the equations at the end of the sub-steps. ``columns`` are the same
    [SI], with which the next step begins. ``contact`` is as at the start of the step, ``room`` for the shares of all
    factors, shape (2, factors).
    """
    (
        draws,
        follows,
        again,
        starts_empty,
        mounts,
        jumps,
        touches,
        energies,
        paid,
        share,
        radii,
    ) = ends
    if not follows:
        return
    state, has_draws = columns.view(mechanics.ROW)[0], len(draws[0]) > 0
    drawn = expected = energies[m]
    if has_draws:
        drawn, expected = _draw(state, m, k, duration, contact.field, draws, room)
    is_open, radius = not row.radius > 0.0, math.nan
    is_reached = row.lost == 0.0 and not mechanics.has_ended(row)
    # the radius that the sub-steps have reached, to its last bit: a rounding would be a slip at once
    if not (is_open or jumps[k] or has_draws) and is_reached:
        radius = row.radius
    elif not is_open or (touches[k] and (again or row.parted == 0.0)):
        has_none = is_open and starts_empty
        bonds = (0.0, 0.0) if has_none else (row.bound, row.moment)
        radius = _equilibrium(
            row, bonds, mounts[k, 0], mounts[k, 1], paid * drawn, contact, share
        )
        # a sphere that touches without adhesion and without load has a contact of no size
        radius = 0.0 if touches[k] and math.isnan(radius) else radius
    if not is_open and math.isnan(radius):
        state.parted = 1.0
    radii[k, m], state.radius = radius, radius
    state.closed = 1.0 if is_open and radius > 0.0 else 0.0
    state.paid = paid
    if len(share[2]) > 0:
        state.paid = paid * (
            share_of(radius, share[0], share[1], share[2]) if radius > 0.0 else 0.0
        )
    state.drawn = state.paid * drawn
    state.felt = state.paid * (expected if draws[9] else drawn)
