"""The constants of a scene: moduli, a second body, adhesion."""

from dataclasses import astuple

import numpy as np
from numpy.testing import assert_allclose

from sim.laws import halfspace
from sim.parts.contact.models import Adhesion, Body, Solid


def test_either_modulus_describes_a_solid_and_a_second_body_adds_its_compliances():
    by_shear = Solid(shear_modulus=1e6, poisson_ratio=0.3)
    by_young = Solid(youngs_modulus=2.6e6, poisson_ratio=0.3)
    moduli = by_young.elastic.shear_modulus, by_shear.elastic.shear_modulus
    assert_allclose(*moduli, rtol=1e-15, atol=0)
    assert by_young.elastic.poisson_ratio == by_shear.elastic.poisson_ratio == 0.3
    assert_allclose(
        by_young.contact_modulus, 2.6e6 / (1.0 - 0.3**2), rtol=1e-14, atol=0
    )
    solid = Solid(
        shear_modulus=1e6,
        poisson_ratio=0.5,
        counter_body={"youngs_modulus": 5e6, "poisson_ratio": 0.25},
    )
    assert isinstance(solid.counter_body, Body)
    expected = halfspace.in_series(1e6, 0.5, 2e6, 0.25)
    of_both = *expected, halfspace.coupling(1e6, 0.5, 2e6, 0.25)
    assert_allclose(astuple(solid.elastic), of_both, rtol=1e-14, atol=0)
    assert_allclose(
        solid.contact_modulus, halfspace.contact_modulus(*expected), rtol=1e-14, atol=0
    )
    assert_allclose(
        solid.contact_modulus,
        1.0 / ((1 - 0.5**2) / 3e6 + (1 - 0.25**2) / 5e6),
        rtol=1e-14,
        atol=0,
    )


def test_the_work_follows_the_bonds_by_their_share():
    fraction = np.array([0.0, 0.5, 1.0])
    assert_allclose(
        Adhesion(work=0.04).work_of_bonds(fraction),
        [0.0, 0.02, 0.04],
        rtol=1e-15,
        atol=0,
    )
    shared = Adhesion(work=0.04, bond_share=0.25).work_of_bonds(fraction)
    assert_allclose(shared, [0.03, 0.035, 0.04], rtol=1e-15, atol=0)
    assert_allclose(
        Adhesion(work=0.04, bond_share=0.0).work_of_bonds(fraction),
        0.04,
        rtol=1e-15,
        atol=0,
    )
    assert Adhesion(work=0.0).work_of_bonds(1.0) == 0.0
