"""The temperature of a scene: a scene at a temperature is a plain scene with other numbers.

All numbers of a scenario are those at a reference temperature. Rates follow from them by a law for each process, and
the Bell force and the modulus by factors. ``Temperature.changes`` returns the numbers at the temperature, so that
neither parts nor steppers know a temperature.
"""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import scipy
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity, keyed
from sim.units.temperature import ModulusTable, absolute

_OF_A_BOND = ("J", "is no energy per mole; 1 eV for each bond is 96.5 kJ/mol")
#: Largest change of a rate, as a logarithm: no number may exceed 1e40 either.
_LARGEST = 40.0 * math.log(10.0)


@keyed()
class Arrhenius:
    """A rate over one barrier: k = k_ref exp(E/R (1/T_ref − 1/T)) (Arrhenius 1889).

    Examples
    --------
    A barrier of 50 kJ/mol doubles a rate from 20 °C to about 30 °C:

    >>> print(f"{math.exp(Arrhenius('50 kJ/mol').growth(303.15, 293.15)):.3f}")
    1.967
    """

    energy: Annotated[
        float,
        Quantity(
            "J/mol",
            "activation energy",
            "E",
            at_least=0,
            at_most=1e6,
            typical="60 kJ/mol",
            mistaken=(_OF_A_BOND,),
        ),
    ]
    model: Literal["arrhenius"] = "arrhenius"

    def growth(self, temperature: float, reference: float) -> float:
        """Return the logarithm of the rate at a temperature over that at the reference, both in K [1]."""
        return self.energy / scipy.constants.R * (1.0 / reference - 1.0 / temperature)

    def fault(self, temperature: float, reference: float) -> str:
        return ""


@keyed()
class Wlf:
    """A rate of polymer segments: log10 k/k_ref = c1 (T − T_ref)/(c2 + T − T_ref) (Williams, Landel & Ferry 1955).

    Examples
    --------
    The universal constants hold if the reference is the glass transition:

    >>> print(f"{Wlf(17.44, '51.6 K').growth(260.0, 210.0) / math.log(10.0):.3f}")
    8.583
    """

    c1: Annotated[
        float, Quantity("1", "first constant of WLF at the reference", "c_1", above=0)
    ]
    c2: Annotated[
        float,
        Quantity(
            "K",
            "second constant of WLF at the reference, a difference",
            "c_2",
            above=0,
            typical="51.6 K",
        ),
    ]
    model: Literal["wlf"] = "wlf"

    def growth(self, temperature: float, reference: float) -> float:
        """Return the logarithm of the rate at a temperature over that at the reference, both in K [1]."""
        above = temperature - reference
        left = self.c2 + above
        if left <= 0.0:
            return -math.inf
        return math.log(10.0) * self.c1 * above / left

    def fault(self, temperature: float, reference: float) -> str:
        """Return a fault if nothing moves at the temperature."""
        least = reference - self.c2
        if temperature > least:
            return ""
        return f"WLF holds above reference − c2 = {least:g} K; raise value, or give another law"


RateLaw = Arrhenius | Wlf
_Process = Annotated[RateLaw, Field(discriminator="model")]


@keyed(kw_only=True)
class Temperature:
    """Temperature of the scene, beside the one at which all numbers of the scenario hold.

    Parameters
    ----------
    value, reference : float or str
        T and T_ref [K].
    rupture, rebinding, edge : RateLaw, optional
        Laws of the rupture rate, the rebinding rate and the speed of an edge that lags.
    bell_force : str
        ``"thermal"``: f_b = kT/x_b at a fixed distance x_b to the barrier. ``"constant"``: f_b does not change.
    modulus : ModulusTable, optional
        The modulus over the temperature, relative to its value at the reference.

    Notes
    -----
    A critical speed V_c = ℓ k_on of bonds without a stretch goes with the rebinding rate, because ℓ is a length.

    Examples
    --------
    >>> warm = Temperature(value="40 °C", reference="20 °C", rebinding=Arrhenius("50 kJ/mol"))
    >>> print(f"{warm.changes({'bonds.rebinding_rate': 100.0})['bonds.rebinding_rate']:.2f}")
    370.68
    """

    value: Annotated[float, absolute("temperature", "T")]
    reference: Annotated[
        float, absolute("temperature at which the scenario's numbers hold", "T_ref")
    ]
    rupture: _Process | None = None
    rebinding: _Process | None = None
    edge: _Process | None = None
    bell_force: Annotated[
        Literal["thermal", "constant"],
        Field(
            description='"thermal": kT over a fixed distance to the barrier; "constant": that of the reference'
        ),
    ] = "thermal"
    modulus: ModulusTable | None = None

    #: Laws by their keys, and the numbers of a scenario that follow each.
    FOLLOWING: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "rupture": ("bonds.rupture.rate", "bonds.rupture.zero_force_rate"),
        "rebinding": ("bonds.rebinding_rate", "bonds.critical_speed"),
        "edge": ("contact.front_speed", "contact.heal_speed"),
    }
    _FORCE: ClassVar[str] = "bonds.rupture.bell_force"
    _MODULI: ClassVar[tuple[str, ...]] = ("solid.shear_modulus", "solid.youngs_modulus")

    @model_validator(mode="after")
    def _within_laws(self) -> "Temperature":
        for name, law in self.laws.items():
            if fault := law.fault(self.value, self.reference):
                raise PydanticCustomError("temperature", f"{name}: {fault}")
            if abs(law.growth(self.value, self.reference)) > _LARGEST:
                fault = "changes its rate by more than 1e40; check its constants and the temperatures"
                raise PydanticCustomError("temperature", f"{name}: {fault}")
        rows = self.modulus.temperature if self.modulus else (0.0, math.inf)
        for name in ("value", "reference"):
            if not rows[0] <= getattr(self, name) <= rows[-1]:
                fault = f"modulus: is given from {rows[0]:g} to {rows[-1]:g} K, but {name} is {getattr(self, name):g} K"
                raise PydanticCustomError("temperature", f"{fault}; add rows")
        return self

    @property
    def laws(self) -> dict[str, RateLaw]:
        """Return the laws that are given, by key."""
        laws = {name: getattr(self, name) for name in self.FOLLOWING}
        return {name: law for name, law in laws.items() if law is not None}

    def changes(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """Return those of some numbers of a scenario, by key, that change with the temperature, as they are at it."""
        factors = {
            key: math.exp(min(max(growth, -_LARGEST), _LARGEST))
            for name, law in self.laws.items()
            for growth in (law.growth(self.value, self.reference),)
            for key in self.FOLLOWING[name]
        }
        if self.bell_force == "thermal":
            factors[self._FORCE] = self.value / self.reference
        if self.modulus is not None:
            ratio = self.modulus.at(self.value) / self.modulus.at(self.reference)
            factors |= dict.fromkeys(self._MODULI, ratio)
        return {
            key: value * factors[key]
            for key, value in numbers.items()
            if key in factors
        }

    def faults(self, numbers: Mapping[str, float]) -> dict[str, str]:
        """Return what is missing, idle or has no law for the numbers of a scenario, by the place of the fault."""
        faults = {}
        for name, keys in self.FOLLOWING.items():
            present = [key for key in keys if key in numbers]
            is_given = name in self.laws
            if is_given and not present:
                faults[f"temperature.{name}"] = (
                    f"has no effect, because the scenario has none of {', '.join(keys)}; omit it"
                )
            elif not is_given and any(numbers[key] for key in present):
                faults[f"temperature.{name}"] = (
                    f"is missing, so {present[0]} has no law over the temperature; give one, such as"
                    ' { model = "arrhenius", energy = "60 kJ/mol" }, or an energy of 0'
                )
        for key, reason in _UNKNOWN.items():
            if numbers.get(key):
                faults[key] = f"has no law over the temperature: {reason}"
        if self.modulus is not None and any(
            key.startswith("solid.counter_body.") for key in numbers
        ):
            faults["temperature.modulus"] = (
                "is that of one body: omit it, or solid.counter_body"
            )
        if not faults and not self.changes(numbers):
            faults["temperature"] = (
                "changes nothing, because no number of the scenario depends on it; omit the table"
            )
        return faults

    def unshifted(self, numbers: Mapping[str, float]) -> list[str]:
        """Return the reasons for which curves over the speed at two temperatures are no shifted copies.

        If all rates change by one factor a and nothing else changes, steady sliding at a speed V is that of the
        reference at V/a.
        """
        reasons = list[str]()
        rupture = {key for key in numbers if key.startswith("bonds.rupture.")}
        if rupture == {"bonds.rupture.rate"}:
            # of bonds whose rupture does not depend on their force: friction is proportional to the speed
            return reasons
        acting = {
            name: law
            for name, law in self.laws.items()
            if name != "edge" and any(numbers.get(key) for key in self.FOLLOWING[name])
        }
        if len(set(acting.values())) > 1:
            reasons.append("rupture and rebinding have different laws")
        if self.bell_force == "thermal" and self._FORCE in numbers:
            reasons.append("the Bell force is proportional to the temperature")
        if self.modulus is not None and len(set(self.modulus.value)) > 1:
            reasons.append("the modulus changes")
        return reasons

    def remarks(self, numbers: Mapping[str, float]) -> list[str]:
        """Return a remark if friction over speed at other temperatures has no master curve."""
        reasons = self.unshifted(numbers)
        no_curve = "no shift of the speed makes one master curve of the friction at several temperatures"
        return [f"{no_curve}: {', '.join(reasons)}"] if reasons else []


#: Numbers of a scenario without a law over the temperature, with the cure.
_UNKNOWN = {
    "bonds.rupture.catch_rate": "a catch bond has two barriers; omit temperature, or take Bell's rupture",
    "drive.viscosity": "omit temperature, or the viscosity of the interface",
    "shear.amplitude.speed": "omit temperature, or take another amplitude, such as one that follows the stress",
    "shear.correlation.time": "omit temperature, or let the fluctuations renew by sliding",
    "shear.correlation.diffusivity": "omit temperature, or let the fluctuations renew by sliding",
}
