"""Statements of ``sim check`` before a run."""

import itertools
import math
import re
from pathlib import Path

import pytest
from helpers.cases import some
from helpers.parts import Slip, bonds, load, run, shear
from helpers.scenes import BELL, CELL, CUT_OFF, SHEARS, SPECTRUM, STRETCHED, scene
from numpy.testing import assert_allclose

from sim.ensemble.plan import Plan
from sim.ensemble.preview import preview
from sim.laws import cohesive
from sim.laws.schallamach import bell_moments
from sim.scenario.schema import quantities

FOLDER = Path(__file__).parents[2] / "scenarios"
WIDE = {"model": "gaussian", "rms": "10 kPa", "length": "4 mm"}
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
MODAL = {
    "model": "modal",
    "cell": "0.24 mm",
    "points": 32,
    "spectrum": {
        "model": "band",
        "rms": "150 kPa",
        "longest": "60 um",
        "shortest": "16 um",
    },
    "correlation": {"model": "slip", "length": "5 um"},
}


def blocks(name, **overrides):
    """The preview of a scenario: lines of each block by its title."""
    scenario = load(FOLDER / f"{name}.toml", overrides)
    title, *texts = preview(scenario).split("\n\n")
    assert title == scenario.name
    return {
        block.partition("\n")[0]: [line.strip() for line in block.splitlines()[1:]]
        for block in texts
    }


def row(lines, key):
    """The cells of the row that begins with a key."""
    (line,) = (line for line in lines if line.startswith(f"{key}  "))
    return re.split(r" {2,}", line)


@pytest.mark.parametrize("name", some(NAMES, *NAMES[::4]))
def test_every_number_is_listed_in_si_with_its_unit_in_columns(name):
    scenario = load(FOLDER / f"{name}.toml", {"sweep": {}})
    lines = blocks(name, sweep={})["quantities in SI"]
    for key, (quantity, value) in quantities(scenario).items():
        if not key.startswith("record."):
            number, _, unit = row(lines, key)[1].partition(" ")
            assert_allclose(float(number), value, rtol=1e-5, atol=0)
            assert unit == ("" if quantity.unit == "1" else quantity.unit)
    assert len({re.match(r"(?:\S+ )*\S+ {2,}", line).end() for line in lines}) == 1


def test_swept_numbers_are_listed_with_their_range():
    for name, overrides, key, cells in (
        (
            "uniform_stress",
            {},
            "contact.load",
            ["-0.0003 to 0.016 N", "normal load, compression positive (5 values)"],
        ),
        ("uniform_stress", {}, "bonds.stress", ["0 to 1e+06 Pa"]),
        ("fixed_grips", {"shear": MODAL}, "drive.scale", ["log"]),
        ("fixed_grips", {"shear": MODAL}, "shear.contact", ["plane"]),
        (
            "fixed_grips",
            {"record": {"per_member": False}},
            "record.per_member",
            ["false"],
        ),
    ):
        assert (
            row(blocks(name, **overrides)["quantities in SI"], key)[1:][: len(cells)]
            == cells
        )
    lines = blocks("fixed_grips", shear=MODAL)["quantities in SI"]
    assert not any(line.startswith(("record", "name", "shear.model")) for line in lines)


def test_the_contact_at_rest_its_stiffness_and_errors_of_the_cell_are_those_of_the_dataset():
    lines = blocks("afm_tip")["contact at rest"]
    scenario = load(FOLDER / "afm_tip.toml")
    radii = [
        point.rest_radius
        for point in scenario.points()
        if math.isfinite(point.rest_radius)
    ]
    low, _, high, unit = row(lines, "Maugis-Dugdale radius")[1].split()
    assert_allclose([float(low), float(high)], [min(radii), max(radii)], rtol=1e-3)
    assert unit == "m"
    lost = len(scenario.points()) - len(radii)
    assert row(lines, "open")[1] == f"beyond pull-off at {lost} of 189 points"
    stress = cohesive.stress_of_range(0.4, 0.4e-9)
    assert_allclose(
        float(row(lines, "pull-off load")[1].split()[0]),
        cohesive.pull_off(0.0, 0.4, stress, 1e-7, scenario.solid.contact_modulus).load,
        rtol=1e-3,
    )
    # the surfaces attract each other up to w/sigma; in JKR's theory they do not before they touch
    gaps = row(lines, "jump into contact")[1].split()
    reach = [9.0 * math.sqrt(3.0) / 16.0 * length for length in (1e-12, 0.4e-9)]
    assert_allclose([float(gaps[4]), float(gaps[6])], reach, rtol=1e-3)
    of_lens = blocks("soft_lens")["contact at rest"]
    assert not any(line.startswith("jump into contact") for line in of_lens)
    short = {"clock.duration": "10 ms", "clock.step": "10 ms", "ensemble.members": 2}
    shown, dataset = (
        blocks("soft_lens", **short),
        run(load(FOLDER / "soft_lens.toml", short)),
    )
    points, lines = (
        float(row(shown["errors of the result"], "cell")[1].split()[0]),
        shown["fluctuations"],
    )
    assert_allclose(points, 100 * float(dataset["cell_error_area"].min()), rtol=0.05)
    energies = [float(word) for word in row(lines, "stored energy")[1].split()[::2][:2]]
    assert_allclose(energies[1] / energies[0], (45 / 10) ** 2, rtol=1e-3)
    assert_allclose(float(row(lines, "cell")[1].split()[0]), 4e-3)
    lines = blocks("stick_slip")["slider"]
    radius = next(iter(load(FOLDER / "stick_slip.toml").points())).rest_radius
    firm = float(row(lines, "contact k_t")[1].split()[0])
    assert_allclose(firm, 3.0 * math.pi**2 * 1.6e6 * radius / (4.0 * 1.5), rtol=1e-3)


def sizes(name, **overrides):
    """Bytes of the file, as told: packed and before compression."""
    cell = row(blocks(name, **overrides)["the run"], "file")[1]
    found = [
        float(number) * {"kB": 1e3, "MB": 1e6}[unit]
        for number, unit in re.findall(r"([0-9.]+) (kB|MB)", cell)
    ]
    return found[0], found[-1]


def test_the_run_is_counted_and_its_file_estimated_with_its_maps(tmp_path):
    lines = blocks("fixed_grips")["the run"]
    plan = Plan.of(load(FOLDER / "fixed_grips.toml"))
    clock = plan.points[0].clock
    assert row(lines, "time")[1] == f"{clock.steps} steps, {clock.records} records"
    work = len(plan.points) * plan.members * (clock.steps + 1)
    assert row(lines, "work")[1].startswith(f"{work:,} member-steps, about ")
    assert (
        row(blocks("uniform_stress")["the run"], "sweep")[1]
        == "4 bonds.stress × 5 contact.load = 20 points"
    )
    alone = blocks("masking", **{"ensemble.members": 9})["the run"]
    assert row(alone, "members")[1] == "1"
    scenes = ("fixed_grips", {}), ("soft_lens", {"record.per_member": False})
    scenes += (("fixed_grips", {"record.quantities": ["speed"]}),)
    for compression, (name, changes) in itertools.product(
        ("none", "zlib", "digits"), scenes
    ):
        overrides = changes | {"record.compression": compression}
        packed, bare = sizes(name, **overrides)
        size = (
            run(
                load(FOLDER / f"{name}.toml", overrides),
                tmp_path / "out.nc",
                replace=True,
            )
            .stat()
            .st_size
        )
        assert 0.5 * packed < size < 2.0 * packed
        assert size < bare + 100e3  # and what HDF5 itself takes
        assert (packed == bare) == (compression == "none")

    def size(**record):
        mapped = {**MODAL, "model": "mapped", "points": 64}
        overrides = {
            "shear": mapped,
            "clock": {"duration": "2 s", "step": "1 s"},
            "ensemble.members": 9,
        }
        return sizes("uniform_stress", sweep={}, record=record, **overrides)[1]

    maps = 8 * 9 * 2 * 64**2  # 9 members, 2 times, a grid of 64 points a side
    assert_allclose(size(maps=["1 s", "2 s"], map_members=9) - size(), maps, rtol=0.1)


def test_limits_of_the_theory_and_of_the_cell_are_noted_once():
    for name, overrides, start in (
        (
            "soft_lens",
            {},
            "adhesion pays for the stored energy: the paper's assumption",
        ),
        (
            "uniform_stress",
            {"sphere.radius": "100 um"},
            "the contact radius reaches",
        ),
        (
            "soft_lens",
            {"shear.spectrum": WIDE, "shear.points": 32, "sweep": {}},
            "the mean ΔΓ of the cell makes A/A_JKR up to",
        ),
        (
            "masking",
            {"sweep": {}, "sphere.radius": 2.0, "contact.load": "1 kN"},
            "sphere.radius is 2 m",
        ),
        (
            "uniform_stress",
            {},
            "the mean stress is 0.19 to 0.62 times the shear modulus: finite strains",
        ),
        (
            "masking",
            {"sweep": {}, "shear.spectrum.amplitude": "3.2 MPa"},
            "the rms of the fluctuations is 1.41 times",
        ),
        (
            "pdms_lens_spring",
            {"contact.reversible": 0.5, "drive.viscosity": "1 kPa s/m"},
            "contact.reversible counts the stress of the bonds alone",
        ),
    ):
        assert (
            sum(line.startswith(start) for line in blocks(name, **overrides)["notes"])
            == 1
        ), start
    gentle = {"sweep": {}, "bonds.stress": "0.1 MPa"}  # 0.06 of the modulus
    assert not {"notes", "fluctuations"} & blocks("uniform_stress", **gentle).keys()
    viscous = blocks("pdms_lens_spring", **{"drive.viscosity": "1 kPa s/m"})
    assert not any("contact.reversible" in line for line in viscous["notes"])
    for cell, noted in ((CELL, False), (0.4 * CELL, True)):
        part = shear.Banded(spectrum=SPECTRUM, cell=cell, correlation=Slip(length=1e-6))
        assert ("longer than the cell" in preview(scene(shear=part))) == noted
    assert "longer than the cell" not in preview(scene(shear=SHEARS["modal ripple"]))


def test_depths_are_listed_with_their_reason_also_if_chosen_by_the_scene():
    lines = blocks("masking", **{"drive.speed": "2 mm/s"})["models"]
    assert row(lines, "drive")[1:3] == ["steady", "changed by an override"]
    assert row(lines, "bonds")[1:3] == ["none", "omitted: the simplest"]
    assert row(lines, "shear")[1:3] == ["mean", "in the file"]
    assert row(lines, "contact")[3].startswith("The contact is in JKR equilibrium")
    tables = [{"model": "none"}, {"model": "steady", "critical_speed": 0.01}]
    swept = blocks("masking", sweep={"bonds": tables})["models"]
    assert [line.split()[1] for line in swept if line.startswith("bonds")] == [
        "none",
        "steady",
    ]
    assert all("swept" in line for line in swept if line.startswith("bonds"))
    for part, model, reason in (
        (
            {"shear": SHEARS["auto with correlation"]},
            "banded",
            "a correlation is given",
        ),
        (
            {"shear": SHEARS["auto without correlation"]},
            "mean",
            "no correlation is given",
        ),
        (
            {"bonds": bonds.Auto(rupture=BELL, **STRETCHED)},
            "cohort",
            "1/√N of 4,547,221,756 sites is 1.48e-05",
        ),
    ):
        (line,) = (line for line in preview(scene(**part)).splitlines() if "→" in line)
        mark, chosen, why = re.split(r" {2,}", line.strip())
        assert (mark, chosen) == (f"→ {model}", "chosen") and reason in why


def test_what_bonds_do_to_the_paper_is_listed_with_the_size_of_their_field():
    for rebinding, percent in ((1.0, 27), (100.0, 47)):
        recipe = STRETCHED | {"rebinding_rate": rebinding * BELL.zero_force_rate}
        text = preview(scene(bonds=bonds.FirstMoment(rupture=BELL, **recipe)))
        (line,) = (line.strip() for line in text.splitlines() if "overpredicts" in line)
        assert (
            line.startswith("the mean stretch")
            and f" overpredicts the friction maximum by {percent}%" in line
        )
    for silent in (
        bonds.FirstMoment(rupture=CUT_OFF, **STRETCHED),
        bonds.Cohort(rupture=BELL, **STRETCHED),
    ):
        assert "overpredicts" not in preview(scene(bonds=silent))

    def twice(**overrides):
        lines = blocks("bond_noise", **overrides).get("notes", [])
        return sum(
            line.startswith("friction already supplies the energy under each bond")
            for line in lines
        )

    assert twice() == twice(sweep={}) == 1
    assert (
        twice(**{"sweep": {}, "shear.paid_by_adhesion": 0.0})
        == twice(sweep={}, shear={"model": "uniform"})
        == 0
    )
    assert not any(
        "friction already supplies" in line for line in blocks("masking")["notes"]
    )
    lines = blocks("bond_noise")["fluctuations"]
    square = 9e16 * float(bell_moments(0.1, 1e4, 4e-12, 4e-4, 1e5).force_square)
    energy, unit, *when = row(lines, "stored energy")[1].split(" ", 2)
    assert_allclose(float(energy), square / (math.pi**2 * 1.6e6 * 1e-9), rtol=1e-3)
    assert (unit, when) == (
        "J/m^2",
        ["in steady sliding at the last speed, on the infinite plane"],
    )
    assert_allclose(
        float(row(lines, "rms of the stress")[1].split()[0]),
        math.sqrt(square / math.pi) / 1e-9,
        rtol=1e-3,
    )


def test_a_very_large_run_is_counted_without_a_name_for_each_of_its_parts(monkeypatch):
    monkeypatch.delattr("sim.ensemble.plan.part_name")
    run = blocks(
        "pdms_lens", **{"clock.duration": "100 s", "ensemble.members": 10_000_000}
    )["the run"]
    assert row(run, "work")[1].startswith("1,000,010,000,000 member-steps")
