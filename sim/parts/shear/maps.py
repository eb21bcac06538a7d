"""A measured map of the stress as the field itself, which passes the contact, on the plane or under a disc.

On the plane the map is periodic and its energy does not change. On a disc only the stress in the contact counts, and
the pattern passes under the sphere. A unit of new contact at the edge costs dE/dA of this pattern, of either sign.
Several radii may then be in balance.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from sim.laws.halfspace import disc_energies_of_map, soft_disc
from sim.numerics.grid import Lattice
from sim.parts.exchange import Array
from sim.parts.shear.process import Fluctuation, SmoothProcess
from sim.solid import ElasticSolid
from sim.spectrum.measured import StressMap
from sim.spectrum.radial import Terms

#: Radius [pixels] below which a disc is not resolved, and most radii at which energies are found.
_RESOLVED, _MOST_RADII = 5.0, 48
#: Pixels around the widest disc, and whole pixels between which energies are interpolated.
_AROUND, _NODES = 6, np.arange(-1, 3)


@dataclass(frozen=True)
class CarriedProcess(SmoothProcess):
    """ΔΓ = g² × that of a measured map, and the map at any position of the slider.

    On a disc the energy is that of the whole map, of which ``Passing`` gives the share.
    """

    field: StressMap
    on_disc: bool

    @property
    def lattice(self) -> Lattice:
        """The lattice of the maps."""
        return self.field.lattice

    def maps(self, state: Fluctuation, position: Array, members: int) -> Array:
        """Return stress maps τ1(x, y) of the first ``members``, shape (members, nx, ny) [Pa].

        At ``position`` X [m] the pattern has moved by X past the contact. Under a disc
        the contact is in the middle of the pattern, without stress beyond the pattern.
        Otherwise the pattern is periodic.
        """
        lattice, ahead = (
            self.field.lattice,
            self.field.middle - self.field.begin if self.on_disc else 0.0,
        )
        places = lattice.sides[0] / lattice.shape[0] * np.arange(lattice.shape[0])
        spectrum, (qx, _), nyquist = (
            np.fft.rfft2(self.field.field),
            lattice.wavevectors,
            lattice.shape[0] // 2,
        )
        moved = np.empty((members, *lattice.shape))
        positions, sizes = (
            np.broadcast_to(values, members) for values in (position, state.amplitude)
        )
        for map_, x, size in zip(moved, positions, sizes, strict=True):
            turned = np.exp(-1j * qx * (x + ahead))
            if lattice.shape[0] % 2 == 0:  # the Nyquist row holds both signs
                turned[nyquist] = turned[nyquist].real
            map_[:] = size * np.fft.irfft2(spectrum * turned, lattice.shape)
            before = places - (x + ahead)
            if self.on_disc:
                map_[(before < 0.0) | (before >= lattice.sides[0])] = 0.0
        return moved


@dataclass(frozen=True)
class DiscShares:
    """Energies per area on discs of a map over its mean energy, at whole pixels and at radii up to ``widest`` [m].

    They are kept by the pixel at which the disc's middle is.
    """

    field: StressMap
    solid: ElasticSolid
    widest: float

    @cached_property
    def _rows(self) -> dict[int, Array]:
        return {}

    @cached_property
    def _discs(self) -> list[Array]:
        return [
            soft_disc(float(radius / self.field.pixels[0])) for radius in self.radii
        ]

    @cached_property
    def radii(self) -> Array:
        """Radii at which energies are found [m], evenly spaced in their logarithm."""
        pixel = self.field.pixels[0]
        low = min(_RESOLVED * pixel, 0.5 * self.widest)
        count = math.ceil(self.widest / pixel * math.log(self.widest / low))
        return np.geomspace(low, self.widest, min(max(count, 8), _MOST_RADII))

    @property
    def step(self) -> float:
        """Step of the logarithm of the radii."""
        return math.log(self.radii[-1] / self.radii[0]) / (self.radii.size - 1)

    def row(self, place: int) -> Array:
        """Return the shares at the radii of discs at a pixel."""
        if place not in self._rows:
            pixel, across = self.field.pixels[0], self.field.shape[1] // 2
            half = math.ceil(self.widest / pixel) + _AROUND
            padded = np.pad(self.field.field, half)
            window = padded[place : place + 2 * half, across : across + 2 * half]
            energies = disc_energies_of_map(
                window,
                pixel,
                self.radii,
                self.solid.shear_modulus,
                self.solid.held_ratio,
                self._discs,
            )
            self._rows[place] = energies / self.solid.stored_energy(self.field)
        return self._rows[place]


@dataclass(frozen=True)
class Passing:
    """Share of a map's energy that a contact of finite radius pays when it grows, as the pattern passes under it.

    Between the pixels and radii of the ``discs`` there are cubics. The share of new contact is the derivative of these
    cubics, so its integral over the area is the energy. ``position`` of the slider [m] has the shape (1,) or
    (steps, 1).
    """

    discs: DiscShares
    position: Array

    def at(self, position: Array) -> "Passing":
        """Return the shares at other positions of the slider [m], the same for all members."""
        return replace(self, position=position[..., :1])

    @cached_property
    def _mean(self) -> Array:
        """Cubics of the mean share over ln a at each position, shape (steps, 4, pieces)."""
        field, radii = self.discs.field, self.discs.radii
        shares, last = np.empty((self.position.size, radii.size)), field.shape[0]
        for row, x in zip(shares, self.position.flat, strict=True):
            place = (field.begin - x) / field.pixels[0]
            nodes = [
                min(max(math.floor(place) + int(node), 0), last) for node in _NODES
            ]
            s = place - math.floor(place)
            weights = (
                -s * (s - 1.0) * (s - 2.0) / 6.0,
                (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
                -(s + 1.0) * s * (s - 2.0) / 2.0,
                (s + 1.0) * s * (s - 1.0) / 6.0,
            )
            row[:] = sum(
                weight * self.discs.row(node)
                for weight, node in zip(weights, nodes, strict=True)
                if weight != 0.0
            )
        return scipy.interpolate.CubicSpline(np.log(radii), shares, axis=1).c.transpose(
            2, 0, 1
        )

    @cached_property
    def _new(self) -> Array:
        """Cubics of the share of new contact: with F the mean share, dE/dA = F + ½ dF/d ln a."""
        a, b, c, d = self._mean.transpose(1, 0, 2)
        return np.stack([a, b + 1.5 * a, c + b, d + 0.5 * c], axis=1)

    def __call__(self, radius: Array) -> Array:
        """Return the share at contact radii [m]; nan at nan."""
        return self._read(self._new, radius)

    def mean(self, radius: Array) -> Array:
        """Return the mean of the share over the area of the disc: E/(πa²) over the energy of the whole map [1]."""
        return self._read(self._mean, radius)

    def _read(self, cubics: Array, radius: Array) -> Array:
        shape = np.broadcast_shapes(self.position.shape, radius.shape)
        radii = np.broadcast_to(radius, shape).reshape(len(cubics), -1)
        nodes, step = self.discs.radii, self.discs.step
        low = nodes[0]
        at = np.log(np.clip(np.nan_to_num(radii, nan=low), low, nodes[-1]) / low) / step
        piece = np.minimum(at.astype(int), nodes.size - 2)
        s = (at - piece) * step
        a, b, c, d = (np.take_along_axis(cubics[:, k], piece, axis=1) for k in range(4))
        share = ((a * s + b) * s + c) * s + d
        share = np.where(radii < low, share * np.maximum(radii, 0.0) / low, share)
        return np.where(np.isnan(radii), np.nan, share).reshape(shape)

    @property
    def least(self) -> Array:
        """The lowest share of new contact at any radius, or 0 if none is negative."""
        return np.minimum(self._new[:, 3].min(axis=1), 0.0).reshape(self.position.shape)

    @property
    def each(self) -> list[Terms]:
        """Inputs of ``sim.spectrum.radial.share_of`` at each position."""
        low, step = float(self.discs.radii[0]), self.discs.step
        cubics = self._new.transpose(0, 2, 1) * step ** np.arange(3, -1, -1)
        ends = low, math.log(low), 1.0 / step
        return [
            ((0.0, 0.0, 0.0), ends, np.ascontiguousarray(cubic)) for cubic in cubics
        ]
