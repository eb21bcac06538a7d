"""What closed forms say of the bonds that a dataset was made with."""

import contextlib
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import setting
from sim.laws import schallamach


class Steady(NamedTuple):
    """A closed form of steady sliding over speed: shear stress [Pa] and bonds over bonds at rest [1]."""

    words: str
    style: str
    stress: np.ndarray
    fraction: np.ndarray


def numbers(dataset: xr.Dataset, at: dict[str, int], *keys: str) -> list[float]:
    """Numbers of the bonds at a point of the sweep; raises KeyError where one is not held."""
    found = (setting(dataset, f"bonds.{key}") for key in keys)
    return [float(number.isel(at, missing_dims="ignore")) for number in found]


def steady_laws(dataset: xr.Dataset, at: dict[str, int], speed: np.ndarray) -> list[Steady]:
    """What closed forms say of the dataset's bonds in steady sliding.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    at : dict
        Index of the point along each dimension of the sweep.
    speed : array
        V [m/s].

    Returns
    -------
    list of Steady
        Exact, and for Bell's rupture the first-moment closure, too. None for bonds without a stretch.
    """
    common = ("bond_stiffness", "rebinding_rate", "site_density")
    with contextlib.suppress(KeyError):
        rate, force = numbers(dataset, at, "rupture.zero_force_rate", "rupture.bell_force")
        stiffness, rebinding, density = numbers(dataset, at, *common)
        bell, field = (rate, force, stiffness, rebinding), schallamach.first_moment_stress
        exact = schallamach.bell_stress(speed, *bell, density), schallamach.bell_fraction(speed, *bell)
        closed = field(speed, *bell, density), schallamach.first_moment_fraction(speed, *bell)
        return [Steady("steady sliding, exact", "-", *exact), Steady("mean field", "--", *closed)]
    with contextlib.suppress(KeyError):
        rate, stretch = numbers(dataset, at, "rupture.rate", "rupture.stretch")
        stiffness, rebinding, density = numbers(dataset, at, *common)
        stress = schallamach.cut_off_stress(speed, rate, stretch, stiffness, rebinding, density)
        fraction = schallamach.cut_off_fraction(speed, rate, stretch, rebinding)
        return [Steady("steady sliding, exact", "-", stress, fraction)]
    with contextlib.suppress(KeyError):
        (rate,) = numbers(dataset, at, "rupture.rate")
        stiffness, rebinding, density = numbers(dataset, at, *common)
        force = schallamach.constant_moments(speed, rate, stiffness, rebinding).force
        return [Steady("steady sliding, exact", "-", density * force, np.ones_like(speed))]
    return []


def rest_of(dataset: xr.Dataset) -> xr.DataArray | None:
    """Time at rest before the start [s], for a drive that rests and starts; else None."""
    with contextlib.suppress(KeyError):
        return setting(dataset, "drive.rest")
    return None


def start_peak(dataset: xr.Dataset, at: dict[str, int], speed: np.ndarray, fraction: float) -> np.ndarray | None:
    """Static peak of the dataset's Bell bonds at start-up speeds [m/s], if none of them rebinds [Pa].

    ``fraction`` is that of bonds over bonds at rest when sliding begins. None for other rupture laws.
    """
    with contextlib.suppress(KeyError):
        rate, force = numbers(dataset, at, "rupture.zero_force_rate", "rupture.bell_force")
        stiffness, rebinding, density = numbers(dataset, at, "bond_stiffness", "rebinding_rate", "site_density")
        bound = fraction * float(schallamach.rest_share(rate, rebinding))
        return density * bound * np.asarray(schallamach.start_up_peak(speed, rate, force, stiffness).force)
    return None
