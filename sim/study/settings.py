"""The settings at which a scene could run: depths and tolerances, clock steps, grids.

A setting that a scene does not admit (a map of waves that do not fit the cell, a mean of fluctuations
that relax) is left out with the reason.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from sim.analysis import engineering
from sim.parts.shear import Banded, Mapped, Mean, Modal
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.process import SmoothProcess
from sim.scenario.scenario import Scenario

TOLERANCES = (0.3, 0.1, 0.03, 0.01, 0.003)

#: A scene's tolerance where it gives none.
USUAL_TOLERANCE = 0.01

_MODELS: dict[str, Any] = {"mean": Mean, "banded": Banded, "modal": Modal, "mapped": Mapped}
_RATIOS = (4.0, 2.0, 1.0, 0.5)
_MOST_POINTS = 2**14


@dataclass(frozen=True)
class Setting:
    """One row of the comparison.

    Attributes
    ----------
    label, line : str
        What it is called, and the line it belongs to: a depth, ``"clock step"`` or ``"grid"``.
    scenario : Scenario
        The scene at this setting, without sweep and maps.
    toml : str
        What to write into the scenario file.
    ratio : float
        Its clock step over the scene's.
    tolerance : float
        Of its bands; nan where there are none.
    points : int
        Points of the grid along a side; 0 where there is none.
    """

    label: str
    line: str
    scenario: Scenario
    toml: str
    ratio: float = 1.0
    tolerance: float = math.nan
    points: int = 0


def tolerance_of(scenario: Scenario) -> float:
    """The scene's tolerance, 1 % where it gives none."""
    return float(getattr(scenario.shear, "tolerance", USUAL_TOLERANCE))


def settings(scenario: Scenario) -> tuple[list[Setting], list[str]]:
    """All admissible settings of a scene, shallow depths first, and what was left out with the reasons.

    Tolerances that lead to the same bands are one setting. Clock steps and grids are varied at the
    scene's own tolerance, or at its own depth where that has no cell.
    """
    plain = scenario.with_values({"record": {}})
    left_out: list[str] = []
    found = _depths(plain, left_out)
    own = next((s for s in found if s.line == "banded" and s.tolerance == tolerance_of(plain)), found[0])
    return [*found, *_clocks(own, left_out), *_grids(own, left_out)], left_out


def _depths(scenario: Scenario, left_out: list[str]) -> list[Setting]:
    given: Any = scenario.fluctuations
    if not hasattr(given, "cell"):
        return [Setting(given.model, given.model, scenario, f'[shear]\nmodel = "{given.model}"')]
    own = tolerance_of(scenario)
    tried = [("mean", math.nan), *(("banded", t) for t in sorted({*TOLERANCES, own}, reverse=True))]
    tried += [("modal", math.nan), ("mapped", math.nan)]
    found: list[Setting] = []
    for model, tolerance in tried:
        changes = {} if math.isnan(tolerance) else {"tolerance": tolerance}
        try:
            changed = scenario.with_values({"shear": _table(scenario, model) | changes})
            points = int(getattr(changed.shear, "points", None) or 0)
            label = model if math.isnan(tolerance) else f"{model} {tolerance:g}"
            setting = Setting(label, model, changed, _shear_lines(scenario, model, changes), 1.0, tolerance, points)
            same = found and model == "banded" == found[-1].line and _alike(found[-1].scenario, changed)
        except ValueError as fault:
            left_out.append(f"{model}: {_reason(fault)}")
            continue
        if not same:
            found.append(setting)
        elif tolerance == own or found[-1].tolerance != own:
            found[-1] = _joined(found[-1], setting, setting if tolerance == own else found[-1])
        else:
            found[-1] = _joined(found[-1], setting, found[-1])
    return found


def _joined(first: Setting, last: Setting, kept: Setting) -> Setting:
    """Several tolerances that lead to the same bands."""
    coarsest = first.label.partition(" to ")[0]
    label = f"{coarsest} to {last.tolerance:g}"
    return Setting(label, kept.line, kept.scenario, kept.toml, 1.0, kept.tolerance, kept.points)


def _alike(one: Scenario, other: Scenario) -> bool:
    """Whether two banded scenes have the same bands."""
    a, b = one.process, other.process
    if isinstance(a, BandedProcess) and isinstance(b, BandedProcess):
        return np.array_equal(a.bands.weight, b.bands.weight) and np.array_equal(a.bands.freedom, b.bands.freedom)
    return (
        isinstance(a, SmoothProcess)
        and isinstance(b, SmoothProcess)
        and math.isclose(a.energy, b.energy, rel_tol=1e-12)
    )


def _table(scenario: Scenario, model: str) -> dict[str, Any]:
    """The scene's table [shear] as another depth takes it."""
    dumped = TypeAdapter(Scenario).dump_python(scenario, by_alias=True, exclude={"source", "sweep"})["shear"]
    known = _MODELS[model].__pydantic_fields__
    return {key: value for key, value in dumped.items() if key in known and value is not None} | {"model": model}


def _shear_lines(scenario: Scenario, model: str, changes: dict[str, Any]) -> str:
    """The lines of [shear] that choose a depth, with a word on keys that it does not take."""
    part: Any = scenario.shear
    fields = type(part).__pydantic_fields__
    unknown = [
        key for key in fields
        if key not in _MODELS[model].__pydantic_fields__ and getattr(part, key) not in (None, fields[key].default)
    ]  # fmt: skip
    left = f"    # without {', '.join(unknown)}" if unknown else ""
    return "\n".join(["[shear]", f'model = "{model}"{left}', *(f"{key} = {value:g}" for key, value in changes.items())])


def _reason(fault: ValueError) -> str:
    """The first sentence of a fault."""
    return str(fault).partition("\n")[0]


def _clocks(own: Setting, left_out: list[str]) -> list[Setting]:
    """Other clock steps whose whole multiples the records are; the scene's own among them, none if it is alone."""
    clock = own.scenario.clock
    record = clock.stride * clock.step
    found = []
    for ratio in _RATIOS:
        if ratio > 1.0 and clock.stride % round(ratio):
            continue
        step = clock.step * ratio
        lines = [own.toml, "", "[clock]", f'step = "{step:.12g} s"', f'record = "{record:.12g} s"']
        try:
            table = {"duration": clock.duration, "step": step, "record": record}
            scenario = own.scenario if ratio == 1.0 else own.scenario.with_values({"clock": table})
        except ValueError as fault:
            left_out.append(f"clock step of {step:g} s: {_reason(fault)}")
            continue
        label = f"{own.label}, step {engineering(step, 's')}"
        found.append(Setting(label, "clock step", scenario, "\n".join(lines), ratio, own.tolerance, own.points))
    return found if len(found) > 1 else []


def _grids(own: Setting, left_out: list[str]) -> list[Setting]:
    """Half and twice the points, where the spectrum has no shortest wave of its own to set them."""
    part: Any = own.scenario.shear
    endless = math.isinf(getattr(getattr(part, "spectrum", None), "support", (0.0, 0.0))[1])
    if not (own.points and endless):
        return []
    found = []
    for points in (own.points // 2, own.points, min(2 * own.points, _MOST_POINTS)):
        try:
            scenario = own.scenario if points == own.points else own.scenario.with_values({"shear.points": points})
        except ValueError as fault:
            left_out.append(f"{points} points: {_reason(fault)}")
            continue
        toml = f"{own.toml}\npoints = {points}"
        found.append(Setting(f"{own.label}, {points} points", "grid", scenario, toml, 1.0, own.tolerance, points))
    return found
