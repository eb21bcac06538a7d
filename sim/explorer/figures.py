"""Figures that the page draws as they are described here: measured curves, spread of members, map of stability."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sim.ensemble.diagnosis import onset, stability
from sim.explorer.drawing import contact, listed, picture
from sim.parts.exchange import Array
from sim.quantities import QUANTITIES
from sim.scenario.scenario import Scenario
from sim.units.notation import engineering, scaled

if TYPE_CHECKING:
    from sim.study.likelihood import Problem
    from sim.study.measurement import Measured

#: Colours of curves that differ in their conditions, by the names that the page has for them.
_COLOURS = ("bonds", "fluctuations", "own", "stress", "rest")
#: Most members of a figure; bins of a distribution; cells of a row of the map.
_MEMBERS, _BINS, _CELLS = 2000, 40, 24
#: Share of chi^2 in the count of numbers above which a fit is proposed.
_POOR = 3.0
#: Fits that are drawn of the distribution of a fit.
_DRAWS = 30


def axis(label: str, unit: str, log: bool = False, **choices: Any) -> dict[str, Any]:
    """Return the description of an axis: its label with the unit, and how it is chosen."""
    return {"label": f"{label} ({unit})" if unit else label, "log": log, **choices}


def _mark(kind: str, x: Array, y: Array, colour: str, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "x": listed(x), "y": listed(y), "colour": colour} | more


def contact_to_scale(scenario: Scenario, speed: float) -> dict[str, Any]:
    """Return a cut through sphere and half-space and the contact from above, in steady sliding at a speed [m/s].

    The picture ``waves`` shows the fluctuations alone; it is None without them. A panel whose height is "scale" has one
    scale along both axes.
    """
    found = contact(scenario, speed)
    radius, energy = found["radius"], found["fluctuation_energy"]
    if not radius:
        words = "In steady sliding the contact is open."
        return {"radius": 0.0, "panels": [], "words": words, "waves": None}
    factor, unit = scaled(found["side"] / 2.0, "m")
    half, x = factor * found["side"] / 2.0, factor * np.array(found["x"])
    heights = factor * np.array([found["surface"], found["sphere"]])
    across, upwards = (
        axis(name, unit, low=-half, high=half)
        for name in ("along the sliding direction", "across")
    )
    depth = axis("z", unit, low=float(heights.min()), high=float(heights.max()))
    profiles = [
        _mark("line", x, y, colour)
        for y, colour in zip(heights, ("rest", ""), strict=True)
    ]
    stress, words, ends = found["stress"], "", np.array([-half, half])
    marks = []
    if stress is not None:
        marks.append(_mark("image", ends, ends, "", name=picture(stress)))
        most = engineering(float(np.max(np.abs(stress))), "Pa")
        words = (
            f"; blue is −{most} and red +{most} of one realisation of the shear stress"
        )
    ink, angles = "" if stress is None else "black", np.linspace(0.0, 2.0 * np.pi, 181)
    circles = (radius, {"width": 2}), (found["jkr_radius"], {"width": 1, "dash": "2 4"})
    for size, look in circles:
        if size:
            y = factor * size * np.sin(angles)
            marks.append(_mark("line", factor * size * np.cos(angles), y, ink, **look))
    waves = None
    if stress is not None and energy > 0.0:
        href = picture(stress - stress.mean())
        waves = {"href": href, "side": found["side"], "energy": energy}
    sliding = f"In steady sliding at {engineering(speed, 'm/s')}"
    drawn = (
        "Above: a cut through sphere and half-space, heights and widths to one scale."
        f" Below: the contact circle; dotted: JKR's circle{words}."
    )
    return {
        "radius": radius,
        "panels": [
            {"x": across, "y": depth, "height": "scale", "marks": profiles},
            {"x": across, "y": upwards, "height": "scale", "marks": marks},
        ],
        "words": f"{sliding}: contact radius {engineering(radius, 'm')}. {drawn}",
        "waves": waves,
    }


def _plain(words: str) -> str:
    return words.replace("$", "").replace("\\", "")


def measured(scenario: Scenario, table: "Measured") -> dict[str, Any]:
    """Return each measured curve over the condition that varies most, with its prediction and its residuals.

    Residuals are in standard errors. They are left out for a curve without errors.
    """
    from sim.study.likelihood import problem_of

    problem = problem_of(scenario, [table], [], {})
    return {"panels": _panels(problem, problem.start), "words": fitness(problem)}


def fitness(problem: "Problem") -> str:
    """Return chi^2 of the measured numbers and the largest residual in words."""
    off = problem.residuals(problem.start)[: len(problem.values)]
    residuals = np.where(problem.estimated, np.nan, off)
    count = int(np.isfinite(residuals).sum())
    if not count:
        return "The measured curves have no errors, so there is no χ²"
    far = float(np.nanmax(np.abs(residuals)))
    total = float(np.nansum(residuals**2))
    square = f"χ² = {total:.4g} for {count} measured numbers"
    cure = "; tick the numbers to fit below" * (total > _POOR * count)
    return f"{square}, the largest residual is {far:.2g} standard errors{cure}"


def _panels(problem: "Problem", x: Array) -> list[dict[str, Any]]:
    """Return two panels for each measured variable: its curves, and below them their residuals."""
    from sim.plots.style import axis_scale
    from sim.study.fit import courses

    every, labels = courses(problem, x)
    result = []
    for name in dict.fromkeys(course.name for course in every):
        drawn = [course for course in every if course.name == name]
        along = drawn[0].along
        places = along.values
        is_log = axis_scale(places) == "log"
        has_errors = not problem.estimated[problem.of(name)].any()
        (per_x, unit_x), (per_y, unit_y) = _scales(problem, name, places, along.unit)
        curves, residuals = list[Any](), list[Any]()
        for course in drawn:
            colour = _COLOURS[course.label % len(_COLOURS)]
            at, fine = per_x * course.x, per_x * course.fine
            label = _plain(labels[course.label]) or "model"
            curves.append(
                _mark("line", fine, per_y * course.smooth, colour, label=label)
            )
            values = per_y * course.values
            more: dict[str, Any] = {"name": "measured"}
            if has_errors:
                more |= {"high": listed(per_y * course.errors)}
                off = course.residuals
                residuals.append(_mark("points", at, off, colour, name="residual"))
            curves.append(_mark("points", at, values, colour, **more))
        across = axis(_plain(along.words), unit_x, is_log)
        quantity = QUANTITIES[name].meaning.partition(",")[0]
        upper = axis(quantity, unit_y, zero=True)
        panel = {"of": name, "x": across, "y": upper, "height": 260, "marks": curves}
        result.append(panel)
        if has_errors:
            zero = per_x * np.array([places.min(), places.max()])
            residuals.append(_mark("line", zero, 0.0 * zero, "rest", width=1))
            lower = axis("residual / σ", "")
            result.append({"x": across, "y": lower, "height": 90, "marks": residuals})
    return result


def _scales(
    problem: "Problem", name: str, places: Array, unit: str
) -> tuple[tuple[float, str], tuple[float, str]]:
    """Return factors from SI and units of both axes of a measured curve, which depend on the table alone."""
    largest = float(np.max(np.abs(problem.values[problem.of(name)])))
    across = scaled(float(np.max(np.abs(places))), unit)
    return across, scaled(largest, QUANTITIES[name].unit)


def band(
    problem: "Problem", x: Array, covariance: Array, seed: int
) -> list[dict[str, Any]]:
    """Return the bands between the lowest and the highest of 30 fits that are drawn from the covariance of a fit.

    A mark has the variable ``of`` its panel in the figure of the measured curves.
    """
    from sim.study.fit import courses

    ends = np.array(problem.bounds).T
    drawn = np.random.default_rng(seed).multivariate_normal(x, covariance, _DRAWS)
    every = [courses(problem, np.clip(place, *ends))[0] for place in drawn]
    result = []
    for fits in zip(*every, strict=True):
        course, curves = fits[0], np.array([one.smooth for one in fits])
        along = course.along
        across, upper = _scales(problem, course.name, along.values, along.unit)
        low, high = upper[0] * curves.min(0), upper[0] * curves.max(0)
        colour = _COLOURS[course.label % len(_COLOURS)]
        more = {"high": listed(high), "name": "draws", "opacity": 0.3}
        more |= {"of": course.name}
        result.append(_mark("band", across[0] * course.fine, low, colour, **more))
    return result


def rings(problem: "Problem", points: Sequence[dict[str, float]]) -> list[Any]:
    """Return further points of a plan, by their conditions [SI], as rings on the curve ``of`` each variable."""
    from sim.study.fit import courses
    from sim.study.likelihood import problem_of
    from sim.study.measurement import Curve

    (table,) = problem.tables
    curves = [Curve(name, np.zeros(1), np.ones(1)) for name in table.names]
    every = {course.name: course for course in courses(problem, problem.start)[0]}
    result = []
    for point in points:
        conditions = {key: np.array([value]) for key, value in point.items()}
        row = table._replace(conditions=conditions, curves=tuple(curves), baseline=0)
        further = problem_of(problem.groups[0][0].scenario, [row], [], {})
        for name, value in zip(table.names, further.steady(further.start), strict=True):
            along = every[name].along
            across, upper = _scales(problem, name, along.values, along.unit)
            x, y = across[0] * conditions[along.key], upper[0] * np.array([value])
            more = {"of": name, "name": "plan", "size": 8, "label": "measure next"}
            result.append(_mark("points", x, y, "own", **more))
    return result


def spread(scenes: Sequence[Scenario], labels: Sequence[str]) -> dict[str, Any]:
    """Return the distribution of the contact area over members at the end of the runs of some scenes."""
    from sim.ensemble.simulate import run

    marks, words = [], []
    for place, (scene, label) in enumerate(zip(scenes, labels, strict=True)):
        members = min(_MEMBERS, scene.ensemble.members)
        dataset = run(scene.with_values({"ensemble.members": members}))
        full = np.pi * dataset["jkr_radius"] ** 2
        share = 100.0 * (dataset["contact_area"] / full).isel(t=-1).to_numpy().ravel()
        share = share[np.isfinite(share)]
        counts, edges = np.histogram(share, _BINS)
        # percent of the members for each percent of the area
        density = 100.0 * counts / len(share) / np.diff(edges)
        x = np.repeat(edges, 2)
        y = np.concatenate([[0.0], np.repeat(density, 2), [0.0]])
        colour = _COLOURS[place % len(_COLOURS)]
        marks.append(_mark("line", x, y, colour, label=label, name="spread"))
        middle, width = np.mean(share), np.std(share, ddof=1)
        at = f"{label}: " if len(labels) > 1 else ""
        words.append(f"{at}{middle:.3g} ± {width:.2g} %")
    panel = {
        "x": axis("area", "% of JKR's", tight=True),
        "y": axis("members", "% per % of area", zero=True),
        "height": 320,
        "marks": marks,
    }
    text = "Area of the members, mean and standard deviation: " + "; ".join(words)
    return {"panels": [panel], "words": text}


class StabilityMap:
    """Swing of the spring force over speed and stiffness, one row of the map after the other.

    The scenario sweeps the stiffness of the spring alone, and its stage moves at changing speed. The swing is the range
    of the force in a cell over its largest. It has a panel for increasing and one for decreasing speed, each with the
    stiffness below which steady sliding is unstable in linear theory, and a colour scale.
    """

    def __init__(self, stiffness: Sequence[float]) -> None:
        self.stiffness = sorted(stiffness)
        self._rows: dict[float, list[_Leg]] = {}
        self._of: dict[str, float] = {}

    def answer(self, scene: Scenario, values: dict[str, float]) -> dict[str, Any]:
        """Return the map with one further row for the numbers of a scene; ``more`` is True until it has all rows.

        ``plays`` has the numbers and the moment of each cell, in words, too, and ``table`` the swings of all cells.
        """
        others = {key: x for key, x in values.items() if key != _STIFFNESS}
        if others != self._of:
            self._of, self._rows = others, {}
        missing = [one for one in self.stiffness if one not in self._rows]
        if missing:
            self._rows[missing[0]] = _legs(scene.with_values({_STIFFNESS: missing[0]}))
        return self._drawn(scene, len(missing) > 1)

    def _drawn(self, scene: Scenario, more: bool) -> dict[str, Any]:
        hard = np.array(self.stiffness)
        per_y, unit_y = scaled(float(np.sqrt(hard[0] * hard[-1])), "N/m")
        middle = np.sqrt(hard[1:] * hard[:-1])
        sides = [hard[0] ** 2 / middle[0], *middle, hard[-1] ** 2 / middle[-1]]
        panels, plays, table = dict[str, Any](), dict[str, Any](), dict[str, Any]()
        for place, stiffness in enumerate(self.stiffness):
            for leg in self._rows.get(stiffness, []):
                per_x, unit_x = scaled(leg.edges[-1], "m/s")
                tight = {"log": True, "tight": True}
                across = axis("speed of the stage", unit_x, **tight)
                upper = axis(f"K, {leg.words}", unit_y, **tight)
                panel = {"x": across, "y": upper, "height": 230, "marks": []}
                panel = panels.setdefault(leg.words, panel)
                low, high = per_y * sides[place], per_y * sides[place + 1]
                of_spring = f"K = {engineering(stiffness, 'N/m')}, {leg.words}"
                centres = per_x * np.sqrt(leg.edges[1:] * leg.edges[:-1])
                table[across["label"]] = listed(centres)
                table[f"{of_spring} (%)"] = listed(100.0 * leg.swings)
                for cell in np.flatnonzero(np.isfinite(leg.swings)).tolist():
                    swing, name = float(leg.swings[cell]), f"{leg.words} {place} {cell}"
                    look = {"name": name, "high": [high, high], **_shade(swing)}
                    x, y = per_x * leg.edges[[cell, cell + 1]], np.array([low, low])
                    panel["marks"].append(_mark("band", x, y, "fluctuations", **look))
                    at = engineering(centres[cell] / per_x, "m/s")
                    plays[name] = {
                        "values": {_STIFFNESS: stiffness},
                        "time": float(leg.times[cell]),
                        "words": f"{of_spring}, about {at}: {100.0 * swing:.2g} %",
                    }
        for panel in panels.values():
            ends = self._rows[self.stiffness[0]][0].edges[[0, -1]]
            fine = np.geomspace(ends[0], ends[1], _FINE)
            needed = per_y * onset(scene, fine).stiffness
            inside = (needed >= per_y * sides[0]) & (needed <= per_y * sides[-1])
            y = np.where(inside, needed, np.nan)
            look = {"label": "theory", "name": "theory", "width": 2}
            panel["marks"].append(_mark("line", per_x * fine, y, "bonds", **look))
        shown = [*panels.values(), _scale()]
        columns = {"head": [*table], "rows": [*zip(*table.values(), strict=True)]}
        words = self._words(scene) + ("; more rows follow" if more else "")
        answer = {"panels": shown, "words": words, "more": more, "plays": plays}
        return answer | {"table": columns}

    def _words(self, scene: Scenario) -> str:
        """Return between which springs of the map the force begins to vary, and the limit of stability in theory."""
        most = {
            stiffness: max(float(np.nanmax(leg.swings)) for leg in legs)
            for stiffness, legs in sorted(self._rows.items())
        }
        varying = [stiffness for stiffness, swing in most.items() if swing > _HALF]
        words = f"The spring force varies by at most {100.0 * max(most.values()):.2g} % within a cell"
        if varying:
            words = f"The spring force varies by more than half within a cell at K = {engineering(varying[-1], 'N/m')}"
            stiffer = [stiffness for stiffness in most if stiffness > varying[-1]]
            if stiffer:
                words += f", and by less from {engineering(stiffer[0], 'N/m')} on"
        theory = stability(scene)
        if 0.0 < theory.stiffness < np.inf:
            limit, speed = (
                engineering(theory.stiffness, "N/m"),
                engineering(theory.speed, "m/s"),
            )
            words += (
                f". In theory (line) steady sliding is unstable below {limit} at {speed}; near the line oscillations"
                " may grow too slowly for this ramp, which starts in steady sliding"
            )
        return words


#: Key of the map; range of the force in a cell over its largest that the sentence is about; speeds of the theory.
_STIFFNESS, _HALF, _FINE = "drive.stiffness", 0.5, 200
#: Steps of the colour scale.
_SHADES = 20


def _shade(swing: float) -> dict[str, float]:
    """Return how opaque a cell is in which the force varies by a share of its largest."""
    return {"opacity": max(0.02, 0.9 * swing)}


def _scale() -> dict[str, Any]:
    """Return the colour scale of the map as a panel."""
    steps = np.linspace(0.0, 1.0, _SHADES + 1)
    marks = []
    for ends in np.stack([steps[:-1], steps[1:]], axis=1):
        look = {"high": [1.0, 1.0], **_shade(float(np.mean(ends)))}
        marks.append(_mark("band", 100.0 * ends, 0.0 * ends, "fluctuations", **look))
    across = axis("range of the spring force in a cell", "% of its largest", tight=True)
    return {"x": across, "y": axis("", "", tight=True), "height": 12, "marks": marks}


class _Leg(NamedTuple):
    """Swings of the force in cells of the speed between ``edges``, while the speed grows or falls, and their times."""

    words: str
    edges: Array
    swings: Array
    times: Array


def _legs(scene: Scenario) -> list[_Leg]:
    """Return the legs of a run at growing and at falling speed of the stage."""
    from sim.ensemble.simulate import run

    dataset = run(scene.with_values({"ensemble.members": 1}))
    force = np.abs(dataset["spring_force"].to_numpy().ravel())
    speed = np.abs(dataset["stage_speed"].to_numpy().ravel())
    time, turn = dataset["t"].to_numpy(), int(np.argmax(speed)) + 1
    edges = np.geomspace(speed[speed > 0.0].min(), speed.max(), _CELLS + 1)
    place = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, _CELLS - 1)
    result = []
    for words, leg in (("V grows", slice(0, turn)), ("V falls", slice(turn, None))):
        swings, times = np.full(_CELLS, np.nan), np.full(_CELLS, np.nan)
        for cell in np.unique(place[leg]):
            here = np.flatnonzero(place[leg] == cell)
            forces = force[leg][here]
            swings[cell] = 1.0 - forces.min() / forces.max()
            times[cell] = time[leg][here[0]]
        if len(force[leg]) > _CELLS:
            result.append(_Leg(words, edges, swings, times))
    return result
