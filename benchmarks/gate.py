"""Equality of two source trees, bit for bit: ``python benchmarks/gate.py OLD NEW [SCENE ...]``.

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
from typing import Any

import numpy as np

LENS: dict[str, Any] = {
    "seed": 5,
    "clock": {"duration": "20 ms", "step": "1 ms"},
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "contact": {"load": "4 mN"},
    "ensemble": {"members": 3},
}
LOG_RAMP = {"model": "ramp", "from": 1e-5, "to": 0.1, "scale": "log"}
SPEEDS = {"model": "table", "time": [0, 3e-3, 3e-3, 20e-3], "speed": [1e-3, 1e-3, 2e-2, 0]}
SPRING = {"model": "spring", "stage": 2e-2, "stiffness": 100.0, "start": "steady"}
HEAVY = SPRING | {
    "stage": {"from": 1e-2, "to": -1e-2, "cycles": 1},
    "start": "rest",
    "start_after": 1e-3,
    "mass": 1e-4,
    "damping": 0.1,
    "viscosity": 1e5,
    "contact_stiffness": "rigid",
}
CREEP = {"model": "force", "force": {"from": 0.0, "to": 3e-3}, "damping": 0.1, "contact_stiffness": "rigid"}

CONSTANT = {"model": "constant", "rate": 200.0}
BELL = {"model": "bell", "zero_force_rate": 200.0, "bell_force": 4e-12}
CUT_OFF = {"model": "cut_off", "stretch": 20e-6, "rate": 50.0}
CATCH = {"model": "catch", "catch_rate": 300.0, "catch_force": 4e-12, "slip_rate": 20.0, "slip_force": 4e-12}
STRETCHED = {"bond_stiffness": 4e-7, "rebinding_rate": 400.0, "site_density": 1e17}
STEADY = {"model": "steady", "critical_speed": 1e-2, "stress": 2e5}
RATE = STEADY | {"model": "rate", "rebinding_rate": 500.0}
COUNTED = RATE | {"model": "counted", "sites": 40}
COHORT = STRETCHED | {"model": "cohort", "rupture": BELL, "tolerance": 1e-3}
TRACKED = STRETCHED | {"model": "tracked", "rupture": BELL, "sites": 30}

BAND = {"model": "band", "rms": 120e3, "longest": 120e-6, "shortest": 60e-6}
ROUGH = {"model": "self_affine", "rms": 1e5, "hurst": 0.8, "longest": 120e-6, "rolloff": 60e-6, "shortest": 30e-6}
SPECTRA = [
    {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6},
    BAND,
    ROUGH,
    {"model": "gaussian", "rms": 1e5, "length": 5e-6},
    {"model": "anisotropic_gaussian", "rms": 1e5, "length_x": 5e-6, "length_y": 9e-6, "angle": 0.3},
    {"model": "von_karman", "rms": 1e5, "hurst": 0.5, "length": 5e-6},
    {"model": "tabulated", "wavenumbers": [1e5, 3e5, 1e6], "densities": [3e-2, 1e-2, 1e-4]},
    {"model": "measured", "file": "map.npy", "spacing": 4e-6, "window": "hann"},
]
SLIP = {"model": "slip", "length": 5e-6}
CORRELATIONS = [
    SLIP,
    {"model": "time", "time": 2e-3},
    {"model": "wave", "waves": 2.0},
    {"model": "diffusion", "diffusivity": 1e-9},
]
ONSET = {"model": "onset", "speed": 2e-3, "width": 0.3, "floor": 0.1}
STRESS = {"model": "stress", "reference": 2e5}
AMPLITUDES = [{"model": "constant"}, ONSET, ONSET | {"relaxing": True}, STRESS, STRESS | {"relaxing": True}]
MODAL = {"model": "modal", "spectrum": BAND, "cell": 0.24e-3, "correlation": SLIP}
BANDED = MODAL | {"model": "banded", "spectrum": ROUGH, "tolerance": 0.05}
MAPPED = MODAL | {"model": "mapped", "points": 32, "cell": 0.48e-3}
PATTERN = {"model": "mapped", "field": {"file": "map.npy", "pixel": 16e-6}}

CYCLE = {"displacement": {"from": 1e-6, "to": -3e-6, "cycles": 2}, "stiffness": 500.0}
LAGGING = {"model": "rate_dependent", "front_speed": 1e-2, "after_pull_off": "reattach"}

SCENES: dict[str, dict[str, Any]] = {
    "loads": {
        "drive": {"model": "start", "rest": 3e-3, "speed": 4e-3},
        "bonds": STEADY,
        "contact": {"after_pull_off": "reattach"},
        "sweep": {"contact.load": [-0.3e-3, {"from": 4e-3, "to": -1e-3, "cycles": 1}]},
    },
    "spectra": {
        "drive": LOG_RAMP,
        "bonds": {"model": "none", "stress": 2e5},
        "shear": {"model": "mean", "spectrum": BAND, "amplitude": STRESS},
        "sweep": {"shear.spectrum": SPECTRA, "shear.contact": ["plane"]},
    },
    "correlations": {
        "drive": {"model": "ramp", "from": -1e-3, "to": 5e-3},
        "bonds": RATE,
        "shear": BANDED,
        "contact": CYCLE | {"after_pull_off": "reattach"},
        "sweep": {"shear.correlation": CORRELATIONS, "shear.mode_amplitudes": ["gaussian", "fixed"]},
    },
    "amplitudes": {
        "drive": SPEEDS,
        "bonds": TRACKED,
        "shear": MODAL,
        "contact": LAGGING | {"indentation": {"from": 1e-6, "to": -2e-6, "cycles": 1}},
        "sweep": {"shear.amplitude": AMPLITUDES, "bonds.rupture": [CONSTANT, BELL, CUT_OFF]},
    },
    "maps": {
        "drive": {"model": "steady", "speed": 2e-3},
        "bonds": COUNTED,
        "shear": MAPPED,
        "record": {"maps": ["0 ms", "10 ms"], "map_members": 2},
        "sweep": {"shear.contact": ["plane", "disc"], "shear.mode_amplitudes": ["gaussian", "fixed"]},
    },
    "measured map": {
        "drive": {"model": "steady", "speed": 2e-3},
        "bonds": COUNTED,
        "shear": PATTERN,
        "record": {"maps": ["0 ms", "10 ms"]},
        "sweep": {"shear.contact": ["plane", "disc"]},
    },
    "bonds make the field": {
        "drive": LOG_RAMP,
        "bonds": COHORT,
        "shear": {"model": "mean", "spectrum": {"model": "bonds", "footprint": 1e-9}},
        "contact": {"reversible": 0.05},
        "sweep": {"bonds.start": ["steady", "bonded", "empty"], "bonds.area": ["present", "carried"]},
    },
    "spring and rate bonds": {
        "drive": SPRING,
        "bonds": STRETCHED | {"model": "rate", "rupture": BELL, "start": "bonded"},
        "shear": BANDED | {"amplitude": {"model": "slip_rate", "floor": 0.1, "relaxing": True}},
        "sweep": {"bonds.rupture": [CONSTANT, BELL, CUT_OFF], "shear.paid_by_adhesion": [0.0, 1.0]},
    },
    "heavy slider and cohorts": {
        "drive": HEAVY,
        "bonds": COHORT,
        "shear": MODAL | {"mode_amplitudes": "fixed", "amplitude": {"model": "slip_rate"}},
        "sweep": {"bonds.rupture": [CONSTANT, BELL, CUT_OFF, CATCH]},
    },
    "spring and tracked bonds": {
        "drive": SPRING,
        "bonds": TRACKED,
        "shear": {"model": "mean", "spectrum": BAND, "contact": "disc", "paid_by_adhesion": 0.5},
        "contact": {"indentation": {"time": [0.0, 5e-3, 1.0], "value": [2e-6, -2e-6, -2e-6]}},
        "sweep": {"bonds.rupture": [CONSTANT, BELL, CUT_OFF]},
    },
    "force": {
        "drive": CREEP,
        "bonds": RATE,
        "contact": LAGGING | {"load": "4 mN"},
        "sweep": {"bonds": [STEADY, RATE, COUNTED, COHORT, TRACKED, STRETCHED | {"model": "rate", "rupture": CUT_OFF}]},
    },
    "pooled": {
        "drive": LOG_RAMP,
        "bonds": COHORT | {"area": "carried", "rupture": CATCH},
        "shear": MODAL | {"amplitude": ONSET},
        "contact": CYCLE | {"after_pull_off": "stop", "reversible": 0.02},
        "record": {"per_member": False, "precision": "float32"},
    },
    "auto, two bodies": {
        "solid": {"counter_body": {"youngs_modulus": "1 GPa", "poisson_ratio": 0.3}},
        "drive": LOG_RAMP,
        "bonds": STRETCHED | {"model": "auto", "rupture": CUT_OFF},
        "shear": {"model": "auto", "spectrum": BAND, "cell": 0.24e-3, "correlation": SLIP},
        "record": {"compression": "digits"},
        "sweep": {"bonds.sites": [20, 10**6], "contact.load": [1e-3, 4e-3]},
    },
}


def scene(name: str) -> dict[str, Any]:
    """Return the tables of a scene, those of the lens filled in."""
    tables = dict(LENS) | {"name": name}
    for key, table in SCENES[name].items():
        tables[key] = {**tables.get(key, {}), **table} if isinstance(table, dict) else table
    if "displacement" in tables["contact"] or "indentation" in tables["contact"]:
        tables["contact"] = {key: value for key, value in tables["contact"].items() if key != "load"}
    return tables


def _run(names: list[str]) -> None:
    """Run scenes with the package of this process, and write the variables of each as NAME.npz."""
    import sim

    random = np.random.default_rng(1)
    np.save("map.npy", 1e5 * random.standard_normal((32, 32)))
    for name in names:
        dataset = sim.run(scene(name))
        values = {key: variable.values for key, variable in dataset.variables.items()}
        np.savez(name, **{key: array for key, array in values.items() if array.dtype.kind in "biuf"})


def _variables(tree: Path, folder: Path, names: list[str]) -> dict[str, dict[str, np.ndarray]]:
    """Return the numeric variables of each scene, run with the package of a tree."""
    folder.mkdir()
    command = [sys.executable, str(Path(__file__).resolve()), "--run", json.dumps(names)]
    subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": str(tree.resolve())}, check=True)
    return {name: dict(np.load(folder / f"{name}.npz")) for name in names}


def main() -> None:
    """Print one line per scene; exit with 1 if any number differs."""
    if sys.argv[1:2] == ["--run"]:
        _run(json.loads(sys.argv[2]))
        return
    first, second, *chosen = sys.argv[1:]
    names = chosen or list(SCENES)
    with tempfile.TemporaryDirectory() as folder:
        old = _variables(Path(first), Path(folder, "old"), names)
        new = _variables(Path(second), Path(folder, "new"), names)
    different = 0
    for name in names:
        common = [key for key in old[name] if key in new[name]]
        changed = [key for key in common if not np.array_equal(old[name][key], new[name][key], equal_nan=True)]
        different += len(changed)
        gone, more = sorted(old[name].keys() - new[name].keys()), sorted(new[name].keys() - old[name].keys())
        print(f"{name}: {len(common)} variables, different: {changed or 'none'}; gone: {gone}; new: {more}")
    sys.exit(different > 0)


if __name__ == "__main__":
    main()
