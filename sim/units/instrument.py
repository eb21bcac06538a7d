"""Files as instruments write them: the head, columns by number, decimal commas, encodings, units, stretches of time.

Nothing is guessed. The table ``[instrument]`` of a scenario names each column by its number, with the unit that its
numbers really have, because the heading of an instrument may be wrong. The file becomes a table with a header, whose
rows keep their lines, so that a fault names the line of the file.
"""

import codecs
import math
import re
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity, keyed

#: A column by its number: "2: normal_load [nm * 3.01 N/m]".
_COLUMN = re.compile(
    r"\s*(?P<number>\d+)\s*:\s*(?P<name>\w+)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*"
)
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
#: A unit times a factor that may have a unit, too: "nm * 3.01 N/m".
_SCALED = re.compile(
    rf"(?P<unit>[^*]*?)\s*\*\s*(?P<factor>{_NUMBER})\s*(?P<other>.*?)\s*"
)
_SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "blank": None}
_TIME = Quantity("s", "time")


def same_line_ends(text: str) -> str:
    """Return a text in which each line ends as on Linux, because Windows and old spreadsheets end lines otherwise."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


class ColumnOfFile(NamedTuple):
    """A column of a file: its ``place`` from 0, its name, the unit of its numbers, and a factor to multiply them by."""

    place: int
    name: str
    unit: str
    factor: float

    @property
    def heading(self) -> str:
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def _column(text: str) -> ColumnOfFile:
    """Return the column of a text such as ``"2: normal_load [nm * 3.01 N/m]"``.

    >>> _column("2: normal_load [nm * 3.01 N/m]")
    ColumnOfFile(place=1, name='normal_load', unit='nm*N/m', factor=3.01)
    """
    match = _COLUMN.fullmatch(text)
    if not match or int(match["number"]) == 0:
        cure = 'write its number from 1, its name and its unit, such as "3: t [s]"'
        raise PydanticCustomError(
            "column", f'"{text[:40]}" is no column of a file; {cure}'
        )
    unit, factor = (match["unit"] or "").strip(), 1.0
    if scaled := _SCALED.fullmatch(unit):
        unit = "*".join(filter(None, (scaled["unit"], scaled["other"])))
        factor = float(scaled["factor"])
    return ColumnOfFile(int(match["number"]) - 1, match["name"], unit, factor)


@keyed(kw_only=True)
class Instrument:
    """Form of the files of measured curves that a fit reads, if they are not tables with a header of names and units.

    Parameters
    ----------
    columns : tuple of str
        Each column that is read by its number, with its name and the unit of its numbers, ``"3: t [s]"``. A factor
        stands behind the unit: ``"2: normal_load [nm * 3.01 N/m]"`` is a deflection times a stiffness, and
        ``"1: displacement [um * -1]"`` is counted the other way. Without columns the file has a header itself.
    marker : str
        Beginning of the last line of the head.
    skip : int
        Lines of the head, beside a marker those behind it.
    encoding, separator, decimal : str
        Encoding of the text, ``tab``, ``semicolon``, ``comma`` or ``blank`` between cells, sign of decimals.
    stretch, baseline : tuple of str
        Times ``"FROM:TO"`` of the rows that are fitted, and of those before the contact, which have the zero of the
        load and its noise. Each has one text for all files, or one for each file of a fit in turn.
    every : int
        Every so many rows one is fitted, beside those at which the mount turns.
    """

    columns: Annotated[
        tuple[str, ...],
        Field(
            description='columns by number, with name and unit, such as "3: t [s]" or "2: normal_load [nm * 3 N/m]"'
        ),
    ] = ()
    marker: Annotated[
        str, Field(description="beginning of the last line of the head")
    ] = ""
    skip: Annotated[
        int,
        Quantity(
            "1",
            "lines of the head, beside a marker those behind it",
            at_least=0,
            whole=True,
        ),
    ] = 0
    encoding: Annotated[
        str, Field(description='encoding of the text, such as "latin-1"')
    ] = "utf-8"
    separator: Annotated[
        Literal["tab", "semicolon", "comma", "blank"],
        Field(description="sign between cells, with columns by number"),
    ] = "tab"
    decimal: Annotated[
        Literal[".", ","],
        Field(description="sign of decimals, with columns by number"),
    ] = "."
    stretch: Annotated[
        tuple[str, ...],
        Field(
            description='times "FROM:TO" of the rows that are fitted, one or one a file'
        ),
    ] = ()
    baseline: Annotated[
        tuple[str, ...],
        Field(
            description='times "FROM:TO" before the contact, which have its zero and noise, one or one a file'
        ),
    ] = ()
    every: Annotated[
        int,
        Quantity("1", "rows, of which one is fitted", at_least=1, whole=True),
    ] = 1

    @model_validator(mode="after")
    def _readable(self) -> "Instrument":
        try:
            codecs.lookup(self.encoding)
        except LookupError:
            cure = 'write for example "utf-8", "latin-1" or "utf-16"'
            raise PydanticCustomError(
                "encoding", f'the encoding "{self.encoding[:40]}" is unknown; {cure}'
            ) from None
        if self.separator == "comma" and self.decimal == ",":
            fault = "decimal and separator are both a comma; correct one of them"
            raise PydanticCustomError("decimal", fault)
        places = [column.place for column in self._columns]
        names = [column.name for column in self._columns]
        for values in (places, names):
            if len({*values}) < len(values):
                raise PydanticCustomError(
                    "columns", "columns has a number or a name twice; give each once"
                )
        for text in (*self.stretch, *self.baseline):
            _times(text)
        return self

    @property
    def _columns(self) -> list[ColumnOfFile]:
        return [_column(text) for text in self.columns]

    def _decoded(self, content: bytes) -> str:
        """Return the text of a file; ``ValueError`` names the line that is none in this encoding."""
        try:
            text = content.decode(self.encoding)
        except UnicodeDecodeError as fault:
            line = content.count(b"\n", 0, fault.start) + 1
            cure = 'give instrument.encoding, such as "latin-1"'
            raise ValueError(
                f"line {line}: is no text in {self.encoding}; {cure}"
            ) from None
        return same_line_ends(text.removeprefix("\ufeff"))

    def table(self, content: bytes) -> tuple[str | None, str]:
        """Return the header of a file, None if it has one itself, and its rows, each on its line of the file.

        Raises
        ------
        ValueError
            With the line, the column and the cure.
        """
        lines = self._decoded(content).split("\n")
        head = self._head(lines)
        columns, result = self._columns, [""] * head
        if not columns:
            return None, "\n".join([*result, *lines[head:]])
        for number, line in enumerate(lines[head:], head + 1):
            cells = self._cells(line) if line.strip() else []
            self._check_number(number, cells)
            row = [self._cell(number, cells, column) for column in columns if cells]
            result.append(";".join(row))
        return ",".join(column.heading for column in columns), "\n".join(result)

    def _head(self, lines: Sequence[str]) -> int:
        """Return the number of lines of the head."""
        if not self.marker:
            return self.skip
        for number, line in enumerate(lines, 1):
            if line.strip().startswith(self.marker):
                return number + self.skip
        cure = "write the beginning of the last line before the rows"
        raise ValueError(
            f'no line begins with instrument.marker "{self.marker[:40]}"; {cure}'
        )

    def _cells(self, line: str) -> list[str]:
        return [
            cell.strip().strip('"') for cell in line.split(_SEPARATORS[self.separator])
        ]

    def _check_number(self, line: int, cells: Sequence[str]) -> None:
        """Refuse a line with fewer cells than the columns need."""
        last = max(self._columns)
        if cells and last.place >= len(cells):
            place = f"line {line}, column {last.place + 1} ({last.name})"
            cure = (
                "correct instrument.columns, instrument.separator or instrument.marker"
            )
            fault = f'the line has {len(cells)} columns by separator "{self.separator}"'
            raise ValueError(f"{place}: {fault}; {cure}")

    def _cell(self, line: int, cells: Sequence[str], column: ColumnOfFile) -> str:
        """Return the text of a number with a decimal point, times the factor of its column."""
        place = f"line {line}, column {column.place + 1} ({column.name})"
        text = cells[column.place]
        if self.decimal == "," and "." not in text:
            text = text.replace(",", ".")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            other = "," if self.decimal == "." else "."
            cure = "correct instrument.marker or skip, or omit the line"
            if other in text:
                cure = f'if "{other}" is its decimal sign, set instrument.decimal = "{other}"'
            raise ValueError(f"{place}: is no finite number; {cure}")
        return text if column.factor == 1.0 else repr(number * column.factor)

    def times(self, name: str, place: int, files: int) -> tuple[float, float] | None:
        """Return both ends of the ``stretch`` or ``baseline`` of a file of a fit [s]; None if it has none."""
        texts = getattr(self, name)
        if len(texts) not in (0, 1, files):
            raise ValueError(
                f"instrument.{name} has {len(texts)} stretches for {files} files; give one, or one for each file"
            )
        if not texts:
            return None
        return _times(texts[place] if len(texts) > 1 else texts[0])


def _times(text: str) -> tuple[float, float]:
    """Return both times of a text ``"FROM:TO"`` [s]."""
    first, _, last = text.partition(":")
    low, high = (_TIME.read(end.strip()) for end in (first, last))
    if not low < high:
        raise PydanticCustomError(
            "times", f'"{text[:40]}" has no time; write the earlier one first'
        )
    return low, high


@keyed(kw_only=True)
class Zero:
    """Zeros of the instrument: readings of displacement, indentation and load at which the true value is zero.

    A true value is the reading less the zero, less the drift times the time since the first row of the stretch. The
    numbers enter fits alone, by what was measured; a run does not read them.
    """

    displacement: Annotated[
        float, Quantity("m", "reading of the displacement at its zero", "Δ_0")
    ] = 0.0
    indentation: Annotated[
        float, Quantity("m", "reading of the indentation at its zero", "δ_0")
    ] = 0.0
    load: Annotated[float, Quantity("N", "reading of the load at its zero", "P_0")] = (
        0.0
    )
    displacement_drift: Annotated[
        float, Quantity("m/s", "speed at which the zero of the displacement moves")
    ] = 0.0
    indentation_drift: Annotated[
        float, Quantity("m/s", "speed at which the zero of the indentation moves")
    ] = 0.0
    load_drift: Annotated[
        float, Quantity("N/s", "rate at which the zero of the load moves")
    ] = 0.0

    def at(self, name: str, elapsed: Any) -> Any:
        """Return the reading of a variable at its zero, at some times since the first row [s]; 0 if it has no zero."""
        key = {"normal_load": "load"}.get(name, name)
        if key not in ("displacement", "indentation", "load"):
            return 0.0
        return getattr(self, key) + getattr(self, f"{key}_drift") * elapsed


class Reading(NamedTuple):
    """One reading of the instrument and its standard error [SI]; ``name`` is that of its variable."""

    name: str
    value: float
    error: float


@keyed(kw_only=True)
class JumpIn:
    """Readings of the instrument at the jump into contact, which a fit of loops compares with the jump of the model.

    They are data beside the curves. A run does not read them. Each list has one value for all files of a fit, or one
    for each file in turn.
    """

    displacement: Annotated[
        tuple[
            Annotated[float, Quantity("m", "reading of the displacement at the jump")],
            ...,
        ],
        Field(
            description="readings of the displacement or indentation at which the contact closes, one or one a file"
        ),
    ] = ()
    displacement_error: (
        Annotated[float, Quantity("m", "standard error of the displacement", above=0)]
        | None
    ) = None
    load: Annotated[
        tuple[
            Annotated[float, Quantity("N", "reading of the load after the jump")], ...
        ],
        Field(
            description="readings of the load right after the jump, one or one a file"
        ),
    ] = ()
    load_error: (
        Annotated[float, Quantity("N", "standard error of the load", above=0)] | None
    ) = None

    @model_validator(mode="after")
    def _with_errors(self) -> "JumpIn":
        if not self.displacement and not self.load:
            fault = "has no reading"
            cure = (
                'give displacement = ["2.5 um"] or load = ["-40 nN"], or omit the table'
            )
            raise PydanticCustomError("jump_in", f"{fault}; {cure}")
        for name in ("displacement", "load"):
            if bool(getattr(self, name)) != (
                getattr(self, f"{name}_error") is not None
            ):
                fault = f"{name} and {name}_error belong together"
                raise PydanticCustomError(
                    "jump_in", f"{fault}; give both, or omit both"
                )
        return self

    def readings(self, place: int, files: int) -> tuple[Reading, ...]:
        """Return the readings of a file of a fit; ``ValueError`` if their number is not that of the files."""
        result = []
        for name, variable in (
            ("displacement", "displacement"),
            ("load", "normal_load"),
        ):
            values, error = getattr(self, name), getattr(self, f"{name}_error")
            if len(values) not in (0, 1, files):
                fault = f"jump_in.{name} has {len(values)} readings for {files} files"
                raise ValueError(f"{fault}; give one, or one for each file")
            if values:
                value = values[place] if len(values) > 1 else values[0]
                result.append(Reading(variable, value, error))
        return tuple(result)
