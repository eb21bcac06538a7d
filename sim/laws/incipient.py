"""The empirical law of the contact area on the way to sliding (Sahli et al. 2018).

A contact of the area A0 at rest has under a tangential force Q, before it slides,

    ``A = A0 - alpha Q^2``,  ``alpha = beta A0^(-gamma)``,

with gamma = 3/2 in the source, for contacts from micrometres to millimetres. The law has no mechanism, and beta no
theory: it depends on the material and on the units of gamma. It is stated here by the alpha of a contact of a known
area, ``alpha = alpha_1 (A0/A_1)^(-gamma)``, whose numbers have units that do not depend on gamma; beta is
``alpha_1 A_1^gamma``, in m^5/N^2 at gamma = 3/2.
"""

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.units.quantity import Quantity, keyed


@keyed(kw_only=True)
class Incipient:
    """Empirical loss of contact area by a tangential force before sliding, `A0 - alpha Q^2`, for fits and figures.

    A contact of the area at rest `area` has the coefficient `shrinkage`; that of other contacts falls as the power
    `exponent` of their area at rest. A run does not read these numbers.

    >>> law = Incipient(shrinkage=100.0, area=1e-8)
    >>> [float(law.shrinkage_at(area)) for area in (1e-8, 4e-8)]
    [100.0, 12.5]
    """

    shrinkage: Annotated[
        float,
        Quantity(
            "m^2/N^2",
            "loss of area over the squared tangential force, of a contact of incipient.area",
            "alpha",
            above=0,
            typical="0.01 mm^2/N^2",
        ),
    ]
    area: Annotated[
        float,
        Quantity(
            "m^2",
            "area at rest of the contact that has this shrinkage",
            "A_1",
            above=0,
        ),
    ]
    exponent: Annotated[
        float,
        Quantity("1", "exponent by which the shrinkage falls with the area", "gamma"),
    ] = 1.5

    @property
    def coefficient(self) -> float:
        """Coefficient beta of ``alpha = beta A0^(-gamma)``, in m^(2 + 2 gamma)/N^2."""
        return float(self.shrinkage * self.area**self.exponent)

    def shrinkage_at(self, area_at_rest: ArrayLike) -> NDArray[np.float64]:
        """Return alpha of contacts of some areas at rest [m^2/N^2]."""
        return np.asarray(
            self.shrinkage * (np.asarray(area_at_rest) / self.area) ** -self.exponent
        )

    def area_at(self, area_at_rest: ArrayLike, force: ArrayLike) -> NDArray[np.float64]:
        """Return the areas of contacts under a tangential force, 0 beyond the force at which none is left.

        Parameters
        ----------
        area_at_rest, force : float or array
            A0 [m^2], Q [N] of either sign.

        Returns
        -------
        array
            A [m^2].
        """
        lost = self.shrinkage_at(area_at_rest) * np.square(force)
        return np.asarray(np.maximum(np.asarray(area_at_rest) - lost, 0.0))
