"""All kernels and laws compiled at once, in parallel processes: the first job of a cluster."""

import importlib
import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from sim.ensemble.progress import progress_bar
from sim.numerics import jit


def missing() -> list[str]:
    """Kernels and laws whose code is not in the cache; those of long modules, which take longest, first."""
    texts = jit.sources()
    for module in texts:
        importlib.import_module(module)
    names = [name for name in jit.compiled if _module(name) in texts]
    return [name for name in sorted(names, key=lambda name: -len(texts[_module(name)])) if not jit.cached(name)]


def compile_missing(jobs: int | None) -> tuple[int, int, int]:
    """Compile what is not in the cache; how many that were, how many of them could not be stored, and how many are."""
    lacking = missing()
    if lacking:
        with progress_bar(len(lacking), "kernels") as shown:
            for _ in compile_all(lacking, jobs):
                shown.advance(1)
    return len(lacking), sum(not jit.cached(name) for name in lacking), len(jit.compiled)


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
