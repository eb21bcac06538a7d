"""What is chosen for a figure is what it shows: a member, a time, an axis, units, measured points, axes to draw in."""

import re

import matplotlib as mpl
import numpy as np
import pytest
from helpers.commands import sim as command
from helpers.parts import Equilibrium, RateDependent, Record, read, shear
from helpers.pictured import (
    STEADY,
    drawn,
    field,
    legend_of,
    lines_of,
    mapped,
    rendered,
    simulated,
)
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import sim
from sim.cli import _KINDS
from sim.plots import Choices, kinds as plots, style as pictures
from sim.plots.field import PIXELS
from sim.plots.measured import Compared, Line
from sim.reports.report import drawings
from sim.units.errors import BadInput

LOADS = {"contact.load": [1e-3, 4e-3]}


def draw(dataset, kind=None, **choices):
    return plots.draw(dataset, kind, Choices(**choices))


@pytest.fixture(scope="module")
def ramp():
    return simulated()


@pytest.fixture(scope="module")
def loads():
    """Two loads under a ramp, without fluctuations."""
    return simulated(shear=shear.Uniform(), sweep=LOADS)


def test_a_member_a_time_and_axes_are_those_chosen_in_their_units_and_what_does_not_exist_is_refused(
    ramp,
):
    dataset = simulated(
        shear=field(shear.Mapped),
        drive=STEADY,
        record=Record(maps=(0.2, 0.4), map_members=2),
    )
    for member, at, place in ((0, 0.25, 0), (1, "300.1 ms", 1)):
        figure = draw(dataset, "map", member=member, at=at)
        shown = np.asarray(figure.axes[0].images[0].get_array())
        stress = (
            1e-3
            * dataset["shear_map"].isel(map_member=member, map_time=place).to_numpy()
        )
        # the middle of the picture is the array's corner
        half, fine = shown.shape[0] // 2, PIXELS // len(stress)
        at = half + fine * np.arange(len(stress) // 2)
        rounding = 1e-13 * np.max(np.abs(stress))
        assert_allclose(
            shown.T[np.ix_(at, at)], stress[:16, :16], rtol=0.0, atol=rounding
        )
        assert f"$t$ = {(200, 400)[place]} ms" in figure.get_suptitle()
        assert r"mean $\tau_0$ = " in figure.get_suptitle()
    with pytest.raises(ValueError, match="no stress maps"):
        draw(dataset, "map", member=3)
    figure = rendered(draw(ramp, "time", member=3))
    radius = ramp["contact_radius"].isel(member=3)
    assert_allclose(drawn(figure.axes[0], pictures.BOTH)[1], 1e6 * radius, rtol=1e-14)
    assert legend_of(figure.axes[0])[1] == "member 3"
    with pytest.raises(ValueError, match="members 0 to 5"):
        draw(ramp, "time", member=6)
    with pytest.raises(ValueError, match="per_member = true"):
        draw(simulated(record=Record(per_member=False)), "time", member=1)
    with pytest.raises(ValueError, match=r"^at 3 mm: "):
        draw(dataset, "map", at="3 mm")
    for x, variable, factor, label in [
        (
            "slider_position",
            "slider_position",
            1e3,
            "displacement of the slider $X$ (mm)",
        ),
        (
            "shear_stress",
            "shear_stress",
            1e-3,
            r"mean shear stress at the interface $\tau_{0}$ (kPa)",
        ),
    ]:
        dataset = simulated(shear=shear.Uniform())
        figure = draw(dataset, "time", x=x)
        if x == "shear_stress":  # the longest label
            rendered(figure)
        over, radius = drawn(figure.axes[0], pictures.BOTH)
        assert_allclose(over, factor * dataset[variable], rtol=1e-14)
        assert_allclose(radius, 1e6 * dataset["contact_radius"], rtol=1e-14)
        assert figure.axes[-1].get_xlabel() == label
        assert plots.draw(dataset, None, Choices(x=x)).axes[-1].get_xlabel() == label
    dataset = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        sweep=LOADS | {"sphere.radius": ["1 mm", "2 mm", "3 mm"]},
    )
    figure = draw(dataset, x="sphere.radius")
    assert figure.axes[-1].get_xlabel() == "radius of the sphere $R$ (mm)"
    x, radius = drawn(figure.axes[0], pictures.LINES[1])
    assert_allclose(x, [1.0, 2.0, 3.0], rtol=1e-14)
    assert_allclose(
        radius, 1e6 * dataset["contact_radius"].isel(contact_load=1, t=-1), rtol=1e-14
    )
    figure = draw(ramp, "curve", units=("um/s", "kN"), absolute=True)
    area, *_, friction = figure.axes
    assert (
        friction.get_xlabel() == "sliding speed $V$ (µm/s)"
        and friction.get_ylabel() == "friction $F$ (kN)"
    )
    assert area.get_ylabel().endswith("(mm²)")
    assert_allclose(drawn(friction, pictures.BOTH)[0], 1e6 * ramp["speed"], rtol=1e-14)


HEADER = (
    "speed [mm/s], contact_area [mm^2], contact_area_error [%], friction_force [mN]"
)


@pytest.fixture
def table(tmp_path):
    def written(text):
        path = tmp_path / "measured.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def points_of(panel):
    """Places of the measured points of a panel."""
    return [
        line.get_data()
        for line in panel.lines
        if line.get_marker() == "o" and line.get_mfc() == "white"
    ]


def test_measured_points_lie_where_they_were_measured_in_curves_and_loops(loads, table):
    path = table(
        "contact_load [mN], speed [mm/s], contact_radius [um]\n4, 1, 110\n1, 1, 85\n4, 2, 111\n9, 1, 99\n"
    )
    panel = draw(loads, "curve", data=path, absolute=True).axes[0]
    areas = [np.pi * np.square(radii) / 1e6 for radii in ([85.0], [110.0, 111.0])]
    colours = [line.get_color() for line in panel.lines if line.get_mfc() == "white"]
    assert colours == list(pictures.LINES[:2])
    for (_, shown), area in zip(points_of(panel), areas, strict=True):
        assert_allclose(shown, area, rtol=1e-12)
    one = read.where(loads, {"contact.load": "1 mN"})
    assert_allclose(
        points_of(draw(one, "curve", data=path).axes[0])[0][0], [1.0], rtol=1e-14
    )
    dataset = simulated(shear=shear.Uniform())
    path = table(f"{HEADER}\n2, 0.04, 2, 9\n20, 0.03, 2, 4\n500, 0.03, 2, 1\n")
    area, _, friction, residual = rendered(draw(dataset, "curve", data=path)).axes
    ((speed, share),) = points_of(area)
    full = 1e6 * np.pi * float(dataset["radius_at_rest"]) ** 2
    assert_allclose(speed, [2.0, 20.0, 500.0], rtol=1e-14)
    assert_allclose(share, np.array([0.04, 0.03, 0.03]) / full, rtol=1e-12)
    assert_allclose(points_of(friction)[0][1], [9.0, 4.0, 1.0], rtol=1e-14)
    ((at, off),) = points_of(residual)
    mean = np.interp(
        np.log(at[:2]), np.log(1e3 * dataset["speed"]), dataset["contact_area"]
    )
    assert_allclose(
        off[:2],
        (np.array([0.04, 0.03]) - 1e6 * mean) / (0.02 * np.array([0.04, 0.03])),
        rtol=1e-9,
    )
    assert np.isnan(off[2])  # beyond the ramp
    assert any(
        name.startswith(r"measured, $\chi^2$ =") and name.endswith("of 2")
        for name in legend_of(area)[0]
    )
    assert area.get_xlim()[1] > 500.0
    columns = {"speed": [2e-3], "contact_area": [4e-8], "contact_area_error": [1e-9]}
    assert_allclose(
        points_of(draw(dataset, "curve", data=columns).axes[0])[0],
        [[2.0], [0.04 / full]],
        rtol=1e-12,
    )
    absolute = draw(dataset, "curve", data=path, absolute=True).axes[0]
    assert_allclose(points_of(absolute)[0][1], [0.04, 0.03, 0.03], rtol=1e-14)
    radius = draw(dataset, "time", x="speed", data=path).axes[0]
    assert_allclose(
        points_of(radius)[0][1],
        1e3 * np.sqrt(np.array([0.04, 0.03, 0.03]) / np.pi),
        rtol=1e-12,
    )
    lagging = RateDependent(
        load={"from": 1e-4, "to": 1e-3, "cycles": 1}, front_speed=1e-5
    )
    dataset = simulated(contact=lagging, drive=STEADY, shear=shear.Uniform())
    path = table(
        "normal_load [mN], contact_radius [um], contact_radius_error [um]\n0.3, 70, 2\n0.5, 90, 2\n"
    )
    loads, radii, loaded, below = draw(dataset, "loop", data=path).axes
    assert not points_of(loads) and not points_of(radii)
    assert_allclose(points_of(loaded)[0], [[0.3, 0.5], [70.0, 90.0]], rtol=1e-12)
    load, radius = (
        dataset[name].to_numpy() for name in ("normal_load", "contact_radius")
    )
    for off, (at, measured) in zip(
        below.lines[0].get_ydata(), ((3e-4, 70e-6), (5e-4, 90e-6)), strict=True
    ):
        passed = np.flatnonzero(
            ((load[:-1] - at) * (load[1:] - at) <= 0.0) & (np.diff(load) != 0.0)
        )
        share = (at - load[passed]) / (load[passed + 1] - load[passed])
        crossings = radius[passed] + share * (radius[passed + 1] - radius[passed])
        assert crossings.size == 2
        assert_allclose(off, min((measured - crossings) / 2e-6, key=abs), rtol=1e-9)
    (label,) = (one for one in legend_of(loaded)[0] if one.startswith("measured, $"))
    assert label.endswith(" of 2 (nearest branch)")
    # one branch of radii
    there_and_back = Equilibrium(load={"from": 1e-4, "to": 1e-3, "cycles": 1})
    dataset = simulated(contact=there_and_back, drive=STEADY, shear=shear.Uniform())
    (label,) = (
        one
        for one in legend_of(draw(dataset, "loop", data=path).axes[2])[0]
        if one.startswith("measured, $")
    )
    assert label.endswith(" of 2")


@pytest.mark.parametrize(
    ("column", "order"),
    [("normal_load [mN]", 1), ("load [N]", -1), ("contact_load [uN]", 1)],
)
def test_each_row_of_a_table_is_drawn_once_or_counted_as_left_out(
    loads, table, column, order
):
    factor = {"mN": 1e3, "N": 1.0, "uN": 1e6}[column.partition("[")[2].rstrip("]")]
    known = [
        (load, 10.0**k, 0.03 + 0.001 * k + load)
        for load in (1e-3, 4e-3)
        for k in range(-1, 2)
    ]
    beyond, unknown = (
        (4e-3, 1e6, 0.02),
        [(9e-3, 1.0, 0.03), (2e-3, 2.0, 0.03), (9e-3, 3.0, 0.03)],
    )
    every = [*known, beyond, *unknown, (4e-3, 5.0, ""), (1e-3, 0.0, 0.02)][::order]
    rows = "".join(
        f"{factor * load}, {v}, {area}, {1e-3 if v + load != 10.001 else ''}\n"
        for load, v, area in every
    )
    path = table(
        f"{column}, speed [mm/s], contact_area [mm^2], contact_area_error [mm^2]\n{rows}"
    )
    figure = draw(loads, "curve", data=path, absolute=True, units=("mm/s",))
    first, *others = figure.axes
    assert not any(map(points_of, others[:-1]))
    drawn_of = {
        line.get_color(): line.get_data()
        for line in first.lines
        if line.get_mfc() == "white"
    }
    for colour, load in zip(pictures.LINES, (1e-3, 4e-3), strict=False):
        wanted = sorted(
            (speed, area) for each, speed, area in [*known, beyond] if each == load
        )
        assert_allclose(
            sorted(np.transpose(drawn_of[colour]).tolist()), wanted, rtol=1e-12
        )
    remark = " ".join(figure.get_supxlabel().split())
    numbers = re.findall(r"(\d+) (of 12|not of|with|at)", remark)
    assert {words: int(number) for number, words in numbers} == {
        "of 12": 7,
        "not of": 3,
        "with": 1,
        "at": 1,
    }
    assert "2 mN, 9 mN" in remark
    (drawing,) = (each for each in drawings(sim.Run(loads), path) if each.measured)
    assert drawing.kind == plots.default(loads) and drawing.measured.remark == remark


def test_points_at_the_ends_of_a_curve_that_turns_are_on_it_in_spite_of_rounding_and_others_beyond():
    there = np.array([1.0, 2.0, 3.0, 2.0, 1.0])
    curve = Compared(Line(0, {}, "", ""), there, there**2, 0.0 * there, 0.0 * there)
    (values,) = curve.at(
        np.array([1.0 - 1e-12, 2.5, 3.0 + 1e-12, 0.999, 3.001]), curve.mean
    )
    assert_allclose(values, [[1.0, 6.5, 9.0, np.nan, np.nan]] * 2, rtol=1e-11)


def test_rows_without_a_load_are_of_no_one_curve_and_a_table_without_speeds_is_refused_in_figure_and_report(
    loads, table
):
    path = table(
        "speed [mm/s], contact_area [mm^2], contact_area_error [%]\n1, 0.04, 1\n2, 0.05, 1\n"
    )
    area, *_ = (figure := draw(loads, "curve", data=path, absolute=True)).axes
    assert [line.get_color() for line in area.lines if line.get_mfc() == "white"] == [
        pictures.BOTH
    ]
    assert "2 of several curves (no column contact_load)" in " ".join(
        figure.get_supxlabel().split()
    )
    with pytest.raises(
        ValueError, match=r"omitted: 2 of curves .* \(no column contact_load\)"
    ):
        draw(loads, "curve", data=path)  # the area of JKR's contact is not known
    path = table("contact_load [mN], contact_area [mm^2]\n1, 0.04\n4, 0.05\n")
    for show in (
        lambda: draw(loads, data=path),
        lambda: drawings(sim.Run(loads), path),
    ):
        with pytest.raises(ValueError, match='no column "speed"'):
            show()


def test_what_cannot_be_drawn_is_refused_and_given_axes_are_drawn_in(
    ramp, table, loads, tmp_path, monkeypatch
):
    for kind, choices, words in (
        ("time", {"x": "slider_positon"}, "choose t, speed or a recorded variable"),
        (
            "stress",
            {"at": "1 s"},
            "at; it takes: where, member, .* size, xlim, ylim, .*data, ax$",
        ),
        ("theories", {"data": "x.csv"}, "data; it takes: where, member"),
        ("curve", {"units": ("mm",)}, '"mm"'),
        ("curve", {"units": ("parsnip",)}, '"parsnip"'),
    ):
        with pytest.raises(ValueError, match=words):
            draw(ramp, kind, **choices)
    for text, words in [
        ("contact_area [mm^2]\n0.04\n", '"speed".*--x'),
        ("speed [mm/s], contact_aera [mm^2]\n1, 0.04\n", "contact_aera → contact_area"),
        ("speed [mm/s], contact_area [mm^2], contact_load [N]\n1, 0.04, 1\n", "no row"),
    ]:
        with pytest.raises(ValueError, match=words):
            draw(ramp, "curve", data=table(text))
    figure = Figure()
    left, right = figure.subplots(1, 2)
    path = table(f"{HEADER}\n2, 0.04, 2, 9\n")
    before = mpl.rcParams["font.family"]
    assert sim.plot(loads, "curve", ax=right, absolute=True, data=path) is right
    assert (
        mpl.rcParams["font.family"] == before
        and not lines_of(left)
        and len(figure.axes) == 2
    )
    assert (
        right.get_xlabel() == "sliding speed $V$ (mm/s)"
        and right.get_ylabel() == "contact area $A$ (mm²)"
    )
    assert_allclose(
        drawn(right, pictures.LINES[0])[1],
        1e6 * loads["contact_area"].isel(contact_load=0),
        rtol=1e-14,
    )
    with pytest.raises(BadInput, match='"map" has no choice of ax'):
        sim.plot(mapped(), "map", ax=left)
    with pytest.raises(
        BadInput, match="scale: is no choice of a figure; there are: member, at"
    ):
        sim.plot(loads, "curve", scale=2)
    monkeypatch.chdir(tmp_path)
    loads.to_netcdf("x.nc")
    path = table(f"{HEADER}\n2, 0.04, 2, 9\n")
    done = command(
        "plot",
        "x.nc",
        "curve",
        "--where",
        "load=4 mN",
        "--units",
        "mm/s",
        "--absolute",
        "--data",
        path,
    )
    assert done.exit_code == 0, done.stderr
    assert (tmp_path / "x-curve.png").read_bytes()[:4] == b"\x89PNG"
    assert (
        command("plot", "x.nc", "time", "--data", path, "-o", path, "--force").exit_code
        == 2
    )
    assert path.read_text(encoding="utf-8").startswith("speed")
    refused = command("plot", "x.nc", "--at", "1 s", "curve", "--force").stderr
    assert refused.strip().endswith("size, xlim, ylim, x, absolute, data, ax")
    listed = " ".join(command("plot", "--help").stdout.split())
    assert "over speed. --x --absolute --data" in listed
    for name, kind in plots.KINDS.items():
        assert _KINDS[name] == " ".join(
            [kind.shows, *(f"--{choice}" for choice in kind.takes if choice != "ax")]
        )
