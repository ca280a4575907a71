"""The files that a level names, once it is saved in another folder: found from there, or copied below it."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterable, Iterator
from itertools import chain, count
from pathlib import Path

from flockbrush.engine.files import write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.checked_nodes import parsed_document
from flockbrush.levels.document_nodes import file_names, is_brush_file
from flockbrush.levels.json_lines import JsonError
from flockbrush.levels.level_files import FileRefused, is_of_project, plain, project_folder

_TILESETS = (".tsj", ".tsx")


def from_folder(name: str, before: Path, after: Path) -> str:
    """What a file is called from one folder that is called ``name`` from another; both resolved."""
    try:
        return posixpath.normpath(os.path.relpath(before / plain(name), after).replace("\\", "/"))
    except (FileRefused, ValueError):  # not relative to a folder, or on another drive
        return name


def renamed_files(names: Iterable[tuple[str, bool]], before: Path, after: Path) -> dict[str, str]:
    """{name: new name} of the files that a level calls otherwise when it is saved elsewhere.

    Parameters
    ----------
    names : iterable of (str, bool)
        As the level names them, and whether the level needs the file: one that it could read where it was, and could
        not read from its new place, is copied below its new folder.
    before, after : Path
        The level, there and here.

    Raises
    ------
    ProblemsError
        When a file cannot be copied.
    """
    source_folder, target_folder = before.parent.resolve(), after.parent.resolve()
    if source_folder == target_folder:
        return {}
    moved, old_root, root = {}, project_folder(before), project_folder(after)
    for name, needed in dict(sorted(names, key=lambda entry: entry[1])).items():
        try:
            source = source_folder.joinpath(plain(name))
        except FileRefused:  # no file beside the level: it stays what it is
            continue
        source = Path(os.path.normpath(source))
        if needed and not is_of_project(source, root) and source.resolve().is_relative_to(old_root):
            new = _copied(name, source, old_root, after)
        else:
            new = from_folder(name, source_folder, target_folder)
        if new != name:
            moved[name] = new
    return moved


def _copied(name, source, root, level):
    """Copy a file that a level needs below its folder, and with a tileset all that this names; its name there.

    Files of others keep their names: where one has the same name and other contents, the copies are called otherwise.
    """
    own = (level.stem + (f"-{k}" if k > 1 else "") for k in count(1))
    if source.suffix.lower() in _TILESETS:
        named = [file for file in _named_by(source) if file.resolve().is_relative_to(root)]
        base = Path(os.path.commonpath([source.parent, *(file.parent for file in named)]))
        files = {file: file.relative_to(base).as_posix() for file in (source, *named)}
        prefixes = chain(["tilesets/"], map("tilesets/{}/".format, own))
    elif is_brush_file(name):
        parts = plain(name).split("/")
        files = {source: "/".join(part for part in parts if part != "..")}
        prefixes = chain([""], map("{}/".format, own))
    else:
        files, prefixes = {source: source.name}, chain([""], map("{}-".format, own))
    return _copied_as({file: new for file, new in files.items() if file.is_file()}, prefixes, level) + files[source]


def _named_by(tileset) -> Iterator[Path]:
    """The pictures and brushes of a tileset's file."""
    try:
        names = file_names(parsed_document(tileset.read_bytes()))
        yield from (Path(os.path.normpath(tileset.parent / plain(name))) for name, needed in names if needed)
    except (OSError, JsonError, FileRefused):
        return  # reported when the level is read


def _copied_as(files, prefixes, level):
    """Copy files, {file: its name}, below a level's folder; what stands before the names so that no file is in the
    way."""
    try:
        for prefix in prefixes:
            pairs = [(file, level.parent / (prefix + name)) for file, name in files.items()]
            if all(not new.exists() or new.read_bytes() == file.read_bytes() for file, new in pairs):
                break
        for file, new in pairs:
            if not new.exists():
                new.parent.mkdir(parents=True, exist_ok=True)
                write_bytes(new, file.read_bytes(), overwrite=False)
    except ProblemsError:  # it names the file
        raise
    except OSError as error:
        names = ", ".join(file.name for file in files)
        message = f"{names} cannot be copied beside it: {error.strerror or error}"
        raise ProblemsError([Problem(str(level), None, None, message)]) from None
    return prefix
