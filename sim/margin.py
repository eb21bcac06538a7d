"""What a contact of finite size pays for the fluctuations when it grows, as a function of its radius."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from sim.spectrum.families import Ripple
from sim.spectrum.finite_contact import disc_energy, marginal_energy

#: Points of the splines over ln a, from 1e-4 to 1 sphere radii. Good to 1e-8 for smooth spectra, 1e-5 for a broad
#: power law, 3e-5 for a band and 3e-3 for one a few per cent wide: its share oscillates with the waves in the contact.
_POINTS, _DECADES = 513, 4


class Margin:
    """dE/dA of a disc over ΔΓ of the plane [1]: 1 for many waves in the contact, 0 for a vanishing one.

    E is the ensemble mean of the energy that fluctuations confined to a disc of radius a store (``finite_contact``);
    a contact that grows pays dE/dA. A spline over ln a, made once for a scene; a ripple's is in closed form.
    """

    def __init__(self, spectrum: Any, shear_modulus: float, poisson_ratio: float, sphere_radius: float) -> None:
        self.spectrum, self.solid, self.sphere_radius = spectrum, (shear_modulus, poisson_ratio), sphere_radius

    def __call__(self, radius: np.ndarray) -> np.ndarray:
        """The share at contact radii [m]; nan stays nan."""
        return self._share(radius, marginal_energy, lambda x: self._spline(x))

    def mean(self, radius: np.ndarray) -> np.ndarray:
        """What the whole disc has paid per area over ΔΓ of the plane [1]: the mean of the share over its area."""
        return self._share(radius, disc_energy, lambda x: self._mean_spline(x))

    def _share(self, radius: np.ndarray, law: Callable[..., Any], spline: Callable[..., np.ndarray]) -> np.ndarray:
        if isinstance(self.spectrum, Ripple) and self._plane > 0.0:
            share = np.asarray(law(self.spectrum, np.nan_to_num(radius), *self.solid)) / self._plane
            return np.where(np.isnan(radius), np.nan, share)
        low, high = self._ends
        share = spline(np.log(np.clip(radius, low, high)))
        return np.where(radius < low, share * np.maximum(radius, 0.0) / low, share)

    @property
    def _ends(self) -> tuple[float, float]:
        return self.sphere_radius * 10.0**-_DECADES, self.sphere_radius

    @cached_property
    def _plane(self) -> float:
        return float(np.asarray(self.spectrum.surface_energy(*self.solid)))

    @cached_property
    def _spline(self) -> CubicSpline:
        return self._splined(marginal_energy)

    @cached_property
    def _mean_spline(self) -> CubicSpline:
        return self._splined(disc_energy)

    def _splined(self, law: Callable[..., Any]) -> CubicSpline:
        radii = np.geomspace(*self._ends, _POINTS)
        energies = np.asarray(law(self.spectrum, radii, *self.solid)) if self._plane > 0.0 else np.zeros(_POINTS)
        return CubicSpline(np.log(radii), energies / (self._plane or 1.0))
