"""Numbers as text, with a suitable prefix and their error in the last digits."""

import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from contextvars import ContextVar

from sim.units.errors import BadInput
from sim.units.quantity import Quantity

#: Most digits of a mean with its error.
_MOST_DIGITS = 6

#: Prefixes of powers of a thousand, from the fifth below one.
_PREFIXES = ("f", "p", "n", "µ", "m", "", "k", "M", "G", "T")
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
    thousands = (math.log10(size) + 2.0 * (power - 1) + 1e-12) / (3 * power)
    place = min(max(math.floor(thousands), -5), 4)
    return 10.0 ** (-3 * place * power), _PREFIXES[place + 5] + shown


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

    The error has two digits, and the mean at most six. An error that would need more
    digits is not stated: the mean then has five digits, and the error is below a unit
    of the last of them. Without brackets the error is therefore unknown, zero, or
    smaller than the last digit.

    >>> print(concise(118.2312, 0.0423), concise(0.5, 0.013), concise(1234.0, 56.0))
    118.231(42) 0.500(13) 1234(56)
    >>> print(concise(118.2312, 0.0004), concise(12.5, 0.0), concise(12345.0, 567.0))
    118.23 12.5 12340(570)
    """
    if math.isnan(mean):
        return "–"
    if not sem > 1e-9 * abs(mean) or not math.isfinite(sem):
        return _digits(mean, 4)
    places = _places_of(sem)
    if mean != 0.0 and places > _MOST_DIGITS - 1 - math.floor(math.log10(abs(mean))):
        return _digits(mean, _MOST_DIGITS - 1)
    digits = max(places, 0)
    error = round(round(sem, places) * 10**digits)
    return f"{round(mean, places) + 0.0:.{digits}f}({error})"


def _digits(number: float, digits: int) -> str:
    """Return a number of so many digits; up to a million it has no power of ten."""
    return f"{float(f'{number:.{digits}g}'):.{_MOST_DIGITS}g}"


def _places_of(error: float) -> int:
    """Return the number of decimal places at which an error has two digits."""
    return 1 - int(f"{error:.1e}".partition("e")[2])


def bounded(
    value: float,
    sem: float,
    low: float = math.nan,
    high: float = math.nan,
    bound: float = 0.0,
    source: str = "",
) -> str:
    """Return a value with its standard error, or with the only end of its interval that is known.

    Parameters
    ----------
    value, sem : float
        Value and standard error.
    low, high : float
        Ends of an interval. An end alone is a bound.
    bound : float
        Bound of a systematic error, such as that of the clock step. It stands behind
        the value, unless it is smaller than the last digit.
    source : str
        Cause of that error in a word.

    Examples
    --------
    >>> print(bounded(118.2312, 0.0423), bounded(561.0, math.nan, low=446.0))
    118.231(42) 561 (> 446)
    >>> print(bounded(math.nan, math.nan, high=0.2), bounded(math.nan, math.nan, 0.3, 3.0))
    < 0.2 0.3 to 3
    >>> print(bounded(83.214, 0.2, bound=0.31, source="step"))
    83.21(20) ± 0.31 (step)
    >>> print(bounded(116.587, math.nan, bound=0.4, source="step"))
    116.59 ± 0.40 (step)
    """
    ends = [f"> {low:.4g}"] if math.isfinite(low) else []
    ends += [f"< {high:.4g}"] if math.isfinite(high) else []
    if math.isnan(value) and len(ends) == 2:
        return f"{low:.4g} to {high:.4g}"
    if math.isnan(value):
        return ends[0] if ends else "–"
    if len(ends) == 1:
        return f"{value:.4g} ({ends[0]})"
    text = concise(value, sem)
    is_shown = 10.0 ** (1 - _MOST_DIGITS) * abs(value) < bound < math.inf
    if not is_shown or ("(" in text and bound < 0.1 * sem):
        return text
    places = max(_places_of(bound), 0)
    if "(" not in text:
        text = f"{value:.{places}f}"
    return f"{text} ± {bound:.{places}f} ({source})"


#: Probability below which only this bound is known, because smaller numbers lose their digits.
_LEAST_CHANCE = 1e-300


def chance(p_value: float) -> str:
    """Return a p value in words; one that would be rounded to 1 is above 0.99, and none is 0.

    >>> print(chance(0.0312), chance(0.998), chance(0.0), sep="; ")
    p = 0.031; p > 0.99; p < 1e-300
    """
    if p_value < _LEAST_CHANCE:
        return f"p < {_LEAST_CHANCE:g}"
    return f"p = {p_value:.2g}" if p_value < 0.995 else "p > 0.99"


def share(value: float, low: float, high: float) -> str:
    """Return a share in percent with an end of its 95 % interval if a standard error would leave 0 to 100 %; "" else.

    The end is that of the side on which there is room.

    >>> print(share(0.0, 0.0, 0.39), share(1.0, 0.985, 1.0), share(0.002, 0.0001, 0.039))
    0 (<39) 100 (>98.5) 0.2 (<3.9)
    >>> print(share(0.99998, 0.9998, 1.0), share(0.5, 0.4, 0.6) == "")
    99.9980 (>99.980) True
    """
    error = (high - low) / 3.92
    if not (value - error < 0.0 or value + error > 1.0):
        return ""
    if value < 0.5:
        return f"{100.0 * value:.2g} (<{100.0 * high:.2g})"
    texts = []
    for number in (value, low):
        missing = 100.0 * (1.0 - number)
        # two digits of it
        places = max(_places_of(missing), 0) if missing > 0.0 else 0
        texts.append(f"{100.0 * number:.{places}f}")
    return f"{texts[0]} (>{texts[1]})"
