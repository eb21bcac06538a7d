"""Fixtures for tests of several folders."""

import contextlib
import os
import sys

import pytest
from _pytest.doctest import DoctestModule

# Tests run on all cores at once already: threads of the linear algebra would wait for each other, many times as
# long as they work. Read when numpy is imported first, here and in every process that a test starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


#: A module that changes the process that imports it: only processes of ``test_portability.py`` do.
collect_ignore = ["helpers/elsewhere"]


@pytest.hookimpl(wrapper=True)
def pytest_collect_file():
    """Look for doctests in the package alone: to read the modules of tests a second time takes seconds."""
    collectors = yield
    return [each for each in collectors if not isinstance(each, DoctestModule)]


@pytest.fixture(scope="session", autouse=True)
def _written_at_once(request):
    """Files of tests need not be on the disk, but in ``make verify``: a run waits for the disk ten times."""
    with pytest.MonkeyPatch.context() as patched:
        if request.config.getoption("markexpr") == "not verify":
            patched.setattr("os.fsync", lambda descriptor: None)
        yield


@pytest.fixture
def room():
    """A limit on the bytes of a file, which stands for a full disk: ``with room(100): ...``."""
    resource = pytest.importorskip(
        "resource", reason="the system has no limit on the bytes of a file"
    )

    @contextlib.contextmanager
    def limited(size):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        # Python would leave half of a file
        bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
            sys.dont_write_bytecode = bytecode

    return limited
