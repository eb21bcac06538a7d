"""Writes docs/api.md, the public functions and classes, from their signatures and docstrings."""

import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import sim
from sim.spectrum.family import Family
from sim.study.fit import Estimate, Fit

TARGET = Path(__file__).with_name("api.md")
HEAD = """# Public functions and classes

Made by `python docs/make_api.py` from the code. Numbers are in SI units, arrays broadcast. The column *unit* is that of
the result; `help(sim.laws.jkr.radius_at_load)` and its like give arguments, formula, source and an example.
"""
MODULES = (
    *(f"sim.laws.{name}" for name in ("halfspace", "jkr", "reversible", "schallamach", "theories")),
    "sim.spectrum",
    "sim.analysis",
    "sim.plots",
    "sim.report",
)
#: Numbers that a fit computes of its fields.
_OF_FIT = ("values", "p_value", "aicc")
_RETURNS = re.compile(r"^(?:Returns|Yields)\n-+\n(.*?)(?=^\S[^\n]*\n-{3,}|\Z)", re.S | re.M)
_UNIT = re.compile(r"\[((?:1/)?[A-Za-zµ1][\w µ^/²³().½-]*)\]")


def text() -> str:
    """The page."""
    lines = [HEAD, *_section("sim", sim, _public(sim))]
    for name in MODULES:
        module = importlib.import_module(name)
        lines += _section(name, module, _public(module))
        if name == "sim.plots":
            lines += ["\n### Figures\n", "Any takes `where`, `member` and `units`.\n"]
            lines += ["| kind | shows | takes |", "| --- | --- | --- |"]
            lines += [f"| `{k}` | {one.shows} | {', '.join(one.takes)} |" for k, one in sim.plots.KINDS.items()]
    lines += ["\n## The result of sim.fit\n", "`print` shows the numbers, the chi^2 and p.\n"]
    lines += ["| name | unit | meaning |", "| --- | --- | --- |"]
    for fields, prefix in ((Fit, ""), (Estimate, "numbers[i].")):
        for names, meaning in re.findall(r"^(\w[\w, ]*) : .*\n    (.+)", inspect.getdoc(fields) or "", re.M):
            lines.append(f"| {', '.join(f'`{prefix}{name}`' for name in names.split(', '))} | | {meaning} |")
    lines += [f"| `{name}` | {units(vars(Fit)[name])} | {_meaning(vars(Fit)[name])} |" for name in _OF_FIT]
    lines += [
        "\n## A spectrum\n",
        "What each family of `sim.spectrum` has.\n",
        "| name | unit | meaning |",
        "| --- | --- | --- |",
    ]
    for text, name in re.findall(r"#: (.+)\n    (\w+): ClassVar", inspect.getsource(Family)):
        unit = re.search(r"\[(\S+?)\]", text)
        lines.append(f"| `{name}` | {unit[1] if unit else ''} | {text} |")
    for name, member in vars(Family).items():
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
            called = f"{name}{_signature(member)}" if inspect.isfunction(member) else name
            lines.append(f"| `{called}` | {units(member)} | {_meaning(member)} |")
    return "\n".join(lines) + "\n"


def _section(title: str, module: ModuleType, public: Iterator[tuple[str, Any]]) -> list[str]:
    rows = [f"| `{name}{_signature(thing)}` | {units(thing)} | {_meaning(thing)} |" for name, thing in public]
    return [f"\n## {title}\n", f"{_meaning(module)}\n", "| name | unit | meaning |", "| --- | --- | --- |", *rows]


def _public(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Public functions and classes: those of ``__all__``, or else those that the module or its folder defines."""
    for name in getattr(module, "__all__", sorted(vars(module))):
        thing = getattr(module, name)
        own = hasattr(module, "__all__") or f"{getattr(thing, '__module__', '')}.".startswith(f"{module.__name__}.")
        if own and not name.startswith("_") and (inspect.isfunction(thing) or inspect.isclass(thing)):
            yield name, thing


def _signature(thing: Any) -> str:
    """Names and defaults of the arguments, without annotations."""
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return ""
    parameters = [p.replace(annotation=p.empty) for p in inspect.signature(thing).parameters.values()]
    shown = [
        re.sub(r"<factory>|<.* object at .*>", "...", str(p)) for p in parameters if p.name not in ("self", "model")
    ]
    return f"({', '.join(shown)})"


def _meaning(thing: Any) -> str:
    """First line of the docstring."""
    return (inspect.getdoc(thing) or "").split("\n")[0].replace("|", "\\|")


def units(thing: Any) -> str:
    """Units of the result: those of the docstring's section Returns, or else of its first line."""
    if inspect.isclass(thing):
        return ""
    doc = inspect.getdoc(thing) or ""
    section = _RETURNS.search(doc)
    found = _UNIT.findall(section.group(1)) if section else []
    return ", ".join(dict.fromkeys(found or _UNIT.findall(doc.split("\n")[0])))


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
