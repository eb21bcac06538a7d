"""The figure of the theories shows what each theory says."""

import numpy as np
import pytest
from helpers.parts import Adhesion, Clock, Ensemble, Equilibrium, bonds, shear
from helpers.pictured import STEADY, data_of, simulated
from numpy.testing import assert_allclose

from sim.laws import jkr, theories
from sim.plots import kinds as plots, style as pictures, theories as rival_figures
from sim.read import where

NUMBERS = (42e-3, 2e-3, 6.4e6, 0.5, 0.1)


def plain(**changes):
    parts = {
        "bonds": bonds.Unbroken(stress=3e5),
        "shear": shear.Uniform(),
        "drive": STEADY,
        "clock": Clock(duration=0.04, step=0.02),
        "ensemble": Ensemble(members=1),
    }
    return simulated(**(parts | changes))


def curve_of(panel, name):
    _, colour, style = rival_figures._THEORIES[name]
    (data,) = (data for data in data_of(panel, colour, style) if len(data[0]) > 2)
    return data


def test_every_theory_is_drawn_as_far_as_adhesion_holds_with_a_dot_at_its_end():
    drawn_at = {}
    for contact, law, value in [
        (Equilibrium(load=4e-3), theories.compare_at_load, 4e-3),
        (Equilibrium(indentation=2e-6), theories.compare_at_indentation, 2e-6),
        (Equilibrium(load=-3e-4), theories.compare_at_load, -3e-4),
    ]:
        stresses, forces = drawn_at[value] = plots.draw(
            plain(contact=contact), "theories"
        ).axes
        factor = 1e3 if "kPa" in stresses.get_xlabel() else 1.0
        drawn, _ = curve_of(stresses, "uncorrected")
        radii = law(factor * drawn, value, *NUMBERS)
        names = (
            "uncorrected",
            "savkoor_briggs",
            "reversible_force",
            "reversible_stress",
            "fraction",
        )
        for name in (*names, "scaled_angle", "shear_share", "scaled_tangent"):
            stress, area = curve_of(stresses, name)
            assert np.array_equal(stress, drawn)
            held = np.isfinite(area)
            assert held[0] and np.all(
                radii[name][held] > np.nan_to_num(radii["hertz"][held])
            )
            per_area = {"mm²": 1e6, "µm²": 1e12}[
                stresses.get_ylabel()[-4:-1].strip("(")
            ]
            # rounding of the axis's unit, which a fold has the square root of
            assert_allclose(
                area[held], per_area * np.pi * radii[name][held] ** 2, rtol=1e-6
            )
            force, again = curve_of(forces, name)
            assert_allclose(again, area, rtol=1e-14)
            newton = {"mN": 1e3, "µN": 1e6}[forces.get_xlabel()[-3:-1]]
            assert_allclose(
                force[held],
                newton * factor * stress[held] * area[held] / per_area,
                rtol=1e-12,
            )
    at_stress, panel = drawn_at[4e-3]
    _, colour, _ = rival_figures._THEORIES["savkoor_briggs"]
    (dot,) = (
        line
        for line in panel.lines
        if line.get_color() == colour and line.get_marker() == "o"
    )
    limit = 1e3 * float(theories.savkoor_briggs_limit(4e-3, 42e-3, 2e-3))
    # four refinements of 1/29 each of a step of 500 over the decades of the axis
    assert limit * (1.0 - 1e-6) < dot.get_xdata()[0] <= limit * (1.0 + 1e-9)
    # stress held: the branch reaches Hertz's area smoothly, not with a jump
    hertz = 1e6 * np.pi * jkr.hertz_radius_at_load(4e-3, 2e-3, 6.4e6) ** 2
    _, held = curve_of(at_stress, "reversible_stress")
    assert_allclose(held[np.isfinite(held)][-1], hertz, rtol=1e-4)
    grey = [line for line in at_stress.lines if line.get_color() == pictures.REFERENCE]
    lines = {line.get_linestyle(): line.get_ydata()[0] for line in grey}
    at = {
        "--": jkr.radius_at_load(4e-3, 42e-3, 2e-3, 6.4e6),
        ":": jkr.hertz_radius_at_load(4e-3, 2e-3, 6.4e6),
    }
    for style, radius in at.items():
        assert_allclose(lines[style], 1e6 * np.pi * radius**2, rtol=1e-14)


def test_points_are_means_over_members_and_the_second_half_and_lie_on_the_theories():
    dataset = plain(sweep={"bonds.stress": [0.0, 1e5, 1e6]})
    stress, area = rival_figures.points_of(dataset)
    assert_allclose(stress, [0.0, 1e5, 1e6], rtol=1e-14)
    assert_allclose(area, dataset["contact_area"].isel(t=-1), rtol=1e-14)
    members = simulated(drive=STEADY, ensemble=Ensemble(members=5))
    late = members["contact_area"].isel(t=slice(members.sizes["t"] // 2, None))
    assert_allclose(rival_figures.points_of(members)[1], [late.mean()], rtol=1e-13)
    dataset = plain(sweep={"contact.load": [-3e-4, 1e-3, 4e-3]})
    with pytest.raises(ValueError, match=r"a single contact.*--where contact_load="):
        plots.draw(dataset, "theories")
    figure = plots.draw(where(dataset, {"load": "4 mN"}), "theories")
    assert "$P$ = 4 mN, $w$ = 42 mJ/m²" in figure.legends[0].get_title().get_text()
    dataset = simulated(shear=shear.Uniform())
    panel = plots.draw(dataset, "theories").axes[0]
    (last,) = (
        line for line in panel.lines if line.get_label() == "simulated, last record"
    )
    at = [1e-3 * dataset["shear_stress"][-1], 1e6 * dataset["contact_area"][-1]]
    assert_allclose(np.ravel(last.get_data()), at, rtol=1e-14)
    contact = Equilibrium(load=4e-3, reversible=0.02)
    dataset = plain(
        contact=contact,
        sweep={"contact.reversible": [0.0, 0.02, 1.0], "bonds.stress": [1e4, 3e4]},
    )
    case = rival_figures.case_of(dataset)
    assert case.reversible == 0.02 and rival_figures.case_of(plain()).reversible == 0.1
    stress, area = rival_figures.points_of(dataset)
    theories = case.areas(np.array([1e4, 3e4]))
    exact = np.concatenate(
        [theories[name] for name in ("jkr", "fraction", "reversible_stress")]
    )
    assert_allclose(np.sort(area), np.sort(exact), rtol=1e-9)
    assert len(stress) == 6


def test_scenes_that_theories_do_not_describe_are_refused_with_the_cure():
    for changes, words in (
        (
            {"contact": Equilibrium(displacement=1e-6, stiffness=100.0)},
            "load = .*indentation; .*drawn as: .*time",
        ),
        (
            {"contact": Equilibrium(load={"from": 0.0, "to": 4e-3})},
            "load = .*indentation; .*drawn as: .*time",
        ),
        ({"adhesion": Adhesion(work=0.0)}, "only with adhesion"),
        ({"contact": Equilibrium(load=-1.0)}, "no contact at rest.*drawn as: time$"),
    ):
        with pytest.raises(ValueError, match=words):
            plots.draw(plain(**changes), "theories")
