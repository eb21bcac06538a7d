"""What tests of several folders are given."""

import contextlib
import resource

import pytest


@pytest.fixture
def room():
    """A limit on the bytes of a file, which stands for a full disk: ``with room(100): ...``."""

    @contextlib.contextmanager
    def limited(size):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    return limited
