"""A disk that fails at any call ends a run with a message and without half a file, and the run goes on afterwards."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.commands import SCENE
from helpers.faults import each

from sim.numerics import hdf5

COMPILER = shutil.which("cc") or shutil.which("gcc")
pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not COMPILER,
    reason="calls inside of HDF5 fail by a library that is loaded before libc, which takes Linux and a C compiler",
)
FOLDER = Path(each.__file__).parent


@pytest.fixture(scope="module")
def shim(tmp_path_factory):
    """The library that lets calls fail, compiled."""
    library = tmp_path_factory.mktemp("shim") / "shim.so"
    command = [
        COMPILER,
        "-shared",
        "-fPIC",
        "-O1",
        "-o",
        library,
        FOLDER / "shim.c",
        "-ldl",
    ]
    subprocess.run(list(map(str, command)), check=True)
    return library


def faults(shim, state, folder, task):
    """The summary of the faults of a command, none of which ended wrong."""
    state.write_bytes(bytes(each.STATE.size))
    environment = os.environ | {
        "FAULTS_STATE": str(state),
        "FAULTS_FOLDER": str(folder.resolve()),
        "LD_PRELOAD": str(shim),
        "PYTHONPATH": os.pathsep.join(
            [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        ),
    }
    command = [sys.executable, each.__file__, json.dumps(task | {"state": str(state)})]
    done = subprocess.run(
        command, env=environment, capture_output=True, encoding="utf-8"
    )
    assert not done.returncode, done.stderr
    *wrong, summary = map(json.loads, done.stdout.splitlines())
    assert not wrong
    return summary


# because each of some hundred faults of a large dataset starts a process
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    "all_of_them",
    [False, pytest.param(True, marks=pytest.mark.verify)],
    ids=["last", "all"],
)
@pytest.mark.parametrize(
    "large",
    [False, pytest.param(True, marks=pytest.mark.verify)],
    ids=["built in memory", "written part by part"],
)
def test_a_run_whose_disk_fails_ends_in_a_message_and_goes_on_with_resume(
    tmp_path, shim, large, all_of_them
):
    """A large dataset is written by HDF5 in a process of its own; all other calls are as for a small one."""
    scenario, state, folder = (
        tmp_path / "scene.toml",
        tmp_path / "state",
        tmp_path / "out",
    )
    scenario.write_text(SCENE.replace("members = 3", "members = 70"), encoding="utf-8")
    words = ["run", str(scenario), "-o", str(folder / "out.nc"), "--quiet", "-j", "1"]
    calls = ["pwrite", "ftruncate"] if large else each.CALLS
    task = {"calls": calls, "all_of_them": all_of_them, "words": words, "large": large}
    summary = faults(shim, state, folder, task | {"again": [*words, "--resume"]})
    assert summary["faults"] >= (
        (20 if large else 500) if all_of_them else len(calls) // 2
    )
    # else HDF5 has written to the disk by itself
    assert (summary["counts"]["pwrite"] > 0) == large


@pytest.mark.parametrize(
    "all_of_them",
    [False, pytest.param(True, marks=pytest.mark.verify)],
    ids=["last", "all"],
)
def test_a_study_whose_disk_fails_ends_in_a_message_and_keeps_older_files_or_replaces_them_whole(
    tmp_path, shim, all_of_them
):
    scenario, folder = tmp_path / "scene.toml", tmp_path / "out"
    scenario.write_text(SCENE, encoding="utf-8")
    words = [
        "converge",
        str(scenario),
        "-o",
        str(folder / "out.nc"),
        "--budget",
        "0.2 s",
        "--force",
    ]
    summary = faults(
        shim, tmp_path / "state", folder, {"all_of_them": all_of_them, "words": words}
    )
    # of open, write, fsync and rename at least
    assert summary["faults"] >= (60 if all_of_them else 4)
    # else HDF5 has written to the disk by itself, and crashes
    assert not summary["counts"]["pwrite"]


def test_this_system_gives_the_bytes_of_a_dataset_in_memory_and_an_unknown_one_has_none():
    assert hdf5.hdf5_gives_bytes()
    with pytest.raises(RuntimeError, match="HDF5"):
        hdf5.bytes_of("no such dataset")
