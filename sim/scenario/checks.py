"""Conditions that hold between the parts of a scenario."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from sim.laws.layer_table import WIDEST
from sim.laws.limits import (
    DISTANCES,
    FINITE_STRAIN,
    JKR_FROM,
    elastocapillary_length,
    tabor_number,
)
from sim.parts.bonds.models import Demands
from sim.parts.exchange import Array
from sim.step.phases import phases
from sim.units.notation import engineering

_STEPS_A_CYCLE = 2
#: Times between which the slip of a run is looked at.
_MOST_SLIPS = 2**16
#: Contact radius over that of the sphere above which some unit must be wrong.
_WIDEST = 10.0
#: The same of a circle, which is never wider.
_WIDEST_CIRCLE = 0.99
#: Slip force over catch force of a bond above which no two lengths of a molecule explain it. A thermal pathway has the
#: force kT over the distance to its barrier: from the 0.1 nm of a chemical bond to the 100 nm of a stretched protein.
#: The number of sub-steps of a bond's life, and so the time of a run, grows with this ratio.
_LARGEST_FORCE_RATIO = 1000.0
_TOO_SHORT = "the table ends at {:g} s, before clock.duration ({:g} s); add rows or shorten the run"

Faults = Iterator[tuple[tuple[str, ...], str]]
#: A checked scenario; its class imports this module.
Scene = Any


def faults_across(scene: Scene, built: bool = True) -> Faults:
    """Yield the faults between the parts of a scenario, each as (place, fault and cure).

    Without ``built`` the process of the shear part is not built.
    """
    try:
        _ = scene.fluctuations
    except (PydanticCustomError, ValidationError) as fault:
        yield (
            ("shear",),
            fault.message()
            if isinstance(fault, PydanticCustomError)
            else fault.errors()[0]["msg"],
        )
        return
    for check in (
        _too_short,
        _unlike_drive,
        _unknown_on_a_layer,
        _unknown_of_a_circle,
        _unlike_contact,
        _unlike_bonds,
        _catch_is_too_weak,
        _unlike_temperature,
        _implausible,
        _wrong_maps,
    ):
        yield from check(scene)
    yield from _shear_faults(scene, built)
    yield from _off_the_map(scene)


def _too_short(scene: Scene) -> Faults:
    clock, contact, end = scene.clock, scene.contact, scene.contact.course.end
    if scene.drive.end < clock.duration * (1 - 1e-9):
        yield ("drive",), _TOO_SHORT.format(scene.drive.end, clock.duration)
    if end < clock.duration * (1 - 1e-9):
        yield ("contact", contact.kind), _TOO_SHORT.format(end, clock.duration)
    elif clock.steps < _STEPS_A_CYCLE * contact.course.cycles:
        fault = (
            f"fewer than {_STEPS_A_CYCLE} of the {clock.steps} clock steps for a cycle"
        )
        yield (
            ("contact", contact.kind, "cycles"),
            f"{fault}; make fewer cycles or shorter steps",
        )
    elif any(way < clock.step for way in contact.course.ways):
        fault = f"one way of the loop takes {min(contact.course.ways):.3g} s, less than a clock step"
        cure = "lower its approach or retraction, or clock.step"
        yield ("contact", contact.kind), f"{fault}; {cure}"


def _unlike_contact(scene: Scene) -> Faults:
    faults = scene.contact.faults(
        is_driven=scene.drive.solves_motion,
        is_on_disc=scene.fluctuations.contact != "plane",
        is_on_layer=scene.solid.thickness is not None,
    )
    yield from ((("contact", key), fault) for key, fault in faults.items())


def _by_place(faults: Mapping[str, str]) -> Faults:
    """Yield faults that have dotted keys of a scenario."""
    yield from ((tuple(key.split(".")), fault) for key, fault in faults.items())


def _unlike_drive(scene: Scene) -> Faults:
    is_reversible = scene.contact.reversible > 0.0
    yield from _by_place(scene.drive.faults(scene.population.stretched, is_reversible))


def _unknown_on_a_layer(scene: Scene) -> Faults:
    thickness = scene.solid.thickness
    if thickness is None:
        return
    if scene.fluctuations.contact != "plane":
        fault = "ΔΓ of a disc is known on a half-space only"
        yield ("shear", "contact"), f'{fault}: give "plane", or omit solid.thickness'
    if scene.widest > WIDEST * thickness:
        fault = f"the contact radius, {scene.widest:.3g} m, exceeds {WIDEST:g} times the thickness, beyond the theory"
        yield ("solid", "thickness"), f"{fault}: give a thicker layer"


def _unknown_of_a_circle(scene: Scene) -> Faults:
    if scene.sphere.profile == "circle" and (cure := _no_circle(scene)):
        known = "a circle is known on a half-space in JKR's theory only"
        yield ("sphere", "profile"), f'{known}: {cure}, or take "parabola"'


def _no_circle(scene: Scene) -> str:
    """Return the cure of a scene whose sphere cannot have the profile of a circle, "" if it can."""
    if scene.solid.thickness is not None:
        return "omit solid.thickness"
    if scene.solid.counter_body is not None:
        return "omit solid.counter_body, because an elastic sphere is no half-space"
    if scene.contact.theory != "JKR":
        return 'use contact.model = "equilibrium"'
    return ""


def _unlike_bonds(scene: Scene) -> Faults:
    spectrum, stiffest = scene.fluctuations.spectrum, None
    if spectrum.bond_made:
        stiffest = 0.5 / scene.elastic.stored_energy(spectrum)
    reads_stress = scene.fluctuations.amplitude.reads_stress
    demands = Demands(scene.drive.solves_motion, reads_stress, stiffest)
    yield from _by_place(scene.population.faults(demands))


def _catch_is_too_weak(scene: Scene) -> Faults:
    bonds = scene.population
    if (
        bonds.stretched
        and bonds.law.catch > 0.0
        and bonds.law.relief > _LARGEST_FORCE_RATIO * bonds.law.softness
    ):
        fault = f"is less than 1/{_LARGEST_FORCE_RATIO:,.0f} of slip_force; the time of a run grows as it falls"
        cure = f"give at least {bonds.rupture.slip_force / _LARGEST_FORCE_RATIO:.3g} N, a smaller slip_force"
        yield ("bonds", "rupture", "catch_force"), f"{fault}; {cure}, or catch_rate = 0"


def _unlike_temperature(scene: Scene) -> Faults:
    if scene.temperature is not None:
        yield from _by_place(scene.temperature.faults(scene.numbers))


def _implausible(scene: Scene) -> Faults:
    contact, radius, size = scene.contact, scene.rest_radius, scene.sphere.radius
    if contact.lags and not scene.adhesion.work > 0.0:
        fault = "a rate-dependent edge needs a work of adhesion at rest; give adhesion.work above zero"
        yield ("adhesion", "work"), fault
    widest = _WIDEST_CIRCLE if scene.sphere.profile == "circle" else _WIDEST
    if radius > widest * size:
        fault = f"makes a contact of {radius:.3g} m on a sphere of {size:.3g} m radius, for which no theory holds;"
        yield (
            ("contact", contact.kind),
            f"{fault} check its unit, and those of sphere, adhesion and solid",
        )


def _wrong_maps(scene: Scene) -> Faults:
    record, clock, members = scene.record, scene.clock, scene.ensemble.members
    if record.maps and scene.fluctuations.model != "mapped":
        yield (
            ("record", "maps"),
            'needs shear.model = "mapped"; choose it or omit the maps',
        )
    between = clock.step * clock.stride
    records = {time: time / between for time in record.maps}
    off = [
        time
        for time, number in records.items()
        if abs(number - round(number)) > 1e-9 * max(number, 1.0)
    ]
    off += [time for time in record.maps if time > clock.duration * (1 + 1e-9)]
    if off:
        fault = f"{off[0]:g} s is not a recorded time; choose whole multiples of {between:g} s"
        yield ("record", "maps"), f"{fault} up to {clock.duration:g} s"
    elif len({*map(round, records.values())}) < len(record.maps):
        yield ("record", "maps"), "names a time twice; give each once"
    if record.map_members > members:
        fault = f"is more than ensemble.members ({members}); lower it or add members"
        yield ("record", "map_members"), fault


def _shear_faults(scene: Scene, built: bool) -> Faults:
    shear, contact, radius = scene.fluctuations, scene.contact, scene.rest_radius
    if not shear.side(math.sqrt(math.pi) * radius) > 0.0:
        pull_off = contact.pull_off_load(scene.adhesion.work, scene.bodies)
        limit = f" of {pull_off:.3g} N" if contact.kind == "load" else ""
        fault = f"is beyond pull-off{limit} at the start, so there is no contact at rest for the size of the cell"
        yield (
            ("contact", contact.kind),
            f'{fault}; move the sphere closer, or give shear.cell such as "0.2 mm"',
        )
    elif built:
        listed = shear.faults(scene.elastic, radius)
        yield from (
            (("shear", key) if key else ("shear",), fault) for key, fault in listed
        )


def _off_the_map(scene: Scene) -> Faults:
    shear, clock = scene.fluctuations, scene.clock
    if shear.passes and scene.drive.solves_motion:
        fault = 'a measured map under a disc needs a known slip: prescribe the speed, or give "plane"'
        yield ("shear", "contact"), fault
    elif shear.passes:
        ends = np.linspace(0.0, clock.duration, min(clock.steps, _MOST_SLIPS) + 1)
        positions = np.cumsum(scene.drive.pieces(ends, clock.duration).joined.integral)
        reach = min(0.0, positions.min()), max(0.0, positions.max())
        faults = shear.off_the_map(reach, scene.widest)
        yield from (
            (("shear", "field", *([key] if key else [])), fault)
            for key, fault in faults
        )


#: Rms of the fluctuations over the mean stress above which a remark is made: some 2 % of the area is reversed.
_MOST_REVERSED = 0.5
#: Radius over that of the sphere, and γ/E over the contact radius, above each of which a remark is made.
LARGEST_SLOPE, LARGEST_CAPILLARITY = 0.3, 0.1
#: Contact radius over the thickness of a layer above which a remark is made on its compressibility.
_COMPRESSED = 10.0
#: Surface tension of water, and so of a wet gel [N/m].
WATER = 0.072
#: Decades between the stress of a map and that of the bonds from which a factor of 1000 is nearer than none.
_FAR = 1.5
#: Radius of a sphere that is rather a number whose unit was forgotten [m].
_LARGEST_SPHERE = 1.0


class Limits(NamedTuple):
    """Numbers that tell if a scene lies within the theory of small strains and short-ranged adhesion.

    Attributes
    ----------
    tabor : tuple of float
        Tabor number at each of the likely distances of the attraction [1].
    slope, strain : float
        Largest contact radius over that of the sphere, and largest mean stress over the shear modulus [1].
    squeeze : float
        About the largest shear strain at the base of a layer that is thinner than the contact [1]; 0 of others.
    parabola : float
        Largest area of a parabola over that of a circle, less 1 [1]; nan if that of a circle is not known.
    tensions, capillary : tuple of float
        Surface tensions [N/m], which no scenario gives: half of the work of adhesion, as of two equal solids without
        any energy of their interface, and that of water. The elastocapillary length of each [m].
    """

    tabor: tuple[float, float]
    slope: float
    strain: float
    squeeze: float
    parabola: float
    tensions: tuple[float, float]
    capillary: tuple[float, float]


def limits(scene: Scene) -> Limits:
    """Return the numbers that tell if a scene lies within the theory."""
    work, size = scene.adhesion.work, scene.sphere.radius
    body = scene.softer_body
    low, high = sorted((0.5 * work, WATER))
    lengths = elastocapillary_length(
        np.array([low, high]), body.own_shear_modulus, body.poisson_ratio
    )
    distances = np.array(scene.contact.distances(work))
    tabor = tabor_number(work, size, scene.elastic.contact_modulus, distances)
    return Limits(
        (float(tabor[0]), float(tabor[1])),
        scene.widest / size,
        _largest_stress(scene) / body.own_shear_modulus,
        _of_squeeze(scene),
        _of_parabola(scene),
        (low, high),
        (float(lengths[0]), float(lengths[1])),
    )


def _largest_stress(scene: Scene) -> float:
    """Return the largest mean stress in steady sliding, or that of a prescribed force on the contact at rest [Pa]."""
    largest = float(np.max(scene.steady_stress))
    if not scene.drive.forces or not scene.rest_radius > 0.0:
        return largest
    force = max(map(abs, scene.drive.forces))
    return max(largest, force / (math.pi * scene.rest_radius**2))


def _of_squeeze(scene: Scene) -> float:
    """Return about the largest shear strain at the base of a layer that is thinner than the contact, 0 of others.

    As long as hardly any volume leaves a thin incompressible layer under the contact, the parabola sinks in by a²/4R
    − r²/2R, and the layer flows outwards by (a² − r²) r/8Rh in the mean over its thickness. The base is sheared by
    three times this over the thickness, which is largest at r = a/√3.
    """
    thickness = scene.solid.thickness
    if thickness is None or not scene.widest > thickness:
        return 0.0
    return float(
        scene.widest**3 / (4.0 * math.sqrt(3.0) * scene.sphere.radius * thickness**2)
    )


def _of_parabola(scene: Scene) -> float:
    """Return the largest area of a parabola over that of a circle, less 1; nan if that of a circle is not known."""
    if _no_circle(scene):
        return math.nan
    radii = [
        scene.contact.largest_radius(
            scene.adhesion.work,
            scene.bodies._replace(
                solid=replace(scene.sphere, profile=profile).on(scene.elastic)
            ),
        )
        for profile in ("parabola", "circle")
    ]
    return (radii[0] / radii[1]) ** 2 - 1.0 if radii[1] > 0.0 else math.nan


def _remarks_on_theory(scene: Scene, known: Limits) -> Iterator[str]:
    """Yield a remark for each number that lies outside of the theory."""
    if scene.contact.theory == "JKR" and 0.0 < known.tabor[0] < JKR_FROM:
        near, far = (f"{distance * 1e9:g} nm" for distance in DISTANCES)
        yield (
            f"the Tabor number is {known.tabor[0]:.2g} for z0 = {near} and {known.tabor[1]:.2g} for z0 = {far}:"
            f' JKR\'s theory holds above about {JKR_FROM:g}; contact.model = "cohesive" has a range of adhesion'
        )
    if known.slope > LARGEST_SLOPE:
        cure = 'sphere.profile = "circle" has no error of the profile'
        is_circle = scene.sphere.profile == "circle" or math.isnan(known.parabola)
        yield (
            f"the contact radius reaches {known.slope:.2g} of the sphere's, beyond {LARGEST_SLOPE}: the theory is"
            f" valid for small contacts{'' if is_circle else f'; {cure}'}"
        )
    if known.strain > FINITE_STRAIN:
        yield (
            f"the mean stress is {known.strain:.2g} times the shear modulus: finite strains, which are left out, reduce"
            f" the area from about {FINITE_STRAIN} on"
        )
    if known.squeeze > FINITE_STRAIN:
        yield (
            f"the sphere shears the base of the thin layer by about {known.squeeze:.2g}: the theory is valid for small"
            f" strains, up to about {FINITE_STRAIN}"
        )
    thickness = scene.solid.thickness
    if thickness is not None and scene.widest > _COMPRESSED * thickness:
        yield (
            f"the contact radius is {scene.widest / thickness:.3g} times the thickness of the layer: there the slight"
            f" compressibility of real rubber matters, from about {_COMPRESSED:g} on"
        )
    share = known.capillary[1] / scene.widest if scene.widest else 0.0
    if share > LARGEST_CAPILLARITY:
        tension = engineering(known.tensions[1], "N/m")
        yield (
            f"surface tension, which is left out, may matter: γ/E is {share:.2g} of the contact radius if"
            f" γ = {tension}"
        )


def remarks_between(scene: Scene) -> list[str]:
    """Return assumptions and limits of the parts together."""
    drive, bonds, shear, contact = scene.chosen
    speeds, strength = scene.strengths
    remarks = []
    if (radius := scene.sphere.radius) > _LARGEST_SPHERE:
        remarks.append(
            f'sphere.radius is {radius:g} m: a number without a unit is in metres, write "5 mm"'
        )
    moves_contact = shear.random_variance * shear.paid_by_adhesion > 0.0
    if moves_contact and bonds.feeds_back and not contact.lags:
        remarks.append(
            'carried area does not converge in a fluctuating contact: use model = "rate_dependent"'
        )
    reattaches = contact.after_pull_off == "reattach"
    if reattaches and bonds.stretched and not (bonds.feeds_back or drive.solves_motion):
        remarks.append(
            'bonds continue to slide while the contact is open; bonds.area = "carried" starts without bonds'
        )
    if contact.reversible * drive.viscosity > 0.0:
        remarks.append(
            "contact.reversible counts the stress of the bonds alone: that of drive.viscosity stores energy, too"
        )
    if scene.temperature is not None:
        remarks += scene.temperature.remarks(scene.numbers)
    remarks += _remarks_on_theory(scene, scene.limits)
    remarks += _remark_on_unit(shear, float(strength.max()))
    rms = math.sqrt(shear.spectrum.variance) * shear.amplitude.factor(speeds, strength)
    if not shear.spectrum.bond_made and np.any(
        (rms > _MOST_REVERSED * scene.steady_stress) & (strength > 0.0)
    ):
        remarks.append(
            f"rms fluctuations exceed {_MOST_REVERSED} of the mean stress: patches of reversed friction"
        )
    return [
        *remarks,
        *_remarks_on_step(scene, np.array([np.abs(speeds).max() * scene.clock.step])),
        *_remark_on_rise(scene),
    ]


def _remark_on_unit(shear: Any, strength: float) -> list[str]:
    """Return a remark if the stress of a measured map is nearer to a thousand times that of the bonds, or less."""
    key, size, text = shear.mapped
    if not size * strength > 0.0 or abs(math.log10(size / strength)) < _FAR:
        return []
    return [
        f"the map ({text}) is {size / strength:.2g} times the stress of the bonds, {strength:.3g} Pa: is"
        f" shear.{key}.unit right?"
    ]


#: Clock step over the life of a bond in steady sliding from which on no peak of the friction is shown, and a short one.
_SHOWN, _RISE = 0.5, 0.1
#: Mean overshoot of a random walk beyond a limit, over the standard deviation of its steps: −ζ(1/2)/√(2π).
_OVERSHOOT = 0.5826
#: Share of the variance of ΔΓ that a step may renew: a contact under tension lets go late by a tenth of the scatter of
#: ΔΓ, and the variance of the radius of a lagging edge is 1 % too large.
_RENEWED_LATE, _RENEWED_LAGGING = 0.005 / _OVERSHOOT**2, -math.expm1(-math.sqrt(0.12))


def renewed(scene: Scene, path: Array) -> Array:
    """Return the share of the variance of ΔΓ that a clock step with a path [m] renews."""
    all_of_it = scene.process.change(np.full(1, np.inf), np.inf)
    return np.asarray((scene.process.change(path, scene.clock.step) / all_of_it) ** 2)


def pull_off_error(scene: Scene, path: Array, when: Array | None = None) -> Array:
    """Return about how much the load at pull-off is off [N], as the contact is seen after clock steps with a path [m].

    The first passage of ΔΓ is detected late by the overshoot of its changes (Siegmund, Sequential Analysis, 1985). As a
    load this is 3/2 πR times the overshoot, or more on a layer and if adhesion has a range. A prescribed load adds half
    of its change in the step of the pull-off, which ends at the time ``when`` [s], or in any step if that is not given.
    The two have opposite signs; this is a bound. An edge that lags is seen at the ends of clock steps, between which
    its load falls by what the mount alone changes at most.
    """
    shear, clock, contact = scene.fluctuations, scene.clock, scene.contact
    late = np.zeros(1)
    if scene.feels_steps:
        settled = scene.population.steady(path / clock.step)
        size = (
            np.ones(1)
            if shear.law.remembers
            else shear.law.factor(path / clock.step, settled.strength)
        )
        power = (
            settled.frozen + settled.varying if shear.spectrum.bond_made else size**2
        )
        change = scene.process.change(path, clock.step)
        late = _OVERSHOOT * shear.paid_by_adhesion * power * change
    most = _largest_change(scene, when)
    if contact.kind == "load":
        ramp = most if contact.lags else 0.5 * most
    elif contact.lags:
        of_contact = scene.elastic.normal_stiffness(scene.widest)
        # both in series; a contact that is never closed yields without a load
        mount = contact.stiffness or math.inf
        ramp = most * of_contact / (1.0 + of_contact / mount)
    else:
        ramp = np.zeros(1)  # the fold is found within the step
    work = scene.adhesion.work or 1.0
    once, twice = (
        contact.pull_off_load(each, scene.bodies) for each in (work, 2.0 * work)
    )
    return np.asarray((once - twice) / work * late + ramp)


def _largest_change(scene: Scene, when: Array | None) -> Array:
    """Return the largest change of the course of the contact in a clock step [N or m].

    With times ``when`` [s] only the steps before and after each of them count: an edge that lags has its lowest load in
    either.
    """
    clock, course = scene.clock, scene.contact.course
    if when is None:
        times = np.linspace(0.0, clock.duration, min(clock.steps, _MOST_SLIPS) + 1)
        changes = np.abs(np.diff(course.at(times, clock.duration)))
        return np.asarray([changes.max() * (len(times) - 1) / clock.steps])
    last = np.ceil(when / clock.step - 1e-9)
    around = np.stack([last - 1.0, last, last + 1.0][: 3 if scene.contact.lags else 2])
    times = np.clip(around * clock.step, 0.0, clock.duration)
    return np.asarray(np.abs(np.diff(course.at(times, clock.duration), axis=0)).max(0))


def _remarks_on_step(scene: Scene, path: Array) -> list[str]:
    """Return a remark if a clock step in which a path [m] is slid is too long, with one that is not."""
    slid = path[0]
    if scene.feels_steps:
        gone = -math.log1p(-min(renewed(scene, path)[0], 0.999))
        share = -math.log1p(
            -(_RENEWED_LATE if scene.contact.can_open else _RENEWED_LAGGING)
        ) / max(gone, 1e-300)
        lost = 0.5 * gone / math.tanh(0.5 * gone) - 1.0 if gone else 0.0
        error = f"the variance of its radius is up to {lost:.1%} too large"
        if scene.contact.can_open:
            error = f"the error of its pull-off load is up to {engineering(pull_off_error(scene, path)[0], 'N')}"
        part = f"a step renews {-math.expm1(-gone):.1%} of its variance"
        text = f"ΔΓ acts on the contact only at clock steps, and {part}: {error}"
    elif scene.fluctuations.passes and (scene.contact.lags or scene.contact.can_open):
        share = scene.fluctuations.field.pixels[0] / max(slid, 1e-300)
        text = f"a clock step slides {engineering(slid, 'm')}, more than a pixel of the map: the contact skips pixels"
    else:
        return []
    return [f"{text}; {_finer(scene, share)}"] if share < 1.0 else []


def _finer(scene: Scene, share: float) -> str:
    """Return the cure of a clock step of which this share at most is short enough."""
    between, least = scene.clock.step * scene.clock.stride, scene.clock.stride / share
    count = next(
        count
        for k in range(99)
        for count in (10**k, 2 * 10**k, 5 * 10**k)
        if count >= least
    )
    step = engineering(between / count, "s").replace("µ", "u")
    return f'give clock.step = "{step}"'


def _remark_on_rise(scene: Scene) -> list[str]:
    """Return a remark if friction rises from rest within a clock step, because its peak is then not seen.

    Bonds that form without a stretch bear their steady stress after about the life of a bond.
    """
    drive, bonds, clock = scene.drive, scene.population, scene.clock
    if drive.solves_motion or not (bonds.stretched and bonds.rebinding_rate > 0.0):
        return []
    course = phases(drive, scene.contact, scene.times)
    unstretched = (bonds.start_from != "steady", *course.rests)
    begins = [
        start
        for start, before, rests in zip(
            course.starts, unstretched, course.rests, strict=False
        )
        if before and not rests
    ]
    if not begins:
        return []
    ends = np.array([[start, start + clock.step] for start in begins]).clip(
        max=clock.duration
    )
    paths = [
        drive.pieces(pair, clock.duration).joined.integral.sum()
        for pair in ends
        if pair[1] > pair[0]
    ]
    speeds = np.abs(np.array(paths)) / clock.step
    lives = bonds.life(bonds.steady(speeds).fraction)
    place = int(np.argmin(lives))
    if clock.step <= _SHOWN * lives[place]:
        return []
    life, speed = (
        engineering(float(values[place]), unit)
        for values, unit in ((lives, "s"), (speeds, "m/s"))
    )
    return [
        f"friction rises from rest, and may pass a peak, within about the life of a bond, {life} at {speed}, which"
        f" clock.step is too long to show; {_finer(scene, _RISE * lives[place] / clock.step)}"
    ]
