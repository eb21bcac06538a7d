"""Bond populations as a user of numpy would step them: clear, vectorised, without waste."""

import math

import numba
import numpy as np
from scipy.integrate import solve_ivp


class TrackedNumpy:
    """Bonds under Bell's rupture in fixed steps of steady sliding: in each, a bond may break and a free site bind.

    Second order in the step. A bond breaks if an exponential number is below its rupture integrated over the step. The
    rest of the step its site is free. A site may bind there, and such a young bond may break.
    """

    def __init__(self, shape, rate, softness, rebinding_rate, random):
        self.rate, self.softness, self.rebinding_rate, self.random = (
            rate,
            softness,
            rebinding_rate,
            random,
        )
        self.stretch, self.bound = np.zeros(shape), np.zeros(shape, bool)

    def step(self, slip, duration):
        """Advance by one step, and return the share of sites bound and the mean stretch per site."""
        first, later, last = self.random.standard_exponential((3, *self.stretch.shape))
        rise = self.softness * slip
        rupture = (
            self.rate
            * duration
            * np.expm1(rise)
            / rise
            * np.exp(self.softness * self.stretch)
        )
        breaks = self.bound & (first < rupture)
        # share of the step
        free = np.where(self.bound, np.where(breaks, 1.0 - first / rupture, 0.0), 1.0)
        age = free - later / (self.rebinding_rate * duration)
        binds = (age > 0.0) & (last > self.rate * duration * age)
        self.stretch = np.where(
            binds, slip * age, (self.stretch + slip) * (self.bound & ~breaks)
        )
        self.bound = (self.bound & ~breaks) | binds
        return self.bound.mean(), self.stretch.mean()


@numba.njit(cache=True)
def binomials(members, steps, sites, stay, bind, random):
    """Numbers of bound sites in steps, by numba's binomial numbers."""
    bound = np.full(members, sites // 2)
    for _ in range(steps):
        for m in range(members):
            bound[m] = random.binomial(bound[m], stay) + random.binomial(
                sites - bound[m], bind
            )
    return bound


@numba.njit(cache=True)
def renewal(outputs, step, speed, sites, rate, softness, rebinding_rate, random):
    """Bonds under Bell's rupture in steady sliding, one after the other and life by life: exact, compiled.

    A life ends where its integrated rupture k0 (e^(gt) − 1)/g, g = softness × speed, reaches an exponential number.
    """
    sums, growth, end = np.zeros((outputs, 3)), softness * speed, outputs * step
    for _ in range(sites):
        birth = random.standard_exponential() / rebinding_rate
        while birth < end:
            life = math.log1p(random.standard_exponential() * growth / rate) / growth
            for k in range(int(birth / step), min(int((birth + life) / step), outputs)):
                stretch = speed * ((k + 1) * step - birth)
                sums[k, 0] += 1.0
                sums[k, 1] += stretch
                sums[k, 2] += stretch * stretch
            birth += life + random.standard_exponential() / rebinding_rate
    return sums


@numba.njit(cache=True)
def renewal_in_steps(edges, speeds, sites, rate, softness, rebinding_rate, random):
    """Bonds as in ``renewal``, under any motion forwards in steps of constant speed, by one clock for all bonds."""
    sums, (x, clock, grown), paces = (
        np.zeros((speeds.size, 3)),
        np.zeros((3, edges.size)),
        softness * speeds,
    )
    for k in range(speeds.size):
        grown[k], span = rate * math.exp(softness * x[k]), edges[k + 1] - edges[k]
        x[k + 1], clock[k + 1] = (
            x[k] + speeds[k] * span,
            clock[k] + grown[k] * math.expm1(paces[k] * span) / paces[k],
        )
    for _ in range(sites):
        time, k = random.standard_exponential() / rebinding_rate, 0
        while time < edges[-1]:
            while edges[k + 1] <= time:
                k += 1
            after = time - edges[k]
            birth, now = (
                x[k] + speeds[k] * after,
                clock[k] + grown[k] * math.expm1(paces[k] * after) / paces[k],
            )
            due = now + random.standard_exponential() * math.exp(softness * birth)
            while k < speeds.size and clock[k + 1] <= due:
                stretch = x[k + 1] - birth
                sums[k, 0] += 1.0
                sums[k, 1] += stretch
                sums[k, 2] += stretch * stretch
                k += 1
            if k == speeds.size:
                break
            life = math.log1p((due - clock[k]) * paces[k] / grown[k]) / paces[k]
            time = edges[k] + life + random.standard_exponential() / rebinding_rate
    return sums


@numba.njit(cache=True)
def slopes(time, state, body, rates):
    """Slopes of position, speed, bound share and sum of stretches of a slider on bonds under Bell's rupture.

    ``body`` holds stiffness, speed of the stage, mass and damping over those of all sites, in Bell's stretches and
    lives at rest. Rebinding is as fast as rupture at rest. Without mass the balance of forces gives the sum of
    stretches, and its time derivative the speed.
    """
    stiffness, stage, mass, damping = body
    position, speed, bound, moment = state
    if mass == 0.0:
        moment = stiffness * (stage * time - position)
    rupture = math.exp(abs(moment) / bound)
    if mass == 0.0:
        speed = (stiffness * stage + rupture * moment) / (stiffness + bound)
    rates[0], rates[2] = speed, 1.0 - bound - rupture * bound
    rates[1] = (
        (stiffness * (stage * time - position) - damping * speed - moment) / mass
        if mass > 0.0
        else 0.0
    )
    rates[3] = speed * bound - rupture * moment


def by_scipy(method, tolerance, times, body):
    """Positions of a slider at some times, by scipy's ``solve_ivp`` with compiled slopes."""

    def of(time, state):
        rates = np.empty(4)
        slopes(time, state, body, rates)
        return rates

    tolerances = {"rtol": tolerance, "atol": 0.1 * tolerance}
    return solve_ivp(
        of, times[[0, -1]], [0.0, 0.0, 1.0, 0.0], method, t_eval=times, **tolerances
    ).y[0]


_A = np.zeros((7, 6))
_A[1, :1] = 1 / 5
_A[2, :2] = 3 / 40, 9 / 40
_A[3, :3] = 44 / 45, -56 / 15, 32 / 9
_A[4, :4] = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
_A[5, :5] = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
_A[6] = 35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
_C = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
_E = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
)


@numba.njit(cache=True)
def dormand_prince(tolerance, times, body):
    """Positions of a slider at some times, by the explicit pair of Dormand and Prince, compiled."""
    state, rates, trial = np.array([0.0, 0.0, 1.0, 0.0]), np.zeros((7, 4)), np.empty(4)
    positions, time, step = np.zeros(times.size), times[0], 1e-4
    slopes(time, state, body, rates[0])
    for k in range(1, times.size):
        while time < times[k]:
            last = time + step >= times[k]
            taken = times[k] - time if last else step
            for stage in range(1, 7):
                trial[:] = state
                for j in range(stage):
                    trial += taken * _A[stage, j] * rates[j]
                slopes(time + _C[stage] * taken, trial, body, rates[stage])
            error = 0.0
            for i in range(4):
                off = 0.0
                for j in range(7):
                    off += taken * _E[j] * rates[j, i]
                error = max(
                    error,
                    abs(off) / (tolerance * (0.1 + max(abs(state[i]), abs(trial[i])))),
                )
            step = taken * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
            if error <= 1.0:
                time, state[:], rates[0] = (
                    times[k] if last else time + taken,
                    trial,
                    rates[6],
                )
        positions[k] = state[0]
    return positions
