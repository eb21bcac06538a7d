"""Runs whose file operations fail below Python, or that are killed: nothing is lost, and the bytes stay the same."""

import errno
import shutil

import pytest

from benchmarks.reliability import FAIL, KILL, Campaign, Fault, Runs, campaign, table

pytestmark = [
    pytest.mark.verify,
    pytest.mark.skipif(shutil.which("cc") is None, reason="the faults are put in by a library that cc makes"),
]


@pytest.mark.parametrize(("name", "count", "least"), [("faults", 1, 1000), ("kills", 200, 200), ("limits", 40, 35)])
def test_what_befalls_a_run_changes_none_of_its_bytes(name, count, least):
    found = campaign(name, count)
    assert not found["problems"]
    assert sum(found["codes"].values()) >= least


def test_of_twenty_starts_on_one_output_one_runs():
    found = campaign("starts", 20)
    assert not found["problems"]
    assert found["codes"].pop("0") == 1
    assert found["codes"].keys() <= {"75", "73"}
    assert sum(found["codes"].values()) == 19


def test_a_campaign_finds_what_is_wrong(tmp_path):
    with Runs(tmp_path) as runs:
        done = Campaign(runs)
        done.files = done.files | {"out.nc": b"other"}
        done.history((Fault("killed", KILL), done.operations // 2, 1))
        assert len(done.problems) >= 1
        ended = runs.run(fault=Fault("full", FAIL, errno.ENOSPC, lasting=True), at=done.operations // 3)
        assert (ended.code, ended.fired) == (74, True)
        assert "No space left on device" in ended.said
    assert "| killed 1 |" in table({"one": {"what": "", "codes": dict(done.codes), "problems": done.problems}})
