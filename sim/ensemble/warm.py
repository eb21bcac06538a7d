"""All kernels and laws compiled at once, in parallel processes: the first job of a cluster."""

import concurrent.futures
import importlib
import time

from sim.ensemble.execute import pool
from sim.numerics import jit
from sim.numerics.files import StoreTrouble
from sim.units.terminal import progress_bar


def missing() -> list[str]:
    """Return the kernels and laws whose code is not in the cache; first those of long modules, which take longest."""
    texts = jit.sources()
    for module in texts:
        importlib.import_module(module)
    names = [name for name in jit.compiled if _module(name) in texts]
    return [name for name in sorted(names, key=lambda name: -len(texts[_module(name)])) if not jit.cached(name)]


def compile_missing(jobs: int | None) -> str:
    """Compile what is not in the cache in some processes, by default one a core; return a text about it.

    Raises
    ------
    StoreTrouble
        If code could not be stored.
    """
    import loky  # slow to import

    began, lacking = time.monotonic(), missing()
    if lacking:
        processes = min(jobs or loky.cpu_count(), len(lacking))
        with progress_bar(len(lacking), "kernels") as shown, pool(processes) as executor:
            for future in concurrent.futures.as_completed([executor.submit(_compile, name) for name in lacking]):
                future.result()
                shown.advance(1)
    if left := sum(not jit.cached(name) for name in lacking):
        raise StoreTrouble(f"{left} kernels could not be stored; set SIM_CACHE_DIR to a writable folder")
    took = f" in {time.monotonic() - began:.0f} s" if lacking else ""
    return f"{len(lacking)} of {len(jit.compiled)} kernels and laws compiled{took}; the others are in the cache"


def _compile(name: str) -> None:
    importlib.import_module(_module(name))
    jit.compiled[name]()


def _module(name: str) -> str:
    return name.rpartition(".")[0]
