"""Writes docs/dataset.md, every variable of a dataset, from the declarations in the code."""

import sys
from collections.abc import Iterable
from pathlib import Path

from sim.ensemble.variables import LARGEST
from sim.quantities import (
    DERIVED,
    ERRORS,
    MAP,
    NUMBERS,
    OF_MEMBERS,
    OF_PHASES,
    RECORDS,
    Definition,
)

TARGET = Path(__file__).with_name("dataset.md")
HEAD = """# The variables of a dataset

This page lists every variable of a dataset. The shortest example:

    sim run scenarios/pull_off.toml

```python
import sim

dataset = sim.open("outputs/pull_off.nc")
dataset.contact_area
```

All numbers are in SI units. Each variable has the attributes `units`, `long_name` and `symbol`. *Sweep* stands for the
dimensions of the sweep. Each is named as its key with an underscore for each dot (`contact_load`). A run without a
sweep has none. Made by `python docs/make_dataset.py` from the declarations in the code.
"""
SECTIONS = {
    "Coordinates": """If the drive prescribes the speed, `speed` is the same for all members and an auxiliary
coordinate: `dataset.contact_area.mean("member").plot(x="speed")`. Omit the mean if members do not differ.
""",
    "Recorded at each time": """A variable that differs between members has the dimension `member`, too.
With `per_member = false` it has the dimension `statistic` in its place: the mean, the standard deviation and the
standard error of the mean over the members, as in `dataset["contact_area"].sel(statistic="mean")`.
Members whose value is nan are omitted.

With `per_member = false` there is also `late_<name>`, for quantities that have a mean over time. Its dimension `late`
has four values:

- `mean` and `sem`: each member is averaged over the second half of the run. These are the mean and the standard error
  over the members.
- `drift` and `drift_sem`: the drift of a member is its mean over the last quarter of the run minus that over the third
  quarter. These are its mean and its standard error over the members.

Radius, area, load and friction are averaged over the times at which the contact is closed.

`speed` is the speed at the time of the record. In stick-slip it is mostly far below the speed of the stage, and rarely
far above it. `sim.Run(dataset).statistic("speed", late=True)` has its mean over the second half of the run.

A member has the same noise at all points of a sweep. The error of a difference between two points is therefore that of
the members' differences. It is often much smaller than the two errors added in quadrature:

```python
import sim

few = {"ensemble.members": 8}
loads = {"sweep": {"contact.load": ["1 mN", "4 mN"]}}
dataset = sim.run(sim.load("scenarios/pdms_lens.toml", few | loads))
change = sim.read.distribution(
    dataset, ["contact_area"], minus={"contact.load": "4 mN"}
)
change["contact_area"].value, change["contact_area"].sem
```

With the drives `spring` and `force`, energies balance. `drive_work` is the sum of three parts: the rise of
`stored_energy`, the energies `dissipated_by_...`, and `energy_residual`, the error of the integration.

The residual is compared with the larger of work and stored energy, at its largest since the start. The slider may have
returned nearly all of that energy at each record, if it rings. The ratio stays below ten times the largest `tolerance`
of the scenario, with two exceptions after thousands of sub-steps: `tracked` bonds, and a slider that rings without
damping. There the residual stays below 1e-3 of the largest energy of the run. `make verify` checks both limits on
random scenes.

No energy exceeds ten times the larger of work and stored energy, with one exception. `dissipated_by_area` is negative
while the area grows, because bonds that are gained are stretched as the others are (`bonds.area = "present"`). It
accumulates under a load that cycles behind a stage at rest.
""",
    "Numbers of the scene": """Every quantity of the scenario is a variable, too, named as its key with underscores.

Events are detected at the clock steps. They do not depend on the records.

`peak_time`, `peak_speed`, those of the friction and those of the phases are the ones at which the maximum was found.
Along a ramp bonds are late by up to half a clock step, which the tables take off as far as it is known:
`sim.Run(dataset).statistic("peak_speed")`.

A *phase* of a run is an interval in which no prescribed course turns, stops, starts or jumps. Within a phase, no
prescribed speed changes its sign. Examples are rest and sliding of a `start`, approach and retraction of each cycle.
If a run has several phases (at most 1,000), the events of each phase are recorded, too.

[Events](events.md) has the definition of a slip event and of each other event.

If members are kept, the first 1,000 slip events of each member are recorded one by one. Moments include all events.
With `per_member = false` an event that a member has at most once has a `<name>_count`, too. It is the number of members
with that event, over which the mean and its error are taken. (`slip_count` is the number of slip events of a member.)
""",
    "Known before the run": "Only some models of `[shear]` have these errors. The largest are attributes, too.\n",
    "Stress maps": """`dataset.shear_map[0, 0].plot(x="x")` draws a map with the sliding direction
horizontal. The command `sim plot OUT.nc map` does the same.
""",
}
FOLLOWING = """
## Quantities that follow from these

`sim stats` prints them, and `sim.Run(dataset).statistic(name)` has their statistics. A column is left out of a table
if it says nothing, such as the share of open contacts while all are closed. A value that is missing has its reason in
a note.
"""
OTHERS = """
## Other programs

**xarray** joins runs that differ in one key. The result has the form of a sweep of this key. Runs of
different seeds are joined along `member`. `sim.stats`, `sim.plot` and `sim.read` accept the joined dataset:

```python
import xarray

for name, value in [
    ("contact.load", "2 mN"),
    ("contact.load", "3 mN"),
    ("seed", 1),
    ("seed", 2),
]:
    sim.run(
        sim.load("scenarios/pdms_lens.toml", few | {name: value}),
        to=f"{name}_{value}.nc",
    )
by_load = {
    "concat_dim": "contact_load",
    "preprocess": lambda run: run.set_coords("contact_load"),
}
runs = xarray.open_mfdataset("contact.load_*.nc", combine="nested", **by_load)
seeds = xarray.open_mfdataset(
    "seed_*.nc",
    combine="nested",
    concat_dim="member",
    data_vars="minimal",
    coords="minimal",
    compat="override",
)
```

`open_mfdataset` needs dask, which `pip install '.[cluster]'` adds. Without dask, `xarray.concat` joins opened
runs: `xarray.concat([run.set_coords("contact_load") for run in runs], "contact_load")`, and for seeds
`xarray.concat(runs, "member", data_vars="minimal", coords="minimal", compat="override")`.

Attributes are those of the first run. `t` counts seconds and is no date. Therefore `dataset.resample` needs
`dataset.assign_coords(t=(1e9 * dataset.t).round().astype("timedelta64[ns]"))`.

**NCO.** `ncwa -a t out.nc mean.nc` and `ncwa -a member out.nc mean.nc` average over time and members, `nces a.nc b.nc
mean.nc` over runs. `ncra` averages over a record dimension, which comes first. A dataset has none, so that it must be
made:

    ncpdq -a t,member out.nc a.nc && ncks --mk_rec_dmn t a.nc b.nc
    ncra b.nc mean.nc

**CDO** recognises time only if it has a calendar. Without a calendar, `cdo timmean` averages nothing:

    ncatted -a units,t,o,c,"seconds since 2000-01-01" -a calendar,t,o,c,standard b.nc c.nc
    cdo timmean c.nc mean.nc

Here `b.nc` is the file made above. CDO reads up to two dimensions beside time. If there is a sweep, choose a point
first, by `ncwa -a contact_load -d contact_load,0`.
"""
MAPS, PHASES = "record.maps", "a run of several phases"
COORDINATES = (
    ("t", "s", "t", "time since the start", ""),
    (
        "member",
        "1",
        "member",
        "number of the ensemble member",
        "members differ and each is kept",
    ),
    (
        "slip",
        "1",
        "slip",
        "number of the slip event of a member",
        'drive.model = "spring", and each member is kept',
    ),
    (
        "statistic",
        "",
        "statistic",
        "mean, standard deviation and standard error over the members",
        "members are not kept",
    ),
    (
        "late",
        "",
        "late",
        "statistic of the members' means over the second half of the run",
        "members are not kept",
    ),
    ("phase", "1", "phase", "number of the phase", PHASES),
    ("phase_start", "s", "*sweep*, phase", "time at which a phase begins", PHASES),
    ("phase_end", "s", "*sweep*, phase", "time at which a phase ends", PHASES),
    (
        "phase_name",
        "",
        "*sweep*, phase",
        "course of drive and contact in a phase",
        PHASES,
    ),
    ("map_member", "1", "map_member", "member of a map", MAPS),
    ("map_time", "s", "map_time", "time of a map", MAPS),
    ("x", "m", "x", "position along the sliding direction", MAPS),
    ("y", "m", "y", "position across the sliding direction", MAPS),
)


def described(definition: Definition, dimensions: str) -> tuple[str, ...]:
    """The columns of a quantity."""
    row = definition
    return row.name, row.unit, dimensions, row.meaning, row.exists_when.words


def text() -> str:
    """The page."""
    where = "*sweep*, map_member, map_time"
    tables: tuple[Iterable[tuple[str, ...]], ...] = (
        COORDINATES,
        (described(definition, "*sweep*, t") for definition in RECORDS),
        [
            *(described(definition, "*sweep*") for definition in NUMBERS),
            *(
                described(
                    one.definition,
                    ", ".join(filter(None, ("*sweep*, member", one.axis))),
                )
                for one in LARGEST
            ),
        ],
        [
            (*described(definition, "*sweep*")[:4], "a periodic cell")
            for definition in ERRORS
        ],
        [(*described(MAP, f"{where}, x, y")[:4], MAPS)],
    )
    lines = [HEAD]
    for (title, note), rows in zip(SECTIONS.items(), tables, strict=True):
        lines += [
            f"\n## {title}\n",
            *([note] if note else []),
            "| name | unit | dimensions | meaning | there if |",
            "| --- " * 5 + "|",
        ]
        lines += [
            f"| `{name}` | {unit} | {dims} | {meaning} | {there} |"
            for name, unit, dims, meaning, there in rows
        ]
    lines += [
        FOLLOWING,
        "| name | unit | heading | meaning | reason if it is missing |",
        "| --- " * 5 + "|",
    ]
    lines += [
        f"| `{row.name}` | {row.unit} | {row.heading} | {row.meaning} | {row.absent} |"
        for row in (*DERIVED, *OF_MEMBERS, *OF_PHASES)
    ]
    return "\n".join(lines) + "\n" + OTHERS


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
