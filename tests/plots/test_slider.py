"""Figures of a slider that feels its friction: what they show is what the dataset and the theory have."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest
from helpers.parts import Adhesion, Bell, Clock, Force, Spring
from helpers.pictured import legend_of, lines_of, rendered
from helpers.scenes import scene
from numpy.testing import assert_allclose

import sim
from sim.laws.schallamach import (
    Body,
    first_moment_onset,
    first_moment_peak,
    resolved_onset,
)
from sim.parts.bonds.models import Cohort, FirstMoment
from sim.plots import curves, draw, style
from sim.plots.slider import steady_law
from sim.read import slips

#: Bonds of a unit of stretch of 5 µm, and their numbers as the laws take them; the area stays.
NUMBERS = (25.0, 4e-12, 8e-7, 250.0, 6.5e16)
BONDS = FirstMoment(Bell(zero_force_rate=25.0, bell_force=4e-12), *NUMBERS[2:])


@functools.cache
def driven(kind):
    """Small runs, each made once; do not change them."""
    parts = {"bonds": BONDS, "adhesion": Adhesion(work=42e-3, bond_share=0.0)}
    most = first_moment_peak(*NUMBERS).stress * scene(1).contact_area
    ramp = {"from": 1e-3, "to": 3e-2, "scale": "log", "cycles": 1}
    drives = {
        "creep": (
            Force(force=0.5 * most),
            0.2,
            {"drive.force": [0.5 * most, 1.3 * most]},
        ),
        "both ways": (
            Force(force=0.5 * most),
            0.2,
            {"drive.force": [-0.5 * most, 0.5 * most]},
        ),
        "map": (
            Spring(stage=ramp, stiffness=100.0, damping=1e-2, start="steady"),
            4.0,
            {"drive.stiffness": [100.0, 1e4]},
        ),
        "pull": (Spring(stage=2e-3, stiffness=300.0), 0.1, {}),
    }
    drive, duration, sweep = drives[kind]
    if kind == "pull":
        parts["adhesion"] = Adhesion(work=42e-3)
    return sim.run(
        scene(
            2,
            clock=Clock(duration=duration, step=duration / 400),
            drive=drive,
            sweep=sweep,
            **parts,
        )
    )


def test_slips_that_last_few_records_are_remarked_on_with_the_key_that_shows_them():
    path = Path(sim.__file__).parents[1] / "scenarios" / "stick_slip.toml"
    for record, key in (("4 ms", "clock.record"), ("1 ms", "clock.step")):
        dataset = sim.run(sim.load(path, {"clock.record": record}))
        apart = float(dataset["t"][1] - dataset["t"][0])
        assert float(slips(dataset)["slip_duration"].median()) < 3.0 * apart
        _, title = legend_of(draw(dataset, "time").axes[0])
        assert title.endswith(f"reduce {key}")
    assert curves.coarse_slips(driven("pull")) == ""


def test_a_size_of_the_contact_that_stays_is_left_out_beside_panels_that_change():
    stays, changes = (
        draw(
            driven(kind).isel(drive_stiffness=0) if kind == "map" else driven(kind),
            "time",
        )
        for kind in ("map", "pull")
    )
    assert "radius" in changes.axes[0].get_ylabel() and not any(
        "radius" in panel.get_ylabel() for panel in stays.axes
    )


def test_few_fast_records_do_not_rule_the_axis_of_the_speed_and_are_stated():
    dataset = driven("pull").copy(deep=True)
    dataset["speed"][:] = 1e-3 * np.linspace(1.0, 2.0, dataset.sizes["t"])
    dataset["speed"][..., 7] = 0.5
    panel = draw(dataset, "time").axes[-1]
    assert panel.get_ylim()[0] < 1.0 and 2.0 < panel.get_ylim()[1] < 3.0
    stated = [text.get_text() for text in panel.texts]
    assert "largest record 500 mm/s" in stated
    usual = draw(driven("pull"), "time").axes[-1].texts
    assert not any("largest" in text.get_text() for text in usual)


def test_a_map_of_stability_shows_both_ways_and_the_boundary_of_its_bonds():
    dataset = driven("map")
    figure = rendered(draw(dataset))
    up, down = figure.axes[:2]
    body = Body(scene(1).contact_area, damping=1e-2)
    for panel, words in ((up, "increasing"), (down, "decreasing")):
        assert words in legend_of(panel)[1]
        ((speed, stiffness),) = lines_of(panel)
        firm = 0.5 * np.pi**2 * 1.6e6 * float(dataset["radius_at_rest"][0])
        exact = first_moment_onset(
            1e-3 * speed, *NUMBERS, body._replace(contact_stiffness=firm)
        ).stiffness
        assert_allclose(np.nan_to_num(stiffness), 1e-3 * exact, rtol=1e-6)
        swings = panel.collections[0].get_array().reshape(2, -1)
        # a soft spring sticks and slips at 30 mm/s, one stiffer than the boundary nowhere
        assert swings[0, -1] > 0.5 and np.nanmax(swings[1]) < 0.1
    # and nothing does below the friction maximum on the way up
    slow = first_moment_peak(*NUMBERS).speed
    edges = np.geomspace(1e-3, 3e-2, swings.shape[1] + 1)
    assert (
        np.nanmax(up.collections[0].get_array().reshape(2, -1)[:, edges[1:] < slow])
        < 0.1
    )
    bonds = Cohort(
        BONDS.rupture,
        BONDS.bond_stiffness,
        BONDS.rebinding_rate,
        BONDS.site_density,
        tolerance=1e-2,
    )
    drive = Spring(
        stage={"from": 1e-3, "to": 3e-2, "scale": "log"},
        stiffness=1e4,
        damping=1.0,
        start="steady",
    )
    parts = {
        "bonds": bonds,
        "drive": drive,
        "sweep": {"drive.stiffness": [5e3, 1e4]},
        "clock": Clock(2.0, 0.05),
    }
    panel = rendered(
        draw(sim.run(scene(1, adhesion=Adhesion(work=42e-3, bond_share=0.0), **parts)))
    ).axes[0]
    ((speed, stiffness),) = lines_of(panel)
    firm = 0.5 * np.pi**2 * 1.6e6 * math.sqrt(scene(1).contact_area / np.pi)
    body = Body(scene(1).contact_area, damping=1.0, contact_stiffness=firm)
    exact = resolved_onset(1e-3 * speed, [(25.0, 4e-12)], *NUMBERS[2:], body).stiffness
    assert_allclose(np.nan_to_num(stiffness), 1e-3 * exact, rtol=1e-6)


def test_creep_and_the_way_to_sliding_are_drawn_from_the_first_step_beside_the_law_and_a_runaway_ends():
    dataset = driven("creep")
    figure = rendered(draw(dataset))  # the default
    position, speed = figure.axes
    slow, fast = lines_of(speed)[:2]
    assert_allclose(
        slow[1],
        1e3 * dataset["speed"].isel(drive_force=0, t=slice(1, None)),
        rtol=1e-12,
    )
    assert slow[0][0] > 0.0 and position.get_yscale() == position.get_xscale() == "log"
    # a runaway is marked at its own time, between two records
    last = int(np.isfinite(fast[1]).sum()) - 1
    time = 1e3 * float(dataset["runaway_time"].isel(drive_force=1, t=-1))
    assert np.isfinite(dataset["t"][last + 1]) and fast[0][last] <= time
    assert runaways(speed) == runaways(position) == [time]
    assert "runaway" in legend_of(position)[0]
    dataset = driven("pull")
    figure = rendered(draw(dataset, "incipient"))
    force, area = (dataset[name].values for name in ("spring_force", "contact_area"))
    top = int(np.argmax(force)) + 1
    own = lines_of(figure.axes[0])[-1]
    assert_allclose(own[0], 1e3 * force[:top], rtol=1e-12)
    assert_allclose(own[1], area[:top] / area[0], rtol=1e-12)


def runaways(panel):
    """The times of the vertical lines of a panel."""
    return [
        line.get_xdata()[0] for line in panel.lines if len({*line.get_xdata()}) == 1
    ]


def test_fewer_records_leave_each_runaway_of_a_creep_where_it_is():
    dataset = driven("creep")
    (time,) = runaways(rendered(draw(dataset)).axes[0])
    # all records but the first come after it
    late = 1e-3 * time < dataset["t"].to_numpy()
    late[0] = True
    figure = rendered(draw(dataset.isel(t=late), "creep"))
    for panel in figure.axes:
        assert_allclose(panel_time := runaways(panel), [time], rtol=1e-12)
        assert panel.get_xlim()[0] < panel_time[0] < panel.get_xlim()[1]
    # the curve has no point, so that the line has the name of its force
    assert any(name.endswith("mN: runaway") for name in legend_of(figure.axes[0])[0])


def test_creep_in_both_directions_is_drawn_on_linear_axes_which_show_both():
    position, speed = rendered(draw(driven("both ways"), "creep")).axes
    assert position.get_yscale() == speed.get_yscale() == "linear"
    back, forth = lines_of(position)
    assert_allclose(back[1], -forth[1], rtol=1e-9)


def test_a_legend_has_no_name_of_a_line_without_a_point():
    figure, (panel,) = style.rows([2.0])
    panel.set_yscale("log")
    x, nothing = [1.0, 2.0], [math.nan, math.nan]
    panel.plot(x, x, label="drawn")
    panel.plot(x, nothing, label="missing")
    panel.plot(x, [-1.0, -2.0], label="without a logarithm")
    panel.errorbar(x, nothing, nothing, label="missing with bars")
    panel.errorbar(x, x, x, label="drawn with bars")
    panel.plot([], [], label="a sample of a look")
    style.legend(panel)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {*names} == {"drawn", "drawn with bars", "a sample of a look"}


def pulled(exponent):
    """A run whose area is lost as a power of the force."""
    dataset = driven("pull").copy(deep=True)
    force, area = dataset["spring_force"], dataset["contact_area"]
    share = force / force.max()
    dataset["contact_area"] = (area[0] * (1.0 - 0.2 * share**exponent)).assign_attrs(
        area.attrs
    )
    return dataset


@pytest.mark.parametrize(
    ("exponent", "is_square"), [(1.1, False), (1.5, False), (2.0, True), (2.9, False)]
)
def test_only_a_loss_as_the_square_of_the_force_has_an_alpha_and_a_law(
    exponent, is_square
):
    panel = rendered(draw(pulled(exponent), "incipient")).axes[0]
    names = legend_of(panel)[0]
    assert any(f"Q^{{{exponent:.2f}}}" in name for name in names)
    assert any("alpha" in name for name in names) is is_square
    assert len(lines_of(panel)) == 1 + is_square
    if is_square:
        force, area = driven("pull")["spring_force"], driven("pull")["contact_area"]
        alpha = 1e6 * 0.2 * float(area[0] / force.max() ** 2)
        assert any(f"{alpha:.3g} mm$^2$/N$^2$" in name for name in names)


@pytest.mark.parametrize(
    "share_left",
    [
        lambda share: 1.0 + 0.02 * share - 0.1 * share**2,
        lambda share: 1.0 - 0.1 * (np.exp(8.0 * share) - 1.0) / np.exp(8.0),
    ],
)
def test_a_loss_that_no_power_of_the_force_describes_has_no_exponent(share_left):
    """The first area grows before it falls, and the second falls faster than any power."""
    dataset = pulled(2.0)
    force, area = dataset["spring_force"], dataset["contact_area"]
    left = area[0] * share_left(force / force.max())
    dataset["contact_area"] = left.assign_attrs(area.attrs)
    panel = rendered(draw(dataset, "incipient")).axes[0]
    assert not [line for line in panel.lines if "Q" in str(line.get_label())]
    assert len(lines_of(panel)) == 1


def test_figures_of_a_slider_are_refused_with_the_cure_where_they_cannot_be_drawn():
    for kind, of, cure in (
        ("creep", "pull", "force"),
        ("stability", "pull", "drive.stiffness"),
        ("stability", "creep", "spring"),
        ("incipient", "map", "rest"),
    ):
        with pytest.raises(ValueError, match=cure):
            draw(driven(of), kind)


def test_the_law_of_steady_sliding_is_that_of_the_bonds_and_the_viscosity_at_speeds_of_either_sign():
    # bonds on sites: the fraction k/(k + V/l) of them bears the stress, and the viscosity adds 2 kPa s/m times V
    tables = {
        "clock": {"duration": "2 ms", "step": "1 ms"},
        "solid": {"shear_modulus": "1.6 MPa"},
        "sphere": {"radius": "2 mm"},
        "contact": {"load": "4 mN"},
        "adhesion": {"work": "42 mJ/m^2"},
        "drive": {
            "model": "spring",
            "stage": "1 mm/s",
            "stiffness": "1 kN/m",
            "viscosity": "2 kPa s/m",
            "contact_stiffness": "rigid",
        },
        "bonds": {
            "model": "steady",
            "stress": "0.1 MPa",
            "critical_speed": "2 mm/s",
        },
        "sweep": {"bonds.stress": ["0.1 MPa", "0.3 MPa"]},
    }
    dataset, speed = sim.run(tables), np.array([-6e-3, -2e-3, 2e-3, 6e-3])
    fraction = 1.0 / (1.0 + np.abs(speed) / 2e-3)
    for place, strength in enumerate((1e5, 3e5)):
        stress, bound = steady_law(dataset, {"bonds_stress": place}, speed)
        assert_allclose(bound, fraction, rtol=1e-12)
        exact = strength * fraction * np.sign(speed) + 2e3 * speed
        assert_allclose(stress, exact, rtol=1e-12)
    unread = dataset.drop_attrs()
    assert np.isnan(steady_law(unread, {}, speed)).all()
