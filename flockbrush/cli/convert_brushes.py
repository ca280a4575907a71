"""The command ``flockbrush brush convert``, for brush files from versions without species."""

from __future__ import annotations

from pathlib import Path

import typer

from flockbrush.behaviours.brush_conversion import convert
from flockbrush.behaviours.species import SUFFIX
from flockbrush.behaviours.tomlfile import read_bytes
from flockbrush.engine.files import held, refused, write_bytes
from flockbrush.levels.libraries import library_for_file
from flockbrush.runs import terminal
from flockbrush.runs.terminal import any_refused, print_line


def convert_brushes(files, species="", output=None):
    """Convert brush files and print the result for each; a file is converted completely or not at all."""
    if any_refused(map(Path, files), lambda path: print_line(f"{path}: {_convert(path, species, output)}")):
        raise typer.Exit(terminal.PROBLEM)


def _convert(path, species, output):
    """Convert one file and return the text to print."""
    folder = path.parent if output is None else Path(output)
    fauna = library_for_file(path).species
    if convert(read_bytes(path), str(path), fauna, species) is None:
        return "nothing to convert"
    if not folder.is_dir():
        raise refused(folder, "folder not found")
    with held(folder / path.name):
        converted = convert(read_bytes(path), str(path), fauna, species)  # as it is now that nobody else writes it
        return "nothing to convert" if converted is None else _written(converted, folder, path.name)


def _written(converted, folder, name):
    """Write a converted brush and return the text to print."""
    summary = f"made for {', '.join(converted.made_for)}"
    if converted.species:
        beside = folder / f"{converted.made_for[0]}{SUFFIX}"
        write_bytes(beside, converted.species.encode(), overwrite=False)
        summary += f"; its body is now in {beside}: move that file to a folder 'species' beside the level"
    write_bytes(folder / name, converted.text.encode(), overwrite=True)
    return summary
