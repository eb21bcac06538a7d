"""Damaged and hostile files of four kinds: each is used, or refused in plain words and with exit code 2."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import hostile

ROOT = Path(__file__).parents[1]
#: Files of each kind, ten thousand in all, and how many one process reads.
COUNTS = {"scenario": 4000, "table": 2500, "map": 2500, "dataset": 1000}
BATCH = 250


@pytest.mark.filterwarnings("ignore")  # of numbers beyond all measure
@pytest.mark.parametrize("kind", ["table", "map", "dataset"])  # tests/scenario/test_fuzz.py has the scenarios
def test_some_damaged_files_are_used_or_refused_in_plain_words(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    # seeds beyond those of the thousands; of the datasets one has a page, the others `sim stats` alone
    for _, seed, _, _, wrong in hostile.answers(kind, range(10_001, 10_007), tmp_path):
        assert wrong == "", seed


@pytest.mark.verify
@pytest.mark.parametrize("kind", hostile.KINDS)
def test_thousands_of_damaged_files_end_without_traceback_crash_or_20_s_or_1_gib(kind):
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    for first in range(0, COUNTS[kind], BATCH):
        run = [sys.executable, "-m", "helpers.hostile", kind, str(first), str(BATCH)]
        done = subprocess.run(
            run, cwd=ROOT, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
        )
        answers = [json.loads(line) for line in done.stdout.splitlines()]
        assert (done.returncode, len(answers)) == (0, BATCH), (answers[-1:], done.stderr[-2000:])
        assert not [answer for answer in answers if answer[4]]
        assert max(answer[5] for answer in answers) < hostile.MEMORY
