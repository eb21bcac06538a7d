"""What a growing contact does to its bonds: new area brings sites that are not bound yet.

By default a population is that of the present area, whatever its history: a closure. With ``area =
"carried"`` the number of bonds is carried: where the contact has grown, the share of bound sites falls as
the area rises; where it shrinks, bonds leave with their area and the share stays.
"""

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from sim.numerics.noise import Noise

Area = Annotated[
    Literal["present", "carried"],
    Field(description='"carried": area that the contact gains comes without bonds'),
]


def share_kept(seen: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Share of bound sites that is left [1] when the contact radius goes from ``seen`` to ``radius`` [m].

    A contact that was open (0) has none; the first contact seen (nan) keeps all.

    >>> print(share_kept(np.array([1.0, 2.0, 0.0, np.nan]), np.array([2.0, 1.0, 1.0, 1.0])))
    [0.25 1.   0.   1.  ]
    """
    grown = radius > seen
    return np.where(grown, np.square(np.divide(seen, radius, out=np.ones(grown.shape), where=grown)), 1.0)


class OverArea:
    """What depths share whose population may be carried with the area: ``diluted`` is the depth's own.

    The area of a step is that at its start, so dilution follows the contact by one clock step and no
    bond is lost in between. A contact in equilibrium with an energy that fluctuates moves the more, the
    finer the clock: each way out dilutes its bonds and none comes back on the way in, so there is no limit
    of fine steps. A ``rate_dependent`` edge has one.
    """

    area: Area

    @property
    def per_member(self) -> bool:
        """Whether members differ: where the contact of each has its own say."""
        return self.area == "carried"

    def over(self, population: Any, radius: np.ndarray) -> Any:
        """The population over a contact of this radius [m], nan where it is open."""
        if self.area == "present":
            return population
        now = np.nan_to_num(radius, nan=0.0)
        share = np.where(now > 0.0, share_kept(population.seen, now), 0.0)  # an open contact has no bonds to fill
        return replace(self.diluted(population, share), seen=now)

    def rows(self, noise: Noise) -> np.ndarray:
        """Ones, one for each population: all members share one unless each has its own area."""
        return np.ones(len(noise.members) if self.per_member else 1)

    def diluted(self, population: Any, share: np.ndarray) -> Any:
        """The population with only a share of its bonds left."""
        raise NotImplementedError
