"""Sweeps: keys of a scenario and the values that they take, as an outer product of axes."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from sim.units.quantity import same_unit

_SHARED = (
    "clock",
    "clock.duration",
    "clock.record",
    "name",
    "ensemble",
    "instrument",
    "jump_in",
    "record",
    "zero",
)
_RANGE = ("from", "to", "count", "scale")
_MOST_POINTS = 20_000


@dataclass(frozen=True)
class Axis:
    """One dimension of a sweep: its ``keys`` take the rows of ``values`` together."""

    keys: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


def set_key(document: dict[str, Any], words: Sequence[str], value: Any) -> None:
    """Set a key in a nested document by the words of its path, copying or making the tables on its way."""
    *tables, last = words
    for name in tables:
        inner = document.get(name)
        document[name] = dict(inner) if isinstance(inner, dict) else {}
        document = document[name]
    document[last] = value


def read_sweep(sweep: Any) -> tuple[Axis, ...]:
    """Return the axes of a table of keys (outer product) or of a list of tables (zipped into one axis).

    Raises
    ------
    PydanticCustomError
        (a ValueError) with the first fault.

    Examples
    --------
    >>> loads, _ = read_sweep({"contact.load": ["1 mN", "4 mN"], "solid.poisson_ratio": [0.4, 0.5]})
    >>> loads.keys, loads.values
    (('contact.load',), (('1 mN',), ('4 mN',)))
    """
    if isinstance(sweep, tuple) and all(isinstance(axis, Axis) for axis in sweep):
        return sweep
    if isinstance(sweep, list):
        axes = [_zipped(sweep)]
    elif isinstance(sweep, dict):
        axes = list(_columns(sweep))
    else:
        raise _fault(
            'must be a table of lists, such as "contact.load" = ["1 mN", "4 mN"]'
        )
    keys = [key for axis in axes for key in axis.keys]
    for key in keys:
        _require_sweepable(key, keys)
    for axis in axes:
        if len({str(row) for row in axis.values}) < len(axis.values):
            raise _fault(f"{', '.join(axis.keys)}: has a value twice; remove one")
    if math.prod(len(axis.values) for axis in axes) > _MOST_POINTS:
        raise _fault(
            f"has more than {_MOST_POINTS:,} points; give fewer values, or use several runs"
        )
    return tuple(axes)


def rows(axes: tuple[Axis, ...]) -> list[dict[str, Any]]:
    """Return the values of all keys at each point of a sweep, the last axis fastest."""
    keys = [key for axis in axes for key in axis.keys]
    points = itertools.product(*(axis.values for axis in axes))
    return [dict(zip(keys, itertools.chain(*point), strict=True)) for point in points]


def written(axes: tuple[Axis, ...]) -> Any:
    """Return the sweep of a scenario file: a list of tables for one zipped axis, else a table of lists."""
    if len(axes) == 1 and len(axes[0].keys) > 1:
        return [dict(zip(axes[0].keys, row, strict=True)) for row in axes[0].values]
    return {axis.keys[0]: [row[0] for row in axis.values] for axis in axes}


def without(axes: tuple[Axis, ...], key: str) -> tuple[Axis, ...]:
    """Return a sweep without a key; points that differ in nothing else are one."""
    result = []
    for axis in axes:
        places = [place for place, other in enumerate(axis.keys) if other != key]
        values = {
            str(row): row
            for row in (tuple(row[place] for place in places) for row in axis.values)
        }
        if places:
            result.append(
                Axis(
                    tuple(axis.keys[place] for place in places), tuple(values.values())
                )
            )
    return tuple(result)


def _fault(message: str) -> PydanticCustomError:
    return PydanticCustomError("sweep", "{text}", {"text": message})


def _zipped(tables: list[Any]) -> Axis:
    """Return the axis of a list of tables, each a row of values."""
    if not tables or not all(
        isinstance(table, dict) and table.keys() == tables[0].keys() != set()
        for table in tables
    ):
        raise _fault(
            'must be a list of tables with the same keys, each such as { "contact.load" = "1 mN" }'
        )
    keys = tuple(tables[0])
    return Axis(keys, tuple(tuple(table[key] for key in keys) for table in tables))


def _columns(table: dict[str, Any], above: str = "") -> Iterator[Axis]:
    """Iterate over the axes of the swept keys; keys may be quoted as one or nested as tables."""
    for name, values in table.items():
        key = f"{above}{name}"
        if isinstance(values, dict) and any(
            type(values.get(word, [])) not in (list, dict) for word in _RANGE
        ):
            values = spaced(values, f"{key}: ")
        if isinstance(values, list) and values:
            yield Axis((key,), tuple((value,) for value in values))
        elif isinstance(values, dict) and values:
            yield from _columns(values, f"{key}.")
        else:
            example = (
                '["1 mN", "4 mN"] or { from, to, count, scale = "linear" or "log" }'
            )
            raise _fault(
                f"{key}: must be a list of values that is not empty; write {example}"
            )


def _require_sweepable(key: str, keys: list[str]) -> None:
    """Refuse a key that cannot be swept, with the cure."""
    first = key.partition(".")[0]
    if first in ("seed", "sweep", "source"):
        raise _fault(
            f"{key}: cannot be swept; members differ in their noise, so raise ensemble.members"
        )
    if first in _SHARED[3:] or key in _SHARED:
        raise _fault(
            f"{key}: cannot be swept, because all points share it; run the scenario once for each value"
        )
    if key.endswith(".model"):
        table = key.removesuffix(".model")
        raise _fault(
            f'{key}: a model is swept as a whole table: "{table}" = [{{ model = ... }}, {{ model = ... }}]'
        )
    if (
        any(other != key and key.startswith(f"{other}.") for other in keys)
        or keys.count(key) > 1
    ):
        raise _fault(f"{key}: is swept twice; remove one")


def spaced(values: dict[str, Any], before: str = "") -> list[Any]:
    """Return the values of a range, spaced evenly on a linear or logarithmic scale; ``before`` begins a message."""
    low, high, count, scale = (values.get(word, "linear") for word in _RANGE)
    ends = same_unit(low, high)
    if not {"from", "to", "count"} <= values.keys() <= set(_RANGE) or scale not in (
        "linear",
        "log",
    ):
        raise _fault(
            f'{before}write a range as {{ from = ..., to = ..., count = ..., scale = "linear" or "log" }}'
        )
    if type(count) is not int or not 2 <= count <= _MOST_POINTS:
        raise _fault(
            f"{before}the count of the range must be a whole number from 2 to {_MOST_POINTS:,}"
        )
    if ends is None:
        raise _fault(
            f"{before}both ends of the range must be finite numbers in units of one dimension"
        )
    first, last, unit = ends
    if scale == "log" and not (first > 0.0 and last > 0.0):
        raise _fault(f'{before}a range with scale = "log" needs both ends above zero')
    numbers = (np.geomspace if scale == "log" else np.linspace)(
        first, last, count
    ).tolist()
    return (
        numbers
        if unit is None
        else [f"{number!r} {unit}".strip() for number in numbers]
    )
