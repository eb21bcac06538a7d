"""Bonds followed one by one: a finite number of sites per member, every stretch, exact rupture times.

Each site is free or bound. A bond is born unstretched, is stretched by the slider, and breaks when
its integrated rupture reaches an exponential threshold; the site then waits an exponential time and
binds again, at the slider's place of that very moment. Nothing of this depends on the clock step: steps
only cut the motion into pieces of constant speed, so the same motion in other steps gives the same
lives but for rounding. The numbers of each life have an address of their own (seed, site, life,
member), so members do not depend on the batch, nor on where a run was taken up again.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.special import reduced_exponential_integral, scaled_exponential_integral
from sim.parts.bonds.rupture import RuptureRate
from sim.parts.bonds.tracked_events import BLOCK, BOUND, COLUMNS, SENSE, SLIDER, SQUARES, STEPS, SUM
from sim.parts.bonds.tracked_step import ENDLESS, SPENT, draw, live
from sim.parts.exchange import Array

#: What is said of a state that is spent.
AGAIN = "these tracks have been advanced already: go on from the newest state, or from copies"


class Tracks(NamedTuple):
    """State of the bonds of all members; plain arrays, so that it can be written and read back.

    ``advance`` works in the large arrays themselves, which the states of a run share: only the newest
    state can go on, an older one raises an error. The frames are each state's own, so the moments of an older state
    stay right. Copies of all arrays make a state that goes on by itself.

    Attributes
    ----------
    birth, due : array, shape (members, sites)
        Where each bond was born, when it breaks or its site binds, in the units of ``tracked_events``.
    life : array of uint32, shape (members, sites)
        Number of each site's life.
    soonest : array, shape (members, 3, blocks)
        First rupture, first binding and rearmost bond of each block of sites.
    stamp : array of int, shape (members,)
        Steps that the large arrays have seen.
    frame : array, shape (members, columns)
        Slider, time, clock, sums and steps of each member.
    """

    birth: Array
    due: Array
    life: Array
    soonest: Array
    stamp: Array
    frame: Array


def start(
    rupture: RuptureRate, rebinding_rate: float, sites: int, speed: Array, begin: str, seed: int, members: Array
) -> Tracks:
    """Bonds at the start of a run.

    Parameters
    ----------
    rupture : RuptureRate
        Rupture rate of a bond against its stretch.
    rebinding_rate : float
        k_on [1/s] of a free site, at least 0.
    sites : int
        Sites of each member.
    speed : array, shape (1,) or (members,)
        V [m/s], either sign; needed by "steady" only.
    begin : str
        "steady": the stationary law at that speed. "bonded": a site is bound with the chance of rest,
        k_on/(k_on + k0), and unstretched. "empty": no site is bound.
    seed : int
        Seed of the run.
    members : array of int
        Absolute numbers of the members.

    Raises
    ------
    ValueError
        For "steady" sliding of bonds that never break, which has no stationary law.

    Examples
    --------
    At rest half of the sites are bound where bonds open as fast as they close; sliding takes them away:

    >>> law, still, fast = RuptureRate(1.0, 1e9, math.inf), np.zeros(1), np.array([1e-8])
    >>> for speed in still, fast:
    ...     tracks = start(law, 1.0, 10**5, speed, "steady", 1, np.arange(1))
    ...     share, mean, _ = moments(tracks.frame, 10**5)
    ...     print("%.2f of the sites, mean stretch %.2f nm" % (share[0], 1e9 * mean[0]))
    0.50 of the sites, mean stretch 0.00 nm
    0.17 of the sites, mean stretch 0.20 nm
    """
    rows, blocks = len(members), -(-sites // BLOCK)
    tracks = Tracks(
        birth=np.zeros((rows, sites)),
        due=np.zeros((rows, sites)),
        life=np.zeros((rows, sites), np.uint32),
        soonest=np.zeros((rows, 3, blocks)),
        stamp=np.zeros(rows, np.int64),
        frame=np.zeros((rows, COLUMNS)),
    )
    _draw(tracks, np.ones(1, bool), begin, np.asarray(speed, dtype=float), rupture, rebinding_rate, seed, members)
    return tracks


def advance(
    tracks: Tracks, slip: Array, duration: Array, rupture: RuptureRate, rebinding_rate: float, seed: int, members: Array
) -> tuple[Tracks, Array]:
    """Bonds after steps of constant speed each.

    Parameters
    ----------
    tracks : Tracks
        State before the steps; spent afterwards, but for its moments.
    slip : array, shape (steps, 1) or (steps, members)
        Displacement of the slider over each step, either sign [m].
    duration : array, shape (steps,)
        Length of each step [s], above 0.
    rupture, rebinding_rate, seed, members
        As at the start. Only the rates may have changed since.

    Returns
    -------
    tracks : Tracks
        State at the end.
    frames : array, shape (steps, members, columns)
        Frames after each step, of which ``moments`` reads; the same, bit for bit, however many steps are made at once.

    Raises
    ------
    RuntimeError
        When the state has been advanced already.
    ValueError
        When slip or duration are not finite, or duration is not positive.

    Notes
    -----
    Exact for any length of a step. One of more than about 300 lives of a site ends in the
    stationary law of its speed, and is drawn from it.
    """
    members, after = np.asarray(members, dtype=np.uint64), tracks._replace(frame=tracks.frame.copy())
    frames, done = np.empty((*after.frame.shape, len(duration))), 0
    while done < len(duration):
        done = live(tuple(after), slip, duration, *rupture[:3], rebinding_rate, seed, members, done, frames)
        if done == SPENT:
            raise RuntimeError(AGAIN)
        if done == ENDLESS:
            raise ValueError("slip and duration of a step must be finite, and its duration positive")
        left = after.frame[:, STEPS] < tracks.frame[:, STEPS] + done
        if left.any():
            _draw(after, left, "steady", slip[done - 1] / duration[done - 1], rupture, rebinding_rate, seed, members)
            frames[:, :, done - 1] = after.frame
    return after, frames.transpose(2, 0, 1)


def bound(frames: Array) -> Array:
    """Number of bound sites of frames of shape (..., columns), shape (...)."""
    return frames[..., BOUND]


def mean_stretch(frames: Array, sites: int) -> Array:
    """Sum of all stretches, with sign, over the number of sites [m]."""
    return frames[..., SENSE] * (frames[..., BOUND] * frames[..., SLIDER] - frames[..., SUM]) / sites


def mean_square_stretch(frames: Array, sites: int) -> Array:
    """Sum of all squared stretches over the number of sites [m^2]."""
    number, slider, total, squares = (frames[..., column] for column in (BOUND, SLIDER, SUM, SQUARES))
    return np.maximum(slider * (number * slider - 2.0 * total) + squares, 0.0) / sites


def moments(frames: Array, sites: int) -> tuple[Array, Array, Array]:
    """Share of sites bound [1], mean stretch [m] and mean square stretch [m^2] per site, each of the frames' shape."""
    return bound(frames) / sites, mean_stretch(frames, sites), mean_square_stretch(frames, sites)


def mean_life(speed: Array, rupture: RuptureRate) -> Array:
    """Mean life of a bond born unstretched at constant speed.

    Parameters
    ----------
    speed : array
        V [m/s], either sign.
    rupture : RuptureRate
        Rupture rate of a bond against its stretch.

    Returns
    -------
    array
        ⟨T⟩ = ∫S dt [s], to 1e-12; infinite where bonds never break.

    Notes
    -----
    Bell's: z e^z E1(z)/k0 with z = k0/(softness \\|V\\|). With a limit as well, by
    Gauss's rule in 32 pieces.

    Examples
    --------
    A bond lives shorter the faster it is pulled, but only by the logarithm:

    >>> lives = mean_life(np.array([0.0, 1e-8, 1e-6]), RuptureRate(1.0, 1e9, math.inf))
    >>> print("%.4f %.4f %.4f" % tuple(lives))
    1.0000 0.2015 0.0063
    """
    return np.array([_mean_life(abs(v), rupture) for v in np.atleast_1d(speed).tolist()])


def _mean_life(speed: float, rupture: RuptureRate) -> float:
    rate, softness, limit, *_ = rupture
    pace, longest = speed * softness, limit / speed if speed > 0.0 else math.inf
    if rate == 0.0:
        return longest
    if pace < 1e-16 * rate:
        return -math.expm1(-rate * longest) / rate
    z = max(rate / pace, 5e-324)
    if longest == math.inf and z > 1.0:
        return float(reduced_exponential_integral(z, 0.0)) / rate
    if longest == math.inf:
        return float(scaled_exponential_integral(z, 0.0)) / pace
    end = min(longest, math.log1p(40.0 / z) / pace)  # where e^-40 are left
    edges = np.linspace(0.0, end, 33)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    age = edges[:-1, np.newaxis] + 0.5 * edges[1] * (nodes + 1.0)
    return float(0.5 * edges[1] * np.sum(weights * np.exp(-z * np.expm1(pace * age))))


def _steady_share(age: Array, speed: Array, rebinding_rate: float) -> Array:
    """Chance that a site is bound, ⟨T⟩/(⟨T⟩ + 1/k_on); 1 for bonds that never break and rest."""
    if np.any(np.isinf(age) & (speed != 0.0)):
        raise ValueError("bonds that never break have no stationary stretch: start from bonded or empty")
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(np.isinf(age), 1.0, rebinding_rate * age / (rebinding_rate * age + 1.0))


def _draw(tracks, chosen, begin, speed, rupture, rebinding_rate, seed, members) -> None:
    """Draw the chosen members anew, in place, as a run may begin."""
    age, rest = np.zeros(1), 1.0 if rupture.rate == 0.0 else rebinding_rate / (rebinding_rate + rupture.rate)
    share = np.array([rest if begin == "bonded" else 0.0])
    if begin == "steady":
        age = mean_life(speed, rupture)
        share = _steady_share(age, speed, rebinding_rate)
    laws = (*rupture[:3], rebinding_rate)
    members = np.asarray(members, dtype=np.uint64)
    draw(tuple(tracks), chosen, speed, share, np.where(np.isinf(age), 0.0, age), *laws, seed, members)
