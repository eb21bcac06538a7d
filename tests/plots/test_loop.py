"""The figure of a loop shows load and radius over displacement, JKR's equilibria, and the energy lost."""

import numpy as np
import pytest
from helpers.parts import Clock, Ensemble, Equilibrium, Record, bonds, jkr, shear
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


def cycles_of(panel):
    """Data of the curve, by its cycles: the first is thick, the later ones are thin."""
    lines = [
        line
        for line in panel.lines
        if line.get_color() == pictures.BOTH and line.get_linestyle() == "-"
    ]
    return [
        line.get_data()
        for width in (1.2, 0.6)
        for line in lines
        if line.get_linewidth() == width
    ]


def thick(panel):
    """Data of the whole curve: the cycles begin where the one before them ends."""
    first, later = cycles_of(panel)
    return np.hstack([first, np.array(later)[:, 1:]])


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


def test_behind_a_machine_cycles_have_crosses_rings_verticals_and_the_energy_of_a_trip(
    machine,
):
    loads, radii, _ = plots.draw(machine, "loop").axes
    first, later = (x for x, _ in cycles_of(radii))
    assert (
        len(first) == len(later) == machine.sizes["t"] // 2 + 1
        and first[-1] == later[0]
    )
    assert radii.get_xlabel() == r"displacement $\Delta$ (µm)"
    assert_allclose(thick(loads)[0], 1e6 * machine["displacement"], rtol=1e-14)
    closed = machine["in_contact"].to_numpy().astype(int)
    off, on = (
        np.flatnonzero(np.diff(closed) == -1),
        np.flatnonzero(np.diff(closed) == 1) + 1,
    )
    assert len(off) == len(on) == 2
    x, load = (
        1e6 * machine["displacement"].to_numpy(),
        1e6 * machine["normal_load"].to_numpy(),
    )
    for marker, at in (("x", off), ("o", on)):
        ((place, value),) = marks(loads, marker)
        assert_allclose(place, x[at], rtol=1e-14)
        assert_allclose(value, load[at], rtol=1e-14)
    # the sphere comes off before the fold and touches at a displacement of zero, at most one record beyond
    step = 1e6 * RECORD
    fold = 1e6 * float(jkr.pull_off_displacement(340.0, *JKR))
    assert np.all(
        (marks(loads, "x")[0][0] >= fold) & (marks(loads, "x")[0][0] <= fold + step)
    )
    assert np.all((marks(loads, "o")[0][0] >= 0.0) & (marks(loads, "o")[0][0] <= step))
    (verticals,) = loads.collections
    ends = sorted((path[0, 0], path[1, 1]) for path in verticals.get_segments())
    assert_allclose(
        ends, sorted(zip(x[[*off, *on]], load[[*off, *on]], strict=True)), rtol=1e-14
    )
    assert len(radii.collections[0].get_segments()) == 4
    dead = moved(
        Equilibrium(load={"from": 1e-3, "to": -1e-3, "cycles": 1}), clock=COARSE
    )
    # a dead load has no jump to draw, but a cross
    loads = plots.draw(dead, "loop").axes[0]
    assert (
        not loads.collections and len(marks(loads, "x")) == 1 and not marks(loads, "o")
    )
    # P dDelta by hand; the two cycles leave the contact as it was
    P, displacement = (
        machine["normal_load"].to_numpy(),
        machine["displacement"].to_numpy(),
    )
    spent, loop = (
        0.5 * float(machine["dissipated_energy"][-1]),
        0.5 * np.trapezoid(P, displacement),
    )
    # a jump drawn as a straight line between two records costs half its load times their distance, twice a cycle
    assert_allclose(
        loop, spent, rtol=0, atol=2 * 0.5 * 1.5 * np.pi * 42e-3 * 2e-3 * RECORD
    )
    entry, *_ = legend_of(plots.draw(machine, "loop").axes[0])[0]
    assert all(f"{1e12 * energy:.3g} pJ" in entry for energy in (spent, loop))
    for contact in (
        Equilibrium(indentation={"from": 2e-6, "to": -2e-6}),
        Equilibrium(
            indentation={"time": [0.0, 0.5, 1.0], "value": [2e-6, -2e-6, 1e-6]}
        ),
    ):
        dataset = moved(contact, clock=COARSE)
        (entry, *_), title = legend_of(plots.draw(dataset, "loop").axes[0])
        assert title == "dissipated in all: $W$"
        assert f"{1e12 * float(dataset['dissipated_energy'].max()):.3g} pJ" in entry


def test_members_that_differ_have_their_own_pull_offs_and_a_deviation_alone_makes_no_band():
    parts = {"shear": field(), "ensemble": Ensemble(members=3)}
    dataset = moved(MACHINE, **parts)
    loads, radii, over_load = plots.draw(dataset, "loop").axes
    ((place, load),) = marks(loads, "x")
    assert not marks(radii, "x") and not marks(over_load, "x") and loads.collections
    # in each of two cycles that of each member at its fold, which comes after the lowest load behind such a spring
    half = dataset.sizes["t"] // 2
    cycles = [
        dataset["normal_load"].isel(t=slice(first, first + half)).min("t")
        for first in (0, half)
    ]
    known = np.isfinite(load)
    lowest = 1e6 * np.concatenate([cycle.to_numpy().ravel() for cycle in cycles])
    assert known.sum() == 6 and np.all(np.sort(load[known]) > np.sort(lowest))
    assert np.all(np.diff(np.sort(place[known])) > 0.0)
    sparse = moved(MACHINE, **parts, record=Record(per_member=False))
    loads, *_ = plots.draw(sparse, "loop").axes
    assert not loads.collections and "mean pull-off" in legend_of(loads)[0]
    ((_, means),) = marks(loads, "x")
    assert_allclose(np.nanmean(means), np.mean(load[known]), rtol=1e-9)


def test_each_value_of_a_sweep_has_its_curves():
    dataset = moved(MACHINE, clock=COARSE, sweep={"contact.stiffness": [100.0, 1e3]})
    loads, radii, _ = plots.draw(dataset).axes
    assert [
        line.get_color() for line in radii.lines if line.get_linestyle() == "--"
    ] == [pictures.REFERENCE] * 2
    words = [text.get_text() for text in loads.get_legend().get_texts()]
    assert [text.split(":")[0] for text in words[:2]] == [
        "$k$ = 0.1 kN/m",
        "$k$ = 1 kN/m",
    ]
    # under a dead load all contacts are open at the end: the sweep shows at which load they came off
    dead = moved(
        Equilibrium(load={"from": 1e-3, "to": -1e-3}),
        clock=COARSE,
        sweep={"adhesion.work": [21e-3, 42e-3]},
    )
    (panel,) = plots.draw(dead, "sweep").axes
    (load,) = (
        line.get_ydata()
        for line in panel.lines
        if len(line.get_ydata()) == 2 and line.get_marker() == "o"
    )
    assert_allclose(load, 1e6 * dead["pull_off_load"], rtol=1e-12)
    # of works of adhesion each has its folds
    panel = plots.draw(
        moved(clock=COARSE, sweep={"adhesion.work": [0.0, 21e-3, 42e-3]})
    ).axes[0]
    assert sum(line.get_linewidth() == 0.5 for line in panel.lines) == 4


def test_a_loop_is_what_fits_a_sphere_that_moves_with_load_and_radius_over_the_indentation(
    grips,
):
    loads, radii, over_load = rendered(plots.draw(grips, "loop")).axes
    closed = grips["in_contact"].to_numpy() == 1
    assert radii.get_xlabel() == r"indentation $\delta$ (µm)" and not closed.all()
    radius = np.where(closed, 1e6 * grips["contact_radius"], np.nan)
    for panel, x, y in (
        (loads, "indentation", np.where(closed, 1e6 * grips["normal_load"], np.nan)),
        (radii, "indentation", radius),
        (over_load, "normal_load", radius),
    ):
        place, value = thick(panel)
        assert_allclose(value, y, rtol=1e-14)
        assert_allclose(place[closed], 1e6 * grips[x][closed], rtol=1e-14)
    (thin,) = (line for line in loads.lines if line.get_linewidth() == 0.4)
    np.testing.assert_array_equal(thin.get_ydata(), np.where(closed, np.nan, 0.0))
    load, radius = drawn(over_load, pictures.REFERENCE, "--")
    assert_allclose(
        load, 1e6 * jkr.load_at_radius(1e-6 * radius, *JKR), rtol=1e-12, atol=1e-12
    )
    levels = sorted(
        line.get_ydata()[0] for line in loads.lines if line.get_linewidth() == 0.5
    )
    pull = np.pi * 42e-3 * 2e-3
    assert_allclose(levels, [-1.5e6 * pull, -5.0 / 6.0 * 1e6 * pull], rtol=1e-14)
    named = [
        line.get_label()[-3:] for line in loads.lines if line.get_linewidth() == 0.5
    ]
    assert (
        named == ["/2$", "/6$"]
        and sum("pi wR" in words for words in legend_of(loads)[0]) == 2
    )
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
    assert {"pull-off", "jump-in"} <= set(legend_of(radii)[0])
