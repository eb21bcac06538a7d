"""Parts of a run, in memory or on disk."""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim.numerics.files import explained, write_whole


class MemoryParts(dict):
    """Parts kept in memory."""

    def save(self, name: str, arrays: dict[str, np.ndarray]) -> None:
        self[name] = arrays

    def load(self, name: str, beginning: str) -> dict[str, np.ndarray]:
        return {key: array for key, array in self[name].items() if key.startswith(beginning)}


@dataclass(frozen=True)
class PartFiles:
    """Parts kept as files of a folder: built in memory, written, synced, then renamed into place."""

    folder: Path

    def save(self, name: str, arrays: dict[str, np.ndarray]) -> None:
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        with explained(self.folder):
            write_whole(self.folder / f"{name}.npz", buffer.getbuffer())

    def load(self, name: str, beginning: str) -> dict[str, np.ndarray]:
        """The arrays whose names begin so, without reading the others."""
        with explained(self.folder), np.load(self.folder / f"{name}.npz", allow_pickle=False) as arrays:
            return {key: arrays[key] for key in arrays.files if key.startswith(beginning)}


#: Where parts are kept until the dataset is made.
Parts = MemoryParts | PartFiles
