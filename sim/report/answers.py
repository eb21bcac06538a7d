"""The answer of a run in a sentence, by the kind of its scene: numbers of ``sim stats`` with their standard errors."""

import contextlib
from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from sim.analysis import is_stationary, is_steady, loss_speeds, setting, settled, summary
from sim.analysis.observables import all_observables
from sim.analysis.over_speed import speed_dim
from sim.analysis.scene import MEMBERS, answered, control, speed_name, speed_of
from sim.analysis.statistics import over_members
from sim.analysis.tables import once
from sim.laws import jkr
from sim.plots import kinds
from sim.report.sentences import ROUNDING, TIE, Found, Mean, from_on, led, points_of, ranged, swept

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
#: Members from which on their spread is told.
_MANY = 16
#: Points of a sweep that each have a sentence, at most.
_FEW = 4


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


def _at_the_end(dataset: xr.Dataset) -> xr.Dataset:
    """Statistics over the members at the last record; of steady runs those of the means over the second half.

    Beside them the standard deviation of the area between members at one time, with its standard error.
    """
    late, last = is_stationary(dataset), all_observables(dataset.isel(t=[-1]))
    found = summary(settled(all_observables(dataset)) if late else last, quantiles=False).isel(t=-1)
    if "area_ratio" in last and last.sizes.get(MEMBERS, 1) >= _MANY:
        apart = last["area_ratio"].isel(t=0)
        apart = apart - apart.mean(MEMBERS)
        spread = apart.std(MEMBERS, ddof=1)
        peaked = (apart**4).mean(MEMBERS) / spread.where(spread > 0.0) ** 4
        error = 0.5 * spread * ((peaked - 1.0) / apart.sizes[MEMBERS]) ** 0.5
        found = found.assign(area_spread_mean=spread.assign_attrs(units="1"), area_spread_sem=error)
    return found


def _area_over_speed(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """What the area loses from the lowest to the highest speed, to which mechanism, and at which speeds.

    Behind a spring the area at one speed of a steady stage is the mean over stick and slip, and under a ramp nothing,
    where it is that of a moment.
    """
    if speed_name(dataset) != "speed":
        if is_stationary(dataset):
            places = points_of(dataset, _at_the_end(dataset))
            yield from ranged(places, "area_ratio", "The contact area over JKR's")
            for name, words in _TAKEN.items():
                yield from ranged(places, name, f"What is lost of JKR's area to {words}")
        return
    given = dataset
    if is_steady(dataset):
        axis, found = str(speed_dim(dataset)), _at_the_end(dataset)
        dataset = dataset.isel({axis: [0]})
    else:
        axis, found = "t", summary(all_observables(dataset.isel(t=[0, -1])), quantiles=False)
    sizes = abs(found["speed_mean"]).max([name for name in found["speed_mean"].dims if name != axis])
    ends = int(np.argmin(sizes.to_numpy())), int(np.argmax(sizes.to_numpy()))
    slow, fast = (points_of(dataset, found.isel({axis: end})) for end in ends)
    if len(fast) > _FEW:
        yield from ranged(fast, "area_ratio", "The contact area over JKR's at the highest speed")
        return
    losses = points_of(dataset, loss_speeds(given))
    for before, after, lost in zip(slow, fast, losses, strict=True):
        area, left = before.mean("area_ratio"), after.mean("area_ratio")
        speeds = [place.mean("speed") for place in (before, after)]
        if area is None or left is None or None in speeds:
            continue
        way = f"from {speeds[0]} to {speeds[1]}"
        if area.equals(left):
            yield led(after.words, f"The contact area does not change {way}: it is {left} of JKR's.")
            continue
        verb = "falls" if left.value < area.value else "grows"
        said = f"The contact area {verb} from {area} to {left} of JKR's, {way}{_taken(after)}."
        known = list(filter(None, (_speed(lost.statistics, name, words) for name, words in _LOSSES.items())))
        yield led(after.words, f"{said} It has lost {', '.join(known)}." if known else said)


def _speed(found: xr.Dataset, name: str, words: str) -> str:
    """A speed in words with its interval, where members differ; "" where it is not known."""
    speed, low, high = (Mean(float(found.get(f"{name}{end}", np.nan)), 0.0, "m/s") for end in ("", "_low", "_high"))
    if not np.isfinite(speed.value):
        return ""
    spans = np.isfinite(low.value) and high.value - low.value > ROUNDING * speed.value
    return f"{words} at {speed}{f' (95{TIE}%: {low.beside(speed)} to {high.beside(speed)})' if spans else ''}"


def _taken(place: Found) -> str:
    """What each mechanism takes of JKR's area at a place, in words."""
    shares = {words: place.mean(name) for name, words in _TAKEN.items()}
    taken = [f"to {words} {mean}" for words, mean in shares.items() if mean is not None and abs(mean.value) > ROUNDING]
    order = ", charged in this order" if len(taken) > 1 else ""
    return f"; of JKR's area there is lost {', '.join(taken)}{order}" if taken else ""


def _area_over_sweep(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """The range of the area over a sweep or of a single run, over JKR's, from where on adhesion is masked, friction."""
    when = "" if is_stationary(dataset) else " at the end of the run"
    found = _at_the_end(dataset)
    places = points_of(dataset, found)
    closed = [place for place in places if (opened := place.mean("fraction_detached")) is None or opened.value < 1.0]
    yield from ranged(closed, "area_ratio", f"The contact area over JKR's{when}")
    if 0 < len(places) - len(closed) <= _FEW:
        yield f"The contact is open with {', '.join(place.words for place in places if place not in closed)}."
    if len(places) == 1 and (taken := _taken(places[0])):
        yield f"Of{taken.removeprefix('; of')}."
    yield from ranged(closed, "area_spread", "Its standard deviation between the members at the end of the run")
    yield from from_on(dataset, places, [place.mean("fraction_masked") for place in places], "Adhesion is masked")


def _friction_over_sweep(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """The range of friction over a sweep of steady runs, and whether it is in proportion to the area."""
    if not is_stationary(dataset) or speed_name(dataset) == "stage_speed":
        return
    places = points_of(dataset, _at_the_end(dataset))
    closed = [place for place in places if (opened := place.mean("fraction_detached")) is None or opened.value < 1.0]
    yield from ranged(closed, "friction_force", "Friction")
    stresses = [stress for place in closed if (stress := place.mean("shear_stress"))]
    if stresses and all(stress.equals(stresses[0]) for stress in stresses):
        yield from ranged(closed, "shear_stress", "The mean shear stress, friction over contact area,")


def _area_over_theories(dataset: xr.Dataset, found: xr.Dataset) -> Iterator[str]:
    """The range of the area at each share of the stress's energy that adhesion pays for."""
    (dim,) = setting(dataset, "contact.reversible").dims
    for number in range(dataset.sizes[dim] if dataset.sizes[dim] <= _FEW else 0):
        for said in _area_over_sweep(dataset.isel({dim: [number]}), found):
            yield led(swept(dataset["contact_reversible"][number]), said)


def _of_the_run(*asked: tuple[str, str]) -> Answer:
    """Sentences on what a whole run has once: names of events, and what each is in words."""

    def answer(dataset: xr.Dataset, found: xr.Dataset) -> Iterator[str]:
        places = points_of(dataset, found)
        for name, words in asked:
            yield from ranged(places, name, words)

    return answer


def _friction(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """The largest friction in both directions, or the largest and the least; of the means over the members."""
    found = over_members(dataset, ["friction_force"], quantiles=False)
    mean = found["friction_force_mean"].fillna(0.0)
    both = bool((mean.min() < 0.0) & (mean.max() > 0.0))
    named = ("The largest friction", "The least friction")
    words = ("Friction in one direction", "Friction in the other") if both else named
    for end, what in zip((mean.argmax("t"), mean.argmin("t")), words, strict=True):
        yield from ranged(points_of(dataset, found.isel(t=end)), "friction_force", what)


def _stroke(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """How far stage and slider go in the last whole stroke of a stage that goes there and back, and its work."""
    words = {
        "stage_position": "The way of the stage in a stroke", "slider_position": "The way of the slider in it",
        "drive_work": "The work of the stage in it",
    }  # fmt: skip
    stage = speed_of(dataset).to_numpy()
    if not {*words} <= {*dataset.data_vars} or stage.ndim > 1:  # points of a sweep may turn at different times
        return
    moving = np.flatnonzero(stage)
    turns = moving[np.flatnonzero(np.diff(np.sign(stage[moving])))]
    if turns.size > 1:
        ends = dataset[[*words]].isel(t=turns[-2:]).astype(float)
        gone = {name: abs(one.diff("t").isel(t=0)).assign_attrs(one.attrs) for name, one in ends.items()}
        found = summary(xr.Dataset(gone), quantiles=False)
        for name, what in words.items():
            yield from ranged(points_of(dataset, found), name, what)


def _read_work(dataset: xr.Dataset, _: xr.Dataset) -> Iterator[str]:
    """What a JKR test reads: the energy release rate of load and radius, on the way to the largest load and back."""
    if control(dataset).kind != "load" or "normal_load" not in dataset:
        return
    load, radius = dataset["normal_load"].astype(float), dataset["contact_radius"].astype(float)
    sphere = setting(dataset, "sphere.radius"), dataset["contact_modulus"]
    read = xr.apply_ufunc(jkr.energy_release_rate, radius.where(radius > 0.0), load, *sphere)
    loading = dataset["t"] <= load.idxmax("t")
    ways = {"loading": read.where(loading).mean("t"), "unloading": read.where(~loading).mean("t")}
    found = summary(xr.Dataset({way: one.assign_attrs(units="J/m^2") for way, one in ways.items()}), quantiles=False)
    for way in ways:
        what = f"The work of adhesion that JKR's theory reads off load and radius, on average while {way},"
        yield from ranged(points_of(dataset, found), way, what)


def _pull_off(dataset: xr.Dataset, whole: xr.Dataset) -> Iterator[str]:
    """The largest pull that the contacts bear that come off."""
    gone = [
        place for place in points_of(dataset, whole) if (share := place.mean("ever_detached")) and share.value > 0.0
    ]
    yield from ranged(gone, "pull_off_load", "The pull-off load, the lowest that the contact bears,")


def _creep(dataset: xr.Dataset, whole: xr.Dataset) -> Iterator[str]:
    """How fast what bears its force to the end creeps there, and when what does not gives way."""
    steady = is_stationary(dataset)
    found, late = points_of(dataset, whole), points_of(dataset, _at_the_end(dataset))
    shares = [share.value if (share := place.mean("ran_away")) else 0.0 for place in found]
    borne = [place for place, share in zip(late, shares, strict=True) if share == 0.0]
    gone = [place for place, share in zip(found, shares, strict=True) if share > 0.0]
    force = dataset["spring_force"]
    if bool((force.max("t") > force.min("t")).any()):
        yield from ranged(gone, "static_friction", "The force at which the contact gives way")
    yield from from_on(dataset, found, [place.mean("ran_away") for place in found], "The contact gives way")
    creeps = "The speed" if steady else "Where the force is borne to the end of the run, the speed there"
    yield from ranged(borne, "speed", creeps)
    if "friction_force" in dataset and bool((abs(1.0 - dataset["friction_force"] / force).isel(t=-1) > _APART).any()):
        part = (
            "The part of the force that the bonds bear, friction," if steady else "Friction, what the bonds bear there,"
        )
        yield from ranged(borne, "friction_force", part)
    yield from ranged(gone, "runaway_after", "The time after which the contact gives way")
    if any(share not in (0.0, 1.0) for share in shares):
        yield from ranged(found, "ran_away", "The share of the members whose contact gives way")


def _stick_and_slip(dataset: xr.Dataset, whole: xr.Dataset) -> Iterator[str]:
    """Speeds of a stage between which slips follow each other, and behind which springs they never do."""
    places = points_of(dataset, whole)
    onset = "The onset of stick-slip, the speed of the stage at the first slip that another one follows,"
    yield from ranged(places, "slips_from", onset)
    end = "The end of stick-slip as the stage gets slower, its speed at the last slip that follows another,"
    yield from ranged(places, "slips_down_to", end)
    ends = ("slips_from", "slips_down_to")
    if is_stationary(dataset):
        counts = [place.mean("slip_count") for place in places]
        slipping = [count and count._replace(value=float(count.value > 0.0)) for count in counts]
        yield from from_on(dataset, places, slipping, "It sticks and slips")
    calm = [place.words for place in places if not any(place.mean(name) for name in ends)]
    if 0 < len(calm) < len(places):
        yield f"Slips never follow each other with {', '.join(calm) if len(calm) <= _FEW else f'{len(calm)} of these'}."


_PEAK = _of_the_run(
    ("peak_stress", "The maximum of the shear stress on the ramp"), ("peak_speed", "The sliding speed at that maximum")
)
_OPENINGS = _of_the_run(("ever_detached", "The share of the members that come off"))

#: What answers the question of a scene, by the kind of figure that fits it.
_ANSWERS: dict[str, tuple[Answer, ...]] = {
    "loop": (
        _read_work,
        _of_the_run(("loop_dissipation", "The energy dissipated in a cycle there and back")),
        _pull_off,
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
    "friction": (_stroke, _friction),
    "curve": (_area_over_speed, _PEAK, _OPENINGS),
    "sweep": (_area_over_sweep, _friction_over_sweep, _OPENINGS),
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
