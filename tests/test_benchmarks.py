"""What the benchmarks compute: intervals of ratios, and lines of code."""

import math
import random

import pytest

from benchmarks.compare import interval, slower
from benchmarks.lines import code_lines


def test_the_interval_of_twenty_ratios_reaches_from_the_sixth_to_the_fifteenth():
    # 1 - 2 (1 + 20 + 190 + 1140 + 4845 + 15504)/2^20 = 0.9586; one ratio further in it would be 0.8847
    ratios = [float(n) for n in range(1, 21)]
    random.Random(1).shuffle(ratios)
    assert interval(ratios) == (6.0, 15.0)
    assert interval(ratios, confidence=0.88) == (7.0, 14.0)
    assert interval([1.0] * 5) == (-math.inf, math.inf)
    assert interval([3.0, 1.0, 2.0, 5.0, 4.0, 6.0]) == (1.0, 6.0)


def test_the_interval_holds_the_median_as_often_as_it_says():
    numbers, tries = random.Random(2), 4000
    held = sum(low <= 1.0 <= high for low, high in (interval([numbers.expovariate(math.log(2.0)) for _ in range(20)])
                                                    for _ in range(tries)))  # fmt: skip
    assert abs(held / tries - 0.9586) < 5.0 * math.sqrt(0.9586 * 0.0414 / tries)


@pytest.mark.parametrize(
    ("ratios", "told"),
    [
        ([0.9] * 20, True),
        ([0.96] * 20, False),
        ([0.9] * 14 + [1.1] * 6, False),
        ([0.9] * 15 + [1.1] * 5, True),
        ([2.0] * 20, False),
        ([0.5] * 5, False),
    ],
)
def test_a_row_is_slower_if_its_median_is_and_its_interval_says_so(ratios, told):
    assert slower(ratios) is told


def test_lines_of_code_hold_neither_docstrings_nor_comments_nor_blanks():
    text = '''"""What a module
is."""

import math  # counts

# does not


def area(radius):
    """Of a disc."""
    text = """two
lines"""
    return (
        math.pi * radius**2
    ), text
'''
    assert code_lines(text) == 7
