"""Brushes, species and programs by name: files of one kind in some folders, or embedded in a recording."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from flockbrush.behaviours.tomlfile import TomlFile, parse_toml, read_bytes
from flockbrush.engine.file_formats import format_error
from flockbrush.engine.problems import Problem, ProblemsError

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def read_source(source: str | os.PathLike | bytes, file: str | None, suffix: str) -> tuple[TomlFile, bytes]:
    """The TOML and the bytes of a file, or of bytes that messages call `file`; ProblemsError."""
    if not isinstance(source, bytes):
        file = file or os.fspath(source)
        source = read_bytes(source)
    return parse_toml(source, file or f"unnamed{suffix}"), source


def check_schema(toml: TomlFile, schema: str, needed: bool = True) -> dict[str, Any]:
    """What a file holds apart from the schema that it states; files of some kinds did not state theirs once.

    Raises
    ------
    ProblemsError
        For another schema: that has other rules, so nothing else is said of the file then.
    """
    document = dict(toml.data)
    given = document.pop("schema", None if needed else schema)
    kind = schema.removeprefix("flockbrush.").partition("/")[0]
    if given is None:
        message = f'is missing; a {kind} starts with: schema = "{schema}"'
        raise ProblemsError([Problem(toml.name, 1, "schema", message)])
    if wrong := format_error(given, schema):
        raise ProblemsError([toml.problem(("schema",), wrong)])
    return document


def name_in(toml: TomlFile, suffix: str) -> tuple[str, list[Problem]]:
    """The name that a file gives to what is in it; "unnamed" and a problem where it is called otherwise."""
    base = re.split(r"[/\\]", toml.name)[-1]
    name = base.removesuffix(suffix)
    if base.endswith(suffix) and NAME.fullmatch(name):
        return name, []
    kind = suffix.split(".")[1]
    message = f"the name of a {kind} file must be NAME{suffix}, with letters, digits, - and _ in NAME; got {base!r}"
    return "unnamed", [Problem(toml.name, None, None, message)]


def _folders(folders):
    """Folders as paths; TypeError for anything else than several of them."""
    many = isinstance(folders, Iterable) and not isinstance(folders, (str, bytes, Mapping))
    folders = list(folders) if many else folders
    if not many or not all(isinstance(folder, (str, os.PathLike)) for folder in folders):
        raise TypeError(f"folders must be a list of folders, such as ['brushes'], got {folders!r}"[:300])
    return [Path(folder) for folder in folders]


class FileLibrary:
    """Files ``NAME + suffix`` in some folders; the first folder that has a name wins.

    Files are looked for anew at every call.

    Parameters
    ----------
    folders : sequence of path
        In order of precedence; those that are not there are empty.
    files : mapping of str to bytes, optional
        Files by name or path, before all folders: those a recording has embedded.
    """

    suffix: ClassVar[str]

    def __init__(self, folders: Iterable[str | os.PathLike] = (), files: Mapping[str, bytes] | None = None):
        self.folders = _folders(folders)
        self._files = {name.replace("\\", "/").rsplit("/", 1)[-1]: data for name, data in (files or {}).items()}

    def __repr__(self):
        return f"<{type(self).__name__}: {', '.join(self.names())}>"

    def names(self) -> list[str]:
        """All names, sorted."""
        bases = {base for base in self._files if base.endswith(self.suffix)}
        for folder in self.folders:
            bases.update(path.name for path in folder.glob(f"*{self.suffix}"))
        return sorted(name for name in (base.removesuffix(self.suffix) for base in bases) if NAME.fullmatch(name))

    def file_called(self, *bases: str) -> Path | None:
        """The file of the first of these base names in the first folder that has one; None where there is none.

        The bare name where it is embedded.
        """
        embedded = (Path(base) for base in bases if base in self._files)
        there = (folder / base for folder in self.folders for base in bases if (folder / base).exists())
        return next(itertools.chain(embedded, there), None)

    def file_of(self, name: str) -> Path | None:
        """The file of a valid name, as `file_called` tells it."""
        return self.file_called(name + self.suffix)

    def bytes_of(self, file: Path) -> bytes:
        """What is in a file that `file_called` gave; ProblemsError where it cannot be read."""
        return self._files[file.name] if file.name in self._files else read_bytes(file)
