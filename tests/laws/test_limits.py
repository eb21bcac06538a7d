"""Numbers that tell if a contact is the one of Johnson, Kendall & Roberts."""

import numpy as np
from numpy.testing import assert_allclose

from sim.laws.jkr import pull_off_load, radius_at_load
from sim.laws.limits import elastocapillary_length, tabor_number


def test_the_tabor_number_is_the_neck_at_pull_off_over_the_range_of_attraction():
    radius, work, modulus, distance = 1e-7, 0.4, 46.5e9, 0.16e-9
    # 1e-7 * 0.16/(46.5e9^2 * 4.096e-30) = 1.8066
    assert_allclose(
        tabor_number(work, radius, modulus, distance), 1.8066 ** (1 / 3), rtol=1e-5
    )
    last = radius_at_load(pull_off_load(work, radius), work, radius, modulus)
    # the radius at pull-off is the cube root of 9 pi R^2 w/(8 E*)
    number = last**2 / (radius * distance) * (8 / (9 * np.pi)) ** (2 / 3)
    assert_allclose(tabor_number(work, radius, modulus, distance), number, rtol=1e-12)


def test_lengths_of_a_hydrogel_and_of_rubber_span_five_decades():
    lengths = elastocapillary_length(0.072, np.array([50.0, 5e6]), 0.5)
    assert_allclose(lengths, [0.48e-3, 4.8e-9], rtol=1e-12)
    assert_allclose(elastocapillary_length(0.072, 1e3, 0.0), 36e-6, rtol=1e-12)
