"""Numbers for readers: in the prefix that suits, with their error in the last digits."""

import math

import numpy as np
import pytest

from sim import analysis
from sim.units.quantity import Quantity


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.203e-4, "m", "120.3 µm"),
        (42e-3, "J/m^2", "42 mJ/m²"),
        (4.55e-8, "m^2", "0.0455 mm²"),
        (3.1e-16, "m^2", "310 nm²"),
        (-1.5e-7, "N", "-150 nN"),
        (1.6e6, "Pa", "1.6 MPa"),
        (999.96e-6, "m", "1 mm"),
        (0.0, "m/s", "0 m/s"),
        (math.nan, "N", "nan N"),
        (0.25, "1", "0.25"),
        (1e5, "rad/m", "1e+05 rad/m"),
        (500.0, "1/s", "500 1/s"),
    ],
)
def test_a_number_is_told_in_the_prefix_that_suits_it(value, unit, text):
    assert analysis.engineering(value, unit) == text


@pytest.mark.parametrize("unit", ["m", "m/s", "J/m^2", "m^2", "N", "Pa"])
@pytest.mark.parametrize("exponent", range(-14, 12))
def test_told_numbers_read_back_to_what_they_were(unit, exponent):
    text = analysis.engineering(3.25 * 10.0**exponent, unit)
    read = Quantity(unit, "number").read(text.replace("²", "^2"))
    np.testing.assert_allclose(read, 3.25 * 10.0**exponent, rtol=1e-12)


@pytest.mark.parametrize(
    ("mean", "sem", "text"),
    [
        (118.2312, 0.0423, "118.23(4)"),
        (0.5, 0.013, "0.500(13)"),
        (-0.3, 3.0, "0(3)"),
        (1234.0, 56.0, "1230(60)"),
        (12.5, 0.0, "12.5"),
        (12.5, math.nan, "12.5"),
        (math.nan, math.nan, "–"),
        (9.999, 0.0999, "10.00(10)"),
        (120.27993, 0.00013, "120.2799(1)"),
        (0.0, 0.00013, "0.00000(13)"),
        (120.27993, 0.000013, "120.28"),
        (123456.0, 0.4, "123456.0(4)"),
        (123456.0, 40.0, "123460(40)"),
    ],
)
def test_a_mean_carries_its_standard_error_in_brackets(mean, sem, text):
    assert analysis.concise(mean, sem) == text


def test_an_error_is_never_told_as_nothing():
    rng = np.random.default_rng(11)
    for mean, sem in zip(10.0 ** rng.uniform(-6, 6, 2000), 10.0 ** rng.uniform(-9, 3, 2000), strict=True):
        text = analysis.concise(mean, mean * sem)
        assert "(0)" not in text
        if (
            "(" in text
        ):  # the digits in the brackets are the error to a unit of the last one, half of it but for rounding
            shown, digits = text.rstrip(")").split("(")
            unit = 10.0 ** -len(shown.partition(".")[2])
            assert abs(int(digits) * unit - mean * sem) <= 0.51 * max(unit, 10.0 ** math.floor(math.log10(mean * sem)))
            assert abs(float(shown) - mean) <= 0.51 * max(unit, 10.0 ** math.floor(math.log10(mean * sem)))
