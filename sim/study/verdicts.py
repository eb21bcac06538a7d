"""What ``sim converge`` found, in words: a table for the terminal and a closing sentence.

Everything is read from the dataset.
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import concise, engineering

Mask = NDArray[np.bool_]

#: Standard errors beyond which an error is real, and beyond which it contradicts what was known beforehand.
_REAL, _CONTRADICTS = 4.0, 5.0

#: Standard errors within which an error may still be at the tolerance.
_WITHIN = 2.0

#: Errors below this are not told: the closed forms are not exact to more.
_TOLD = 1e-4

#: Costs that differ by less than this share count as equal.
_SAME_COST = 0.15

_SHORT = ("mean", "sd", "skew", "q01", "q99", "t_c")
_SYMBOLS = ("ΔΓ", "a")
_OF = ("ΔΓ", "the radius")


def real(dataset: xr.Dataset) -> Mask:
    """Where a measured error cannot be sampling, shape (rows, times, quantities, statistics)."""
    error, sem = np.abs(dataset["error"].to_numpy()), dataset["standard_error"].to_numpy()
    return (error > _REAL * sem) & (error > _TOLD)


def contradicted(dataset: xr.Dataset) -> Mask:
    """Where a measured error is not the one known beforehand: a fault of the program."""
    off = np.abs(dataset["error"].to_numpy() - dataset["known_error"].to_numpy())
    found = (off > _CONTRADICTS * dataset["standard_error"].to_numpy()) & (off > _TOLD)
    found[:, :, 1, 5] = False  # the correlation time of the radius is known to first order only
    return found


def cost(dataset: xr.Dataset) -> NDArray[np.float64]:
    """CPU time of each row per member and clock step *of the scene*, so that coarser steps count for more [s]."""
    return (dataset["cpu_time"] * dataset.attrs["clock_step"] / dataset["clock_step"]).to_numpy()


class Worst(NamedTuple):
    """The largest of some errors and what it is of; nan and nothing where none is known."""

    error: float
    statistic: str
    quantity: int

    def __str__(self) -> str:
        return f"{percent(abs(self.error))} ({self.statistic} of {_OF[self.quantity]})"


def worst(errors: NDArray[np.float64], names: tuple[str, ...]) -> Worst:
    """The largest of errors of shape (times, quantities, statistics) by size."""
    sizes = np.abs(errors)
    if not np.any(np.isfinite(sizes)):
        return Worst(math.nan, "", 0)
    place = np.unravel_index(int(np.nanargmax(sizes)), sizes.shape)
    return Worst(float(errors[place]), names[place[2]], int(place[1]))


def percent(error: float) -> str:
    """A relative error to two digits.

    >>> print(percent(-0.0123), percent(2e-6), percent(1.0))
    -1.2 % 0 % 100 %
    """
    if abs(error) < _TOLD:
        return "0 %"
    return f"{float(f'{100.0 * error:.2g}'):g} %"


def table(dataset: xr.Dataset) -> list[dict[str, str]]:
    """Two rows for each setting, of ΔΓ and of the radius, for the terminal.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.

    Returns
    -------
    list of dict
        Cells by heading. Errors are in percent of their yardsticks with the standard error of the last
        digits in brackets, at the first stated time; "known" is the largest error known beforehand,
        and the verdict names the statistics whose errors are real (more than four standard errors),
        at any of the stated times.
    """
    when = engineering(float(dataset["t"][0]), "s")
    found, wrong = real(dataset), contradicted(dataset)
    rows = []
    for row in range(dataset.sizes["row"]):
        here = dataset.isel(row=row)
        about = [str(here["row"].values), _count(here["terms"]), _micro(here["cpu_time"]), _micro(here["wall_time"])]
        about.append(_count(here["members"]))
        for q, symbol in enumerate(_SYMBOLS):
            numbers = here.isel(quantity=q, t=0)
            errors, sems = (100.0 * numbers[name].to_numpy() for name in ("error", "standard_error"))
            texts = [_cell(error, sem) for error, sem in zip(errors, sems, strict=True)]
            known = worst(here["known_error"].to_numpy()[:, [q]], _SHORT)
            verdict = _verdict(here.isel(quantity=q), found[row, :, q], wrong[row, :, q])
            headings = ("setting", "terms", "CPU\n(µs)", "wall\n(µs)", "members")
            cells = dict(zip(headings, about if q == 0 else [""] * len(about), strict=True)) | {f"at\n{when}": symbol}
            cells |= {f"{name}\n(%)": text for name, text in zip(_SHORT, texts, strict=True)}
            cells["known\nat most"] = _largest(known)
            rows.append(cells | {"verdict": verdict})
    return rows


def _largest(known: Worst) -> str:
    """A known error without its sign, and what it is of."""
    if math.isnan(known.error):
        return "–"
    size = percent(abs(known.error))
    return size if size == "0 %" else f"{size} {known.statistic}"


def _count(number: xr.DataArray) -> str:
    return f"{int(number):,}"


def _micro(seconds: xr.DataArray) -> str:
    return f"{1e6 * float(seconds):.3g}"


def _cell(error: float, sem: float) -> str:
    """An error with its standard error, or without where it has none."""
    if math.isnan(error):
        return "–"
    return "0" if abs(error) < 1e-6 and not sem > 1e-6 else concise(error, sem).replace("-", "−")


def _verdict(here: xr.Dataset, found: Mask, wrong: Mask) -> str:
    """Which errors of a row are real, over its statistics and times."""
    if not int(here["members"]):
        return "over budget"
    errors = here["error"].to_numpy()
    if not np.any(np.isfinite(errors)):
        return "the reference"
    if np.any(wrong):
        return f"NOT AS KNOWN: {_named(wrong)}"
    if np.any(found):
        return f"real: {_named(found)}"
    return "not separated" if np.nanmax(here["standard_error"].to_numpy()) > 0.0 else "exact"


def _named(which: Mask) -> str:
    return " ".join(name for number, name in enumerate(_SHORT) if np.any(which[:, number]))


def unknown(dataset: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measured errors that are not known beforehand, by size, and their standard errors; nan where they are known.

    The finest clock step, which nothing finer judges, errs at most as the next one differs from it; and
    what is not known of the scene's own clock step is not known of any depth at that step.
    """
    known = dataset["known_error"].to_numpy()
    error, sem = (
        np.where(np.isnan(known), np.abs(dataset[name].to_numpy()), np.nan) for name in ("error", "standard_error")
    )
    line, step = dataset["line"].to_numpy(), dataset["clock_step"].to_numpy()
    clocks = sorted(np.flatnonzero(line == "clock step"), key=lambda row: step[row])
    if clocks:
        finest, coarser = clocks[:2]
        itself = np.isnan(error[finest])
        error[finest], sem[finest] = (np.where(itself, a[coarser], a[finest]) for a in (error, sem))
        own = next((row for row in clocks if step[row] == dataset.attrs["clock_step"]), finest)
        depths = (line != "clock step") & (line != "grid")
        error[depths], sem[depths] = (np.fmax(a[depths], a[own]) for a in (error, sem))
    return error, sem


def within(dataset: xr.Dataset, tolerance: float) -> Mask:
    """Which rows keep a tolerance, shape (rows,).

    All errors known beforehand do, no measured one is beyond by more than two standard errors unless
    it is the known one within four, and none that is ``unknown``.
    """
    known, error, sem = (dataset[name].to_numpy() for name in ("known_error", "error", "standard_error"))
    explained = np.abs(error - known) <= _REAL * sem + _TOLD
    beyond = (np.abs(error) - _WITHIN * sem > tolerance + _TOLD) & ~explained
    error, sem = unknown(dataset)
    beyond |= error - _WITHIN * sem > tolerance + _TOLD
    promised = ~(np.abs(known) > tolerance * (1.0 + 1e-9))
    return (promised & ~beyond).all(axis=(1, 2, 3)) & (dataset["members"].to_numpy() > 0)


def recommendation(dataset: xr.Dataset) -> str:
    """The cheapest setting that keeps the scene's tolerance, in words and with the lines to write.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.
    """
    tolerance, line = float(dataset.attrs["asked_tolerance"]), dataset["line"].to_numpy()
    paid, kept = cost(dataset), within(dataset, tolerance)
    open_to_all = line != "grid"
    size = np.array([_reached(dataset, row) for row in range(len(line))])
    candidates = np.flatnonzero(kept & open_to_all)
    if candidates.size:
        cheap = candidates[paid[candidates] <= (1.0 + _SAME_COST) * paid[candidates].min()]
        row = int(cheap[np.argmin(size[cheap])])
        said = [_praise(dataset, row, tolerance)]
    else:
        tried = np.flatnonzero(open_to_all & (dataset["members"].to_numpy() > 0))
        if not tried.size:
            return "The budget is too small to sample any setting; the table tells what is known beforehand."
        row = int(tried[np.argmin(size[tried])])
        said = [_nearest(dataset, row, tolerance)]
    grid, points = _grid_advice(dataset, row, tolerance)
    said += [*grid, *_warnings(dataset)]
    shear, *others = str(dataset["toml"].values[row]).split("\n\n")
    return "\n\n".join([f"{' '.join(said)} Write:", shear + points, *others])


def _reached(dataset: xr.Dataset, row: int) -> float:
    """The largest error of a row."""
    return float(np.nanmax(np.abs(_sizes(dataset, row)), initial=0.0))


def _sizes(dataset: xr.Dataset, row: int) -> NDArray[np.float64]:
    """Errors of a row: as known, where nothing is known as far as measured beyond two standard errors."""
    known = dataset["known_error"].to_numpy()[row]
    error, sem = (numbers[row] for numbers in unknown(dataset))
    return np.where(np.isfinite(known), known, np.maximum(error - _WITHIN * sem, 0.0))


def _praise(dataset: xr.Dataset, row: int, tolerance: float) -> str:
    """What a setting that keeps the tolerance costs and errs."""
    here = dataset.isel(row=row)
    names = tuple(dataset["statistic"].to_numpy())
    known = worst(here["known_error"].to_numpy(), names)
    spent = f"{float(f'{1e6 * cost(dataset)[row]:.2g}'):g} µs of CPU time per member and step"
    spent += "" if float(here["clock_step"]) == dataset.attrs["clock_step"] else " of the scene"
    if not np.any(dataset["standard_error"].to_numpy() > 0.0):
        if max(np.nanmax(np.abs(dataset[name].to_numpy()), initial=0.0) for name in ("known_error", "error")) < _TOLD:
            return (
                "Nothing fluctuates here and nothing depends on the clock step: every setting gives the exact answer, "
                f"and “{here['row'].values}” is the cheapest, with {spent}."
            )
        return (
            f"Nothing fluctuates here. “{here['row'].values}” is the cheapest that keeps "
            f"{percent(tolerance)}: its largest error is {worst(_sizes(dataset, row), names)}."
        )
    unseen = worst(_WITHIN * unknown(dataset)[1][row], names)
    doubtful = unseen.error > tolerance
    told = ", as far as sampling tells, keeps" if doubtful else " keeps"
    text = f"“{here['row'].values}” is the cheapest setting that{told} {percent(tolerance)}: {spent}"
    faster = _times_modal(dataset, row)
    text += f", {float(f'{faster:.2g}'):g} times as fast as the modal depth" if faster > 1.2 else ""
    if math.isfinite(known.error):
        text += (
            f". Its largest error known beforehand is {known}"
            if abs(known.error) > _TOLD
            else ". It is exact in what is known beforehand"
        )
    if doubtful:
        text += f"; what is not known beforehand was measured to {unseen} only: a larger budget tells more"
    return text + "."


def _times_modal(dataset: xr.Dataset, row: int) -> float:
    """How many times cheaper than the modal depth a row is; nan without one."""
    modal = np.flatnonzero(dataset["line"].to_numpy() == "modal")
    paid = cost(dataset)
    return float(paid[modal[0]] / paid[row]) if modal.size else math.nan


def _nearest(dataset: xr.Dataset, row: int, tolerance: float) -> str:
    """What comes nearest where nothing keeps the tolerance."""
    here = dataset.isel(row=row)
    far = worst(_sizes(dataset, row), tuple(dataset["statistic"].to_numpy()))
    text = f"No setting keeps {percent(tolerance)}; “{here['row'].values}” comes nearest, off by {far}"
    clock = dataset["line"].to_numpy() == "clock step"
    finer = bool(clock[row]) and float(here["clock_step"]) == float(dataset["clock_step"].min())
    return text + (": a still shorter clock step would come nearer." if finer else ".")


def _grid_advice(dataset: xr.Dataset, row: int, tolerance: float) -> tuple[list[str], str]:
    """What the grid leaves out, where it does, and the line that cures it."""
    grids = np.flatnonzero((dataset["line"] == "grid").to_numpy())
    own = [k for k in grids if int(dataset["points"][k]) == int(dataset["points"][row])]
    if not own:
        return [], ""
    known = worst(dataset["known_error"].to_numpy()[own[0]], tuple(dataset["statistic"].to_numpy()))
    if not abs(known.error) > tolerance:
        return [], ""
    enough = [k for k in grids if within(dataset, tolerance)[k]]
    count = int(dataset["points"][enough[0]]) if enough else 0
    cure = f"{count} points keep the tolerance" if enough else "take more points still"
    said = f"But the grid of {int(dataset['points'][row])} points leaves short waves out and errs by {known}: {cure}."
    return [said], f"\npoints = {count}" if enough else ""


def _warnings(dataset: xr.Dataset) -> list[str]:
    """Measured errors that contradict what is known beforehand."""
    wrong = contradicted(dataset)
    rows = [str(dataset["row"].values[k]) for k in np.flatnonzero(wrong.any(axis=(1, 2, 3)))]
    if not rows:
        return []
    names = f"“{rows[0]}”" + (f" and {len(rows) - 1} more" if len(rows) > 1 else "")
    return [
        f"Beware: {names} differ by more than five standard errors from what is known beforehand: "
        "a fault of the program."
    ]
