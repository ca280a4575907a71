"""Where a level's files come from: a folder of the disk, never outside of the project, or a recording."""

from __future__ import annotations

import os
import posixpath
from pathlib import Path, PurePosixPath, PureWindowsPath

from flockbrush.engine import limits
from flockbrush.levels.schema import PROJECT_FILE


class FileRefused(Exception):
    """This file is not read; the text says why."""


def project_folder(level: Path) -> Path:
    """The nearest folder upwards that holds a Flockbrush project, else the level's own."""
    here = level.parent.resolve()
    return next((f for f in (here, *here.parents) if (f / PROJECT_FILE).is_file()), here)


def is_of_project(file: Path, root: Path) -> bool:
    """Whether a file lies in this project, and not in another one below its folder."""
    between = [folder for folder in file.parents if folder != root and folder.is_relative_to(root)]
    return file.is_relative_to(root) and not any((folder / PROJECT_FILE).is_file() for folder in between)


class DiskFiles:
    """The files beside a level; `got` remembers all that was read."""

    def __init__(self, level: Path):
        self.level = Path(level)
        self.root = project_folder(self.level)
        self.got: dict[str, bytes] = {}

    def first(self) -> bytes:
        """The level itself."""
        data = self._read(self.level)
        self.got[self.level.name] = data
        return data

    def shown(self, relative: str) -> str:
        """What to call this file in a problem."""
        return str(Path(os.path.normpath(self.level.parent / relative)))

    def read(self, relative: str) -> bytes:
        """The bytes of a file named relative to the level's folder; FileRefused."""
        key = plain(relative)
        path = self.level.parent / key
        try:
            real = path.resolve()
        except (OSError, RuntimeError, ValueError):
            raise FileRefused(f"{relative!r} cannot be found") from None
        if not real.is_relative_to(self.root):
            raise FileRefused(
                f"{relative!r} is outside of the project folder; copy it beside the level"
                f" (the project is the folder with {PROJECT_FILE}, else the level's own)"
            )
        return self._keep(key, self._read(real))

    def _keep(self, key, data):
        self.got[key] = data
        if sum(map(len, self.got.values())) > limits.LEVEL_BYTES:
            raise FileRefused(f"makes the files of this level larger than {limits.LEVEL_BYTES.text}")
        return data

    def _read(self, path: Path) -> bytes:
        try:
            if path.is_dir():
                raise FileRefused("is a folder, not a file")
            if not path.is_file():
                raise FileRefused("there is no such file" if not path.exists() else "is not a regular file")
            with open(path, "rb") as file:
                return checked_size(file.read(limits.LEVEL_FILE_BYTES + 1))
        except (OSError, ValueError) as error:
            raise FileRefused(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


class UnsavedFiles(DiskFiles):
    """The files beside a level that itself is not as the disk has it; ``kept`` ones where the disk has lost them."""

    def __init__(self, level: Path, text: bytes, kept: dict[str, bytes]):
        super().__init__(level)
        self.text, self.kept = text, kept

    def first(self) -> bytes:
        """The level itself."""
        self.got[self.level.name] = self.text
        return self.text

    def read(self, relative: str) -> bytes:
        """The bytes of a file named relative to the level's folder; FileRefused."""
        try:
            return super().read(relative)
        except FileRefused:
            key = plain(relative)
            if key not in self.kept:
                raise
        self.got[key] = self.kept[key]
        return self.got[key]


class MemoryFiles:
    """The files a recording has embedded, the level first."""

    def __init__(self, files: dict[str, bytes]):
        if not files:
            raise ValueError("no level among the files")
        self.level = Path(next(iter(files)))
        self.files = files
        self.got: dict[str, bytes] = {}

    def first(self) -> bytes:
        """The level itself."""
        name = next(iter(self.files))
        self.got[name] = checked_size(self.files[name])
        return self.files[name]

    def shown(self, relative: str) -> str:
        """What to call this file in a problem."""
        return posixpath.normpath(relative)

    def read(self, relative: str) -> bytes:
        """The bytes of a file named relative to the level's folder; FileRefused."""
        key = plain(relative)
        if key not in self.files:
            raise FileRefused(f"{relative!r} is not among the recorded files")
        self.got[key] = checked_size(self.files[key])
        return self.got[key]


def checked_size(data: bytes) -> bytes:
    """The content of one file of a level; FileRefused when it is too large."""
    if len(data) > limits.LEVEL_FILE_BYTES:
        raise FileRefused(f"is larger than {limits.LEVEL_FILE_BYTES.text}")
    return data


def plain(relative: str) -> str:
    """A relative path without detours; FileRefused for an absolute one."""
    if not relative or "\0" in relative or len(relative) > 1000:
        raise FileRefused(f"{relative[:60]!r} is not the name of a file")
    if PurePosixPath(relative).is_absolute() or PureWindowsPath(relative).drive or "://" in relative:
        raise FileRefused(f"{relative!r} is an absolute path; name the file relative to the level")
    return posixpath.normpath(relative.replace("\\", "/"))
