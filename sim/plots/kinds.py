"""The kinds of figures, the choices for a figure, and its drawing."""

import contextlib
import functools
import inspect
import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.numerics.files import claim as claim_file
from sim.plots import curves, distributions, field, movie, slider, style, theories
from sim.plots.measured import Measured
from sim.plots.style import STYLE, recorded, save, swept_value
from sim.read import Run, engineering, sweep_dims
from sim.read.dataset import (
    MEMBERS,
    answered,
    claim,
    only_statistics,
    plain,
    speed_name,
)
from sim.units.errors import BadInput, naming
from sim.units.notation import in_units
from sim.units.quantity import read_option

#: Kinds of figures over time, of which a part can be drawn.
_OVER_TIME = ("time", "friction", "creep", "stress", "movie")
#: Choices that all kinds take, and those that kinds over time take beside them.
_OF_ALL, _TIMES = ("member", "units", "size", "xlim", "ylim"), ("start", "stop")
_SIZE = re.compile(r"([\d.]+) *[x×] *([\d.]+) *(in|cm|mm)")
_INCHES = {"in": 1.0, "cm": 1.0 / 2.54, "mm": 0.1 / 2.54}


class Choices(NamedTuple):
    """Choices for a figure.

    Any kind takes ``member``, one of the ensemble, and ``units`` of axes, such as ``"mm/s"``. Kinds with these
    parameters take ``at``, the time [s] of the drawn record or map. ``x`` is the variable or swept key of the x axis.
    ``absolute`` draws areas instead of shares. ``data`` are measured points in a CSV table, or columns in SI by name
    (``{"speed": [1e-3], "contact_area": [4e-8]}``). ``ax`` are the matplotlib axes of the first panel. ``size`` is the
    size of the picture, such as ``"3.4x2.6in"``. ``xlim`` and ``ylim`` are ranges of the axes of the first panel in
    their units, such as ``"0.1:10"``. ``start`` and ``stop`` limit the time of figures over time.
    """

    member: int | None = None
    at: float | str | None = None
    x: str = ""
    absolute: bool = False
    units: tuple[str, ...] = ()
    data: Path | str | Mapping[str, Any] | Measured | None = None
    ax: Axes | None = None
    size: str = ""
    xlim: str = ""
    ylim: str = ""
    start: float | str | None = None
    stop: float | str | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        """Choices that are not the default, by name."""
        return {
            name: value
            for name, value in self._asdict().items()
            if value != self._field_defaults[name]
        }

    def options(
        self, kind: str, takes: Collection[str], dataset: xr.Dataset
    ) -> dict[str, Any]:
        """Return the arguments for the function that draws a kind of figure.

        Raises
        ------
        ValueError
            For a choice that the kind does not take, or that cannot be read.
        """
        of_all = [*_OF_ALL, *(_TIMES if kind in _OVER_TIME else ())]
        options = {
            name: self.chosen[name] for name in self.chosen if name not in of_all
        }
        for name in options:
            if name not in takes:
                words = ", ".join(["where", *of_all, *takes])
                words = words.replace("start, stop", "start (--from), stop (--to)")
                raise ValueError(
                    f'the figure "{kind}" has no choice of {name}; it takes: {words}'
                )
        if self.at is not None:
            options["at"] = read_option(self.at, "at", "s")
        if self.data is not None:
            options["data"] = self.measured(dataset)
        return options

    def measured(self, dataset: xr.Dataset) -> Measured | None:
        """Return the measured points, if there are any."""
        if self.data is None or isinstance(self.data, Measured):
            return self.data
        return Measured(self.data, dataset)

    def between(self, dataset: xr.Dataset) -> xr.Dataset:
        """Return the dataset between the times ``start`` and ``stop``."""
        start = None if self.start is None else read_option(self.start, "--from", "s")
        cut = dataset.sel(t=slice(start, read_option(self.stop, "--to", "s")))
        if cut.sizes["t"] < 2:
            last = engineering(float(dataset["t"][-1]), "s")
            raise ValueError(
                f"there are fewer than two records between --from and --to; the run ends at {last}"
            )
        return cut

    def shape(self, figure: Figure) -> None:
        """Give a figure the chosen size, and its first panel the chosen ranges of the axes."""
        if self.size:
            if not (match := _SIZE.fullmatch(self.size)):
                raise ValueError(
                    f'--size takes width x height with a unit, such as 3.4x2.6in, not "{self.size[:40]}"'
                )
            *sides, unit = match.groups()
            width, height = (float(side) * _INCHES[unit] for side in sides)
            figure.set_size_inches(width, height)
        for name, text in (("xlim", self.xlim), ("ylim", self.ylim)):
            if text:
                try:
                    low, high = map(float, text.split(":"))
                except ValueError:
                    words = f'--{name} takes two numbers in the unit of the axis, such as 0.1:10, not "{text[:40]}"'
                    raise ValueError(words) from None
                if not low < high:
                    words = f'--{name} takes the lower end first, not "{text[:40]}"'
                    raise ValueError(words)
                figure.axes[0].set(**{name: (low, high)})

    def of_member(self, dataset: xr.Dataset) -> xr.Dataset:
        """Return the dataset of the chosen member, or of all.

        Raises
        ------
        ValueError
            If there is no such member, or members were not recorded.
        """
        if self.member is None:
            return dataset
        members = int(dataset.attrs["members"])
        if not 0 <= self.member < members:
            raise ValueError(
                f"there is no member {self.member}; there are members 0 to {members - 1}"
            )
        if only_statistics(dataset):
            raise ValueError(
                "members were not recorded, only statistics; run again with [record] per_member = true"
            )
        dataset = dataset.isel({MEMBERS: [self.member]}, missing_dims="ignore")
        if "map_member" in dataset.dims:
            maps = dataset["map_member"].to_numpy() == self.member
            dataset = (
                dataset.isel(map_member=maps)
                if maps.any()
                else dataset.drop_dims("map_member")
            )
        return dataset


class Kind(NamedTuple):
    """A kind of figure: its drawing function, its refusal of a dataset, whether it fits one best, and its variables."""

    draw: Callable[..., Figure]
    needs: Callable[[xr.Dataset], object] = lambda dataset: None
    fits: Callable[[xr.Dataset], bool] = lambda dataset: True
    reads: tuple[str, ...] = ()

    @property
    def shows(self) -> str:
        """Content of the figure, in a line."""
        return (self.draw.__doc__ or "").partition("\n")[0]

    @property
    def takes(self) -> tuple[str, ...]:
        """Choices that the kind takes beside a member and units."""
        names = inspect.signature(self.draw).parameters
        return tuple(name for name in names if name in Choices._fields)


def _never(dataset: xr.Dataset) -> bool:
    """Fit no dataset, because the kind is drawn only if its name is given."""
    return False


def _has_holds(dataset: xr.Dataset) -> bool:
    """Fit a dataset whose drive has a list of holds."""
    return '"holds"' in str(dataset.attrs.get("scenario_resolved", ""))


_OF_THEORY = ("shear_stress", "contact_area")
_OF_CURVE = ("speed", "contact_area", "jkr_radius", "hertz_radius")
#: All figures, by name. The default of a dataset is the first kind that fits it.
KINDS: dict[str, Kind] = {
    "loop": Kind(
        theories.loop_figure,
        theories.needs_course,
        reads=("normal_load", "displacement"),
    ),
    "theories": Kind(
        theories.theories_figure, theories.case_of, theories.sweeps_theories, _OF_THEORY
    ),
    "stress": Kind(
        slider.stress_figure,
        slider.needs_stress,
        lambda dataset: "drive_rest" in dataset,
        ("speed",),
    ),
    "stability": Kind(
        slider.stability_figure, slider.needs_map, reads=("spring_force",)
    ),
    "creep": Kind(
        slider.creep_figure, slider.needs_force, reads=("slider_position", "speed")
    ),
    "holds": Kind(slider.holds_figure, slider.needs_holds, _has_holds),
    "friction": Kind(
        curves.friction_figure, curves.needs_friction, curves.turns, ("speed",)
    ),
    "curve": Kind(
        curves.curve_figure,
        curves.needs_speeds,
        lambda dataset: not curves.turns(dataset),
        _OF_CURVE,
    ),
    "sweep": Kind(curves.sweep_figure, curves.needs_sweep),
    "time": Kind(curves.time_figure),
    "incipient": Kind(
        slider.incipient_figure,
        slider.needs_pull,
        reads=("spring_force", "contact_area"),
    ),
    "map": Kind(field.map_figure, field.needs_maps),
    "histogram": Kind(distributions.histogram_figure, distributions.differing, _never),
    "survival": Kind(distributions.survival_figure, distributions.needs_event, _never),
    "movie": Kind(movie.movie_figure, movie.needs_one_contact, _never, movie.READS),
}


def default(dataset: xr.Dataset, data: Measured | None = None) -> str:
    """Return the kind of figure that fits a dataset best; with measured points one that has a place for them."""
    dataset = plain(dataset)
    kinds = (
        name for name, kind in KINDS.items() if data is None or "data" in kind.takes
    )
    result = next(
        name
        for name in kinds
        if not _missing(dataset, name) and KINDS[name].fits(dataset)
    )
    over = {
        "curve": speed_name(dataset),
        "stress": speed_name(dataset),
        "sweep": next(iter(style.swept(dataset)), ""),
    }
    timed = (
        data is not None
        and data.column("t") is not None
        and data.column(over.get(result, "t")) is None
    )
    return "time" if timed else result


def drawable(dataset: xr.Dataset) -> list[str]:
    """Return the kinds of figures that can be drawn of a dataset."""
    return [kind for kind in KINDS if not _missing(plain(dataset), kind)]


def _missing(dataset: xr.Dataset, kind: str) -> str:
    """Return the lack of a dataset for a kind of figure, with the cure; "" if it has none."""
    try:
        with answered():
            KINDS[kind].needs(dataset)
            for name in KINDS[kind].reads:
                recorded(dataset, name)
    except ValueError as fault:
        return str(fault)
    return ""


def draw(
    dataset: xr.Dataset, kind: str | None = None, choices: Choices | None = None
) -> Figure:
    """Draw a figure of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it; ``sim.read.where`` chooses values of its sweep.
    kind : str, optional
        One of ``KINDS``, whose ``shows`` describes it; by default the kind that fits the dataset best.
    choices : Choices, optional
        The member, axes, units and measured points of the figure.

    Returns
    -------
    Picture
        A matplotlib Figure, one column wide, or two if panels are side by side. Save it by its ``savefig`` as PNG, PDF
        or SVG. With axes to draw in, it is their figure.

    Raises
    ------
    ValueError
        For an unknown kind, or a kind that lacks data, with the cure and the kinds that can be drawn.
    """
    choices = choices or Choices()
    dataset = choices.of_member(plain(dataset))
    swept = style.swept(dataset)
    if not kind:
        data = choices.measured(dataset)
        choices, x = choices._replace(data=data), choices.x.replace(".", "_")
        is_key = any(name.endswith(x) for name in swept)
        kinds = {"": default(dataset, data), "speed": "curve"}
        kind = kinds.get(x, "sweep" if is_key else "time")
    drawing = KINDS.get(kind)
    if drawing is None:
        if not swept or kind not in Run(dataset).statements():
            raise ValueError(
                f'there is no figure "{kind}"; known: {", ".join(KINDS)}, and statements of a sweep'
            )
        drawing = Kind(functools.partial(curves.statement_figure, name=kind))
    elif missing := _missing(dataset, kind):
        raise ValueError(
            f"{missing}; it can be drawn as: {', '.join(drawable(dataset))}"
        )
    options = choices.options(kind, drawing.takes, dataset)
    dataset = choices.between(dataset) if kind in _OVER_TIME else dataset
    # axes of somebody else keep their own
    look = contextlib.nullcontext() if choices.ax else mpl.rc_context(STYLE)
    with look, answered(), in_units(choices.units):
        figure = drawing.draw(dataset, **options)
        if not choices.ax:
            _describe(figure, dataset, choices.member)
        choices.shape(figure)
        return figure


def _describe(figure: Figure, dataset: xr.Dataset, member: int | None) -> None:
    """Write chosen values above a figure, and below it what the labels of swept courses stand for."""
    fixed = [
        swept_value(dataset, name, 0)
        for name in sweep_dims(dataset)
        if dataset.sizes[name] == 1
    ]
    fixed += [] if member is None else [f"member {member}"]
    if fixed:
        style.head(figure, fixed)
    courses = [
        str(dataset[name].attrs.get("long_name", "")).partition(", ")[2]
        for name in style.swept(dataset)
        if dataset[name].dtype.kind not in "fi"
    ]
    if any(courses):
        texts = [text for course in courses for text in course.split("; ")]
        text = "\n".join(filter(None, [*texts, figure.get_supxlabel()]))
        figure.supxlabel(text, x=0.02, ha="left", fontsize=6.0)


def drawn(
    dataset: xr.Dataset,
    kind: str | None,
    source: Path,
    path: Path | None,
    replace: bool,
    choices: Choices,
) -> tuple[Path, str]:
    """Draw the dataset of a file into a picture, by default beside it; return its path and a remark on measured points.

    Raises
    ------
    BadInput
        For an unknown kind or format, or a path that must not be written.
    """
    with naming(source):
        suffix = ".gif" if kind == "movie" else ".png"
        target = path or source.with_name(
            f"{source.stem}{'-' + kind if kind else ''}{suffix}"
        )
        if kind == "movie" and target.suffix.lower() not in (".gif", ".mp4"):
            raise ValueError(f"a movie is a .gif or .mp4 file, not {target.name}")
        tables = [Path(choices.data)] if isinstance(choices.data, Path | str) else []
        claim(dataset, source, target, replace, *tables)
        figure = draw(dataset, kind, choices)
        save(figure, target)
    return target, " ".join(
        figure.get_supxlabel().split()
    ) if choices.data is not None else ""


def planned(
    source: Path,
    kind: str | None,
    path: Path | None,
    replace: bool,
    chosen: Collection[str] = (),
) -> Path:
    """Draw the spectral density of a scenario file before any run, and return the path of the picture.

    Raises
    ------
    BadInput
        If the scenario cannot be read or has no such figure, anything is chosen, or the path must not be written.
    """
    from sim.scenario.reader import load  # heavy: pydantic, where a dataset needs none
    from sim.scenario.schema import files_read

    scene, target = (
        load(source),
        path or Path("outputs") / f"{source.stem}-spectrum.png",
    )
    if kind not in (None, "spectrum"):
        raise BadInput(
            [
                f'{source}: before a run only "spectrum" can be drawn; for "{kind}" run it: sim run {source}'
            ]
        )
    if chosen:
        fault = f"a figure before a run takes no options ({', '.join(chosen)})"
        raise BadInput([f"{source}: {fault}; name the dataset that `sim run` writes"])
    claim_file(target, replace, files_read(scene))
    with naming(source), mpl.rc_context(STYLE):
        save(field.density_figure(scene), target)
    return target
