"""A number with its unit, bounds and meaning, declared once.

A field of a part is declared as ``radius: Annotated[float, Quantity("m", "radius of the sphere",
"R", above=0)]``. That one declaration feeds the reader (strings with units become SI), the checks,
the JSON schema, the netCDF attributes and ``sim check``. SI inside, always.
"""

import contextlib
import functools
import json
import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, dataclass_transform

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, dataclasses
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from sim.units.errors import naming

T = TypeVar("T")
_NUMBER = r"[+-]?(?:(?:[0-9]+(?:_[0-9]+)*\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?|inf(?:inity)?|nan)"
_REST = r"(?P<unit>[^\s0-9+,-](?:.*\S)?|1\s*/.*\S)?"
_TEXT = re.compile(rf"\s*(?P<number>{_NUMBER})\s*{_REST}\s*", re.IGNORECASE | re.DOTALL)

# Only products of names with small whole powers reach pint, so that no text makes it compute.
_NAME = r"[A-Za-zµμΩΩ°%ÅÅ]+(?:_[A-Za-z]+)*"
_POWER = re.compile(rf"({_NAME})\s*(?:\^|\*\*)?\s*(-?[0-9]+)")
_FACTOR = rf"{_NAME}(?:\s*(?:\^|\*\*)\s*-?[1-9][0-9]?|-?[1-9][0-9]?)?"
_UNIT = re.compile(rf"(?:1?\s*/\s*)?{_FACTOR}(?:\s*[*/]\s*{_FACTOR}|\s+{_FACTOR})*")
_LONGEST_TEXT, _LONGEST_UNIT = 200, 60
#: Words of a unit by which it counts angles.
_ANGLES = re.compile("rad|cycle|turn|rev|deg|°")
_TYPESET = str.maketrans("−·⋅×⁄⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-***/-0123456789")

# Beyond these nothing is measurable, and the sixth power of a larger stress leaves the range of floats.
_LARGEST, SMALLEST = 1e40, 1e-40

#: Each bound of a quantity: its name in a JSON schema, and how a number within it compares.
_BOUNDS = {
    "above": ("exclusiveMinimum", operator.gt),
    "at_least": ("minimum", operator.ge),
    "below": ("exclusiveMaximum", operator.lt),
    "at_most": ("maximum", operator.le),
}
_TYPICAL = {
    "m": "2 mm",
    "Pa": "1.6 MPa",
    "N": "4 mN",
    "s": "10 ms",
    "m/s": "1 mm/s",
    "J/m^2": "42 mJ/m^2",
    "1/s": "500 1/s",
    "m^2/s": "1 um^2/s",
    "rad": "30 deg",
}


@functools.cache
def _units() -> Any:
    import pint  # heavy: only when the first string with a unit is read

    try:
        return pint.UnitRegistry(cache_folder=":auto:")
    except Exception:  # an unwritable or broken cache must not stop a run
        return pint.UnitRegistry()


@functools.cache
def _common_scales() -> dict[str, float | None]:
    """Return the factors between common units as pint has them, so that most runs need not load it."""
    return json.loads(
        Path(__file__).with_name("scales.json").read_text(encoding="utf-8")
    )


@functools.lru_cache(maxsize=1024)
def _scale(unit: str, target: str) -> float | None:
    """Return the factor from a unit to another; None for another dimension, ValueError for an unknown unit."""
    unit = unit.translate(_TYPESET)
    if len(unit) > _LONGEST_UNIT or not _UNIT.fullmatch(unit):
        raise ValueError(unit)
    written = re.sub(r"^/", "1/", _POWER.sub(r"\1^\2", unit))
    common, units = _common_scales(), f"{written} in {target}"
    return common[units] if units in common else _scale_of_pint(written, target)


def _scale_of_pint(unit: str, target: str) -> float | None:
    registry = _units()
    try:
        source = registry.Quantity(1.0, registry.parse_units(unit))
        wanted = (
            registry.parse_units(target) if target != "1" else registry.dimensionless
        )
        if not source.is_compatible_with(wanted):
            return None
        scale = float(source.to(wanted).magnitude)
    except Exception as fault:
        # pint raises its own, tokenizer's and arithmetic errors here
        raise ValueError(unit) from fault
    if not (0.0 < scale < math.inf and source._is_multiplicative):
        raise ValueError(unit)
    return scale


def _times(number: float, scale: float) -> float:
    """Return ``number * scale``, correctly rounded if the scale is a power of ten, so "100 um" is 1e-4."""
    power = round(math.log10(scale))
    if abs(power) > 22 or abs(scale / 10.0**power - 1.0) > 1e-12:
        return number * scale
    return number * 10.0**power if power >= 0 else number / 10.0**-power


def _split(text: str) -> tuple[float, str] | None:
    """Return the number and the unit of a text; None if it cannot be read."""
    match = (
        _TEXT.fullmatch(text.translate(_TYPESET)) if len(text) < _LONGEST_TEXT else None
    )
    return (float(match["number"]), match["unit"] or "") if match else None


def same_unit(first: Any, last: Any) -> tuple[float, float, str | None] | None:
    """Return two numbers in the unit of the first, and that unit: None of bare numbers, "" of texts without one.

    The result is None if they are no finite numbers of one dimension.

    >>> same_unit("10 um/s", "3 mm/s")
    (10.0, 3000.0, 'um/s')
    """
    ends: Any = [
        _split(end) if isinstance(end, str) else (end, None) for end in (first, last)
    ]
    # of what is no number, and of an unknown unit
    with contextlib.suppress(TypeError, ValueError):
        (low, unit), (high, other) = ends
        scale = 1.0 if unit == other else _scale(other, unit)
        if scale and math.isfinite(low) and math.isfinite(high):
            return float(low), float(_times(high, scale)), unit
    return None


def _fault(message: str) -> PydanticCustomError:
    return PydanticCustomError("quantity", "{text}", {"text": message})


def _digits(number: float) -> str:
    """Return a number for a message; whole numbers have all digits."""
    if isinstance(number, int):
        return str(number) if abs(number) < 10**40 else "a number of many digits"
    return f"{number:g}"


@dataclass(frozen=True)
class Quantity:
    """Declaration of a number: its SI ``unit``, ``meaning``, ``symbol`` and bounds.

    ``above`` and ``below`` exclude the bound, ``at_least`` and ``at_most`` include it. Beside its own bounds no number
    may exceed 1e40, nor be nearer to zero than 1e-40 unless it is zero, because powers and ratios of such numbers
    leave the range of floats. Messages show ``typical`` as an example, without it a usual value of the unit. A
    ``whole`` number is read as an int.
    ``mistaken`` are units of what is taken for this quantity, each with what to say of it. A unit of angle per length
    must name the angle: 1/m may count radians or cycles.

    Examples
    --------
    >>> work = Quantity("J/m^2", "work of adhesion", "w", at_least=0)
    >>> work.read("42 mJ/m^2"), work.read("0.042 N/m"), work.read(0.042)
    (0.042, 0.042, 0.042)
    """

    unit: str
    meaning: str
    symbol: str = ""
    above: float = -math.inf
    at_least: float = -math.inf
    below: float = math.inf
    at_most: float = math.inf
    typical: str = ""
    whole: bool = False
    mistaken: tuple[tuple[str, str], ...] = ()

    def read(self, value: Any) -> float:
        """Return the value in SI of a number or a string such as ``"42 mJ/m^2"``.

        Raises
        ------
        PydanticCustomError
            (a ValueError) if it is not a number, is text without a unit, has the wrong dimension, is not
            finite or lies outside the bounds; the message names the cure.
        """
        number = (
            self._parse(value)
            if isinstance(value, str) and not self.whole
            else self._number(value)
        )
        if not self.whole and not math.isfinite(number):
            raise _fault(f"must be finite; write for example {self.example}")
        for name, (_, holds) in _BOUNDS.items():
            bound = getattr(self, name)
            if not holds(number, bound):
                unit = "" if self.unit == "1" else f" {self.unit}"
                raise _fault(
                    f"must be {name.replace('_', ' ')} {_digits(bound)}{unit}, not {_digits(number)}{unit}"
                )
        if abs(number) > _LARGEST:
            raise _fault(f"is too large to be real; write for example {self.example}")
        if 0.0 < abs(number) < SMALLEST:
            zero = "0, or " if self._holds(0.0) else ""
            raise _fault(
                f"is too small to be real; write {zero}for example {self.example}"
            )
        return number

    def scaled(self, numbers: Any, unit: str) -> Any:
        """Return numbers, or an array of them, in SI; without a unit they are in SI. Bounds are not checked."""
        if not unit:
            return numbers
        shown, cure = unit[:40], f"write for example {self.example}"
        try:
            scale = _scale(unit, self.unit)
        except ValueError:
            raise _fault(f'has the unknown unit "{shown}"; {cure}') from None
        if scale is None:
            wanted = "a pure number" if self.unit == "1" else self.unit
            reasons = [
                f": {reason}"
                for other, reason in self.mistaken
                if _scale(unit, other) is not None
            ]
            reasons.append(f", which is not a unit of {wanted}; {cure}")
            raise _fault(f'has the unit "{shown}"{reasons[0]}')
        if self.unit.startswith("rad/") and not _ANGLES.search(unit):
            length = next(iter(re.findall(r"[A-Za-zµμ]+", unit)), "m")
            raise _fault(
                f'has the unit "{shown}", which may count radians or cycles: write "rad/{length}" for 2 pi over the'
                f' wavelength, "cycles/{length}" for 1 over it'
            )
        return _times(numbers, scale)

    def _number(self, value: Any) -> float:
        """Return a number that is none of text."""
        is_whole = hasattr(value, "__index__") or (
            isinstance(value, float) and value.is_integer()
        )
        is_scalar = not isinstance(value, bool) and getattr(value, "shape", ()) == ()
        is_number = is_whole if self.whole else hasattr(value, "__float__")
        if not (is_scalar and is_number):
            kind = "number" if self.unit == "1" else "number or text with a unit"
            kind = "whole number" if self.whole else kind
            raise _fault(f"must be a {kind} such as {self.example}")
        try:
            return int(value) if self.whole else float(value)
        except (OverflowError, TypeError, ValueError):
            raise _fault(f"is too large; write for example {self.example}") from None

    def _parse(self, text: str) -> float:
        """Return the number of a text in SI."""
        parts = _split(text)
        if parts is None:
            raise _fault(
                f"cannot be read; write a number with a decimal point and its unit, such as {self.example}"
            )
        number, unit = parts
        if not unit and self.unit != "1" and math.isfinite(number):
            raise _fault(
                f"is text without a unit; write for example {self.example}, or a bare number in {self.unit}"
            )
        return self.scaled(number, unit)

    @property
    def example(self) -> str:
        """Return an admissible value as it is written in a scenario file."""
        if self.typical:
            return f'"{self.typical}"'
        if self.whole:
            return "64"
        if self.unit in _TYPICAL and self._holds(1e-6) and self._holds(1e6):
            return f'"{_TYPICAL[self.unit]}"'
        numbers = (1.0, 0.5, 2.0 * self.above, self.at_least, self.at_most, 0.0)
        inside = next((number for number in numbers if self._holds(number)), 1.0)
        return f"{inside:g}" if self.unit == "1" else f'"{inside:g} {self.unit}"'

    def _holds(self, number: float) -> bool:
        return all(
            holds(number, getattr(self, name)) for name, (_, holds) in _BOUNDS.items()
        )

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(
            int if self.whole else float
        )
        return core_schema.no_info_plain_validator_function(
            self.read, serialization=written
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict:
        if self.whole:
            described: dict[str, Any] = {
                "type": "integer",
                "description": self.meaning,
                "examples": [64],
            }
        else:
            example = self.example.strip('"')
            described = {
                "type": ["number", "string"],
                "description": f"{self.meaning} [{self.unit}]",
                "examples": [float(example) if self.unit == "1" else example],
            }
        for name, (word, _) in _BOUNDS.items():
            if math.isfinite(bound := getattr(self, name)):
                described[word] = bound
        return described


@dataclass_transform(frozen_default=True, field_specifiers=(Field,))
def keyed(kw_only: bool = False) -> Callable[[type[T]], type[T]]:
    """Return the decorator of a class whose fields are the keys of a table of a scenario."""
    config = {"extra": "forbid", "populate_by_name": True, "defer_build": True}
    return dataclasses.dataclass(frozen=True, kw_only=kw_only, config=config)  # type: ignore


def tagged(shared: str, *names: str) -> Callable[[object], str | None]:
    """Return a function for the tag of a table or a part, where two classes share a model's name.

    The tag is ``shared[name]``, by the first of the ``names``, for the class that has a key of these names.
    """

    def tag(value: object) -> str | None:
        keys = (
            value
            if isinstance(value, dict)
            else {name: getattr(value, name, None) for name in ("model", *names)}
        )
        model = keys.get("model")
        if model == shared and any(keys.get(name) is not None for name in names):
            return f"{shared}[{names[0]}]"
        return model if isinstance(model, str) else None

    return tag


def read_option(
    value: float | str | None, name: str, unit: str, **bounds: Any
) -> float:
    """Return the value of an option in SI from a number, or text with or without a unit; infinity for None.

    Raises
    ------
    BadInput
        With the ``name`` of the option.
    """
    if value is None:
        return math.inf
    number: float | str = value
    with contextlib.suppress(ValueError):
        number = float(value)
    with naming(f"{name} {value}"):
        return Quantity(unit, name, **bounds).read(number)
