"""Judgement of a run before it starts: systematic errors of its results, remarks, and the limits of its contact."""

import functools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from sim.ensemble.expected import (
    TIMES,
    Expected,
    StoredEnergy,
    along,
    areas,
    energies_of,
    expected,
    jkr_radius,
    largest_losses,
)
from sim.ensemble.plan import Plan
from sim.ensemble.steady import bonds_at, changed, sensitivities
from sim.ensemble.swept import grouped, in_words, places, points_in_words, spread
from sim.laws.schallamach import Body, Onset
from sim.parts.bonds.models import Model as BondModel
from sim.parts.contact.balance import Balance
from sim.parts.drive import Spring
from sim.parts.exchange import Array
from sim.parts.shear import Mean
from sim.quantities import ERRORS
from sim.scenario.checks import renewed
from sim.scenario.scenario import Scenario
from sim.spectrum.families import Band
from sim.spectrum.family import Family
from sim.step.state import MemberNoise
from sim.units.notation import engineering

#: Points of a sweep whose steady sliding is computed, and points that are searched for remarks.
COMPUTED, SEARCHED = 12, 100
#: Steps of a ramp, and keys in a sentence.
_STEPS, _KEYS = 1000, 5
#: Error of A/A_JKR and lag that need a sentence; share of masked or open contacts and points of the area that do not.
_ERROR, _LAG, _NEVER, _NO_POINT = 0.01, 0.005, 1e-4, 0.05
#: Members whose contacts are computed at the start of a run.
_STARTED = 16
#: Points along a side of a cell beyond which no more are proposed; wavelengths of a band over a correlation length.
_MOST_POINTS, _BAND = 2**14, (0.8, 1.2)
#: Relative change of bonds and stress in the derivative of the area; duration over that of a ramp that nothing delays.
_RELATIVE_STEP, _VERY_SLOW = 1e-4, 1e6

#: Slowest and fastest speed that is examined, over those of the stage; number of speeds on either side.
_SLOWER, _FASTER, _AROUND = 0.01, 100.0, 5
#: Values of K_c/K − 1 from which on no slope is used, and at which a limit is found; width of ln V at which it is, too.
_STEEP, _ZERO, _NARROW = 10.0, 1e-4, 1e-4

#: What a larger cell and the mean do beside the change that is announced.
_LESS_SPREAD = " (the spread of ΔΓ between members falls, too, which changes the mean area further)"

#: A point of a sweep, and its systematic errors.
Worst = tuple[Scenario, dict[str, float]]


def systematic_errors(point: Scenario) -> dict[str, float]:
    """Return the known errors of the shear process, and those of area and friction by the names of ``ERRORS``.

    There are none of area and friction without a cell. They are those of the mean over members in steady sliding. The
    energy of a member is a gamma number with an offset, of the mean, variance and skewness in the cell. The error of
    the cell is that of this mean against the infinite plane, the error of the bands that of the skewness against all
    modes. A clock step adds at most the variance of the radius that a lagging edge gains by it, and along a prescribed
    course of the speed what the contact changes while its bonds are late by the step. They are nan if the contact opens
    at some of the energies at all times.
    """
    shear, plane = (
        point.fluctuations,
        point.elastic.stored_energy(point.fluctuations.spectrum),
    )
    if (
        "cell_error_energy" not in (known := point.process.known_errors())
        or not plane > 0.0
    ):
        return known
    law, count = StoredEnergy.of(point), energies_of(point)
    whole = law.skewness / (1.0 - known.get("banded_error_third_cumulant", 0.0))
    energies = np.concatenate(
        [
            each.values(count)
            for each in (law, law._replace(mean=plane), law._replace(skewness=whole))
        ]
    )
    times, speeds = along(point)
    scene = (
        changed(point, {"shear.amplitude.floor": 1.0}) if shear.law.remembers else point
    )
    ratios = areas(scene, times, speeds, energies).reshape(len(times), 3, -1)
    (cell, exact, banded), gained = np.mean(ratios, axis=-1).T, np.zeros(len(times))
    if point.contact.lags and point.feels_steps:
        left = -0.5 * np.log1p(
            -np.clip(renewed(point, speeds[:, 0] * point.clock.step), 1e-12, 0.999)
        )
        gained = np.var(np.sqrt(ratios[:, 0]), axis=-1) * np.minimum(
            left / np.tanh(left) - 1.0, 1.0
        )
    if len(times) > 1 and not point.drive.solves_motion:
        gained = gained + _late(scene, times, speeds, energies[:count]) - cell
    errors = np.stack([cell - exact, cell - banded, gained])
    worst = int(np.argmax(np.nan_to_num(np.sum(np.abs(errors), axis=0))))
    relative = errors[:, worst] / (exact[worst] or math.nan)
    values = *errors[:, worst], *relative, speeds[worst, 0], np.std(ratios[worst, 0])
    names = (row.name for row in ERRORS)
    return known | dict(zip(names, map(float, values), strict=True))


def _late(scene: Scenario, times: Array, speeds: Array, stored: Array) -> Array:
    """Return the mean A/A_JKR along a course of the speed with bonds that are late by the clock step, shape (times,).

    The amplitude of the fluctuations is that at the speed itself.
    """
    law = scene.fluctuations.amplitude
    fraction = bonds_at(scene.population, tuple(speeds[:, 0])).fraction
    late = scene.population.delay(fraction, scene.clock.step)
    fine = np.linspace(0.0, scene.times.duration, _STEPS)
    earlier = np.interp(times[:, 0] - late, fine, np.abs(scene.speeds(_STEPS)))
    strength = bonds_at(scene.population, tuple(earlier)).strength[:, np.newaxis]
    earlier = earlier[:, np.newaxis]
    now, before = (law.factor(each, strength) ** 2 for each in (speeds, earlier))
    ratio = np.divide(now, before, out=np.ones(before.shape), where=before > 0.0)
    return np.asarray(np.mean(areas(scene, times, earlier, ratio * stored), axis=-1))


def worst(candidates: Iterable[Worst]) -> Worst | None:
    """Return that of some points at which the cell changes A/A_JKR most, with its errors; None without a cell."""
    known = [
        pair
        for pair in candidates
        if math.isfinite(pair[1].get("cell_error_area", math.nan))
    ]
    return max(known, key=lambda pair: abs(pair[1]["cell_error_area"]), default=None)


def worst_of_sweep(points: Sequence[Scenario]) -> Worst | None:
    """Return the ``worst`` of some points of a sweep."""
    return worst((point, systematic_errors(point)) for point in spread(points))


def cure(point: Scenario, errors: dict[str, float]) -> str:
    """Return the keys that reduce the error of the cell to about a tenth; "" if A/A_JKR is off by less than 1 point.

    The error falls with the side of the cell, unless the grid has too few points for the short waves. It is that of the
    mean energy at the same spread, so that a remark follows the keys if these also reduce the spread.
    """
    if not abs(errors["cell_error_area"]) > _ERROR:
        return ""
    shear, solid = cast(Any, point.fluctuations), point.elastic
    side, points, error = (
        shear.side(point.setting.cell),
        shear.points,
        errors["cell_error_energy"],
    )
    decade = 10.0 ** math.floor(math.log10(10.0 * side))

    def lacks(cell: float, share: float) -> bool:
        return points and 1.0 - solid.share_of_long_waves(
            shear.spectrum, 2.0 * cell / points
        ) > share * abs(error)

    wide = side if lacks(side, 0.5) else math.ceil(10.0 * side / decade - 0.05) * decade
    while lacks(wide, 0.02) and points < _MOST_POINTS:
        points *= 2
    changes = (
        [f'shear.cell = "{engineering(wide, "m").replace("µ", "u")}"']
        if wide > side
        else []
    )
    changes += [f"shear.points = {points}"] if points != shear.points else []
    many = changed(shear, {"cell": wide, "points": points}).too_many_modes(wide)
    keys = 'shear.model = "mean"' if many else " and ".join(changes)
    return keys + _LESS_SPREAD * (bool(many) or wide > side)


def error_in_words(plan: Plan, point: Scenario, errors: dict[str, float]) -> str:
    """Return where the systematic errors of a point are largest, with the amplitude if that depends on the motion."""
    at = in_words(plan, point, errors["error_speed"])
    return f"{at}, at amplitude 1" if point.shear.law.remembers else at


def remarks(plan: Plan, most: Worst | None = None) -> list[str]:
    """Return the remarks on a run, one sentence each; ``most`` are its ``worst`` errors if they are known."""
    # modes are slow to make, and the remarks on a clock step need them
    many = COMPUTED if plan.points[0].fluctuations.keeps_modes else SEARCHED
    texts = grouped(plan, places(len(plan.points), many), Scenario.remarks)
    texts += grouped(plan, places(len(plan.points), COMPUTED), _outside)
    if (most := most or worst_of_sweep(plan.points)) and (keys := cure(*most)):
        area, friction = (
            100.0 * most[1][f"cell_error_{of}"] for of in ("area", "friction")
        )
        too, at = "large" if area > 0.0 else "small", error_in_words(plan, *most)
        size = (
            f"{abs(area):.2g} points and the friction {abs(friction):.2g} % too {too}"
        )
        texts.append(
            f"the mean ΔΓ of the cell makes A/A_JKR up to {size} (at {at}): {keys}"
        )
    if plan.scenario.record.per_member is None and not plan.per_member:
        texts.append(
            "a file with every member would exceed 20 GB: only mean, spread and standard error are recorded"
            " (record.per_member = true records every member)"
        )
    return texts


def diagnosis(plan: Plan) -> list[str]:
    """Return the expectations of a run in sentences: what opens or masks its contacts, and what reduces their area.

    Sentences on steady sliding are of those points of a sweep at which contacts are closed at some time.
    """
    examined = places(len(plan.points), COMPUTED)
    stay_open = [place for place in examined if _stays_open(plan, plan.points[place])]
    opened = list(_open(plan, stay_open, examined))
    scenes = {
        place: plan.points[place]
        for place in examined
        if not plan.points[place].fluctuations.passes and place not in stay_open
    }
    courses = {place: expected(scene) for place, scene in scenes.items()}
    closed = {
        place: course
        for place, course in courses.items()
        if np.any(np.isfinite(course.area))
    }
    if not closed:
        return opened
    middle = plan.points[list(closed)[len(closed) // 2]]
    return [
        *opened,
        *_stored(plan, closed),
        *_masked(plan, closed, examined),
        *_pulled_off(plan, closed, examined),
        *_smallest_area(plan, closed),
        *_largest_losses(plan, list(closed)),
        *grouped(plan, list(closed), _waves),
        *_sensitive(plan, middle),
        *_most_lagging(plan, list(closed)),
    ]


#: Steady sliding at points of a sweep, by their places.
Courses = Mapping[int, Expected]


def _percents(shares: Iterable[float]) -> str:
    """Return shares in percent as text, the least and the largest of several; only all is 100 %."""
    known = [100.0 * share for share in shares if math.isfinite(share)]
    ends = (
        "over 99.9" if 99.95 <= value < 100.0 else f"{value:.3g}"
        for value in (min(known), max(known))
    )
    return f"{' to '.join(dict.fromkeys(ends))} %"


def _stays_open(plan: Plan, point: Scenario) -> bool:
    """Return True if the first members of a run start with an open contact, and no mount closes it later."""
    contact = point.contact
    # a dead load comes back at a load of zero, whatever the range of adhesion
    is_held = contact.kind != "load"
    reach = contact.jump_in_distance(point.adhesion.work) if is_held else 0.0
    if max(contact.course.extremes) >= -reach:
        return False
    members = np.arange(min(plan.members, _STARTED))
    state = point.stepper.start(MemberNoise.of(point.seed, members))
    return bool(np.isnan(state.contact.radius).all())


def _open(plan: Plan, opened: Sequence[int], examined: Sequence[int]) -> Iterator[str]:
    """Yield a sentence on contacts that are open at the start of a run and stay open."""
    if not opened:
        return
    text = f"open for the whole run {points_in_words(plan, opened, examined)}".rstrip()
    few = f" (by the first {_STARTED} members)" * (plan.members > _STARTED)
    yield f"{text}{few}: no contact is closed at the start, and the mount closes none"


def _stored(plan: Plan, courses: Courses) -> Iterator[str]:
    """Yield a sentence on the size of the stored energy beside the work of adhesion."""
    most = {place: float(np.max(course.energy)) for place, course in courses.items()}
    works = [plan.points[place].adhesion.work for place in courses]
    if not max(most.values()) > 0.0 or not min(works) > 0.0:
        return
    ends = (engineering(end(most.values()), "J/m^2") for end in (min, max))
    shares = (most[place] / plan.points[place].adhesion.work for place in most)
    changes = any(np.ptp(course.energy) > 0.0 for course in courses.values())
    yield (
        f"stored energy in steady sliding {'up to ' * changes}{' to '.join(dict.fromkeys(ends))},"
        f" {_percents(shares)} of the work of adhesion"
    )


def _masked(plan: Plan, courses: Courses, examined: Sequence[int]) -> Iterator[str]:
    """Yield a sentence on the share of the time in which contacts are masked."""
    most = {
        place: float(np.max(course.masked))
        for place, course in courses.items()
        if plan.points[place].adhesion.work > 0.0
    }
    masked = [place for place, share in most.items() if share > _NEVER]
    if not masked:
        return
    along_run = [courses[place].masked_time for place in masked]
    varies = any(len(courses[place].masked) > 1 for place in masked)
    noise = any(plan.points[place].population.is_random for place in masked)
    text = f"masked for {'about ' * varies}{_percents(along_run)} of the time in steady sliding"
    text += ", without the noise of the bonds" * noise
    text += f" {points_in_words(plan, masked, examined)}".rstrip()
    place = max(masked, key=lambda place: most[place])
    members = f"{_percents([most[place]])} of the members at one time"
    if len(masked) > 1 or varies:
        speed = float(courses[place].speed[np.argmax(courses[place].masked)])
        at = in_words(plan, plan.points[place], speed)
        yield f"{text}; most at {at}: {members}"
    else:
        yield f"{text}, as are {members}"


def _pulled_off(plan: Plan, courses: Courses, examined: Sequence[int]) -> Iterator[str]:
    """Yield a sentence on contacts that fluctuations and broken bonds open."""
    # a contact that is open with all its adhesion is none that they open
    lost = {
        place: float(np.max(np.where(np.isnan(course.without[0]), 0.0, course.lost)))
        for place, course in courses.items()
    }
    opened = [place for place, share in lost.items() if share > _NEVER]
    if opened:
        shares = _percents(lost[place] for place in opened)
        where = points_in_words(plan, opened, examined)
        text = "pulled off in steady sliding: at one time bonds and fluctuations take what the contact needs in"
        text = f"{text} up to {shares} of the members {where}".rstrip()
        adds_up = min(lost[place] for place in opened) < 1.0
        yield f"{text}{'; members that stay open add up over the run' * adds_up}"


def _smallest_area(plan: Plan, courses: Courses) -> Iterator[str]:
    """Yield the mean A/A_JKR where it is smallest, and the points that each mechanism takes in both orders."""
    place = min(courses, key=lambda place: float(np.nanmin(courses[place].area)))
    course = courses[place]
    row = int(np.nanargmin(course.area))
    rest, bonds, waves, left = 100.0 * course.without[:, row]
    # if bonds are subtracted before the fluctuations, and after them
    taken = {
        "the mean stress": (100.0 - rest, 100.0 - rest),
        "bonds": (rest - bonds, waves - left),
        "fluctuations": (bonds - left, rest - waves),
    }
    taken = {name: pair for name, pair in taken.items() if max(pair) > _NO_POINT}
    if not taken:
        return
    every = np.concatenate([course.area for course in courses.values()])
    varies = np.nanmax(every) > np.nanmin(every)
    smallest = ", smallest" if varies else ""
    point = plan.points[place]
    at = in_words(plan, point, float(course.speed[row]))
    if varies and point.contact.changes:
        contact, time = point.contact, along(point)[0][row]
        size = float(contact.course.at(time, point.times.duration)[0])
        unit = "N" if contact.kind == "load" else "m"
        at += f", contact.{contact.kind} = {engineering(size, unit)}"
    text = f"in steady sliding mean A/A_JKR {_percents(every)}{smallest} at {at}: points taken by"
    text += ",".join(f" {name} {points:.2g}" for name, (points, _) in taken.items())
    if taken.keys() >= {"bonds", "fluctuations"}:
        bonds, waves = taken["bonds"][1], taken["fluctuations"][1]
        text += f" ({bonds:.2g} and {waves:.2g} if fluctuations are subtracted first)"
    yield text


def _largest_losses(plan: Plan, closed: Sequence[int]) -> Iterator[str]:
    """Yield the largest loss of area that each mechanism can cause at the load of the run."""
    points = [plan.points[place] for place in closed]
    losses = [largest_losses(point) for point in points]
    whole = [float(np.nanmax(loss.waves)) for loss in losses]
    all_paid = all(point.fluctuations.paid_by_adhesion > 0.0 for point in points)
    columns: dict[str, list[Array]] = {
        "broken bonds": [loss.bonds for loss in losses],
        "fluctuations" + " if shear.paid_by_adhesion = 1" * (not all_paid): [
            loss.waves for loss in losses
        ],
    }
    # a prescribed force has no speed of steady sliding that is known before the run
    if all(
        point.contact.takes_mean_stress and not point.drive.forces for point in points
    ):
        columns["the mean stress of steady sliding if contact.reversible = 1"] = [
            np.nanmax(loss.mean_stress, keepdims=True) for loss in losses
        ]
    by_size: dict[str, list[str]] = {}
    for name, column in columns.items():
        shares = np.concatenate(column)
        size = _percents(shares) + " (a pull-off)" * bool(np.nanmax(shares) == 1.0)
        by_size.setdefault(size, []).append(name)
    at = in_words(plan, points[int(np.argmax(whole))]) if np.ptp(whole) > 0.0 else ""
    most = f" (most at {at})" if at else ""
    words = (
        f"{size} by {', by '.join(names)}{', each alone' if len(names) > 1 else ''}"
        for size, names in by_size.items()
    )
    kind = points[0].contact.kind
    yield f"largest loss of area at this {kind}{most}: {'; '.join(words)}"


def _waves(point: Scenario) -> Iterator[str]:
    """Yield sentences on the waves that store the energy."""
    spectrum = point.fluctuations.spectrum
    if not (spectrum.variance and point.rest_radius > 0.0):
        return
    long_waves = point.elastic.share_of_long_waves(spectrum, 2.0 * point.rest_radius)
    if long_waves > _LAG:
        yield f"waves longer than the contact store {100.0 * long_waves:.2g} % of the energy"
    if (times := over_band(spectrum)) is not None:
        short, long = (
            engineering(factor * cast(Any, spectrum).length, "m") for factor in _BAND
        )
        yield (
            f"shear.spectrum.length is a correlation length: wavelengths from {short} to {long} with the same rms store"
            f" {times:.2g} times less energy"
        )


def _sensitive(plan: Plan, point: Scenario) -> Iterator[str]:
    """Yield the keys that change area and friction most, at the middle of a run."""
    time, speed = 0.5 * point.clock.duration, abs(float(point.speeds(3)[1]))
    known = sensitivities(point, time, speed)
    words = [
        f"{key} {area:+.2g}" + f"/{force:+.2g}" * bool(force)
        for key, (area, force) in list(known.items())[:_KEYS]
    ]
    if words:
        at = in_words(plan, point, speed)
        shear = point.fluctuations
        fluctuates = shear.random_variance * shear.paid_by_adhesion > 0.0
        of_mean = " and the mean ΔΓ" * fluctuates
        yield f"area/friction change (%) for 1 % more of a key, at {at}{of_mean}: {', '.join(words)}"


def over_band(spectrum: Family) -> float | None:
    """Return the energy of a spectrum over that of wavelengths near its correlation length with the same rms.

    It is None for a spectrum without a correlation length. The energy grows with the length, so a pattern of the
    wavelength λ has the energy of the correlation length λ over this number.
    """
    if getattr(spectrum, "model", "") not in ("gaussian", "von_karman"):
        return None
    short, long = (factor * cast(Any, spectrum).length for factor in _BAND)
    band = Band(rms=cast(Any, spectrum).rms, shortest=short, longest=long)
    return spectrum.over_wavenumber[0] / band.over_wavenumber[0]


def _along_course(point: Scenario, slower: float) -> Array:
    """Return A/A_JKR, the friction over that of A_JKR [Pa] and the speed [m/s] along a course, shape (3, steps).

    The run is followed in 1000 steps without noise, from steady bonds, ``slower`` by a factor.
    """
    shear, duration = cast(Any, point.fluctuations), slower * point.clock.duration
    values: dict[str, Any] = (
        {"bonds.start": "steady"} if point.population.stretched else {}
    )
    values |= (
        {"drive.time": tuple(slower * time for time in point.drive.time)}
        if point.drive.model == "table"
        else {}
    )
    if not math.isinf(shear.side(point.setting.cell)):
        values["shear"] = Mean(
            shear.spectrum, shear.law, shear.paid_by_adhesion, shear.contact
        )
    scene = changed(
        point, values | {"clock.duration": duration, "clock.step": duration / _STEPS}
    )
    noise = MemberNoise.of(0, np.zeros(1, int))
    course = scene.stepper.follow(noise, None, range(_STEPS + 1))[1]
    area = course.radius**2 / jkr_radius(scene, course.time) ** 2
    return np.stack([area, area * course.strength, course.speed])[..., 0]


def _behind(course: Array, steady: Array) -> tuple[float, float, float]:
    """Return how far the mean along a prescribed course of the speed is from that along a very slow one, and where.

    Parameters
    ----------
    course, steady : array
        Results of ``_along_course`` for both.

    Returns
    -------
    area, friction, speed : float
        Largest differences of A/A_JKR, and of the friction over its largest [1]; the speed at which both together are
        largest [m/s]. They are nan without a contact.
    """
    area, friction = np.abs(course - steady)[:2]
    friction = friction / max(np.max(steady[1]), 1e-300)
    return (
        float(np.max(area)),
        float(np.max(friction)),
        float(np.abs(course[2, np.argmax(area + friction)])),
    )


def _most_lagging(plan: Plan, closed: Sequence[int]) -> Iterator[str]:
    """Yield the sentence of ``_lagging`` on that of the first, middle and last points of a sweep that lags most."""
    lags = {
        sentence: size
        for place in {closed[0], closed[len(closed) // 2], closed[-1]}
        for size, sentence in _lagging(plan, plan.points[place])
    }
    if lags:
        yield max(lags, key=lambda sentence: lags[sentence])


def _lagging(plan: Plan, point: Scenario) -> Iterator[tuple[float, str]]:
    """Yield how far values along a ramp or table are from steady ones, and how far they would be along a slower one.

    The sentence stands behind the sum of the lags of area and friction [1].
    There is no statement for few bonds and for a relaxing amplitude, which the course leaves out, nor for a part
    with feedback, which is slow. Nothing is said of a table with a jump or beside a changing load.
    """
    left_out = (
        point.population.is_random
        or point.fluctuations.law.relaxing
        or point.stepper.longest == 1
    )
    rows = point.drive.time if point.drive.model == "table" else ()
    jumps = bool(rows) and (point.contact.changes or 0.0 in np.diff(rows))
    if point.drive.model not in ("ramp", "table") or left_out or jumps:
        return
    steady = _along_course(point, _VERY_SLOW)
    behind, longer = (
        _behind(_along_course(point, 1.0), steady),
        10.0 * point.clock.duration,
    )
    if max(behind[:2]) > _LAG:
        values = [
            100.0 * value
            for value in behind[:2] + _behind(_along_course(point, 10.0), steady)[:2]
        ]
        times = "10 times drive.time and " if rows else ""
        at = f" at {in_words(plan, point)}" if len(plan.points) > 1 else ""
        yield (
            behind[0] + behind[1],
            (
                f"along the {point.drive.model}{at} A/A_JKR is up to {values[0]:.2g} points off its steady value, the"
                f" friction {values[1]:.2g} % of its largest (near {engineering(behind[2], 'm/s')});"
                f' {times}clock.duration = "{engineering(longer, "s")}" leaves {values[2]:.2g} points and'
                f" {values[3]:.2g} %"
            ),
        )


def slider_body(point: Scenario, speeds: Array) -> Body:
    """Return the body behind the spring of a scene in steady sliding at speeds [m/s], with the growth of its area."""
    drive, steady = cast(Spring, point.drive), point.population.steady(speeds)
    control = point.contact.control(0.0, 0.0)

    def area(share: float = 1.0, stress: float = 1.0) -> Array:
        work_left = point.adhesion.work_of_bonds(steady.fraction * share)
        terms = Balance(
            work_left,
            np.zeros(1),
            steady.strength * stress,
            None,
            point.bodies,
            point.adhesion.work,
        )
        return np.asarray(np.pi * point.contact.equilibrium(control, terms) ** 2)

    now, few = area(), _RELATIVE_STEP
    by_bonds = (area(share=1.0 + few) - area(share=1.0 - few)) / (2.0 * few * now)
    by_stress = (area(stress=1.0 + few) - area(stress=1.0 - few)) / (2.0 * few * now)
    radius, solid = np.sqrt(now / np.pi), point.elastic
    firm: Array | float = math.inf
    power: Array | float = 0.0
    if sum(drive.yields(solid)) > 0.0:
        firm = 1.0 / drive.compliance(solid, radius)
        # of k_t over the area
        wider = drive.compliance(solid, radius * math.exp(few)) * firm
        narrower = drive.compliance(solid, radius * math.exp(-few)) * firm
        power = np.log(narrower / wider) / (4.0 * few)
    return Body(
        now,
        by_bonds,
        by_stress,
        drive.mass,
        drive.damping,
        drive.viscosity,
        firm,
        power,
    )


class Stability(NamedTuple):
    """Stability of steady sliding behind the spring of a scene, by the linear theory.

    Attributes
    ----------
    stiffness, speed, frequency : float
        Stiffness below which some speed of the run is unstable [N/m], that speed [m/s], and the frequency of the
        oscillations [1/s]. The stiffness is 0 if every spring holds, infinite if none does, and nan if it is not known.
    unstable : list of (float, float)
        Ranges of the speed that are unstable behind the spring [m/s]; 0 and infinity are ends that were not found.
    """

    stiffness: float
    speed: float
    frequency: float
    unstable: list[tuple[float, float]]


def stability(point: Scenario) -> Stability:
    """Return the stability of steady sliding of a scene with a spring, at the speeds of its stage and around them."""
    spring = cast(Spring, point.drive).spring
    of_run = distinct_speeds(point)
    if not of_run.size:
        return Stability(0.0, 0.0, math.nan, [])
    below = of_run[0] * np.geomspace(_SLOWER, 1.0, _AROUND)[:-1]
    above = of_run[-1] * np.geomspace(1.0, _FASTER, _AROUND)[1:]
    speeds = np.concatenate([below, of_run, above])
    known = onset(point, speeds)
    in_run = known.stiffness[len(below) :][: len(of_run)]
    if np.isnan(in_run).all():
        return Stability(math.nan, math.nan, math.nan, [])
    worst = len(below) + int(np.nanargmax(in_run))
    excess = _excess(known, spring)
    holds = ~(excess > 0.0)
    places = np.flatnonzero(holds[1:] != holds[:-1])
    edges = [
        *[0.0] * (not holds[0]),
        *(_edge(point, speeds[k : k + 2], excess[k : k + 2]) for k in places),
        *[math.inf] * (not holds[-1]),
    ]
    return Stability(
        float(known.stiffness[worst]),
        float(speeds[worst]),
        float(known.frequency[worst]) / (2.0 * math.pi),
        list(zip(edges[::2], edges[1::2], strict=True)),
    )


def distinct_speeds(point: Scenario) -> Array:
    """Return the distinct speeds of a run above zero [m/s], in increasing order."""
    speeds = np.unique(np.abs(point.speeds(TIMES)))
    return np.asarray(speeds[speeds > 0.0])


def _excess(known: Onset, spring: float) -> Array:
    """Return K_c/K − 1, bounded, of a needed stiffness K_c and that of a spring; sliding is unstable above 0."""
    return np.minimum(known.stiffness / spring - 1.0, _STEEP)


def _edge(point: Scenario, speeds: Array, excess: Array) -> float:
    """Return the limit of stability between two speeds [m/s] by regula falsi, or by halving where no law is smooth."""
    spring = cast(Spring, point.drive).spring
    (first, last), (before, after), moved = np.log(speeds), excess, ""
    while last - first > _NARROW:
        is_steep = max(before, after) >= _STEEP
        share = 0.5 if is_steep else before / (before - after)
        middle = first + share * (last - first)
        here = float(_excess(onset(point, np.exp([middle])), spring)[0])
        if abs(here) < _ZERO:
            return math.exp(middle)
        # the value at an end that stays twice is halved, so that the other does not move alone
        if (here > 0.0) == (before > 0.0):
            after = 0.5 * after if moved == "first" and not is_steep else after
            first, before, moved = middle, here, "first"
        else:
            before = 0.5 * before if moved == "last" and not is_steep else before
            last, after, moved = middle, here, "last"
    return math.exp(0.5 * (first + last))


def onset(point: Scenario, speeds: Array) -> Onset:
    """Return the onset of oscillations behind a spring at speeds [m/s].

    It does not depend on the spring, so points of a sweep over the spring share it.
    """
    body = slider_body(point, speeds)
    terms = tuple(tuple(np.ravel(number)) for number in body)
    return _onset(point.population, tuple(speeds), terms)


@functools.lru_cache(maxsize=64)
def _onset(
    bonds: BondModel,
    speeds: tuple[float, ...],
    body: tuple[tuple[float, ...], ...],
) -> Onset:
    """Return the onset of oscillations of a body whose numbers are tuples."""
    return bonds.onset(np.array(speeds), Body(*map(np.array, body)))


def _outside(point: Scenario) -> Iterator[str]:
    """Yield a remark if sliding is unstable behind the contact's own stiffness: no slider on it is rigid."""
    if point.drive.model == "spring" and point.drive.contact_stiffness == "half_space":
        speeds = np.unique(np.abs(point.speeds(TIMES)))
        bonds, body = (
            point.population,
            slider_body(point, speeds),
        )
        with np.errstate(all="ignore"):  # of a contact that is open
            needed = bonds.onset(speeds, Body(*body[:3])).stiffness
            of_contact = np.asarray(body.contact_stiffness, float)
        if np.any(needed > of_contact):
            worst = int(np.nanargmax(needed / of_contact))
            high, low = (
                engineering(float(values[worst]), "N/m")
                for values in (needed, of_contact)
            )
            yield (
                f"the model of a rigid slider does not hold: at {engineering(float(speeds[worst]), 'm/s')} stable"
                f" sliding needs {high}, but the stiffness of the contact is {low}, so the half-space would oscillate"
            )
