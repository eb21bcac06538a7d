"""Temperatures with their unit, kelvin inside and degrees Celsius in a text, and a modulus over the temperature."""

from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity, keyed
from sim.units.tables import LISTED, FromFile, file_columns

_ZERO_CELSIUS = 273.15
_CELSIUS = ("°C", "℃", "degC", "celsius")


class AbsoluteTemperature(Quantity):
    """Declaration of an absolute temperature [K], which a text may also give in degrees Celsius.

    A difference of temperatures is a plain ``Quantity`` in K, because a degree Celsius has no zero there.

    Examples
    --------
    >>> temperature = AbsoluteTemperature("K", "temperature", "T", above=0)
    >>> temperature.read("20 °C"), temperature.read("293.15 K"), temperature.read(293.15)
    (293.15, 293.15, 293.15)
    """

    def scaled(self, numbers: Any, unit: str) -> Any:
        if unit.strip() in _CELSIUS:
            return numbers + _ZERO_CELSIUS
        return super().scaled(numbers, unit)


_COULOMB = ("C", "is a coulomb; write °C for degrees Celsius, or K")
_MODULUS = Quantity("Pa", "modulus at these temperatures", above=0)


def absolute(meaning: str, symbol: str) -> AbsoluteTemperature:
    """Return the declaration of a temperature of a scenario."""
    return AbsoluteTemperature(
        "K", meaning, symbol, above=0, typical="20 °C", mistaken=(_COULOMB,)
    )


_ROW = absolute("temperatures of the rows", "T")


@keyed(kw_only=True)
class ModulusTable(FromFile):
    """The modulus over the temperature, linear between the rows; ``file`` names a CSV."""

    temperature: Annotated[tuple[Annotated[float, _ROW], ...], LISTED] = ()
    value: Annotated[tuple[Annotated[float, _MODULUS], ...], LISTED] = ()
    file: Annotated[
        str,
        Field(
            description="CSV file with the columns `temperature` and `modulus`, instead of lists"
        ),
    ] = ""

    def read_keys(self, context: Any) -> dict[str, np.ndarray]:
        if self.temperature or not self.file:
            return {}
        wanted = {"temperature": _ROW, "modulus": _MODULUS}
        read = file_columns(self.file, context, wanted)
        return {"temperature": read["temperature"], "value": read["modulus"]}

    @model_validator(mode="after")
    def _rows_in_order(self) -> "ModulusTable":
        if len(self.temperature) != len(self.value) or len(self.value) < 2:
            message = 'needs two rows or more, each a temperature and a value; or a CSV file, file = "dma.csv"'
            raise PydanticCustomError("modulus_table", message)
        if np.any(np.diff(self.temperature) <= 0.0):
            raise PydanticCustomError(
                "modulus_table", "temperatures must rise from row to row; sort them"
            )
        return self

    def at(self, temperature: float) -> float:
        """Return the modulus at a temperature [K]."""
        return float(np.interp(temperature, self.temperature, self.value))
