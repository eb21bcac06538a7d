"""Running maxima: exact for parabolas, honest about jumps, the same after a restart."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.parts import events
from sim.parts.exchange import Bonding, ContactState, Motion

FOLLOWED = events.Followed()
ONE = np.full(1, 1.0 / np.sqrt(np.pi))  # radius of a contact of unit area


def column(name, maxima):
    return maxima.view(events.MAXIMUM)[:, 0][name]


def contact(radius):
    """A contact that stays closed, with this radius at the end of each step."""
    zero = np.zeros(radius.shape)
    turn = np.full((*radius.shape, 3), np.nan)
    return ContactState(zero + 1.0, radius, zero + np.nan, zero, zero, turn)


def followed(samples, step=0.5, slopes=None, radii=(ONE, ONE)):
    """Running maxima of a stress given by its values, slopes where they are known, and of a pull of these values.

    The friction is that over a growing area.
    """
    zero, slopes = np.zeros(1), slopes or [np.full(1, np.nan)] * len(samples)
    pairs = zip(samples, slopes, strict=True)
    bondings = [
        Bonding(zero, np.asarray(one), zero, zero, slope) for one, slope in pairs
    ]
    first = contact(radii[0])
    maxima = events.first(bondings[0], first, bondings[0].stress, np.empty(0))
    whole = _after(maxima, bondings, radii, step, 1)
    for number in range(1, len(bondings)):
        maxima = _after(maxima, bondings[number - 1 : number + 1], radii, step, number)
    for one, other in zip(maxima[:4], whole[:4], strict=True):
        assert_array_equal(one, other)
    return maxima


def _after(maxima, bondings, radii, step, number):
    """Maxima after a block of steps."""
    steps = len(bondings) - 1
    still, times = (
        np.zeros((steps, 1)),
        step * np.arange(number, number + steps)[:, None],
    )
    motions = Motion(
        number, times, np.full((steps, 1), step), still, still, still, still, still
    )
    bonding = Bonding(*(np.array(values[1:]) for values in zip(*bondings, strict=True)))
    # the radius jumps at the beginning of a step: only the last row of a block is its end
    ends = np.repeat(radii[1][None], steps, axis=0)
    start, pull = (bondings[0], radii[0]), bonding.stress
    return events.after(maxima, start, bonding, contact(ends), pull, motions, FOLLOWED)


def stress(*course):
    return followed(*course).stress[:, 0]


def pull(samples, step=0.5):
    return followed(samples, step).pull[:, 0]


def test_parabolas_and_cubics_are_found_between_samples_and_friction_over_a_growing_area():
    top, where = np.array([3.0, 7.0]), np.array([1.2, 2.9])
    times = 0.5 * np.arange(9)
    maxima = pull([top - 0.1 * (t - where) ** 2 for t in times])
    assert_allclose(column("largest", maxima), top, rtol=1e-14)
    assert_allclose(column("time", maxima), where, rtol=1e-12)
    top, where = np.array([2.0, 7.0]), np.array([1.6, 2.9])
    away = [t - where for t in 0.5 * np.arange(7)]
    maxima = stress(
        [top - 0.05 * u**2 * (1.5 - u) for u in away],
        0.5,
        [0.15 * u * (u - 1.0) for u in away],
    )
    assert_allclose(column("largest", maxima), top, rtol=1e-14)
    assert_allclose(column("time", maxima), where, rtol=1e-12)
    # Hermite's cubic from 0 with slope 1 to 0.5 with slope −0.5, of either sign.
    sign, t = np.array([1.0, -1.0]), np.linspace(0.0, 1.0, 100_001)
    maxima = stress([np.zeros(2), 0.5 * sign], 1.0, [sign, -0.5 * sign])
    cubic = 0.5 * t**2 * (3.0 - 2.0 * t) + t * (1.0 - t) ** 2 - 0.5 * t**2 * (t - 1.0)
    assert_allclose(column("largest", maxima), cubic.max(), rtol=1e-9)
    # Stress 1 − (t − 1/2)² over an area that doubles in a step of 1: cubic, (1 + t)(3/4 + t − t²).
    values, slopes = (
        [np.array([0.75]), np.array([0.75])],
        [np.array([1.0]), np.array([-1.0])],
    )
    maxima = followed(values, 1.0, slopes, (ONE, np.sqrt(2.0) * ONE))
    top = 0.5 * np.sqrt(7.0 / 3.0)  # where 7/4 − 3 t² is 0: 0.76
    assert_allclose(maxima.stress[0, 0, 3:5], [1.0, 0.5], rtol=1e-14)
    assert_allclose(
        maxima.friction[0, 0, 3:5],
        [(1.0 + top) * (0.75 + top - top**2), top],
        rtol=1e-14,
    )


def test_a_jump_keeps_its_sample_and_nothing_is_larger_than_nan():
    for samples in ([0.0, 0.0, 5.0, 4.9], [4.0, 4.9, 5.0, 0.0, 1.0], [1.0, 5.0]):
        maxima = pull([np.array([value]) for value in samples])
        assert column("largest", maxima)[0] == 5.0
        assert column("time", maxima)[0] == 0.5 * samples.index(5.0)
    maxima = pull([np.array([np.nan]), np.array([2.0]), np.array([np.nan])])
    assert column("largest", maxima)[0] == 2.0
    maxima = stress(
        [np.zeros(1), np.ones(1)], 1.0, [np.full(1, 30.0), np.full(1, -1.0)]
    )
    assert column("largest", maxima)[0] == 1.0
    samples = [np.array([1.0]), np.array([2.0]), np.array([1.5])]
    assert_array_equal(
        np.repeat(pull(samples), 3, axis=0),
        pull([np.repeat(values, 3) for values in samples]),
    )


def test_no_maximum_exceeds_a_kink_between_two_straight_courses():
    # From the start up with slope 1 to a kink of height 1, from there down with slope −0.01.
    place = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    samples, slopes = (
        [1.0 - place, 1.0 - 0.01 * (1.0 - place)],
        [np.ones(5), np.full(5, -0.01)],
    )
    largest = column("largest", stress(samples, 1.0, slopes))
    assert np.all(largest <= 1.0 + 1e-15) and np.all(largest >= samples[1])
    # Hermite's cubic from 0 with slope 1 to 0.3 with slope −0.01 exceeds the tangent at its end.
    largest = column(
        "largest",
        stress([np.zeros(1), np.full(1, 0.3)], 1.0, [np.ones(1), np.full(1, -0.01)]),
    )
    assert 0.3 <= largest < 0.3 + 0.01 * 0.2


def test_a_stress_without_slopes_is_never_refined_by_a_parabola():
    # the end of a stick phase, a jump of the speed, a bond of two that breaks
    for samples in ([0.8, 1.0, 0.98], [1.0, 1.0, 0.6], [0.97, 1.0, 0.52]):
        course = [np.full(1, value) for value in samples]
        parabola, largest = (column("largest", of(course)) for of in (pull, stress))
        assert parabola > 1.01 and largest == 1.0


def peak_errors(counts, known):
    """Errors of the peak of sin t e^(−t) at t = π/4 from off the lattice, with or without known slopes."""
    exact, errors = np.sin(np.pi / 4) * np.exp(-np.pi / 4), []
    for count in counts:
        times = 0.013 + np.linspace(0.0, 3.0, count + 1)
        slopes = (
            [np.array([(np.cos(t) - np.sin(t)) * np.exp(-t)]) for t in times]
            if known
            else None
        )
        values = [np.array([np.sin(t) * np.exp(-t)]) for t in times]
        course = values, 3.0 / count
        maxima = stress(*course, slopes) if known else pull(*course)
        errors.append(abs(column("largest", maxima)[0] / exact - 1.0))
    return np.array(errors)


def test_the_error_is_of_third_order_in_the_step_and_of_fourth_with_slopes():
    errors = peak_errors((40, 80, 160, 320), known=False)
    assert max(errors) < 1e-4 and errors[-1] < 2e-6 and errors[-1] < errors[0] / 100.0
    counts = np.array([10, 20, 40, 80])
    errors = peak_errors(counts, known=True)
    # h⁴ f⁗/384, f⁗ = 4 f
    assert (
        np.all(errors < (3.0 / counts) ** 4 / 90.0) and errors[-1] < errors[0] / 100.0
    )


def test_the_first_maximum_of_friction_counts_once_friction_has_fallen_from_it_by_a_hundredth():
    rises = [0.0, 1.0, 2.0, 3.0]
    for fall, end, largest in (
        (0.02, 2.98, np.nan),  # by less
        (0.04, 2.98, 3.0),
        (0.04, 5.0, 3.0),  # a larger one comes later
        (0.02, 5.0, np.nan),  # it is exceeded before
        (-1.0, 9.0, np.nan),
    ):
        course = [*rises, 3.0 - fall, end]
        samples = [np.full(1, value) for value in course]
        # without slopes a maximum is that of the samples
        top = followed(samples).first_maximum(0)
        assert_allclose(top["largest"], largest, rtol=1e-14)
        assert_allclose(top["time"], 1.5 + 0.0 * largest, rtol=1e-14)
        assert_allclose(top["area"], 1.0 + 0.0 * largest, rtol=1e-14)


def test_a_friction_that_only_falls_has_no_first_maximum_and_a_rest_begins_another():
    falls = [np.full(1, value) for value in (3.0, 2.0, 1.0)]
    maxima = followed(falls)
    assert np.isnan(maxima.first_maximum(0)["largest"])
    for after_rest, start in ((True, 1.0), (False, 3.0)):
        ahead = maxima.next_phase(2.0, after_rest, events.NO_JUMPS).rise[0, :, 0]
        assert_allclose(ahead, [3.0, start], rtol=1e-14)
