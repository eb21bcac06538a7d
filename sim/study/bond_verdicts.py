"""What ``sim converge`` found of the bonds, in words; everything is read from the dataset."""

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import concise

#: Standard errors beyond which an error is more than noise, at any of the records.
_REAL = 5.0

#: Costs that differ by less than this share count as equal.
_SAME_COST = 0.15

#: Share of the tolerance below which errors count as equal, so that the shallower depth is taken.
_SMALL = 0.01

#: Most sites of a depth that has a number of them.
_MOST = {"counted": 1e9, "tracked": 1e6}

#: Errors below this are roundings.
_ROUNDING = 1e-12

_SHORT = ("stress", "fraction", "square")


def bond_table(dataset: xr.Dataset) -> list[dict[str, str]]:
    """A row for each depth of the bonds, for the terminal.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.bonds.converge_bonds`` gives it.

    Returns
    -------
    list of dict
        Cells by heading. Errors are the largest over the records, in percent of the reference's largest value,
        with the standard error of the last digits in brackets; the noise is that of one member, of the
        friction or, where bonds have no stretch, of the fraction.
    """
    rows = []
    which = 0 if "rupture" in str(dataset.attrs["bonds_kind"]) else 1
    for row in range(dataset.sizes["bond_row"]):
        here = dataset.isel(bond_row=row)
        label = str(here["bond_row"].values) + (" *" if int(here["bonds_own"]) else "")
        cells = {"bonds": label} | {
            f"{name}\n(µs)": _three(1e6 * float(here[f"bonds_{time}_time"]))
            for name, time in (("CPU", "cpu"), ("wall", "wall"))
        }
        cells["members"] = f"{int(here['bonds_members']):,}"
        errors, sems = (100.0 * here[f"bonds_{name}"].to_numpy() for name in ("error", "standard_error"))
        cells |= {f"{name}\n(%)": _cell(e, s) for name, e, s in zip(_SHORT, errors, sems, strict=True)}
        for name, heading in (("noise", "noise\n(%)"), ("expected_noise", "expected\n(%)")):
            cells[heading] = _three(100.0 * float(here[f"bonds_{name}"][which]))
        sites = int(here["bonds_sites"])
        cells["1/√N\n(%)"] = _three(100.0 / math.sqrt(sites)) if sites else "–"
        rows.append(cells | {"verdict": _verdict(here)})
    return rows


def percent(error: float) -> str:
    """A relative error to two digits.

    >>> print(percent(0.0123), percent(2e-6), percent(0.0))
    1.2 % 0.0002 % 0 %
    """
    return f"{float(f'{100.0 * error:.2g}'):.4g} %" if error > _ROUNDING else "0 %"


def _three(number: float) -> str:
    return f"{number:.3g}" if math.isfinite(number) else "–"


def _cell(error: float, sem: float) -> str:
    if math.isnan(error):
        return "–"
    if sem > 0.0:
        return concise(error, sem).replace("-", "−")
    return "0" if abs(error) < 100.0 * _ROUNDING else f"{error:.2g}".replace("-", "−")


def _verdict(here: xr.Dataset) -> str:
    """Whether the errors of a row are more than the noise of so many sites."""
    if not int(here["bonds_members"]):
        return "over budget"
    if int(here["bonds_finer"]) > 1:
        return "what the step costs"
    if not int(here["bonds_sites"]):
        return "" if np.nanmax(np.abs(here["bonds_error"].to_numpy()), initial=0.0) > _ROUNDING else "exact"
    return "NOT NOISE ALONE" if np.nanmax(here["bonds_score"].to_numpy(), initial=0.0) > _REAL else "noise alone"


def _off(dataset: xr.Dataset) -> NDArray[np.float64]:
    """How far one member of each row is from the mean of infinitely many sites: error, or two noises."""
    error = np.abs(dataset["bonds_error"].to_numpy())
    noise = 2.0 * dataset["bonds_expected_noise"].to_numpy()
    found = np.where(dataset["bonds_sites"].to_numpy()[:, np.newaxis] > 0, noise, error)[:, :2]
    known = np.where(np.isnan(found), 0.0, found).max(axis=1)
    marched = (dataset["bonds_members"].to_numpy() > 0) & (dataset["bonds_finer"].to_numpy() == 1)
    return np.where(marched & np.isfinite(found).any(axis=1), known, np.inf)


def bond_advice(dataset: xr.Dataset) -> str:
    """The depth of the bonds that the scene's tolerance suggests, in words and with the lines to write.

    Where the contact has so few sites that their noise is above the tolerance they are followed, since that
    noise is real; else it is the cheapest depth whose stress and fraction keep the tolerance.
    """
    tolerance, number = float(dataset.attrs["bonds_tolerance_asked"]), float(dataset.attrs["bonds_sites_of_contact"])
    sites, cost = dataset["bonds_sites"].to_numpy(), dataset["bonds_cpu_time"].to_numpy()
    off, labels = _off(dataset), dataset["bond_row"].to_numpy()
    real = tolerance**2 * number < 1.0
    if real and number <= _MOST.get(str(dataset["bonds_model"].values[np.argmax(sites)]), 0.0):
        model = dataset["bonds_model"].values[np.argmax(sites)]
        return (
            f"The {number:,.0f} sites of the contact fluctuate by {percent(1.0 / math.sqrt(number))}, which is real "
            f"and above the tolerance of {percent(tolerance)}: the bonds are best “{model}”. Write:\n\n[bonds]\n"
            f'model = "{model}"\nsites = {round(number)}'
        )
    good = np.flatnonzero(off <= tolerance)
    if not good.size:
        row = int(np.argmin(off))
        said = f"For the bonds, no depth keeps {percent(tolerance)}"
        return f"{said}; “{labels[row]}” comes nearest, off by {percent(off[row])}."
    cheap = good[cost[good] <= (1.0 + _SAME_COST) * cost[good].min()]
    row = int(cheap[off[cheap] <= max(off[cheap].min(), _SMALL * tolerance)][0])
    return (
        f"For the bonds, “{labels[row]}” is the cheapest depth that keeps {percent(tolerance)}: "
        f"{_three(1e6 * cost[row])} µs of CPU time per step, off by {percent(off[row])} at the most. Write:\n\n"
        f"{dataset['bonds_toml'].values[row]}"
    )
