"""What tests of runs are given."""

import pytest

from sim.ensemble import plan


@pytest.fixture
def many_parts(monkeypatch):
    """Several groups and blocks even of a small run."""
    monkeypatch.setattr(plan, "_GROUP", 2)
    monkeypatch.setattr(plan, "_BLOCK_SECONDS", 4.5e-5)
