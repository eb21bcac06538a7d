"""Equality of two source trees, bit for bit: ``python -m benchmarks.gate OLD NEW [SCENE ...]``.

Thirteen short scenes hold every model of every part. Each tree runs them in a process of its own; then all numeric
variables of the datasets are compared by ``==``, nan with nan. Variables that only one tree has are listed. The exit
code is 1 if any number differs. Stored hashes would fail on another processor; two trees on one machine do not.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import scenes
from benchmarks.scenes import RAMP, RATE, SLIP, SPRING, STRETCHED, Tables

#: Program of a process of a tree: runs scenes in the present folder, and writes the variables of each as NAME.npz.
RUN = """
import json, sys
import numpy as np
import sim
np.save("map.npy", 1e5 * np.random.default_rng(1).standard_normal((32, 32)))
for name, scene in json.load(sys.stdin).items():
    values = {key: variable.values for key, variable in sim.run(scene).variables.items()}
    np.savez(name, **{key: array for key, array in values.items() if array.dtype.kind in "biuf"})
"""
SPEEDS = {
    "model": "table",
    "time": [0, 3e-3, 3e-3, 20e-3],
    "speed": [1e-3, 1e-3, 2e-2, 0],
}
TURNING = {
    "stage": {"from": 1e-2, "to": -1e-2, "cycles": 1},
    "start": "rest",
    "start_after": 1e-3,
}
HEAVY = (
    SPRING
    | TURNING
    | {"mass": 1e-4, "damping": 0.1, "viscosity": 1e5, "contact_stiffness": "rigid"}
)
CREEP = {
    "model": "force",
    "force": {"from": 0.0, "to": 3e-3},
    "damping": 0.1,
    "contact_stiffness": "rigid",
}

CONSTANT = {"model": "constant", "rate": 200.0}
CUT_OFF = {"model": "cut_off", "stretch": 20e-6, "rate": 50.0}
CATCH = {
    "model": "catch",
    "catch_rate": 300.0,
    "catch_force": 4e-12,
    "slip_rate": 20.0,
    "slip_force": 4e-12,
}

SPREAD = STRETCHED | {"model": "rate", "rupture": CUT_OFF}
POPULATIONS = [
    scenes.STEADY,
    RATE,
    scenes.COUNTED,
    scenes.COHORT,
    scenes.TRACKED,
    SPREAD,
]

BAND = {"model": "band", "rms": 120e3, "longest": 120e-6, "shortest": 60e-6}
COARSE = scenes.ROUGH | {"longest": 120e-6, "rolloff": 60e-6, "shortest": 30e-6}
SPECTRA = [
    {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6},
    BAND,
    COARSE,
    {"model": "gaussian", "rms": 1e5, "length": 5e-6},
    {
        "model": "anisotropic_gaussian",
        "rms": 1e5,
        "length_x": 5e-6,
        "length_y": 9e-6,
        "angle": 0.3,
    },
    {"model": "von_karman", "rms": 1e5, "hurst": 0.5, "length": 5e-6},
    {
        "model": "tabulated",
        "wavenumbers": [1e5, 3e5, 1e6],
        "densities": [3e-2, 1e-2, 1e-4],
    },
    {"model": "measured", "file": "map.npy", "spacing": 4e-6, "window": "hann"},
]
CORRELATIONS = [
    SLIP,
    {"model": "time", "time": 2e-3},
    {"model": "wave", "waves": 2.0},
    {"model": "diffusion", "diffusivity": 1e-9},
]
STRESS = {"model": "stress", "reference": 2e5}
AMPLITUDES = [
    {"model": "constant"},
    scenes.ONSET,
    scenes.ONSET | {"relaxing": True},
    STRESS,
    STRESS | {"relaxing": True},
]
MODAL = {"model": "modal", "spectrum": BAND, "cell": 0.24e-3, "correlation": SLIP}
BANDED_COARSE = MODAL | {"model": "banded", "spectrum": COARSE, "tolerance": 0.05}
MAPPED = MODAL | {"model": "mapped", "points": 32, "cell": 0.48e-3}
PATTERN = {"model": "mapped", "field": {"file": "map.npy", "pixel": 16e-6}}

CYCLE = {"displacement": {"from": 1e-6, "to": -3e-6, "cycles": 2}, "stiffness": 500.0}
LAGGING = {"model": "rate_dependent", "front_speed": 1e-2, "after_pull_off": "reattach"}

SCENES: dict[str, Tables] = {
    "loads": {
        "drive": {"model": "start", "rest": 3e-3, "speed": 4e-3},
        "bonds": scenes.STEADY,
        "contact": {"after_pull_off": "reattach"},
        "sweep": {"contact.load": [-0.3e-3, {"from": 4e-3, "to": -1e-3, "cycles": 1}]},
    },
    "spectra": {
        "drive": RAMP,
        "bonds": {"model": "none", "stress": 2e5},
        "shear": {"model": "mean", "spectrum": BAND, "amplitude": STRESS},
        "sweep": {"shear.spectrum": SPECTRA, "shear.contact": ["plane"]},
    },
    "correlations": {
        "drive": {"model": "ramp", "from": -1e-3, "to": 5e-3},
        "bonds": RATE,
        "shear": BANDED_COARSE,
        "contact": CYCLE | {"after_pull_off": "reattach"},
        "sweep": {
            "shear.correlation": CORRELATIONS,
            "shear.mode_amplitudes": ["gaussian", "fixed"],
        },
    },
    "amplitudes": {
        "drive": SPEEDS,
        "bonds": scenes.TRACKED,
        "shear": MODAL,
        "contact": LAGGING | {"indentation": {"from": 1e-6, "to": -2e-6, "cycles": 1}},
        "sweep": {
            "shear.amplitude": AMPLITUDES,
            "bonds.rupture": [CONSTANT, scenes.BELL, CUT_OFF],
        },
    },
    "maps": {
        "drive": {"model": "steady", "speed": 2e-3},
        "bonds": scenes.COUNTED,
        "shear": MAPPED,
        "record": {"maps": ["0 ms", "10 ms"], "map_members": 2},
        "sweep": {
            "shear.contact": ["plane", "disc"],
            "shear.mode_amplitudes": ["gaussian", "fixed"],
        },
    },
    "measured map": {
        "drive": {"model": "steady", "speed": 2e-3},
        "bonds": scenes.COUNTED,
        "shear": PATTERN,
        "record": {"maps": ["0 ms", "10 ms"]},
        "sweep": {"shear.contact": ["plane", "disc"]},
    },
    "bonds make the field": {
        "drive": RAMP,
        "bonds": scenes.COHORT,
        "shear": {"model": "mean", "spectrum": {"model": "bonds", "footprint": 1e-9}},
        "contact": {"reversible": 0.05},
        "sweep": {
            "bonds.start": ["steady", "bonded", "empty"],
            "bonds.area": ["present", "carried"],
        },
    },
    "spring and rate bonds": {
        "drive": SPRING,
        "bonds": STRETCHED
        | {"model": "rate", "rupture": scenes.BELL, "start": "bonded"},
        "shear": BANDED_COARSE
        | {"amplitude": {"model": "slip_rate", "floor": 0.1, "relaxing": True}},
        "sweep": {
            "bonds.rupture": [CONSTANT, scenes.BELL, CUT_OFF],
            "shear.paid_by_adhesion": [0.0, 1.0],
        },
    },
    "heavy slider and cohorts": {
        "drive": HEAVY,
        "bonds": scenes.COHORT,
        "shear": MODAL
        | {"mode_amplitudes": "fixed", "amplitude": {"model": "slip_rate"}},
        "sweep": {"bonds.rupture": [CONSTANT, scenes.BELL, CUT_OFF, CATCH]},
    },
    "spring and tracked bonds": {
        "drive": SPRING,
        "bonds": scenes.TRACKED,
        "shear": {
            "model": "mean",
            "spectrum": BAND,
            "contact": "disc",
            "paid_by_adhesion": 0.5,
        },
        "contact": {
            "indentation": {"time": [0.0, 5e-3, 1.0], "value": [2e-6, -2e-6, -2e-6]}
        },
        "sweep": {"bonds.rupture": [CONSTANT, scenes.BELL, CUT_OFF]},
    },
    "force": {
        "drive": CREEP,
        "bonds": RATE,
        "contact": LAGGING | {"load": "4 mN"},
        "sweep": {"bonds": POPULATIONS},
    },
    "pooled": {
        "drive": RAMP,
        "bonds": scenes.COHORT | {"area": "carried", "rupture": CATCH},
        "shear": MODAL | {"amplitude": scenes.ONSET},
        "contact": CYCLE | {"after_pull_off": "stop", "reversible": 0.02},
        "record": {"per_member": False, "precision": "float32"},
    },
    "auto, two bodies": {
        "solid": {"counter_body": {"youngs_modulus": "1 GPa", "poisson_ratio": 0.3}},
        "drive": RAMP,
        "bonds": STRETCHED | {"model": "auto", "rupture": CUT_OFF},
        "shear": {
            "model": "auto",
            "spectrum": BAND,
            "cell": 0.24e-3,
            "correlation": SLIP,
        },
        "record": {"compression": "digits"},
        "sweep": {"bonds.sites": [20, 10**6], "contact.load": [1e-3, 4e-3]},
    },
}


def _variables(
    tree: Path, folder: Path, names: list[str]
) -> dict[str, dict[str, np.ndarray]]:
    """Return the numeric variables of each scene, run with the package of a tree."""
    folder.mkdir()
    tables = json.dumps({name: scenes.tables(name, SCENES[name]) for name in names})
    environment = os.environ | {"PYTHONPATH": str(tree.resolve())}
    subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=folder,
        env=environment,
        input=tables,
        text=True,
        check=True,
    )
    return {name: dict(np.load(folder / f"{name}.npz")) for name in names}


def main() -> None:
    """Print one line per scene; exit with 1 if any number differs."""
    first, second, *chosen = sys.argv[1:]
    names = chosen or list(SCENES)
    with tempfile.TemporaryDirectory() as folder:
        old = _variables(Path(first), Path(folder, "old"), names)
        new = _variables(Path(second), Path(folder, "new"), names)
    different = 0
    for name in names:
        common = [key for key in old[name] if key in new[name]]
        changed = [
            key
            for key in common
            if not np.array_equal(old[name][key], new[name][key], equal_nan=True)
        ]
        different += len(changed)
        gone, more = (
            sorted(old[name].keys() - new[name].keys()),
            sorted(new[name].keys() - old[name].keys()),
        )
        print(
            f"{name}: {len(common)} variables, different: {changed or 'none'}; gone: {gone}; new: {more}"
        )
    sys.exit(different > 0)


if __name__ == "__main__":
    main()
