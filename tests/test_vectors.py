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

from sim.engine import pack

USUAL = {"drive": "log ramp", "bonds": "rate", "shear": "banded, slip, onset", "contact": "load"}
MODELS = {"drive": scenes.DRIVES, "bonds": scenes.BONDS, "shear": scenes.SHEARS, "contact": scenes.CONTACTS}


def digests():
    """A digest of the last state of a scene for every model of every part, and for bonds that move the slider."""
    cases = [USUAL | {part: name} for part, models in MODELS.items() for name in models]
    cases += [USUAL | {"drive": "spring with mass", "bonds": name} for name in scenes.BONDS]
    results = {}
    for case in cases:
        case = case if scenes.go_together(case) else case | {"bonds": "rate, bell"}
        *_, state = scenes.march(
            scenes.scene(steps=20, **{part: MODELS[part][name] for part, name in case.items()}), np.arange(3)
        )
        text = b"".join(np.ascontiguousarray(array).tobytes() for array in pack(state).values())
        results[" ".join(case.values())] = hashlib.sha256(text).hexdigest()
    return results


@pytest.mark.verify
def test_states_are_those_of_kernels_for_any_x86_64_and_of_numpy_without_vectors(tmp_path):
    tests = Path(__file__).parent
    plain = {
        "NUMBA_CPU_NAME": "x86-64",
        "NUMBA_CPU_FEATURES": "",
        "NPY_DISABLE_CPU_FEATURES": " ".join(np._core._multiarray_umath.__cpu_dispatch__),
        "OPENBLAS_CORETYPE": "Prescott",
        "SIM_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(tests), str(tests.parent)]),
    }
    code = "import json, numpy as np, test_vectors; from numba.core import config; "
    code += (
        "used = np._core._multiarray_umath; used = [used.__cpu_features__[name] for name in used.__cpu_dispatch__]; "
    )
    code += "print(json.dumps([config.CPU_NAME, any(used), test_vectors.digests()]))"
    process = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | plain, capture_output=True, text=True, check=True
    )
    target, vectors, results = json.loads(process.stdout)
    assert target == "x86-64"
    assert not vectors
    assert results == digests()
