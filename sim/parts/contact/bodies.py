"""Bodies in contact: the solid, the sphere pressed on it, and their adhesion.

Frozen constants of a scene.
"""

from functools import cached_property
from typing import Annotated, cast

from pydantic import model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import in_series
from sim.units.quantity import Quantity

_SHEAR = Quantity("Pa", "shear modulus", "G", above=0)
_YOUNG = Quantity("Pa", "Young's modulus", "E", above=0)
_POISSON = Quantity("1", "Poisson ratio", "nu", at_least=0, at_most=0.5)


@dataclass(frozen=True, config={"extra": "forbid"})
class Body:
    """An elastic body, given by one of its two moduli.

    Parameters
    ----------
    shear_modulus, youngs_modulus : float or str, one of the two
        G or E [Pa].
    poisson_ratio : float
        nu [1].
    """

    shear_modulus: Annotated[float, _SHEAR] | None = None
    youngs_modulus: Annotated[float, _YOUNG] | None = None
    poisson_ratio: Annotated[float, _POISSON] = 0.5

    @model_validator(mode="after")
    def _one_modulus(self) -> "Body":
        if (self.shear_modulus is None) == (self.youngs_modulus is None):
            found = "none is" if self.shear_modulus is None else "both are"
            raise PydanticCustomError(
                "one_modulus",
                'needs exactly one modulus, but {found} given: write either shear_modulus = "1.6 MPa" '
                'or youngs_modulus = "4.8 MPa"',
                {"found": found},
            )
        return self

    @cached_property
    def own_shear_modulus(self) -> float:
        """G of this body alone [Pa]: as given, or E/(2(1 + nu))."""
        if self.youngs_modulus is not None:
            return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
        return cast(float, self.shear_modulus)  # one of the two is there, as checked above


@dataclass(frozen=True, config={"extra": "forbid"})
class Solid(Body):
    """The elastic half-space, with what presses on it if that yields too.

    Parameters
    ----------
    shear_modulus, youngs_modulus : float or str, one of the two
        G or E [Pa].
    poisson_ratio : float
        nu [1]; the theory is that of 0.5, other values neglect the normal-tangential coupling.
    counter_body : Body, optional
        An elastic sphere; without it the sphere is rigid.

    Examples
    --------
    >>> pdms = Solid(shear_modulus="1.6 MPa")
    >>> print(f"{pdms.contact_modulus:.2e}")
    6.40e+06
    >>> both = Solid(shear_modulus="1.6 MPa", counter_body={"youngs_modulus": "4.8 MPa"})
    >>> print(f"{both.contact_modulus:.2e}")
    3.20e+06
    """

    counter_body: Body | None = None

    @cached_property
    def effective(self) -> tuple[float, float]:
        """G [Pa] and nu [1] of the one half-space that yields as both bodies do.

        The bodies' 1/G and nu/G add, and with them both the tangential and the normal compliance.
        """
        if self.counter_body is None:
            return self.own_shear_modulus, self.poisson_ratio
        other = self.counter_body
        return in_series(self.own_shear_modulus, self.poisson_ratio, other.own_shear_modulus, other.poisson_ratio)

    @cached_property
    def contact_modulus(self) -> float:
        """E* = 2G/(1 - nu) of the effective half-space [Pa]; 4G for one incompressible body."""
        shear_modulus, poisson_ratio = self.effective
        return 2.0 * shear_modulus / (1.0 - poisson_ratio)


@dataclass(frozen=True, config={"extra": "forbid"})
class Sphere:
    """The smooth sphere.

    Parameters
    ----------
    radius : float or str
        R [m].
    """

    radius: Annotated[float, Quantity("m", "radius of the sphere", "R", above=0)]


@dataclass(frozen=True, config={"extra": "forbid"})
class Adhesion:
    """Work of adhesion, and how much of it the bonds carry.

    Parameters
    ----------
    work : float or str
        Delta gamma with all the bonds of rest [J/m^2].
    bond_share : float
        Share of it that goes with the bonds [1]; the rest (van der Waals, say) stays.

    Notes
    -----
    ``Delta gamma(phi) = work (1 - share + share phi)``. The paper gives no relation between the
    number of bonds and the work of adhesion: this line, linear in the bond fraction phi, is an
    assumption of this project.

    Examples
    --------
    >>> print(f"{Adhesion(work='42 mJ/m^2', bond_share=0.5).work_of_bonds(0.5):.4f}")
    0.0315
    """

    work: Annotated[float, Quantity("J/m^2", "work of adhesion at rest", "Δγ", at_least=0)]
    bond_share: Annotated[
        float, Quantity("1", "share of the work of adhesion carried by bonds", "β", at_least=0, at_most=1)
    ] = 1.0

    def work_of_bonds(self, fraction):
        """Delta gamma [J/m^2] at a bond fraction phi [1], a float or an array."""
        return self.work * (1.0 - self.bond_share + self.bond_share * fraction)
