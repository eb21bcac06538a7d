"""What the benchmarks compute: rows and their page, intervals of ratios, and lines of code."""

import json
import math
import random
import re

import pytest
from helpers.cases import some

from benchmarks import page, run, timing
from benchmarks.compare import interval

RESULTS = json.loads(run.RESULTS.read_text(encoding="utf-8"))


#: Groups that start many processes, or run many scenes.
LONG = {"commands", "statistics", "sweeps"}


@pytest.mark.parametrize("group", some(run.GROUPS, *run.GROUPS.keys() - LONG))
def test_every_row_runs_and_is_kept(group):
    rows = run.GROUPS[group](timing.Bench(quick=True))
    assert [row.ours for row in rows] == [row["ours"] for row in RESULTS[group]["rows"]]
    for row in rows:
        assert all(map(math.isfinite, row.result)), row.ours
        assert all(0.0 < time < math.inf for time in row.seconds or row.result), row.ours


def test_the_page_of_speed_is_that_of_the_results():
    found = run.PAGE.read_text(encoding="utf-8")
    assert found == page.text(RESULTS), "run make bench"
    assert list(RESULTS) == list(run.GROUPS)
    assert len(re.findall(r"\| (?:yes|\*\*no\*\*) \|", found)) == sum(
        row.met is not None for row in page.rows_of(RESULTS)
    )


def test_the_interval_of_twenty_ratios_reaches_from_the_sixth_to_the_fifteenth():
    # 1 - 2 (1 + 20 + 190 + 1140 + 4845 + 15504)/2^20 = 0.9586; one ratio further in it would be 0.8847
    ratios = [float(n) for n in range(1, 21)]
    random.Random(1).shuffle(ratios)
    assert interval(ratios) == (6.0, 15.0)
    assert interval(ratios, confidence=0.88) == (7.0, 14.0)
    assert interval([1.0] * 5) == (-math.inf, math.inf)
    assert interval([3.0, 1.0, 2.0, 5.0, 4.0, 6.0]) == (1.0, 6.0)
