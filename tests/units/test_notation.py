"""Numbers for readers: in the prefix that suits, with their error in the last digits."""

import math

import numpy as np

from sim.units.notation import bounded, concise, engineering
from sim.units.quantity import Quantity


def test_a_number_has_the_prefix_that_suits_it():
    for value, unit, text in (
        (1.203e-4, "m", "120.3 µm"),
        (42e-3, "J/m^2", "42 mJ/m²"),
        (4.55e-8, "m^2", "0.0455 mm²"),
        (3.1e-16, "m^2", "310 nm²"),
        (-1.5e-7, "N", "-150 nN"),
        (999.96e-6, "m", "1 mm"),
        (0.0, "m/s", "0 m/s"),
        (math.nan, "N", "nan N"),
        (0.25, "1", "0.25"),
    ):
        assert engineering(value, unit) == text


def test_numbers_read_back_to_what_they_were():
    for unit in ("m", "m/s", "J/m^2", "m^2", "N", "Pa"):
        numbers = 3.25 * 10.0 ** np.arange(-14, 12)
        texts = [engineering(number, unit).replace("²", "^2") for number in numbers]
        np.testing.assert_allclose(
            [Quantity(unit, "number").read(text) for text in texts],
            numbers,
            rtol=1e-12,
            atol=0,
        )


def test_a_mean_carries_its_standard_error_in_brackets():
    for mean, sem, text in (
        (118.2312, 0.0423, "118.231(42)"),
        (-0.3, 3.0, "-0.3(30)"),
        (1234.0, 56.0, "1234(56)"),
        (12.5, 0.0, "12.5"),
        (math.nan, math.nan, "–"),
        (9.999, 0.0999, "10.00(10)"),
        (0.0, 0.00013, "0.00000(13)"),
        (120.27993, 0.000013, "120.28"),
        (123456.0, 4.0, "123460"),
        (123456.0, 40.0, "123456(40)"),
    ):
        assert concise(mean, sem) == text


def test_an_error_is_never_written_as_nothing():
    rng = np.random.default_rng(11)
    for mean, sem in zip(
        10.0 ** rng.uniform(-6, 6, 2000), 10.0 ** rng.uniform(-9, 3, 2000), strict=True
    ):
        text = concise(mean, mean * sem)
        assert "(0)" not in text
        # the digits in the brackets are the error to a unit of the last, half of it but for rounding
        if "(" in text:
            shown, digits = text.rstrip(")").split("(")
            unit = 10.0 ** -len(shown.partition(".")[2])
            largest = 0.51 * max(unit, 0.1 * 10.0 ** math.floor(math.log10(mean * sem)))
            assert (
                abs(int(digits) * unit - mean * sem) <= largest
                and abs(float(shown) - mean) <= largest
            )


def test_a_systematic_error_stands_behind_the_value_and_never_in_brackets():
    for numbers, text in (
        ((83.214, 0.2, math.nan, math.nan, 0.31, "step"), "83.21(20) ± 0.31 (step)"),
        ((116.587, math.nan, math.nan, math.nan, 0.4, "step"), "116.59 ± 0.40 (step)"),
        ((83.214, 0.2, math.nan, math.nan, 0.01, "step"), "83.21(20)"),
        ((116.587, 0.0, math.nan, math.nan, 1e-5, "records"), "116.6"),
        ((1170.0, 0.0, math.nan, math.nan, 40.0, "records"), "1170 ± 40 (records)"),
        ((math.nan, math.nan, 0.3, 3.0, 0.4, "step"), "0.3 to 3"),
    ):
        assert bounded(*numbers) == text
