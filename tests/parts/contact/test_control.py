"""The contact under each control: energies along a path, limits of a machine, never below Hertz, any number."""

import math
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sim.laws import jkr
from sim.parts.contact import Equilibrium
from sim.parts.contact.balance import (
    Balance,
    Bodies,
    DisplacementControl,
    LoadControl,
    elastic_energy,
)
from sim.solid import HalfSpace
from sim.spectrum.families import Gaussian
from sim.spectrum.radial import Margin, disc_energy

SHEAR_MODULUS = 0.1875
#: Maugis's units: K = 4 E*/3, R and pi w are 1, so that radii, loads and displacements are those of the textbooks.
MAUGIS = Bodies(1.0, HalfSpace(SHEAR_MODULUS))
WORK = 1.0 / math.pi
PATCHES = Gaussian(rms=1.0, length=0.4)
DISC = Margin(PATCHES, HalfSpace(SHEAR_MODULUS).softness, 4.0)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)


def drift(part):
    """A number that changes smoothly along a path, and its derivative."""
    return math.sin(2.0 * part + 0.3), 2.0 * math.cos(2.0 * part + 0.3)


class Path:
    """A slow path of part 0 to 1 along which the control moves from one value to another and the work changes."""

    def __init__(self, control, ends, reversible=0.0, fluctuating=0.0, changing=0.0):
        self.control, self.ends, self.reversible = control, ends, reversible
        self.fluctuating, self.changing = fluctuating, changing
        self.margin = DISC if fluctuating else None
        self.stress = np.array([0.25])

    def state(self, part):
        """Control, balance and radius on the way, in equilibrium."""
        value = self.ends[0] + np.diff(self.ends)[0] * part
        bonded = np.array([WORK * (1.0 + self.changing * drift(part)[0])])
        balance = Balance(
            bonded,
            np.array([self.fluctuating * WORK]),
            self.stress,
            self.margin,
            MAUGIS,
            WORK,
        )
        contact = Equilibrium(**self.control(value), reversible=self.reversible)
        control = contact.control(0.0, 1.0)
        return control, balance, contact.equilibrium(control, balance)

    def stored(self, part):
        """Energy of the contact and its machine, adhesion included: int w dA in closed form."""
        control, balance, a = self.state(part)
        depth = control.indentation(a, MAUGIS)
        machine = 0.0
        if isinstance(control, DisplacementControl) and math.isfinite(
            control.stiffness
        ):
            machine = 0.5 * control.stiffness * (control.base - depth) ** 2
        area = math.pi * a**2
        plane = float(HalfSpace(SHEAR_MODULUS).stored_energy(PATCHES))
        share = (
            disc_energy(PATCHES, a, HalfSpace(SHEAR_MODULUS).softness) / plane
            if self.fluctuating
            else 0.0
        )
        adhesive = area * (balance.bonded - balance.fluctuating * share)
        mean = self.reversible * 4.0 * self.stress**2 * a**3 / MAUGIS.modulus
        return (elastic_energy(a, depth, MAUGIS) + machine - adhesive + mean)[0]

    def spent(self):
        """int P d(displacement) - int A dw over the path, by Gauss's nodes; at a load by parts."""
        total = 0.0
        for node, weight in zip(0.5 * (1.0 + NODES), 0.5 * WEIGHTS, strict=True):
            control, _, a = self.state(node)
            at_load = isinstance(control, LoadControl)
            slope = (
                -control.displacement(a, MAUGIS)
                if at_load
                else control.normal_load(a, MAUGIS)
            )
            adhesive = math.pi * a**2 * WORK * self.changing * drift(node)[1]
            total += weight * (np.diff(self.ends) * slope - adhesive)[0]
        if "load" in self.control(1.0):
            for part, sign in ((1.0, 1.0), (0.0, -1.0)):
                control, _, a = self.state(part)
                total += sign * (control.load * control.displacement(a, MAUGIS))[0]
        return total


CONTROLS = {
    "load": (lambda value: {"load": value}, (3.0, -1.0)),
    "indentation": (lambda value: {"indentation": value}, (2.0, -0.5)),
    "soft machine": (
        lambda value: {"displacement": value, "stiffness": 0.1},
        (9.0, -10.0),
    ),
    "machine": (lambda value: {"displacement": value, "stiffness": 5.0}, (3.0, -0.8)),
}
PAID = {
    "constant work": {},
    "work that changes in time": {"changing": 0.1},
    "reversible": {"reversible": 0.3},
    "reversible, changing": {"reversible": 0.3, "changing": -0.1},
    "on a disc": {"fluctuating": 0.2},
    "on a disc, reversible, changing": {
        "fluctuating": 0.1,
        "reversible": 0.2,
        "changing": 0.05,
    },
}


def test_the_work_done_on_a_contact_is_what_it_stores_and_energies_slope_to_the_load():
    for paid, control in product(PAID, CONTROLS):
        # the sum converges like exp(-60 x): to rounding, but for the spline of the disc's share, good to 1e-9
        path = Path(*CONTROLS[control], **PAID[paid])
        gained = path.stored(1.0) - path.stored(0.0)
        assert abs(gained) > 0.01
        assert_allclose(
            path.spent(), gained, rtol=0.0, atol=1e-8 if "disc" in paid else 1e-10
        )
    for make, (low, _) in CONTROLS.values():
        control = Equilibrium(**make(low)).control(0.0, 1.0)
        a = np.array([1.3])
        depth = control.indentation(a, MAUGIS)
        # a complex step has no rounding of differences
        slope = elastic_energy(a, depth + 1e-30j, MAUGIS).imag / 1e-30
        assert_allclose(slope, control.normal_load(a, MAUGIS), rtol=1e-13)
        rate = (
            elastic_energy(a + 1e-30j, depth, MAUGIS).imag / 1e-30 / (2.0 * math.pi * a)
        )
        assert_allclose(rate, release_rate(a, control), rtol=1e-13)


def test_load_indentation_and_displacement_of_any_radius_go_together_and_an_open_contact_bears_no_load():
    a = np.random.default_rng(7).uniform(0.1, 3.0, 200)
    for control in (
        LoadControl(-0.7),
        DisplacementControl(0.4),
        DisplacementControl(0.4, 3.0),
    ):
        load, depth = control.normal_load(a, MAUGIS), control.indentation(a, MAUGIS)
        assert_allclose(
            load, 2.0 * 0.75 * a * (depth - a**2 / 3.0), rtol=0.0, atol=1e-13
        )
        yielded = load / 3.0 if getattr(control, "stiffness", math.inf) == 3.0 else 0.0
        assert_allclose(
            control.displacement(a, MAUGIS), depth + yielded, rtol=0.0, atol=1e-14
        )
    gone = np.array([math.nan])
    for control in (
        LoadControl(-3.0),
        DisplacementControl(-2.0),
        DisplacementControl(-2.0, 5.0),
    ):
        assert_array_equal(control.normal_load(gone, MAUGIS), 0.0)
        assert not control.closes
    # a free sphere is anywhere
    assert math.isnan(LoadControl(-3.0).indentation(gone, MAUGIS)[0])
    assert_array_equal(DisplacementControl(-2.0, 5.0).indentation(gone, MAUGIS), -2.0)
    for load in (0.0, 1.0):
        assert LoadControl(load).energy(np.zeros(2), np.zeros(2), MAUGIS).tolist() == [
            0.0,
            0.0,
        ]


def random_cases(kind, size, count):
    """Contacts on a disc of random controls; works from masked to strong, and stresses over decades."""
    rng = np.random.default_rng(13)
    for _ in range(count):
        held = {kind: rng.uniform(-2.0, 3.0)}
        if kind == "displacement":
            held["stiffness"] = 10.0 ** rng.uniform(-3.0, 3.0)
        contact = Equilibrium(**held)
        bonded, fluctuating = (
            WORK * rng.uniform(0.0, 1.0, size),
            WORK * rng.uniform(0.0, 2.0, size),
        )
        balance = Balance(
            bonded,
            fluctuating,
            10.0 ** rng.uniform(-3.0, 1.0, size),
            DISC,
            MAUGIS,
            WORK,
        )
        control = contact.control(0.0, 1.0)
        hertz = control.radius(np.zeros(1), MAUGIS)
        yield control, balance, contact.equilibrium(control, balance), hertz


def release_rate(a, control):
    return jkr.energy_release_rate_at_indentation(
        a, control.indentation(a, MAUGIS), 1.0, 0.75
    )


@pytest.mark.parametrize("contacts", [8, pytest.param(20, marks=pytest.mark.verify)])
def test_the_contact_on_a_disc_is_the_widest_that_balances(contacts):
    # a walk from the right over 4000 places of the surplus G - w(a), G below Hertz's radius counted negative
    places = np.geomspace(4.0, 1e-3, 4000)[:, None]
    step = places[0, 0] / places[1, 0]
    for kind in ("load", "indentation", "displacement"):
        for control, balance, a, hertz in random_cases(kind, 30, contacts):
            rate = release_rate(places, control)
            pull = np.where(
                places**2 > control.indentation(places, MAUGIS), rate, -rate
            )
            below = pull <= balance.bonded - balance.fluctuating * DISC(places)
            widest = places[np.argmax(below, 0), 0]
            masked = hertz if control.closes else math.nan
            expected = np.where(
                below.any(0), np.maximum(widest, np.nan_to_num(hertz)), masked
            )
            off = np.isnan(a) != np.isnan(expected)
            off |= ~np.isnan(a + expected) & (
                (a < expected / step) | (a > expected * step * (1.0 + 1e-12))
            )
            # two crossings between neighbouring places are a contact that the walk does not see
            balanced = np.abs(release_rate(a, control) - balance.work(a)) <= 1e-9 * WORK
            assert not np.any(off & ~(np.isnan(expected) & ~np.isnan(a) & balanced))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_no_number_raises_or_hangs_or_makes_a_contact_smaller_than_hertz():
    numbers = [
        0.0,
        5e-324,
        1e-300,
        1e-150,
        1e-30,
        1e-6,
        1.0,
        1e6,
        1e30,
        1e150,
        1e300,
        1.7e308,
    ]
    works = np.array([0.0, -1.0, *numbers, math.inf, -math.inf, math.nan])
    for reversible in [0.0, 1e-9, 1.0]:
        contact = Equilibrium(load=1.0, reversible=reversible)
        for sign, size, stiffness in product(
            [1.0, -1.0], numbers, [0.0, 5e-324, 1e-30, 1.0, 1e30, 1e308, math.inf]
        ):
            value = sign * size
            control = (
                DisplacementControl(value, stiffness)
                if stiffness
                else LoadControl(value)
            )
            hertz = control.radius(np.zeros(1), MAUGIS)[0]
            for stress in (0.0, 1.0, 1e150):
                balance = Balance(
                    works, np.zeros(1), np.full(1, stress), None, MAUGIS, WORK
                )
                a = contact.equilibrium(control, balance)
                closed = np.isfinite(a) & (a > 0.0)
                # a denormal number has too few digits
                is_normal = 5e-324 not in (size, stiffness)
                if value >= 0.0 and is_normal and math.isfinite(hertz):
                    assert np.all(a[closed] >= hertz * (1.0 - 1e-13))
                if value < 0.0:
                    assert np.all(np.isnan(a[:2]))
                for read in (
                    control.normal_load,
                    control.indentation,
                    control.displacement,
                ):
                    assert read(a, MAUGIS).shape == a.shape
