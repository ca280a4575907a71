"""The command ``flockbrush brush check``: what is wrong with brushes and with paths between them."""

from __future__ import annotations

import shlex
from pathlib import Path

import typer

from flockbrush.behaviours.brush import PATH_SUFFIX, SUFFIX
from flockbrush.behaviours.mixture import load_path
from flockbrush.behaviours.tomlfile import read_bytes
from flockbrush.cli.level_commands import find_brush
from flockbrush.levels.libraries import library_for_file
from flockbrush.runs import terminal
from flockbrush.runs.terminal import any_refused, print_line


def check_brushes(files):
    """Print every problem of some brushes and of paths between brushes, one line each."""
    if any_refused(files, _check_brush):
        raise typer.Exit(terminal.PROBLEM)


def _check_brush(name):
    if name.endswith(PATH_SUFFIX):
        _check_path(name)
        return
    brush = find_brush(name)
    print_line(f"{name}: ok: {brush.title or brush.name}, model {brush.model}")
    if brush.has_own_body and not brush.made_for and Path(name).suffix:
        convert = shlex.join(["flockbrush", "brush", "convert", name])
        print_line(f"{name}: note: the brush has its own [body]; `{convert}` moves it to a species")


def _check_path(name):
    source = read_bytes(name)
    path = load_path(source, name)
    ends = path.start, path.end
    beside = [file for end in ends if (file := Path(name).with_name(end + SUFFIX)).is_file()]
    library = library_for_file(name).with_files({file.name: read_bytes(file) for file in beside})
    known = [end for end in ends if library.file_of(end) is not None]
    load_path(source, name, map(library.get, known))  # its detour, by the brushes
    kind = "even" if path.even else "bistable" if path.bistable else "uneven"
    print_line(f"{name}: ok: path from {path.start} to {path.end}, {kind}")
    if missing := [repr(end) for end in ends if end not in known]:
        print_line(f"{name}: note: there is no brush {' and no brush '.join(missing)}, so [detour] was not checked")
