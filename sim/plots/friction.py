"""The figure of the friction force: over time, and as a loop over the position of the slider."""

import xarray as xr
from matplotlib.figure import Figure

from sim.plots.bond_laws import rest_of
from sim.plots.curves import colour_bar, scene_along
from sim.plots.panels import friction_panel
from sim.plots.style import GUIDE, across, legend, recorded, rows


def turns(dataset: xr.Dataset) -> bool:
    """Whether the speed does not only rise, or only fall, in time: a curve over it would lie on itself."""
    change = dataset["speed"].diff("t")
    return rest_of(dataset) is None and bool(((change > 0.0).any("t") & (change < 0.0).any("t")).any())


def needs_friction(dataset: xr.Dataset) -> None:
    """Refuse a dataset without friction, or whose slider does not move."""
    if not bool((recorded(dataset, "friction_force") != 0.0).any()):
        raise ValueError('there is no friction; give the bonds a stress, such as [bonds] stress = "0.3 MPa"')
    if not bool((dataset["slider_position"] != 0.0).any()):
        raise ValueError('the slider does not move; let it: [drive] speed = "1 mm/s"')


def friction_figure(dataset: xr.Dataset) -> Figure:
    """Friction force over time and over the slider's position: the friction loop."""
    scene = scene_along(dataset, "t")
    figure, axes = rows([1.7, 2.1], shared=False)
    for panel, x, words, si, room in (
        (axes[0], dataset["t"].to_numpy(), "time $t$", "s", 0.0),
        (axes[1], scene.all("slider_position_mean"), "slider position $x$", "m", 0.03),
    ):
        placed = scene.placed(x, words, si, broken=True)
        friction_panel(panel, placed)
        panel.axhline(0.0, **GUIDE)
        across(panel, placed.x, placed.words, room=room)
    legend(axes[0], scene.title)
    colour_bar(figure, axes, scene)
    return figure
