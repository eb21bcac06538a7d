"""The state of a page and its answers: sliders of a scenario, curves of steady sliding, and sentences about them."""

import contextlib
import functools
import math
import secrets
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sim.ensemble.diagnosis import diagnosis, over_band, remarks
from sim.ensemble.plan import Plan, seconds_a_step
from sim.ensemble.steady import sensitivities
from sim.explorer.drawing import listed
from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.scenario.schema import entries, quantities
from sim.scenario.sweep import rows
from sim.study.curves import curves, speeds_of_loss
from sim.units.errors import BadInput
from sim.units.notation import engineering, scaled
from sim.units.quantity import Quantity

if TYPE_CHECKING:
    from sim.study.likelihood import Measured

#: Points of a curve, and speeds at which a key is tried; change of a curve that counts.
_POINTS, _TRIED, _CHANGE = 121, 9, 1e-9
#: Tables whose numbers do not change the curves, and those of the numerics of a table.
_NO_SLIDERS = ("clock", "drive", "ensemble", "instrument", "record", "seed", "zero")
#: Ends of a slider over the value of its key: of a positive key, and of one that may be zero.
_FACTOR, _TIMES = 30.0, 4.0
#: Loads of further curves over the scenario's; members of the band, and time that it may take [s].
_LOADS, _FEW, _QUICK = (0.25, 4.0), 8, 0.05
#: Keys that matter most for the area and are marked; tables that are kept.
_MARKED, _KEPT = 3, 8
#: Curves of the page that are not shares of an area, with their SI unit.
_UNITS = {
    "work_of_adhesion": "J/m^2",
    "fluctuation_energy": "J/m^2",
    "friction_force": "N",
    "contact_area": "m^2",
}


class Slider(NamedTuple):
    """A number of the scenario that changes the curves: where it starts [SI], and between which ends it slides.

    ``over_wavelength`` is the ratio of a correlation length to the wavelength of the same energy; None of any other
    number.
    """

    key: str
    meaning: str
    symbol: str
    unit: str
    value: float
    text: str
    low: float
    high: float
    logarithmic: bool
    marked: bool
    over_wavelength: float | None


class Refused(ValueError):
    """Values that cannot be used, with a message for each key."""

    def __init__(self, faults: dict[str, str]) -> None:
        super().__init__("; ".join(f"{key} {reason}" for key, reason in faults.items()))
        self.faults = faults


class Page:
    """A scenario that is explored: its sliders, and what it shows for their values.

    Parameters
    ----------
    scenario : Scenario
        What is explored; of a sweep the first point.
    data : Path, optional
        A table of measured curves that is shown from the start.

    Raises
    ------
    BadInput
        If the table cannot be read.
    """

    def __init__(self, scenario: Scenario, data: Path | None = None) -> None:
        self._asked, self.tables = scenario, dict[str | None, "Measured"]()
        self.scenario = scenario.points()[0].with_values({})
        self.speeds = _speeds(self.scenario)
        self.sliders = list(self._sliders())
        self._times: list[float] = []
        self._first = None if data is None else self.add(data, str(data))

    def start(self) -> dict[str, Any]:
        """Return what the page needs once: title, sliders, and why its curves are a preview alone."""
        return {
            "title": self.scenario.name,
            "sliders": [slider._asdict() for slider in self.sliders],
            "preview": list(previews(self.scenario)),
            "members": self.scenario.ensemble.members,
            "data": self._first,
        }

    def read(self, values: Mapping[str, Any], built: bool = True) -> Scenario:
        """Return the scenario with numbers [SI], or text with units, by key; ``built`` as of ``Scenario.with_values``.

        Raises
        ------
        Refused
            With a message for each key whose value cannot be used, and one for "" if values do not go together.
        """
        known, faults, changed = quantities(self.scenario), {}, dict[str, float]()
        for key, value in values.items():
            try:
                number = known[key][0].read(value)
            except KeyError:
                faults[key[:80]] = "is no slider of this page"
            except ValueError as fault:
                faults[key] = str(fault)
            else:
                changed |= {key: number} if number != known[key][1] else {}
        if faults:
            raise Refused(faults)
        try:
            return self.scenario.with_values(changed, built)
        except BadInput as fault:
            raise Refused({"": "; ".join(fault.problems)}) from None

    def answer(
        self,
        values: Mapping[str, Any],
        share: float,
        loads: bool = False,
        table: str | None = None,
    ) -> dict[str, Any]:
        """Return curves [SI] for values of the sliders, and the speeds at which a share of the area is lost in words.

        ``loads`` adds curves at other loads, ``table`` the points of a table by its name.
        """
        scene = self.read(values, built=False)
        now, columns = quantities(scene), curves(scene, self.speeds)
        largest = {
            name: float(np.nanmax(np.abs(columns[name]), initial=0.0))
            for name in _UNITS
        }
        energies = ("work_of_adhesion", "fluctuation_energy")
        largest |= dict.fromkeys(energies, max(largest[name] for name in energies))
        crossings = speeds_of_loss(scene, share, self.speeds)
        result: dict[str, Any] = {
            "values": {
                key: (now[key][1], engineering(now[key][1], unit))
                for key, _, _, unit, *_ in self.sliders
            },
            "speed": self.speeds.tolist(),
            "curves": {name: listed(column) for name, column in columns.items()},
            "units": {
                name: scaled(largest[name], unit) for name, unit in _UNITS.items()
            },
            "level": {"speeds": crossings, "words": _loss(scene, share, crossings)},
        }
        result["units"]["speed"] = scaled(
            float(np.sqrt(self.speeds[0] * self.speeds[-1])), "m/s"
        )
        if loads and scene.contact.load is not None and not scene.contact.changes:
            result["loads"] = list(self._other_loads(scene))
        if measured := self.tables.get(table):
            from sim.explorer.data import compared

            result["data"] = compared(scene, measured)
        return result

    def _other_loads(self, scene: Scenario) -> Iterator[dict[str, Any]]:
        """Yield other loads, with their curves, at which the scenario can be run."""
        for load in (factor * float(scene.contact.load or 0.0) for factor in _LOADS):
            with contextlib.suppress(BadInput):
                other = curves(scene.with_values({"contact.load": load}), self.speeds)
                drawn = {
                    name: listed(other[name])
                    for name in ("contact_area", "area_ratio", "friction_force")
                }
                yield {"load": engineering(load, "N"), "curves": drawn}

    def band(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the band of a few members of the scenario's own models; empty if that takes too long to follow."""
        from sim.explorer.job import ensemble

        scenes = self.scenes(values, min(_FEW, self.scenario.ensemble.members))
        estimate = sum(
            scene.clock.steps * seconds_a_step(scene, scene.ensemble.members)
            for scene in scenes
        )
        # the first run also loads and compiles, and the estimate is rough
        if estimate > 10.0 * _QUICK or (
            len(self._times) > 1 and min(self._times) > _QUICK
        ):
            return {}
        began = time.perf_counter()
        result = ensemble(scenes, lambda message: None)
        self._times = [*self._times[-1:], time.perf_counter() - began]
        return result

    def scenes(self, values: Mapping[str, Any], members: int) -> list[Scenario]:
        """Return what an ensemble runs: the scenario, at each speed of a sweep over the speed alone."""
        scene = self.read(dict(values) | {"ensemble.members": members})
        axes = self._asked.sweep
        if len(axes) == 1 and axes[0].keys == ("drive.speed",):
            return [
                scene.with_values({"drive.speed": speed}) for (speed,) in axes[0].values
            ]
        return [scene]

    def add(self, source: str | Path, name: str) -> str:
        """Read a table of measured curves, its text or a file, and return the name by which an ``answer`` shows it."""
        from sim.explorer.data import table_of

        key, table = secrets.token_hex(8), table_of(source, name, self.scenario)
        self.tables = dict([*self.tables.items()][1 - _KEPT :]) | {key: table}
        return key

    def toml(self, values: Mapping[str, Any]) -> str:
        """Return the scenario as TOML with values of the sliders."""
        from sim.explorer import take

        scene, known = self.read(values), quantities(self.scenario)
        changed = {
            key: value
            for key, (_, value) in quantities(scene).items()
            if value != known[key][1]
        }
        first = rows(self._asked.sweep)[0] if self._asked.sweep else {}
        return take.toml(self._asked, changed, self._asked.source.overrides | first)

    def take(self, values: Mapping[str, Any], kind: str) -> Any:
        """Return the curves for values of the sliders as a table for the kind "csv", else as a picture."""
        from sim.explorer import take

        scene = self.read(values)
        return (
            take.table(scene, self.speeds)
            if kind == "csv"
            else take.picture(scene, self.speeds, kind)
        )

    def words(self, values: Mapping[str, Any]) -> dict[str, list[str]]:
        """Return the diagnosis and the remarks of ``sim check`` for values of the sliders."""
        plan = Plan.of(self.read(values))
        return {"diagnosis": diagnosis(plan), "remarks": remarks(plan)}

    def _sliders(self) -> Iterator[Slider]:
        """Yield the sliders of all numbers that change a curve."""
        known = quantities(self.scenario)
        tried = np.geomspace(self.speeds[0], self.speeds[-1], _TRIED)
        before = curves(self.scenario, tried)
        middle = float(tried[len(tried) // 2])
        order = sorted(
            sensitivities(self.scenario, 0.0, middle).items(),
            key=lambda item: -abs(item[1][0]),
        )
        marked = [key for key, (area, _) in order if key != "speed" and area][:_MARKED]
        for key, (quantity, value) in known.items():
            known_to_stay = quantity.whole or key.partition(".")[0] in _NO_SLIDERS
            if known_to_stay or not _changes(self.scenario, key, tried, before):
                continue
            low, high, logarithmic = _ends(self.scenario, key, quantity, value)
            shown = (
                quantity.meaning,
                quantity.symbol,
                quantity.unit,
                value,
                engineering(value, quantity.unit),
            )
            more = (
                over_band(self.scenario.fluctuations.spectrum)
                if key == "shear.spectrum.length"
                else None
            )
            yield Slider(
                key,
                *shown,
                low,
                high,
                logarithmic,
                key in marked,
                None if more is None else 1.0 / more,
            )


def previews(scenario: Scenario) -> Iterator[str]:
    """Yield the reasons for which steady sliding is not what a scenario computes."""
    if scenario.drive.solves_motion:
        yield "the slider's motion is computed"
    elif scenario.drive.model not in ("steady", "ramp"):
        yield "the speed follows a course in time"
    if scenario.contact.changes:
        yield "what holds the sphere changes in time: the curves are those of its start"
    if scenario.fluctuations.passes:
        yield "a measured map passes under the contact"
    if ("bonds.area", "carried") in (
        (entry.key, entry.value) for entry in entries(scenario)
    ):
        yield "bonds keep the stretch of an area that the contact has lost"


def _speeds(scenario: Scenario) -> Array:
    """Return growing speeds [m/s] that the scenario passes through, and at least three decades around them."""
    speeds = np.abs(scenario.speeds(_POINTS))
    moving = speeds[speeds > 0.0]
    _, critical = quantities(scenario).get("bonds.critical_speed", (None, 1e-3))
    low, high = (
        (float(np.min(moving)), float(np.max(moving)))
        if moving.size
        else (critical, critical)
    )
    wider = math.sqrt(max(1.0, 1e3 / (high / low)))
    return np.geomspace(low / wider, high * wider, _POINTS)


def _changes(
    scenario: Scenario, key: str, speeds: Array, before: dict[str, Array]
) -> bool:
    """Return True if another value of a key, a little smaller or larger, changes a curve."""
    value = quantities(scenario)[key][1]
    for other in (0.99 * value, 1.01 * value) if value else (0.01, -0.01, 1e-6, -1e-6):
        try:
            after = curves(scenario.with_values({key: other}, built=False), speeds)
        except BadInput:
            continue
        close = functools.partial(np.allclose, rtol=_CHANGE, atol=0.0, equal_nan=True)
        return after.keys() != before.keys() or not all(
            close(after[name], before[name]) for name in before
        )
    return False


def _ends(
    scenario: Scenario, key: str, quantity: Quantity, value: float
) -> tuple[float, float, bool]:
    """Return the ends of a slider, and True if it is logarithmic."""
    lowest, highest = (
        max(quantity.above, quantity.at_least),
        min(quantity.below, quantity.at_most),
    )
    if math.isfinite(lowest) and math.isfinite(highest):
        return lowest, highest, False
    if quantity.above >= 0.0:
        return value / _FACTOR, min(value * _FACTOR, highest), True
    size = abs(value) or abs(
        Quantity(quantity.unit, "").read(quantity.example.strip('"'))
    )
    if lowest >= 0.0:
        return 0.0, _TIMES * size, False
    if key == "contact.load":
        pull_off = 1.5 * math.pi * scenario.adhesion.work * scenario.sphere.radius
        return -1.1 * pull_off, _TIMES * max(size, pull_off), False
    return -_TIMES * size, _TIMES * size, False


def _loss(scenario: Scenario, share: float, speeds: list[float]) -> str:
    """Return where a share of the area is lost, and to what, in words."""
    lost = f"{100.0 * share:.3g} %"
    if not speeds:
        return f"{lost} of the area is lost at no speed shown"
    at = curves(scenario, np.array(speeds[:1]))
    names = {
        "bonds": "lost_to_bonds",
        "fluctuations": "lost_to_fluctuations",
        "mean stress": "lost_to_mean_stress",
    }
    points = [
        f"{word} {100.0 * at[name][0]:.1f}"
        for word, name in names.items()
        if name in at
    ]
    others = [engineering(speed, "m/s") for speed in speeds[1:]]
    again = f"; again at {', '.join(others)}" if others else ""
    return f"{lost} lost at {engineering(speeds[0], 'm/s')}: {', '.join(points)} points{again}"
