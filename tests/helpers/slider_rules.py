"""Rules that each run of a driven slider keeps, computed from its records by own formulas, and counts of corners."""

import math
from collections import Counter

import numpy as np
from helpers.scenes import follow
from scipy.linalg import expm

from sim.laws import layer
from sim.laws.layer_table import WIDEST
from sim.parts.drive import READINGS
from sim.step.state import MemberNoise

#: Turns of the speed of a body that rings, and events in a clock step of many events.
TURNS, EVENTS = 6, 10**6


def column(course, name):
    """Return a reading of a driven slider at each record, shape (records, members)."""
    return course.driven[..., READINGS.index(name)]


def has_ended(course):
    """True where the member has ended before, as a runaway or unresolved."""
    times = [column(course, name) for name in ("runaway_time", "unresolved_time")]
    return np.any(np.isfinite(times), axis=0)


def most_of_drive(scenario, course):
    """Return the least and the largest stage speed or force in each clock step, shape (steps, 1)."""
    pieces = scenario.drive.driven(course.time.reshape(-1), scenario.times.duration)
    least, most = np.full((2, len(course.time) - 1, 1), np.nan)
    np.fmin.at(least[:, 0], pieces.interval, np.fmin(pieces.first, pieces.last))
    np.fmax.at(most[:, 0], pieces.interval, np.fmax(pieces.first, pieces.last))
    return least, most


def check_ends(scenario, course):
    """No member is unresolved, and a runaway is one in which nothing could hold the slider."""
    unresolved = np.isfinite(column(course, "unresolved_time"))
    assert not np.any(unresolved), (
        f"members {np.flatnonzero(unresolved.any(axis=0))} are unresolved"
    )
    times = column(course, "runaway_time")
    for member in np.flatnonzero(np.isfinite(times[-1])):
        record = int(np.argmax(np.isfinite(times[:, member])))
        holder = holds(scenario, course, member, max(record, 1))
        # at the ends of the step, within which the area may have shrunk
        if holder == BORNE_BY_BONDS:
            holder = holds_finer(scenario, member, record)
        assert not holder, (
            f"a runaway at {times[record, member]:.6g} s, record {record}, though {holder}"
        )


def holds(scenario, course, member, record):
    """Return what holds a slider in the clock step that ends with a record, or an empty text if nothing does.

    Mass and damping leave a body a motion under any force. A spring leaves a slider a balance of forces with any bonds,
    at the latest where all of them are broken. So a runaway needs a prescribed force, and neither mass nor damping.
    Then an open contact holds nothing. In a closed contact a viscosity holds the slider at a finite speed. Otherwise
    the bonds must bear the force.
    """
    drive, radius = (
        scenario.drive,
        float(course.radius[record - 1, member % course.radius.shape[1]]),
    )
    area = math.pi * np.nan_to_num(radius) ** 2
    delays = drive.mass + drive.damping > 0.0
    if drive.spring:
        return "the spring holds the slider"
    if delays:
        return "mass or damping delays the slider"
    if not area > 0.0:
        return ""
    if drive.viscosity:
        return "the viscosity of the closed contact holds the slider"
    after = float(course.radius[record, member % course.radius.shape[1]])
    area = min(area, math.pi * after**2) if after > 0.0 else area
    least, most = most_of_drive(scenario, course)
    force = max(abs(least[record - 1, 0]), abs(most[record - 1, 0]))
    bonds = [
        min(
            course.fraction[k, member % course.fraction.shape[1]]
            for k in (record - 1, record)
        )
    ]
    return BORNE_BY_BONDS if bears(scenario, force / area, bonds[0]) else ""


def holds_finer(scenario, member, record):
    """Return what holds a slider where it ended by a record, from a run at a sixteenth of the clock step."""
    finer = scenario.with_values({"clock.step": scenario.clock.step / 16.0})
    noise = MemberNoise.of(finer.seed, np.array([member]))
    _, course = follow(finer, noise, None, range(16 * max(record, 1) + 17))
    ends = np.isfinite(column(course, "runaway_time")[:, 0])
    return (
        holds(finer, course, 0, max(int(np.argmax(ends)), 1))
        if ends.any()
        else "finer steps hold it"
    )


#: Holder of a slider under a force that its bonds bear.
BORNE_BY_BONDS = "its bonds bear the force"
#: Share of the strength below which bonds bear a stress, as the area within a clock step is known from its ends only;
#: share of the cut-off stretch that the mean stretch has at least if bonds give way; ruptures of a bond in a clock step
#: below which it outlasts some of the step.
BORNE, SHORT, RUPTURES = 0.98, 0.1, 1e3


def bears(scenario, stress, fraction):
    """True if bonds bear a stress [Pa] for some part of a clock step, at a bond fraction."""
    bonds = scenario.bonds
    if not hasattr(bonds, "law"):
        return stress < BORNE * bonds.stress * fraction
    bound = fraction * bonds.bound_at_rest * bonds.site_density * bonds.bond_stiffness
    if not bound > 0.0:
        return False
    stretch = stress / bound
    if bonds.law.limit < math.inf:
        return stretch < SHORT * bonds.law.limit
    with np.errstate(over="ignore"):
        return bool(bonds.law.at(2.0 * stretch) * scenario.times.step < RUPTURES)


#: Tolerance of the spring's law over the largest force so far; roundings of positions in it, over the position.
HOOKE, ROUNDED = 1e-9, 1e-13


def check_spring(scenario, course):
    """The spring force is its stiffness times the distance from slider to stage."""
    if not scenario.drive.spring:
        return
    going, force = ~has_ended(course), column(course, "spring_force")
    stage, position = column(course, "stage_position"), course.position
    size = np.maximum.accumulate(np.where(going, np.abs(force), 0.0))
    far = np.maximum.accumulate(
        np.where(going, np.maximum(np.abs(stage), np.abs(position)), 0.0)
    )
    bound = HOOKE * size + ROUNDED * scenario.drive.spring * far
    off = np.where(
        going, np.abs(force - scenario.drive.spring * (stage - position)), 0.0
    )
    worst = np.max(off / np.maximum(size, 1e-300), initial=0.0)
    assert np.all(off <= bound), (
        f"the spring force is off by {worst:.1e} of the largest so far"
    )


#: Tolerance of the motion of a slider in an open contact, over its largest force or displacement. It is that of the
#: energies, of which a position of a body that rings has at least half the relative error.
FREE = 1e-3


def check_open(scenario, course):
    """A slider whose contact is open goes on: the solution of its linear equation of motion, in each clock step.

    Without mass and damping no spring force is left. With damping c the spring force relaxes with c/K towards c times
    the speed of the stage. With a mass the linear equation is solved with the mean speed of the stage, if it is steady.
    """
    drive, is_open = (
        scenario.drive,
        np.isnan(course.radius) & np.ones(course.position.shape, bool),
    )
    pairs = is_open[:-1] & is_open[1:] & ~has_ended(course)[1:]
    if not pairs.any():
        return
    stiffness, mass, damping = drive.spring, drive.mass, drive.damping
    force, position, step = (
        column(course, "spring_force"),
        course.position,
        np.diff(course.time.reshape(-1, 1), axis=0),
    )
    least, most = most_of_drive(scenario, course)
    size = np.nanmax(np.abs(force))
    if not mass + damping:
        assert drive.spring, (
            "nothing holds the slider under a force in an open contact, and it goes on"
        )
        rounding = ROUNDED * stiffness * np.nanmax(np.abs(position))
        assert np.all(np.abs(force[1:][pairs]) <= HOOKE * size + rounding), (
            "a spring bears a force without a contact"
        )
        return
    if not mass and stiffness:
        left = np.exp(-stiffness / damping * step)
        low, high = (
            left * force[:-1] + damping * speed * (1.0 - left)
            for speed in (least, most)
        )
        off, bound = (
            np.fmax(low - force[1:], force[1:] - high),
            FREE * (size + damping * np.max(np.abs(most))),
        )
    elif not mass:
        low, high = (position[:-1] + pull / damping * step for pull in (least, most))
        off, bound = (
            np.fmax(low - position[1:], position[1:] - high),
            FREE * np.nanmax(np.abs(position[is_open])),
        )
    else:
        ahead, bound = after_free_step(scenario, course, 0.5 * (least + most), step)
        pairs &= most == least
        # the speed at a record that closed before is that of the interface
        pairs[1:] &= is_open[:-2]
        pairs[0] = False
        off, bound = np.abs(ahead - position[1:]), FREE * bound
    worst = np.max(np.where(pairs, off, 0.0), initial=0.0)
    assert worst <= bound, (
        f"in an open contact the motion is off by {worst / bound * FREE:.1e}"
    )


def after_free_step(scenario, course, drawn, step):
    """Return the positions of free bodies with a mass after each clock step, and the displacement that measures them.

    The body is pulled by a force, or by a stage of steady speed, both ``drawn``.
    """
    stiffness, mass, damping = (
        scenario.drive.spring,
        scenario.drive.mass,
        scenario.drive.damping,
    )
    position, speed = course.position[:-1], course.speed[:-1]
    behind = (
        column(course, "spring_force")[:-1] / stiffness if stiffness else 0.0 * position
    )
    ahead = np.empty(position.shape)
    rate = np.array(
        [
            [0.0, 1.0, 0.0],
            [0.0, -damping / mass, stiffness / mass if stiffness else 1.0 / mass],
            [0.0, -1.0, 0.0],
        ]
    )
    if not stiffness:
        rate[2, 1] = 0.0
    for k in range(len(step)):
        # rows: displacement, speed, lag behind the stage or force; the stage adds its speed to the lag
        whole = np.zeros((4, 4))
        whole[:3, :3] = rate
        whole[2, 3] = drawn[k, 0] if stiffness else 0.0
        start = np.array(
            [
                position[k],
                speed[k],
                behind[k] if stiffness else np.full(speed[k].shape, drawn[k, 0]),
                np.ones(speed[k].shape),
            ]
        )
        ahead[k] = (expm(whole * step[k, 0]) @ start)[0]
    return ahead, np.nanmax(np.abs(position)) + np.nanmax(np.abs(speed)) * np.max(step)


def check_dissipated(scenario, course, bound, size):
    """Energies that bonds, damping, viscosity and slips at once dissipate never come back."""
    for name in ("damping", "viscosity", "rupture", "snaps"):
        fall = -np.nan_to_num(np.diff(column(course, f"dissipated_by_{name}"), axis=0))
        worst = np.max(fall / np.maximum(size[1:], 1e-300), initial=0.0)
        assert np.all(fall <= bound * size[1:]), (
            f"dissipated_by_{name} falls by {worst:.1e} of the largest energy"
        )


#: Tolerance of a strength of bonds.
STRENGTH = 1e-6


def check_peaks(scenario, course, end):
    """No recorded peak exceeds the strength of the bonds, nor the force that a spring without a body bears."""
    drive, bonds = scenario.drive, scenario.bonds
    stress, friction = (
        float(end.events.largest(name)["largest"].max())
        for name in ("stress", "friction")
    )
    area = math.pi * np.nan_to_num(course.radius) ** 2
    widest = np.max(area) + np.max(np.abs(np.diff(area, axis=0)), initial=0.0)
    strength = math.inf
    if not hasattr(bonds, "law"):
        strength = bonds.stress
    elif bonds.law.limit < math.inf:
        strength = bonds.site_density * bonds.bond_stiffness * bonds.law.limit
    if strength < math.inf and not drive.viscosity:
        assert stress <= strength * (1.0 + STRENGTH), (
            f"peak_stress is {stress / strength:.6g} of the strength"
        )
        assert friction <= strength * widest * (1.0 + STRENGTH), (
            "peak_friction exceeds the strength"
        )
    if drive.spring and not drive.mass + drive.damping:
        going = ~has_ended(course)
        borne = np.max(
            np.abs(np.where(going, column(course, "spring_force"), 0.0)), initial=0.0
        )
        stage = column(course, "stage_position")
        borne += drive.spring * np.max(np.abs(np.diff(stage, axis=0)), initial=0.0)
        assert friction <= borne * (1.0 + STRENGTH), (
            f"peak_friction is {friction / borne:.6g} of what the spring bears"
        )


#: Tolerance of the load or displacement at which a contact pulls off, over the scale of the pull-off.
TURN = 1e-6
#: Work of adhesion over that at rest below which a contact is taken for a Hertzian one.
LEAST_WORK = 1e-9


def check_turns(scenario, course):
    """A contact is closed exactly as the fold of its mount and the first touch demand, by an own computation of both.

    Left out: edges that lag, works of adhesion that depend on the radius (a disc, a reversible share), and steps in
    which the motion ends or has ended, after which the contact stays as it was.
    """
    contact, bodies = scenario.contact, scenario.bodies
    if contact.lags or contact.reversible or scenario.margin is not None:
        return
    time = course.time.reshape(-1, 1)
    value = (
        np.asarray(contact.course.at(time, scenario.times.duration)).reshape(-1, 1)
        + 0.0 * time
    )
    least = max(LEAST_WORK * scenario.adhesion.work, 1e-12)
    work, is_open = np.fmax(course.work, least), np.isnan(course.radius)
    if scenario.solid.thickness is None:
        fold, scale = pull_off(contact, work, bodies.sphere_radius, bodies.modulus)
    else:
        fold, scale = pull_off_on_layer(contact, work, scenario)
    near = TURN * np.maximum(scale, np.max(np.abs(value)))
    again = contact.after_pull_off == "reattach"
    is_open, value, fold = np.broadcast_arrays(is_open, value, fold)
    before, after, has_work = (
        is_open[:-1],
        is_open[1:],
        np.broadcast_to(work > least, is_open.shape)[1:],
    )
    ended = np.broadcast_to(np.isnan(course.position), is_open.shape)
    assert not np.any(ended[:-1] & (before != after)), (
        "a contact opens or closes after the end of the motion"
    )
    lost, holds_on = value[1:] < fold[1:] - near, value[1:] > fold[1:] + near
    touches, apart = value[1:] > near, value[1:] < -near
    lost, touches = lost & ~ended[1:], touches & ~ended[1:]
    never_closed = np.logical_and.accumulate(is_open)[:-1]
    assert not np.any(~before & ~after & lost), (
        "a contact is closed beyond its pull-off"
    )
    assert not np.any(~before & after & holds_on & has_work), (
        "a contact opens before its pull-off"
    )
    assert not np.any(before & after & touches & (again | never_closed)), (
        "a contact is open though the sphere touches"
    )
    assert not np.any(before & ~after & apart), (
        "a contact closes before the sphere touches"
    )
    assert again or not np.any(before & ~after & ~never_closed), (
        "a contact closes that should stay open"
    )


def pull_off_on_layer(contact, work, scenario):
    """Return the same of a contact on a layer, from a parabola through the three least values of a scan of radii."""
    thickness, modulus = scenario.solid.thickness, scenario.bodies.modulus
    x = np.geomspace(1e-6, 0.999 * WIDEST, 4000)
    e1, e2, g1, g2 = (layer.contact_function(which, x) for which in (0, 2, 4, 5))
    a, sizes = thickness * x, scenario.sphere.radius
    works, place = np.unique(np.ravel(work), return_inverse=True)
    root = np.sqrt(2.0 * math.pi * a * works[:, np.newaxis] / modulus) / e1
    depth = a**2 * e2 / (e1 * sizes) - root
    load = 2.0 * modulus * (depth * a * g1 - a**3 * g2 / sizes)
    values = load
    if contact.load is None:
        values = depth + (load / contact.stiffness if contact.stiffness else 0.0)
    least = np.clip(values.argmin(axis=1), 1, len(x) - 2)
    rows = np.arange(len(works))
    before, at, after = (values[rows, least + shift] for shift in (-1, 0, 1))
    bend = before - 2.0 * at + after
    fold = at - 0.125 * (after - before) ** 2 / np.where(bend > 0.0, bend, np.inf)
    fold = fold[place].reshape(work.shape)
    return fold, np.max(np.abs(fold))


def pull_off(contact, work, sphere_radius, modulus):
    """Return the load or displacement at the fold of a JKR contact, and a scale of it.

    At a load it is −(3/2) π w R. Behind a stiffness it is the least displacement, where its slope over the radius,
    which rises, is zero.
    """
    if contact.load is not None:
        return -1.5 * math.pi * work * sphere_radius, 1.5 * math.pi * np.max(
            work
        ) * sphere_radius
    compliance = 1.0 / contact.stiffness if contact.stiffness else 0.0
    low, high = (
        np.zeros(work.shape),
        4.0 * np.cbrt(math.pi * work * sphere_radius**2 / modulus),
    )
    for _ in range(100):
        a = 0.5 * (low + high)
        slope = 2.0 * a / sphere_radius - np.sqrt(0.5 * math.pi * work / (modulus * a))
        slope += compliance * (
            4.0 * modulus * a**2 / sphere_radius
            - 3.0 * np.sqrt(2.0 * math.pi * work * modulus * a)
        )
        low, high = np.where(slope < 0.0, a, low), np.where(slope < 0.0, high, a)
    a = high
    depth = a**2 / sphere_radius - np.sqrt(2.0 * math.pi * a * work / modulus)
    load = 4.0 * modulus * a**3 / (3.0 * sphere_radius) - np.sqrt(
        8.0 * math.pi * work * modulus * a**3
    )
    fold = depth + compliance * load
    return fold, np.max(np.abs(fold)) + np.max(a**2) / sphere_radius


def reached(scenario, course):
    """Return counts of the corners that the first member of a run reached."""
    if not scenario.drive.solves_motion:
        return Counter()
    going, closed = ~has_ended(course)[:, 0], course.radius[:, 0] > 0.0
    opens = int(np.sum(closed[:-1] & ~closed[1:] & going[1:]))
    closes = int(np.sum(~closed[:-1] & closed[1:] & going[1:]))
    spring = bool(scenario.drive.spring)
    speed = course.speed[closed & going, 0]
    turns = int(np.sum(speed[1:-1] * speed[2:] < 0.0))
    rings = scenario.drive.mass > 0.0 and turns >= TURNS
    events = np.diff(column(course, "substeps")[:, 0])
    many = int(np.sum(events >= EVENTS)) if scenario.bonds.model == "tracked" else 0
    return Counter(
        {
            "openings behind springs": opens * spring,
            "openings under forces": opens * (not spring),
            "closings": closes,
            "ringing bodies on cohorts": int(
                rings and scenario.bonds.model == "cohort"
            ),
            "ringing bodies on other bonds": int(
                rings and scenario.bonds.model != "cohort"
            ),
            "clock steps with a million events": many,
            "runaways": int(np.isfinite(column(course, "runaway_time")[-1, 0])),
        }
    )
