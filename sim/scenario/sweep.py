"""Sweeps: which keys of a scenario take which values, as an outer product of axes."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from sim.units.quantity import number_and_unit, same_unit

_SHARED = ("clock", "clock.duration", "clock.record", "name", "ensemble", "record")
_RANGE = ("from", "to", "count", "scale")
_MOST_POINTS = 20_000

Fault = tuple[tuple[str | int, ...], str]


@dataclass(frozen=True)
class Axis:
    """One dimension of a sweep: its ``keys`` take the rows of ``values`` together."""

    keys: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key in a nested document, copying or making the tables on its way."""
    *tables, last = key.split(".")
    for name in tables:
        inner = document.get(name)
        document[name] = dict(inner) if isinstance(inner, dict) else {}
        document = document[name]
    document[last] = value


def read_sweep(sweep: Any) -> tuple[Axis, ...]:
    """Axes from a table of keys (outer product) or a list of tables (zipped into one axis).

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
    axes, faults = sweep_axes(sweep)
    for path, said in faults:
        where = ".".join(str(word) for word in path)
        raise PydanticCustomError("sweep", "{text}", {"text": f"{where}: {said}" if where else said})
    return axes


def written(axes: tuple[Axis, ...]) -> Any:
    """The sweep of a scenario file that has these axes: a list of tables of one zipped axis, else a table of lists."""
    if len(axes) == 1 and len(axes[0].keys) > 1:
        return [dict(zip(axes[0].keys, row, strict=True)) for row in axes[0].values]
    return {axis.keys[0]: [row[0] for row in axis.values] for axis in axes}


def sweep_axes(sweep: Any) -> tuple[tuple[Axis, ...], list[Fault]]:
    """The sound axes of a sweep and all of its faults, each with its path in the sweep and its cure."""
    if isinstance(sweep, tuple) and all(isinstance(axis, Axis) for axis in sweep):
        return sweep, []
    faults: list[Fault] = []
    if isinstance(sweep, list):
        axes = _zipped(sweep, faults)
    elif isinstance(sweep, dict):
        axes = _columns(sweep, (), faults)
    else:
        return (), [((), 'must be a table of lists, such as "contact.load" = ["1 mN", "4 mN"]')]
    keys = [key for axis in axes for key in axis.keys]
    unfit = {key: said for key in keys if (said := _unfit(key, keys))}
    faults += [((key,), said) for key, said in unfit.items()]
    axes = [axis for axis in axes if not unfit.keys() & set(axis.keys)]
    for axis in axes:
        rows = Counter(", ".join(map(str, row)) for row in axis.values)
        faults += [((axis.keys[0],), f"has {row} twice; take it out once") for row, n in rows.items() if n > 1][:1]
    if math.prod(len(axis.values) for axis in axes) > _MOST_POINTS:
        return (), [*faults, ((), f"has more than {_MOST_POINTS:,} points; take fewer values, or several runs")]
    return tuple(axes), faults


def _zipped(tables: list[Any], faults: list[Fault]) -> list[Axis]:
    """One axis from a list of tables, each a row of values."""
    if not tables or not all(isinstance(table, dict) and table for table in tables):
        faults.append(((), 'must be a list of tables, each such as { "contact.load" = "1 mN" }'))
        return []
    keys = tuple(tables[0])
    for place, table in enumerate(tables):
        if set(table) != set(keys):
            other = sorted(set(table) ^ set(keys))[0]
            said = f'has other keys than the first table of the sweep ("{other}"); give all of them the same keys'
            faults.append(((place,), said))
            return []
    return [Axis(keys, tuple(tuple(table[key] for key in keys) for table in tables))]


def _columns(table: dict[str, Any], above: tuple[str, ...], faults: list[Fault]) -> list[Axis]:
    """An axis for each swept key; keys may be quoted as one or nested as tables."""
    axes: list[Axis] = []
    for name, values in table.items():
        path = (*above, name)
        if isinstance(values, dict) and any(type(values.get(word, [])) not in (list, dict) for word in _RANGE):
            try:
                values = _spaced(values)
            except ValueError as fault:
                faults.append((path, str(fault)))
                continue
        if isinstance(values, list) and values:
            axes.append(Axis((".".join(path),), tuple((value,) for value in values)))
        elif isinstance(values, dict) and values:
            axes += _columns(values, path, faults)
        else:
            what = "must not be an empty list" if values == [] else "must be a list of values"
            faults.append((path, f'{what}; write ["1 mN", "4 mN"] or {{ from, to, count, scale = "linear" or "log" }}'))
    return axes


def _unfit(key: str, keys: list[str]) -> str | None:
    """Why a key cannot be swept, and the cure."""
    first, _, rest = key.partition(".")
    if first == "seed":
        return "cannot be swept; members differ in their noise already, so raise ensemble.members"
    if first in ("sweep", "source"):
        return "cannot be swept; sweep keys of the scenario"
    if first in _SHARED[3:] or key in _SHARED:
        return "cannot be swept, since all points of a sweep share it; run the scenario once for each value"
    if rest.rpartition(".")[2] == "model":
        table = key.removesuffix(".model")
        return f'a model is swept as a whole table: "{table}" = [{{ model = ... }}, {{ model = ... }}]'
    if any(other != key and key.startswith(f"{other}.") for other in keys) or keys.count(key) > 1:
        return "is swept twice; take it out once"
    return None


def _spaced(values: dict[str, Any]) -> list[Any]:
    """Evenly spaced values of a range, linearly or logarithmically; ValueError with what is wrong about it."""
    unknown = [key for key in values if key not in _RANGE]
    if unknown:
        raise ValueError(f'the range has the unknown key "{unknown[0]}"; it takes {", ".join(_RANGE)}')
    missing = [key for key in _RANGE[:3] if key not in values]
    if missing:
        raise ValueError(f"the range lacks {' and '.join(missing)}; write {{ from = ..., to = ..., count = ... }}")
    low, high, count, scale = (values.get(key, "linear") for key in _RANGE)
    ends = number_and_unit(low), number_and_unit(high)
    if ends[0] is None or ends[1] is None:
        raise ValueError("the range needs finite numbers, with or without a unit, as from and to")
    both = same_unit(low, high)
    if both is None:
        given = [f'"{unit}"' if unit else "no unit" for _, unit in (ends[0], ends[1])]
        raise ValueError(f"the range goes from {given[0]} to {given[1]}; write both ends in units of one dimension")
    if type(count) is not int or not 2 <= count <= _MOST_POINTS:
        raise ValueError(f"the count of the range must be a whole number from 2 to {_MOST_POINTS:,}")
    if scale not in ("linear", "log"):
        raise ValueError('the scale of the range must be "linear" or "log"')
    first, last, unit = both
    if scale == "log" and not (first > 0.0 and last > 0.0):
        raise ValueError('a range with scale = "log" needs both ends above zero')
    numbers = (np.geomspace if scale == "log" else np.linspace)(first, last, count).tolist()
    return numbers if unit is None else [f"{number!r} {unit}".strip() for number in numbers]
