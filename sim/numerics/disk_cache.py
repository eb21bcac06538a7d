"""Results kept on disk between runs. A store that is broken, read-only or full costs time, never a run."""

import contextlib
import functools
import hashlib
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")
#: What is found sooner is not kept [s].
_WORTH = 0.1


def folder() -> Path:
    """Folder of what is kept: ``SIM_CACHE_DIR``, else the user's cache."""
    base = os.environ.get("SIM_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    try:
        return Path(base).expanduser() / "sliding-sim"
    except RuntimeError:  # there is no home
        return Path(tempfile.gettempdir()) / f"sliding-sim-{os.getuid()}"


def read(path: Path) -> bytes | None:
    """Content of a file as it was stored; None where there is none, or where a byte of it has changed."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return content[32:] if content[:32] == hashlib.sha256(content[32:]).digest() else None


def store(path: Path, content: bytes) -> None:
    """Write a file with its checksum, whole or not at all."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_bytes(hashlib.sha256(content).digest() + content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@functools.cache
def sources() -> dict[str, bytes]:
    """Texts of the package's modules by name."""
    package = Path(__file__).parents[1]
    texts = {path.relative_to(package).with_suffix(""): path.read_bytes() for path in sorted(package.rglob("*.py"))}
    return {".".join((package.name, *path.parts)): text for path, text in texts.items()}


@functools.cache
def digest() -> bytes:
    """Hash of what any result may depend on: the sources, and the version of Python."""
    found = hashlib.sha256(sys.version.encode())
    for text in sources().values():
        found.update(text)
    return found.digest()


def found(key: Any, find: Callable[[], T]) -> T:
    """What ``find`` gives: from the disk where an earlier run of the same sources has found it under the same key.

    The key holds all that the result depends on, versions of libraries and features of the processor included.
    """
    path = folder() / "found" / hashlib.sha256(digest() + pickle.dumps(key)).hexdigest()[:32]
    with contextlib.suppress(Exception):
        return pickle.loads(read(path) or b"")
    began = time.process_time()
    value = find()
    if time.process_time() - began > _WORTH:
        store(path, pickle.dumps(value))
    return value
