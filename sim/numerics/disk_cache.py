"""Results kept on disk between runs. A cache that is broken, read-only or full costs time, never a run."""

import contextlib
import functools
import hashlib
import os
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from sim.numerics.files import whole

T = TypeVar("T")
#: Results that took less time are not stored [s].
_WORTH = 0.1


def folder() -> Path:
    """Return the folder of the cache: ``SIM_CACHE_DIR``, else the user's cache, else none that can be written."""
    base = (
        os.environ.get("SIM_CACHE_DIR")
        or os.environ.get("XDG_CACHE_HOME")
        or "~/.cache"
    )
    try:
        return Path(base).expanduser() / "sliding-sim"
    except RuntimeError:  # there is no home; nothing is written below a device
        return Path(os.devnull)


def read(path: Path) -> bytes | None:
    """Return the content of a file as it was stored; None if there is none, or a byte of it has changed."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return (
        content[32:] if content[:32] == hashlib.sha256(content[32:]).digest() else None
    )


def store(path: Path, content: bytes) -> None:
    """Write a file with its checksum, whole or not at all."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as aside:
            aside.write_bytes(hashlib.sha256(content).digest() + content)


@functools.cache
def sources() -> dict[str, bytes]:
    """Return the texts of the package's modules by name."""
    package = Path(__file__).parents[1]
    texts = {
        path.relative_to(package).with_suffix(""): path.read_bytes()
        for path in sorted(package.rglob("*.py"))
    }
    return {".".join((package.name, *path.parts)): text for path, text in texts.items()}


@functools.cache
def digest() -> bytes:
    """Return a hash of the sources and of the version of Python, on which any result may depend."""
    result = hashlib.sha256(sys.version.encode())
    for text in sources().values():
        result.update(text)
    return result.digest()


def cached(key: Any, compute: Callable[[], T]) -> T:
    """Return the result of ``compute``, from the disk if a run of the same sources has stored it under the same key.

    The key holds all that the result depends on, including versions of libraries and features of the processor.
    """
    path = (
        folder()
        / "found"
        / hashlib.sha256(digest() + pickle.dumps(key)).hexdigest()[:32]
    )
    with contextlib.suppress(Exception):
        return pickle.loads(read(path) or b"")
    began = time.process_time()
    value = compute()
    if time.process_time() - began > _WORTH:
        store(path, pickle.dumps(value))
    return value
