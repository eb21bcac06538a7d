"""Writes docs/dataset.md, every variable of a dataset, from the declarations in the code."""

import sys
from collections.abc import Iterable
from pathlib import Path

from sim.ensemble.variables import DISC_ENERGIES, KNOWN_ERRORS, LARGEST, MAP, NUMBERS, SYSTEMATIC, VARIABLES

TARGET = Path(__file__).with_name("dataset.md")
HEAD = """# The variables of a dataset

Made by `python docs/make_dataset.py` from the declarations in the code. All numbers are in SI units; each variable has
the attributes `units`, `long_name` and `symbol`. *Sweep* stands for the dimensions of the sweep, each named as its key
with an underscore for each dot (`contact_load`); a run without a sweep has none.
"""
SECTIONS = {
    "Coordinates": """`speed` is an auxiliary coordinate, too, where it is the same for all members, as it is if a drive
prescribes it: `dataset.contact_area.mean("member").plot(x="speed")`, without the mean where members do not differ.
""",
    "Recorded at each time": """A variable that differs between members has the dimension `member`, too. With
`per_member = false` it becomes `<name>_mean`, `<name>_std` and `<name>_sem` instead: mean, standard deviation and
standard error of the mean over the members, without members of which the value is nan.

Then there is also `late_<name>`, of quantities that have a mean over time. Its dimension `late` has four values. `mean`
and `sem` are mean and standard error over the members' means over the second half of the run. `drift` and `drift_sem`
are those of their drift, the mean over the last quarter of the run less that over the third. Radius, area, load and
friction count while the contact is closed.

A member has the same noise at all points of a sweep. So the error of a difference between two points is that of the
members' differences, often far below the two errors combined:

```python
change = sim.analysis.distribution(dataset, ["contact_area"], minus={"contact.load": "4 mN"})
change.contact_area_mean, change.contact_area_sem
```

Under a drive that feels the friction `drive_work` is the rise of `stored_energy`, the energies `dissipated_by_...` and
`energy_residual`, the error of the integration. It stays below ten times the largest `tolerance` of the scene, of the
larger of work and stored energy, the largest since the start. A body that rings may have given back nearly all of that
at each record. With `tracked` bonds, and with a body that rings without damping, the residual may be larger after
thousands of sub-steps (up to 4e-5 and 3e-4 at the default tolerance in scenes tried).
No energy exceeds ten times the larger of the two, with this exception: `dissipated_by_area` is negative while the area
grows, because bonds that are gained are stretched as the others are (`bonds.area = "present"`). Under a load that
cycles behind a stage at rest it adds up.
""",
    "Numbers of the scene": """Every quantity of the scenario is a variable, too, named as its key with underscores.

Events are seen by the engine at its clock steps, whatever the records. A *phase* of a run is an interval in which no
prescribed course turns, stops, starts or jumps, and no prescribed speed changes its sign: rest and sliding of a
`start`, approach and retraction of each cycle. If a run has several, at most 1,000, events of each are kept, too.

A *slip event* is a fall of the spring force by
more than 0.3 of the largest force so far, from its maximum to the next minimum, during which the interface slips at
least half of the slider's advance. The minimum is known once the force has risen again by 0.1 of the largest. A stage
that stops or turns back ends a fall without an event. The first 1,000 events of a member are kept one by one, if
members are; moments are those of all. With `per_member = false` an event has a `<name>_count`, too: the number of
members that had it, of which the mean and its error are.
""",
    "Known before the run": "As far as the model of `[shear]` has them. The largest errors are attributes, too.\n",
    "Stress maps": """`dataset.shear_map[0, 0].plot(x="x")` draws a map with the sliding direction across, as
`sim plot OUT.nc map` does.
""",
}
OTHERS = """
## Other programs

**xarray.** Runs that differ in a key are joined along it, as a sweep of that key would be, and runs of different seeds
along `member`; `sim.stats`, `sim.plot` and `sim.analysis` take what is joined:

```python
runs = xarray.open_mfdataset(
    paths, combine="nested", concat_dim="contact_load", preprocess=lambda run: run.set_coords("contact_load")
)
seeds = xarray.open_mfdataset(
    paths, combine="nested", concat_dim="member", data_vars="minimal", coords="minimal", compat="override"
)
```

`open_mfdataset` needs dask, which `pip install 'sliding-sim[cluster]'` adds. Without dask, `xarray.concat` joins the
runs that `[sim.open(path) for path in paths]` has opened, with the same options.

Attributes are those of the first run. `t` counts seconds and is no date: `dataset.resample` needs
`dataset.assign_coords(t=(1e9 * dataset.t).round().astype("timedelta64[ns]"))`.

**NCO.** `ncwa -a t out.nc mean.nc` and `ncwa -a member out.nc mean.nc` average over time and members, `nces a.nc b.nc
mean.nc` over runs. `ncra` averages over a record dimension, which comes first, and a dataset has none:

    ncpdq -a t,member out.nc a.nc && ncks --mk_rec_dmn t a.nc b.nc
    ncra b.nc mean.nc

**CDO** takes for time only what has a calendar; without, `cdo timmean` averages nothing:

    ncatted -a units,t,o,c,"seconds since 2000-01-01" -a calendar,t,o,c,standard b.nc c.nc
    cdo timmean c.nc mean.nc

with `b.nc` as above. It reads up to two dimensions beside time: of a sweep choose a point first, by
`ncwa -a contact_load -d contact_load,0`.
"""
MAPS, PHASES = "record.maps", "a run of several phases"
COORDINATES = (
    ("t", "s", "t", "time since the start", ""),
    ("member", "1", "member", "number of the ensemble member", "members differ and each is kept"),
    ("slip", "1", "slip", "number of the slip event of a member", 'drive.model = "spring", and each member is kept'),
    ("late", "", "late", "statistic of the members' means over the second half of the run", "members are not kept"),
    ("phase", "1", "phase", "number of the phase", PHASES),
    ("phase_start", "s", "*sweep*, phase", "time at which a phase begins", PHASES),
    ("phase_end", "s", "*sweep*, phase", "time at which a phase ends", PHASES),
    ("phase_name", "", "*sweep*, phase", "course of drive and contact in a phase", PHASES),
    ("map_member", "1", "map_member", "member of a map", MAPS),
    ("map_time", "s", "map_time", "time of a map", MAPS),
    ("x", "m", "x", "position along the sliding direction", MAPS),
    ("y", "m", "y", "position across the sliding direction", MAPS),
)


def text() -> str:
    """The page."""
    where = "*sweep*, map_member, map_time"
    tables: tuple[Iterable[tuple[str, ...]], ...] = (
        COORDINATES,
        ((v.name, v.unit, "*sweep*, t", v.long_name, v.condition) for v in VARIABLES),
        [
            *((n.name, n.unit, "*sweep*", n.long_name, n.condition) for n in NUMBERS),
            *(
                (
                    one.name,
                    one.unit,
                    ", ".join(filter(None, ("*sweep*, member", one.axis))),
                    one.long_name,
                    one.condition,
                )
                for one in LARGEST
            ),
        ],
        [
            *((name, "1", "*sweep*", meaning, "") for name, meaning in KNOWN_ERRORS.items()),
            *((name, unit, "*sweep*", meaning, "a periodic cell") for name, (unit, meaning) in SYSTEMATIC.items()),
        ],
        [
            (MAP[0], MAP[1], f"{where}, x, y", MAP[2], MAPS),
            *(
                (name, unit, where, meaning, f'{MAPS}, shear.contact = "disc"')
                for name, unit, meaning, _ in DISC_ENERGIES
            ),
        ],
    )
    lines = [HEAD]
    for (title, note), rows in zip(SECTIONS.items(), tables, strict=True):
        lines += [
            f"\n## {title}\n",
            *([note] if note else []),
            "| name | unit | dimensions | meaning | there if |",
            "| --- " * 5 + "|",
        ]
        lines += [f"| `{name}` | {unit} | {dims} | {meaning} | {there} |" for name, unit, dims, meaning, there in rows]
    return "\n".join(lines) + "\n" + OTHERS


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
