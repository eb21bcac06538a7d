"""Checksums beside a dataset: every flipped byte is found and placed, and what makes the dataset again is named."""

import os
import random
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from sim.cli import cli
from sim.ensemble import checksums, simulate as ensemble
from sim.ensemble.checksums import Damaged, damaged, path_of, read, verify
from sim.ensemble.part_files import OutputExists
from sim.scenario.reader import load
from sim.units.errors import BadInput

LENS = Path(__file__).parents[2] / "scenarios" / "pdms_lens.toml"
SHORT = {"clock": {"duration": "2 ms", "step": "1 ms"}, "ensemble.members": 2, "seed": 7}


@pytest.fixture
def dataset(tmp_path):
    return ensemble.run(load(LENS, SHORT), tmp_path / "out.nc")


def flipped(path, place):
    with open(path, "r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 1 << place % 8]))


def test_a_thousand_flipped_bytes_are_found_where_they_are(dataset, monkeypatch):
    monkeypatch.setattr(checksums, "STRETCH", 256)
    whole = dataset.read_bytes()
    wanted = checksums.Checksums("", "", len(whole), list(checksums._digests(dataset)))
    for place in random.Random(5).sample(range(len(whole)), 1000):
        flipped(dataset, place)
        [found] = damaged(dataset, wanted)
        assert place in found and len(found) <= 256
        flipped(dataset, place)
    assert dataset.read_bytes() == whole and damaged(dataset, wanted) == []


@pytest.mark.parametrize(
    ("harm", "ranges"),
    [
        (lambda whole: whole[:-1], lambda size: [range(size - size % 256, size)]),
        (lambda whole: b"", lambda size: [range(size)]),
        (lambda whole: whole + bytes(1000), lambda size: [range(size - size % 256, size + 1000)]),
        (
            lambda whole: bytes(255 - byte for byte in whole[:700]) + whole[700:-1] + bytes([whole[-1] ^ 1]),
            lambda size: [range(768), range(size - size % 256, size)],
        ),
    ],
)
def test_what_is_lost_or_added_is_found_and_neighbours_are_one_range(dataset, monkeypatch, harm, ranges):
    monkeypatch.setattr(checksums, "STRETCH", 256)
    whole = dataset.read_bytes()
    wanted = checksums.Checksums("", "", len(whole), list(checksums._digests(dataset)))
    dataset.write_bytes(harm(whole))
    assert damaged(dataset, wanted) == ranges(len(whole))


def test_the_command_that_is_named_makes_the_same_bytes(dataset):
    whole, beside = dataset.read_bytes(), path_of(dataset).read_bytes()
    assert f"all {len(whole):,} bytes" in verify(dataset)
    flipped(dataset, len(whole) - 1)
    with pytest.raises(Damaged, match=f"bytes 0 to {len(whole) - 1:,} are damaged") as trouble:
        verify(dataset)
    words = shlex.split(str(trouble.value).splitlines()[-1])
    assert words[:3] == ["sim", "run", str(LENS)] and words[-3:] == ["--force", "-o", str(dataset)]
    done = CliRunner().invoke(cli, [*words[1:], "--quiet"])
    assert done.exit_code == 0, done.output
    assert dataset.read_bytes() == whole and path_of(dataset).read_bytes() == beside


def test_lost_or_damaged_checksums_are_reported(dataset):
    place = path_of(dataset)
    sums = place.read_bytes()
    for number in range(0, len(sums), 7):
        flipped(place, number)
        assert read(place) is None
        flipped(place, number)
    flipped(place, 99)
    with pytest.raises(Damaged, match=r"sha256 is damaged or not of a run, so that .* cannot be checked"):
        verify(dataset)
    place.unlink()
    with pytest.raises(Damaged, match=r"out\.nc\.sha256 is lost, so .*with --force"):
        verify(dataset)


@pytest.mark.parametrize("line", ["command: \x1b]0;x\x07", "command: \u202e", f"command: {'x' * 70_000}"])
def test_checksums_of_others_print_nothing_but_plain_text(dataset, line):
    _, *rest, _, _ = path_of(dataset).read_text().split("\n")
    lines = "\n".join([checksums._FIRST, line, *rest[1:], ""]).encode()
    path_of(dataset).write_bytes(checksums._closed(lines))
    assert read(path_of(dataset)) is None
    lines = "\n".join([checksums._FIRST, "command: plain", *rest[1:], ""]).encode()
    path_of(dataset).write_bytes(checksums._closed(lines))
    assert read(path_of(dataset)).command == "plain"


def test_a_file_of_others_in_their_place_is_not_replaced(tmp_path):
    place = tmp_path / "out.nc.sha256"
    for make in (lambda: place.write_text("mine"), place.mkdir, lambda: place.symlink_to("elsewhere")):
        make()
        with pytest.raises(OutputExists, match="holds no checksums of a run; move it away"):
            ensemble.run(load(LENS, SHORT), tmp_path / "out.nc", replace=True, progress=lambda done: 1 / 0)
        place.rename(tmp_path / str(make).replace("/", ""))
    with pytest.raises(OutputExists, match="holds no checksums of a run"):
        ensemble.run(load(LENS, SHORT), tmp_path / "out.nc", progress=lambda done: place.write_text("mine"))
    assert place.read_text() == "mine" and not (tmp_path / "out.nc").exists()
    place.unlink()
    assert ensemble.run(load(LENS, SHORT), tmp_path / "out.nc", resume=True).exists()


def test_a_run_that_ended_between_dataset_and_checksums_is_named_and_mended(dataset, monkeypatch):
    whole, sums = dataset.read_bytes(), path_of(dataset).read_bytes()
    path_of(dataset).write_bytes(checksums.content(LENS, {}, {}))  # of an older output
    for older in (True, False):
        if not older:
            dataset.unlink()
            path_of(dataset).unlink()
        with monkeypatch.context() as patched, pytest.raises(ZeroDivisionError):
            moved, move = iter((0, 1)), os.replace

            def second(path, target, moved=moved, move=move):
                if path.name.startswith("dataset.nc"):
                    1 / (1 - next(moved))
                move(path, target)

            patched.setattr(os, "replace", second)
            ensemble.run(load(LENS, SHORT), dataset, replace=older)
        assert dataset.read_bytes() == whole and dataset.with_name("out.nc.parts").exists()
        with pytest.raises(Damaged, match="--resume makes it whole"):
            verify(dataset)
        ensemble.run(load(LENS, SHORT), dataset, resume=True)
        assert (dataset.read_bytes(), path_of(dataset).read_bytes()) == (whole, sums)
        assert sorted(path.name for path in dataset.parent.iterdir()) == ["out.nc", "out.nc.sha256"]


def test_a_dataset_that_is_not_there_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match="there is no such file"):
        verify(tmp_path / "out.nc")
