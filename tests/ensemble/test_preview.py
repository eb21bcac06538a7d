"""What ``sim check`` tells before a run."""

import math
import re
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from sim.ensemble.plan import Plan
from sim.ensemble.preview import preview
from sim.ensemble.simulate import run
from sim.scenario.declared import quantities
from sim.scenario.reader import load

FOLDER = Path(__file__).parents[2] / "scenarios"
WIDE = {"model": "gaussian", "rms": "10 kPa", "length": "4 mm"}
RIPPLE = {"sweep": {}}
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


MODAL = {
    "model": "modal",
    "cell": "0.24 mm",
    "points": 32,
    "spectrum": {"model": "band", "rms": "150 kPa", "longest": "60 um", "shortest": "16 um"},
    "correlation": {"model": "slip", "length": "5 um"},
}


def told(name, **overrides):
    """The preview of a scenario: lines of each block by its title."""
    scenario = load(FOLDER / f"{name}.toml", overrides)
    title, *blocks = preview(scenario).split("\n\n")
    assert title == scenario.name
    return {block.partition("\n")[0]: [line.strip() for line in block.splitlines()[1:]] for block in blocks}


def row(lines, key):
    """The cells of the row that begins with a key."""
    (line,) = (line for line in lines if line.startswith(f"{key}  "))
    return re.split(r" {2,}", line)


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_a_scenario_is_told_in_si_with_its_unit(name):
    scenario = load(FOLDER / f"{name}.toml", {"sweep": {}})
    lines = told(name, sweep={})["quantities in SI"]
    for key, (quantity, value) in quantities(scenario).items():
        if key.startswith("record."):
            continue
        number, _, unit = row(lines, key)[1].partition(" ")
        assert_allclose(float(number), value, rtol=1e-5, atol=0)
        assert unit == ("" if quantity.unit == "1" else quantity.unit)


@pytest.mark.parametrize("name", NAMES)
def test_the_columns_of_a_block_line_up_and_no_line_trails(name):
    for block in preview(load(FOLDER / f"{name}.toml")).split("\n\n")[1:]:
        lines = block.splitlines()[1:]
        assert all(line == line.rstrip() for line in lines)
        starts = {re.match(r"  (?:\S+ )*\S+ {2,}", line).end() for line in lines if re.search(r"\S {2,}\S", line)}
        assert len(starts) <= 1


def test_each_depth_is_told_with_its_reason():
    lines = told("masking", **{"drive.speed": "2 mm/s"})["models"]
    assert row(lines, "drive")[1:3] == ["steady", "changed by an override"]
    assert row(lines, "bonds")[1:3] == ["none", "left out, so the simplest"]
    assert row(lines, "shear")[1:3] == ["mean", "in the file"]
    assert row(lines, "contact")[3].startswith("The contact is in JKR equilibrium")
    swept = told("masking", sweep={"bonds": [{"model": "none"}, {"model": "steady", "critical_speed": 0.01}]})["models"]
    assert [line.split()[1] for line in swept if line.startswith("bonds")] == ["none", "steady"]
    assert all("swept" in line for line in swept if line.startswith("bonds"))


def test_an_inline_table_counts_as_in_the_file(tmp_path):
    text = "clock = { duration = 1, step = 1 }\nsolid.shear_modulus = 1e6\nsphere = { radius = 1e-3 }\n"
    text += "adhesion = { work = 0.04 }\ncontact = { load = 0.0 }\n'drive' = { model = \"steady\" }\n"
    (tmp_path / "x.toml").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    said = preview(load(tmp_path / "x.toml"))
    assert re.search(r"drive +steady +in the file", said)
    assert re.search(r"bonds +none +left out", said)


def test_a_swept_quantity_is_told_from_where_to_where():
    lines = told("uniform_stress")["quantities in SI"]
    assert row(lines, "contact.load")[1:] == ["-0.0003 to 0.016 N", "normal load, compression positive (5 values)"]
    assert row(lines, "bonds.stress")[1] == "0 to 1e+06 Pa"
    run = told("uniform_stress")["the run"]
    assert row(run, "sweep")[1] == "4 bonds.stress × 5 contact.load = 20 points"


def test_choices_are_told_beside_the_numbers():
    lines = told("fixed_grips", shear=MODAL)["quantities in SI"]
    assert row(lines, "drive.scale")[1] == "log"
    assert row(lines, "shear.spectrum.model")[1] == "band"
    assert row(lines, "shear.mode_amplitudes")[1] == "gaussian"
    assert not any(line.startswith(("record", "name", "shear.model")) for line in lines)
    lines = told("fixed_grips", record={"per_member": False})["quantities in SI"]
    assert row(lines, "record.per_member")[1] == "false"


def test_the_contact_at_rest_is_that_of_the_dataset():
    lines = told("afm_tip")["contact at rest"]
    scenario = load(FOLDER / "afm_tip.toml")
    radii = [point.rest_radius for point in scenario.points() if math.isfinite(point.rest_radius)]
    low, _, high, unit = row(lines, "JKR radius")[1].split()
    assert_allclose([float(low), float(high)], [min(radii), max(radii)], rtol=1e-3)
    assert unit == "m"
    lost = len(scenario.points()) - len(radii)
    assert row(lines, "open")[1] == f"beyond pull-off at {lost} of 61 points"
    assert_allclose(float(row(lines, "pull-off load")[1].split()[0]), -1.5 * math.pi * 0.4 * 100e-9, rtol=1e-3)


def test_an_open_contact_is_told():
    lines = told("uniform_stress", sweep={}, **{"contact.load": "-1 N"})["contact at rest"]
    assert lines[0] == "open           beyond pull-off"


def test_the_errors_of_the_cell_are_those_of_the_dataset():
    short = {"clock.duration": "10 ms", "clock.step": "10 ms", "ensemble.members": 2}
    lines = told("soft_lens", **short)["fluctuations"]
    dataset = run(load(FOLDER / "soft_lens.toml", short))
    found = re.search(r"energy ([+-][0-9.e-]+) %", " ".join(row(lines, "error of the cell")))
    assert_allclose(float(found[1]), 100 * float(dataset["cell_error_energy"].max()), rtol=0.05)
    energies = [float(word) for word in row(lines, "stored energy")[1].split()[::2][:2]]
    assert_allclose(energies[1] / energies[0], (45 / 10) ** 2, rtol=1e-3)
    assert_allclose(float(row(lines, "cell")[1].split()[0]), 4e-3)


def test_the_mean_depth_knows_its_energy():
    lines = told("masking", sweep={})["fluctuations"]
    assert row(lines, "stored energy")[1] == "0.04196 J/m^2 at amplitude 1, on the infinite plane"
    assert row(lines, "rms of the stress")[1] == "2.652e+05 Pa at amplitude 1"


@pytest.mark.parametrize(
    ("name", "overrides", "said"),
    [
        ("soft_lens", {}, "adhesion pays for the stored energy: the paper's assumption"),
        ("afm_tip", {}, "poisson_ratio is not 0.5: the normal-tangential coupling is neglected"),
        ("uniform_stress", {"sphere.radius": "100 um"}, "the contact exceeds 0.3 of the sphere's radius"),
        (
            "soft_lens",
            {"shear.spectrum": WIDE, "shear.points": 32, "sweep": {}},
            "the longest waves exceed the contact",
        ),
        ("soft_lens", {"shear.spectrum": WIDE, "shear.points": 32, "sweep": {}}, "the cell is off by more than 5%"),
        ("uniform_stress", {}, "the mean stress is 0.62 times the shear modulus, beyond linear elasticity"),
        ("masking", RIPPLE | {"shear.spectrum.amplitude": "3.2 MPa"}, "the rms of the fluctuations is 1.41 times the"),
        ("masking", RIPPLE | {"adhesion.work": "1 uJ/m^2"}, "the stored energy is 4.2e+04 times the work of adhesion"),
    ],
)
def test_what_the_theory_or_the_cell_cannot_hold_is_told(name, overrides, said):
    lines = told(name, **overrides)["notes"]
    assert sum(line.startswith(said) for line in lines) == 1


def test_nothing_is_told_where_nothing_is_to_know():
    assert "notes" not in told("uniform_stress", sweep={})
    assert "fluctuations" not in told("uniform_stress")


def test_the_run_is_counted_as_it_will_be():
    lines = told("fixed_grips")["the run"]
    plan = Plan.of(load(FOLDER / "fixed_grips.toml"))
    steps = plan.points[0].clock.steps
    assert row(lines, "time")[1] == f"{steps} steps, {plan.points[0].clock.records} records"
    assert row(lines, "work")[1].startswith(f"{len(plan.points) * plan.members * (steps + 1):,} member-steps, about ")
    alone = told("masking", **{"ensemble.members": 9})["the run"]
    assert row(alone, "members")[1] == "9, all alike, so one is computed"


def sizes(name, **overrides):
    """Bytes of the file, as told: packed and before compression."""
    cell = row(told(name, **overrides)["the run"], "file")[1]
    found = [float(number) * {"kB": 1e3, "MB": 1e6}[unit] for number, unit in re.findall(r"([0-9.]+) (kB|MB)", cell)]
    return found[0], found[-1]


@pytest.mark.parametrize("compression", ["none", "zlib", "digits"])
def test_the_file_is_as_large_as_told_and_before_compression_no_larger(tmp_path, compression):
    for name, overrides in (
        ("fixed_grips", {}),
        ("soft_lens", {"record.per_member": False}),
        ("masking", {}),
        ("fixed_grips", {"record.quantities": ["speed"]}),
    ):
        overrides = overrides | {"record.compression": compression}
        packed, bare = sizes(name, **overrides)
        size = run(load(FOLDER / f"{name}.toml", overrides), tmp_path / "out.nc", replace=True).stat().st_size
        assert 0.5 * packed < size < 2.0 * packed
        assert size < bare + 100e3  # and what HDF5 itself takes
        assert (packed == bare) == (compression == "none")


def test_maps_count_in_the_size_of_the_file():
    def size(**record):
        mapped = {**MODAL, "model": "mapped", "points": 64}
        overrides = {"shear": mapped, "clock": {"duration": "2 s", "step": "1 s"}, "ensemble.members": 9}
        return sizes("uniform_stress", sweep={}, record=record, **overrides)[1]

    maps = 8 * 9 * 2 * 64**2  # 9 members, 2 times, a grid of 64 points a side
    assert_allclose(size(maps=["1 s", "2 s"], map_members=9) - size(), maps, rtol=0.1)


def test_more_members_take_longer_in_proportion(monkeypatch):
    monkeypatch.setattr("sim.ensemble.preview.tried", lambda plan: 1.0)

    def about(members):
        lines = told("decomposition", **{"ensemble.members": members})["the run"]
        number, unit = re.search(r"about ([0-9.]+) (s|min|h) of CPU", row(lines, "work")[1]).groups()
        return float(number) * {"s": 1.0, "min": 60.0, "h": 3600.0}[unit]

    assert about(1) < about(1000) < about(10_000)
    assert_allclose(about(100_000), 10 * about(10_000), rtol=0.2)  # linear but for the start, in whole minutes


def test_a_depth_chosen_by_the_scene_is_named_with_its_reason():
    from helpers.scenes import SHEARS, scene

    with_memory, without = (preview(scene(shear=SHEARS[f"auto {name} correlation"])) for name in ("with", "without"))
    assert "→ banded" in with_memory and "a correlation is given" in with_memory
    assert "→ mean" in without and "no correlation is given" in without


def test_waves_longer_than_the_cell_are_told():
    from helpers.scenes import CELL, SHEARS, SPECTRUM, scene

    from sim.parts.shear import models as shear
    from sim.parts.shear.process import Slip

    for cell, told_of in ((CELL, False), (0.4 * CELL, True)):
        part = shear.Banded(spectrum=SPECTRUM, cell=cell, correlation=Slip(length=1e-6))
        assert ("longer than the cell" in preview(scene(shear=part))) == told_of
    assert "longer than the cell" not in preview(scene(shear=SHEARS["modal ripple"]))


def test_the_mean_field_of_bell_bonds_is_told_by_how_much_it_overpredicts():
    from helpers.scenes import BELL, CUT_OFF, STRETCHED, scene

    from sim.parts.bonds import models as bonds
    from sim.parts.bonds.rupture import Constant

    for rebinding, percent in ((1.0, 27), (10.0, 37), (100.0, 47)):
        recipe = STRETCHED | {"rebinding_rate": rebinding * BELL.zero_force_rate}
        said = preview(scene(bonds=bonds.FirstMoment(rupture=BELL, **recipe)))
        (line,) = (line.strip() for line in said.splitlines() if "overpredicts" in line)
        assert line.startswith("the mean stretch") and f" overpredicts the friction maximum by {percent}%" in line
        assert line.endswith('bonds.model = "cohort" does not')
    for silent in (
        bonds.FirstMoment(rupture=Constant(rate=9.0), **STRETCHED),
        bonds.FirstMoment(rupture=CUT_OFF, **STRETCHED),
        bonds.Cohort(rupture=BELL, **STRETCHED),
        bonds.Rate(critical_speed=1.0, rebinding_rate=1.0),
    ):
        assert "overpredicts" not in preview(scene(bonds=silent))


def test_bonds_left_open_are_told_with_their_depth_and_the_reason():
    from helpers.scenes import BELL, STRETCHED, scene

    from sim.parts.bonds import models as bonds
    from sim.parts.bonds.rupture import Constant

    for auto, depth, reason in (
        (bonds.Auto(critical_speed=1.0, rebinding_rate=1.0), "rate", "no number of sites is given; the rupture"),
        (bonds.Auto(critical_speed=1.0, rebinding_rate=1.0, sites=64), "counted", "1/√N of 64 sites is 0.125, above"),
        (bonds.Auto(rupture=BELL, **STRETCHED, sites=64), "tracked", "1/√N of 64 sites is 0.125, above the"),
        (bonds.Auto(rupture=BELL, **STRETCHED), "cohort", "1/√N of 4,547,221,756 sites is 1.48e-05, within the"),
        (bonds.Auto(rupture=Constant(rate=9.0), **STRETCHED), "rate", "1/√N of 4,547,221,756 sites is 1.48e-05,"),
    ):  # fmt: skip
        lines = preview(scene(bonds=auto)).split("\n\n")[1].splitlines()
        place = next(k for k, line in enumerate(lines) if line.startswith("  bonds "))
        assert re.split(r" {2,}", lines[place])[2:4] == ["auto", "given"]
        mark, chosen, why = re.split(r" {2,}", lines[place + 1].strip())
        assert (mark, chosen) == (f"→ {depth}", "chosen")
        assert why.startswith(reason)


def test_energy_under_bonds_that_friction_has_paid_for_is_told_where_adhesion_pays_again():
    def twice(**overrides):
        lines = told("bond_noise", **overrides).get("notes", [])
        return sum(line.startswith("friction has paid for the energy under each bond") for line in lines)

    assert twice() == twice(sweep={}) == 1
    assert twice(**{"sweep": {}, "shear.paid_by_adhesion": 0.0}) == twice(sweep={}, shear={"model": "uniform"}) == 0
    assert not any("friction has paid" in line for line in told("masking")["notes"])


def test_the_size_of_the_bonds_field_is_that_of_steady_sliding_at_the_last_speed():
    from sim.laws.schallamach import bell_moments

    lines = told("bond_noise")["fluctuations"]
    square = 9e16 * float(bell_moments(0.1, 1e4, 4e-12, 4e-4, 1e5).force_square)
    energy, unit, *when = row(lines, "stored energy")[1].split(" ", 2)
    assert_allclose(float(energy), square / (math.pi**2 * 1.6e6 * 1e-9), rtol=1e-3)
    assert (unit, when) == ("J/m^2", ["in steady sliding at the last speed, on the infinite plane"])
    assert_allclose(float(row(lines, "rms of the stress")[1].split()[0]), math.sqrt(square / math.pi) / 1e-9, rtol=1e-3)
