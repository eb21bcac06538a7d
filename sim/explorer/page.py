"""The state of a page and its answers: sliders of a scenario, curves of steady sliding, and sentences about them."""

import contextlib
import difflib
import itertools
import math
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sim.ensemble.diagnosis import diagnosis, over_band, remarks
from sim.ensemble.plan import Plan, seconds_a_step
from sim.explorer import figures
from sim.explorer.drawing import listed
from sim.explorer.motion import Motions, course
from sim.numerics.files import output
from sim.parts.exchange import Array
from sim.scenario.files import question_of
from sim.scenario.reader import load
from sim.scenario.scenario import Scenario
from sim.scenario.schema import entries, quantities
from sim.scenario.sweep import rows
from sim.study.curves import curves, speeds_of_loss
from sim.units.errors import BadInput
from sim.units.notation import engineering, scaled
from sim.units.quantity import Quantity

if TYPE_CHECKING:
    from sim.study.measurement import Measured

#: Points of a curve, and speeds at which a key is tried; change of a curve that counts.
_POINTS, _TRIED, _CHANGE = 121, 9, 1e-9
#: Tables whose numbers have no slider, and one whose numbers change the motion alone.
_NO_SLIDERS = ("clock", "ensemble", "instrument", "record", "seed", "zero")
_DRIVE, _NUMERICS = "drive", ("drive.tolerance",)
#: Ends of a slider over the value of its key: of a positive key, and of one that may be zero.
_FACTOR, _TIMES = 30.0, 4.0
#: Factor by which a maximum of friction is above both ends of a curve.
_CLEAR = 1.01
#: Loads of further curves over the scenario's; most curves of other points of a sweep.
_LOADS, _MOST_OTHERS = (0.25, 4.0), 8
#: Length of the way of a quantity over its range, above which it is not drawn beside others.
_TURNS = 30.0
#: Longest time of the motions of other points [s].
_LONGEST = 8.0
#: Members of the band, and time that it may take by its number of steps [s].
_FEW, _QUICK = 8, 0.5
#: Records of all members up to which a motion is recorded at each clock step.
_RECORDS = 1_000_000
#: Keys that matter most for the area and are marked; tables that are kept.
_MARKED, _KEPT = 3, 8
#: Shares of the mechanisms in the work of adhesion; 0 switches a mechanism off.
_MECHANISMS = {
    "adhesion.bond_share": "broken bonds",
    "shear.paid_by_adhesion": "fluctuations",
    "contact.reversible": "mean stress",
}
#: Shares of the lost area that a mechanism has, by the order in which mechanisms are subtracted.
_LOST = {
    "bonds": ("lost_to_bonds", "lost_to_bonds_last"),
    "fluctuations": ("lost_to_fluctuations", "lost_to_fluctuations_first"),
    "mean stress": ("lost_to_mean_stress",),
}
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
        Scenario that is explored; of a sweep the numbers outside the table ``[sweep]``.
    data : Path, optional
        A table of measured curves that is shown from the start.

    Raises
    ------
    BadInput
        If the table cannot be read.
    """

    def __init__(self, scenario: Scenario, data: Path | None = None) -> None:
        self._asked, self.tables = scenario, dict[str | None, "Measured"]()
        self.sources = dict[str, tuple[str | Path, str]]()
        self.stamp = stamp_of(Path(scenario.source.path))
        self.scenario = scenario.with_values({})
        self.speeds = _speeds(self.scenario)
        self.axis = _axis(scenario)
        self.sliders = list(self._sliders())
        self.motions = Motions()
        self._moves = any(previews(self.scenario))
        self._map = _map(scenario)
        self._first = self._beside() if data is None else self.add(data, str(data))

    def _beside(self) -> str | None:
        """Return the name of the table of measured curves that stands beside the scenario under its name, if any."""
        source = self._asked.source.path
        if source and (path := Path(source).with_suffix(".csv")).is_file():
            # a file of a course, a map or a spectrum has no measured curve
            with contextlib.suppress(BadInput):
                key = self.add(path, path.name)
                return key if key in self.tables else None
        return None

    @property
    def path(self) -> str:
        """Path of the scenario's file, "" if it has none."""
        return self._asked.source.path

    @property
    def figures(self) -> list[str]:
        """Figures of the page, first the one that shows what the scenario computes."""
        if self._moves:
            result = [*(["map"] if self._map else []), "motion"]
        elif self.axis:
            result = ["sweep"]
        else:
            result = ["spread"] if self._spreads else []
        first = ["data"] if self._first in self.tables else []
        return [*first, *result, "speed", *([] if first else ["data"])]

    @property
    def _spreads(self) -> bool:
        """Return True if the scenario is about the spread of members at one speed."""
        return self.scenario.is_random and self.scenario.drive.model == "steady"

    def figure(
        self, values: Mapping[str, Any], figure: str, table: str | None = None
    ) -> dict[str, Any]:
        """Return the panels and the sentence of the figure "data", "spread" or "map"."""
        # predictions of steady sliding need none of what the members of a run need
        scene = self.read(values, built=figure != "data")
        if figure == "map" and self._map:
            return self._map.answer(scene, self._numbers(scene))
        if figure == "data" and (measured := self.tables.get(table)):
            return figures.measured(scene, measured)
        if figure == "spread":
            changes = list(self._other_points(scene, None))
            scenes = [scene, *(scene.with_values(change) for change in changes)]
            names = [_words_of(scene, change) for change in changes]
            return figures.spread(scenes, ["present numbers" if names else "", *names])
        return {"panels": [], "words": "There are no measured values"}

    def _numbers(self, scene: Scenario) -> dict[str, float]:
        known = quantities(scene)
        return {slider.key: known[slider.key][1] for slider in self.sliders}

    def start(self) -> dict[str, Any]:
        """Return what the page needs once, such as title, question, sliders, and points of the sweep."""
        known = quantities(self.scenario)
        points = [
            {
                key: known[key][0].read(value)
                for key, value in row.items()
                if key in known
            }
            for row in (rows(self._asked.sweep) if self._asked.sweep else [])
        ]
        return {
            "title": self.scenario.name,
            "question": question_of(self._asked.source.text)[0],
            "path": self._asked.source.path,
            "stamp": self.stamp,
            "sliders": [slider._asdict() for slider in self.sliders],
            "points": points if self._is_slidable(points) else [],
            "mechanisms": [
                {"key": key, "name": name, "on": known[key][1] or 1.0}
                for key, name in _MECHANISMS.items()
                if any(slider.key == key for slider in self.sliders)
            ],
            "figures": self.figures,
            "duration": self.scenario.clock.duration,
            "speed": float(np.abs(self.scenario.speeds(2)[-1]))
            or float(self.speeds[0]),
            "mount": self.scenario.contact.kind,
            "preview": list(previews(self.scenario)),
            "members": self.scenario.ensemble.members,
            "data": self._first,
            # of a single point there are no others
            "alone": not self._asked.sweep,
        }

    def _is_slidable(self, points: list[dict[str, float]]) -> bool:
        keys = {slider.key for slider in self.sliders}
        return bool(points) and all(point and point.keys() <= keys for point in points)

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
        figure: str = "speed",
        table: str | None = None,
    ) -> dict[str, Any]:
        """Return the curves [SI] of a figure, and where a share of the area is lost in words.

        The curves are over the sliding speed, or for the figure "sweep" over a number of the sweep at the scenario's
        own speed. ``table`` adds the points of a table by its name.
        """
        scene = self.read(values, built=False)
        measured = self.tables.get(table)
        swept = self.axis if figure == "sweep" else None
        x = self._places(swept, measured)
        columns = self._over(scene, swept, x)
        largest = {
            name: float(np.nanmax(np.abs(columns[name]), initial=0.0))
            for name in _UNITS
        }
        energies = ("work_of_adhesion", "fluctuation_energy")
        largest |= dict.fromkeys(energies, max(largest[name] for name in energies))
        ratio = columns["area_ratio"]
        crossings = [] if swept else speeds_of_loss(scene, share, x, ratio)
        result: dict[str, Any] = {
            "values": self._numbers(scene),
            "x": x.tolist(),
            "axis": _described(scene, swept, x),
            "curves": {name: listed(column) for name, column in columns.items()},
            "units": {
                name: scaled(largest[name], unit) for name, unit in _UNITS.items()
            },
            "level": {
                "places": crossings,
                "words": _loss(scene, share, crossings, (x, columns, swept)),
            },
        }
        if measured:
            from sim.explorer.data import compared

            result["data"] = compared(scene, measured)
            if swept:  # the points are over the speed
                result["data"]["points"] = {}
        elif table in self.sources:
            name = Path(self.sources[table][1]).name
            words = "errors without measured values, for a plan of where to measure"
            result["data"] = {"points": {}, "name": name, "words": words}
        return result

    def _places(self, swept: str | None, measured: "Measured | None") -> Array:
        """Return the numbers [SI] of a figure's axis; speeds reach to those of a table of measured curves."""
        if swept:
            quantity = quantities(self.scenario)[swept][0]
            axis = next(axis for axis in self._asked.sweep if axis.keys[0] == swept)
            return np.array(sorted({quantity.read(row[0]) for row in axis.values}))
        conditions = measured.conditions if measured else {}
        moving = [speed for speed in np.abs(conditions.get("speed", [])) if speed > 0.0]
        ends = [self.speeds[0], self.speeds[-1], *moving]
        return np.geomspace(min(ends), max(ends), _POINTS)

    def _over(self, scene: Scenario, swept: str | None, x: Array) -> dict[str, Array]:
        """Return the curves of a scenario over its speed, or over another number at its speed."""
        if swept is None:
            return curves(scene, x)
        speed = np.abs(scene.speeds(2)[-1:])
        each = [
            curves(scene.with_values({swept: place}, built=False), speed) for place in x
        ]
        return {name: np.concatenate([one[name] for one in each]) for name in each[0]}

    def others(
        self, values: Mapping[str, Any], figure: str = "speed", loads: bool = False
    ) -> dict[str, Any]:
        """Return curves [SI] at the other points of the sweep and, if wanted, at other loads, with their labels."""
        scene = self.read(values, built=False)
        if figure == "motion":
            return {"others": list(self._other_motions(values))}
        swept = self.axis if figure == "sweep" else None
        x, load = self._places(swept, None), scene.contact.load
        changes = list(self._other_points(scene, swept))
        if loads and load is not None and not scene.contact.changes:
            changes += [{"contact.load": factor * float(load)} for factor in _LOADS]
        drawn = ("contact_area", "area_ratio", "friction_force")
        own = self._over(scene, swept, x) if changes else {}
        result = []
        for change in changes:
            with contextlib.suppress(BadInput):
                found = self._over(scene.with_values(change, built=False), swept, x)
                if all(_is_close(found[name], own[name]) for name in drawn):
                    continue
                columns = {name: listed(found[name]) for name in drawn}
                label = _words_of(scene, change)
                result.append({"label": label, "curves": columns})
        return {"x": x.tolist(), "others": result}

    def _other_motions(self, values: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Yield the motions at the points of the sweep that differ from the present numbers in one key."""
        scene = self.read(values)
        present = {entry.key: entry.value for entry in entries(scene)}
        changes = []
        for row in rows(self._asked.sweep):
            other = scene.with_values(row)
            now = {entry.key: entry.value for entry in entries(other)}
            changed = [key for key in row if now.get(key) != present.get(key)]
            if len(changed) == 1:
                (key,) = changed
                value = now.get(key) if isinstance(now.get(key), float) else row[key]
                changes.append((other, {key: value}))
        estimate = scene.clock.steps * seconds_a_step(scene, 1) * len(changes)
        if self._map or len(changes) > _MOST_OTHERS or estimate > _LONGEST:
            return
        own = course(scene) if changes else {}
        courses = [(_words_of(scene, change), course(one)) for one, change in changes]
        hidden = {n for _, columns in courses for n in columns if _is_busy(columns[n])}
        for label, columns in courses:
            if columns != own:
                shown = {name: x for name, x in columns.items() if name not in hidden}
                yield {"label": label, "columns": shown}

    def _other_points(self, scene: Scenario, swept: str | None) -> Iterator[Any]:
        """Yield the changes of a scenario to the other points of its sweep, at most eight."""
        axes = [
            axis
            for axis in self._asked.sweep
            if axis.keys[0] != swept and not axis.keys[0].startswith("drive.")
        ]
        known = quantities(scene)
        points = (
            list(itertools.product(*(axis.values for axis in axes))) if axes else []
        )
        for point in points if len(points) <= _MOST_OTHERS else []:
            keys = itertools.chain.from_iterable(axis.keys for axis in axes)
            change = dict(zip(keys, itertools.chain.from_iterable(point), strict=True))
            numbers = {
                key: known[key][0].read(x) for key, x in change.items() if key in known
            }
            if any(number != known[key][1] for key, number in numbers.items()):
                yield numbers

    def band(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the band of a few members of the scenario's own models; empty if that takes too long to follow."""
        if self._moves:  # the motion shows the first member itself
            return {"reason": ""}
        from sim.explorer.job import ensemble

        scenes = self.scenes(values, min(_FEW, self.scenario.ensemble.members))
        estimate = sum(
            scene.clock.steps * seconds_a_step(scene, scene.ensemble.members)
            for scene in scenes
        )
        # by counted work alone, so that a busy machine hides no curve
        if estimate > _QUICK:
            return {"reason": "eight members take too long to follow the sliders"}
        return ensemble(scenes, lambda message: None)

    def scenes(self, values: Mapping[str, Any], members: int) -> list[Scenario]:
        """Return what an ensemble runs: the scenario, at each speed of a sweep over the speed alone.

        A motion that is not too long is recorded at each clock step, as the page draws it.
        """
        scene = self.read(dict(values) | {"ensemble.members": members})
        if self._moves and members * scene.clock.steps <= _RECORDS:
            scene = scene.with_values({"clock.record": scene.clock.step})
        axes = self._asked.sweep
        if len(axes) == 1 and axes[0].keys == ("drive.speed",):
            return [
                scene.with_values({"drive.speed": speed}) for (speed,) in axes[0].values
            ]
        return [scene]

    def add(self, source: str | Path, name: str, key: str = "") -> str:
        """Read a table of measured curves, its text or a file, and return the name by which an ``answer`` shows it.

        A table of errors without measured values serves a plan alone.
        """
        from sim.explorer.data import is_plan, table_of

        key, table = key or secrets.token_hex(8), None
        try:
            table = table_of(source, name, self.scenario)
        except BadInput:
            if not is_plan(source, name, self.scenario):
                raise
        self.sources = dict([*self.sources.items()][1 - _KEPT :])
        self.sources[key] = source, name
        if table:
            self.tables = dict([*self.tables.items()][1 - _KEPT :]) | {key: table}
        return key

    def planned(self, key: str) -> "Measured":
        """Return a table as a plan of a measurement reads it."""
        from sim.explorer.data import table_of

        return table_of(*self.sources[key], self.scenario, is_plan=True)

    def toml(self, values: Mapping[str, Any]) -> str:
        """Return the scenario as TOML with values of the sliders."""
        from sim.explorer import take

        scene, known = self.read(values), quantities(self.scenario)
        changed = {
            key: value
            for key, (_, value) in quantities(scene).items()
            if value != known[key][1]
        }
        return take.toml(self._asked, changed, self._asked.source.overrides)

    def difference(self, values: Mapping[str, Any]) -> dict[str, str]:
        """Return the ``text`` of the scenario's file with values of the sliders, and its ``difference`` from the file.

        Raises
        ------
        BadInput
            If the scenario has no file of its user, or none of its numbers is changed.
        """
        from sim.explorer import take

        source, package = self._asked.source, Path(__file__).parents[1]
        if not source.text or Path(source.path).resolve().is_relative_to(package):
            raise BadInput(["The scenario has no file of yours; save it as TOML"])
        known, now = quantities(self.scenario), quantities(self.read(values))
        changed = {key: x for key, (_, x) in now.items() if x != known[key][1]}
        text = take.toml(self._asked, changed, {}, is_swept=True)
        before, after = source.text.splitlines(), text.splitlines()
        name = Path(source.path).name
        shown = difflib.unified_diff(before, after, name, name, lineterm="")
        difference = "\n".join(shown)
        if not difference:
            raise BadInput(["The file has these numbers already"])
        return {"text": text, "difference": difference}

    def write(self, values: Mapping[str, Any], stamp: str) -> dict[str, str]:
        """Write values of the sliders into the scenario's file, if it has not changed since it had a stamp."""
        text = self.difference(values)["text"]
        path = Path(self._asked.source.path)
        if stamp_of(path) != stamp:
            raise BadInput([f"{path} has changed meanwhile; look at it again"])
        with output(path) as beside:
            beside.write_bytes(text.encode())
        return {}

    def renewed(self) -> "Page":
        """Return a page of the scenario's file as it is now, with the tables of this one that it can read.

        Raises
        ------
        BadInput
            If the file cannot be read.
        """
        source = self._asked.source
        result = Page(load(source.path, source.overrides))
        for key, (content, name) in self.sources.items():
            with contextlib.suppress(BadInput):
                result.add(content, name, key)
        result._first = self._first if self._first in result.tables else None
        return result

    def csv(self, values: Mapping[str, Any]) -> str:
        """Return the curves for values of the sliders as a table."""
        from sim.explorer import take

        return take.table(self.read(values), self.speeds)

    def words(self, values: Mapping[str, Any]) -> dict[str, list[str]]:
        """Return the diagnosis and the remarks of ``sim check`` for values of the sliders."""
        scene = self.read(values)
        plan, said = Plan.of(scene), []
        if self.axis:  # the figure has other values of this number
            change = {self.axis: quantities(scene)[self.axis][1]}
            said = [f"at {_words_of(scene, change)}, the number of its slider"]
        return {"diagnosis": said + diagnosis(plan), "remarks": remarks(plan)}

    def _sliders(self) -> Iterator[Slider]:
        """Yield the sliders of all numbers that change a curve."""
        known = quantities(self.scenario)
        tried = np.geomspace(self.speeds[0], self.speeds[-1], _TRIED)
        before = curves(self.scenario, tried)
        is_moving = any(previews(self.scenario))
        effects = {
            key: _effect(self.scenario, key, tried, before)
            for key, (quantity, _) in known.items()
            if not quantity.whole
            and key not in _NUMERICS
            and key.partition(".")[0] not in _NO_SLIDERS
        }
        order = sorted(effects, key=lambda key: -(effects[key] or 0.0))
        marked = [key for key in order if effects[key]][:_MARKED]
        for key, effect in effects.items():
            is_drive = key.partition(".")[0] == _DRIVE
            if key != "contact.load" and (
                not is_moving if is_drive else effect is None and not is_moving
            ):
                continue
            quantity, value = known[key]
            low, high, logarithmic = _ends(self.scenario, key, quantity, value)
            shown = quantity.meaning, quantity.symbol, quantity.unit, value
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


def stamp_of(path: Path) -> str:
    """Return the time of the last change of a file, "" if it is none."""
    return str(path.stat().st_mtime_ns) if path.is_file() else ""


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


def _effect(
    scenario: Scenario, key: str, speeds: Array, before: dict[str, Array]
) -> float | None:
    """Return the largest change of the share of the area if a key is a tenth smaller or larger; None without a change.

    A key that is 0 becomes a tenth of its usual value. None also means that no curve changes at all.
    """
    quantity, value = quantities(scenario)[key]
    size = abs(value) or abs(quantity.read(quantity.example.strip('"')))
    result = None
    for other in (value - 0.1 * size, value + 0.1 * size):
        try:
            quantity.read(other)
            after = curves(scenario.with_values({key: other}, built=False), speeds)
        except ValueError:
            continue
        if after.keys() != before.keys() or not all(
            _is_close(after[name], before[name]) for name in before
        ):
            lost = np.nan_to_num(after["area_ratio"]) - np.nan_to_num(
                before["area_ratio"]
            )
            result = max(result or 0.0, float(np.max(np.abs(lost))))
    return result


def _is_busy(column: list[float | None]) -> bool:
    """Return True if a course turns so often that several of them are no lines any more."""
    values = np.array(column, float)
    values = values[np.isfinite(values)]
    return bool(np.sum(np.abs(np.diff(values))) > _TURNS * np.ptp(values))


def _is_close(one: Array, other: Array) -> bool:
    return np.allclose(one, other, rtol=_CHANGE, atol=0.0, equal_nan=True)


def _axis(scenario: Scenario) -> str | None:
    """Return the number of a sweep that is the axis of a figure: that of the longest axis, in steady sliding."""
    known = quantities(scenario)
    axes = [
        axis
        for axis in scenario.sweep
        if len(axis.keys) == 1
        and axis.keys[0] in known
        and axis.keys[0] != "drive.speed"
    ]
    if scenario.drive.model != "steady" or not axes:
        return None
    return max(axes, key=lambda axis: len(axis.values)).keys[0]


def _map(scenario: Scenario) -> "figures.StabilityMap | None":
    """Return the map of stability of a sweep of the stiffness of the spring alone under a stage of changing speed."""
    keys = [key for axis in scenario.sweep for key in axis.keys]
    if keys != ["drive.stiffness"] or not np.ptp(np.abs(scenario.speeds(_TRIED))):
        return None
    quantity = quantities(scenario)["drive.stiffness"][0]
    return figures.StabilityMap([quantity.read(x) for (x,) in scenario.sweep[0].values])


def _described(scenario: Scenario, swept: str | None, x: Array) -> dict[str, Any]:
    """Return name, symbol, factor, unit and scale of the axis of a figure."""
    if swept is None:
        middle = float(np.sqrt(x[0] * x[-1]))
        name, symbol, unit, log = "sliding speed", "V", scaled(middle, "m/s"), True
    else:
        quantity = quantities(scenario)[swept][0]
        name, symbol = quantity.meaning, quantity.symbol
        unit = scaled(float(np.max(np.abs(x))), quantity.unit)
        steps, ratios = np.diff(x), x[1:] / np.where(x[:-1] > 0.0, x[:-1], np.nan)
        log = bool(np.ptp(ratios) < np.ptp(steps) / np.max(np.abs(x)))
    return {"name": name, "symbol": symbol, "unit": unit, "log": log}


def _words_of(scenario: Scenario, change: Mapping[str, Any]) -> str:
    """Return values of a scenario in words, by their symbols."""
    words, known = [], quantities(scenario)
    for key, value in change.items():
        name = key.rpartition(".")[2].replace("_", " ")
        if key in known:
            quantity = known[key][0]
            name, value = quantity.symbol or name, engineering(value, quantity.unit)
        words.append(f"{name} = {value}")
    return ", ".join(words)


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


def _loss(
    scenario: Scenario,
    share: float,
    speeds: list[float],
    drawn: tuple[Array, dict[str, Array], str | None],
) -> str:
    """Return where a share of the area is lost, and to what, in words.

    ``drawn`` holds the numbers of the axis, the curves over them, and the key of the axis if it is no speed.
    """
    x, columns, swept = drawn
    lost = 100.0 * (1.0 - columns["area_ratio"])
    if not np.any(lost < 100.0):
        return "The contact is open everywhere in this figure"
    limit, least, most = 100.0 * share, np.nanmin(lost), np.nanmax(lost)
    place = "speed" if swept is None else "value"
    unit = "m/s" if swept is None else quantities(scenario)[swept][0].unit
    more = _masking(x, columns["work_of_adhesion"], unit)
    if swept is None:
        more += _peak(scenario, x, columns["friction_force"])
    if np.all(lost[np.isfinite(lost)] >= limit):
        ends = sorted({f"{least:.3g}", f"{most:.3g}"}, key=float)
        return f"{limit:.3g} % or more of the area is lost at every {place} shown: {' to '.join(ends)} %{more}"
    if most < 1e-6:
        return f"With these numbers no area is lost at any {place} shown{more}"
    if not np.any(lost >= limit):
        return f"Less than {limit:.3g} % of the area is lost at every {place} shown: at most {most:.3g} %{more}"
    if swept is not None:
        first = int(np.flatnonzero(np.diff(lost >= limit))[0])
        ends = [engineering(float(end), unit) for end in x[first : first + 2]]
        return (
            f"{limit:.3g} % of the area is lost between {ends[0]} and {ends[1]}{more}"
        )
    at = {
        name: column[0]
        for name, column in curves(scenario, np.array(speeds[:1])).items()
    }
    points = []
    for word, names in _LOST.items():
        shares = sorted(100.0 * at[name] for name in names if name in at)
        if any(abs(one) > 1e-9 for one in shares):
            low, high = f"{shares[0] + 0.0:.1f}", f"{shares[-1] + 0.0:.1f}"
            points.append(f"{word} {low}" if low == high else f"{word} {low} to {high}")
    order = (
        ", by the order of subtraction" if any(" to " in one for one in points) else ""
    )
    others = [engineering(speed, "m/s") for speed in speeds[1:]]
    again = f"; again at {', '.join(others)}" if others else ""
    return f"{limit:.3g} % lost at {engineering(speeds[0], 'm/s')}: {', '.join(points)} points{order}{again}{more}"


def _masking(x: Array, work: Array, unit: str) -> str:
    """Return in words between which numbers of an axis the effective work of adhesion falls to zero, "" if nowhere."""
    masked = work <= 0.0
    if not masked.any() or masked[0]:
        return "; adhesion is masked everywhere in this figure" * bool(masked.all())
    first = int(np.argmax(masked))
    ends = [engineering(float(end), unit) for end in x[first - 1 : first + 1]]
    return f"; adhesion becomes masked between {ends[0]} and {ends[1]}"


def _peak(scenario: Scenario, x: Array, friction: Array) -> str:
    """Return in words where friction is largest, "" if that is at an end of the speeds."""
    place = int(np.argmax(friction))
    if place in (0, len(x) - 1) or friction[place] < _CLEAR * friction[[0, -1]].max():
        return ""
    fine = np.geomspace(x[place - 1], x[place + 1], _POINTS)
    values = curves(scenario, fine)["friction_force"]
    # to the digits that the spacing of the speeds leaves
    at = float(f"{fine[int(np.argmax(values))]:.2g}")
    force = engineering(float(values.max()), "N")
    return f"; friction is largest, {force}, at about {engineering(at, 'm/s')}"
