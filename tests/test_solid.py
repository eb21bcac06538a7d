"""The elastic solid: its closed forms beside quadrature and beside each other, and a solid of another kind."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.laws import halfspace, layer
from sim.parts import shear
from sim.parts.contact.models import Solid
from sim.parts.shear.process import Time
from sim.solid import ElasticSolid, HalfSpace, Layer
from sim.spectrum import (
    AnisotropicGaussian,
    Band,
    BondMade,
    Gaussian,
    Ripple,
    SelfAffine,
    Tabulated,
    VonKarman,
)
from sim.spectrum.measured import StressMap

STRESSES = {
    "ripple": Ripple(2.0, 0.3, 0.4),
    "band": Band(2.0, longest=3.0, shortest=1.0),
    "self-affine": SelfAffine(2.0, 0.3, longest=5.0, rolloff=2.0, shortest=0.1),
    "gaussian": Gaussian(2.0, 0.7),
    "anisotropic": AnisotropicGaussian(2.0, 0.7, 2.1, 0.4),
    "von Kármán": VonKarman(2.0, 0.7, 0.05),
    "table": Tabulated((1.0, 3.0, 4.0), (0.0, 4.0, 1.0)),
    "bonds": BondMade(footprint=0.2),
    "map": StressMap(
        file="",
        pixel=0.1,
        pixel_y=0.2,
        values=np.random.default_rng(1).normal(size=(24, 15)).tobytes(),
        shape=(24, 15),
    ),
}


@dataclass(frozen=True)
class Stiffened(HalfSpace):
    """A made-up solid that is stiffer against waves longer than a length, as a layer is."""

    length: float = 1.0

    def compliance(self, qx, qy):
        return super().compliance(qx, qy) * np.tanh(np.hypot(qx, qy) * self.length)

    def stored_energy(self, stress):
        return ElasticSolid.stored_energy(self, stress)


@pytest.mark.parametrize("name", STRESSES)
def test_the_quadrature_of_the_compliance_is_the_closed_form_of_the_half_space(name):
    stress = STRESSES[name]
    # the last 1e-7 of the energy of bonds lies where their density is not followed
    rtol = 1e-7 if name == "bonds" else 1e-12
    for poisson_ratio in (0.0, 0.3, 0.5):
        solid = HalfSpace(1.7, poisson_ratio)
        by_quadrature = ElasticSolid.stored_energy(solid, stress)
        assert_allclose(by_quadrature, solid.stored_energy(stress), rtol=rtol, atol=0)


def surface(poisson_ratio, shear_modulus, side):
    """Return U, W, shear and normal stress at the face z = 0 of two solutions in a body, as rows of a matrix.

    The body fills z < 0 for ``side`` 1 and z > 0 for -1. The displacement is (iU, W) exp(ix), each solution
    exp(\\|z\\|) smaller inside: U = W = 1 and U = z, W = z - (3 - 4ν).
    """
    rest = 2.0 - 4.0 * poisson_ratio
    return np.array(
        [
            [1.0, 0.0],
            [side, -side * (1.0 + rest)],
            [2.0 * side * shear_modulus, -side * rest * shear_modulus],
            [2.0 * shear_modulus, -4.0 * (1.0 - poisson_ratio) * shear_modulus],
        ]
    )


@pytest.mark.parametrize("ratios", [(0.3, 0.1), (0.3, 0.3), (0.5, 0.0), (0.1, 0.5)])
def test_two_bodies_slip_past_each_other_as_their_equations_say_without_coming_apart(
    ratios,
):
    moduli = 2.0, 7.0
    for (low, other), (soft, hard) in ((ratios, moduli), (ratios, (3.0, 3.0))):
        first, second = surface(low, soft, 1.0), surface(other, hard, -1.0)
        zero = np.zeros(2)
        system = np.array(
            [
                [*(first[1]), *(-second[1])],
                [*(first[2]), *zero],
                [*zero, *(second[2])],
                [*(first[3]), *(-second[3])],
            ]
        )
        weights = np.linalg.solve(system, [0.0, 1.0, 1.0, 0.0])
        slip = first[0] @ weights[:2] - second[0] @ weights[2:]
        body = {"shear_modulus": hard, "poisson_ratio": other}
        solid = Solid(shear_modulus=soft, poisson_ratio=low, counter_body=body).elastic
        assert_allclose(solid.compliance(1.0, 0.0), slip, rtol=1e-14, atol=0)
        across = 1.0 / soft + 1.0 / hard
        assert_allclose(solid.compliance(0.0, 1.0), across, rtol=1e-14, atol=0)


def test_a_rigid_sphere_stiffens_a_compressible_solid_and_no_other():
    spectrum = Gaussian(2.0, 0.7)
    for poisson_ratio in (0.0, 0.1, 0.3, 0.5):
        solid = HalfSpace(1.7, poisson_ratio)
        # (7 - 8ν)/(32π(1 - ν)G) ∫ C dq of an isotropic spectrum
        level = (7.0 - 8.0 * poisson_ratio) / (32.0 * math.pi * (1.0 - poisson_ratio))
        exact = level / 1.7 * spectrum.line_integral
        assert_allclose(solid.stored_energy(spectrum), exact, rtol=1e-14, atol=0)
        rigid = Solid(shear_modulus=1.7, poisson_ratio=poisson_ratio).elastic
        assert rigid.held_ratio == solid.held_ratio
    assert HalfSpace(1.7).held_ratio == 0.5


@pytest.mark.verify
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.1, 0.3, 0.49])
def test_waves_under_a_rigid_sphere_move_as_those_of_the_package_tamaas(poisson_ratio):
    tamaas = pytest.importorskip("tamaas", reason="in the extra peers")
    modulus, count = 1.7, 16
    surface = tamaas.model_type.surface_2d
    model = tamaas.ModelFactory.createModel(surface, [2 * np.pi] * 2, [count] * 2)
    model.E, model.nu = 2.0 * modulus * (1.0 + poisson_ratio), poisson_ratio
    along = np.arange(count) * 2.0 * np.pi / count
    for qx, qy in ((1, 0), (0, 2), (1, 2)):
        wave = np.cos(qx * along[:, np.newaxis] + qy * along)
        moved = np.empty((3, 3), complex)
        for stress in range(3):
            model.traction[:] = 0.0
            model.traction[..., stress] = wave
            model.solveNeumann()
            displacement = np.fft.fft2(model.displacement, axes=(0, 1))[qx, qy]
            moved[:, stress] = displacement / np.fft.fft2(wave)[qx, qy]
        # a normal stress that adjusts itself holds the normal displacement
        held = moved[0, 0] - moved[0, 2] * moved[2, 0] / moved[2, 2]
        exact = HalfSpace(modulus, poisson_ratio).compliance(float(qx), float(qy))
        assert_allclose(held, exact, rtol=1e-12, atol=0)


def test_the_force_of_a_uniform_stress_does_the_work_that_the_solid_stores():
    radius, stress = np.array([0.3, 2.0]), 5.0
    for poisson_ratio in (0.0, 0.3, 0.5):
        solid = HalfSpace(1.7, poisson_ratio)
        energy = halfspace.disc_tangential_energy(radius, stress, 1.7, poisson_ratio)
        force = math.pi * radius**2 * stress
        compliance = solid.tangential_compliance(radius)
        assert_allclose(0.5 * force**2 * compliance, energy, rtol=1e-14, atol=0)
        # dU/dA of U ∝ a³
        new = 1.5 * energy / (math.pi * radius**2)
        assert_allclose(solid.mean_stress_energy(radius, stress), new, rtol=1e-14)
    # π² G a/2 under the footprint of a bond, and under any other disc of an incompressible half-space
    solid, footprint = HalfSpace(1.6e6), BondMade(footprint=1e-9)
    under_bond = 0.5 / solid.stored_energy(footprint)
    assert_allclose(under_bond, 0.5 * math.pi**2 * 1.6e6 * 1e-9, rtol=1e-14)
    assert_allclose(under_bond * solid.tangential_compliance(1e-9), 1.0, rtol=1e-14)


def test_stiffness_and_energy_go_with_the_shear_modulus():
    for solid in (HalfSpace(1.7, 0.3), Stiffened(1.7, 0.3, 0.2)):
        assert type(solid.unit) is type(solid) and solid.unit.shear_modulus == 1.0
        assert hash(solid.unit) == hash(solid.unit.unit)
        for stress in STRESSES.values():
            energies = (each.stored_energy(stress) for each in (solid.unit, solid))
            assert_allclose(next(energies) / next(energies), 1.7, rtol=1e-14, atol=0)


def test_a_solid_with_a_length_is_followed_by_spectra_modes_and_bands():
    spectrum = Gaussian(2.0, 0.7)
    recipe = {"spectrum": spectrum, "correlation": Time(time=1.0)}
    solid = Stiffened(1.7, 0.3, length=0.5)
    plane, errors = solid.stored_energy(spectrum), []
    assert plane < 0.9 * HalfSpace(1.7, 0.3).stored_energy(spectrum)
    for cell, points in ((20.0, 200), (40.0, 400)):
        keys = recipe | {"cell": cell, "points": points}
        modal, banded = (
            model(**keys).process(solid, 1.0) for model in (shear.Modal, shear.Banded)
        )
        energy = np.sum(modal.modes.energies(solid))
        assert_allclose(banded.bands.mean, energy, rtol=1e-12, atol=0)
        errors.append(energy / plane - 1.0)
        for process in (modal, banded):
            known = process.known_errors()["cell_error_energy"]
            assert_allclose(known, errors[-1], rtol=1e-9, atol=0)
    # second order in the step of wavenumbers, because the compliance at q = 0 is finite; a half-space has first order
    assert_allclose(errors[0] / errors[1], 4.0, rtol=0.05)
    # a layer much thicker than all waves lacks ∫ (1 − tanh qh) dq = ln 2/h of ∫ exp(−q²ξ²/4) dq = √π/ξ
    deep, half_space = Stiffened(1.7, 0.3, length=1e5), HalfSpace(1.7, 0.3)
    ratio = deep.stored_energy(spectrum) / half_space.stored_energy(spectrum)
    lacks = math.log(2.0) * 0.7 / math.sqrt(math.pi) / 1e5
    assert_allclose(1.0 - ratio, lacks, rtol=1e-8, atol=0)


@pytest.mark.parametrize("name", STRESSES)
def test_the_energy_on_a_layer_is_the_integral_of_its_compliance(name):
    stress, solid = STRESSES[name], Layer(1.7, 0.05)
    energy, half_space = (
        each.stored_energy(stress) for each in (solid, HalfSpace(1.7))
    )
    assert energy < 0.9 * half_space
    # short waves alone do not feel the base
    thick = Layer(1.7, 1e4).stored_energy(stress)
    assert_allclose(thick, half_space, rtol=1e-3)
    if name == "ripple":
        q = 2.0 * math.pi / 0.3
        level = math.cos(0.4) ** 2 * layer.along_held(0.05 * q)
        level += math.sin(0.4) ** 2 * layer.across(0.05 * q)
        exact = 0.25 * 2.0**2 * level / (1.7 * q)
        assert_allclose(energy, exact, rtol=1e-14, atol=0)
    elif name in ("gaussian", "von Kármán", "self-affine", "band", "table"):
        low, high = stress.support
        edges = np.unique([low, *stress.breaks, *np.geomspace(0.01, 1e14, 80), high])
        edges = edges[(edges >= low) & (edges <= min(high, 1e14))]

        def integrand(q):
            level = layer.along_held(0.05 * q) + layer.across(0.05 * q)
            return stress.density(q, 0.0) * level / (8.0 * math.pi * 1.7)

        exact = sum(
            quad(integrand, *pair, epsabs=0, epsrel=1e-12, limit=200)[0]
            for pair in itertools.pairwise(edges)
        )
        # quad is good to 1e-12 in each piece; the tail of von Kármán's density falls as q^-1.1 beyond the last edge
        assert_allclose(energy, exact, rtol=1e-9, atol=0)


def test_a_layer_under_a_uniform_stress_stores_the_work_that_its_stiffness_does():
    solid, stress = Layer(1.7, 0.4), 5.0
    for radius in (1e-3, 0.1, 0.7, 3.0, 25.0):
        force = math.pi * radius**2 * stress
        energy = 0.5 * force**2 * solid.tangential_compliance(radius)
        density = solid.mean_stress_density(radius, stress)
        assert_allclose(density * math.pi * radius**2, energy, rtol=1e-14, atol=0)
        sizes = radius * (1.0 + 1e-3 * np.array([-2.0, -1.0, 1.0, 2.0]))
        stored = math.pi * sizes**2 * solid.mean_stress_density(sizes, stress)
        slope = stored @ [1.0, -8.0, 8.0, -1.0] / (12e-3 * radius)
        new = solid.mean_stress_energy(radius, stress)
        assert_allclose(slope / (2.0 * math.pi * radius), new, rtol=1e-9, atol=0)
    thin, thick, half_space = Layer(1.7, 1e-2), Layer(1.7, 1e9), HalfSpace(1.7)
    assert_allclose(thin.mean_stress_energy(0.7, stress), 25e-2 / 3.4, rtol=0.03)
    for law in ("mean_stress_energy", "mean_stress_density"):
        values = (getattr(each, law)(0.7, stress) for each in (thick, half_space))
        assert_allclose(next(values), next(values), rtol=1e-8, atol=0)
    assert thin.mean_stress_density(0.0, stress) == 0.0
