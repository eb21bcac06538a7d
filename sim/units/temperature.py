"""A temperature with its unit: kelvin inside, degrees Celsius in a text."""

from typing import Any

from sim.units.quantity import Quantity

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
