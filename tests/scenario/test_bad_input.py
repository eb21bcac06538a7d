"""What a scenario file can get wrong: each fault is told once, with its line, its key and the cure."""

import os
import re
from pathlib import Path

import pytest

from sim.scenario.reader import BadInput, load

LENS = """\
name = "lens"
seed = 7

[clock]
duration = "2 s"
step = "5 ms"

[solid]
shear_modulus = "1.6 MPa"

[sphere]
radius = "2 mm"

[adhesion]
work = "42 mJ/m^2"

[drive]
model = "ramp"
from = "10 um/s"
to = "100 mm/s"
scale = "log"

[bonds]
model = "rate"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"

[shear]
model = "modal"
cell = "0.24 mm"
points = 32

[shear.spectrum]
model = "self_affine"
rms = "150 kPa"
hurst = 0.8
longest = "60 um"
rolloff = "24 um"
shortest = "16 um"

[shear.correlation]
model = "slip"
length = "5 um"

[contact]
load = "4 mN"

[ensemble]
members = 4
"""
LINES = LENS.splitlines()
END = len(LINES)


def line_of(text):
    """Where a line of the lens stands."""
    return LINES.index(text) + 1


@pytest.fixture
def refusal(tmp_path, monkeypatch):
    """Load a text, or the lens with parts replaced, and give the problems with "x" for the file."""
    monkeypatch.chdir(tmp_path)

    def refused(text=None, overrides=None, **replaced):
        if text is None:
            text = LENS
            for old, new in replaced.pop("edits", ()):
                assert old in text, old
                text = text.replace(old, new, 1)
        before = set(tmp_path.iterdir())
        Path("x").write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(BadInput) as fault:
            load("x", overrides)
        assert set(tmp_path.iterdir()) == before | {tmp_path / "x"}
        return fault.value.problems

    return refused


def edited(*edits):
    return {"edits": edits}


# --- keys ---


@pytest.mark.parametrize(
    ("line", "wrong", "key", "meant"),
    [
        ('rms = "150 kPa"', 'rsm = "150 kPa"', "shear.spectrum.rsm", "rms"),
        ('step = "5 ms"', 'stpe = "5 ms"', "clock.stpe", "step"),
        ("seed = 7", "sede = 7", "sede", "seed"),
        ('critical_speed = "10 mm/s"', 'crit_speed = "10 mm/s"', "bonds.crit_speed", "critical_speed"),
        ("[sphere]", "[shpere]", "shpere", "sphere"),
        ("[shear.correlation]", "[shear.corelation]", "shear.corelation", "correlation"),
        ("members = 4", "member = 4", "ensemble.member", "members"),
    ],
)
def test_a_misspelt_key_is_told_once_with_the_one_meant(refusal, line, wrong, key, meant):
    assert refusal(**edited((line, wrong))) == [f'x:{line_of(line)}: {key}: is not a key; did you mean "{meant}"?']


def test_a_misspelt_key_of_an_inline_table_is_told_with_the_one_meant(refusal):
    body = 'counter_body = { youngs_modulus = "1 GPa", poison = 0.3 }'
    assert refusal(**edited(("[solid]", f"[solid]\n{body}"))) == [
        f'x:{line_of("[solid]") + 1}: solid.counter_body.poison: is not a key; did you mean "poisson_ratio"?'
    ]


@pytest.mark.parametrize(
    ("line", "added", "key", "meant"),
    [
        ('step = "5 ms"', 'load = "1 mN"', "clock.load", "contact.load"),
        ("points = 32", 'rms = "1 kPa"', "shear.rms", "shear.spectrum.rms"),
        ("hurst = 0.8", 'cell = "1 mm"', "shear.spectrum.cell", "shear.cell"),
        ("seed = 7", "members = 3", "members", "ensemble.members"),
    ],
)
def test_a_key_in_the_wrong_table_is_told_with_the_right_one(refusal, line, added, key, meant):
    found = refusal(**edited((line, f"{line}\n{added}")))
    assert found == [f'x:{line_of(line) + 1}: {key}: is not a key here; did you mean "{meant}"?']


def test_a_key_of_another_model_is_told_with_the_models_that_have_it(refusal):
    at = line_of('rebinding_rate = "500 1/s"')
    assert refusal(**edited(('model = "rate"', 'model = "steady"'))) == [
        f'x:{at}: bonds.rebinding_rate: is not a key of model = "steady";'
        ' remove it, or choose model = "rate", "cohort", "counted", "tracked" or "auto"'
    ]


def test_a_key_like_none_is_told_with_those_there_are(refusal):
    assert refusal(**edited(("members = 4", "members = 4\nxyz = 1"))) == [
        f"x:{END + 1}: ensemble.xyz: is not a key; known: members"
    ]


def test_strange_keys_stay_on_one_line_and_reach_no_terminal(refusal):
    for problem in refusal('"" = 1\n"a b" = 2\n"\\u001b[31m" = 3\n"x\\ny" = 4\n' + LENS):
        assert problem.isprintable()
    first = refusal('"" = 1\n' + LENS)
    assert first[0].startswith('x:1: "": is not a key; known: clock, ')


# --- missing ---


def test_missing_keys_and_tables_are_told_with_an_example(refusal):
    text = '[clock]\nduration = "1 s"\n[solid]\n[contact]\nload = 0\n'
    text += '[bonds]\nmodel = "counted"\n[shear]\nmodel = "modal"\n'
    found = refusal(text)
    assert found[:2] == [
        "x: sphere: is missing; add the table [sphere] with radius",
        "x: adhesion: is missing; add the table [adhesion] with work",
    ]
    assert 'x:1: clock.step: is missing; add for example step = "10 ms"' in found
    assert 'x:6: bonds.rebinding_rate: is missing; add for example rebinding_rate = "500 1/s"' in found
    assert "x:6: bonds.sites: is missing; add for example sites = 64" in found
    correlation = 'the table [shear.correlation] with model = "time", "slip", "wave" or "diffusion"'
    assert f"x:8: shear.correlation: is missing; add {correlation}" in found
    solid = next(problem for problem in found if problem.startswith("x:3: solid: "))
    assert 'shear_modulus = "1.6 MPa" or youngs_modulus = "4.8 MPa"' in solid


def test_a_missing_model_is_told_with_the_choices(refusal):
    assert refusal(**edited(('[bonds]\nmodel = "rate"', "[bonds]"))) == [
        f"x:{line_of('[bonds]')}: bonds.model: is missing;"
        ' choose "none", "steady", "rate", "cohort", "counted", "tracked" or "auto"'
    ]


def test_a_misspelt_model_is_told_with_the_one_meant_or_all(refusal):
    assert refusal(**edited(('model = "modal"', 'model = "modl"'))) == [
        f'x:{line_of("[shear]") + 1}: shear.model: must not be "modl"; did you mean "modal"?'
    ]
    assert refusal(**edited(('model = "slip"', 'model = "magnetic"'))) == [
        f"x:{line_of('[shear.correlation]') + 1}: shear.correlation.model:"
        ' must be "time", "slip", "wave" or "diffusion", not "magnetic"'
    ]


# --- values ---


@pytest.mark.parametrize(
    ("line", "wrong", "said"),
    [
        ('work = "42 mJ/m^2"', 'work = "42 mJ"', 'has the unit "mJ", which is not a unit of J/m^2; write for example'),
        ('work = "42 mJ/m^2"', 'work = "42 mJx/m^2"', 'has the unknown unit "mJx/m^2"; did you mean "mJ/m^2"?'),
        (
            'radius = "2 mm"',
            'radius = "2 MPa"',
            'has the unit "MPa", which is not a unit of m; write for example "2 mm"',
        ),
        ('radius = "2 mm"', "radius = nan", 'must be finite; write for example "2 mm"'),
        ('radius = "2 mm"', "radius = -inf", 'must be finite; write for example "2 mm"'),
        ('radius = "2 mm"', 'radius = "-2 mm"', "must be above 0 m, not -0.002 m"),
        ('radius = "2 mm"', "radius = 0", "must be above 0 m, not 0 m"),
        ('radius = "2 mm"', 'radius = ""', 'cannot be read: ""; write a number and a unit, such as "2 mm"'),
        ('radius = "2 mm"', "radius = true", 'must be a number or text with a unit such as "2 mm", not true'),
        ('radius = "2 mm"', "radius = [2]", 'must be a number or text with a unit such as "2 mm", not a list'),
        ('radius = "2 mm"', "radius = { a = 1 }", 'must be a number or text with a unit such as "2 mm", not a table'),
        ('radius = "2 mm"', "radius = 1979-05-27", 'must be a number or text with a unit such as "2 mm", not a date'),
        ("hurst = 0.8", "hurst = 1.5", "must be at most 1, not 1.5"),
        ("hurst = 0.8", "hurst = false", "must be a number such as 0.5, not false"),
        ("members = 4", "members = 0", "must be at least 1, not 0"),
        ("members = 4", "members = 4.5", "must be a whole number such as 64, not 4.5"),
        ("members = 4", 'members = "many"', 'must be a whole number such as 64, not "many"'),
        ("members = 4", "members = true", "must be a whole number such as 64, not true"),
        ("points = 32", "points = true", "must be a whole number such as 64, not true"),
        ("seed = 7", "seed = -1", "must be at least 0, not -1"),
        ("seed = 7", "seed = 18446744073709551616", "must be at most 18446744073709551615, not 18446744073709551616"),
        ('name = "lens"', "name = 5", "must be text in quotes, not 5"),
        ('name = "lens"', f'name = "{"x" * 201}"', "is longer than 200 characters; shorten it"),
        ('scale = "log"', 'scale = "logarithmic"', 'must be "linear" or "log", not "logarithmic"'),
        ('scale = "log"', 'scale = "lin"', 'must not be "lin"; did you mean "linear"?'),
    ],
)
def test_a_bad_value_is_told_with_its_key_and_the_cure(refusal, line, wrong, said):
    (problem,) = refusal(**edited((line, wrong)))
    table = next((text for text in reversed(LINES[: line_of(line)]) if text.startswith("[")), "")
    key = ".".join(filter(None, (table.strip("[]"), wrong.partition(" ")[0])))
    assert problem.startswith(f"x:{line_of(line)}: {key}: {said}")


@pytest.mark.parametrize(
    "zero", ["duration", "step", "shear_modulus", "radius", "critical_speed", "rebinding_rate", "length"]
)
def test_nothing_that_divides_may_be_zero(refusal, zero):
    line = next(line for line in LINES if line.startswith(f"{zero} = "))
    (problem,) = refusal(**edited((line, f"{zero} = 0")))
    assert f"{zero}: must be above 0 " in problem


@pytest.mark.parametrize(
    ("line", "wrong", "said"),
    [
        (
            '[sphere]\nradius = "2 mm"',
            'sphere = "2 mm"',
            "sphere: must be a table, not text; write [sphere] and its keys below",
        ),
        ("[ensemble]\nmembers = 4", "ensemble = 4", "ensemble: must be a table, not a whole number; write [ensemble]"),
        ("[sphere]", "[[sphere]]", "sphere: must be one table, not a list; write [sphere] once, in single brackets"),
    ],
)
def test_what_is_no_table_is_told(refusal, line, wrong, said):
    text = LENS.replace(line, "")
    if wrong.startswith("["):
        text = LENS.replace(line, wrong)
    else:
        text = f"{wrong}\n{text}"
    assert any(said in problem for problem in refusal(text))


def test_a_model_given_as_text_is_told_as_a_table(refusal):
    text = 'drive = "steady"\n' + re.sub(r"(?s)\[drive\].*?\n\n", "", LENS)
    assert refusal(text) == ['x:1: drive: must be a table, not text; write drive = { model = "steady" }']


def test_lists_and_choices_of_the_record_are_checked(refusal):
    text = LENS + '[record]\nper_member = "maybe"\nmaps = "1 s"\nprecision = "double"\nmap_members = 0\n'
    assert refusal(text) == [
        f'x:{END + 2}: record.per_member: must be true or false, without quotes, not "maybe"',
        f'x:{END + 3}: record.maps: must be a list such as ["1 s", "2 s"], not "1 s"',
        f'x:{END + 4}: record.precision: must be "float64" or "float32", not "double"',
        f"x:{END + 5}: record.map_members: must be at least 1, not 0",
    ]
    assert refusal(LENS + '[record]\nmaps = ["1 s",\n  "2 kg"]\n') == [
        f'x:{END + 3}: record.maps: value 2: has the unit "kg", which is not a unit of s; write for example "10 ms"'
    ]


# --- what does not go together ---


def test_a_contact_is_held_by_exactly_one_of_load_and_indentation(refusal):
    at = line_of("[contact]")
    for edit in (('load = "4 mN"', 'load = "4 mN"\nindentation = "1 um"'), ('load = "4 mN"', "")):
        (problem,) = refusal(**edited(edit))
        assert problem.startswith(f"x:{at}: contact: ")
        assert "load" in problem and "indentation" in problem and ("give" in problem or "leave" in problem)


def test_a_solid_has_exactly_one_modulus(refusal):
    at, line = line_of("[solid]"), 'shear_modulus = "1.6 MPa"'
    for edit, found in (((line, ""), "none is"), ((line, f'{line}\nyoungs_modulus = "1 MPa"'), "both are")):
        (problem,) = refusal(**edited(edit))
        assert problem.startswith(f"x:{at}: solid: needs exactly one modulus, but {found} given")


@pytest.mark.parametrize(
    ("new", "said"),
    [
        ('step = "3 ms"', "duration (2 s) must be a whole multiple of step (0.003 s), such as 1.998 s or 2.001 s"),
        ('step = "5 s"', "duration (2 s) must be a whole multiple of step (5 s), such as 5 s"),
        ('step = "5 ms"\nrecord = "7 ms"', "record (0.007 s) must be a whole multiple of step (0.005 s), such as"),
        ('step = "5 ms"\nrecord = "0.3 s"', "duration (2 s) must be a whole multiple of record (0.3 s), such as 1.8 s"),
        ('step = "1 ns"', "asks for more than 1,000,000,000 steps; make step longer"),
        ('step = "100 ns"', "asks for more than 10,000,000 records; give a longer record"),
    ],
)
def test_a_clock_that_does_not_come_out_even_is_told_with_one_that_does(refusal, new, said):
    (problem,) = refusal(**edited(('step = "5 ms"', new)))
    assert problem.startswith(f"x:{line_of('[clock]')}: clock: {said}")


def test_faults_between_parts_are_told_beside_those_of_values(refusal):
    text = LENS.replace('"42 mJ/m^2"', '"42 mJ"') + '[record]\nmaps = ["1 s"]\nmap_members = 5\n'
    assert refusal(text) == [
        f'x:{line_of("[adhesion]") + 1}: adhesion.work: has the unit "mJ", which is not a unit of J/m^2;'
        ' write for example "42 mJ/m^2"',
        f'x:{END + 2}: record.maps: needs shear.model = "mapped"; choose it or leave the maps out',
        f"x:{END + 3}: record.map_members: is more than ensemble.members (4); lower it or add members",
    ]


def test_maps_are_drawn_at_recorded_times_only(refusal):
    text = LENS.replace('model = "modal"', 'model = "mapped"') + '[record]\nmaps = ["1 s", "3 ms"]\n'
    assert refusal(text) == [
        f"x:{END + 2}: record.maps: 0.003 s is none of the recorded times; choose whole multiples of 0.005 s up to 2 s"
    ]


def test_a_amplitude_with_the_stress_needs_a_stress(refusal):
    text = LENS + '[shear.amplitude]\nmodel = "stress"\nreference = "1 MPa"\n'
    (problem,) = refusal(text)
    assert problem.startswith(f"x:{END + 1}: shear.amplitude: ")
    assert "bonds.stress" in problem


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        ([("points = 32", "points = 8")], "the shortest wavelength needs at least 31 points, not 8; give more points"),
        (
            [('cell = "0.24 mm"', 'cell = "24 mm"'), ("points = 32\n", "")],
            "Fourier modes, of which 2.1e+06 can be kept",
        ),
        ([('cell = "0.24 mm"', 'cell = "240 km"'), ("points = 32\n", "")], "of the shortest waves along a side; take"),
        ([('cell = "0.24 mm"', 'cell = "1 um"')], "no wave of the spectrum fits the cell of 1e-06 m; make the cell"),
        (
            [('cell = "0.24 mm"\n', ""), ('"4 mN"', '"-1 N"')],
            "there is no contact at rest to set the cell by; give a cell",
        ),
    ],
)
def test_a_cell_that_cannot_hold_the_spectrum_is_refused_before_it_is_made(refusal, edits, said):
    (problem,) = refusal(**edited(*edits))
    assert problem.startswith(f"x:{line_of('[shear]')}: shear: ")
    assert said in problem


def test_cut_offs_out_of_order_and_logarithms_of_zero_are_told(refusal):
    (problem,) = refusal(**edited(('longest = "60 um"', 'longest = "6 um"')))
    assert problem.startswith(
        f"x:{line_of('[shear.spectrum]')}: shear.spectrum: longest (6e-06 m) is shorter than rolloff"
    )
    (problem,) = refusal(**edited(('from = "10 um/s"', "from = 0")))
    assert problem.startswith(f"x:{line_of('[drive]')}: drive: a logarithmic course cannot reach or pass zero")


def test_all_faults_come_in_one_pass_in_the_order_of_the_file(refusal):
    found = refusal(
        **edited(
            ('duration = "2 s"', 'duration = "2 m"'),
            ('shear_modulus = "1.6 MPa"', "shear_modulus = -1"),
            ("[drive]", "[drvie]"),
            ('rms = "150 kPa"', "rms = nan"),
            ('length = "5 um"', 'lenght = "5 um"'),
            ('load = "4 mN"', 'load = "4 mN"\nindentation = "1 um"'),
            ("members = 4", "members = 0"),
        )
    )
    keys = [problem.split(": ")[1] for problem in found]
    wanted = ["clock.duration", "solid.shear_modulus", "drvie", "shear.spectrum.rms", "shear.correlation.lenght"]
    assert keys == [*wanted, "contact", "ensemble.members"]
    numbers = [int(problem.split(":")[1]) for problem in found]
    assert numbers == sorted(numbers)


# --- bonds with a stretch ---

HAZARD = 'rupture = { model = "bell", zero_force_rate = "200 1/s", bell_force = "4 pN" }'
STRETCHED = [HAZARD, 'bond_stiffness = "0.4 uN/m"', 'rebinding_rate = "400 1/s"', 'site_density = "1e17 1/m^2"']
LINEAR = ['critical_speed = "10 mm/s"', 'rebinding_rate = "500 1/s"']
BONDS = line_of("[bonds]")
NEEDS = "give either critical_speed and rebinding_rate, or rupture, bond_stiffness, rebinding_rate and site_density"


def bonded(model, *lines, shear=None):
    """The lens with other bonds, whose lines begin two below their table, and another shear part."""
    text = LENS.replace("\n".join(['model = "rate"', *LINEAR]), "\n".join([f'model = "{model}"', *lines]))
    if shear is not None:
        text = re.sub(r"(?s)\[shear\].*?(?=\[contact\])", "[shear]\n" + "\n".join(shear) + "\n\n", text)
    return text


@pytest.mark.parametrize("model", ["rate", "cohort", "tracked"])
def test_bonds_with_a_stretch_are_told_which_keys_they_lack(refusal, model):
    sites = ["sites = 50"] if model == "tracked" else []
    tables = 'the table [bonds.rupture] with model = "constant", "bell" or "cut_off"'
    assert refusal(bonded(model, *STRETCHED[1:], *sites)) == [f"x:{BONDS}: bonds.rupture: is missing; add {tables}"]
    lacking = [problem.split(" for example")[0] for problem in refusal(bonded(model, HAZARD, *sites))]
    assert lacking == [
        f"x:{BONDS}: bonds.{key}: is missing; add" for key in ("bond_stiffness", "rebinding_rate", "site_density")
    ]


@pytest.mark.parametrize(
    ("rupture", "key", "said"),
    [
        ('{ model = "bel", bell_force = 1 }', "rupture.model", 'must not be "bel"; did you mean "bell"?'),
        ('{ model = "arrhenius" }', "rupture.model", 'must be "constant", "bell" or "cut_off", not "arrhenius"'),
        ("{ rate = 1 }", "rupture.model", 'is missing; choose "constant", "bell" or "cut_off"'),
        ('"bell"', "rupture", 'must be a table, not text; write rupture = { model = "bell" }'),
        ('{ model = "bell", zero_force_rate = 1 }', "rupture.bell_force", "is missing; add for example bell_force = "),
        ('{ model = "constant" }', "rupture.rate", "is missing; add for example rate = "),
        ('{ model = "cut_off" }', "rupture.stretch", "is missing; add for example stretch = "),
        ('{ model = "bell", zero_force_rate = 1, bell_force = "4 pN/m" }', "rupture.bell_force",
         'has the unit "pN/m", which is not a unit of N; write for example "'),
        ('{ model = "bell", zero_force_rate = 0, bell_force = 1 }', "rupture.zero_force_rate", "must be above 0 1/s"),
        ('{ model = "cut_off", stretch = "-1 nm" }', "rupture.stretch", "must be above 0 m, not -1e-09 m"),
        ('{ model = "cut_off", stretch = 1, rate = -1 }', "rupture.rate", "must be at least 0 1/s, not -1 1/s"),
        ('{ model = "bell", zero_force_rate = 1, bell_force = 1, stretch = 1 }', "rupture.stretch",
         'is not a key of model = "bell"; remove it, or choose model = "cut_off"'),
    ],
)  # fmt: skip
@pytest.mark.parametrize("model", ["rate", "cohort", "auto"])
def test_a_bad_rupture_is_told_with_its_key_and_the_cure(refusal, model, rupture, key, said):
    (problem,) = refusal(bonded(model, f"rupture = {rupture}", *STRETCHED[1:]))
    assert problem.startswith(f"x:{BONDS + 2}: bonds.{key}: {said}")


@pytest.mark.parametrize(
    ("model", "added", "said"),
    [
        ("rate", 'critical_speed = "1 mm/s"', "critical_speed: does not go with rupture; leave one of them out"),
        ("rate", 'stress = "1 MPa"', "stress: does not go with rupture; leave one of them out"),
        ("rate", "tolerance = 0.1", 'tolerance: is not a key of model = "rate"; remove it, or choose model = "cohort"'),
        ("cohort", 'critical_speed = "1 mm/s"', 'critical_speed: is not a key of model = "cohort"; remove it, or'),
        ("cohort", 'stress = "1 MPa"', 'stress: is not a key of model = "cohort"; remove it, or choose model = "n'),
        ("cohort", "sites = 5", 'sites: is not a key of model = "cohort"; remove it, or choose model = "counted", "t'),
        ("cohort", "tolerance = 0", "tolerance: must be at least 1e-12, not 0"),
        ("cohort", "tolerance = 0.1", "tolerance: must be below 0.1, not 0.1"),
        ("cohort", "tolerance = -1e-3", "tolerance: must be at least 1e-12, not -0.001"),
        ("cohort", 'area = "carry"', 'area: must not be "carry"; did you mean "carried"?'),
        ("cohort", 'area = "old"', 'area: must be "present" or "carried", not "old"'),
        ("cohort", 'start = "resting"', 'start: must be "steady", "bonded" or "empty", not "resting"'),
        ("tracked", "sites = 0", "sites: must be at least 1, not 0"),
        ("tracked", "sites = 10_000_000", "sites: must be at most 1000000, not 10000000"),
        ("tracked", "sites = 2.5", "sites: must be a whole number such as 64, not 2.5"),
        ("tracked", "sites = true", "sites: must be a whole number such as 64, not true"),
        ("auto", "sites = 0", "sites: must be at least 1, not 0"),
        ("auto", "tolerance = 0", "tolerance: must be above 0, not 0"),
        ("auto", "tolerance = 1", "tolerance: must be below 1, not 1"),
    ],
)  # fmt: skip
def test_a_bad_key_of_bonds_with_a_stretch_is_told_with_the_cure(refusal, model, added, said):
    (problem,) = refusal(bonded(model, *STRETCHED, added))
    assert problem.startswith(f"x:{BONDS + 6}: bonds.{said}")


def test_tracked_bonds_without_a_number_or_with_an_area_are_told(refusal):
    assert refusal(bonded("tracked", *STRETCHED)) == [f"x:{BONDS}: bonds.sites: is missing; add for example sites = 64"]
    (problem,) = refusal(bonded("tracked", *STRETCHED, "sites = 5", 'area = "carried"'))
    assert problem.startswith(f'x:{BONDS + 7}: bonds.area: is not a key of model = "tracked"; remove it, or choose')


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([], NEEDS),
        (["sites = 3"], NEEDS),
        ([LINEAR[0], *STRETCHED], NEEDS),
        ([LINEAR[0], STRETCHED[1]], NEEDS),
        (LINEAR[:1], "rebinding_rate is missing, which bonds like these need"),
        (LINEAR[1:], NEEDS),
        (STRETCHED[:3], "site_density is missing, which bonds like these need"),
        ([*STRETCHED, 'stress = "1 MPa"'], "bonds with a rupture make their own stress; leave stress out"),
    ],
)
def test_bonds_left_open_take_the_keys_of_one_kind(refusal, lines, said):
    assert refusal(bonded("auto", *lines)) == [f"x:{BONDS}: bonds: {said}"]


MADE = ['model = "mean"', 'spectrum = { model = "bonds", footprint = "10 um" }']
CELLED = [MADE[1], 'correlation = { model = "time", time = "1 ms" }', 'cell = "0.24 mm"']


@pytest.mark.parametrize(
    ("shear", "key", "said"),
    [
        ([MADE[0], 'spectrum = { model = "bonds" }'], "shear.spectrum.footprint", "is missing; add for example foot"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = 0 }'], "shear.spectrum.footprint", "must be above 0 m"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = "1 um", rms = 1 }'], "shear.spectrum.rms",
         'is not a key of model = "bonds"; remove it, or choose model = "band", '),
        ([*MADE, 'amplitude = { model = "onset", speed = 1, width = 0.1 }'], "shear",
         "the bonds set the size of the field they make; leave amplitude out"),
        (['model = "banded"', *CELLED], "shear", "the frozen part of a field that bonds make has no bands; use mod"),
        (['model = "modal"', *CELLED, "points = 32", 'mode_amplitudes = "fixed"'], "shear",
         'bonds at random places make mode_amplitudes = "gaussian"; leave it out'),
        (['model = "modal"', *CELLED], "shear", "the spectrum has no shortest wavelength; give points (such as points"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = "10 fm" }'], "bonds.bond_stiffness",
         "the half-space under a bond of this footprint yields with 7.9e-08 N/m, in series with the bond: give at mo"),
    ],
)  # fmt: skip
def test_a_field_that_bonds_cannot_make_is_told(refusal, shear, key, said):
    (problem,) = refusal(bonded("cohort", *STRETCHED, shear=shear))
    assert re.match(r"x:\d+: ", problem)
    assert problem.split(": ", 1)[1].startswith(f"{key}: {said}")


@pytest.mark.parametrize(
    ("model", "lines"),
    [
        ("none", ['stress = "1 MPa"']),
        ("rate", [*LINEAR, 'stress = "1 MPa"']),
        ("counted", [*LINEAR, 'stress = "1 MPa"', "sites = 5"]),
        ("auto", [*LINEAR, 'stress = "1 MPa"']),
        ("rate", LINEAR),
        ("auto", LINEAR),
        ("rate", STRETCHED),
    ],
)
def test_a_field_of_bonds_whose_forces_are_not_known_is_told_with_the_depths_that_know(refusal, model, lines):
    (problem,) = refusal(bonded(model, *lines, shear=MADE))
    assert problem.endswith(
        ": shear.spectrum: the spectrum that bonds make needs the force of each bond;"
        ' use bonds.model = "cohort" or "tracked"'
    )


@pytest.mark.parametrize(
    ("lines", "at", "said"),
    [
        (['rest = "-1 s"', "speed = 1"], 2, "rest: must be at least 0 s, not -1 s"),
        (['rest = "1 m"', "speed = 1"], 2, 'rest: has the unit "m", which is not a unit of s; write for example'),
        (["rest = 1", 'speed = "1 N"'], 3, 'speed: has the unit "N", which is not a unit of m/s; write for example'),
        (["speed = 1"], 0, "rest: is missing; add for example rest = "),
        (["rest = 1"], 0, "speed: is missing; add for example speed = "),
        (["rest = 1", "speed = 1", "to = 3"], 4, 'to: is not a key of model = "start"; remove it, or choose model'),
    ],
)  # fmt: skip
def test_a_bad_start_is_told(refusal, lines, at, said):
    drive = "\n".join(["[drive]", 'model = "start"', *lines, "", ""])
    (problem,) = refusal(re.sub(r"(?s)\[drive\].*?(?=\[bonds\])", drive, LENS))
    assert problem.startswith(f"x:{line_of('[drive]') + at}: drive.{said}")


# --- files that a scenario names ---

FILE = line_of("[drive]") + 2
TABLE = ('model = "ramp"\nfrom = "10 um/s"\nto = "100 mm/s"\nscale = "log"', 'model = "table"\nfile = "v.csv"')


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "v.csv cannot be read (No such file or directory); give a path relative to the scenario"),
        ("", "v.csv: the table is empty; begin with a header"),
        ("time [s]\n0\n", 'v.csv: line 1: column "speed" is missing (found: time); write the header as'),
        ("time [s], speed [kg]\n0, 1\n", 'v.csv: line 1: column "speed" has the unit "kg", which is not a unit of m/s'),
        (
            "time [s], speed [m/s]\n0, 1\n2, fast\n",
            'v.csv: line 3: speed is "fast", not a number; write a plain number',
        ),
        ("time [s], speed [m/s]\n0, 1\n2\n", "v.csv: line 3: 1 cells where the header has 2"),
        ("time [s], speed [m/s]\n0, 1\n1, 1\n", "the table ends at 1 s, before clock.duration (2 s)"),
        ("time [s], speed [m/s]\n2, 1\n1, 1\n", "times must start at 0 s"),
        (b"time [s], speed [m/s]\n0, \xff\n", "v.csv is not UTF-8 text; save it as plain CSV in UTF-8"),
    ],
)
def test_a_broken_table_is_told_with_its_file_and_line(refusal, tmp_path, content, said):
    if content is not None:
        (tmp_path / "v.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    (problem,) = refusal(**edited(TABLE))
    assert problem.startswith(f"x:{line_of('[drive]')}: drive: " if "v.csv" not in said else f"x:{FILE}: drive.file: ")
    assert said in problem


def test_a_table_without_its_file_is_told(refusal):
    assert refusal(**edited((TABLE[0], 'model = "table"'))) == [
        f'x:{line_of("[drive]")}: drive.file: is missing; name a CSV file such as file = "data.csv"'
    ]
    (problem,) = refusal(**edited((TABLE[0], 'model = "table"\nfile = 5')))
    assert problem == f"x:{FILE}: drive.file: must be text in quotes, not 5"


@pytest.mark.parametrize("name", ["/dev/zero", ".", "a\\u0000b"])
def test_only_plain_files_are_read(refusal, name):
    (problem,) = refusal(**edited((TABLE[0], f'model = "table"\nfile = "{name}"')))
    assert "cannot be read (" in problem


# --- sweeps ---


def swept(text):
    return {"text": LENS + "[sweep]\n" + text}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"contact.lod" = ["1 mN"]', 'sweep."contact.lod": is not a key; did you mean "contact.load"?'),
        ('"contcat.load" = ["1 mN"]', 'sweep."contcat.load": is not a key; did you mean "contact.load"?'),
        ('contact.lod = ["1 mN"]', 'sweep."contact.lod": is not a key; did you mean "contact.load"?'),
        ('"contact.load" = []', 'sweep."contact.load": must not be an empty list; write ["1 mN", "4 mN"] or { from,'),
        ('"contact.load" = "1 mN"', 'sweep."contact.load": must be a list of values; write ["1 mN", "4'),
        ('"contact.load" = { from = "1 mN", to = "2 uN", count = 3 }',
         'sweep."contact.load": the range goes from "mN" to "uN"; write both ends in the same unit'),
        ('"contact.load" = { from = 1, to = "2 uN", count = 3 }', 'the range goes from no unit to "uN"; write both'),
        ('"contact.load" = { from = 1, to = 2 }', "the range lacks count; write { from = ..., to = ..., count = ... }"),
        ('"contact.load" = { from = 1, to = 2, cout = 3 }', 'the range has the unknown key "cout"; it takes from, to,'),
        ('"contact.load" = { from = 1, to = nan, count = 3 }', "the range needs finite numbers"),
        ('"contact.load" = { from = 1, to = 2, count = 1 }', "the count of the range must be a whole number"),
        ('"contact.load" = { from = 1, to = 2, count = 2.5 }', "the count of the range must be a whole number"),
        ('"contact.load" = { from = 1, to = 2, count = 3, scale = "ln" }', 'of the range must be "linear" or "log"'),
        ('"contact.load" = { from = 0, to = 2, count = 3, scale = "log" }', 'scale = "log" needs both ends above zero'),
        ("seed = [1, 2]", "sweep.seed: cannot be swept; members differ in their noise already, so raise ensemble.mem"),
        ('name = ["a"]', "sweep.name: cannot be swept, since all points of a sweep share it; run the scenario once"),
        ('"clock.duration" = ["1 s"]', 'sweep."clock.duration": cannot be swept, since all points'),
        ('"ensemble.members" = [1]', 'sweep."ensemble.members": cannot be swept, since all points'),
        ('"bonds.model" = ["none", "rate"]', 'a model is swept as a whole table: "bonds" = [{ model = ... }, { model'),
        ('bonds = [{ model = "none" }]\n"bonds.stress" = [1]', 'sweep."bonds.stress": is swept twice; take it out'),
        ('"clock.step" = ["5 ms", "10 ms"]', "the points of the sweep would have different records; give clock.record"),
    ],
)  # fmt: skip
def test_a_sweep_that_cannot_be_is_told_with_the_cure(refusal, text, said):
    (problem,) = refusal(**swept(text))
    assert re.match(rf"x:({END + 1}|{END + 2}|{END + 3}): sweep", problem)
    assert said in problem


def test_a_bad_value_of_a_sweep_is_told_with_its_place_and_line(refusal):
    assert refusal(**swept('"shear.spectrum.rms" = ["1 kPa", "2 kg",\n  -3, "4 kPa"]')) == [
        f'x:{END + 2}: sweep."shear.spectrum.rms": value 2 (2 kg): has the unit "kg", which is not a unit of Pa;'
        ' write for example "1.6 MPa"',
        f'x:{END + 3}: sweep."shear.spectrum.rms": value 3 (-3): must be above 0 Pa, not -3 Pa',
    ]


def test_a_fault_shared_by_many_values_is_told_once(refusal):
    (problem,) = refusal(**swept('"contact.load" = { from = "1 kg", to = "2 kg", count = 50 }'))
    assert problem.startswith(f'x:{END + 2}: sweep."contact.load": value 1 (1 kg) and 49 more: has the unit "kg"')


def test_a_sweep_of_tables_is_told_what_each_lacks(refusal):
    found = refusal(**swept('bonds = [{ model = "none" }, { model = "steady" }, { modle = "rate" }]'))
    assert found == [
        f'x:{END + 2}: sweep.bonds: value 2 ({{ model = "steady" }}): bonds.critical_speed: is missing;'
        ' add for example critical_speed = "1 mm/s"',
        f'x:{END + 2}: sweep.bonds: value 3 (a table): bonds.modle: is not a key; did you mean "model"?',
    ]


def test_zipped_tables_have_the_same_keys(refusal):
    rows = '[[sweep]]\n"contact.load" = 1\n[[sweep]]\n"contact.lad" = 1\n'
    (problem,) = refusal(LENS + rows)
    assert problem.startswith(f'x:{END + 3}: sweep: has other keys than the first table of the sweep ("contact.lad")')
    rows = '[[sweep]]\n"contact.load" = 1\n"solid.poisson_ratio" = 0.4\n'
    rows += '[[sweep]]\n"contact.load" = "1 kg"\n"solid.poisson_ratio" = 0.8\n'
    assert refusal(LENS + rows) == [
        f'x:{END + 5}: sweep."contact.load": value 2 (1 kg): has the unit "kg", which is not a unit of N;'
        ' write for example "4 mN"',
        f'x:{END + 6}: sweep."solid.poisson_ratio": value 2 (0.8): must be at most 0.5, not 0.8',
    ]


@pytest.mark.parametrize("sweep", ["5", '"x"', "[]", "[1]", "[{}]"])
def test_what_is_no_sweep_is_told(refusal, sweep):
    (problem,) = refusal(f"sweep = {sweep}\n{LENS}")
    assert problem.startswith("x:1: sweep: must be a ")


def test_a_sweep_is_checked_even_where_other_tables_are_faulty(refusal):
    text = LENS.replace('"2 mm"', '"2 kg"') + '[sweep]\n"contact.load" = ["1 mN", "1 s"]\n"clock.stp" = [1]\n'
    assert [problem.split(": ")[1] for problem in refusal(text)] == [
        "sphere.radius",
        'sweep."contact.load"',
        'sweep."clock.stp"',
    ]


def test_values_of_two_axes_that_do_not_go_together_are_told(refusal):
    text = LENS.replace("points = 32", "points = 40")
    sweep = '[sweep]\n"shear.cell" = ["0.2 mm", "0.3 mm"]\n"shear.points" = [32, 40]\n'
    (problem,) = refusal(text + sweep)
    assert problem.startswith(
        f"x:{END + 1}: sweep: some values do not go together: shear: the shortest wavelength needs"
    )


def test_points_whose_maps_differ_in_size_do_not_fit_into_one_dataset(refusal):
    text = LENS.replace('model = "modal"', 'model = "mapped"') + '[record]\nmaps = ["1 s"]\n'
    (problem,) = refusal(text + '[sweep]\n"shear.points" = [32, 40]\n')
    assert problem == (
        f"x:{END + 3}: sweep: the points of the sweep would have different maps;"
        " run once for each cell and number of points"
    )


def test_a_sweep_of_far_too_many_points_is_refused_before_it_is_made(refusal):
    rows = "".join(f'"{key}" = {{ from = 1, to = 2, count = 9999 }}\n' for key in ("drive.to", "contact.load"))
    (problem,) = refusal(**swept(rows))
    assert problem == f"x:{END + 1}: sweep: asks for more than 20,000 points; take fewer values, or several runs"


# --- overrides ---


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"contact.lod": 1}, '--set contact.lod: is not a key; did you mean "load"?'),
        ({"nope.x.y": 3}, "--set nope.x.y: nope is not a key; known: clock, "),
        (
            {"contact.load": "1 kg"},
            '--set contact.load: has the unit "kg", which is not a unit of N; write for example',
        ),
        ({"contact": 5}, "--set contact: must be a table, not a whole number; write [contact] and its keys below"),
        ({"seed": True}, "--set seed: must be a whole number such as 64, not true"),
        ({"name.x": 1}, '--set name.x: needs a table, but "name" is "lens" in the file'),
        ({"": 1}, '--set "": is not a key; known: clock'),
        ({"shear.spectrum.rsm": 1}, '--set shear.spectrum.rsm: is not a key; did you mean "rms"?'),
        ({'sweep."contact.load"': [1, "2 mm"]}, '--set sweep."contact.load": value 2 (2 mm): has the unit "mm", which'),
    ],
)
def test_a_bad_override_is_told_as_such(refusal, overrides, said):
    (problem,) = refusal(LENS, overrides)
    assert problem.startswith(said)


def test_an_override_that_contradicts_the_file_is_told_how_to_replace_the_table(refusal):
    (problem,) = refusal(LENS, {"contact.indentation": "1 um"})
    assert problem.startswith(f"x:{line_of('[contact]')}: contact: ")
    assert problem.endswith("""; replace the whole table by --set 'contact={ indentation = "1 um" }'""")


def test_a_model_chosen_by_an_override_is_told_which_keys_are_in_its_way(refusal):
    assert refusal(LENS, {"shear.model": "uniform"}) == [
        "--set shear.model: shear holds keys that this model does not take (cell, points, spectrum, correlation);"
        """ replace the whole table by --set 'shear={ model = "uniform" }'"""
    ]


# --- files that are no scenarios ---


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "x: is empty; `sim new` writes a starter scenario"),
        ("# nothing but a question?\n", "x: is empty; `sim new` writes a starter scenario"),
        (b"\x00" * 40, "x:1: is not TOML: "),
        (b"PK\x03\x04\x14\x00", "x:1: is not TOML: "),
        (LENS.encode("utf-16"), "x:1: is not UTF-8 text; save the file as UTF-8"),
        (LENS.encode() + b"\n# caf\xe9\n", f"x:{END + 2}: is not UTF-8 text; save the file as UTF-8"),
        (
            LENS.replace("[drive]", "[drive"),
            "x:17: is not TOML: expected ']' at the end of a table declaration; close the",
        ),
        (
            LENS.replace('"4 mN"', "4 mN"),
            'after a statement; put a value with its unit in quotes, such as load = "4 mN"',
        ),
        (
            LENS.replace('"rate"', "rate"),
            'x:24: is not TOML: invalid value; put text in quotes, such as model = "rate"',
        ),
        (
            LENS.replace("seed = 7", "seed 7"),
            "x:2: is not TOML: expected '=' after a key in a key/value pair; write key =",
        ),
        (
            LENS + "[clock]\n",
            f"x:{END + 1}: is not TOML: cannot declare clock twice; the table is there twice, so merge",
        ),
        ("seed = 1\n" + LENS, "x:3: is not TOML: cannot overwrite a value; the key is there twice, so keep one"),
        (
            LENS.replace('"lens"', '"lens'),
            "x:1: is not TOML: illegal character '\\n'; close the quotes on the same line",
        ),
        (LENS + 'text = """never closed\n', "is not TOML: unterminated string; close its quotes"),
        ("a = [1, 2\n", "is not TOML: unclosed array; close its bracket ]"),
        ("a = 2024-02-31\n", "x:1: is not TOML: invalid date or datetime"),
        ("a = " + "[" * 10_000, "x:1: is nested too deeply; a scenario nests four deep at most"),
        ("a = " + "[" * 10_000 + "]" * 10_000, "x:1: is nested too deeply; a scenario nests four deep at most"),
        (
            "a = " + "{ b = " * 10_000 + "1" + " }" * 10_000,
            "x:1: is nested too deeply; a scenario nests four deep",
        ),
        ("a = 1\nb = [\n" + "[\n" * 10_000, "x:18: is nested too deeply; a scenario nests four deep at most"),
        ("a = " + "[" * 100 + "]" * 100, "x:1: a: is nested too deeply; a scenario nests four deep at most"),
        ("\n[" + "a." * 30 + "a]\n", "x:2: a.a.a.a: is nested too deeply; a scenario nests four deep at most"),
        ("[" + "a." * 10_000 + "a]\n", "x:1: has a key of 40 words or more; a scenario needs four at most"),
        ("x = 1\n\ny = " + "1" * 5000, "x:3: holds a number of thousands of digits; shorten it"),
        ("\ny = 0x" + "1" * 5000, "x:2: y: is a number of hundreds of digits; shorten it"),
        ("#" * 2**21, "x: is larger than 1 MiB; put long tables into CSV files and name those"),
    ],
)
def test_what_is_no_scenario_is_told_in_one_line(refusal, text, said):
    (problem,) = refusal(text)
    assert problem.startswith("x")
    assert said in problem


def test_a_missing_file_a_folder_and_a_broken_name_are_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, said in (
        ("nope.toml", "nope.toml: there is no such file; `sim new` writes a starter"),
        (".", ".: cannot be read (Is a directory); name a TOML file"),
        ("a\0b", "a\\x00b: cannot be read (embedded null byte); name a TOML file"),
        ("x" * 300, "cannot be read (File name too long); name a TOML file"),
    ):
        with pytest.raises(BadInput) as fault:
            load(name)
        (problem,) = fault.value.problems
        assert said in problem
    assert not os.listdir(tmp_path)


def test_a_path_without_end_is_read_no_further_than_a_scenario_can_be_long():
    with pytest.raises(BadInput, match="larger than 1 MiB"):
        load("/dev/zero")
