"""Prescribed courses: values, cuts where they turn or jump, exact integrals between."""

import itertools

import pytest
from numpy.testing import assert_allclose
from pydantic import TypeAdapter
from scipy.integrate import quad

from sim.units.course import held, prescribed
from sim.units.quantity import Quantity

DURATION = 1.2
COURSES = {
    "number": (0.7, []),
    "course": ({"from": -1.0, "to": 3.0}, []),
    "course, log": ({"from": 1e-3, "to": 10.0, "scale": "log"}, []),
    "course, log down": ({"from": -10.0, "to": -1e-3, "scale": "log"}, []),
    "cycles": ({"from": 2.0, "to": -1.0, "cycles": 2}, [0.3, 0.6, 0.9]),
    "cycles, log": ({"from": 2.0, "to": 0.1, "scale": "log", "cycles": 2}, [0.3, 0.6, 0.9]),
    "table": ({"time": [-1.0, 0.0, 0.5, 0.5, 0.8], "value": [9.0, 1.0, 2.0, -0.5, 1.5]}, [0.5, 0.8]),
}
TURNS = sorted({turn for _, turns in COURSES.values() for turn in turns})


def course(name):
    kind = held(Quantity("N", "load", "P"), "load")
    return prescribed(TypeAdapter(kind).validate_python(COURSES[name][0]))


@pytest.mark.parametrize("name", COURSES)
@pytest.mark.parametrize(("start", "stop"), [(0.0, DURATION), (0.13, 1.07), (0.31, 0.59)])
def test_pieces_hold_the_integral_and_the_path_of_the_value(name, start, stop):
    # the zeros of the linear courses, besides their turns, are kinks of the magnitude
    kinks = [t for t in (*TURNS, 0.2, 0.4, 0.5 + 0.3 * 0.25, 0.8, 1.0) if start < t < stop]
    held = course(name)
    pieces = held.pieces(start, stop, DURATION)
    exact = [
        quad(lambda t, f=f: f(held.at(t, DURATION)), start, stop, points=kinks, epsabs=0.0, epsrel=1e-12)[0]
        for f in (float, abs)
    ]
    found = [sum(piece.integral for piece in pieces), sum(piece.path for piece in pieces)]
    assert_allclose(found, exact, rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("name", COURSES)
def test_a_course_is_cut_where_it_turns_or_jumps_and_nowhere_else(name):
    held, turns = course(name), COURSES[name][1]
    pieces = held.pieces(0.0, DURATION, DURATION)
    assert_allclose([piece.stop for piece in pieces], [*turns, DURATION], rtol=1e-15)
    for piece in pieces:
        assert_allclose(piece.first, held.at(piece.start, DURATION), rtol=1e-14)
        before = held.at(piece.stop - 1e-7, DURATION)
        assert_allclose(piece.last, before, rtol=1e-5)
    for before, after in itertools.pairwise(pieces):
        assert before.stop == after.start
        assert (before.last == after.first) == (name != "table" or before.stop != 0.5)


@pytest.mark.parametrize("name", COURSES)
def test_a_step_that_ends_at_a_turn_but_for_rounding_has_one_piece(name):
    for turn in COURSES[name][1]:
        for time in (turn * (1.0 - 3e-16), turn, turn * (1.0 + 3e-16)):
            assert len(course(name).pieces(turn - 0.1, time, DURATION)) == 1
            assert len(course(name).pieces(time, turn + 0.1, DURATION)) == 1


def test_an_instant_is_one_piece_with_the_value_after_a_jump():
    (piece,) = course("table").pieces(0.5, 0.5, DURATION)
    assert piece == (0.5, 0.5, -0.5, -0.5, 0.0, 0.0)
