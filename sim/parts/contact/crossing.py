"""Equilibrium of a contact on a disc: the widest radius at which the energy release rate falls to the work left.

The share of ΔΓ that a disc pays is not convex in its radius, so neither Newton's method nor a fixed-point iteration
is safe. A walk inwards starts from the radius without fluctuations; between the two places where the sign changes
Ridders's method goes down to rounding. Where the walk meets no crossing, the least surplus along it is searched, lest
two crossings lie between two places.
"""

import math

from sim.laws.jkr.scales import series_shares
from sim.numerics.jit import device, kernel
from sim.spectrum.finite_contact import share_of

#: Places of the walk inwards, its end over its start, and turns that narrow an interval down to rounding.
_WALK, _NARROWEST, _TURNS = 128, 1e-4, 40
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_TURN = 0.5 / math.pi


@device
def _surplus(radius, terms, bodies, wave, ends, cubics):
    """Energy release rate, negative below Hertz's radius, less the work of adhesion left at a radius [J/m²]."""
    load, base, bonded, fluctuating, reversible = terms
    curvature, modulus, stiffness = bodies
    inverse, hertz = 1.0 / radius, radius * radius * curvature
    missing = 2.0 / 3.0 * hertz - 0.5 * load / modulus * inverse
    if stiffness > 0.0:
        grips, dead = series_shares(stiffness, 2.0 * modulus * radius)
        missing = grips * (hertz - base) + dead * (2.0 / 3.0 * hertz)
    rate = _TURN * modulus * inverse * missing * abs(missing)
    return rate - (bonded - fluctuating * share_of(radius, wave, ends, cubics) - reversible * radius)


@device
def _dip(inside, outside, terms, bodies, wave, ends, cubics):
    """Place between two others at which the surplus is least, by golden section."""
    one, two = outside - _GOLDEN * (outside - inside), inside + _GOLDEN * (outside - inside)
    first, second = _surplus(one, terms, bodies, wave, ends, cubics), _surplus(two, terms, bodies, wave, ends, cubics)
    for _ in range(_TURNS):
        if first < second:
            outside, two, second = two, one, first
            one = outside - _GOLDEN * (outside - inside)
            first = _surplus(one, terms, bodies, wave, ends, cubics)
        else:
            inside, one, first = one, two, second
            two = inside + _GOLDEN * (outside - inside)
            second = _surplus(two, terms, bodies, wave, ends, cubics)
    return 0.5 * (inside + outside)


@device
def _narrowed(inside, outside, terms, bodies, wave, ends, cubics):
    """Place at which the surplus crosses zero between two places, to rounding: Ridders's method."""
    low = _surplus(inside, terms, bodies, wave, ends, cubics)
    high = _surplus(outside, terms, bodies, wave, ends, cubics)
    before = 0.0
    for _ in range(_TURNS):
        if not (outside - inside > 4e-16 * outside and low < 0.0 and high > 0.0):
            break
        middle = 0.5 * (inside + outside)
        value = _surplus(middle, terms, bodies, wave, ends, cubics)
        guess = middle + (middle - inside) * (-value) / math.sqrt(value * value - low * high)
        guess = min(max(guess, inside), outside)
        if abs(guess - before) <= 4e-16 * guess:
            return guess
        before, at = guess, _surplus(guess, terms, bodies, wave, ends, cubics)
        for place, found in ((middle, value), (guess, at)):
            if inside < place < outside:
                if found <= 0.0:
                    inside, low = place, found
                else:
                    outside, high = place, found
    return outside if high == 0.0 else inside


@device
def _widest(start, hertz, terms, bodies, wave, ends, cubics):
    """Radius of one contact, see ``widest_crossings``."""
    if not start > 0.0 or terms[3] == 0.0 or _surplus(start, terms, bodies, wave, ends, cubics) <= 0.0:
        return start  # nothing is taken
    low = max(hertz if hertz > 0.0 else 0.0, _NARROWEST * start)
    ratio = (low / start) ** (1.0 / _WALK)
    outside, inside, least, lowest = start, start, math.inf, start
    for k in range(1, _WALK + 1):
        outside, inside = inside, low if k == _WALK else inside * ratio
        value = _surplus(inside, terms, bodies, wave, ends, cubics)
        if value <= 0.0:
            return max(_narrowed(inside, outside, terms, bodies, wave, ends, cubics), low)
        if value < least and k < _WALK:
            least, lowest = value, inside
    dip = _dip(lowest * ratio, lowest / ratio, terms, bodies, wave, ends, cubics)
    if _surplus(dip, terms, bodies, wave, ends, cubics) <= 0.0:
        return max(_narrowed(dip, lowest / ratio, terms, bodies, wave, ends, cubics), low)
    return hertz


@kernel(
    "void(float64[:, ::1], UniTuple(float64, 3), UniTuple(float64, 3), UniTuple(float64, 3), float64[:, ::1],"
    " float64[::1])"
)
def widest_crossings(contacts, bodies, wave, ends, cubics, radius):
    """Largest stable radius of contacts on discs, written to ``radius`` [m].

    Rows of ``contacts``: radius without fluctuations [m], nan without a contact; Hertz's radius [m], nan where pulled;
    load [N] and displacement of the base [m], one of them 0; work of adhesion of the bonds left and energy of the
    fluctuations [J/m²]; energy that the mean stress takes, over the radius [J/m³]. ``bodies``: curvature of the
    sphere, contact modulus, stiffness, 0 at a load. The rest is a margin's ``terms``. The walk never goes below
    1e-4 of its start.
    """
    for i in range(radius.size):
        terms = contacts[2, i], contacts[3, i], contacts[4, i], contacts[5, i], contacts[6, i]
        radius[i] = _widest(contacts[0, i], contacts[1, i], terms, bodies, wave, ends, cubics)
