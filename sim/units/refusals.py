"""Bad input, and the names of version 0.1.0 with those that took their place."""

import re
from collections.abc import Iterable

#: Old names of keys, models, words, dataset variables, dimensions and kinds of figure.
RENAMED = {
    "healing": "rebinding_rate", "hazard": "rupture", "memory": "correlation", "growth": "amplitude",
    "amplitudes": "mode_amplitudes", "on_detach": "after_pull_off", "travel": "displacement", "trips": "cycles",
    "lagging": "rate_dependent", "convention": "normalization", "menga": "in_integral", "persson": "in_density",
    "realization": "member", "snapshot": "map_time", "rivals": "theories",
}  # fmt: skip
#: Variables and dimensions that only a dataset of version 0.1.0 has.
_OLD_VARIABLES = {"travel", "travel_mean", "realization", "map_realization", "snapshot"}
_OLD = re.compile(rf"(?<![A-Za-z])({'|'.join(RENAMED)})(?![A-Za-z])")


class BadInput(ValueError):
    """Input that cannot be used; ``problems`` holds one line for each fault."""

    exit_code = 2

    def __init__(self, problems: list[str]):
        super().__init__("\n".join(problems))
        self.problems = problems


def renamed(name: str) -> str | None:
    """The present name of what version 0.1.0 called so; None for a name that it did not have or that stays.

    >>> renamed("travel_mean"), renamed("memory"), renamed("contact_load")
    ('displacement_mean', 'correlation', None)
    """
    now = _OLD.sub(lambda word: RENAMED[word[0]], name)
    return now if now != name else None


def refuse_old(path: object, names: Iterable[object]) -> None:
    """Refuse a dataset with variables or dimensions (``names``) of version 0.1.0.

    Raises
    ------
    BadInput
        With one sentence.
    """
    if _OLD_VARIABLES.intersection(map(str, names)):
        raise BadInput([f"{path}: was written by version 0.1.0, whose names have changed; run its scenario again"])
