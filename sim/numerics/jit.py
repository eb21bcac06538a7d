"""Compilation by numba, the only place that decorates with it.

Four decorators: ``device`` for a scalar helper that compiles into its callers, ``inlined`` for one whose body must
stand in the calling loop for vector instructions, ``kernel`` for a loop over arrays, ``law`` for a formula that
broadcasts as a numpy ufunc but keeps its Python signature, defaults and docstring. Kernels and laws compile at their
first call and are cached on disk, in a folder named by a hash of all compiled sources: numba itself does not notice a
change in a helper of another file. A cache that is broken, read-only or full costs time, never a run.
"""

import functools
import hashlib
import inspect
import os
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import config

device = numba.njit(error_model="numpy")
inlined = numba.njit(error_model="numpy", inline="always")
_building = threading.RLock()
_BLOCK = 4096


@functools.cache
def _cache_folder() -> str:
    """Folder of compiled code, named by a hash of all sources that import this module."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"sim.numerics.jit" in text or source.name == "jit.py":
            digest.update(text)
    base = os.environ.get("SIM_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return str(Path(base).expanduser() / "sliding-sim" / digest.hexdigest()[:16])


def _build(compile_it: Callable[[bool], Any]) -> Any:
    """Compile with the disk cache; if the cache is at fault in any way, compile without it.

    A bad cache raises whatever numba's file layer or unpickler meets (OSError, EOFError,
    UnpicklingError, RuntimeError, ...), so every exception leads to the second try, where a fault
    of the code itself shows again.
    """
    with _building:
        before = config.CACHE_DIR  # type: ignore[attr-defined]
        try:
            folder = _cache_folder()
            os.makedirs(folder, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            config.CACHE_DIR = folder  # type: ignore[attr-defined]
            return compile_it(True)
        except Exception:
            return compile_it(False)
        finally:
            config.CACHE_DIR = before  # type: ignore[attr-defined]


def kernel(signature: str) -> Callable[[Callable], Callable]:
    """Compile a loop over arrays for one ``signature``, at the first call."""

    def decorate(function: Callable) -> Callable:
        @functools.cache
        def compiled() -> Callable:
            return _build(lambda cache: numba.njit(signature, cache=cache, error_model="numpy")(function))

        @functools.wraps(function)
        def call(*arguments):
            return compiled()(*arguments)

        return call

    return decorate


def law(function: Callable) -> Callable:
    """Turn a scalar formula of floats into one that broadcasts over arrays.

    The result keeps name, signature, defaults and docstring; where no answer exists it gives nan
    without a warning.
    """
    parameters = inspect.signature(function).parameters
    count = len(parameters)

    @functools.cache
    def compiled() -> Callable:
        signature = f"float64({', '.join(['float64'] * count)})"
        return _build(lambda cache: numba.vectorize([signature], cache=cache)(function)).ufunc

    bind = inspect.signature(function).bind

    @functools.wraps(function)
    def call(*arguments, **keywords):
        if keywords or len(arguments) != count:
            bound = bind(*arguments, **keywords)
            bound.apply_defaults()
            arguments = bound.args
        small = all(map(_is_small, arguments))
        with np.errstate(all="ignore"):
            return compiled()(*arguments) if small else _in_blocks(compiled(), arguments)

    return call


def _is_small(argument: Any) -> bool:
    return type(argument) is float or (type(argument) is np.ndarray and argument.size < _BLOCK // 16)


@functools.lru_cache(maxsize=64)  # constants of a scene come back at every step
def _filled(shape: tuple[int, ...], value: float) -> np.ndarray:
    """Read-only array of one number."""
    array = np.empty(shape)
    array.fill(value)
    array.flags.writeable = False
    return array


def _in_blocks(ufunc: Callable, arguments: tuple) -> Any:
    """Call a ufunc; with large arrays beside single numbers in blocks in which the numbers are arrays, too.

    The compiler's vector instructions need every argument contiguous; a block that stays in the
    cache makes that free. Elementwise, so the blocks change no bit.
    """
    arrays = [np.asarray(argument, dtype=float) for argument in arguments]
    size = max([array.size for array in arrays])
    if size < _BLOCK // 16:
        return ufunc(*arrays)
    shapes = [array.shape for array in arrays if array.size != 1]
    shape = shapes[0]
    if shapes.count(shape) != len(shapes):
        return ufunc(*arrays)
    if size <= _BLOCK:
        return ufunc(*[_filled(shape, array.item()) if array.size == 1 else array for array in arrays])
    flat = [_filled((_BLOCK,), a.item()) if a.size == 1 else np.ascontiguousarray(a).ravel() for a in arrays]
    out = np.empty(size)
    for first in range(0, size, _BLOCK):
        block = slice(first, min(first + _BLOCK, size))
        length = block.stop - first
        ufunc(*[a[:length] if array.size == 1 else a[block] for a, array in zip(flat, arrays, strict=True)], out[block])
    return out.reshape(shape)
