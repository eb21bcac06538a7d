"""The kinds of figures, the choices for a figure, and its drawing."""

import contextlib
import inspect
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import sweep_dims
from sim.analysis.scene import MEMBERS, answered, claim, of_dataset
from sim.numerics.files import claim as claim_file, output
from sim.plots import curves, field, slider, style, theories
from sim.plots.measured import Measured
from sim.plots.style import STYLE, recorded, swept_value
from sim.units.errors import BadInput
from sim.units.quantity import Quantity


class Choices(NamedTuple):
    """Choices for a figure.

    Any kind takes ``member``, one of the ensemble, and ``units`` of axes, such as ``"mm/s"``. Kinds with these
    parameters take ``at``, the time [s] of the record or map that is drawn; ``x``, the variable or swept key that it is
    drawn over; ``absolute``, areas in place of shares; ``data``, measured points in a CSV table or columns in SI by
    name (``{"speed": [1e-3], "contact_area": [4e-8]}``); ``ax``, the matplotlib axes that its first panel is drawn in.
    """

    member: int | None = None
    at: float | str | None = None
    x: str = ""
    absolute: bool = False
    units: tuple[str, ...] = ()
    data: Path | str | Mapping[str, Any] | Measured | None = None
    ax: Axes | None = None

    @property
    def given(self) -> dict[str, Any]:
        """What has been chosen, by name."""
        unsaid = (value is None or value is False or (isinstance(value, str | tuple) and not value) for value in self)
        return {name: value for (name, value), none in zip(self._asdict().items(), unsaid, strict=True) if not none}

    def options(self, kind: str, takes: Collection[str], dataset: xr.Dataset) -> dict[str, Any]:
        """Arguments for what draws a kind of figure.

        Raises
        ------
        ValueError
            For a choice that the kind does not take, or that cannot be read.
        """
        found = {name: value for name, value in self.given.items() if name not in ("member", "units")}
        for name in (name for name in found if name not in takes):
            words = f"it takes: {', '.join(takes)}" if takes else "it takes none but member and units"
            raise ValueError(f'the figure "{kind}" has no choice of {name}; {words}')
        if "at" in found:
            try:
                found["at"] = Quantity("s", "time").read(self.at)
            except ValueError as fault:
                raise ValueError(f"at {self.at}: {fault}") from None
        if self.data is None:
            return found
        return found | {"data": self.data if isinstance(self.data, Measured) else Measured(self.data, dataset)}

    def of_member(self, dataset: xr.Dataset) -> xr.Dataset:
        """The dataset of the member chosen, or of all.

        Raises
        ------
        ValueError
            If there is no such member, or members were not recorded.
        """
        if self.member is None:
            return dataset
        members = int(dataset.attrs["members"])
        if not 0 <= self.member < members:
            raise ValueError(f"there is no member {self.member}; there are members 0 to {members - 1}")
        if MEMBERS not in dataset.dims and any(str(name).endswith("_sem") for name in dataset.data_vars):
            raise ValueError("members were not recorded, only statistics; run again with [record] per_member = true")
        own = dataset.isel({MEMBERS: [self.member]}, missing_dims="ignore")
        if "map_member" in own.dims:
            there = own["map_member"].to_numpy() == self.member
            own = own.isel(map_member=there) if there.any() else own.drop_dims("map_member")
        return own


# The kinds of figures, each a module of its own, and the choice between them.


if TYPE_CHECKING:
    from sim.scenario.scenario import Scenario


class Kind(NamedTuple):
    """A kind of figure: what draws it, what refuses a dataset, which datasets it fits best, and what it reads."""

    draw: Callable[..., Figure]
    needs: Callable[[xr.Dataset], object] = lambda dataset: None
    fits: Callable[[xr.Dataset], bool] = lambda dataset: False
    reads: tuple[str, ...] = ()

    @property
    def shows(self) -> str:
        """Content of the figure, in a line."""
        return (self.draw.__doc__ or "").partition("\n")[0]

    @property
    def help(self) -> str:
        """Content of the figure and its options, for the command's help."""
        return " ".join([self.shows, *(f"--{name}" for name in self.takes if name != "ax")])

    @property
    def takes(self) -> tuple[str, ...]:
        """Choices that it takes beside a member and units."""
        return tuple(inspect.signature(self.draw).parameters)[1:]


_OF_FORCE = ("spring_force", "contact_area")
_OF_CURVE = ("speed", "contact_area", "jkr_radius", "hertz_radius")
#: What can be drawn, by name; the first line of what draws it is its help. The default is the first kind that fits.
KINDS: dict[str, Kind] = {
    "loop": Kind(theories.loop_figure, theories.needs_course, lambda dataset: True, ("normal_load", "displacement")),
    "theories": Kind(
        theories.theories_figure, theories.case_of, theories.sweeps_theories, ("shear_stress", "contact_area")
    ),
    "stress": Kind(
        slider.stress_figure, slider.needs_stress, lambda dataset: curves.rest_of(dataset) is not None, ("speed",)
    ),
    "stability": Kind(slider.stability_figure, slider.needs_map, lambda dataset: True, ("spring_force",)),
    "creep": Kind(slider.creep_figure, slider.needs_force, lambda dataset: True, ("slider_position", "speed")),
    "friction": Kind(curves.friction_figure, curves.needs_friction, curves.turns, ("speed",)),
    "curve": Kind(curves.curve_figure, curves.needs_speeds, lambda dataset: not curves.turns(dataset), _OF_CURVE),
    "sweep": Kind(curves.sweep_figure, curves.needs_sweep, lambda dataset: True),
    "time": Kind(curves.time_figure, fits=lambda dataset: True),
    "incipient": Kind(slider.incipient_figure, slider.needs_pull, reads=_OF_FORCE),
    "map": Kind(field.map_figure, field.needs_maps),
    "spectrum": Kind(field.spectrum_figure, field.needs_maps),
    "profile": Kind(theories.profile_figure, theories.shapes_of),
}


@of_dataset
def default(dataset: xr.Dataset) -> str:
    """The kind of figure that fits a dataset best."""
    return next(name for name, kind in KINDS.items() if not _missing(dataset, name) and kind.fits(dataset))


@of_dataset
def drawable(dataset: xr.Dataset) -> list[str]:
    """Kinds of figures whose needs a dataset meets."""
    return [kind for kind in KINDS if not _missing(dataset, kind)]


def _missing(dataset: xr.Dataset, kind: str) -> str:
    """Lack of a dataset for a kind of figure, with the cure; "" for nothing."""
    try:
        with answered():
            KINDS[kind].needs(dataset)
            for name in KINDS[kind].reads:
                recorded(dataset, name)
    except ValueError as fault:
        return str(fault)
    return ""


def _drawn_over(dataset: xr.Dataset, x: str) -> str:
    """The kind of figure that is drawn over a variable or swept key, or by default."""
    swept = {word for dim in style.swept(dataset) for word in (dim, dim.rpartition("_")[2], dim.replace("_", ".", 1))}
    return {"": default(dataset), "speed": "curve"}.get(x, "sweep" if x in swept else "time")


@of_dataset
def draw(dataset: xr.Dataset, kind: str | None = None, choices: Choices | None = None) -> Figure:
    """Draw a figure of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it; ``sim.analysis.where`` chooses values of its sweep.
    kind : str, optional
        One of ``KINDS``, whose ``shows`` says what it is; without it the one that fits the dataset best.
    choices : Choices, optional
        What of it is drawn, over what and in which units.

    Returns
    -------
    Picture
        A matplotlib Figure, one column wide, pictures of two panels side by side two; save it by its
        ``savefig``, as PNG, PDF or SVG. With axes to draw in, theirs.

    Raises
    ------
    ValueError
        For an unknown kind, or one that the dataset cannot serve, with the cure and the kinds that it can.
    """
    choices = choices or Choices()
    dataset = choices.of_member(dataset)
    kind = kind or _drawn_over(dataset, choices.x)
    if kind not in KINDS:
        raise ValueError(f'there is no figure "{kind}"; known: {", ".join(KINDS)}')
    missing = _missing(dataset, kind)
    if missing:
        raise ValueError(f"{missing}; it can be drawn as: {', '.join(drawable(dataset))}")
    options = choices.options(kind, KINDS[kind].takes, dataset)
    look = contextlib.nullcontext() if choices.ax else mpl.rc_context(STYLE)  # axes of somebody else keep their own
    with look, answered(), style.in_units(choices.units):
        figure = KINDS[kind].draw(dataset, **options)
        fixed = [swept_value(dataset, name, 0) for name in sweep_dims(dataset) if dataset.sizes[name] == 1]
        fixed += [] if choices.member is None else [f"member {choices.member}"]
        if fixed and not choices.ax:
            figure.suptitle(", ".join(fixed), fontsize=mpl.rcParams["axes.titlesize"])
        return figure


def drawn(
    dataset: xr.Dataset, kind: str | None, source: Path, path: Path | None, replace: bool, choices: Choices
) -> Path:
    """Draw the dataset of a file into a picture, by default beside it; the picture's path.

    Raises
    ------
    BadInput
        For an unknown kind or format of picture, or a picture that is not to be made.
    """
    try:
        target = path or source.with_name(f"{source.stem}{'-' + kind if kind else ''}.png")
        claim(dataset, source, target, replace, *([Path(choices.data)] if isinstance(choices.data, Path | str) else []))
        save(draw(dataset, kind, choices), target)
    except BadInput:
        raise
    except ValueError as fault:
        raise BadInput([f"{source}: {fault}"]) from None
    return target


def planned(source: Path, kind: str | None, path: Path | None, replace: bool, chosen: Collection[str] = ()) -> Path:
    """Draw what a scenario file says of its fluctuations before any run, C(q); the picture's path.

    Raises
    ------
    BadInput
        If the scenario cannot be read or has no such figure, something is chosen of it, or the picture is not to be
        made.
    """
    from sim.scenario.reader import load  # heavy: pydantic, where a dataset needs none
    from sim.scenario.schema import files_read

    scene, target = load(source), path or Path("outputs") / f"{source.stem}-spectrum.png"
    if kind not in (None, "spectrum"):
        raise BadInput([f'{source}: before a run only "spectrum" can be drawn; for "{kind}" run it: sim run {source}'])
    if chosen:
        said = f"nothing can be chosen of what is drawn before a run ({', '.join(chosen)})"
        raise BadInput([f"{source}: {said}; name the dataset that `sim run` makes of it"])
    claim_file(target, replace, files_read(scene))
    try:
        save(spectrum_of(scene), target)
    except ValueError as fault:
        raise BadInput([f"{source}: {fault}"]) from None
    return target


def spectrum_of(scene: "Scenario") -> Figure:
    """Spectral density of a scene's fluctuations before any run; errors as of ``density_figure``."""
    with mpl.rc_context(STYLE):
        return field.density_figure(scene)


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format that the ending of its name says, PNG without one, whole or not at all."""
    with output(path) as beside:
        figure.savefig(beside, format=path.suffix.removeprefix(".").lower() or "png")
