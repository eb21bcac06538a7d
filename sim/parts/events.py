"""Events of a run, seen at every clock step: the largest stress, friction and pull, openings, masking, slip events.

Maxima are refined between steps. Records have no influence on events. Most are kept for each phase of the run.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.numerics.jit import device, kernel
from sim.parts.exchange import Array, Bonding, ContactState, Motion, during, record
from sim.quantities import SLIP_EVENT

#: Arrays that are read alone, as they come.
_READ = "Array(float64, 2, 'A', readonly=True), "
#: What a stress and its slope follow from.
_OF_THE_STRESS = "stress", "stiffness", "relaxation"
#: Change over a step, by the slope at one of its ends, over the value, up to which a cubic holds.
_RESOLVED = 5.0
#: A maximum, its time [s], the sliding speed [m/s] and the contact area [m²] there.
EXTREME = record("largest time speed area")
#: Row of a running maximum: the last value but one, the last value, 1 if the value fell at both ends of the last step
#: by its slopes and -1 if it may have a kink there, and the maximum of the phase so far.
MAXIMUM = record("before last falls " + " ".join(EXTREME.names or ()))
_NO_MAXIMUM = np.array([-math.inf, 0.0, 0.0, *(-math.inf for _ in EXTREME.names or ())])
#: Time of the first opening and of the first closing of a contact [s], and the radius after that closing [m].
TURN = record("opening closing radius")
#: Row of a contact: radius [m] when it last opened or closed, and time of the last detachment [s]; number of
#: detachments; time at which it was first masked, time for which it was closed, and of that masked [s]; then the turns
#: of the phase.
CONTACT = record(
    "last detached detachments masked closed hidden " + " ".join(TURN.names or ())
)
#: Its columns for the kernel, because a kernel with a view of a record takes 0.1 s to load.
(
    _LAST,
    _DETACHED,
    _DETACHMENTS,
    _MASKED,
    _CLOSED,
    _HIDDEN,
    _OPENING,
    _CLOSING,
    _RADIUS,
) = range(len(CONTACT.names or ()))
#: Fall of the spring force that makes a slip event, and rise that ends it, over the largest force so far.
FALL, RISE = 0.3, 0.1
#: Slip of the interface over the slider's advance in a slip event, at least.
_SLIPPED = 0.5
#: Slip events of a member that are stored at most.
MOST_SLIPS = 1000
#: A slip event: its time (that of the force's maximum) and its end [s], the slider's advance [m], speed of the stage
#: at its time [m/s], spring force there and at its end [N], largest stress since the event before and least stress in
#: the event [Pa]. Forces and stresses are in the sense in which the stage moves.
SLIP = record(" ".join(SLIP_EVENT))
#: Work of the stage [J], path of the stage and of the slider [m], all since the start.
_GONE = "work", "path", "gone"
#: State of the detector: sense in which the stage moves and its position, that of the slider, slip of the interface so
#: far, largest force so far, 1 once the force has fallen far enough; positions of slider and interface at the last
#: maximum of the force and at its least value since; time of the event before; count of all events. Then the event that
#: may come, as ``SLIP``. Last ``_GONE`` now, at the last maximum, at half of the run, and at the first and the last of
#: the late events.
SLIPPING = record(
    "sense stage position slid largest falling top top_slid low low_slid before count "
    + " ".join([*(SLIP.names or ()), *_GONE])
    + "".join(
        f" {at}_{name}" for at in ("top", "half", "first", "last") for name in _GONE
    )
)
#: Quantities of late slip events of which moments are kept, and their moments.
LATE = "force_before", "force_drop", "amplitude", "recurrence"
MOMENTS = record("count mean squares least largest")


class Slips(NamedTuple):
    """Slip events of members; no rows if no stage pulls.

    Attributes
    ----------
    running : array, shape (members, columns)
        State of the detector, rows of ``SLIPPING``.
    late : array, shape (members, quantities, 5)
        Moments of the quantities ``LATE`` of events in the second half of the run, rows of ``MOMENTS``.
    log : array, shape (members, events, 8)
        The first events, rows of ``SLIP``, nan beyond the last.
    """

    running: Array
    late: Array
    log: Array

    @classmethod
    def none(cls, stage: Array) -> "Slips":
        """Return the slip events before the first sample, for positions of the stage at the start [m]."""
        slipping, moments, slip = (
            len(kind.names or ()) for kind in (SLIPPING, MOMENTS, SLIP)
        )
        running = np.zeros((len(stage), slipping))
        running.view(SLIPPING)[:, 0]["stage"] = stage
        return cls(
            running,
            np.zeros((len(stage), len(LATE), moments)),
            np.zeros((len(stage), 0, slip)),
        )

    def after(
        self,
        time: Array,
        stage: tuple[Array, Array],
        slider: tuple[Array, ...],
        half: float,
    ) -> "Slips":
        """Return the slip events after some more samples.

        Parameters
        ----------
        time : array, shape (samples,)
            Times [s].
        stage : tuple of arrays, shape (samples, members)
            Position [m] and speed [m/s] of the stage.
        slider : tuple of arrays, shape (samples, members)
            Spring force [N], position of the slider [m], slip of the interface since the sample before [m], shear
            stress [Pa], and work of the stage since the start [J].
        half : float
            Time from which on events are late [s].
        """
        samples = time, *stage, *slider, half
        slips = Slips(self.running.copy(), self.late.copy(), self.log[:, :0])
        if not _follow_slips(*samples, *slips):
            return Slips(*slips[:2], self.log)
        # of the count alone, not of the blocks
        room = 2 ** math.ceil(math.log2(min(slips.total.max(), MOST_SLIPS)))
        log = np.full((len(self.log), room, self.log.shape[2]), np.nan)
        log[:, : self.log.shape[1]] = self.log
        slips = Slips(self.running.copy(), self.late.copy(), log)
        _follow_slips(*samples, *slips)
        return slips

    @property
    def total(self) -> Array:
        """Return the number of slip events of each member so far."""
        counts: Array = self.running.view(SLIPPING)[:, 0]["count"]
        return counts

    def column(self, name: str) -> Array:
        """Return a column of the first events by its name in ``SLIP``, shape (members, events)."""
        stored = int(min(self.total.max(initial=0.0), MOST_SLIPS))
        return self.log[:, :stored, (SLIP.names or ()).index(name)]

    def kinetic_friction(self) -> Array:
        """Return the work of the stage over its path [N], from the first late event to the last.

        Without two late events the span is the second half of the run. The result is nan if the slider moved less than
        half as far as the stage, because the spring is then still extending.
        """
        state = self.running.view(SLIPPING)[:, 0]
        slips = self.late[:, 0].view(MOMENTS)[:, 0]["count"] > 1.0
        between = (state[f"last_{name}"] - state[f"first_{name}"] for name in _GONE)
        since_half = (state[name] - state[f"half_{name}"] for name in _GONE)
        work, path, gone = (
            np.where(slips, *spans) for spans in zip(between, since_half, strict=True)
        )
        follows = (path > 0.0) & (gone > _SLIPPED * path)
        friction: Array = np.divide(
            work, path, out=np.full(len(path), np.nan), where=follows
        )
        return friction


@device
def slip_ends(time, stage, speed, force, position, slip, stress, work, state, event):
    """Take one sample of a slider behind a spring; return True if a slip event has ended, and fill it in.

    Notes
    -----
    A slip event is a fall of the spring force by more than ``FALL`` of its largest magnitude so far, from a maximum to
    the next minimum, during which the interface slips at least half of the slider's advance. The minimum is known once
    the force has risen again by ``RISE`` of the largest. A stage that stops or turns back ends a fall without an event.
    """
    if math.isnan(position):
        return False
    sense = 1.0 if stage > state.stage else -1.0 if stage < state.stage else 0.0
    turns = sense != state.sense
    state.path += math.fabs(stage - state.stage)
    state.gone += math.fabs(position - state.position)
    state.sense, state.stage, state.position, state.work = sense, stage, position, work
    state.slid += slip
    if math.fabs(force) > state.largest:
        state.largest = math.fabs(force)
    if turns:
        state.before = math.nan
    if sense == 0.0:
        return False
    pull, bears = sense * force, sense * stress
    rises = (
        not turns
        and state.falling > 0.0
        and pull - state.force_after > RISE * state.largest
    )
    slips = False
    if rises:
        advance, slid = (
            sense * (state.low - state.top),
            sense * (state.low_slid - state.top_slid),
        )
        slips = advance > 0.0 and slid >= _SLIPPED * advance
        if slips:
            event.time, event.end, event.amplitude, event.speed = (
                state.time,
                state.end,
                advance,
                state.speed,
            )
            event.force_before, event.force_after = (
                state.force_before,
                state.force_after,
            )
            event.stress_before, event.stress_after = (
                state.stress_before,
                state.stress_after,
            )
    if turns or rises:
        state.falling, state.force_before, state.stress_before = 0.0, -math.inf, bears
    if bears > state.stress_before:
        state.stress_before = bears
    if pull > state.force_before:
        state.force_before, state.time, state.speed = pull, time, math.fabs(speed)
        state.top, state.top_slid, state.force_after, state.stress_after = (
            position,
            state.slid,
            math.inf,
            bears,
        )
        state.top_work, state.top_path, state.top_gone = work, state.path, state.gone
    if bears < state.stress_after:
        state.stress_after = bears
    if pull < state.force_after:
        state.force_after, state.end, state.low, state.low_slid = (
            pull,
            time,
            position,
            state.slid,
        )
    if state.force_before - state.force_after > FALL * state.largest:
        state.falling = 1.0
    return slips


@device
def _gather(value, moments):
    """Add a value to the moments of those before."""
    row = moments.view(MOMENTS)[0]
    first = row.count == 0.0
    row.count += 1.0
    apart = value - row.mean
    row.mean += apart / row.count
    row.squares += apart * (value - row.mean)
    if first or value < row.least:
        row.least = value
    if first or value > row.largest:
        row.largest = value


@kernel(
    f"boolean(Array(float64, 1, 'A', readonly=True), {7 * _READ}float64, "
    "float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1])"
)
def _follow_slips(
    times, stage, speed, force, position, slip, stress, work, half, running, late, log
):
    """Take samples of all members; return True if a slip event has ended."""
    ends = False
    columns = np.zeros(log.shape[2])
    event = columns.view(SLIP)[0]
    for i in range(len(running)):
        state = running[i].view(SLIPPING)[0]
        for k in range(len(times)):
            mark = state.top_work, state.top_path, state.top_gone
            sample = (
                times[k],
                stage[k, i],
                speed[k, i],
                force[k, i],
                position[k, i],
                slip[k, i],
                stress[k, i],
            )
            ended = slip_ends(*sample, work[k, i], state, event)
            # a stage at rest has no path
            if times[k] >= half and state.half_path == 0.0:
                state.half_work, state.half_path, state.half_gone = (
                    state.work,
                    state.path,
                    state.gone,
                )
            if not ended:
                continue
            ends = True
            if state.count < min(log.shape[1], MOST_SLIPS):
                log[i, int(state.count)] = columns
            if event.time >= half:
                state.last_work, state.last_path, state.last_gone = mark
                if late[i, 0, 0] == 0.0:
                    state.first_work, state.first_path, state.first_gone = mark
                _gather(event.force_before, late[i, 0])
                _gather(event.force_before - event.force_after, late[i, 1])
                _gather(event.amplitude, late[i, 2])
                if state.before >= half:
                    _gather(event.time - state.before, late[i, 3])
            state.count += 1.0
            state.before = event.time
    return ends


class Events(NamedTuple):
    """Events so far; NaN counts as 0 in a maximum; ties keep the first.

    The first four are arrays of the shape (rows, phases, columns), the present phase last. All are rows of ``MAXIMUM``,
    in magnitude. ``stress`` is that of the shear stress [Pa] and ``friction`` that of the friction force [N]. ``pull``
    is that of the tensile load of a closed contact [N], without rows if the load is constant. ``contact`` are rows of
    ``CONTACT``. ``path`` is the longest path within a step [m], shape (1,) or (members,). ``slips`` are the slip
    events.
    """

    stress: Array
    friction: Array
    pull: Array
    contact: Array
    path: Array
    slips: Slips

    def next_phase(self) -> "Events":
        """Return the events at the start of another phase."""
        contact = self.contact[:, -1:].copy()
        contact[..., _OPENING:] = np.nan
        ahead = *(_started(rows[:, -1, 1]) for rows in self[:3]), contact
        phases = (
            np.concatenate(pair, axis=1) for pair in zip(self[:4], ahead, strict=True)
        )
        return Events._make([*phases, self.path, self.slips])

    def by_phase(self, name: str) -> NDArray[np.void]:
        """Return the events of a name in all phases up to this one, as records, shape (rows, phases)."""
        rows: Array = getattr(self, name)
        return rows.view(CONTACT if name == "contact" else MAXIMUM)[..., 0]

    def largest(self, name: str) -> NDArray[np.void]:
        """Return the largest stress, friction or pull of the run, as a record ``MAXIMUM`` in each row."""
        maxima = self.by_phase(name)
        first = maxima["largest"].argmax(axis=1)
        return maxima[np.arange(len(maxima)), first]

    def first_turn(self, name: str) -> NDArray[np.void]:
        """Return the first opening or closing of the run, as a record ``CONTACT`` in each row; nan without one."""
        turns = self.by_phase("contact")
        first = np.isfinite(turns[name]).argmax(axis=1)
        return turns[np.arange(len(turns)), first]


def first(bonding: Bonding, contact: ContactState, pull: Array, stage: Array) -> Events:
    """Return the events at t = 0, from the bonds, the contact and a pull [N].

    ``stage`` are positions of the stages that pull through a spring [m].
    """
    stress = np.abs(bonding.stress)
    friction = stress * (np.pi * contact.radius**2)
    rows = np.zeros((len(contact.radius), 1, len(CONTACT.names or ())))
    rows[:, 0, _LAST], rows[..., _DETACHED], rows[..., _OPENING:] = (
        contact.radius,
        -np.inf,
        np.nan,
    )
    rows[:, 0, _MASKED] = np.where(
        (contact.work <= 0.0) & (contact.radius > 0.0), 0.0, np.nan
    )
    started = [
        _started(np.where(np.isnan(values), 0.0, values))
        for values in (stress, friction, pull)
    ]
    return Events._make([*started, rows, np.zeros(1), Slips.none(stage)])


def _started(values: Array) -> Array:
    """Return running maxima before the first step of a phase, from the values at its start."""
    rows = np.empty((len(values), 1, len(_NO_MAXIMUM)))
    rows[:], rows[:, 0, 1] = _NO_MAXIMUM, values
    return rows


def after(
    so_far: Events,
    before: tuple[Bonding, Array],
    bonding: Bonding,
    contact: ContactState,
    pull: Array,
    motions: Motion,
    with_path: bool = False,
    with_area: bool = True,
) -> Events:
    """Return the events after a block of steps in one phase, from bonds, contact and pull [N] at the end of each.

    ``before`` are bonds and contact radius at its start. The path is followed only ``with_path``, the area at the
    largest stress only ``with_area``: members that share a stress may differ in it.

    Notes
    -----
    The slope of the stress over time is ``stiffness`` × speed + ``relaxation``, and speed and area are taken as linear
    within a step. Where the slopes are known, a maximum between the ends is that of the cubic through values and
    slopes, of fourth order, if neither slope alone would change the value by more than five times its size within the
    step. It is at most what the tangents at both ends allow, because a kink between them would lift the cubic above
    both. Where the slopes are unknown, or contradict the values (bonds follow the mean speed of a step), and for the
    pull, a sample above its two neighbours is refined by the parabola through the three, of third order, if both
    neighbours have more than half of its value: a quantity that jumps is not smooth there.

    The stress of bonds without a stretch has kinks wherever the slider starts or stops, and jumps with its speed. Its
    maximum is therefore that of the samples, of second order, and the strength at the end of a stick phase. The
    friction is refined by a parabola only where it follows the contact area rather than the stress.
    """
    start, radius_before = before
    stress, stiffness, relaxation = (
        _with_start(getattr(start, name), getattr(bonding, name), len(contact.radius))
        for name in _OF_THE_STRESS
    )
    radii = _with_start(radius_before, contact.radius, len(contact.radius))
    rows = max(len(so_far.stress), stress.shape[1])
    members = max(rows, len(so_far.friction), radii.shape[1])
    counts = (
        rows,
        members,
        max(len(so_far.pull), pull.shape[1]),
        max(len(so_far.contact), radii.shape[1]),
    )
    now = [
        values + np.zeros((count, 1, 1))
        for values, count in zip(so_far[:4], counts, strict=True)
    ]
    here = (values[:, -1] for values in now)
    ends = (
        motions.first,
        motions.speed,
        *motions.stick_ends,
        motions.time[:, 0],
        motions.duration[:, 0],
    )
    bent = np.isnan(bonding.frozen).all()  # bonds without a stretch
    traits = 1.0 * with_area, 1.0 * bent
    _follow(
        stress,
        stiffness,
        relaxation,
        radii,
        pull,
        contact.work,
        contact.detached,
        *ends,
        *traits,
        *here,
    )
    path = (
        np.maximum(so_far.path, motions.path.max(axis=0)) if with_path else so_far.path
    )
    return Events._make([*now, path, so_far.slips])


def _with_start(before: Array, values: Array, steps: int) -> Array:
    """Values at the start of a block and at the end of each step, shape (steps + 1, rows)."""
    if values.ndim == 1:
        return during(values, steps + 1)
    return np.concatenate([np.broadcast_to(before, (1, *values.shape[1:])), values])


@device
def _of(values, k, i):
    """Return the value of a member at a time; all members may share a column."""
    return values[k, i if values.shape[1] > 1 else 0]


@device
def _load(k, i, stress, stiffness, relaxation, speed, radius):
    """Magnitude of the stress, its slope over time at a speed, and the area."""
    value, area = _of(stress, k, i), math.pi * _of(radius, k, i) ** 2
    slope = _of(stiffness, k, i) * speed + _of(relaxation, k, i)
    return (
        math.fabs(value),
        (slope if value > 0.0 else -slope if value < 0.0 else math.fabs(slope)),
        area,
    )


@kernel(
    f"void({11 * _READ}{2 * 'float64[:], '}float64, float64, {', '.join(4 * ['float64[:, :]'])})"
)
def _follow(
    stresses,
    stiffness,
    relaxation,
    radii,
    pulls,
    works,
    detached,
    first,
    speed,
    strengths,
    since,
    times,
    steps,
    share,
    bent,
    stress,
    friction,
    pull,
    contact,
):
    bonds, none = (stresses, stiffness, relaxation), (0.0, math.nan, 0.0)
    for k in range(len(times)):
        time, step = times[k], steps[k]
        for i in range(len(friction)):
            strength, place = _of(strengths, k, i), _of(since, k, i) / step
            speeds = _of(first, k, i), _of(speed, k, i)
            value0, slope0, area0 = _load(k, i, *bonds, speeds[0], radii)
            value1, slope1, area1 = _load(k + 1, i, *bonds, speeds[1], radii)
            around = time, step, speeds[0], speeds[1], area0, area1
            if i < len(stress):
                # an open contact has none to leave out
                areas = (area0, area1) if share > 0.0 else (0.0, 0.0)
                _keep(
                    value1,
                    slope0,
                    slope1,
                    (*around[:4], areas[0], areas[1]),
                    (bent, strength, place),
                    stress,
                    i,
                )
            growth = (area1 - area0) / step
            rise, slope = (
                area0 * slope0 + growth * value0,
                area1 * slope1 + growth * value1,
            )
            of_stress = math.fabs(value1 - value0) * (area0 + area1)
            of_area = math.fabs(area1 - area0) * (value0 + value1)
            kink = (
                (bent if of_stress > of_area else 0.0),
                strength * (area1 - place * (area1 - area0)),
                place,
            )
            _keep(value1 * area1, rise, slope, around, kink, friction, i)
        for i in range(len(pull)):
            area0, area1 = (
                math.pi * _of(radii, k, i) ** 2,
                math.pi * _of(radii, k + 1, i) ** 2,
            )
            around = time, step, _of(first, k, i), _of(speed, k, i), area0, area1
            _keep(_of(pulls, k, i), math.nan, math.nan, around, none, pull, i)
        for i in range(len(contact)):
            radius, work, opening = (
                _of(radii, k + 1, i),
                _of(works, k, i),
                _of(detached, k, i),
            )
            closed, was_closed = radius > 0.0, contact[i, _LAST] > 0.0
            if closed:
                contact[i, _CLOSED] += step
            if (
                closed != was_closed
                or (closed and not work > 0.0)
                or opening > contact[i, _DETACHED]
            ):
                _turn(time, step, radius, work, opening, contact[i])


@device
def _turn(time, step, radius, work, detached, row):
    """Take the radius [m], work of adhesion [J/m²] and time of the last detachment of a contact after a step.

    It is called where one of them matters: a contact that stays open, or closed with work of adhesion left, has no
    events.
    """
    opens = detached > row[_DETACHED]
    was_open = opens or not row[_LAST] > 0.0
    row[_LAST] = radius
    if opens:
        row[_DETACHED] = detached
        row[_DETACHMENTS] += 1.0
        if math.isnan(row[_OPENING]):
            row[_OPENING] = detached
    if not radius > 0.0:
        return
    if work <= 0.0:
        row[_HIDDEN] += step
        if math.isnan(row[_MASKED]):
            row[_MASKED] = time
    if was_open and math.isnan(row[_CLOSING]):
        row[_CLOSING], row[_RADIUS] = time, radius


@device
def _keep(now, rise, slope, around, kink, maxima, i):
    """Replace the maximum of a row by that after a value ``now``; slopes at both ends of the step, nan if unknown.

    ``around``: time and length of the step [s], speeds and areas at both ends. ``kink``: 1 if the value may have one in
    the step, the value at a maximum that is one, nan without, and its place as share of the step before its end. Rows
    are taken by their number, because a row that is an array, or a view of a record, costs twice the time.
    """
    time, step, speed0, speed1, area0, area1 = around
    before, last, fell, largest = maxima[i, 0], maxima[i, 1], maxima[i, 2], maxima[i, 3]
    bent, top, place_of_top = kink
    now = 0.0 if math.isnan(now) else now
    place = -1.0  # of a new maximum, as share of the step before its end
    if last > largest:  # at the start of a phase
        largest, place = last, 1.0
    if now > largest:
        largest, place = now, 0.0
    peak, back = -math.inf, 0.0
    # max compiles for long
    steepest, larger = rise if rise > -slope else -slope, last if last > now else now
    if rise > 0.0 > slope and step * steepest < _RESOLVED * larger:
        peak, back = _top(last, now, step * rise, step * slope)
    elif (
        bent == 0.0
        and fell >= 0.0
        # slopes are wrong or unknown
        and (fell > 0.0 or math.isnan(rise + slope) or (rise > 0.0 and slope > 0.0))
        and (last >= before and last > now and before > 0.5 * last and now > 0.5 * last)
    ):
        back = 1.0 - 0.5 * (before - now) / (before - 2.0 * last + now)
        peak = last - 0.25 * (before - now) * (1.0 - back)
    if top > peak:
        peak, back = top, place_of_top
    if peak > largest:
        largest, place = peak, back
    maxima[i, 0], maxima[i, 1] = last, now
    maxima[i, 2] = -1.0 if bent > 0.0 else 1.0 if rise < 0.0 and slope < 0.0 else 0.0
    if place >= 0.0:
        maxima[i, 3], maxima[i, 4] = largest, time - place * step
        maxima[i, 5], maxima[i, 6] = (
            speed1 - place * (speed1 - speed0),
            area1 - place * (area1 - area0),
        )


@device
def _top(last, now, rise, slope):
    """Maximum of the cubic with these values and slopes, up then down, over a unit interval; how far before its end.

    The derivative ``rise + 2 b s + c s²`` has one zero between the ends, since it changes its sign there. The maximum
    is lowered to the tangents at both ends where it exceeds one of them.
    """
    b, c = (
        3.0 * (now - last) - 2.0 * rise - slope,
        3.0 * (rise + slope) - 6.0 * (now - last),
    )
    square = b * b - rise * c
    s = rise / (math.sqrt(0.0 if square < 0.0 else square) - b)
    peak, first, second = (
        last + s * (rise + s * (b + s * c / 3.0)),
        last + s * rise,
        now - (1.0 - s) * slope,
    )
    lower = first if first < second else second
    return (peak if peak < lower else lower), 1.0 - s
