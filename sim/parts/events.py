"""Events of a run, seen at every clock step: the largest stress, friction and pull, openings, masking, slip events.

Maxima are refined between steps. Records have no influence on events. Most are kept for each phase of the run.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.numerics.jit import device, kernel
from sim.parts.exchange import (
    TURN,
    Array,
    Bonding,
    ContactState,
    Motion,
    during,
    record,
)
from sim.quantities import SLIP_EVENT

#: Arrays that are read alone, as they come.
_READ = "Array(float64, 2, 'A', readonly=True), "
_READ_ROWS = _READ.replace("2", "3")
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
#: Row of the first maximum of the friction since a rest, or since the start: the friction then, 1 once it has fallen
#: from the maximum, or if no maximum is looked for, and the maximum, its time [s] and the contact area [m²] there.
RISE = record("start fallen largest time area")
#: Share of a maximum by which the friction must fall before it exceeds the maximum again.
FALLEN = 0.01
#: Relative difference up to which a friction is the one at the start.
_SAME = 1e-9
#: Times of the first opening and of the first closing of a contact [s]. Time [s], load [N] and displacement of the
#: mount [m] of its first pull-off, and of its first jump into contact.
TURNS = record(
    "opening closing "
    + " ".join(
        f"{of}_{name}" for of in ("pull_off", "jump_in") for name in TURN.names or ()
    )
)
#: Row of a contact: radius [m] when it last opened or closed, and time of the last detachment [s]; number of
#: detachments; time at which it was first masked, time for which it was closed, and of that masked [s]; then the turns
#: of the phase.
CONTACT = record(
    "last detached detachments masked closed hidden " + " ".join(TURNS.names or ())
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
    _PULL_OFF,
    _PULL_OFF_LOAD,
    _PULL_OFF_DISPLACEMENT,
    _JUMP_IN,
    _JUMP_IN_LOAD,
    _JUMP_IN_DISPLACEMENT,
) = range(len(CONTACT.names or ()))
#: Speed of the slider over that of the stage above which it slips.
FASTER = 10.0
#: Least fall of the spring force in a slip event, over the largest force before; largest distance by which the slider
#: has gone back just before, over its advance in the event.
LEAST_FALL, MOST_BACK = 0.3, 0.5
#: Slip events of a member that are stored at most.
MOST_SLIPS = 1000
#: A slip event: its time and its end [s], the slider's advance [m], speed of the stage at its time [m/s], largest
#: spring force since the event before and the force at its end [N], largest stress since the event before and least
#: stress in the event [Pa]. Forces and stresses are in the sense in which the stage moves.
SLIP = record(" ".join(SLIP_EVENT))
#: Work of the stage [J] and its path [m], since the start.
_SPENT = "work", "path"
#: Marks at which they are kept: the start of an episode; the half and three quarters of the run; the first of the late
#: events, the first after three quarters of the run, and the last.
_MARKS = "begin", "half", "quarter", "first", "middle", "final"
#: State of the detector: sense in which the stage last moved, and that of its last step (0 at rest). Then the last
#: sample. Then the speed of the stage when the slider was last not faster, or the largest one since; 1 if the slider is
#: faster than the stage; 1 if it slips; its place when it was last faster; place and force at which it became faster
#: than that speed, a place of nan if it did not, and at which it began to slip; number of episodes that are events but
#: for the speed of the slider. Then the times of the last two events and their count, the event that may come, as
#: ``SLIP``, and the marks.
SLIPPING = record(
    "sense motion clock stage stage_speed position force work path "
    "reference faster slips farthest faster_start faster_force start from_force slow "
    "before latest interval count "
    + " ".join(SLIP.names or ())
    + "".join(f" {mark}_{name}" for mark in _MARKS for name in _SPENT)
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

    Notes
    -----
    A slip event is an episode in which the slider is faster than ten times the stage. It ends when the slider is slower
    than the stage. The speeds are the displacements over a clock step, so that a slip that takes no time counts if it
    is longer than ten times the path of the stage in a step. Three rules make the number of events independent of the
    factor ten as long as slips are much faster than the stage:

    - The stage is as fast as when the slider was last slower, or faster. If the stage slows down, stops or turns, the
      slider lags behind it for a while, and this is no event. While the stage rests, its last speed counts.
    - The spring force falls by at least 0.3 of the largest force since the event before. A slider on few bonds that are
      followed one by one jumps at each rupture. Most of these jumps are smaller: of N bonds one bears 1/N of the force.
    - Just before the event the slider has gone back by less than half of its advance in the event. After a slip a body
      with mass oscillates on its spring or on bonds that hold. There it goes back as far as it then advances.

    A slow fall of the force beyond a friction maximum is no event, because the slider is hardly faster than the stage.
    Episodes in which the slider is faster than the stage, but not ten times, and that keep the three rules, are
    counted apart: in a fast oscillation, or if a clock step is too long to show the speed of a slip.
    An event that the stage ends by turning back counts; one that lasts beyond the end of the run does not.
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
        state = running.view(SLIPPING)[:, 0]
        state["stage"], state["before"], state["latest"] = stage, np.nan, np.nan
        state["interval"] = np.nan
        return cls(
            running,
            np.zeros((len(stage), len(LATE), moments)),
            np.zeros((len(stage), 0, slip)),
        )

    def after(
        self, time: Array, samples: Array, half: float, factor: float = FASTER
    ) -> "Slips":
        """Return the slip events after some more samples.

        Parameters
        ----------
        time : array, shape (samples,)
            Times [s].
        samples : array, shape (6, samples, members)
            Position [m] and speed [m/s] of the stage, spring force [N], position of the slider [m], shear stress [Pa],
            and work of the stage since the start [J].
        half : float
            Time from which on events are late [s].
        factor : float
            Speed of the slider over that of the stage above which it slips.
        """
        inputs = time, samples, half, factor
        slips = Slips(self.running.copy(), self.late.copy(), self.log[:, :0])
        if not _follow_slips(*inputs, *slips):
            return Slips(*slips[:2], self.log)
        # of the count alone, not of the blocks
        room = 2 ** math.ceil(math.log2(min(slips.total.max(), MOST_SLIPS)))
        log = np.full((len(self.log), room, self.log.shape[2]), np.nan)
        log[:, : self.log.shape[1]] = self.log
        slips = Slips(self.running.copy(), self.late.copy(), log)
        _follow_slips(*inputs, *slips)
        return slips

    @property
    def state(self) -> NDArray[np.void]:
        """Return the state of the detector, as records ``SLIPPING``, shape (members,)."""
        return self.running.view(SLIPPING)[:, 0]

    @property
    def total(self) -> Array:
        """Return the number of slip events of each member so far."""
        counts: Array = self.state["count"]
        return counts

    def column(self, name: str) -> Array:
        """Return a column of the first events by its name in ``SLIP``, shape (members, events)."""
        stored = int(min(self.total.max(initial=0.0), MOST_SLIPS))
        return self.log[:, :stored, (SLIP.names or ()).index(name)]

    def kinetic_friction(self) -> tuple[Array, Array]:
        """Return the work of the stage over its path [N], and its change from one part of the path to the next [N].

        The path is that from the first late slip event to the last, so that it has whole cycles. It is parted at the
        first event after three quarters of the run. Without late events it is the second half of the run, parted in the
        middle. Both results are nan if a part has no path, as with one or two late events.
        """
        slipped = self.late[:, 0].view(MOMENTS)[:, 0]["count"] > 0.0
        work, path = (
            [
                np.where(
                    slipped, self.state[f"{cycle}{name}"], self.state[f"{mark}{name}"]
                )
                for cycle, mark in (
                    ("first_", "half_"),
                    ("middle_", "quarter_"),
                    ("final_", ""),
                )
            ]
            for name in _SPENT
        )
        parts = np.diff(path, axis=0)
        known = (parts > 0.0).all(axis=0) & (path[0] > 0.0)
        first, last = np.divide(
            np.diff(work, axis=0), parts, out=np.full(parts.shape, np.nan), where=known
        )
        weight = np.divide(parts[1], parts.sum(axis=0), out=0.0 * first, where=known)
        return first + weight * (last - first), last - first


@device
def _falls(start, force, state):
    """Return True if the force has fallen far enough from a ``force`` at the place ``start``, and not in a swing."""
    advance, fall = (
        state.sense * state.position - start,
        force - state.sense * state.force,
    )
    least = LEAST_FALL * math.fabs(state.force_before)
    return fall >= least and state.farthest - start <= MOST_BACK * advance


@device
def _is_slip(state, event):
    """Return True if the episode that has ended at the last sample is a slip event, and fill it in."""
    if not _falls(state.start, state.from_force, state):
        return False
    amplitude = state.sense * state.position - state.start
    pull = state.sense * state.force
    event.time, event.end, event.amplitude = state.time, state.end, amplitude
    event.speed, event.force_before, event.force_after = (
        state.speed,
        state.force_before,
        pull,
    )
    event.stress_before, event.stress_after = state.stress_before, state.stress_after
    state.force_before, state.stress_before = -math.inf, -math.inf
    return True


@device
def _goes_on(sample, factor, state, event):
    """Take a sample in the sense in which the stage last moved; return True if a slip event has ended before it."""
    time, stage, _, force, position, stress, _ = sample
    pull, bears = state.sense * force, state.sense * stress
    gone, drawn = (
        state.sense * (position - state.position),
        state.sense * (stage - state.stage),
    )
    duration, ended = time - state.clock, False
    if drawn > 0.0 and gone > drawn:
        state.reference = max(state.reference, drawn / duration)
    if gone > (drawn if drawn > 0.0 else state.reference * duration):
        # a slider that lags behind a stage that slows down is never faster than the stage was
        if state.faster == 0.0:
            state.faster_start = math.nan
        if math.isnan(state.faster_start) and gone > state.reference * duration:
            state.faster_start = state.sense * state.position
            state.faster_force = state.sense * state.force
        if state.slips == 0.0:
            slips = gone > factor * state.reference * duration
            # the step before has the beginning of the slip, if the slider was faster in it
            if not (slips and state.faster > 0.0):
                state.time, state.speed = state.clock, state.stage_speed
                state.start = state.sense * state.position
                state.from_force = state.sense * state.force
                state.begin_work, state.begin_path = state.work, state.path
            if slips:
                state.slips, state.stress_after = 1.0, math.inf
        state.faster = 1.0
    else:
        ended = state.slips > 0.0 and _is_slip(state, event)
        if state.faster > 0.0:
            if state.slips == 0.0:
                state.slow += _falls(state.faster_start, state.faster_force, state)
            state.farthest = state.sense * state.position
        state.slips, state.faster = 0.0, 0.0
        if drawn > 0.0:
            state.reference = drawn / duration
    if state.slips > 0.0:
        state.end, state.stress_after = time, min(state.stress_after, bears)
    else:
        state.force_before = max(state.force_before, pull)
        state.stress_before = max(state.stress_before, bears)
    return ended


@device
def slip_ends(sample, factor, state, event):
    """Take one sample of a slider behind a spring; return True if a slip event has ended, and fill it in.

    A ``sample``: its time [s], and the six values that ``Slips.after`` takes.
    """
    time, stage, speed, force, position, stress, work = sample
    if math.isnan(position):
        return False
    ended, motion = False, 0.0
    if stage != state.stage:
        motion = math.copysign(1.0, stage - state.stage)
    if motion != state.motion:
        state.motion, state.before = motion, math.nan
    if motion != 0.0 and motion != state.sense:
        ended = state.slips > 0.0 and _is_slip(state, event)
        state.sense, state.slips, state.faster = motion, 0.0, 0.0
        state.reference = math.fabs(stage - state.stage) / (time - state.clock)
        state.farthest = motion * state.position
        state.force_before, state.stress_before = motion * force, motion * stress
    elif state.sense != 0.0:
        ended = _goes_on(sample, factor, state, event)
    state.path += math.fabs(stage - state.stage)
    state.clock, state.stage, state.stage_speed = time, stage, math.fabs(speed)
    state.position, state.force, state.work = position, force, work
    return ended


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


@device
def _gather_late(event, half, state, late):
    """Add a late slip event to the moments of those before, and keep the marks at its start."""
    begin = state.begin_work, state.begin_path
    state.final_work, state.final_path = begin
    if late[0, 0] == 0.0:
        state.first_work, state.first_path = begin
    if event.time >= 1.5 * half and state.middle_path == 0.0:
        state.middle_work, state.middle_path = begin
    _gather(event.force_before, late[0])
    _gather(event.force_before - event.force_after, late[1])
    _gather(event.amplitude, late[2])
    if state.before >= half:
        _gather(event.time - state.before, late[3])


@kernel(
    "boolean(Array(float64, 1, 'A', readonly=True), float64[:, :, ::1], float64, float64, "
    "float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1])"
)
def _follow_slips(times, samples, half, factor, running, late, log):
    """Take samples of all members; return True if a slip event has ended."""
    ends = False
    columns = np.zeros(log.shape[2])
    event = columns.view(SLIP)[0]
    for i in range(len(running)):
        state = running[i].view(SLIPPING)[0]
        for k in range(len(times)):
            sample = (
                times[k],
                samples[0, k, i],
                samples[1, k, i],
                samples[2, k, i],
                samples[3, k, i],
                samples[4, k, i],
                samples[5, k, i],
            )
            ended = slip_ends(sample, factor, state, event)
            # a stage at rest has no path
            if times[k] >= half and state.half_path == 0.0:
                state.half_work, state.half_path = state.work, state.path
            if times[k] >= 1.5 * half and state.quarter_path == 0.0:
                state.quarter_work, state.quarter_path = state.work, state.path
            if not ended:
                continue
            ends = True
            if state.count < min(log.shape[1], MOST_SLIPS):
                log[i, int(state.count)] = columns
            if event.time >= half:
                _gather_late(event, half, state, late[i])
            state.count += 1.0
            state.interval, state.latest = event.time - state.latest, event.time
            state.before = event.time
    return ends


class Jumps(NamedTuple):
    """True if the stress jumps, and if the contact area and the pull do."""

    stress: bool
    area: bool


NO_JUMPS = Jumps(False, False)


class PhaseEnd(NamedTuple):
    """Share of the last step of a block before the end of the phase, and True if area and pull jump there."""

    share: float = 1.0
    jumps: bool = False


class Followed(NamedTuple):
    """Path and area at the largest stress, if they are followed in a block of steps, and the ``end`` of its last step.

    Members that share a stress may differ in the area at its largest.
    """

    path: bool = False
    area: bool = True
    end: PhaseEnd = PhaseEnd()


class Events(NamedTuple):
    """Events so far; NaN counts as 0 in a maximum; ties keep the first.

    The first five are arrays of the shape (rows, phases, columns), the present phase last. The first three are rows of
    ``MAXIMUM``, in magnitude. ``stress`` is that of the shear stress [Pa] and ``friction`` that of the friction force
    [N]. ``pull`` is that of the tensile load of a closed contact [N], without rows if the load is constant. ``rise``
    are rows of ``RISE`` for those of ``friction``, and ``contact`` rows of ``CONTACT``. ``path`` is the longest path
    within a step [m], shape (1,) or (members,). ``slips`` are the slip events.
    """

    stress: Array
    friction: Array
    pull: Array
    contact: Array
    rise: Array
    path: Array
    slips: Slips

    def next_phase(self, since: float, after_rest: bool, jumps: Jumps) -> "Events":
        """Return the events at the start of another phase; a first maximum is looked for anew ``after_rest``.

        Turns of the contact ``since`` some time [s] belong to the phase that starts. They may have been found in the
        clock step before, within which the phase starts, or at whose end the mount jumps. A value that ``jumps`` as the
        phase starts has not begun as the phase before has left it.
        """
        contact, rise = self.contact[:, -1:].copy(), self.rise[:, -1:]
        ended = self.contact.copy()
        for turn, first in ((_PULL_OFF, _OPENING), (_JUMP_IN, _CLOSING)):
            is_late = contact[:, 0, turn] >= since
            for column in (first, *range(turn, turn + len(TURN.names or ()))):
                ended[is_late, -1, column] = np.nan
                contact[~is_late, 0, column] = np.nan
        if after_rest:
            # a rest that ends within a clock step is followed to the end of that step
            before, last = self.friction[:, -1, :2].T
            rise = _rising(np.where(before < last, np.maximum(before, 0.0), last))
        jump = jumps.stress, jumps.stress or jumps.area, jumps.area
        starts = (
            np.where(is_other, np.nan, rows[:, -1, 1])
            for is_other, rows in zip(jump, self[:3], strict=True)
        )
        ahead = *map(_started, starts), contact, rise
        so_far = *self[:3], ended, self.rise
        phases = (
            np.concatenate(pair, axis=1) for pair in zip(so_far, ahead, strict=True)
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

    def first_maximum(self, phase: int) -> NDArray[np.void]:
        """Return the first maximum of the friction up to the end of a phase, as a record ``RISE`` in each row.

        It is nan if the friction has not fallen from it.
        """
        rows = self.rise[:, phase].copy().view(RISE)[:, 0]
        for name in EXTREME.names or ():
            if name in (RISE.names or ()):
                rows[name][rows["fallen"] == 0.0] = np.nan
        return rows

    def first_turn(self, name: str) -> NDArray[np.void]:
        """Return the first turn of the run by its time in ``TURNS``, as a record ``CONTACT`` in each row."""
        turns = self.by_phase("contact")
        first = np.isfinite(turns[name]).argmax(axis=1)
        return turns[np.arange(len(turns)), first]


def first(
    bonding: Bonding,
    contact: ContactState,
    pull: Array,
    stage: Array,
    from_rest: bool = True,
) -> Events:
    """Return the events at t = 0, from the bonds, the contact and a pull [N].

    ``stage`` are positions of the stages that pull through a spring [m]. A first maximum of the friction is looked for
    in a scene that starts ``from_rest``.
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
    firsts = [
        np.where(np.isnan(values), 0.0, values) for values in (stress, friction, pull)
    ]
    maxima = map(_started, firsts)
    rise = _rising(firsts[1])
    rise.view(RISE)["fallen"] = not from_rest
    return Events._make([*maxima, rows, rise, np.zeros(1), Slips.none(stage)])


def _started(values: Array) -> Array:
    """Return running maxima before the first step of a phase, from the values at its start."""
    rows = np.empty((len(values), 1, len(_NO_MAXIMUM)))
    rows[:], rows[:, 0, 1] = _NO_MAXIMUM, values
    return rows


def _rising(friction: Array) -> Array:
    """Return rows of ``RISE`` before the first step after a rest, from the friction at its end [N]."""
    rows = np.zeros((len(friction), 1), RISE)
    rows["start"], rows["largest"] = friction[:, np.newaxis], -math.inf
    return rows[..., np.newaxis].view(float)


def after(
    so_far: Events,
    before: tuple[Bonding, Array],
    bonding: Bonding,
    contact: ContactState,
    pull: Array,
    motions: Motion,
    followed: Followed,
) -> Events:
    """Return the events after a block of steps in one phase, from bonds, contact and pull [N] at the end of each.

    ``before`` are bonds and contact radius at its start. If the phase ends within the last step, the stress there is
    the smaller one by the tangents at both ends of the step, and what jumps there keeps its value before the step.

    Notes
    -----
    The slope of the stress over time is ``stiffness`` × speed + ``relaxation``, and speed and area are taken as linear
    within a step. Where the slopes are known, a maximum between the ends is that of the cubic through values and
    slopes, of fourth order, if neither slope alone would change the value by more than five times its size within the
    step. It is at most what the tangents at both ends allow, because a kink between them would lift the cubic above
    both. Where the slopes contradict the values (bonds follow the mean speed of a step), and for the pull, a sample
    above its two neighbours is refined by the parabola through the three, of third order, if both neighbours have more
    than half of its value: a quantity that jumps is not smooth there.

    The stress of bonds without a stretch has kinks wherever the slider starts or stops, and jumps with its speed, and
    that of bonds that are followed one by one jumps as each breaks. Neither has a known slope. Its maximum is therefore
    that of the samples, and the strength at the end of a stick phase. The friction is refined by a parabola only where
    it follows the contact area rather than the stress.
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
        members,
    )
    now = [
        values + np.zeros((count, 1, 1))
        for values, count in zip(so_far[:5], counts, strict=True)
    ]
    ends = (
        motions.first,
        motions.speed,
        *motions.stick_ends,
        motions.time[:, 0],
        motions.duration[:, 0],
    )
    # bonds without a stretch have kinks, bonds that are followed one by one jump
    bent = np.isnan(bonding.relaxation).all()
    _follow(
        (stress, stiffness, relaxation),
        (radii, pull, contact.work, contact.detached, contact.turn),
        ends,
        (1.0 * followed.area, 1.0 * bent, *np.multiply(1.0, followed.end)),
        tuple(values[:, -1] for values in now),
    )
    path = (
        np.maximum(so_far.path, motions.path.max(axis=0))
        if followed.path
        else so_far.path
    )
    return Events._make([*now, path, so_far.slips])


def _with_start(before: Array, values: Array, steps: int) -> Array:
    """Values at the start of a block and at the end of each step, shape (steps + 1, rows)."""
    if values.ndim == 1:
        return during(values, steps + 1)
    result = np.empty((steps + 1, *values.shape[1:]))
    result[0], result[1:] = before, values
    return result


@device
def _of(values, k, i):
    """Return the value of a member at a time; all members may share a column."""
    return values[k, i if values.shape[1] > 1 else 0]


@device
def _load(k, i, stress, stiffness, relaxation, speed, radius):
    """Magnitude of the stress, its slope over time at a speed, and the area."""
    value, area = _of(stress, k, i), math.pi * _of(radius, k, i) ** 2
    slope = _of(stiffness, k, i) * speed + _of(relaxation, k, i)
    if not math.fabs(value) > 0.0:
        return math.fabs(value), math.fabs(slope), area
    return math.fabs(value), (slope if value > 0.0 else -slope), area


@kernel(
    f"void(Tuple(({3 * _READ})), Tuple(({4 * _READ}{_READ_ROWS})), Tuple(({4 * _READ}{2 * 'float64[:], '})),"
    f" UniTuple(float64, 4), UniTuple(float64[:, :], 5))"
)
def _follow(bonds, contacts, motion, traits, events):
    """Follow the events through a block of clock steps, in place.

    ``bonds``: stress, its stiffness and its relaxation; with the radii and ``motion`` as ``after`` has them.
    ``contacts``: radii, pulls, works of adhesion, times of detachment, turns. ``traits``: 1 if the area at the largest
    stress is followed, 1 if bonds have no stretch, and the ``PhaseEnd``. ``events``: the present rows of the first five
    of ``Events``.
    """
    radii, pulls, works, detached, turns = contacts
    first, speed, strengths, since, times, steps = motion
    stress, friction, pull, contact, rises = events
    (share, bent, part, jumps), none = traits, (0.0, math.nan, 0.0)
    for k in range(len(times)):
        time, step, is_last = times[k], steps[k], k == len(times) - 1
        left = (1.0 - part) * step if is_last else 0.0
        has_jump = is_last and jumps > 0.0
        for i in range(len(friction)):
            strength, place = _of(strengths, k, i), _of(since, k, i) / step
            speeds = _of(first, k, i), _of(speed, k, i)
            value0, slope0, area0 = _load(k, i, *bonds, speeds[0], radii)
            value1, slope1, area1 = _load(k + 1, i, *bonds, speeds[1], radii)
            last, area1 = (value1, value1 * area1), area0 if has_jump else area1
            if left > 0.0:
                value1 = _at_end(value0, slope0, value1, slope1, left, step)
                slope1, area1 = slope0, area1 - (area1 - area0) * left / step
                place = max(place - left / step, 0.0) * step / (step - left)
                speeds = speeds[0], speeds[0]
            around = time - left, step - left, speeds[0], speeds[1], area0, area1
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
            growth = (area1 - area0) / (step - left)
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
            if rises[i, 1] == 0.0:
                _rise(friction, rises, i)
            if left > 0.0 or has_jump:
                # with which the next phase starts; an open contact has no area
                friction[i, 1] = last[1] if last[1] >= 0.0 else 0.0
                stress[i if i < len(stress) else 0, 1] = (
                    last[0] if last[0] >= 0.0 else 0.0
                )
        for i in range(len(pull)):
            if math.isnan(_of(first, k, i)):  # the motion had ended before
                continue
            area0, area1 = (
                math.pi * _of(radii, k, i) ** 2,
                math.pi * _of(radii, k + 1, i) ** 2,
            )
            around = time, step, _of(first, k, i), _of(speed, k, i), area0, area1
            now = _of(pulls, k, i)
            held = pull[i, 1] if has_jump else now
            _keep(held, math.nan, math.nan, around, none, pull, i)
            pull[i, 1] = 0.0 if math.isnan(now) else now
        for i in range(len(contact)):
            radius, work, opening = (
                _of(radii, k + 1, i),
                _of(works, k, i),
                _of(detached, k, i),
            )
            closed, was_closed = radius > 0.0, contact[i, _LAST] > 0.0
            if math.isnan(_of(first, k, i)):  # the motion had ended before
                continue
            if closed:
                contact[i, _CLOSED] += step
            if (
                closed != was_closed
                or (closed and not work > 0.0)
                or radius == 0.0
                or opening > contact[i, _DETACHED]
            ):
                turn = turns[k, i if turns.shape[1] > 1 else 0]
                _turn(time, step, radius, work, opening, turn, contact[i])


@device
def _at_end(first, rise, last, slope, left, step):
    """Return a stress at a kink or a jump within a step, a time ``left`` before its end; slopes are at its ends."""
    ahead, back = first + rise * (step - left), last - slope * left
    return max(min(ahead, back), 0.0) if ahead + back < math.inf else first


@device
def _turn(time, step, radius, work, detached, turn, row):
    """Take the radius [m], work of adhesion [J/m²], last detachment [s] and ``TURN`` of a contact after a step.

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
            row[_PULL_OFF], row[_PULL_OFF_LOAD], row[_PULL_OFF_DISPLACEMENT] = (
                turn[0],
                turn[1],
                turn[2],
            )
    is_attracted = radius == 0.0 and not opens
    if is_attracted and math.isnan(row[_JUMP_IN]):  # without touching
        row[_JUMP_IN], row[_JUMP_IN_LOAD], row[_JUMP_IN_DISPLACEMENT] = (
            turn[0],
            turn[1],
            turn[2],
        )
    if not radius > 0.0:
        return
    if work <= 0.0:
        row[_HIDDEN] += step
        if math.isnan(row[_MASKED]):
            row[_MASKED] = time
    if was_open and math.isnan(row[_CLOSING]):
        row[_CLOSING] = time
    if was_open and math.isnan(row[_JUMP_IN]):
        row[_JUMP_IN], row[_JUMP_IN_LOAD], row[_JUMP_IN_DISPLACEMENT] = (
            turn[0],
            turn[1],
            turn[2],
        )


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
    is_known = not math.isnan(last)
    if is_known and rise > 0.0 > slope and step * steepest < _RESOLVED * larger:
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
    maxima[i, 2] = -1.0 if bent > 0.0 else 1.0 * (rise < 0.0 and slope < 0.0)
    if place >= 0.0:
        maxima[i, 3], maxima[i, 4] = largest, time - place * step
        maxima[i, 5], maxima[i, 6] = (
            speed1 - place * (speed1 - speed0),
            area1 - place * (area1 - area0),
        )
    if place == 1.0:  # the contact may open, or the motion end, in the step
        maxima[i, 5], maxima[i, 6] = speed0, area0


@device
def _rise(friction, rises, i):
    """Follow the friction of a row to its first maximum above the friction at the start, and to the fall from it.

    Columns are those of ``RISE`` and ``MAXIMUM``, by their numbers.
    """
    start, largest = rises[i, 0], rises[i, 2]
    if friction[i, 3] > largest:
        largest = friction[i, 3]
        rises[i, 2], rises[i, 3], rises[i, 4] = largest, friction[i, 4], friction[i, 6]
    if largest > (1.0 + _SAME) * start and friction[i, 1] < (1.0 - FALLEN) * largest:
        rises[i, 1] = 1.0


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
