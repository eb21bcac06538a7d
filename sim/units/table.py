"""Tables from CSV text: named columns with units in the header, and the files that hold them."""

import contextlib
import csv
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?\s*")


#: What a header's names look like; whatever else stands in a file is shown by no message.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_ .-]{0,19}")


class TableError(ValueError):
    """A table that cannot be read; the message names the line and the cure, not the file nor what stands in it.

    ``names`` are those that its header has in place of one that is wanted.
    """

    def __init__(self, said: str, names: Iterable[str] = ()):
        super().__init__(said)
        self.names = tuple(names)


def columns(text: str, wanted: dict[str, Quantity]) -> dict[str, NDArray[np.float64]]:
    """Named columns of a CSV text in SI units.

    Parameters
    ----------
    text : str
        Comma-separated cells. The first line that is neither empty nor a ``#`` comment names the
        columns, each with its unit in brackets; a column without brackets is in SI units. Columns
        that nobody wants are ignored.
    wanted : dict of str to Quantity
        The columns to read, each with its SI unit and bounds.

    Returns
    -------
    dict of str to array, shape (rows,)
        At least one row.

    Raises
    ------
    TableError
        If a column is missing or there twice, its unit is unknown or of another dimension, a row has
        another number of cells, or a cell is no finite number within the bounds.

    Examples
    --------
    >>> table = columns("time [s], speed [mm/s]\\n0, 1\\n2, 5", {"speed": Quantity("m/s", "speed")})
    >>> table["speed"].tolist()
    [0.001, 0.005]
    """
    lines = _lines(text)
    example = ", ".join(_column(name, quantity) for name, quantity in wanted.items())
    if not lines:
        raise TableError(f'the table is empty; begin with a header such as "{example}", then rows of numbers')
    (number, header), rows = lines[0], lines[1:]
    found = _header(number, header, wanted, example)
    if not rows:
        raise TableError(f"line {number}: no rows follow the header; add rows of numbers below it")
    for at, cells in rows:
        if len(cells) != len(header):
            said = f"{len(cells)} cells where the header has {len(header)}"
            raise TableError(f"line {at}: {said}; separate cells by commas, write decimals with a point")
    return {
        name: np.array([_number(at, name, cells[place], unit, wanted[name]) for at, cells in rows])
        for name, (place, unit) in found.items()
    }


def matrix(text: str, quantity: Quantity) -> NDArray[np.float64]:
    """A plain rectangular block of comma-separated SI numbers, shape (rows, columns).

    Raises
    ------
    TableError
        If it is empty or ragged, or a cell is no finite number within the bounds.
    """
    lines = _lines(text)
    if not lines:
        raise TableError("the table is empty; write one row of comma-separated numbers per line")
    width = len(lines[0][1])
    for at, cells in lines:
        if len(cells) != width:
            raise TableError(f"line {at}: {len(cells)} cells where the first row has {width}; complete the row")
    return np.array([[_number(at, "value", cell, "", quantity) for cell in cells] for at, cells in lines])


def _lines(text: str) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of all lines that are neither empty nor comments."""
    lines = []
    for at, line in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                cells = next(csv.reader([line], skipinitialspace=True, strict=True))
            except csv.Error as fault:
                raise TableError(f"line {at}: cannot be read as comma-separated cells ({fault})") from None
            lines.append((at, [cell.strip() for cell in cells]))
    return lines


def _column(name: str, quantity: Quantity) -> str:
    return name if quantity.unit == "1" else f"{name} [{quantity.unit}]"


def _header(at: int, header: list[str], wanted: dict[str, Quantity], example: str) -> dict[str, tuple[int, str]]:
    """Place and unit of each wanted column, "" for SI."""
    split = [match for cell in header if (match := _HEADER.fullmatch(cell))]
    if len(split) != len(header):
        raise TableError(f'line {at}: a header cell cannot be read; write the header as "{example}"')
    names = [match["name"] for match in split]
    found = {}
    for name, quantity in wanted.items():
        if names.count(name) != 1:
            what = "is there twice" if name in names else "is missing"
            raise TableError(f'line {at}: column "{name}" {what}; write the header as "{example}"', names)
        place = names.index(name)
        found[name] = (place, _unit(at, name, split[place]["unit"], quantity))
    return found


def _unit(at: int, name: str, unit: str | None, quantity: Quantity) -> str:
    """A header's unit, checked; "" where the column is in SI."""
    if unit is None or (unit in ("", "1", "-") and quantity.unit == "1"):
        return ""
    free = Quantity(quantity.unit, quantity.meaning)  # one unit need not lie within the bounds
    try:
        if not re.match(r"[A-Za-zµμΩ°%]|1/", unit):
            raise ValueError(unit)
        free.read(f"1 {unit}")
    except ValueError:
        said = f'has a unit that is not a unit of {quantity.unit}; write the column as "{_column(name, quantity)}"'
        raise TableError(f'line {at}: column "{name}" {said}') from None
    return unit


def _number(at: int, name: str, cell: str, unit: str, quantity: Quantity) -> float:
    try:
        number = float(cell)
    except ValueError:
        said = "" if cell else " an empty cell,"
        raise TableError(f"line {at}: {name} is{said} not a number; write a plain number") from None
    try:
        return quantity.read(f"{number!r} {unit}" if unit else number)
    except ValueError as fault:
        raise TableError(f"line {at}: {name} {_words(fault)}") from None


def _words(fault: ValueError) -> str:
    """What a number must be, without the number, and without the example that does not fit a table."""
    text = fault.message() if isinstance(fault, PydanticCustomError) else str(fault)
    return re.split("; write for example|, not |: ", text)[0]


def file_text(name: str, context: Any) -> str:
    """Text of a file that a scenario names, for validators of its parts.

    Parameters
    ----------
    name : str
        Path, relative to the scenario.
    context : dict or None
        The validation's context; ``context["files"].text(name)`` reads beside the scenario. Without
        it the path is relative to the current directory.

    Raises
    ------
    PydanticCustomError
        If the file cannot be read, with the reason and a cure.
    """
    with _readable(name):
        return context["files"].text(name) if context and "files" in context else Path(name).read_text("utf-8")


def file_columns(name: str, context: Any, wanted: dict[str, Quantity]) -> dict[str, NDArray[np.float64]]:
    """Columns of a CSV file that a scenario names; arguments as of ``file_text`` and ``columns``."""
    try:
        return columns(file_text(name, context), wanted)
    except TableError as fault:
        raise file_fault(name, fault, context) from None


def file_fault(name: str, fault: Exception, context: Any) -> PydanticCustomError:
    """A fault of what a file holds; of libraries' messages the first line.

    Names that it has are shown only of a file in the scenario's folder: one elsewhere may be no table of who reads it.
    """
    reason = str(fault).partition("\n")[0]
    names = [one for one in getattr(fault, "names", ()) if _NAME.fullmatch(one)]
    folder = context["files"].folder if context and "files" in context else Path()
    if names and (folder / name).resolve().is_relative_to(folder.resolve()):
        reason += f" (found: {', '.join(names[:8])})"
    return PydanticCustomError("bad_table", "{file}: {reason}", {"file": name, "reason": reason})


def file_path(name: str, context: Any) -> Path:
    """Where a file that a scenario names lies; arguments and errors as ``file_text``."""
    with _readable(name):
        path = context["files"].path(name) if context and "files" in context else Path(name)
        open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb").close()  # a pipe is not waited for
        return path


@contextlib.contextmanager
def _readable(name: str) -> Iterator[None]:
    """A context in which trouble with a file that a scenario names is a fault of the scenario."""
    try:
        yield
    except UnicodeDecodeError:
        said = "{file} is not UTF-8 text; save it as plain CSV in UTF-8"
        raise PydanticCustomError("file_not_text", said, {"file": name}) from None
    except (OSError, ValueError) as fault:
        about = {"file": name[:200], "reason": getattr(fault, "strerror", None) or str(fault) or "not found"}
        said = "{file} cannot be read ({reason}); give a path relative to the scenario"
        raise PydanticCustomError("file_unreadable", said, about) from None
