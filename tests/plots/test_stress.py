"""Figures of friction show the stress of the bonds, its maximum, its peaks, and the closed forms beside them."""

import numpy as np
import pytest
from helpers.parts import Clock, Ensemble, bonds, drive, read, shear
from helpers.pictured import data_of, drawn, legend_of, rendered, simulated
from numpy.testing import assert_allclose

from sim.laws import schallamach
from sim.parts.bonds.rupture import Bell, Constant, CutOff
from sim.plots import kinds as plots, slider, style as pictures

#: Bonds whose friction is largest at 19.3 zero_force_rate bell_force/bond_stiffness = 1.93 mm/s.
BELL = {"zero_force_rate": 1e4, "bell_force": 4e-12}
SITES = {"bond_stiffness": 4e-4, "rebinding_rate": 1e5, "site_density": 9e16}
LAW = (1e4, 4e-12, 4e-4, 1e5)
COHORT = bonds.Cohort(rupture=Bell(**BELL), **SITES)
PALE = "#BBBBBB"
PLAIN = {"shear": shear.Uniform(), "ensemble": Ensemble(members=1)}


def ramped(population=COHORT, **changes):
    ramp = drive.Ramp(start=1e-6, stop=1e-1, scale="log")
    parts = {
        "bonds": population,
        "drive": ramp,
        "clock": Clock(duration=10.0, step=0.1),
    } | PLAIN
    return simulated(**(parts | changes))


def started(**changes):
    """Slow bonds, 1/s, at rest and then slid; the speeds that are drawn by default are 0.1 and 1 µm/s."""
    population = bonds.Cohort(
        rupture=Bell(zero_force_rate=1.0, bell_force=4e-12),
        bond_stiffness=4e-4,
        rebinding_rate=1.0,
        site_density=9e16,
        start_from="empty",
    )
    parts = {
        "bonds": population,
        "clock": Clock(duration=2.0, step=5e-3),
        "drive": drive.Start(rest=1.0, speed=1e-6),
    }
    return simulated(**(parts | PLAIN | changes))


@pytest.fixture(scope="module")
def ramp():
    return ramped()


@pytest.fixture(scope="module")
def starts():
    return started(sweep={"drive.rest": [0.5, 1.0], "drive.speed": [1e-7, 3e-7, 1e-6]})


def test_stress_and_bonds_are_drawn_over_the_speed_beside_the_law_of_every_rupture(
    ramp,
):
    stress, fraction = rendered(plots.draw(ramp, "stress")).axes
    assert_allclose(
        drawn(stress, pictures.BOTH),
        [1e6 * ramp["speed"], 1e-3 * ramp["shear_stress"]],
        rtol=1e-14,
    )
    assert_allclose(
        drawn(fraction, pictures.BOTH)[1], ramp["bond_fraction"], rtol=1e-14
    )
    assert stress.get_ylabel() == r"shear stress $\tau_0$ (kPa)"
    assert (fraction.get_xlabel(), fraction.get_xscale()) == (
        "sliding speed $V$ (µm/s)",
        "log",
    )
    speed, exact = drawn(stress, PALE)
    bell = schallamach.bell_stress(1e-6 * speed, *LAW, 9e16)
    # the steady law of cohorts is an integral
    assert_allclose(exact, 1e-3 * bell, rtol=1e-9)
    speed, exact = drawn(fraction, PALE)
    assert_allclose(exact, schallamach.bell_fraction(1e-6 * speed, *LAW), rtol=1e-9)
    assert_allclose(speed[[0, -1]], [1.0, 1e5], rtol=1e-9)
    speed, short = np.array([1e-5, 1e-3]), Clock(duration=1.0, step=0.1)
    for rupture, exact in (
        (
            CutOff(stretch=2e-8, rate=1e4),
            schallamach.cut_off_stress(speed, 1e4, 2e-8, 4e-4, 1e5, 9e16),
        ),
        (
            CutOff(stretch=2e-8),
            schallamach.cut_off_stress(speed, 0.0, 2e-8, 4e-4, 1e5, 9e16),
        ),
        (
            Constant(rate=1e4),
            9e16 * schallamach.constant_moments(speed, 1e4, 4e-4, 1e5).force,
        ),
    ):
        dataset = ramped(bonds.Cohort(rupture=rupture, **SITES), clock=short)
        stress, _ = slider.steady_law(dataset, {}, speed)
        assert_allclose(stress, exact, rtol=2e-4)
        # the stress has the sign of the speed
        assert_allclose(slider.steady_law(dataset, {}, -speed)[0], -exact, rtol=2e-4)
        plots.draw(dataset, "stress")
    dataset = ramped(sweep={"bonds.rupture.bell_force": [4e-12, 8e-12]}, clock=short)
    for k, force in enumerate((4e-12, 8e-12)):
        stress, _ = slider.steady_law(dataset, {"bonds_rupture_bell_force": k}, speed)
        exact = schallamach.bell_stress(speed, 1e4, force, 4e-4, 1e5, 9e16)
        # cohorts hold it to their tolerance
        assert_allclose(stress, exact, rtol=2e-4)


def test_the_maximum_is_marked_and_named_of_each_model_unless_the_stress_only_rises(
    ramp,
):
    panel = plots.draw(ramp, "stress").axes[0]
    (ring,) = (line for line in panel.lines if line.get_markerfacecolor() == "none")
    place, peak = np.ravel(ring.get_data())
    # it is that of the table, refined between clock steps
    stated = read.Run(ramp).statements()
    assert_allclose(place, 1e6 * stated["peak_speed"].value, rtol=1e-12)
    assert_allclose(peak, 1e-3 * stated["peak_stress"].value, rtol=1e-12)
    speed, stress = schallamach.bell_peak(*LAW, 9e16)
    assert abs(np.log(1e-6 * place / speed)) <= 0.5 * np.log(1e5) / 100
    name = f"simulated: {pictures.rounded(1e3 * peak, 'Pa')} at 1.93 mm/s"
    assert legend_of(panel)[0][0] == name
    assert_allclose(1e3 * peak, stress, rtol=5e-3)
    rupture = {"model": "bell", "zero_force_rate": "1e4 1/s", "bell_force": "4 pN"}
    numbers = {
        "bond_stiffness": "0.4 mN/m",
        "rebinding_rate": "1e5 1/s",
        "site_density": "9e16 1/m^2",
    }
    tables = [
        {"model": model, "rupture": rupture, **numbers} for model in ("rate", "cohort")
    ]
    dataset = ramped(sweep={"bonds": tables})
    names = legend_of(plots.draw(dataset, "stress").axes[0])[0]
    most = [
        pictures.rounded(float(value), "Pa")
        for value in read.Run(dataset).statements()["peak_stress"].value
    ]
    for k, model in enumerate(("rate", "cohort")):
        assert names[k].startswith(f"{model}: {most[k]} at ")
    dataset = ramped(
        drive=drive.Ramp(start=1e-6, stop=1e-4, scale="log"),
        clock=Clock(duration=1.0, step=0.1),
    )
    assert legend_of(plots.draw(dataset, "stress").axes[0])[0] == [
        "simulated",
        "steady sliding",
    ]
    # transients after a jump of the speed have no maximum over the speed
    jump = drive.Table(
        time=(0.0, 0.3, 0.3, 0.6, 0.6, 1.0), speed=(1e-4, 1e-4, 2e-3, 2e-3, 2e-2, 2e-2)
    )
    panel = plots.draw(
        ramped(drive=jump, clock=Clock(duration=1.0, step=0.1)), "stress"
    ).axes[0]
    assert not [line for line in panel.lines if line.get_markerfacecolor() == "none"]


def test_peaks_after_rests_are_those_of_steps_beside_steady_sliding(
    starts,
):
    after, peaks = rendered(plots.draw(starts, "stress")).axes
    slides = starts["t"].to_numpy() > 1.0 + 1e-9
    curves = [line.get_data() for line in after.lines if line.get_linestyle() == "-"]
    assert after.get_legend().get_title().get_text() == "after 1 s at rest"
    dots = [line.get_data() for line in after.lines if line.get_marker() == "o"]
    for k, ((time, stress), (when, peak)) in enumerate(zip(curves, dots, strict=True)):
        assert_allclose(time, 1e3 * (starts["t"].to_numpy()[slides] - 1.0), rtol=1e-12)
        assert_allclose(
            stress, 1e-3 * starts["shear_stress"][1, k].to_numpy()[slides], rtol=1e-14
        )
        assert_allclose(peak, 1e-3 * starts["peak_stress"][1, k], rtol=1e-12)
        assert abs(time[np.argmax(stress)] - when) <= 5.0  # a clock step
    lines = [
        line.get_data()
        for line in peaks.lines
        if line.get_linestyle() == "-" and line.get_marker() == "o"
    ]
    assert len(lines) == 2 and peaks.get_xscale() == "log"
    for k, rest in enumerate((0.5, 1.0)):
        assert_allclose(lines[k][0], [100.0, 300.0, 1000.0], rtol=1e-12)
        assert_allclose(lines[k][1], 1e-3 * starts["peak_stress"][k], rtol=1e-14)
        highest = starts["shear_stress"][k].where(starts["t"] > rest).max("t")
        # between two records it is higher
        assert np.all(starts["peak_stress"][k] >= highest)
    assert legend_of(peaks)[0][2:] == ["steady sliding"]
    speed, stress = data_of(peaks, PALE)[0]
    exact = schallamach.bell_stress(1e-9 * speed, 1.0, 4e-12, 4e-4, 1.0, 9e16)
    assert_allclose(stress, 1e-3 * exact, rtol=2e-4)


def test_sliding_without_a_stress_over_speed_or_time_is_refused_with_the_cure():
    short = Clock(duration=0.1, step=0.1)
    for changes, cure in (
        (
            {"population": bonds.Unbroken()},
            r"\[bonds\] stress = .*drawn as: theories, curve, time, movie$",
        ),
        (
            {"drive": drive.Steady(speed=1e-3)},
            r'model = "start".*drawn as: .*friction, time, movie$',
        ),
        (
            {
                "population": bonds.Unbroken(stress=3e5),
                "drive": drive.Start(rest=5.0, speed=1e-3),
            },
            "clock.duration",
        ),
    ):
        with pytest.raises(ValueError, match=cure):
            plots.draw(ramped(**changes, clock=short), "stress")


def test_no_stress_is_drawn_of_a_contact_that_is_open():
    dataset = started(sweep={"contact.load": [-3.5e-4, 4e-3]})
    is_open = dataset["in_contact"].isel(t=-1) == 0
    assert is_open.to_numpy().tolist() == [True, False]
    panel = plots.draw(dataset).axes[0]
    assert legend_of(panel)[0] == ["$P$ = 4 mN"]
    lines = [line.get_ydata() for line in panel.lines if line.get_linestyle() == "-"]
    assert [bool(np.any(np.isfinite(line))) for line in lines] == [False, True]
