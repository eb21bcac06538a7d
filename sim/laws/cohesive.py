"""Contact of a sphere with an elastic half-space whose adhesion has a finite range: Maugis & Dugdale.

The surfaces touch within the inner radius a. Around it, up to the outer radius c, they attract each other with the
constant stress sigma, the *cohesive stress*, as long as the gap between them is below the *reach* ``H = w/sigma``.
Beyond the reach they do not feel each other. With R and E* as in ``sim.laws.jkr``, ``cos t = a/c`` and t from 0 to
pi/2 (Maugis 1992, with a and c in place of his m = c/a)

    ``H = c^2 A(t)/(pi R) + 4 sigma c B(t)/(pi E*)``,  ``A = sin(2t)/2 - t cos 2t``,  ``B = t sin t + cos t - 1``
    ``P = 4 E* a^3/(3R) - 2 sigma c^2 (t + sin t cos t)``
    ``delta = a^2/R - (2 sigma/E*) c sin t``

The first is the gap at c. For a given t it is a quadratic equation of c, so that the whole *branch* of equilibria has a
closed form in t. It is even in pi/2 - t, so that functions of ``v = cot^2 t = a^2/(c^2 - a^2)`` have no root at a = 0.

**Without contact.** The branch does not end at a = 0, where v = 0 and c = c_0. The surfaces there are parallel, as it
were, over c, and go on to attract each other although they do not touch (Kim, McMeeking & Johnson 1998):

    ``P = -pi sigma c^2``,  ``-delta = H + 4 sigma c/(pi E*) - c^2/(2R)``  for c from c_0 to 0

Load and indentation as functions of c have continuous slopes at c_0. The branch ends at c = 0, in the free sphere at
the distance H. A sphere that comes nearer than that jumps in, because the branch near c = 0 is unstable behind any
mount.

**Energy.** The energy of the half-space and of the interface, 0 for a free sphere, has the slope P over delta along the
branch. With ``x = cos t`` and ``y = sin t``

    ``U = (2/5) p_3 x^2 c^5/R - (p_3 q + 2 p_2 x^2/R) c^4/4 + p_2 q c^3/3 + sigma A c^4/(2R) + 8 sigma^2 B c^3/(3E*)
    - pi w c^2``,  ``p_3 = 4 E* x^3/(3R)``, ``p_2 = 2 sigma (t + x y)``, ``q = 2 sigma y/E*``

and without contact ``U = (4/3) sigma^2 c^3/E* - pi sigma c^4/(4R)``.

**Mount.** The sphere is under a load P, or behind a stiffness k whose base has the displacement
``Delta = delta + P/k``. P and Delta have one minimum each over v and c, the *fold*. The equilibrium is stable on the
side of the wider contacts. There P and Delta are convex in v, so that Newton's method from the right goes left and
never passes the equilibrium. Both facts were found by computing: there is no proof of them here, but a test over all
ranges and stiffnesses. If the slope at v = 0 is positive, the fold lies on the branch without contact, where it is
that of a parabola.

**Limits.** The number ``lambda = sigma (9R/(2 pi w E*^2))^(1/3)`` tells how the range compares with the stretch of the
edge. For large lambda the contact is JKR's but for a relative difference of about lambda^(-2). For small lambda it is
that of Derjaguin, Muller & Toporov, Hertz's under the load and 2 pi w R, but for one of about lambda. Below
lambda = 0.938 the fold under a displacement is on the branch without contact.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.laws import halfspace
from sim.numerics.jit import device, kernel, law
from sim.numerics.special import cube_root

#: Largest stress of a Lennard-Jones attraction times its equilibrium distance, over the work of adhesion: 16/(9 √3).
LENNARD_JONES = 16.0 / (9.0 * math.sqrt(3.0))
#: Angle 2t below which A(t) is summed as a series, and its terms.
_SERIES_BELOW, _TERMS = 1.0, 10
#: Change of v over it below which Newton's next step, its square, is below rounding; most steps; halvings of a fold.
_CLOSE, _MOST, _HALVINGS = 1e-14, 200, 200
#: Range of v in which a fold is looked for.
_LEAST, _LARGEST = 1e-40, 1e40


class Touch(NamedTuple):
    """Stable contacts, or folds, each array of the shape of the arguments and nan where there is none.

    Attributes
    ----------
    inner, outer : array
        Radius a within which the surfaces touch, and radius c within which they attract each other [m].
    load, indentation : array
        P [N] and delta [m].
    energy : array
        Energy of half-space and interface, above that of a free sphere far away [J].
    """

    inner: NDArray[np.float64]
    outer: NDArray[np.float64]
    load: NDArray[np.float64]
    indentation: NDArray[np.float64]
    energy: NDArray[np.float64]


# Scales of a contact.


@law
def maugis_number(work, stress, sphere_radius, modulus):
    """Return Maugis's number lambda of a contact [1], by which its range is compared with the stretch of its edge.

    Parameters
    ----------
    work, stress, sphere_radius, modulus : float or array
        w [J/m^2], sigma [Pa], R [m], E* [Pa].

    Notes
    -----
    ``sigma (9R/(2 pi w E*^2))^(1/3)``; 1.157 times the Tabor number if sigma is ``stress_of_range``.

    Examples
    --------
    A tip of an atomic force microscope lies between the limits:

    >>> print(f"{maugis_number(0.4, stress_of_range(0.4, 0.3e-9), 1e-7, 4.65e10):.2f}")
    0.75
    """
    return stress * cube_root(
        4.5 / math.pi * (sphere_radius / work / modulus / modulus)
    )


@law
def stress_of_range(work, distance):
    """Return the cohesive stress of an attraction with an equilibrium distance z0 [Pa]: ``16/(9 sqrt 3) w/z0``.

    It is the largest stress of a Lennard-Jones attraction of two half-spaces.

    Parameters
    ----------
    work, distance : float or array
        w [J/m^2], z0 [m].

    Examples
    --------
    >>> print(f"{stress_of_range(0.05, 0.3e-9):.2e}")
    1.71e+08
    """
    return 16.0 / (9.0 * math.sqrt(3.0)) * work / distance


# The branch of equilibria. ``adhesion``: reach H [m], cohesive stress [Pa], R [m] and E* [Pa].


@device
def _gap_terms(angle, cosine, sine):
    """Return A and B of the gap at an angle t."""
    double = 2.0 * angle
    if double < _SERIES_BELOW:
        # (sin 2t - 2t cos 2t)/2, the sum of (-1)^n (2t)^(2n + 3) (2n + 2)/(2 (2n + 3)!)
        square, term, level = double * double, double**3 / 6.0, 0.0
        for n in range(_TERMS):
            level += term
            term *= -square / ((2.0 * n + 2.0) * (2.0 * n + 5.0))
    else:
        level = sine * cosine - angle * (cosine - sine) * (cosine + sine)
    half = math.sin(0.5 * angle)
    return level, angle * sine - 2.0 * half * half


@device
def _touching(v, adhesion):
    """Return a, c, load and indentation of the contact with ``v``, and the slopes of the last two over v."""
    reach, stress, sphere_radius, modulus = adhesion
    angle = math.atan2(1.0, math.sqrt(v))
    sine = 1.0 / math.sqrt(1.0 + v)
    cosine = math.sqrt(v) * sine
    level, bend = _gap_terms(angle, cosine, sine)
    square = level / (math.pi * sphere_radius)
    line = 4.0 * stress * bend / (math.pi * modulus)
    c = 2.0 * reach / (line + math.sqrt(line * line + 4.0 * square * reach))
    a = c * cosine
    pull = angle + sine * cosine
    hertz, opening = a * a / sphere_radius, 2.0 * stress / modulus
    load = 4.0 / 3.0 * modulus * a * hertz - 2.0 * stress * c * c * pull
    depth = hertz - opening * c * sine
    # slope of c over t, over cos t
    growth = -4.0 * angle * c / math.pi
    growth *= c * sine / sphere_radius + stress / modulus
    growth /= 2.0 * c * square + line
    closing = c / sphere_radius * (growth * cosine * cosine - c * sine)
    load_slope = 4.0 * modulus * a * closing
    load_slope -= 4.0 * stress * c * (growth * pull + c * cosine)
    depth_slope = 2.0 * closing - opening * (growth * sine + c)
    turn = -0.5 * sine**3
    return a, c, load, depth, turn * load_slope, turn * depth_slope


@device
def _energy(a, c, v, adhesion):
    """Return the energy of a contact of radii a and c, and ``v``."""
    reach, stress, sphere_radius, modulus = adhesion
    if a == 0.0:
        cube = c * c * c
        bulk = 4.0 / 3.0 * stress * cube * (stress / modulus)
        return bulk - 0.25 * math.pi * stress * cube * (c / sphere_radius)
    angle = math.atan2(1.0, math.sqrt(v))
    sine = 1.0 / math.sqrt(1.0 + v)
    cosine = math.sqrt(v) * sine
    level, bend = _gap_terms(angle, cosine, sine)
    hertz, opening = a * a / sphere_radius, 2.0 * stress / modulus * c * sine
    pressed = 4.0 / 3.0 * modulus * a * hertz
    pulled = 2.0 * stress * c * c * (angle + sine * cosine)
    energy = 0.4 * pressed * hertz - 0.25 * pressed * opening - 0.5 * pulled * hertz
    energy += pulled * opening / 3.0
    energy += stress * c * c * (0.5 * level * (c / sphere_radius) * c)
    energy += 8.0 / 3.0 * bend * stress * c * c * (stress / modulus * c)
    return energy - math.pi * stress * reach * c * c


@device
def _apart(c, adhesion):
    """Return load and indentation of a sphere that is attracted over a radius c without contact."""
    reach, stress, sphere_radius, modulus = adhesion
    attracted = 4.0 * stress / (math.pi * modulus) * c - 0.5 * c * (c / sphere_radius)
    return -math.pi * stress * c * c, -reach - attracted


@device
def _bare(mount, sphere_radius, modulus):
    """Return the radius of a contact without adhesion, nan if it is pulled."""
    load, base, spring = mount
    if not spring > 0.0:
        return cube_root(0.75 * load * (sphere_radius / modulus))
    if not base >= 0.0:
        return math.nan
    # convex, and the start is on the right
    a = math.sqrt(base * sphere_radius)
    rigid = 4.0 / 3.0 * modulus / spring
    for _ in range(_MOST):
        square = a * a / sphere_radius
        over = square + rigid * a * square - base
        slope = (2.0 * a + 3.0 * rigid * a * a) / sphere_radius
        if not over > 1e-15 * base:
            break
        a -= over / slope
    return a


@device
def _first_guess(mount, adhesion):
    """Return a guess of ``v``: a from Hertz's contact and JKR's without a load, c by the least of three estimates."""
    reach, stress, sphere_radius, modulus = adhesion
    load, base, spring = mount
    a = cube_root(4.5 * math.pi * stress * reach * sphere_radius**2 / modulus)
    if not spring > 0.0:
        a += cube_root(0.75 * max(load, 0.0) * (sphere_radius / modulus))
    elif base > 0.0:
        soft = cube_root(0.75 * sphere_radius * base * (spring / modulus))
        a += min(math.sqrt(base * sphere_radius), soft)
    free = 2.0 * sphere_radius * reach
    annulus = cube_root(0.75 * math.pi * sphere_radius * reach * a)
    stretch = 0.5 * math.pi * modulus * reach * (a / stress)
    return a * a / min(free, annulus * annulus, stretch)


@device
def _pushed(v, mount, adhesion):
    """Return the load or the displacement of the base that holds the contact with ``v``, and its slope over v."""
    _, _, load, depth, load_slope, depth_slope = _touching(v, adhesion)
    spring = mount[2]
    if not spring > 0.0:
        return load, load_slope
    return depth + load / spring, depth_slope + load_slope / spring


@device
def _parabola(spring, adhesion):
    """Return ``l`` and ``s`` of the displacement of the base without contact, ``-H - l c + s c^2``."""
    _, stress, sphere_radius, modulus = adhesion
    line = 4.0 * stress / (math.pi * modulus)
    return line, 0.5 / sphere_radius - math.pi * stress / spring


@device
def _stable(mount, adhesion):
    """Return v and c of the stable contact, nan without one; v is 0 without contact."""
    load, base, spring = mount
    at_load = not spring > 0.0
    target = load if at_load else base
    level, slope = _pushed(0.0, mount, adhesion)
    if slope >= 0.0 and target < level:
        line, square = _parabola(spring, adhesion)
        left = line * line + 4.0 * square * (base + adhesion[0])
        if not left >= 0.0:
            return math.nan, math.nan
        return 0.0, 0.5 * (line + math.sqrt(left)) / square
    v, is_right = _first_guess(mount, adhesion), False
    for _ in range(_MOST):
        level, slope = _pushed(v, mount, adhesion)
        over = level - target
        if not (slope > 0.0 and abs(over) < math.inf):
            if is_right or not v < math.inf:
                return math.nan, math.nan
            v *= 4.0
            continue
        if is_right and over <= 0.0:
            break
        is_right = over > 0.0
        change = over / slope
        # rounding alone can pass v = 0
        v = v - change if change < v else 0.25 * v
        if abs(change) <= _CLOSE * v:
            break
    else:
        return math.nan, math.nan
    return v, _touching(v, adhesion)[1]


@device
def _at(v, c, adhesion):
    """Return a, c, load, indentation and energy of the contact with ``v``, or with c alone if v is 0."""
    if v > 0.0:
        a, c, load, depth, _, _ = _touching(v, adhesion)
    elif v == 0.0:
        a, (load, depth) = 0.0, _apart(c, adhesion)
    else:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    return a, c, load, depth, _energy(a, c, v, adhesion)


@kernel("void(float64[:, ::1], float64[:, ::1])")
def _solve(rows, result):
    """Write the stable contact of each column of ``rows``: load, base, stiffness, w, sigma, R and E*."""
    for i in range(rows.shape[1]):
        mount = rows[0, i], rows[1, i], rows[2, i]
        work, stress, sphere_radius, modulus = (
            rows[3, i],
            rows[4, i],
            rows[5, i],
            rows[6, i],
        )
        if work > 0.0:
            adhesion = work / stress, stress, sphere_radius, modulus
            v, c = _stable(mount, adhesion)
            state = _at(v, c, adhesion)
        elif work <= 0.0:
            a = _bare(mount, sphere_radius, modulus)
            hertz = a * a / sphere_radius
            load = 4.0 / 3.0 * modulus * a * hertz
            state = a, a, load, hertz, 0.4 * load * hertz
        else:
            state = math.nan, math.nan, math.nan, math.nan, math.nan
        for k in range(5):
            result[k, i] = state[k]


@kernel("void(float64[:, ::1], float64[:, ::1])")
def _solve_fold(rows, result):
    """Write the fold of each column of ``rows``: stiffness, 0 under a load, w, sigma, R and E*."""
    for i in range(rows.shape[1]):
        mount, work, stress = (0.0, 0.0, rows[0, i]), rows[1, i], rows[2, i]
        adhesion = work / stress, stress, rows[3, i], rows[4, i]
        v, c = math.nan, math.nan
        if work > 0.0 and _pushed(0.0, mount, adhesion)[1] >= 0.0:
            line, square = _parabola(mount[2], adhesion)
            v, c = 0.0, 0.5 * line / square
        elif work > 0.0:
            low, high = _LEAST, _LARGEST
            for _ in range(_HALVINGS):
                v = math.sqrt(low) * math.sqrt(high)
                if not low < v < high:
                    break
                if _pushed(v, mount, adhesion)[1] > 0.0:
                    high = v
                else:
                    low = v
            v = high
        state = _at(v, c, adhesion)
        for k in range(5):
            result[k, i] = state[k]


@kernel("void(float64[:, ::1], float64[:, ::1])")
def _solve_branch(rows, result):
    """Write the contact of each column of ``rows``: v, w, sigma, R and E*."""
    for i in range(rows.shape[1]):
        stress = rows[2, i]
        adhesion = rows[1, i] / stress, stress, rows[3, i], rows[4, i]
        a, c, load, depth, _, _ = _touching(rows[0, i], adhesion)
        energy = _energy(a, c, rows[0, i], adhesion)
        result[0, i], result[1, i], result[2, i] = a, c, load
        result[3, i], result[4, i] = depth, energy


def _states(solve, *arguments):
    """Return the contacts that a kernel finds for arguments that broadcast."""
    rows = np.ascontiguousarray(np.broadcast_arrays(*arguments), dtype=float)
    result = np.empty((len(Touch._fields), *rows.shape[1:]))
    solve(rows.reshape(len(rows), -1), result.reshape(len(result), -1))
    return Touch(*(values[()] for values in result))


def equilibrium(load, base, stiffness, work, stress, sphere_radius, modulus):
    """Return the stable contact under a load, or at a displacement of the base behind a stiffness.

    Parameters
    ----------
    load, base, stiffness : float or array
        P [N] with a stiffness of 0, or Delta [m] behind a stiffness k [N/m], which may be inf, with a load of 0.
    work, stress : float or array
        w [J/m^2] and sigma [Pa].
    sphere_radius, modulus : float or array
        R [m], E* [Pa].

    Returns
    -------
    Touch
        nan beyond the fold. The inner radius is 0 if the sphere is attracted without contact. Hertz's contact where
        w <= 0.

    Examples
    --------
    A tip without a load, by three ranges; JKR's radius is the limit of a short one:

    >>> from sim.laws import jkr
    >>> ranges = [1e-9, 1e-10, 1e-11]
    >>> tip = equilibrium(0.0, 0.0, 0.0, 0.4, stress_of_range(0.4, ranges), 1e-7, 4.65e10)
    >>> print(*(f"{1e9 * a:.3f}" for a in tip.inner), f"{1e9 * jkr.radius_at_load(0.0, 0.4, 1e-7, 4.65e10):.3f}")
    8.265 10.283 10.669 10.674
    """
    return _states(_solve, load, base, stiffness, work, stress, sphere_radius, modulus)


def pull_off(stiffness, work, stress, sphere_radius, modulus):
    """Return the fold of the branch, at which a contact behind a stiffness is lost; nan where w <= 0.

    Parameters
    ----------
    stiffness : float or array
        k [N/m]; 0 for a contact under a load, inf for one at an indentation.
    work, stress, sphere_radius, modulus : float or array
        w [J/m^2], sigma [Pa], R [m], E* [Pa].

    Returns
    -------
    Touch
        The last contact.

    Examples
    --------
    The pull-off load over pi w R is between 2, of a long range, and JKR's 3/2:

    >>> lost = pull_off(0.0, 1.0, [0.01, 0.3, 100.0], 1.0, 1.0)
    >>> print(*(f"{load / np.pi:.3f}" for load in lost.load))
    -1.998 -1.794 -1.500
    """
    return _states(_solve_fold, stiffness, work, stress, sphere_radius, modulus)


def branch(opening, work, stress, sphere_radius, modulus):
    """Return equilibria with contact, stable and unstable.

    Parameters
    ----------
    opening : float or array
        ``v = a^2/(c^2 - a^2)`` [1], at least 0; large values are wide contacts.
    work, stress, sphere_radius, modulus : float or array
        w [J/m^2], sigma [Pa], R [m], E* [Pa].

    Examples
    --------
    >>> contact = branch(1.0, 1.0, 1.0, 1.0, 1.0)
    >>> print(f"{contact.inner / contact.outer:.4f}")
    0.7071
    """
    return _states(_solve_branch, opening, work, stress, sphere_radius, modulus)


def normal_displacement(r, touch, stress, sphere_radius, modulus):
    """Return the displacement of the surface of the half-space along the normal, into it.

    Parameters
    ----------
    r : float or array
        Distance from the axis [m].
    touch : Touch
        One contact; the surfaces may be apart.
    stress, sphere_radius, modulus : float
        sigma [Pa], R [m], E* [Pa].

    Returns
    -------
    array
        u_z [m]; below 0 the surface is raised.

    Notes
    -----
    ``u_z = (2/pi) int f(s)/sqrt(r^2 - s^2) ds`` over s from 0 to r or c, where f is that of Hertz's contact,
    ``delta - s^2/R``, below a, and that of a uniform tension, ``-(2 sigma/E*) sqrt(c^2 - s^2)``, from a to c. Both are
    equal at a, which is the equation of delta. The second integral is one of Gauss's with 64 nodes.

    Examples
    --------
    The gap at the outer radius is the reach of the attraction, here 1:

    >>> contact = equilibrium(0.0, -0.1, math.inf, 1.0, 1.0, 1.0, 1.0)
    >>> raised = -normal_displacement(contact.outer, contact, 1.0, 1.0, 1.0)
    >>> print(f"{contact.outer**2 / 2.0 + 0.1 - raised:.6f}")
    1.000000
    """
    r = np.maximum(np.asarray(r, dtype=float), 1e-300)[..., np.newaxis]
    nodes, weights = np.polynomial.legendre.leggauss(64)
    a, c = touch.inner, touch.outer
    far = np.maximum(r, c)
    # s = min(r, c) sin(angle), from the edge of the contact on
    size = np.minimum(r, c)
    start = np.arcsin(np.minimum(a / size, 1.0))
    half = 0.5 * (0.5 * math.pi - start)
    angle = start + half * (1.0 + nodes)
    along = size * np.sin(angle)
    inside = np.sqrt(np.maximum((c - along) * (c + along), 0.0))
    beyond = size * np.cos(angle) / np.sqrt((far - along) * (far + along))
    pulled = np.where(r > c, inside * beyond, inside)
    pulled = 2.0 * stress / modulus * np.sum(half * weights * pulled, axis=-1)
    pressed = halfspace.normal_displacement(r, a, touch.indentation, sphere_radius)
    return pressed[..., 0] - 2.0 / math.pi * pulled
