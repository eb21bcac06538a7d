"""A number with its unit, bounds and meaning, declared once.

A field of a part is declared as ``radius: Annotated[float, Quantity("m", "radius of the sphere",
"R", above=0)]``. That one declaration feeds the reader (strings with units become SI), the checks,
the JSON schema, the netCDF attributes and ``sim check``. SI inside, always.
"""

import functools
import math
import re
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

_TEXT = re.compile(
    r"\s*(?P<number>[+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?|[+-]?(?:inf|nan))"
    r"(?:\s*(?P<unit>(?:1/)?[A-Za-zµμΩ°%][A-Za-z0-9µμΩ°%^*/. \-]{0,60}))?\s*"
)
_HUGE_POWER = re.compile(r"(?:\^|\*\*)\s*-?\s*\d{3}|\d{4}")


@functools.cache
def _units() -> Any:
    import pint  # heavy: only when the first string with a unit is read

    try:
        return pint.UnitRegistry(cache_folder=":auto:")
    except Exception:  # an unwritable or broken cache must not stop a run
        return pint.UnitRegistry()


@functools.lru_cache(maxsize=1024)
def _scale(unit: str, target: str) -> float | None:
    """Factor from ``unit`` to ``target``; None where the dimensions differ, ValueError if unknown."""
    try:
        given = _units().Quantity(1.0, _units().parse_units(unit))
    except Exception as fault:  # pint raises its own, tokenizer's and arithmetic errors here
        raise ValueError(unit) from fault
    wanted = _units().parse_units(target) if target != "1" else _units().dimensionless
    if not given.is_compatible_with(wanted):
        return None
    return float(given.to(wanted).magnitude)


@dataclass(frozen=True)
class Quantity:
    """Declaration of a number: its SI ``unit``, ``meaning``, ``symbol`` and bounds.

    ``above`` and ``below`` exclude the bound, ``at_least`` and ``at_most`` include it.
    """

    unit: str
    meaning: str
    symbol: str = ""
    above: float = -math.inf
    at_least: float = -math.inf
    below: float = math.inf
    at_most: float = math.inf

    def read(self, value: Any) -> float:
        """The value in SI from a number or a string such as ``"42 mJ/m^2"``.

        Raises
        ------
        PydanticCustomError
            (a ValueError) if it is not a number, has the wrong dimension, is not finite or lies
            outside the bounds; the message names the cure.
        """
        number = self._parse(value) if isinstance(value, str) else self._number(value)
        if not math.isfinite(number):
            raise PydanticCustomError("not_finite", "must be finite; give a number{unit}", self._about())
        self._check(number)
        return number

    def _number(self, value: Any) -> float:
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            raise PydanticCustomError(
                "not_a_quantity",
                'must be a number{unit}, or a string with a unit such as "{example}"',
                self._about(),
            )
        try:
            return float(value)
        except (OverflowError, TypeError, ValueError):
            raise PydanticCustomError("too_large", "is too large for a number", {}) from None

    def _parse(self, text: str) -> float:
        match = _TEXT.fullmatch(text) if len(text) < 200 else None
        if match is None or _HUGE_POWER.search(match["unit"] or ""):
            raise PydanticCustomError(
                "not_a_quantity",
                'cannot be read: {text}; write a number and a unit, such as "{example}"',
                {"text": repr(text[:40]), **self._about()},
            )
        number, unit = float(match["number"]), (match["unit"] or "").strip()
        if not unit:
            return number
        try:
            scale = _scale(unit, self.unit)
        except ValueError:
            raise PydanticCustomError(
                "unknown_unit",
                'has the unknown unit "{given}"; write for example "{example}"',
                {"given": unit, **self._about()},
            ) from None
        if scale is None:
            raise PydanticCustomError(
                "wrong_dimension",
                'has the unit "{given}", which is not a unit of {wanted}; write for example "{example}"',
                {"given": unit, "wanted": self.wanted, **self._about()},
            )
        return number * scale

    def _check(self, number: float) -> None:
        for wrong, text, bound in (
            (not number > self.above, "above", self.above),
            (not number >= self.at_least, "at least", self.at_least),
            (not number < self.below, "below", self.below),
            (not number <= self.at_most, "at most", self.at_most),
        ):
            if wrong:
                raise PydanticCustomError(
                    "out_of_bounds",
                    "must be {text} {bound}{unit}, not {number}",
                    {"text": text, "bound": f"{bound:g}", "number": f"{number:g}", **self._about()},
                )

    @property
    def wanted(self) -> str:
        """The unit in words, for messages."""
        return "a pure number" if self.unit == "1" else self.unit

    def _about(self) -> dict[str, Any]:
        unit = "" if self.unit == "1" else f" {self.unit}"
        inside = next((b for b in (1.0, 0.5, 2.0 * self.above, 0.0) if self._holds(b)), 1.0)
        return {"unit": unit, "example": f"{inside:g}{unit}"}

    def _holds(self, number: float) -> bool:
        return self.above < number < self.below and self.at_least <= number <= self.at_most

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read, serialization=core_schema.plain_serializer_function_ser_schema(float)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict:
        return {"type": ["number", "string"], "description": f"{self.meaning} [{self.unit}]"}
