"""Running maxima: exact for parabolas, honest about jumps, the same after a restart."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.numerics import extremes

UNKNOWN = np.full(1, np.nan)


def followed(samples, step=0.5, slopes=None):
    found = extremes.first(samples[0], 0.0)
    for number, values in enumerate(samples[1:], 1):
        ends = (UNKNOWN, UNKNOWN) if slopes is None else (slopes[number - 1], slopes[number])
        found = extremes.after(found, values, number * step, step, *ends)
    return found


def test_a_parabola_is_found_between_its_samples():
    top, where = np.array([3.0, 7.0]), np.array([1.2, 2.9])
    times = 0.5 * np.arange(9)
    found = followed([top - 0.1 * (t - where) ** 2 for t in times])
    assert_allclose(found[:, extremes.LARGEST], top, rtol=1e-14)
    assert_allclose(found[:, extremes.WHEN], where, rtol=1e-12)


def test_a_cubic_is_found_between_its_samples_by_values_and_slopes():
    top, where = np.array([2.0, 7.0]), np.array([1.6, 2.9])
    away = [t - where for t in 0.5 * np.arange(7)]
    found = followed([top - u**2 * (1.5 - u) for u in away], slopes=[u * (3.0 * u - 3.0) for u in away])
    assert_allclose(found[:, extremes.LARGEST], top, rtol=1e-14)
    assert_allclose(found[:, extremes.WHEN], where, rtol=1e-12)


def test_a_jump_keeps_its_sample():
    for samples in ([0.0, 0.0, 5.0, 4.9], [4.0, 4.9, 5.0, 0.0, 1.0], [1.0, 5.0]):
        found = followed([np.array([value]) for value in samples])
        assert found[0, extremes.LARGEST] == 5.0
        assert found[0, extremes.WHEN] == 0.5 * samples.index(5.0)


def test_nothing_is_larger_than_nan():
    found = followed([np.array([np.nan]), np.array([2.0]), np.array([np.nan])])
    assert found[0, extremes.LARGEST] == 2.0


def test_the_error_is_of_third_order_in_the_step():
    """A smooth peak, sin t e^(−t) at t = π/4, from off the lattice."""
    exact, errors = np.sin(np.pi / 4) * np.exp(-np.pi / 4), []
    for count in (40, 80, 160, 320):
        times = 0.013 + np.linspace(0.0, 3.0, count + 1)
        found = followed([np.array([np.sin(t) * np.exp(-t)]) for t in times], 3.0 / count)
        errors.append(abs(found[0, extremes.LARGEST] / exact - 1.0))
    assert max(errors) < 1e-4 and errors[-1] < 2e-6 and errors[-1] < errors[0] / 100.0


def test_with_slopes_the_error_is_of_fourth_order():
    exact, errors = np.sin(np.pi / 4) * np.exp(-np.pi / 4), []
    for count in (10, 20, 40, 80):
        times = 0.013 + np.linspace(0.0, 3.0, count + 1)
        slopes = [np.array([(np.cos(t) - np.sin(t)) * np.exp(-t)]) for t in times]
        found = followed([np.array([np.sin(t) * np.exp(-t)]) for t in times], 3.0 / count, slopes)
        errors.append(abs(found[0, extremes.LARGEST] / exact - 1.0))
    # h⁴ f⁗/384 at most, f⁗ = 4 f
    assert np.all(np.array(errors) < (3.0 / np.array([10, 20, 40, 80])) ** 4 / 90.0) and errors[-1] < errors[0] / 100.0


def test_one_row_for_all_members_is_each_members_own():
    samples = [np.array([1.0]), np.array([2.0]), np.array([1.5])]
    wide = [np.repeat(values, 3) for values in samples]
    assert_array_equal(np.repeat(followed(samples), 3, axis=0), followed(wide))
