"""Tables from CSV text: named columns with units in the header, and the files that hold them."""

import contextlib
import csv
import errno
import itertools
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import WrapValidator
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?\s*")
#: What a header's names look like; whatever else stands in a file is shown by no message.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_ .-]{0,19}")
_MOST_BYTES = 2**28
#: Characters of a table that are read together, and of a line at most.
_AT_ONCE, _LONGEST_LINE = 2**18, 2**23


class TableError(ValueError):
    """A table that cannot be read; the message names the line and the cure, not the file nor what stands in it.

    ``names`` are those that its header has in place of one that is wanted, ``cell`` the one at fault: to be shown only
    of a file that the user has named, as a scenario of somebody else's may name any.
    """

    def __init__(self, said: str, names: Iterable[str] = (), cell: str = ""):
        super().__init__(said)
        self.names, self.cell = tuple(names), cell


def columns(text: str, wanted: dict[str, Quantity], header: str | None = None) -> dict[str, NDArray[np.float64]]:
    """Named columns of a CSV text in SI units.

    Parameters
    ----------
    text : str
        Cells with commas, semicolons or tabs between them. The first line that is neither empty nor a ``#``
        comment names the columns, each with its unit in brackets; a column without brackets is in SI
        units. Columns that nobody wants are ignored.
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
    example = ", ".join(_column(name, quantity) for name, quantity in wanted.items())
    found: dict[str, tuple[int, str]] = {}
    parts: dict[str, list[NDArray[np.float64]]] = {name: [] for name in wanted}
    number, names = 0, list[str]()
    for lines, rows in _rows(text):
        if not names:
            number, names, at_top = lines[0], rows[0], f"line {lines[0]}"
            if header is not None and _are_numbers(names):
                if not header:
                    said = "the columns have no header; add one, or name it by the key header"
                    raise TableError(f'{at_top}: {said}, such as header = "{example}"')
                names, at_top = header.split(","), "header"
            elif header:
                raise TableError(f"{at_top}: the columns have a header of their own; leave the key header out")
            else:
                del lines[0], rows[0]
            names = [cell.strip() for cell in names]
            found = _header(at_top, names, wanted, example)
        if at := _ragged(lines, rows, len(names)):
            said = f"line {at[0]}: {at[1]} cells where the header has {len(names)}"
            raise TableError(f"{said}; separate cells by commas, write decimals with a point")
        for name, (place, unit) in found.items():
            parts[name].append(_numbers(name, lines, [row[place] for row in rows], unit, wanted[name]))
    if not names:
        raise TableError(f'the table is empty; begin with a header such as "{example}", then rows of numbers')
    columns = {name: np.concatenate(several) for name, several in parts.items()}
    if not all(map(len, columns.values())):
        raise TableError(f"line {number}: no rows follow the header; add rows of numbers below it")
    return columns


def headings(text: str) -> dict[str, str]:
    """Names of the columns of a CSV text with the texts of their units, "" for a column without one.

    Raises
    ------
    TableError
        If there is no header, or it cannot be read or has a name twice.

    >>> headings("speed [mm/s], share\\n1, 2")
    {'speed': 'mm/s', 'share': ''}
    """
    for lines, rows in _rows(text):
        split = [_HEADER.fullmatch(cell) for cell in rows[0]]
        names = [match["name"] for match in split if match]
        if len(names) < len(split) or not all(names) or len({*names}) < len(names):
            raise TableError(f"line {lines[0]}: the header needs one name a column, each once, its unit in brackets")
        return {match["name"]: match["unit"] or "" for match in split if match}
    raise TableError("the table is empty; begin with a header of names and units, then rows of numbers")


def matrix(text: str, quantity: Quantity, gaps: bool = False) -> NDArray[np.float64]:
    """A plain rectangular block of SI numbers, separated as in ``columns`` or by blanks, shape (rows, columns).

    With ``gaps`` some may be nan.

    Raises
    ------
    TableError
        If it is empty or ragged, or a cell is no finite number within the bounds.
    """
    width, parts = 0, []
    for lines, rows in _rows(text):
        width = width or len(rows[0])
        if at := _ragged(lines, rows, width):
            raise TableError(f"line {at[0]}: {at[1]} cells where the first row has {width}; complete the row")
        cells = list(itertools.chain.from_iterable(rows))
        parts.append(_numbers("value", np.repeat(lines, width), cells, "", quantity, gaps))
    if not parts:
        raise TableError("the table is empty; write one row of comma-separated numbers per line")
    return np.concatenate(parts).reshape(-1, width)


def _rows(text: str) -> Iterator[tuple[list[int], list[list[str]]]]:
    """Line numbers and cells of all lines that are neither empty nor comments, some thousands at a time."""
    start, number, sign = len(text) - len(text.removeprefix("\ufeff")), 1, ""
    while start < len(text):
        end = text.find("\n", start + _AT_ONCE) + 1 or len(text)
        if end - start > _LONGEST_LINE:
            raise TableError(f"a line after line {number} is longer than {_LONGEST_LINE:,} characters; break it")
        lines = text[start:end].splitlines()
        found = [at for at, line in enumerate(lines, number) if (bare := line.lstrip()) and bare[0] != "#"]
        if found:
            sign = sign or _separator(lines[found[0] - number])
            yield found, [_cells(at, lines[at - number], sign) for at in found]
        start, number = end, number + len(lines)


def _separator(line: str) -> str:
    """The sign between the cells of a table, by its first line: blanks only between plain numbers."""
    blank = " " if _are_numbers(line.split()) else ","
    return next((sign for sign in ";,\t" if sign in line), blank)


def _are_numbers(cells: list[str]) -> bool:
    try:
        return len(list(map(float, cells))) > 0
    except ValueError:
        return False


def _cells(at: int, line: str, sign: str) -> list[str]:
    """The cells of a line, some of them perhaps quoted."""
    if '"' not in line:
        return line.split(sign.strip(" ") or None)
    try:
        return next(csv.reader([line], delimiter=sign, skipinitialspace=True, strict=True))
    except csv.Error as fault:
        raise TableError(f"line {at}: cannot be read as separated cells ({fault})") from None


def _ragged(lines: list[int], rows: list[list[str]], width: int) -> tuple[int, int] | None:
    """Line and number of cells of the first row that has not as many as are due."""
    if set(map(len, rows)) <= {width}:
        return None
    return next((at, len(row)) for at, row in zip(lines, rows, strict=True) if len(row) != width)


def _column(name: str, quantity: Quantity) -> str:
    return name if quantity.unit == "1" else f"{name} [{quantity.unit}]"


def _header(at: str, header: list[str], wanted: dict[str, Quantity], example: str) -> dict[str, tuple[int, str]]:
    """Place and unit of each wanted column, "" for SI; ``at`` is where the header stands."""
    split = [match for cell in header if (match := _HEADER.fullmatch(cell))]
    if len(split) != len(header):
        raise TableError(f'{at}: a header cell cannot be read; write the header as "{example}"')
    names = [match["name"] for match in split]
    found = {}
    for name, quantity in wanted.items():
        if names.count(name) != 1:
            what = "is there twice" if name in names else "is missing"
            raise TableError(f'{at}: column "{name}" {what}; write the header as "{example}"', names)
        place = names.index(name)
        found[name] = (place, _unit(at, name, split[place]["unit"], quantity))
    return found


def _unit(at: str, name: str, unit: str | None, quantity: Quantity) -> str:
    """A header's unit, checked; "" where the column is in SI."""
    if unit is None or (unit in ("", "1", "-") and quantity.unit == "1"):
        return ""
    free = Quantity(quantity.unit, quantity.meaning, mistaken=quantity.mistaken)  # one unit may exceed the bounds
    try:
        if not re.match(r"[A-Za-zµμΩ°%]|1\s*/", unit):
            raise ValueError(unit)
        free.read(f"1 {unit}")
    except ValueError as fault:
        said = f'has a unit that is not a unit of {quantity.unit}; write the column as "{_column(name, quantity)}"'
        if isinstance(fault, PydanticCustomError) and fault.type in ("no_angle", "mistaken"):
            said = fault.message()
        raise TableError(f'{at}: column "{name}" {said}') from None
    return unit


def _numbers(
    name: str, lines: Iterable[int], cells: list[str], unit: str, quantity: Quantity, gaps: bool = False
) -> NDArray[np.float64]:
    """The numbers in cells of some lines, in SI: all at once, or where that fails one by one to say what is wrong."""
    try:
        with np.errstate(over="ignore"):
            numbers = quantity.scaled(np.array(list(map(float, cells))), unit)
        _sound(numbers[~np.isnan(numbers)] if gaps else numbers, quantity)
        return numbers
    except ValueError:
        each = zip(lines, cells, strict=True)
        return np.array([_number(at, name, cell.strip(), unit, quantity, gaps) for at, cell in each])


def _sound(numbers: NDArray[np.float64], quantity: Quantity) -> NDArray[np.float64]:
    """The numbers, where the least and the largest of them, which are nan if any is, can be read."""
    for end in (numbers.min(), numbers.max()) if numbers.size else ():
        quantity.read(float(end))
    return numbers


def at_once(quantity: Quantity) -> WrapValidator:
    """Checks an array of numbers as a whole, and what is none, or not sound, number by number."""

    def check(values: Any, each: Callable[[Any], tuple[float, ...]]) -> tuple[float, ...]:
        if isinstance(values, np.ndarray) and values.dtype == float and values.ndim == 1:
            with contextlib.suppress(ValueError):
                return tuple(_sound(values, quantity).tolist())
        return each(values)

    return WrapValidator(check)


def _number(at: int, name: str, cell: str, unit: str, quantity: Quantity, gaps: bool) -> float:
    try:
        number = float(cell)
    except ValueError:
        said, cure = "" if cell else " an empty cell,", ", decimals with a point" if "," in cell else ""
        cure = cure if cell else ", or leave the row out"
        raise TableError(f"line {at}: {name} is{said} not a number; write a plain number{cure}", cell=cell) from None
    if number != number:
        if gaps:
            return number
        raise TableError(f"line {at}: {name} is nan; write a plain number, or leave the row out", cell=cell)
    try:
        return quantity.read(f"{number!r} {unit}" if unit else number)
    except ValueError as fault:
        raise TableError(f"line {at}: {name} {_words(fault)}", cell=cell) from None


def _words(fault: ValueError) -> str:
    """What a number must be, without the number, and without the example that does not fit a table."""
    text = fault.message() if isinstance(fault, PydanticCustomError) else str(fault)
    return re.split("; write for example|, not |: ", text)[0]


def plain_text(path: Path) -> str:
    """Text of a plain file of at most 256 MiB; nothing of the system's without a size, such as /proc/kmsg."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), encoding="utf-8") as file:  # a pipe is not waited for
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "it is no plain file")
        if found.st_size > _MOST_BYTES:
            raise OSError(errno.EFBIG, f"it is larger than {_MOST_BYTES // 2**20} MiB")
        return file.read(found.st_size)


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
        return context["files"].text(name) if context and "files" in context else plain_text(Path(name))


def file_columns(
    name: str, context: Any, wanted: dict[str, Quantity], header: str | None = None
) -> dict[str, NDArray[np.float64]]:
    """Columns of a CSV file that a scenario names; arguments as of ``file_text`` and ``columns``."""
    try:
        return columns(file_text(name, context), wanted, header)
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
