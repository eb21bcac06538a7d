"""What a bond population hands to the shear part: the stress it carries and how its bonds differ."""

from dataclasses import dataclass

import numpy as np


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
