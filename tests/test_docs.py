"""The documentation keeps up with the code."""

import contextlib
import doctest
import functools
import importlib.util
import io
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import mpmath
import numpy as np
import pytest
from docutils.utils.math.latex2mathml import tex2mathml
from helpers.commands import sim as command_line
from markdown_it import MarkdownIt
from numpy.testing import assert_allclose
from PIL import Image

import sim
from sim import read
from sim.cli import _values, cli
from sim.laws import halfspace, schallamach
from sim.plots.kinds import KINDS
from sim.quantities import QUANTITIES
from sim.scenario.reader import load

ROOT = Path(__file__).parent.parent
PAGES = sorted(
    str(path.relative_to(ROOT))
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
)


def maker_of(page):
    """The script that makes a page."""
    spec = importlib.util.spec_from_file_location(
        f"make_{page}", ROOT / "docs" / f"make_{page}.py"
    )
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    return maker


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def test_pages_made_from_the_code_are_up_to_date():
    for page in ("keys", "dataset"):
        assert text_of(f"docs/{page}.md") == maker_of(page).text(), (
            f"run python docs/make_{page}.py"
        )


def test_the_pages_of_a_release_name_its_version():
    version = tomllib.loads(text_of("pyproject.toml"))["project"]["version"]
    assert f"\nversion: {version}\n" in text_of("CITATION.cff")
    assert f"\n## [{version}] - " in text_of("CHANGELOG.md") or "dev" in version


def anchors(page):
    """The anchors that a code host gives to the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        for heading in headings
    }


def test_sentences_above_35_words_are_listed_and_no_text_is_a_fault(tmp_path):
    (tmp_path / "docs").mkdir()
    script = tmp_path / "docs" / "readability.py"
    script.write_bytes((ROOT / "docs" / "readability.py").read_bytes())
    page = f"Long {'word ' * 34}end. Short {'word ' * 33}end. {'Many sentences. ' * 20_000}"
    (tmp_path / "README.md").write_text(page)
    (tmp_path / "CONTRIBUTING.md").write_text("# A heading alone")
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "module.py").write_text('"""What opens as a question."""')
    printed = subprocess.run(
        [sys.executable, script], capture_output=True, encoding="utf-8", check=True
    ).stdout
    assert "README.md, 36 words: Long word" in printed
    assert "Short" not in printed
    assert "question word: What opens" in printed


def test_links_between_pages_lead_to_files_and_headings():
    for page in PAGES:
        for target, heading in re.findall(
            r"(?:\]\(|src=\")(?!https?:)([^)#\"]*)(?:#([^)\"]*))?", text_of(page)
        ):
            path = (ROOT / page).parent.joinpath(target) if target else ROOT / page
            assert path.exists(), (page, target)
            assert not heading or heading in anchors(path), (page, target, heading)


@pytest.mark.parametrize("page", sorted(page for page in PAGES if "$" in text_of(page)))
def test_each_formula_of_a_page_can_be_shown_by_the_site(page):
    prose = re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL)
    prose = re.sub(r"`[^`]*`", "", prose)
    formulas = [code for words, code in blocks(page) if words == ["math"]]
    formulas += re.findall(r"(?<![\\$])\$([^$]+)\$", prose)
    for formula in formulas:
        assert tex2mathml(formula), formula


#: Pages that have names of former versions, too.
FORMER_NAMES = {"CHANGELOG.md", "docs/migration.md"}


def test_names_of_code_in_the_pages_exist():
    scenarios = (
        f"scenarios/{path.name}" for path in (ROOT / "scenarios").glob("*.toml")
    )
    for page in {*PAGES, *scenarios} - FORMER_NAMES:
        for name in set(
            re.findall(
                r"`(sim(?!\.schema\.json)(?:\.\w+)+)(?:\([^`]*\))?`", text_of(page)
            )
        ):
            module, code = name, None
            while code is None and module:
                try:
                    code = importlib.import_module(module)
                except ModuleNotFoundError:
                    module = module.rpartition(".")[0]
            for part in name[len(module) + 1 :].split(".") if name != module else []:
                assert hasattr(code, part), (page, name)
                code = getattr(code, part)
            assert code is not None, (page, name)


@functools.cache
def blocks(page):
    """The blocks of code of a page, each with the words after its fence."""
    tokens = MarkdownIt().disable("inline").parse(text_of(page))
    return [
        (token.info.split(), token.content)
        for token in tokens
        if token.type in ("code_block", "fence")
    ]


def command_lines(code):
    """The commands of a block, each as its words after ``sim``."""
    return [
        shlex.split(line, comments=True)[1:]
        for line in code.splitlines()
        if line.startswith("sim ")
    ]


def commands(page):
    """The commands that a page shows, in blocks or between words, each as its words after ``sim``."""
    between = [
        shlex.split(text)[1:]
        for text in re.findall(r"`(sim\s(?!-)[^`]*)`", text_of(page))
    ]
    return sorted(
        {
            *map(tuple, between),
            *(tuple(line) for _, code in blocks(page) for line in command_lines(code)),
        }
    )


def test_the_commands_that_a_page_shows_exist_with_their_options_kinds_and_keys():
    for page in PAGES:
        for name, *words in commands(page):
            command = cli.commands[name]
            known = {
                option for parameter in command.params for option in parameter.opts
            } | {"--help"}
            assert {word for word in words if word.startswith("-")} <= known, (
                page,
                name,
                *words,
            )
            # words may be left out
            values = command.make_context(name, words, resilient_parsing=True).params
            kinds = (None, *KINDS, *QUANTITIES)
            assert values.get("kind") in kinds, (page, name, *words)
            assert all(
                (ROOT / word).exists()
                for word in words
                if word.startswith("scenarios/")
            ), (page, *words)
            if values.get("changes"):
                scenario = ROOT / values["scenario"]
                scenario = (
                    scenario if scenario.exists() else ROOT / "sim" / "starter.toml"
                )
                load(scenario, _values(values["changes"], "--set"))


def test_the_page_for_newcomers_shows_what_its_code_gives():
    assert (
        doctest.testfile(
            str(ROOT / "docs" / "jkr_only.md"), module_relative=False
        ).failed
        == 0
    )


GALLERY = maker_of("gallery")
NUMBERS, LABELS = GALLERY.stored(GALLERY.NUMBERS), GALLERY.stored(GALLERY.LABELS)


def test_every_scenario_has_its_question_in_the_gallery():
    shown = {entry.scenario for entry in GALLERY.ENTRIES}
    missing = {path.stem for path in (ROOT / "scenarios").glob("*.toml")} - shown
    assert not missing, "give it an entry in docs/make_gallery.py, then make gallery"


def test_the_gallery_shows_the_numbers_that_were_computed():
    pages = GALLERY.pages(NUMBERS)
    assert {*GALLERY.FOLDER.glob("*.md")} == {*pages}, (
        "delete the page of a question that is gone"
    )
    for path, text in pages.items():
        assert path.read_text(encoding="utf-8") == text, (
            "run python docs/make_gallery.py --text"
        )
    for entry in GALLERY.ENTRIES:  # and no number is typed
        typed = re.sub(
            r"\{.*?\}|`.*?`|\]\(.*?\)|[χα] = [01]|theory of 2018", "", entry.answer
        )
        assert not re.search(r"\d", typed), entry.name
        moves = entry.kind == "movie"
        assert (
            0
            < entry.picture.stat().st_size
            < (2_000_000 if moves else GALLERY.MOST_BYTES)
        )
        with Image.open(entry.picture) as picture:
            assert getattr(picture, "n_frames", 1) == (60 if moves else 1)


@pytest.mark.verify
@pytest.mark.parametrize("entry", GALLERY.ENTRIES, ids=lambda entry: entry.name)
def test_an_answer_of_the_gallery_is_computed_again(entry):
    result = entry.run()
    if entry.kind != "movie":  # whose frames differ
        assert GALLERY.labels(entry.figure(result)) == LABELS[entry.name]
    numbers = entry.numbers(result)
    assert numbers.keys() == NUMBERS[entry.name].keys()
    for name, number in numbers.items():
        assert_allclose(
            number, NUMBERS[entry.name][name], rtol=1e-6, atol=1e-9, err_msg=name
        )


@pytest.mark.parametrize("name", GALLERY.BESIDE)
def test_a_picture_of_a_page_has_the_labels_that_are_drawn_today(name):
    figure = sim.plot(sim.run(GALLERY.BESIDE[name]))
    assert GALLERY.labels(figure) == LABELS[name]


#: Numbers of docs/findings.md: change of the lens behind a spring, speed [mm/s], quantity, factor, and its text.
SLIDING = [
    ({}, 2, "area_ratio", 100.0, "91.706"),
    ({}, 3, "area_ratio", 100.0, "88.531(15)"),
    ({}, 3, "lost_to_fluctuations", 100.0, "5.711(14)"),
    ({}, 2, "lost_to_fluctuations", 100.0, "0.026902(52)"),
    ({}, 3, "lost_to_bonds", 100.0, "5.7578(19)"),
    ({}, 2, "lost_to_bonds", 100.0, "8.2673"),
    ({}, 20, "lost_to_bonds", 100.0, "12.561(11)"),
    ({}, 20, "lost_to_fluctuations", 100.0, "5.0917(26)"),
    ({"shear.amplitude.memory_length": "1 mm"}, 3, "area_ratio", 100.0, "83.789(35)"),
    ({"drive.damping": 0.0}, 3, "friction_force", 1e3, "7.508(44)"),
    ({"drive.damping": 0.0}, 3, "area_ratio", 100.0, "92.719(12)"),
    ({"drive.damping": 0.0}, 3, "lost_to_fluctuations", 100.0, "2.0699(63)"),
]


@pytest.mark.verify
@pytest.mark.parametrize(
    "keys",
    [{}, {"shear.amplitude.memory_length": "1 mm"}, {"drive.damping": 0.0}],
    ids=str,
)
def test_the_findings_have_the_numbers_of_the_lens_behind_a_spring_at_a_16_times_finer_clock_step(
    keys,
):
    """A mean differs by no more than twice the standard errors of both, or half of its last digit."""
    findings = " ".join(text_of("docs/findings.md").split())
    for speed in sorted({row[1] for row in SLIDING if row[0] == keys}):
        path, values = (
            ROOT / "scenarios" / "pdms_lens_spring.toml",
            {"sweep": {}, "drive.stage": f"{speed} mm/s"},
        )
        fine = values | {"clock.step": "62.5 us", "clock.record": "1 ms"} | keys
        late = read.distribution(sim.run(load(path, fine)))
        for _, _, name, factor, text in (
            row for row in SLIDING if row[:2] == (keys, speed)
        ):
            mean, sem = (factor * float(part) for part in late[name][:2])
            value, _, error = text.rstrip(")").partition("(")
            digit = 10.0 ** -len(value.partition(".")[2])
            assert text in findings
            room = 2.0 * math.hypot(sem, digit * float(error or 0)) + 0.5 * digit
            assert abs(mean - float(value)) < room, (name, mean)


#: Pages whose blocks are run one after the other. A block that is marked ``cluster`` needs several machines, and one of
#: ``browser`` waits for its page: both are only parsed, except for the tasks of a job array. Lines of ``make`` and
#: ``pip`` need a network: ``.ci/run`` runs ``make run`` and ``make test`` of README.
RUN = [
    page
    for page in PAGES
    if any("python" in words or command_lines(code) for words, code in blocks(page))
]
#: Pages that are quick to run.
QUICK = {f"docs/{name}.md" for name in ("cluster", "jkr_only", "paper")} | {"README.md"}
#: Pages whose numbers another test has: computed from the laws, by other commands, or by a program that makes the page.
APART = {
    "docs/dataset.md",
    "docs/design.md",
    "docs/theory.md",
    "docs/validation.md",
}
#: Numbers that no command of their page prints, because the page states them: limits and defaults of the program,
#: examples of the notation, exit codes, versions, years and measurements on several systems.
STATED = {
    "README.md": "2025 3.11 133.2(10) 1.0 116.59 0.40",
    "docs/choosing.md": "24 55 64 1000 95",
    "docs/explore.md": "30 95 800",
    "docs/fit.md": "250 1.5 10,000 30 45 512 1,000 94.8 95.5 94.3 94.1",
    "docs/index.md": "3.11 2.0",
    "docs/large_files.md": "0.02",
    "docs/limits.md": "1000 80 3.4 2020 2021 2025",
    "docs/loops.md": "0.40",
    "docs/means.md": "133.2(10) 1.0 101 105",
    "docs/own_data.md": "1,000",
    "docs/paper.md": "2020 2021 2025 112 2018 145 133 2019 103744 1710.06506 43 0.1 0.12 1.6 6.4 42",
    "docs/plan.md": "5.6 400",
    "docs/recipes.md": "20",
    "docs/reliability.md": "73 74 75 130 2.0 2.1 2.2",
    "docs/reproducibility.md": "64 512 2e-13 7e-12 2e-9 2e-4 1.3",
    "docs/within.md": "16 20",
}
#: A number as pages and tables print it, with its standard error in brackets.
NUMBER = re.compile(
    r"(?<![\w.^])\d(?:[\d,]*\d)?(?:\.\d+)?(?:e[+-]?\d+)?(?:\(\d+\))?(?![\w^])"
)


def numbers_of(page):
    """The numbers of two digits and more in the words of a page, its tables, and what it shows as printed."""
    texts = [code for words, code in blocks(page) if words == ["text"]]
    for token in MarkdownIt().enable("table").parse(text_of(page)):
        texts += [part.content for part in token.children or () if part.type == "text"]
    every = {number for text in texts for number in NUMBER.findall(text)}
    return {number for number in every if len(number) > 1}


def inputs_of(page):
    """The numbers in the code of a page, and in the scenarios and tables that it names, without comments."""
    texts = [code for words, code in blocks(page) if words != ["text"]]
    texts += re.findall(r"`([^`]*)`", text_of(page))
    names = {*re.findall(r"scenarios/\w+\.(?:toml|csv)", text_of(page))}
    names |= {"sim/starter.toml"} if "first.toml" in text_of(page) else set()
    texts += [re.sub(r"#.*", "", text_of(name)) for name in names]
    return {number for text in texts for number in NUMBER.findall(text)}


def printed_by(page):
    """Run the blocks of a page in the present folder and return what they print."""
    names, output = {}, io.StringIO()
    for words, code in blocks(page):
        # which the test of the page for newcomers runs
        if "python" in words and ">>>" not in code:
            parsed = compile(code, page, "exec")
            with contextlib.redirect_stdout(output):
                exec("" if "cluster" in words else parsed, names)
        lines, tasks = command_lines(code), re.search(r"--array=1-(\d+)", code)
        if tasks:
            task, every = "$SLURM_ARRAY_TASK_ID", range(1, int(tasks[1]) + 1)
            lines = [
                [word.replace(task, str(number)) for word in line]
                for number in every
                for line in lines
            ]
        elif {"cluster", "browser", "measured"} & {*words}:
            lines = []
        for line in lines:
            done = command_line(*line)
            assert done.exit_code == 0, (line, done.stderr)
            assert "nothing to compute" not in done.output, line
            output.write(done.output)
    return output.getvalue()


def is_nearly(number, printed):
    """True if a number is printed but for a tenth of its standard error.

    Roundings differ between processors, and grow on the paths of sliders that no damping holds.
    """

    def parts(text):
        form = re.fullmatch(r"([\d,]*)\.?(\d*)\((\d+)\)", text)
        return form and (
            int(form[1].replace(",", "") + form[2]),
            len(form[2]),
            int(form[3]),
        )

    here = parts(number)
    return here is not None and any(
        there[1] == here[1] and abs(np.subtract(here, there)).max() <= 0.1 * here[2]
        for there in filter(None, map(parts, printed))
    )


def test_a_number_of_a_page_may_be_off_by_a_tenth_of_its_error_alone():
    assert is_nearly("2.0699(63)", {"2.0698(63)", "12"})
    assert is_nearly("1,000(20)", {"1002(21)"})
    assert not is_nearly("2.0699(63)", {"2.0707(63)", "2.0699", "20699(63)"})
    assert not is_nearly("2.0699", {"2.0698(63)", "2.0698"})
    assert not is_nearly("5.0(2)", {"5.1(2)"})


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page in QUICK else pytest.mark.verify)
        for page in RUN
    ],
)
def test_what_a_page_shows_runs_and_prints_the_numbers_of_the_page(
    page, tmp_path, monkeypatch
):
    """A number of a page is printed by its commands with all digits, or given in its code, or stated by the page."""
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    monkeypatch.chdir(tmp_path)
    printed = {*NUMBER.findall(printed_by(page))}
    # other kinds of systems may differ in the last digits
    if page in APART or "gallery" in page or os.name != "posix":
        return
    # README quotes a page whose commands print its numbers
    printed |= numbers_of("docs/findings.md") if page == "README.md" else set()
    stated = {*STATED.get(page, "").split()}
    missing = numbers_of(page) - inputs_of(page) - printed
    assert {each for each in missing if not is_nearly(each, printed)} <= stated
    assert stated <= numbers_of(page)


@pytest.mark.verify
def test_the_fits_of_the_measured_loop_print_the_numbers_of_the_page(
    tmp_path, monkeypatch
):
    if not (path := os.environ.get("SIM_MEASURED_LOOP")):
        pytest.skip("SIM_MEASURED_LOOP names the file, which has no licence to be here")
    shutil.copy(path, tmp_path / "test-5")
    shutil.copy(ROOT / "docs" / "pdms_loop.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    page, output = "docs/validation.md", ""
    for words, code in blocks(page):
        for line in command_lines(code) if "measured" in words else ():
            done = command_line(*line)
            assert done.exit_code == 0, (line, done.stderr)
            output += done.output
    rows = re.findall(r"(?m)^\| (?:zero|the same) .*", text_of(page))
    assert len(rows) == 3
    printed = {*NUMBER.findall(output)}
    assert {number for row in rows for number in NUMBER.findall(row)} <= printed
    assert {"0.8887", "1.156"} <= printed


def test_numbers_of_theory_and_choosing_that_no_command_prints_follow_from_laws_and_own_constants():
    """Own values: Lambert's W, the normal law, and zeta functions of the lattice and of the half-line."""

    def excess(low, high):
        recipe = 1.0, 1.0, 1.0, np.geomspace(low, high, 401), 1.0
        ratio = schallamach.first_moment_peak(*recipe).stress
        ratio = 100.0 * (ratio / schallamach.bell_peak(*recipe).stress - 1.0)
        return f"{ratio.min():.0f} to {ratio.max():.0f} % too high"

    def on_disc(waves):
        mean, skew = halfspace.marginal_factors(2.0 * math.pi * waves)
        share = 4.0 / math.pi * (0.75 * mean + 0.25 * skew) - 1.0
        return f"{-100.0 * share:.0f} %"

    strengths = [mpmath.mpf(3), mpmath.mpf(30), mpmath.mpf(1000)]
    roots = [mpmath.lambertw(strength).real for strength in strengths]
    stretches = (float(w / (1 + w)) for w in roots)
    forces = (
        float((1 - mpmath.exp(-w)) * mpmath.exp(1 / strength - 1 / w))
        for w, strength in zip(roots, strengths, strict=True)
    )
    lattice = mpmath.zeta(0.5) * (mpmath.zeta(0.5, 0.25) - mpmath.zeta(0.5, 0.75))
    reversed_share = 50.0 * math.erfc(1.0 / math.sqrt(2.0))
    siegmund = float(-mpmath.zeta(0.5) / mpmath.sqrt(2.0 * mpmath.pi))
    pages = {
        "choosing": [excess(0.01, 1000.0)],
        "theory": [
            excess(1.0, 100.0),
            f"along a diameter the difference is {on_disc(10)}, with one wave {on_disc(1)}",
            f"the friction is reversed on {reversed_share:.0f} % of the area",
            f"{float(-3.0 * lattice / (8.0 * mpmath.pi)):.4f}\\,C(0)",
            f"{siegmund:.3f}\\,\\sigma$ (Siegmund 1985)",
            " | ".join(f"{value:.2f}" for value in stretches),
            " | ".join(f"{value:.2f}" for value in forces),
        ],
    }
    for page, texts in pages.items():
        shown = " ".join(text_of(f"docs/{page}.md").split())
        assert [text for text in texts if text not in shown] == []


def test_numbers_with_errors_in_the_paper_of_the_package_are_those_of_the_findings():
    numbers = {number for number in numbers_of("paper/paper.md") if "(" in number}
    assert len(numbers) > 0 and numbers <= numbers_of("docs/findings.md")


def test_tables_that_a_page_shows_are_those_of_a_scenario(tmp_path):
    """The files of a table are those of the scenarios with the same tables."""
    shutil.copy(ROOT / "sim" / "starter.toml", tmp_path / "first.toml")
    for kind in ("psd", "map"):
        shutil.copy(ROOT / "scenarios" / f"own_{kind}.csv", tmp_path / f"{kind}.csv")
    shown = [code for page in PAGES for words, code in blocks(page) if "toml" in words]
    assert len(shown) > 2
    for code in shown:
        load(tmp_path / "first.toml", tomllib.loads(code))
    for page in {*PAGES} - {"CHANGELOG.md"}:  # which shortens tables
        for code in re.findall(r"`((?:\[[\w.]+\] *)?[\w.\"]+ = [^`]+)`", text_of(page)):
            assert tomllib.loads(code), page


NOTEBOOK = ROOT / "docs" / "first_steps.ipynb"


def outputs_of(notebook):
    """The outputs of each code cell, without the cells that only import."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [
        cell["outputs"]
        for cell in cells
        if not "".join(cell["source"]).startswith("import")
    ]


def printed(outputs):
    return [
        "".join(output["text"])
        for cell in outputs
        for output in cell
        if output.get("name") == "stdout"
    ]


def test_the_notebook_stores_the_output_of_each_cell_and_no_warning_or_path():
    stored = outputs_of(json.loads(NOTEBOOK.read_text(encoding="utf-8")))
    assert all(stored), "execute docs/first_steps.ipynb and save its outputs"
    assert {output.get("name", "result") for cell in stored for output in cell} == {
        "stdout",
        "result",
    }
    assert not re.search(
        r"/(home|root|tmp|work|Users)/|Warning", json.dumps(stored, ensure_ascii=False)
    )
    assert NOTEBOOK.stat().st_size < 400_000


@pytest.mark.verify
@pytest.mark.filterwarnings("default")  # those of the notebook's packages
def test_the_notebook_runs_to_its_end():
    nbclient, nbformat = (
        pytest.importorskip(name, reason="in the extra verify")
        for name in ("nbclient", "nbformat")
    )
    notebook = nbformat.read(NOTEBOOK, 4)
    stored = printed(outputs_of(notebook))
    resources = {"metadata": {"path": str(ROOT / "docs")}}
    nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources=resources
    ).execute()
    assert printed(outputs_of(notebook)) == stored
    results = [result for cell in notebook.cells for result in cell.get("outputs", [])]
    assert sum("image/png" in result.get("data", {}) for result in results) == 3
    assert [result for result in results if result.get("name") == "stderr"] == []
