"""Compiled laws broadcast like numpy, and their cache may be missing, broken, read-only or full."""

import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sim.laws import jkr
from sim.numerics import jit
from sim.numerics.noise import Noise
from sim.numerics.special import lambert_w


def test_a_law_of_arrays_is_that_of_single_numbers():
    random = np.random.default_rng(3)
    for size in [1, 3, 255, 256, 4095, 4096, 4097, 10_000]:
        load, work = (
            random.uniform(-1e-4, 4e-3, size),
            random.uniform(-1e-2, 42e-3, size),
        )
        whole = jkr.radius_at_load(load, work, 2e-3, 6.4e6)
        some = random.integers(0, size, 50)
        assert_array_equal(
            whole[some],
            [jkr.radius_at_load(load[i], work[i], 2e-3, 6.4e6) for i in some],
        )
    load, work = (
        np.linspace(0, 4e-3, 30).reshape(5, 1, 6),
        np.linspace(0, 42e-3, 40).reshape(40, 1),
    )
    assert jkr.radius_at_load(load, work, 2e-3, 6.4e6).shape == (5, 40, 6)
    square = np.linspace(0, 4e-3, 90_000).reshape(300, 300)
    whole = jkr.radius_at_load(square, 0.042, 2e-3, 6.4e6)
    assert_array_equal(jkr.radius_at_load(square.T, 0.042, 2e-3, 6.4e6), whole.T)
    assert jkr.radius_at_load(np.empty((0, 3)), 0.042, 2e-3, 6.4e6).shape == (0, 3)


def test_a_compiled_helper_is_called_like_any_function():
    # without the wrappers that Python calls, which it is compiled without, this would end the process
    helper = jit.device(lambda x, y: x / y)
    assert helper(1.0, 4.0) == 0.25
    assert helper(1.0, 0.0) == np.inf


WITHOUT_INTERNALS = """
import numba.np.ufunc.wrappers
del numba.np.ufunc.wrappers.build_ufunc_wrapper
import numpy as np
from sim.numerics import jit, noise, special
assert not jit.FAST
numbers = special.lambert_w(np.linspace(0.0, 4.0, 7)), noise.Noise(7, "shear", np.arange(2)).normals(3, 300).ravel()
assert jit.cached("sim.numerics.special.lambert_w") and jit.cached("sim.numerics.noise._normals")
print(np.concatenate(numbers).tobytes().hex())
"""


def test_without_an_internal_of_numba_the_public_decorators_give_the_same_bits(
    tmp_path,
):
    environment = {
        **os.environ,
        "SIM_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    command = [sys.executable, "-c", WITHOUT_INTERNALS]
    printed = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True
    ).stdout
    numbers = (
        lambert_w(np.linspace(0.0, 4.0, 7)),
        Noise(7, "shear", np.arange(2)).normals(3, 300).ravel(),
    )
    assert printed.strip() == np.concatenate(numbers).tobytes().hex()


LITTLE = """
from sim.numerics.jit import law

@law
def cubed(x):
    return x**3
"""


@pytest.fixture
def compiled_in(tmp_path, monkeypatch):
    """A little law compiled or loaded anew with its cache in a folder, and what it gives."""
    source = tmp_path / "little.py"
    source.write_text(LITTLE, encoding="utf-8")

    def answer(folder):
        monkeypatch.setenv("SIM_CACHE_DIR", str(folder))
        jit._cache_folder.cache_clear()
        module = {"__name__": "little", "__file__": str(source)}
        exec(compile(LITTLE, source, "exec"), module)
        return float(module["cubed"](1.1))

    yield answer
    jit._cache_folder.cache_clear()


def test_a_missing_broken_read_only_or_full_cache_stops_no_run(
    tmp_path, compiled_in, room, monkeypatch
):
    compilings = []
    monkeypatch.setattr(jit, "on_compiling", [compilings.append])
    fresh = compiled_in(tmp_path / "cache")
    files = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert len(files) == 1
    before = [path.read_bytes() for path in files]
    compilings.clear()
    again = compiled_in(tmp_path / "cache")
    assert [path.read_bytes() for path in files] == before
    assert not compilings
    for wrong in (b"broken", before[0][:-100], before[0].replace(b"cubed", b"cuned")):
        files[0].write_bytes(wrong)
        assert compiled_in(tmp_path / "cache") == fresh
        assert compilings.pop() == "little.cubed"
        assert files[0].read_bytes() != wrong
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    no_folder = compiled_in(tmp_path / "file")
    unmakeable = compiled_in(tmp_path / "file" / "below")
    with room(100):
        no_room = compiled_in(tmp_path / "full")
    assert not [path for path in (tmp_path / "full").rglob("*") if path.is_file()]
    assert fresh == again == no_folder == unmakeable == no_room
