"""The page of a run: whole, harmless, and in numbers what the statistics are."""

import contextlib
import io
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import matplotlib as mpl
import netCDF4
import numpy as np
import pytest
from helpers.commands import SCENE, sim
from helpers.pictured import STEADY, drawn, field, mapped, simulated
from scipy import special
from xarray import Dataset

from sim import analysis
from sim.analysis.observables import all_observables, full_area
from sim.ensemble.simulate import run
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.contact import Equilibrium
from sim.parts.shear import models as shear
from sim.plots import kinds
from sim.plots.style import BOTH, STYLE, fill, rows
from sim.report import answers, document, figures, html, sentences
from sim.report.measured import agreement, fit_of
from sim.scenario.clock import Clock, Ensemble, Record
from sim.scenario.reader import load
from sim.spectrum.families import Band
from tests.analysis.test_stick_slip import cycles

REVERSING = drive.Table(time=(0.0, 0.1, 0.1, 0.3, 0.3, 0.4), speed=(2e-3, 2e-3, -2e-3, -2e-3, 2e-3, 2e-3))
UNBROKEN = bonds.Unbroken()
VOID = {"meta", "link", "img", "br", "hr", "input"}


class Page(HTMLParser):
    """What stands in a page: its elements with their attributes, its texts, and the texts of its tables' cells."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.texts = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def words(self, *tags):
        return [text for tag, text in self.texts if tag in tags and text.strip()]


def harmless(page):
    """Whether a page has no script, asks for nothing outside of itself, and every part that it refers to is there."""
    assert not page.open
    assert {tag for tag, _ in page.elements} <= TAGS
    names = [given["id"] for _, given in page.elements if "id" in given]
    assert len(set(names)) == len(names)
    for _, given in page.elements:
        assert not [name for name in given if name.startswith("on")]
        for key in ("src", "href", "xlink:href"):
            assert given.get(key, "#").startswith(("#", "data:image/png;base64,"))
        used = [given["href"]] if given.get("href", "").startswith("#") else []
        used += re.findall(r"url\(([^)]*)\)", " ".join(str(value) for value in given.values()))
        assert {one.lstrip("#") for one in used} <= set(names)
    return page


TAGS = {
    "html", "head", "meta", "title", "style", "body", "main", "header", "h1", "h2", "p", "b", "code", "pre", "div",
    "figure", "figcaption", "table", "thead", "tbody", "tr", "th", "td",
    "svg", "g", "defs", "path", "use", "circle", "clippath", "rect", "image",
}  # fmt: skip


@pytest.fixture(scope="module")
def ramp():
    return simulated()


@pytest.fixture(scope="module")
def page(ramp):
    return harmless(Page(html(ramp)))


@pytest.fixture(scope="module")
def curve(ramp):
    """A figure, and its SVG."""
    figure = kinds.draw(ramp, "curve")
    return figure, figures.svg_of(figure, "x-")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a scenario, its dataset and the log of its run."""
    folder = tmp_path_factory.mktemp("made")
    with contextlib.chdir(folder):
        Path("scene.toml").write_text(f"# Does it stick?\n#\n# Nobody\n# knows.\n\n{SCENE}")
        assert sim("run", "scene.toml", "-o", "x.nc", "--quiet", "--no-table").exit_code == 0
    return folder


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    """A folder to work in, with one dataset."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def bare(monkeypatch):
    """Pages without figures, which take most of the time."""
    monkeypatch.setattr(document, "drawings", lambda *_: [])


@pytest.fixture
def unwritten(monkeypatch):
    """Figures that are drawn, but not written as SVG, which takes most of their time."""
    monkeypatch.setattr(figures, "svg_of", lambda figure, prefix: "<svg></svg>")


# -- the page ---------------------------------------------------------------------------------


def test_a_page_is_whole_in_itself_with_a_caption_to_every_figure(page):
    assert [tag for tag, _ in page.elements].count("svg") == len(page.words("b")) == 1
    assert page.words("h2")[:2] == ["Figures", "Numbers"]


@pytest.mark.usefixtures("bare")
def test_equal_datasets_give_equal_pages(ramp, curve):
    assert html(ramp) == html(ramp)
    assert figures.svg_of(kinds.draw(ramp, "curve"), "x-") == curve[1]


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize(
    "changes",
    [
        {"sweep": {"contact.load": [1e-3, 4e-3]}},
        {"record": Record(per_member=False)},
        {"ensemble": Ensemble(members=1)},
        {"contact": Equilibrium(load=-1.0), "shear": shear.Uniform()},
        {"drive": REVERSING, "shear": shear.Uniform()},
        {"drive": STEADY, "clock": Clock(duration=0.02, step=0.02)},
    ],
    ids=["sweep", "statistics only", "one member", "never closed", "reversing", "two records"],
)
def test_every_shape_of_dataset_has_its_page(changes):
    harmless(Page(html(simulated(**changes))))


def test_maps_are_within_the_page():
    found = harmless(Page(figures.svg_of(kinds.draw(mapped(), "map"), "x-")))
    assert any(given.get("href", "").startswith("data:image/png") for tag, given in found.elements if tag == "image")


def test_numbers_are_those_of_the_statistics(ramp, page):
    cells = page.words("td")
    for row in (*analysis.table(ramp, 24), *analysis.highlights(ramp, 24)):
        assert set(row.values()) <= set(cells)


def test_a_figure_that_cannot_be_drawn_is_left_out_with_the_reason(monkeypatch):
    loads = {"from": 1e-3, "to": 2e-3, "count": 21}
    dataset = simulated(
        drive=STEADY, shear=shear.Uniform(), sweep={"contact.load": loads}, clock=Clock(duration=0.04, step=0.02)
    )
    assert {one.kind: bool(one.svg) for one in figures.drawings(dataset)} == {"sweep": True}  # time changes nothing
    draw = figures.kinds.draw
    monkeypatch.setattr(figures.kinds, "draw", lambda found, kind: draw(found, "map" if kind == "sweep" else kind))
    assert ["no stress maps" in one.lacks for one in figures.drawings(dataset)] == [True]


def test_points_of_curves_lie_on_them_and_carry_their_values(curve):
    figure, picture = curve[0], Page(curve[1])
    titles = [text for tag, text in picture.texts if tag == "title"]
    places = [(float(given["cx"]), float(given["cy"])) for tag, given in picture.elements if tag == "circle"]
    speed, ratio = drawn(figure.axes[0], BOTH)
    wanted = f"sliding speed V = {speed[-1]:.4g} mm/s, contact area A/A_JKR = {ratio[-1]:.4g}"
    (at,) = [place for place, text in zip(places, titles, strict=True) if text.endswith(f"members: {wanted}")]
    paths = [given.get("d", "") for tag, given in picture.elements if tag == "path"]
    drawn_at = np.array([pair for path in paths for pair in re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", path)], float)
    for place in [at, *places[:40]]:
        assert np.min(np.hypot(*(drawn_at - place).T)) < 0.08  # places have one decimal, paths two


def test_a_band_of_many_records_is_drawn_by_few_corners_that_reach_as_far():
    count = 20_000
    with mpl.rc_context(STYLE):
        figure, (panel,) = rows([2.0])
        x, noise = np.linspace(0.0, 1.0, count), 0.1 * np.random.default_rng(5).random((2, count))
        fill(panel, x, noise[0] - 1.0, 1.0 - noise[1], color=BOTH)
    picture = Page(figures.svg_of(figure, "x-"))
    paths = [given["d"] for tag, given in picture.elements if tag == "path" and len(given.get("d", "")) > 2000]
    (corners,) = (np.array(re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", path), float) for path in paths)
    place = panel.transData.transform(np.column_stack([x[[0, -1]], [noise[0].min() - 1.0, 1.0 - noise[1].min()]]))
    ends = [corners.min(axis=0), corners.max(axis=0)]
    wanted = np.array([[place[0, 0], -place[1, 1]], [place[1, 0], -place[0, 1]]])  # from the lower edge down
    assert len(corners) < 0.6 * count  # of twice that
    np.testing.assert_allclose(
        ends, wanted, rtol=0, atol=1 / 9 + 0.01
    )  # matplotlib's share of a pixel, and two decimals


def test_a_figure_is_laid_out_in_the_style_in_which_it_is_saved():
    panels = [rows([1.7, 2.1], shared=False) for _ in range(2)]
    for _, axes in panels:
        for panel in axes:
            panel.set(ylim=(-0.8, 16.3), ylabel="friction")  # ticks 5 or 2.5 apart, as the style has their font
    (figure, _), (saved, _) = panels
    figures.svg_of(figure, "x-")
    saved.savefig(io.BytesIO(), format="svg")
    for one, other in zip(figure.axes, saved.axes, strict=True):
        assert one.get_position().bounds == other.get_position().bounds


def test_ink_and_paper_of_figures_are_those_of_the_page(curve):
    assert "currentColor" in curve[1] and "#000000" not in curve[1] and "#ffffff" not in curve[1]
    assert "#0072b2" in curve[1]


# -- the answer -------------------------------------------------------------------------------


def the_mean(found, name, **at):
    return float(found[f"{name}_mean"].isel(at)), float(found[f"{name}_sem"].isel(at))


def test_a_ramp_says_what_the_area_loses_and_to_what(ramp):
    found = analysis.statistics(ramp).merge(analysis.shares(ramp))
    first, last, bonds, rest = (
        analysis.concise(*(100.0 * number for number in the_mean(found, name, t=at)))
        for name, at in (("area_ratio", 0), ("area_ratio", -1), ("lost_to_bonds", -1), ("lost_to_fluctuations", -1))
    )
    (said, *_) = plainly(answers.answers(ramp))
    assert said.startswith(
        f"The contact area falls from {first} % to {last} % of JKR's, from 10 µm/s to 100 mm/s; of JKR's area there is"
        f" lost to broken bonds {bonds} %, to fluctuations {rest} %, charged in this order."
    )


def plainly(said):
    return [sentence.replace(sentences.TIE, " ") for sentence in said]


def test_steady_speeds_of_a_sweep_are_answered_by_the_second_half_of_their_runs():
    dataset = simulated(drive=STEADY, shear=shear.Uniform(), sweep={"drive.speed": [1e-2, 1e-3, 4e-2]})
    (said, *_) = plainly(answers.answers(dataset))
    ratio = [f"{100 * value:.4g} %" for value in analysis.statistics(dataset)["area_ratio_mean"].isel(t=-1).values]
    # from the first point of the sweep to the last
    assert said.startswith(f"The contact area falls from {ratio[1]} to {ratio[2]} of JKR's, from 1 mm/s to 40 mm/s")


def test_a_contact_that_stays_is_said_to_stay():
    (said, *_) = plainly(answers.answers(simulated(shear=shear.Uniform(), bonds=UNBROKEN)))
    assert said == "The contact area does not change from 10 µm/s to 100 mm/s: it is 100 % of JKR's."


def test_a_loop_a_start_a_sweep_and_a_reversal_have_their_sentences():
    course = {"from": 1e-6, "to": -4e-6, "cycles": 2}
    contact, clock = Equilibrium(indentation=course, after_pull_off="reattach"), Clock(duration=0.4, step=0.002)
    turning = simulated(contact=contact, clock=clock, drive=STEADY, shear=shear.Uniform(), bonds=UNBROKEN)
    lost = float(analysis.events(turning)["loop_dissipation"])
    assert lost > 0.0
    assert plainly(answers.answers(turning))[0] == (
        f"The energy dissipated in a cycle there and back is {analysis.engineering(lost, 'J')}."
    )
    start = simulated(drive=drive.Start(rest=0.1, speed=1e-3), sweep={"contact.load": [1e-3, 4e-3]})
    assert answers.answers(start) == [] or "after the start" in answers.answers(start)[0]
    loads = simulated(drive=STEADY, sweep={"contact.load": [1e-3, 4e-3]})
    found = analysis.summary(analysis.settled(analysis.observables(loads))).isel(t=-1)
    low, high = (
        f"{analysis.concise(*(100.0 * number for number in the_mean(found, 'area_ratio', contact_load=at)))} %"
        for at in (0, 1)
    )
    area, friction, stress = plainly(answers.answers(loads))
    assert area == f"The contact area over JKR's goes from {low} (contact load 1 mN) to {high} (contact load 4 mN)."
    assert friction.startswith("Friction goes from ") and " everywhere in the sweep." in stress
    there = plainly(answers.answers(simulated(drive=REVERSING, shear=shear.Uniform())))
    assert [sentence.partition(" is ")[0] for sentence in there] == [
        "Friction in one direction", "Friction in the other"
    ]  # fmt: skip


def test_the_speeds_of_losses_have_their_intervals():
    loud = field(spectrum=Band(rms=200e3, longest=60e-6, shortest=16e-6))
    dataset = simulated(shear=loud)
    found = analysis.loss_speeds(dataset)
    ends = [float(found[f"speed_at_5_percent_lost{end}"]) for end in ("", "_low", "_high")]
    said = [float(number) for number in re.findall(r"[\d.]+(?= mm/s)", plainly(answers.answers(dataset))[0])]
    np.testing.assert_allclose(said[1:4], 1e3 * np.array(ends), rtol=1e-3)
    (certain,) = (one for one in plainly(answers.answers(simulated(shear=shear.Uniform()))) if "lost 5 %" in one)
    assert "95 %:" not in certain


def test_a_slider_behind_a_spring_is_said_to_stick_and_slip():
    found = analysis.events(cycles())
    said = plainly(answers.answers(cycles()))
    for name, words, unit in (
        ("static_friction", "The force at which a slip or sliding begins", "N"),
        ("recurrence_time", "The time from slip to slip", "s"),
    ):
        assert f"{words} is {analysis.engineering(float(found[name].mean()), unit)}." in said
    assert not [sentence for sentence in said if "contact area" in sentence and "from" in sentence]
    assert f"The number of slips of the slider behind its spring is {int(found['slip_count'].mean())}." in said


def shipped(name, **changes):
    """A scenario of the project with some changes, run."""
    return run(load(Path(__file__).parents[2] / "scenarios" / f"{name}.toml", changes))


def test_creep_says_what_is_borne_and_when_more_gives_way():
    dataset = shipped(
        "creep", clock={"duration": "0.1 s", "step": "2 ms"}, sweep={"drive.force": [4e-3, 8e-3, 16e-3, 24e-3]}
    )
    speed, gone = (dataset[name].isel(t=-1, member=0).to_numpy() for name in ("speed", "runaway_time"))
    shown = [analysis.engineering(number, "m/s") for number in speed[:2]] + [analysis.engineering(gone[2], "s")]
    assert "stress" not in kinds.drawable(dataset)  # over a speed that nothing sets
    away, crept, late = plainly(answers.answers(dataset))
    assert away == "The contact gives way from drive force 16 mN on, and not up to drive force 8 mN."
    assert crept.startswith("Where the force is borne") and crept.endswith(f"to {shown[1]} (drive force 8 mN).")
    assert late.startswith("The time after which the contact gives way goes from")
    assert late.endswith(f"(drive force 24 mN) to {shown[2]} (drive force 16 mN).")


def test_a_force_that_all_bear_is_answered_by_the_second_half_of_the_run():
    borne = shipped("creep", clock={"duration": "0.1 s", "step": "2 ms"}, sweep={"drive.force": [4e-3, 8e-3]})
    slow, fast = borne["speed"].isel(member=0, t=slice(borne.sizes["t"] // 2, None)).mean("t").to_numpy()
    (said,) = plainly(answers.answers(borne))
    shown = analysis.engineering(fast, "m/s")
    factor = 1e3 if shown.endswith(" mm/s") else 1e6
    assert (
        said
        == f"The speed goes from {factor * slow:.4g} {shown[-4:]} (drive force 4 mN) to {shown} (drive force 8 mN)."
    )
    assert [one.kind for one in figures.drawings(borne)] == ["creep", "sweep"]


def test_what_a_jkr_test_reads_is_said_for_both_ways_and_no_pull_off_where_none_comes_off():
    course = {"time": [0.0, 0.2, 0.4], "value": [1e-3, 4e-3, 1e-3]}
    dataset = simulated(contact=Equilibrium(load=course), drive=STEADY, shear=shear.Uniform(), bonds=UNBROKEN)
    work = analysis.engineering(float(dataset["adhesion_work"]), "J/m^2")  # of a contact in equilibrium both ways
    assert [one.partition(", on average while ")[2] for one in plainly(answers.answers(dataset))] == [
        f"loading, is {work}.", f"unloading, is {work}."
    ]  # fmt: skip


def test_a_stroke_there_and_back_has_its_ways_and_work():
    dataset = shipped("friction_loop")
    ways = plainly(answers.answers(dataset))[:3]
    assert ways[0] == "The way of the stage in a stroke is 240 µm."
    one = dataset.isel(member=0)
    turns = [int(np.argmin(abs(one["t"].to_numpy() - time))) for time in (1.2, 1.8)]  # before the stage turns
    for name, unit, said in (("slider_position", "m", ways[1]), ("drive_work", "J", ways[2])):
        gone = abs(float(one[name][turns[1]] - one[name][turns[0]]))
        assert said.endswith(f" is {analysis.engineering(gone, unit)}.")


def test_from_which_value_on_adhesion_is_masked_is_said_of_one_of_all_and_of_some_members():
    def said(shares, members):
        loads = {"contact_load": [4e-3, 1e-3, 2e-3]}
        dataset = Dataset({"contact_modulus": ("contact_load", np.ones(3))}, loads, {"members": members})
        found = [sentences.Found(Dataset(), f"contact load {n} mN") for n in (4, 1, 2)]
        values = [sentences.Mean(share, 0.0, "1") for share in shares]
        return plainly(sentences.from_on(dataset, found, values, "It is masked"))

    assert said([1.0, 0.0, 0.0], 1) == ["It is masked from contact load 4 mN on, and not up to contact load 2 mN."]
    assert said([1.0, 0.0, 0.5], 4) == [
        "It is masked in all members from contact load 4 mN on, and in none up to contact load 1 mN."
    ]
    assert said([0.5, 0.0, 0.0], 4) == [
        "It is masked in no member up to contact load 2 mN,"
        " and in 50 % of all members and records with contact load 4 mN."
    ]
    assert said([0.0, 0.0, 0.0], 1) == said([1.0, 1.0, 1.0], 1) == said([0.0, 1.0, 0.0], 1) == []


def test_the_spread_of_the_area_between_members_has_the_error_of_its_jackknife():
    dataset = simulated(drive=STEADY, ensemble=Ensemble(members=400), clock=Clock(duration=0.04, step=0.02))
    area = analysis.observables(dataset)["area_ratio"].isel(t=-1).to_numpy()
    left_out = np.array([np.std(np.delete(area, k), ddof=1) for k in range(area.size)])
    error = np.sqrt((area.size - 1) * np.var(left_out))
    found = answers._at_the_end(dataset)
    np.testing.assert_allclose(found["area_spread_mean"], np.std(area, ddof=1), rtol=1e-12)
    np.testing.assert_allclose(found["area_spread_sem"], error, rtol=8.0 / area.size)  # of the same first order


def test_a_jump_of_the_speed_and_a_pull_from_rest_have_their_sentences():
    pulled = shipped("incipient_shear", sweep={"contact.load": [4e-3]}, clock={"duration": "60 ms", "step": "1 ms"})
    found = analysis.events(pulled).isel(member=0, contact_load=0)
    said = plainly(answers.answers(pulled))
    assert said[0].endswith(f" is {analysis.engineering(float(found['static_threshold']), 'N')}.")
    assert said[1].endswith(f" is {100.0 * float(found['area_at_threshold']):.4g} %.")
    course = {"time": [0.0, 0.02, 0.02, 0.06], "value": [2e-4, 2e-4, 2e-3, 2e-3]}
    jumped = shipped("velocity_step", **{"drive.stage": course}, clock={"duration": "60 ms", "step": "1 ms"})
    rise = analysis.engineering(analysis.events(jumped)["direct_effect"].item(), "N")
    assert plainly(answers.answers(jumped))[0].endswith(f" is {rise}.")
    # over few speeds transients are no curve: no maximum is marked, and the page leaves the figure out
    faster = jumped.assign(stage_speed=jumped["stage_speed"].where(jumped["t"] < 0.05, 5e-3))  # than at the peak
    assert not [line for line in kinds.draw(faster, "stress").axes[0].lines if line.get_marker() not in ("None", "")]
    assert "stress" not in {one.kind for one in figures.drawings(jumped)}


def test_greys_of_a_map_of_stability_are_an_image_that_a_dark_page_does_not_turn_over():
    dataset = shipped("stability_map", sweep={"drive.stiffness": [50.0, 1600.0]})
    picture = Page(figures.svg_of(kinds.draw(dataset, "stability"), "x-"))
    assert [tag for tag, _ in picture.elements].count("image") == 3  # both ways, and the bar


def test_a_map_of_stability_says_where_slips_follow_each_other_and_behind_which_spring_none_do():
    dataset = shipped("stability_map", sweep={"drive.stiffness": [50.0, 1600.0]})
    begins, ends, never = plainly(answers.answers(dataset))
    soft = analysis.slips(dataset).isel(member=0, drive_stiffness=0)
    along, down = soft["slip_speed"], soft["slip_time"] > 4.0
    assert f" is {analysis.engineering(float(along[0]), 'm/s')} (drive stiffness 50 N/m)." in begins
    assert f" is {analysis.engineering(float(along.where(down).min()), 'm/s')} (drive stiffness 50 N/m)." in ends
    assert never == "Slips never follow each other with drive stiffness 1.6 kN/m."


def test_steady_stages_say_what_the_mean_over_stick_and_slip_loses_and_to_what():
    sweep = {"drive.stage": [1e-3, 1e-2]}
    dataset = shipped("stick_slip", sweep=sweep, clock={"duration": "0.4 s", "step": "2 ms"})
    found = analysis.summary(analysis.settled(all_observables(dataset)), quantiles=False).isel(t=-1)
    area, lost = (100.0 * found[f"{name}_mean"].to_numpy() for name in ("area_ratio", "lost_to_bonds"))
    said = plainly(answers.answers(dataset))
    assert f"from {min(area):.4g} %" in said[0] and f"to {max(area):.4g} %" in said[0]
    assert f"from {min(lost):.4g} %" in said[1] and said[1].startswith("What is lost of JKR's area to broken bonds")
    assert not [one for one in said if "on the ramp" in one or "onset" in one]


def test_where_no_kind_of_scene_fits_nothing_is_claimed(monkeypatch, ramp):
    monkeypatch.setattr(answers, "_ANSWERS", {})
    assert answers.answers(ramp) == []
    monkeypatch.setattr(document, "drawings", lambda *_: [])
    assert "No sentence of this page fits" in " ".join(Page(html(ramp)).words("p"))


# -- measured points, and a fit ---------------------------------------------------------------


def measured_about(dataset, *distances):
    """Points of the area over the speed, so many standard errors of theirs off the curve of a dataset."""
    at = np.linspace(5, dataset.sizes["t"] - 5, len(distances)).astype(int)
    some = dataset.isel(t=at)
    area = some["contact_area"].to_numpy() / float(full_area(some).mean())
    error = np.full(len(distances), 0.01)
    return {"speed": some["speed"].to_numpy().reshape(-1, len(at))[0], "area_ratio": area + error * distances} | {
        "area_ratio_error": error
    }


@pytest.fixture(scope="module")
def smooth():
    """A ramp whose members are alike."""
    return simulated(shear=shear.Uniform())


@pytest.mark.usefixtures("unwritten")
@pytest.mark.parametrize(
    ("distances", "said"),
    [((0.5, -1.0, 1.5, 0.2), "agree within"), ((0.5, -4.0, 1.5, 0.2), "do not agree"), ((0, 0, 0, 1e-3), "nearer")],
)
def test_data_and_run_agree_where_chi_square_is_as_likely_as_their_errors_make_it(smooth, distances, said):
    (drawing,) = figures.drawings(smooth, measured_about(smooth, *distances))
    found = agreement(smooth, [drawing.measured])
    square, (row,) = float(np.sum(np.square(distances))), found.rows
    p = special.gammaincc(2.0, 0.5 * square)  # of four degrees of freedom
    assert (
        said in found.said and f"χ² is {square:.4g} for 4 degrees of freedom, p = {p:.2g}" in plainly([found.said])[0]
    )
    assert row == {"measured": "area ratio", "χ²": f"{square:.4g}", "degrees of\nfreedom": "4", "p": f"{p:.2g}"}
    assert "Rings are measured points with" in drawing.see and "The lowest panel" in drawing.see


@pytest.mark.usefixtures("unwritten")
def test_points_beyond_the_curve_are_counted_and_those_without_errors_not_judged(smooth):
    points = measured_about(smooth, 1.0, 1.0)
    beyond = points | {"speed": points["speed"] * [1.0, 1e3]}
    (drawing,) = figures.drawings(smooth, beyond)
    said = agreement(smooth, [drawing.measured]).said
    assert "χ² is 1 for 1 degrees of freedom" in said and said.endswith("; 1 further values lie beyond the curves.")
    del points["area_ratio_error"]
    (drawing,) = figures.drawings(smooth, points)
    found = agreement(smooth, [drawing.measured])
    assert not found.rows and "cannot be told: they have no errors" in found.said and "Rings" in drawing.see


@pytest.mark.usefixtures("unwritten")
def test_each_curve_of_a_sweep_is_judged_by_its_own_points():
    dataset = simulated(shear=shear.Uniform(), sweep={"contact.load": [1e-3, 4e-3]})
    (one, two) = (measured_about(dataset.isel(contact_load=k), 1.0, 2.0, d) for k, d in ((0, 1.0), (1, 9.0)))
    points = {name: np.concatenate([one[name], two[name]]) for name in one}
    points["contact_load"] = np.repeat([1e-3, 4e-3], 3)
    shown = [drawing.measured for drawing in figures.drawings(dataset, points) if drawing.measured]
    found = agreement(dataset, shown)
    assert [row["measured"] for row in found.rows] == ["area ratio (P = 1 mN)", "area ratio (P = 4 mN)", "all"]
    assert [row["χ²"] for row in found.rows] == ["6", "86", "92"]
    assert found.said.endswith("; farthest from it is area ratio (P = 4 mN).")
    del points["contact_load"]
    drawing, *_ = figures.drawings(dataset, points)
    assert "give the points a column contact_load" in agreement(dataset, [drawing.measured]).said
    assert "The lowest panel" not in drawing.see


@pytest.mark.usefixtures("unwritten")
def test_points_that_the_best_figure_lacks_make_another_and_those_of_none_are_refused(ramp):
    time = {"t": ramp["t"].to_numpy()[[5, 9]], "friction_force": [1e-3, 1e-3]}
    first, second = figures.drawings(ramp, time)
    assert (first.kind, second.kind, second.measured) == ("friction", "curve", None)
    with pytest.raises(ValueError, match="no column"):
        figures.drawings(ramp, {"bond_fraction": [0.5]})


FIT = {
    "data": ["d.csv"], "level": 0.95, "chi_square": 3.0, "degrees_of_freedom": 3, "converged": True, "remarks": ["odd"],
    "numbers": {"bonds.critical_speed": {
        "value": 2e-2, "unit": "m/s", "standard_error": 2e-4, "low": 19.6e-3, "high": None, "low_open": False,
        "high_open": True, "start": 3e-2}},
    "correlations": {"keys": ["bonds.critical_speed"], "matrix": [[1.0]]},
}  # fmt: skip


def fit(path, **changes):
    path.write_text(json.dumps(FIT | changes))
    return path


@pytest.mark.usefixtures("unwritten")
def test_a_fit_stands_beside_the_run_and_costs_a_degree_of_freedom_where_it_is_of_these_points(smooth, tmp_path):
    found = fit_of(fit(tmp_path / "m_fit.json"), smooth)
    (row,) = found.rows
    own = float(smooth["bonds_critical_speed"])
    assert found.said == f"The fit gives bonds.critical_speed = 20.0(2){sentences.TIE}mm/s."
    assert list(row.values()) == [
        "bonds.critical_speed", "20.0(2) mm/s", "19.6 to unknown", "30 mm/s", analysis.engineering(own, "m/s")
    ]  # fmt: skip
    assert "this run has other numbers" in found.notes[1] and found.notes[-1] == "odd" and not found.here
    (drawing,) = figures.drawings(smooth, measured_about(smooth, 1.0, 1.0, 1.0, 0.0))
    same = fit_of(
        fit(
            tmp_path / "m_fit.json",
            numbers={"bonds.critical_speed": FIT["numbers"]["bonds.critical_speed"] | {"value": own}},
        ),
        smooth,
    )
    for fitted, count, freedom in ((found, 1, 4), (same, 2, 3), (same._replace(freedom=9), 1, 4)):
        judged = agreement(smooth, [drawing.measured], fitted)
        assert len(judged.rows) == count and f"χ² is 3 for {freedom} degrees" in judged.said


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize(
    "text", ["", "{}", "[1]", '{"numbers": {}}', "[" * 10**5, "\xff", json.dumps(FIT | {"numbers": {"a": 1}}),
             json.dumps(FIT | {"chi_square": None}), json.dumps(FIT | {"correlations": {"keys": ["a"], "matrix": []}})],
)  # fmt: skip
def test_what_is_no_result_of_a_fit_is_refused_in_one_line(here, text):
    Path("m_fit.json").write_bytes(text.encode("latin-1"))
    done = sim("report", "x.nc", "--fit", "m_fit.json")
    assert (done.exit_code, len(done.stderr.splitlines())) == (2, 1) and "no result of `sim fit`" in done.stderr
    assert not Path("x.html").exists()


def test_of_a_large_file_only_as_much_is_held_in_memory_as_there_is_room_for(here, monkeypatch):
    with analysis.scene.open("x.nc") as dataset:
        size = dataset["contact_radius"].nbytes
        small = sum(one.nbytes for one in dataset.data_vars.values() if one.nbytes < size)
        monkeypatch.setattr(document, "_WHOLE", small + 2 * size)
        held = document._held(dataset)
        large = [str(name) for name, one in held.data_vars.items() if one.nbytes == size]
        inside = [name for name in large if isinstance(held[name].variable._data, np.ndarray)]
    assert len(inside) == 2 and {*inside} <= {*document._OFTEN} and len(large) > 5


# -- errors, cost, question, repetition -------------------------------------------------------


def test_errors_known_beforehand_stand_beside_those_measured():
    dataset = simulated(drive=STEADY, ensemble=Ensemble(members=400), clock=Clock(duration=0.04, step=0.02))
    rows = {row.words: row for row in document.known(dataset)}
    row = rows["spread of ΔΓ between members, over its mean"]
    energy = dataset["fluctuation_energy"].isel(t=-1).to_numpy()
    left_out = [np.delete(energy, k) for k in range(energy.size)]
    each = np.array([np.std(some, ddof=1) / np.mean(some) for some in left_out])
    error = np.sqrt((energy.size - 1) * np.var(each))
    spread = np.std(energy, ddof=1) / np.mean(energy)
    assert row.measured == f"{analysis.concise(100 * spread, 100 * error)} %"
    assert abs(spread - float(dataset["member_spread_energy"])) < 5.0 * error
    assert row.before == f"{100 * float(dataset['member_spread_energy']):.3g} %"


def test_the_question_is_the_first_paragraph_of_the_scenarios_comment_else_its_name(ramp):
    text = "# Why\n# so?\n#\n# Because\n# of that.\n#\n# Really.\nname = 'x'\n# no more\n"
    asked = document.question(ramp.assign_attrs(scenario_toml=text, title="x"))
    assert asked == ("x", "Why so?", ["Because of that.", "Really."])
    assert document.question(ramp.assign_attrs(scenario_toml="", title="x")) == ("x", "x", [])


@pytest.mark.usefixtures("bare")
def test_the_page_of_a_file_has_its_scenario_cost_and_the_commands_that_repeat_it(here):
    override = ["--set", 'contact.load="2 mN"', "--seed", "7"]
    assert sim("run", "scene.toml", *override, "-o", "y.nc", "--quiet", "--no-table").exit_code == 0
    done = sim("report", "y.nc")
    assert (done.exit_code, done.stdout) == (0, "y.html\n")
    found = harmless(Page(Path("y.html").read_text(encoding="utf-8")))
    assert found.words("h1") == ["Does it stick?"] and "Nobody knows." in found.words("p")
    assert found.words("pre")[0] == Path("scene.toml").read_text()
    assert "What it cost" in found.words("h2") and {"in all", "of it simulating"} <= set(found.words("th"))
    command = found.words("pre")[-1].splitlines()[0]
    assert command == "sim run y.toml -o y.nc --set 'contact.load=\"2 mN\"' --set seed=7"
    Path("y.toml").write_text(found.words("pre")[0])
    arguments = ["-o", "z.nc", "--set", 'contact.load="2 mN"', "--set", "seed=7", "--quiet", "--no-table"]
    assert sim("run", "y.toml", *arguments).exit_code == 0
    assert Path("z.nc").read_bytes() == Path("y.nc").read_bytes()


# -- hostile files and bad input --------------------------------------------------------------

MARKUP = "</pre></style><script>alert(1)</script><img src=x onerror=alert(1)>{{ 7 * 7 }}\"'&lt;"


def test_markup_in_a_file_is_shown_and_does_nothing(here):
    with netCDF4.Dataset("x.nc", "a") as file:
        file.title = MARKUP
        file.scenario_toml = f"# {MARKUP}\n#\n# {MARKUP}\n\x1b]0;x\x07\u202e\nname = '{MARKUP}'\n"
        file.scenario_overrides = f'{{"{MARKUP[:30]}": "{MARKUP[:30]}"}}'
        file.scenario_files = f'{{"{MARKUP[:30]}": 1}}'
        file.history = file.source = file.references = MARKUP
        for name, variable in file.variables.items():
            variable.long_name = MARKUP
            if name != "t":
                variable.symbol = "<b>"
    Path("x.nc.log").write_text(f'{{"began": "{MARKUP[:40]}", "seconds": 1, "stages": {{"<b>": 2}}}}\n')
    assert sim("report", "x.nc", "--force").exit_code == 0
    text = Path("x.html").read_text(encoding="utf-8")
    found = harmless(Page(text))
    assert found.words("h1") == [MARKUP] and found.words("title")[0] == MARKUP
    assert [words for words in found.words("pre") if MARKUP in words and r"\x1b]0;x\x07\u202e" in words]
    assert "49" not in found.words("h1")[0] and "\x1b" not in text
    assert [given for tag, given in found.elements if tag == "style"] == [{}]


def test_markup_in_measured_data_and_a_fit_is_shown_and_does_nothing(here):
    name = "<img src=x onerror=alert(1)>\x1b[31m\u202e{{ 7 * 7 }}.csv"
    Path(name).write_text("speed [mm/s], area_ratio, area_ratio_error\n1, 0.9, 0.1\n9, 0.8, 0.1\n")
    key = MARKUP[:60]
    numbers = {key: FIT["numbers"]["bonds.critical_speed"]}
    told = fit(Path("m_fit.json"), numbers=numbers, data=[MARKUP], remarks=[MARKUP],
               correlations={"keys": [key, "<b>"], "matrix": [[1.0, 0.5], [0.5, 1.0]]})  # fmt: skip
    assert sim("report", "x.nc", "--data", name, "--fit", told).exit_code == 0
    text = Path("x.html").read_text(encoding="utf-8")
    found = harmless(Page(text))
    assert (
        "\x1b" not in text
        and "\u202e" not in text
        and any(r"onerror=alert(1)>\x1b[31m" in one for one in found.words("p"))
    )
    assert {key, "<b>"} <= set(found.words("th")) and MARKUP in found.words("p") and "49" not in found.words("p")


@pytest.mark.parametrize(
    "header",
    ["speed [mm/s], <script>alert(1)</script>", f"speed [mm/s], {'x' * 10**6}", "speed [mm/s], area_ratio [<b>]",
     "speed [mm/s], area\x1b[31m_ratio", "speed [mm/s], $\\frac{1}{0}$"],
    ids=["markup", "long", "unit", "control", "mathematics"],
)  # fmt: skip
def test_hostile_headings_of_measured_data_are_refused_in_one_short_line(here, header):
    Path("d.csv").write_text(f"{header}\n1, 0.9\n")
    done = sim("report", "x.nc", "--data", "d.csv")
    assert (done.exit_code, len(done.stderr.splitlines())) == (2, 1) and len(done.stderr) < 400
    assert done.stderr.startswith("d.csv: ") and "\x1b" not in done.stderr and not Path("x.html").exists()


@pytest.mark.parametrize(
    "log", ["", "no JSON\n", '{"seconds": "x"}\n', "[1]\n", '{"began": 1, "seconds": 1}\n', "\xff\n"]
)
def test_a_log_that_is_none_costs_only_its_table(here, log):
    Path("x.nc.log").write_bytes(log.encode("latin-1"))
    assert document.cost(Path("x.nc.log")) == {}


@pytest.mark.usefixtures("bare")
def test_a_page_that_is_there_is_replaced_only_if_asked(here):
    Path("x.html").write_text("mine")
    done = sim("report", "x.nc")
    assert done.exit_code == 73 and "x.html exists" in done.stderr and Path("x.html").read_text() == "mine"
    assert sim("report", "x.nc", "-o", "x.nc", "--force").exit_code == 2
    assert sim("report", "x.nc", "-o", "none/of/it/x.html").exit_code == 0
    assert sim("report", "x.nc", "--force").exit_code == 0 and "<h1>" in Path("x.html").read_text()


@pytest.mark.usefixtures("bare")
def test_what_is_no_dataset_is_refused_in_one_line_and_nothing_written(here):
    content = Path("x.nc").read_bytes()
    Path("short.nc").write_bytes(content[: len(content) // 2])
    with netCDF4.Dataset("other.nc", "w") as file:
        file.title = "another program's"
    before = sorted(path.name for path in here.iterdir())
    for name in ("short.nc", "other.nc", "scene.toml", "missing.nc"):
        done = sim("report", name)
        assert (done.exit_code, done.stdout, len(done.stderr.splitlines())) == (2, "", 1), name
        assert name in done.stderr
    assert sorted(path.name for path in here.iterdir()) == before


# -- as a browser shows it, and how large it is -----------------------------------------------

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.mark.verify
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
@pytest.mark.parametrize("width", [390, 1000])
def test_a_browser_shows_the_page_without_complaint(here, width):
    assert sim("report", "x.nc").exit_code == 0
    options = ["--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={here}/browser"]
    options += ["--enable-logging=stderr", "--v=0", f"--window-size={width},3000", "--screenshot=x.png"]
    done = subprocess.run([BROWSER, *options, f"file://{here}/x.html"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "CONSOLE" not in done.stderr
    shown = figure_of(Path("x.png"))
    assert shown.shape[:2] == (3000, width)
    ink = np.any(shown[..., :3] < 128, axis=-1)
    assert ink[:300].any() and ink[1000:].any() and not ink[:, -8:].any()  # text and figures, nothing cut at the edge


def figure_of(path):
    """Pixels of a picture, from 0 to 255."""
    from matplotlib.image import imread

    return np.round(255.0 * imread(path))


@pytest.mark.verify
def test_a_page_of_a_thousand_members_at_five_loads_is_below_5_mb(here):
    sweep = 'sweep={"contact.load" = {from = "1 mN", to = "16 mN", count = 5}}'
    assert sim("run", "scene.toml", "--members", 1000, "--set", sweep, "-o", "large.nc", "--quiet").exit_code == 0
    assert sim("report", "large.nc").exit_code == 0
    assert Path("large.html").stat().st_size < 5e6
