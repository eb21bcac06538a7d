"""The house: folders are floors, and a module imports only from floors below its own."""

import ast
import functools
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import sim
from benchmarks.lines import MOST, code_lines

ROOT = Path(sim.__file__).parent
#: What is no part of the package but of the tree, by the name under which its modules import each other.
BESIDE = {path.stem: path for path in sorted((ROOT.parent / "docs").glob("*.py"))}
BESIDE |= {f"benchmarks.{path.stem}": path for path in sorted((ROOT.parent / "benchmarks").glob("*.py"))}
BESIDE |= {f"helpers.{path.stem}": path for path in sorted((ROOT.parent / "tests" / "helpers").glob("*.py"))}

#: The folders and the two modules beside them, lowest first.
FLOORS = ("units", "numerics", "laws", "spectrum", "parts", "scenario", "engine", "ensemble")
FLOORS += ("analysis", "plots", "report", "study", "cli", "__main__")
#: What a floor must not read although it stands below.
FORBIDDEN = {"analysis": {"parts", "scenario", "engine", "ensemble"}, "plots": {"engine", "ensemble"}}
FORBIDDEN |= {"report": {"ensemble"}}


def module_name(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def is_module(name):
    path = ROOT.joinpath(*name.split(".")[1:])
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


@functools.cache
def imports(path):
    """Names of modules, and of what is taken from them, that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if is_module(name) or name in BESIDE else node.module for name in inner}
    return found


def imported(path):
    """Names of the package's modules that a file imports, wherever in it."""
    return {name.removeprefix("sim").lstrip(".") for name in imports(path) if name.split(".")[0] == "sim"}


MODULES = {module_name(path): path for path in sorted(ROOT.rglob("*.py")) if path != ROOT / "__init__.py"}


def floor(name):
    return name.split(".")[0]


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_imports_only_from_floors_below_its_own(name):
    for other in imported(MODULES[name]):
        assert other, f"{name} imports the package root"
        if floor(other) == floor(name):
            continue
        assert FLOORS.index(floor(other)) < FLOORS.index(floor(name)), f"{name} imports {other}, which is not below it"
        assert floor(other) not in FORBIDDEN.get(floor(name), ()), f"{name} imports {other}"


def test_every_module_stands_on_a_floor():
    assert {floor(name) for name in MODULES} == set(FLOORS)
    assert {path.name for path in ROOT.iterdir() if path.is_file()} == {
        "__init__.py",
        "__main__.py",
        "cli.py",
        "engine.py",
        "starter.toml",
    }


@pytest.mark.parametrize("name", sorted(name for name in MODULES if name.count(".") > 1 and floor(name) == "parts"))
def test_a_part_reads_no_other_part(name):
    part = name.split(".")[1]
    for other in imported(MODULES[name]):
        if floor(other) == "parts":
            assert other == "parts.exchange" or other.split(".")[1] == part, f"{name} imports {other}"


#: Words by which parts go outside their folder.
PARTS = {"drive", "bonds", "shear", "contact", "population", "fluctuations", "process", "part"}
OUTSIDE = sorted(name for name in MODULES if floor(name) != "parts" and name != "scenario.reader")


def asks_a_class(call, taken):
    """Whether a call asks a part for its class: isinstance of a class taken from parts, or a test for an attribute."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    if name == "isinstance":
        return bool(taken & {node.id for node in ast.walk(call.args[1]) if isinstance(node, ast.Name)})
    tested = name == "hasattr" or (name == "getattr" and len(call.args) == 3)
    return tested and bool(PARTS & set(ast.unparse(call.args[0]).replace("(", ".").replace(",", ".").split(".")))


@pytest.mark.parametrize("name", OUTSIDE)
def test_outside_its_folder_no_part_is_asked_for_its_class(name):
    tree = ast.parse(MODULES[name].read_text())
    froms = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module)
    named = (alias for node in froms if node.module.startswith("sim.parts") for alias in node.names)
    taken = {alias.asname or alias.name for alias in named}
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    assert not [f"line {call.lineno}: {ast.unparse(call)}" for call in calls if asks_a_class(call, taken)]


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_is_read_in_one_sitting(name):
    text = MODULES[name].read_text()
    assert text.count("\n") <= MOST or code_lines(text) <= MOST


def test_nothing_imports_in_a_circle_benchmarks_and_tests_included():
    graph = {f"sim.{name}": path for name, path in MODULES.items()} | BESIDE
    # raises a CycleError that names the circle
    assert tuple(TopologicalSorter({name: imports(path) for name, path in graph.items()}).static_order())


def test_public_names_are_all_there():
    for name in sim.__all__:
        assert getattr(sim, name) is not None
