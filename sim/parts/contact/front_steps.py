"""The edge of a rate-dependent contact through a block of clock steps: its way, its touches and its openings.

Within a step the work of adhesion changes linearly and the control piece by piece; over each piece ``crack_front``
moves the edge. A contact that closes begins as a spot, and one that has shrunk to half of it counts as open.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.numerics.special import cube_root
from sim.parts.contact.balance import Balance
from sim.parts.contact.crack_front import Kinetics, moved_edge, scene_of
from sim.parts.contact.edge_law import excess, hertz_radius
from sim.parts.exchange import Array, ContactState
from sim.spectrum.finite_contact import share_of
from sim.units.course import Pieces

#: Radius of a first touch over the length (w R²/E*)^(1/3) of adhesive contacts.
_SPOT = 1e-3
_READ, _THREE = "Array(float64, 2, 'A', readonly=True)", "UniTuple(float64, 3)"
#: ``terms`` of a contact on the whole plane, see ``Margin.terms``.
_PLANE = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.empty((0, 4))


@device
def _left(radius, bonded, fluctuating, taken, wave, ends, cubics):
    """Work of adhesion left at a radius; of an open contact that of a vanishing one."""
    size, share = (0.0 if math.isnan(radius) else radius), 1.0
    if len(cubics) > 0:
        share = share_of(size, wave, ends, cubics) if size > 0.0 else 0.0
    return bonded - fluctuating * share - taken * size


@device
def _energy(t, a, scene):
    """Energy of a contact above that of an open one: elastic, of the spring or the load, of adhesion."""
    modulus, curvature, stiffness, load, load_rate, base, base_rate, work, work_rate, _ = scene
    hertz = a * a * curvature
    indentation = hertz - excess(t, a, scene)[0]
    energy = modulus * a * (indentation * indentation - 2.0 / 3.0 * hertz * indentation + 0.2 * hertz * hertz)
    energy -= (load + load_rate * t) * indentation + math.pi * a * a * (work + work_rate * t)
    if stiffness < math.inf:
        stretch = base + base_rate * t - indentation
        energy += 0.5 * stiffness * stretch * stretch
    return energy


@device
def _moved(radius, touches, works, loads, bases, stiffness, duration, kinetics, bodies, spot):
    """Radius or nan, time of opening or nan, and dissipated energy after a part of a clock step.

    Energy still stored where the edge opens counts as dissipated, and so does what a spot gains at a touch. Under a
    load nothing counts where it falls: below the radius at pull-off its work diverges as the radius vanishes.
    """
    a = spot if touches else radius
    if math.isnan(a):
        return math.nan, math.nan, 0.0
    end, opened, lost = moved_edge(a, works, loads, bases, stiffness, duration, kinetics, bodies, 0.5 * spot)
    scene, opens = scene_of(works, loads, bases, stiffness, duration, kinetics[0], bodies), math.isnan(end)
    if stiffness == 0.0:
        sphere_radius, modulus = bodies
        fold = cube_root(9.0 * math.pi * max(works[1], 0.0) * sphere_radius * (sphere_radius / (8.0 * modulus)))
        if opens or (loads[1] < 0.0 and radius < fold):
            lost = 0.0
    elif opens:
        lost += max(_energy(opened, 0.5 * spot, scene), 0.0)
    if touches:
        lost += max(-_energy(0.0, max(spot, hertz_radius(0.0, scene)), scene), 0.0)
    return end, opened, lost


@kernel(
    f"void(float64[:, ::1], float64[::1], int64[::1], float64[:, ::1], {_READ}, {_READ}, {_READ}, float64,"
    f" UniTuple(float64, 5), UniTuple(float64, 2), float64, boolean, {_THREE}, {_THREE}, float64[:, ::1],"
    " float64[:, :, ::1])"
)
def _follow(
    state, durations, opening, pieces, bonded, fluctuating, taken, stiffness, kinetics, bodies, spot, again, wave, ends,
    cubics, out,
):  # fmt: skip
    for m in range(state.shape[1]):
        work, radius, detached, dissipated = state[0, m], state[1, m], state[2, m], state[3, m]
        for k in range(len(durations)):
            last = _left(radius, bonded[k, m], fluctuating[k, m], taken[k, m], wave, ends, cubics)
            first, share = (last if math.isnan(radius) else work), 0.0
            for p in range(opening[k], opening[k + 1]):
                before, share = share, pieces[1, p]
                works = (1.0 - before) * first + before * last, (1.0 - share) * first + share * last
                held, none = (pieces[2, p], pieces[3, p]), (0.0, 0.0)
                loads, bases = (held, none) if stiffness == 0.0 else (none, held)
                touches = math.isnan(radius) and (math.isnan(detached) or again) and held[0] >= 0.0
                closed, duration = touches or not math.isnan(radius), durations[k] * (share - before)
                radius, opened, lost = _moved(
                    radius, touches, works, loads, bases, stiffness, duration, kinetics, bodies, spot
                )
                dissipated += lost
                if closed and math.isnan(radius):
                    detached = pieces[0, p] - duration + opened
            work = _left(radius, bonded[k, m], fluctuating[k, m], taken[k, m], wave, ends, cubics)
            out[0, k, m], out[1, k, m], out[2, k, m], out[3, k, m] = work, radius, detached, dissipated


def follow(
    state: ContactState, durations: Array, pieces: Pieces, stiffness: float, balance: Balance, reversible: float,
    kinetics: Kinetics, again: bool,
) -> Array:  # fmt: skip
    """The first four quantities of ``ContactState`` at the end of each step of a block, shape (4, steps, rows).

    Parameters
    ----------
    state : ContactState
        The contact before the block.
    durations : array, shape (steps,)
        Lengths of the steps [s].
    pieces : Pieces
        The control in each step: the displacement of the base behind a ``stiffness`` [N/m], infinite for an
        indentation, or for a stiffness of 0 the load.
    balance : Balance
        Terms of the work of adhesion at the end of each step, of which the mean stress takes the share
        ``reversible``. What depends on the radius is taken at that of the start of the step.
    kinetics : Kinetics
        The law of the edge.
    again : bool
        Whether a contact that has come off closes again where the free sphere touches.
    """
    opening = np.searchsorted(pieces.interval, np.arange(len(durations) + 1))
    begin, end = pieces.start[opening[:-1]], pieces.stop[opening[1:] - 1]
    shares = (pieces.stop - begin[pieces.interval]) / (end - begin)[pieces.interval]
    taken = reversible * balance.reversible(np.ones(1)) if reversible else np.zeros(1)
    of_steps = balance.bonded, balance.fluctuating, taken
    _, rows = np.broadcast_shapes(state.radius.shape, *((1, *values.shape)[-2:] for values in of_steps))
    before, out = np.empty((4, rows)), np.empty((4, len(durations), rows))
    for row, values in zip(before, state, strict=False):
        row[:] = values
    sphere_radius, modulus, _ = balance.bodies
    spot = _SPOT * math.cbrt(balance.reference * sphere_radius**2 / modulus)
    _follow(
        before, durations, opening, np.array([pieces.stop, shares, pieces.first, pieces.last]),
        *(np.broadcast_to(values, out.shape[1:]) for values in of_steps), stiffness, tuple(kinetics),
        (sphere_radius, modulus), spot, again, *(_PLANE if balance.margin is None else balance.margin.terms), out,
    )  # fmt: skip
    return out
