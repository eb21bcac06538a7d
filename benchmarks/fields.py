"""Rows of the fluctuating shear stress: banded, modal, mapped, and the energy of a given field."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import fft

import sim
from benchmarks import plain
from benchmarks.scenes import RAMP, RATE, field, followed, lens
from benchmarks.timing import Bench, Beside, Row
from sim.spectrum.families import SelfAffine
from sim.step.state import MemberNoise

CELL, SHEAR_MODULUS, EXPONENT = 0.24e-3, 1.6e6, 0.1
TEXTBOOK, HALF = "numpy, noise by rfft2", "numpy, only pairs with power drawn"


def known(points: int) -> tuple[int, float, Callable]:
    """Return the arguments of the programs of numpy: the grid, its cell, and the spectrum's density."""
    spectrum = SelfAffine(
        rms=100e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=512e-6 / points
    )
    return points, CELL, spectrum.radial_density


def by_numpy(points: int, goal: float, errors: str = "") -> tuple[Beside, Beside]:
    """A step of all modes of a grid by numpy, for one member: as the textbooks have it, and as lean as can be."""
    textbook, half = (
        of(*known(points), SHEAR_MODULUS, 1)
        for of in (plain.TextbookModes, plain.HalfSpectrumModes)
    )
    return (
        Beside(TEXTBOOK, lambda: textbook.step(EXPONENT), goal=goal, errors=errors),
        Beside(HALF, lambda: half.step(EXPONENT), errors=errors),
    )


def banded(bench: Bench) -> list[Row]:
    """ΔΓ(t) of a 512² cell from bands, through whole runs into a file, per member-step."""
    points, rows = bench.of(512, 64), []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.nc"
        parts = {
            "drive": RAMP,
            "bonds": RATE,
            "shear": field("banded", points, tolerance=0.01),
        }
        for name, members, steps, every, more, goal in (
            ("1024 members × 10⁴ steps, 1001 records", 1024, 10_000, 10, {}, 8000),
            (
                "1024 members × 2000 steps, all recorded, uncompressed",
                1024,
                2000,
                1,
                {"compression": "none"},
                2500,
            ),
            ("one member × 10⁵ steps, 1001 records", 1, 100_000, 100, {}, 230),
        ):
            members, steps = bench.of((members, steps), (2, 2 * every))
            scene = sim.load(lens(members, steps, every, record=more, **parts))
            third = abs(scene.process.known_errors()["banded_error_third_cumulant"])
            rows += bench.compare(
                f"banded at 1 %, 512²: run to netCDF, {name}",
                lambda scene=scene: sim.run(scene, to=file, replace=True),
                *by_numpy(points, goal, f"third cumulant of ΔΓ {third:.1%}; none")[
                    : 2 if every == 10 else 1
                ],
                share=members * steps,
                turns=7,
            )
    members, steps = bench.of((1024, 200), (2, 4))
    scene = lens(members, steps, **parts)
    weights, shapes, *_ = sim.load(scene).process.gammas
    theirs, random = (
        plain.BandsNumpy(members, weights, shapes, 1),
        np.random.default_rng(1),
    )
    return rows + bench.compare(
        "banded at 1 %, 512²: a member-step in memory, ours with bonds and contact, 1024 members × 200 steps",
        followed(scene),
        Beside(
            "numpy with the same bands, ΔΓ alone",
            lambda: theirs.step(EXPONENT),
            members,
            bound=True,
        ),
        Beside(
            "compiled (numba) with the same bands, ΔΓ alone",
            lambda: plain.bands_compiled(
                members, steps, weights, shapes, EXPONENT, random
            ),
            members * steps,
            bound=True,
        ),
        share=members * steps,
    )


def modal(bench: Bench) -> list[Row]:
    """A step of all modes of a grid, and ΔΓ and the radius of it."""
    rows, steps = [], bench.of(50, 2)
    for points in (256, 512):
        size = bench.of(points, 32)
        program = followed(
            lens(1, steps, drive=RAMP, bonds=RATE, shear=field("modal", size))
        )
        rows += bench.compare(
            f"modal, {points}²: a step of a run",
            program,
            *by_numpy(size, 6),
            share=steps,
        )
    return rows


def mapped(bench: Bench) -> list[Row]:
    """A step of a stress field and its map."""
    rows = []
    for points, goal in ((512, 2.0), (1024, 1.5)):
        size = bench.of(points, 32)
        scene = sim.load(
            lens(1, 1000, drive=RAMP, bonds=RATE, shear=field("mapped", size))
        )
        noise = MemberNoise.of(1, np.arange(1))
        states = [scene.stepper.start(noise)]

        def step(scene=scene, noise=noise, states=states) -> None:
            is_done = states[0].step == 1000
            before = scene.stepper.start(noise) if is_done else states[0]
            steps = range(before.step + 1, before.step + 2)
            states[0], _ = scene.stepper.advance(before, noise, steps)
            scene.process.maps(states[0].shear, states[0].drive.position, 1)

        textbook = plain.TextbookModes(*known(size), SHEAR_MODULUS, 1)
        half, compiled = (
            plain.HalfSpectrumMap(*known(size), 1),
            plain.CompiledMap(*known(size), SHEAR_MODULUS, 1),
        )
        still = half.modes.copy()
        rows += bench.compare(
            f"mapped, {points}²: a step and its map",
            step,
            Beside(
                f"{TEXTBOOK}, scipy's irfft2",
                lambda of=textbook: of.map(EXPONENT),
                goal=goal,
            ),
            Beside(
                "numpy, half spectrum drawn, scipy's irfft2",
                lambda of=half: of.map(EXPONENT),
            ),
            Beside(
                "compiled (numba), scipy's irfft2",
                lambda of=compiled: of.map(EXPONENT, CELL / 7),
                goal=1,
                bound=True,
            ),
            Beside(
                "scipy's irfft2 alone",
                lambda still=still: fft.irfft2(still),
                bound=True,
            ),
        )
    return rows
