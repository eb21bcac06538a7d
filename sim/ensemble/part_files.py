"""The folder of a run that is not done: its manifest, its lock and its parts, which are written once and never changed.

``OUT.nc.parts`` holds ``manifest.json``, which says what is run, by which versions and in which blocks, and one part
for each block that was computed. A part is built in memory, written beside its place, synced and renamed, and begins
with the SHA-256 of the rest, so that it is either whole or not there. A folder without a manifest of ours is not
touched, nor is any file in it that a run did not make; links are not followed.
"""

import contextlib
import hashlib
import json
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.ensemble import checksums
from sim.numerics.disk_cache import digest
from sim.numerics.files import OutputExists, StoreTrouble, by_hdf5, explained, locked, read_whole, sync, write_whole
from sim.units.errors import BadInput

Arrays = dict[str, np.ndarray]
Manifest = dict[str, Any]

#: Number of a shard, from 1, and how many there are.
Shard = tuple[int, int]
WHOLE: Shard = (1, 1)

DATASET = "dataset.nc"
_SUMS = "dataset.nc.sha256"
_MANIFEST, _LOCK, _STATE = checksums.MANIFEST, "lock", "state."
_LOCKS = {_LOCK, "lease"}
#: Name of the folder of a shard, inside that of its run.
_SHARD, _NUMBERS = (re.compile(rf"([1-9][0-9]{{0,5}}){sign}([1-9][0-9]{{0,5}})") for sign in ("-of-", "/"))
#: Names of the files that a run makes in its folder, whole or on the way.
_OURS = re.compile(
    r"manifest\.json|lock|lease(\.\d+)?|dataset\.nc(\.sha256)?|point\d+-group\d+-block\d+\.part|\..*\.tmp"
)
_DIGEST = hashlib.sha256().digest_size
_FORMAT = "parts of a run of sim, 2"
_MOST_NAMED, _LONGEST = 5, 40
#: Tables and lists inside each other in a manifest.
_DEEPEST = 40


def shard_of(text: str) -> Shard:
    """Number of a shard and how many there are, of "I/N"."""
    found = _NUMBERS.fullmatch(text)
    if not found or int(found[1]) > int(found[2]):
        raise BadInput([f"--shard takes I/N with I from 1 to N, such as 3/64, not {text[:_LONGEST]}"])
    return int(found[1]), int(found[2])


class OutputBusy(RuntimeError):
    """Another run is writing this output."""

    exit_code = 75


class Stopped(RuntimeError):
    """The run was to stop; what is computed is kept."""

    exit_code = 75


class MemoryParts(dict[str, Arrays]):
    """Parts kept in memory, without the states that only a run which goes on needs."""

    def save(self, name: str, arrays: Arrays, state: Arrays) -> None:
        self[name] = arrays

    def load(self, name: str) -> Arrays:
        return self[name]

    def state(self, name: str) -> Arrays:
        raise KeyError(f"{name} was kept without its state")


@dataclass(frozen=True)
class PartFiles:
    """Parts kept as files of a folder."""

    folder: Path

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.part"

    def __contains__(self, name: str) -> bool:
        return self.path(name).exists()

    def save(self, name: str, arrays: Arrays, state: Arrays) -> None:
        """Keep what a block recorded, and the state at its end: SHA-256, a line of what follows, the numbers."""
        named = {**arrays, **{f"{_STATE}{key}": values for key, values in state.items()}}
        kept = {key: np.asarray(values, order="C") for key, values in named.items()}
        line = json.dumps({key: (values.dtype.str, values.shape) for key, values in kept.items()}).encode()
        line += b" " * (-(_DIGEST + len(line) + 1) % 16) + b"\n"  # numbers begin where the processor likes them to
        pieces: list[bytes | memoryview] = [line, *(values.reshape(-1).view(np.uint8).data for values in kept.values())]
        found = hashlib.sha256()
        for piece in pieces:
            found.update(piece)
        with explained(self.folder):
            write_whole(self.path(name), found.digest(), *pieces)

    def sound(self, name: str) -> bool:
        """Whether a part is there and undamaged."""
        with explained(self.folder):
            return name in self and _sound(read_whole(self.path(name)))

    def load(self, name: str) -> Arrays:
        """What a block recorded."""
        return {key: values for key, values in self._read(name) if not key.startswith(_STATE)}

    def state(self, name: str) -> Arrays:
        """The state at the end of a block."""
        return {key.removeprefix(_STATE): values.copy() for key, values in self._read(name) if key.startswith(_STATE)}

    def _read(self, name: str) -> Iterator[tuple[str, np.ndarray]]:
        with explained(self.folder):
            content = read_whole(self.path(name))
        try:
            found = _arrays(content) if _sound(content) else None
        except (ValueError, TypeError, AttributeError, RecursionError):
            found = None  # of others: a sum that fits, of what no run has written
        if found is None:
            raise StoreTrouble(f"{self.path(name)} is damaged; go on with --resume, which computes it anew")
        yield from found.items()

    def publish(self, target: Path, write: Callable[[Path], None]) -> None:
        """Make the output and its checksums beside the parts, sync them, and rename them into place.

        The run is done when its manifest is removed: one that was killed between the two renames goes on.
        """
        beside, sums, manifest = self.folder / DATASET, self.folder / _SUMS, manifest_of(self.folder)
        with explained(self.folder):
            with by_hdf5(beside):
                write(beside)
            sync(beside)
            write_whole(sums, checksums.content(beside, manifest["source"], manifest["run"]))
        _refuse_foreign(target)
        if not manifest["replace"]:
            _link(beside, target)
        with explained(self.folder):
            os.replace(beside, target)  # which leaves two names of one file as they are
            os.replace(sums, checksums.path_of(target))
        with contextlib.suppress(OSError):  # the output is there
            sync(target.parent)

    def begin(
        self, target: Path, wanted: Manifest, source: Manifest, resume: bool, replace: bool,
        read: Callable[[Path], Manifest],
    ) -> bool:  # fmt: skip
        """Take up a run or begin one, where that is what was asked for; gives whether the output is there already.

        ============  ===========================================  ===========  =======
        there is      ``resume``                                   ``replace``  neither
        ============  ===========================================  ===========  =======
        nothing       begins                                       begins       begins
        an output     True if of this run, else refused            begins       refused
        parts         goes on if they are of this run, else        begins anew  refused
                      refused
        both          goes on as with parts, where these were      begins anew  refused
                      begun to replace the output or it is theirs
        ============  ===========================================  ===========  =======
        """
        _refuse_foreign(target)
        folder, older, there = self.folder, manifest_of(self.folder), target.exists()
        run = read(target) if resume and there else {}
        manifest = {"format": _FORMAT, "replace": there, "run": wanted, "source": source, "code": digest().hex()}
        if resume and run == wanted and not older:
            return True
        if resume and older:
            refuse_other(folder, older, manifest)
        elif resume and there:
            refuse_other(target, {"run": run}, {"run": wanted})
        if older and not (resume or replace):
            raise OutputExists(f"{folder} holds an unfinished run; go on with --resume, or begin anew with --force")
        if there and run != wanted and not (replace or older.get("replace")):
            raise OutputExists(f"{target} exists; replace it with --force or name another output")
        self.clean(keep=resume and bool(older))
        with explained(folder):
            write_whole(folder / _MANIFEST, json.dumps(manifest, sort_keys=True, default=str).encode())
        return False

    def adopt(self, shards: Iterable["PartFiles"], replace: bool) -> None:
        """Take over the parts of all shards of a run, which is then like one that was stopped."""
        with explained(self.folder):
            for shard in shards:
                manifest = manifest_of(shard.folder) | {"replace": replace}
                write_whole(self.folder / _MANIFEST, json.dumps(manifest, sort_keys=True).encode())
                for path in shard.folder.iterdir():
                    if _OURS.fullmatch(path.name) and path.suffix == ".part":
                        os.replace(path, self.folder / path.name)
                sync(self.folder)
                shard.clean(keep=False)
                _unlock(shard.folder)
                with contextlib.suppress(OSError):  # with files of others
                    shard.folder.rmdir()

    def clean(self, keep: bool) -> None:
        """Remove what a run made here but its lock; of a run that goes on only what is damaged or half made.

        The manifest goes first: parts without one are none.
        """
        with explained(self.folder):
            for path in sorted(self.folder.iterdir(), key=lambda path: path.name != _MANIFEST):
                sound = keep and (path.name == _MANIFEST or (path.suffix == ".part" and _sound(read_whole(path))))
                if _OURS.fullmatch(path.name) and path.name not in _LOCKS and not sound:
                    path.unlink()
            sync(self.folder)


Parts = MemoryParts | PartFiles


def _arrays(content: bytes) -> Arrays:
    """The numbers of a part, each where it stands in it."""
    found, at = {}, content.index(b"\n", _DIGEST) + 1
    for key, (kind, shape) in json.loads(content[_DIGEST:at]).items():
        found[key] = np.frombuffer(content, kind, math.prod(shape), at).reshape(shape)
        at += found[key].nbytes
    return found


def _sound(content: bytes) -> bool:
    return hashlib.sha256(memoryview(content)[_DIGEST:]).digest() == content[:_DIGEST]


@contextlib.contextmanager
def held(
    target: Path, wanted: Manifest, source: Manifest, resume: bool, replace: bool, read: Callable[[Path], Manifest],
    shard: Shard = WHOLE,
) -> Iterator[PartFiles | None]:  # fmt: skip
    """A context with the parts of an output, under a lock; they stay when the run ends early and go when it is done.

    Those of a shard stay until they are merged.

    Parameters
    ----------
    target : Path
        The netCDF file to be.
    wanted : dict
        What is to run, by which versions.
    source : dict
        Path, text, overrides and files of the scenario, and its swept keys in their order.
    resume : bool
        Whether to go on from the parts of an earlier run of the same, if there are any. Where the output is there
        already, the context gives None.
    replace : bool
        Whether the output and the parts of an earlier run of it may be replaced.
    read : callable
        Gives what an output has run.
    shard : (int, int)
        Share of the run, which has a folder and a lock of its own.

    Raises
    ------
    OutputExists
        If there is an output or an unfinished run that is not to be replaced, or the folder is not one of a run.
    OutputBusy
        If another run holds the output.
    BadInput
        If the output or the unfinished run is of something else.
    """
    whole, folder = checksums.parts_of(target), folder_of(target, shard)
    try:
        with locked(folder / _LOCK, lambda: _make(whole, folder)) as free:
            if not free:
                raise OutputBusy(f"another run is writing {target}; wait for it or name another output")
            parts = PartFiles(folder)
            try:
                done = parts.begin(target, wanted, source, resume, replace, read)
                yield None if done else parts
                if done or folder == whole:
                    with contextlib.suppress(OSError):  # the output is there: whatever stays here does no harm
                        parts.clean(keep=False)
            finally:
                _unlock(folder)
    finally:
        with contextlib.suppress(OSError):  # of a run that goes on, or with files of others
            folder.rmdir()
            whole.rmdir()


def folder_of(target: Path, shard: Shard) -> Path:
    """Folder of the parts of a run that is not done, or of one of its shards."""
    whole = checksums.parts_of(target)
    return whole if shard == WHOLE else whole / "{}-of-{}".format(*shard)


@contextlib.contextmanager
def gathered(target: Path) -> Iterator[tuple[PartFiles, dict[Shard, PartFiles]]]:
    """A context with the parts of a run and of its shards by their numbers, under all their locks.

    Raises
    ------
    BadInput
        If there are none, or shards of different divisions.
    OutputBusy
        If one of them is being run.
    """
    folder = checksums.parts_of(target)
    shards = {shard: PartFiles(path) for shard, path in _shards(folder).items()}
    for shard, path in _named_shards(folder).items():
        if shard not in shards and (manifest := path / _MANIFEST).exists():
            raise BadInput([f"{manifest} is damaged; move {path} away and run that shard again"])
    if not shards and not manifest_of(folder):
        raise BadInput([f"{folder}: there are no shards of a run; name the output that `sim run --shard` was given"])
    if len(divisions := {of for _, of in shards}) > 1:
        several = " and of ".join(map(str, sorted(divisions)))
        raise BadInput([f"{folder} holds shards of {several}; move away those that are of another division"])
    with contextlib.ExitStack() as locks:
        for parts in (PartFiles(folder), *shards.values()):
            if not locks.enter_context(locked(parts.folder / _LOCK, lambda: None)):
                raise OutputBusy(f"{parts.folder} is being written; wait for it")
            locks.callback(_unlock, parts.folder)
        yield PartFiles(folder), shards


def folders(target: Path) -> list[Path]:
    """Folders in which an unfinished run of an output, or its shards, have their parts."""
    whole = checksums.parts_of(target)
    return [*([whole] if manifest_of(whole) else []), *_shards(whole).values()]


def _shards(folder: Path) -> dict[Shard, Path]:
    """Folders of the shards in that of a run, in order."""
    return {shard: path for shard, path in _named_shards(folder).items() if manifest_of(path)}


def _named_shards(folder: Path) -> dict[Shard, Path]:
    """Folders with names of shards, in order, whether or not they hold a manifest."""
    found = {}
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for path in folder.iterdir():
            if (numbers := _SHARD.fullmatch(path.name)) and not path.is_symlink():
                found[int(numbers[1]), int(numbers[2])] = path
    return dict(sorted(found.items()))


def _unlock(folder: Path) -> None:
    """Remove the lock of a folder in which no run is to go on."""
    if not (folder / _MANIFEST).exists():
        (folder / _LOCK).unlink(missing_ok=True)


def _refuse_foreign(target: Path) -> None:
    """Refuse to replace a file in the place of the checksums that no run made."""
    place = checksums.path_of(target)
    if not checksums.known(place):
        raise OutputExists(f"{place} holds no checksums of a run; move it away or name another output")


def _link(beside: Path, target: Path) -> None:
    """Give a file its place where nothing has come meanwhile; a file system without links is asked before."""
    try:
        os.link(beside, target)
    except FileExistsError:
        cure = "move it away, and the same command with --resume goes on"
        raise OutputExists(f"{target} has come during the run, which does not replace it: {cure}") from None
    except OSError:
        if target.exists():
            raise OutputExists(f"{target} has come during the run, which does not replace it") from None


def _make(whole: Path, folder: Path) -> None:
    """Make the folder, a shard's in that of the run; refuse one that no run made, and a run beside its shards."""
    with explained(whole.parent):
        folder.mkdir(parents=True, exist_ok=True)
        names = {path: os.listdir(path) for path in (whole, folder)}
    for path, inside in names.items():
        foreign = [name for name in inside if not (_OURS.fullmatch(name) or _SHARD.fullmatch(name))]
        unknown = not manifest_of(path) if _MANIFEST in inside else foreign
        if path.is_symlink() or unknown:
            raise OutputExists(f"{path} is not the folder of a run; move it away or name another output")
    if folder != whole and _MANIFEST in names[whole]:
        raise OutputExists(f"{whole} holds an unfinished run; go on by --resume without --shard, or move it away")
    if folder == whole and _shards(whole):
        raise OutputExists(f"{whole} holds shards of a run; put them together with `sim merge`, or move them away")


def manifest_of(folder: Path) -> Manifest:
    """The manifest of a folder; empty where there is none of ours, or a damaged one."""
    try:
        found = json.loads(read_whole(folder / _MANIFEST))
    except (FileNotFoundError, RecursionError, ValueError):
        return {}
    whole = isinstance(found, dict) and found.get("format") == _FORMAT and _shallow(found)
    return found if whole and isinstance(found.get("run"), dict) and isinstance(found.get("source"), dict) else {}


def _shallow(tree: Any) -> bool:
    """Whether tables and lists nest no deeper than in a scenario."""
    inner = [tree]
    for _ in range(_DEEPEST):
        found = (one for outer in inner for one in (outer.values() if isinstance(outer, dict) else outer))
        inner = [one for one in found if isinstance(one, dict | list)]
    return not inner


def refuse_other(
    path: Path, older: Manifest, wanted: Manifest, cure: str = "run what was begun, or begin anew with --force"
) -> None:
    """Refuse to go on with another scenario, other versions or other code, naming what differs."""
    was, now = _decisive(older), _decisive(wanted)
    changed = [key for key in sorted({*was, *now}) if was.get(key) != now.get(key)]
    if changed:
        some = [f"{key} was {_short(was.get(key))}, is {_short(now.get(key))}" for key in changed[:_MOST_NAMED]]
        more = f" and {len(changed) - len(some)} more" if len(changed) > len(some) else ""
        raise BadInput([f"{path} is of another run: {'; '.join(some)}{more}; {cure}"])


def _decisive(manifest: Manifest) -> dict[str, Any]:
    """What decides the bytes of an output, by dotted key; a finished one gives no code and no order of its sweep."""
    found = _flat(manifest.get("run"))
    if "code" in manifest:
        found |= {"code": manifest["code"], "order of the sweep": manifest["source"].get("sweep")}
    return found


def _short(value: Any) -> str:
    text = "left out" if value is None else str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _flat(tree: Any, path: str = "") -> dict[str, Any]:
    """The values of nested tables by dotted key."""
    if not isinstance(tree, dict):
        return {path: tree}
    return {k: v for name, inner in tree.items() for k, v in _flat(inner, f"{path}.{name}".lstrip(".")).items()}
