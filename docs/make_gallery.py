"""Writes docs/gallery: a page for each question with its figure, its answer and its commands, and an index of all.

``python docs/make_gallery.py`` runs all scenarios; with names, those alone; with ``--text``, none. The numbers of the
answers are kept in ``gallery/numbers.json``, from which the pages are made. The labels of the pictures are kept in
``gallery/labels.json``, by which a test finds a picture with labels that the program no longer draws.
"""

import io
import json
import math
import re
import shlex
import sys
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import sim
from sim import laws, read
from sim.read import Estimate, concise, distribution, over_members
from sim.read.events import incipient_law
from sim.solid import HalfSpace, Layer
from sim.study.fit import Fit, figure as fitted, zero_figure
from sim.study.likelihood import LEVEL
from sim.study.mechanisms import WHOLE
from sim.study.plan import Plan, figure as planned

ROOT = Path(__file__).parent.parent
FOLDER = Path(__file__).with_name("gallery")
NUMBERS, LABELS = FOLDER / "numbers.json", FOLDER / "labels.json"
#: Pictures of other pages, each with its scenario.
BESIDE = {
    "../first_contact": ROOT / "sim" / "starter.toml",
    "../pdms_lens": ROOT / "scenarios" / "pdms_lens.toml",
}
HEAD = """# Gallery

Each question below leads to a page with its figure, its answer and the commands that give the figure. The shortest
example:

    sim run scenarios/pull_off.toml
    sim plot outputs/pull_off.nc

Each page links to its scenario, which states the assumptions. If members differ, a number is the mean over the members.
Its standard error stands in brackets and refers to the last digits. The command `make gallery` computes all numbers and
figures.
"""
#: Headings of the index, each with the first of its questions.
TOPICS = {
    "uniform_stress": "The sliding contact",
    "friction_maximum": "Friction",
    "stick_slip": "Stick-slip",
    "motor_clutch": "Single bonds",
    "fixed_grips": "Pull-off",
    "measured_lens": "Measured data",
}
#: Pixels an inch and colours of a picture, the first with which it is small enough, and its bytes.
FINENESS, MOST_BYTES = (
    ((140, 256), (120, 256), (110, 128), (100, 128), (90, 64)),
    60_000,
)
#: A number of an answer, or one with its standard error.
Number = float | tuple[float, float]


Reading = Callable[[Any], dict[str, Number]]


class _Certain(float):
    """A number without an error, to four digits where the answer does not say otherwise."""

    def __format__(self, spec: str) -> str:
        return float.__format__(self, spec or ".4g")


class Entry(NamedTuple):
    """A question to a scenario: ``numbers`` reads them from its dataset, ``answer`` has a place for each.

    ``changes`` are overrides of the scenario, ``kind`` is that of the figure, ``where`` the values of swept keys that
    it shows, ``units`` some of its axes and ``choices`` further options; ``name`` is that of the picture. With ``free``
    keys the scenario is fitted to the table of its name, and ``numbers`` reads the fit. With a table of
    ``points`` as well, ``numbers`` reads the plan of a measurement. A fit of the kind ``zero`` reads a file of an
    instrument, and its figure is the profile of the free zeros.
    """

    name: str
    scenario: str
    question: str
    answer: str
    numbers: Reading
    kind: str | None = None
    changes: Mapping[str, Any] = MappingProxyType({})
    where: Mapping[str, str] = MappingProxyType({})
    units: tuple[str, ...] = ()
    choices: Mapping[str, Any] = MappingProxyType({})
    free: tuple[str, ...] = ()
    points: str = ""

    @property
    def picture(self) -> Path:
        """The picture, which moves if its kind does."""
        return FOLDER / f"{self.name}.{'gif' if self.kind == 'movie' else 'png'}"

    @property
    def table(self) -> Path:
        """The table to which the scenario is fitted."""
        suffix = "txt" if self.kind == "zero" else "csv"
        return ROOT / "scenarios" / f"{self.scenario}.{suffix}"

    @property
    def commands(self) -> list[str]:
        """Commands that give the figure at a terminal."""
        path = f"scenarios/{self.scenario}"
        if self.free:
            free = "".join(f" --free {shlex.quote(key)}" for key in self.free)
            table = f"scenarios/{self.table.name}"
            if self.points:
                table = f"--plan scenarios/{self.points}.csv"
            return [f"sim fit {path}.toml {table}{free} -o outputs/{self.name}"]
        options = "".join(
            f" --set '{key}={_toml(value)}'" for key, value in self.changes.items()
        )
        output = f" -o outputs/{self.name}.nc" if self.name != self.scenario else ""
        chosen = "".join(
            f" --where '{key}={value}'" for key, value in self.where.items()
        )
        chosen += "".join(f" --units {unit}" for unit in self.units)
        words = {"start": "from", "stop": "to"}
        chosen += "".join(
            f" --{words.get(name, name)} {shlex.quote(str(value))}"
            for name, value in self.choices.items()
        )
        shown = " ".join(
            filter(None, ["sim plot", f"outputs/{self.name}.nc", self.kind])
        )
        return [f"sim run {path}.toml{options}{output}", f"{shown}{chosen}"]

    def run(self) -> Any:
        """Return the dataset of the question, or the fit."""
        path = ROOT / "scenarios" / f"{self.scenario}.toml"
        if self.points:
            return sim.plan(path, path.with_name(f"{self.points}.csv"), self.free)
        if self.free:
            return sim.fit(path, self.table, self.free)
        return sim.run(sim.load(path, dict(self.changes)))

    def figure(self, result: Any, to: Path | None = None) -> Figure:
        """Return the figure of the question, and save it if asked."""
        if self.points:
            return planned(result)
        if self.kind == "zero":
            return zero_figure(result)
        if self.free:
            return fitted(result.problem, result.best)
        chosen: Any = {"where": dict(self.where), "units": self.units, **self.choices}
        return sim.plot(result, self.kind, to, **chosen)

    def draw(self, result: Any) -> list[str]:
        """Make the picture, of few colours and as many pixels as its size allows.

        Returns its labels, none for a movie, whose frames differ.
        """
        if self.kind == "movie":
            self.figure(result, self.picture)
            return []
        figure = self.figure(result)
        for dpi, colours in FINENESS:
            drawn, small = io.BytesIO(), io.BytesIO()
            figure.savefig(drawn, format="png", dpi=dpi)
            # rare colours, such as those of a bar's ends, stay
            picture = Image.open(drawn).convert("RGB")
            palette = {
                "method": Image.Quantize.MAXCOVERAGE,
                "dither": Image.Dither.NONE,
            }
            picture.quantize(colours, **palette).save(small, "png", optimize=True)
            if small.tell() < MOST_BYTES:
                break
        self.picture.write_bytes(small.getvalue())
        return labels(figure)

    def text(self, numbers: dict[str, Any]) -> str:
        """Return the page with the question, its figure, its answer and the commands."""
        commands = "\n".join(f"    {command}" for command in self.commands)
        figure = f"![{self.question}]({self.picture.name})"
        scenario = f"[`{self.scenario}.toml`](../../scenarios/{self.scenario}.toml)"
        links = f"Scenario: {scenario}. [All questions](README.md)."
        answer = textwrap.fill(
            self.filled(numbers), 120, break_long_words=False, break_on_hyphens=False
        )
        return f"# {self.question}\n\n{answer}\n\n{figure}\n\n{commands}\n\n{links}\n"

    def filled(self, numbers: dict[str, Any]) -> str:
        """Return the answer with its numbers."""
        shown = {
            name: concise(*value) if isinstance(value, list | tuple) else value
            for name, value in numbers.items()
        }
        shown = {
            name: _Certain(value) if isinstance(value, float) else value
            for name, value in shown.items()
        }
        return " ".join(self.answer.format(**shown).split())


def labels(figure: Figure) -> list[str]:
    """Return the words of a figure: legends, titles and names of axes, without the numbers at ticks.

    Lines of a text are joined, because a text is broken only when its figure is drawn.
    """
    texts = {text.get_text().replace("\n", " ") for text in figure.findobj(Text)}
    return sorted(
        text
        for text in texts
        if re.search("[A-Za-z]{2}", text) and "mathdefault" not in text
    )


def _toml(value: Any) -> str:
    """Return a value as an override of the command line."""
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f'"{key}" = {_toml(inner)}' for key, inner in value.items())
            + "}"
        )
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(
        value, ensure_ascii=False
    )  # as TOML writes text, booleans and numbers


def pair(one: Estimate, factor: float = 1.0, **at: float) -> Number:
    """A mean with its standard error where it has one, at the records nearest to some values."""
    index = {name: nearest(one.value[name], value) for name, value in at.items()}
    there = one.isel(index)
    value = factor * float(there.value.squeeze())
    error = math.nan if there.sem is None else factor * float(there.sem.squeeze())
    return (value, error) if error > 0.0 else value


def mean(
    variable: str, dataset: xr.Dataset, factor: float = 1.0, **at: float
) -> Number:
    """Mean over the members with its standard error."""
    return pair(over_members(dataset, [variable])[variable], factor, **at)


def share(variable: str, dataset: xr.Dataset, **at: float) -> Number:
    """Mean share of JKR's area with its standard error [%]."""
    return pair(over_members(dataset, [variable])[variable], 100.0, **at)


def area_left(dataset: xr.Dataset) -> xr.DataArray:
    """Mean area at the end of the run over JKR's [%]."""
    last = over_members(dataset.isel(t=[-1]), ["area_ratio"])["area_ratio"]
    return 100.0 * last.value.isel(t=0)


def modulus_of(dataset: xr.Dataset) -> float:
    """Shear modulus of the half-space, the same at all points of the sweep [Pa]."""
    return float(dataset["effective_shear_modulus"].max())


def nearest(values: xr.DataArray, wanted: float) -> int:
    """Place of the value that is nearest."""
    return int(np.argmin(np.abs(values.to_numpy() - wanted)))


def speeds(dataset: xr.Dataset) -> xr.DataArray:
    """Prescribed speed over time, at the first point of the sweep [m/s]."""
    course = read.speed_of(dataset)
    return course.isel({name: 0 for name in course.dims if name != "t"})


def at_speed(dataset: xr.Dataset, speed: float) -> tuple[float, float]:
    """Time [s] and speed [m/s] of the record whose speed is nearest."""
    course = speeds(dataset)
    place = nearest(course, speed)
    return float(dataset["t"][place]), float(course[place])


#: All questions, in the order of the index.
ENTRIES: list[Entry] = []


def asks(
    scenario: str, question: str, answer: str, **how: Any
) -> Callable[[Reading], Reading]:
    """Add a question; the function below it reads the numbers of its answer from the dataset."""

    def add(reading: Reading) -> Reading:
        ENTRIES.append(
            Entry(reading.__name__, scenario, question, answer, reading, **how)
        )
        return reading

    return add


@asks(
    "uniform_stress",
    "Does a uniform shear stress change the contact?",
    """No. From {low:g} to {high:g} MPa the contact radius under {load:g} mN stays {radius:.2f} µm (it changes by
    {change:g} %). Friction grows to {friction:.1f} mN. The contact does not change because the drive supplies all
    the energy that a uniform stress stores. The command `sim paper` checks this theorem of the paper line by
    line.""",
)
def uniform_stress(dataset: xr.Dataset) -> dict[str, Number]:
    stress, load = 1e-6 * dataset["bonds_stress"], 1e3 * dataset["contact_load"]
    radii = 1e6 * dataset["contact_radius"].isel(t=-1, contact_load=-2)
    change = 100.0 * float(abs(radii / radii[0] - 1.0).max())
    friction = 1e3 * dataset["friction_force"].isel(t=-1, contact_load=-2)
    return {
        "low": float(stress[0]),
        "high": float(stress[-1]),
        "load": float(load[-2]),
        "radius": float(radii[-1]),
        "change": change,
        "friction": float(friction[-1]),
    }


@asks(
    "theories",
    "What do other theories say about a uniform shear stress?",
    """Most of them predict a smaller contact. At {stress:g} kPa, the corrected theory keeps JKR's area. If adhesion
    supplies a share α = {share:g} of the energy of the mean stress, {some:.1f} % of JKR's area are left. If
    adhesion supplies all of it, {all:.1f} % are left, which is Hertz's area. In Savkoor and Briggs' theory the
    contact sticks; at {ends:.1f} mN of tangential force it jumps to Hertz. In the uncorrected theory of 2018
    friction enlarges the contact.""",
    kind="theories",
)
def theories(dataset: xr.Dataset) -> dict[str, Number]:
    place = nearest(dataset["bonds_stress"], 50e3)
    ratio = area_left(dataset).isel(bonds_stress=place)
    numbers = (
        float(dataset[name])
        for name in ("contact_load", "adhesion_work", "sphere_radius")
    )
    return {
        "stress": 1e-3 * float(dataset["bonds_stress"][place]),
        "share": float(dataset["contact_reversible"][1]),
        "some": float(ratio[1]),
        "all": float(ratio[2]),
        "ends": 1e3 * float(laws.theories.savkoor_briggs_limit(*numbers)),
    }


@asks(
    "masking",
    "How strong must a ripple of the stress be to mask adhesion?",
    """It needs an amplitude of {amplitude:.1f} kPa at a wavelength of {wavelength:g} µm, a tenth of the contact's
    width. The stored energy then equals the work of adhesion. The contact is Hertzian, with {hertz:.1f} % of JKR's
    area. A stronger ripple does not reduce the area further.""",
)
def masking(dataset: xr.Dataset) -> dict[str, Number]:
    wavelength, work = (
        float(dataset["shear_spectrum_wavelength"]),
        float(dataset["adhesion_work"]),
    )
    unit = laws.halfspace.ripple_energy(
        1.0, 2 * np.pi / wavelength, 0.0, modulus_of(dataset)
    )
    ratio = area_left(dataset)
    return {
        "amplitude": 1e-3 * float(np.sqrt(work / unit)),
        "wavelength": 1e6 * wavelength,
        "hertz": float(ratio[-1]),
    }


@asks(
    "masking",
    "Does the direction of the ripple matter?",
    """Yes, it changes the energy by a factor of two. A ripple of {amplitude:g} kPa stores {along:.2f} mJ/m² if it
    runs along the sliding direction. Across it the ripple stores {across:.2f} mJ/m², because the half-space is half
    as stiff there. The area falls from {wide:.1f} to {narrow:.1f} % of JKR's.""",
    changes={
        "shear.spectrum.amplitude": "300 kPa",
        "sweep": {
            "shear.spectrum.angle": {"from": "0 deg", "to": "90 deg", "count": 19}
        },
    },
    units=("deg",),
)
def direction(dataset: xr.Dataset) -> dict[str, Number]:
    energy = 1e3 * dataset["fluctuation_energy"].isel(t=-1)
    ratio = area_left(dataset)
    return {
        "amplitude": 1e-3 * float(dataset["shear_spectrum_amplitude"]),
        "along": float(energy[0]),
        "across": float(energy[-1]),
        "wide": float(ratio[0]),
        "narrow": float(ratio[-1]),
    }


@asks(
    "pdms_lens",
    "Does the contact of a PDMS lens shrink because its bonds break, or because its stress fluctuates?",
    """Both contribute, under the assumptions of the scenario. At {slow:.2g} mm/s the area is still {kept} % of
    JKR's. At {fast:.2g} mm/s {left} % are left. Broken bonds, which are counted first, account for a loss of
    {bonds} %, fluctuations for {fluctuations} %. The scenario prescribes the onset of the fluctuations;
    [behind a spring](pdms_lens_spring.md) nothing prescribes it.""",
)
def pdms_lens(dataset: xr.Dataset) -> dict[str, Number]:
    (slow, slower), (fast, faster) = (
        at_speed(dataset, speed) for speed in (1e-3, 8e-3)
    )
    return {
        "slow": 1e3 * slower,
        "fast": 1e3 * faster,
        "kept": mean("area_ratio", dataset, 100.0, t=slow),
        "left": mean("area_ratio", dataset, 100.0, t=fast),
        "bonds": share("lost_to_bonds", dataset, t=fast),
        "fluctuations": share("lost_to_fluctuations", dataset, t=fast),
    }


@asks(
    "decomposition",
    "Do the two mechanisms add up?",
    """Their effects on the area do not. At {speed:.2g} mm/s broken bonds alone leave {bonds} % of the area,
    fluctuations alone {fluctuations} %. The product would be {product:.1f} %, but both together leave {both} %. The
    reductions of the work of adhesion do add up; the area is not a linear function of it.""",
)
def decomposition(dataset: xr.Dataset) -> dict[str, Number]:
    then, speed = at_speed(dataset, 8e-3)
    left = [
        mean(
            "area_ratio",
            dataset,
            100.0,
            t=then,
            adhesion_bond_share=bonds,
            shear_paid_by_adhesion=paid,
        )
        for bonds, paid in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    ]
    bonds, fluctuations = (float(np.max(each)) for each in left[:2])
    return {
        "speed": 1e3 * speed,
        "bonds": left[0],
        "fluctuations": left[1],
        "both": left[2],
        "product": 0.01 * bonds * fluctuations,
    }


@asks(
    "soft_lens",
    "How small a fluctuation masks the adhesion of a softer, larger contact?",
    """With G = {modulus:g} MPa and a contact {width:.1f} mm wide, an rms of {rms:g} kPa masks the contact {masked}
    % of the time. The fluctuations then store {energy} mJ/m². The bonds at this speed supply a work of adhesion of
    {work:.1f} mJ/m².""",
    kind="time_masked",
)
def soft_lens(dataset: xr.Dataset) -> dict[str, Number]:
    rms = 30e3
    late, at = distribution(dataset), {"shear_spectrum_rms": rms}
    work = read.bond_work(dataset).isel(t=-1)
    return {
        "modulus": 1e-6 * modulus_of(dataset),
        "width": 2e3 * float(dataset["radius_at_rest"].max()),
        "rms": 1e-3 * rms,
        "masked": pair(late["fraction_masked"], 100.0, **at),
        "energy": pair(late["fluctuation_energy"], 1e3, **at),
        "work": 1e3 * float(work.max()),
    }


@asks(
    "ten_wavelengths",
    "How wide is the area's distribution if the contact holds ten wavelengths?",
    """The standard deviation is {ten} % of the mean area. Nine contacts in ten have between {low:.1f} and
    {high:.1f} % of JKR's area. With three wavelengths the standard deviation is {three} %, with thirty {thirty} %.
    The energy is a sum over the waves in the contact. Its spread therefore falls about as one over the number of
    waves along a side.""",
    kind="histogram",
)
def ten_wavelengths(dataset: xr.Dataset) -> dict[str, Number]:
    area = dataset["contact_area"].isel(t=-1)
    ratio = over_members(dataset.isel(t=[-1]), ["area_ratio"])["area_ratio"].quantile
    ratio = ratio.isel(t=0)
    count = dataset.sizes["member"]
    spread = 100.0 * (area.std("member", ddof=1) / area.mean("member")).to_numpy()
    three, ten, thirty = (
        (float(each), float(each) / np.sqrt(2.0 * (count - 1))) for each in spread
    )
    low, high = (
        100.0 * float(ratio.isel(shear_spectrum_longest=1).sel(quantile=level))
        for level in (0.05, 0.95)
    )
    return {"three": three, "ten": ten, "thirty": thirty, "low": low, "high": high}


@asks(
    "soft_lens",
    "What does a fluctuating shear stress look like?",
    """The figure maps the stress and the displacement that it causes; the circle is the contact. Waves across the
    sliding direction move the surface twice as far as waves along it. The displacement therefore has streaks along
    x. This realisation has an rms of {rms:.1f} kPa and stores {energy:.1f} mJ/m². The displacement has an rms of
    {moved:.2f} µm.""",
    kind="map",
    changes={
        "sweep": {},
        "ensemble.members": 1,
        "shear.model": "mapped",
        "record.maps": ["2 s"],
        "clock.step": "0.1 s",
    },
)
def stress_map(dataset: xr.Dataset) -> dict[str, Number]:
    stress = dataset["shear_map"].squeeze(drop=True)
    cell = float(dataset["x"][1] - dataset["x"][0]) * dataset.sizes["x"]
    modulus = modulus_of(dataset)
    moved = laws.halfspace.displacement(stress.to_numpy(), cell, modulus)
    return {
        "rms": 1e-3 * float(stress.std()),
        "moved": 1e6 * float(np.std(moved)),
        "energy": 1e3
        * float(laws.halfspace.surface_energy(stress.to_numpy(), cell, modulus)),
    }


@asks(
    "friction_maximum",
    "Why does the friction of rubber first rise and then fall with speed?",
    """A bond that is pulled faster bears more before it breaks, but fewer sites hold a bond. Bonds under Bell's law
    have a maximum of {stress:.1f} kPa at {speed:.2f} mm/s. At that speed {bound:.0f} % of the bonds at rest are
    left. The area has then fallen by {lost:.1f} %.""",
)
def friction_maximum(dataset: xr.Dataset) -> dict[str, Number]:
    # area and bonds are as late as the stress, whose speed is that without the delay by the clock step
    top = read.observables(dataset).interp(t=float(dataset["peak_time"]))
    peaks = read.peaks(dataset)
    return {
        "stress": 1e-3 * float(peaks["peak_stress"].value),
        "speed": 1e3 * float(peaks["peak_speed"].value),
        "bound": 100.0 * float(top["bond_fraction"]),
        "lost": 100.0 - 100.0 * float(top["area_ratio"]),
    }


@asks(
    "static_peak",
    "How does the peak of static friction grow with the time at rest and the speed of the start?",
    """The peak grows with the speed, ever closer to the logarithm of the speed. After {rest:g} s at rest the peak
    is {slow:.0f} kPa at {slower:g} µm/s and {fast:.0f} kPa at {faster:g} µm/s. It rises by {first:.0f} kPa over the
    first decade of the speed and by {last:.0f} kPa over the last. With the time at rest the peak saturates: after
    {short:g} s it has {share:.0f} % of that height. A single rebinding rate gives no logarithm of time.""",
)
def static_peak(dataset: xr.Dataset) -> dict[str, Number]:
    peak, rest, speed = (
        dataset[name] for name in ("peak_stress", "drive_rest", "drive_speed")
    )
    longest, shortest = 1e-3 * peak.isel(drive_rest=-1), 1e-3 * peak.isel(drive_rest=0)
    # two speeds a decade
    first, last = (float(longest[k + 2] - longest[k]) for k in (0, -3))
    return {
        "rest": float(rest[-1]),
        "short": float(rest[0]),
        "slower": 1e6 * float(speed[0]),
        "faster": 1e6 * float(speed[-1]),
        "slow": float(longest[0]),
        "fast": float(longest[-1]),
        "share": 100.0 * float(shortest[-1] / longest[-1]),
        "first": first,
        "last": last,
    }


@asks(
    "velocity_step",
    "How does friction respond to a sudden change of the speed?",
    """Friction overshoots. When the stage jumps from {slow:g} to {fast:g} mm/s, the force rises from {before:.2f}
    mN to {peak:.2f} mN within {after:.1f} ms. The bonds are stretched further before more of them break. The force
    settles at {settled:.2f} mN. After {length:.1f} µm of sliding since the jump the overshoot has fallen to one e-th.
    Back at the old speed the force returns to {last:.2f} mN and never falls below.""",
    kind="time",
)
def velocity_step(dataset: xr.Dataset) -> dict[str, Number]:
    force, stage = (
        dataset[name].to_numpy() for name in ("friction_force", "stage_speed")
    )
    up, down = (int(place) + 1 for place in np.flatnonzero(np.diff(stage))[[0, -1]])
    top = up + int(np.argmax(force[up:down]))
    position, settled = (
        1e6 * dataset["slider_position"].to_numpy(),
        force[down - 1],
    )
    left = (
        up
        + int(
            np.flatnonzero(
                np.abs(force[up:down] - settled) > (force[top] - settled) / np.e
            )[-1]
        )
        + 1
    )
    return {
        "slow": 1e3 * float(stage[0]),
        "fast": 1e3 * float(stage[up]),
        "before": 1e3 * float(force[0]),
        "peak": 1e3 * float(force[top]),
        "settled": 1e3 * float(force[down - 1]),
        "after": 1e3 * float(dataset["t"][top] - dataset["t"][up - 1]),
        "length": float(position[left] - position[up - 1]),
        "last": 1e3 * float(force[down:].min()),
    }


@asks(
    "friction_loop",
    "How much of a stroke back and forth is sliding?",
    """In each stroke of {stage:.0f} µm the slider moves {slider:.0f} µm. The rest strains the spring and the
    contact. The slider slides at a steady {force:.2f} mN in both directions. The stage does {work:.2f} µJ of work
    in a stroke; all of it is dissipated by bonds that break.""",
)
def friction_loop(dataset: xr.Dataset) -> dict[str, Number]:
    turns = np.flatnonzero(np.diff(np.sign(dataset["stage_speed"].to_numpy())[1:])) + 1
    stage, slider, work = (
        dataset[name].to_numpy()[turns]
        for name in ("stage_position", "slider_position", "drive_work")
    )
    return {
        "stage": 1e6 * abs(float(stage[2] - stage[1])),
        "slider": 1e6 * abs(float(slider[2] - slider[1])),
        "force": 1e3 * float(abs(dataset["friction_force"]).max()),
        "work": 1e6 * float(work[2] - work[1]),
    }


@asks(
    "creep",
    "Which tangential force does a contact bear for ever, and how long a larger one?",
    """The contact bears up to {most:.2f} mN, the limit at which a cluster of Bell's bonds fails. Under {held:g} mN
    it creeps at {creep:.2f} mm/s without end. Under {more:g} mN it fails after {late:.0f} ms, under {much:g} mN
    after {soon:.1f} ms.""",
)
def creep(dataset: xr.Dataset) -> dict[str, Number]:
    names = (
        "rupture_zero_force_rate",
        "rupture_bell_force",
        "bond_stiffness",
        "rebinding_rate",
        "site_density",
    )
    area = np.pi * float(dataset["radius_at_rest"].max()) ** 2
    most = (
        laws.schallamach.first_moment_peak(
            *(float(dataset[f"bonds_{name}"]) for name in names)
        ).stress
        * area
    )
    force, last = 1e3 * dataset["drive_force"].to_numpy(), dataset.isel(t=-1)
    gone = np.flatnonzero(last["runaway_time"].notnull())
    speed, ends = 1e3 * last["speed"].to_numpy(), 1e3 * last["runaway_time"].to_numpy()
    return {
        "most": 1e3 * float(most),
        "held": float(force[gone[0] - 1]),
        "creep": float(speed[gone[0] - 1]),
        "more": float(force[gone[0]]),
        "late": float(ends[gone[0]]),
        "much": float(force[-1]),
        "soon": float(ends[-1]),
    }


@asks(
    "incipient_shear",
    "How does the contact area fall before sliding begins?",
    """The loss of area grows about as the square of the tangential force, as measured on many contacts. The
    loss grows faster when sliding begins. At the largest tangential force, {small:.1f} % of the area are lost under
    a load of {least:g} mN, {large:.1f} % under {load:g} mN; measured contacts lose one to three tenths. The
    coefficient α of the square scales with the area at rest to the power {power:.2f}; measured contacts have about
    minus three halves (dashed: this empirical law, its size taken from the middle contact). Which mechanisms can
    make such a loss at these loads? Broken bonds can, and they alone do it here. They cannot take more than
    {most:.0f} % under {least:g} mN and {fewest:.0f} % under {load:g} mN, which leaves Hertz's area. Fluctuations of
    the stress have the same limits, and this scenario has none. A uniform stress takes nothing, unless adhesion
    pays for a share of its energy (`contact.reversible`). The theory of full stick (dotted) takes all of adhesion
    at {limit:.1f} mN under {least:g} mN, at {share:.0f} % of the force at which this contact begins to slide.""",
    kind="incipient",
)
def incipient_shear(dataset: xr.Dataset) -> dict[str, Number]:
    share = read.events(dataset)["area_at_threshold"].value.to_numpy()
    load = 1e3 * dataset["contact_load"].to_numpy()
    lost, area = 100.0 * (1.0 - share), dataset["contact_area"].isel(t=0)
    curves = zip(
        *(dataset[name].to_numpy() for name in ("spring_force", "contact_area")),
        strict=True,
    )
    power = np.polyfit(
        np.log(area), np.log([incipient_law(*curve)[1] for curve in curves]), 1
    )[0]
    work, size, modulus = (
        float(dataset[name].max())
        for name in ("adhesion_work", "sphere_radius", "contact_modulus")
    )
    held = 1e-3 * load
    hertz = np.pi * laws.jkr.hertz_radius_at_load(held, size, modulus) ** 2
    most = 100.0 * (1.0 - hertz / area.to_numpy())
    limit = 1e3 * float(laws.theories.savkoor_briggs_limit(held[0], work, size))
    threshold = 1e3 * read.events(dataset)["static_threshold"].value.to_numpy()
    return {
        "small": float(lost[0]),
        "least": float(load[0]),
        "large": float(lost[-1]),
        "load": float(load[-1]),
        "power": float(power),
        "most": float(most[0]),
        "fewest": float(most[-1]),
        "limit": limit,
        "share": 100.0 * limit / float(threshold[0]),
    }


@asks(
    "incipient_fit",
    "How does the loss of area before sliding depend on the size of the contact?",
    """In this made-up table the area falls as A₀ − αQ², and α falls with the area at rest to the power {exponent}.
    At {area:g} mm² the coefficient α is {shrinkage} mm²/N². The table was made with a power of {power:g} and
    {made:g} mm²/N². The law is
    empirical, so that the fit says nothing of its cause. `--compare` fits theories of a sticking contact to the same
    points. Here each of them is rejected: it predicts much more loss, or a loss that depends otherwise on the size.""",
    free=("incipient.shrinkage", "incipient.exponent"),
)
def incipient_fit(result: Fit) -> dict[str, Number]:
    shrinkage, exponent = result.numbers
    return {
        "shrinkage": (1e6 * shrinkage.value, 1e6 * shrinkage.error),
        "exponent": (exponent.value, exponent.error),
        "area": 1e6 * float(result.scenario.incipient.area),
        # of the table
        "made": 200.0,
        "power": 1.5,
    }


@asks(
    "slide_hold_slide",
    "How does static friction grow with the time at rest?",
    """It saturates, because these bonds rebind with a single rate. If the spring is relaxed during the holds, the peak
    grows from {short:.1f} mN after {least:g} ms to {long:.1f} mN after {most:g} s, and saturates after {after:g} s. If
    the stage rests, the spring still pulls. The slider creeps on, its stretched bonds break sooner, and the peak is
    only {low:.1f} mN after {least:g} ms. It reaches {high:.1f} mN after {most:g} s, because by then the spring has
    relaxed by itself. A growth with the logarithm of time would need a distribution of rates.""",
)
def slide_hold_slide(dataset: xr.Dataset) -> dict[str, Number]:
    each = read.peaks_after_holds(dataset)
    peaks, held = (
        each[name].dropna("phase", how="all").to_numpy()
        for name in ("peak_after_hold", "time_held")
    )
    rest, unloaded = 1e3 * peaks
    saturation = read.events(dataset)["hold_saturation"].value.to_numpy()
    return {
        "short": float(unloaded[0]),
        "long": float(unloaded[-1]),
        "low": float(rest[0]),
        "high": float(rest[-1]),
        "least": 1e3 * float(held[0, 0]),
        "most": float(held[0, -1]),
        "after": float(saturation[1]),
    }


@asks(
    "stick_slip",
    "At which speed does a lens behind a soft spring begin to stick and slip?",
    """Slip events set in between {steady:.1f} and {onset:.1f} mm/s as the stage speed increases. Nothing prescribes
    the onset. In steady sliding the friction force is largest at {force:.1f} mm/s and the stress of the bonds at
    {peak:.1f} mm/s, below the onset. From then on the force falls by {drop:.1f} mN in each slip event of
    {slip:.0f} µm. Slip events begin at {static:.1f} mN, and the mean force is {kinetic:.1f} mN.""",
    kind="time",
)
def stick_slip(dataset: xr.Dataset) -> dict[str, Number]:
    names = (
        "rupture_zero_force_rate",
        "rupture_bell_force",
        "bond_stiffness",
        "rebinding_rate",
        "site_density",
    )
    peak = laws.schallamach.first_moment_peak(
        *(float(dataset[f"bonds_{name}"]) for name in names)
    )
    speeds = np.geomspace(1e-3, 1e-2, 1001)
    steady = sim.steady_curves(sim.load(ROOT / "scenarios" / "stick_slip.toml"), speeds)
    mean, times = read.slips(dataset).mean("slip"), dataset["slip_time"]
    # from the first slip event to the last
    stage = dataset.sel(t=slice(float(times[0]), float(times[-1])))
    path, work = (
        float(stage[name][-1] - stage[name][0])
        for name in ("stage_position", "drive_work")
    )
    return {
        "steady": 1e3 * float(dataset["onset_steady_speed"]),
        "onset": 1e3 * float(dataset["onset_slip_speed"]),
        "force": 1e3 * float(speeds[int(steady["friction_force"].argmax("speed"))]),
        "peak": 1e3 * float(peak.speed),
        "drop": 1e3 * float(mean["force_drop"]),
        "slip": 1e6 * float(mean["slip_amplitude"]),
        "static": 1e3 * float(mean["static_friction"]),
        "kinetic": 1e3 * work / path,
    }


@asks(
    "stability_map",
    "For which springs and speeds does a slider stick and slip, and does the history matter?",
    """Springs softer than the theory's boundary (blue) give stick-slip, with a delay. Behind {soft:g} N/m
    stick-slip begins at {up:.1f} mm/s as the speed increases. As the speed decreases, it ends at {down:.1f} mm/s.
    Behind {stiff:.0f} N/m and more there is none here, because the slider leaves the unstable speeds before a
    disturbance has grown.""",
    kind="stability",
)
def stability_map(dataset: xr.Dataset) -> dict[str, Number]:
    events, stiffness = (
        read.stick_slip(dataset),
        dataset["drive_stiffness"].to_numpy(),
    )
    up, down = (
        1e3 * float(events[name].value[0])
        for name in ("onset_slip_speed", "end_slip_speed")
    )
    calm = events["end_slip_speed"].value.isnull().to_numpy()
    return {
        "soft": float(stiffness[0]),
        "up": up,
        "down": down,
        "stiff": float(stiffness[np.argmax(calm)]),
    }


@asks(
    "pdms_lens_spring",
    "Does the lens shrink at the onset of stick-slip if nothing prescribes it?",
    """Yes, because of the fluctuations. At {slow:g} mm/s the lens slides steadily, with a mean area of {before} % of
    JKR's. At {fast:g} mm/s the lens sticks and slips, with a mean area of {after} %. The loss to broken bonds falls
    from {bonded} to {bonds} %, because bonds recover in the stick phases. Unsteady sliding makes fluctuations: the
    loss to them rises from {calm} to {noise} %. Three things are assumed: an rms of {rms:g} kPa, a memory of
    {length:g} µm of sliding, and a damping. Without the damping the area would not fall there.""",
)
def pdms_lens_spring(dataset: xr.Dataset) -> dict[str, Number]:
    late = read.distribution(dataset)
    slow, fast = {"drive_stage": 2e-3}, {"drive_stage": 3e-3}
    area, bonds = late["area_ratio"], late["lost_to_bonds"]
    noise = late["lost_to_fluctuations"]
    return {
        "before": pair(area, 100.0, **slow),
        "after": pair(area, 100.0, **fast),
        "slow": 2.0,
        "fast": 3.0,
        "bonds": pair(bonds, 100.0, **fast),
        "bonded": pair(bonds, 100.0, **slow),
        "noise": pair(noise, 100.0, **fast),
        "calm": pair(noise, 100.0, **slow),
        "rms": 1e-3 * float(dataset["shear_spectrum_rms"]),
        "length": 1e6 * float(dataset["shear_correlation_length"]),
    }


@asks(
    "pdms_lens_spring",
    "What happens in a slip event?",
    """The movie shows one member in slow motion. The stage pulls at {speed:g} mm/s through the spring. The dots lie on
    the half-space. In a stick phase the slider hardly moves over them, and the spring force rises to {before:.1f} mN.
    In the slip event that begins at {time:.0f} ms the slider moves by {slip:.0f} µm in {lasts:.0f} ms, and the force
    falls to {after:.1f} mN. The area is smallest in this slip event: {small:.0f} % of JKR's, which is dotted. Broken
    bonds take {bonds:.0f} % of it there, fluctuations {noise:.0f} %.""",
    kind="movie",
    where={"drive.stage": "3 mm/s"},
    choices={"member": 0, "start": "1 s", "stop": "1.2 s"},
)
def slip_event(dataset: xr.Dataset) -> dict[str, Number]:
    shown = dataset.sel(drive_stage=3e-3, member=0)
    event = int(np.argmax(shown["slip_time"].to_numpy() > 1.0))
    begin, end, moved = (
        float(shown[f"slip_{name}"][event]) for name in ("time", "end", "amplitude")
    )
    force = {
        name: 1e3 * float(shown[f"slip_force_{name}"][event])
        for name in ("before", "after")
    }
    within = shown.sel(t=slice(begin, end))
    least = within.isel(t=int(within["contact_radius"].argmin("t")))
    area, left = (
        100.0 * float(least[name] / least["jkr_radius"]) ** 2
        for name in ("contact_radius", "bonds_radius")
    )
    return force | {
        "speed": 3.0,
        "time": 1e3 * begin,
        "slip": 1e6 * moved,
        "lasts": 1e3 * (end - begin),
        "small": area,
        "bonds": 100.0 - left,
        "noise": left - area,
    }


@asks(
    "motor_clutch",
    "On which substrate does a cell pull hardest: soft, stiff, or in between?",
    """In between. The stiffness of the contact stands for that of the substrate. At {best:g} pN/nm the clutches
    (bonds) bear {most} of the {motors:g} pN that the motors can pull. At {soft:g} pN/nm they bear {softly} pN,
    because they are loaded for so long that they fail together. At {stiff:g} pN/nm they bear {stiffly} pN, because
    each is torn off soon after it has bound. The filament then glides at {glides} nm/s, hardly slower than without
    clutches. These are means over the second half of the run.""",
    kind="sweep",
)
def motor_clutch(dataset: xr.Dataset) -> dict[str, Number]:
    late = read.summary(read.settled(dataset[["friction_force"]]), quantiles=False)
    friction = late["friction_force"]
    stiffness, best = (
        dataset["drive_contact_stiffness"].to_numpy(),
        int(np.argmax(friction.value.to_numpy())),
    )
    at = {"most": best, "softly": 0, "stiffly": -1}
    numbers = {
        name: pair(friction.isel({"drive_contact_stiffness": k}), 1e12)
        for name, k in at.items()
    }
    borne = np.array(numbers["stiffly"])
    numbers["glides"] = 120.0 - 1.2 * float(borne[0]), 1.2 * float(borne[1])
    numbers["motors"] = 1e12 * float(dataset["drive_force"])
    return numbers | {
        name: 1e3 * float(stiffness[k])
        for name, k in (("best", best), ("soft", 0), ("stiff", -1))
    }


@asks(
    "bond_noise",
    "Do the bonds themselves make fluctuations that matter?",
    """Hardly. They store at most {energy:.2f} mJ/m², {part:.2f} % of the work of adhesion. At that speed broken
    bonds cost {bonds:.0f} % of it. Either adhesion supplies that energy (χ = 1), or friction has already supplied
    it (χ = 0). The choice changes the area by at most {moved:.2f} %.""",
)
def bond_noise(dataset: xr.Dataset) -> dict[str, Number]:
    energy = dataset["fluctuation_energy"].max("shear_paid_by_adhesion")
    work, top = float(dataset["adhesion_work"]), int(energy.argmax("t"))
    area = dataset["contact_area"]
    moved = 1.0 - area.isel(shear_paid_by_adhesion=1) / area.isel(
        shear_paid_by_adhesion=0
    )
    fraction = dataset["bond_fraction"].isel(t=top).min()
    return {
        "energy": 1e3 * float(energy[top]),
        "part": 100.0 * float(energy[top]) / work,
        "bonds": 100.0 - 100.0 * float(fraction),
        "moved": 100.0 * float(moved.max()),
    }


@asks(
    "fixed_grips",
    "What changes if the indentation is fixed instead of the load?",
    """The contact holds longer. At an indentation of {deep:g} µm it keeps {kept} % of its JKR area at {speed:.0f}
    mm/s. At {high:g} µm the sphere is held above the surface, where no load could hold it. There {open} % of the
    members detach as the speed increases, half of them within {off:.0f} ms, at which the speed is {at:.1f} mm/s.""",
)
def fixed_grips(dataset: xr.Dataset) -> dict[str, Number]:
    depth, events = dataset["contact_indentation"], read.Run(dataset).events
    high, deep = {"contact_indentation": 0}, {"contact_indentation": -1}
    then = float(events["half_detached"].isel(high).value)
    last = over_members(dataset.isel(t=[-1]), ["area_ratio"])["area_ratio"]
    return {
        "deep": 1e6 * float(depth[-1]),
        "high": 1e6 * float(depth[0]),
        "kept": pair(last.isel(deep), 100.0),
        "speed": 1e3 * float(speeds(dataset)[-1]),
        "open": pair(events["ever_detached"].isel(high), 100.0),
        "off": 1e3 * then,
        "at": 1e3 * float(speeds(dataset).sel(t=then, method="nearest")),
    }


@asks(
    "pull_off",
    "At which load does a sphere behind a soft or a stiff spring pull off?",
    """The largest pull is {pull:.3f} mN for all springs, as in JKR theory. The energy lost in a cycle differs:
    {soft:.2f} nJ behind {softest:g} N/m and {stiff:.2f} nJ behind {stiffest:g} N/m. Behind the soft spring the
    sphere jumps off far from the surface, behind the stiff spring close to it. The material itself dissipates
    nothing.""",
)
def pull_off(dataset: xr.Dataset) -> dict[str, Number]:
    lost = 1e9 * read.loop_energy(dataset)["loop_dissipation"].mean("cycle")
    stiffness = dataset["contact_stiffness"]
    return {
        "pull": -1e3 * float(dataset["lowest_load"].min()),
        "soft": float(lost[0]),
        "stiff": float(lost[-1]),
        "softest": float(stiffness[0]),
        "stiffest": float(stiffness[-1]),
    }


@asks(
    "thin_film",
    "How much more tension does a soft contact bear if the rubber is a thin film on glass?",
    """The sliding contact with a film of {thin:g} µm bears {pull:.2f} mN, {times:.1f} times as much as with one of
    {thick:g} mm, whose base is too far away to matter. Without sliding, the film bears {still:.2f} mN, and the
    thick one {jkr:.2f} mN as in JKR theory. The film gains twice: it cannot flow aside under the sphere, and
    the glass holds the long waves of the shear stress, so that sliding takes {share:.0f} % of the work of
    adhesion instead of {most:.0f} %. Broken bonds take {bonds:.0f} % in both cases, and the fluctuations the
    rest.""",
)
def thin_film(dataset: xr.Dataset) -> dict[str, Number]:
    pull, thickness = -1e3 * dataset["lowest_load"], dataset["solid_thickness"]
    solids = [Layer(float(dataset["solid_shear_modulus"]), float(h)) for h in thickness]
    work, size = float(dataset["adhesion_work"]), float(dataset["sphere_radius"])
    still = [-1e3 * solid.pull_off_load(work, size) for solid in solids]
    taken = 100.0 * (1.0 - dataset["work_of_adhesion"].isel(t=0) / work)
    return {
        "thin": 1e6 * float(thickness[0]),
        "thick": 1e3 * float(thickness[-1]),
        "pull": float(pull[0]),
        "times": float(pull[0] / pull[-1]),
        "still": still[0],
        "jkr": still[-1],
        "share": float(taken[0]),
        "most": float(taken[-1]),
        "bonds": 100.0 * float(1.0 - dataset["bond_fraction"].isel(t=0).max()),
    }


@asks(
    "soft_bead",
    "How wrong is the parabola for a sphere whose contact is almost half as wide as itself?",
    """By {rest:.1f} % of the area without a load, where the contact radius is {share:.2f} of the sphere's. JKR's theory
    takes a parabola, which rises less than the sphere, so that its contact is too large (black). At {load:g} µN the
    area is {pressed:.1f} % too large, and `sim check` states this largest error, {stated:.1f} %, before the run. The
    pull-off differs less: the sphere bears {circle:.2f} µN of tension and the parabola {parabola:.2f} µN, because
    the contact has shrunk by then. Both profiles have large strains, which are neglected.""",
    kind="loop",
)
def soft_bead(dataset: xr.Dataset) -> dict[str, Number]:
    area, load = dataset["contact_area"], dataset["normal_load"].isel(sphere_profile=0)
    parabola, circle = (
        area.sel(sphere_profile=name) for name in ("parabola", "circle")
    )
    over = 100.0 * (parabola / circle - 1.0)
    rest = nearest(load, 0.0)
    radius = dataset["contact_radius"].isel(sphere_profile=1, t=rest)
    pull = -1e6 * dataset["lowest_load"]
    scene = sim.load(ROOT / "scenarios" / "soft_bead.toml", {"sweep": {}})
    return {
        "rest": float(over[rest]),
        "share": float(radius / dataset["sphere_radius"]),
        "load": 1e6 * float(load[0]),
        "pressed": float(over[0]),
        "stated": 100.0 * scene.limits.parabola,
        "parabola": float(pull[0]),
        "circle": float(pull[1]),
    }


@asks(
    "peeling",
    "How much larger is the pull-off force if the edge cannot follow?",
    """If the edge runs at {fast:g} mm/s at twice the work of adhesion, the largest pull is {quick:.2f} mN. At
    {slow:g} µm/s it is {slack:.2f} mN, {times:.0f} times JKR's pull-off force. A cycle then dissipates {lost:.1f}
    nJ.""",
)
def peeling(dataset: xr.Dataset) -> dict[str, Number]:
    pull, speed = -1e3 * dataset["lowest_load"], dataset["contact_front_speed"]
    work, size = float(dataset["adhesion_work"]), float(dataset["sphere_radius"])
    lost = 1e9 * read.loop_energy(dataset)["loop_dissipation"].mean("cycle")
    return {
        "fast": 1e3 * float(speed[-1]),
        "slow": 1e6 * float(speed[0]),
        "quick": float(pull[-1]),
        "slack": float(pull[0]),
        "lost": float(lost[0]),
        "times": float(pull[0]) / (-1e3 * float(laws.jkr.pull_off_load(work, size))),
    }


@asks(
    "afm_tip",
    "How much does the range of adhesion change the friction of an AFM tip?",
    """Without a load friction is {short:.0f} nN if the range is negligible, which is JKR's theory. It is {near:.0f} nN
    at a range of {close:g} nm and {far:.0f} nN at {wide:g} nm, so that JKR's area is {over:.0f} to {most:.0f} %
    too large. The tip with the longest range comes off at {off:.0f} nN and not at JKR's {jkr:.0f} nN. Friction is
    {stress:g} GPa times the area within which the surfaces touch, under tension too.""",
)
def afm_tip(dataset: xr.Dataset) -> dict[str, Number]:
    last, load = dataset.isel(t=-1), dataset["contact_load"]
    force = 1e9 * last["friction_force"][{"contact_load": nearest(load, 0.0)}]
    short, near, far = force.to_numpy()
    work, size, modulus, stress, jkr = (
        float(values.max())
        for values in (
            dataset["adhesion_work"],
            dataset["sphere_radius"],
            dataset["contact_modulus"],
            last["shear_stress"],
            dataset["jkr_pull_off_load"],
        )
    )
    of_range = laws.cohesive.stress_of_range(work, float(dataset["contact_range"][-1]))
    lost = laws.cohesive.pull_off(0.0, work, of_range, size, modulus)
    return {
        "short": float(short),
        "close": 1e9 * float(dataset["contact_range"][1]),
        "wide": 1e9 * float(dataset["contact_range"][2]),
        "near": float(near),
        "far": float(far),
        "over": 100.0 * float(short / near - 1.0),
        "most": 100.0 * float(short / far - 1.0),
        "off": 1e9 * float(lost.load),
        "jkr": 1e9 * jkr,
        "stress": 1e-9 * stress,
    }


@asks(
    "measured_lens",
    "Which critical speed and stress of the bonds follow from measured areas and forces?",
    """The critical speed is {speed} mm/s, with {level:g} % confidence between {slowest:.2f} and {fastest:.2f}. The
    stress is {stress} kPa, between {least:.1f} and {most:.1f}. The measurement,
    [measured_lens.csv](../../scenarios/measured_lens.csv), is made up. The scenario names the true values, and both
    lie in the intervals.""",
    free=("bonds.critical_speed", "bonds.stress"),
)
def measured_lens(fit: Fit) -> dict[str, Number]:
    speed, stress = fit.numbers
    ends = {"slowest": speed.interval.low, "fastest": speed.interval.high}
    heights = {"least": stress.interval.low, "most": stress.interval.high}
    return {
        "speed": (1e3 * speed.value, 1e3 * speed.error),
        "stress": (1e-3 * stress.value, 1e-3 * stress.error),
        "level": 100.0 * LEVEL,
        **{name: 1e3 * end for name, end in ends.items()},
        **{name: 1e-3 * end for name, end in heights.items()},
    }


@asks(
    "jkr_fit",
    "Which work of adhesion and which modulus follow from a JKR test?",
    """The work of adhesion is {work} mJ/m², with {level:g} % confidence between {least:.1f} and {most:.1f}. The
    contact modulus E* is {modulus} MPa, between {softest:.2f} and {stiffest:.2f}. Their correlation is
    {together:.2f}. The test, [jkr_fit.csv](../../scenarios/jkr_fit.csv), is made up. The scenario names the true
    values, and both lie in the intervals. Replace it by a table of your own loads and radii (or areas).""",
    free=("adhesion.work", "solid.youngs_modulus"),
)
def jkr_fit(fit: Fit) -> dict[str, Number]:
    work, young = fit.numbers
    # MPa for a Pa of Young's modulus
    contact = 1e-6 * fit.scenario.solid.contact_modulus / young.value
    return {
        "work": (1e3 * work.value, 1e3 * work.error),
        "level": 100.0 * LEVEL,
        "least": 1e3 * work.interval.low,
        "most": 1e3 * work.interval.high,
        "modulus": (contact * young.value, contact * young.error),
        "softest": contact * young.interval.low,
        "stiffest": contact * young.interval.high,
        "together": float(fit.correlations[0, 1]),
    }


@asks(
    "measured_loop",
    "How stiff is a soft solid if the instrument does not know where the sphere touches?",
    """Young's modulus is {modulus} kPa, with {level:g} % confidence between {softest:.0f} and {stiffest:.0f}. The work
    of adhesion is {work} mJ/m², between {least:.1f} and {most:.1f}. The fit finds where the sphere touches, at a
    reading of {zero} µm. With this zero held at the first guess, {guess:g} µm, the modulus would be {wrong:.0f} kPa, so
    that the zero decides. The zero of
    the load and its drift hardly move the other values (middle and right). The measurement,
    [measured_loop.txt](../../scenarios/measured_loop.txt), is made up. The scenario names the true values, and all of
    them lie in the intervals. A datum of the [jump into contact](../loops.md#the-jump-into-contact) would narrow the
    zero.""",
    kind="zero",
    free=(
        "solid.youngs_modulus",
        "adhesion.work",
        "contact.front_speed",
        "contact.front_exponent",
        "zero.displacement=2.2 um:2.8 um",
        "zero.load=-20 nN:20 nN",
        "zero.load_drift=-1 nN/s:1 nN/s",
    ),
)
def measured_loop(fit: Fit) -> dict[str, Number]:
    modulus, work, *_ = fit.numbers
    profile = fit.profiles[0]
    guess = fit.numbers[4].free.start
    held = int(np.argmin(np.abs(profile.values - guess)))
    return {
        "modulus": (1e-3 * modulus.value, 1e-3 * modulus.error),
        "level": 100.0 * LEVEL,
        "softest": 1e-3 * modulus.interval.low,
        "stiffest": 1e-3 * modulus.interval.high,
        "work": (1e3 * work.value, 1e3 * work.error),
        "least": 1e3 * work.interval.low,
        "most": 1e3 * work.interval.high,
        "zero": (1e6 * fit.numbers[4].value, 1e6 * fit.numbers[4].error),
        "guess": 1e6 * guess,
        "wrong": 1e-3 * float(profile.numbers[held, 0]),
    }


@asks(
    "temperature",
    "Does one master curve hold the friction at several temperatures, and which energies do the bonds have?",
    """No. A shift along the speed keeps the height of the maximum, but from {cold:g} to {hot:g} °C the largest shear
    stress falls from {high:.0f} to {low:.0f} kPa. A master curve would need equal energies and a Bell force that does
    not change. The energy of rupture is {rupture} kJ/mol, with {level:g} % confidence between {weakest:.1f} and
    {strongest:.1f}. That of rebinding is {rebinding} kJ/mol, between {least:.1f} and {most:.1f}. The measurement,
    [temperature.csv](../../scenarios/temperature.csv), is made up. The scenario names the true values, and both lie in
    the intervals. `sim check` says for any scenario with a temperature if no master curve exists, and why.""",
    free=("temperature.rupture.energy", "temperature.rebinding.energy"),
)
def temperature(fit: Fit) -> dict[str, Number]:
    rupture, rebinding = fit.numbers
    measured = fit.problem.tables[0].conditions["temperature.value"]
    ends, speeds = (measured.min(), measured.max()), np.geomspace(1e-5, 10.0, 400)
    scenes = [fit.scenario.with_values({"temperature.value": end}) for end in ends]
    highest = [scene.population.steady(speeds).strength.max() for scene in scenes]
    return {
        "cold": round(float(ends[0]) - 273.15, 6),
        "hot": round(float(ends[1]) - 273.15, 6),
        "high": 1e-3 * float(highest[0]),
        "low": 1e-3 * float(highest[1]),
        "rupture": (1e-3 * rupture.value, 1e-3 * rupture.error),
        "rebinding": (1e-3 * rebinding.value, 1e-3 * rebinding.error),
        "level": 100.0 * LEVEL,
        "weakest": 1e-3 * rupture.interval.low,
        "strongest": 1e-3 * rupture.interval.high,
        "least": 1e-3 * rebinding.interval.low,
        "most": 1e-3 * rebinding.interval.high,
    }


@asks(
    "pdms_lens",
    "Which speed shall be measured next, so that broken bonds and fluctuations are told apart?",
    """A speed above the onset of the fluctuations, such as {speed:.1f} mm/s. Eight areas below the onset, with errors
    of {error:g} %, tell the mechanisms apart with a probability of {bonds} if only bonds break, and of {fluctuations}
    if the stress only fluctuates. With one more area it is {bonds_next} and {fluctuations_next}. If both act, it rises
    from {both} to {both_next}. The fastest candidates
    are the best here, so still faster ones may be better. The dashed lines only rank the speeds.""",
    free=("bonds.critical_speed", "shear.spectrum.rms"),
    points="pdms_lens_points",
)
def next_point(plan: Plan) -> dict[str, Number]:
    best, names = (
        plan.points[0],
        {"both": WHOLE, "bonds": "bonds only", "fluctuations": "fluctuations only"},
    )
    probabilities = {
        name: tuple(plan.probabilities[truth]) for name, truth in names.items()
    }
    further = {
        f"{name}_next": tuple(best.probabilities[truth])
        for name, truth in names.items()
    }
    error = 100.0 * float(np.median(plan.problem.sigma / plan.problem.values))
    return {
        "speed": 1e3 * best.conditions["speed"],
        "error": error,
        **probabilities,
        **further,
    }


@asks(
    "jkr_test",
    "Which work of adhesion follows from a JKR test if the edge lags?",
    """Two different values follow, and both are wrong. The true value is {work:g} mJ/m². If the edge runs at
    {speed:g} µm/s, the radius under {load:g} mN gives {loading:.1f} mJ/m² on loading and {unloading:.1f} mJ/m² on
    unloading. At {faster:g} µm/s the values are {closer:.1f} and {nearer:.1f} mJ/m². The loads over time are a
    made-up record, [jkr_test.csv](../../scenarios/jkr_test.csv).""",
)
def jkr_test(dataset: xr.Dataset) -> dict[str, Number]:
    size, modulus = (
        float(dataset["sphere_radius"]),
        float(dataset["contact_modulus"].max()),
    )
    load, top = (
        dataset["normal_load"].isel(contact_front_speed=0),
        int(dataset["normal_load"].argmax("t")[0]),
    )
    # up to the ends of the two stays at this load
    held = np.flatnonzero(np.isclose(load, 1e-3, rtol=1e-9))
    ends = [int(held[held < top][-1]), int(held[-1])]
    radius = (
        dataset["contact_radius"]
        .isel(t=ends)
        .transpose("contact_front_speed", "t")
        .to_numpy()
    )
    rates = 1e3 * laws.jkr.energy_release_rate(radius, 1e-3, size, modulus)
    speed = 1e6 * dataset["contact_front_speed"]
    return {
        "load": 1.0,
        "loading": rates[0, 0],
        "unloading": rates[0, 1],
        "closer": rates[-1, 0],
        "nearer": rates[-1, 1],
        "work": 1e3 * float(dataset["adhesion_work"]),
        "speed": float(speed[0]),
        "faster": float(speed[-1]),
    }


@asks(
    "own_psd",
    "How strong may a stress of my measured spectrum be before the contact loses its adhesion?",
    """The limit is an rms of {lost:.0f} kPa: there the stored energy equals the work of adhesion, {work:g} mJ/m².
    At {rms:g} kPa the stress stores {energy} mJ/m², and {share} % of JKR's area are left. The energy is
    proportional to the square of the rms. The spectrum is a made-up table,
    [own_psd.csv](../../scenarios/own_psd.csv), scaled to each rms.""",
)
def own_psd(dataset: xr.Dataset) -> dict[str, Number]:
    rms, work = 100.0, 1e3 * float(dataset["adhesion_work"])
    at, late = (
        {"shear_spectrum_rms": 1e3 * rms},
        distribution(dataset, ("fluctuation_energy", "area_ratio")),
    )
    energy = pair(late["fluctuation_energy"], 1e3, **at)
    stored = energy[0] if isinstance(energy, tuple) else energy
    return {
        "rms": rms,
        "work": work,
        "energy": energy,
        "share": pair(late["area_ratio"], 100.0, **at),
        "lost": rms * float(np.sqrt(work / stored)),
    }


@asks(
    "own_map",
    "How does a measured pattern of stress change the contact as it passes under it?",
    """The contact area varies with the part of the pattern under it, between {small:.1f} and {large:.1f} % of JKR's
    area. The stored energy of the whole map is {whole:.1f} mJ/m² if it is periodic, and {radial:.1f} mJ/m² by its
    radial spectrum. On the disc of the contact it is {low:.1f} to {high:.1f} mJ/m². The area depends on the energy
    of a unit of new contact at the edge. This energy lies between {least:.1f} and {most:.1f} mJ/m². The map is made
    up, [own_map.csv](../../scenarios/own_map.csv).""",
)
def own_map(dataset: xr.Dataset) -> dict[str, Number]:
    field = sim.load(ROOT / "scenarios" / "own_map.toml").shear.field
    energy, area = (
        1e3 * dataset["fluctuation_energy"],
        100.0 * dataset["contact_area"] / (np.pi * dataset["jkr_radius"] ** 2),
    )
    paid = 1e3 * (dataset["adhesion_work"] - dataset["work_of_adhesion"])
    ends = {
        "low": energy.min(),
        "high": energy.max(),
        "least": paid.min(),
        "most": paid.max(),
        "small": area.min(),
        "large": area.max(),
    }
    modulus = modulus_of(dataset)
    return {name: float(value) for name, value in ends.items()} | {
        "whole": 1e3 * HalfSpace(modulus).stored_energy(field),
        "radial": 1e3 * float(HalfSpace(modulus).stored_energy(field.spectrum)),
    }


@asks(
    "own_map",
    "What does a measured pattern look like, and which part of it is in contact?",
    """The pattern has streaks along the sliding direction. Its rms is {rms:.1f} kPa, on a mean of {mean:.0f} kPa
    that the bonds bear. The circle is the contact, {width:.0f} µm wide. The pattern passes under the contact as the
    slider moves. Beyond the map there is no stress.""",
    kind="map",
)
def pattern(dataset: xr.Dataset) -> dict[str, Number]:
    field = sim.load(ROOT / "scenarios" / "own_map.toml").shear.field
    width = 2e6 * float(
        dataset["contact_radius"].sel(t=dataset["map_time"][-1], method="nearest")
    )
    return {"rms": 1e-3 * field.rms, "mean": 1e-3 * field.mean, "width": width}


@asks(
    "own_map",
    "How does the contact move over the pattern?",
    """The pattern moves from left to right under the sphere. The circle is the contact, and the dotted circle is JKR's
    contact. In {time:.0f} ms the pattern moves by {moved:.0f} µm. The area is largest at {top:.0f} ms, with {large:.1f}
    % of JKR's area. Each frame of the movie is one of {maps:g} recorded maps.""",
    kind="movie",
    changes={"record.maps": {"from": "0 s", "to": "295 ms", "count": 60}},
)
def moving_pattern(dataset: xr.Dataset) -> dict[str, Number]:
    share, last = (
        100.0 * (dataset["contact_radius"] / dataset["jkr_radius"]) ** 2,
        dataset["map_time"][-1],
    )
    return {
        "time": 1e3 * float(last),
        "moved": 1e6 * float(dataset["slider_position"].sel(t=last, method="nearest")),
        "large": float(share.max()),
        "top": 1e3 * float(share["t"][int(share.argmax("t"))]),
        "maps": float(dataset.sizes["map_time"]),
    }


def pages(numbers: dict[str, dict[str, Any]]) -> dict[Path, str]:
    """Return the text of each page: the index and one page for each question."""
    index = HEAD
    for entry in ENTRIES:
        index += f"\n## {TOPICS[entry.name]}\n\n" if entry.name in TOPICS else ""
        index += f'- [<img src="{entry.picture.name}" alt="" width="160"> {entry.question}]({entry.name}.md)\n'
    index += (
        "\n```{toctree}\n:hidden:\n\n"
        + "".join(f"{entry.name}\n" for entry in ENTRIES)
        + "```\n"
    )
    texts = {
        FOLDER / f"{entry.name}.md": entry.text(numbers[entry.name])
        for entry in ENTRIES
    }
    return {FOLDER / "README.md": index} | texts


def stored(path: Path) -> dict[str, Any]:
    """Return the numbers of all answers, or the labels of all pictures, as last computed."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def store(path: Path, values: Mapping[str, Any]) -> None:
    """Write the numbers or the labels in the order of the questions, pictures of other pages first."""
    names = [*BESIDE, *(entry.name for entry in ENTRIES)]
    ordered = {name: values[name] for name in names if name in values}
    text = json.dumps(ordered, indent=1, ensure_ascii=False)
    path.write_text(f"{text}\n", encoding="utf-8")


def main(names: list[str]) -> None:
    """Run, draw and answer questions, all or some, and write the pages."""
    numbers, drawn = stored(NUMBERS), stored(LABELS)
    for name, scenario in BESIDE.items():
        if not names or Path(name).name in names:
            figure = sim.plot(sim.run(scenario), to=FOLDER / f"{name}.png")
            drawn[name] = labels(figure)
    for entry in ENTRIES:
        if not names or entry.name in names:
            dataset = entry.run()
            numbers[entry.name] = entry.numbers(dataset)
            drawn[entry.name] = entry.draw(dataset)
            sys.stdout.write(f"{entry.name}: {entry.filled(numbers[entry.name])}\n")
    store(NUMBERS, numbers)
    store(LABELS, drawn)
    for path, text in pages(numbers).items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
