"""Pace of this machine: measured time of some steps of a run over their counted time.

The counted time is the same on any machine, and it is right to a factor of two if a clock step is one piece of work. A
driven slider and bonds with a stretch are advanced in sub-steps or from event to event, and their number is known only
afterwards. Therefore pieces at several times of such a run are timed.
"""

from typing import Any, cast

import numpy as np

from sim.ensemble.plan import Block, Plan, map_bytes, seconds_a_step, snapshots
from sim.ensemble.swept import spread
from sim.numerics.stopwatch import stopwatch
from sim.parts.drive import ENERGY, Driven
from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.step.state import MemberNoise, State, pack, unpack
from sim.step.stepper import Stepper
from sim.units.errors import BadInput

# Rough costs of one core [s]: a record of a batch, of a member, a byte of a map that is drawn.
_RECORD, _RECORD_OF_MEMBER, _MAP_BYTE = 5e-6, 2e-7, 2e-9
#: Time for which steps are tried [s]; a run of a shorter estimate [s] is tried only if it is made in sub-steps.
_TRIED, _WORTH_TRYING = 0.6, 1.0
#: Times over the duration at which pieces of a run are tried.
_PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Factor from the length of the pieces to the next, the largest number of steps into which a clock step is divided, and
#: the most steps of a run so divided.
_LONGER, _DIVISIONS, _MOST_STEPS = 4, 4**6, 10**9


def counted(plan: Plan) -> float:
    """Return the counted time of all steps and records on one core [s]."""
    some, groups = spread(plan.points), plan.groups
    first, last = (
        sum(
            counted_block(
                point, group, Block(-1, point.clock.steps, point.clock.stride)
            )
            for point in some
        )
        for group in (np.array(groups[0]), np.array(groups[-1]))
    )
    return len(plan.points) * ((len(groups) - 1) * first + last) / len(some)


def counted_block(point: Scenario, members: np.ndarray, block: Block) -> float:
    """Return the counted time of the steps of a block and of the records and maps in it [s]."""
    steps = block.end - block.start
    maps = map_bytes(point, int(np.sum(members < point.record.map_members)))
    maps *= sum(block.start < step <= block.end for step in snapshots(point)) / max(
        1, len(point.record.maps)
    )
    records = steps / block.stride * (_RECORD + len(members) * _RECORD_OF_MEMBER)
    return steps * seconds_a_step(point, len(members)) + records + _MAP_BYTE * maps


def pace(plan: Plan) -> float:
    """Return measured time of some steps over their counted time on this machine; 1 for a short run of known steps.

    Kernels that are not in the cache are compiled.
    """
    trials, ends = [], spread(plan.points, 3)
    if not any(map(in_substeps, ends)) and counted(plan) < _WORTH_TRYING:
        return 1.0
    for point in ends:
        trials.append(_tried(plan, point, _TRIED / len(ends)))
        point.release()
    measured, expected = np.sum(trials, axis=0)
    return float(measured / expected)


def in_substeps(point: Scenario) -> bool:
    """Return True if the time of a clock step depends on the solution: on sub-steps, or on events of bonds."""
    return point.drive.solves_motion or point.population.stretched


def _tried(plan: Plan, point: Scenario, most: float) -> tuple[float, float]:
    """Return the time of the steps of one group [s] by pieces that take about ``most`` [s], and their counted time.

    If sub-steps are made, a piece at each place is a small fraction of a clock step, because a whole one may take
    minutes. All are made four times as long as often as the time allows. Behind a spring they begin in steady sliding,
    but for the first, because a slider at rest needs no sub-steps before its spring is loaded.
    """
    members = np.arange(
        min(plan.group, max(1, int(most / 10.0 / seconds_a_step(point, 1))))
    )
    noise, clock, division, count = (
        MemberNoise.of(point.seed, members),
        point.clock,
        1,
        1,
    )
    while (
        in_substeps(point)
        and division < _DIVISIONS
        and clock.steps * division * _LONGER <= _MOST_STEPS
    ):
        division *= _LONGER
    stepper = _divided(point, division)
    first = stepper.follow(noise, None, range(1, 2))[0]  # loads kernels
    sliding = _sliding(point, noise)
    # its first step is made as such, because at any other the bonds of a contact that was open begin without a stretch
    others = pack(
        first if sliding is None else stepper.follow(noise, sliding, range(1, 2))[0]
    )
    states = [
        first,
        *(
            unpack(point.parts, {name: array.copy() for name, array in others.items()})
            for _ in _PLACES[1:]
        ),
    ]
    now, duration = stopwatch(), clock.steps * clock.step
    end, rates, powers = (
        now() + most,
        np.ones(len(_PLACES)),
        [np.zeros(len(members))] * len(_PLACES),
    )
    while True:
        began, longer = now(), list[float]()
        for number, place in enumerate(_PLACES):
            last = min(
                int(place * clock.steps * division) + count, stepper.scene.times.steps
            )
            steps, before = range(last - count + 1, last + 1), now()
            start = _balanced(point, states[number], powers[number] * place * duration)
            start = start._replace(step=last - count)
            states[number] = stepper.advance(start, noise, steps)[0]
            longer.append(max(now() - before, 1e-9) * division / count)
            passed = count / division * clock.step
            powers[number] = _work_between(point, start, states[number]) / passed
            if now() > end:
                break
        number, after = len(longer), now()
        # places without such long pieces change like those with them
        rates = np.append(
            longer, rates[number:] * np.mean(longer) / np.mean(rates[:number])
        )
        if (
            count * _LONGER > clock.steps * division
            or after + _LONGER * (after - began) > end
        ):
            break
        division, count = (
            (division // _LONGER, 1) if division > 1 else (1, _LONGER * count)
        )
        stepper = _divided(point, division)
    weights = np.where(np.isin(_PLACES, (0.0, 1.0)), 0.5, 1.0)  # trapezoidal rule
    measured = clock.steps * float(np.average(rates, weights=weights))
    block = Block(-1, clock.steps, clock.stride)
    expected, whole = (
        counted_block(point, group, block)
        for group in (members, np.array(plan.groups[0]))
    )
    if in_substeps(point) and measured > expected:  # sub-steps are made for each member
        return whole + (measured - expected) * len(plan.groups[0]) / len(members), whole
    return measured * whole / expected, whole


def _balanced(point: Scenario, state: State, work: Array) -> State:
    """Return a state in which the drive of each member has done some ``work`` [J] before, and no energy is missing.

    Sub-steps are shortened by the energy that is missing beside the work since the start. A piece late in a run whose
    work were that of a few pieces would make more of them than the run does there.
    """
    if not point.drive.solves_motion:
        return state
    drive = cast(Driven, state.drive)
    energies = np.zeros((len(work), 1), ENERGY)
    before = drive.energies.view(ENERGY)
    energies["work"], energies["damping"] = work[:, np.newaxis], work[:, np.newaxis]
    energies["stored"] = energies["first"] = before["stored"]
    return state._replace(drive=drive._replace(energies=energies.view(float)))


def _work_between(point: Scenario, start: State, end: State) -> Array:
    """Return the work that the drive of each member has done between two states [J], 0 if it does not feel friction."""
    if not point.drive.solves_motion:
        return np.zeros(1)
    first, last = (
        cast(Driven, state.drive).energies.view(ENERGY)["work"][:, 0]
        for state in (start, end)
    )
    return last - first


def _divided(point: Scenario, divisions: int) -> Stepper:
    """Return the stepper of a point with its clock steps divided, and the same shear process."""
    if divisions == 1:
        return point.stepper
    clock = {"duration": point.clock.duration, "step": point.clock.step / divisions}
    finer = point.with_values(
        {"clock": clock | {"record": point.clock.step * point.clock.stride}},
        built=False,
    )
    return finer.stepper_with(point.process)


def _sliding(point: Scenario, noise: MemberNoise) -> State | None:
    """Return the state of steady sliding behind a spring, with steady bonds; None if there is no such state."""
    changes: dict[str, Any] = {
        "drive.start": "steady",
        "drive.start_after": 0.0,
        "bonds.start": "steady",
    }
    try:
        return point.with_values(changes, built=False).stepper.start(noise)
    except BadInput:
        return None
