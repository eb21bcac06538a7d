"""What a drive hands to the other parts for one clock step."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """Sliding during one clock step, each array of shape (1,) or (members,).

    Attributes
    ----------
    step : int
        Number of the step; 0 is the start, which has no duration.
    time : float
        Time at the end of the step [s].
    duration : float
        Length of the step [s].
    slip : array
        Displacement of the slider over the step, signed [m].
    path : array
        Distance slid over the step, the integral of the absolute speed [m].
    first : array
        Speed at the beginning of the step [m/s]; after a jump of the speed, the new one.
    speed : array
        Speed at the end of the step [m/s]; before a jump there, the old one.
    """

    step: int
    time: float
    duration: float
    slip: np.ndarray
    path: np.ndarray
    first: np.ndarray
    speed: np.ndarray


@dataclass(frozen=True)
class Traction:
    """Shear that bonds carry, each array of shape (1,) or (members,).

    Attributes
    ----------
    stress : array
        Mean shear stress τ0 [Pa], positive against positive sliding.
    frozen : array
        n f̄² [N²/m²] for n sites per area of mean force f̄: what a pattern of sites fixed on the slider
        makes of the mean force. nan where bonds carry no stretch.
    varying : array
        n Var f [N²/m²]: what forces that differ from bond to bond add. nan where it is not known.
    """

    stress: np.ndarray
    frozen: np.ndarray
    varying: np.ndarray

    @classmethod
    def of_stress(cls, stress: np.ndarray) -> "Traction":
        """A stress of bonds whose forces are not known."""
        unknown = np.full(1, np.nan)
        return cls(stress, unknown, unknown)
