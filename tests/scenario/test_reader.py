"""From a file to a scenario: overrides, sweeps, files beside it, the schema."""

import copy
import dataclasses
import itertools
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import LENS
from jsonschema import Draft202012Validator

from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.shear import models as shear
from sim.scenario.reader import BadInput, load
from sim.scenario.scenario import Scenario
from sim.scenario.schema import json_schema, quantities

FOLDER = Path(__file__).parents[2] / "scenarios"
STARTER = Path(__file__).parents[2] / "sim" / "starter.toml"
PATHS = [*sorted(FOLDER.glob("*.toml")), STARTER]


@pytest.fixture
def scene(tmp_path):
    """Write a scene and load it."""

    def write(text="", overrides=None, base=LENS):
        path = tmp_path / "x.toml"
        path.write_text(base + text, encoding="utf-8")
        return load(path, overrides)

    return write


def test_every_scenario_is_read_and_keeps_its_text_and_fits_the_schema():
    schema = Draft202012Validator(json.loads(json.dumps(json_schema(Scenario))))
    schema.check_schema(schema.schema)
    for path in PATHS:
        text = path.read_text(encoding="utf-8")
        assert load(path).source.text == text
        document = tomllib.loads(text)
        assert schema.is_valid(document)
        assert not schema.is_valid(
            {**document, "solid": {**document["solid"], "shear_modulos": 1}}
        )
        assert not schema.is_valid({**document, "drive": {"model": "stedy"}})
        assert not schema.is_valid(
            {key: value for key, value in document.items() if key != "clock"}
        )


def test_a_table_or_a_model_left_out_is_the_simplest_and_a_table_names_a_file_or_holds_columns(
    scene,
):
    assert (scene().drive, scene().bonds, scene().shear) == (
        drive.Steady(),
        bonds.Unbroken(),
        shear.Uniform(),
    )
    scenario = scene(
        '[drive]\nspeed = "1 mm/s"\n[bonds]\nstress = "1 kPa"\n'
        '[shear]\nmodel = "mean"\nspectrum = { model = "gaussian", rms = "1 kPa", length = "1 um" }\namplitude = {}\n'
    )
    assert scenario.drive == drive.Steady(speed=1e-3)
    assert scenario.bonds == bonds.Unbroken(stress=1e3)
    assert scenario.shear.amplitude.model == "constant"
    schema = Draft202012Validator(json_schema(Scenario))
    assert schema.is_valid(tomllib.loads(LENS + "[drive]\nspeed = 1\n[bonds]\n"))
    assert not schema.is_valid(tomllib.loads(LENS + "[bonds]\ncritical_speed = 1\n"))
    for table, fitting in (
        ({"file": "speeds.csv"}, True),
        ({"time": [0, 1], "speed": [0, 1]}, True),
        ({}, False),
    ):
        assert (
            schema.is_valid(
                tomllib.loads(LENS) | {"drive": {"model": "table", **table}}
            )
            == fitting
        )


def test_a_dictionary_is_read_as_a_file_is(scene):
    document = tomllib.loads(LENS)
    before = copy.deepcopy(document)
    assert quantities(load(document)) == quantities(scene())
    assert load(document, {"contact.load": "2 mN"}).contact.load == 2e-3
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene().seed = 3
    assert document == before
    with pytest.raises(BadInput) as refused:
        load({**document, "ensemble": {"members": 0, "member": 1}})
    assert isinstance(refused.value, ValueError) and len(refused.value.problems) == 2
    assert str(refused.value).splitlines() == refused.value.problems


def test_a_byte_order_mark_and_windows_line_ends_are_the_same_scene(scene, tmp_path):
    # the last is made by a program that writes the second as text
    for end in ("\n", "\r\n", "\r\r\n"):
        (tmp_path / "y.toml").write_bytes(
            b"\xef\xbb\xbf" + LENS.replace("\n", end).encode()
        )
        read = load(tmp_path / "y.toml")
        assert quantities(read) == quantities(scene())
        assert read.source.text.replace("\n\n", "\n") == LENS.replace("\n\n", "\n")


def test_overrides_replace_values_tables_and_what_was_left_out(scene):
    table = {"model": "steady", "critical_speed": "1 mm/s"}
    values = {
        "contact.load": "2 mN",
        "bonds": table,
        "drive.model": "steady",
        "drive.speed": "3 mm/s",
    }
    changed = scene(overrides=values | {"ensemble.members": 5})
    assert (
        changed.contact.load,
        changed.bonds.critical_speed,
        changed.drive.speed,
    ) == (2e-3, 1e-3, 3e-3)
    assert changed.ensemble.members == 5
    assert changed.source.overrides["contact.load"] == "2 mN"


BANDED = """
[shear]
model = "banded"
points = 64
spectrum = { model = "gaussian", rms = "1 kPa", length = "10 um" }
correlation = { model = "slip", length = "50 um" }
"""


LOADS = '"contact.load" = ["1 mN", "2 mN"]'
LEFT_OUT = {"shear.points", "shear.correlation"}


@pytest.mark.parametrize(
    ("sweep", "overrides", "points", "named"),
    [
        (LOADS, {"contact.load": "3 mN"}, [3e-3], {"contact.load"}),
        (
            "contact.load = { from = 1e-3, to = 2e-3, count = 5 }",
            {"contact": {"load": 3e-3}},
            [3e-3],
            {"contact.load"},
        ),
        (
            f'{LOADS}\n"drive.speed" = ["1 mm/s"]',
            {"drive.speed": 0},
            [1e-3, 2e-3],
            {"drive.speed"},
        ),
        (LOADS, {"solid.poisson_ratio": 0.4}, [1e-3, 2e-3], set()),
        ('"shear.points" = [16, 32]', {"shear.model": "mean"}, [4e-3], LEFT_OUT),
        (
            '"shear.spectrum.length" = ["1 um", "2 um"]',
            {"shear.model": "mean"},
            [4e-3] * 2,
            LEFT_OUT,
        ),
        (LOADS, {"sweep": {}}, [4e-3], set()),
        (LOADS, {"sweep": {"solid.shear_modulus": [1e6]}}, [4e-3], set()),
        (
            LOADS,
            {'sweep."contact.load"': ["1 mN", "2 mN", "3 mN"]},
            [1e-3, 2e-3, 3e-3],
            set(),
        ),
    ],
)
def test_an_override_replaces_the_sweep_of_its_key_and_the_keys_of_another_model(
    scene, sweep, overrides, points, named
):
    result = scene(f"{BANDED}[sweep]\n{sweep}\n", overrides)
    assert [point.contact.load for point in result.points()] == points
    assert {
        word
        for line in result.source.notes
        for word in re.findall(r"[a-z]+\.[a-z]+", line)
    } == named
    for key, value in quantities(scene(BANDED, overrides)).items():
        assert quantities(result)[key] == value


def test_rows_of_a_sweep_lose_a_key_that_is_set_and_no_key_is_set_inside_of_a_swept_table(
    scene,
):
    rows = 'sweep = [{ "contact.load" = 1, "drive.speed" = 1 }, { "contact.load" = 1, "drive.speed" = 2 }]\n'
    for overrides, count in (({"drive.speed": 3}, 1), ({"contact.load": 2e-3}, 2)):
        assert len(scene(overrides=overrides, base=rows + LENS).points()) == count
    text = '[sweep]\nbonds = [{ model = "none", stress = "1 kPa" }, { model = "none", stress = "2 kPa" }]\n'
    with pytest.raises(BadInput, match=r"bonds\.stress.*is part of bonds"):
        scene(text, {"bonds.stress": "3 kPa"})
    with pytest.raises(BadInput, match=r"shear\.points.*not a key of this model"):
        scene(BANDED, {"shear.model": "mean", "shear.points": 32})


def loads(scenario):
    return [point.contact.load for point in scenario.points()]


def test_a_range_is_spaced_evenly_with_both_ends_in_one_unit(scene):
    for ends, exact in (
        ('from = "-1 mN", to = "3 mN", count = 5', np.linspace(-1e-3, 3e-3, 5)),
        ('from = "1mN", to = "100mN", count = 3, scale = "log"', [1e-3, 1e-2, 1e-1]),
        (
            'from = "100 uN", to = "0.01 N", count = 3, scale = "log"',
            [1e-4, 1e-3, 1e-2],
        ),
        ("from = 0, to = 1e-3, count = 2", [0.0, 1e-3]),
    ):
        swept = scene(f'[sweep]\n"contact.load" = {{ {ends} }}\n')
        np.testing.assert_allclose(loads(swept), exact, rtol=1e-14, atol=1e-19)


def test_nested_keys_lists_of_tables_and_whole_models_are_swept(scene):
    assert loads(scene('[sweep]\ncontact.load = ["1 mN", "2 mN"]\n')) == [1e-3, 2e-3]
    assert loads(
        scene('[sweep.contact]\nload = { from = "1 mN", to = "2 mN", count = 2 }\n')
    ) == [1e-3, 2e-3]
    pairs = ((1, 1), (2, 3))
    zipped = scene(
        "".join(
            f'[[sweep]]\n"contact.load" = "{p} mN"\n"sphere.radius" = "{r} mm"\n'
            for p, r in pairs
        )
    )
    assert [(point.contact.load, point.sphere.radius) for point in zipped.points()] == [
        (1e-3, 1e-3),
        (2e-3, 3e-3),
    ]
    assert len(zipped.sweep) == 1
    swept = scene(
        '[sweep]\nbonds = [{ model = "none" }, { model = "steady", critical_speed = "1 mm/s" }]\n'
    )
    assert [point.bonds for point in swept.points()] == [
        bonds.Unbroken(),
        bonds.Steady(critical_speed=1e-3),
    ]


TABLE = '[drive]\nmodel = "table"\nfile = "speeds.csv"\n'


def test_a_table_is_read_once_beside_the_scenario_and_its_text_kept(scene, tmp_path):
    text = "time [ms], speed [mm/s]\n0, 1\n1000, 2\n"
    (tmp_path / "speeds.csv").write_text(text, encoding="utf-8")
    scenario = scene(TABLE + '[sweep]\n"contact.load" = ["1 mN", "2 mN"]\n')
    (tmp_path / "speeds.csv").unlink()
    assert [(point.drive.time, point.drive.speed) for point in scenario.points()] == [
        ((0.0, 1.0), (1e-3, 2e-3))
    ] * 2
    assert scenario.source.files == {"speeds.csv": text}


def test_swept_files_are_each_read(scene, tmp_path):
    for name, speed in (("slow", 1), ("fast", 5)):
        (tmp_path / f"{name}.csv").write_text(
            f"time [s], speed [mm/s]\n0, {speed}\n1, {speed}\n", encoding="utf-8"
        )
    (tmp_path / "speeds.csv").write_text(
        "time [s], speed [mm/s]\n0, 9\n1, 9\n", encoding="utf-8"
    )
    swept = scene(TABLE + '[sweep]\n"drive.file" = ["slow.csv", "fast.csv"]\n')
    assert [point.drive.speed[0] for point in swept.points()] == [1e-3, 5e-3]
    whole = scene(
        '[sweep]\ndrive = [{ model = "table", file = "slow.csv" }, { model = "steady", speed = "2 mm/s" }]\n'
    )
    assert [type(point.drive) for point in whole.points()] == [
        drive.Table,
        drive.Steady,
    ]
    assert set(whole.source.files) == {"slow.csv"}


def test_the_starter_shows_every_table_key_and_model():
    text = STARTER.read_text(encoding="utf-8")
    schema = json_schema(Scenario)
    for name in schema["properties"]:
        assert re.search(rf"(?m)^(# )?(\[{name}\]|{name} = )", text), name
    # of files, not written by hand
    columns = {"time", "speed", "wavenumbers", "densities", "variable", "value"}
    for definition in schema["$defs"].values():
        for key in set(definition["properties"]) - columns:
            assert re.search(rf"\b{key}( = |\])", text), key
        if "model" in definition["properties"]:
            assert f'"{definition["properties"]["model"]["const"]}"' in text


def alternatives():
    """Yield the tables in the comments of the starter: the name of the table and its content."""
    table = ""
    for line in STARTER.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            table = line[1 : line.index("]")]
        if line.startswith("# or {"):
            yield (
                table,
                tomllib.loads(
                    f"value = {line.removeprefix('# or ').rpartition('}')[0]}}}"
                )["value"],
            )


def test_every_alternative_of_the_starter_is_a_scene(tmp_path):
    (tmp_path / "x.toml").write_text(
        STARTER.read_text(encoding="utf-8"), encoding="utf-8"
    )
    (tmp_path / "speeds.csv").write_text(
        "time [s], speed [mm/s]\n0, 1\n2, 5\n", encoding="utf-8"
    )
    (tmp_path / "loads.csv").write_text(
        "time [s], load [mN]\n0, 4\n2, -1\n", encoding="utf-8"
    )
    (tmp_path / "psd.csv").write_text(
        "q [rad/m], C [Pa^2 m^2]\n1e5, 1\n3e5, 1\n", encoding="utf-8"
    )
    waves = np.cos(np.arange(16)[:, None] * 1.7) + np.sin(np.arange(16) * 2.1)
    np.savetxt(tmp_path / "map.csv", 1e5 * waves, fmt="%.3e", delimiter=",")
    cohort = next(
        content
        for table, content in alternatives()
        if table == "bonds" and content["model"] == "cohort"
    )
    rate = {"model": "rate"} | {
        key: value for key, value in cohort.items() if key not in ("model", "tolerance")
    }
    # what some models need
    beside = {"bonds": {"bonds": cohort, "shear.amplitude": {"model": "constant"}}}
    beside |= {"spring": {"bonds": rate}, "force": {"bonds": rate}}
    for table, content in alternatives():
        part = load(
            tmp_path / "x.toml", {table: content} | beside.get(content["model"], {})
        )
        for word in table.split("."):
            part = getattr(part, word)
        assert part.model == content["model"]


def test_every_setting_in_the_comments_of_the_starter_is_a_scene(tmp_path):
    text = STARTER.read_text(encoding="utf-8")
    opened = re.sub(r'(?m)^# (?=\[|"?[\w.]+"? = )', "", text).replace(
        'model = "modal"', 'model = "mapped"'
    )
    path = tmp_path / "x.toml"
    path.write_text(opened, encoding="utf-8")
    # the speed at the onset of the fluctuations has no law over the temperature
    scenario = load(path, {"shear.amplitude": {"model": "constant"}})
    assert scenario.record.maps == (0.5, 1.0)
    assert len(scenario.points()) == 15
    assert scenario.solid.counter_body is not None


def test_points_of_a_sweep_are_those_made_one_by_one(scene):
    loads, models = (
        ["1 mN", "2 mN", "4 mN"],
        [{"model": "none"}, {"model": "steady", "critical_speed": 1, "stress": 1}],
    )
    sweep = {
        "contact.load": loads,
        "bonds": models,
        "contact.after_pull_off": ["stop", "stay_open"],
    }
    result = scene(overrides={"sweep": sweep})
    points = result.points()
    values = [
        dict(zip(sweep, row, strict=True)) for row in itertools.product(*sweep.values())
    ]
    expected = [result.with_values(value) for value in values]
    assert points == expected
    assert [point.origin for point in points] == [point.origin for point in expected]


def test_a_point_inside_a_long_sweep_that_cannot_be_built_is_bad_input(scene):
    band = {"model": "band", "rms": "1 kPa", "longest": "120 um", "shortest": "60 um"}
    mapped = {
        "model": "mapped",
        "points": 64,
        "correlation": {"model": "time", "time": 1},
        "spectrum": band,
    }
    cells = [
        *np.linspace(0.23e-3, 0.24e-3, 33),
        1e-2,
        *np.linspace(0.25e-3, 0.26e-3, 33),
    ]
    points = scene(overrides={"shear": mapped, "sweep": {"shear.cell": cells}}).points()
    assert points[0].process
    with pytest.raises(BadInput, match="shear: "):
        _ = points[33].process
