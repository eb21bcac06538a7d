"""The whole way of a user without the names that macOS or Windows lack.

``helpers/elsewhere`` says what this cannot see of other systems; ``make windows`` goes the way on a Windows Python.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.commands import COUNTED, LENS

on_linux = pytest.mark.skipif(
    sys.platform != "linux", reason="names are hidden on Linux alone"
)

ELSEWHERE = Path(__file__).parent / "helpers" / "elsewhere"
SCENE = (
    LENS.replace('"a scene"', '"a lens — Größe µ"\nseed = 3')
    .replace('"1 s"', '"40 ms"')
    .replace('"0.1 s"', '"1 ms"')
)
SCENE += f"""
[drive]
model = "table"
file = "Geschwindigkeit à.csv"
{COUNTED}
[ensemble]
members = 40
[sweep]
"contact.load" = ["2 mN", "4 mN"]
"bonds.rebinding_rate" = ["400 1/s", "500 1/s"]
"""
SPEEDS = "time [ms];speed [mm/s]\r\n0;0,1\r\n40;20\r\n"
AREAS = {0.1: 45300, 1: 44000, 5: 39500, 10: 36200, 20: 32500, 50: 29000}
CURVES = "speed [mm/s],contact_area [um^2],contact_area_error [um^2]\r\n"
CURVES += "".join(f"{speed},{area},200\r\n" for speed, area in AREAS.items())


@pytest.fixture
def elsewhere(tmp_path):
    """A folder with a scenario, and ``sim`` as a process there without the names, whose output is in cp1252."""
    folder = tmp_path / "Ordner mit Größe ñ"
    folder.mkdir()
    (folder / "szene µ.toml").write_bytes(SCENE.replace("\n", "\r\n").encode())
    steady = SCENE[: SCENE.index("[sweep]")].replace('"counted"', '"steady"')
    steady = steady.replace('rebinding_rate = "500 1/s"', "").replace("sites = 50", "")
    (folder / "fit.toml").write_text(steady, encoding="utf-8", newline="\r\n")
    (folder / "Geschwindigkeit à.csv").write_bytes(SPEEDS.encode())
    (folder / "curves.csv").write_bytes(CURVES.encode())
    path = os.pathsep.join([str(ELSEWHERE), *sys.path])
    environment = {
        **os.environ,
        "PYTHONPATH": path,
        "PYTHONIOENCODING": "cp1252",
        "PYTHONUTF8": "0",
    }

    def sim(*words, code=0):
        command = [sys.executable, "-W", "error::FutureWarning", "-m", "sim", *words]
        process = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, encoding="cp1252"
        )
        assert process.returncode == code, (words, process.stderr)
        assert "Traceback" not in process.stderr
        return process.stdout + process.stderr

    sim.folder = folder
    return sim


def variables(path):
    with xr.open_dataset(path) as dataset:
        return {
            name: value.values
            for name, value in dataset.load().variables.items()
            if value.dtype.kind in "biuf"
        }


@on_linux
def test_names_are_hidden_from_the_package_alone(tmp_path):
    program = """
import os, signal
for name in ("sim.somewhere", "elsewhere"):
    for text in ("import fcntl", "os.fork", "os.getuid", "signal.SIGHUP"):
        try:
            exec(text, {"__name__": name, "os": os, "signal": signal})
            print(name, "sees")
        except (ImportError, AttributeError):
            print(name, "does not see")
print(getattr(os, "process_cpu_count", os.cpu_count)() > 0)
"""
    environment = {**os.environ, "PYTHONPATH": str(ELSEWHERE)}
    printed = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    seen = ["sim.somewhere does not see"] * 4 + ["elsewhere sees"] * 4 + ["True"]
    assert printed.stdout.splitlines() == seen


@pytest.mark.verify
@on_linux
def test_a_user_goes_from_a_scenario_to_a_fit(elsewhere):
    sim, scene = elsewhere, "szene µ.toml"
    sim("new", "erste Szene.toml")
    assert "counted" in sim("check", scene)
    sim("run", scene, "-o", "one.nc", "-j", "1", "--quiet")
    sim(
        "run",
        scene,
        "-o",
        "zwei Läufe.nc",
        "-j",
        "2",
        "--quiet",
        "--max-time",
        "1 us",
        code=75,
    )
    sim("run", scene, "-o", "zwei Läufe.nc", "-j", "2", "--quiet", "--resume")
    one, two = (variables(sim.folder / name) for name in ("one.nc", "zwei Läufe.nc"))
    assert one.keys() == two.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(values, two[name], err_msg=name)
    assert not [
        path
        for path in sim.folder.iterdir()
        if path.is_dir() or path.suffix in (".lock", ".tmp")
    ]
    assert "A/A_JKR" in sim("stats", "zwei Läufe.nc", "--csv", "stats ü.csv")
    assert (sim.folder / "stats ü.csv").stat().st_size > 1000
    sim("plot", "zwei Läufe.nc", "-o", "Bild.png")
    sim("report", "zwei Läufe.nc", "-o", "Seite.html")
    assert "Größe µ" in (sim.folder / "Seite.html").read_text(encoding="utf-8")
    sim(
        "fit",
        "fit.toml",
        "curves.csv",
        "--free",
        "bonds.critical_speed",
        "--steady",
        "-o",
        "à",
    )
    assert (sim.folder / "à_fit.json").exists()


@pytest.mark.verify
@pytest.mark.parametrize(
    ("schema", "files"),
    [
        ("github-workflows", ".github/workflows/*.yml"),
        ("github-issue-forms", ".github/ISSUE_TEMPLATE/*.yml"),
        ("readthedocs", ".readthedocs.yaml"),
        ("citation-file-format", "CITATION.cff"),
    ],
)
def test_the_files_for_hosts_follow_their_schemas(schema, files):
    paths = [str(path) for path in Path(__file__).parents[1].glob(files)]
    command = [
        sys.executable,
        "-m",
        "check_jsonschema",
        "--builtin-schema",
        f"vendor.{schema}",
        *paths,
    ]
    assert paths
    subprocess.run(command, check=True)
