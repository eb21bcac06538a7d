"""The answer of a run in a sentence, by the kind of its scene: numbers of ``sim stats`` with their standard errors."""

import contextlib
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import (
    concise,
    engineering,
    is_stationary,
    is_steady,
    loss_speeds,
    setting,
    settled,
    summary,
    sweep_dims,
)
from sim.analysis.observables import all_observables
from sim.analysis.over_speed import speed_dim
from sim.analysis.scene import answered, speed_name
from sim.analysis.statistics import over_members
from sim.analysis.tables import once
from sim.plots import kinds
from sim.units.notation import scaled

#: The space between a number and its unit, where no line breaks.
TIE = "\u00a0"
#: Two means are the same within this many standard errors of their difference, or this part of them.
_ERRORS, _ROUNDING = 3.0, 1e-9
#: Mechanisms that take area, in the order in which they are charged.
_TAKEN = {
    "lost_to_bonds": "broken bonds", "lost_to_fluctuations": "fluctuations",
    "lost_to_mean_stress": "the mean stress", "lost_to_lag": "the edge's lag",
}  # fmt: skip
#: Losses whose speeds are known, in words.
_LOSSES = {
    "speed_at_5_percent_lost": f"5{TIE}% of JKR's", "speed_at_50_percent_lost": f"50{TIE}% of JKR's",
    "speed_halfway_to_hertz": "half of what lies between JKR's and Hertz's",
}  # fmt: skip
#: Share of a force in which friction and what is prescribed differ where something else bears it, too.
_APART = 1e-3
#: Points of a sweep that each have a sentence, at most.
_FEW = 4


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
        return bool(apart <= max(_ERRORS * float(np.hypot(*errors)), _ROUNDING * abs(self.value)))


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


#: What a whole run has once, and sentences that a dataset and these statistics of it give.
Answer = Callable[[xr.Dataset, xr.Dataset], Iterator[str]]


def answers(dataset: xr.Dataset, found: xr.Dataset | None = None) -> list[str]:
    """Sentences with numbers that answer the question of a scene; none where no kind of scene fits.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    found : xarray.Dataset, optional
        Statistics of what it has once in a whole run, as ``sim.analysis.tables.once`` gives them, if they are known.

    Returns
    -------
    list of str
        A number in brackets is the standard error in the last digits; a number without has none.
    """
    kind = kinds.default(dataset)
    said: list[str] = []
    found = once(dataset) if found is None else found
    for answer in (_TRANSIENTS, *_ANSWERS.get(kind, ()), *_sliding(dataset, kind)):
        with contextlib.suppress(ValueError, KeyError), answered():
            said += answer(dataset, found)
    return said


def _sliding(dataset: xr.Dataset, kind: str) -> list[Answer]:
    """What is said of a slider behind a spring; its work over its way is kinetic friction at one speed alone."""
    if speed_name(dataset) != "stage_speed":
        return []
    counted = [] if kind == "stability" else [_COUNTED]
    return [_stick_and_slip, *counted, *([_KINETIC] if is_stationary(dataset) else [])]


def _places(dataset: xr.Dataset, found: xr.Dataset) -> list[Found]:
    """Each point of the sweep, with the swept values in words."""
    several = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
    shape = [dataset.sizes[name] for name in sweep_dims(dataset)]
    places = []
    for at in np.ndindex(*shape):
        point = dict(zip(sweep_dims(dataset), at, strict=True))
        words = ", ".join(_swept(dataset[name][point[name]]) for name in several)
        places.append(Found(found.isel(point, missing_dims="ignore"), words))
    return places


def _swept(value: xr.DataArray) -> str:
    """A swept value with its key: ``contact load 4 mN``."""
    number = value.item()
    if value.dtype.kind in "fi":
        number = engineering(number, value.attrs.get("units", "1")).replace("-", "−").replace(" ", TIE)
    return f"{str(value.name).replace('_', ' ')} {number}"


def _led(words: str, sentence: str) -> str:
    """A sentence with the place that it is of, if that has words."""
    return f"With {words}, {sentence[0].lower()}{sentence[1:]}" if words else sentence


def _at_the_end(dataset: xr.Dataset) -> xr.Dataset:
    """Statistics over the members at the last record; of steady runs those of the means over the second half."""
    if is_stationary(dataset):
        return summary(settled(all_observables(dataset)), quantiles=False).isel(t=-1)
    return summary(all_observables(dataset.isel(t=[-1])), quantiles=False).isel(t=-1)


def _ranged(places: list[Found], name: str, what: str) -> Iterator[str]:
    """A sentence on an observable over the sweep: what it is, or its least and largest values and where they are.

    None where it is zero throughout.
    """
    known = [(place, mean) for place in places if (mean := place.mean(name)) is not None]
    if not known:
        return
    (low, least), (high, most) = (pick(known, key=lambda one: one[1].value) for pick in (min, max))
    if least.value == most.value == 0.0:
        return
    if len(known) == 1:
        yield f"{what} is {most}{f' ({high.words})' if high.words else ''}."
    elif least.equals(most) or least.beside(most) == str(most):
        yield f"{what} is {most} everywhere in the sweep."
    else:
        yield f"{what} goes from {least.beside(most)} ({low.words}) to {most} ({high.words})."


def _area_over_speed(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """What the area loses from the lowest to the highest speed, to which mechanism, and at which speeds.

    Behind a spring the area at one speed of a steady stage is the mean over stick and slip, and under a ramp nothing,
    where it is that of a moment.
    """
    if speed_name(dataset) != "speed":
        if is_stationary(dataset):
            places = _places(dataset, _at_the_end(dataset))
            yield from _ranged(places, "area_ratio", "The contact area over JKR's")
            for name, words in _TAKEN.items():
                yield from _ranged(places, name, f"What is lost of JKR's area to {words}")
        return
    given = dataset
    if is_steady(dataset):
        axis, found = str(speed_dim(dataset)), _at_the_end(dataset)
        dataset = dataset.isel({axis: [0]})
    else:
        axis, found = "t", summary(all_observables(dataset.isel(t=[0, -1])), quantiles=False)
    sizes = abs(found["speed_mean"]).max([name for name in found["speed_mean"].dims if name != axis])
    ends = int(np.argmin(sizes.to_numpy())), int(np.argmax(sizes.to_numpy()))
    slow, fast = (_places(dataset, found.isel({axis: end})) for end in ends)
    if len(fast) > _FEW:
        yield from _ranged(fast, "area_ratio", "The contact area over JKR's at the highest speed")
        return
    losses = _places(dataset, loss_speeds(given))
    for before, after, lost in zip(slow, fast, losses, strict=True):
        area, left = before.mean("area_ratio"), after.mean("area_ratio")
        speeds = [place.mean("speed") for place in (before, after)]
        if area is None or left is None or None in speeds:
            continue
        way = f"from {speeds[0]} to {speeds[1]}"
        if area.equals(left):
            yield _led(after.words, f"The contact area does not change {way}: it is {left} of JKR's.")
            continue
        verb = "falls" if left.value < area.value else "grows"
        said = f"The contact area {verb} from {area} to {left} of JKR's, {way}{_taken(after)}."
        known = list(filter(None, (_speed(lost.statistics, name, words) for name, words in _LOSSES.items())))
        yield _led(after.words, f"{said} It has lost {', '.join(known)}." if known else said)


def _speed(found: xr.Dataset, name: str, words: str) -> str:
    """A speed in words with its interval, where members differ; "" where it is not known."""
    speed, low, high = (Mean(float(found.get(f"{name}{end}", np.nan)), 0.0, "m/s") for end in ("", "_low", "_high"))
    if not np.isfinite(speed.value):
        return ""
    spans = np.isfinite(low.value) and high.value - low.value > _ROUNDING * speed.value
    return f"{words} at {speed}{f' (95{TIE}%: {low.beside(speed)} to {high.beside(speed)})' if spans else ''}"


def _taken(place: Found) -> str:
    """What each mechanism takes of JKR's area at a place, in words."""
    shares = {words: place.mean(name) for name, words in _TAKEN.items()}
    taken = [f"to {words} {mean}" for words, mean in shares.items() if mean is not None and abs(mean.value) > _ROUNDING]
    order = ", charged in this order" if len(taken) > 1 else ""
    return f"; of JKR's area there is lost {', '.join(taken)}{order}" if taken else ""


def _area_over_sweep(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """The range of the area over a sweep or of a single run, over JKR's."""
    when = "" if is_stationary(dataset) else " at the end of the run"
    places = _places(dataset, _at_the_end(dataset))
    yield from _ranged(places, "area_ratio", f"The contact area over JKR's{when}")
    if len(places) == 1 and (taken := _taken(places[0])):
        yield f"Of{taken.removeprefix('; of')}."


def _area_over_theories(dataset: xr.Dataset, found: xr.Dataset) -> Iterator[str]:
    """The range of the area at each share of the stress's energy that adhesion pays for."""
    (dim,) = setting(dataset, "contact.reversible").dims
    for number in range(dataset.sizes[dim] if dataset.sizes[dim] <= _FEW else 0):
        for said in _area_over_sweep(dataset.isel({dim: [number]}), found):
            yield _led(_swept(dataset["contact_reversible"][number]), said)


def _of_the_run(*asked: tuple[str, str]) -> Answer:
    """Sentences on what a whole run has once: names of events, and what each is in words."""

    def answer(dataset: xr.Dataset, found: xr.Dataset) -> Iterator[str]:
        places = _places(dataset, found)
        for name, words in asked:
            yield from _ranged(places, name, words)

    return answer


def _friction(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """The largest friction in both directions, or the largest and the least; of the means over the members."""
    found = over_members(dataset, ["friction_force"], quantiles=False)
    mean = found["friction_force_mean"].fillna(0.0)
    both = bool((mean.min() < 0.0) & (mean.max() > 0.0))
    named = ("The largest friction", "The least friction")
    words = ("Friction in one direction", "Friction in the other") if both else named
    for end, what in zip((mean.argmax("t"), mean.argmin("t")), words, strict=True):
        yield from _ranged(_places(dataset, found.isel(t=end)), "friction_force", what)


def _creep(dataset: xr.Dataset, whole: xr.Dataset) -> Iterator[str]:
    """How fast what bears its force to the end creeps there, and when what does not gives way."""
    found = _places(dataset, whole)
    late = _places(dataset, summary(all_observables(dataset.isel(t=[-1])), quantiles=False).isel(t=-1))
    shares = [share.value if (share := place.mean("ran_away")) else 0.0 for place in found]
    borne = [place for place, share in zip(late, shares, strict=True) if share == 0.0]
    gone = [place for place, share in zip(found, shares, strict=True) if share > 0.0]
    force = dataset["spring_force"]
    if bool((force.max("t") > force.min("t")).any()):
        yield from _ranged(gone, "static_friction", "The force at which the contact gives way")
    yield from _ranged(borne, "speed", "Where the force is borne to the end of the run, the speed there")
    if "friction_force" in dataset and bool((abs(1.0 - dataset["friction_force"] / force).isel(t=-1) > _APART).any()):
        yield from _ranged(borne, "friction_force", "The part of the force that the bonds bear there, friction,")
    yield from _ranged(gone, "runaway_after", "The time after which the contact gives way")
    if any(share not in (0.0, 1.0) for share in shares):
        yield from _ranged(found, "ran_away", "The share of the members whose contact gives way")


def _stick_and_slip(dataset: xr.Dataset, whole: xr.Dataset) -> Iterator[str]:
    """Speeds of a stage between which slips follow each other, and behind which springs they never do."""
    places = _places(dataset, whole)
    onset = "The onset of stick-slip, the speed of the stage at the first slip that another one follows,"
    yield from _ranged(places, "slips_from", onset)
    end = "The end of stick-slip as the stage gets slower, its speed at the last slip that follows another,"
    yield from _ranged(places, "slips_down_to", end)
    ends = ("slips_from", "slips_down_to")
    calm = [place.words for place in places if not any(place.mean(name) for name in ends)]
    if 0 < len(calm) < len(places):
        yield f"Slips never follow each other with {', '.join(calm) if len(calm) <= _FEW else f'{len(calm)} of these'}."


_OPENINGS = _of_the_run(("ever_detached", "The share of the members that come off"))

#: What answers the question of a scene, by the kind of figure that fits it.
_ANSWERS: dict[str, tuple[Answer, ...]] = {
    "loop": (
        _of_the_run(
            ("loop_dissipation", "The energy dissipated in a cycle there and back"),
            ("pull_off_load", "The lowest load that the contact bears"),
        ),
    ),
    "theories": (_area_over_theories,),
    "stress": (
        _of_the_run(
            ("peak_stress", "The largest shear stress after the start"),
            ("peak_time", "The time from the start to that peak"),
        ),
    ),
    "stability": (),
    "creep": (_creep,),
    "friction": (_friction,),
    "curve": (_area_over_speed, _of_the_run(("peak_stress", "The maximum of the shear stress on the ramp")), _OPENINGS),
    "sweep": (_area_over_sweep, _OPENINGS),
    "time": (_area_over_sweep, _OPENINGS),
}
_COUNTED = _of_the_run(
    ("slip_count", "The number of slips of the slider behind its spring"),
    ("static_friction", "The force at which a slip or sliding begins"),
    ("force_drop", "The fall of the force in a slip"),
    ("recurrence_time", "The time from slip to slip"),
)
_KINETIC = _of_the_run(("kinetic_friction", "The work of the stage over its way, the kinetic friction,"))
#: Answers to a jump of the speed, and to a pull from rest.
_TRANSIENTS = _of_the_run(
    ("direct_effect", "The direct effect, the rise of friction after the first jump to a higher speed,"),
    ("step_overshoot", "The overshoot of friction over the level at which it then settles"),
    ("step_length", "The sliding distance from the jump until 1/e of that overshoot is left"),
    ("static_threshold", "The static threshold, the largest force on the way to sliding,"),
    ("area_at_threshold", "The contact area at the threshold over that at rest"),
    ("area_by_law", "By the law A₀ − αQ², fitted up to half of the threshold, it"),
    ("incipient_alpha", "The coefficient α of that law"),
)
