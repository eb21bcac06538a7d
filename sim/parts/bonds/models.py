"""Bond populations: the models there are, and the choice between them.

Simple to full: none, steady, rate, counted without a stretch; rate, cohort, tracked with one. Both
kinds of rate equation are called ``rate``: a rupture law distinguishes them.
"""

import math
from typing import Annotated, Literal, cast

from pydantic import Discriminator, Tag, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.bonds.area import Area
from sim.parts.bonds.rupture import Rupture
from sim.parts.bonds.stretched import Cohort, Density, FirstMoment, Rebinding, Stiffness, Tracked
from sim.parts.bonds.two_state import Counted, CriticalSpeed, Rate, Sites, Start, Steady, Stress, Unbroken
from sim.units.quantity import Quantity

_MOST_TRACKED = 10**6
_WITHOUT = ("critical_speed", "rebinding_rate")
_WITH = ("rupture", "bond_stiffness", "rebinding_rate", "site_density")
_STRETCHED = ("rupture", "bond_stiffness", "site_density")

#: A model that can be advanced.
Model = Unbroken | Steady | Rate | Counted | FirstMoment | Cohort | Tracked


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Auto:
    """The simplest model that is good to ``tolerance``; it takes the keys of all of them.

    A finite number N of bonds fluctuates by 1/√N: where that is above the tolerance they are counted, or
    tracked if they have a rupture law. Otherwise it is the rate equation, or cohorts where the rupture rate depends
    on the stretch.
    """

    critical_speed: CriticalSpeed | None = None
    stress: Stress = 0.0
    rupture: Rupture | None = None
    bond_stiffness: Stiffness | None = None
    rebinding_rate: Rebinding | None = None
    site_density: Density | None = None
    sites: Sites | None = None
    tolerance: Annotated[float, Quantity("1", "noise of the bonds that may be left out", "", above=0, below=1)] = 0.01
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["auto"] = "auto"

    @model_validator(mode="after")
    def _one_kind(self) -> "Auto":
        with_ = any(getattr(self, name) is not None for name in _STRETCHED)
        if (self.critical_speed is not None) == with_:
            said = f"give either {' and '.join(_WITHOUT)}, or {', '.join(_WITH[:-1])} and {_WITH[-1]}"
            raise PydanticCustomError("one_kind", said)
        missing = [name for name in (_WITH if with_ else _WITHOUT) if getattr(self, name) is None]
        if missing:
            are = "is" if len(missing) == 1 else "are"
            raise PydanticCustomError("one_kind", f"{' and '.join(missing)} {are} missing, which bonds like these need")
        if with_ and self.stress:
            raise PydanticCustomError("one_kind", "bonds with a rupture make their own stress; leave stress out")
        return self

    def number(self, area: float) -> float:
        """Sites of a contact of this area [m²]: as given, else by their density; infinite without both."""
        if self.sites is not None:
            return self.sites
        return math.inf if self.site_density is None or not area > 0.0 else max(1.0, round(self.site_density * area))

    def chosen(self, area: float, forces: bool) -> Model:
        """The model for a contact of this ``area`` [m²] whose field reads the bonds' ``forces`` or not."""
        number, start = self.number(area), self.start_from
        noisy = self.tolerance**2 * number < 1.0 and self.area == "present"
        if self.rupture is None:
            plain = cast(tuple[float, float], (self.critical_speed, self.rebinding_rate))
            if noisy:
                return Counted(*plain, sites=int(number), stress=self.stress, start_from=start)
            return Rate(*plain, stress=self.stress, start_from=start, area=self.area)
        rest = cast(tuple[float, float, float], (self.bond_stiffness, self.rebinding_rate, self.site_density))
        if noisy and number <= _MOST_TRACKED and self.rupture.separable:
            return Tracked(self.rupture, *rest, sites=int(number), start_from=start)
        if not self.rupture.depends_on_stretch and not forces:
            return FirstMoment(self.rupture, *rest, start_from=start, area=self.area)
        tolerance = max(1e-12, min(1e-4, 0.1 * self.tolerance))
        return Cohort(self.rupture, *rest, tolerance=tolerance, start_from=start, area=self.area)

    def why(self, area: float, forces: bool) -> str:
        """The reason for the choice, in words."""
        number, model = self.number(area), self.chosen(area, forces).model
        if math.isinf(number):
            size = "no number of sites is given"
        else:
            noise = 1.0 / math.sqrt(number)
            size = f"1/√N of {number:,.0f} site{'' if number == 1 else 's'} is {noise:.3g}, "
            size += f"{'above' if noise > self.tolerance else 'within'} the tolerance of {self.tolerance:g}"
        if model in ("counted", "tracked"):
            return size
        if self.area == "carried":
            size += "; a number of sites cannot be carried with the area"
        elif self.tolerance**2 * number < 1.0 and number > _MOST_TRACKED:
            size += f"; more than {_MOST_TRACKED:,} bonds are not followed one by one"
        if model == "cohort":
            return f"{size}; {'the forces of the bonds are read' if forces else 'the rupture depends on the stretch'}"
        return f"{size}; the rupture rate does not depend on the stretch"


def _tag(value: object) -> str | None:
    """Class of a table or a part: both rate equations have one name."""
    given = value if isinstance(value, dict) else {name: getattr(value, name, None) for name in ("model", *_STRETCHED)}
    model = given.get("model")
    if not isinstance(model, str):
        return None
    with_stretch = any(given.get(name) is not None for name in _STRETCHED)
    return "rate[rupture]" if model == "rate" and with_stretch else model


Bonds = Annotated[
    Annotated[Unbroken, Tag("none")]
    | Annotated[Steady, Tag("steady")]
    | Annotated[Rate, Tag("rate")]
    | Annotated[FirstMoment, Tag("rate[rupture]")]
    | Annotated[Cohort, Tag("cohort")]
    | Annotated[Counted, Tag("counted")]
    | Annotated[Tracked, Tag("tracked")]
    | Annotated[Auto, Tag("auto")],
    Discriminator(_tag),
]
