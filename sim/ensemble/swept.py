"""Points of a sweep in words, and statements about several of them at once."""

import math
import re
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from sim.ensemble.plan import Plan
from sim.scenario.scenario import Scenario
from sim.scenario.schema import entries
from sim.units.notation import engineering
from sim.units.quantity import same_unit

#: Most values of a key that are listed, unless they follow one another.
_LISTED = 3

#: A value in a remark with its unit, if it has one; a number after "=" or in quotes is part of a cure.
_VALUE = re.compile(
    r'(?<![\w.^"-])(?<!= )\d+(?:\.\d+)?(?:e[+-]?\d+)?\b(?: [pnµmkMG]?(?P<unit>m/s|N/m|Pa|m|s|N)\b)?'
)


def places(count: int, most: int = 8) -> list[int]:
    """Return the places of some of a number of points, first and last included."""
    even = np.linspace(0, count - 1, min(most, count)).round().astype(int)
    return [int(place) for place in np.unique(even)]


def spread(points: Sequence[Scenario], most: int = 8) -> list[Scenario]:
    """Return some of the points, first and last included."""
    return [points[place] for place in places(len(points), most)]


def _value(plan: Plan, place: int, key: str) -> str:
    """Return the value of a swept key at a point in words: of a table its model, or else all its values."""
    listed = [
        entry
        for entry in entries(plan.points[place])
        if entry.key == key or entry.key.startswith(f"{key}.")
    ]
    if listed[0].key == f"{key}.model":
        return str(listed[0].value)
    return ", ".join(
        str(value)
        if quantity is None or isinstance(value, tuple)
        else engineering(value, quantity.unit)
        for _, value, quantity in listed
        if value is not None
    )


def in_words(plan: Plan, point: Scenario, speed: float | None = None) -> str:
    """Return the swept keys of a point in words, except for its speed, and a sliding speed [m/s] if it is given."""
    place = next(k for k, other in enumerate(plan.points) if other is point)
    keys = [key for axis in plan.scenario.sweep for key in axis.keys]
    words = [
        f"{key} = {_value(plan, place, key)}"
        for key in keys
        if key not in ("drive.speed", "drive.stage")
    ]
    if speed is not None:
        words.append(engineering(speed, "m/s") if speed else "rest")
    return ", ".join(words)


def points_in_words(plan: Plan, chosen: Sequence[int], examined: Sequence[int]) -> str:
    """Return places of a sweep with their number among those examined: "at contact.load = 1 N, 1 of 4 points".

    It is empty without a sweep, and if the places are all points of the sweep.
    """
    everywhere = len(chosen) == len(examined)
    if everywhere and len(examined) == len(plan.points):
        return ""
    count = f"{len(chosen)} of {len(examined)} points"
    if len(examined) < len(plan.points):
        count += f" examined of {len(plan.points)}"
    if everywhere:
        return f"at {count}"
    axes = plan.scenario.sweep
    shape = [len(axis.values) for axis in axes]
    columns = np.unravel_index(chosen, shape)
    values = [np.unique(column) for column in columns]
    known = [np.unique(column) for column in np.unravel_index(examined, shape)]
    if math.prod(map(len, values)) > len(chosen):
        # no product of values, so that their list would name points that are not chosen
        keys = [key for axis in axes for key in axis.keys]
        words = [f"{key} = {_value(plan, chosen[0], key)}" for key in keys]
        return f"at {count}, such as {', '.join(words)}"
    words = []
    for axis, column, held, every in zip(axes, columns, values, known, strict=True):
        if len(held) < len(every):
            firsts = [chosen[int(np.argmax(column == value))] for value in held]
            first, last = np.searchsorted(every, held[[0, -1]])
            follow = bool(last - first + 1 == len(held))
            words += [
                f"{key} = {_listed(plan, firsts, key, follow)}" for key in axis.keys
            ]
    return f"at {', '.join(words)}, {count}"


def _listed(plan: Plan, chosen: Sequence[int], key: str, follow: bool) -> str:
    """Return the values of a key at some points, as a range if they ``follow`` one another and are more than two."""
    if follow and len(chosen) > 2:
        chosen = [chosen[0], chosen[-1]]
        return " to ".join(_value(plan, place, key) for place in chosen)
    texts = [_value(plan, place, key) for place in chosen[:_LISTED]]
    more = ["others"] if len(chosen) > _LISTED else []
    *before, last = [*texts, *more]
    return f"{', '.join(before)} and {last}" if before else last


def grouped(
    plan: Plan,
    examined: Sequence[int],
    statements: Callable[[Scenario], Iterable[str]],
) -> list[str]:
    """Return the statements about points of a sweep, each once, with the range of its values and its points."""
    alike: dict[str, dict[int, str]] = {}
    for place in examined:
        for text in statements(plan.points[place]):
            kind = _VALUE.sub(lambda value: f"\0{value['unit'] or ''}", text)
            alike.setdefault(kind, {})[place] = text
    texts = []
    for group in alike.values():
        where = points_in_words(plan, list(group), examined)
        text = _in_range(list(group.values()))
        texts.append(f"{text} ({where})" if where else text)
    return texts


def _in_range(texts: Sequence[str]) -> str:
    """Return the one statement of statements that are alike, with ranges in place of values."""
    ends = []
    for column in zip(
        *([value[0] for value in _VALUE.finditer(text)] for text in texts), strict=True
    ):
        ordered = sorted(
            column, key=lambda value: (same_unit(column[0], value) or (0.0, 0.0))[1]
        )
        ends.append(" to ".join(dict.fromkeys([ordered[0], ordered[-1]])))
    return _VALUE.sub(lambda _: ends.pop(0), texts[0])
