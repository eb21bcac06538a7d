"""Figures of the fluctuations: a map and its displacement, its spectrum, and C(q) before any run."""

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from sim.laws.halfspace import displacement
from sim.plots import style
from sim.read.dataset import sweep_dims, where_recorded, word
from sim.spectrum.radial import Rowed, Waves

if TYPE_CHECKING:
    from sim.scenario.scenario import Scenario

#: Pixels that a cell has at least in a picture.
PIXELS = 384

#: Share of the pixels that the colours tell apart; unit, words and colour map of the stress.
_SHOWN = 0.999
STRESS = "Pa", r"shear stress $\tau_1$", "RdBu_r"


def needs_maps(dataset: xr.Dataset) -> None:
    """Refuse a dataset without stress maps."""
    if "shear_map" not in dataset:
        raise ValueError(
            'there are no stress maps; record some: [shear] model = "mapped" and [record] maps = ["1 s"]'
        )


def map_figure(dataset: xr.Dataset, at: float | None = None) -> Figure:
    """Last stress map of a member, or the map nearest to a time, and the displacement by this stress."""
    point = dataset.isel(dict.fromkeys(sweep_dims(dataset), 0))
    times = point["map_time"].to_numpy()
    number = -1 if at is None else int(np.abs(times - at).argmin())
    stress = point["shear_map"].isel(map_time=number, map_member=0).transpose("x", "y")
    sides, measured = sides_of(stress), bool(word(dataset, "shear.field.file", ""))
    solid = (
        float(point[f"effective_{name}"]) for name in ("shear_modulus", "poisson_ratio")
    )
    moved = displacement(stress.to_numpy(), sides, *solid)
    radius, speed = (
        float(_then(point, name, stress)) for name in ("contact_radius", "speed")
    )
    figure, axes = style.pairs(0.6 + 2.5 * min(1.0, sides[1] / sides[0]), shared=True)
    length = style.Unit.of(np.array(sides), "m")
    sizes = [length.factor * size for size in (*sides, radius)]
    about: Any = (*STRESS, None), ("m", "displacement $w_1$", "PuOr_r", None)
    for panel, values, words in zip(
        axes, (stress.to_numpy(), moved), about, strict=True
    ):
        draw_field(panel, values, sizes, measured, words)
        if measured or 0.0 < sizes[2] < 1.5 * sizes[0]:
            style.contact_circle(panel, sizes[2])
        panel.set_xlabel(length.label("$x$"))
    axes[0].set_ylabel(length.label("$y$"))
    arrow = (r"$\longleftarrow$ sliding", "at rest", r"sliding $\longrightarrow$")
    now = [style.swept_value(dataset, name, 0) for name in style.swept(dataset)]
    now += [f"$t$ = {style.text_of(stress['map_time'], 's')}"]
    now += [f"$V$ = {style.text_of(speed, 'm/s')}", arrow[int(np.sign(speed)) + 1]]
    with where_recorded():
        mean = style.rounded(_then(point, "shear_stress", stress), "Pa")
        now.append(rf"mean $\tau_0$ = {mean}")
    style.head(figure, now)
    return figure


def _then(point: xr.Dataset, name: str, stress: xr.DataArray) -> np.ndarray:
    """Return a variable at the time of the maps, of the member of a single map."""
    values = style.recorded(point, name).sel(t=stress["map_time"], method="nearest")
    return (
        values.sel(member=stress["map_member"]) if "member" in values.dims else values
    ).to_numpy()


def around(
    field: np.ndarray, sizes: list[float], measured: bool
) -> tuple[np.ndarray, tuple, float]:
    """Return pixels of a field around the contact, the extent of the pixels, and half the side of a square view.

    ``sizes`` are the two sides of the cell and the radius of the contact. A measured field is shown whole, pixel by
    pixel. Any other field is continued periodically if the contact is wider than the cell.
    """
    if measured:
        firsts = [
            -(points // 2 + 0.5) * side / points
            for points, side in zip(field.shape, sizes, strict=False)
        ]
        x, y, (along, across, _) = *firsts, sizes
        return field, (x, x + along, y, y + across), 0.0
    cell, _, radius = sizes
    # between its samples by its own Fourier series: nothing is smoothed
    points = field.shape[0] * -(-PIXELS // field.shape[0])
    for axis in (0, 1):
        field = scipy.signal.resample(field, points, axis=axis)
    side = max(cell, 2.3 * radius) if 2.3 * radius < 3.0 * cell else cell
    half = int(np.ceil(0.5 * side / cell * points))
    index = np.arange(-half, half + 1) % points
    reach = (half + 0.5) * cell / points
    return field[np.ix_(index, index)], (-reach, reach, -reach, reach), 0.5 * side


def draw_field(
    panel: Axes, field: np.ndarray, sizes: list[float], measured: bool, about: tuple
) -> tuple[AxesImage, float]:
    """Draw a field (x, y) around the contact with x to the right, and a colour bar; return the image and its factor.

    ``about`` holds the SI unit, words, colour map, and the fields that share the colours, or
    None. Few pixels beyond the ends of the bar do not rule it. A dash-dotted square is the
    cell if the view is wider, in which the cell repeats.
    """
    si, words, colours, among = about
    shown, extent, half = around(field, sizes, measured)
    among = shown if among is None else among
    unit = style.Unit.of(among, si)
    most = unit.factor * np.quantile(np.abs(among), _SHOWN) or 1.0
    image = panel.imshow(
        unit.factor * shown.T,
        extent=extent,
        origin="lower",
        cmap=style.part_of(colours, 0.05, 0.95),
        vmin=-most,
        vmax=most,
        interpolation="nearest",
    )
    beside: Any = {"cax": panel.inset_axes((1.03, 0.0, 0.045, 1.0))}
    panel.figure.colorbar(image, label=unit.label(words), extend="both", **beside)
    if half:
        panel.set(xlim=(-half, half), ylim=(-half, half))
    if half > 0.5 * sizes[0]:
        corner = (-0.5 * sizes[0], -0.5 * sizes[0])
        look: Any = {"fill": False, "linestyle": "-.", "linewidth": 0.8}
        panel.add_patch(Rectangle(corner, sizes[0], sizes[0], **look))
        panel.set_title("dash-dotted: the cell, which repeats")
    return image, unit.factor


def sides_of(maps: xr.DataArray) -> tuple[float, float]:
    """Return the sides of the cell of maps along x and y [m]."""
    along, across = (
        float(maps[axis][1] - maps[axis][0]) * maps.sizes[axis] for axis in "xy"
    )
    return along, across


def density_figure(scene: "Scenario") -> Figure:
    """Draw the spectral density of a scenario before any run, and the waves that hold variance and energy.

    Raises
    ------
    ValueError
        If there is none: the stress is uniform, or a single wave.
    """
    shear, radius = scene.fluctuations, scene.rest_radius
    radius = radius if radius > 0.0 else 0.01 * scene.sphere.radius
    spectrum = shear.spectrum
    if spectrum.wavevector is not None:
        raise ValueError(
            "its stress has no spectrum before a run; name the dataset that `sim run` writes"
        )
    low, high = cast(Waves, spectrum).reach(radius)
    q = np.geomspace(0.7 * low, min(1.4 * high, 1e4 * low), 1500)
    along, across = spectrum.density(q, 0.0), spectrum.density(0.0, q)
    length = style.Unit.of(2 * np.pi / q, "m", logarithmic=True)
    figure, (panel, below) = style.rows([1.9, 1.1])
    shown = q / length.factor
    densities = {"along the sliding": (along, "-"), "across it": (across, "--")}
    if np.allclose(along, across, rtol=1e-9, atol=0.0):
        densities = {"$C(q)$": (along, "-")}
    for name, (density, look) in densities.items():
        line = np.where(density > 0.0, density, np.nan)
        panel.loglog(shown, line, look, color=style.FLUCTUATIONS, label=name)
    if getattr(spectrum, "file", ""):
        rows = cast(Rowed, spectrum).rows
        known = rows.density > 0.0
        marks: Any = style.HOLLOW | {"color": style.BOTH, "label": "rows"}
        panel.plot(rows.q[known] / length.factor, rows.density[known], **marks)
    most = np.max(np.maximum(along, across))
    least = 0.3 * np.min(along[along > 0.0], initial=most)
    panel.set_ylim(max(least, 1e-9 * most), 3.0 * most)
    for wave, look, name in (
        (radius, ":", r"$\pi/a$, a wave as wide as the contact"),
        (0.5 * shear.side(scene.setting.cell), "-.", r"$2\pi$/cell"),
    ):
        place = np.pi / wave / length.factor
        if shown[0] < place < shown[-1]:
            panel.axvline(place, linestyle=look, **style.GREY, label=name)
            below.axvline(place, linestyle=look, **style.GREY)
    words = r"spectral density $C$ (Pa² m²)"
    if spectrum.bond_made:
        words = r"$C$ for $n\langle f^2\rangle$ = 1 N²/m²"
    panel.set_ylabel(words)
    style.legend(panel)
    mean, lean = cast(Waves, spectrum).harmonics(q)
    wave_along = scene.elastic.compliance(q, 0.0)
    wave_across = scene.elastic.compliance(0.0, q)
    weights = {
        "variance": (q * mean, "-"),
        "stored energy": (
            q * (wave_along * (mean + lean) + wave_across * (mean - lean)),
            "--",
        ),
    }
    for name, (weight, look) in weights.items():
        held = scipy.integrate.cumulative_trapezoid(weight, q, initial=0.0)
        below.plot(shown, held / held[-1], look, color=style.BOTH, label=name)
    below.set_ylabel("share of longer waves")
    style.legend(below)
    style.across(below, shown, f"wavenumber $q$ (rad/{length.name})", "log")
    return figure
