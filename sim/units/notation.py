"""Numbers as text, with a suitable prefix and their error in the last digits."""

import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from contextvars import ContextVar

from sim.units.errors import BadInput
from sim.units.quantity import Quantity

#: Most digits of a mean with its error.
_MOST_DIGITS = 7

_PREFIXES = {
    -15: "f",
    -12: "p",
    -9: "n",
    -6: "µ",
    -3: "m",
    0: "",
    3: "k",
    6: "M",
    9: "G",
    12: "T",
}
_PREFIXABLE = re.compile(r"(?P<base>m|s|N|Pa|J)(?:\^(?P<power>\d))?(?P<rest>|[/ ].*)")


def second_half(records: int) -> tuple[int, int]:
    """Return the first of the records in the second half of a run, all of two, and the first in the half of these."""
    first = records // 2 if records > 2 else 0
    return first, first + (records - first) // 2


#: Units that a person has chosen for numbers of their dimensions, and whether any number has had them.
_CHOSEN: ContextVar[dict[str, bool]] = ContextVar("chosen units")


@contextlib.contextmanager
def in_units(units: Iterable[str]) -> Iterator[None]:
    """Return a context in which numbers of their dimension are shown in these units, such as ``"mm/s"``.

    Without any unit those of the context around it stay.

    Raises
    ------
    BadInput
        For a unit that no number in the context can have.
    """
    wanted = tuple(units)
    chosen = dict.fromkeys(wanted, False) or _CHOSEN.get({})
    before = _CHOSEN.set(chosen)
    try:
        yield
    finally:
        _CHOSEN.reset(before)
    for name in (name for name in wanted if not chosen[name]):
        raise BadInput(
            [
                f'--units: no number here can be in "{name[:40]}"; choose a unit of one, as mm/s of speed'
            ]
        )


def chosen_unit(unit: str) -> tuple[float, str] | None:
    """Return the factor from SI to the unit chosen for this dimension, and its name; None if there is no choice."""
    chosen = _CHOSEN.get({})
    for name in chosen:
        with contextlib.suppress(ValueError):
            size = Quantity(unit, "unit").read(f"1 {name}")
            chosen[name] = True
            return 1.0 / size, name
    return None


def scaled(magnitude: float, unit: str) -> tuple[float, str]:
    """Return the factor from SI to a unit with a prefix that suits a magnitude, and that unit for people.

    A unit that was chosen with ``in_units`` comes first.

    >>> scaled(0.042, "J/m^2")
    (1000.0, 'mJ/m²')
    """
    if choice := chosen_unit(unit):
        return choice[0], _typeset(re.sub("^u(?=.)", "µ", choice[1]))
    match, shown = _PREFIXABLE.fullmatch(unit), _typeset(unit)
    size = abs(float(f"{magnitude:.3e}"))
    if match is None or not (0.0 < size < math.inf):
        return 1.0, "" if unit == "1" else shown
    power = int(match["power"] or 1)
    # squares step by a million: 0.05 mm² reads better than 50 000 µm²
    exponent = 3 * math.floor(
        (math.log10(size) + 2.0 * (power - 1) + 1e-12) / (3 * power)
    )
    exponent = min(max(exponent, -15), 12)
    return 10.0 ** (-exponent * power), _PREFIXES[exponent] + shown


def _typeset(unit: str) -> str:
    return unit.replace("^2", "²").replace("^3", "³")


def engineering(value: float, unit: str) -> str:
    """Return a number with its unit in the SI prefix that suits it, with four digits at most.

    >>> print(engineering(1.203e-4, "m"), engineering(42e-3, "J/m^2"), engineering(4.55e-8, "m^2"))
    120.3 µm 42 mJ/m² 0.0455 mm²
    """
    factor, shown = scaled(value, unit)
    return f"{value * factor:.4g} {shown}".rstrip()


def concise(mean: float, sem: float) -> str:
    """Return a mean with its standard error in the last digits, as metrologists write it.

    Seven digits of the mean at most: a smaller error stays untold and leaves five. So without brackets
    there is no error, it is not known, or it is below half of the seventh digit.

    >>> print(concise(118.2312, 0.0423), concise(0.5, 0.013), concise(1234.0, 56.0), concise(12.5, 0.0))
    118.23(4) 0.500(13) 1230(60) 12.5
    >>> print(concise(118.2312, 0.0004), concise(118.2312, 0.000004))
    118.2312(4) 118.23
    """
    if math.isnan(mean):
        return "–"
    if not sem > 1e-9 * abs(mean) or not math.isfinite(sem):
        return f"{mean:.4g}"
    decade = math.floor(math.log10(sem))
    places = -decade + (1 if sem < 2.0 * 10.0**decade else 0)
    if mean != 0.0:
        last = _MOST_DIGITS - 1 - math.floor(math.log10(abs(mean)))
        if sem < 0.5 * 10.0**-last:
            return f"{mean:.5g}"
        places = min(places, last)
    digits = max(places, 0)
    return f"{round(mean, places) + 0.0:.{digits}f}({round(round(sem, places) * 10**digits)})"


def bounded(
    value: float, sem: float, low: float = math.nan, high: float = math.nan
) -> str:
    """Return a value with its standard error, or with the only end of its interval that is known.

    >>> print(bounded(118.2312, 0.0423), bounded(561.0, math.nan, low=446.0), bounded(math.nan, math.nan, low=50.0))
    118.23(4) 561 (> 446) > 50
    >>> print(bounded(math.nan, math.nan, high=0.2), bounded(math.nan, math.nan, 0.3, 3.0), bounded(math.nan, math.nan))
    < 0.2 0.3 to 3 –
    """
    ends = [
        f"{sign} {end:.4g}"
        for sign, end in ((">", low), ("<", high))
        if math.isfinite(end)
    ]
    if math.isnan(value):
        return (
            f"{low:.4g} to {high:.4g}" if len(ends) == 2 else ends[0] if ends else "–"
        )
    return f"{value:.4g} ({ends[0]})" if len(ends) == 1 else concise(value, sem)


def share(value: float, low: float, high: float) -> str:
    """Return a share in percent with its 95 % interval if a standard error would leave 0 to 100 %; "" else.

    >>> print(share(0.0, 0.0, 0.39), share(0.5, 0.4, 0.6) == "")
    0 (0 to 39) True
    """
    error = (high - low) / 3.92
    if not (value - error < 0.0 or value + error > 1.0):
        return ""
    first, middle, last = (
        100.0 * min(max(number, 0.0), 1.0) for number in (low, value, high)
    )
    return f"{middle:.3g} ({first:.2g} to {last:.3g})"
