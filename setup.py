"""The build of the source archive; all else about the project is in ``pyproject.toml``."""

import gzip
import os
import tarfile
from pathlib import Path
from typing import Any

import setuptools
from setuptools.command.sdist import sdist


class Repeatable(sdist):
    """A source archive whose bytes follow from the sources and from ``SOURCE_DATE_EPOCH``, if that is set.

    Wheels of setuptools do so by themselves. Its source archives do not, because they hold the user, the times at which
    files were copied, and the time of the compression.
    """

    def make_archive(
        self, base_name: str, format: str, *arguments: Any, **keywords: Any
    ) -> str:  # type: ignore[override]
        """Write the archive of a folder that has been laid out, and return the path of the archive."""
        epoch = os.environ.get("SOURCE_DATE_EPOCH")
        folder = keywords.get("base_dir")
        if epoch is None or format != "gztar" or folder is None:
            return str(super().make_archive(base_name, format, *arguments, **keywords))

        def settle(member: tarfile.TarInfo) -> tarfile.TarInfo:
            member.mtime, member.uid, member.gid, member.uname, member.gname = (
                int(epoch),
                0,
                0,
                "",
                "",
            )
            member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            return member

        path = f"{base_name}.tar.gz"
        with (
            open(path, "wb") as file,
            gzip.GzipFile("", "wb", fileobj=file, mtime=int(epoch)) as stream,
            tarfile.open(
                fileobj=stream, mode="w", format=tarfile.PAX_FORMAT
            ) as archive,
        ):
            for member in [Path(folder), *sorted(Path(folder).rglob("*"))]:
                archive.add(member, member.as_posix(), recursive=False, filter=settle)
        return path


setuptools.setup(cmdclass={"sdist": Repeatable})
