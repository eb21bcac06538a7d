"""The package as it is used from Python: scenes, runs, statistics and figures; every fault as ``BadInput``."""

import html
import subprocess
import sys
import tomllib
from importlib.metadata import version
from unittest.mock import Mock

import netCDF4
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from helpers.commands import LENS
from helpers.printed import rows_of

import sim
from sim import read
from sim.cli import cli
from sim.numerics.files import StoreTrouble
from sim.scenario.files import written

SCENE = tomllib.loads(LENS) | {
    "name": "a <scene>",
    "drive": {"model": "ramp", "from": "0 mm/s", "to": "10 mm/s"},
    "bonds": {"model": "steady", "critical_speed": "10 mm/s", "stress": "0.3 MPa"},
}


@pytest.fixture(scope="module")
def dataset():
    return sim.run(SCENE)


@pytest.fixture
def file(dataset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sim.run(SCENE, to="out.nc").close()
    return tmp_path / "out.nc"


def test_importing_the_package_imports_nothing_heavy_and_dir_lists_what_is_public():
    heavy = "{'numpy', 'pydantic', 'xarray', 'matplotlib', 'click'}"
    code = f"import sys, sim; sim.run, sim.check, sim.stats, dir(sim); sys.exit(len({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
    for module in (sim, sim.read, sim.laws, sim.plots, sim.spectrum):
        assert set(dir(module)) == set(module.__all__)
        assert all(hasattr(module, name) for name in dir(module))
    assert sim.__version__ == version("sliding-sim")
    with pytest.raises(AttributeError, match="nothing"):
        sim.nothing  # noqa: B018


def test_a_scene_is_a_path_a_dictionary_or_keywords(dataset, tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(written(SCENE), encoding="utf-8")
    keywords = sim.Scenario(
        **{**SCENE, "drive": {"model": "ramp", "start": "0 mm/s", "stop": "10 mm/s"}}
    )
    for scene in (path, str(path), sim.load(SCENE), keywords):
        np.testing.assert_array_equal(
            sim.run(scene).contact_radius, dataset.contact_radius
        )


def test_a_run_into_a_file_is_replaced_only_if_asked(file, dataset, monkeypatch):
    with sim.open(file) as opened:
        np.testing.assert_array_equal(opened.contact_radius, dataset.contact_radius)
    with pytest.raises(sim.BadInput, match=r"out\.nc exists; .* replace=True"):
        sim.run(SCENE, to="out.nc")
    with sim.run(SCENE, to="out.nc", replace=True) as again:
        assert not again.contact_radius._in_memory and again.equals(dataset)
    trouble = StoreTrouble("out.nc: no space; repeat the command with --resume")
    monkeypatch.setattr("sim.ensemble.simulate.run", Mock(side_effect=trouble))
    with pytest.raises(StoreTrouble, match=r"^out\.nc: no space; .* resume=True"):
        sim.run(SCENE, to="out.nc")


def test_progress_is_told_to_a_function_or_shown_or_logged(capsys, caplog, monkeypatch):
    done = []
    sim.run(SCENE, progress=done.append)
    assert sum(done) == 11
    monkeypatch.setattr("time.monotonic", iter(range(0, 10_000, 31)).__next__)
    sim.run(SCENE, progress=True)
    assert "100 % of 11 member-steps" in capsys.readouterr().err
    with caplog.at_level("INFO", "sim"):
        sim.run({**SCENE, "solid": {"shear_modulus": "1.6 MPa", "poisson_ratio": 0.4}})
    assert (
        "poisson_ratio is not 0.5: the coupling of mean shear stress and pressure is neglected"
        in caplog.messages
    )
    assert any(line.startswith("100 % of 11 member-steps") for line in caplog.messages)
    assert capsys.readouterr() == ("", "")


def test_a_prescribed_speed_is_a_coordinate_for_users_and_a_quantity_for_statistics(
    file, dataset, tmp_path
):
    spring = {
        "model": "spring",
        "stage": "1 mm/s",
        "stiffness": "1 N/m",
        "damping": 10,
        "contact_stiffness": "rigid",
    }
    assert "speed" in sim.run({**SCENE, "drive": spring}).data_vars
    with sim.open(file) as opened, xr.open_dataset(file, decode_times=False) as plainly:
        variable = dataset.reset_coords("speed")
        expected = read.observables(variable), read.share_observables(variable)
        table = rows_of(variable)
        for found in (dataset, opened, plainly):
            assert "speed" in found.contact_area.coords
            assert (
                float(found.contact_area.swap_dims(t="speed").sel(speed=5e-3))
                == dataset.contact_area[5]
            )
            xr.testing.assert_identical(read.observables(found), expected[0])
            xr.testing.assert_identical(read.share_observables(found), expected[1])
            assert rows_of(found) == table
        opened.to_netcdf(tmp_path / "again.nc")
    with netCDF4.Dataset(file, "a"):  # as nothing holds it any longer
        pass
    assert "speed" in sim.open(tmp_path / "again.nc").coords


def test_check_reads_as_the_command_prints_and_a_scene_is_shown_in_a_line(tmp_path):
    (tmp_path / "x.toml").write_text(written(SCENE), encoding="utf-8")
    printed = CliRunner().invoke(cli, ["check", str(tmp_path / "x.toml")]).stdout
    assert (
        printed == f"{sim.check(tmp_path / 'x.toml')}\n" and "sphere.radius" in printed
    )
    assert repr(sim.check(SCENE)) == str(sim.check(SCENE))
    scene = sim.load(
        SCENE, {"sweep": {"contact.load": [1e-3, 2e-3]}, "ensemble.members": 3}
    )
    assert repr(scene).startswith('<Scenario "a <scene>": drive ramp') and repr(
        scene
    ).endswith("points 2>")


def test_a_value_of_a_sweep_is_chosen_by_its_key():
    models = [{"model": "none"}, {"model": "none", "stress": 3e5}]
    dataset = sim.run(
        {**SCENE, "sweep": {"contact.load": ["1 mN", "4 mN"], "bonds": models}}
    )
    for key, value in (("contact.load", "4 mN"), ("load", 4e-3)):
        found = sim.stats(dataset, where={key: value, "bonds": "none 2"})
        assert len(found) == dataset.sizes["t"]
        assert set(found["contact_load"]) == {4e-3}
    for where, words in (
        ({"radius": "2 mm"}, "not swept; swept: contact_load, bonds"),
        ({"load": "2 mm"}, "unit"),
        ({"contact.load": 1.0}, "there are: 1 mN, 4 mN"),
        ({"bonds": "rate"}, "no value rate; there are: none"),
    ):
        with pytest.raises(sim.BadInput, match=words):
            sim.plot(dataset, where=where)


def test_stats_are_a_data_frame_in_si_and_plot_draws_and_saves(file, dataset, tmp_path):
    for source in (file, str(file), dataset):
        table = sim.stats(source)
        np.testing.assert_array_equal(
            table["contact_radius"], dataset.contact_radius.to_numpy().ravel()
        )
        assert table.attrs["units"]["contact_radius"] == "m"
    assert sim.plot(dataset).axes
    sim.plot(file, "time", to=tmp_path / "time.png")
    assert (tmp_path / "time.png").stat().st_size > 1000
    with pytest.raises(sim.BadInput, match=r"known: .*curve"):
        sim.plot(dataset, "nothing")


def test_a_report_is_a_page_that_is_saved_if_a_file_is_named(file, dataset, tmp_path):
    page = sim.report(dataset, to=tmp_path / "first.html")
    assert (tmp_path / "first.html").read_text(encoding="utf-8") == page
    assert "<h1>a &lt;scene&gt;</h1>" in page and len(repr(page)) < 100
    shown = html.unescape(page._repr_html_().partition('srcdoc="')[2])
    assert shown.removesuffix('"></iframe>') == page
    for source in (file, str(file)):
        assert 'to="out.nc"' in html.unescape(sim.report(source))
    with pytest.raises(sim.BadInput, match="reads this file"):
        sim.report(file, to=file)
    with pytest.raises(sim.BadInput, match="not swept"):
        sim.report(file, where={"load": "1 mN"})


def test_converge_takes_a_budget_as_text(monkeypatch):
    monkeypatch.setattr(
        "sim.study.converge.converge", lambda scene, seconds, of: (scene.name, seconds)
    )
    assert sim.converge(SCENE, "2 min") == (SCENE["name"], 120.0)
    with pytest.raises(sim.BadInput, match=r"^budget 2 kg: .*not a unit of s"):
        sim.converge(SCENE, "2 kg")


TAKES_A_SCENE = {
    "load": sim.load,
    "run": sim.run,
    "check": sim.check,
    "converge": sim.converge,
    "fit": lambda scene: sim.fit(scene, "measured.csv", ["contact.load"]),
    "plan": lambda scene: sim.plan(scene, "points.csv", ["contact.load"]),
    "steady_curves": lambda scene: sim.steady_curves(scene, [1e-3]),
    "explore": sim.explore,
}
TAKES_A_DATASET = (sim.Run, sim.stats, sim.plot, sim.report, sim.methods)


def test_what_is_no_scenario_and_no_dataset_is_refused_with_its_type():
    for takes in TAKES_A_SCENE.values():
        with pytest.raises(sim.BadInput, match=r"^a scenario is a file .* type int$"):
            takes(3)
    for takes in TAKES_A_DATASET:
        for wrong in (3, None, xr.Dataset()):
            words = f"^is of type {type(wrong).__name__}, which no run has made"
            with pytest.raises(sim.BadInput, match=words):
                takes(wrong)
    with pytest.raises(sim.BadInput, match=r"^is of type str, which no run"):
        sim.Run("out.nc")
    with pytest.raises(sim.BadInput, match=r"^1: there is no such file"):
        sim.open(1)


def test_a_fault_of_a_scene_is_bad_input_with_its_key_and_cure():
    for use, key, cure in (
        (
            lambda: sim.Scenario(**{**SCENE, "sphere": {"raduis": 1}}),
            "sphere.raduis",
            '"radius"',
        ),
        (
            lambda: sim.load(SCENE, {"sphere.raduis": 1}),
            'overrides["sphere.raduis"]',
            '"radius"',
        ),
        (
            lambda: sim.load(SCENE).with_values({"contact.lod": 1}),
            "contact.lod",
            '"load"',
        ),
    ):
        with pytest.raises(sim.BadInput) as fault:
            use()
        (problem,) = fault.value.problems
        assert problem.startswith(key) and cure in problem
    swept = sim.Scenario(**SCENE, sweep={"clock.step": ["0.1 s", "0.2 s"]})
    with pytest.raises(sim.BadInput, match=r"clock\.record"):
        swept.points()
