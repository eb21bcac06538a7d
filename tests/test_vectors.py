"""The numbers of a run do not depend on the vector instructions of the machine."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import scenes

from sim.step.state import pack

USUAL = {
    "drive": "log ramp",
    "bonds": "rate",
    "shear": "banded, slip, onset",
    "contact": "load",
}
MODELS = {
    "drive": scenes.DRIVES,
    "bonds": scenes.BONDS,
    "shear": scenes.SHEARS,
    "contact": scenes.CONTACTS,
}


def digests():
    """A digest of the last state of a scene for every model of every part, and for bonds that move the slider."""
    cases = [USUAL | {part: name} for part, models in MODELS.items() for name in models]
    cases += [
        USUAL | {"drive": "spring with mass", "bonds": name} for name in scenes.BONDS
    ]
    results = {}
    for case in cases:
        case = case if scenes.go_together(case) else case | {"bonds": "rate, bell"}
        *_, state = scenes.march(
            scenes.scene(
                steps=20, **{part: MODELS[part][name] for part, name in case.items()}
            ),
            np.arange(3),
        )
        text = b"".join(
            np.ascontiguousarray(array).tobytes() for array in pack(state).values()
        )
        results[" ".join(case.values())] = hashlib.sha256(text).hexdigest()
    return results


def states(folder, cores, left_out):
    """Return the digests of a process whose numpy leaves out some vector instructions, and which numpy uses."""
    tests = Path(__file__).parent
    path = os.pathsep.join([str(tests), str(tests.parent)])
    setting = {
        "NPY_DISABLE_CPU_FEATURES": " ".join(left_out),
        "SIM_CACHE_DIR": str(folder),
        "PYTHONPATH": path,
    }
    code = "import json, numpy as np, test_vectors; used = np._core._multiarray_umath; "
    code += "used = [name for name in used.__cpu_dispatch__ if used.__cpu_features__[name]]; "
    code += "print(json.dumps([used, test_vectors.digests()]))"
    process = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | setting | cores,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(process.stdout)


@pytest.mark.verify
def test_states_are_those_of_kernels_for_any_x86_64_and_of_numpy_without_vectors(
    tmp_path,
):
    dispatched = np._core._multiarray_umath.__cpu_dispatch__
    # with AVX-512 the exp and log of numpy round otherwise
    widest = [
        name for name in dispatched if name.startswith("AVX512") or name == "X86_V4"
    ]
    plain = {
        "NUMBA_CPU_NAME": "x86-64",
        "NUMBA_CPU_FEATURES": "",
        "OPENBLAS_CORETYPE": "Prescott",
    }
    used, results = states(tmp_path / "plain", plain, dispatched)
    assert used == []
    assert results == states(tmp_path / "wide", {}, widest)[1]
