"""Inward root search: the largest radius at which a function falls through zero, for many members at once."""

import math
from collections.abc import Callable

import numpy as np

from sim.parts.exchange import Array, Flags

Surplus = Callable[[Array], Array]

#: Places of the walk inwards, its end over its start, and turns that narrow an interval down to rounding.
_WALK, _NARROWEST, _TURNS = 128, 1e-4, 40
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def widest_crossing(surplus: Surplus, start: Array, low: Array) -> tuple[Array, Flags, Flags]:
    """Radius at which ``surplus`` falls to zero, walking inwards from ``start`` to ``low``, each shape (members, 1).

    Where the walk meets no crossing, the least surplus along it is searched, lest two crossings lie between two places.
    The walk never goes below 1e-4 of its start.

    Returns
    -------
    edge, closed, at_once : array, shape (members, 1)
        The radius; whether there is one; whether nothing is in surplus at the start already.
    """
    low = np.maximum(low, _NARROWEST * start)
    places = start * (low / start) ** np.linspace(0.0, 1.0, _WALK + 1)
    places[:, -1:] = np.broadcast_to(low, places[:, -1:].shape)
    crossed = surplus(places) <= 0.0
    first = np.maximum(np.argmax(crossed, 1), 1)[:, None]
    closed = crossed.any(1, keepdims=True)
    inside, outside = np.take_along_axis(places, first, 1), np.take_along_axis(places, first - 1, 1)
    if not closed.all():
        dip, before = _dip(surplus, places)
        inside, outside = np.where(closed, inside, dip), np.where(closed, outside, before)
        closed |= surplus(dip) <= 0.0
    return _narrowed(surplus, inside, outside), np.asarray(closed), crossed[:, :1]


def _dip(surplus: Surplus, places: Array) -> tuple[Array, Array]:
    """Place along a walk at which the surplus is least, by golden section, and the place before."""
    least = np.clip(np.argmin(surplus(places), 1), 1, _WALK - 1)[:, None]
    left, right = np.take_along_axis(places, least + 1, 1), np.take_along_axis(places, least - 1, 1)
    before = right
    for _ in range(_TURNS):
        one, two = right - _GOLDEN * (right - left), left + _GOLDEN * (right - left)
        inner = surplus(one) < surplus(two)
        left, right = np.where(inner, left, one), np.where(inner, two, right)
    return 0.5 * (left + right), before


def _narrowed(surplus: Surplus, inside: Array, outside: Array) -> Array:
    """Place at which the surplus crosses zero between two places, to rounding: Ridders's method, element by element."""
    low, high = surplus(inside), surplus(outside)
    for _ in range(_TURNS):
        open_ = (np.abs(outside - inside) > 4e-16 * outside) & (low < 0.0) & (high > 0.0)
        if not open_.any():
            break
        middle = 0.5 * (inside + outside)
        value = surplus(middle)
        root = np.sqrt(np.where(open_, value * value - low * high, 1.0))
        guess = np.where(open_, middle + (middle - inside) * (-value) / root, inside)
        guess = np.clip(guess, np.minimum(inside, outside), np.maximum(inside, outside))
        at = surplus(guess)
        for place, found in ((middle, value), (guess, at)):
            within = open_ & (place > inside) & (place < outside)
            below = within & (found <= 0.0)
            inside, low = np.where(below, place, inside), np.where(below, found, low)
            above = within & (found > 0.0)
            outside, high = np.where(above, place, outside), np.where(above, found, high)
    return np.where(high == 0.0, outside, inside)
