"""Modules that libraries load for what no command does: commands go without, who uses the package does not."""

import contextlib
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def without(*names: str) -> Iterator[None]:
    """A context in which modules that are not there yet cannot be imported."""
    absent = [name for name in names if name not in sys.modules]
    sys.modules |= dict.fromkeys(absent)  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


def other_arrays() -> None:
    """Let xarray find no arrays of pint and dask, whose import takes a second and which no command makes of a file."""
    known = "dask.array" if "xarray" in sys.modules else "dask"  # which xarray looks for when it is loaded
    with without("pint", known):
        import xarray as xr

        xr.Dataset(coords={"t": [0.0]}).t.notnull()


def blas() -> None:
    """Let numba find no BLAS, whose import with all of scipy.linalg takes a fifth of a second: no kernel calls it."""
    with without("scipy.linalg.cython_blas"):
        import numba.np.arraymath  # noqa: F401
