"""Judgement of a run before it starts: systematic errors of its results, remarks, and the limits of its contact."""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, cast

import numpy as np

from sim.engine import MemberNoise, follow
from sim.ensemble.plan import Plan
from sim.ensemble.steady import changed, plane_energy, sensitivities, steady_course
from sim.laws.schallamach import Body
from sim.parts.bonds.models import Cohort, FirstMoment, Rate
from sim.parts.drive import Spring
from sim.parts.exchange import Array
from sim.parts.shear import Mean
from sim.quantities import ERRORS
from sim.scenario.checks import renewed
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.spectrum.families import Band
from sim.spectrum.family import Family
from sim.spectrum.radial import share_of_long_waves
from sim.units.notation import engineering
from sim.units.quantity import same_unit

#: Times of a run at which it is judged, steps of a ramp, keys in a sentence; energies of a member, on a disc, and
#: points at which their density is summed.
_TIMES, _STEPS, _KEYS, _ENERGIES, _ON_DISC, _POINTS = 21, 1000, 5, 256, 32, 2**12
#: Error of A/A_JKR and lag that need a sentence; share of the work of adhesion that nearly masks it.
_ERROR, _LAG, _MASKING = 0.01, 0.005, 0.9
#: Points along a side of a cell beyond which no more are proposed; wavelengths of a band over a correlation length.
_MOST_POINTS, _BAND = 2**14, (0.8, 1.2)
#: Relative change of bonds and stress in the derivative of the area; duration over that of a ramp that nothing delays.
_RELATIVE_STEP, _VERY_SLOW = 1e-4, 1e6

#: A value in a remark with its unit, if it has one; a number after "=" or in quotes is part of a cure.
_VALUE = re.compile(
    r'(?<![\w.^"-])(?<!= )\d+(?:\.\d+)?(?:e[+-]?\d+)?\b(?: [pnµmkMG]?(?P<unit>m/s|N/m|Pa|m|s|N)\b)?'
)

#: A point of a sweep, and its systematic errors.
Worst = tuple[Scenario, dict[str, float]]


def spread(points: Sequence[Scenario], most: int = 8) -> list[Scenario]:
    """Return some of the points, first and last included."""
    places = np.unique(
        np.linspace(0, len(points) - 1, min(most, len(points))).round().astype(int)
    )
    return [points[place] for place in places]


def _along(point: Scenario) -> tuple[Array, Array]:
    """Return times [s] and absolute speeds [m/s] of a run, shape (times, 1); one of each if all are alike."""
    times, speeds = (
        np.linspace(0.0, point.times.duration, _TIMES),
        np.abs(point.speeds(_TIMES)),
    )
    count = None if point.contact.changes or np.ptp(speeds) else 1
    return times[:count, np.newaxis], speeds[:count, np.newaxis]


def _areas(
    point: Scenario, times: Array, speeds: Array, stored: Array | None = None
) -> Array:
    """Return A/A_JKR in steady sliding, arguments as of ``steady_course``; nan without a contact."""
    full = _jkr_radius(point, times)
    return np.asarray(
        (
            steady_course(point, times, speeds, stored).radius
            / np.where(full > 0.0, full, np.nan)
        )
        ** 2
    )


def _jkr_radius(point: Scenario, times: Array) -> Array:
    """Return the radius with all adhesion at times [s], shape (times, 1) [m]."""
    work, control = (
        np.full(times.shape, point.adhesion.work),
        point.contact.control(times, point.clock.duration),
    )
    return control.radius(work, np.zeros(1), 0.0, point.bodies)


def systematic_errors(point: Scenario) -> dict[str, float]:
    """Return the known errors of the shear process, and those of area and friction by the names of ``ERRORS``.

    There are none of area and friction without a cell. They are those of the mean over members in steady sliding. The
    energy of a member is a gamma number with an offset, of the mean, variance and skewness in the cell. The error of
    the cell is that of this mean against the infinite plane, the error of the bands that of the skewness against all
    modes. A clock step adds at most the variance of the radius that a lagging edge gains by it. They are nan if the
    contact opens at some of the energies at all times.
    """
    shear, plane = (
        point.fluctuations,
        plane_energy(point.fluctuations.spectrum, *point.solid.effective),
    )
    if (
        "cell_error_energy" not in (known := point.process.known_errors())
        or not plane > 0.0
    ):
        return known
    weight, shape, _, constant = point.process.gammas
    mean, sd = (
        float(np.sum(weight * shape)) + constant,
        math.sqrt(np.sum(weight**2 * shape)),
    )
    skewness = 2.0 * float(np.sum(weight**3 * shape)) / sd**3 if sd else 0.0
    whole = skewness / (1.0 - known.get("banded_error_third_cumulant", 0.0))
    count = _ENERGIES if point.margin is None else _ON_DISC
    scores = sd * _scores(skewness, count)
    energies = np.concatenate(
        [mean + scores, plane + scores, mean + sd * _scores(whole, count)]
    )
    times, speeds = _along(point)
    scene = (
        changed(point, {"shear.amplitude.floor": 1.0}) if shear.law.remembers else point
    )
    areas = _areas(scene, times, speeds, energies).reshape(len(times), 3, count)
    (cell, exact, banded), gained = np.mean(areas, axis=-1).T, np.zeros(len(times))
    if point.contact.lags and point.feels_steps:
        left = -0.5 * np.log1p(
            -np.clip(renewed(point, speeds[:, 0] * point.clock.step), 1e-12, 0.999)
        )
        gained = np.var(np.sqrt(areas[:, 0]), axis=-1) * np.minimum(
            left / np.tanh(left) - 1.0, 1.0
        )
    errors = np.stack([cell - exact, cell - banded, gained])
    worst = int(np.argmax(np.nan_to_num(np.sum(np.abs(errors), axis=0))))
    relative = errors[:, worst] / (exact[worst] or math.nan)
    values = *errors[:, worst], *relative, speeds[worst, 0], np.std(areas[worst, 0])
    names = (row.name for row in ERRORS)
    return known | dict(zip(names, map(float, values), strict=True))


def _scores(skewness: float, count: int) -> Array:
    """Return equally likely values of a gamma number of this skewness, scaled to the mean 0 and the variance 1.

    They are found by the trapezoidal rule over the logarithm, because to import ``scipy.special`` would make the start
    of ``sim run`` and ``sim check`` an eighth longer.
    """
    shape = 4.0 / max(skewness, 1e-4) ** 2
    logs = (
        np.linspace(-1.0 - 1.0 / math.sqrt(shape), 1.0, _POINTS)
        * 12.0
        / math.sqrt(shape)
    )
    density = np.exp(shape * (logs - np.expm1(logs)))
    below = np.cumsum(density) - 0.5 * density
    values = np.exp(
        np.interp((np.arange(count) + 0.5) / count, below / np.sum(density), logs)
    )
    return cast(Array, (values - np.mean(values)) / np.std(values))


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

    The error falls with the side of the cell, unless the grid has too few points for the short waves.
    """
    if not abs(errors["cell_error_area"]) > _ERROR:
        return ""
    shear, solid = cast(Any, point.fluctuations), point.solid.effective
    side, points, error = (
        shear.side(point.setting.cell),
        shear.points,
        errors["cell_error_energy"],
    )
    decade = 10.0 ** math.floor(math.log10(10.0 * side))

    def lacks(cell: float, share: float) -> bool:
        return points and 1.0 - share_of_long_waves(
            shear.spectrum, 2.0 * cell / points, solid[1]
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
    return 'shear.model = "mean"' if many else " and ".join(changes)


def place(plan: Plan, point: Scenario, speed: float) -> str:
    """Return a point of a sweep and a sliding speed [m/s] in words."""
    swept = [
        key
        for axis in plan.scenario.sweep
        for key in axis.keys
        if key not in ("drive.speed", "drive.stage")
    ]
    numbers = quantities(point)
    words = [
        f"{key} = {engineering(numbers[key][1], numbers[key][0].unit)}"
        for key in swept
        if key in numbers
    ]
    return ", ".join([*words, engineering(speed, "m/s") if speed else "rest"])


def remarks(plan: Plan, most: Worst | None = None) -> list[str]:
    """Return the remarks on a run, one sentence each; ``most`` are its ``worst`` errors if they are known."""
    alike: dict[str, list[str]] = {}
    for text in (
        text
        for point in spread(plan.points)
        for text in [*point.remarks(), *_outside(point)]
    ):
        alike.setdefault(
            _VALUE.sub(lambda value: f"\0{value['unit'] or ''}", text), []
        ).append(text)
    texts = [_in_range(group) for group in alike.values()]
    if (most := most or worst_of_sweep(plan.points)) and (keys := cure(*most)):
        point, area, friction = (
            most[0],
            *(100.0 * most[1][f"cell_error_{of}"] for of in ("area", "friction")),
        )
        too, at = (
            "large" if area > 0.0 else "small",
            place(plan, point, most[1]["error_speed"]),
        )
        size = (
            f"{abs(area):.2g} points and the friction {abs(friction):.2g} % too {too}"
        )
        texts.append(f"the cell makes A/A_JKR up to {size} (at {at}): {keys}")
    if plan.scenario.record.per_member is None and not plan.per_member:
        texts.append(
            "a file with every member would exceed 20 GB: only mean, spread and standard error are recorded"
            " (record.per_member = true records every member)"
        )
    return texts


def _in_range(texts: Sequence[str]) -> str:
    """Return the one remark of remarks that are alike, with ranges in place of values."""
    ends = []
    for column in zip(
        *([value[0] for value in _VALUE.finditer(text)] for text in texts), strict=True
    ):
        ordered = sorted(
            column, key=lambda value: (same_unit(column[0], value) or (0.0, 0.0))[1]
        )
        ends.append(" to ".join(dict.fromkeys([ordered[0], ordered[-1]])))
    return _VALUE.sub(lambda _: ends.pop(0), texts[0])


def diagnosis(plan: Plan) -> list[str]:
    """Return what limits the contact at the middle of a sweep and along its run, in sentences."""
    point = plan.points[len(plan.points) // 2]
    if not point.rest_radius > 0.0 or point.fluctuations.passes:
        return []
    time, speed = (
        np.full((1, 1), 0.5 * point.clock.duration),
        np.abs(point.speeds(3)[1:2, np.newaxis]),
    )
    at = place(plan, point, float(speed[0, 0]))
    where, texts = f" at {at}" if len(plan.points) > 1 else "", list[str]()
    if point.fluctuations.spectrum.variance:
        texts = [*_fluctuating(point, where), *_mechanisms(point, time, speed, at)]
    if shown := list(
        sensitivities(point, float(time[0, 0]), float(speed[0, 0])).items()
    )[:_KEYS]:
        words = [
            f"{key} {area:+.2g}" + f"/{force:+.2g}" * bool(force)
            for key, (area, force) in shown
        ]
        texts.append(
            f"area/friction change (%) for 1 % more of a key, at {at}: {', '.join(words)}"
        )
    return [*texts, *_lagging(point)]


def _fluctuating(point: Scenario, where: str) -> Iterator[str]:
    """Yield sentences on the size of the stored energy and on the waves that store it."""
    shear, spectrum, work = (
        point.fluctuations,
        point.fluctuations.spectrum,
        point.adhesion.work or math.inf,
    )
    course = steady_course(point, *_along(point))
    most, paid = (
        float(np.max(course.energy)),
        float(np.min(shear.paid_by_adhesion * course.energy)) / work,
    )
    masked, always = (
        course.work <= 0.0,
        "at any speed" if shear.amplitude.model == "constant" else "throughout the run",
    )
    how = (
        f": masked {always}"
        if paid >= 1.0
        else f": nearly masked {always}"
        if paid > _MASKING
        else ""
    )
    if paid < 1.0 and np.any(masked):
        noise = " without the noise of the bonds" if point.population.per_member else ""
        how = f": masked {'throughout' if np.all(masked) else 'in part of'} the run{where}{noise}"
    share = f"{100.0 * most / work:.2g} % of the work of adhesion"
    yield f"stored energy in steady sliding {engineering(most, 'J/m^2')}, {share}{how}"
    long_waves = share_of_long_waves(
        spectrum, 2.0 * point.rest_radius, point.solid.effective[1]
    )
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


def over_band(spectrum: Family) -> float | None:
    """Return the energy of a spectrum over that of wavelengths near its correlation length with the same rms.

    It is None for a spectrum without a correlation length. The energy grows with the length, so a pattern of the
    wavelength λ has the energy of the correlation length λ over this number.
    """
    if getattr(spectrum, "model", "") not in ("gaussian", "von_karman"):
        return None
    short, long = (factor * cast(Any, spectrum).length for factor in _BAND)
    band = Band(rms=cast(Any, spectrum).rms, shortest=short, longest=long)
    return plane_energy(spectrum, 1.0, 0.5) / plane_energy(band, 1.0, 0.5)


def _mechanisms(point: Scenario, time: Array, speed: Array, at: str) -> Iterator[str]:
    """Yield the points of A/A_JKR that each mechanism takes, in both orders, and the area without fluctuations."""
    whole, none = changed(point, {"adhesion.bond_share": 0.0}), np.zeros((1, 1))
    scenes = (whole, none), (point, none), (whole, None), (point, None)
    rest, bonds, waves, left = (
        100.0 * float(_areas(scene, time, speed, stored)[0, 0])
        for scene, stored in scenes
    )
    if bonds > left:
        first = f"bonds take {rest - bonds:.2g} points, fluctuations {bonds - left:.2g}"
        other = f" ({waves - left:.2g} and {rest - waves:.2g} if fluctuations are subtracted first)"
        yield f"the mean A/A_JKR at {at} is {left:.3g} %: {first}{other if bonds < rest else ''}"
        yield f"by the paper's strict balance (shear.paid_by_adhesion = 0) A/A_JKR is {bonds:.3g} %"


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
    course = follow(
        scene, MemberNoise.of(0, np.zeros(1, int)), None, range(_STEPS + 1)
    )[1]
    area = course.radius**2 / _jkr_radius(scene, course.time) ** 2
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


def _lagging(point: Scenario) -> Iterator[str]:
    """Yield how far values along a ramp or table are from steady ones, and how far they would be along a slower one.

    There is no statement for few bonds and for a relaxing amplitude, which the course leaves out, nor for a part
    with feedback, which is slow. Nothing is said of a table with a jump or beside a changing load.
    """
    left_out = (
        point.population.per_member or point.fluctuations.law.relaxing or point.by_steps
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
        yield (
            f"along the {point.drive.model} A/A_JKR is up to {values[0]:.2g} points off its steady value, the friction"
            f" {values[1]:.2g} % of its largest (near {engineering(behind[2], 'm/s')});"
            f' {times}clock.duration = "{engineering(longer, "s")}" leaves {values[2]:.2g} points and {values[3]:.2g} %'
        )


def slider_body(point: Scenario, speeds: Array) -> Body:
    """Return the body behind the spring of a scene in steady sliding at speeds [m/s], with the growth of its area."""
    drive, steady = cast(Spring, point.drive), point.population.steady(speeds)
    control, (yields, slope) = (
        point.contact.control(0.0, 0.0),
        drive.yields(*point.solid.effective),
    )

    def area(share: float = 1.0, stress: float = 1.0) -> Array:
        work_left = point.adhesion.work_of_bonds(steady.fraction * share)
        terms = steady.strength * stress, point.contact.reversible, point.bodies
        return np.asarray(np.pi * control.radius(work_left, *terms) ** 2)

    now, few = area(), _RELATIVE_STEP
    by_bonds = (area(share=1.0 + few) - area(share=1.0 - few)) / (2.0 * few * now)
    by_stress = (area(stress=1.0 + few) - area(stress=1.0 - few)) / (2.0 * few * now)
    firm = (
        1.0 / (yields + slope / np.sqrt(now / np.pi))
        if yields + slope > 0.0
        else math.inf
    )
    power = 0.5 if slope > 0.0 else 0.0
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


def _outside(point: Scenario) -> Iterator[str]:
    """Yield a remark if sliding is unstable behind the contact's own stiffness: no slider on it is rigid."""
    if point.drive.model == "spring" and point.drive.contact_stiffness == "half_space":
        speeds = np.abs(point.speeds(_TIMES))
        bonds, body = (
            cast(Rate | Cohort | FirstMoment, point.population),
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
