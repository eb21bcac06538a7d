"""Figures of stress maps show the map and its displacement."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import LENS, sim
from helpers.parts import Ensemble, Onset, Record, Stress, drive, load
from helpers.pictured import field, mapped, simulated
from matplotlib.patches import Circle
from numpy.testing import assert_allclose

from sim.parts.shear import Carried, models as shear
from sim.plots import field as field_figures, kinds as plots
from sim.solid import HalfSpace
from sim.spectrum.families import AnisotropicGaussian, Ripple
from sim.spectrum.measured import StressMap, Tabulated

STARTER = Path(__file__).parents[2] / "sim" / "starter.toml"


def test_a_ripple_and_its_displacement_have_the_closed_ratio_and_an_arrow_points_ahead():
    ripple = Ripple(amplitude=3e5, wavelength=24e-6)
    dataset = mapped(spectrum=ripple, amplitude=Onset(speed=1e-9, width=0.1))
    shown = [panel.images[0] for panel in plots.draw(dataset, "map").axes]
    # 384 pixels to ten waves: the highest pixel is at most half a pixel's phase from the crest
    near = 1.0 - np.cos(np.pi * 10 / field_figures.PIXELS)
    stress = 1e3 * shown[0].get_array().max()
    compliance = 1.0 / (2.0 * 1.6e6 * 2.0 * np.pi / 24e-6)
    assert_allclose(shown[1].get_array().max(), 1e9 * stress * compliance, rtol=near)
    along, across = (np.ptp(shown[0].get_array(), axis=axis).max() for axis in (1, 0))
    assert along > 1.6e-3 * stress and across < 1e-6  # x to the right
    for speed, text in [
        (4e-3, r"sliding $\longrightarrow$"),
        (-4e-3, r"$\longleftarrow$ sliding"),
        (0.0, "at rest"),
    ]:
        parts = {
            "shear": field(shear.Mapped, amplitude=Stress(reference=3e5)),
            "record": Record(maps=(0.4,)),
        }
        dataset = simulated(
            drive=drive.Steady(speed=speed), ensemble=Ensemble(members=1), **parts
        )
        assert text in plots.draw(dataset, "map").get_suptitle()


def test_maps_that_cannot_be_drawn_say_why():
    parts = {
        "shear": field(shear.Mapped),
        "record": Record(maps=(0.4,)),
        "ensemble": Ensemble(members=1),
    }
    with pytest.raises(ValueError, match=r'\[record\] maps = \["1 s"\]'):
        plots.draw(simulated(), "map")
    assert plots.draw(simulated(drive=drive.Steady(), **parts), "map").axes


ANISOTROPIC = {
    "model": "anisotropic_gaussian",
    "rms": "100 kPa",
    "length_x": "12 um",
    "length_y": "40 um",
}


def before(**spectrum):
    """The figure of a scene that has not run."""
    return field_figures.density_figure(
        load(tomllib.loads(LENS) | {"shear": {"model": "mean", "spectrum": spectrum}})
    )


def test_the_figure_of_a_spectrum_shows_the_energy_of_longer_waves_at_any_direction_of_its_streaks():
    for name, spectrum in (
        ("12 um by 40 um", AnisotropicGaussian(1e5, 12e-6, 40e-6)),
        ("40 um by 12 um", AnisotropicGaussian(1e5, 40e-6, 12e-6)),
    ):
        sizes = {"length_x": spectrum.length_x, "length_y": spectrum.length_y}
        _, below = before(**ANISOTROPIC | sizes).axes
        curve = below.lines[-1]
        q = curve.get_xdata() * 1e6
        longer = np.array(
            [
                HalfSpace(1.6e6).share_of_long_waves(spectrum, 2.0 * np.pi / each)
                for each in q[::100]
            ]
        )
        # the curve begins with the longest wave that is shown
        exact = (longer - longer[0]) / (1.0 - longer[0])
        # trapezoids of 1500 places between 0.7 and 80 inverse lengths, 0.3 % wide
        assert_allclose(
            curve.get_ydata()[::100], exact, rtol=0, atol=1e-5, err_msg=name
        )


def test_a_spectrum_is_drawn_before_any_run_also_by_the_command_which_replaces_nothing(
    tmp_path, monkeypatch
):
    q, density = np.geomspace(1e4, 1e6, 9), np.geomspace(1.0, 1e-4, 9)
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{a}; {b}" for a, b in zip(q, density, strict=True))
    Path("psd.csv").write_text(f"q [rad/m]; C [Pa^2 m^2]\n{rows}", encoding="utf-8")
    panel, below = before(model="tabulated", file="psd.csv").axes
    line, rows = panel.lines[:2]
    table = Tabulated(q, density)
    assert_allclose(line.get_xdata() * 1e6, np.geomspace(7e3, 1.4e6, 1500), rtol=1e-12)
    inside = np.isfinite(line.get_ydata())
    assert_allclose(
        line.get_ydata()[inside],
        table.radial_density(line.get_xdata()[inside] * 1e6),
        rtol=1e-9,
    )
    assert_allclose(rows.get_ydata(), density, rtol=1e-9)
    # by trapezoids, one of which begins at the jump of the density: half of it counts too much
    variance = below.lines[-2]
    exact = table.cumulative(variance.get_xdata() * 1e6) / table.variance
    assert_allclose(variance.get_ydata(), exact, rtol=0, atol=1e-3)
    along, across = before(**ANISOTROPIC).axes[0].lines[:2]
    assert [line.get_label() for line in (along, across)] == [
        "along the sliding",
        "across it",
    ]
    spectrum = AnisotropicGaussian(1e5, 12e-6, 40e-6)
    q = along.get_xdata() * 1e6
    assert_allclose(
        np.nan_to_num(along.get_ydata()), spectrum.density(q, 0.0), rtol=1e-12
    )
    assert_allclose(
        np.nan_to_num(across.get_ydata()), spectrum.density(0.0, q), rtol=1e-12
    )
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(STARTER.read_text(encoding="utf-8"), encoding="utf-8")
    answer = sim("plot", "scene.toml")
    assert (answer.exit_code, answer.stdout) == (
        0,
        f"{Path('outputs/scene-spectrum.png')}\n",
    )
    made = Path("outputs/scene-spectrum.png").read_bytes()
    assert made.startswith(b"\x89PNG") and sim("plot", "scene.toml").exit_code == 73
    for arguments, words in (
        (("scene.toml", "curve"), 'before a run only "spectrum"'),
        (("scene.toml", "-o", "scene.toml", "--force"), "the command reads this file"),
        (("none.toml",), "none.toml"),
    ):
        answer = sim("plot", *arguments)
        assert answer.exit_code == 2 and words in answer.stderr
    Path("ripple.toml").write_text(
        STARTER.read_text(encoding="utf-8").partition("[shear]")[0], encoding="utf-8"
    )
    answer = sim("plot", "ripple.toml")
    assert answer.exit_code == 2 and "no spectrum before a run" in answer.stderr
    assert sorted(path.name for path in Path("outputs").iterdir()) == [
        "scene-spectrum.png"
    ]


def test_a_map_passes_through_every_sample_and_a_measured_one_is_drawn_as_it_is():
    for points in [32, 33]:
        dataset = mapped(points=points)
        panels = plots.draw(dataset, "map").axes
        stress = dataset["shear_map"][0, 0].to_numpy()
        shown = panels[0].images[0].get_array().T / 1e-3  # kPa
        fine = points * -(-field_figures.PIXELS // points) // points
        half = shown.shape[0] // 2
        # the middle of the picture is the corner of the cell's array; rounding of the transform of |stress|
        at = half + fine * np.arange(points // 2)
        rounding = 1e-13 * np.max(np.abs(stress))
        assert_allclose(
            shown[np.ix_(at, at)],
            stress[: points // 2, : points // 2],
            rtol=0,
            atol=rounding,
        )
    values = np.random.default_rng(2).normal(size=(40, 32)) * 1e4
    found = StressMap(
        file="map.npy", pixel=9e-6, values=values.tobytes(), shape=values.shape
    )
    dataset = simulated(
        drive=drive.Steady(speed=0.0),
        shear=Carried(field=found, contact="disc"),
        record=Record(maps=(0.4,)),
        ensemble=Ensemble(members=1),
    )
    panel = plots.draw(dataset, "map").axes[0]
    (image,) = panel.images
    assert_allclose(
        image.get_array().T * 1e3, values - values.mean(), rtol=0, atol=1e-6
    )
    left, right, low, high = image.get_extent()
    bar = panel.child_axes[0]
    # of 1280 normal numbers one is larger
    most = 1e-3 * np.quantile(np.abs(values - values.mean()), 0.999)
    assert_allclose(image.get_clim(), [-most, most], rtol=1e-12)
    assert_allclose(sorted(np.abs(bar.get_ylim()))[-1], most, rtol=1e-12)
    assert np.all(np.abs(bar.get_ylim()) <= 1e-3 * np.abs(values - values.mean()).max())
    assert_allclose(
        (left, right, low, high), 9.0 * np.array([-20.5, 19.5, -16.5, 15.5]), rtol=1e-12
    )
    (circle,) = (patch for patch in panel.patches if isinstance(patch, Circle))
    assert circle.center == (0.0, 0.0)
