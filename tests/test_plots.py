"""Figures show the numbers they claim to show, for every shape of dataset."""

import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.patches import Circle

from sim import analysis, plots
from sim.bodies import Adhesion, Solid, Sphere
from sim.ensemble import run
from sim.grid import Grid
from sim.memory import Onset, Stress, Time
from sim.modes import modes
from sim.parts import bonds, drive, shear
from sim.parts.contact import Equilibrium
from sim.scenario import Clock, Ensemble, Record, Scenario
from sim.spectrum import AnisotropicGaussian, Band, Gaussian, Ripple

CELL = 0.24e-3
RAMP = drive.Ramp(start=1e-5, stop=1e-1, scale="log")
STEADY = drive.Steady(speed=4e-3)


def field(kind=shear.Modal, spectrum=None, **changes):
    spectrum = spectrum or Band(rms=150e3, longest=60e-6, shortest=16e-6)
    options = {"memory": Time(time=0.01), "growth": Onset(speed=2.5e-3, width=0.3), "cell": CELL, "points": 32}
    return kind(spectrum=spectrum, **(options | changes))


def simulated(**changes):
    parts = {
        "clock": Clock(duration=0.4, step=0.02),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=2e-3),
        "adhesion": Adhesion(work=42e-3),
        "contact": Equilibrium(load=4e-3),
        "drive": RAMP,
        "bonds": bonds.Rate(critical_speed=1e-2, healing=500.0, stress=3e5),
        "shear": field(),
        "ensemble": Ensemble(members=6),
        "seed": 2003,
    }
    return run(Scenario(**{**parts, **changes}))


def mapped(members=1, spectrum=None, **changes):
    record = Record(maps=(0.4,), map_members=members)
    options = {"drive": STEADY, "record": record, "ensemble": Ensemble(members=members)}
    return simulated(shear=field(shear.Mapped, spectrum, **changes), **options)


@pytest.fixture(scope="module")
def ramp():
    return simulated()


def drawn(panel, colour, style="-"):
    """Data of the line of a colour and a style."""
    (line,) = (line for line in panel.lines if line.get_color() == colour and line.get_linestyle() == style)
    return line.get_data()


def rendered(figure):
    """The figure went through its whole layout without a warning, and its panels have labels with units."""
    figure.draw_without_rendering()
    assert figure.axes[0].get_ylabel() and figure.axes[-1].get_xlabel() + figure.axes[-1].get_ylabel()
    return figure


# -- what is drawn ----------------------------------------------------------------------------


def test_curve_shows_the_mean_area_over_speed_and_what_each_mechanism_takes(ramp):
    figure = rendered(plots.draw(ramp, "curve"))
    found, shares = analysis.statistics(ramp), analysis.shares(ramp)
    area, energies, friction = figure.axes
    speed, ratio = drawn(area, plots._BOTH)
    np.testing.assert_allclose(speed, 1e3 * ramp["speed"], rtol=1e-14)  # mm/s
    np.testing.assert_allclose(ratio, found["area_ratio_mean"], rtol=1e-14)
    np.testing.assert_allclose(drawn(area, plots._REFERENCE, ":")[1], shares["area_ratio_hertz"], rtol=1e-14)
    assert area.get_xscale() == "log" and friction.get_xlabel() == "sliding speed $V$ (mm/s)"
    edges = [shade.get_paths()[0].vertices[:, 1] for shade in area.collections[:2]]
    colours = [mpl.colors.to_hex(shade.get_facecolor()[0]).upper() for shade in area.collections[:2]]
    assert colours == [plots._BONDS, plots._FLUCTUATIONS]
    least = [1.0 - shares["lost_to_bonds_mean"].max(), found["area_ratio_mean"].min()]
    np.testing.assert_allclose([edge.min() for edge in edges], least, rtol=1e-12)
    np.testing.assert_allclose(
        [edge.max() for edge in edges], [1.0, 1.0 - shares["lost_to_bonds_mean"].min()], rtol=1e-12
    )
    _, left = drawn(energies, plots._BOTH)
    np.testing.assert_allclose(left, 1e3 * found["work_of_adhesion_mean"], rtol=1e-14)
    _, fluctuations = drawn(energies, plots._FLUCTUATIONS, "--")
    np.testing.assert_allclose(fluctuations, 1e3 * found["fluctuation_energy_mean"], rtol=1e-14)
    _, bonded = drawn(energies, plots._BONDS, "-.")
    np.testing.assert_allclose(bonded, 1e3 * analysis.bond_work(ramp), rtol=1e-14)
    np.testing.assert_allclose(drawn(friction, plots._BOTH)[1], 1e3 * found["friction_force_mean"], rtol=1e-14)


def test_bands_reach_from_the_5_to_the_95_percent_quantile(ramp):
    panel = plots.draw(ramp, "time").axes[0]
    quantiles = 1e6 * analysis.statistics(ramp)["contact_radius_quantile"]
    # no quantile lies outside of its band, and the band reaches no further
    band = panel.collections[0].get_paths()[0].vertices
    assert band[:, 1].min() == quantiles.sel(quantile=0.05).min()
    assert band[:, 1].max() == quantiles.sel(quantile=0.95).max()


def test_time_shows_radius_area_and_energies(ramp):
    figure = rendered(plots.draw(ramp, "time"))
    found = analysis.statistics(ramp)
    for panel, name, factor in zip(figure.axes, ("contact_radius", "contact_area"), (1e6, 1e6), strict=False):
        time, mean = drawn(panel, plots._BOTH)
        np.testing.assert_allclose(time, 1e3 * ramp["t"], rtol=1e-14)
        np.testing.assert_allclose(mean, factor * found[f"{name}_mean"], rtol=1e-14)
    labels = [panel.get_ylabel() for panel in figure.axes]
    assert labels == ["contact radius $a$ (µm)", "contact area $A$ (mm²)", "energy per area (mJ/m²)"]
    jkr = drawn(figure.axes[1], plots._REFERENCE, "--")[1]
    np.testing.assert_allclose(jkr, 1e6 * np.pi * float(ramp["radius_at_rest"]) ** 2, rtol=1e-14)


def test_sweep_shows_the_second_half_against_the_swept_key():
    dataset = simulated(drive=STEADY, sweep={"contact.load": ["1 mN", "4 mN", "16 mN"]})
    figure = rendered(plots.draw(dataset))
    found = analysis.summary(analysis.settled(analysis.observables(dataset)))
    load, radius = drawn(figure.axes[0], plots._BOTH)
    np.testing.assert_allclose(load, [1.0, 4.0, 16.0], rtol=1e-14)
    np.testing.assert_allclose(radius, 1e6 * found["contact_radius_mean"].isel(t=0), rtol=1e-14)
    np.testing.assert_allclose(
        drawn(figure.axes[0], plots._REFERENCE, "--")[1], 1e6 * dataset["radius_at_rest"], rtol=1e-14
    )
    assert figure.axes[-1].get_xlabel() == "normal load, compression positive $P$ (mN)"
    assert figure.axes[0].get_xscale() == "log"


def test_further_swept_keys_are_further_curves_with_their_values():
    dataset = simulated(
        drive=STEADY, shear=shear.Uniform(), sweep={"contact.load": [0.0, 4e-3], "sphere.radius": ["1 mm", "2 mm"]}
    )
    panel = plots.draw(dataset).axes[0]
    labels = [text.get_text() for text in panel.get_legend().get_texts()]
    assert labels == ["$R$ = 1 mm", "$R$ = 2 mm", "JKR", "Hertz"]
    np.testing.assert_allclose(
        drawn(panel, plots._LINES[1])[1], 1e6 * dataset["contact_radius"].isel(radius=1, t=-1), rtol=1e-14
    )


def test_curves_of_different_ramps_keep_their_own_speeds():
    dataset = simulated(sweep={"drive.to": ["10 mm/s", "100 mm/s"]})
    panel = plots.draw(dataset).axes[0]
    ends = [drawn(panel, colour)[0][-1] for colour in plots._LINES[:2]]
    np.testing.assert_allclose(ends, [10.0, 100.0], rtol=1e-12)


# -- maps -------------------------------------------------------------------------------------


@pytest.mark.parametrize("points", [32, 33])
def test_map_passes_through_every_sample(points):
    dataset = mapped(points=points)
    panels = plots.draw(dataset, "map").axes
    stress = dataset["shear_map"][0, 0].to_numpy()
    shown = panels[0].images[0].get_array().T / 1e-3  # kPa
    fine = points * -(-plots._PIXELS // points) // points
    half = shown.shape[0] // 2
    # the middle of the picture is the corner of the cell's array; rounding of the transform of |stress|
    at = half + fine * np.arange(points // 2)
    rounding = 1e-13 * np.max(np.abs(stress))
    np.testing.assert_allclose(shown[np.ix_(at, at)], stress[: points // 2, : points // 2], rtol=0, atol=rounding)


def test_map_of_a_ripple_and_its_displacement_have_the_closed_amplitudes():
    ripple = Ripple(amplitude=3e5, wavelength=24e-6)
    dataset = mapped(spectrum=ripple, amplitudes="fixed", growth=Onset(speed=1e-9, width=0.1))
    shown = [panel.images[0] for panel in plots.draw(dataset, "map").axes]
    # 384 pixels to ten waves: the highest pixel is at most half a pixel's phase from the crest
    near = 1.0 - np.cos(np.pi * 10 / plots._PIXELS)
    np.testing.assert_allclose(shown[0].get_array().max(), 300.0, rtol=near)
    compliance = 1.0 / (2.0 * 1.6e6 * 2.0 * np.pi / 24e-6)
    np.testing.assert_allclose(shown[1].get_array().max(), 1e9 * 3e5 * compliance, rtol=near)
    along, across = (np.ptp(shown[0].get_array(), axis=axis).max() for axis in (1, 0))
    assert along > 500.0 and across < 1e-6  # x to the right


def test_contact_circle_has_the_members_radius():
    dataset = mapped(members=2)
    (circle,) = (patch for patch in plots.draw(dataset, "map").axes[0].patches if isinstance(patch, Circle))
    np.testing.assert_allclose(circle.radius, 1e6 * dataset["contact_radius"][0, -1], rtol=1e-14)


@pytest.mark.parametrize(
    ("speed", "text"), [(4e-3, r"sliding $\longrightarrow$"), (-4e-3, r"$\longleftarrow$ sliding"), (0.0, "at rest")]
)
def test_arrow_points_where_the_slider_goes(speed, text):
    growth = Stress(reference=3e5)
    dataset = simulated(
        drive=drive.Steady(speed=speed),
        shear=field(shear.Mapped, growth=growth),
        record=Record(maps=(0.4,)),
        ensemble=Ensemble(members=1),
    )
    panel = plots.draw(dataset, "map").axes[0]
    assert text in [label.get_text() for label in panel.texts]


@pytest.mark.parametrize(
    ("spectrum", "growth"),
    [
        (Band(rms=150e3, longest=60e-6, shortest=16e-6), Onset(speed=2.5e-3, width=0.3)),
        (Gaussian(rms=1e5, length=20e-6), Stress(reference=1e5)),
        (AnisotropicGaussian(rms=1e5, length_x=15e-6, length_y=25e-6, angle=0.4), Onset(speed=2.5e-3, width=0.3)),
    ],
    ids=["band", "gaussian", "anisotropic"],
)
def test_measured_spectrum_is_the_one_asked_for(spectrum, growth):
    """Each ring within five of the standard errors that Gaussian modes have, whatever the growth."""
    members = 24
    dataset = mapped(members, spectrum, growth=growth)
    above, below = rendered(plots.draw(dataset, "spectrum")).axes
    q, ratio = below.containers[0].lines[0].get_data()
    cells = modes(spectrum, CELL, 32)
    ring = np.floor(np.hypot(cells.ix, cells.iy) + 0.5)
    shown = [cells.variance[ring == k] for k in np.rint(q * 1e6 * CELL / (2 * np.pi))]
    # a mode's periodogram is exponentially distributed: its standard deviation is its mean
    error = np.array([np.sqrt(np.sum(v**2)) / np.sum(v) for v in shown]) / np.sqrt(members)
    assert len(q) > 5 and np.all(np.abs(ratio - 1.0) < 5.0 * error)
    fine, asked = above.lines[0].get_data()
    angle = 2 * np.pi * np.arange(360) / 360
    density = np.mean(
        spectrum.density(1e6 * fine[:, None] * np.cos(angle), 1e6 * fine[:, None] * np.sin(angle)), axis=1
    )
    raised = growth.factor(np.array([4e-3]), dataset["shear_stress"].to_numpy()[-1:])[0] ** 2
    np.testing.assert_allclose(np.nan_to_num(asked), raised * density, rtol=1e-9)


@pytest.mark.parametrize("points", [32, 33])
def test_modes_laid_out_on_the_grid_hold_their_variance_both_ways(points):
    cells = modes(AnisotropicGaussian(rms=1e5, length_x=15e-6, length_y=25e-6, angle=0.4), CELL, points)
    grid = Grid(CELL, points)
    density = plots._mode_density(cells, grid)
    np.testing.assert_allclose(grid.mode_sum(density) / CELL**2, np.sum(cells.variance), rtol=1e-13)
    np.testing.assert_array_equal(density[1:, 0], density[:0:-1, 0])  # q and -q alike


def test_spectrum_of_a_sweep_takes_the_swept_number():
    record = Record(maps=(0.4,))
    dataset = simulated(
        drive=STEADY, shear=field(shear.Mapped), record=record, ensemble=Ensemble(members=1),
        sweep={"shear.spectrum.rms": [50e3, 100e3]},
    )  # fmt: skip
    base, swept = (plots.draw(d, "spectrum").axes[0].lines[0].get_ydata() for d in (mapped(), dataset))
    np.testing.assert_allclose(np.nanmax(swept), np.nanmax(base) / 9.0, rtol=1e-12)


# -- which figure -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({}, "curve"),
        ({"sweep": {"contact.load": [1e-3, 4e-3]}}, "curve"),
        ({"drive": STEADY, "sweep": {"drive.speed": [1e-3, 4e-3]}}, "curve"),
        ({"drive": STEADY, "sweep": {"contact.load": [1e-3, 4e-3]}}, "sweep"),
        ({"drive": STEADY}, "time"),
    ],
)
def test_default_figure_fits_the_dataset(changes, kind):
    dataset = simulated(shear=shear.Uniform(), **changes)
    default, named = plots.draw(dataset), plots.draw(dataset, kind)
    assert [p.get_xlabel() + p.get_ylabel() for p in default.axes] == [
        p.get_xlabel() + p.get_ylabel() for p in named.axes
    ]


def test_an_unknown_kind_names_the_known_ones(ramp):
    with pytest.raises(ValueError, match='no figure "histogram"; known: curve, time, sweep, map, spectrum'):
        plots.draw(ramp, "histogram")


@pytest.mark.parametrize("kind", ["map", "spectrum"])
def test_a_dataset_without_maps_says_how_to_record_them(ramp, kind):
    with pytest.raises(ValueError, match=r'\[record\] maps = \["1 s"\]'):
        plots.draw(ramp, kind)


def test_figures_that_need_a_sweep_or_a_ramp_say_so(ramp):
    with pytest.raises(ValueError, match=r"nothing is swept; .*\[sweep\]"):
        plots.draw(ramp, "sweep")
    with pytest.raises(ValueError, match=r'ramp it: \[drive\] model = "ramp"'):
        plots.draw(simulated(drive=STEADY, shear=shear.Uniform()), "curve")


def test_a_spectrum_that_cannot_be_compared_says_why():
    with pytest.raises(ValueError, match="single wave"):
        plots.draw(mapped(spectrum=Ripple(amplitude=3e5, wavelength=24e-6)), "spectrum")
    resting = simulated(
        drive=drive.Steady(), shear=field(shear.Mapped), record=Record(maps=(0.4,)), ensemble=Ensemble(members=1)
    )
    with pytest.raises(ValueError, match="holds no stress"):
        plots.draw(resting, "spectrum")
    assert plots.draw(resting, "map").axes


THERE_AND_BACK = drive.Table(time=(0.0, 0.2, 0.4), speed=(0.0, 0.02, 0.0))
CONTACTS = {"contact": [{"model": "equilibrium", "load": 4e-3}, {"model": "equilibrium", "indentation": 1e-6}]}


@pytest.mark.parametrize(
    "changes",
    [
        {"record": Record(per_member=False)},
        {"ensemble": Ensemble(members=1)},
        {"record": Record(precision="float32")},
        {"drive": drive.Ramp(start=-2e-3, stop=8e-3)},
        {"drive": THERE_AND_BACK},
        {"contact": Equilibrium(load=-3e-4)},
        {"contact": Equilibrium(load=-1.0), "shear": shear.Uniform()},
        {"contact": Equilibrium(indentation=1e-6), "bonds": bonds.Counted(critical_speed=1e-2, healing=500.0, sites=50),
         "record": Record(per_member=False)},
        {"sweep": CONTACTS},
        {"sweep": {"contact.load": {"from": "0 mN", "to": "20 mN", "count": 12}}},
        {"drive": STEADY, "sweep": {"shear": [{"model": "uniform"}] * 2, "contact.load": [0.0, 1e-3]}},
        {"shear": shear.Uniform(), "bonds": bonds.Unbroken()},
        {"drive": STEADY, "clock": Clock(duration=0.02, step=0.02)},
    ],
    ids=["statistics only", "one member", "float32", "through zero", "there and back", "pulled off", "never closed",
         "counted statistics", "two controls", "many curves", "names", "nothing happens", "two records"],
)  # fmt: skip
def test_every_shape_of_dataset_can_be_drawn(changes):
    dataset = simulated(**changes)
    for figure in (plots.draw(dataset), plots.draw(dataset, "time")):
        assert all(panel.get_ylabel() for panel in figure.axes) and figure.axes[-1].get_xlabel()


@pytest.mark.parametrize("load", [-1.0, -3e-4], ids=["never closed", "pulled off"])
def test_layout_stands_without_a_contact(load):
    rendered(plots.draw(simulated(contact=Equilibrium(load=load), shear=shear.Uniform())))


# -- saving -----------------------------------------------------------------------------------


def test_equal_figures_give_equal_files(ramp, tmp_path):
    for name in ("first", "second"):
        figure = plots.draw(ramp)
        for suffix in ("png", "pdf"):
            figure.savefig(tmp_path / f"{name}.{suffix}")
    for suffix in ("png", "pdf"):
        assert (tmp_path / f"first.{suffix}").read_bytes() == (tmp_path / f"second.{suffix}").read_bytes()


def test_figures_are_one_or_two_columns_wide_at_200_dpi(ramp, tmp_path):
    widths = {}
    for name, figure in (("curve", plots.draw(ramp)), ("map", rendered(plots.draw(mapped(), "map")))):
        figure.savefig(tmp_path / f"{name}.png")
        header = (tmp_path / f"{name}.png").read_bytes()[16:20]
        widths[name] = int.from_bytes(header, "big")
    assert widths == {"curve": 680, "map": 1400}


def test_an_unknown_extension_is_refused(ramp, tmp_path):
    with pytest.raises(ValueError, match="not supported"):
        plots.draw(ramp).savefig(tmp_path / "figure.docx")


def test_drawing_leaves_the_settings_of_matplotlib_alone(ramp, tmp_path):
    before = dict(mpl.rcParams)
    plots.draw(ramp).savefig(tmp_path / "figure.png")
    assert dict(mpl.rcParams) == before


def test_drawing_needs_no_pyplot():
    code = "import sys, sim.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
