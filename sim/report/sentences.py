"""Sentences on a number over a sweep: a mean with its error, where it is so, and from which value on."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import concise, engineering, sweep_dims
from sim.units.notation import scaled

#: The space between a number and its unit, where no line breaks.
TIE = "\u00a0"
#: Two means are the same within this many standard errors of their difference, or this part of them.
_ERRORS, ROUNDING = 3.0, 1e-9


class Mean(NamedTuple):
    """A mean with its standard error [SI unit], nan where that is not known."""

    value: float
    error: float
    unit: str  # "1" for a share, "" for a count

    def __str__(self) -> str:
        return self.beside(self)

    def beside(self, other: "Mean") -> str:
        """The number with its error, in the unit that suits another one."""
        if self.unit == "":  # a count
            return concise(self.value, self.error)
        if self.unit == "1":
            return f"{concise(100.0 * self.value, 100.0 * self.error)}{TIE}%"
        factor, shown = scaled(other.value, self.unit)
        return f"{concise(factor * self.value, factor * self.error)}{TIE}{shown}".replace("-", "−")

    def equals(self, other: "Mean") -> bool:
        """Whether the two are the same within their errors."""
        apart = abs(self.value - other.value)
        errors = np.nan_to_num([self.error, other.error])
        return bool(apart <= max(_ERRORS * float(np.hypot(*errors)), ROUNDING * abs(self.value)))


class Found(NamedTuple):
    """Statistics at one place: a point of the sweep, at one time or of a whole run, in words."""

    statistics: xr.Dataset
    words: str

    def mean(self, name: str) -> Mean | None:
        """The mean of an observable there; None where it is not known."""
        if f"{name}_mean" not in self.statistics:
            return None
        mean, error = (self.statistics.get(f"{name}_{kind}", xr.DataArray(np.nan)) for kind in ("mean", "sem"))
        value = float(mean)
        unit = "" if name == "slip_count" else str(mean.attrs.get("units", "1"))
        return Mean(value, float(error), unit) if np.isfinite(value) else None


def points_of(dataset: xr.Dataset, found: xr.Dataset) -> list[Found]:
    """Each point of the sweep, with the swept values in words."""
    several = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
    shape = [dataset.sizes[name] for name in sweep_dims(dataset)]
    places = []
    for at in np.ndindex(*shape):
        point = dict(zip(sweep_dims(dataset), at, strict=True))
        words = ", ".join(swept(dataset[name][point[name]]) for name in several)
        places.append(Found(found.isel(point, missing_dims="ignore"), words))
    return places


def swept(value: xr.DataArray) -> str:
    """A swept value with its key: ``contact load 4 mN``."""
    number = value.item()
    if value.dtype.kind in "fi":
        number = engineering(number, value.attrs.get("units", "1")).replace("-", "−").replace(" ", TIE)
    return f"{str(value.name).replace('_', ' ')} {number}"


def led(words: str, sentence: str) -> str:
    """A sentence with the place that it is of, if that has words."""
    return f"With {words}, {sentence[0].lower()}{sentence[1:]}" if words else sentence


def ranged(places: list[Found], name: str, what: str) -> Iterator[str]:
    """A sentence on an observable over the sweep: what it is, or its least and largest values and where they are.

    None where it is zero throughout. Values that differ by their errors alone are said to be the same within them.
    """
    known = [(place, mean) for place in places if (mean := place.mean(name)) is not None]
    if not known:
        return
    (low, least), (high, most) = (pick(known, key=lambda one: one[1].value) for pick in (min, max))
    if least.value == most.value == 0.0:
        return
    large = max(least, most, key=lambda mean: abs(mean.value))
    ends = least.beside(large), most.beside(large)
    if len(known) == 1:
        yield f"{what} is {most}{f' ({high.words})' if high.words else ''}."
    elif ends[0] == ends[1]:
        yield f"{what} is {ends[1]} everywhere in the sweep."
    elif least.equals(most):
        yield f"{what} is the same within the errors everywhere in the sweep, {ends[0]} to {ends[1]}."
    else:
        yield f"{what} goes from {ends[0]} ({low.words}) to {ends[1]} ({high.words})."


def from_on(dataset: xr.Dataset, places: list[Found], shares: list[Mean | None], what: str) -> Iterator[str]:
    """From which value of the one number that is swept on something happens to all members, and up to which to none.

    None where it does not set in once.
    """
    keys = [key for key in sweep_dims(dataset) if dataset.sizes[key] > 1]
    known = [share for share in shares if share is not None]
    if len(keys) != 1 or dataset[keys[0]].dtype.kind not in "fi" or len(known) < len(places):
        return
    order = np.argsort(dataset[keys[0]].to_numpy())
    none, whole = ([known[k].value == end for k in order] for end in (0.0, 1.0))
    if whole != sorted(whole) or none != sorted(none, reverse=True) or all(none) or not any(none):
        return
    before, after, last = (places[order[k]].words for k in (sum(none) - 1, -sum(whole), -1))
    if not any(whole):
        yield f"{what} in no member up to {before}, and in {known[order[-1]]} of all members and records with {last}."
    elif sum(none) + sum(whole) == len(places):
        yield f"{what} from {after} on, and not up to {before}."
    else:
        yield f"{what} in all members from {after} on, and in none up to {before}."
