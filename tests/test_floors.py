"""The house: folders are floors, and a module imports only from floors below its own."""

import ast
import functools
from graphlib import TopologicalSorter
from pathlib import Path

import sim

ROOT = Path(sim.__file__).parent
#: Modules of the tree outside of the package, by the name under which they import each other.
BESIDE = {path.stem: path for path in sorted((ROOT.parent / "docs").glob("*.py"))}
BESIDE |= {
    f"benchmarks.{path.stem}": path
    for path in sorted((ROOT.parent / "benchmarks").glob("*.py"))
}
BESIDE |= {
    f"helpers.{path.stem}": path
    for path in sorted((ROOT.parent / "tests" / "helpers").glob("*.py"))
}

#: The folders and the modules beside them, lowest first.
FLOORS = (
    "units",
    "numerics",
    "quantities",
    "laws",
    "spectrum",
    "solid",
    "parts",
    "step",
    "scenario",
    "ensemble",
)
FLOORS += ("read", "plots", "reports", "study", "explorer", "cli", "__main__")
#: Floors that a floor must not import although they are below it.
FORBIDDEN = {
    "read": {"parts", "step", "scenario", "ensemble"},
    "plots": {"step", "ensemble"},
}
FORBIDDEN |= {"reports": {"ensemble"}}
#: Speeds in steady sliding beside those of a course are of the models of a stored scenario.
ALLOWED = {
    ("read.over_speed", f"ensemble.{name}") for name in ("dataset", "steady_speed")
}
#: A report shows the remarks of ``sim check``, a figure the boundary of steady sliding, of a stored scenario.
ALLOWED |= {
    ("read.errors", f"ensemble.{name}") for name in ("dataset", "diagnosis", "plan")
}
ALLOWED |= {("plots.slider", f"ensemble.{name}") for name in ("dataset", "diagnosis")}
#: Names that hold a part outside of ``parts``.
PARTS = {
    "drive",
    "bonds",
    "shear",
    "contact",
    "population",
    "fluctuations",
    "process",
    "part",
}


def module_name(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(
        ".__init__"
    )


MODULES = {
    module_name(path): path
    for path in sorted(ROOT.rglob("*.py"))
    if path != ROOT / "__init__.py"
}


@functools.cache
def tree(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path):
    """Names of modules, and of what is taken from them, that a file imports anywhere."""
    names = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {
                name
                if name.removeprefix("sim.") in MODULES or name in BESIDE
                else node.module
                for name in inner
            }
    return names


def imported(name):
    """Names of the package's modules that a module imports anywhere."""
    return {
        other.removeprefix("sim").lstrip(".")
        for other in imports(MODULES[name])
        if other.split(".")[0] == "sim"
    }


def floor(name):
    return name.split(".")[0]


def test_a_module_imports_only_from_floors_below_its_own():
    for name in MODULES:
        for other in imported(name):
            assert other, f"{name} imports the package root"
            if floor(other) != floor(name):
                assert FLOORS.index(floor(other)) < FLOORS.index(floor(name)), (
                    f"{name} imports {other} above it"
                )
                is_allowed = (name, other) in ALLOWED or floor(
                    other
                ) not in FORBIDDEN.get(floor(name), ())
                assert is_allowed, f"{name} imports {other}"


def test_a_part_imports_no_other_part_except_the_coupled_solution():
    for name in MODULES:
        part = name.split(".")[1] if name.startswith("parts.") else "coupled"
        for other in imported(name) if part != "coupled" else ():
            if floor(other) == "parts":
                assert other == "parts.exchange" or other.split(".")[1] == part, (
                    f"{name} imports {other}"
                )


def asks_a_class(call, taken):
    """True if a call asks a part for its class: isinstance of a class taken from parts, or a test for an attribute."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    if name == "isinstance":
        return bool(
            taken
            & {node.id for node in ast.walk(call.args[1]) if isinstance(node, ast.Name)}
        )
    tested = name == "hasattr" or (name == "getattr" and len(call.args) == 3)
    return tested and bool(
        PARTS
        & set(ast.unparse(call.args[0]).replace("(", ".").replace(",", ".").split("."))
    )


def test_outside_its_folder_no_part_is_asked_for_its_class():
    for name in MODULES:
        if floor(name) != "parts" and name != "scenario.reader":
            nodes = list(ast.walk(tree(MODULES[name])))
            froms = (
                node
                for node in nodes
                if isinstance(node, ast.ImportFrom) and node.module
            )
            aliases = (
                alias
                for node in froms
                if node.module.startswith("sim.parts")
                for alias in node.names
            )
            taken = {alias.asname or alias.name for alias in aliases}
            calls = [
                node
                for node in nodes
                if isinstance(node, ast.Call) and asks_a_class(node, taken)
            ]
            assert not calls, [
                f"{name}, line {call.lineno}: {ast.unparse(call)}" for call in calls
            ]


def test_no_module_hands_open_files_to_another_process():
    # ruff forbids the other names that only some systems have
    for path in MODULES.values():
        keywords = {
            node.arg for node in ast.walk(tree(path)) if isinstance(node, ast.keyword)
        }
        assert "pass_fds" not in keywords, path


def test_nothing_imports_in_a_circle_benchmarks_and_tests_included():
    graph = {f"sim.{name}": path for name, path in MODULES.items()} | BESIDE
    # raises a CycleError that names the circle
    assert tuple(
        TopologicalSorter(
            {name: imports(path) for name, path in graph.items()}
        ).static_order()
    )


def names(node, context):
    return {
        part.id
        for part in ast.walk(node)
        if isinstance(part, ast.Name) and isinstance(part.ctx, context)
    }


def comprehensions(node):
    """The comprehensions of a function that are in no other one."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ListComp | ast.SetComp | ast.DictComp):
            yield child
        else:
            yield from comprehensions(child)


def test_a_variable_of_a_comprehension_is_no_function_that_another_one_calls():
    # CPython 3.12.1 takes such a function for a local variable without a value
    for path in (*MODULES.values(), *BESIDE.values()):
        functions = {
            node.name for node in tree(path).body if isinstance(node, ast.FunctionDef)
        }
        for node in tree(path).body:
            variables, reads = set(), set()
            for inner in comprehensions(node):
                variables |= names(inner, ast.Store)
                reads |= names(inner, ast.Load) - names(inner, ast.Store)
            assert not functions & variables & reads, f"{path.name}, line {node.lineno}"
