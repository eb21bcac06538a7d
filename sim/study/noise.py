"""Noise of an instrument and its correlation, from readings of a quantity that only drifts."""

from typing import NamedTuple

import numpy as np
from scipy import linalg, optimize

from sim.parts.exchange import Array

#: Most readings from which the noise is computed; of more, as many are taken evenly.
_MOST = 600
#: Fewest readings that tell a noise and its correlation.
FEWEST = 30


class Noise(NamedTuple):
    """Noise whose readings are independent but for a share of the variance, which is forgotten exponentially.

    Attributes
    ----------
    sigma : float
        Standard deviation [SI].
    share : float
        Share of the variance that is correlated [1].
    time : float
        Time in which the correlation falls by a factor of e [s].
    """

    sigma: float
    share: float
    time: float

    def correlation(self, times: Array) -> Array:
        """Return the correlations of readings at some times [s], shape (times, times)."""
        distance = np.abs(np.subtract.outer(times, times))
        result: Array = self.share * np.exp(-distance / self.time)
        np.fill_diagonal(result, 1.0)
        return result

    def drawn(self, times: Array, rng: np.random.Generator) -> Array:
        """Return noise at some times [s]."""
        root = np.linalg.cholesky(self.correlation(times))
        return np.asarray(self.sigma * (root @ rng.standard_normal(len(times))))


def noise_of(times: Array, values: Array) -> Noise:
    """Return the noise around a straight line of readings at some times, by restricted maximum likelihood.

    The line is a zero and a drift linear in time. Restricted likelihood counts the freedom of the line, so that the
    variance has no bias by it.
    """
    chosen = np.unique(np.linspace(0, len(times) - 1, _MOST).astype(int))
    times, values = times[chosen], values[chosen]
    span = float(np.ptp(times))
    line = np.stack([np.ones(len(times)), (times - times.mean()) / span], axis=1)
    freedom = len(times) - 2

    def fitted(place: Array) -> tuple[float, Noise]:
        share = float(1.0 / (1.0 + np.exp(-np.clip(place[0], -12.0, 12.0))))
        step = span / len(times)
        forgotten = float(np.clip(np.exp(np.clip(place[1], -99, 99)), step, span))
        law = Noise(1.0, share, forgotten)
        root = linalg.cholesky(law.correlation(times), lower=True)
        both = np.column_stack([line, values])
        white = linalg.solve_triangular(root, both, lower=True)
        lines, readings = white[:, :2], white[:, 2]
        solution = np.linalg.lstsq(lines, readings, rcond=None)[0]
        variance = float(np.sum((readings - lines @ solution) ** 2)) / freedom
        size = freedom * np.log(max(variance, 1e-300))
        size += 2.0 * np.sum(np.log(np.diag(root)))
        size += np.linalg.slogdet(lines.T @ lines)[1]
        return float(size), law._replace(sigma=float(np.sqrt(variance)))

    starts = [(-1.0, np.log(span * part)) for part in (0.01, 0.1)]
    searches = [
        optimize.minimize(
            lambda place: fitted(place)[0],
            start,
            method="Nelder-Mead",
            options={"xatol": 0.02, "fatol": 0.01, "maxfev": 120},
        )
        for start in starts
    ]
    return fitted(min(searches, key=lambda search: search.fun).x)[1]
