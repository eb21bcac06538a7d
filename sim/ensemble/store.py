"""Blocks of a run that is not done, in the folder ``OUT.nc.parts``, and their way to the output.

The folder holds ``manifest.json`` with the run, its versions and the number of shards, and the locks. Each computed
block has a file ``.npz``, which is written under another name and then renamed. Each shard has a lock, held while the
shard is computed. The output has another one, held while a run begins and while the output is published. A folder
without a manifest of ours is not touched, nor is any file in it that a run did not make.
"""

import contextlib
import errno
import hashlib
import json
import os
import re
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sim.numerics.disk_cache import digest
from sim.numerics.files import OutputExists, StoreTrouble, explained, move, whole
from sim.units.errors import BadInput

Arrays = dict[str, np.ndarray]
Manifest = dict[str, Any]
#: Number of a shard, from 1, and how many there are.
Shard = tuple[int, int]
WHOLE: Shard = (1, 1)

_MANIFEST, _DATASET, _LOCK, _STATE, _SEAL = (
    "manifest.json",
    "dataset.nc",
    "output.lock",
    "state.",
    "seal",
)
_SHARD = re.compile(r"([1-9][0-9]{0,5})/([1-9][0-9]{0,5})")
#: Names of the files that a run makes in its folder, whole or on the way.
_OURS = re.compile(
    r"manifest\.json|dataset\.nc|.*\.(lock|held)(\..+)?|point\d+-group\d+-block\d+\.npz|\..*\.tmp"
)
_FORMAT = "parts of a run of sim, 4"
#: Seconds for which a run that begins waits while another one begins.
_PATIENCE = 10.0
#: Seconds for which a file may be read by another process before its removal is given up.
_READING = 1.0
_MOST_NAMED, _LONGEST = 5, 40
#: Errors of a file system without locks.
_NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}


class OutputBusy(RuntimeError):
    """Another run is writing this output."""

    exit_code = 75


class Stopped(RuntimeError):
    """The run was to stop; what is computed is kept."""

    exit_code = 75


def shard_of(text: str) -> Shard:
    """Return the number of a shard and how many there are, of "I/N"."""
    match = _SHARD.fullmatch(text)
    if not match or int(match[1]) > int(match[2]):
        raise BadInput(
            [
                f"--shard takes I/N with I from 1 to N, such as 3/64, not {text[:_LONGEST]}"
            ]
        )
    return int(match[1]), int(match[2])


def parts_of(target: Path) -> Path:
    """Return the folder of the blocks of a run that is not done."""
    return target.with_name(f"{target.name}.parts")


def lock_of(number: int, of: int) -> str:
    """Return the name of the lock of a shard."""
    return f"shard-{number}-of-{of}.lock"


class MemoryBlocks(dict[str, Arrays]):
    """Blocks in memory, without the states that only a resumed run needs."""

    def save(self, name: str, arrays: Arrays, state: Arrays) -> None:
        self[name] = arrays

    def load(self, name: str) -> Arrays:
        return self[name]

    def state(self, name: str) -> Arrays:
        raise KeyError(f"{name} was stored without its state")


@dataclass(frozen=True)
class BlockFiles:
    """Blocks of a run as files of a folder, each with the state at its end.

    A block ends with a text of the run, its names and its shapes. This check is needed because a zip file may lack
    entries or belong to another run.
    """

    folder: Path
    run: str = ""

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.npz"

    def __contains__(self, name: str) -> bool:
        return self.path(name).exists()

    def save(self, name: str, arrays: Arrays, state: Arrays) -> None:
        """Write a block, whole or not at all."""
        content = arrays | {f"{_STATE}{key}": values for key, values in state.items()}
        sealed: dict[str, Any] = content | {_SEAL: np.array(self._seal(content))}
        with (
            explained(self.folder),
            whole(self.path(name)) as aside,
            aside.open("wb") as file,
        ):
            np.savez(file, **sealed)

    def _seal(self, content: Arrays) -> str:
        return f"{self.run} {sorted((key, values.shape) for key, values in content.items())}"

    def load(self, name: str) -> Arrays:
        """Return what a block recorded."""
        return self._read(name, lambda key: not key.startswith(_STATE))

    def state(self, name: str) -> Arrays:
        """Return the state at the end of a block."""
        states = self._read(name, lambda key: key.startswith(_STATE))
        return {key.removeprefix(_STATE): values for key, values in states.items()}

    def drop_damaged(self, name: str) -> None:
        """Remove a block that is not readable to its last byte, or not as this run has saved it."""
        with contextlib.suppress(StoreTrouble):
            self._read(name, lambda key: True, wholly=True)
            return
        with explained(self.folder):
            self.path(name).unlink(missing_ok=True)

    def _read(
        self, name: str, wanted: Callable[[str], bool], wholly: bool = False
    ) -> Arrays:
        try:
            with (
                self.path(name).open("rb") as file,
                np.load(file, allow_pickle=False) as arrays,
            ):
                content, seal = (
                    {
                        key: arrays[key]
                        for key in arrays
                        if key != _SEAL and wanted(key)
                    },
                    str(arrays[_SEAL]),
                )
                if not (
                    seal == self._seal(content) if wholly else seal.startswith(self.run)
                ):
                    raise ValueError("another run or another process wrote it")
                return content
        except Exception as trouble:  # a damaged file raises whatever its reader meets
            cure = "continue with --resume, which computes it again"
            raise StoreTrouble(f"{self.path(name)} is damaged; {cure}") from trouble


Blocks = MemoryBlocks | BlockFiles


class Unfinished:
    """The folder of the run of an output, from its beginning until the output is published.

    Parameters
    ----------
    target : Path
        The netCDF file to be.
    run : dict
        Scenario and versions, which decide the numbers.
    order : list of str
        Swept keys in their order.
    read : callable
        Returns the ``run`` of an output.
    """

    def __init__(
        self,
        target: Path,
        run: Manifest,
        order: list[str],
        read: Callable[[Path], Manifest],
    ) -> None:
        self.target, self.folder, self.run, self.order, self.read = (
            target,
            parts_of(target),
            run,
            order,
            read,
        )
        self._begun: Manifest = {}
        self.blocks = BlockFiles(
            self.folder,
            hashlib.sha256(json.dumps(run, sort_keys=True).encode()).hexdigest(),
        )

    def begin(
        self, shard: Shard, resume: bool, replace: bool, names: Iterable[str]
    ) -> int:
        """Begin a run or take up one; return the number of its shards, 0 if the output is there already.

        ==========  ====================================  ===========  =======
        there is    ``resume``                            ``replace``  neither
        ==========  ====================================  ===========  =======
        nothing     begins                                begins       begins
        an output   0 if it is of this run, else refused  begins       refused
        blocks      goes on if they are of this run,      begins anew  refused
                    else refused
        ==========  ====================================  ===========  =======

        A shard joins the blocks of other shards of its run; ``names`` are those of its own.
        """
        with self._output_locked(_PATIENCE):
            older, exists = self._manifest(), self.target.exists()
            finished = self.read(self.target) if resume and exists else {}
            manifest = {"format": _FORMAT, "replace": exists, "shards": shard[1]}
            manifest |= self.run | {"code": digest().hex(), "sweep": self.order}
            if resume and finished == self.run and not older:
                return 0
            if resume and older:
                refuse_other(
                    self.folder,
                    older,
                    manifest | ({"shards": older["shards"]} if shard == WHOLE else {}),
                )
            elif resume and exists:
                refuse_other(self.target, finished, self.run)
            joins = shard != WHOLE and older and not _changed(older, manifest)
            if older and not (
                resume
                or replace
                or (joins and not any(name in self.blocks for name in names))
            ):
                cure = "continue with --resume, or start again with --force"
                raise OutputExists(f"{self.folder} holds an unfinished run; {cure}")
            if (
                exists
                and finished != self.run
                and not (replace or older.get("replace"))
            ):
                raise OutputExists(
                    f"{self.target} exists; replace it with --force or name another output"
                )
            if (resume or joins) and older:
                if replace and self._busy(older["shards"], [shard[0]] if joins else ()):
                    raise self.refusal(*shard)
                for name in names if replace else ():
                    self.blocks.path(name).unlink(missing_ok=True)
                self._begun = older
                return int(older["shards"])
            if older and self._busy(older["shards"]):
                raise self.refusal()
            with explained(self.folder):
                self._clean()
                with whole(self.folder / _MANIFEST) as aside:
                    aside.write_text(
                        json.dumps(manifest, sort_keys=True, default=str),
                        encoding="utf-8",
                    )
            self._begun = self._manifest()
            return shard[1]

    @contextlib.contextmanager
    def shards_locked(
        self, numbers: Iterable[int], of: int
    ) -> Iterator[list[int] | None]:
        """Lock those of some shards that no other process holds, and give their numbers; None if the run is done."""
        locked = list[int]()
        with contextlib.ExitStack() as held:
            with self._output_locked(None):
                gone = not self._manifest_of_this_run()
                for number in () if gone else numbers:
                    if lock := _lock(self.folder / lock_of(number, of)):
                        held.callback(self._unlock, lock)
                        locked.append(number)
            yield None if gone else locked

    def publish(
        self, names: Iterable[str], of: int, write: Callable[[Path], None]
    ) -> bool | None:
        """Make the output; False if blocks are missing or another process holds a shard, None if it did so itself."""
        with self._output_locked(None):
            if not (manifest := self._manifest_of_this_run()):
                return None
            if not all(name in self.blocks for name in names) or self._busy(of):
                return False
            dataset = self.folder / _DATASET
            with explained(self.folder), whole(dataset) as aside:
                write(aside)
            if (
                self.target.exists()
                and not manifest["replace"]
                and self.read(self.target) != self.run
            ):
                cure = "move it away and repeat the command with --resume"
                raise OutputExists(
                    f"{self.target} appeared during the run and is not replaced: {cure}"
                )
            try:
                move(dataset, self.target)
            except StoreTrouble as trouble:
                cure = "then repeat the command with --resume to write the output"
                raise StoreTrouble(f"{trouble}; {cure}") from trouble
            with contextlib.suppress(OSError):  # the output is there
                self._clean()
            return True

    def refusal(self, *shard: int) -> OutputBusy:
        """Return the error if another process holds the lock of the output, or of a shard.

        A lock that a file stands in for may be abandoned.
        """
        name = lock_of(*shard) if shard else _LOCK
        text = (
            f"another run is writing {self.target}; wait for it or name another output"
        )
        for path in (self.folder / name, (self.folder / name).with_suffix(".held")):
            if path.exists() and path.stat().st_size:  # such a file names its process
                text += (
                    f"; if that process was killed on another computer, delete {path}"
                )
        return OutputBusy(text)

    def _busy(self, of: int, numbers: Sequence[int] = ()) -> bool:
        """True if another process holds one of some shards, by default of all."""
        for number in numbers or range(1, of + 1):
            path = self.folder / lock_of(number, of)
            if path.exists():
                if not (lock := _lock(path)):
                    return True
                lock.release()
        return False

    def _manifest(self) -> Manifest:
        """Return the manifest of the folder; empty if there is none, or a damaged one."""
        try:
            manifest = json.loads((self.folder / _MANIFEST).read_bytes())
        except (FileNotFoundError, RecursionError, ValueError):
            return {}
        known = isinstance(manifest, dict) and manifest.get("format") == _FORMAT
        return (
            manifest
            if known and manifest.keys() >= {"scenario", "shards", "replace"}
            else {}
        )

    def _manifest_of_this_run(self) -> Manifest:
        """Return the manifest, empty if the run is done; ``BadInput`` if another run has begun in the folder since."""
        if manifest := self._manifest():
            refuse_other(self.folder, manifest, self._begun)
        return manifest

    def _refuse_foreign(self) -> None:
        """Refuse a folder that no run made, or a run of another format."""
        inside = os.listdir(self.folder)
        foreign = any(not _OURS.fullmatch(name) for name in inside)
        # a manifest that is gone by now is of a run that was done meanwhile
        if _MANIFEST in inside:
            foreign = not self._manifest() and (self.folder / _MANIFEST).exists()
        if self.folder.is_symlink() or foreign:
            raise OutputExists(
                f"{self.folder} is not the folder of a run; move it away or name another output"
            )

    def _clean(self) -> None:
        """Remove what a run made in the folder, first the manifest, without which no run goes on; a held lock stays."""
        for path in sorted(
            self.folder.iterdir(), key=lambda path: path.name != _MANIFEST
        ):
            if _OURS.fullmatch(path.name) and path.stem != "output":
                _patiently(path.unlink)

    @contextlib.contextmanager
    def _output_locked(self, patience: float | None) -> Iterator[None]:
        """Hold the lock of the output; a folder without a manifest goes when the lock is released."""
        began, path, lock = time.monotonic(), self.folder / _LOCK, None
        while not lock:
            with explained(self.folder.parent):
                self.folder.parent.mkdir(parents=True, exist_ok=True)
                try:
                    _patiently(self.folder.mkdir)
                except FileExistsError:
                    # or it did: another process may have removed the folder since
                    if self.folder.is_file():
                        raise
            # the folder of a run that was done meanwhile
            with contextlib.suppress(FileNotFoundError):
                self._refuse_foreign()
                lock = _lock(path, 1.0)
            if (
                not lock
                and patience is not None
                and time.monotonic() - began > patience
            ):
                raise self.refusal()
        try:
            yield
        finally:
            # of a run that was killed on its way out
            if not (self.folder / _MANIFEST).exists():
                with contextlib.suppress(OSError):
                    self._clean()
            self._unlock(lock)

    def _unlock(self, lock: Any) -> None:
        """Release a lock; its file and the folder go with it if there is no manifest any more."""
        path, is_done = Path(lock.lock_file), not (self.folder / _MANIFEST).exists()
        left = [path.with_suffix(".lock"), path] if is_done else []
        with contextlib.suppress(OSError):  # Windows keeps open files
            # before the release: who waits for a file that is gone begins anew
            while left:
                left[-1].unlink(missing_ok=True)
                left.pop()
        lock.release()
        if is_done:
            # with a lock of another process, or files of others
            with contextlib.suppress(OSError):
                for file in left:
                    file.unlink(missing_ok=True)
                self.folder.rmdir()


def _lock(path: Path, wait: float = 0.0) -> Any:
    """Return a lock that is held now, None if another process has it; without locks of the file system it is a file."""
    from filelock import FileLock, SoftFileLock, Timeout  # slow to import

    with warnings.catch_warnings():  # of filelock, if it falls back by itself
        warnings.simplefilter("ignore", UserWarning)
        for lock in (FileLock(path), SoftFileLock(path.with_suffix(".held"))):
            try:
                _patiently(partial(lock.acquire, wait, poll_interval=0.05))
                return lock
            except Timeout:
                return None
            except FileNotFoundError:
                raise
            except OSError as trouble:
                if trouble.errno not in _NO_LOCKS:
                    raise StoreTrouble(f"{path}: {trouble.strerror}") from trouble
    raise StoreTrouble(f"{path}: the file system has no locks")


def _patiently(act: Callable[[], Any]) -> Any:
    """Act, and again for a second if it is not permitted.

    Windows does not permit to remove a file that another process reads, nor to make or open one that is being removed.
    """
    end = time.monotonic() + _READING
    while True:
        try:
            return act()
        except PermissionError:
            if time.monotonic() > end:
                raise
            time.sleep(0.01)


def refuse_other(path: Path, older: Manifest, wanted: Manifest) -> None:
    """Refuse to go on with another scenario, other versions or other code, naming what differs."""
    changed = _changed(older, wanted)
    if "version.sim" in changed:
        version = _short(changed["version.sim"][0])
        if changed["version.sim"][0] is None:
            fault = "is not a netCDF file, is truncated or damaged, or was not written by `sim run`"
            raise BadInput(
                [f"{path}: {fault}; move it away, or replace it with --force"]
            )
        raise BadInput(
            [
                f"{path} was made by sim {version}: finish it by that version, or move it and run again"
            ]
        )
    if changed:
        some = [
            f"{key} was {_short(was)}, is {_short(now)}"
            for key, (was, now) in changed.items()
        ]
        more = f" and {len(some) - _MOST_NAMED} more" if len(some) > _MOST_NAMED else ""
        cure = "run the original scenario, or start again with --force"
        raise BadInput(
            [
                f"{path} belongs to another run: {'; '.join(some[:_MOST_NAMED])}{more}; {cure}"
            ]
        )


def _changed(older: Manifest, wanted: Manifest) -> dict[str, tuple[Any, Any]]:
    """Return the entries before and now that differ between two manifests and decide the numbers, by dotted key."""
    was, now = (
        _flat(manifest | {"format": "", "replace": ""}) for manifest in (older, wanted)
    )
    return {
        key: (was.get(key), now.get(key))
        for key in sorted({*was, *now})
        if was.get(key) != now.get(key)
    }


def _short(value: Any) -> str:
    text = "left out" if value is None else str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _flat(tree: Any, path: str = "") -> dict[str, Any]:
    """Return the values of nested tables by dotted key."""
    if not isinstance(tree, dict):
        return {path: tree}
    return {
        k: v
        for name, inner in tree.items()
        for k, v in _flat(inner, f"{path}.{name}".lstrip(".")).items()
    }
