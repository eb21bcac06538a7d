"""Statements on motions that end before the run: no event and no share after the end, and the number of members."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from helpers.driven import LOAD, force, scenario
from helpers.parts import Record, bonds, run, shear
from numpy.testing import assert_array_equal

from sim.spectrum.families import Ripple

#: Members of a run and its length [s]: under the force every bond of each member breaks within a second or two.
MEMBERS, LASTS, ABOVE = 6, 8.0, 0.5
#: A load that draws the sphere off after all motions have ended, and one that does so at once.
LATE = {"time": [0.0, 0.5 * LASTS, LASTS], "value": [LOAD, LOAD, -LOAD]}
EARLY = {"time": [0.0, 0.04, LASTS], "value": [LOAD, -2.0 * LOAD, -2.0 * LOAD]}
#: Fluctuations that leave no work of adhesion at any time.
STRONG = shear.Mean(spectrum=Ripple(amplitude=1e7, wavelength=24e-6))


def creeping(factor, per_member=True, **keys):
    """Few bonds, followed one by one, that carry the work of adhesion under a constant force."""
    make = functools.partial(bonds.Tracked, sites=10)
    options = {"share": 1.0, "members": MEMBERS, "make": make}
    scene = scenario(LASTS, 400, force(factor), **(options | keys))
    return replace(scene, record=Record(per_member=per_member))


@pytest.fixture(scope="module")
def ended():
    """A run in which every member loses stability, before its mount moves."""
    dataset = run(creeping(ABOVE, load=LATE))
    assert float(dataset["runaway_time"].isel(t=-1).max()) < 0.5 * LASTS
    return dataset


def test_no_event_of_the_contact_is_set_after_the_end_of_a_motion_and_each_is_that_comes_before(
    ended,
):
    # the breaking bonds leave no work of adhesion, and the mount then draws the sphere away
    for name in ("first_masked", "first_detachment", "pull_off_time", "lowest_load"):
        assert ended[name].isnull().all(), name
    assert_array_equal(ended["time_masked"], 0.0)
    assert_array_equal(ended["detachments"], 0.0)
    assert_array_equal(ended["in_contact"], 1)
    gone = ended["t"] >= ended["runaway_time"].isel(t=-1)
    assert_array_equal(ended["masked"].isnull(), gone.transpose(*ended["masked"].dims))
    opened = run(creeping(ABOVE, load=EARLY))
    assert_array_equal(opened["detachments"], 1.0)
    assert (opened["lowest_load"] < 0.0).all()
    masked = run(replace(creeping(ABOVE), shear=STRONG))
    assert_array_equal(masked["first_masked"], 0.0)
    assert_array_equal(masked["time_masked"], 1.0)
    assert np.isfinite(masked["runaway_time"].isel(t=-1)).all()
