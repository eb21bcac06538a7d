"""Every line of ``sim paper`` holds, and would not if a law were wrong."""

import math

from sim.laws import halfspace, jkr, schallamach
from sim.study import paper
from sim.study.paper import Check, checks


def test_every_line_of_the_paper_holds():
    lines = checks()
    assert len(lines) >= 30
    assert [line.name for line in lines if not line.holds] == []


def test_lines_say_what_they_compare():
    lines = checks()
    assert len({(line.name, line.equation, line.computed) for line in lines}) == len(lines)
    for line in lines:
        assert line.equation
        assert math.isfinite(line.computed)
        scale = abs(line.expected) if line.expected != 0.0 else 1.0
        assert line.error == abs(line.computed - line.expected) / scale


def test_nothing_passes_on_a_loose_tolerance_but_the_printed_numbers():
    loose = [line.name for line in checks() if line.tolerance > 1e-7]
    assert len(loose) == 3
    assert all("as printed" in name for name in loose)


def test_a_wrong_value_and_a_nan_fail():
    assert not Check("", "", 1.1, 1.0, 0.1, 1e-3).holds
    assert not Check("", "", math.nan, 1.0, math.nan, 1e-3).holds
    assert not paper._check("", "", [1.0, math.nan, 2.0], [1.0, 1.0, 2.0]).holds
    worst = paper._check("", "", [1.0, 1.5, 2.0], [1.0, 1.0, 2.0])
    assert (worst.computed, worst.expected, worst.error) == (1.5, 1.0, 0.5)


#: Laws, and the section of the paper that each enters.
LAWS = (
    (halfspace, "point_displacement", paper._point_force),
    (halfspace, "compliance", paper._point_force),
    (halfspace, "disc_displacement", paper._disc),
    (halfspace, "disc_mean_displacement", paper._disc),
    (halfspace, "disc_edge_mean_displacement", paper._uniform_stress),
    (halfspace, "disc_tangential_energy", paper._uniform_stress),
    (halfspace, "edge_work", paper._uniform_stress),
    (halfspace, "surface_energy", paper._fluctuation),
    (halfspace, "displacement", paper._ripple),
    (halfspace, "ripple_energy", paper._ripple),
    (halfspace, "masking_amplitude", paper._masking),
    (jkr, "load_under_indentation", paper._fixed_separation),
    (jkr, "potential_at_indentation", paper._fixed_separation),
    (jkr, "potential_slope_at_indentation", paper._fixed_separation),
    (jkr, "indentation_under_load", paper._fixed_load),
    (jkr, "potential_at_load", paper._fixed_load),
    (jkr, "potential_slope_at_load", paper._fixed_load),
    (jkr, "radius_at_load", paper._equilibrium),
    (jkr, "radius_at_indentation", paper._equilibrium),
    (jkr, "pull_off_load", paper._equilibrium),
    (schallamach, "steady_fraction", paper._bonds),
)


def test_a_law_that_is_wrong_by_a_millionth_fails_its_section(monkeypatch):
    for module, law, section in LAWS:
        right = getattr(module, law)
        assert all(paper._check(*row).holds for row in section())
        with monkeypatch.context() as patched:
            patched.setattr(module, law, lambda *values, right=right, **named: right(*values, **named) * (1.0 + 1e-6))
            assert not all(paper._check(*row).holds for row in section()), law
