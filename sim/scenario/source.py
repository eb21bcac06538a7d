"""Origin of a scenario: its text and the files it names."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sim.units.tables import plain_text


@dataclass(frozen=True)
class Source:
    """Origin of a scenario: the file's text, what was changed on top, and every file it names.

    ``parts`` are those of the first scenario made from it, the one that text and overrides describe.
    """

    path: str = ""
    text: str = ""
    overrides: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    parts: dict[str, Any] = field(default_factory=dict)

    def changed(self, values: dict[str, Any]) -> "Source":
        """Return the source with more overrides; they replace those of keys inside their own keys."""
        inside = tuple(f"{key}." for key in values)
        others = {key: value for key, value in self.overrides.items() if not key.startswith(inside)}
        return Source(self.path, self.text, others | values, self.files)

    @property
    def written(self) -> dict[str, Any]:
        """Return path, text, overrides and files, from which another process makes the same source."""
        return {"path": self.path, "text": self.text, "overrides": self.overrides, "files": self.files}


@dataclass(frozen=True)
class Files:
    """Files that a scenario names, relative to its own folder, and the text of each that was read."""

    folder: Path
    texts: dict[str, str] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """Return the path of a file."""
        return self.folder / name

    def text(self, name: str) -> str:
        """Return the text of a file, which the dataset keeps as its provenance."""
        if name not in self.texts:
            self.texts[name] = plain_text(self.path(name))
        return self.texts[name]
