"""Figures show the numbers they claim to show, for every shape of dataset."""

import sys

import matplotlib as mpl
import numpy as np
import pytest
from helpers.parts import (
    Adhesion,
    Bell,
    Clock,
    Ensemble,
    Equilibrium,
    RateDependent,
    Record,
    bonds,
    drive,
    read,
    shear,
)
from helpers.pictured import (
    RAMP,
    STEADY,
    drawn,
    legend_of,
    lines_of,
    mapped,
    rendered,
    simulated,
)
from helpers.statements import shares, statistics
from numpy.testing import assert_allclose, assert_array_equal

from sim.plots import Choices, kinds as plots, style as pictures

#: Colour of closed forms.
PALE = "#BBBBBB"
REVERSING = drive.Table(
    time=(0.0, 0.1, 0.1, 0.3, 0.3, 0.4), speed=(2e-3, 2e-3, -2e-3, -2e-3, 2e-3, 2e-3)
)


@pytest.fixture(scope="module")
def ramp():
    return simulated()


def swept(**sweep):
    axes = {
        key.replace("_", "."): {"from": 1e-3, "to": 2e-3, "count": count}
        for key, count in sweep.items()
    }
    return simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        sweep=axes,
        clock=Clock(duration=0.04, step=0.02),
    )


def test_the_key_of_a_sweep_with_markers_tells_its_energies_apart():
    keys = {"drive.speed": [1e-3, 2e-3, 4e-3], "sphere.radius": ["1 mm", "2 mm"]}
    figure = plots.draw(simulated(drive=STEADY, sweep=keys), "sweep")
    legend = figure.axes[1].get_legend()
    looks = {line.get_marker() for line in legend.get_lines()}
    assert len(legend.get_lines()) == len(looks) == 2 and "None" not in looks


@pytest.mark.parametrize(
    ("scale", "start", "axis"), [("linear", 0.0, "linear"), ("log", 1e-5, "log")]
)
def test_a_ramp_from_rest_has_a_linear_axis_of_the_speed(scale, start, axis):
    ramp = drive.Ramp(start=start, stop=1e-2, scale=scale)
    clock = Clock(duration=0.4, step=2e-3)
    dataset = simulated(drive=ramp, shear=shear.Uniform(), clock=clock)
    panel = plots.draw(dataset, "curve").axes[-1]
    assert panel.get_xscale() == axis


def test_sweeps_are_shown_against_their_key_and_of_many_curves_ten_are_drawn():
    dataset = simulated(drive=STEADY, sweep={"contact.load": ["1 mN", "4 mN", "16 mN"]})
    figure = plots.draw(dataset)
    found = read.summary(read.settled(read.observables(dataset)))
    load, radius = drawn(figure.axes[0], pictures.BOTH)
    assert_allclose(load, [1.0, 4.0, 16.0], rtol=1e-14)
    assert_allclose(radius, 1e6 * found["contact_radius"].value.isel(t=0), rtol=1e-14)
    assert_allclose(
        drawn(figure.axes[0], pictures.REFERENCE, "--")[1],
        1e6 * dataset["radius_at_rest"],
        rtol=1e-14,
    )
    assert (
        figure.axes[-1].get_xlabel() == "normal load $P$ (mN)"
        and figure.axes[0].get_xscale() == "log"
    )
    tables = [
        {"model": "none", "stress": "0.3 MPa"},
        {"model": "steady", "critical_speed": "10 mm/s"},
    ]
    keys = {"bonds": tables, "contact.load": [1e-3, 4e-3]}
    dataset = simulated(drive=STEADY, shear=shear.Uniform(), sweep=keys)
    figure = plots.draw(dataset, "sweep")
    for panel in figure.axes:
        for line in panel.lines:
            y = np.asarray(line.get_ydata())
            joined = (
                np.isfinite(y[1:])
                & np.isfinite(y[:-1])
                & (line.get_linestyle() != "None")
            )
            # no line joins categories, but the one at zero
            assert not np.any(joined) or np.all(y == 0.0)
    radii = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert_allclose(
        radii[1].get_ydata(),
        1e6 * dataset["contact_radius"].isel(contact_load=1, t=-1),
        rtol=1e-14,
    )
    assert [text.get_text() for text in figure.axes[-1].get_xticklabels()] == [
        "none",
        "steady",
    ]
    keys = {"contact.load": [0.0, 4e-3], "sphere.radius": ["1 mm", "2 mm"]}
    dataset = simulated(drive=STEADY, shear=shear.Uniform(), sweep=keys)
    panel = plots.draw(dataset).axes[0]
    assert legend_of(panel)[0] == ["$R$ = 1 mm", "$R$ = 2 mm", "JKR", "Hertz"]
    radius = 1e6 * dataset["contact_radius"].isel(sphere_radius=1, t=-1)
    assert_allclose(drawn(panel, pictures.LINES[1])[1], radius, rtol=1e-14)
    dataset = simulated(sweep={"drive.to": ["10 mm/s", "100 mm/s"]})
    figure = plots.draw(dataset, "sweep")
    assert legend_of(figure.axes[0])[1] == "at $t$ = 400 ms"
    panel = plots.draw(dataset).axes[0]
    ends = [drawn(panel, colour)[0][-1] for colour in pictures.LINES[:2]]
    assert_allclose(ends, [10.0, 100.0], rtol=1e-12)
    dataset = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        sweep={"contact.load": list(np.linspace(1e-3, 9e-3, 9))},
    )
    panel = rendered(plots.draw(dataset, "time")).axes[0]
    assert sum("$P$" in name for name in legend_of(panel)[0]) == 9
    colours = [line.get_color() for line in panel.lines if line.get_linestyle() == "-"]
    assert len(colours) == 9 and colours == sorted(
        colours, key=lambda c: sum(mpl.colors.to_rgb(c)[:2])
    )
    dataset = swept(contact_load=41)
    panel = plots.draw(dataset, "time").axes[0]
    ends = [line.get_ydata()[0] for line in panel.lines if line.get_linestyle() == "-"]
    places = np.rint(np.linspace(0, 40, 10)).astype(int)
    assert_allclose(
        ends, 1e6 * dataset["contact_radius"].isel(contact_load=places, t=0), rtol=1e-14
    )
    assert "10 of 41 curves drawn (choose others by --where)" in legend_of(panel)[
        1
    ].replace("\n", " ")
    chosen = plots.draw(read.where(dataset, {"contact.load": "1 mN"}), "time")
    assert legend_of(chosen.axes[0])[1] == "$P$ = 1 mN"
    dataset = swept(contact_load=9, sphere_radius=3)
    panel = rendered(plots.draw(dataset, "time")).axes[0]
    ends = [
        line.get_ydata()[-1]
        for line in panel.lines
        if np.size(line.get_ydata()) and line.get_linestyle() == "-"
    ]
    radii = (
        dataset["contact_radius"]
        .isel(t=-1)
        .stack(point=["contact_load", "sphere_radius"])
        .to_numpy()
        .ravel()
    )
    assert_allclose(
        ends, 1e6 * radii[np.rint(np.linspace(0, 26, 10)).astype(int)], rtol=1e-14
    )
    names, title = legend_of(panel)
    assert (
        "$P$ = 2 mN, $R$ = 2 mm" in names
        and "10 of 27 curves drawn" in title.replace("\n", " ")
    )


def test_several_curves_keep_their_mechanisms_by_a_line_of_the_area_with_the_bonds_left():
    loads = {"contact.load": ["1 mN", "4 mN"]}
    dataset = simulated(
        bonds=bonds.Steady(critical_speed=2e-2, stress=3e5), sweep=loads
    )
    panel = plots.draw(dataset, "curve").axes[0]
    lost = shares(dataset)["lost_to_bonds"].value.transpose("contact_load", "t")
    for colour, share in zip(pictures.LINES, lost, strict=False):
        assert_allclose(drawn(panel, colour, "-.")[1], 1.0 - share, rtol=1e-12)
    assert "with intact bonds only" in legend_of(panel)[0]
    alone = simulated(
        bonds=bonds.Steady(critical_speed=2e-2, stress=3e5),
        shear=shear.Uniform(),
        sweep=loads,
    )
    # the curves themselves
    assert (
        "with intact bonds only" not in legend_of(plots.draw(alone, "curve").axes[0])[0]
    )


@pytest.mark.parametrize("fluctuates", [True, False])
def test_a_mechanism_that_takes_nothing_but_rounding_is_no_part_of_a_legend(fluctuates):
    parts = {} if fluctuates else {"shear": shear.Uniform()}
    dataset = simulated(**parts)
    radius = dataset["bonds_radius"]
    odd = np.arange(radius.sizes["t"]) % 2
    dataset = dataset.assign(bonds_radius=radius * (1.0 + np.finfo(float).eps * odd))
    names = legend_of(plots.draw(dataset, "curve").axes[0])[0]
    assert "lost to broken bonds" in names
    assert ("lost to fluctuations" in names) is fluctuates


def test_curves_show_means_over_speed_and_break_where_the_contact_is_open_or_the_speed_jumps(
    ramp,
):
    figure = rendered(plots.draw(ramp, "curve"))
    found, lost = statistics(ramp), shares(ramp)["lost_to_bonds"].value
    area, energies, friction = figure.axes
    speed, ratio = drawn(area, pictures.BOTH)
    assert_allclose(speed, 1e3 * ramp["speed"], rtol=1e-14)  # mm/s
    assert_allclose(ratio, found["area_ratio"].value, rtol=1e-14)
    radii = read.reference_radii(ramp)
    hertz = (radii["radius_hertz"] / radii["radius_jkr"]) ** 2
    assert_allclose(drawn(area, pictures.REFERENCE, ":")[1], hertz, rtol=1e-14)
    assert (
        area.get_xscale() == "log"
        and friction.get_xlabel() == "sliding speed $V$ (mm/s)"
    )
    edges = [shade.get_paths()[0].vertices[:, 1] for shade in area.collections[:2]]
    colours = [
        mpl.colors.to_hex(shade.get_facecolor()[0]).upper()
        for shade in area.collections[:2]
    ]
    assert colours == [pictures.BONDS, pictures.FLUCTUATIONS]
    least = [1.0 - lost.max(), found["area_ratio"].value.min()]
    assert_allclose([edge.min() for edge in edges], least, rtol=1e-12)
    assert_allclose(
        [edge.max() for edge in edges],
        [1.0, 1.0 - lost.min()],
        rtol=1e-12,
    )
    _, left = drawn(energies, pictures.BOTH)
    assert_allclose(left, 1e3 * found["work_of_adhesion"].value, rtol=1e-14)
    _, fluctuations = drawn(energies, pictures.FLUCTUATIONS, "--")
    assert_allclose(fluctuations, 1e3 * found["fluctuation_energy"].value, rtol=1e-14)
    _, bonded = drawn(energies, pictures.BONDS, "-.")
    assert_allclose(bonded, 1e3 * read.bond_work(ramp), rtol=1e-14)
    assert_allclose(
        drawn(friction, pictures.BOTH)[1],
        1e3 * found["friction_force"].value,
        rtol=1e-14,
    )
    band = plots.draw(ramp, "time").axes[0].collections[0].get_paths()[0].vertices[:, 1]
    quantiles = 1e6 * found["contact_radius"].quantile.sel(quantile=[0.05, 0.95])
    assert (band.min(), band.max()) == (
        quantiles[{"quantile": 0}].min(),
        quantiles[{"quantile": 1}].max(),
    )
    assert len(plots.draw(ramp, "curve").axes) == 3
    dataset = simulated(contact=Equilibrium(load=-3e-4), shear=shear.Uniform())
    closed = dataset["in_contact"].to_numpy() == 1
    last = int(np.flatnonzero(closed)[-1])
    assert 0 < last < len(closed) - 1 and np.all(
        dataset["contact_radius"][~closed] == 0.0
    )
    panel = plots.draw(dataset, "time").axes[0]
    _, radius = drawn(panel, pictures.BOTH)
    np.testing.assert_array_equal(np.isfinite(radius), closed)
    (cross,) = (line.get_data() for line in panel.lines if line.get_marker() == "x")
    at = [1e3 * dataset["pull_off_time"], 1e6 * dataset["contact_radius"][last]]
    assert_allclose(np.ravel(cross), at, rtol=1e-14)
    assert dataset["t"][last] < dataset["pull_off_time"] < dataset["t"][last + 1]
    assert "pull-off" in legend_of(panel)[0] and "Hertz" not in legend_of(panel)[0]
    loads = [-3.9e-4, -2e-4, 0.0, 1e-3, 4e-3]
    dataset = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        bonds=bonds.Unbroken(),
        sweep={"contact.load": loads},
    )
    panel = plots.draw(dataset, "sweep").axes[0]
    _, hertz = drawn(panel, pictures.REFERENCE, ":")
    assert np.all(np.isnan(hertz[:2])) and np.all(hertz[3:] > 0.0)
    assert drawn(panel, pictures.REFERENCE, "--")[1][0] > 0.0  # JKR holds it
    dataset = simulated(drive=REVERSING, shear=shear.Uniform())
    speed = dataset["speed"].to_numpy()
    for kind in ("curve", "friction", "stress"):
        for panel in plots.draw(dataset, kind).axes:
            for line in (
                line
                for line in panel.lines
                if np.size(line.get_ydata()) > 10 and line.get_color() != PALE
            ):
                x = np.asarray(line.get_xdata(), float)
                gaps = np.flatnonzero(np.diff(speed)) + 1
                # a friction loop is one line
                speeds = np.insert(speed, gaps if kind != "friction" else (), np.nan)
                assert len(x) == len(speeds) and np.all(
                    np.isnan(x) == np.isnan(speeds)
                ), kind


def test_of_members_that_come_off_at_different_times_the_closed_ones_are_drawn_beside_the_share_of_open_ones():
    counted = bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=200)
    dataset = simulated(
        contact=Equilibrium(load=-3e-4), bonds=counted, ensemble=Ensemble(members=8)
    )
    closed = dataset["in_contact"] == 1
    count = closed.sum("member").to_numpy()
    assert {8, 0} < {*count}
    radius, *_, opened = rendered(
        plots.draw(dataset, "curve", Choices(absolute=True))
    ).axes
    mean = 1e6 * read.over_members(dataset, ["contact_area"])["contact_area"].value
    _, area = drawn(radius, pictures.BOTH)
    assert_allclose(area, np.where(count > 2, mean, np.nan), rtol=1e-12)
    (cross,) = (line.get_xydata() for line in radius.lines if line.get_marker() == "x")
    last = np.flatnonzero(count > 2)[-1]
    pulled = dataset["pull_off_time"].max() / dataset["t"][-1]
    at = 1e3 * RAMP.start * (RAMP.stop / RAMP.start) ** pulled
    assert_allclose(cross, [[at, area[last]]], rtol=1e-12)
    assert "last pull-off" in legend_of(radius)[0]
    assert opened.get_ylabel() == "open contacts"
    assert_allclose(
        drawn(opened, pictures.BOTH)[1], 1.0 - count / 8, rtol=0, atol=1e-15
    )


BACK = {"from": 2e-6, "to": -14e-6, "cycles": 2}
BEHIND_A_SPRING = Equilibrium(
    displacement=BACK, stiffness=340.0, after_pull_off="reattach"
)
LAGGING = RateDependent(
    indentation=BACK,
    front_speed=1e-3,
    front_exponent=0.6,
    heal_speed=1e-4,
    after_pull_off="reattach",
)


@pytest.mark.parametrize("contact", [BEHIND_A_SPRING, LAGGING])
@pytest.mark.parametrize("record", [2e-3, 0.06])
def test_pull_offs_and_the_first_jump_in_are_marked_at_their_times_between_records(
    contact, record
):
    clock = Clock(duration=1.8, step=2e-3, record=record)
    parts = {"shear": shear.Uniform(), "bonds": bonds.Unbroken(), "drive": STEADY}
    dataset = simulated(contact=contact, clock=clock, **parts)
    panel = plots.draw(dataset, "time").axes[0]
    marks = {
        line.get_label(): line.get_xdata()
        for line in panel.lines
        if line.get_marker() in ("x", "o")
    }
    pulled = dataset["phase_pull_off_time"].to_numpy()
    assert np.isfinite(pulled).sum() == 2
    expected = {"pull-off": pulled[np.isfinite(pulled)]}
    if "jump_in_time" in dataset:  # a lagging edge closes without a jump
        expected["first jump-in"] = dataset["jump_in_time"]
    assert marks.keys() == expected.keys()
    for words, times in expected.items():
        assert_allclose(marks[words], 1.0 * np.ravel(times), rtol=1e-14)


def test_of_members_known_by_their_statistics_alone_no_pull_off_is_marked():
    counted = bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=200)
    parts = {"contact": Equilibrium(load=-3e-4), "bonds": counted}
    dataset = simulated(
        ensemble=Ensemble(members=8), record=Record(per_member=False), **parts
    )
    assert dataset["in_contact"].isel(t=-1, statistic=0) == 0.0
    panel = plots.draw(dataset, "time").axes[0]
    assert all(line.get_marker() != "x" for line in panel.lines)


def test_branches_of_a_course_are_apart_and_shuffled_speeds_make_the_same_curves():
    course = drive.Table(time=(0.0, 0.2, 0.4), speed=(1e-4, 1e-2, 1e-4))
    dataset = simulated(
        drive=course,
        bonds=bonds.Rate(critical_speed=1e-3, rebinding_rate=50.0, stress=1e5),
    )
    area = rendered(plots.draw(dataset, "curve")).axes[0]
    ways = [line for line in area.lines if "speed" in str(line.get_label())]
    assert [line.get_label() for line in ways] == [
        "increasing speed",
        "decreasing speed",
    ]
    parts = [line.get_xdata()[np.isfinite(line.get_ydata())] for line in ways]
    assert np.all(np.diff(parts[0]) > 0.0) and np.all(np.diff(parts[1]) < 0.0)
    # all records; that of the turn is in both
    assert sum(map(len, parts)) == dataset.sizes["t"] + 1
    speeds, curves = [3e-3, 3e-4, 1e-3, 1e-2], []
    for order in (speeds, sorted(speeds)):
        dataset = simulated(
            drive=drive.Steady(speed=1e-3), sweep={"drive.speed": order}
        )
        for kind in ("curve", "sweep"):
            curves.append(
                [line.get_xydata() for line in plots.draw(dataset, kind).axes[0].lines]
            )
    for mixed, ordered in zip(curves[:2], curves[2:], strict=True):
        for one, other in zip(mixed, ordered, strict=True):
            assert_array_equal(one, other)


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.verify)])
def test_every_shape_of_dataset_is_drawn_as_what_fits_it_and_a_quantity_not_recorded_is_named(
    every,
):
    waves = {"model": "band", "rms": "10 kPa", "longest": "60 um", "shortest": "16 um"}
    shears = [{"model": "uniform"}, {"model": "mean", "spectrum": waves}]
    counted = bonds.Counted(critical_speed=1e-2, rebinding_rate=5e2, sites=9)
    contacts = [
        {"model": "equilibrium", "load": 4e-3},
        {"model": "equilibrium", "indentation": 1e-6},
    ]
    moving = {"model": "equilibrium", "indentation": {"from": "2 um", "to": "-2 um"}}
    tracked = bonds.Tracked(
        rupture=Bell(zero_force_rate=1e4, bell_force=4e-12),
        bond_stiffness=4e-4,
        rebinding_rate=1e5,
        site_density=9e16,
        sites=50,
    )
    known = set()
    shapes = [
        {"record": Record(per_member=False)},
        {"ensemble": Ensemble(members=1)},
        {"record": Record(precision="float32")},
        {"drive": drive.Ramp(start=-2e-3, stop=8e-3)},
        {"drive": drive.Table(time=(0.0, 0.2, 0.4), speed=(0.0, 0.02, 0.0))},
        {"contact": Equilibrium(load=-3e-4)},
        {"contact": Equilibrium(load=-1.0), "shear": shear.Uniform()},
        {
            "contact": Equilibrium(indentation=1e-6),
            "bonds": counted,
            "record": Record(per_member=False),
        },
        {"sweep": {"contact": contacts}},
        {"sweep": {"contact.load": {"from": "0 mN", "to": "20 mN", "count": 12}}},
        {"drive": STEADY, "sweep": {"shear": shears, "contact.load": [0.0, 1e-3]}},
        {"shear": shear.Uniform(), "bonds": bonds.Unbroken()},
        {"bonds": tracked, "record": Record(per_member=False)},
        {"contact": Equilibrium(indentation={"from": -4e-6, "to": -2e-6})},
        {"sweep": {"contact": [moving, *contacts]}},
        {"drive": STEADY, "clock": Clock(duration=0.02, step=0.02)},
    ]
    for changes in shapes[::every]:
        dataset, scenes = (
            simulated(**changes),
            repr([changes.get(key) for key in ("contact", "sweep", "shear")]),
        )
        for kind in plots.drawable(dataset):
            if kind == "theories" and (kind, scenes) in known:
                # one of the same contact: it has no speeds, members or records
                continue
            known.add((kind, scenes))
            figure = plots.draw(dataset, kind)
            assert (
                any(panel.get_xlabel() for panel in figure.axes)
                and figure.axes[0].get_ylabel()
            )
            for panel in figure.axes:
                assert (
                    lines_of(panel)
                    or panel.texts
                    or panel.collections
                    or panel.images
                    or panel.patches
                ), (changes, kind)
    loads, start = {"contact.load": [1e-3, 4e-3]}, drive.Start(rest=0.1, speed=1e-3)
    moved = {
        "contact": Equilibrium(load={"from": 0.0, "to": 4e-3}),
        "sweep": {"sphere.radius": [1e-3, 2e-3]},
    }
    for changes, kind in (
        ({}, "curve"),
        ({"sweep": loads}, "curve"),
        ({"drive": STEADY, "sweep": {"drive.speed": [1e-3, 4e-3]}}, "curve"),
        ({"drive": STEADY, "sweep": loads}, "sweep"),
        ({"drive": STEADY}, "time"),
        ({"drive": STEADY, **moved}, "loop"),
        ({"drive": start}, "stress"),
        ({"drive": start, "bonds": bonds.Unbroken()}, "time"),
        ({"drive": REVERSING}, "friction"),
        ({"drive": REVERSING, "bonds": bonds.Unbroken()}, "time"),
        ({"drive": STEADY, "sweep": {"contact.reversible": [0.0, 0.1]}}, "theories"),
    ):
        assert plots.default(simulated(shear=shear.Uniform(), **changes)) == kind, (
            changes
        )
    dataset = simulated(
        record=Record(
            quantities=("speed", "friction_force", "jkr_radius", "hertz_radius")
        )
    )
    for kind, name in (
        ("curve", "contact_area"),
        ("stress", "shear_stress"),
        ("friction", "slider_position"),
    ):
        with pytest.raises(
            ValueError,
            match=f'^{name} was not recorded; add "{name}" to record.quantities',
        ):
            plots.draw(dataset, kind)
    assert plots.default(dataset) == "time" and rendered(plots.draw(dataset))
    with pytest.raises(
        ValueError,
        match=r"\[sweep\].*drawn as: theories, stress, friction, curve, time",
    ):
        plots.draw(simulated(), "sweep")
    with pytest.raises(ValueError, match=r'\[drive\] model = "ramp"'):
        plots.draw(simulated(drive=STEADY, shear=shear.Uniform()), "curve")


def test_equal_figures_give_equal_files_of_one_or_two_columns_and_leave_matplotlib_alone(
    ramp, tmp_path, monkeypatch
):
    before = mpl.rcParams.copy()
    # which code of the pages imports
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)
    for name in ("first", "second"):
        figure = plots.draw(ramp, "friction")
        for suffix in ("png", "pdf"):
            figure.savefig(tmp_path / f"{name}.{suffix}")
    for suffix in ("png", "pdf"):
        assert (tmp_path / f"first.{suffix}").read_bytes() == (
            tmp_path / f"second.{suffix}"
        ).read_bytes()
    plots.draw(mapped(), "map").savefig(tmp_path / "map.png")
    widths = [
        int.from_bytes((tmp_path / f"{name}.png").read_bytes()[16:20], "big")
        for name in ("first", "map")
    ]
    assert widths == [1360, 2800]  # at 400 dpi
    assert mpl.rcParams.copy() == before and "matplotlib.pyplot" not in sys.modules


def test_a_band_of_few_members_is_named_as_interpolated_between_them():
    for members, name in (
        (3, "5–95 %, interpolated between 3 members"),
        (20, "5–95 % of members"),
    ):
        figure = plots.draw(simulated(ensemble=Ensemble(members=members)))
        assert name in legend_of(figure.axes[0])[0]


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_each_band_is_named_once_also_if_only_a_lower_panel_has_it(share):
    counted = bonds.Counted(
        critical_speed=1e-2, rebinding_rate=500.0, sites=200, stress=1e5
    )
    dataset = simulated(
        bonds=counted,
        shear=shear.Uniform(),
        adhesion=Adhesion(work=42e-3, bond_share=share),
        ensemble=Ensemble(members=20),
    )
    figure = plots.draw(dataset, "curve", Choices(absolute=True))
    # without a share of the bonds in the adhesion the areas of all members agree
    radius = dataset["contact_radius"].std("member").max()
    assert (radius > 1e-9) == (share > 0.0)
    legends = [*figure.legends, *(panel.get_legend() for panel in figure.axes)]
    names = [text.get_text() for each in filter(None, legends) for text in each.texts]
    for band in ("5–95 % of members", "± standard error"):
        assert names.count(band) == 1


def test_a_single_member_has_no_band_in_its_legend():
    dataset = simulated(ensemble=Ensemble(members=1), shear=shear.Uniform())
    names = legend_of(plots.draw(dataset, "time").axes[0])[0]
    assert not any("%" in name or "error" in name for name in names)


def test_each_branch_of_a_course_has_the_band_of_its_own_records():
    course = drive.Table(time=(0.0, 0.2, 0.4), speed=(1e-4, 1e-2, 1e-4))
    counted = bonds.Counted(
        critical_speed=1e-3, rebinding_rate=50.0, sites=200, stress=1e5
    )
    parts = {"drive": course, "bonds": counted, "shear": shear.Uniform()}
    dataset = simulated(ensemble=Ensemble(members=20), **parts)
    panel = plots.draw(dataset, "curve").axes[0]
    ratio = read.over_members(dataset, ["area_ratio"])["area_ratio"]
    low, high = ratio.quantile.isel(quantile=[0, -1]).transpose("quantile", "t")
    turn = int(np.argmax(dataset["speed"].to_numpy()))
    halves = slice(None, turn + 1), slice(turn, None)
    heights = {}
    for band in panel.collections:
        if "members" in str(band.get_label()):
            colour = tuple(band.get_facecolor()[0])
            for path in band.get_paths():
                heights.setdefault(colour, []).extend(path.vertices[:, 1])
    for edges, half in zip(heights.values(), halves, strict=True):
        ends = [np.min(low[half]), np.max(high[half])]
        assert_allclose([min(edges), max(edges)], ends, rtol=1e-12)
