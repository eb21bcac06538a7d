"""The house: a module imports only from floors below its own."""

import ast
from pathlib import Path

import pytest

import sim

ROOT = Path(sim.__file__).parent

#: Every module, lowest floor first.
FLOORS = (
    ("jit", "quantity", "motion", "traction", "durable", "lines", "grid", "radial", "pixels"),
    ("noise", "roots", "table", "sweep", "faults", "expint", "hazards", "footprint", "binomial", "widest"),
    ("laws.schallamach.linear", "laws.schallamach.renewal"),
    tuple(f"laws.schallamach.{name}" for name in ("bell", "loading", "cut_off", "first_moment", "cluster")),
    ("laws.halfspace", "laws.schallamach", "laws.jkr.scales"),
    ("laws.jkr.hertz", "laws.jkr.load", "laws.jkr.indentation", "laws.jkr.energy"),
    ("laws.jkr.machine",),
    ("laws.jkr.travel",),
    ("laws.jkr",),
    ("laws.rivals", "laws.profiles", "laws.disc"),
    ("laws", "bodies", "modes", "memory", "measured", "document"),
    ("spectrum", "bands"),
    ("disc", "grips"),
    ("margin",),
    ("cohort_merging", "cohort_steady", "following", "front"),
    ("cohort_steps", "lives"),
    ("cohorts", "tracks", "first_moment"),
    ("processes",),
    ("site_field",),
    ("parts.area", "parts.control"),
    ("parts.unstretched",),
    ("parts.stretched",),
    ("parts.drive", "parts.bonds", "parts.shear", "parts.contact", "parts"),
    ("scenario",),
    ("engine", "reader"),
    ("gauges",),
    ("store",),
    ("ensemble",),
    ("preview",),
    ("cli",),
    ("__main__",),
)
WING = ("settings", "wording", "observables", "correlation", "energies", "events", "members", "rows")
WING += ("analysis", "paper", "pictures", "curves", "panels", "field_figures", "bond_laws", "friction_figures")
WING += ("start_figure", "rival_figures", "profile_figures", "loop_figure", "plots")
#: The study of speed against error: it runs scenes, so it stands on the engine, beside the commands.
STUDY = ("gammasum", "estimates", "expected", "moments", "alternatives")
STUDY += ("converge_data", "converge_table", "converge_bonds_march", "converge_bonds", "converge_bonds_table")
STUDY += ("converge_figure", "converge")
#: What the wing may read: laws and the spectra with what they stand on, never parts or engine.
WING_READS = {name for floor in FLOORS[: FLOORS.index(("margin",)) + 1] for name in floor}


def module_name(path):
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


def imported(path):
    """Names of our own modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "sim"}
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "sim":
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {name if is_module(name) else node.module for name in inner}
    return {name.removeprefix("sim").lstrip(".") for name in found}


def is_module(name):
    path = ROOT.joinpath(*name.split(".")[1:])
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


MODULES = {module_name(path): path for path in sorted(ROOT.rglob("*.py")) if path != ROOT / "__init__.py"}


def test_every_module_has_a_floor():
    placed = {name for floor in FLOORS for name in floor} | set(WING) | set(STUDY)
    assert placed == set(MODULES)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_imports_only_from_floors_below_its_own(name):
    height = {module: level for level, floor in enumerate(FLOORS) for module in floor}
    for other in imported(MODULES[name]):
        assert other, f"{name} imports the package root"
        if name in WING:
            assert other in WING_READS or other in WING, f"{name} of the wing imports {other}"
        elif name in STUDY:
            below = other in WING or height.get(other, len(FLOORS)) <= height["gauges"]
            assert below or (other in STUDY and STUDY.index(other) < STUDY.index(name)), f"{name} imports {other}"
        elif name == "cli":
            assert other in WING + STUDY or height[other] < height[name]
        else:
            assert height[other] < height[name], f"{name} imports {other}, which is not below it"


def test_public_names_are_all_there():
    for name in sim.__all__:
        assert getattr(sim, name) is not None
