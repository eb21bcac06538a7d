"""Runs that are not done, by the folder of their parts: what they run, what they lack, and shards put together."""

from dataclasses import replace as changed
from pathlib import Path

from pydantic import TypeAdapter

from sim.ensemble.outline import attributes, identity
from sim.ensemble.part_files import (
    WHOLE,
    Manifest,
    OutputExists,
    PartFiles,
    Shard,
    Stopped,
    gathered,
    manifest_of,
    refuse_other,
)  # fmt: skip
from sim.ensemble.plan import Plan
from sim.ensemble.simulate import run
from sim.scenario.scenario import Scenario
from sim.scenario.source import Source
from sim.units.kept import digest

#: Shards that a message names.
_MOST_NAMED = 20


def merge(target: Path, replace: bool = False) -> Path:
    """Make the file of a run of which all shards are done; it is that of an undivided run.

    Raises
    ------
    OutputExists
        If the file is there and is not to be replaced.
    OutputBusy
        If a shard is being run.
    BadInput
        If there are no shards, or they are of different runs, or of other versions.
    Stopped
        If shards are not done: with what each lacks.
    """
    target = target.resolve() if target.is_symlink() else target
    with gathered(target) as (whole, shards):
        found = {parts.folder: manifest_of(parts.folder) for parts in (whole, *shards.values())}
        manifests = {folder: manifest for folder, manifest in found.items() if manifest}
        scenario = scenario_of(next(iter(manifests.values())))
        plan = Plan.of(scenario)
        now = {"run": identity(attributes(plan)), "code": digest().hex()}
        for folder, manifest in manifests.items():
            refuse_other(folder, manifest, now)
        if lacking := _lacking(plan, whole, shards):
            cure = "run it with --resume, then merge again"
            raise Stopped("\n".join([*lacking[:_MOST_NAMED], *(["..."] if lacking[_MOST_NAMED:] else []), cure]))
        replace = replace or any(manifest["replace"] for manifest in manifests.values())
        if target.exists() and not replace:
            raise OutputExists(f"{target} exists; replace it with --force")
        whole.adopt(shards.values(), replace and target.exists())
    return run(scenario, target, replace=replace, resume=True)


def scenario_of(manifest: Manifest) -> Scenario:
    """The scenario of a run by its manifest."""
    scenario = TypeAdapter(Scenario).validate_python(manifest["run"]["scenario"])
    return changed(scenario, source=Source(**manifest["source"]))


def _lacking(plan: Plan, whole: PartFiles, shards: dict[Shard, PartFiles]) -> list[str]:
    """For each shard that is not done how many of its parts are lost, damaged or not computed yet."""
    of = next(iter(shards), WHOLE)[1]
    said = []
    for number in range(1, of + 1):
        names = [name for task in plan.share(number, of) for name in task.names]
        kept = [whole, *(parts for parts in [shards.get((number, of))] if parts)]
        lost = sum(not any(parts.sound(name) for parts in kept) for name in names)
        if lost:
            said.append(f"shard {number}/{of} lacks {lost:,} of {len(names):,} parts")
    return said
