"""The archives of a release: a wheel and the sources."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EPOCH = 1_800_000_000
#: What a folder of the sources may hold beside them.
LEFT = shutil.ignore_patterns(
    ".*", "__pycache__", "*.egg-info", "_build", "_api", "build", "dist", "outputs"
)


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """The archives of two copies of the sources, each as paths by their suffixes."""
    result = []
    for turn in ("first", "second"):
        folder = tmp_path_factory.mktemp(turn) / turn
        # with times of their own
        shutil.copytree(ROOT, folder, ignore=LEFT, copy_function=shutil.copy)
        command = [sys.executable, "-m", "build", "--no-isolation", str(folder)]
        environment = {**os.environ, "SOURCE_DATE_EPOCH": str(EPOCH)}
        process = subprocess.run(
            command, env=environment, capture_output=True, text=True
        )
        assert process.returncode == 0, process.stderr
        result.append({path.suffix: path for path in (folder / "dist").iterdir()})
    return result


@pytest.mark.verify
@pytest.mark.parametrize("suffix", [".whl", ".gz"])
def test_an_archive_that_is_built_twice_has_the_same_bytes(archives, suffix):
    first, second = archives
    assert first[suffix].read_bytes() == second[suffix].read_bytes()


@pytest.mark.verify
def test_the_archives_hold_the_package_and_what_builds_and_tests_it(archives):
    with zipfile.ZipFile(archives[0][".whl"]) as wheel:
        packed = {name for name in wheel.namelist() if name.startswith("sim/")}
    files = (
        path
        for path in (ROOT / "sim").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    )
    assert packed == {path.relative_to(ROOT).as_posix() for path in files}
    with tarfile.open(archives[0][".gz"]) as sources:
        members = sources.getmembers()
    assert {member.mtime for member in members} == {EPOCH}
    inside = {member.name.partition("/")[2] for member in members}
    assert (
        packed
        | {
            "pyproject.toml",
            "setup.py",
            "tests/test_archives.py",
            "scenarios/pdms_lens.toml",
        }
        <= inside
    )
