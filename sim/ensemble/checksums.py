"""Checksums of a finished dataset, in a file beside it: what has changed in it later is found and placed.

``OUT.nc.sha256`` is text: a first line by which it is known, ``command: ...`` (what makes the dataset again) and
``versions: ...``, the size of the dataset in bytes, the SHA-256 of each MiB of it, a line each, and at its end the
SHA-256 of the lines before. Both files are read as bytes: HDF5 itself may crash on a damaged file.
"""

import hashlib
import itertools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from sim.numerics.files import explained, read_whole
from sim.scenario.toml_text import toml
from sim.units.errors import BadInput

#: Manifest of the parts of a run that is not done.
MANIFEST = "manifest.json"

STRETCH = 2**20
_FIRST = "checksums of a dataset of sim, 1"
_LINES = re.compile(rf"{_FIRST}\ncommand: (.*)\nversions: (.*)\nbytes: (\d{{1,18}})\n((?:[0-9a-f]{{64}}\n)*)")
#: Of the checksums of a terabyte.
_MOST_BYTES = 2**27
_MOST_TEXT, _MOST_NAMED = 2**16, 20
_BY_PYTHON = "sim.run(scene, to=..., replace=True), with the scenario as Python has made it"


class Damaged(RuntimeError):
    """A dataset is not as its run has written it, or its checksums are not there."""

    exit_code = 1


class Checksums(NamedTuple):
    """Checksums of a dataset with what makes it again: a command, run by these versions."""

    command: str
    versions: str
    size: int
    stretches: list[str]


def path_of(dataset: Path) -> Path:
    """Where the checksums of a dataset stand."""
    return dataset.with_name(f"{dataset.name}.sha256")


def parts_of(dataset: Path) -> Path:
    """Folder of the parts of a run that is not done."""
    return dataset.with_name(f"{dataset.name}.parts")


def _command(source: dict[str, Any]) -> str:
    """The command that runs a scenario of this source, without its output; "" if no file and overrides describe it."""
    if not source.get("text"):
        return ""
    changes = (f"{key}={toml(value)}" for key, value in source["overrides"].items())
    words = ["sim", "run", source["path"], *(word for change in changes for word in ("--set", change))]
    return "".join(sign if sign.isprintable() else "?" for sign in shlex.join(words))[:_MOST_TEXT]


def content(dataset: Path, source: dict[str, Any], run: dict[str, Any]) -> bytes:
    """What stands in the file of a dataset's checksums; ``source`` and ``run`` as in the manifest of its parts."""
    versions = ", ".join(f"{name} {version}" for name, version in run.get("version", {}).items())
    head = [_FIRST, f"command: {_command(source)}", f"versions: {versions}", f"bytes: {dataset.stat().st_size}"]
    return _closed("\n".join([*head, *_digests(dataset), ""]).encode())


def _closed(lines: bytes) -> bytes:
    return lines + hashlib.sha256(lines).hexdigest().encode() + b"\n"


def _digests(dataset: Path) -> Iterator[str]:
    with open(dataset, "rb") as file:
        while stretch := file.read(STRETCH):
            yield hashlib.sha256(stretch).hexdigest()


def known(path: Path) -> bool:
    """Whether a file is one of checksums of ours, or there is none."""
    if not path.is_symlink() and not path.exists():
        return True
    if path.is_symlink() or not path.is_file():
        return False
    with explained(path), open(path, "rb") as file:
        return file.read(len(_FIRST) + 1) == f"{_FIRST}\n".encode()


def read(path: Path) -> Checksums | None:
    """The checksums that a file holds; None if it is damaged or none of ours."""
    with explained(path):
        raw = read_whole(path) if path.stat().st_size <= _MOST_BYTES else b""
    lines = raw[: -2 * hashlib.sha256().digest_size - 1]
    if raw != _closed(lines):
        return None
    found = _LINES.fullmatch(lines.decode("utf-8", "replace"))
    if not found or not (found[1] + found[2]).isprintable() or max(len(found[1]), len(found[2])) > _MOST_TEXT:
        return None
    return Checksums(found[1], found[2], int(found[3]), found[4].split())


def damaged(dataset: Path, wanted: Checksums) -> list[range]:
    """The bytes of a dataset among which some have changed, are lost or were added: whole stretches, joined."""
    ranges: list[range] = []
    with explained(dataset):
        longest = max(dataset.stat().st_size, wanted.size)
        for number, (was, now) in enumerate(itertools.zip_longest(wanted.stretches, _digests(dataset))):
            if was != now:
                start, stop = number * STRETCH, min((number + 1) * STRETCH, longest)
                start = ranges.pop().start if ranges and ranges[-1].stop == start else start
                ranges.append(range(start, stop))
    return ranges


def verify(dataset: Path) -> str:
    """Compare a dataset with its checksums; gives in words what was compared.

    Raises
    ------
    BadInput
        If there is no such file.
    Damaged
        If it differs, or its checksums are lost: with the damaged stretches and what makes it again.
    """
    beside, unfinished = path_of(dataset), parts_of(dataset) / MANIFEST
    cure = "the same command with --resume makes it whole" if unfinished.exists() else ""
    if not dataset.is_file():
        raise BadInput([f"{dataset}: {f'is of an unfinished run; {cure}' if cure else 'there is no such file'}"])
    found = read(beside) if beside.exists() else None
    if found is None:
        state = "is damaged or not of a run" if beside.exists() else "is lost"
        cure = cure or "the command that made both makes them again with --force"
        raise Damaged(f"{beside} {state}, so that {dataset} cannot be checked; {cure}")
    if not (ranges := damaged(dataset, found)):
        return f"{dataset}: all {found.size:,} bytes are as they were written"
    made_by = f"{found.command} --force -o {shlex.quote(str(dataset))}" if found.command else _BY_PYTHON
    lines = [f"{dataset}: bytes {one.start:,} to {one.stop - 1:,} are damaged" for one in ranges[:_MOST_NAMED]]
    if len(ranges) > _MOST_NAMED:
        lines.append(f"and {len(ranges) - _MOST_NAMED:,} stretches more")
    cure = cure or f"to make it again, byte for byte, with {found.versions}:\n{made_by}"
    raise Damaged("\n".join([*lines, cure]))
