"""Closed forms for the bonds that a dataset was made with."""

import contextlib
from typing import NamedTuple, get_args

import numpy as np
import xarray as xr
from pydantic import TypeAdapter

from sim.analysis import setting
from sim.laws import schallamach
from sim.parts.bonds.rupture import Rupture
from sim.plots.style import number_at

_PREFIX = "bonds_rupture_"
_BONDS = ("bond_stiffness", "rebinding_rate", "site_density")

#: Any rupture law by its numbers alone, as a dataset holds them.
_RUPTURE: TypeAdapter[Rupture] = TypeAdapter(get_args(Rupture)[0])


class Steady(NamedTuple):
    """A closed form of steady sliding over speed: shear stress [Pa] and bonds over bonds at rest [1]."""

    words: str
    style: str
    stress: np.ndarray
    fraction: np.ndarray


class Population(NamedTuple):
    """Bonds that stretch: their rupture law, stiffness [N/m], rebinding rate [1/s] and sites per area [1/m^2]."""

    rupture: Rupture
    stiffness: float
    rebinding: float
    density: float

    @property
    def pathway(self) -> tuple[float, float, float] | tuple[()]:
        """Rate [1/s], Bell force [N] and stiffness [N/m] where all rupture is by one pathway that force opens."""
        law = self.rupture.law(self.stiffness)
        return (law.rate, self.stiffness / law.softness, self.stiffness) if law.one_pathway else ()

    @property
    def at_rest(self) -> float:
        """Share of the sites that are bound at rest."""
        return float(schallamach.rest_share(self.rupture.law(self.stiffness).at_rest, self.rebinding))

    def start_peak(self, speed: np.ndarray) -> np.ndarray:
        """Static peak at speeds [m/s] after a long rest, of bonds with one pathway of which none rebinds [Pa]."""
        peak = schallamach.start_up_peak(speed, *self.pathway)
        return self.density * self.at_rest * np.asarray(peak.force)


def population_of(dataset: xr.Dataset, at: dict[str, int]) -> Population | None:
    """Bonds at a point of the sweep; None where they do not stretch, or the dataset does not hold their numbers."""
    keys = [str(name) for name in dataset.variables if str(name).startswith(_PREFIX)]
    with contextlib.suppress(KeyError, ValueError):
        rupture = _RUPTURE.validate_python({key.removeprefix(_PREFIX): number_at(dataset[key], at) for key in keys})
        return Population(rupture, *(number_at(setting(dataset, f"bonds.{key}"), at) for key in _BONDS))
    return None


def steady_laws(dataset: xr.Dataset, at: dict[str, int], speed: np.ndarray) -> list[Steady]:
    """Closed forms of the dataset's bonds in steady sliding.

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
    bonds = population_of(dataset, at)
    if bonds is None:
        return []
    bound, force, _ = bonds.rupture.closed_form(speed, bonds.stiffness, bonds.rebinding)
    laws = [Steady("steady sliding, exact", "-", bonds.density * force, bound / bonds.at_rest)]
    if bonds.pathway:
        stress = schallamach.first_moment_stress(speed, *bonds.pathway, bonds.rebinding, bonds.density)
        fraction = schallamach.first_moment_fraction(speed, *bonds.pathway, bonds.rebinding)
        laws.append(Steady("mean field", "--", stress, fraction))
    return laws


def rest_of(dataset: xr.Dataset) -> xr.DataArray | None:
    """Time at rest before the start [s], for a drive that rests and starts; else None."""
    with contextlib.suppress(KeyError):
        return setting(dataset, "drive.rest")
    return None
