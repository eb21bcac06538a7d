"""Attributes of all bond models, and the dilution of bonds in a growing contact: new area brings unbound sites.

By default a population is that of the present area, whatever its history: a closure. With ``area =
"carried"`` the number of bonds is carried: where the contact has grown, the share of bound sites falls as
the area rises; where it shrinks, bonds leave with their area and the share stays.
"""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from sim.numerics.noise import Noise
from sim.parts.exchange import Array, Setting

Area = Annotated[
    Literal["present", "carried"], Field(description='"carried": area that the contact gains comes without bonds')
]

#: Contact radius of a population that has not seen a contact yet; share of bonds that stay where the area is no matter.
UNSEEN, _ALL = np.full(1, np.nan), np.ones(1)
UNSEEN.setflags(write=False)


def share_kept(seen: Array, radius: Array) -> Array:
    """Share of bound sites that is left [1] when the contact radius goes from ``seen`` to ``radius`` [m].

    A contact that was open (0) has none; the first contact seen (nan) keeps all.

    >>> print(share_kept(np.array([1.0, 2.0, 0.0, np.nan]), np.array([2.0, 1.0, 1.0, 1.0])))
    [0.25 1.   0.   1.  ]
    """
    grown = radius > seen
    return np.where(grown, np.square(np.divide(seen, radius, out=np.ones(grown.shape), where=grown)), 1.0)


class Common:
    """Attributes of all models, as they are where all members share one population."""

    in_place: ClassVar[bool] = False
    #: Whether they are solved through blocks of clock steps.
    in_blocks: ClassVar[bool] = False
    #: Rough time of a step of a batch where it is made alone, for estimates [s].
    step_seconds: ClassVar[float] = 0.0

    @property
    def numbers(self) -> int:
        """Numbers that a member's state holds."""
        return 1

    @property
    def per_member(self) -> bool:
        return False

    @property
    def feeds_back(self) -> bool:
        return False

    def kept(self, seen: Array, radius: Array) -> tuple[Array, Array]:
        """Share of bound sites left over a contact of ``radius`` [m], nan where it is open, and that of the area."""
        return _ALL, seen

    def chosen(self, area: float, forces: bool) -> Self:
        """The model for a contact of this ``area`` [m²] whose field reads the bonds' ``forces`` or not: this one."""
        return self

    def why(self, area: float, forces: bool) -> str:
        return ""

    def followed(self, speeds: Array, step: float) -> float:
        """Lives of single bonds that are followed in a step of one member at speeds [m/s], on average."""
        return 0.0

    def remarks(self, setting: Setting) -> list[str]:
        return []


class OverArea(Common):
    """Attributes of models whose population may be carried with the area of each member's own contact."""

    area: Area

    @property
    def per_member(self) -> bool:
        return self.area == "carried"

    @property
    def feeds_back(self) -> bool:
        return self.area == "carried"

    def rows(self, noise: Noise) -> Array:
        """Ones, one for each population: all members share one unless each has its own area."""
        return np.ones(len(noise.members) if self.per_member else 1)

    def kept(self, seen: Array, radius: Array) -> tuple[Array, Array]:
        """Share of bound sites left over a contact of ``radius`` [m], nan where it is open, and that of the area.

        The area of a step is that at its start, so dilution follows the contact by one clock step and no
        bond is lost in between. With an equilibrium contact and fluctuating ΔΓ the total outward motion grows without
        bound as dt → 0, and each outward motion dilutes the bonds irreversibly: the result does not converge in dt.
        With a ``rate_dependent`` edge it does.
        """
        if self.area == "present":
            return super().kept(seen, radius)
        now = np.where(np.isnan(radius), 0.0, radius)
        return np.where(now > 0.0, share_kept(seen, now), 0.0), now  # an open contact has no bonds to fill
