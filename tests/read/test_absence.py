"""A named event is stated if and only if it happened, in random scenes over all parts.

The detectors read records of each clock step and share no code with the package. Where a record is within its error of
the limit of a definition, either verdict is right, and the detector returns None.
"""

import math
import warnings
from collections import Counter

import numpy as np
import pytest
from helpers.corner_scenes import corner_scene
from helpers.random_scenes import random_scene

import sim

#: Seeds of scenes of each kind: a few, some of which have been wrong, and those of ``make verify``.
SHORT = {random_scene: (0, 1, 2, 1083, 1172), corner_scene: (1040, 1055)}
LONG = {random_scene: range(1000, 1240), corner_scene: range(1000, 1060)}
#: Definitions of a slip event and of a static threshold, and how near to them either verdict is right.
FASTER, FALL, NEAR = 10.0, 0.01, 0.25
#: Relative size of rounding.
ROUNDING = 1e-9


class Records:
    """The records of a run, arrays of the shape (members, records)."""

    def __init__(self, dataset):
        self.dataset, self.count = dataset, dataset.sizes.get("member", 1)
        self.time = dataset["t"].to_numpy()

    def __contains__(self, name):
        return name in self.dataset.variables

    def of(self, name):
        values = self.dataset[name].astype(float)
        if "member" not in values.dims:
            values = values.expand_dims(member=self.count)
        return values.transpose("member", "t").to_numpy()


def has_opened(records):
    """A contact that was closed is open at a later record."""
    closed = records.of("in_contact") > 0.0
    return [bool(np.any(row[:-1] & ~row[1:])) for row in closed]


def has_jumped_in(records):
    """An open contact is closed at a later record with work of adhesion, so that its radius is above zero."""
    closed, work = records.of("in_contact") > 0.0, records.of("work_of_adhesion")
    full = float(records.dataset["adhesion_work"])
    verdicts = []
    for is_closed, values in zip(closed, work, strict=True):
        closing = np.flatnonzero(~is_closed[:-1] & is_closed[1:]) + 1
        if np.any(values[closing] > NEAR * full):
            verdicts.append(True)
        # with little or no adhesion left it may have had some within the step
        elif closing.size:
            verdicts.append(None)
        else:
            verdicts.append(False)
    return verdicts


def has_been_masked(records):
    """A closed contact has no work of adhesion left.

    A work within rounding of zero may be either, and that of a slider that has lost stability is unknown.
    """
    closed, work = records.of("in_contact") > 0.0, records.of("work_of_adhesion")
    full = float(records.dataset["adhesion_work"])
    verdicts = []
    for is_closed, values in zip(closed, work, strict=True):
        if np.any(values[is_closed] < -ROUNDING * full):
            verdicts.append(True)
        elif not np.all(values[is_closed] > ROUNDING * full):
            verdicts.append(None)
        else:
            verdicts.append(False)
    return verdicts


def has_fallen(records):
    """Friction falls by 1 % from its largest value so far, before it exceeds it and before the stage slows down."""
    force = np.abs(records.of("friction_force"))
    end = force.shape[1]
    if "stage_position" in records:
        speeds = np.diff(records.of("stage_position")[0]) / np.diff(records.time)
        fastest = np.maximum.accumulate(np.abs(speeds))
        slower = speeds * np.sign(speeds.sum()) < (1.0 - ROUNDING) * fastest
        end = int(np.argmax(slower)) + 1 if slower.any() else end
    verdicts = []
    for row in force[:, :end]:
        row = row[np.isfinite(row)]
        largest = np.maximum.accumulate(row)
        bears = largest > 0.0
        fall = np.max(1.0 - row[bears] / largest[bears], initial=0.0)
        if abs(fall - FALL) < NEAR * FALL:
            verdicts.append(None)
        else:
            verdicts.append(bool(fall > FALL))
    return verdicts


def has_slipped(records):
    """The slider moves along the stage ten times as fast as the stage over a clock step."""
    step = np.diff(records.time)
    slider = np.diff(records.of("slider_position")) / step
    stage = np.diff(records.of("stage_position")) / step
    verdicts = []
    for moved, pulled in zip(slider, stage, strict=True):
        # while the stage rests its last speed counts
        last, speeds = 0.0, []
        for speed in pulled:
            last = speed if speed != 0.0 else last
            speeds.append(last)
        speeds = np.array(speeds)
        # a slider whose contact comes off slips, too
        known = (speeds != 0.0) & np.isfinite(moved)
        ratio = np.max(moved[known] / speeds[known], initial=0.0)
        if ratio > (1.0 - NEAR) * FASTER:
            # an interface that sticks, a turning stage or the end of the run may leave it out
            verdicts.append(None)
        else:
            verdicts.append(False)
    return verdicts


def has_lost_stability(records):
    """The motion of the slider is unknown from some record on, although it was resolved."""
    gone = np.isnan(records.of("slider_position"))
    unresolved = np.broadcast_to(records.dataset["unresolved_time"], records.count)
    return [
        bool(np.any(row)) if np.isnan(at) else None
        for row, at in zip(gone, unresolved, strict=True)
    ]


#: Events by the quantity that is stated if they happened: what it needs to be recorded, and its detector.
EVENTS = {
    "first_detachment": ("in_contact", has_opened),
    "pull_off_load": ("in_contact", has_opened),
    "jump_in_load": ("in_contact", has_jumped_in),
    "first_masked": ("in_contact", has_been_masked),
    "static_threshold": ("static_threshold", has_fallen),
    "slip_time": ("slip_time", has_slipped),
    "runaway_force": ("runaway_force", has_lost_stability),
}


def dense(seed, draw):
    """Return the dataset of a scene with a record for each clock step; None if it is refused."""
    scene = draw(seed)
    scene["clock"].pop("record", None)
    try:
        return sim.run(scene)
    except sim.BadInput:
        return None


def disagreements(dataset):
    """Yield each event of which statement and detector disagree, and count the verdicts by event."""
    records = Records(dataset)
    for name, (needed, detector) in EVENTS.items():
        if name not in records or needed not in records:
            continue
        stated = dataset[name]
        if "slip" in stated.dims:
            stated = (
                stated.isel(slip=0)
                if stated.sizes["slip"]
                else stated.sum("slip") * math.nan
            )
        stated = np.broadcast_to(stated.notnull().to_numpy(), records.count)
        for member, (is_stated, happened) in enumerate(
            zip(stated, detector(records), strict=True)
        ):
            yield name, member, bool(is_stated), happened


def check(seeds, draw):
    counts, wrong = Counter(), []
    for seed in seeds:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            dataset = dense(seed, draw)
        if dataset is None:
            continue
        for name, member, stated, happened in disagreements(dataset):
            counts[name, happened] += 1
            if happened is not None and stated != happened:
                wrong.append((seed, name, member, stated))
    assert not wrong, wrong
    return counts


@pytest.mark.parametrize("draw", SHORT)
def test_an_event_is_stated_if_and_only_if_it_happened(draw):
    check(SHORT[draw], draw)


@pytest.mark.verify
def test_an_event_is_stated_if_and_only_if_it_happened_in_300_scenes():
    counts = sum((check(seeds, draw) for draw, seeds in LONG.items()), Counter())
    for name in EVENTS:
        happened = [counts[name, verdict] for verdict in (True, False)]
        # a detector of slip events only knows when there is none
        assert all(count >= 5 for count in happened[name == "slip_time" :]), counts
