"""JSON schema of scenario files, and a starter."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from sim.numerics.files import OutputExists
from sim.parts.contact import Equilibrium
from sim.scenario.declared import all_tables, keys, model
from sim.scenario.scenario import Scenario


def write_starter(name: Path) -> Path:
    """Write a commented starter scenario where no file is; its path."""
    target = name if name.suffix else name.with_suffix(".toml")
    text = files("sim").joinpath("starter.toml").read_text(encoding="utf-8")
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise OutputExists(f"{target} exists; name another file") from None
    return target


def as_text() -> str:
    """The JSON schema as text."""
    return json.dumps(scenario_schema(), indent=2)


def scenario_schema() -> dict[str, Any]:
    """The JSON schema of a scenario file."""
    schema = TypeAdapter(Scenario).json_schema(by_alias=True, mode="validation")
    for table in schema["$defs"].values():
        if "file" in table["properties"] and "file" not in table.get("required", ()):
            table["anyOf"] = [{"required": ["file"]}, {"required": table.pop("required")}]
    simplest = [field.default_factory or Equilibrium for _, field in all_tables(Scenario)]
    optional = [(model(table), keys(table).keys()) for table in simplest if isinstance(table, type)]
    for name in _in_unions(schema):  # there the model tells the tables apart; only the simplest may leave it out
        table = schema["$defs"][name]
        own = table["properties"].get("model", {}).get("const")
        if own is not None and (own, table["properties"].keys()) not in optional:
            table["required"] = ["model", *table.get("required", ())]
    schema["properties"].pop("source", None)
    schema["properties"]["sweep"] = {
        "description": "keys with lists of values (outer product), or a list of tables (zipped)",
        "anyOf": [{"type": "object"}, {"type": "array", "items": {"type": "object"}}],
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "sim scenario"}


def _in_unions(node: Any) -> set[str]:
    """Names of the tables that a schema tells apart by their model."""
    if isinstance(node, list):
        return set().union(*map(_in_unions, node))
    if not isinstance(node, dict):
        return set()
    found = set().union(*map(_in_unions, node.values()))
    options = [option["$ref"] for option in node.get("oneOf", ()) if "$ref" in option]
    return found | {reference.rsplit("/", 1)[-1] for reference in options}
