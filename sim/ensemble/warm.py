"""All kernels and laws compiled at once, in parallel processes: the first job of a cluster."""

import importlib
import multiprocessing
import os
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from sim.ensemble.progress import progress_bar
from sim.numerics import jit
from sim.numerics.files import StoreTrouble


def missing() -> list[str]:
    """Kernels and laws whose code is not in the cache; those of long modules, which take longest, first."""
    texts = jit.sources()
    for module in texts:
        importlib.import_module(module)
    names = [name for name in jit.compiled if _module(name) in texts]
    return [name for name in sorted(names, key=lambda name: -len(texts[_module(name)])) if not jit.cached(name)]


def compile_missing(jobs: int | None) -> str:
    """Compile what is not in the cache; what was done, in words.

    Raises
    ------
    StoreTrouble
        If code could not be stored.
    """
    began, lacking = time.monotonic(), missing()
    if lacking:
        with progress_bar(len(lacking), "kernels") as shown:
            for _ in compile_all(lacking, jobs):
                shown.advance(1)
    if left := sum(not jit.cached(name) for name in lacking):
        raise StoreTrouble(f"{left} kernels could not be stored; set SIM_CACHE_DIR to a folder that can be written")
    took = f" in {time.monotonic() - began:.0f} s" if lacking else ""
    return f"{len(lacking)} of {len(jit.compiled)} kernels and laws compiled{took}; the others were there"


def compile_all(names: list[str], jobs: int | None = None) -> Iterator[str]:
    """Compile kernels and laws into the cache in some processes, one a core, and give the name of each."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs or os.cpu_count() or 1, len(names)), context) as pool:
        yield from pool.map(_compile, names)


def _compile(name: str) -> str:
    importlib.import_module(_module(name))
    jit.compiled[name]()
    return name


def _module(name: str) -> str:
    return name.rpartition(".")[0]
