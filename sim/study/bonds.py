"""Speed against error for the bonds of a scene, part of ``sim converge``.

Only the bonds are marched, at every depth and tolerance that they admit, under the scene's own drive. Errors
are those of the mean over members; beside them stands the noise of one member, which a finite number of
sites has by right.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import engineering
from sim.laws.schallamach import bell_moments, constant_moments, cut_off_moments
from sim.parts.bonds import models as depths
from sim.parts.bonds.rupture import Bell, Constant
from sim.parts.drive import Steady
from sim.scenario.scenario import Scenario
from sim.study.bond_models import REFERENCE, BondRow, Course, bond_rows, march, march_all
from sim.study.settings import tolerance_of

Array = NDArray[np.float64]

QUANTITIES = ("shear_stress", "bond_fraction", "mean_square_force")
_UNITS = ("Pa", "1", "N^2")


def has_bond_depths(scenario: Scenario) -> bool:
    """Whether the scene's bonds have depths to compare: those with a rupture and those that are counted."""
    return isinstance(scenario.population, depths.FirstMoment | depths.Cohort | depths.Tracked | depths.Counted)


def converge_bonds(scenario: Scenario, budget_seconds: float) -> xr.Dataset:
    """March the bonds of a scene at every depth and say how far each is from the truth.

    Parameters
    ----------
    scenario : Scenario
        One whose bonds have a rupture or are counted; its sweep and its contact are not looked at.
    budget_seconds : float
        Time shared equally by the depths. One that cannot finish a march within it is told without errors.

    Returns
    -------
    xarray.Dataset
        Dimensions ``bond_row`` and ``bond_quantity`` (shear stress [Pa], bond fraction [1] and mean square force
        per site [N^2]; nan where a depth does not know it): ``bonds_error``, the largest over the records
        of the mean over members less the reference; ``bonds_standard_error`` of it, from the spread of the
        members, ``bonds_score``, the largest error in standard errors that the number of sites should
        have; ``bonds_noise`` and ``bonds_expected_noise`` of one member, root mean square over the records.
        All are in units of the reference's largest value over the run. Along ``bond_row`` also the costs,
        members, sites, tolerances and TOML lines.

    Notes
    -----
    Reference: for bonds with a rupture the closed form where drive and start are steady, else cohorts at a
    tolerance of 1e-6 (number and stretch by the rate equation where the rupture is constant, which is exact);
    for two-state sites the linear rate equation, which is exact. All depths take the same steps. Sites are
    independent, so the variance of a mean over N of them is that of one over N, known from the reference.
    """
    course, rows = Course.of(scenario), bond_rows(scenario)
    march_all(rows, course, budget_seconds / len(rows))
    reference = _reference(scenario, course, rows)
    return _assembled(scenario, course, rows, reference)


@dataclass(frozen=True)
class Reference:
    """What is true.

    Attributes
    ----------
    values, variance : array, shape (quantities, records)
        Means, and variances over single sites; nan where they are not known.
    share : array, shape (records,)
        Share of the sites that is bound [1].
    words : str
        Where they come from.
    """

    values: Array
    variance: Array
    share: Array
    words: str


def _reference(scenario: Scenario, course: Course, rows: list[BondRow]) -> Reference:
    """The best answer, and the variance of a single site that follows from it."""
    given: Any = rows[0].part
    if not hasattr(given, "rupture"):
        values = _marched(rows, course, lambda row: isinstance(row.part, depths.Rate))
        share, scale = values[1], np.array([[given.stress**2], [1.0], [np.nan]])
        return Reference(values, scale * share * (1.0 - share), share, "the linear rate equation, exact")
    speed = _settled_speed(scenario)
    if math.isfinite(speed):
        bound, force, square = (float(x) for x in _closed_form(given, speed))
        found = np.array([given.site_density * force, bound / given.bound_at_rest, square])
        values, words = np.tile(found[:, np.newaxis], len(course.times)), "the closed form of steady sliding"
    else:
        values, words = _marched(rows, course, lambda row: row.tolerance == REFERENCE), f"cohorts at {REFERENCE:g}"
        if isinstance(given.rupture, Constant):
            values[:2] = _marched(rows, course, lambda row: isinstance(row.part, depths.FirstMoment))[:2]
            words = f"the rate equation, exact for a constant rupture, and for the square {words}"
    share = values[1] * given.bound_at_rest
    forces = given.site_density**2 * np.maximum(values[2] - (values[0] / given.site_density) ** 2, 0.0)
    numbers = share * (1.0 - share) / given.bound_at_rest**2
    return Reference(values, np.array([forces, numbers, np.full(share.shape, np.nan)]), share, words)


def _marched(rows: list[BondRow], course: Course, wanted: Callable[[BondRow], bool]) -> Array:
    """What a depth without noise gives, marched to its end whatever the budget; shape (quantities, records)."""
    row = next(row for row in rows if wanted(row))
    kept = row.batches[0] if row.batches else march(row, course, np.arange(1), math.inf)[0]
    assert kept is not None
    return kept[0].copy()


def _settled_speed(scenario: Scenario) -> float:
    """Speed at which bonds with a rupture slide steadily from the start on, where that has a closed form; else nan."""
    given: Any = scenario.population
    drive = scenario.drive
    if not isinstance(drive, Steady) or given.start_from != "steady" or (drive.speed == 0.0 and given.law.rate == 0.0):
        return math.nan
    return drive.speed


def _closed_form(part: Any, speed: float) -> Any:
    """Share bound, mean force and mean square force per site of steady sliding."""
    rupture, rest = part.rupture, (part.bond_stiffness, part.rebinding_rate)
    if isinstance(rupture, Bell):
        return bell_moments(speed, rupture.zero_force_rate, rupture.bell_force, *rest)
    if isinstance(rupture, Constant):
        return constant_moments(speed, rupture.rate, *rest)
    return cut_off_moments(speed, rupture.rate, rupture.stretch, *rest)


def _numbers(row: BondRow, reference: Reference) -> dict[str, Array]:
    """Error, standard error, score, noise and expected noise of a row, each of shape (quantities,)."""
    found = {name: np.full(len(QUANTITIES), np.nan) for name in _ALONG}
    yard = np.max(np.abs(reference.values), axis=1, initial=0.0)
    if not row.batches:
        return found
    kept = np.concatenate(row.batches) if row.part.per_member else row.batches[0]
    count = len(kept)
    off = kept.mean(axis=0) - reference.values
    spread = kept.std(axis=0, ddof=1) if count > 1 else np.zeros(off.shape)
    known = reference.variance / max(row.sites, 1)
    # with fewer bonds than these their number is far from normal
    known = np.where(row.sites * count * reference.share >= 20.0, known, np.nan)
    for q in np.flatnonzero(np.isfinite(off).all(axis=1) & (yard > 0.0)):
        worst = int(np.argmax(np.abs(off[q])))
        found["error"][q] = off[q, worst] / yard[q]
        found["standard_error"][q] = spread[q, worst] / math.sqrt(count) / yard[q]
        if row.sites:
            told = known[q] > 0.0
            found["score"][q] = np.max(np.abs(off[q, told]) / np.sqrt(known[q, told] / count), initial=0.0)
            found["noise"][q] = math.sqrt(np.mean(spread[q] ** 2)) / yard[q]
            found["expected_noise"][q] = math.sqrt(np.mean(reference.variance[q]) / row.sites) / yard[q]
    found["score"][2] = np.nan
    return found


_ALONG = {
    "error": "largest error of the mean over members, over the records",
    "standard_error": "standard error of that error, from the spread of the members",
    "score": "largest error in standard errors of as many independent sites",
    "noise": "root mean square noise of one member",
    "expected_noise": "noise of that many independent sites",
}


def _assembled(scenario: Scenario, course: Course, rows: list[BondRow], reference: Reference) -> xr.Dataset:
    """Everything told, with units and long names."""
    numbers = [_numbers(row, reference) for row in rows]
    variables: dict[str, Any] = {
        f"bonds_{name}": (
            ("bond_row", "bond_quantity"),
            np.array([row[name] for row in numbers]),
            {"units": "1", "long_name": text if name == "score" else f"{text}, in units of the largest reference"},
        )
        for name, text in _ALONG.items()
    }
    along: dict[str, tuple[list[Any], str, str]] = {
        "toml": ([row.toml for row in rows], "", "lines of the scenario file that choose it"),
        "model": ([row.part.model for row in rows], "", "depth of the bonds"),
        "finer": ([row.finer for row in rows], "1", "parts in which each step is taken"),
        "own": ([int(row.own) for row in rows], "1", "1 where it is what the scene asks for"),
        "cpu_time": ([_middle(row.cpu) for row in rows], "s", "CPU time per member-step, median of the marches"),
        "wall_time": ([_middle(row.wall) for row in rows], "s", "wall time per member-step, median of the marches"),
        "members": ([row.members for row in rows], "1", "members marched; 0 where time was up"),
        "sites": ([row.sites for row in rows], "1", "sites of a member; 0 where there is no number"),
        "tolerance": ([row.tolerance for row in rows], "1", "tolerance of the cohorts"),
    }
    for name, (values, unit, text) in along.items():
        variables[f"bonds_{name}"] = ("bond_row", values, {"long_name": text} | ({"units": unit} if unit else {}))
    for q, (name, unit) in enumerate(zip(QUANTITIES, _UNITS, strict=True)):
        about = {"units": unit, "long_name": f"{name.replace('_', ' ')} of the bonds, the reference"}
        variables[f"bonds_{name}_reference"] = ("bond_t", reference.values[q], about)
    coordinates = {
        "bond_row": ("bond_row", [row.label for row in rows], {"long_name": "depth of the bonds"}),
        "bond_quantity": ("bond_quantity", list(QUANTITIES), {"long_name": "quantity"}),
        "bond_t": ("bond_t", course.times, {"units": "s", "long_name": "time of the records"}),
    }
    step = scenario.clock.step * course.taken
    found = xr.Dataset(variables, coordinates, {
        "bonds_reference": reference.words,
        "bonds_kind": "with a rupture" if hasattr(rows[0].part, "rupture") else "of two states",
        "bonds_tolerance_asked": asked_tolerance(scenario),
        "bonds_sites_of_contact": number_of_sites(scenario),
        "bonds_step": step,
        "bonds_comment": _comment(scenario, course, step),
    })  # fmt: skip
    found["bond_t"].encoding["_FillValue"] = None
    return found


def _middle(times: list[float]) -> float:
    return float(np.median(times)) if times else math.nan


def _comment(scenario: Scenario, course: Course, step: float) -> str:
    """What was left out or thinned."""
    said = ["only the bonds are marched, under the drive alone"]
    if course.taken > 1:
        said.append(f"{course.taken} clock steps are taken at once, as steps of {engineering(step, 's')}")
    if course.scenario.clock.steps % course.taken:
        said.append(f"the run ends at {engineering(float(course.steps * step), 's')}")
    if getattr(scenario.population, "area", "present") == "carried":
        said.append('area = "carried" is left out')
    if scenario.sweep:
        said.append("the sweep is left out")
    return "; ".join(said)


def asked_tolerance(scenario: Scenario) -> float:
    """What the scene asks of its bonds: the tolerance of ``auto``, else that of the shear, else 1 %."""
    given = scenario.bonds
    return float(given.tolerance) if isinstance(given, depths.Auto) else tolerance_of(scenario)


def number_of_sites(scenario: Scenario) -> float:
    """Sites of the contact: as given, else by their density and the area at rest, else infinite."""
    given: Any = scenario.bonds
    area = math.pi * scenario.rest_radius**2
    if isinstance(given, depths.Auto):
        return float(given.number(area))
    if hasattr(given, "sites"):
        return float(given.sites)
    return float(given.site_density * area) if hasattr(given, "site_density") and area > 0.0 else math.inf
