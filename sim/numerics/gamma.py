"""The gamma distribution of a skewness, scaled to the mean 0 and the variance 1, in a table.

It is summed by the trapezoidal rule over the logarithm, because to import ``scipy.special`` would make the start of
``sim run`` and ``sim check`` an eighth longer.
"""

import math
from typing import NamedTuple

import numpy as np

#: Points of a table; width of a table in standard deviations of the logarithm; the least skewness that is told from 0.
_POINTS, _WIDTH, _LEAST = 2**12, 12.0, 1e-4


class GammaTable(NamedTuple):
    """Distribution of a gamma number with the mean 0 and the variance 1.

    Attributes
    ----------
    scores : array
        Values of the number, in increasing order [1].
    below : array
        Probability of a smaller value [1].
    """

    scores: np.ndarray
    below: np.ndarray

    def quantiles(self, count: int) -> np.ndarray:
        """Return equally likely values, shape (count,), scaled to the mean 0 and the variance 1 in their turn."""
        values = np.interp((np.arange(count) + 0.5) / count, self.below, self.scores)
        return np.asarray((values - np.mean(values)) / np.std(values))

    def above(self, score: np.ndarray) -> np.ndarray:
        """Return the probability of values above some scores, in the shape of these."""
        return 1.0 - np.interp(score, self.scores, self.below, left=0.0, right=1.0)


def gamma_table(skewness: float) -> GammaTable:
    """Return the gamma distribution of a skewness of at least 0, which is a normal one at 0.

    Notes
    -----
    A number X with ``p(X) ~ X^(k - 1) e^(-X)`` has the mean and the variance k and the skewness ``2/sqrt(k)``. Its
    score is ``(X - k)/sqrt(k)``.

    Examples
    --------
    The share above the mean is 1/e for an exponential number, of skewness 2, and half for a normal one:

    >>> print("%.4f %.4f" % tuple(float(gamma_table(s).above(0.0)) for s in (2.0, 0.0)))
    0.3679 0.5000
    """
    shape = 4.0 / max(skewness, _LEAST) ** 2
    root = math.sqrt(shape)
    logs = np.linspace(-1.0 - 1.0 / root, 1.0, _POINTS) * _WIDTH / root
    excess = np.expm1(logs)
    density = np.exp(shape * (logs - excess))
    below = np.cumsum(density) - 0.5 * density
    return GammaTable(root * excess, below / np.sum(density))
