"""The commands: what they print, write and refuse, and with which exit code."""

import csv
import io
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import netCDF4
import pytest
import xarray as xr
from helpers.cases import posix
from helpers.commands import LENS as LENS_TEXT, SCENE, sim
from helpers.random_scenes import random_scene

from sim import cli
from sim.ensemble import preview
from sim.numerics import jit
from sim.plots.kinds import KINDS
from sim.scenario.files import written
from sim.study import paper
from sim.units import terminal

#: Change of the scene by which its run has no note.
SMALL_STRAIN = 'bonds.stress="0.1 MPa"'


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in, with one scenario."""
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def loaded(*arguments):
    """The modules that a command imports."""
    code = (
        "import sys\nfrom sim.cli import main\n"
        f"sys.argv = ['sim', *{list(map(str, arguments))!r}]\n"
        "try:\n    main()\nexcept SystemExit as done:\n    assert not done.code, done.code\n"
        "print('MODULES', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return set(done.stdout.splitlines()[-1].split()[1:])


def complaints(errors):
    """Lines on standard error but those on progress, which a slow machine or kernels not compiled yet make."""
    lines = [
        line for line in errors.splitlines() if line.strip() and " % of " not in line
    ]
    return [line for line in lines if not line.startswith(("compiling", "making"))]


def test_commands_import_only_what_they_need_and_a_reader_that_leaves_at_once_is_no_error(
    here,
):
    figures = {"xarray", "matplotlib", "rich"}
    numbers = {
        "numpy",
        "scipy",
        "numba",
        "pydantic",
        "pint",
        "netCDF4",
        "tomllib",
        "json",
    }
    assert not (loaded("run", "--help") | loaded("plot", "--help")) & (
        figures | numbers
    )
    needless = {"scipy.stats", "scipy.optimize", "scipy.constants"}
    heavy = {"pandas", "dask"} | needless | figures
    assert not loaded("check", "scene.toml") & heavy
    assert not loaded("run", "scene.toml", "--no-table", "--quiet") & heavy
    assert Path("outputs/scene.nc").exists() and "xarray" in (
        table := loaded("stats", "outputs/scene.nc")
    )
    # xarray would import two
    assert not table & {
        "pint",
        "dask",
        "matplotlib",
        "scipy.stats",
        "scipy.interpolate",
    }
    reading, writing = os.pipe()
    os.close(reading)
    command = [
        sys.executable,
        "-m",
        "sim",
        "stats",
        "outputs/scene.nc",
        "--csv",
        "x.csv",
    ]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, timeout=120)
    os.close(writing)
    assert (done.returncode, complaints(done.stderr.decode())) == (0, []) and Path(
        "x.csv"
    ).exists()


@posix
@pytest.mark.parametrize("orders", [[signal.SIGTERM], [signal.SIGINT, signal.SIGTERM]])
def test_an_order_to_stop_keeps_what_is_computed(here, orders):
    points = 'sweep={"contact.load"={from=1e-3, to=4e-3, count=1000}}'
    changes = ['clock.duration="20 s"', points, SMALL_STRAIN]
    long = ["run", "scene.toml", *itertools.chain(*(("--set", x) for x in changes))]
    run = subprocess.Popen(
        [sys.executable, "-m", "sim", *long],
        stderr=subprocess.PIPE,
        text=True,
        # a shell's background jobs ignore it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    parts = here / "outputs" / "scene.nc.parts"
    # once the first point is written, all is compiled and loaded and another point is marched
    while not list(parts.glob("*.npz")) and run.poll() is None:
        time.sleep(0.02)
    for order in orders:
        run.send_signal(order)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == (130 if len(orders) > 1 else 75)
    assert [line.startswith("stop") for line in complaints(errors)] == [
        True,
        True,
    ] and "--resume" in errors
    assert (
        "the run is not complete; continue it with `sim run ... --resume`"
        in sim("stats", "outputs/scene.nc").stderr
    )
    assert not (here / "outputs" / "scene.nc").exists()
    assert list(parts.glob("*.npz"))
    other = sim(
        *long[:-1], 'sweep={"contact.load"={from=1e-3, to=4e-3, count=100}}', "--resume"
    )
    assert (other.exit_code, "scenario.sweep.contact.load" in other.stderr) == (2, True)


def test_a_run_that_cannot_begin_names_each_fault_in_one_line_with_its_code_and_writes_nothing(
    here, monkeypatch
):
    Path("bad.toml").write_text(
        SCENE.replace("4 mN", "4 kg").replace("members", "memebrs"), encoding="utf-8"
    )
    before = sorted(here.iterdir())
    done = sim("run", "bad.toml")
    assert (done.exit_code, done.stdout) == (2, "")
    keys = [line.split(": ")[:2] for line in done.stderr.splitlines()]
    assert keys == [["bad.toml", "contact.load"], ["bad.toml", "ensemble.memebrs"]]
    assert sorted(here.iterdir()) == before
    monkeypatch.setattr("sim.ensemble.simulate.simulate", None)  # computing would fail
    of_posix = [
        (["-o", "x" * 250], 74, "xxx"),
        (["-o", "loop.nc"], 74, "loop.nc"),
        (["-o", "\udcff.nc"], 2, "UTF-8"),
    ]
    of_posix.append((["-o", "a\\b.nc"], 2, "backslash"))
    if os.name == "posix":
        Path("loop.nc").symlink_to("loop.nc")
    before = sorted(here.iterdir())
    for arguments, code, message in (
        *(of_posix if os.name == "posix" else ()),
        (["-o", "."], 2, ". is a folder"),
        (["-o", "scene.toml", "--force"], 2, "scene.toml: the command reads"),
        (["-o", "scene.toml/x.nc"], 74, "scene.toml"),
        (["--set", "contact"], 2, "--set takes TABLE.KEY=VALUE"),
        (["--set", "contact.lod=3"], 2, 'did you mean "load"?'),
        (["--members", "0"], 2, "'--members'"),
    ):
        done = sim("run", "scene.toml", *arguments)
        assert (done.exit_code, message in done.stderr, "Traceback" in done.output) == (
            code,
            True,
            False,
        ), arguments
        assert sorted(here.iterdir()) == before


def test_run_writes_the_dataset_into_a_new_folder_and_never_replaces_one_unasked(
    here, monkeypatch
):
    done = sim(
        "run",
        "scene.toml",
        "-o",
        "new/folder/x.nc",
        "--seed",
        99,
        "--members",
        2,
        "--set",
        "contact.load=2 mN",
    )
    assert done.exit_code == 0
    assert (
        done.stdout.splitlines()[-1] == str(Path("new/folder/x.nc"))
        and len(done.stdout.splitlines()) > 3
    )
    assert sorted(path.name for path in (here / "new/folder").iterdir()) == ["x.nc"]
    with xr.open_dataset("new/folder/x.nc") as dataset:
        assert dataset.sizes["member"] == 2 and dataset.attrs["seed"] == "99"
        assert float(dataset["contact_load"]) == 2e-3
        assert json.loads(dataset.attrs["scenario_overrides"])["contact.load"] == "2 mN"
    content, again = (
        Path("new/folder/x.nc").read_bytes(),
        ["run", "scene.toml", "-o", "new/folder/x.nc", "--no-table"],
    )
    with monkeypatch.context() as patched:
        patched.setattr("sim.ensemble.simulate.run", None)  # computing would fail
        done = sim(*again)
    assert (
        done.exit_code == 73
        and "--force" in done.stderr
        and Path("new/folder/x.nc").read_bytes() == content
    )
    done = sim(*again, "--shard", "9/9")
    assert done.exit_code == 0 and "most shards of this run: 1" in done.stdout
    assert (
        sim(*again, "--force").exit_code == 0
        and Path("new/folder/x.nc").read_bytes() != content
    )
    quiet = sim("run", "scene.toml", "--quiet")
    assert (quiet.exit_code, quiet.output) == (0, "") and Path(
        "outputs/scene.nc"
    ).exists()


def test_stages_of_a_long_run_and_the_first_compilation_have_their_line(
    capsys, monkeypatch
):
    for quiet in (False, True):
        cli._announce_compiling(quiet)
        for _ in range(2):
            for notice in list(jit.on_compiling):
                notice("sim.laws.jkr.pull_off_load")
        assert capsys.readouterr().err.count("compiling") == (not quiet)
    monkeypatch.setattr("time.monotonic", iter([0.0, 10.0, 40.0, 50.0]).__next__)
    with terminal.progress_bar(100) as shown:
        shown.begin("simulating")
        shown.advance(30)
        shown.begin("writing")
    assert capsys.readouterr().err.splitlines() == [
        "30 % of 100 member-steps, 2 min left",
        "writing",
    ]
    monkeypatch.undo()
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    with terminal.progress_bar(100) as shown:
        shown.begin("simulating")
        shown.advance(30)
    printed = "".join(capsys.readouterr())  # a terminal has a bar
    assert "simulating" in printed and "30%" in printed


@posix
def test_a_table_that_a_scenario_reads_is_never_its_output(here):
    text = "time [s], speed [m/s]\n0, 1e-3\n1, 2e-3\n"
    Path("v.csv").write_text(text, encoding="utf-8")
    Path("link.nc").symlink_to("v.csv")
    for where in (
        'drive={ model="table", file="v.csv" }',
        'sweep={ drive=[{ model="table", file="v.csv" }] }',
    ):
        for name in ("v.csv", "link.nc"):
            done = sim("run", "scene.toml", "--set", where, "-o", name, "--force")
            assert (done.exit_code, done.stderr.startswith(f"{name}: ")) == (2, True)
    assert Path("v.csv").read_text(encoding="utf-8") == text


def test_nothing_after_the_rename_makes_a_failure_of_a_run(here, monkeypatch):
    with monkeypatch.context() as patched:
        done, replace = [], os.replace

        def replaced(path, target):
            replace(path, target)
            if Path(target).name == "x.nc":
                done.append(target)

        def broken(real):
            def call(*arguments, **options):
                if done:
                    raise OSError(5, "Input/output error")
                return real(*arguments, **options)

            return call

        patched.setattr("os.replace", replaced)
        for name in ("os.unlink", "os.rmdir", "os.fsync"):
            patched.setattr(name, broken(getattr(os, name.partition(".")[2])))
        patched.setattr("sim.read.tables_of", broken(lambda *_: done.append("read")))
        found = sim("run", "scene.toml", "-o", "x.nc")
    assert found.exit_code == 0
    assert (
        "the output is complete, but its table could not be made: [Errno 5]"
        in found.stdout
    )
    assert sim("stats", "x.nc").exit_code == 0


def test_trouble_of_the_system_has_its_code_and_place_and_a_fault_of_our_own_is_not_hidden(
    here, monkeypatch
):
    for name, fault, code, start in (
        (
            "pathlib.Path.mkdir",
            PermissionError(13, "Permission denied", "outputs"),
            74,
            "outputs: ",
        ),
        (
            "numpy.savez",
            OSError(28, "No space left on device"),
            74,
            f"{Path('outputs/scene.nc.parts')}: ",
        ),
        ("sim.ensemble.simulate.run", MemoryError(), 1, "there is not enough memory; "),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(name, Mock(side_effect=fault))
            done = sim("run", "scene.toml", "--set", SMALL_STRAIN)
        assert done.exit_code == code and done.stderr.startswith(start)
        assert not Path("outputs/scene.nc").exists()
    monkeypatch.setattr(
        "sim.ensemble.simulate.run", Mock(side_effect=RuntimeError("ours"))
    )
    assert isinstance(sim("run", "scene.toml").exception, RuntimeError)


def test_check_set_schema_and_paper_print_what_they_promise_and_a_wrong_command_ends_with_2(
    here, monkeypatch
):
    done = sim("check", "scene.toml")
    assert done.exit_code == 0 and done.stdout.startswith("a scene\n")
    changed = sim(
        "check",
        "scene.toml",
        "--set",
        'bonds={ model = "none" }',
        "--set",
        'drive.from="2 mm/s"',
    )
    Path("swept.toml").write_text(
        f'{SCENE}[sweep]\n"contact.load" = [1e-3, 2e-3]\n', encoding="utf-8"
    )
    swept = sim("check", "swept.toml", "--set", "contact.load=3e-3")
    assert [line.split()[:2] for line in complaints(swept.stderr)] == [
        ["note:", "contact.load"]
    ]
    Path("swept.toml").unlink()
    assert (
        re.search("bonds +none +changed", changed.stdout)
        and sim("check", "nope.toml").exit_code == 2
    )
    assert sorted(path.name for path in here.iterdir()) == ["scene.toml"]
    for text in ("2 mN", "1\nother = 2", "[" * 5000):  # no text sets another key
        assert cli._values((f"contact.load={text}",), "--set") == {"contact.load": text}
    for arguments in ([], ["nope"], ["run"], ["run", "--nope"]):
        done = sim(*arguments)
        assert (done.exit_code, "Traceback" in done.output) == (2, False)
    assert sim("--version").stdout.startswith("sim, version ")
    required = json.loads(sim("schema").stdout)["required"]
    assert set(required) == {"clock", "solid", "sphere", "adhesion", "contact"}
    line = paper.Check("a", "1", computed=1.0, expected=1.0, error=0.0, tolerance=1e-12)
    for lines, code, last in (
        ([line], 0, "1 of 1 hold"),
        ([line, line._replace(computed=1.1, error=0.1)], 1, "1 of 2 hold"),
    ):
        monkeypatch.setattr(paper, "checks", lambda: lines)
        done = sim("paper")
        assert (
            done.exit_code,
            done.stdout.splitlines()[-1],
            "FAILS" in done.stdout,
        ) == (code, last, code == 1)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """A finished run."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert (
        sim("run", folder / "scene.toml", "-o", folder / "x.nc", "--quiet").exit_code
        == 0
    )
    return folder / "x.nc"


@pytest.fixture
def made(dataset, here):
    """A folder with a run, its scenario and an unlike file of each name that a command would make."""
    Path("x.nc").write_bytes(dataset.read_bytes())
    Path("other.nc").write_bytes(dataset.read_bytes())
    for name in (
        "x.png",
        "x-time.png",
        "x.csv",
        "notes",
        "new.png",
        "new.nc",
        "new.toml",
    ):
        Path(name).write_text("mine", encoding="utf-8")
    return here


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_what_a_command_reads_is_never_replaced_and_an_older_file_only_if_asked_and_as_a_whole(
    made, monkeypatch
):
    Path("copy").write_bytes(Path("scene.toml").read_bytes())
    if os.name == "posix":
        Path("link.png").symlink_to("x.nc")
    for arguments, start in (
        *(
            [(["plot", "x.nc", "-o", "link.png"], "link.png: the command reads")]
            if os.name == "posix"
            else []
        ),
        (["stats", "x.nc", "--csv", "x.nc"], "x.nc: the command reads"),
        (["stats", "x.nc", "--csv", "other.nc"], "other.nc is a dataset"),
        (["stats", "x.nc", "--csv", "new.toml"], "new.toml has a scenario name"),
        (["plot", "x.nc", "-o", "copy"], "copy is the scenario of this dataset"),
        (
            ["converge", "scene.toml", "-o", "new.png"],
            "new.png: the dataset cannot have the name of its picture",
        ),
    ):
        before = content(made)
        done = sim(*arguments, "--force")
        assert (done.exit_code, done.stderr.startswith(start)) == (2, True), arguments
        assert content(made) == before
    monkeypatch.setattr("sim.study.converge.converge", None)  # computing would fail
    for arguments, file in (
        (["stats", "x.nc", "--csv", "x.csv"], "x.csv"),
        (["plot", "x.nc"], "x.png"),
        (["converge", "scene.toml", "-o", "new.nc"], "new.nc"),
        (["converge", "scene.toml", "-o", "new"], "new.png"),
    ):
        before = content(made)
        done = sim(*arguments)
        assert (
            done.exit_code == 73
            and done.stderr.startswith(file)
            and "--force" in done.stderr
        )
        assert content(made) == before
        if arguments[0] != "converge":
            assert sim(*arguments, "--force").exit_code == 0
            assert {
                name for name, now in content(made).items() if now != before.get(name)
            } == {file}

    def full(figure, path, **options):
        Path(path).write_bytes(b"torn")
        raise OSError(28, "No space left on device")

    before = content(made)
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    assert sim("plot", "x.nc", "--force").exit_code == 74 and content(made) == before


# datasets of older versions have the line ends of the file
@pytest.mark.parametrize("is_old", [False, True])
def test_a_scenario_with_the_line_ends_of_windows_is_known_again_and_shown_without_signs_at_its_ends(
    here, is_old
):
    Path("table.csv").write_bytes(b"time [s], speed [mm/s]\r\n0, 1\r\n1, 2\r\n")
    text = f'{LENS_TEXT}[drive]\nmodel = "table"\nfile = "table.csv"\n'
    Path("scene.toml").write_bytes(text.replace("\n", "\r\n").encode())
    Path("copy").write_bytes(Path("scene.toml").read_bytes())
    Path("copy of the table").write_bytes(Path("table.csv").read_bytes())
    assert sim("run", "scene.toml", "-o", "x.nc", "--quiet").exit_code == 0
    with netCDF4.Dataset("x.nc", "a") as file:
        assert file.scenario_toml == text
        if is_old:
            file.scenario_toml = text.replace("\n", "\r\n")
    before = content(here)
    for copy in ("copy", "copy of the table", "scene.toml"):
        assert sim("plot", "x.nc", "-o", copy, "--force").exit_code == 2
        assert sim("stats", "x.nc", "--csv", copy, "--force").exit_code == 2
    assert content(here) == before
    assert sim("report", "x.nc").exit_code == 0
    page = Path("x.html").read_text(encoding="utf-8")
    assert "[sphere]" in page and not re.search(r"\?$", page, re.MULTILINE)


def test_stats_and_plot_write_beside_the_dataset_or_where_asked_or_refuse_in_one_line(
    dataset, here
):
    done = sim("stats", dataset, "--csv", "new/table.csv")
    assert (done.exit_code, done.stdout.splitlines()[-1]) == (
        0,
        str(Path("new/table.csv")),
    )
    header, *rows = csv.reader(
        Path("new/table.csv").read_text(encoding="utf-8").splitlines()
    )
    assert len({len(row) for row in (header, *rows)}) == 1 and len(rows) == 11
    assert "contact_radius [m]" in header
    assert sim("stats", dataset, "--csv-all", "new/all.csv").exit_code == 0
    lines = Path("new/all.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(lines))
    assert len({len(row) for row in rows}) == 1
    assert sum("contact_area" in row for row in rows) == 11
    assert sim("stats", dataset, "--csv", "scene.toml/table.csv").exit_code == 74
    last = "all notes and the headings: --notes"
    assert sim("stats", dataset, "--show", "all").stdout.splitlines()[-1] == last
    last = f"all columns: sim stats FILE --show all; {last}"
    assert sim("stats", dataset).stdout.splitlines()[-1] == last
    # a bound or a reason, if not a speed
    assert "10 % lost" in sim("stats", dataset, "--lost", "10 %").stdout
    assert "lost 10" in sim("stats", dataset, "--lost", "10").stderr
    done = sim("plot", dataset, "time", "-o", "new/picture.svg")
    assert (done.exit_code, done.stdout) == (0, f"{Path('new/picture.svg')}\n")
    assert Path("new/picture.svg").read_text(encoding="utf-8").startswith("<?xml")
    assert sim("plot", dataset).stdout.strip() == str(dataset.with_suffix(".png"))
    assert dataset.with_suffix(".png").exists()
    for arguments, code, message in (
        (["plot", dataset, "banana"], 2, "known: "),
        (["plot", dataset, "map"], 2, "x.nc: "),
        (["plot", dataset, "-o", "picture.xyz"], 2, "xyz"),
        (["plot", dataset, "-o", "scene.toml/picture.png"], 74, "scene.toml"),
        (["stats", "nope.nc"], 2, "nope.nc: "),
        (["plot", "."], 2, ".: "),
        (["stats", "scene.toml"], 2, "`sim run`"),
    ):
        done = sim(*arguments)
        assert (
            done.exit_code,
            message in done.stderr,
            len(done.stderr.splitlines()),
        ) == (code, True, 1)


def test_new_converge_and_a_reduced_file_work_and_name_what_a_figure_misses(
    here, monkeypatch
):
    done = sim("new", "mine")
    assert (
        done.exit_code == 0
        and done.stdout.startswith("mine.toml: ")
        and done.stderr == ""
    )
    schema = Path("sim.schema.json")
    assert (
        Path("mine.toml")
        .read_text(encoding="utf-8")
        .startswith(f"#:schema ./{schema}\n")
    )
    assert json.loads(schema.read_text(encoding="utf-8")) == json.loads(
        sim("schema").stdout
    )
    assert sim("new", "next").stderr == ""
    schema.write_text("{}", encoding="utf-8")
    assert sim("run", "mine.toml", "--quiet", "--members", 2).exit_code == 0
    other = sim("new")
    assert other.stdout.startswith("first.toml: ") and other.stderr.startswith(
        f"note: {schema} is another file"
    )
    assert schema.read_text(encoding="utf-8") == "{}"
    for name, code in (("mine.toml", 73), ("no/where.toml", 74)):
        again = sim("new", name)
        assert again.exit_code == code and again.stderr.startswith(str(Path(name)))
    starter = (Path(cli.__file__).parent / "starter.toml").read_text(encoding="utf-8")
    Path("scene.toml").write_text(
        starter.replace('duration = "2 s"', 'duration = "0.2 s"'), encoding="utf-8"
    )
    done = sim("converge", "scene.toml", "--budget", "5 s", "--tolerance", "2 %")
    assert done.exit_code == 0 and "banded" in done.output and "2 %" in done.output
    assert (
        Path("outputs/scene-converge.nc").exists()
        and Path("outputs/scene-converge.png").exists()
    )
    refused = sim("converge", "scene.toml", "--budget", "2 kg")
    assert refused.exit_code == 2 and "budget" in refused.stderr
    done = sim(
        "run", "scene.toml", "-o", "out.nc", "--set", 'record.quantities=["speed"]'
    )
    assert done.exit_code == 0 and "V" in done.output and "A/A_JKR" not in done.output
    assert "record.quantities has speed" in done.output
    assert "record.quantities" not in sim("run", "scene.toml", "-o", "whole.nc").stdout
    assert sim("stats", "out.nc", "--csv", "out.csv").exit_code == 0
    assert "out.nc: shear_stress" in sim("plot", "out.nc", "stress").output


#: From rest behind a spring, with a contact that loses no area.
PULLED = (
    LENS_TEXT.replace("[contact]", "bond_share = 0.0\n[contact]")
    + """\
[drive]
model = "spring"
stage = { from = "0 m/s", to = "10 um/s" }
stiffness = "1 kN/m"
contact_stiffness = "rigid"
[bonds]
model = "rate"
rupture = { model = "bell", zero_force_rate = "1 1/s", bell_force = "4 pN" }
bond_stiffness = "0.4 mN/m"
rebinding_rate = "1 1/s"
site_density = "1e16 1/m^2"
"""
)


@pytest.mark.parametrize(
    "scene",
    [
        # backward creep in seed 1, waves of one size at an edge that lags in 9, tension in 21
        PULLED,
        *(
            pytest.param(random_scene(k), marks=pytest.mark.verify)
            for k in (0, 1, 2, 4, 7, 8, 9, 10, 17, 18, 21, 22, 23)
        ),
    ],
)
def test_no_warning_of_a_library_reaches_the_terminal_in_any_command(
    scene, here, request
):
    Path("scene.toml").write_text(
        scene if isinstance(scene, str) else written(scene), encoding="utf-8"
    )
    kinds = KINDS if request.node.get_closest_marker("verify") else ()
    commands = [
        "check scene.toml",
        "run scene.toml -o x.nc",
        "stats x.nc --csv x.csv",
        "report x.nc",
    ]
    commands += ["plot scene.toml", *(f"plot x.nc {kind} --force" for kind in kinds)]
    for command in commands:
        done = sim(*command.split())
        assert (
            isinstance(done.exception, SystemExit | None)
            and "Warning" not in done.output
        ), command


MARKS = "\x1b]0;x\x07\x9b31m\u202e\u2066"


def test_no_control_character_reaches_the_terminal_and_one_without_utf_8_gets_ascii(
    dataset, here, monkeypatch
):
    name = json.dumps(MARKS)
    text = SCENE.replace('"a scene"', name)
    Path("scene.toml").write_text(
        text + f'[sweep]\n"contact.load" = [1, {name}]\n', encoding="utf-8"
    )
    # Windows forbids ASCII's
    odd = f"{MARKS if os.name == 'posix' else MARKS[MARKS.index(chr(0x9B)) :]}.toml"
    Path(odd).write_text(SCENE.replace('"a scene"', name), encoding="utf-8")
    shown = [
        sim("check", "scene.toml"),
        sim("check", odd),
        sim("run", odd),
        sim("new", odd),
        sim("check", "a", MARKS),
    ]
    shown += [
        sim("check", odd, "--set", f"{MARKS}=1"),
        sim("stats", MARKS),
        sim("plot", dataset, MARKS),
    ]
    shown += [
        sim("stats", dataset, "--where", f"{MARKS}=1"),
        sim("stats", f"outputs/{MARKS}.nc"),
    ]
    with netCDF4.Dataset(dataset, "a") as file:
        file["t"].units = MARKS
    shown += [sim("stats", dataset), sim("plot", dataset)]
    for done in shown:
        assert done.output
        assert done.output.replace("\n", "").isprintable(), done.output
    Path("scene.toml").write_text(SCENE.replace("a scene", "τ1 → ∮"), encoding="utf-8")
    command = [sys.executable, "-m", "sim", "check", "scene.toml"]
    environment = os.environ | {"PYTHONIOENCODING": "cp1252"}
    done = subprocess.run(
        command, env=environment, capture_output=True, timeout=120, check=False
    )
    assert (done.returncode, complaints(done.stderr.decode())) == (
        0,
        [],
    ) and b"tau1 -> " in done.stdout
    screen = io.TextIOWrapper(io.BytesIO(), encoding="ascii")  # and so does a table
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setattr(cli.cli, "main", lambda **how: cli.print_rows([{"τ": "→"}]))
    cli.main()
    screen.flush()
    assert screen.buffer.getvalue().split() == [b"tau", b"->"]


def test_no_number_of_a_table_is_cut_short(capsys):
    cli.print_rows(
        [{"a long heading": "1.23456789(12)" * 9, "[mm/s]": "[bold]2[/bold]"}] * 2
    )
    printed = capsys.readouterr().out
    assert (
        printed.count("1.23456789(12)" * 9) == 2
        and "[mm/s]" in printed
        and "[bold]2[/bold]" in printed
    )
    cli.print_rows([])


def test_max_memory_is_honoured_and_refused_with_the_least_where_it_is_too_little(
    here, monkeypatch
):
    for text in ("5 m", "-1 GB", "much"):
        refused = sim("run", "scene.toml", "--max-memory", text)
        assert (refused.exit_code, "--max-memory" in refused.stderr) == (2, True)
    refused = sim("run", "scene.toml", "--max-memory", "9 MB")
    assert refused.exit_code == 1
    assert re.search(
        r"needs at least \d+ MB of memory, but 9 MB are allowed \(--max-memory\)",
        refused.stderr,
    )
    assert not Path("outputs").exists()
    assert sim("run", "scene.toml", "--max-memory", "4 GB", "--no-table").exit_code == 0
    monkeypatch.setattr(preview, "_MOST_TABULATED", 0.0)
    large = sim("run", "scene.toml", "--force")
    assert (large.exit_code, large.stdout) == (
        0,
        f"{Path('outputs/scene.nc')}\n",
    ) and "`sim stats`" in large.stderr
