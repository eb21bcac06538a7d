"""Curves of steady sliding over the speed: variables of a dataset, shares of the lost area, and the speed of a loss."""

from typing import TYPE_CHECKING

import numpy as np

from sim.ensemble.steady import steady_course
from sim.ensemble.variables import READ
from sim.parts.exchange import Array
from sim.quantities import QUANTITIES
from sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr

#: Variables of a dataset that are curves of steady sliding.
OVER_SPEED = (
    "bond_fraction",
    "shear_stress",
    "fluctuation_energy",
    "work_of_adhesion",
    "contact_radius",
    "contact_area",
    "friction_force",
)


def curves(scenario: Scenario, speeds: Array, time: float = 0.0) -> dict[str, Array]:
    """Return the curves of ``steady_curves`` by name, arrays like ``speeds`` [m/s]."""
    course = steady_course(
        scenario, np.full((len(speeds), 1), time), speeds[:, np.newaxis]
    )
    radii = [
        "jkr_radius",
        "bonds_radius",
        *(["fluctuations_radius"] if scenario.contact.reversible else []),
    ]
    names = (*OVER_SPEED, *radii)
    read = {
        name: np.broadcast_to(READ[name](scenario, course), (len(speeds), 1))[:, 0]
        for name in names
    }
    full, *left = (np.pi * read.pop(name) ** 2 for name in radii)
    full = np.where(full > 0.0, full, np.nan)
    levels = [full, *left, read["contact_area"]]
    lost = ("lost_to_bonds", "lost_to_fluctuations", "lost_to_mean_stress")
    result = read | {"area_ratio": read["contact_area"] / full}
    result |= {
        name: (levels[k] - levels[k + 1]) / full
        for k, name in enumerate(lost[: len(levels) - 1])
    }
    # on a disc the edge pays another energy than that on the contact
    if scenario.margin is None:
        work = (
            scenario.adhesion.work
            - scenario.fluctuations.paid_by_adhesion * course.energy
        )
        control = scenario.contact.control(course.time, scenario.clock.duration)
        alone = np.nan_to_num(control.radius(work, scenario.bodies))[:, 0]
        result["lost_to_fluctuations_first"] = 1.0 - np.pi * alone**2 / full
        lost_to_either = result["lost_to_bonds"] + result["lost_to_fluctuations"]
        result["lost_to_bonds_last"] = (
            lost_to_either - result["lost_to_fluctuations_first"]
        )
    return result


def steady_curves(scenario: Scenario, speeds: Array, time: float = 0.0) -> "xr.Dataset":
    """Return the curves of steady sliding as a dataset; see ``sim.steady_curves``."""
    import xarray as xr

    axis = "speed", speeds, {"units": "m/s", "long_name": "sliding speed"}
    result = xr.Dataset(coords={"speed": axis}, attrs={"title": scenario.name})
    for name, values in curves(scenario, speeds, time).items():
        row = QUANTITIES[name]
        result[name] = "speed", values, {"units": row.unit, "long_name": row.meaning}
    return result


def speeds_of_loss(
    scenario: Scenario, share: float, speeds: Array, ratio: Array | None = None
) -> list[float]:
    """Return the speeds [m/s] in steady sliding at which a share of JKR's area is lost, between some speeds.

    ``ratio`` is the curve of the area over JKR's at these speeds, if it is known. Each crossing between two neighbours
    of ``speeds``, which grow, is solved to rounding in the logarithm of the speed.
    """
    from scipy import optimize

    if ratio is None:
        ratio = curves(scenario, speeds)["area_ratio"]
    left = ratio - (1.0 - share)
    places = np.flatnonzero((left[:-1] > 0.0) != (left[1:] > 0.0))
    logarithms = np.log(speeds).tolist()
    # the ends of an interval are known, with the signs by which it was found
    known = dict(zip(logarithms, left.tolist(), strict=True))

    def surplus(logarithm: float) -> float:
        if logarithm in known:
            return known[logarithm]
        area_ratio = curves(scenario, np.exp([logarithm]))["area_ratio"]
        return float(area_ratio[0]) - (1.0 - share)

    ends = [(logarithms[k], logarithms[k + 1]) for k in places]
    return [
        float(np.exp(optimize.brentq(surplus, low, high, xtol=1e-12, rtol=1e-12)))
        for low, high in ends
    ]
