"""Members whose motion is not resolved have a time and missing values, and a run with such members ends with 1."""

import os
import subprocess
import sys

import numpy as np
import pytest

import sim

#: Sub-steps are judged so early and so strictly that those of a body that rings hardly advance.
PROGRAM = """
import sys
from sim.parts.coupled import mechanics
mechanics._TURNS, mechanics._PROGRESS = 200, 1.0
from sim import cli
sys.argv = ["sim", *sys.argv[1:]]
cli.main()
"""
SCENE = """
clock = { duration = "20 ms", step = "10 ms" }
solid = { shear_modulus = "1 MPa" }
sphere = { radius = "1 mm" }
adhesion = { work = "30 mJ/m^2", bond_share = 0 }
drive = { model = "force", force = "0.2 mN", mass = "1 mg", contact_stiffness = "100 N/m" }
contact = { load = "0.1 mN" }
ensemble = { members = 2 }
[bonds]
MODEL
rupture = { model = "constant", rate = "0.3 1/s" }
bond_stiffness = "1 uN/m"
rebinding_rate = "3 1/s"
site_density = "1e17 1/m^2"
"""
#: Models of bonds by their loops, of which the last has noise.
MODELS = {
    "rate": 'model = "rate"',
    "cohort": 'model = "cohort"',
    "tracked": 'model = "tracked"\nsites = 50',
}


@pytest.mark.verify
@pytest.mark.parametrize("model", MODELS)
def test_a_motion_that_hardly_advances_ends_as_unresolved_and_the_run_ends_with_1(
    model, tmp_path
):
    scene, output = tmp_path / "scene.toml", tmp_path / "out.nc"
    scene.write_text(SCENE.replace("MODEL", MODELS[model]), encoding="utf-8")
    # because constants are compiled in
    environment = {**os.environ, "SIM_CACHE_DIR": str(tmp_path / "cache")}
    words = [
        sys.executable,
        "-c",
        PROGRAM,
        "run",
        str(scene),
        "-o",
        str(output),
        "-j",
        "1",
        "--quiet",
    ]
    ended = subprocess.run(words, env=environment, capture_output=True, text=True)
    assert ended.returncode == 1, ended.stderr
    assert "could not be resolved" in ended.stderr and "Traceback" not in ended.stderr
    with sim.open(output) as dataset:
        times = dataset["unresolved_time"].values
        assert np.all((times >= 0.0) & (times < 0.02))
        later = dataset.isel(t=-1)
        assert np.isnan(later["slider_position"]).all()
        assert np.isfinite(dataset["slider_position"].isel(t=0)).all()
        assert np.isnan(dataset["runaway_time"]).all()
