"""Prescribed courses: values, cuts where they turn or jump, exact integrals between."""

import functools
import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import TypeAdapter
from scipy.integrate import quad

from sim.units.quantity import Quantity
from sim.units.tables import Pieces, over_time, prescribed, table_pieces

DURATION = 1.2
COURSES = {
    "number": (0.7, []),
    "course": ({"from": -1.0, "to": 3.0}, []),
    "course, log": ({"from": 1e-3, "to": 10.0, "scale": "log"}, []),
    "course, log down": ({"from": -10.0, "to": -1e-3, "scale": "log"}, []),
    "cycles": ({"from": 2.0, "to": -1.0, "cycles": 2}, [0.3, 0.6, 0.9]),
    "cycles, log": (
        {"from": 2.0, "to": 0.1, "scale": "log", "cycles": 2},
        [0.3, 0.6, 0.9],
    ),
    "loop": (
        {"from": -1.0, "to": 2.0, "approach": 6.0, "retraction": 7.5},
        [0.5, 0.9],
    ),
    "table": (
        {"time": [-1.0, 0.0, 0.5, 0.5, 0.8], "value": [9.0, 1.0, 2.0, -0.5, 1.5]},
        [0.5, 0.8],
    ),
}
TURNS = sorted({turn for _, turns in COURSES.values() for turn in turns})


@functools.cache  # which an integrand evaluates thousands of times
def course(name):
    return prescribed(
        TypeAdapter(
            over_time(Quantity("m", "place", "z"), "place", loops=True)
        ).validate_python(COURSES[name][0])
    )


def pieces(name, *ends):
    """The pieces of a course between some times, one after the other."""
    return [
        Pieces(*row)
        for row in zip(*course(name).pieces(np.array(ends), DURATION), strict=True)
    ]


def at(name, time):
    return float(course(name).at(np.asarray(time), DURATION))


@pytest.mark.parametrize("name", COURSES)
def test_pieces_hold_the_integral_and_the_path_of_the_value(name):
    for start, stop in [(0.0, DURATION), (0.13, 1.07), (0.31, 0.59)]:
        # the zeros of the linear courses, besides their turns, are kinks of the magnitude
        kinks = [
            t
            for t in (
                *TURNS,
                1 / 6,
                0.2,
                0.4,
                0.5 + 0.3 * 0.25,
                0.5 + 2 / 7.5,
                0.8,
                1.0,
            )
            if start < t < stop
        ]
        exact = [
            quad(
                lambda t, f=f: f(at(name, t)),
                start,
                stop,
                points=kinks,
                epsabs=0.0,
                epsrel=1e-12,
            )[0]
            for f in (float, abs, np.square)
        ]
        parts = pieces(name, start, stop)
        squares = [
            piece.unsteady + piece.path**2 / (piece.stop - piece.start)
            for piece in parts
        ]
        sums = (
            sum(piece.integral for piece in parts),
            sum(piece.path for piece in parts),
            sum(squares),
        )
        assert_allclose(sums, exact, rtol=1e-11)
        assert name != "number" or parts[0].unsteady == 0.0
        whole = course(name).pieces(np.array([start, stop]), DURATION).joined
        square = whole.unsteady + whole.path**2 / (stop - start)
        assert_allclose(
            [whole.integral, whole.path, square], np.transpose([exact]), rtol=1e-11
        )
        assert (whole.start, whole.stop, whole.first) == (start, stop, parts[0].first)


@pytest.mark.parametrize("name", COURSES)
def test_the_pieces_of_a_block_of_intervals_are_those_of_each(name):
    ends = DURATION * (np.arange(12) / 11)
    block = course(name).pieces(ends, DURATION)
    alone = [pieces(name, *span) for span in itertools.pairwise(ends)]
    assert [Pieces(*row)[1:] for row in zip(*block, strict=True)] == [
        piece[1:] for few in alone for piece in few
    ]
    assert block.interval.tolist() == [k for k, few in enumerate(alone) for _ in few]
    joined = course(name).pieces(ends, DURATION).joined
    assert_array_equal(joined.interval, np.arange(11))
    assert_array_equal(
        joined.integral, [math.fsum(piece.integral for piece in few) for few in alone]
    )
    assert_array_equal(
        course(name).at(ends, DURATION), [at(name, time) for time in ends]
    )


@pytest.mark.parametrize("name", COURSES)
def test_a_course_is_cut_where_it_turns_or_jumps_and_nowhere_else(name):
    turns, result = COURSES[name][1], pieces(name, 0.0, DURATION)
    assert_allclose([piece.stop for piece in result], [*turns, DURATION], rtol=1e-15)
    assert_allclose(
        [piece.first for piece in result],
        [at(name, piece.start) for piece in result],
        rtol=1e-14,
    )
    assert_allclose(
        [piece.last for piece in result],
        [at(name, piece.stop - 1e-7) for piece in result],
        rtol=1e-5,
    )
    for before, after in itertools.pairwise(result):
        assert before.stop == after.start
        assert (before.last == after.first) == (name != "table" or before.stop != 0.5)
    for turn in turns:  # a step that ends at a turn but for rounding has one piece
        for time in (turn * (1.0 - 3e-16), turn, turn * (1.0 + 3e-16)):
            assert (
                len(pieces(name, turn - 0.1, time))
                == len(pieces(name, time, turn + 0.1))
                == 1
            )


def test_the_last_rows_of_a_computed_decay_are_zero_if_they_are_too_small_to_be_real():
    kind = TypeAdapter(over_time(Quantity("N", "load", "P"), "load"))
    for value in (np.array([1.0, 1e-87, -5e-324]), [1.0, 1e-87, -5e-324]):
        table = kind.validate_python({"time": [0.0, 5e-324, 0.8], "value": value})
        assert (table.time, table.value) == ((0.0, 0.0, 0.8), (1.0, 0.0, 0.0))
        assert_array_equal(prescribed(table).at(np.array([0.4]), DURATION), [0.0])


def test_an_instant_is_one_piece_with_the_value_after_a_jump():
    (piece,) = pieces("table", 0.5, 0.5)
    assert piece == (0, 0.5, 0.5, -0.5, -0.5, 0.0, 0.0, 0.0)


def test_the_values_of_rows_are_their_own_and_sums_over_many_rows_are_rounded_once():
    values = np.random.default_rng(1).normal(size=201)
    result = table_pieces(
        np.linspace(0.0, 1.0, 201), values, np.array([0.0, 0.3, 0.7, 1.0]), 1.0
    )
    assert_array_equal(result.last, values[1:])
    sums = [math.fsum(result.integral[result.interval == k]) for k in range(3)]
    assert_array_equal(result.joined.integral, sums)
