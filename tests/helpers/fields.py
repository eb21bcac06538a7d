"""Fields of given half spectra, by scipy."""

import numpy as np
import scipy.fft


def field_of(grid, spectrum):
    """What ``grid.forward`` makes the half spectrum of."""
    return scipy.fft.irfft2(spectrum, s=(grid.points, grid.points)) / grid.spacing**2


def complex_amplitudes(process, state):
    """c_q of τ1(x) = Σ c_q e^{iqx} + conjugate in the slider's frame, shape (members, pairs) [Pa]."""
    parts, size = process._standard(state)
    return size[:, np.newaxis] * process.deviation * (parts[:, 0] + 1j * parts[:, 1])
