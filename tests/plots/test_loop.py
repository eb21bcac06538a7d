"""The figure of a loop shows load and radius over displacement, JKR's equilibria, and the energy lost."""

import numpy as np
import pytest
from helpers.parts import Clock, Ensemble, Equilibrium, Record, bonds, jkr, read, shear
from helpers.pictured import STEADY, drawn, field, legend_of, rendered, simulated
from numpy.testing import assert_allclose

from sim.plots import kinds as plots, style as pictures

JKR = (42e-3, 2e-3, 6.4e6)
BACK = {"from": 2e-6, "to": -4e-6, "cycles": 2}
# displacement of one record [m]: cycles of 12 um in 1 s, 2 ms
RECORD = 2.0 * 2.0 * 6e-6 * 2e-3
COARSE = Clock(duration=1.0, step=2e-2)
GRIPS = Equilibrium(indentation=BACK, after_pull_off="reattach")
MACHINE = Equilibrium(displacement=BACK, stiffness=340.0, after_pull_off="reattach")


def moved(contact=GRIPS, **changes):
    parts = {
        "contact": contact,
        "drive": STEADY,
        "bonds": bonds.Unbroken(),
        "shear": shear.Uniform(),
        "ensemble": Ensemble(members=1),
        "clock": Clock(duration=1.0, step=2e-3),
    }
    return simulated(**(parts | changes))


@pytest.fixture(scope="module")
def grips():
    return moved()


@pytest.fixture(scope="module")
def machine():
    return moved(MACHINE)


def marks(panel, marker):
    return [
        line.get_data()
        for line in panel.lines
        if line.get_marker() == marker and len(line.get_xdata())
    ]


def course_of(panel):
    """Data of the curve."""
    return drawn(panel, pictures.BOTH)


def test_grey_are_all_equilibria_of_jkr_stable_or_not(request):
    for which, stiffness in [("grips", np.inf), ("machine", 340.0)]:
        dataset = request.getfixturevalue(which)
        loads, radii, _ = plots.draw(dataset, "loop").axes
        x, radius = drawn(radii, pictures.REFERENCE, "--")
        again, load = drawn(loads, pictures.REFERENCE, "--")
        a = 1e-6 * radius
        exact = jkr.load_at_radius(a, *JKR)
        assert_allclose(load, 1e6 * exact, rtol=1e-12, atol=1e-12)
        # load and indentation cancel near their zeros: compared with what the contact has at most
        assert_allclose(
            x,
            1e6 * (jkr.indentation_at_radius(a, *JKR) + exact / stiffness),
            rtol=1e-12,
            atol=1e-14,
        )
        np.testing.assert_array_equal(x, again)
        # down to no contact at all, up to the largest that was simulated
        assert a[0] == 0.0
        assert_allclose(a[-1], dataset["contact_radius"].max(), rtol=1e-14)
        # every equilibrium that was simulated lies on it: the stable branch is that beyond the fold
        stable = a >= a[np.argmin(x)]
        simulated = dataset["contact_radius"].to_numpy()
        closed = simulated > 0.0
        between = np.interp(
            1e6 * dataset["displacement"].to_numpy()[closed], x[stable], radius[stable]
        )
        # a chord under the square root of a fold, over 600 points of which those next to it are 2/600 of a radius apart
        assert_allclose(1e6 * simulated[closed], between, rtol=4e-3)


def test_behind_a_machine_an_open_contact_has_no_load_and_a_cross_at_each_pull_off(
    machine,
):
    loads, radii, _ = plots.draw(machine, "loop").axes
    assert radii.get_xlabel() == r"displacement $\Delta$ (µm)"
    displacement, load = course_of(loads)
    closed = machine["in_contact"].to_numpy() == 1
    assert_allclose(displacement, 1e6 * machine["displacement"], rtol=1e-14)
    exact = np.where(closed, 1e6 * machine["normal_load"], 0.0)
    assert_allclose(load, exact, rtol=1e-14)
    exact = np.where(closed, 1e6 * machine["contact_radius"], 0.0)
    assert_allclose(course_of(radii)[1], exact, rtol=1e-14)
    ((place, pull),) = marks(loads, "x")
    each = read.pull_offs(machine).dropna("phase")
    assert_allclose(place, 1e6 * each["pull_off_displacement"], rtol=1e-14)
    assert_allclose(pull, 1e6 * each["pull_off_load"], rtol=1e-14)
    # the sphere comes off at the fold, within a record
    fold = 1e6 * float(jkr.pull_off_displacement(340.0, *JKR))
    known = place[np.isfinite(place)]
    assert len(known) == 2 and np.all(np.abs(known - fold) <= 1e6 * RECORD)
    ((place, pull),) = marks(loads, "o")
    assert_allclose(place, 1e6 * machine["jump_in_displacement"], rtol=1e-14)
    assert_allclose(pull, 1e6 * machine["jump_in_load"], rtol=1e-14)
    # where the radius at an event is not recorded there is no mark of it
    assert not marks(radii, "x") and not marks(radii, "o")


def test_the_marks_of_a_loop_under_a_load_are_inside_the_figure():
    course = {"from": 1e-3, "to": -1e-3, "cycles": 1}
    dataset = moved(Equilibrium(load=course, after_pull_off="reattach"), clock=COARSE)
    loads = rendered(plots.draw(dataset, "loop")).axes[0]
    left, right = loads.get_xlim()
    ((place, pull),) = marks(loads, "x")
    assert loads.get_ylabel() == "normal load $P$ (mN)"
    assert_allclose(pull, -1.5e3 * np.pi * 42e-3 * 2e-3, rtol=1e-9)
    assert left < place.item() < right
    ((place, _),) = marks(loads, "o")
    assert left < place.item() < right


def test_members_that_differ_have_their_own_pull_offs_or_the_means_of_these():
    parts = {"shear": field(), "ensemble": Ensemble(members=3)}
    dataset = moved(MACHINE, **parts)
    ((place, load),) = marks(plots.draw(dataset, "loop").axes[0], "x")
    known = np.isfinite(load)
    assert known.sum() == 6 and np.all(np.diff(np.sort(place[known])) > 0.0)
    sparse = moved(MACHINE, **parts, record=Record(per_member=False))
    ((_, means),) = marks(plots.draw(sparse, "loop").axes[0], "x")
    assert_allclose(np.nanmean(means), np.mean(load[known]), rtol=1e-9)


def test_a_contact_that_stays_closed_has_neither_cross_nor_ring():
    pressed = moved(Equilibrium(load={"from": 1e-3, "to": 2e-3}), clock=COARSE)
    for panel in plots.draw(pressed, "loop").axes:
        assert not [data for data in marks(panel, "x") if np.isfinite(data[0]).any()]
        assert not marks(panel, "o")
        assert not {"pull-off", "jump-in"} & set(legend_of(panel)[0])


def test_each_value_of_a_sweep_has_its_curves():
    dataset = moved(MACHINE, clock=COARSE, sweep={"contact.stiffness": [100.0, 1e3]})
    loads, radii, _ = plots.draw(dataset).axes
    assert [
        line.get_color() for line in radii.lines if line.get_linestyle() == "--"
    ] == [pictures.REFERENCE] * 2
    words = legend_of(loads)[0]
    assert words[:2] == ["$k$ = 100 N/m", "$k$ = 1 kN/m"]


def test_a_loop_is_what_fits_a_sphere_that_moves_with_load_and_radius_over_the_indentation(
    grips,
):
    loads, radii, over_load = rendered(plots.draw(grips, "loop")).axes
    closed = grips["in_contact"].to_numpy() == 1
    assert radii.get_xlabel() == r"indentation $\delta$ (µm)" and not closed.all()
    radius = np.where(closed, 1e6 * grips["contact_radius"], 0.0)
    for panel, x, y in (
        (loads, "indentation", np.where(closed, 1e6 * grips["normal_load"], 0.0)),
        (radii, "indentation", radius),
        (over_load, "normal_load", radius),
    ):
        place, value = course_of(panel)
        assert_allclose(value, y, rtol=1e-14)
        assert_allclose(place[closed], 1e6 * grips[x][closed], rtol=1e-14)
    load, radius = drawn(over_load, pictures.REFERENCE, "--")
    assert_allclose(
        load, 1e6 * jkr.load_at_radius(1e-6 * radius, *JKR), rtol=1e-12, atol=1e-12
    )
    pull = np.pi * 42e-3 * 2e-3
    # under fixed grips the loop reaches below the one, and an equilibrium never beyond the other
    assert (
        -1.5 * pull * (1.0 + 1e-12)
        <= float(grips["normal_load"].min())
        < -5.0 / 6.0 * pull
    )
    assert plots.default(grips) == "loop"
    stays = moved(Equilibrium(load=4e-3))
    assert "loop" not in plots.drawable(stays) and "loop" in plots.drawable(grips)
    with pytest.raises(
        ValueError, match=r"\[contact\] indentation = .*drawn as: theories, time"
    ):
        plots.draw(stays, "loop")
    radii, loads, base = plots.draw(grips, "time").axes
    _, hertz = drawn(radii, pictures.REFERENCE, ":")
    pressed = grips["indentation"].to_numpy() > 0.0
    assert_allclose(
        hertz[pressed],
        1e6 * np.sqrt(2e-3 * grips["indentation"].to_numpy()[pressed]),
        rtol=1e-9,
    )
    assert [loads.get_ylabel(), base.get_ylabel()] == [
        "load $P$ (µN)",
        r"base $\Delta$ (µm)",
    ]
    assert {"pull-off", "first jump-in"} <= set(legend_of(radii)[0])


def test_of_several_cycles_the_ring_is_named_as_the_first_jump_in(grips):
    assert "first jump-in" in legend_of(plots.draw(grips, "loop").axes[0])[0]
    once = Equilibrium(indentation=BACK | {"cycles": 1}, after_pull_off="reattach")
    assert "jump-in" in legend_of(plots.draw(moved(once), "loop").axes[0])[0]
