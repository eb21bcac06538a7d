"""Write docs/drawings: pictures of the experiment and of the terms that the pages explain.

``python docs/make_drawings.py`` writes all of them as SVG. Curves in a drawing are computed by ``sim``; everything else
is a sketch that is not to scale. Colours are variables of CSS, so that a drawing follows the light or the dark page:
the drawing itself asks the system, and the site overrides its variables (``docs/_static/site.css``).
"""

import math
import random
import sys
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sim
from sim.laws import layer, schallamach
from sim.spectrum import SelfAffine

ROOT = Path(__file__).parent.parent
FOLDER = Path(__file__).with_name("drawings")
WIDTH = 520
LIGHT = {
    "ink": "#1b2430",
    "faint": "#5f6875",
    "solid": "#d9e5ee",
    "body": "#c6ccd4",
    "bond": "#0067a3",
    "flux": "#b84a00",
    "glue": "#00735a",
}
DARK = {
    "ink": "#e4e7eb",
    "faint": "#a0a8b4",
    "solid": "#2c3e4e",
    "body": "#4b545f",
    "bond": "#5bb8f0",
    "flux": "#ff9557",
    "glue": "#3fcfa6",
}
Points = Sequence[tuple[float, float]]


def _variables(colours: dict[str, str]) -> str:
    return "".join(f"--drawing-{name}:{value};" for name, value in colours.items())


def _style() -> str:
    rules = [
        f":root{{{_variables(LIGHT)}}}",
        f"@media (prefers-color-scheme:dark){{:root{{{_variables(DARK)}}}}}",
        ".drawing text{font:14px system-ui,'DejaVu Sans',Arial,sans-serif;"
        "fill:var(--drawing-ink);stroke:none}",
        ".drawing .small{font-size:12.5px}",
        ".drawing .title{font-weight:600}",
        ".drawing .line{fill:none;stroke-width:1.5}",
        ".drawing .thick{stroke-width:2.6}",
        ".drawing .thin{stroke-width:1}",
        ".drawing .dashed{stroke-dasharray:5 4}",
        ".drawing .pale{fill-opacity:.22;stroke:none}",
    ]
    for name in LIGHT:
        rules += [
            f".drawing .line.{name},.drawing .edge-{name}"
            f"{{stroke:var(--drawing-{name})}}",
            f".drawing .fill-{name},.drawing text.{name}{{fill:var(--drawing-{name})}}",
        ]
    return "".join(rules)


def _number(value: float) -> str:
    return f"{value + 0.0:.1f}".replace("-0.0", "0.0").removesuffix(".0")


class Drawing:
    """An SVG drawing that grows by its methods.

    Lengths are in pixels of a page 520 wide, y points down, and a look is a list of names of CSS classes.
    """

    def __init__(self, title: str, height: float) -> None:
        self.title, self.height = title, height
        self.parts: list[str] = []

    def path(self, way: str, look: str) -> None:
        """Add a path in the language of SVG."""
        self.parts.append(f'<path d="{way}" class="{look}"/>')

    def line(self, points: Iterable[tuple[float, float]], look: str = "ink") -> None:
        """Add straight lines between points."""
        pairs = [f"{_number(x)} {_number(y)}" for x, y in points]
        self.path("M" + "L".join(pairs), f"line {look}")

    def area(self, points: Iterable[tuple[float, float]], look: str) -> None:
        """Add a filled polygon."""
        pairs = [f"{_number(x)} {_number(y)}" for x, y in points]
        self.path("M" + "L".join(pairs) + "Z", look)

    def box(
        self, corner: tuple[float, float], size: tuple[float, float], look: str
    ) -> None:
        """Add a rectangle with slightly rounded corners."""
        x, y, width, height = map(_number, (*corner, *size))
        self.parts.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="3" '
            f'class="{look}"/>'
        )

    def dot(self, at: tuple[float, float], radius: float, look: str) -> None:
        """Add a circle."""
        x, y, size = map(_number, (*at, radius))
        self.parts.append(f'<circle cx="{x}" cy="{y}" r="{size}" class="{look}"/>')

    def text(
        self, at: tuple[float, float], words: str, look: str = "", anchor: str = "start"
    ) -> None:
        """Add words, with lines that follow each other downwards."""
        x, y = at
        for line in words.split("\n"):
            self.parts.append(
                f'<text x="{_number(x)}" y="{_number(y)}" text-anchor="{anchor}" '
                f'class="{look}">{escape(line)}</text>'
            )
            y += 17

    def arrow(
        self, start: tuple[float, float], end: tuple[float, float], look: str = "ink"
    ) -> None:
        """Add an arrow whose head has the colour that the look names first."""
        colour = look.split()[0]
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        back = [
            (end[0] - 9 * math.cos(angle + turn), end[1] - 9 * math.sin(angle + turn))
            for turn in (0.42, -0.42)
        ]
        neck = (end[0] - 6 * math.cos(angle), end[1] - 6 * math.sin(angle))
        self.line([start, neck], look)
        self.area([end, *back], f"fill-{colour}")

    def spring(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        half: float,
        look: str = "ink",
    ) -> None:
        """Add a zigzag of seven turns between two points, with straight ends."""
        (x0, y0), (x1, y1) = start, end
        length = math.hypot(x1 - x0, y1 - y0)
        side = (-(y1 - y0) / length * half, (x1 - x0) / length * half)
        shares = [0.0, 0.15, *np.linspace(0.2, 0.8, 13), 0.85, 1.0]
        signs = [0, 0, *((1, -1) * 7)[:13], 0, 0]
        self.line(
            (
                (x0 + s * (x1 - x0) + k * side[0], y0 + s * (y1 - y0) + k * side[1])
                for s, k in zip(shares, signs, strict=True)
            ),
            look,
        )

    def svg(self) -> str:
        """Return the drawing as a file."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" '
            f'viewBox="0 0 {WIDTH} {_number(self.height)}" '
            f'width="{WIDTH}" height="{_number(self.height)}">'
        )
        title, style = f"<title>{escape(self.title)}</title>", _style()
        return "\n".join(
            [head, title, f"<style>{style}</style>", *self.parts, "</svg>"]
        )


class Panel(NamedTuple):
    """Axes of a drawing: corner and size in pixels, range of both axes, and True for a logarithmic one."""

    drawing: Drawing
    corner: tuple[float, float]
    size: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    logs: tuple[bool, bool] = (False, False)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixels of a point."""
        shares = []
        for value, ends, is_log in zip(
            (x, y), (self.x, self.y), self.logs, strict=True
        ):
            low, high, value = (
                map(math.log, (*ends, value)) if is_log else (*ends, value)
            )
            shares.append((value - low) / (high - low))
        return (
            self.corner[0] + shares[0] * self.size[0],
            self.corner[1] + (1.0 - shares[1]) * self.size[1],
        )

    def curve(self, x: Iterable[float], y: Iterable[float], look: str) -> None:
        """Draw a curve."""
        self.drawing.line((self.at(*point) for point in zip(x, y, strict=True)), look)

    def between(
        self, x: Sequence[float], low: Sequence[float], high: Sequence[float], look: str
    ) -> None:
        """Fill the area between two curves."""
        there = [self.at(*point) for point in zip(x, low, strict=True)]
        back = [self.at(*point) for point in zip(x, high, strict=True)]
        self.drawing.area([*there, *back[::-1]], look)

    def frame(
        self,
        words: tuple[str, str],
        ticks: tuple[dict[float, str], dict[float, str]],
    ) -> None:
        """Draw both axes with their ticks and words; those of y stand above the axis."""
        (left, top), (width, height) = self.corner, self.size
        base, right = top + height, left + width
        self.drawing.line([(left, top), (left, base), (right, base)], "faint")
        for value, label in ticks[0].items():
            x, _ = self.at(value, self.y[0])
            self.drawing.line([(x, base), (x, base + 5)], "faint")
            self.drawing.text((x, base + 19), label, "small", "middle")
        for value, label in ticks[1].items():
            _, y = self.at(self.x[0], value)
            self.drawing.line([(left - 5, y), (left, y)], "faint")
            self.drawing.text((left - 8, y + 4), label, "small", "end")
        self.drawing.text((right, base + 37), words[0], "small", "end")
        self.drawing.text((left - 34, top - 10), words[1], "small")


def _sphere(drawing: Drawing, centre: tuple[float, float], radius: float, cut: float):
    """Draw a sphere that is cut off at a height."""
    x, y = centre
    half = math.sqrt(radius**2 - (y - cut) ** 2)
    large = 1 if y > cut else 0
    drawing.path(
        f"M{_number(x - half)} {_number(cut)}A{radius} {radius} 0 {large} 0 "
        f"{_number(x + half)} {_number(cut)}Z",
        "fill-body edge-ink",
    )


def _solid(drawing: Drawing, contact: tuple[float, float, float], base: float) -> None:
    """Draw a solid under a sphere: centre x, height of the free surface, half width of the contact."""
    x, surface, half = contact
    drawing.path(
        f"M20 {_number(surface)}L{_number(x - half - 60)} {_number(surface)}"
        f"C{_number(x - half - 22)} {_number(surface)} {_number(x - half - 4)} "
        f"{_number(surface - 2)} {_number(x - half)} {_number(surface - 12)}"
        f"L{_number(x + half)} {_number(surface - 12)}"
        f"C{_number(x + half + 4)} {_number(surface - 2)} {_number(x + half + 22)} "
        f"{_number(surface)} {_number(x + half + 60)} {_number(surface)}"
        f"L500 {_number(surface)}L500 {_number(base)}L20 {_number(base)}Z",
        "fill-solid edge-ink",
    )


def experiment() -> Drawing:
    """Return the sphere, the half-space, the spring and the stage, and the interface magnified."""
    drawing = Drawing("A sphere that a stage pulls over a soft half-space", 545)
    radius, half, surface, x = 120.0, 56.0, 222.0, 205.0
    centre = (x, surface - 12 - math.sqrt(radius**2 - half**2))
    _solid(drawing, (x, surface, half), 298)
    _sphere(drawing, centre, radius, 62)
    drawing.arrow((x, 8), (x, 58), "ink thick")
    drawing.text((x + 10, 28), "load P")
    drawing.text((x, 106), "rigid, smooth sphere\nof radius R", anchor="middle")
    drawing.spring((x + 117, 130), (432, 130), 9)
    drawing.text((376, 108), "spring K", anchor="middle")
    drawing.box((432, 104), (34, 52), "fill-body edge-ink")
    drawing.text((449, 96), "stage", anchor="middle")
    drawing.arrow((466, 130), (512, 130), "ink thick")
    drawing.text((470, 152), "speed")
    drawing.arrow((x - half - 4, 196), (x - half - 66, 196), "flux thick")
    drawing.text((x - half - 70, 188), "friction F", "flux", "end")
    drawing.line([(x - half, 252), (x + half, 252)], "thin ink")
    for edge in (x - half, x + half):
        drawing.line([(edge, 246), (edge, 258)], "thin ink")
    drawing.text((x, 271), "contact, width 2a", "small", "middle")
    drawing.text((490, 246), "soft half-space,\nshear modulus G", "small", "end")
    drawing.line(
        [(x + 14, 206), (x + 48, 206), (x + 48, 232), (x + 14, 232), (x + 14, 206)],
        "thin ink",
    )
    drawing.line([(x + 14, 232), (40, 326)], "thin faint dashed")
    drawing.line([(x + 48, 232), (480, 326)], "thin faint dashed")

    top, bottom = 352.0, 412.0
    drawing.box((40, 326), (440, top - 326), "fill-body edge-ink")
    drawing.box((40, bottom), (440, 26), "fill-solid edge-ink")
    drawing.text((48, 344), "sphere", "small")
    drawing.arrow((420, 339), (470, 339), "ink")
    drawing.text((412, 344), "slides", "small", "end")
    drawing.text((48, bottom + 18), "half-space", "small")
    leans = [22, 34, None, None, 40, 28, 0, 18, 30, 36, 24]
    for k, lean in enumerate(leans):
        foot = 66.0 + 36.0 * k
        if lean is None:
            drawing.line([(foot, bottom), (foot + 3, bottom - 14)], "faint")
            drawing.line([(foot, top), (foot - 4, top + 14)], "faint")
        else:
            drawing.spring((foot, bottom), (foot + lean, top), 4, "bond")
            drawing.dot((foot, bottom), 2.5, "fill-bond")
            drawing.dot((foot + lean, top), 2.5, "fill-bond")
    drawing.text((157, 386), "broken", "small", "middle")
    drawing.text((291, 386), "new", "small")
    waves = Panel(drawing, (40, 462), (440, 58), (0, 440), (0, 2))
    along = np.linspace(0, 440, 221)
    stress = 1 + sum(
        size * np.cos(2 * math.pi * along / length + phase)
        for size, length, phase in ((0.32, 150, 0.4), (0.2, 61, 2.0), (0.1, 27, 1.0))
    )
    waves.between(along, stress, np.ones(221), "fill-flux pale")
    waves.curve(along, stress, "flux")
    waves.curve((0, 440), (1, 1), "ink dashed")
    waves.curve((0, 0, 440), (2, 0, 0), "faint")
    drawing.text((48, 460), "shear stress τ = τ₀ + τ₁", "small flux")
    drawing.text((484, 495), "τ₀", "small")
    drawing.text((484, 475), "τ₁", "small flux")
    drawing.text((478, 538), "place along the sliding direction", "small", "end")
    return drawing


def _bubble(drawing: Drawing, corner: tuple[float, float], words: str, look: str):
    drawing.box(corner, (150, 62), f"fill-solid edge-{look}")
    lines = words.count("\n") + 1
    drawing.text(
        (corner[0] + 75, corner[1] + 36 - 8.5 * (lines - 1)), words, "", "middle"
    )


def energy_balance() -> Drawing:
    """Return the payers and receivers of energy if the contact grows, and shares of one lens over the speed."""
    drawing = Drawing("Energy that new contact area receives, and its payers", 600)
    drawing.text((20, 22), "If the contact grows by an area dA …", "title")
    drawing.text((95, 52), "… these pay", "", "middle")
    drawing.text((425, 52), "… and these receive", "", "middle")
    _bubble(drawing, (20, 64), "adhesion of the\nbonds that are left", "glue")
    _bubble(drawing, (20, 204), "drive, which pulls\nthe slider", "ink")
    _bubble(drawing, (350, 64), "deformation along\nthe normal (JKR)", "ink")
    _bubble(drawing, (350, 144), "stress fluctuations\nΔΓ dA", "flux")
    _bubble(drawing, (350, 224), "mean shear stress\n(uniform)", "ink")
    drawing.arrow((172, 88), (347, 88), "glue thick")
    drawing.text((260, 80), "w dA, the rest", "small glue", "middle")
    drawing.arrow((172, 112), (347, 168), "flux thick")
    drawing.text((282, 135), "share χ", "small flux")
    drawing.arrow((172, 222), (347, 186), "ink dashed")
    drawing.text((206, 206), "1 − χ", "small", "middle")
    drawing.arrow((172, 250), (347, 254), "ink thick")
    drawing.text((260, 270), "1 − α", "small", "middle")
    drawing.arrow((172, 124), (347, 238), "ink dashed thin")
    drawing.text((174, 178), "share α", "small")
    drawing.text(
        (20, 312),
        "Hypothesis of the paper: χ = 1, α = 0. Taken strictly: χ = 0.",
        "small",
    )
    drawing.text((20, 350), "The example lens with χ = 1", "title")
    changes = {"shear.model": "mean", "ensemble.members": 1}
    dataset = sim.run(sim.load(ROOT / "scenarios" / "pdms_lens.toml", changes))
    every = dataset.isel(t=slice(0, None, 8)).squeeze()
    speed, work = 1e3 * every.speed.values, 42.0
    fluctuation = 1e3 * every.fluctuation_energy.values
    intact = work * every.bond_fraction.values
    left = np.maximum(intact - fluctuation, 0.0)
    panel = Panel(drawing, (64, 388), (420, 160), (0.01, 100), (0, 45), (True, False))
    none, full = np.zeros(len(speed)), np.full(len(speed), work)
    panel.between(speed, none, left, "fill-glue pale")
    panel.between(speed, left, intact, "fill-flux pale")
    panel.between(speed, intact, full, "fill-bond pale")
    panel.curve(speed, left, "glue thick")
    panel.curve(speed, intact, "bond thick")
    panel.curve((0.01, 100), (work, work), "ink dashed")
    drawing.text((90, 470), "w: left for the contact", "glue")
    drawing.text(panel.at(14, 6), "ΔΓ", "flux")
    drawing.text(panel.at(13.4, 29), "broken bonds", "bond")
    masked = float(np.interp(0.0, (fluctuation - intact), np.log10(speed)))
    x, _ = panel.at(10**masked, 0)
    drawing.line([(x, 388), (x, 548)], "thin ink dashed")
    drawing.text((x + 6, 420), "masked: w ≤ 0", "small")
    panel.frame(
        ("sliding speed (mm/s)", "energy per area (mJ/m²)"),
        (
            {0.01: "0.01", 0.1: "0.1", 1: "1", 10: "10", 100: "100"},
            {0: "0", 20: "20", work: "42"},
        ),
    )
    return drawing


def bond_life() -> Drawing:
    """Return the states of a site, and the force of three sites over time under Bell's law."""
    drawing = Drawing("Life of a bond: binding, stretch, rupture", 470)
    titles = ("free site", "new bond", "stretched", "broken: free")
    for k, title in enumerate(titles):
        left = 12.0 + 128.0 * k
        drawing.text((left + 50, 24), title, "title", "middle")
        drawing.box((left, 36), (100, 24), "fill-body edge-ink")
        drawing.box((left, 116), (100, 24), "fill-solid edge-ink")
        foot = left + 34
        head = foot + (40 if k >= 2 else 0)
        if k in (0, 3):
            drawing.line([(foot, 116), (foot + 2, 101)], "bond")
            drawing.line([(head, 60), (head - 3, 74)], "bond")
        else:
            drawing.spring((foot, 116), (head, 60), 4, "bond")
        drawing.dot((foot, 116), 3, "fill-bond")
        drawing.dot((head, 60), 3, "fill-bond")
    drawing.line([(302, 152), (342, 152)], "thin ink")
    for edge in (302, 342):
        drawing.line([(edge, 147), (edge, 157)], "thin ink")
    drawing.text((322, 170), "stretch x", "small", "middle")
    for k, words in enumerate(
        ("binds at\nrate kₒₙ", "slip\nstretches", "opens at\nrate k(x)")
    ):
        x = 115.0 + 128.0 * k
        drawing.arrow((x, 82), (x + 22, 82), "ink")
        drawing.text((x + 11, 190), words, "small", "middle")
        drawing.line([(x + 11, 90), (x + 11, 176)], "thin faint dashed")

    speed, rate, force, stiffness, binding = 2e-3, 1e4, 4e-12, 4e-4, 1e5
    draws, end = random.Random(4), 160.0
    pull = 1e-6 * stiffness * speed  # N/µs
    panel = Panel(drawing, (54, 250), (440, 170), (0, end), (0, 22))
    looks = ("bond thick", "faint", "faint dashed")
    for look in looks[::-1]:
        time, times, forces = -30.0 * draws.random(), [0.0], [0.0]
        while time < end:
            time += 1e6 * draws.expovariate(binding)
            threshold = draws.expovariate(1.0)
            growth = threshold * pull / (1e-6 * rate * force)
            life = force / pull * math.log1p(growth)
            if time > 0.0:
                last = min(life, end - time)
                times += [min(time, end), time + max(last, 0.0)]
                forces += [0.0, 1e12 * pull * max(last, 0.0)]
                if life <= end - time:
                    times.append(time + life)
                    forces.append(0.0)
            time += life
        ends = np.minimum(times, end)
        panel.curve(
            [*ends, end], [*forces, forces[-1] if times[-1] >= end else 0.0], look
        )
    recipe = (speed, rate, force, stiffness, binding)
    mean = 1e12 * float(schallamach.bell_moments(*recipe).force)
    panel.curve((0, end), (mean, mean), "flux thick dashed")
    drawing.text((494, 240), "dashed: mean of many sites", "small flux", "end")
    panel.frame(
        ("time (µs), sliding at 2 mm/s", "force of a site (pN): three sites"),
        ({t: f"{t:g}" for t in (0, 50, 100, 150)}, {0: "0", 10: "10", 20: "20"}),
    )
    return drawing


def bands() -> Drawing:
    """Return the spectrum of the example lens in three bands, each with its wave and its shares."""
    drawing = Drawing("Bands of a power spectrum of the shear stress", 530)
    spectrum = SelfAffine(
        rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=1e-6
    )
    edges = 2e6 * math.pi / np.array([60.0, 24.0, 6.0, 1.0])  # rad/m
    panel = Panel(drawing, (64, 46), (430, 170), (7e4, 9e6), (1e-7, 3), (True, True))
    q = np.geomspace(edges[0] * 1.0001, edges[-1] * 0.9999, 160)
    density = spectrum.density(q, 0.0 * q)
    shares = []
    looks = ("glue", "flux", "bond")
    for low, high, look in zip(edges[:-1], edges[1:], looks, strict=True):
        inside = np.geomspace(low * 1.0001, high * 0.9999, 400)
        values = np.asarray(spectrum.density(inside, 0.0 * inside))
        shares.append(
            (np.trapezoid(inside * values, inside), np.trapezoid(values, inside))
        )
        few = inside[::20].tolist() + [inside[-1]]
        top = (np.asarray(spectrum.density(np.array(few), 0.0)) / density[0]).tolist()
        panel.between(few, [1e-7] * len(few), top, f"fill-{look} pale")
    panel.curve(q, np.asarray(density) / density[0], "ink thick")
    panel.frame(
        ("wavenumber q (rad/m)", "power spectral density C(q), over its plateau"),
        (
            {1e5: "10⁵", 1e6: "10⁶"},
            {1.0: "1", 1e-3: "10⁻³", 1e-6: "10⁻⁶"},
        ),
    )
    total = np.sum(shares, axis=0)
    names = ("long waves", "middle waves", "short waves")
    lengths = ("60 to 24 µm", "24 to 6 µm", "6 to 1 µm")
    waves = (38.0, 12.0, 2.5)
    drawing.text((150, 280), "wave, and depth", "small title", "middle")
    drawing.text((352, 280), "share of", "small title", "middle")
    drawing.text((452, 280), "share of", "small title", "middle")
    drawing.text((150, 296), "that it strains", "small title", "middle")
    drawing.text((352, 296), "variance σ²", "small title", "middle")
    drawing.text((452, 296), "energy ΔΓ", "small title", "middle")
    for k, (name, length, wave, look) in enumerate(
        zip(names, lengths, waves, looks, strict=True)
    ):
        top = 314.0 + 80.0 * k
        scale = 2.0  # pixels a µm
        depth = scale * wave / (2.0 * math.pi) * 2.0
        drawing.area(
            [
                (20, top + 24),
                (270, top + 24),
                (270, top + 24 + depth),
                (20, top + 24 + depth),
            ],
            f"fill-{look} pale",
        )
        along = np.linspace(0, 250, 251)
        height = 9.0 * np.sin(2 * math.pi * along / (scale * wave))
        drawing.line(
            ((20 + x, top + 24 - y) for x, y in zip(along, height, strict=True)), look
        )
        drawing.text((20, top + 8), f"{name}, {length}", f"small {look}")
        for x, part in zip((352, 452), shares[k] / total, strict=True):
            drawing.text((x, top + 30), f"{100 * part:.0f} %", look, "middle")
    return drawing


def slip_cycle() -> Drawing:
    """Return the spring force and the slider's speed over three cycles of stick-slip."""
    drawing = Drawing("Cycles of stick-slip: spring force and speed of the slider", 480)
    changes = {
        "drive.stage": "5 mm/s",
        "drive.start": "rest",
        "clock.duration": "1 s",
        "clock.step": "50 us",
        "clock.record": "0.1 ms",
    }
    dataset = sim.run(sim.load(ROOT / "scenarios" / "stick_slip.toml", changes))
    run = dataset.squeeze()
    time, force = 1e3 * run.t.values, 1e3 * run.spring_force.values
    speed = 1e3 * run.speed.values
    starts = time[1:][(speed[1:] >= 50.0) & (speed[:-1] < 50.0)]
    first, second, _ = starts[-4], starts[-3], starts[-2]
    begin, period = first - 0.55 * (second - first), second - first
    stop = begin + 3.0 * period
    inside = (time >= begin) & (time <= stop)
    time, force, speed = time[inside] - begin, force[inside], speed[inside]
    keep = np.unique([*range(0, len(time), 12), *np.flatnonzero(speed > 4.0)])
    time, force, speed = time[keep], force[keep], speed[keep]
    high, low = force.max(), force.min()
    top = Panel(drawing, (60, 56), (440, 170), (0, stop - begin), (0, 1.25 * high))
    top.curve(time, force, "bond thick")
    for value in (high, low):
        top.curve((0, stop - begin), (value, value), "thin faint dashed")
    drawing.text((500, top.at(0, high)[1] - 5), "static friction", "small", "end")
    events = time[1:][(speed[1:] >= 50.0) & (speed[:-1] < 50.0)].tolist()
    arrow = top.at(events[0] + 0.12 * period, high)[0]
    drawing.arrow((arrow, top.at(0, high)[1]), (arrow, top.at(0, low)[1] - 1), "flux")
    drawing.text((arrow + 6, top.at(0, 0.75 * high)[1]), "force drop", "small flux")
    drawing.text(
        top.at(events[1] + 0.46 * period, 0.14 * high), "stick phase", "small bond"
    )
    drawing.text((arrow + 8, top.at(0, low)[1] - 4), "after the event", "small")
    ticks = {t: f"{t:g}" for t in np.arange(0, stop - begin, 100.0).tolist()}
    top.frame(("", "spring force (mN)"), ({}, {0: "0", 5: "5", 10: "10"}))
    bottom = Panel(
        drawing, (60, 278), (440, 150), (0, stop - begin), (0.01, 1e4), (False, True)
    )
    bottom.curve(time, np.maximum(speed, 0.0101), "bond thick")
    for value, words in ((5.0, "stage"), (50.0, "ten times the stage")):
        bottom.curve((0, stop - begin), (value, value), "thin ink dashed")
        drawing.text((500, bottom.at(0, value)[1] - 4), words, "small", "end")
    left, right = (bottom.at(x, 1)[0] for x in events[:2])
    for x in (left, right):
        drawing.line([(x, 274), (x, 428)], "thin faint")
    drawing.arrow((left, 282), (right, 282), "ink")
    drawing.arrow((right, 282), (left, 282), "ink")
    drawing.text(((left + right) / 2, 298), "recurrence time", "small", "middle")
    bottom.frame(
        ("time (ms)", "speed of the slider (mm/s)"),
        (ticks, {0.01: "0.01", 1: "1", 100: "100"}),
    )
    return drawing


def thin_layer() -> Drawing:
    """Return a layer on a rigid base, the depth of short and long waves, and the compliance over q h."""
    drawing = Drawing("A layer on a rigid base", 610)
    _solid(drawing, (260, 130, 60), 190)
    _sphere(drawing, (260, 118 - math.sqrt(170**2 - 60**2)), 170, 24)
    drawing.text((260, 60), "sphere", anchor="middle")
    drawing.text((32, 165), "soft layer", "small")
    drawing.box((20, 190), (480, 12), "fill-faint")
    drawing.text((32, 220), "rigid base", "small")
    drawing.arrow((470, 158), (470, 131), "ink")
    drawing.arrow((470, 162), (470, 189), "ink")
    drawing.text((462, 165), "thickness h", "small", "end")
    for left, wave, count, look, words in (
        (20.0, 20.0, 11, "bond", "short wave: as on a half-space"),
        (280.0, 220.0, 1, "flux", "long wave: the base holds it"),
    ):
        top, base, width = 264.0, 322.0, wave * count
        along = np.linspace(0, width, 12 * count + 25)
        depth = min(wave / math.pi, base - top)
        drawing.box((left, top), (width, base - top), "fill-solid")
        drawing.area(
            [
                (left, top),
                (left + width, top),
                (left + width, top + depth),
                (left, top + depth),
            ],
            f"fill-{look} pale",
        )
        drawing.line(
            ((left + x, top - 7 * math.sin(2 * math.pi * x / wave)) for x in along),
            look,
        )
        drawing.box((left, base), (width, 8), "fill-faint")
        drawing.text((left, 250), words, f"small {look}")
    panel = Panel(drawing, (70, 390), (420, 170), (0.05, 20), (0.008, 2), (True, True))
    x = np.geomspace(0.05, 20, 121)
    panel.curve(x, np.minimum(layer.across(x), 2.0), "bond thick")
    panel.curve(x, layer.along_held(x), "flux thick")
    panel.curve((0.05, 20), (1.0, 1.0), "thin bond dashed")
    panel.curve((0.05, 20), (0.5, 0.5), "thin flux dashed")
    drawing.text(panel.at(0.06, 0.68), "across the sliding", "small bond")
    drawing.text(panel.at(0.4, 0.045), "along the sliding", "small flux")
    drawing.text((490, 380), "dashed: half-space", "small", "end")
    panel.frame(
        ("wavenumber times thickness, q h", "displacement per stress, times G q"),
        (
            {0.1: "0.1", 1: "1", 10: "10"},
            {0.01: "0.01", 0.1: "0.1", 1: "1"},
        ),
    )
    return drawing


def members() -> Drawing:
    """Return contacts that differ in their random stress, their areas over time, and the mean of all."""
    drawing = Drawing("Members of an ensemble, their mean and its standard error", 540)
    draws, radius = np.random.default_rng(7), 48.0
    cells = 14
    for k, look in enumerate(("bond", "flux", "glue")):
        centre = (90.0 + 140.0 * k, 90.0)
        drawing.text((centre[0], 26), f"member {k + 1}", f"title {look}", "middle")
        wave = np.fft.fftfreq(cells)
        weight = np.exp(-((wave[:, None] ** 2 + wave**2) * 22.0))
        noise = np.fft.fft2(draws.standard_normal((cells, cells)))
        field = np.fft.ifft2(weight * noise).real
        field /= 2.2 * field.std()
        size = 2.0 * radius / cells
        for i, j in np.ndindex(field.shape):
            x = centre[0] + (j - 0.5 * (cells - 1)) * size
            y = centre[1] + (i - 0.5 * (cells - 1)) * size
            if math.hypot(x - centre[0], y - centre[1]) < radius - 0.3 * size:
                share = min(abs(float(field[i, j])), 1.0)
                drawing.dot(
                    (x, y),
                    0.8 + 2.6 * share,
                    "fill-flux" if field[i, j] > 0 else "fill-faint",
                )
        drawing.dot(centre, radius, f"line {look}")
    drawing.text((452, 96), "…", "title")
    drawing.text(
        (20, 162),
        "The same contact with other random shear stress: large dots are large",
        "small",
    )
    drawing.text(
        (20, 179),
        "fluctuations, orange along the friction and grey against it.",
        "small",
    )
    changes = {
        "drive": {"model": "steady", "speed": "5 mm/s"},
        "ensemble.members": 24,
        "clock.duration": "0.02 s",
        "clock.step": "0.2 ms",
        "clock.record": "0.2 ms",
    }
    dataset = sim.run(sim.load(ROOT / "scenarios" / "pdms_lens.toml", changes))
    area = 1e6 * dataset.contact_area.squeeze().transpose("member", "t").values
    time = 1e3 * dataset.t.values
    mean, error = area.mean(0), area.std(0, ddof=1) / math.sqrt(len(area))
    ends = float(area.min()), float(area.max())
    panel = Panel(drawing, (70, 232), (420, 230), (0, 20), ends)
    for row in area[3:12]:
        panel.curve(time, row, "thin faint")
    for row, look in zip(area[:3], ("bond", "flux", "glue"), strict=True):
        panel.curve(time, row, look)
    panel.between(time, mean - error, mean + error, "fill-ink pale")
    panel.curve(time, mean, "ink thick")
    first = math.ceil(1e3 * ends[0]) / 1e3
    values = np.arange(first, ends[1], 1e-3).tolist()
    panel.frame(
        ("time (ms), sliding at 5 mm/s", "contact area (mm²)"),
        ({t: f"{t:g}" for t in (0, 5, 10, 15, 20)}, {v: f"{v:.3f}" for v in values}),
    )
    drawing.text(
        (20, 528),
        "Thick: mean of 24 members with its standard error. Coloured: as above.",
        "small",
    )
    return drawing


def map_axes() -> Drawing:
    """Return the rows of a file with a map of the stress, and the map under a moving contact."""
    drawing = Drawing("Axes of a map of the shear stress", 250)
    values = np.random.default_rng(3).standard_normal((5, 5))
    values = 40.0 + 12.0 * (values + np.roll(values, 1, 1) + np.roll(values, 1, 0))
    drawing.text((20, 30), "file", "title")
    drawing.text((300, 30), "interface", "title")
    drawing.box((20, 62), (200, 160), "fill-solid")
    for i, j in np.ndindex(values.shape):
        drawing.text((54 + 40 * j, 88 + 29 * i), f"{values[i, j]:.0f}", "small", "end")
        share = min(max((values[i, j] - 10.0) / 70.0, 0.05), 1.0)
        centre = (318.0 + 36.0 * j, 84.0 + 29.0 * i)
        drawing.dot(centre, 13.0 * math.sqrt(share), "fill-flux")
    for left in (20.0, 300.0):
        drawing.arrow((left, 50), (left + 70, 50), "ink")
        drawing.text((left + 76, 54), "x, sliding", "small")
        drawing.arrow((left - 8, 62), (left - 8, 132), "ink")
        drawing.text((left - 12, 148), "y", "small")
    drawing.dot((372, 142), 42, "line bond thick")
    drawing.text((400, 238), "contact", "small bond", "middle")
    drawing.line([(388, 226), (380, 184)], "thin bond")
    return drawing


def loads() -> Drawing:
    """Return the area over the speed at three loads, and the friction coefficient over the load."""
    drawing = Drawing("Contact area and friction coefficient at several loads", 530)
    starter = ROOT / "sim" / "starter.toml"
    one = {"shear.model": "mean", "ensemble.members": 1}
    top = Panel(drawing, (64, 46), (420, 170), (0.01, 100), (0.4, 1.02), (True, False))
    looks = {"1 mN": "bond", "4 mN": "ink", "16 mN": "flux"}
    for k, (load, look) in enumerate(looks.items()):
        dataset = sim.run(sim.load(starter, {**one, "contact.load": load}))
        every = dataset.squeeze()
        share = (every.contact_area / every.jkr_radius**2 / math.pi).values
        top.curve(1e3 * every.speed.values, share, f"{look} thick")
        drawing.text((84, 120 + 18 * k), load, look)
    top.frame(
        ("sliding speed (mm/s)", "contact area, over that at rest"),
        (
            {0.01: "0.01", 0.1: "0.1", 1: "1", 10: "10", 100: "100"},
            {0.4: "0.4", 0.6: "0.6", 0.8: "0.8", 1.0: "1"},
        ),
    )
    bottom = Panel(drawing, (64, 310), (420, 160), (0.5, 32), (0, 12), (True, False))
    steady = {**one, "drive": {"model": "steady", "speed": "1 mm/s"}}
    values = np.geomspace(0.5, 32.0, 13)  # mN; every second is a power of two
    sweep = {"sweep": {"contact.load": [f"{value:.6g} mN" for value in values]}}
    dataset = sim.run(sim.load(starter, {**steady, **sweep})).isel(t=-1).squeeze()
    coefficient = (dataset.friction_force / dataset.normal_load).values
    bottom.curve(values, coefficient, "ink thick")
    for load, look in zip((1.0, 4.0, 16.0), looks.values(), strict=True):
        at = float(np.interp(math.log(load), np.log(values), coefficient))
        drawing.dot(bottom.at(load, at), 5, f"fill-{look}")
    bottom.frame(
        ("load (mN)", "friction coefficient at 1 mm/s"),
        (
            {1: "1", 4: "4", 16: "16"},
            {0: "0", 5: "5", 10: "10"},
        ),
    )
    return drawing


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    "experiment": experiment,
    "energy_balance": energy_balance,
    "bond_life": bond_life,
    "bands": bands,
    "slip_cycle": slip_cycle,
    "thin_layer": thin_layer,
    "members": members,
    "map_axes": map_axes,
    "loads": loads,
}


def main(names: Sequence[str]) -> None:
    """Write the drawings of the given names, or all."""
    FOLDER.mkdir(exist_ok=True)
    for name in names or DRAWINGS:
        path = FOLDER / f"{name}.svg"
        path.write_text(DRAWINGS[name]().svg() + "\n", encoding="utf-8", newline="\n")
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
