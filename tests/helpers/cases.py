"""Marks of tests and of cases: those of POSIX systems, and those for ``make verify`` only."""

import os

import pytest

posix = pytest.mark.skipif(
    os.name != "posix",
    reason="the system has no signals, forks, symbolic links for all users or named pipes of POSIX",
)


def some(cases, *always):
    """All cases, of which those not in ``always`` are for ``make verify``."""
    left = [case for case in always if case not in cases]
    assert not left, f"{left} is none of the cases"
    whole = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [
        case if case in always else pytest.param(*all_of, marks=pytest.mark.verify)
        for case, all_of in zip(cases, whole, strict=True)
    ]
