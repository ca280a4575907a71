"""Brushes and programs that were changed in a session, and may be in no file as they are."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.program import SUFFIX, Program, load_program
from flockbrush.engine.problems import ProblemsError
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import UseBrush
from flockbrush.systems.program_commands import UseProgram


def is_tuned(brush: Brush, library) -> bool:
    """Whether a brush has other numbers than its file; False if there is none, or it cannot be read now."""
    with suppress(ProblemsError):
        return library.get(brush.name) != brush
    return False


def tuned_by(commands: Iterable, library) -> list[Brush]:
    """Brushes as these commands leave them, one after another, if they have other numbers than their files.

    One that the commands made, which has no file, if they changed it afterwards.
    """
    texts: dict[str, UseBrush] = {}
    numbers: dict[str, dict[str, float]] = {}
    for command in commands:
        if isinstance(command, UseBrush):
            texts[command.name] = command
            numbers.pop(command.name, None)
        elif isinstance(command, SetParameter):
            numbers.setdefault(command.brush, {})[command.name] = command.value
    brushes = []
    for name in {**texts, **numbers}:
        with suppress(ProblemsError):  # of a brush between two others there is no file
            brush = texts[name].brush() if name in texts else library.get(name)
            brushes.append(brush.with_parameters(**numbers[name]) if name in numbers else brush)
    made = numbers.keys() - set(library.names())
    return [brush for brush in brushes if brush.name in made or is_tuned(brush, library)]


def _is_file(library, name, text):
    with suppress(ProblemsError):  # it cannot be read
        file = library.file_of(name)
        return file is not None and library.bytes_of(file) == text
    return False


def changed_by(commands: Iterable, library) -> list[Program]:
    """Programs as these commands leave them, one after another, if they are not those of the library."""
    texts = {command.name: command.source.encode() for command in commands if isinstance(command, UseProgram)}
    changed = {name: text for name, text in texts.items() if not _is_file(library, name, text)}
    return [load_program(text, f"{name}{SUFFIX}") for name, text in changed.items()]
