"""Numbers with units: read to SI, held to their bounds, refused with a cure."""

import math
from typing import Annotated
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from sim.units import quantity
from sim.units.quantity import Quantity, same_unit

LENGTH = Quantity("m", "length", "l", above=0)
STRESS = Quantity("Pa", "stress", "tau", at_least=0)
FORCE = Quantity("N", "load", "P")
WORK = Quantity("J/m^2", "work", "w", at_least=0)
RATE = Quantity("1/s", "rate", "h", above=0)
ANGLE = Quantity("rad", "angle", "theta")
SHARE = Quantity("1", "share", "chi", at_least=0, at_most=1)
COUNT = Quantity("1", "members", at_least=1, at_most=10**7, whole=True)

UNITS = {
    LENGTH: {
        "m": 1.0,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
        "nm": 1e-9,
        "Å": 1e-10,
        "inch": 25.4e-3,
        "dm": 0.1,
    },
    STRESS: {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6, "bar": 1e5},
    FORCE: {"N": 1.0, "mN": 1e-3, "nN": 1e-9, "kN": 1e3},
    WORK: {
        "J/m^2": 1.0,
        "mJ/m^2": 1e-3,
        "mJ/m²": 1e-3,
        "mJ m⁻²": 1e-3,
        "mJ m^-2": 1e-3,
        "mN/m": 1e-3,
        "mJ/m2": 1e-3,
    },
    RATE: {"1/s": 1.0, "Hz": 1.0, "1/ms": 1e3, "s^-1": 1.0, "/s": 1.0},
    ANGLE: {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180},
    SHARE: {"%": 1e-2},
}


def refusal(declared, value):
    with pytest.raises(PydanticCustomError) as refused:
        declared.read(value)
    return refused.value.message()


def test_a_unit_of_the_right_dimension_becomes_si():
    # 0.25 is exact in binary: what differs is the rounding of pint's own factor, a few units in the last place
    for declared, units in UNITS.items():
        for unit, factor in units.items():
            texts = (
                f"0.25 {unit}",
                f" 0.25  {unit} ",
                f"0.25{'' if unit[0].isalpha() else ' '}{unit}",
            )
            assert_allclose(
                [declared.read(text) for text in texts],
                0.25 * factor,
                rtol=1e-15,
                atol=0,
            )


@given(
    st.integers(-(10**15), 10**15),
    st.sampled_from([("nN", 9), ("uN", 6), ("mN", 3), ("N", 0)]),
)
def test_a_decimal_prefix_costs_no_digit(number, unit):
    name, power = unit
    assert FORCE.read(f"{number} {name}") == float(f"{number}e-{power}")


@given(st.floats(1e-40, 1e40))
def test_a_bare_number_is_si_and_text_needs_a_unit(number):
    assert LENGTH.read(number) == number == LENGTH.read(f"{number!r} m")
    with pytest.raises(PydanticCustomError, match="without a unit"):
        LENGTH.read(repr(number))
    assert Quantity("1", "share").read(repr(number)) == number


@given(
    st.text(max_size=80)
    | st.from_regex(r"[0-9.eE+-]{1,4} ?[a-zA-Zµ^*/ 0-9()-]{1,20}", fullmatch=True)
)
def test_any_text_is_read_or_refused_in_words(text):
    try:
        assert math.isfinite(FORCE.read(text))
    except PydanticCustomError as refused:
        assert refused.message()


def test_a_whole_number_is_read_from_whole_numbers_only():
    assert [COUNT.read(value) for value in (7, 7.0, np.int64(7))] == [7, 7, 7]
    assert all(type(COUNT.read(value)) is int for value in (7, 7.0, np.int64(7)))
    for value in (7.5, "7", True, math.nan, math.inf, None):
        assert "whole number" in refusal(COUNT, value)
    assert "at least 1, not 0" in refusal(COUNT, 0)
    assert "at most 10000000" in refusal(COUNT, 10**5000)


def test_two_numbers_come_in_the_unit_of_the_first():
    assert same_unit("1", "2") == (1.0, 2.0, "")
    assert same_unit(1, 2) == (1.0, 2.0, None)
    for first, last in (
        ("1 m", "1 s"),
        (1, "1 m"),
        ("1 m", "1"),
        ("1 m", "1 foo"),
        ("x", "1 m"),
        ("nan m", "1 m"),
    ):
        assert same_unit(first, last) is None


def test_no_unit_makes_the_parser_compute():
    names = [
        "m^9^9^9^9",
        "m**9**9**9",
        "m^999999999",
        "m^-999",
        "m" * 61,
        "m " * 40,
        "m^0",
        "(m)",
        "m;m",
        "m@m",
        "m!",
    ]
    names += [
        "m if 1 else m",
        "__import__('os')",
        "m.__class__",
        "lambda: m",
        "9m",
        "__m",
        "µ^99/s^98",
        "1e400 m",
    ]
    for unit in (*names, "dB", "degC"):
        assert refusal(LENGTH, f"5 {unit}").startswith(("has the un", "cannot be read"))


def test_what_cannot_be_read_is_refused_with_a_cure():
    for declared, values, words in (
        (WORK, ["42 mJ"], '"mJ"...J/m^2...for example "42 mJ/m^2"'),
        (SHARE, ["0.5 m"], "pure number"),
        (STRESS, ["1 KPa", "1 mpa"], 'unknown unit...for example "1.6 MPa"'),
        (LENGTH, ["1,5 mm", "", "mm 2"], 'decimal point...such as "2 mm"'),
        (
            LENGTH,
            [math.nan, -math.inf, "nan", "inf mm", "-Infinity m", "1e400 m"],
            "finite",
        ),
        (
            LENGTH,
            [True, [1.0], {"a": 1}, None, 1j],
            'must be a number...such as "2 mm"',
        ),
        (SHARE, [False], "must be a number"),
        (LENGTH, [0, "-0 mm", "-3 mm"], "above 0 m, not "),
        (SHARE, [1.5], "at most 1, not 1.5"),
        (Quantity("1", "x", below=2), [2], "below 2, not 2"),
        (LENGTH, [1e41, 10**400], "too large"),
        (LENGTH, [1e-41, "1e-300 mm", 5e-324], 'too small...write for example "2 mm"'),
        (STRESS, [1e-41, 5e-324], 'too small...write 0, or for example "1.6 MPa"'),
    ):
        for value in values:
            message = refusal(declared, value)
            assert all(word in message for word in words.split("...")), message
    # at a bound
    assert (STRESS.read(0), STRESS.read(1e-40), SHARE.read("100 %")) == (
        0.0,
        1e-40,
        1.0,
    )


def test_a_declaration_validates_and_describes_itself():
    kind = TypeAdapter(Annotated[float, LENGTH])
    assert kind.validate_python("2 mm") == kind.dump_python(2e-3) == 2e-3
    described = {
        "type": ["number", "string"],
        "description": "length [m]",
        "exclusiveMinimum": 0,
        "examples": ["2 mm"],
    }
    assert kind.json_schema() == described
    with pytest.raises(ValidationError):
        kind.validate_python("2 kg")
    for declared in (
        *UNITS,
        Quantity("m^2/s", "D", above=0),
        Quantity("K", "T", at_least=300),
        Quantity("m/s", "V"),
    ):
        assert math.isfinite(declared.read(declared.example.strip('"')))


def test_factors_that_come_with_the_package_are_those_of_pint():
    common = quantity._common_scales()
    assert len(common) > 50
    for units, scale in common.items():
        assert quantity._scale_of_pint(*units.split(" in ")) == scale


@pytest.mark.parametrize("harm", ["file", "broken", "full"])
def test_units_are_read_if_the_cache_of_pint_cannot_be_used(
    tmp_path, monkeypatch, harm
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if harm == "full":
        monkeypatch.setattr(
            "pickle.dump", Mock(side_effect=OSError(28, "No space left on device"))
        )
    for _ in range(2):  # fills the cache, then finds it harmed
        quantity._units.cache_clear()
        quantity._scale.cache_clear()
        assert LENGTH.read("2 dm") == 0.2
        for path in [
            path for path in tmp_path.rglob("*") if path.is_file() and harm == "broken"
        ]:
            path.write_bytes(path.read_bytes()[:7])
        if harm == "file":
            monkeypatch.setenv("XDG_CACHE_HOME", __file__)
    quantity._units.cache_clear()
