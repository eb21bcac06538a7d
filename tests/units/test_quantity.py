"""Numbers with units: read to SI, held to their bounds, refused with a cure."""

import math
import os
import pickle
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from sim.units import quantity
from sim.units.quantity import Quantity, number_and_unit, same_unit

LENGTH = Quantity("m", "length", "l", above=0)
STRESS = Quantity("Pa", "stress", "tau", at_least=0)
FORCE = Quantity("N", "load", "P")
WORK = Quantity("J/m^2", "work", "w", at_least=0)
RATE = Quantity("1/s", "rate", "h", above=0)
ANGLE = Quantity("rad", "angle", "theta")
SHARE = Quantity("1", "share", "chi", at_least=0, at_most=1)

UNITS = {
    LENGTH: {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "Å": 1e-10, "inch": 25.4e-3},
    STRESS: {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6, "bar": 1e5},
    FORCE: {"N": 1.0, "mN": 1e-3, "nN": 1e-9, "kN": 1e3},
    WORK: {"J/m^2": 1.0, "mJ/m^2": 1e-3, "mJ/m²": 1e-3, "mJ m⁻²": 1e-3, "mJ m^-2": 1e-3, "mN/m": 1e-3, "mJ/m2": 1e-3},
    RATE: {"1/s": 1.0, "Hz": 1.0, "1/ms": 1e3, "s^-1": 1.0, "/s": 1.0},
    ANGLE: {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180},
    SHARE: {"%": 1e-2},
}


def refusal(declared, value):
    with pytest.raises(PydanticCustomError) as refused:
        declared.read(value)
    return refused.value.message()


@pytest.mark.parametrize(
    ("declared", "unit", "factor"),
    [(declared, unit, factor) for declared, units in UNITS.items() for unit, factor in units.items()],
)
def test_a_unit_of_the_right_dimension_becomes_si(declared, unit, factor):
    # 0.25 is exact in binary: what differs is the rounding of pint's own factor, a few units in the last place
    for text in (f"0.25 {unit}", f" 0.25  {unit} ", f"0.25{'' if unit[0].isalpha() else ' '}{unit}"):
        assert_allclose(declared.read(text), 0.25 * factor, rtol=1e-15, atol=0)


@given(st.integers(-(10**15), 10**15), st.sampled_from([("nN", 9), ("uN", 6), ("mN", 3), ("N", 0)]))
def test_a_decimal_prefix_costs_no_digit(number, unit):
    name, power = unit
    assert FORCE.read(f"{number} {name}") == float(f"{number}e-{power}")


@given(st.floats(1e-50, 1e50))
def test_a_bare_number_is_si_and_text_needs_a_unit(number):
    assert LENGTH.read(number) == number == LENGTH.read(f"{number!r} m")
    with pytest.raises(PydanticCustomError, match="without a unit"):
        LENGTH.read(repr(number))
    assert Quantity("1", "share").read(repr(number)) == number


def test_a_whole_number_is_read_from_whole_numbers_only():
    count = Quantity("1", "members", at_least=1, at_most=10**7, whole=True)
    assert [count.read(value) for value in (7, 7.0, np.int64(7))] == [7, 7, 7]
    assert all(type(count.read(value)) is int for value in (7, 7.0, np.int64(7)))
    for value in (0, 7.5, "7", True, math.nan, math.inf, None, 10**400):
        with pytest.raises(PydanticCustomError):
            count.read(value)


def test_two_numbers_come_in_the_unit_of_the_first():
    assert same_unit("10 um/s", "30 mm/s") == (10.0, 30000.0, "um/s")
    assert same_unit("1", "2") == (1.0, 2.0, "")
    assert same_unit(1, 2) == (1.0, 2.0, None)
    for first, last in (("1 m", "1 s"), (1, "1 m"), ("1 m", "1"), ("1 m", "1 foo"), ("x", "1 m")):
        assert same_unit(first, last) is None


@given(st.text(max_size=80))
def test_any_text_is_read_or_refused_in_words(text):
    try:
        assert math.isfinite(LENGTH.read(text))
    except PydanticCustomError as refused:
        assert refused.message()


@given(st.from_regex(r"[0-9.]{1,4} ?[a-zA-Zµ°% /*^()0-9.\-]{1,40}", fullmatch=True))
def test_anything_like_a_unit_is_read_or_refused_in_words(text):
    try:
        assert math.isfinite(FORCE.read(text))
    except PydanticCustomError as refused:
        assert refused.message()


@pytest.mark.parametrize(
    "unit",
    ["m^9^9^9^9", "m**9**9**9", "m^999999999", "m^-999", "m" * 61, "m " * 40, "m^0", "(m)", "m;m", "m if 1 else m"]
    + ["__import__('os')", "m.__class__", "lambda: m", "m@m", "m!", "9m", "__m", "dB", "degC", "µ^99/s^98", "1e400 m"],
)
def test_no_unit_makes_the_parser_compute(unit):
    assert refusal(LENGTH, f"5 {unit}").startswith(("has the un", "cannot be read"))


def test_a_unit_of_another_dimension_is_named_with_what_is_wanted():
    assert refusal(WORK, "42 mJ") == ('has the unit "mJ", which is not a unit of J/m^2; write for example "42 mJ/m^2"')
    assert refusal(SHARE, "0.5 m").startswith('has the unit "m", which is not a unit of a pure number')


@pytest.mark.parametrize(("given_", "meant"), [("KPa", "kPa"), ("mpa", "MPa"), ("MPA", "MPa"), ("Paa", "Pa")])
def test_a_misspelt_unit_is_told_with_the_one_meant(given_, meant):
    assert refusal(STRESS, f"1 {given_}") == f'has the unknown unit "{given_}"; did you mean "{meant}"?'


def test_of_letters_with_two_meanings_the_one_of_the_example_is_meant():
    load = Quantity("N", "load", typical="4 mN")
    assert refusal(load, "4 mn") == 'has the unknown unit "mn"; did you mean "mN"?'


def test_a_decimal_comma_is_told():
    assert refusal(LENGTH, "1,5 mm") == (
        'cannot be read: "1,5 mm"; write decimals with a point and a unit, such as "2 mm"'
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "nan", "inf mm", "-Infinity m", "1e400 m", "NaN"])
def test_what_is_not_finite_is_refused(value):
    assert refusal(LENGTH, value) == 'must be finite; write for example "2 mm"'


@pytest.mark.parametrize(
    ("value", "named"),
    [(True, "true"), ([1.0], "a list"), ({"a": 1}, "a table"), (None, "something else"), (1j, "something else")],
)
def test_what_is_no_number_is_named(value, named):
    assert refusal(LENGTH, value) == f'must be a number or text with a unit such as "2 mm", not {named}'


def test_every_bound_is_told_with_the_value_in_si():
    assert refusal(LENGTH, 0) == "must be above 0 m, not 0 m"
    assert refusal(LENGTH, "-3 mm") == "must be above 0 m, not -0.003 m"
    assert refusal(STRESS, "-1 kPa") == "must be at least 0 Pa, not -1000 Pa"
    assert refusal(SHARE, 1.5) == "must be at most 1, not 1.5"
    assert refusal(Quantity("1", "x", below=2), 2) == "must be below 2, not 2"
    assert STRESS.read(0) == 0.0
    assert SHARE.read("100 %") == 1.0


def test_numbers_that_leave_the_range_of_floats_in_products_are_refused():
    assert refusal(LENGTH, 1e61).startswith("is too large to be real: 1e+61 m")
    assert refusal(LENGTH, 1e-61).startswith("is too small to be real: 1e-61 m")
    assert refusal(LENGTH, 10**400).startswith("is too large")
    assert STRESS.read(1e-300) == 1e-300  # zero is allowed there, and so is what rounds to it


def test_every_example_is_admissible():
    for declared in (*UNITS, Quantity("m^2/s", "D", above=0), Quantity("K", "T", at_least=300), Quantity("m/s", "V")):
        assert math.isfinite(declared.read(declared.example.strip('"')))


def test_number_and_unit_come_apart_as_they_stand():
    assert number_and_unit("4.5 mN") == (4.5, "mN")
    assert number_and_unit("-1e-3") == (-1e-3, "")
    assert number_and_unit(7) == (7.0, "")
    for other in ("mN", "nan N", True, [1], None, 10**400):
        assert number_and_unit(other) is None


def test_a_declaration_validates_and_describes_itself():
    kind = TypeAdapter(Annotated[float, LENGTH])
    assert kind.validate_python("2 mm") == 2e-3
    assert kind.dump_python(2e-3) == 2e-3
    assert kind.json_schema() == {
        "type": ["number", "string"],
        "description": "length [m]",
        "exclusiveMinimum": 0,
        "examples": ["2 mm"],
    }
    with pytest.raises(ValidationError):
        kind.validate_python("2 kg")


@pytest.fixture
def fresh_registry(monkeypatch, tmp_path):
    """A registry of units made anew from a cache folder of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("SIM_CACHE_DIR", raising=False)
    _forget()
    yield tmp_path
    _forget()


def _forget():
    for known in (quantity._units, quantity._scale, quantity._known_scales):
        known.cache_clear()


def test_units_are_read_where_the_cache_folder_is_a_file(fresh_registry, monkeypatch):
    (fresh_registry / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(fresh_registry / "file"))
    assert LENGTH.read("2 dm") == 0.2


def test_units_are_read_where_the_cache_is_read_only(fresh_registry):
    os.chmod(fresh_registry, 0o500)
    assert LENGTH.read("2 dm") == 0.2
    os.chmod(fresh_registry, 0o700)


def test_units_are_read_where_the_cache_is_broken(fresh_registry):
    assert LENGTH.read("2 dm") == 0.2
    kept = [path for path in fresh_registry.rglob("*") if path.is_file()]
    assert kept
    for path in kept:
        path.write_bytes(path.read_bytes()[:7])
    _forget()
    assert LENGTH.read("3 dm") == 0.3


def test_units_are_read_where_the_disk_is_full(fresh_registry, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pickle, "dump", full)
    assert LENGTH.read("2 dm") == 0.2
