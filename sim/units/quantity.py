"""A number with its unit, bounds and meaning, declared once.

A field of a part is declared as ``radius: Annotated[float, Quantity("m", "radius of the sphere",
"R", above=0)]``. That one declaration feeds the reader (strings with units become SI), the checks,
the JSON schema, the netCDF attributes and ``sim check``. SI inside, always.
"""

import contextlib
import difflib
import functools
import json
import math
import operator
import re
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from sim.units import kept
from sim.units.refusals import BadInput

_NUMBER = r"[+-]?(?:(?:[0-9]+(?:_[0-9]+)*\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?|inf(?:inity)?|nan)"
_REST = r"(?P<unit>[^\s0-9+,-](?:.*\S)?|1\s*/.*\S)?"
_TEXT = re.compile(rf"\s*(?P<number>{_NUMBER})\s*{_REST}\s*", re.IGNORECASE | re.DOTALL)
_COMMA = re.compile(r"\s*[+-]?[0-9]+,[0-9]+(?![0-9,])")

# Only products of names with small whole powers reach pint, so that no text makes it compute.
_NAME = r"[A-Za-zµμΩΩ°%ÅÅ]+(?:_[A-Za-z]+)*"
_POWER = re.compile(rf"({_NAME})\s*(?:\^|\*\*)?\s*(-?[0-9]+)")
_FACTOR = rf"{_NAME}(?:\s*(?:\^|\*\*)\s*-?[1-9][0-9]?|-?[1-9][0-9]?)?"
_UNIT = re.compile(rf"(?:1?\s*/\s*)?{_FACTOR}(?:\s*[*/]\s*{_FACTOR}|\s+{_FACTOR})*")
_LONGEST_TEXT, _LONGEST_UNIT = 200, 60
_MOST_SCALES = 512
#: Words of a unit by which it counts angles.
_ANGLES = re.compile("rad|cycle|turn|rev|deg|°")
_TYPESET = str.maketrans("−·⋅×⁄⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-***/-0123456789")

# Beyond these nothing is measurable, and products of a few such numbers leave the range of floats.
_LARGEST, _SMALLEST = 1e60, 1e-60

#: Each bound of a quantity: its name in a JSON schema, and how a number within it compares.
_BOUNDS = {
    "above": ("exclusiveMinimum", operator.gt),
    "at_least": ("minimum", operator.ge),
    "below": ("exclusiveMaximum", operator.lt),
    "at_most": ("maximum", operator.le),
}
_TYPICAL = {
    "m": "2 mm", "Pa": "1.6 MPa", "N": "4 mN", "s": "10 ms", "m/s": "1 mm/s", "J/m^2": "42 mJ/m^2", "1/s": "500 1/s",
    "m^2/s": "1 um^2/s", "rad": "30 deg",
}  # fmt: skip


@functools.cache
def _units() -> Any:
    import pint  # heavy: only when the first string with a unit is read

    try:
        return pint.UnitRegistry(cache_folder=":auto:")
    except Exception:  # an unwritable or broken cache must not stop a run
        return pint.UnitRegistry()


@functools.lru_cache(maxsize=1024)
def _written(unit: str) -> str:
    """A unit's text as pint reads it; ValueError for what is no product of names with small powers."""
    if len(unit) > _LONGEST_UNIT or not _UNIT.fullmatch(unit):
        raise ValueError(unit)
    return re.sub(r"^/", "1/", _POWER.sub(r"\1^\2", unit))


@functools.lru_cache(maxsize=1)
def _known_scales() -> tuple[Path, dict[str, float]]:
    """Factors between units that pint has found before, by both texts, and their file.

    Those of common units come with the package, so that a first run need not wait for pint.
    """
    path, common = kept.folder() / f"units-{version('pint')}", Path(__file__).with_name("scales.json")
    return path, json.loads(common.read_text(encoding="utf-8")) | json.loads(kept.read(path) or b"{}")


@functools.lru_cache(maxsize=1024)
def _scale(unit: str, target: str) -> float | None:
    """Factor from ``unit`` to ``target``; None where the dimensions differ, ValueError if unknown."""
    (path, known), both = _known_scales(), f"{unit} in {target}"
    if both in known:
        return known[both]
    scale = _found_scale(unit, target)
    if scale is not None and len(known) < _MOST_SCALES:
        known[both] = scale
        kept.store(path, json.dumps(known).encode())
    return scale


def _found_scale(unit: str, target: str) -> float | None:
    registry = _units()
    try:
        given = registry.Quantity(1.0, registry.parse_units(unit))
        wanted = registry.parse_units(target) if target != "1" else registry.dimensionless
        if not given.is_compatible_with(wanted):
            return None
        scale = float(given.to(wanted).magnitude)
    except Exception as fault:  # pint raises its own, tokenizer's and arithmetic errors here
        raise ValueError(unit) from fault
    if not (0.0 < scale < math.inf and given._is_multiplicative):
        raise ValueError(unit)
    return scale


def _times(number: float, scale: float) -> float:
    """``number * scale``, correctly rounded where the scale is a power of ten, so "100 um" is 1e-4."""
    power = round(math.log10(scale))
    if abs(power) > 22 or abs(scale / 10.0**power - 1.0) > 1e-12:
        return number * scale
    return number * 10.0**power if power >= 0 else number / 10.0**-power


def in_words(value: Any) -> str:
    """What a value of a scenario file is, for messages."""
    if isinstance(value, bool):
        return str(value).lower()
    kinds = {dict: "a table", list: "a list", tuple: "a list", str: "text", int: "a whole number", float: "a number"}
    dates = ("date", "time", "datetime")
    return kinds.get(type(value)) or ("a date" if type(value).__name__ in dates else "something else")


def _read_text(text: str) -> re.Match[str] | None:
    return _TEXT.fullmatch(text.translate(_TYPESET)) if len(text) < _LONGEST_TEXT else None


def number_and_unit(value: Any) -> tuple[float, str] | None:
    """A finite number and the text of its unit as they stand in a scenario file; None if it is neither.

    >>> number_and_unit("-2.5 mN"), number_and_unit(3), number_and_unit("much")
    ((-2.5, 'mN'), (3.0, ''), None)
    """
    match = _read_text(value) if isinstance(value, str) else None
    if match is None and (isinstance(value, bool | str) or not isinstance(value, int | float)):
        return None
    number = float(match["number"]) if match else _finite(value)
    return (number, (match and match["unit"]) or "") if math.isfinite(number) else None


def _digits(number: float) -> str:
    """A number for a message."""
    if isinstance(number, int) and abs(number) < 10**40:
        return str(number)
    return f"{_finite(number):g}"


def _finite(value: Any) -> float:
    """A number as a float, nan where it is too large for one."""
    try:
        return float(value)
    except OverflowError:
        return math.nan


def same_unit(first: Any, last: Any) -> tuple[float, float, str | None] | None:
    """Two numbers in the unit of the first, and that unit's text: None of bare numbers, "" of texts without one.

    None if they are not of one dimension.

    >>> same_unit("10 um/s", "3 mm/s")
    (10.0, 3000.0, 'um/s')
    """
    start, stop = number_and_unit(first), number_and_unit(last)
    if start is None or stop is None or isinstance(first, str) != isinstance(last, str):
        return None
    (low, unit), (high, other) = start, stop
    if unit != other:
        try:
            scale = _scale(_written(other), _written(unit)) if unit and other else None
        except ValueError:
            scale = None
        if scale is None:
            return None
        high = _times(high, scale)
    return low, high, unit if isinstance(first, str) else None


@dataclass(frozen=True)
class Quantity:
    """Declaration of a number: its SI ``unit``, ``meaning``, ``symbol`` and bounds.

    ``above`` and ``below`` exclude the bound, ``at_least`` and ``at_most`` include it. Beside its
    own bounds no number may exceed 1e60, nor one that excludes zero fall below 1e-60. Messages show
    ``typical`` as an example, without it a usual value of the unit. A ``whole`` number is read as an int.
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
        """The value in SI from a number or a string such as ``"42 mJ/m^2"``.

        Raises
        ------
        PydanticCustomError
            (a ValueError) if it is not a number, is text without a unit, has the wrong dimension, is not
            finite or lies outside the bounds; the message names the cure.
        """
        if self.whole:
            return self._integer(value)
        number = self._parse(value) if isinstance(value, str) else self._number(value)
        if not math.isfinite(number):
            raise self._fault("not_finite", "must be finite; write for example {example}")
        self._check(number)
        return number

    def scaled(self, numbers: Any, unit: str) -> Any:
        """Numbers, or an array of them, in SI from a unit; without one they are in SI already. Nothing is checked."""
        return _times(numbers, self._factor(unit)) if unit else numbers

    def _fault(self, kind: str, said: str, **words: str) -> PydanticCustomError:
        """A fault in these words, with those about the quantity itself filled in."""
        pure = self.unit == "1"
        own = {"unit": "" if pure else f" {self.unit}", "wanted": "a pure number" if pure else self.unit}
        own |= {"kind": "a number" if pure else "a number or text with a unit", "example": self.example}
        return PydanticCustomError(kind, said, own | words)

    def _integer(self, value: Any) -> int:
        whole = hasattr(value, "__index__") or (isinstance(value, float) and value.is_integer())
        if isinstance(value, bool) or not whole:
            given = f'"{value[:40]}"' if isinstance(value, str) else in_words(value)
            given = f"{value:g}" if isinstance(value, float) else given
            raise self._fault("not_a_quantity", "must be a whole number such as {example}, not {given}", given=given)
        self._check(int(value))
        return int(value)

    def _number(self, value: Any) -> float:
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            said = "must be {kind} such as {example}, not {given}"
            raise self._fault("not_a_quantity", said, given=in_words(value))
        try:
            return float(value)
        except (OverflowError, TypeError, ValueError):
            raise self._fault("too_large", "is too large; write for example {example}") from None

    def _parse(self, text: str) -> float:
        match = _read_text(text)
        if match is None or (match["unit"] and _COMMA.match(text)):
            cure = "write decimals with a point" if _COMMA.match(text) else "write a number"
            cure += "" if self.unit == "1" else " and a unit"
            said = 'cannot be read: "{text}"; {cure}, such as {example}'
            raise self._fault("not_a_quantity", said, text=text[:40], cure=cure)
        number = float(match["number"])
        if match["unit"] is not None:
            return _times(number, self._factor(match["unit"]))
        if self.unit != "1" and math.isfinite(number):
            said = "is text without a unit; write for example {example}, or a bare number in {wanted}"
            raise self._fault("no_unit", said)
        return number

    def _factor(self, given: str) -> float:
        """Factor from a unit's text to SI."""
        try:
            scale = _scale(_written(given), self.unit)
        except ValueError:
            near = self._near(given)
            cure = f'did you mean "{near}"?' if near else f"write for example {self.example}"
            said = 'has the unknown unit "{given}"; {cure}'
            raise self._fault("unknown_unit", said, given=given[:40], cure=cure) from None
        if scale is None:
            for unit, said in self.mistaken:
                if _scale(_written(given), unit) is not None:
                    raise self._fault("mistaken", f'has the unit "{{given}}": {said}', given=given[:40])
            said = 'has the unit "{given}", which is not a unit of {wanted}; write for example {example}'
            raise self._fault("wrong_dimension", said, given=given[:40])
        if self.unit.startswith("rad/") and not _ANGLES.search(given):
            named = re.search(r"1?/\s*(\w+)|([A-Za-zµμ]+)\s*(?:\^|\*\*)?\s*-1", given)
            length = next(filter(None, named.groups())) if named else self.unit.partition("/")[2]
            said = 'has the unit "{given}", which may count radians or cycles: write "rad/{length}" where it is 2π over'
            said += ' the wavelength, "cycles/{length}" where it is 1 over it'
            raise self._fault("no_angle", said, given=given[:40], length=length)
        return scale

    def _near(self, given: str) -> str | None:
        """The unit that was probably meant: the same letters in another case, the example's, else a similar one."""
        if self.unit == "1" or self.unit[0].isdigit():
            return None
        usual = self.example.strip('"').partition(" ")[2]
        known = [usual, *(prefix + self.unit for prefix in ("", "M", "m", "k", "G", "u", "n"))]
        same = [unit for unit in known if unit.casefold() == given.casefold()]
        return next(iter(same or difflib.get_close_matches(given, known, 1, 0.7)), None)

    def _check(self, number: float) -> None:
        for name, bound in self._bounds.items():
            if not _BOUNDS[name][1](number, bound):
                said = "must be {text} {bound}{unit}, not {number}{unit}"
                text = name.replace("_", " ")
                raise self._fault("out_of_bounds", said, text=text, bound=_digits(bound), number=_digits(number))
        if abs(number) > _LARGEST or (self.above >= 0.0 and number < _SMALLEST):
            said = "is too {size} to be real: {number}{unit}; write for example {example}"
            size = "large" if abs(number) > 1.0 else "small"
            raise self._fault("beyond_measure", said, size=size, number=f"{number:g}")

    @property
    def example(self) -> str:
        """An admissible value as it is written in a scenario file."""
        if self.typical:
            return f'"{self.typical}"'
        if self.whole:
            return "64"
        if self.unit in _TYPICAL and self._holds(1e-6) and self._holds(1e6):
            return f'"{_TYPICAL[self.unit]}"'
        usual = (0.5, 1.0) if math.isfinite(min(self.below, self.at_most)) else (1.0, 0.5)
        bounds = (2.0 * self.above, self.at_least, self.at_most, 0.0)
        inside = next((number for number in (*usual, *bounds) if self._holds(number)), 1.0)
        return f"{inside:g}" if self.unit == "1" else f'"{inside:g} {self.unit}"'

    @functools.cached_property
    def _bounds(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in _BOUNDS}

    def _holds(self, number: float) -> bool:
        return all(_BOUNDS[name][1](number, bound) for name, bound in self._bounds.items())

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(int if self.whole else float)
        return core_schema.no_info_plain_validator_function(self.read, serialization=written)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict:
        described: dict[str, Any] = {"type": ["number", "string"], "description": f"{self.meaning} [{self.unit}]"}
        if self.whole:
            described = {"type": "integer", "description": self.meaning}
        described |= {_BOUNDS[name][0]: bound for name, bound in self._bounds.items() if math.isfinite(bound)}
        example: Any = self.example.strip('"')
        return described | {"examples": [64 if self.whole else float(example) if self.unit == "1" else example]}


def read_option(value: float | str | None, name: str, unit: str, **bounds: Any) -> float:
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
    try:
        return Quantity(unit, name, **bounds).read(number)
    except ValueError as fault:
        raise BadInput([f"{name} {value}: {fault}"]) from None
