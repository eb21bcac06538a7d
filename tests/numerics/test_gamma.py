"""The table of the gamma distribution against scipy, which is too slow to import for ``sim check``."""

import numpy as np
import pytest
import scipy
from numpy.testing import assert_allclose

from sim.numerics.gamma import gamma_table


@pytest.mark.parametrize("skewness", [0.0, 0.1, 0.5, 1.0, 2.0])
def test_a_table_holds_the_gamma_distribution_of_its_skewness(skewness):
    exact = scipy.stats.pearson3(skewness)
    table = gamma_table(skewness)
    scores = np.linspace(-0.99 if skewness == 2.0 else -4.0, 8.0, 300)
    # second order in steps of 24/4096 of the logarithm's deviation: 3e-5 squared over eight, of slopes of 1 at most;
    # at skewness 0 the table is that of 1e-4, whose third moment adds 1e-4/6 of it
    assert_allclose(table.above(scores), exact.sf(scores), rtol=0, atol=2e-5)
    values = table.quantiles(1000)
    assert_allclose([values.mean(), values.std()], [0.0, 1.0], atol=1e-12)
    ranks = (np.arange(1000) + 0.5) / 1000
    middle = slice(50, 950)
    # the deviation of a thousand values is up to half a percent below that of all
    assert_allclose(values[middle], exact.ppf(ranks)[middle], rtol=0.01, atol=5e-3)
