"""What a contact of finite size pays for the fluctuations when it grows, as a function of its radius."""

from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from sim.disc import marginal_energy

#: Points of the spline over ln a, from 1e-4 to 1 sphere radii: good to 1e-5 for the spectra of sim.spectrum.
_POINTS, _DECADES = 513, 4


class Margin:
    """dE/dA of a disc over ΔΓ of the plane [1]: 1 for many waves in the contact, 0 for a vanishing one.

    E is the ensemble mean of the energy that fluctuations confined to a disc of radius a store (``sim.disc``);
    a contact that grows pays dE/dA. A spline over ln a, made once for a scene.
    """

    def __init__(self, spectrum: Any, shear_modulus: float, poisson_ratio: float, sphere_radius: float) -> None:
        self.spectrum, self.solid, self.sphere_radius = spectrum, (shear_modulus, poisson_ratio), sphere_radius

    def __call__(self, radius: np.ndarray) -> np.ndarray:
        """The share at contact radii [m]; nan stays nan."""
        low, high = self._ends
        share = self._spline(np.log(np.clip(radius, low, high)))
        return np.where(radius < low, share * np.maximum(radius, 0.0) / low, share)

    @property
    def _ends(self) -> tuple[float, float]:
        return self.sphere_radius * 10.0**-_DECADES, self.sphere_radius

    @cached_property
    def _spline(self) -> CubicSpline:
        radii = np.geomspace(*self._ends, _POINTS)
        plane = float(np.asarray(self.spectrum.surface_energy(*self.solid)))
        energies = np.asarray(marginal_energy(self.spectrum, radii, *self.solid)) if plane > 0.0 else np.zeros(_POINTS)
        return CubicSpline(np.log(radii), energies / (plane or 1.0))
