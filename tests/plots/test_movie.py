"""A movie shows the contact at its times, over the stress or behind a spring."""

import io
import json
import shutil
import subprocess

import numpy as np
import pytest
from helpers.parts import Bell, Clock, Ensemble, Record, Spring
from helpers.pictured import STEADY, field, simulated
from matplotlib.patches import Circle
from numpy.testing import assert_allclose
from PIL import Image

import sim
from sim.parts.bonds.models import FirstMoment
from sim.parts.shear import models as shear
from sim.plots import draw
from sim.plots.kinds import Choices, drawn
from sim.units.errors import BadInput

TIMES = tuple(0.02 * np.arange(12))


@pytest.fixture(scope="module")
def maps():
    """Maps at twelve times of a run of one member."""
    return simulated(
        shear=field(shear.Mapped),
        drive=STEADY,
        record=Record(maps=TIMES),
        ensemble=Ensemble(members=1),
        clock=Clock(duration=0.24, step=0.01),
    )


@pytest.fixture(scope="module")
def pulled():
    """A slider that a spring pulls, of two members."""
    parts = {
        "bonds": FirstMoment(
            Bell(zero_force_rate=25.0, bell_force=4e-12), 8e-7, 250.0, 6.5e16
        )
    }
    spring = Spring(stage=4e-3, stiffness=100.0, damping=1e-2)
    return simulated(
        drive=spring,
        clock=Clock(duration=0.1, step=1e-3),
        ensemble=Ensemble(members=2),
        **parts,
    )


def circle_of(movie):
    _, contact = (patch for patch in movie.axes[0].patches if isinstance(patch, Circle))
    return contact


def cursors_of(movie):
    """The point of each curve, in SI."""
    return [panel.lines[-1].get_data() for panel in movie.axes[1:3]]


def test_frames_are_the_recorded_maps_with_the_contact_and_the_cursors_of_their_times(
    maps,
):
    movie = draw(maps, "movie")
    assert len(movie.places) == len(TIMES)
    image, stress = movie.axes[0].images[0], 1e-3 * maps["shear_map"][0].to_numpy()
    most = np.quantile(np.abs(stress), 0.999)
    for frame in (5, 0, 11):
        movie.show_frame(frame)
        now = maps.isel(member=0).sel(t=TIMES[frame], method="nearest")
        assert_allclose(
            circle_of(movie).radius, 1e6 * float(now["contact_radius"]), rtol=1e-14
        )
        half, fine = np.asarray(image.get_array()).shape[0] // 2, 384 // 32
        at = half + fine * np.arange(16)
        assert_allclose(
            np.asarray(image.get_array()).T[np.ix_(at, at)],
            stress[frame, :16, :16],
            atol=1e-12 * most,
        )
        area, force, t = *cursors_of(movie), 1e3 * TIMES[frame]
        share = float(now["contact_area"] / (np.pi * now["jkr_radius"] ** 2))
        assert_allclose(
            np.ravel([area, force]),
            [t, share, t, 1e3 * float(now["friction_force"])],
            rtol=1e-12,
        )
        assert movie.axes[0].get_title().startswith(f"$t$ = {t:g} ms")
    # the same colours in all frames
    assert_allclose(image.get_clim(), [-most, most], rtol=1e-12)


def test_a_slider_behind_a_spring_stands_behind_its_stage(
    pulled,
):
    movie = draw(pulled, "movie", Choices(member=1, start="20 ms", stop="80 ms"))
    shown = pulled.isel(member=1).sel(t=slice(0.02, 0.08))
    coil = movie.axes[0].lines[0]
    for frame in (0, 1):
        movie.show_frame(frame)
        behind = 1e6 * float(
            shown["slider_position"][frame] - shown["stage_position"][frame]
        )
        assert_allclose(circle_of(movie).center, [behind, 0.0], rtol=1e-9)
        assert_allclose(coil.get_xdata()[[0, -1]], [behind, 0.0], rtol=1e-9)
        assert_allclose(
            cursors_of(movie)[1][1], 1e3 * shown["spring_force"][frame], rtol=1e-12
        )


def test_a_gif_has_a_frame_for_each_map_and_one_palette_and_other_formats_show_the_first_frame(
    maps, tmp_path
):
    target, _ = drawn(maps, "movie", tmp_path / "x.nc", None, False, Choices())
    with Image.open(target) as picture:
        assert target.name == "x-movie.gif" and (
            picture.n_frames,
            picture.info["loop"],
        ) == (len(TIMES), 0)
        assert picture.info["duration"] == 50
        colours = set()
        for k in range(picture.n_frames):
            picture.seek(k)
            colours |= {colour for _, colour in picture.convert("RGB").getcolors(10**6)}
    assert len(colours) <= 256
    still = io.BytesIO()
    sim.plot(maps, "movie").savefig(still, format="png")
    assert not getattr(Image.open(still), "is_animated", False)


def test_a_movie_ends_where_the_slider_runs_away(pulled):
    runaway = pulled.isel(member=[0]).copy(deep=True)
    runaway["slider_position"][:, 60:] = np.nan
    movie = draw(runaway, "movie")
    assert len(movie.places) == 60 and movie.times[-1] == runaway["t"][59]


@pytest.mark.verify
@pytest.mark.skipif(not shutil.which("ffprobe"), reason="ffmpeg is not installed")
def test_an_mp4_has_a_frame_for_each_map(maps, tmp_path):
    sim.plot(maps, "movie", tmp_path / "x.mp4")
    asked = [
        "ffprobe",
        "-count_frames",
        "-show_streams",
        "-print_format",
        "json",
        tmp_path / "x.mp4",
    ]
    (stream,) = json.loads(
        subprocess.run(asked, capture_output=True, check=True).stdout
    )["streams"]
    assert (stream["nb_read_frames"], stream["codec_name"], stream["pix_fmt"]) == (
        "12",
        "h264",
        "yuv420p",
    )


def test_what_a_movie_cannot_show_is_refused_in_one_line(
    maps, pulled, tmp_path, monkeypatch
):
    loads = simulated(drive=STEADY, sweep={"contact.load": [1e-3, 4e-3]})
    alone = simulated(record=Record(per_member=False))
    for dataset, words in (
        (loads, "--where contact.load=VALUE"),
        (pulled, "--member 0"),
        (alone, "per_member = true"),
    ):
        with pytest.raises(ValueError, match=words) as fault:
            draw(dataset, "movie")
        assert "\n" not in str(fault.value)
    few = maps.isel(map_time=[0, 5])
    for dataset, choices, cure in (
        (
            few,
            Choices(),
            r"record\.maps",
        ),
        (pulled, Choices(member=0, start="10 ms", stop="13 ms"), "--from and --to"),
    ):
        with pytest.raises(ValueError, match=f"too few for a movie.*{cure}"):
            draw(dataset, "movie", choices)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(
        BadInput, match=r"needs the program ffmpeg, .* name a \.gif file"
    ):
        drawn(maps, "movie", tmp_path / "x.nc", tmp_path / "x.mp4", False, Choices())
    with pytest.raises(BadInput, match=r"\.gif or \.mp4 file, not x\.txt"):
        drawn(maps, "movie", tmp_path / "x.nc", tmp_path / "x.txt", False, Choices())
    assert not list(tmp_path.iterdir())


def test_a_movie_with_too_few_frames_for_its_slip_events_says_so(pulled, caplog):
    movie = draw(pulled, "movie", Choices(member=0))
    movie.places = movie.places[::10]  # eleven frames
    for slips, is_said in (([0.04], False), ([], False), ([0.04, 0.06], True)):
        movie.slips = np.array(slips)
        caplog.clear()
        movie.savefig(io.BytesIO(), format="gif", dpi=20)
        assert movie.get_supxlabel().startswith("100 ms shown in 0.5 s; dotted: ")
        assert ("--from" in caplog.text) == is_said
