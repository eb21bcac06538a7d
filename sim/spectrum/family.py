"""Contract of every power spectrum of the shear stress, and its exact integrals over pixels of wavevectors.

Samples at lattice points miss cut-offs by whole pixels and, near q = 0, most of a steep spectrum. Integrals over pixels
lose only the pixel of q = 0.
"""

import math
from collections.abc import Callable
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic_core import PydanticCustomError

from sim.numerics.special import erf_between

Array = NDArray[np.float64]
#: Shares of a wave's energy that a disc holds as a function of x = 2qa, see ``sim.laws.halfspace``.
Factors = Callable[[Array], tuple[Array, Array]]
#: Weight of a wave as a function of its wavevector (qx, qy) [rad/m], such as the compliance of a solid.
Weight = Callable[[ArrayLike, ArrayLike], Array]


class Stress(Protocol):
    """A fluctuating shear stress on the infinite plane, as an elastic solid under it needs it."""

    @property
    def over_wavenumber(self) -> tuple[float, float]:
        """Integrals of C/\\|q\\| and of C cos 2θ/\\|q\\| over d²q/4π² [Pa² m], θ from the sliding direction.

        They are all that a half-space of any stiffness needs of the spectrum.
        """

    def total(self, weight: Weight) -> float:
        """Return the integral of C times an even weight over d²q/4π².

        The weight is that of an isotropic solid: at any wavenumber it has a mean over the directions, and a part that
        goes with cos 2θ.
        """


class Family(Stress, Protocol):
    """Power spectral density C of the fluctuating shear stress [Pa² m²] over wavevectors q [rad/m]; frozen."""

    def __hash__(self) -> int:
        return super().__hash__()

    #: (qx, qy) of the one pair ±q that holds all of the power [rad/m]; None where there is a density.
    wavevector: ClassVar[tuple[float, float] | None] = None
    #: True if bonds make the field: C is then that of n <f²> = 1 N²/m², and the bonds set its size.
    bond_made: ClassVar[bool] = False
    #: Root mean square of the map of which it is the spectrum [Pa]; nan if there is none, or another one is given.
    rms_of_map: ClassVar[float] = math.nan
    #: Sentences on what is assumed of the spectrum, for ``sim check``.
    remarks: ClassVar[tuple[str, ...]] = ()
    #: Wavenumbers [rad/m] between which the density may differ from zero.
    support: ClassVar[tuple[float, float]] = 0.0, math.inf
    #: Wavenumbers [rad/m] where the density jumps or kinks.
    breaks: ClassVar[Array] = np.empty(0)

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²]."""

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Return the power spectral density C at wavevector (qx, qy) [Pa² m²]; raises ValueError for a single wave."""

    def total(self, weight: Weight, end: float = math.inf) -> float:
        """Return the integral of C times a weight, see ``Stress``, over the waves with a wavenumber below ``end``."""

    def pixels(self, step: float, reach: int) -> Array:
        """Variance in each pixel around the points of a square wavevector lattice [Pa²], its side ``step`` in rad/m.

        Shape (2 reach + 1, reach + 1): rows ix = -reach ... reach, columns iy = 0 ... reach; q = 0 included.
        """

    def on_disc(self, factors: Factors, radii: Array) -> tuple[Array, Array]:
        """Integrals ∫ C0 P dq and ∫ C2 S dq over discs of given radii [Pa² m], see ``sim.spectrum.radial``."""


# Exact integrals of a spectrum over the pixels of a square wavevector lattice.


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)

#: Gauss-Legendre panels per pixel beyond which a cell counts as far too small for a Gaussian.
_MOST_PANELS = 256


class Radial(Family, Protocol):
    """An isotropic spectrum by its variance within and beyond a wavenumber q [rad/m]."""

    def cumulative(self, q: ArrayLike) -> Array:
        """Return the variance within wavenumber q [Pa²]."""

    def beyond(self, q: ArrayLike) -> Array:
        """Return the variance beyond wavenumber q [Pa²]."""


def radial_quadrant(spectrum: Radial, step: float, reach: int) -> Array:
    """Return the variance of an isotropic spectrum in the pixels of a wavevector lattice.

    Parameters
    ----------
    spectrum : Radial
        The spectrum.
    step : float
        Side of a pixel [rad/m].
    reach : int
        Largest lattice index.

    Returns
    -------
    array, shape (reach + 1, reach + 1)
        [Pa²] around ix, iy = 0 ... reach, the pixel of q = 0 included.

    Notes
    -----
    By Green's theorem the variance in a pixel is ``(1/2π) ∮ M dθ`` around its edge, M(q) the
    variance within q, or ``-(1/2π) ∮ (M_total - M) dθ`` for a pixel without the origin; the form
    that cancels less is taken. An edge is shared by two pixels, and reflection at the diagonal
    turns a vertical edge into a horizontal one, so each is integrated once.
    """
    within, beyond = _edges(spectrum, step, reach)
    cells = np.arange(reach + 1.0)
    centre = step * np.hypot(cells[:, None], cells)
    inner = spectrum.cumulative(centre) <= 0.5 * spectrum.variance
    inner[0, 0] = True  # the pixel around the origin, where θ winds once
    pixels = np.where(inner, _around(within), -_around(beyond))
    return np.maximum(pixels, 0.0)


def _around(edges: Array) -> Array:
    """Sum over the four edges of each pixel, from vertical edges (line, panel)."""
    across = np.diff(np.concatenate([-edges[:1], edges]), axis=0)
    return across + across.T


def _edges(spectrum: Radial, step: float, reach: int) -> tuple[Array, Array]:
    """``(1/2π) ∫ f dθ`` along each vertical pixel edge, f = variance within and beyond q.

    Edge (i, j) lies on qx = (i + ½) step, qy from (j - ½) to (j + ½) step. Lengths are in units of
    ``step``; edges are split where the circles on which the density jumps or kinks cross them.
    """
    bounds = np.concatenate([[0.0], np.arange(reach + 1) + 0.5])
    circles = spectrum.breaks / step
    pieces = []
    for line in np.arange(reach + 1) + 0.5:
        crossings = np.sqrt(np.maximum(circles[circles > line] ** 2 - line**2, 0.0))
        cuts = np.unique(np.concatenate([bounds, crossings[crossings < bounds[-1]]]))
        pieces.append(np.stack([np.full(len(cuts) - 1, line), cuts[:-1], cuts[1:]]))
    line, start, end = np.concatenate(pieces, axis=1)
    values = _integrate(spectrum, step, line, start, end)
    panel = np.minimum(np.searchsorted(bounds, (start + end) / 2) - 1, reach)
    place = (line - 0.5).astype(np.int64) * (reach + 1) + panel
    shape, size = (reach + 1, reach + 1), (reach + 1) ** 2
    within, beyond = (
        np.bincount(place, value, size).reshape(shape) / (2 * math.pi)
        for value in values
    )
    for edges in (within, beyond):
        # the first panel was integrated from 0; its other half is a mirror image
        edges[:, 0] += edges[:, 0]
    return within, beyond


def _integrate(
    spectrum: Radial, step: float, line: Array, start: Array, end: Array
) -> Array:
    """∫ f dθ along pieces of lines, by bisection until Gauss-Legendre sums agree; shape (2, pieces)."""
    total = np.zeros((2, len(line)))
    owner = np.arange(len(line))
    whole = _legendre(spectrum, step, line, start, end)
    for depth in range(20):
        middle = (start + end) / 2
        left = _legendre(spectrum, step, line, start, middle)
        right = _legendre(spectrum, step, line, middle, end)
        halves = left + right
        turn = line * (end - start) / (line**2 + middle**2)
        # rounding grows with the steepness of f, the error of the sums falls 4096-fold by each halving
        allowed = 8.0**depth * (
            1e-14 * np.abs(halves) + 2e-16 * spectrum.variance * turn
        )
        rough = np.any(np.abs(halves - whole) > allowed, axis=0)
        fine = ~rough
        for sums, part in zip(total, halves, strict=True):
            sums += np.bincount(owner[fine], part[fine], len(sums))
        if not rough.any():
            return total
        if np.count_nonzero(rough) > 8 * len(total[0]) + 10_000:
            break
        line, owner = (np.concatenate([a[rough], a[rough]]) for a in (line, owner))
        start, middle, end = start[rough], middle[rough], end[rough]
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        whole = np.concatenate([left[:, rough], right[:, rough]], axis=1)
    raise ArithmeticError("the pixel integrals of the spectrum do not converge")


def _legendre(
    spectrum: Radial, step: float, line: Array, start: Array, end: Array
) -> Array:
    """Gauss-Legendre sums of ∫ f dθ, θ the polar angle along the line; shape (2, pieces)."""
    half = (end - start) / 2
    y = (start + half)[:, None] + half[:, None] * _NODES
    square = line[:, None] ** 2 + y**2
    q = step * np.sqrt(square)
    turn = half[:, None] * _WEIGHTS * line[:, None] / square
    return np.stack(
        [
            np.sum(spectrum.cumulative(q) * turn, axis=1),
            np.sum(spectrum.beyond(q) * turn, axis=1),
        ]
    )


def gaussian_boxes(
    form: tuple[float, float, float], x_edges: NDArray, y_edges: NDArray
) -> Array:
    """Return ∫∫ exp(-(xx qx² + 2 xy qx qy + yy qy²)) over each rectangle between the edges.

    Parameters
    ----------
    form : tuple of float
        xx, xy, yy [m²], positive definite.
    x_edges, y_edges : array, shape (columns + 1,), (rows + 1,)
        Increasing wavevector components [rad/m].

    Returns
    -------
    array, shape (columns, rows)
        [rad²/m²]

    Raises
    ------
    PydanticCustomError
        If a pixel is so much wider than the Gaussian that nothing but q = 0 would be left.

    Notes
    -----
    Error functions across, along the axis in which the Gaussian is narrower; Gauss-Legendre with
    converged panels along the other.

    Examples
    --------
    >>> edges = np.array([-40.0, 0.0, 40.0])
    >>> print(round(float(gaussian_boxes((1.0, 0.3, 1.0), edges, edges).sum()) / np.pi * 0.91**0.5, 12))
    1.0
    """
    xx, xy, yy = form
    if yy < xx:
        return gaussian_boxes((yy, xy, xx), y_edges, x_edges).T
    step, root = np.diff(x_edges), math.sqrt(yy)
    widest = float(np.max(step)) * math.sqrt(xx)
    panels = math.ceil(widest / 2)
    if panels > _MOST_PANELS:
        message = f"the correlation length is {widest / math.pi:.0f} times the cell; make the cell longer"
        raise PydanticCustomError("cell_too_small", message)
    node, weight = np.polynomial.legendre.leggauss(16)
    node = ((node + 1) / 2 + np.arange(panels)[:, None]).ravel() / panels
    weight = np.tile(weight / 2, panels) / panels
    u = x_edges[:-1, None] + step[:, None] * node
    ends = root * (y_edges + (xy / yy) * u[..., None])
    mass = math.sqrt(math.pi) / (2 * root) * erf_between(ends[..., :-1], ends[..., 1:])
    return np.einsum(
        "ik,ikj->ij", np.exp(-(xx - xy**2 / yy) * u**2) * weight * step[:, None], mass
    )
