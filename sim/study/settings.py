"""Settings at which a scene could run: models and tolerances of shear and bonds, clock steps, grids.

Each setting changes one thing of the scene. One that the scene does not admit (a map of waves that do not fit the
cell, a mean of fluctuations that relax) is left out with the reason.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from sim.analysis import engineering
from sim.parts.bonds import Cohort, Counted, FirstMoment, Rate, Steady, Tracked
from sim.parts.shear import Banded, Mapped, Mean, Modal
from sim.scenario.scenario import Scenario
from sim.scenario.schema import keys

#: Tolerance of cohorts whose answer stands for the exact one.
REFERENCE = 1e-6

_SHEARS: dict[str, type] = {"mean": Mean, "banded": Banded, "modal": Modal, "mapped": Mapped}
_STRETCHED: dict[str, type] = {"rate": FirstMoment, "cohort": Cohort, "tracked": Tracked}
_TWO_STATE: dict[str, type] = {"steady": Steady, "rate": Rate, "counted": Counted}
_BANDS = (0.3, 0.1, 0.03, 0.01, 0.003)
_COHORTS = (1e-2, 1e-3, 1e-4, 1e-5)
#: Most sites of a model that holds a number of them.
_MOST_SITES = {"tracked": 1e5, "counted": 1e9}
_MOST_POINTS = 2**14
_USUAL_TOLERANCE = 0.01
_ANY = TypeAdapter(Any)
#: Models, each with the keys that are changed.
_Tried = list[tuple[str, dict[str, Any]]]


@dataclass
class Row:
    """A setting of the study, and what was found of it.

    Attributes
    ----------
    label : str
        Its name.
    part : str
        What it changes: ``"shear"``, ``"bonds"``, ``"step"`` or ``"grid"``.
    scenario : Scenario
        The scene at this setting, without sweep and maps.
    toml : str
        Lines of the scenario file that choose it, below the header of their table.
    own : int
        1 where the scene has this setting as it is written.
    ratio : float
        Its clock step over the scene's.
    error : array, shape (quantities, statistics)
        Largest error over the run, in units of the yardsticks; nan where it is not known.
    bound : array, shape (quantities, statistics)
        What it is at most, where it is known from samples only; else nan.
    time, time_low, time_high : float
        CPU time of the scene's run [s]: median, least and largest of the repeats.
    members : int
        Members sampled; 0 where the budget was too small, or nothing is to be sampled.
    law : array, shape (records, quantities, statistics)
        What a sample should give [SI].
    value, deviation, standard_error : array, shape (times, quantities, statistics)
        A sample [SI], less the law or the fullest model, and the standard error of that, in units of the yardsticks.
    """

    label: str
    part: str
    scenario: Scenario
    toml: str
    own: int = 0
    ratio: float = 1.0
    error: NDArray[np.float64] = field(default_factory=lambda: np.full((4, 4), np.nan))
    bound: NDArray[np.float64] = field(default_factory=lambda: np.full((4, 4), np.nan))
    time: float = math.nan
    time_low: float = math.nan
    time_high: float = math.nan
    members: int = 0
    law: Any = None
    value: Any = None
    deviation: Any = None
    standard_error: Any = None

    @property
    def sites(self) -> float:
        """Number of bond sites of a member; infinite where bonds have a density only."""
        return float(table(self.scenario.population).get("sites", math.inf))

    @property
    def points(self) -> int:
        """Points of the grid along a side; 0 where the spectrum sets them."""
        return int(table(self.scenario.shear).get("points") or 0)

    @property
    def clock_step(self) -> float:
        """Its clock step [s]."""
        return self.scenario.clock.step


def table(part: object) -> dict[str, Any]:
    """A part as its table in a scenario file."""
    return dict(_ANY.dump_python(part, by_alias=True))


def plain(scenario: Scenario) -> Scenario:
    """A scene without sweep and maps, its open choices of models settled."""
    settled = scenario.with_values({"record": {}})
    return settled.with_values({"shear": table(settled.fluctuations), "bonds": table(settled.population)})


def tolerance_of(scenario: Scenario) -> float:
    """Error that a scene accepts: the tolerance of its shear, else that by which its bonds are chosen, else 1 %."""
    chosen = table(scenario.bonds) if "bonds" in scenario.why else {}
    return float(table(scenario.shear).get("tolerance") or chosen.get("tolerance") or _USUAL_TOLERANCE)


def number_of_sites(scenario: Scenario) -> float:
    """Sites of the contact: as given, else by their density and the area at rest, else infinite."""
    bonds, area = table(scenario.bonds), math.pi * scenario.rest_radius**2
    by_density = bonds["site_density"] * area if bonds.get("site_density") and area > 0.0 else math.inf
    return float(bonds.get("sites") or by_density)


def settings(scenario: Scenario, left_out: list[str]) -> list[Row]:
    """All settings of a plain scene but clock steps, simple models first; reasons go to ``left_out``."""
    return [*_shears(scenario, left_out), *_bonds(scenario, left_out), *_grids(scenario, left_out)]


def _shears(scenario: Scenario, left_out: list[str]) -> list[Row]:
    if "cell" not in table(scenario.shear):
        return []
    tolerances = sorted({*_BANDS, tolerance_of(scenario)}, reverse=True)
    bands: _Tried = [("banded", {"tolerance": each}) for each in tolerances]
    tried = [("mean", {}), *bands, ("modal", {}), ("mapped", {})]
    found = _models("shear", scenario, _SHEARS, tried, left_out)
    errors = [row.scenario.process.known_errors() if "tolerance" in row.toml else None for row in found]
    # of tolerances that lead to the same bands the finest alone is a setting of its own
    same = [one is not None and [one] == errors[k + 1 : k + 2] for k, one in enumerate(errors)]
    return [row for row, again in zip(found, same, strict=True) if row.own or not again]


def _bonds(scenario: Scenario, left_out: list[str]) -> list[Row]:
    given, models = table(scenario.bonds), _TWO_STATE
    if "rebinding_rate" not in given:
        return []
    tried: _Tried = [("steady", {}), ("rate", {})]
    if "rupture" in given:
        models, own = _STRETCHED, given.get("tolerance", REFERENCE)
        tried = [("rate", {}), *(("cohort", {"tolerance": each}) for each in sorted({*_COHORTS, REFERENCE, own})[::-1])]
    last = list(models)[-1]
    if given.get("area") == "carried":
        left_out.append(f"{last}: a number of sites cannot be carried with the area")
        return _models("bonds", scenario, models, [row for row in tried if row[0] != "steady"], left_out)
    sites = number_of_sites(scenario)
    if "sites" in given or sites <= _MOST_SITES[last]:
        tried.append((last, {"sites": round(sites)}))
    return _models("bonds", scenario, models, tried, left_out)


def _models(part: str, scenario: Scenario, models: dict[str, type], tried: _Tried, left_out: list[str]) -> list[Row]:
    """The scene with other models of one part, which keep as many of its keys as they take."""
    given = {key: value for key, value in table(getattr(scenario, part)).items() if value is not None}
    found = []
    for model, changes in tried:
        taken = keys(models[model]).keys()
        values = {key: value for key, value in given.items() if key in taken} | changes | {"model": model}
        lost = [key for key in given if key not in {*taken, "tolerance", "points", "sites"}]
        without = f"    # without {', '.join(lost)}" if lost else ""
        lines = [f'model = "{model}"{without}', *(f"{key} = {value}" for key, value in changes.items())]
        label = " ".join([model, *(f"{value:,}" for value in changes.values())])
        own = all(given.get(key) == value for key, value in {**changes, "model": model}.items())
        found += _row(Row(label, part, scenario, "\n".join(lines), int(own)), {part: values}, left_out)
    return found


def _row(row: Row, values: dict[str, Any], left_out: list[str]) -> list[Row]:
    """The row with some keys of its scene changed; none, and the first sentence of the fault, if that is refused."""
    try:
        row.scenario = row.scenario.with_values(values)
        row.scenario.process  # noqa: B018 - some models are refused only when their modes are made
    except ValueError as fault:
        left_out.append(f"{row.label}: " + str(fault).partition("\n")[0])
        return []
    return [row]


def at_step(scenario: Scenario, ratio: float) -> Row:
    """The scene with its clock step times a power of two."""
    clock = scenario.clock
    step, record = clock.step * ratio, clock.stride * clock.step
    changed = scenario.with_values({"clock": {"duration": clock.duration, "step": step, "record": record}})
    lines = f'step = "{step:.12g} s"\nrecord = "{record:.12g} s"'
    return Row(f"step {engineering(float(f'{step:.4g}'), 's')}", "step", changed, lines, int(ratio == 1.0), ratio)


def _grids(scenario: Scenario, left_out: list[str]) -> list[Row]:
    """Half and twice the points, where the spectrum has no shortest wave of its own to set them."""
    own = Row("", "grid", scenario, "").points
    if not own or math.isfinite(scenario.fluctuations.spectrum.support[1]):
        return []
    found = []
    for points in (own // 2, own, min(2 * own, _MOST_POINTS)):
        row = Row(f"{points} points", "grid", scenario, f"points = {points}", int(points == own))
        found += _row(row, {"shear.points": points}, left_out)
    return found
