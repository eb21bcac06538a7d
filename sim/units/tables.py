"""Tables: CSV with units in its header, values prescribed over time, measured curves with their errors."""

import contextlib
import csv
import difflib
import errno
import itertools
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    Tag,
    ValidationInfo,
    model_validator,
)
from pydantic_core import ArgsKwargs, PydanticCustomError

from sim.units.errors import BadInput
from sim.units.instrument import Instrument, same_line_ends
from sim.units.quantity import SMALLEST, Quantity, keyed
from sim.units.terminal import LOG

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A name and its unit: "speed [mm/s]", "speed (mm/s)" or "speed in mm/s".
_HEADING = re.compile(
    r"(?P<name>[^\[\]()]+?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])]|\sin\s+(?P<other>\S+))?"
)
#: A comment that states a condition of all rows: "# contact.load = 4 mN".
_STATED = re.compile(r"^#[ \t]*([\w.]+)[ \t]*=[ \t]*([^;,\t\n]+)", re.MULTILINE)
_MOST_BYTES = 2**28
#: Unknown columns that a message names.
_MOST_NAMED = 20


class TableError(ValueError):
    """A table that cannot be read; the message names the line and the cure, not the file nor its content."""


def columns(
    text: str,
    wanted: dict[str, Quantity],
    header: str | None = None,
    gaps: bool = False,
) -> dict[str, Array]:
    """Return named columns of a CSV text in SI units.

    Parameters
    ----------
    text : str
        Cells with commas, semicolons or tabs between them. The first line that is neither empty nor a ``#``
        comment names the columns, each with its unit in brackets; without that line a comment above may do so. A column
        without brackets has the unit of a comment above, such as ``# stress in kPa``, or is in SI units. Other columns
        are ignored. Decimal commas are read if semicolons or tabs separate the cells.
    wanted : dict of str to Quantity
        The columns to read, each with its SI unit and bounds.
    header : str, optional
        Names of the columns of a text without that line, whose numbers blanks may separate, too. An empty one
        stands for a key ``header`` that would give them.
    gaps : bool
        True if cells may be empty or nan.

    Returns
    -------
    dict of str to array, shape (rows,)
        At least one row.

    Raises
    ------
    TableError
        If a column is missing or there twice, its unit is unknown or of another dimension, a row has
        another number of cells, or a cell is no finite number within the bounds; if ``header`` is given and the
        text has one.

    Examples
    --------
    >>> table = columns("time [s], speed [mm/s]\\n0, 1\\n2, 5", {"speed": Quantity("m/s", "speed")})
    >>> table["speed"].tolist()
    [0.001, 0.005]
    """
    example = ", ".join(
        name if wanted[name].unit == "1" else f"{name} [{wanted[name].unit}]"
        for name in wanted
    )
    table = _cells(text)
    if header and table.bare:
        place, units = "header", _headings("header", header.split(","))
    elif header:
        raise TableError(
            f"line {table.lines[0]}: the file has a header; omit the key header"
        )
    else:
        place, units, table = _headed(table)
        if not units:
            cure = (
                "add one, such as"
                if header is None
                else "add one, or the key header, such as header ="
            )
            raise TableError(f'the columns have no header; {cure} "{example}"')
    if not table.rows:
        raise TableError("no rows follow the header; add rows of numbers below it")
    if len(units) != len(table.rows[0]):
        raise TableError(
            f"{place}: {len(units)} names for {len(table.rows[0])} columns; name each column"
        )
    result = {}
    for name, quantity in wanted.items():
        places = [k for k, (heading, _) in enumerate(units) if heading == name]
        if len(places) != 1:
            fault = "is there twice" if places else "is missing"
            raise TableError(
                f'{place}: column "{name}" {fault}; write the header as "{example}"'
            )
        unit = units[places[0]][1]
        unit = "" if quantity.unit == "1" and unit in ("1", "-") else unit
        try:
            quantity.scaled(1.0, unit)
        except ValueError as fault:
            raise TableError(f'{place}: column "{name}" {fault}') from None
        cells = [row[places[0]] or "nan" * gaps for row in table.rows]
        result[name] = _numbers(name, table, cells, unit, quantity, gaps)
    return result


def matrix(text: str, quantity: Quantity, gaps: bool = False, unit: str = "") -> Array:
    """Return a plain rectangular block of SI numbers, separated as in ``columns`` or by blanks, shape (rows, columns).

    With ``gaps`` numbers may be nan. The numbers are in ``unit`` or in that of a comment
    above, such as ``# stress in kPa``, else in SI units.

    Raises
    ------
    TableError
        If it is empty or ragged, or a cell is no finite number within the bounds; if ``unit`` and comments disagree.
    """
    table, factors = _cells(text), {}
    for other in [unit, *(noted for comment in table.comments for _, noted in comment)]:
        with contextlib.suppress(ValueError):  # of a comment on something else
            factors[quantity.scaled(1.0, other) if other else None] = other
    units = [other for other in factors.values() if other]
    if len(units) > 1:
        raise TableError(
            f"the unit is {' and '.join(units)}, by the comments and the key unit; give one of them"
        )
    for edge in (table.rows[0], [row[0] for row in table.rows]):
        if (
            len(edge) > 4
            and edge[0] in ("0", "1")
            and edge == [str(k + int(edge[0])) for k in range(len(edge))]
        ):
            raise TableError(
                "its first row or column only numbers the others; remove it"
            )
    cells = list(itertools.chain.from_iterable(table.rows))
    return _numbers("value", table, cells, "".join(units), quantity, gaps).reshape(
        len(table.rows), -1
    )


class _Cells(NamedTuple):
    """Rows of cells with the numbers of their lines; ``comma`` if decimals may have a comma.

    ``comments`` are those above the first row, each as names and units.
    """

    lines: list[int]
    rows: list[list[str]]
    comma: bool
    comments: list[list[tuple[str, str]]]

    @property
    def bare(self) -> bool:
        """True if the first row is no header."""
        return all(map(_is_number, self.rows[0]))


def _headed(table: _Cells) -> tuple[str, list[tuple[str, str]], _Cells]:
    """Return the place of a header, its names and units, none without a header, and the table below it."""
    place = f"line {table.lines[0]}"
    if table.bare:
        fitting = [
            comment
            for comment in table.comments
            if len(comment) == len(table.rows[0]) > 1
        ]
        return f"comment above {place}", fitting[-1] if fitting else [], table
    noted = {name: unit for comment in table.comments for name, unit in comment if unit}
    units = [
        (name, unit or noted.get(name, ""))
        for name, unit in _headings(place, table.rows[0])
    ]
    return place, units, table._replace(lines=table.lines[1:], rows=table.rows[1:])


def _cells(text: str) -> _Cells:
    """Return the cells of all lines that are neither empty nor comments, without columns that are empty."""
    every = {
        number: line.strip(" ")
        for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1)
    }
    texts = {
        n: line
        for n, line in every.items()
        if line.strip(" \t;,") and not line.startswith(("#", "sep="))
    }
    if not texts:
        raise TableError(
            "the table is empty; write a header of names and units, then rows of numbers"
        )
    lines, first = list(texts), next(iter(texts.values()))
    blank = " " if all(map(_is_number, first.split())) else ","
    sign = next((sign for sign in ";\t," if sign in first), blank)
    try:
        rows = list(
            csv.reader(
                texts.values(), delimiter=sign, skipinitialspace=True, strict=True
            )
        )
    except csv.Error as fault:
        raise TableError(
            f"a line cannot be read as cells ({fault}); close quotes on the same line"
        ) from None
    for line, row in zip(lines, rows, strict=False):
        if len(row) != len(rows[0]):
            cure = "separate cells by commas, write decimals with a point"
            raise TableError(
                f"line {line}: {len(row)} cells where the first row has {len(rows[0])}; {cure}"
            )
    if not all(rows[0]):  # a spreadsheet ends each line with separators
        filled = [k for k in range(len(rows[0])) if any(row[k] for row in rows)]
        rows = [[row[k] for k in filled] for row in rows]
    above = [
        line[:200].strip("# ;,\t")
        for n, line in every.items()
        if n < lines[0] and line.startswith("#")
    ]
    comments = [
        _named(_HEADING.fullmatch(cell.strip()) for cell in re.split("[;,\t]", line))
        for line in above
    ]
    return _Cells(lines, rows, sign in ";\t", comments)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _headings(place: str, cells: Sequence[str]) -> list[tuple[str, str]]:
    """Return the name and the text of the unit of each column, "" without one."""
    matches = [_HEADING.fullmatch(cell.strip()) for cell in cells]
    if not all(matches):
        raise TableError(
            f"{place}: a heading cannot be read; write a name and its unit, such as time [s]"
        )
    return _named(matches)


def _named(matches: Iterable[re.Match[str] | None]) -> list[tuple[str, str]]:
    return [
        (match["name"], match["unit"] or match["other"] or "")
        for match in matches
        if match
    ]


def _numbers(
    name: str,
    table: _Cells,
    cells: list[str],
    unit: str,
    quantity: Quantity,
    gaps: bool = False,
) -> Array:
    """Return cells of a table as numbers in SI."""

    def fault(place: int, reason: str) -> TableError:
        return TableError(
            f"line {table.lines[place * len(table.lines) // len(cells)]}: {name} {reason}"
        )

    if table.comma and any("," in cell for cell in cells):
        if any("." in cell for cell in cells):
            raise TableError(
                f'{name} has numbers with "." and with ","; write all decimals with a point'
            )
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        numbers = quantity.scaled(
            np.fromiter(map(float, cells), float, len(cells)), unit
        )
    except ValueError:
        place = next(
            place
            for place, cell in enumerate(cells)
            if "," in cell or not _is_number(cell)
        )
        raise fault(
            place, "is not a number; write decimals with a point, or omit the row"
        ) from None
    filled = np.flatnonzero(~(np.isnan(numbers) & gaps))
    for place in (
        filled[[numbers[filled].argmin(), numbers[filled].argmax()]]
        if filled.size
        else ()
    ):
        try:
            quantity.read(numbers[place])
        except ValueError as refusal:
            # shown without the number, as a scenario may name any file
            raise fault(place, re.split("; |, not ", str(refusal))[0]) from None
    return numbers


def _listed(values: Any) -> Any:
    """Return an array or a list as a list, where numbers that are too small to be real are zero.

    The last rows of a computed decay are such numbers, and no fault of their author.
    """
    listed = values.tolist() if isinstance(values, np.ndarray) else values
    if not isinstance(listed, list | tuple):
        return listed
    return [
        0.0 if isinstance(value, float) and abs(value) < SMALLEST else value
        for value in listed
    ]


#: Validator that takes an array for the numbers in it.
LISTED = BeforeValidator(_listed)


def decoded(content: bytes, errors: str = "strict") -> str:
    r"""Return the text of a file in UTF-8, without its mark; each line ends in the same way on all systems.

    >>> decoded(b"\xef\xbb\xbfload\r\nspeed\r\n")
    'load\nspeed\n'
    """
    return same_line_ends(content.decode("utf-8-sig", errors))


def plain_text(path: Path) -> str:
    """Return the text of a plain file of at most 256 MiB."""
    return decoded(_content(path))


def _content(path: Path) -> bytes:
    """Return the content of a plain file of at most 256 MiB."""
    size = _plain(path).stat().st_size
    if size > _MOST_BYTES:
        raise OSError(errno.EFBIG, f"it is larger than {_MOST_BYTES // 2**20} MiB")
    with path.open("rb") as file:
        return file.read(size)


def _plain(path: Path) -> Path:
    """Return the path of a plain file, so that no pipe or device is waited for."""
    if not path.is_file():
        raise OSError(errno.ENOENT, "it does not exist, or is not a regular file")
    return path


@contextlib.contextmanager
def blamed(name: str) -> Iterator[None]:
    """Raise trouble with a file that a scenario names as a fault of the scenario.

    Raises
    ------
    PydanticCustomError
        With the file, the reason and a cure.
    """
    try:
        yield
        return
    except PydanticCustomError:
        raise
    except UnicodeDecodeError:
        reason = "is not UTF-8 text; save it as plain CSV in UTF-8"
    except OSError as fault:
        reason = f"cannot be read ({fault.strerror or fault}); name a plain file, relative to the scenario"
    except (ValueError, RuntimeError, EOFError, MemoryError) as fault:
        reason = str(fault)
    about = {"file": name[:200], "reason": reason.partition("\n")[0]}
    raise PydanticCustomError("bad_table", "{file}: {reason}", about)


def file_text(name: str, context: Any) -> str:
    """Return the text of a file that a scenario names, for validators of its parts.

    Parameters
    ----------
    name : str
        Path, relative to the scenario.
    context : dict or None
        The validation's context; ``context["files"].text(name)`` reads beside the scenario. Without
        it the path is relative to the current directory.
    """
    return context["files"].text(name) if context else plain_text(Path(name))


def file_path(name: str, context: Any) -> Path:
    """Return the path of a plain file that a scenario names; arguments as of ``file_text``."""
    return _plain(context["files"].path(name) if context else Path(name))


def file_columns(
    name: str, context: Any, wanted: dict[str, Quantity], header: str | None = None
) -> dict[str, Array]:
    """Return columns of a CSV file that a scenario names; arguments as of ``file_text`` and ``columns``."""
    with blamed(name):
        return columns(file_text(name, context), wanted, header)


class FromFile:
    """Base of tables of a scenario whose file gives some of their keys."""

    def read_keys(self, context: Any) -> Mapping[str, Any]:
        """Return the keys that the file gives, none if the table has them; ``context`` is that of the validation."""
        raise NotImplementedError

    @model_validator(mode="wrap")
    @classmethod
    def _with_file(
        cls, keys: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        table = handler(keys)
        if not (of_file := table.read_keys(info.context)):
            return table
        if isinstance(keys, ArgsKwargs):  # of a call of the class in Python
            names = (field.name for field in fields(table))  # type: ignore[arg-type]
            keys = dict(zip(names, keys.args, strict=False)) | (keys.kwargs or {})
        return handler({**keys, **of_file})


# Courses: a value prescribed over the time of a run as a number, a course from one value to another, or a table.


Indices = NDArray[np.int64]
_TIME = Quantity("s", "time", "t")
_CYCLES = Quantity(
    "1",
    "number of cycles between both ends; 0: one way",
    at_least=0,
    at_most=10**6,
    whole=True,
)
#: Times nearer than this share of the run are meant to be the same.
_SAME = 1e-9


class Pieces(NamedTuple):
    """Stretches of time, in each of which a prescribed value changes smoothly: arrays (pieces,).

    ``interval`` is the number of the interval in which a piece lies; each interval has one or more. ``start`` and
    ``stop`` are the piece's ends [s], ``first`` and ``last`` the values there. ``integral`` is that of the value over
    time, ``path`` that of its magnitude, ``unsteady`` that of the squared difference of the magnitude from its mean.
    All are closed forms of a piece: differences of an antiderivative (scipy's PPoly) lose up to 1e-12 of the path.
    """

    interval: Indices
    start: Array
    stop: Array
    first: Array
    last: Array
    integral: Array
    path: Array
    unsteady: Array

    @property
    def joined(self) -> "Pieces":
        """Return one piece for each interval; its sums are rounded once."""
        if len(self.interval) == self.interval[-1] - self.interval[0] + 1:
            return self
        opening = np.flatnonzero(np.diff(self.interval, prepend=-1))
        closing = np.append(opening[1:], len(self.interval)) - 1
        squares = self.unsteady + _steady_square(self.path, self.stop - self.start)
        integral, path, square = np.add.reduceat(
            [self.integral, self.path, squares], opening, axis=1
        )
        for k in np.flatnonzero(closing - opening > 1):
            inside = slice(opening[k], closing[k] + 1)
            integral[k], path[k] = (
                math.fsum(self.integral[inside]),
                math.fsum(self.path[inside]),
            )
        ends = (
            self.start[opening],
            self.stop[closing],
            self.first[opening],
            self.last[closing],
        )
        unsteady = np.maximum(square - _steady_square(path, ends[1] - ends[0]), 0.0)
        unsteady = np.where(closing > opening, unsteady, self.unsteady[opening])
        return Pieces(self.interval[opening], *ends, integral, path, unsteady)


def _steady_square(path: Array, span: Array) -> Array:
    """Return the integral over time of the square of a constant value with this integral."""
    return np.divide(path * path, span, out=np.zeros(path.shape), where=span > 0.0)


def linear_pieces(
    interval: Indices, start: Array, stop: Array, first: Array, last: Array
) -> Pieces:
    """Return pieces in which the value changes linearly."""
    integral = 0.5 * (first + last) * (stop - start)
    path, turns = np.abs(integral), first * last < 0.0
    unsteady = (last - first) ** 2 * (stop - start) / 12.0
    if turns.any():
        v0, v1, span = first[turns], last[turns], (stop - start)[turns]
        path[turns] = 0.5 * (v0**2 + v1**2) / np.abs(v1 - v0) * span
        unsteady[turns] = (v0**2 + v0 * v1 + v1**2) / 3.0 * span - _steady_square(
            path[turns], span
        )
    return Pieces(interval, start, stop, first, last, integral, path, unsteady)


def _within(ends: Array, times: Array, apart: float = 0.0) -> tuple[Array, Indices]:
    """Return the times strictly between ``ends``, further than ``apart`` from them, and their places among these."""
    times = times[(ends[0] < times) & (times < ends[-1])]
    places = np.searchsorted(ends, times, "right")
    inside = (ends[places - 1] + apart < times) & (times < ends[places] - apart)
    return times[inside], places[inside]


def _intervals(ends: Array, places: Indices) -> Indices:
    """Return the number of the interval of each piece, if times at these places cut some intervals."""
    count = len(ends) - 1
    return np.repeat(np.arange(count), 1 + np.bincount(places - 1, minlength=count))


class Number(NamedTuple):
    """A constant value.

    Every prescribed value has ``changes``, true if it depends on time, and ``cycles``, the number of cycles. ``end``
    [s] is the last time for which it is given. ``ways`` are the times of its ways there and back [s], none if it is no
    loop. ``lasts`` is the time of all its holds or of its loop [s], minus infinity without them. Its methods are those
    below.
    """

    value: float
    changes: bool = False
    cycles: int = 0
    end: float = math.inf
    ways: tuple[float, ...] = ()
    lasts: float = -math.inf

    @property
    def extremes(self) -> tuple[float, ...]:
        """Return values among which are the least and the largest of the run."""
        return (self.value,)

    def at(self, time: Array, duration: float) -> Array:
        """Return the value at times [s] of a run of ``duration`` [s]; at a jump that after the jump."""
        return np.full(time.shape, self.value)

    def jumps(self, time: Array, duration: float) -> Flags:
        """True for those of some times [s] at which the value jumps."""
        return np.zeros(time.shape, bool)

    def pieces(self, ends: Array, duration: float) -> Pieces:
        """Return the pieces of the intervals between some times [s], cut where the value turns or jumps."""
        value = np.full(len(ends) - 1, self.value)
        return linear_pieces(np.arange(len(value)), ends[:-1], ends[1:], value, value)


@keyed(kw_only=True)
class Course:
    """From one value to another over the run, or ``cycles`` times there and back, linearly or logarithmically.

    Notes
    -----
    Logarithmic: v(t) = v0 r^(t/T) with r = v1/v0; its integral over dt is v(t) T/ln r (r^(dt/T) − 1), by expm1.
    """

    start: Annotated[float, Field(alias="from")]
    stop: Annotated[float, Field(alias="to")]
    scale: Annotated[
        Literal["linear", "log"],
        Field(description="spacing of values between the ends"),
    ] = "linear"
    changes: ClassVar[bool] = True
    cycles: ClassVar[int] = 0
    end: ClassVar[float] = math.inf
    ways: ClassVar[tuple[float, ...]] = ()
    lasts: ClassVar[float] = -math.inf

    @model_validator(mode="after")
    def _log_needs_one_sign(self) -> "Course":
        if self.scale == "log" and self.start * self.stop <= 0.0:
            message = 'a logarithmic course cannot reach or pass zero; give two values above zero or scale = "linear"'
            raise PydanticCustomError("log_through_zero", message)
        return self

    @property
    def extremes(self) -> tuple[float, ...]:
        return self.start, self.stop

    def at(self, time: Array, duration: float) -> Array:
        part = time / duration if duration > 0.0 else np.zeros(time.shape)
        if self.cycles:
            turn = 2.0 * self.cycles * part % 2.0
            part = np.where(turn <= 1.0, turn, 2.0 - turn)
        if self.scale == "log":
            # the library's scalar power: that of numpy differs between processors
            ratio = self.stop / self.start
            return self.start * np.array(
                [ratio**share for share in part.ravel().tolist()]
            ).reshape(part.shape)
        value = self.start + (self.stop - self.start) * part
        # a course that reaches zero but for rounding reaches it: there a free sphere touches
        return np.where(
            np.abs(value) > 1e-13 * max(abs(self.start), abs(self.stop)), value, 0.0
        )

    def jumps(self, time: Array, duration: float) -> Flags:
        return np.zeros(time.shape, bool)

    def pieces(self, ends: Array, duration: float) -> Pieces:
        values, interval = self.at(ends, duration), np.arange(len(ends) - 1)
        if self.cycles:
            half = duration / (2.0 * self.cycles)
            turns = (
                np.arange(math.floor(ends[0] / half), math.ceil(ends[-1] / half) + 1)
                * half
            )
            turns, places = _within(ends, turns, _SAME * duration)
            odd = np.round(turns / half) % 2.0 == 1.0
            values, interval = (
                np.insert(values, places, np.where(odd, self.stop, self.start)),
                _intervals(ends, places),
            )
            ends = np.insert(ends, places, turns)
        pieces = linear_pieces(interval, ends[:-1], ends[1:], values[:-1], values[1:])
        if self.scale == "linear":
            return pieces
        rate = math.log(self.stop / self.start) * max(1, 2 * self.cycles) / duration
        if rate == 0.0:
            return pieces
        rates = np.copysign(rate, np.abs(pieces.last) - np.abs(pieces.first))
        span = pieces.stop - pieces.start
        growth, twice = (
            [math.expm1(n * share) for share in (rates * span).tolist()] for n in (1, 2)
        )
        integral = pieces.first * np.array(growth) / rates
        square = pieces.first**2 * np.array(twice) / (2.0 * rates)
        unsteady = np.maximum(square - _steady_square(integral, span), 0.0)
        return pieces._replace(
            integral=integral, path=np.abs(integral), unsteady=unsteady
        )


def table_pieces(times: Array, values: Array, ends: Array, duration: float) -> Pieces:
    """Return pieces of a table, linear between rows and constant after the last; two rows at one time are a jump."""
    ends = _snapped(times, ends, duration)
    rows, places = _within(
        ends, np.unique(times[slice(*np.searchsorted(times, ends[[0, -1]], "right"))])
    )
    edges = np.insert(ends, places, rows)
    start, stop = edges[:-1], edges[1:]
    row = np.searchsorted(times, 0.5 * (start + stop), "right") - 1
    first, last = (_interpolated(times, values, row, edge) for edge in (start, stop))
    return linear_pieces(_intervals(ends, places), start, stop, first, last)


def _snapped(times: Array, ends: Array, duration: float) -> Array:
    """Return times, replaced by the nearest time of a row if they differ by rounding only."""
    after = np.searchsorted(times, ends).clip(max=len(times) - 1)
    left, right = times[np.maximum(after - 1, 0)], times[after]
    nearest = np.where(np.abs(left - ends) <= np.abs(right - ends), left, right)
    return np.where(np.abs(nearest - ends) <= _SAME * duration, nearest, ends)


def _interpolated(times: Array, values: Array, row: Indices, time: Array) -> Array:
    """Return values on the lines from some rows to the next; after the last row its value."""
    after = np.minimum(row + 1, len(times) - 1)
    span, rise = times[after] - times[row], values[after] - values[row]
    slope = np.divide(rise, span, out=np.zeros(span.shape), where=span > 0.0)
    return np.where(
        time >= times[after], values[after], slope * (time - times[row]) + values[row]
    )


class Rows:
    """Values at some times, linear between them; two rows at one time are a jump. A subclass gives ``_rows``."""

    changes: ClassVar[bool] = True
    cycles: ClassVar[int] = 0
    ways: ClassVar[tuple[float, ...]] = ()
    lasts: ClassVar[float] = -math.inf

    @property
    def _rows(self) -> tuple[Array, Array]:
        """Times [s] and values."""
        raise NotImplementedError

    @property
    def end(self) -> float:
        """Return the last time for which the values are given [s]."""
        raise NotImplementedError

    @property
    def extremes(self) -> tuple[float, ...]:
        """Return values among which are the least and the largest of the run."""
        return tuple(self._rows[1].tolist())

    def at(self, time: Array, duration: float) -> Array:
        times, values = self._rows
        time = _snapped(times, time, duration)
        return _interpolated(
            times, values, np.searchsorted(times, time, "right") - 1, time
        )

    def jumps(self, time: Array, duration: float) -> Flags:
        times, values = self._rows
        is_jump = (np.diff(times) == 0.0) & (np.diff(values) != 0.0)
        return np.isin(_snapped(times, time, duration), times[1:][is_jump])

    def pieces(self, ends: Array, duration: float) -> Pieces:
        return table_pieces(*self._rows, ends, duration)


@keyed(kw_only=True)
class Table(FromFile, Rows):
    """Values tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario file ``file`` names a CSV with the columns ``time`` and ``column``, each with its unit in brackets.
    A subclass declares the field ``values_in``, in which it keeps the latter.
    """

    quantity: ClassVar[Quantity]
    column: ClassVar[str]
    values_in: ClassVar[str] = "value"

    time: Annotated[tuple[Annotated[float, _TIME], ...], LISTED] = ()
    file: Annotated[
        str,
        Field(
            description="CSV file with these columns, beside the scenario, instead of lists"
        ),
    ] = ""

    def read_keys(self, context: Any) -> dict[str, Array]:
        if self.time or not self.file:
            return {}
        wanted = {"time": _TIME, self.column: self.quantity}
        read = file_columns(self.file, context, wanted)
        return {"time": read["time"], self.values_in: read[self.column]}

    @model_validator(mode="after")
    def _rows_in_order(self) -> "Table":
        if len(self.time) != len(self.extremes):
            raise PydanticCustomError(
                "short_table", "a table needs as many values as times"
            )
        if len(self.time) < 2:
            message = 'a table needs two rows or more; give them, or a CSV file such as file = "data.csv"'
            raise PydanticCustomError("short_table", message)
        if np.any(np.diff(self.time) < 0.0) or self.time[0] > 0.0:
            raise PydanticCustomError(
                "time_order", "times must start at 0 s or before and never decrease"
            )
        return self

    @property
    def extremes(self) -> tuple[float, ...]:
        """Return the column beside the times."""
        return tuple(getattr(self, self.values_in))

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        return np.array(self.time), np.array(self.extremes)

    @property
    def end(self) -> float:
        return self.time[-1]


_HOLD = Quantity("s", "time of a hold", "t_h", above=0)


@keyed(kw_only=True)
class Holds(Rows):
    """Sliding at a speed and holds in turn; after the last hold the sliding does not end.

    >>> course = Holds(speed=1e-3, slide=2.0, holds=(1.0, 10.0))
    >>> course.at(np.array([1.0, 2.5, 4.0, 6.0, 20.0]), 20.0).tolist(), course.lasts
    ([0.001, 0.0, 0.001, 0.0, 0.001], 17.0)
    """

    speed: Annotated[float, Quantity("m/s", "speed while sliding", "V")]
    slide: Annotated[
        float, Quantity("s", "time of sliding before each hold", "t_s", above=0)
    ]
    holds: Annotated[
        tuple[Annotated[float, _HOLD], ...],
        LISTED,
        Field(description="times of the holds in turn", min_length=1),
    ]
    end: ClassVar[float] = math.inf  # type: ignore[misc]

    @cached_property
    def _rows(self) -> tuple[Array, Array]:  # type: ignore[override]
        times = list(itertools.accumulate([0.0, self.slide]))
        for hold in self.holds:
            times += [times[-1], times[-1] + hold]
            times += [times[-1], times[-1] + self.slide]
        count = len(self.holds)
        return np.array(times), self.speed * np.resize(
            [1.0, 1.0, 0.0, 0.0], 4 * count + 2
        )

    @property
    def lasts(self) -> float:  # type: ignore[override]
        """Time from the start until the slider has slid after the last hold as after the others [s]."""
        return float(self._rows[0][-1])


@keyed(kw_only=True)
class Loop(Rows):
    """To a value and back, each way at a speed of its own; after the way back the value stays.

    >>> course = Loop(**{"from": -1e-6, "to": 1e-6, "approach": 2e-6, "retraction": 1e-6})
    >>> course.at(np.array([0.0, 0.5, 1.0, 2.0, 9.0]), 9.0).tolist(), course.lasts
    ([-1e-06, 0.0, 1e-06, 0.0, -1e-06], 3.0)
    """

    start: Annotated[float, Field(alias="from")]
    stop: Annotated[float, Field(alias="to")]
    approach: Annotated[float, Quantity("m/s", "speed of the way there", above=0)]
    retraction: Annotated[float, Quantity("m/s", "speed of the way back", above=0)]
    end: ClassVar[float] = math.inf  # type: ignore[misc]

    @model_validator(mode="after")
    def _has_a_way(self) -> "Loop":
        if self.start == self.stop:
            message = "a loop needs a way; give two different values"
            raise PydanticCustomError("no_way", message)
        return self

    @property
    def ways(self) -> tuple[float, float]:  # type: ignore[override]
        """Times of the way there and of that back [s]."""
        way = abs(self.stop - self.start)
        return way / self.approach, way / self.retraction

    @cached_property
    def _rows(self) -> tuple[Array, Array]:  # type: ignore[override]
        times = list(itertools.accumulate((0.0, *self.ways)))
        return np.array(times), np.array([self.start, self.stop, self.start])

    @property
    def lasts(self) -> float:  # type: ignore[override]
        """Time from the start to the end of the way back [s]."""
        return float(self._rows[0][-1])


def _kind(value: Any) -> str:
    if isinstance(value, Holds) or (isinstance(value, dict) and "holds" in value):
        return "[list of holds]"
    if isinstance(value, Loop) or (
        isinstance(value, dict) and {"approach", "retraction"} & value.keys()
    ):
        return "[loop]"
    if isinstance(value, Table) or (
        isinstance(value, dict) and ("file" in value or "time" in value)
    ):
        return "[table]"
    return "[course]" if isinstance(value, dict | Course) else "[value]"


def over_time(
    unit: Quantity, name: str, holds: type[Holds] | None = None, loops: bool = False
) -> Any:
    """Return the annotation of a prescribed quantity: a number, a course, or a table whose column has this name.

    A speed may have ``holds``, too, and a place loops by the speed if ``loops`` is true.
    """

    @keyed(kw_only=True)
    class _Course(Course):
        """From one value to another over the run, or ``cycles`` times there and back."""

        start: Annotated[float, unit, Field(alias="from")]
        stop: Annotated[float, unit, Field(alias="to")]
        cycles: Annotated[int, _CYCLES] = 0  # type: ignore[misc]

    @keyed(kw_only=True)
    class _Table(Table):
        """A value tabulated over time, linear between the rows; ``file`` names the CSV."""

        quantity: ClassVar[Quantity] = unit
        column: ClassVar[str] = name
        value: Annotated[tuple[Annotated[float, unit], ...], LISTED] = ()
        file: Annotated[
            str,
            Field(
                description=f"CSV file with the columns `time` and `{name}`, instead of lists"
            ),
        ] = ""

    @keyed(kw_only=True)
    class _Loop(Loop):
        """To a value and back, each way at a speed of its own; after the way back the value stays."""

        start: Annotated[float, unit, Field(alias="from")]
        stop: Annotated[float, unit, Field(alias="to")]

    number, course = (
        Annotated[float, unit, Tag("[value]")],
        Annotated[_Course, Tag("[course]")],
    )
    kinds = number | course | Annotated[_Table, Tag("[table]")]
    admitted = {"[value]", "[course]", "[table]"}
    if holds is not None:
        kinds |= Annotated[holds, Tag("[list of holds]")]  # type: ignore[valid-type]
        admitted.add("[list of holds]")
    if loops:
        kinds |= Annotated[_Loop, Tag("[loop]")]
        admitted.add("[loop]")

    def kind(value: Any) -> str:
        # keys of a kind that is not admitted are then none of a course
        return _kind(value) if _kind(value) in admitted else "[course]"

    return Annotated[kinds, Discriminator(kind)]


#: A value prescribed over a run.
Prescribed = Number | Course | Rows


def prescribed(value: float | Course | Rows) -> Prescribed:
    """Return the course in time of a value of a scenario."""
    return value if isinstance(value, Course | Rows) else Number(value)


# Tables of what was measured: CSV columns named as variables, with units, and beside them their errors.


#: End of the names of columns with standard errors.
ERROR = "_error"
#: Groups of names of one condition: as recorded, as prescribed, and for short.
_NAMES = (
    ("speed", "drive_speed"),
    ("stage_speed", "drive_stage"),
    ("normal_load", "contact_load", "load"),
    ("indentation", "contact_indentation"),
    ("displacement", "contact_displacement"),
)


def names_of(name: str) -> tuple[str, ...]:
    """Return all names that a column of a variable may have.

    >>> names_of("contact_load")
    ('normal_load', 'contact_load', 'load')
    """
    return next((names for names in _NAMES if name in names), (name,))


#: Names of columns that are proposed for words and symbols, the first one that is known.
_PROPOSED = {
    word: names
    for names, words in (
        ("speed stage_speed", "V v U velocity speed"),
        ("contact_area", "A area"),
        ("contact_radius", "a radius"),
        ("friction_force spring_force", "F f F_T Ft friction force"),
        ("shear_stress", "tau τ stress"),
        ("t", "T time"),
        ("displacement", "z"),
        ("normal_load", "P W N L FN Fn F_N load normal"),
        ("indentation", "d δ delta depth"),
        ("solid_shear_modulus", "G modulus"),
        ("sphere_radius", "R"),
    )
    for word in words.split()
}


class Points(NamedTuple):
    """Values of a column [SI] with their standard errors, None where unknown."""

    values: Array
    errors: Array | None


def read_measured(
    path: Path,
    known: Mapping[str, Quantity],
    outcomes: Mapping[str, Quantity],
    gaps: bool = False,
    is_planned: bool = False,
    instrument: Instrument | None = None,
) -> tuple[dict[str, Points], str]:
    """Return the columns of a table of measured values, and a remark if it has no units, which is printed, too.

    Parameters
    ----------
    path : Path
        CSV with a header such as ``speed [mm/s], contact_area [mm^2], contact_area_error [mm^2]``. A comment such as
        ``# contact.load = 4 mN`` states a condition of all rows.
    known : dict of str to Quantity
        All names that a column may have.
    outcomes : dict of str to Quantity
        Those that may have a column of standard errors beside them, in the same dimension or in ``[%]``.
    gaps : bool
        True if cells may be empty, which are then nan.
    is_planned : bool
        True if errors need no values beside them, which are then nan. Relative errors are negative numbers.
    instrument : Instrument, optional
        Form of the file, if it is not such a table itself.

    Raises
    ------
    BadInput
        With one line.
    """
    try:
        with blamed(str(path)):
            header, text = (
                instrument.table(_content(path))
                if instrument
                else (None, plain_text(path))
            )
            result, bare = _measured_columns(
                text, known, outcomes, gaps, is_planned, header
            )
    except PydanticCustomError as fault:
        raise BadInput([str(fault)]) from None
    reach = [
        f"{name} reaches {np.nanmax(np.abs(result[name].values)):.4g} {known[name].unit}"
        for name in bare
    ]
    remark = f"no units: SI assumed; {', '.join(reach)}" if bare else ""
    if remark:
        LOG.warning("%s: %s", path, remark)
    return result, remark


def measured_points(
    columns: Mapping[str, Any], known: Mapping[str, Quantity]
) -> dict[str, Points]:
    """Return columns of measured values [SI] by name, some with their errors.

    Raises
    ------
    ValueError
        For names that are not known, or columns of different lengths.
    """
    arrays = {str(name): np.asarray(values, float) for name, values in columns.items()}
    _refuse_unknown(arrays, known, known)
    for name in arrays:
        if len(twice := [other for other in names_of(name) if other in arrays]) > 1:
            raise ValueError(
                f'columns "{twice[0]}" and "{twice[1]}" are the same condition; omit one of them'
            )
    if (
        len({values.shape for values in arrays.values()}) != 1
        or next(iter(arrays.values())).ndim != 1
    ):
        raise ValueError(
            "measured columns need the same number of rows; give arrays of one length"
        )
    return {
        name: Points(values, arrays.get(name + ERROR))
        for name, values in arrays.items()
        if name in known
    }


def _measured_columns(
    text: str,
    known: Mapping[str, Quantity],
    outcomes: Mapping[str, Quantity],
    gaps: bool,
    is_planned: bool,
    header: str | None,
) -> tuple[dict[str, Points], list[str]]:
    """Return the columns, and the names of those that would need a unit if none has one."""
    place = "instrument.columns"
    units = dict(
        _headings(place, header.split(",")) if header else _headed(_cells(text))[1]
    )
    if not units:
        raise TableError(
            "the columns have no header; add one of names and units, such as speed [mm/s]"
        )
    comments = {
        name.replace(".", "_"): (name, value.strip())
        for name, value in _STATED.findall(text)
    }
    stated = {
        n: comment
        for n, comment in comments.items()
        if "." in comment[0] or (n in known and n not in outcomes)
    }
    _refuse_unknown(
        [*units, *stated, *(outcomes if is_planned else ())], known, outcomes
    )
    wanted: dict[str, Quantity] = {}
    for name, unit in units.items():
        if name in known:
            wanted[name] = known[name]
        else:
            declared = outcomes[name.removesuffix(ERROR)].unit
            wanted[name] = Quantity(
                "1" if unit == "%" and declared != "1" else declared, name, above=0
            )
    bare = [
        name
        for name, quantity in wanted.items()
        if not units[name] and quantity.unit != "1"
    ]
    if bare and any(units.values()):
        cure = f'write "{bare[0]} [{wanted[bare[0]].unit}]" if that is its unit'
        raise TableError(f'column "{bare[0]}" has no unit, but others have one; {cure}')
    arrays = columns(text, wanted, header, gaps)
    for name, (key, value) in stated.items():
        if name in arrays:
            raise TableError(f'"{key}" is a column and a comment; omit one of them')
        try:
            number = known[name].read(value)
        except ValueError as fault:
            raise TableError(f'the comment "# {key} = {value[:40]}": {fault}') from None
        arrays[name] = np.full(len(next(iter(arrays.values()))), number)
    for base in (name for name in outcomes if name + ERROR in wanted):
        values = arrays.setdefault(base, np.full(len(arrays[base + ERROR]), np.nan))
        if wanted[base + ERROR].unit != outcomes[base].unit:  # a share of the value
            arrays[base + ERROR] *= -1.0 if is_planned else np.abs(values)
        if not is_planned and np.any(arrays[base + ERROR] <= 0.0):
            raise TableError(
                f'column "{base}" has a value of 0, so a relative error is undefined; give it in units'
            )
    return measured_points(arrays, known), [name for name in bare if name in known]


def _refuse_unknown(
    names: Collection[str], known: Iterable[str], outcomes: Iterable[str]
) -> None:
    """Refuse columns that are no conditions, variables or errors of such a column, all at once and with proposals."""
    errors, texts = [name + ERROR for name in names if name in outcomes], []
    for name in [name for name in names if name not in known and name not in errors][
        :_MOST_NAMED
    ]:
        base = name.removesuffix(ERROR)
        near = difflib.get_close_matches(base.lower()[:40], known, 1, 0.75)
        for word in [base, *re.findall("[^\\W\\d_]+", base.lower())]:
            near += [
                each
                for name in _PROPOSED.get(word, "").split()
                for each in names_of(name)
                if each in known
            ]
        ending = f" → {near[0]}{name[len(base) :]}" if near else ""
        texts.append(
            name[:40]
            + (" (the error of no measured column)" if base in known else ending)
        )
    if texts:
        cure = "rename these columns (docs/dataset.md), or omit them"
        raise TableError(
            f"neither variables of a dataset nor numbers of the scenario: {', '.join(texts)}; {cure}"
        )
