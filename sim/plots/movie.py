"""The contact in motion: its edge over the stress or behind a spring, beside area and force over time."""

from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Circle
from PIL import Image

from sim.plots import field, style
from sim.read import sweep_dims
from sim.read.dataset import MEMBERS, only_statistics, word
from sim.units.terminal import LOG

#: Most frames of a movie by format, and least; frames a second; dots an inch by format.
_FRAMES, _LEAST, _RATE = {"gif": 60, "mp4": 120}, 5, 20
_FINENESS = {"gif": 100, "mp4": 150}
#: Colours of a GIF, and least frames that a slip event needs.
_COLOURS, _OF_SLIP = 256, 8
#: Forces over time, the first that is recorded and changes.
_FORCES = {
    "spring_force": "spring force $F$",
    "friction_force": "friction force $F$",
    "normal_load": "normal load $P$",
}
READS = "speed", "slider_position", "jkr_radius", "normal_load"


class Movie(style.Picture):
    """A picture that moves if it is saved as GIF or MP4; in any other format it is its first frame."""

    #: Records at which there are frames, times of all records and of slip events [s], and
    #: the function that shows a frame.
    places: np.ndarray
    times: np.ndarray
    slips: np.ndarray
    show_frame: Callable[[int], None]

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save as a movie (GIF, MP4) or as a picture of the first frame, by ``format`` or the extension.

        Raises
        ------
        ValueError
            If an MP4 is asked for and there is no ffmpeg.
        """
        form = options.get("format") or str(fname).rpartition(".")[2].lower()
        if form not in _FRAMES:
            super().savefig(fname, **options)
            return
        if form == "mp4" and not FFMpegWriter.isAvailable():
            raise ValueError(
                "an MP4 needs the program ffmpeg, which was not found; install it, or name a .gif file"
            )
        frames = np.linspace(0, len(self.places) - 1, _FRAMES[form])
        frames = np.unique(np.rint(frames).astype(int))
        first, last = self.times[self.places[frames[[0, -1]]]]
        lasting = (len(frames) - 1) / _RATE
        pace = f"{style.text_of(last - first, 's')} shown in {lasting:.1f} s"
        slips = np.sum((self.slips >= first) & (self.slips <= last))
        if slips > len(frames) / _OF_SLIP:
            words = "too few frames to show the slip events; choose less time by --from and --to"
            LOG.warning("%s: %s", pace, words)
        with mpl.rc_context(style.STYLE):
            words = f"{pace}; dotted: the contact of JKR"
            self.supxlabel(words, fontsize=7.0, x=0.01, ha="left")
            self.set_dpi(options.get("dpi") or _FINENESS[form])
            self.canvas.draw()
            # the panels stay in their places, which also saves most of the time
            self.set_layout_engine("none")
            (self._save_gif if form == "gif" else self._save_mp4)(fname, frames)

    def _save_gif(self, fname: Any, frames: np.ndarray) -> None:
        """Write a GIF whose frames share one palette without dither, so that it is small and no colour flickers."""
        pictures, canvas = [], FigureCanvasAgg(self)
        for frame in frames:
            self.show_frame(frame)
            canvas.draw()
            pictures.append(Image.fromarray(np.array(canvas.buffer_rgba())[..., :3]))
        palette = pictures[0].quantize(_COLOURS)
        first, *others = (
            each.quantize(palette=palette, dither=Image.Dither.NONE)
            for each in pictures
        )
        lasting: Any = {"duration": 1000 // _RATE, "loop": 0}
        first.save(fname, "gif", save_all=True, append_images=others, **lasting)

    def _save_mp4(self, fname: Any, frames: np.ndarray) -> None:
        """Write an MP4 that browsers and presentations show."""
        browsers = ["-pix_fmt", "yuv420p", "-f", "mp4"]
        writer = FFMpegWriter(_RATE, "h264", extra_args=browsers)
        with writer.saving(self, fname, self.dpi):
            for frame in frames:
                self.show_frame(frame)
                writer.grab_frame()


def needs_one_contact(dataset: xr.Dataset) -> None:
    """Refuse a dataset of several contacts, or of their statistics alone."""
    if swept := style.swept(dataset):
        key = swept[0].replace("_", ".", 1)
        raise ValueError(
            f"a movie shows one point of the sweep; choose it, such as by --where {key}=VALUE"
        )
    if dataset.sizes.get(MEMBERS, 1) > 1:
        raise ValueError(
            "a movie shows one member; choose it by --member, such as --member 0"
        )
    if only_statistics(dataset):
        raise ValueError(
            "members were not recorded, only statistics; run again with [record] per_member = true"
        )
    if not (dataset["contact_radius"] > 0.0).any():
        raise ValueError(
            "the contact is always open; raise the load or the indentation"
        )


def movie_figure(dataset: xr.Dataset, absolute: bool = False) -> Movie:
    """Movie (GIF, MP4) of one contact: its edge, over the stress if maps are recorded, with area and force over time.

    With maps, each frame is a map.
    """
    single = [*sweep_dims(dataset), MEMBERS, "map_member"]
    point = dataset.isel(dict.fromkeys(single, 0), missing_dims="ignore")
    # until the slider runs away
    point = point.isel(t=np.isfinite(point["slider_position"].to_numpy()))
    movie = Movie(figsize=(style.WIDE, 2.9), dpi=200, layout=style.Layout())
    FigureCanvasAgg(movie)
    grid = movie.add_gridspec(2, 2, width_ratios=[1.25, 1.0])
    plan, above, below = (
        movie.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1])
    )
    movie.slips = point["slip_time"].to_numpy() if "slip_time" in point else np.empty(0)
    movie.times = times = point["t"].to_numpy()
    movie.places, time = np.arange(len(times)), style.Unit.of(times, "s")
    is_mapped = "shear_map" in point
    if is_mapped:
        mapped = point["map_time"].to_numpy()
        within = (mapped >= times[0]) & (mapped <= times[-1])
        is_mapped = bool(np.sum(within) > 1)
    if is_mapped:
        point = point.isel(map_time=within)
        movie.places = np.abs(times[:, np.newaxis] - mapped[within]).argmin(axis=0)
    if len(movie.places) < _LEAST:
        cure = "choose more time by --from and --to, or record more by record.maps, clock.step and clock.record"
        raise ValueError(f"frames: {len(movie.places)}, too few for a movie; {cure}")
    move = (_over_stress if is_mapped else _sliding)(plan, point)
    area, full = (
        np.pi * point[name].to_numpy() ** 2 for name in ("contact_radius", "jkr_radius")
    )
    shown = (area, "contact area $A$", "m^2")
    if not absolute and np.all(full > 0.0):
        shown = (area / full, r"contact area $A/A_\mathrm{JKR}$", "1")
    forces = {name: point[name].to_numpy() for name in _FORCES if name in point}
    changing = [
        name
        for name, values in forces.items()
        if np.ptp(values) > 1e-9 * np.max(np.abs(values))
    ]
    force = next(iter(changing), "normal_load")
    pulling = (forces[force], _FORCES[force], "N")
    follow = [_curve(above, times, *shown), _curve(below, times, *pulling)]
    above.tick_params(labelbottom=False)
    above.set_xlabel("")

    def show(frame: int) -> None:
        k = int(movie.places[frame])
        speed = style.rounded(point["speed"][k], "m/s")
        now = f"$t$ = {time.factor * times[k]:.4g} {time.name}"
        plan.set_title(f"{now}, sliding speed {speed}")
        move(frame, k)
        for mark in follow:
            mark(k)

    movie.show_frame = show
    show(0)
    return movie


def _edge(
    panel: Axes, point: xr.Dataset, factor: float
) -> Callable[[int, float], None]:
    """Draw the edge of the contact, and dotted that of JKR's; return the function that moves both."""
    look: Any = {"fill": False, "linestyle": ":", "color": style.REFERENCE}
    dotted = Circle((0.0, 0.0), 0.0, **look)
    panel.add_patch(dotted)
    circles = {"contact_radius": style.contact_circle(panel, 0.0), "jkr_radius": dotted}

    def move(k: int, x: float) -> None:
        for name, circle in circles.items():
            circle.set_radius(factor * float(point[name][k]))
            circle.set_center((factor * x, 0.0))

    return move


def _over_stress(panel: Axes, point: xr.Dataset) -> Callable[[int, int], None]:
    """Draw the maps around the contact; return the function that shows one of them."""
    maps = point["shear_map"].transpose("map_time", "x", "y")
    measured = bool(word(point, "shear.field.file", ""))
    stress, sides = maps.to_numpy(), field.sides_of(maps)
    length = style.Unit.of(np.array(sides), "m")
    sizes = [*sides, float(point["contact_radius"].max())]
    sizes = [length.factor * size for size in sizes]
    about = *field.STRESS, stress
    image, factor = field.draw_field(panel, stress[0], sizes, measured, about)
    panel.set(xlabel=length.label("$x$"), ylabel=length.label("$y$"))
    edge = _edge(panel, point, length.factor)

    def move(frame: int, k: int) -> None:
        image.set_data(factor * field.around(stress[frame], sizes, measured)[0].T)
        edge(k, 0.0)

    return move


def _sliding(panel: Axes, point: xr.Dataset) -> Callable[[int, int], None]:
    """Draw the contact, and the spring that pulls it; return the function that shows a record."""
    pulled, place = "stage_position" in point, point["slider_position"].to_numpy()
    behind = place - (point["stage_position"].to_numpy() if pulled else place)
    radius = float(point["contact_radius"].max())
    ends = np.array([min(behind.min(), 0.0), max(behind.max(), 0.0)])
    ends += 1.4 * radius * np.array([-1.0, 1.0])
    length = style.Unit.of(ends, "m")
    xlabel = length.label(f"$x$ from the {'stage' if pulled else 'slider'}")
    panel.set(
        xlim=length.factor * ends,
        ylim=1.6 * length.factor * radius * np.array([-1.0, 1.0]),
        aspect="equal",
        xlabel=xlabel,
        ylabel=length.label("$y$"),
    )
    (coil,) = panel.plot([], [], color=style.BONDS, linewidth=0.8)
    edge = _edge(panel, point, length.factor)
    turns = np.resize([0.0, 1.0, 0.0, -1.0], 33) * 0.12 * radius

    def move(frame: int, k: int) -> None:
        edge(k, behind[k])
        if pulled:  # the stage is at the origin
            along = np.linspace(behind[k], 0.0, turns.size)
            coil.set_data(length.factor * along, length.factor * turns)

    return move


def _curve(
    panel: Axes, times: np.ndarray, values: np.ndarray, words: str, si: str
) -> Callable[[int], None]:
    """Draw a curve over time; return the function that sets its cursor."""
    time = style.Unit.of(times, "s")
    times = time.factor * times
    values = style.in_unit(panel.yaxis, words, values, si) * values
    panel.plot(times, values, color=style.BOTH)
    style.across(panel, times, time.label("time $t$"))
    cursor = panel.axvline(times[0], **style.GREY)
    (spot,) = panel.plot([], [], "o", color=style.FLUCTUATIONS, ms=4.0)

    def follow(k: int) -> None:
        cursor.set_xdata([times[k]] * 2)
        spot.set_data([times[k]], [values[k]])

    return follow
