"""What tests of several folders are given."""

import contextlib
import os
import resource
import sys

import pytest

# Tests run on all cores at once already: threads of the linear algebra would wait for each other, many times as
# long as they work. Read when numpy is imported first, here and in every process that a test starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.fixture(scope="session", autouse=True)
def _written_at_once(request):
    """Datasets of tests are written by the process that tests, and need not be on the disk: but in ``make verify``.

    Beside the threads of pytest-xdist no copy of a process is safe, and a new one loads for half a second; a run waits
    ten times for the disk.
    """
    with pytest.MonkeyPatch.context() as patched:
        if request.config.getoption("markexpr") == "not verify":
            patched.setattr("sim.ensemble.netcdf.in_process", lambda work, *arguments: work(*arguments))
            patched.setattr("os.fsync", lambda descriptor: None)
        yield


@pytest.fixture
def written_apart(monkeypatch):
    """Datasets are written by a process of their own, as those of any run."""
    from sim.ensemble import workers

    monkeypatch.setattr("sim.ensemble.netcdf.in_process", workers.in_process)


@pytest.fixture
def room(written_apart):
    """A limit on the bytes of a file, which stands for a full disk: ``with room(100): ...``."""

    @contextlib.contextmanager
    def limited(size):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # Python would leave half of a file
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
            sys.dont_write_bytecode = bytecode

    return limited
