"""The datasets keep the Climate and Forecast conventions, as their own checker sees it."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.scenes import BONDS, CELL, SPECTRUM, scene

from sim.ensemble.simulate import run
from sim.parts.shear import models as shear
from sim.parts.shear.process import Slip
from sim.scenario.clock import Record
from sim.scenario.reader import load
from sim.scenario.scenario import read_sweep

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))


def check(path):
    """No remark of the checker but one it must make.

    It takes every coordinate in units of pressure for a height, and recommends (the conventions require
    nothing there) that heights stand right of the time: a swept stress or modulus stands left of it.
    """
    checker = Path(sys.executable).with_name("compliance-checker")
    done = subprocess.run([checker, "--test=cf:1.11", path], capture_output=True, text=True, timeout=600)
    assert "IOOS Compliance Checker Report" in done.stdout, done.stderr
    remarks = [line for line in done.stdout.splitlines() if line.startswith("* ")]
    assert [line for line in remarks if "recommended order T, Z, Y, X" not in line] == []
    assert remarks or "All tests passed" in done.stdout


@pytest.mark.verify
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_gives_a_conforming_dataset(path, tmp_path):
    check(run(load(path, {"ensemble.members": 2}), tmp_path / "out.nc"))


@pytest.mark.verify
@pytest.mark.parametrize("per_member", [True, False])
def test_maps_labels_and_statistics_conform(per_member, tmp_path):
    mapped = shear.Mapped(spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=3e-6))
    scenario = scene(
        3, shear=mapped, bonds=BONDS["counted"], record=Record(maps=(2e-3,), map_members=2, per_member=per_member)
    )
    sweep = read_sweep(
        {"bonds": [{"model": "none"}, {"model": "steady", "critical_speed": "1 cm/s"}], "contact.load": [1e-3, 2e-3]}
    )
    check(run(replace(scenario, sweep=sweep), tmp_path / "out.nc"))
