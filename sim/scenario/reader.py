"""From a TOML file or a dictionary to a scenario. Each fault is reported with its place and one cure."""

import copy
import os
import re
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from sim.scenario.files import Files, Source, parse, read_text
from sim.scenario.messages import Fault, faults, problems
from sim.scenario.scenario import Scenario
from sim.scenario.schema import with_models
from sim.scenario.sweep import set_key
from sim.units.errors import BadInput

__all__ = ["BadInput", "load"]

_SCENARIO = TypeAdapter(Scenario)


def load(
    scenario: str | os.PathLike[str] | dict[str, Any], overrides: dict[str, Any] | None = None, *, option: str = ""
) -> Scenario:
    """Read a scenario from a TOML file or a dictionary of the same tables and keys.

    Parameters
    ----------
    scenario : path or dict
        The file, or ``{"clock": {"duration": "1 s", ...}, ...}``.
    overrides : dict, optional
        Values by dotted key that replace those of the scenario, ``{"contact.load": "2 mN"}``.
    option : str
        The option of a command that gave the overrides, for messages; without it they are an argument.

    Returns
    -------
    Scenario
        The scenario; every point of its sweep is checked.

    Raises
    ------
    BadInput
        With one syntax fault, or all faults of the values, or, if there are none, all faults of the sweep.
    """
    overrides = dict(overrides or {})
    if isinstance(scenario, dict):
        file, text, folder, document = "", "", Path(), copy.deepcopy(scenario)
    else:
        file, text, folder = str(scenario), read_text(Path(scenario)), Path(scenario).parent
        document = parse(text, file)
    words = {_words(key): value for key, value in overrides.items()}
    for path, value in words.items():
        set_key(document, path, value)
    wrong = [Fault(("source",), "is not a key")] if "source" in document else []
    files = Files(folder)
    document = with_models(Scenario, document) | {"source": Source(file, text, overrides, files.texts)}
    try:
        scene = _SCENARIO.validate_python(document, context={"files": files}, by_alias=True, by_name=False)
    except ValidationError as invalid:
        wrong += faults(Scenario, invalid)
    if wrong:
        raise BadInput(problems(wrong, file, words, option))
    try:
        scene.points()
    except BadInput as fault:
        swept = (Fault(("sweep",), problem) for problem in fault.problems)
        raise BadInput(problems(swept, file, words, option)) from None
    return scene


def _words(key: str) -> tuple[str, ...]:
    """Return the words of a dotted key, some of which may be quoted."""
    return tuple(word.strip(' "') for word in re.findall(r'"[^"]*"|[^."]+', key)) or (key,)
