"""Dilution of the bonds of a growing contact: new area brings sites that are not bound yet.

By default a population is that of the present area, whatever its history: a closure. With ``area =
"carried"`` the number of bonds is carried: where the contact has grown, the share of bound sites falls as
the area rises; where it shrinks, bonds leave with their area and the share stays.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from sim.numerics.noise import Noise

Area = Annotated[
    Literal["present", "carried"],
    Field(description='"carried": area that the contact gains comes without bonds'),
]

#: Contact radius of a population that has not seen a contact yet.
UNSEEN = np.full(1, np.nan)
UNSEEN.setflags(write=False)


def share_kept(seen: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Share of bound sites that is left [1] when the contact radius goes from ``seen`` to ``radius`` [m].

    A contact that was open (0) has none; the first contact seen (nan) keeps all.

    >>> print(share_kept(np.array([1.0, 2.0, 0.0, np.nan]), np.array([2.0, 1.0, 1.0, 1.0])))
    [0.25 1.   0.   1.  ]
    """
    grown = radius > seen
    return np.where(grown, np.square(np.divide(seen, radius, out=np.ones(grown.shape), where=grown)), 1.0)


def kept(seen: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share of bound sites that is left over a contact of this ``radius`` [m], nan where it is open, and what it saw.

    The area of a step is that at its start, so dilution follows the contact by one clock step and no
    bond is lost in between. With an equilibrium contact and fluctuating ΔΓ the total outward motion grows without
    bound as dt → 0, and each outward motion dilutes the bonds irreversibly: the result does not converge in dt.
    With a ``rate_dependent`` edge it does.
    """
    now = np.nan_to_num(radius, nan=0.0)
    return np.where(now > 0.0, share_kept(seen, now), 0.0), now  # an open contact has no bonds to fill


class OverArea:
    """Attributes of models whose population may be carried with the area of each member's own contact."""

    area: Area

    @property
    def per_member(self) -> bool:
        return self.area == "carried"

    @property
    def feeds_back(self) -> bool:
        return self.area == "carried"

    def rows(self, noise: Noise) -> np.ndarray:
        """Ones, one for each population: all members share one unless each has its own area."""
        return np.ones(len(noise.members) if self.per_member else 1)
