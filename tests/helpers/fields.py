"""Fields of given half spectra, by scipy."""

import scipy.fft


def field_of(grid, spectrum):
    """What ``grid.forward`` makes the half spectrum of."""
    return scipy.fft.irfft2(spectrum, s=(grid.points, grid.points)) / grid.spacing**2
