"""Writes docs/validation.png and the table of docs/validation.md: sim beside results that are not its own.

``python docs/make_validation.py`` runs all comparisons; those with other packages need the packages that
``make verify`` installs beside the environment. A test of ``make verify`` runs each comparison again.
"""

import importlib.metadata
import importlib.util
import math
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import matplotlib.pyplot
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy import integrate, stats

import sim
from sim.laws import cohesive, jkr, layer
from sim.plots import style
from sim.solid import HalfSpace
from sim.spectrum.families import Gaussian, VonKarman
from sim.spectrum.measured import StressMap

PAGE = Path(__file__).with_name("validation.md")
PICTURE = PAGE.with_suffix(".png")
START, END = "<!-- table: make_validation.py -->", "<!-- end of the table -->"
#: Relative precision of the radius of an edge that lags (`sim.parts.contact.front`).
_EDGE = 1e-7
Array = NDArray[np.float64]

#: A lens of PDMS.
LENS = {
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
}
MODULUS, RADIUS, WORK = 6.4e6, 2e-3, 42e-3


class Comparison(NamedTuple):
    """One result of ``sim`` beside that of another source.

    Attributes
    ----------
    against : str
        The other source.
    quantity : str
        The quantity that is compared.
    difference : float
        Largest difference over the size of the quantity.
    error : float
        Standard error of this difference if one side has noise; else the bound that it must not exceed.
    is_noisy : bool
        True if ``error`` is a standard error.
    x, sim, other : array
        A curve by ``sim`` and the same by the other source, for the figure.
    label : str
        Quantity and unit of ``x``, for the figure.
    """

    against: str
    quantity: str
    difference: float
    error: float
    is_noisy: bool
    x: Array
    sim: Array
    other: Array
    label: str

    @property
    def holds(self) -> bool:
        """Return True if the difference is within its bound, or within four standard errors."""
        return self.difference <= self.error * (4.0 if self.is_noisy else 1.0)


def compared(
    against: str,
    quantity: str,
    bound: float,
    curves: tuple[Array, Array, Array],
    label: str,
) -> Comparison:
    """Return the comparison of two curves without noise; its difference is over the largest value."""
    x, ours, theirs = curves
    difference = np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs))
    return Comparison(
        against, quantity, float(difference), bound, False, x, ours, theirs, label
    )


def shared_force() -> Comparison:
    """Compare the life of bonds that share a constant force with the sum of Erdmann and Schwarz.

    Of i closed bonds each bears the force F/i, so that one of them breaks at the rate i k0 exp(F/(i f_b)). Without
    rebinding the mean life of all N bonds is the sum of the inverse rates.
    """
    sites, members = 10, 4096
    forces, means, errors = np.array([0.0, 10.0, 20.0, 40.0]), [], []
    area = math.pi * 1e-12  # of a sphere of 10 um pressed by 100 nm without adhesion
    scene = {
        "seed": 405247,
        "clock": {"duration": "40 s", "step": "20 s"},
        "solid": {"shear_modulus": "1 kPa"},
        "sphere": {"radius": "10 um"},
        "adhesion": {"work": 0.0},
        "contact": {"model": "equilibrium", "indentation": "100 nm"},
        "drive": {"model": "force", "force": "20 pN"},
        "bonds": {
            "model": "tracked",
            "rupture": {
                "model": "bell",
                "zero_force_rate": "1 1/s",
                "bell_force": "4 pN",
            },
            "bond_stiffness": "0.8 pN/nm",
            "rebinding_rate": 0.0,
            "site_density": sites / area,
            "sites": sites,
            "start": "bonded",
        },
        "ensemble": {"members": members},
    }
    exact = []
    for force in forces[1:]:
        dataset = sim.run(sim.load(scene, {"drive.force": f"{force} pN"}))
        life = dataset.runaway_time.isel(t=-1).values
        means.append(life.mean())
        closed = np.arange(1, sites + 1)
        rates = closed * np.exp(force / 4.0 / closed)
        exact.append(np.sum(1.0 / rates))
        errors.append(math.sqrt(np.sum(rates**-2.0) / members) / exact[-1])
    ours, theirs = np.array(means), np.array(exact)
    off = np.abs(ours / theirs - 1.0)
    worst = int(np.argmax(off / errors))
    return Comparison(
        "Erdmann & Schwarz (2004)",
        "mean life of 10 bonds that share a force",
        float(off[worst]),
        float(errors[worst]),
        True,
        forces[1:],
        ours,
        theirs,
        "force (pN), life (s)",
    )


def one_threshold() -> Comparison:
    """Compare the onset of sliding with the master equation of Braun and Peyrard for contacts with one threshold.

    A contact breaks at the stretch l and forms again, unstretched, at the rate k. At the speed V the j-th birth of a
    contact after its first is at j l/V plus a time with the gamma distribution of j waits, so that the stress is a
    sum of incomplete gamma functions.
    """
    stretch, speed, rate, stress = 100e-6, 1e-3, 10.0, 1e6
    scene = LENS | {
        "clock": {"duration": "0.6 s", "step": "0.2 ms", "record": "2 ms"},
        "contact": {"model": "equilibrium", "load": "4 mN"},
        "drive": {"model": "steady", "speed": speed},
        "bonds": {
            "model": "cohort",
            "rupture": {"model": "cut_off", "stretch": stretch},
            "bond_stiffness": "1 uN/m",
            "rebinding_rate": rate,
            "site_density": stress / (1e-6 * stretch),
            "start": "bonded",
        },
    }
    dataset = sim.run(scene)
    time, life = dataset.t.values, stretch / speed
    exact = np.where(time < life, speed * time, 0.0)
    for j in range(1, 40):
        y = time - j * life
        born, late = (
            np.array([stats.gamma.cdf(x, k) for k in (j, j + 1)])
            for x in (rate * y, rate * (y - life))
        )
        count, waits = born - late
        exact += speed * (y * count - j / rate * waits)
    exact *= stress / stretch
    ours = dataset.shear_stress.values
    # at a rupture of all first contacts at once the stress has two values
    smooth = np.abs(time / life - 1.0) > 1e-6
    return compared(
        "Braun & Peyrard (2010)",
        "shear stress at the onset of sliding, one threshold of rupture",
        1e-4,  # the tolerance of cohorts
        (1e3 * time[smooth], 1e-3 * ours[smooth], 1e-3 * exact[smooth]),
        "time (ms), stress (kPa)",
    )


def fast_pull_off() -> Comparison:
    """Compare the pull-off load over the speed with an edge of finite speed by a general integrator.

    The edge law is G = w (1 + (v/v0)^n). With fixed grips G = E* (a^2/R - d)^2/(2 pi a) and
    P = 4 E* a^3/(3 R) - sqrt(8 pi E* a^3 G). Ciavarella (2020) solves the same equations.
    """
    edge, exponent, path = 1e-3, 0.6, 60e-6
    speeds = np.array([1e-6, 1e-5, 1e-4, 1e-3])
    start = float(jkr.radius_at_indentation(0.0, WORK, RADIUS, MODULUS))

    def released(a: Array, depth: Array) -> Array:
        return MODULUS * (a * a / RADIUS - depth) ** 2 / (2.0 * math.pi * a)

    def load(a: Array, depth: Array) -> Array:
        pull = np.sqrt(8.0 * math.pi * MODULUS * a**3 * released(a, depth))
        return 4.0 * MODULUS * a**3 / (3.0 * RADIUS) - pull

    ours, theirs, bounds = [], [], []
    for speed in speeds:
        duration = path / speed
        scene = LENS | {
            "clock": {"duration": duration, "step": duration / 4000},
            "contact": {
                "model": "rate_dependent",
                "indentation": {"from": 0.0, "to": -path},
                "front_speed": edge,
                "front_exponent": exponent,
            },
        }
        dataset = sim.run(scene)
        ours.append(float(dataset.lowest_load))
        records = dataset.normal_load.values[:-1]
        low = int(np.nanargmin(records))
        # the lowest record is above the least load by an eighth of their second difference at most
        bend = float(np.diff(records[low - 1 : low + 2], 2)[0]) / abs(ours[-1])
        bounds.append(bend / 8.0 + _EDGE)

        def slope(time: float, a: Array, speed: float = float(speed)) -> Array:
            a = np.maximum(a, 0.01 * start)
            excess = np.maximum(released(a, -speed * time) / WORK - 1.0, 0.0)
            return -edge * excess ** (1.0 / exponent)

        def is_small(time: float, a: Array) -> float:
            return float(a[0] - 0.1 * start)

        is_small.terminal = True  # type: ignore[attr-defined]
        found = integrate.solve_ivp(
            slope,
            (0.0, duration),
            [start],
            "DOP853",
            rtol=1e-11,
            atol=1e-16,
            events=is_small,
            dense_output=True,
        )
        time = np.linspace(0.0, found.t[-1], 400_001)
        theirs.append(float(load(found.sol(time)[0], -speed * time).min()))
    return compared(
        "own integration, as Ciavarella (2020)",
        "pull-off load at four speeds of an edge that lags",
        max(bounds),
        (1e6 * speeds, -1e3 * np.array(ours), -1e3 * np.array(theirs)),
        "speed (µm/s), pull-off load (mN)",
    )


def densities() -> Comparison:
    """Compare power spectral densities with those of GSTools: Gaussian, exponential, Matérn."""
    import gstools

    length, rms, hurst = 3e-6, 1e5, 0.8
    q = np.geomspace(1e-2, 1e2, 200) / length
    options: dict[str, Any] = {"dim": 2, "var": rms**2, "rescale": 1.0}
    pairs = [
        (gstools.Gaussian(len_scale=length, **options), Gaussian(rms, length)),
        (gstools.Exponential(len_scale=length, **options), VonKarman(rms, length, 0.5)),
        (
            gstools.Matern(nu=hurst, len_scale=length * math.sqrt(hurst), **options),
            VonKarman(rms, length, hurst),
        ),
    ]
    worst, solid = 0.0, HalfSpace(1.6e6)
    for theirs, ours in pairs:
        density = (2.0 * math.pi) ** 2 * theirs.spectrum(q)
        is_large = density > 1e-12 * density.max()
        off = ours.radial_density(q)[is_large] / density[is_large] - 1.0
        # the energy of any isotropic field is 3/8 of variance and integral scale
        energy = 0.375 * rms**2 * theirs.integral_scale / solid.shear_modulus
        energy_off = solid.stored_energy(ours) / energy - 1.0
        worst = max(worst, float(np.abs(off).max()), abs(energy_off))
    return Comparison(
        "GSTools",
        "spectral densities (Gaussian, exponential, Matérn), and ΔΓ = 3σ²ℓ/8G",
        worst,
        1e-12,
        False,
        1e-6 * q,
        1e2 * ours.radial_density(q),
        1e2 * density,
        "wavenumber (rad/µm), density (MPa² µm²)",
    )


def fields() -> Comparison:
    """Compare ΔΓ of periodic random fields that GSTools draws with the sum over their modes."""
    import gstools

    members, count, side, length, rms = 256, 64, 60e-6, 3e-6, 1e5
    x = np.arange(count) * side / count
    model = gstools.Gaussian(dim=2, var=rms**2, len_scale=length, rescale=1.0)
    solid, energies = HalfSpace(1.6e6), []
    for seed in range(members):
        field = gstools.SRF(
            model, generator="Fourier", period=side, mode_no=40, seed=seed
        )
        values = np.ascontiguousarray(field.structured([x, x]))
        # the first axis of GSTools is x, which is the second of a map
        stress = StressMap(
            file="",
            pixel=side / count,
            pixel_y=side / count,
            values=values.tobytes(),
            shape=values.shape,
        )
        energies.append(solid.stored_energy(stress))
    q = 2.0 * math.pi / side * np.arange(-19, 20)
    qx, qy = np.meshgrid(q, q)
    radial = np.hypot(qx, qy)
    is_mode = radial > 0.0
    density = Gaussian(rms, length).radial_density(radial[is_mode]) / side**2
    green = solid.compliance(qx[is_mode], qy[is_mode])
    exact = float(np.sum(0.5 * green * density))
    sample = np.array(energies)
    ours = np.cumsum(sample) / np.arange(1, members + 1)
    return Comparison(
        "GSTools",
        "mean ΔΓ of 256 periodic fields, which it draws",
        abs(float(sample.mean()) / exact - 1.0),
        float(sample.std(ddof=1)) / math.sqrt(members) / exact,
        True,
        np.arange(1.0, members + 1.0),
        1e3 * ours,
        np.full(members, 1e3 * exact),
        "fields, mean ΔΓ (mJ/m²)",
    )


def counted_bonds() -> Comparison:
    """Compare the mean number of counted bonds with the direct method of Gillespie by the package stochastic-arrow."""
    from stochastic_arrow import StochasticSystem

    sites, members, speed, critical, rate = 50, 8192, 1e-3, 0.5e-3, 10.0
    scene = LENS | {
        "clock": {"duration": "0.12 s", "step": "20 ms"},
        "contact": {"model": "equilibrium", "load": "4 mN"},
        "drive": {"model": "steady", "speed": speed},
        "bonds": {
            "model": "counted",
            "critical_speed": critical,
            "rebinding_rate": rate,
            "sites": sites,
            "stress": "0.1 MPa",
            "start": "bonded",
        },
        "ensemble": {"members": members},
    }
    dataset = sim.run(scene)
    ours = sites * dataset.bond_fraction.transpose("t", "member").values
    theirs, duration = np.full(ours.shape, float(sites)), float(dataset.t[1])
    system = StochasticSystem(np.array([[-1, 1], [1, -1]]), random_seed=1)
    rates = np.array([rate * speed / critical, rate])
    for member in range(members):
        state = np.array([sites, 0])
        for k in range(1, len(theirs)):
            state = system.evolve(duration, state, rates)["outcome"]
            theirs[k, member] = state[0]
    means, other = ours.mean(axis=1), theirs.mean(axis=1)
    variance = (ours.var(axis=1) + theirs.var(axis=1)) / members
    off = np.abs(means - other)[1:]
    errors = np.sqrt(variance[1:])
    worst = int(np.argmax(off / errors))
    return Comparison(
        "stochastic-arrow (Gillespie)",
        "mean number of 50 counted bonds over time",
        float(off[worst] / other[1 + worst]),
        float(errors[worst] / other[1 + worst]),
        True,
        1e3 * dataset.t.values,
        means,
        other,
        "time (ms), bonds",
    )


def finite_range() -> Comparison:
    """Compare the cohesive contact with Maugis and Dugdale's in the package Adhesion, at a Tabor number of 1."""
    package = importlib.metadata.distribution("Adhesion")
    file = package.locate_file("Adhesion/ReferenceSolutions/MaugisDugdale.py")
    place = importlib.util.spec_from_file_location("maugis_dugdale", str(file))
    if place is None or place.loader is None:
        raise ImportError(f"{file} cannot be imported")
    peer = importlib.util.module_from_spec(place)
    place.loader.exec_module(peer)
    # units of Maugis: radius of the sphere, work of adhesion over pi and modulus K are one
    stress = cohesive.stress_of_range(1.0, 1.0)
    modulus = 1.0
    last = cohesive.pull_off(math.inf, 1.0, stress, 1.0, modulus).inner
    radii = np.geomspace(max(1.01 * float(last), 0.05), 4.0, 60)
    load, depth = peer.load_and_displacement(radii, 1.0, 1.0, modulus, float(stress))
    found = cohesive.equilibrium(0.0, depth, math.inf, 1.0, stress, 1.0, modulus)
    return compared(
        "Adhesion (Maugis & Dugdale)",
        "load over indentation, Tabor number 1",
        1e-8,
        (depth, found.load, load),
        "indentation, load (w = R = E* = 1)",
    )


def layer_under_waves() -> Comparison:
    """Compare the normal displacement of a layer under waves of pressure with that in the package ContactMechanics."""
    with warnings.catch_warnings():
        # the package says that it runs without MPI
        warnings.simplefilter("ignore", ImportWarning)
        from ContactMechanics import PeriodicFFTElasticHalfSpace

    thickness, shear_modulus, side, count = 2e-6, 1.6e6, 40e-6, 256
    # the mean displacement of an incompressible layer, which a scalar of numpy makes infinite, is zero
    with np.errstate(divide="ignore"):
        peer = PeriodicFFTElasticHalfSpace(
            (count, count),
            3.0 * shear_modulus,
            (side, side),
            thickness=thickness,
            poisson=np.float64(0.5),
        )
    # the first axis is the one of which only half of the waves are stored
    theirs = np.real(peer.greens_function)
    half, whole = (np.arange(size) for size in theirs.shape)
    around = np.minimum(whole, count - whole)
    q = 2.0 * math.pi / side * np.hypot(half[:, np.newaxis], around)
    order = np.argsort(q, axis=None)[1:]
    radial, other = q.ravel()[order], theirs.ravel()[order]
    ours = layer.normal(radial * thickness) / (shear_modulus * radial)
    off = float(np.max(np.abs(ours / other - 1.0)))
    # sinh 2x - 2x of the other source loses digits at the smallest x = qh
    digits = 2.0 * np.finfo(float).eps * 6.0 / (2.0 * radial[0] * thickness) ** 2
    return Comparison(
        "ContactMechanics",
        "displacement of an incompressible layer under waves of pressure",
        off,
        float(digits) + 16.0 * np.finfo(float).eps,
        False,
        1e-6 * radial,
        1e12 * ours,
        1e12 * other,
        "wavenumber (rad/µm), compliance (µm/MPa)",
    )


#: All comparisons, in the order of the table. Those with packages of ``make verify`` follow those without.
COMPARISONS: tuple[Callable[[], Comparison], ...] = (
    shared_force,
    one_threshold,
    fast_pull_off,
    densities,
    fields,
    counted_bonds,
    finite_range,
    layer_under_waves,
)


def rows(results: list[Comparison]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| against | quantity | difference | its bound or standard error |"
    yield "| --- | --- | --- | --- |"
    for item in results:
        kind = "standard error" if item.is_noisy else "bound"
        numbers = f"{item.difference:.1e} | {kind} {item.error:.1e}"
        yield f"| {item.against} | {item.quantity} | {numbers} |"


def _panel(panel: Axes, item: Comparison) -> None:
    """Draw both curves of a comparison."""
    scale = style.axis_scale(item.x)
    panel.plot(item.x, item.sim, color=style.LINES[2], linewidth=2.4, alpha=0.45)
    panel.plot(item.x, item.other, color=style.LINES[0], linewidth=0.8, linestyle="--")
    panel.set_xscale(scale)
    if "densities" in item.quantity:
        panel.set_yscale("log")
    across, up = item.label.split(", ", 1)
    panel.set(xlabel=across, ylabel=up)
    panel.set_title(item.against, fontsize=7.5)


def main() -> None:
    """Run all comparisons, draw them and write the table into the page."""
    results = [comparison() for comparison in COMPARISONS]
    with mpl.rc_context(style.STYLE):
        figure, panels = mpl.pyplot.subplots(
            3, 3, figsize=(7.8, 6.6), layout="constrained"
        )
        for panel, item in zip(panels.flat, results, strict=False):
            _panel(panel, item)
        key = panels.flat[-1]
        key.axis("off")
        key.plot([], [], color=style.LINES[2], linewidth=2.4, alpha=0.45, label="sim")
        key.plot(
            [], [], "--", color=style.LINES[0], linewidth=0.8, label="the other source"
        )
        key.legend(loc="center", frameon=False)
        style.save(figure, PICTURE)
    text = PAGE.read_text(encoding="utf-8")
    # a page without a marker is not replaced by its beginning
    (before, rest), table = text.split(START), "\n".join(rows(results))
    _, after = rest.split(END)
    page = f"{before}{START}\n\n{table}\n\n{END}{after}"
    PAGE.write_text(page, encoding="utf-8")
    for item in results:
        print(f"{item.against}: {item.quantity}: {item.difference:.1e}", item.holds)
    sys.exit(not all(item.holds for item in results))


if __name__ == "__main__":
    main()
