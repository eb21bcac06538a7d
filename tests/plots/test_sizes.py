"""Figures of all kinds at three sizes: legends and labels stay in the picture and hide no curve."""

import functools
import itertools

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from helpers.parts import (
    Adhesion,
    Bell,
    Clock,
    Ensemble,
    Equilibrium,
    Force,
    Spring,
    bonds,
    drive,
    shear,
)
from helpers.pictured import STEADY, mapped, simulated
from matplotlib.axes import Axes
from matplotlib.legend import Legend

import sim
from sim.plots import KINDS, Choices, draw
from sim.plots.style import swept_value

#: A small size has the least room. The others are tried with the long checks.
SIZES = (
    "3.4x2.6in",
    *(pytest.param(size, marks=pytest.mark.verify) for size in ("", "10x6in")),
)
LOADS = {"contact.load": [1e-3, 2e-3, 4e-3, 6e-3, 8e-3]}
SITES = {"bond_stiffness": 4e-4, "rebinding_rate": 1e5, "site_density": 9e16}
COHORT = bonds.Cohort(rupture=Bell(zero_force_rate=1e4, bell_force=4e-12), **SITES)
SLOW = bonds.FirstMoment(
    Bell(zero_force_rate=25.0, bell_force=4e-12),
    bond_stiffness=8e-7,
    rebinding_rate=250.0,
    site_density=6.5e16,
)
ALONE = {"shear": shear.Uniform(), "ensemble": Ensemble(members=2)}
FIRM = ALONE | {"adhesion": Adhesion(work=42e-3, bond_share=0.0), "bonds": SLOW}
BACK = {"from": 2e-6, "to": -4e-6, "cycles": 2}
SCENES = {
    "loop": {
        "contact": Equilibrium(
            displacement=BACK, stiffness=340.0, after_pull_off="reattach"
        ),
        "drive": STEADY,
        "clock": Clock(duration=1.0, step=1e-2),
        "sweep": {"sphere.radius": [1e-3, 2e-3, 3e-3]},
    },
    "theories": ALONE | {"sweep": {"bonds.stress": [0.0, 1e5, 1e6]}, "drive": STEADY},
    "stress": ALONE
    | {
        "bonds": COHORT,
        "drive": drive.Ramp(start=1e-6, stop=1e-1, scale="log"),
        "clock": Clock(duration=10.0, step=0.1),
        "sweep": {"bonds.site_density": [3e16, 6e16, 9e16]},
    },
    "start": ALONE
    | {
        "bonds": bonds.Cohort(
            rupture=Bell(zero_force_rate=1.0, bell_force=4e-12),
            **SITES | {"rebinding_rate": 1.0},
            start_from="empty",
        ),
        "clock": Clock(duration=2.0, step=1e-2),
        "drive": drive.Start(rest=1.0, speed=1e-6),
        "sweep": {"drive.rest": [0.5, 1.0], "drive.speed": [1e-7, 3e-7, 1e-6]},
    },
    "stability": FIRM
    | {
        "drive": Spring(
            stage={"from": 1e-3, "to": 3e-2, "scale": "log", "cycles": 1},
            stiffness=100.0,
            damping=1e-2,
            start="steady",
        ),
        "clock": Clock(duration=4.0, step=1e-2),
        "sweep": {"drive.stiffness": [100.0, 1e4]},
    },
    "creep": FIRM
    | {
        "drive": Force(force=1e-3),
        "clock": Clock(duration=0.2, step=5e-4),
        "sweep": {"drive.force": [3e-3, 1e-2, 3e-2]},
    },
    "friction": {
        "drive": drive.Table(time=(0.0, 0.2, 0.4), speed=(0.0, 0.02, -0.02)),
        "sweep": LOADS,
    },
    "curve": {"sweep": LOADS, "bonds": bonds.Steady(critical_speed=2e-2, stress=3e5)},
    "sweep": {"drive": STEADY, "sweep": LOADS | {"sphere.radius": [1e-3, 2e-3, 3e-3]}},
    "time": {
        "drive": drive.Table(time=(0.0, 0.2, 0.4), speed=(1e-3, 0.02, 1e-3)),
        "contact": Equilibrium(load={"from": 4e-3, "to": 1e-3}),
    },
    "incipient": FIRM
    | {
        "adhesion": Adhesion(work=42e-3),
        "drive": Spring(stage=2e-3, stiffness=300.0),
        "clock": Clock(duration=0.1, step=2.5e-4),
        "sweep": LOADS,
    },
    "holds": ALONE
    | {
        "bonds": bonds.Rate(critical_speed=1e-3, rebinding_rate=2.0, stress=2e5),
        "drive": drive.Holds(speed=1e-2, slide=0.5, holds=(0.01, 0.1, 1.0)),
        "clock": Clock(duration=3.12, step=2e-3),
        "sweep": LOADS,
    },
    "movie": {"ensemble": Ensemble(members=1)},
}
#: Further figures of these scenes.
SCENES |= {
    "contact_area": SCENES["sweep"],
    "histogram": SCENES["curve"],
    "survival": {
        "drive": drive.Steady(speed=2e-2),
        "ensemble": Ensemble(members=40),
        "sweep": LOADS,
    },
}


@functools.cache
def dataset_of(kind):
    return mapped() if kind == "map" else simulated(**SCENES[kind])


def figure_of(kind, size):
    known = {"start": "stress"}.get(kind, kind)
    choices = Choices(size=size)
    return draw(dataset_of(kind), known, choices)


def test_every_kind_of_figure_is_tried():
    assert {*KINDS} <= {*SCENES, "map"}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", [*SCENES, "map"])
def test_legends_and_labels_stay_in_the_figure_and_off_the_panels(kind, size):
    figure = figure_of(kind, size)
    figure.draw_without_rendering()
    assert_within(figure)


def assert_within(figure):
    frame = figure.bbox.padded(1.0)
    panels = figure.findobj(Axes)
    for artist in (*panels, *figure.findobj(Legend)):
        box = artist.get_tightbbox()
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1, artist
        assert frame.y0 <= box.y0 and box.y1 <= frame.y1, artist
    for legend, panel in itertools.product(figure.findobj(Legend), panels):
        shared = mpl.transforms.Bbox.intersection(
            legend.get_tightbbox(), panel.get_window_extent()
        )
        assert shared is None or min(shared.width, shared.height) <= 1.0
    assert (
        min(panel.get_window_extent().height for panel in panels) > 0.02 * frame.height
    )


def test_a_title_and_axes_of_somebody_else_are_beside_the_legend_and_not_under_it():
    """The two programs of the page on figures."""
    dataset = simulated(sweep={"contact.load": [1e-3, 4e-3]})
    figure = sim.plot(dataset, "curve", units=["mm/s"])
    title = figure.axes[0].set_title("PDMS lens")
    panel, axes = plt.subplots(figsize=(3.4, 2.6))
    sim.plot(dataset, "curve", ax=axes)
    plt.close(panel)
    for shown in (figure, panel):
        shown.draw_without_rendering()
        assert_within(shown)
    for legend in figure.findobj(Legend):
        shared = mpl.transforms.Bbox.intersection(
            legend.get_tightbbox(), title.get_window_extent()
        )
        assert shared is None


def test_every_small_value_of_a_sweep_over_decades_has_a_unit_of_its_own():
    dataset = simulated(sweep={"shear.correlation.time": [0.1, 1.0, 1e3]})
    names = [
        swept_value(dataset, "shear_correlation_time", k).rpartition("= ")[2]
        for k in range(3)
    ]
    assert names == ["100 ms", "1 s", "1 ks"]
