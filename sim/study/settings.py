"""Settings at which a scene could run: models and tolerances of shear and bonds, clock steps, grids.

Each setting changes one thing of the scene. One that the scene does not admit (a map of waves that do not fit the
cell, a mean of fluctuations that relax) is left out with the reason.
"""

import functools
import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from pydantic import TypeAdapter

from sim.analysis import engineering
from sim.parts.bonds import Cohort, Counted, FirstMoment, Rate, Steady, Tracked
from sim.parts.shear import Banded, Mapped, Mean, Modal
from sim.scenario.scenario import Scenario

#: Tolerance of cohorts whose answer stands for the exact one.
REFERENCE = 1e-6

_SHEARS: dict[str, Any] = {"mean": Mean, "banded": Banded, "modal": Modal, "mapped": Mapped}
_STRETCHED: dict[str, Any] = {"rate": FirstMoment, "cohort": Cohort, "tracked": Tracked}
_TWO_STATE: dict[str, Any] = {"steady": Steady, "rate": Rate, "counted": Counted}
_BANDS = (0.3, 0.1, 0.03, 0.01, 0.003)
_COHORTS = (1e-2, 1e-3, 1e-4, 1e-5)
#: Most sites of a model that holds a number of them.
_MOST_SITES = {"tracked": 1e5, "counted": 1e9}
_MOST_POINTS = 2**14
_USUAL_TOLERANCE = 0.01


@dataclass(frozen=True)
class Setting:
    """One row of the study.

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
    own : bool
        Whether the scene has this setting as it is written.
    ratio : float
        Its clock step over the scene's.
    """

    label: str
    part: str
    scenario: Scenario
    toml: str
    own: bool = False
    ratio: float = 1.0

    @property
    def sites(self) -> float:
        """Number of bond sites of a member; infinite where bonds have a density only."""
        return float(table(self.scenario.population).get("sites", math.inf))

    @property
    def points(self) -> int:
        """Points of the grid along a side; 0 where the spectrum sets them."""
        return int(table(self.scenario.shear).get("points") or 0)


def table(part: Any) -> dict[str, Any]:
    """A part as its table in a scenario file."""
    kind: Any = type(part)
    return dict(_adapter(kind).dump_python(part, by_alias=True))


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def plain(scenario: Scenario) -> Scenario:
    """A scene without sweep and maps, its open choices of models settled."""
    settled = scenario.with_values({"record": {}})
    return settled.with_values({"shear": table(settled.fluctuations), "bonds": table(settled.population)})


def tolerance_of(scenario: Scenario) -> float:
    """Error that a scene accepts: the tolerance of its shear, else that by which its bonds are chosen, else 1 %."""
    chosen = table(scenario.bonds) if scenario.bonds.model == "auto" else {}
    return float(table(scenario.shear).get("tolerance") or chosen.get("tolerance") or _USUAL_TOLERANCE)


def number_of_sites(scenario: Scenario) -> float:
    """Sites of the contact: as given, else by their density and the area at rest, else infinite."""
    bonds, area = table(scenario.bonds), math.pi * scenario.rest_radius**2
    if bonds.get("sites"):
        return float(bonds["sites"])
    return float(bonds["site_density"] * area) if bonds.get("site_density") and area > 0.0 else math.inf


def settings(scenario: Scenario, left_out: list[str]) -> list[Setting]:
    """All settings of a plain scene but clock steps, simple models first; reasons go to ``left_out``."""
    return [*_shears(scenario, left_out), *_bonds(scenario, left_out), *_grids(scenario, left_out)]


def _shears(scenario: Scenario, left_out: list[str]) -> list[Setting]:
    given = table(scenario.shear)
    if "cell" not in given:
        return []
    tried: list[tuple[str, dict[str, Any]]] = [("mean", {})]
    tried += [("banded", {"tolerance": each}) for each in sorted({*_BANDS, tolerance_of(scenario)}, reverse=True)]
    found = _models("shear", scenario, _SHEARS, [*tried, ("modal", {}), ("mapped", {})], left_out)
    pairs = itertools.zip_longest(found, found[1:])
    return [row for row, after in pairs if row.own or after is None or not _alike(row, after)]


def _alike(row: Setting, after: Setting) -> bool:
    """Whether two tolerances lead to the same bands, so that the coarser is no setting of its own."""
    models = {row.scenario.shear.model, after.scenario.shear.model}
    return models == {"banded"} and row.scenario.process.known_errors() == after.scenario.process.known_errors()


def _bonds(scenario: Scenario, left_out: list[str]) -> list[Setting]:
    given, models = table(scenario.bonds), _TWO_STATE
    if "rebinding_rate" not in given:
        return []
    tried: list[tuple[str, dict[str, Any]]] = [("steady", {}), ("rate", {})]
    if "rupture" in given:
        models, own = _STRETCHED, given.get("tolerance", REFERENCE)
        tried = [("rate", {}), *(("cohort", {"tolerance": each}) for each in sorted({*_COHORTS, REFERENCE, own})[::-1])]
    last = list(models)[-1]
    own_sites = given.get("sites", math.inf)
    numbers = [own_sites] if math.isfinite(own_sites) else []
    numbers += [each for each in [number_of_sites(scenario)] if each <= _MOST_SITES[last] and each != own_sites]
    tried += [(last, {"sites": round(each)}) for each in sorted(numbers)]
    if given.get("area") == "carried":
        left_out.append(f"{last}: a number of sites cannot be carried with the area")
        tried = [row for row in tried if row[0] not in (last, "steady")]
    return _models("bonds", scenario, models, tried, left_out)


def _models(
    part: str, scenario: Scenario, models: dict[str, Any], tried: Iterable[tuple[str, dict[str, Any]]],
    left_out: list[str],
) -> list[Setting]:  # fmt: skip
    """The scene with other models of one part, which keep as many of its keys as they take."""
    given = table(getattr(scenario, part))
    found = []
    for model, changes in tried:
        label = " ".join([model, *(f"{value:,}" for value in changes.values())])
        taken = {item.alias or name for name, item in models[model].__pydantic_fields__.items()}
        values = {key: value for key, value in given.items() if key in taken and value is not None}
        try:
            changed = scenario.with_values({part: values | changes | {"model": model}})
            changed.process  # noqa: B018 - some models are refused only when their modes are made
        except ValueError as fault:
            left_out.append(f"{label}: {_reason(fault)}")
            continue
        lines = [f'model = "{model}"', *(f"{key} = {value}" for key, value in changes.items())]
        kept = {*taken, "tolerance", "points", "sites"}
        lost = [key for key, value in given.items() if key not in kept and value is not None]
        if lost:
            lines[0] += f"    # without {', '.join(lost)}"
        own = given["model"] == model and all(given.get(key) == value for key, value in changes.items())
        found.append(Setting(label, part, changed, "\n".join(lines), own))
    return found


def _reason(fault: ValueError) -> str:
    """The first sentence of a fault."""
    return str(fault).partition("\n")[0]


def at_step(scenario: Scenario, ratio: float) -> Setting:
    """The scene with its clock step times a power of two."""
    clock = scenario.clock
    step, record = clock.step * ratio, clock.stride * clock.step
    changed = scenario.with_values({"clock": {"duration": clock.duration, "step": step, "record": record}})
    lines = f'step = "{step:.12g} s"\nrecord = "{record:.12g} s"'
    return Setting(f"step {engineering(float(f'{step:.4g}'), 's')}", "step", changed, lines, ratio == 1.0, ratio)


def _grids(scenario: Scenario, left_out: list[str]) -> list[Setting]:
    """Half and twice the points, where the spectrum has no shortest wave of its own to set them."""
    own = Setting("", "grid", scenario, "", own=True)
    part: Any = scenario.fluctuations
    if not own.points or math.isfinite(part.spectrum.support[1]):
        return []
    found = []
    for points in (own.points // 2, own.points, min(2 * own.points, _MOST_POINTS)):
        try:
            changed = scenario.with_values({"shear.points": points})
        except ValueError as fault:
            left_out.append(f"{points} points: {_reason(fault)}")
            continue
        line = f"points = {points}"
        found.append(replace(own, label=f"{points} points", scenario=changed, toml=line, own=points == own.points))
    return found
