"""A run that tests of the analysis share."""

import pytest
from helpers import lens


@pytest.fixture(scope="session")
def ramp():
    return lens.ramp()
