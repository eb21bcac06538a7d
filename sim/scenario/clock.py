"""Clock, ensemble and records of a scenario."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.scenario.sweep import spaced
from sim.units.notation import Recorded
from sim.units.quantity import Quantity

_Duration = Annotated[float, Quantity("s", "duration of the run", "T", above=0)]
_MOST_RECORDS = 10_000_000
_MOST_STEPS = 10**9


@dataclass(frozen=True, config={"extra": "forbid"})
class Clock:
    """Duration, clock step and time between records; the first record is t = 0."""

    duration: _Duration
    step: Annotated[float, Quantity("s", "clock step", "dt", above=0)]
    record: Annotated[float, Quantity("s", "time between records", "", above=0)] | None = None

    @model_validator(mode="after")
    def _whole_multiples(self) -> "Clock":
        for name in ("record", "step"):
            if (getattr(self, name) or 0.0) > self.duration * (1.0 + 1e-9):
                message = f"{name} ({getattr(self, name):g} s) is longer than duration ({self.duration:g} s)"
                raise PydanticCustomError("clock", f"{message}; shorten it, or lengthen the run")
        if self.record is not None:
            _require_multiple("record", self.record, "step", self.step)
        word = "step" if self.record is None else "record"
        _require_multiple("duration", self.duration, word, self.record or self.step)
        if self.steps > _MOST_STEPS:
            raise PydanticCustomError("clock", f"has more than {_MOST_STEPS:,} steps; make step longer")
        if self.records > _MOST_RECORDS:
            raise PydanticCustomError("clock", f"has more than {_MOST_RECORDS:,} records; give a longer record")
        return self

    @property
    def steps(self) -> int:
        """Return the number of clock steps."""
        return round(self.duration / self.step)

    @property
    def stride(self) -> int:
        """Return the number of clock steps from one record to the next."""
        return round((self.record or self.step) / self.step)

    @property
    def records(self) -> int:
        """Return the number of records, with that at t = 0."""
        return self.steps // self.stride + 1

    @property
    def times(self) -> np.ndarray:
        """Return the times of the records [s], shape (records,); they are never accumulated."""
        return self.duration * (self.stride * np.arange(self.records) / self.steps)


def _require_multiple(name: str, long: float, other: str, short: float) -> None:
    """Refuse a time that is no whole multiple of another."""
    ratio = long / short
    if round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * ratio:
        return
    below, above = max(math.floor(ratio), 1) * short, (math.floor(ratio) + 1) * short
    cure = f"{above:g} s" if ratio < 1.0 else f"{below:g} s or {above:g} s"
    message = f"{name} ({long:g} s) must be a whole multiple of {other} ({short:g} s)"
    raise PydanticCustomError("clock", f"{message}, such as {cure}")


@dataclass(frozen=True, config={"extra": "forbid"})
class Ensemble:
    """Independent members of the ensemble, which share everything but their noise."""

    members: Annotated[int, Quantity("1", "members of the ensemble", at_least=1, at_most=10**7, whole=True)] = 1


def _times(value: Any) -> Any:
    """Return the times of a range, and anything else as it is."""
    return spaced(value) if isinstance(value, dict) else value


@dataclass(frozen=True, config={"extra": "forbid"})
class Record:
    """Content of the dataset: each member or the ensemble's mean, spread and standard error; maps at given times."""

    per_member: Annotated[
        bool | None,
        Field(
            description="record every member; false: mean, standard deviation and standard error; if omitted: every"
            " member, unless the file would exceed 20 GB"
        ),
    ] = None
    maps: Annotated[
        tuple[Annotated[float, Quantity("s", "times of stress maps, a list or { from, to, count }", at_least=0)], ...],
        BeforeValidator(_times, list[float | str] | dict[str, float | str]),
    ] = ()
    map_members: Annotated[int, Quantity("1", "members with recorded maps", at_least=1, at_most=10**4, whole=True)] = 1
    quantities: Annotated[
        tuple[Recorded, ...] | None, Field(description="quantities to record beside contact_radius; if omitted: all")
    ] = None
    precision: Annotated[Literal["float64", "float32"], Field(description="of trajectories in the file")] = "float64"
    compression: Annotated[
        Literal["none", "zlib", "digits"], Field(description="of trajectories in the file; digits: zlib of six digits")
    ] = "zlib"

    def keeps(self, name: str) -> bool:
        """Return True if a quantity is recorded; the contact radius always is."""
        return self.quantities is None or name in ("contact_radius", *self.quantities)
