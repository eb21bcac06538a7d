"""The house: folders are floors, and a module imports only from floors below its own."""

import ast
from pathlib import Path

import pytest

import sim

ROOT = Path(sim.__file__).parent

#: The folders and the two modules beside them, lowest first.
FLOORS = ("units", "numerics", "laws", "spectrum", "parts", "scenario", "engine", "ensemble")
FLOORS += ("analysis", "plots", "study", "cli", "__main__")
#: What a floor must not read although it stands below.
FORBIDDEN = {
    "analysis": {"parts", "scenario", "engine", "ensemble"},
    "plots": {"engine", "ensemble"},
}


def module_name(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def is_module(name):
    path = ROOT.joinpath(*name.split(".")[1:])
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


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


def test_nothing_imports_in_a_circle():
    graph = {name: imported(path) & set(MODULES) for name, path in MODULES.items()}
    done: set[str] = set()

    def visit(name, trail):
        assert name not in trail, " -> ".join([*trail, name])
        if name not in done:
            for other in graph[name]:
                visit(other, [*trail, name])
            done.add(name)

    for name in graph:
        visit(name, [])


def test_public_names_are_all_there():
    for name in sim.__all__:
        assert getattr(sim, name) is not None
