"""Speed against plain numpy, as ratios of two programs that take turns in one run: ``make bench``.

Names of groups as arguments run these alone: ``python benchmarks/run.py modal contact``.

Every ratio is the median over the turns of (time of the other) / (time of ours), with the span of
the middle half of the turns; absolute times are only as seen. Machines are noisy, so compare ratios.
"""

import functools
import itertools
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import bonds_plain
import contact_plain
import numpy as np
import plain
from rich.console import Console
from rich.table import Table
from scipy import fft

from sim.engine import Dice, advance, march, start
from sim.laws.schallamach import transition_probabilities
from sim.numerics.noise import Noise
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell
from sim.parts.contact import Equilibrium
from sim.parts.contact.bodies import Adhesion, Solid, Sphere
from sim.parts.drive import prescribed as drive
from sim.parts.exchange import Bonding, Motion, Motions
from sim.parts.shear import models as shear
from sim.parts.shear.correlation import Slip
from sim.scenario.clock import Clock, Ensemble
from sim.scenario.scenario import Scenario
from sim.spectrum.families import Gaussian, SelfAffine, VonKarman

TURNS = 31
SPECTRUM = VonKarman(rms=150e3, length=5e-6, hurst=0.8)


@dataclass(frozen=True)
class Row:
    """One comparison: what takes how long beside what, and what was promised."""

    ours: str
    other: str
    promise: str
    seconds: float
    ratios: np.ndarray

    @property
    def texts(self) -> tuple[str, ...]:
        low, middle, high = (f"{q:.4g}" if q > 10 else f"{q:.2f}" for q in np.quantile(self.ratios, [0.25, 0.5, 0.75]))
        return self.ours, self.other, middle, f"{low} to {high}", self.promise, f"{self.seconds:.2e} s"


def compare(
    ours: str, mine: Callable, other: str, theirs: Callable, promise: str,
    repeats: int = 1, others: int = 0, members: int = 1, other_members: int = 1,
) -> Row:  # fmt: skip
    """Time two programs in turns, per member, after one turn each that is not counted."""
    times = np.array([[_timed(mine, repeats), _timed(theirs, others or repeats)] for _ in range(TURNS + 1)])[1:]
    times /= [members, other_members]
    return Row(ours, other, promise, float(np.median(times[:, 0])), times[:, 1] / times[:, 0])


def _timed(program: Callable, repeats: int) -> float:
    began = time.perf_counter()
    for _ in range(repeats):
        program()
    return (time.perf_counter() - began) / repeats


def scene(members: int, **parts) -> Scenario:
    """The PDMS lens of the scenarios, in as many members."""
    return Scenario(
        clock=Clock(duration=0.2, step=1e-3),
        solid=Solid(shear_modulus=1.6e6),
        sphere=Sphere(radius=2e-3),
        adhesion=Adhesion(work=42e-3),
        contact=Equilibrium(load=4e-3),
        drive=drive.Ramp(start=1e-5, stop=1e-1, scale="log"),
        ensemble=Ensemble(members=members),
        **parts,
    )


def mean_field() -> list[Row]:
    """A batch costs the Python of the loop once; what all members share is computed once."""
    shared = {
        "bonds": bonds.Rate(critical_speed=1e-2, rebinding_rate=500.0, stress=3e5),
        "shear": shear.Mean(spectrum=Gaussian(rms=1e5, length=5e-6)),
    }
    counted = {"bonds": bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=100, stress=3e5)}
    modal = {
        "shear": shear.Modal(
            spectrum=SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=16e-6),
            cell=0.24e-3,
            correlation=Slip(length=5e-6),
        )
    }

    def run(members: int, parts: dict) -> Callable:
        scenario = scene(members, **parts)
        return lambda: sum(1 for _ in march(scenario, np.arange(members)))

    rows = []
    for name, parts, promise in (
        ("mean-field", shared, "1/3 or more"),
        ("counted bonds", counted, ""),
        ("modal, 370 pairs", modal, ""),
    ):
        rows.append(compare(f"64 members, {name}", run(64, parts), "1 member", run(1, parts), promise))
    return rows


def block(motion: Motion) -> Motions:
    """One step as a block of steps."""
    return Motions(motion.step, *(np.reshape(value, (1, -1)) for value in (*motion[1:], motion.slip)))


def modal() -> list[Row]:
    """One Ornstein-Uhlenbeck step of all modes of a grid and its energy."""
    rows, cell, exponent = [], 0.24e-3, 0.1
    for points in (256, 512):
        recipe = shear.Modal(spectrum=SPECTRUM, cell=cell, points=points, correlation=SLIP)
        ours, pairs = lens(exponent, points, 1, recipe), recipe.process(1.6e6, 0.5, cell).pairs
        generator, numbers = np.random.default_rng(1), np.empty(2 * pairs)
        textbook = plain.TextbookModes(points, cell, SPECTRUM.radial_density, 1.6e6, 1)
        half = plain.HalfSpectrumModes(points, cell, SPECTRUM.radial_density, 1.6e6, 1)
        for name, program, promise in (
            ("numpy, noise by rfft2", lambda plan=textbook: plan.step(exponent), "6 or more"),
            ("numpy, half spectrum drawn", lambda plan=half: plan.step(exponent), ""),
            ("numpy's normals alone", lambda out=numbers, draw=generator: draw.standard_normal(out=out), ""),
        ):
            rows.append(compare(f"modal step, {points}² ({pairs} pairs)", ours, name, program, promise, 40))
    return rows


def step() -> list[Row]:
    """What a step of the whole engine costs beside its modes."""
    recipe = shear.Modal(spectrum=SPECTRUM, cell=0.24e-3, points=256, correlation=Slip(length=5e-6))
    scenario = scene(1, shear=recipe, bonds=bonds.Rate(critical_speed=1e-2, rebinding_rate=500.0))
    dice = Dice.of(1, np.arange(1))
    state = {"now": start(scenario, dice)}

    def whole() -> None:
        before = state["now"] if state["now"].step < 200 else start(scenario, dice)
        state["now"], _ = advance(scenario, before, dice, range(before.step + 1, before.step + 2))

    fluctuation, noise, counter = state["now"].shear, Noise(1, "shear", np.arange(1)), itertools.count(1)

    def alone() -> None:
        moved = drive.Steady(speed=5e-7).motion(next(counter), 0.0, 1.0, 1.0)
        scenario.process.advance(fluctuation, block(moved), Bonding(np.ones(1), np.zeros(1), np.zeros(1)), noise)

    return [compare("engine step, modal 256²", whole, "its modes alone", alone, "", 4)]


SLIP = Slip(length=5e-6)
LENS = SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=1e-6)


def lens(exponent: float, points: int, members: int, recipe: shear.Modal | shear.Banded) -> Callable:
    """A program that advances ΔΓ of a lens's cell by one step, for a batch of members."""
    process, noise = recipe.process(1.6e6, 0.5, 0.24e-3), Noise(1, "shear", np.arange(members))
    rest, stress, counter = (
        drive.Steady(speed=0.0).motion(0, 0.0, 0.0, 1.0),
        Bonding(np.ones(1), np.zeros(1), np.zeros(1)),
        itertools.count(1),
    )
    state = [process.start(rest, stress, noise)]

    def program() -> None:
        moved = drive.Steady(speed=exponent * 5e-6).motion(next(counter), 0.0, 1.0, 1.0)
        state[0], _ = process.advance(state[0], block(moved), stress, noise)

    return program


def depths() -> list[Row]:
    """The same ensemble of ΔΓ on a 512² cell, self-affine with a roll-off and slip correlation, per member-step."""
    exponent, points = 0.1, 512
    recipe = {"spectrum": LENS, "cell": 0.24e-3, "correlation": Slip(length=5e-6), "points": points}
    half = plain.HalfSpectrumModes(points, 0.24e-3, LENS.radial_density, 1.6e6, 1)
    real = plain.RealSpaceMap(points, 0.24e-3, LENS.radial_density, 1.6e6, 1)
    rows = []
    for name, members, depth, promise in (
        ("banded, 1 %", 64, shear.Banded(**recipe, tolerance=0.01), "1000 or more"),
        ("banded, 10 %", 64, shear.Banded(**recipe, tolerance=0.1), ""),
        ("banded, 1 %, one member", 1, shear.Banded(**recipe, tolerance=0.01), ""),
        ("modal", 1, shear.Modal(**recipe), ""),
        ("mapped", 1, shear.Mapped(**recipe), ""),
    ):
        ours = lens(exponent, points, members, depth)
        repeats = 50 if isinstance(depth, shear.Banded) else 1
        for other, program, goal in (
            ("numpy, half spectrum drawn", lambda: half.step(exponent), promise),
            ("numpy, through real space", lambda: real.step(exponent), ""),
        ):
            rows.append(compare(f"{name}, 512²", ours, other, program, goal, repeats, 1, members))
    modal_program = lens(exponent, points, 1, shear.Modal(**recipe))
    banded = lens(exponent, points, 64, shear.Banded(**recipe, tolerance=0.01))
    rows.append(compare("banded, 1 %, 512²", banded, "modal", modal_program, "100 or more", 50, 1, 64))
    shapes = np.tile(0.5 * (shear.Banded(**recipe).process(1.6e6, 0.5, 0.24e-3).bands.freedom - 1.0), (64, 1))
    generator = np.random.Generator(np.random.Philox(1))

    def numbers() -> None:
        generator.standard_normal(shapes.shape)
        generator.standard_gamma(shapes)

    rows.append(compare("banded, 1 %, 512²", banded, "numpy's normals and gammas alone", numbers, "", 50, 50, 64, 64))
    return rows


def maps() -> list[Row]:
    """A stress map on 256² points: a step and its map, beside its numbers and transform, and a public package."""
    points, cell, spectrum = 256, 0.24e-3, Gaussian(rms=1e5, length=12e-6)
    recipe = shear.Mapped(
        spectrum=VonKarman(rms=1e5, length=12e-6, hurst=0.8), cell=cell, points=points, correlation=SLIP
    )
    process, noise = recipe.process(1.6e6, 0.5, cell), Noise(1, "shear", np.arange(1))
    rest, stress = drive.Steady(speed=0.0).motion(0, 0.0, 0.0, 1.0), Bonding(np.ones(1), np.zeros(1), np.zeros(1))
    state, counter = [process.start(rest, stress, noise)], itertools.count(1)
    generator, numbers = np.random.Generator(np.random.Philox(1)), np.empty(2 * process.pairs)
    half = np.ones((points, points // 2 + 1), dtype=complex)

    def drawn() -> None:
        moved = drive.Steady(speed=5e-7).motion(next(counter), 0.0, 1.0, 1.0)
        state[0], _ = process.advance(state[0], block(moved), stress, noise)
        process.maps(state[0], np.zeros(1), 1)

    def parts() -> None:
        generator.standard_normal(out=numbers)
        fft.irfft2(half, s=(points, points))

    rows = [compare("mapped, 256², step and map", drawn, "numpy's normals and one FFT", parts, "2/3 or more", 4)]
    try:
        import gstools
    except ImportError:
        print("GSTools is not installed (the extra bench): its row is left out")
        return rows
    model = gstools.Gaussian(dim=2, var=1e10, len_scale=spectrum.length, rescale=1.0)
    field = gstools.SRF(model, seed=1)
    axis = np.arange(points) * cell / points
    theirs = lambda: field.structured((axis, axis), seed=next(counter))  # noqa: E731
    return [*rows, compare("mapped, 256², step and map", drawn, "GSTools field, same size", theirs, "", 4, 1)]


def sizes() -> list[Row]:
    """Banded costs the same per member-step for any number of modes; here beside the 64² cell."""
    exponent, rows = 0.1, []

    def program(points: int) -> Callable:
        spectrum = SelfAffine(
            rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=0.24e-3 / (points // 2 - 1) * 1.001
        )
        recipe = shear.Banded(spectrum=spectrum, cell=0.24e-3, correlation=Slip(length=5e-6), points=points)
        return lens(exponent, points, 64, recipe)

    smallest = program(64)
    for points in (64, 256, 1024, 4096):
        rows.append(compare(f"banded, {points}²", program(points), "banded, 64²", smallest, "", 50, 50, 64, 64))
    return rows


#: Bonds with a rate at rest, a Bell force and a stiffness of 1; at a speed of 10 friction is near its maximum.
BELL = {"rupture": Bell(zero_force_rate=1.0, bell_force=1.0), "bond_stiffness": 1.0, "rebinding_rate": 1.0}
BELL_SPEED, BELL_STEP = 10.0, 0.01


def population(part, members: int, motion) -> Callable:
    """A program that advances a population of bonds by one step and tells its moments, for a batch of members."""
    noise, state = Noise(1, "bonds", np.arange(members)), []
    state.append(part.start(motion, noise))
    motions = itertools.cycle([block(motion._replace(step=step)) for step in range(1, 4097)])

    def program() -> None:
        state[0], _ = part.advance(state[0], next(motions), np.ones(1), noise)

    return program


def stretched(part, members: int = 1, step: float = BELL_STEP) -> Callable:
    """The same for bonds of ``BELL`` in steady sliding, their moments told."""
    return population(part, members, drive.Steady(speed=BELL_SPEED).motion(1, 0.0, step, 1.0))


def stepped(shape: tuple[int, ...], step: float = BELL_STEP, count: int = 1) -> Callable:
    """The same population in some fixed steps, by numpy, once it is stationary."""
    theirs = bonds_plain.TrackedNumpy(shape, 1.0, 1.0, 1.0, np.random.default_rng(1))

    def program(count: int = count) -> None:
        for _ in range(count):
            theirs.step(BELL_SPEED * step, step)

    program(round(1.0 / step))
    return program


def tracked() -> list[Row]:
    """Bonds one by one, k0 dt = 0.01, Bell's rupture at eps = 10 and beta = 1, beside numpy's stepper of as many."""
    rows = []
    for sites, members, repeats, promise in (
        (100, 64, 40, ""),
        (1000, 1, 200, "20 or more"),
        (1000, 64, 20, "20 or more"),
        (10_000, 1, 100, "20 or more"),
        (100_000, 1, 20, ""),
        (1_000_000, 1, 3, "20 or more"),
    ):
        part = bonds.Tracked(sites=sites, site_density=1.0, **BELL)
        name = f"tracked, {sites:,} bonds" + (f", {members} members" if members > 1 else "")
        other, others = stepped((members, sites)), max(1, 10**5 // (members * sites))
        rows.append(
            compare(
                name,
                stretched(part, members),
                "numpy in fixed steps",
                other,
                promise,
                repeats,
                others,
                members,
                members,
            )
        )
    return rows


def tracked_as_exactly() -> list[Row]:
    """The same over a tenth of a bond's life at rest: one step, exact, beside as many of numpy's as 0.5 % need.

    In steps of k0 dt = 0.01 numpy's friction is 4 to 5 % high, of first order in the step.
    """
    rows = []
    for sites, members in ((1000, 1), (1000, 64), (10_000, 1), (100_000, 1), (1_000_000, 1)):
        part = bonds.Tracked(sites=sites, site_density=1.0, **BELL)
        name = f"tracked, {sites:,} bonds" + (f", {members} members" if members > 1 else "") + ", one step of 0.1"
        other, repeats = stepped((members, sites), 1e-3, 100), max(1, 10**6 // (members * sites) // 5)
        rows.append(
            compare(
                name, stretched(part, members, 0.1), "numpy, 100 steps of 0.001: 0.5 % high", other, "20 or more",
                repeats, 1, members, members,
            )
        )  # fmt: skip
    return rows


def counted() -> list[Row]:
    """Two-state bonds at V = Vc in steps of h dt = 1/2, beside numpy's Gillespie of all members and binomials."""
    rows, random = [], np.random.default_rng(1)
    motion = drive.Steady(speed=1e-2).motion(1, 0.0, 1e-3, 1.0)
    stay, bind = transition_probabilities(1e-2 * 1e-3, 1e-3, 1e-2, 500.0)
    for sites, members, others, promise in (
        (100, 64, 64, ""),
        (10_000, 100, 100, "500 or more"),
        (10_000, 1000, 1000, "500 or more"),
        (100_000, 1000, 200, "500 or more"),
    ):
        part = bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=sites)
        name, ours, first = (
            f"counted, {sites:,} bonds, {members} members",
            population(part, members, motion),
            sites // 2,
        )
        events = functools.partial(
            bonds_plain.counted_gillespie_numpy, np.full(others, first), sites, 1.0, 500.0, 1e-3, random
        )
        rows.append(compare(name, ours, "numpy, Gillespie", events, promise, 20, 1, members, others))
        state = [np.full(members, first)]

        def binomials(state: list = state, sites: int = sites) -> None:
            state[0] = random.binomial(state[0], stay) + random.binomial(sites - state[0], bind)

        rows.append(
            compare(name, ours, "numpy, Generator.binomial", binomials, "1/1.1 or more", 20, 20, members, members)
        )
    return rows


def cohorts() -> list[Row]:
    """The density of stretches: by tolerance, one population or one for each member, beside bonds of that noise."""
    rows, usual = [], stretched(bonds.Cohort(site_density=1.0, tolerance=1e-3, **BELL))
    for tolerance, sites in ((1e-2, 10_000), (1e-3, 1_000_000)):
        part = bonds.Cohort(site_density=1.0, tolerance=tolerance, **BELL)
        other, name = stepped((sites,)), f"numpy, {sites:,} bonds"
        promise = "a few µs" if tolerance == 1e-3 else ""
        rows.append(
            compare(f"cohort at {tolerance:g}", stretched(part), name, other, promise, 200, max(1, 10**5 // sites))
        )
    for tolerance in (1e-2, 1e-4, 1e-5, 1e-6):
        part = bonds.Cohort(site_density=1.0, tolerance=tolerance, **BELL)
        rows.append(compare(f"cohort at {tolerance:g}", stretched(part), "cohort at 0.001", usual, "", 200))
    for tolerance in (1e-2, 1e-3, 1e-4):
        part = bonds.Cohort(site_density=1.0, tolerance=tolerance, area="carried", **BELL)
        name = f"cohort at {tolerance:g}, 64 populations"
        rows.append(compare(name, stretched(part, 64), "cohort at 0.001", usual, "a few µs", 10, 200, 64))
    return rows


def contact() -> list[Row]:
    """Radii at a load and behind a machine, each with its largest relative error."""
    return contact_plain.rows(compare)


def main() -> None:
    """Print all rows."""
    table = Table("ours", "beside", "ratio", "middle half", "promised", "ours, as seen", box=None)
    known = (mean_field, modal, step, depths, maps, sizes, tracked, tracked_as_exactly, counted, cohorts, contact)
    for rows in [rows for rows in known if not sys.argv[1:] or rows.__name__ in sys.argv[1:]]:
        for row in rows():
            table.add_row(*row.texts)
    Console(width=140).print(table)
    print("ratio: time of the other / time of ours, median of", TURNS, "turns")


if __name__ == "__main__":
    main()
