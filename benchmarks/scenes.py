"""Scenes of the benchmarks: tables of a lens as a scenario names them, and programs that run them."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

Tables = dict[str, Any]

LENS: Tables = {
    "seed": 5,
    "clock": {"duration": "20 ms", "step": "1 ms"},
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "contact": {"load": "4 mN"},
    "ensemble": {"members": 3},
}
RAMP = {"model": "ramp", "from": 1e-5, "to": 0.1, "scale": "log"}
SPRING = {"model": "spring", "stage": 2e-2, "stiffness": 100.0, "start": "steady"}

BELL = {"model": "bell", "zero_force_rate": 200.0, "bell_force": 4e-12}
STRETCHED = {"bond_stiffness": 4e-7, "rebinding_rate": 400.0, "site_density": 1e17}
STEADY = {"model": "steady", "critical_speed": 1e-2, "stress": 2e5}
RATE = STEADY | {"model": "rate", "rebinding_rate": 500.0}
COUNTED = RATE | {"model": "counted", "sites": 40}
COHORT = STRETCHED | {"model": "cohort", "rupture": BELL, "tolerance": 1e-3}
TRACKED = STRETCHED | {"model": "tracked", "rupture": BELL, "sites": 30}

SLIP = {"model": "slip", "length": 5e-6}
ONSET = {"model": "onset", "speed": 2.5e-3, "width": 0.3, "floor": 0.05}
ROUGH = {
    "model": "self_affine",
    "rms": 1e5,
    "hurst": 0.8,
    "longest": 60e-6,
    "rolloff": 24e-6,
    "shortest": 2.5e-6,
}
FIELD = {"spectrum": ROUGH, "cell": 0.24e-3, "correlation": SLIP, "amplitude": ONSET}
BANDED = FIELD | {"model": "banded", "tolerance": 0.01}

BAND = {"model": "band", "rms": 120e3, "longest": 120e-6, "shortest": 60e-6}
GAUSSIAN = {"model": "gaussian", "rms": 1e5, "length": 5e-6}
TABULATED = {
    "model": "tabulated",
    "wavenumbers": [1e5, 3e5, 1e6],
    "densities": [3e-2, 1e-2, 1e-4],
}
SPECTRA = [
    {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6},
    BAND,
    ROUGH | {"longest": 120e-6, "rolloff": 60e-6, "shortest": 30e-6},
    GAUSSIAN,
    {
        "model": "anisotropic_gaussian",
        "rms": 1e5,
        "length_x": 5e-6,
        "length_y": 9e-6,
        "angle": 0.3,
    },
    {"model": "von_karman", "rms": 1e5, "hurst": 0.5, "length": 5e-6},
    TABULATED,
]
CELL = {"cell": 0.24e-3, "points": 80, "correlation": SLIP}
JUMPING_SPEED = {
    "model": "table",
    "time": [0, 3e-3, 3e-3, 20e-3],
    "speed": [1e-3, 1e-3, 2e-2, 0],
}
COUNTER_BODY = {"youngs_modulus": "1 GPa", "poisson_ratio": 0.3}
FIELDS = [
    {"model": "mean", "amplitude": {"model": "stress", "reference": 2e5}},
    CELL | {"model": "modal"},
    CELL | {"model": "banded"},
    CELL | {"model": "mapped"},
]
#: Changes of the lens with models that neither the scenarios nor the random scenes of the tests hold.
RARE: dict[str, Tables] = {
    "spectra": {
        "drive": JUMPING_SPEED,
        "bonds": RATE,
        "sweep": {
            "shear": [
                field | {"spectrum": spectrum}
                for field in FIELDS
                for spectrum in SPECTRA
            ]
        },
    },
    "auto, two bodies": {
        "solid": {"counter_body": COUNTER_BODY},
        "drive": RAMP,
        "bonds": STRETCHED | {"model": "auto", "rupture": BELL},
        "shear": CELL | {"model": "auto", "spectrum": BAND},
        "sweep": {"bonds.sites": [20, 10**6], "contact.load": [1e-3, 4e-3]},
    },
}


def tables(name: str, changes: Tables) -> Tables:
    """Return the tables of a lens with changes in some of them."""
    scene = LENS | {"name": name}
    for key, table in changes.items():
        scene[key] = (
            {**scene.get(key, {}), **table} if isinstance(table, dict) else table
        )
    if {"displacement", "indentation"} & scene["contact"].keys():
        scene["contact"] = {
            key: value for key, value in scene["contact"].items() if key != "load"
        }
    return scene


def gathered(root: Path, count: int) -> dict[str, Any]:
    """Return the paths of all scenarios of a tree, tables of rare models, and ``count`` random scenes."""
    sys.path.append(str(root / "tests"))
    from helpers.corner_scenes import corner_scene
    from helpers.random_scenes import random_scene

    paths = [*sorted(root.glob("scenarios/*.toml")), root / "sim" / "starter.toml"]
    result: dict[str, Any] = {path.stem: str(path) for path in paths}
    result |= {name: tables(name, changes) for name, changes in RARE.items()}
    result |= {f"random {seed}": random_scene(seed) for seed in range(count // 2)}
    corners = range(count - count // 2)
    return result | {f"corner {seed}": corner_scene(seed) for seed in corners}


def lens(members: int, steps: int, every: int = 1, **parts: Tables) -> Tables:
    """Return a lens of so many members and steps of 1 ms, each ``every``-th of them recorded."""
    clock = {"duration": f"{steps} ms", "step": "1 ms", "record": f"{every} ms"}
    return tables("a lens", {"clock": clock, "ensemble": {"members": members}} | parts)


def field(model: str, points: int = 512, **more: Any) -> Tables:
    """Return the fluctuations on a grid, whose spectrum ends where the grid does: at 1 µm with 512 points."""
    return (
        FIELD
        | {
            "model": model,
            "points": points,
            "spectrum": ROUGH | {"shortest": 512e-6 / points},
        }
        | more
    )


def followed(scene: Tables) -> Callable[[], object]:
    """Return a program that advances all members of a scene to its end, as a run does."""
    import numpy as np

    import sim
    from sim.step.state import MemberNoise

    of = sim.load(scene)
    noise = MemberNoise.of(of.seed, np.arange(of.ensemble.members))
    steps = range(0, of.clock.steps + 1, of.clock.stride)
    return lambda: of.stepper.follow(noise, None, steps)


def steady(speed: float, step: float, steps: int) -> tuple[Any, Any]:
    """Return the start and the motion of steady sliding, in steps of a length [s]."""
    from sim.parts.drive import Steady
    from sim.parts.exchange import Times

    times, drive = Times(step, steps, step * steps), Steady(speed=speed)
    slider, first = drive.begin(times, 1)
    return first, drive.advance(slider, times, range(1, steps + 1))[1]


def written(scene: Tables, path: Path) -> Path:
    """Write a scene as a scenario file; return its path."""
    from sim.scenario import files

    path.write_text(files.written(scene), encoding="utf-8")
    return path


def tiled(dataset: Any, path: Path, times: int) -> None:
    """Write a dataset whose records come again and again, one variable after the other and without compression."""
    import netCDF4
    import numpy as np

    step = float(dataset.t[1] - dataset.t[0])
    alone = dataset.drop_vars(
        [name for name, variable in dataset.variables.items() if "t" in variable.dims]
    )
    alone.assign_coords(t=np.arange(times * dataset.sizes["t"]) * step).to_netcdf(path)
    with netCDF4.Dataset(path, "a") as file:
        for name, variable in dataset.variables.items():
            if "t" in variable.dims and name != "t":
                target = file.createVariable(
                    name, variable.dtype, variable.dims, fill_value=False
                )
                target.setncatts(variable.attrs)
                target[...] = np.concatenate(
                    [variable.values] * times, axis=variable.dims.index("t")
                )
