"""A statement stays the same, within its stated error, however a run is recorded, cut, joined or ordered.

Each statement of each scene is compared before and after each transformation. A statement may become unavailable,
then it has a reason or a bound that the other value keeps. Events, which the engine records, stay the same bit for bit.
"""

import functools
import math

import numpy as np
import pytest
import xarray as xr
from helpers.parts import read, run
from helpers.statements import each

import sim

LENS = {
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "contact": {"load": "4 mN"},
    "bonds": {
        "model": "rate",
        "critical_speed": "5 mm/s",
        "rebinding_rate": "500 1/s",
        "stress": "0.2 MPa",
    },
}
FIELD = {
    "model": "banded",
    "points": 64,
    "spectrum": {"model": "gaussian", "rms": "100 kPa", "length": "10 um"},
    "correlation": {"model": "slip", "length": "50 um"},
}
STRETCHED = {
    "model": "rate",
    "rupture": {"model": "bell", "zero_force_rate": "20 1/s", "bell_force": "4 pN"},
    "bond_stiffness": "0.8 uN/m",
    "rebinding_rate": "200 1/s",
    "site_density": "6e16 1/m^2",
}
PROBE = {
    "solid": {"shear_modulus": "1 MPa"},
    "sphere": {"radius": "5 um"},
    "adhesion": {"work": "20 mJ/m^2", "bond_share": 0.8},
    "drive": {"speed": "0 m/s"},
    "bonds": {
        "model": "tracked",
        "sites": 8,
        "rupture": {"model": "constant", "rate": "20 1/s"},
        "bond_stiffness": "1 mN/m",
        "rebinding_rate": "60 1/s",
        "site_density": "1e13 1/m^2",
    },
}
SPEEDS = ["0.3 mm/s", "1 mm/s", "2 mm/s", "4 mm/s", "8 mm/s", "16 mm/s", "32 mm/s"]
SCENES = {
    "ramp": LENS
    | {
        "clock": {"duration": "2 s", "step": "4 ms"},
        "ensemble": {"members": 6},
        "shear": FIELD,
        "drive": {"model": "ramp", "from": "0.1 mm/s", "to": "40 mm/s", "scale": "log"},
    },
    "speeds": LENS
    | {
        "clock": {"duration": "2 s", "step": "4 ms"},
        "ensemble": {"members": 6},
        "shear": FIELD,
        "drive": {"speed": "1 mm/s"},
        "sweep": {"drive.speed": SPEEDS},
    },
    "peak": LENS
    | {
        "clock": {"duration": "2 s", "step": "1 ms"},
        "bonds": STRETCHED | {"start": "empty"},
        "drive": {"model": "start", "rest": "0.5 s", "speed": "1 mm/s"},
    },
    "slips": LENS
    | {
        "clock": {"duration": "0.6 s", "step": "0.2 ms"},
        "bonds": STRETCHED,
        "drive": {
            "model": "spring",
            "stage": "5 mm/s",
            "stiffness": "150 N/m",
            "mass": "50 mg",
            "damping": "20 mN s/m",
        },
    },
    "cycles": PROBE
    | {
        "clock": {"duration": "4 s", "step": "2 ms"},
        "ensemble": {"members": 12},
        "contact": {
            "displacement": {"from": "0.1 um", "to": "-3 um", "cycles": 2},
            "stiffness": "0.3 N/m",
            "after_pull_off": "reattach",
        },
    },
    "lives": PROBE
    | {
        "clock": {"duration": "2 s", "step": "1 ms"},
        "ensemble": {"members": 40},
        "contact": {"load": "-250 nN"},
    },
    "creep": LENS
    | {
        "clock": {"duration": "1 s", "step": "1 ms"},
        "bonds": STRETCHED
        | {"rupture": STRETCHED["rupture"] | {"zero_force_rate": "5 1/s"}},
        "drive": {"model": "force", "force": "2 mN", "contact_stiffness": "rigid"},
    },
}
#: Statements that count or sum over a run, so that they grow with it.
GROWING = (
    "slip_count",
    "slip_spread",
    "pull_offs",
    "lowest_load",
    "detachments",
    "total_dissipated",
    "ever_detached",
    "onset_",
    "end_",
)
#: Least and largest values of a run, which a longer run exceeds.
ENDS = ("_least", "_largest")


def changed(scene, **tables):
    """Return a scene with some keys of its tables replaced."""
    return scene | {
        table: scene.get(table, {}) | keys for table, keys in tables.items()
    }


@functools.cache
def dataset_of(name):
    return run(sim.Scenario(**SCENES[name]))


def thinned(name, dataset, step):
    return dataset.isel(t=slice(None, None, step)) if step else dataset.isel(t=[0, -1])


def shuffled(name, dataset):
    return dataset.isel(drive_speed=[3, 0, 5, 1, 6, 4, 2])


def single(name, dataset):
    scene = SCENES[name] | {"drive": {"speed": SPEEDS[2]}}
    return run(
        sim.Scenario(**{key: table for key, table in scene.items() if key != "sweep"})
    )


def joined(name, dataset):
    half = dataset.sizes["member"] // 2
    parts = [
        dataset.isel(member=slice(0, half)),
        dataset.isel(member=slice(half, None)),
    ]
    return xr.concat(
        parts, "member", data_vars="minimal", coords="minimal", compat="override"
    )


def of_statistics(name, dataset):
    return run(sim.Scenario(**changed(SCENES[name], record={"per_member": False})))


def longer(name, dataset):
    duration = 2.0 * float(dataset["t"][-1])
    return run(sim.Scenario(**changed(SCENES[name], clock={"duration": duration})))


def more_cycles(name, dataset):
    contact = SCENES[name]["contact"]
    course = contact["displacement"] | {"cycles": 10}
    scene = changed(
        SCENES[name], clock={"duration": "20 s"}, contact={"displacement": course}
    )
    return run(sim.Scenario(**scene))


def more_speeds(name, dataset):
    speeds = np.geomspace(3e-4, 32e-3, 25)
    return run(
        sim.Scenario(
            **SCENES[name]
            | {"sweep": {"drive.speed": [float(speed) for speed in speeds]}}
        )
    )


def fewer_speeds(name, dataset):
    return dataset.isel(drive_speed=[0, 2, 4, 6])


CHANGES = [
    *(
        (
            name,
            f"records thinned by {step or 'all'}",
            functools.partial(thinned, step=step),
        )
        for name in SCENES
        for step in (2, 4, 8, 0)
    ),
    ("speeds", "shuffled", shuffled),
    ("speeds", "a single run", single),
    *(
        (name, "members joined", joined)
        for name in ("ramp", "speeds", "cycles", "lives")
    ),
    *(
        (name, "statistics of members", of_statistics)
        for name in ("ramp", "speeds", "cycles", "lives")
    ),
    *(
        (name, "twice as long", longer)
        for name in ("speeds", "slips", "lives", "creep")
    ),
    ("cycles", "ten cycles", more_cycles),
    ("speeds", "more speeds", more_speeds),
    ("speeds", "fewer speeds", fewer_speeds),
]


#: Changes that each test run looks at; the others take half a minute.
IN_SHORT = (
    ("peak", "records thinned by all"),
    ("slips", "records thinned by 8"),
    ("lives", "members joined"),
)


def by_name(dataset):
    """Return the statements of a dataset by their names and places in the sweep."""
    return {
        (
            one.name,
            *(
                str(np.round(value, 6)) if isinstance(value, float) else value
                for value in one.at.values()
            ),
        ): one
        for one in each(read.Run(dataset).statements())
    }


def half_width(statement):
    """Return half of the 95 % interval and the bound of the other error, 0 of an exact value."""
    ends = 0.5 * (statement.high - statement.low), statement.bound
    return sum(size for size in ends if not math.isnan(size))


def agree(first, second):
    """True if two statements are the same within their errors, or one says that it is not available."""
    values = first.value, second.value
    if first.reason or second.reason:
        return True
    if any(math.isnan(value) for value in values):
        bounds = [
            end
            for one in (first, second)
            for end in (one.low, one.high)
            if math.isfinite(end)
        ]
        return all(math.isnan(value) for value in values) or bool(bounds)
    return abs(values[0] - values[1]) <= 1.5 * (
        half_width(first) + half_width(second)
    ) + 1e-9 * max(map(abs, values))


def _case(name, words, change):
    in_short = (name, words) in IN_SHORT
    return pytest.param(
        name,
        change,
        id=f"{name}: {words}",
        marks=() if in_short else pytest.mark.verify,
    )


@pytest.mark.parametrize(("name", "change"), [_case(*case) for case in CHANGES])
def test_a_statement_stays_the_same_within_its_error(name, change):
    dataset = dataset_of(name)
    changed_run = change(name, dataset)
    if len(changed_run["contact_modulus"].dims) < len(dataset["contact_modulus"].dims):
        dataset = dataset.isel(drive_speed=2)
    before, after = by_name(dataset), by_name(changed_run)
    common = before.keys() & after.keys()
    if changed_run["t"][-1] > dataset["t"][-1]:
        common = [
            key
            for key in common
            if not key[0].startswith(GROWING) and not key[0].endswith(ENDS)
        ]
    assert len(common) > 5
    wrong = [
        f"{key}: {before[key]} | {after[key]}"
        for key in common
        if not agree(before[key], after[key])
    ]
    assert not wrong, "\n".join(sorted(wrong))
