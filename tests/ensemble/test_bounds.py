"""What a run takes: known before it starts, refused where there is no room, and bounded."""

import json

from helpers.scenes import BONDS, CONTACTS, SHEARS, scene

from sim import analysis
from sim.ensemble import plan as plans
from sim.ensemble.outline import identity
from sim.ensemble.plan import Plan
from sim.ensemble.preview import remarks
from sim.ensemble.simulate import run
from sim.scenario.clock import Record


def sample(members=3, steps=9, **parts):
    defaults = {"shear": SHEARS["modal, slip, onset"], "bonds": BONDS["counted"], "contact": CONTACTS["load"]}
    return scene(members, steps, **(defaults | parts))


def test_members_whose_file_would_be_too_large_are_pooled_where_the_scenario_leaves_it_and_it_is_said(monkeypatch):
    open_, kept, pooled = sample(), sample(record=Record(per_member=True)), sample(record=Record(per_member=False))
    assert not any("per_member" in text for text in remarks(Plan.of(open_)))
    assert "member" in run(open_).dims
    bytes_of_all = 0.4 * (Plan.of(kept).bytes - plans._SCENARIO_BYTES)
    for most, each in ((1.01 * bytes_of_all, True), (0.99 * bytes_of_all, False)):
        monkeypatch.setattr(plans, "_MOST_BYTES", most)
        dataset, alike = run(open_), run(kept if each else pooled)
        assert ("member" in dataset.dims) == each == ("contact_radius" in dataset)
        assert sum("record.per_member = true" in text for text in remarks(Plan.of(open_))) == (not each)
        assert json.loads(dataset.attrs["scenario_resolved"])["record"]["per_member"] is each
        assert identity(dataset.attrs) == identity(alike.attrs)  # so that either goes on with the other
        assert analysis.table(dataset) == analysis.table(alike)
        assert "member" in run(kept).dims
