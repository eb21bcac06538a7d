"""The page of a run is complete and harmless, and its numbers are those of the statistics."""

import contextlib
import html as markup
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from helpers.commands import SCENE, sim
from helpers.parts import Clock, Ensemble, Equilibrium, Record, load, read, run, shear
from helpers.pictured import STEADY, mapped, simulated
from helpers.printed import rows_of
from helpers.statements import statistics

from sim.plots import kinds
from sim.read.observables import full_area
from sim.reports import html, report

VOID = {"meta", "link", "img", "br", "hr", "input"}
TAGS = {
    "html",
    "head",
    "meta",
    "title",
    "style",
    "body",
    "main",
    "header",
    "h1",
    "h2",
    "p",
    "b",
    "code",
    "pre",
    "div",
    "figure",
    "figcaption",
    "table",
    "thead",
    "tbody",
    "tr",
    "th",
    "td",
    "svg",
    "g",
    "defs",
    "path",
    "use",
    "clippath",
    "rect",
    "image",
    "ul",
    "li",
    "details",
    "summary",
}


class Page(HTMLParser):
    """The elements of a page with their attributes, and its texts with the element that contains each."""

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
    """Assert that a page has no script, requests nothing from outside, and contains every part that it refers to."""
    assert not page.open and {tag for tag, _ in page.elements} <= TAGS
    names = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(set(names)) == len(names)
    for _, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")]
        for key in ("src", "href", "xlink:href"):
            assert attributes.get(key, "#").startswith(("#", "data:image/png;base64,"))
        used = (
            [attributes["href"]] if attributes.get("href", "").startswith("#") else []
        )
        used += re.findall(
            r"url\(([^)]*)\)", " ".join(str(value) for value in attributes.values())
        )
        assert {name.lstrip("#") for name in used} <= set(names)
    return page


@pytest.fixture(scope="module")
def ramp():
    return simulated()


@pytest.fixture(scope="module")
def smooth():
    """A ramp whose members are alike."""
    return simulated(shear=shear.Uniform())


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A folder with a scenario, its dataset and the log of its run."""
    folder = tmp_path_factory.mktemp("run")
    with contextlib.chdir(folder):
        Path("scene.toml").write_text(
            f"# Does it stick?\n#\n# Nobody\n# knows.\n\n{SCENE}", encoding="utf-8"
        )
        assert (
            sim("run", "scene.toml", "-o", "x.nc", "--quiet", "--no-table").exit_code
            == 0
        )
    return folder


@pytest.fixture
def here(run_folder, tmp_path, monkeypatch):
    """A working folder with one dataset."""
    shutil.copytree(run_folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def bare(monkeypatch):
    """Pages without figures, which take most of the time."""
    monkeypatch.setattr(report, "drawings", lambda *_: [])


@pytest.fixture
def unwritten(monkeypatch):
    """Figures that are drawn but not written as SVG, which takes most of their time."""
    monkeypatch.setattr(report, "svg_of", lambda figure, prefix, name: "<svg></svg>")


def shipped(name, **changes):
    """Run a scenario of the project with some changes."""
    return run(load(Path(__file__).parents[2] / "scenarios" / f"{name}.toml", changes))


@pytest.mark.usefixtures("bare")
def test_every_shape_of_dataset_has_its_page():
    for changes in [
        {"sweep": {"contact.load": [1e-3, 4e-3]}, "record": Record(per_member=False)},
        {
            "contact": Equilibrium(load=-1.0),
            "shear": shear.Uniform(),
            "ensemble": Ensemble(members=1),
        },
        {"drive": STEADY, "clock": Clock(duration=0.02, step=0.02)},
    ]:
        harmless(Page(html(simulated(**changes))))
    text = html(
        simulated(
            sweep={"adhesion.bond_share": [0.0, 1.0], "contact.load": [1e-3, 4e-3]}
        )
    )
    heads = re.findall("<thead>(.*?)</thead>", text, re.DOTALL)
    assert len(heads) > 1 and all(
        "bond_share" in head and "load (mN)" in head for head in heads
    )


@pytest.mark.usefixtures("unwritten")
def test_the_first_figure_fits_a_run_best_and_others_show_more_of_it():
    crept = shipped(
        "creep",
        clock={"duration": "0.1 s", "step": "2 ms"},
        sweep={"drive.force": [4e-3, 8e-3]},
    )
    loads = {"contact.load": {"from": 1e-3, "to": 2e-3, "count": 21}}
    steady = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        sweep=loads,
        clock=Clock(duration=0.04, step=0.02),
    )
    up_and_down = {
        "model": "table",
        "time": [0.0, 0.01, 0.02],
        "speed": [1e-4, 2e-2, 1e-4],
    }
    both_ways = shipped(
        "uniform_stress",
        drive=up_and_down,
        sweep={},
        clock={"duration": 0.02, "step": 1e-3},
    )
    for dataset, shown, left_out in (
        (both_ways, ["friction"], {"sweep"}),
        (crept, ["creep"], {"sweep", "time", "curve"}),
        (steady, ["sweep"], {"time"}),  # nothing changes in time
    ):
        kinds_shown = [each.kind for each in report.drawings(read.Run(dataset))]
        assert kinds_shown[: len(shown)] == shown
        assert not left_out & {*kinds_shown}


@pytest.mark.usefixtures("unwritten")
def test_the_stress_over_the_speed_is_a_further_figure_only_if_it_has_a_maximum():
    # the stress of exponential bonds saturates, that of bonds with a rupture law falls again
    for scene, has_peak in (("pdms_lens", False), ("friction_maximum", True)):
        read_run = read.Run(shipped(scene, ensemble={"members": 2}, sweep={}))
        has_value = not bool(read_run.events["peak_stress"].is_missing.all())
        shown = [each.kind for each in report.drawings(read_run)]
        assert ("stress" in shown, has_value) == (has_peak, has_peak)


@pytest.mark.usefixtures("unwritten")
def test_no_words_of_a_library_reach_a_page(monkeypatch, smooth):
    def refuse(dataset, kind, *choices):
        if kind == best:
            return
        raise ValueError("operands could not be broadcast together")

    best = kinds.default(smooth)
    monkeypatch.setattr(kinds, "draw", refuse)
    monkeypatch.setattr(kinds, "drawable", lambda dataset: [best, "map"])
    text = html(smooth, "x.nc")
    assert "broadcast" not in text
    assert "<code>sim plot x.nc map</code> prints the reason" in text
    # a map of which the dataset has the digest alone
    document = json.loads(smooth.attrs["scenario_resolved"])
    document["shear"] = {"model": "mapped", "field": {"values": 3}}
    lacking = smooth.assign_attrs(scenario_resolved=json.dumps(document))
    (remark,) = report.remarks(lacking)
    assert "does not hold the whole scenario" in remark and "nput" not in remark


def test_figures_are_in_the_pages_colours(ramp):
    dataset = shipped("stability_map", sweep={"drive.stiffness": [50.0, 1600.0]})
    for figure, count in (
        (kinds.draw(mapped(), "map"), 2),
        (kinds.draw(dataset, "stability"), 3),
    ):
        images = [
            given
            for tag, given in harmless(
                Page(report.svg_of(figure, "x-", "a <name>"))
            ).elements
            if tag == "image"
        ]
        # bars are images, too
        assert (
            sum(image["href"].startswith("data:image/png") for image in images) >= count
        )
    text = report.svg_of(kinds.draw(ramp, "curve"), "x-", "")
    assert (
        "currentColor" in text
        and "#0072b2" in text
        and "#000000" not in text
        and "#ffffff" not in text
    )


def measured_about(dataset, *distances):
    """Points of the area over the speed at these distances from the curve of a dataset, in standard errors."""
    at = np.linspace(5, dataset.sizes["t"] - 5, len(distances)).astype(int)
    records = dataset.isel(t=at)
    area = records["contact_area"].to_numpy() / float(full_area(records).mean())
    error = np.full(len(distances), 0.01)
    points = {
        "speed": records["speed"].to_numpy().reshape(-1, len(at))[0],
        "area_ratio": area + error * distances,
    }
    return points | {"area_ratio_error": error}


def test_measured_points_are_in_the_figure_that_has_their_axis_with_their_distances_from_its_curve(
    smooth, ramp
):
    distances = (0.5, -4.0, 1.5, 0.2)
    drawing, *_ = report.drawings(read.Run(smooth), measured_about(smooth, *distances))
    np.testing.assert_allclose(
        drawing.measured.residuals[0].values, distances, rtol=1e-6
    )
    time = {"t": ramp["t"].to_numpy()[[5, 9]], "friction_force": [1e-3, 1e-3]}
    first, second, *_ = report.drawings(read.Run(ramp), time)
    assert (first.kind, second.kind, second.measured) == ("time", "curve", None)
    with pytest.raises(ValueError, match="no column"):
        report.drawings(read.Run(ramp), {"bond_fraction": [0.5]})


@pytest.mark.usefixtures("unwritten")
def test_hostile_headings_are_refused_in_one_line(here):
    columns = (
        "<script>alert(1)</script>",
        "x" * 10**6,
        "area_ratio [<b>]",
        "area\x1b[31m_ratio",
        "$\\frac{1}{0}$",
    )
    for column in columns:
        Path("file").write_bytes(f"speed [mm/s], {column}\n1, 0.9\n".encode("latin-1"))
        result = sim("report", "x.nc", "--data", "file")
        assert (result.exit_code, len(result.stderr.splitlines())) == (2, 1) and len(
            result.stderr
        ) < 400
        assert "file" in result.stderr and "\x1b" not in result.stderr
    assert not Path("x.html").exists()


def order_of(text, *parts):
    """The places of parts of a page, each of which is there once."""
    assert [text.count(part) for part in parts] == [1] * len(parts)
    return [text.index(part) for part in parts]


def test_a_page_has_question_answer_figure_table_and_limits_in_this_order_and_folds_the_rest(
    ramp,
):
    asked = "#:schema ./sim.schema.json\n# Does it\n# shrink?\n#\n# A first guess.\n"
    ramp = ramp.assign_attrs(scenario_toml=f"{asked}name = 'x'\n", title="x")
    text = html(ramp)
    page = harmless(Page(text))
    assert page.words("h1") == ["Does it shrink?"]
    opening = markup.unescape(text[text.index("<body>") :])
    folded = opening.index("<details>")
    sentences = report.answer(read.Run(ramp))
    assert 1 <= len(sentences) <= 3
    parts = ["<h1>", sentences[0], "<h2>Numbers", "<h2>Limits"]
    places = order_of(opening, *parts)
    figure = opening.index("<svg ")
    assert [*places[:2], figure, *places[2:], folded] == sorted(
        [*places, figure, folded]
    )
    assert "A first guess" not in opening[:folded] and "A first guess" in opening
    assert "<details open" not in text
    titles = page.words("summary")
    assert titles[0] == "All tables" and titles[-1].startswith("Provenance")


def test_a_page_has_the_numbers_of_the_statistics_and_error_estimates(ramp):
    page = harmless(Page(html(ramp)))
    figures = read.tables.key_figures(read.Run(ramp))
    assert len(figures) > 3 and {"5 % lost at V", "half masked"} <= {
        row[""] for row in figures
    }
    for row in (*rows_of(ramp, rows=24, show=["all"]), *figures):
        assert set(row.values()) <= set(page.words("td"))
    document = json.loads(ramp.attrs["scenario_resolved"]) | {"<b>small</b>": 1}
    remarked = ramp.assign_attrs(scenario_resolved=json.dumps(document))
    assert "<b>small" not in html(remarked)
    assert set(report.remarks(ramp)) < set(page.words("p"))
    assert html(ramp) == html(ramp)
    # of all records, of which 24 are looked at
    error = float(statistics(ramp)["area_ratio"].sem.max())
    *_, words = report.errors(ramp)
    size = 0.01 * float(words.removesuffix(" %").rpartition(" ")[2])
    assert 0.5 * error < size <= error * 1.005 and words in page.words("li")


def test_figures_have_names_and_all_that_scrolls_is_reached_by_keyboard(ramp):
    page = Page(html(ramp))
    pictures = [given for tag, given in page.elements if tag == "svg"]
    assert len(page.words("title")) == 1 + len(pictures) > 1
    assert all(given["role"] == "img" and given["aria-label"] for given in pictures)
    scrolled = [
        given for _, given in page.elements if "wide" in given.get("class", "").split()
    ]
    assert len(scrolled) > 3
    for given in scrolled:
        assert (given["tabindex"], given["role"]) == ("0", "region")
        assert given["aria-label"]
    assert len(page.words("summary")) > 3


PULLED = {
    "shear": shear.Uniform(),
    "ensemble": Ensemble(members=1),
    "drive": STEADY,
    "clock": Clock(duration=1.0, step=0.01),
}


def test_a_caption_of_a_course_names_no_line_that_is_not_drawn():
    """Without the radii of JKR and Hertz the figure has neither of them."""
    dataset = simulated(record=Record(quantities=("work_of_adhesion",)))
    (course,) = (
        each for each in report.drawings(read.Run(dataset)) if each.kind == "time"
    )
    assert "Hertz" not in course.svg
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", report.html(dataset))
    assert captions and not [words for words in captions if "Hertz" in words]


@pytest.mark.parametrize("lowest", [-0.5e-3, -0.1e-3])
def test_an_answer_names_a_pull_off_only_if_the_contact_opened(lowest):
    course = {"time": [0.0, 1.0], "value": [4e-3, lowest]}
    dataset = simulated(contact=Equilibrium(load=course), **PULLED)
    sentences = report.answer(read.Run(dataset))
    (load,) = (words for words in sentences if "pull-off" in words)
    work = float(dataset["work_of_adhesion"].isel(t=0))  # bonds break at this speed
    by_jkr = 1.5 * np.pi * work * float(dataset["sphere_radius"])
    if lowest < -by_jkr:
        assert (
            load == f"The normal load at the first pull-off is {-1e6 * by_jkr:.4g} µN."
        )
    else:
        assert load.startswith("There is no ") and "does not open" in load


def test_an_answer_names_the_ends_of_a_sweep_and_is_silent_about_zeros():
    dataset = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        ensemble=Ensemble(members=1),
        clock=Clock(duration=0.04, step=0.02),
        sweep={"contact.load": [1e-3, 2e-3, 4e-3]},
    )
    late = read.Run(dataset).late(["area_ratio"])["area_ratio"].value.to_numpy()
    area, *others = report.answer(read.Run(dataset))
    assert f"{100 * late[0]:.4g} % at contact_load = 1 mN" in area
    assert f"{100 * late[-1]:.4g} % at contact_load = 4 mN" in area
    assert not [words for words in others if "masked" in words or "without" in words]


def test_a_page_after_a_fit_has_its_lines_and_another_page_has_none(smooth):
    lines = ["Made by sim fit: bonds.stress is calibrated.", "chi^2 12.1, p = 0.43"]
    asked = "# Does it shrink?\n"
    fitted = asked + "".join(f"# {line}\n" for line in lines) + "name = 'x'\n"
    for text, expected in ((fitted, lines), (asked, [])):
        dataset = smooth.assign_attrs(scenario_toml=text)
        _, question, fit = report.headed(dataset)
        assert (question, fit) == ("Does it shrink?", expected)
        page = Page(html(dataset))
        assert ("The fit" in page.words("h2")) is bool(expected)
        assert set(expected) <= set(page.words("li"))
    assert report.headed(smooth.assign_attrs(scenario_toml="", title="x"))[1] == "x"


def test_tables_key_figures_and_figures_of_a_page_have_the_chosen_units(here):
    assert sim("report", "x.nc", "--units", "m/s", "--units", "nm").exit_code == 0
    page = Page(Path("x.html").read_text(encoding="utf-8"))
    assert {"V (m/s)", "a (nm)"} <= set(page.words("th"))
    assert not [text for text in page.words("td") if text.endswith(("mm/s", "µm"))]
    refused = sim("report", "x.nc", "--units", "K", "--force")
    assert refused.exit_code == 2 and "--units" in refused.stderr


MARKUP = "</pre></style><script>alert(1)</script><img src=x onerror=alert(1)>{{ 7 * 7 }}\"'&lt;"


def test_markup_in_a_file_and_in_measured_data_is_shown_and_does_nothing(here):
    with netCDF4.Dataset("x.nc", "a") as file:
        file.title = MARKUP
        file.scenario_toml = (
            f"# {MARKUP}\n#\n# {MARKUP}\n\x1b]0;x\x07\u202e\nname = '{MARKUP}'\n"
        )
        file.scenario_overrides = f'{{"{MARKUP[:30]}": "{MARKUP[:30]}"}}'
        file.scenario_files = f'{{"{MARKUP[:30]}": 1}}'
        file.history = file.source = file.references = MARKUP
        for name, variable in file.variables.items():
            variable.long_name = MARKUP
            if name != "t":
                variable.symbol = "<b>"
    table = "d\u202e{{ 7 + 42 }}.csv"
    Path(table).write_text(
        "speed [mm/s], area_ratio, area_ratio_error\n1, 0.9, 0.1\n9, 0.8, 0.1\n",
        encoding="utf-8",
    )
    assert sim("report", "x.nc", "--data", table).exit_code == 0
    text = Path("x.html").read_text(encoding="utf-8")
    page = harmless(Page(text))
    assert page.words("h1") == [MARKUP] and page.words("title")[0] == MARKUP
    assert [
        words
        for words in page.words("pre")
        if MARKUP in words and r"\x1b]0;x\x07\u202e" in words
    ]
    assert "\x1b" not in text and "\u202e" not in text
    assert [attributes for tag, attributes in page.elements if tag == "style"] == [{}]
    assert any(r"d\u202e{{ 7 + 42 }}" in paragraph for paragraph in page.words("p"))
    assert "49" not in page.words("p")


@pytest.mark.usefixtures("bare")
def test_the_page_of_a_file_is_replaced_only_if_asked_and_has_the_commands_that_repeat_it(
    here,
):
    override = ["--set", 'contact.load="2 mN"', "--seed", "7"]
    assert (
        sim(
            "run", "scene.toml", *override, "-o", "y.nc", "--quiet", "--no-table"
        ).exit_code
        == 0
    )
    result = sim("report", "y.nc")
    assert (result.exit_code, result.stdout) == (0, "y.html\n")
    page = harmless(Page(Path("y.html").read_text(encoding="utf-8")))
    assert page.words("h1") == ["Does it stick?"]
    *_, changed, text, _ = page.words("pre")
    assert text == Path("scene.toml").read_text(encoding="utf-8")
    assert changed.split("\n")[:2] == ['contact.load = "2 mN"', "seed = 7"]
    command = page.words("pre")[-1].splitlines()[0]
    assert (
        command == "sim run y.toml -o y.nc --set 'contact.load=\"2 mN\"' --set seed=7"
    )
    Path("y.toml").write_text(text, encoding="utf-8")
    arguments = [
        "-o",
        "z.nc",
        "--set",
        'contact.load="2 mN"',
        "--set",
        "seed=7",
        "--quiet",
        "--no-table",
    ]
    assert sim("run", "y.toml", *arguments).exit_code == 0
    with read.dataset.open("y.nc") as first, read.dataset.open("z.nc") as again:
        assert first.equals(again)
    Path("x.html").write_text("mine", encoding="utf-8")
    for arguments, code in (
        ((), 73),
        (("-o", "x.nc", "--force"), 2),
        (("-o", "none/of/it/x.html"), 0),
    ):
        assert sim("report", "x.nc", *arguments).exit_code == code
        assert Path("x.html").read_text(encoding="utf-8") == "mine"
    assert sim("report", "x.nc", "--force").exit_code == 0 and "<h1>" in Path(
        "x.html"
    ).read_text(encoding="utf-8")


BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)


@pytest.mark.verify
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
@pytest.mark.parametrize("width", [390, 1000])
def test_a_browser_shows_the_page_without_complaint(here, width):
    from matplotlib.image import imread

    assert sim("report", "x.nc").exit_code == 0
    options = [
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={here}/browser",
    ]
    options += [
        "--enable-logging=stderr",
        "--v=0",
        f"--window-size={width},3000",
        "--screenshot=x.png",
    ]
    done = subprocess.run(
        [BROWSER, *options, f"file://{here}/x.html"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0 and "CONSOLE" not in done.stderr
    shown = np.round(255.0 * imread("x.png"))
    assert shown.shape[:2] == (3000, width)
    ink = np.any(shown[..., :3] < 128, axis=-1)
    # text and figures, nothing cut at the edge
    assert ink[:300].any() and ink[1000:].any() and not ink[:, -8:].any()


@pytest.mark.verify
def test_a_page_of_a_thousand_members_at_five_loads_is_below_5_mb(here):
    sweep = 'sweep={"contact.load" = {from = "1 mN", to = "16 mN", count = 5}}'
    assert (
        sim(
            "run",
            "scene.toml",
            "--members",
            1000,
            "--set",
            sweep,
            "-o",
            "large.nc",
            "--quiet",
        ).exit_code
        == 0
    )
    assert (
        sim("report", "large.nc").exit_code == 0
        and Path("large.html").stat().st_size < 5e6
    )
