"""Oscillations of a slider behind a spring, as far as they are known before a run, for ``sim check``."""

import math
from collections.abc import Sequence
from typing import cast

import numpy as np

from sim.laws.schallamach import Body
from sim.parts.bonds import Cohort, FirstMoment, Rate
from sim.parts.drive import Spring
from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario

#: Change of bonds and stress by which the growth of the area is found.
_LITTLE = 1e-4


def of_slider(points: Sequence[Scenario]) -> dict[tuple[str, str], list[float]]:
    """Stiffness of the contact, and of the spring below which friction that falls with speed makes oscillations.

    What has values and of what they are, with the values at some points of a sweep.
    """
    rows: dict[tuple[str, str], list[float]] = {}
    for point in points:
        drive, (yields, slope) = cast(Spring, point.drive), cast(Spring, point.drive).yields(*point.solid.effective)
        radius, speeds = math.sqrt(point.contact_area / math.pi), np.abs(point.speeds(41))
        firm = 1.0 / (yields + slope / radius) if yields + slope > 0.0 else math.inf
        rows.setdefault(("contact k_t", "N/m"), []).append(firm)
        if not drive.spring:
            continue
        if drive.mass > 0.0:
            own = math.sqrt(drive.spring / drive.mass) / (2.0 * math.pi)
            rows.setdefault(("natural frequency", "Hz, of mass and spring"), []).append(own)
        bonds, body = point.population, slider_body(point, speeds)
        bare = Body(body.area, body.area_growth, body.stress_growth)
        sticking, stretching = cast(Rate, bonds), cast(Cohort | FirstMoment, bonds)
        alone = stretching.onset(speeds, bare) if bonds.stretched else sticking.onset(speeds, body)
        if np.isnan(alone.stiffness).all():
            continue
        worst = int(np.nanargmax(alone.stiffness))
        at = f", at {speeds[worst]:.3g} m/s, with {alone.frequency[worst] / (2.0 * math.pi):.3g} Hz"
        rows.setdefault(("oscillates below", f"N/m of the spring{at}"), []).append(float(alone.stiffness[worst]))
        if not bonds.stretched:
            continue
        delays = {"mass": drive.mass, "damping": drive.damping, "viscosity": drive.viscosity, "k_t": yields + slope}
        *several, last = [name for name, size in delays.items() if size > 0.0] or [""]
        if last:
            name = f"with {', '.join(several)}{' and ' if several else ''}{last}"
            behind = stretching.onset(speeds, body).stiffness
            if np.isnan(behind).all():
                rows.setdefault((name, "never"), [])
            elif np.nanmax(behind) < math.inf:
                rows.setdefault((name, "N/m of the spring"), []).append(float(np.nanmax(behind)))
            else:
                said = "behind any spring: k_t is so soft that the interface jumps by itself"
                rows.setdefault((name, said), [])
        if drive.mass == 0.0 and (grows := stretching.amplitude(speeds)) is not None:
            said = "suddenly, with large slips; on the way back they last to a stiffer spring"
            if grows[worst] > 0.0:
                said = f"gradually: friction swings by {grows[worst]:.3g} √(1 − K/K_c) of itself"
            rows.setdefault(("sets in there", f"{said} (mean field, constant area)"), [])
        area = np.asarray(body.area)[worst]
        soft = 4.0 * math.pi * point.solid.effective[0] * float(area / alone.stiffness[worst])
        if 0.5 * soft < 2.0 * radius:
            said = "m and longer: such waves along the sliding oscillate by themselves, across half as long ones"
            rows.setdefault(("half-space", said), []).append(soft)
    return rows


def slider_body(point: Scenario, speeds: Array) -> Body:
    """The body behind the spring of a scene, in steady sliding at speeds [m/s], with the growth of its contact."""
    drive, steady = cast(Spring, point.drive), point.population.steady(speeds)
    control, (yields, slope) = point.contact.control(0.0, 0.0), drive.yields(*point.solid.effective)

    def area(share: float = 1.0, stress: float = 1.0) -> Array:
        work = point.adhesion.work_of_bonds(steady.fraction * share)
        held = steady.strength * stress, point.contact.reversible, point.bodies
        return np.asarray(np.pi * control.radius(work, *held) ** 2)

    now, few = area(), _LITTLE
    by_bonds = (area(share=1.0 + few) - area(share=1.0 - few)) / (2.0 * few * now)
    by_stress = (area(stress=1.0 + few) - area(stress=1.0 - few)) / (2.0 * few * now)
    firm = 1.0 / (yields + slope / np.sqrt(now / np.pi)) if yields + slope > 0.0 else math.inf
    own = 0.5 if slope > 0.0 else 0.0
    return Body(now, by_bonds, by_stress, drive.mass, drive.damping, drive.viscosity, firm, own)
