"""The solver of the contact radius against fifty digits, over mounts, works of adhesion, tilts, and shares on a disc.

Units: R = 1 and E* = 1/2, so that 1/C = a and the square of the missing depth is 4 pi a times the energy release rate.
Each state begins with its radius, for which load and displacement are closed. They are rounded, and Newton's method in
fifty digits finds the radius that belongs to them. Tolerances: u = 2^-53. The two sides of the balance have some ten
roundings. These move the radius by their size over the difference of the slopes, ``amplification``. It is of order 1,
and 1/sqrt(d) at a relative distance d from the fold.
"""

import itertools
import math

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.laws.equilibrium import largest_radius
from sim.parts.contact.balance import stable_radius

U = 2.0**-53
BODY = 1.0, 0.5, 0.0
STIFFNESSES = [0.0, 1e-3, 1.0, 1e3, 1e9, math.inf]
#: Share of ΔΓ on a disc: 3s² - 2s³ of s = ln(a/low)/span, as one cubic.
LOW, SPAN = 1e-3, math.log(1e5)
SHARE = (
    (0.0, 0.0, 0.0),
    (LOW, math.log(LOW), 1.0 / SPAN),
    np.array([[-2.0, 3.0, 0.0, 0.0]]),
)


def share_at(a):
    s = mpmath.log(a / LOW) / mpmath.mpf(SPAN)
    return s * s * (3 - 2 * s)


class State:
    """A contact in fifty digits, of a work of adhesion ``w - f share(a) - t a`` behind a stiffness k."""

    def __init__(self, work, fluctuating, tilt, stiffness):
        self.work, self.fluctuating, self.tilt, self.stiffness = map(
            mpmath.mpf, (work, fluctuating, tilt, stiffness)
        )

    def left(self, a):
        return self.work - self.fluctuating * share_at(a) - self.tilt * a

    def push(self, a):
        """Load at a stiffness of zero, else displacement, at which a radius balances, if it can; else of Hertz."""
        missing = mpmath.sqrt(4 * mpmath.pi * a * max(self.left(a), 0))
        load, depth = 2 * a**3 / 3 - a * missing, a**2 - missing
        if self.stiffness == 0:
            return load
        return depth + load / self.stiffness

    def missing(self, a, push):
        """Depth that a contact lacks to Hertz's of its radius, and the size of its terms."""
        hertz, k = 2 * a**3 / 3, self.stiffness
        if k == 0:
            return (hertz - push) / a, (hertz + abs(push)) / a
        if mpmath.isinf(k):
            return a**2 - push, a**2 + abs(push)
        size = k * (a**2 + abs(push)) + hertz
        return (k * (a**2 - push) + hertz) / (k + a), size / (k + a)

    def over(self, a, push):
        """Energy release rate, negative below Hertz's radius, less the work left."""
        missing, _ = self.missing(a, push)
        return missing * abs(missing) / (4 * mpmath.pi * a) - self.left(a)

    def slope(self, a, push):
        return mpmath.diff(lambda x: self.over(x, push), a)

    def amplification(self, a, push):
        """Change of the radius over that of the two sides, both relative."""
        missing, size = self.missing(a, push)
        sides = abs(missing) * size / (2 * mpmath.pi * a)
        sides += abs(self.work) + self.fluctuating * share_at(a) + self.tilt * a
        return float(sides / (a * self.slope(a, push)))

    def fold(self):
        """Radius of the last stable contact: that of the lowest load or displacement."""
        low, high = mpmath.mpf("1e-3"), mpmath.mpf(100)
        if self.tilt > 0:
            high = min(high, self.work / self.tilt * (1 - mpmath.mpf("1e-30")))
        for _ in range(160):
            middle = mpmath.sqrt(low * high)
            rises = self.push(middle * (1 + mpmath.mpf("1e-25"))) > self.push(middle)
            low, high = (low, middle) if rises else (middle, high)
        return high

    def solved(self, start):
        """Radius by the solver, and the slope it returns."""
        push = self.rounded
        load, base = (push, 0.0) if self.stiffness == 0 else (0.0, push)
        mount = load, base, float(self.stiffness)
        work, tilt = float(self.work), float(self.tilt)
        if self.fluctuating == 0:
            return largest_radius(start, work, tilt, mount, BODY)
        works = work, work, float(self.fluctuating), tilt
        return stable_radius(start, works, mount, BODY, SHARE), math.nan

    def check(self, a, starts=(1e-2, 0.7, 30.0)):
        """Compare the radius near ``a`` in balance with the solver's, from several starts."""
        self.rounded = float(self.push(a))
        push = mpmath.mpf(self.rounded)
        exact = a
        for _ in range(40):
            exact -= self.over(exact, push) / self.slope(exact, push)
        room = 12.0 * U * (1.0 + self.amplification(exact, push))
        assert room < 1e-4, "the state is no test"
        for start in starts:
            radius, slope = self.solved(start)
            assert abs(radius / exact - 1) <= room, (start, radius, exact)
            if not math.isnan(slope):
                # the slope is that before the last step, which is 1e-14 at most
                expected = float(self.slope(exact, push))
                bend = float(mpmath.diff(lambda x: self.over(x, push), exact, 2))
                moves = 1.0 + abs(exact * bend / expected)
                assert abs(slope / expected - 1.0) <= moves * (room + 1e-14)


@pytest.fixture(autouse=True)
def fifty_digits():
    with mpmath.workdps(50):
        yield


@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_a_radius_is_that_of_fifty_digits_from_far_inside_to_the_fold(stiffness):
    for work, reach in itertools.product([1e-6, 1.0], [0.0, 1e-3, 0.3, 3.0]):
        # adhesion pays all of its work at 1/reach of the radius without load
        state = State(work, 0.0, reach * work ** (2 / 3) / 3.0, stiffness)
        fold = state.fold()
        for beyond in [1e-6, 1e-3, 0.1, 1.0, 10.0]:
            a = fold * (1 + mpmath.mpf(beyond))
            if state.left(a) > 0:
                state.check(a)
        at_fold = state.push(fold)
        if at_fold < 0:
            state.rounded = float(at_fold * (1 + mpmath.mpf("1e-9")))
            for start in (1e-2, 0.7, 30.0):
                assert math.isnan(state.solved(start)[0])


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize(
    ("work", "tilt"), [(-1.0, 0.0), (0.0, 0.0), (-1.0, 1.0), (0.0, 1.0), (1.0, 3.0)]
)
def test_a_contact_without_adhesion_left_is_hertzian_if_pressed_and_open_if_pulled(
    stiffness, work, tilt
):
    state = State(work, 0.0, tilt, stiffness)
    for a in (0.4, 1.0, 7.0):
        state.rounded = float(state.push(mpmath.mpf(a)))
        for start in (1e-2, 0.7, 30.0):
            radius, slope = state.solved(start)
            assert_allclose(radius, a, rtol=12 * U, atol=0)
            assert slope == math.inf
    if work <= 0.0:
        state.rounded = 0.0
        assert state.solved(1.0) == (0.0, math.inf)
        state.rounded = -1e-300
        assert math.isnan(state.solved(1.0)[0])


@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_a_radius_on_a_disc_is_that_of_fifty_digits_and_no_wider_one_balances(
    stiffness,
):
    checked = 0
    for fluctuating, tilt in itertools.product([1e-6, 0.5, 1.5], [0.0, 0.05]):
        state = State(1.0, fluctuating, tilt, stiffness)
        for radius in (0.3, 1.0, 3.0, 8.0):
            a = mpmath.mpf(radius)
            push = state.push(a)
            wider = [a * mpmath.mpf(10) ** (0.005 * k) for k in range(1, 200)]
            if state.left(a) <= 0 or state.slope(a, push) <= 0:
                continue
            if all(state.over(x, push) > 0 for x in wider):
                state.check(a)
                checked += 1
    assert checked >= 9


@pytest.mark.parametrize("stiffness", [0.0, 1e3, math.inf])
def test_an_equilibrium_is_found_again_from_itself_to_the_last_bit(stiffness):
    # else a slider at its strength would stick and slip for ever, by one rounding of its area
    draws, lens = np.random.default_rng(0), (500.0, 6.4e6, 0.0)
    for _ in range(1000):
        push, work, start = draws.uniform(), draws.uniform(), 1e-3 * draws.uniform()
        mount = (
            (4e-2 * push, 0.0, 0.0)
            if stiffness == 0.0
            else (0.0, 1e-4 * push, stiffness)
        )
        radius, _ = largest_radius(start, work, 0.0, mount, lens)
        assert largest_radius(radius, work, 0.0, mount, lens)[0] == radius
