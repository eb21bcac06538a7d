"""Values of the options of commands."""

import contextlib
import math
from typing import Any

import click


def quantity(text: str | None, option: str, unit: str, **bounds: Any) -> float:
    """The value of an option with a unit, in SI; infinite for one that is not given."""
    if text is None:
        return math.inf
    from sim.units.quantity import Quantity
    from sim.units.refusals import BadInput

    value: str | float = text
    with contextlib.suppress(ValueError):
        value = float(text)
    try:
        return Quantity(unit, option, **bounds).read(value)
    except ValueError as fault:
        raise BadInput([f"{option} {text}: {fault}"]) from None


def values(pairs: tuple[str, ...], option: str) -> dict[str, Any]:
    """The values that an option gives to keys, each read as TOML, else taken as a string."""
    import tomllib

    found: dict[str, Any] = {}
    for pair in pairs:
        key, sign, text = pair.partition("=")
        if not sign or not key.strip():
            raise click.UsageError(f'{option} takes TABLE.KEY=VALUE, such as contact.load="2 mN", not {pair!r}')
        try:
            document = tomllib.loads(f"value = {text}")
        except (ValueError, RecursionError):
            document = {}
        found[key.strip()] = document["value"] if len(document) == 1 else text.strip()
    return found


def overrides(changes: tuple[str, ...], seed: int | None = None, members: int | None = None) -> dict[str, Any]:
    """The values of --set, --seed and --members."""
    given = {"seed": seed, "ensemble.members": members}
    return values(changes, "--set") | {key: value for key, value in given.items() if value is not None}
