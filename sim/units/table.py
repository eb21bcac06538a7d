"""Tables from CSV text: named columns with units in the header, and the files that hold them."""

import contextlib
import csv
import errno
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import WrapValidator
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity

Array = NDArray[np.float64]

_HEADING = re.compile(r"(?P<name>[^\[\]()]+?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?")
_MOST_BYTES = 2**28


class TableError(ValueError):
    """A table that cannot be read; the message names the line and the cure, not the file nor its content."""


def columns(text: str, wanted: dict[str, Quantity], header: str | None = None) -> dict[str, Array]:
    """Return named columns of a CSV text in SI units.

    Parameters
    ----------
    text : str
        Cells with commas, semicolons or tabs between them. The first line that is neither empty nor a ``#``
        comment names the columns, each with its unit in brackets; a column without brackets is in SI
        units. Other columns are ignored. Decimal commas are read if semicolons or tabs separate the cells.
    wanted : dict of str to Quantity
        The columns to read, each with its SI unit and bounds.
    header : str, optional
        Names of the columns of a text without that line, whose numbers blanks may separate, too. An empty one
        stands for a key ``header`` that would give them.

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
    example = ", ".join(name if one.unit == "1" else f"{name} [{one.unit}]" for name, one in wanted.items())
    table, place = _cells(text), "header"
    if header is None or not all(map(_is_number, table.rows[0])):
        place = f"line {table.lines[0]}"
        if header:
            raise TableError(f"{place}: the columns have a header of their own; leave the key header out")
        units, table = _headings(place, table.rows[0]), table._replace(lines=table.lines[1:], rows=table.rows[1:])
    elif header:
        units = _headings(place, header.split(","))
    else:
        raise TableError(f'the columns have no header; add one, or the key header, such as header = "{example}"')
    if not table.rows:
        raise TableError("no rows follow the header; add rows of numbers below it")
    if len(units) != len(table.rows[0]):
        raise TableError(f"{place}: {len(units)} names of {len(table.rows[0])} columns; name each column")
    result = {}
    for name, quantity in wanted.items():
        places = [k for k, (heading, _) in enumerate(units) if heading == name]
        if len(places) != 1:
            fault = "is there twice" if places else "is missing"
            raise TableError(f'{place}: column "{name}" {fault}; write the header as "{example}"')
        unit = units[places[0]][1]
        unit = "" if quantity.unit == "1" and unit in ("1", "-") else unit
        try:
            quantity.scaled(1.0, unit)
        except ValueError as fault:
            raise TableError(f'{place}: column "{name}" {fault}') from None
        result[name] = _numbers(name, table, [row[places[0]] for row in table.rows], unit, quantity)
    return result


def headings(text: str) -> dict[str, str]:
    """Return the names of the columns of a CSV text with the texts of their units, "" for a column without one.

    Raises
    ------
    TableError
        If there is no header, or it cannot be read or has a name twice.

    >>> headings("speed (mm/s), share\\n1, 2")
    {'speed': 'mm/s', 'share': ''}
    """
    table = _cells(text)
    units = _headings(f"line {table.lines[0]}", table.rows[0])
    if len(dict(units)) < len(units):
        raise TableError(f"line {table.lines[0]}: the header has a name twice; name each column once")
    return dict(units)


def matrix(text: str, quantity: Quantity, gaps: bool = False) -> Array:
    """Return a plain rectangular block of SI numbers, separated as in ``columns`` or by blanks, shape (rows, columns).

    With ``gaps`` numbers may be nan, and bounds are not checked.

    Raises
    ------
    TableError
        If it is empty or ragged, or a cell is no finite number within the bounds.
    """
    table = _cells(text)
    cells = list(itertools.chain.from_iterable(table.rows))
    return _numbers("value", table, cells, "", quantity, gaps).reshape(len(table.rows), -1)


class _Cells(NamedTuple):
    """Rows of cells with the numbers of their lines; ``comma`` if decimals may have a comma."""

    lines: list[int]
    rows: list[list[str]]
    comma: bool


def _cells(text: str) -> _Cells:
    """Return the cells of all lines that are neither empty nor comments."""
    texts = {number: line.strip(" ") for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1)}
    texts = {number: line for number, line in texts.items() if line.strip() and line[0] != "#"}
    if not texts:
        raise TableError("the table is empty; write a header of names and units, then rows of numbers")
    lines, first = list(texts), next(iter(texts.values()))
    blank = " " if all(map(_is_number, first.split())) else ","
    sign = next((sign for sign in ";\t," if sign in first), blank)
    try:
        rows = list(csv.reader(texts.values(), delimiter=sign, skipinitialspace=True, strict=True))
    except csv.Error as fault:
        raise TableError(f"a line cannot be read as cells ({fault}); close quotes on the same line") from None
    for line, row in zip(lines, rows, strict=False):
        if len(row) != len(rows[0]):
            cure = "separate cells by commas, write decimals with a point"
            raise TableError(f"line {line}: {len(row)} cells where the first row has {len(rows[0])}; {cure}")
    return _Cells(lines, rows, sign in ";\t")


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
        raise TableError(f"{place}: a heading cannot be read; write a name and its unit, such as time [s]")
    return [(match["name"], match["unit"] or "") for match in matches if match]


def _numbers(
    name: str, table: _Cells, cells: Sequence[str], unit: str, quantity: Quantity, gaps: bool = False
) -> Array:
    """Return cells of a table as numbers in SI."""
    if table.comma and any("," in cell for cell in cells):
        if any("." in cell for cell in cells):
            raise TableError(f'{name} has numbers with "." and with ","; write all decimals with a point')
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        numbers = quantity.scaled(np.fromiter(map(float, cells), float, len(cells)), unit)
    except ValueError:
        place = next(place for place, cell in enumerate(cells) if "," in cell or not _is_number(cell))
        line = table.lines[place * len(table.lines) // len(cells)]
        raise TableError(
            f"line {line}: {name} is not a number; write decimals with a point, or leave the row out"
        ) from None
    for place in () if gaps else (numbers.argmin(), numbers.argmax()):  # the first nan is both
        try:
            quantity.read(float(numbers[place]))
        except ValueError as fault:
            line = table.lines[place * len(table.lines) // len(cells)]
            reason = re.split("; |, not ", str(fault))[0]  # without the number, as a scenario may name any file
            raise TableError(f"line {line}: {name} {reason}") from None
    return numbers


def at_once(quantity: Quantity) -> WrapValidator:
    """Return a validator that checks an array of numbers as a whole, all else number by number."""

    def check(values: Any, each: Callable[[Any], tuple[float, ...]]) -> tuple[float, ...]:
        if isinstance(values, np.ndarray) and values.dtype == float and values.ndim == 1:
            with contextlib.suppress(ValueError):
                for extreme in (values.min(), values.max()):  # the first nan is both
                    quantity.read(float(extreme))
                return tuple(values.tolist())
        return each(values)

    return WrapValidator(check)


def plain_text(path: Path) -> str:
    """Return the text of a plain file of at most 256 MiB; no pipe or device is waited for."""
    if not path.is_file():
        raise OSError(errno.ENOENT, "there is none, or it is no plain file")
    if path.stat().st_size > _MOST_BYTES:
        raise OSError(errno.EFBIG, f"it is larger than {_MOST_BYTES // 2**20} MiB")
    with path.open(encoding="utf-8-sig") as file:
        return file.read(path.stat().st_size)


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
        reason = f"cannot be read ({fault.strerror or fault}); give a path relative to the scenario"
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
    return context["files"].text(name) if context and "files" in context else plain_text(Path(name))


def file_path(name: str, context: Any) -> Path:
    """Return the path of a plain file that a scenario names; arguments as of ``file_text``."""
    path = context["files"].path(name) if context and "files" in context else Path(name)
    if not path.is_file():
        raise OSError(errno.ENOENT, "there is none, or it is no plain file")
    return path


def file_columns(name: str, context: Any, wanted: dict[str, Quantity], header: str | None = None) -> dict[str, Array]:
    """Return columns of a CSV file that a scenario names; arguments as of ``file_text`` and ``columns``."""
    with blamed(name):
        return columns(file_text(name, context), wanted, header)
