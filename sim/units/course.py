"""What holds the sphere in time: a number, a way from one value to another and back, or a table."""

import math
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity
from sim.units.table import TableError, columns, file_text

_TIME = Quantity("s", "time", "t")


def _course(quantity: Quantity) -> type:
    """The class of a course of a quantity."""

    @dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
    class Course:
        """From one value to another over the run, or ``cycles`` times there and back."""

        start: Annotated[float, quantity, Field(alias="from")]
        stop: Annotated[float, quantity, Field(alias="to")]
        scale: Literal["linear", "log"] = "linear"
        cycles: Annotated[int, Field(ge=0, le=10**6, description="cycles there and back; 0: one way")] = 0

        @model_validator(mode="after")
        def _log_needs_one_sign(self) -> "Course":
            if self.scale == "log" and self.start * self.stop <= 0.0:
                raise PydanticCustomError(
                    "log_through_zero",
                    'a logarithmic course cannot reach or pass zero; give two values above zero or scale = "linear"',
                )
            return self

        def at(self, time: float, duration: float) -> float:
            """The value at a time of a run of ``duration`` [s]."""
            part = time / duration if duration > 0.0 else 0.0
            if self.cycles:
                turn = 2.0 * self.cycles * part % 2.0
                part = turn if turn <= 1.0 else 2.0 - turn
            if self.scale == "log":
                return self.start * (self.stop / self.start) ** part
            value = self.start + (self.stop - self.start) * part
            # a course that reaches zero but for rounding reaches it: there a free sphere touches
            return value if abs(value) > 1e-13 * max(abs(self.start), abs(self.stop)) else 0.0

        @property
        def lowest(self) -> float:
            """The least value on the way."""
            return min(self.start, self.stop)

    return Course


def _table(quantity: Quantity, name: str) -> type:
    """The class of a table of a quantity over time."""

    @dataclass(frozen=True, config={"extra": "forbid"})
    class Values:
        """A value tabulated over time, linear between the rows; ``file`` names the CSV."""

        time: tuple[Annotated[float, _TIME], ...]
        value: tuple[Annotated[float, quantity], ...]
        file: str = ""

        @model_validator(mode="before")
        @classmethod
        def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
            if not isinstance(values, dict) or not isinstance(values.get("file"), str) or "time" in values:
                return values
            try:
                found = columns(file_text(values["file"], info.context), {"time": _TIME, name: quantity})
            except TableError as fault:
                said = {"file": values["file"], "said": str(fault)}
                raise PydanticCustomError("table", "{file}: {said}", said) from None
            return {**values, "time": found["time"], "value": found[name]}

        @model_validator(mode="after")
        def _rows_in_order(self) -> "Values":
            if len(self.time) != len(self.value):
                raise PydanticCustomError("short_table", "a table needs as many values as times")
            if len(self.time) < 2:
                raise PydanticCustomError("short_table", "a table needs two rows or more")
            if np.any(np.diff(self.time) < 0.0) or self.time[0] > 0.0:
                raise PydanticCustomError("time_order", "times must start at 0 s or before and never decrease")
            return self

        @cached_property
        def _knots(self) -> tuple[np.ndarray, np.ndarray]:
            return np.array(self.time), np.array(self.value)

        def at(self, time: float, duration: float) -> float:
            """The value at a time [s]; the last one after the table's end."""
            return float(np.interp(time, *self._knots))

        @property
        def lowest(self) -> float:
            """The least value in the table."""
            return min(self.value)

    return Values


def _kind(value: Any) -> str:
    if isinstance(value, dict):
        return "[table]" if "file" in value or "time" in value else "[course]"
    if hasattr(value, "cycles"):
        return "[course]"
    return "[table]" if hasattr(value, "lowest") else "[value]"


def held(quantity: Quantity, name: str) -> Any:
    """Annotation of something that holds the sphere: a number, a course or a table."""
    number = Annotated[float, quantity, Tag("[value]")]
    course, table = Annotated[_course(quantity), Tag("[course]")], Annotated[_table(quantity, name), Tag("[table]")]
    return Annotated[number | course | table, Discriminator(_kind)]


def value_at(control: Any, time: float, duration: float) -> float:
    """What a control is at a time of a run of ``duration`` [s]."""
    return control.at(time, duration) if hasattr(control, "at") else control


def lowest(control: Any) -> float:
    """The least value that a control takes; infinite where there is none."""
    if control is None:
        return math.inf
    return control.lowest if hasattr(control, "at") else control
