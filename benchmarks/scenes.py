"""Scenes of the benchmarks: tables of a lens as a scenario names them, and programs that run them."""

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
