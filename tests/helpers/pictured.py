"""Small runs and their drawn lines, for the tests of figures."""

from helpers.lens import scene

from sim.ensemble.simulate import run
from sim.parts import drive
from sim.parts.shear import models as shear
from sim.parts.shear.process import Onset, Time
from sim.scenario.scenario import Ensemble, Record
from sim.spectrum.families import Band

CELL = 0.24e-3
RAMP = drive.Ramp(start=1e-5, stop=1e-1, scale="log")
STEADY = drive.Steady(speed=4e-3)


def field(kind=shear.Modal, spectrum=None, **changes):
    spectrum = spectrum or Band(rms=150e3, longest=60e-6, shortest=16e-6)
    options = {
        "correlation": Time(time=0.01),
        "amplitude": Onset(speed=2.5e-3, width=0.3),
        "cell": CELL,
        "points": 32,
    }
    return kind(spectrum=spectrum, **(options | changes))


_RUNS = {}


def simulated(**changes):
    """Return a small run, made once for all tests: change a copy of it."""
    key = repr(sorted(changes.items()))
    if key not in _RUNS:
        _RUNS[key] = run(scene(**{"shear": field()} | changes))
    return _RUNS[key]


def mapped(members=1, spectrum=None, **changes):
    record = Record(maps=(0.4,), map_members=members)
    options = {"drive": STEADY, "record": record, "ensemble": Ensemble(members=members)}
    return simulated(shear=field(shear.Mapped, spectrum, **changes), **options)


def drawn(panel, colour, style="-"):
    """Return data of the line of a colour and a style; a line of the legend alone has none."""
    (data,) = data_of(panel, colour, style)
    return data


def data_of(panel, colour, style="-"):
    """Return data of all lines of a colour and a style."""
    lines = [
        line
        for line in panel.lines
        if (line.get_color(), line.get_linestyle()) == (colour, style)
    ]
    return [line.get_data() for line in lines if len(line.get_xdata())]


def lines_of(panel):
    """Data of all lines of a panel that show some."""
    return [line.get_data() for line in panel.lines if len(line.get_xdata())]


def legend_of(panel):
    """Entries of a legend, and its title."""
    legend = panel.get_legend() or panel.figure.legends[0]
    return [
        text.get_text() for text in legend.get_texts()
    ], legend.get_title().get_text()


def rendered(figure):
    """The figure went through its whole layout without a warning; panels are labelled and within the picture."""
    figure.draw_without_rendering()
    assert (
        figure.axes[0].get_ylabel()
        and figure.axes[-1].get_xlabel() + figure.axes[-1].get_ylabel()
    )
    for panel in figure.axes:
        box = panel.get_tightbbox()
        assert (
            min(box.x0, box.y0) > -1.0
            and box.x1 < figure.bbox.x1 + 1.0
            and box.y1 < figure.bbox.y1 + 1.0
        )
    return figure
