"""Results kept on disk between runs. A store that is broken, read-only or full costs time, never a run."""

import contextlib
import hashlib
import os
from pathlib import Path


def folder() -> Path:
    """Folder of what is kept: ``SIM_CACHE_DIR``, else the user's cache."""
    base = os.environ.get("SIM_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "sliding-sim"


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
