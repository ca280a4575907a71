"""Brushes and programs that were changed in a session, and may be in no file as they are."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import PurePosixPath

from pydantic import BaseModel, ValidationError

from flockbrush.behaviours.brush import SUFFIX as BRUSH_SUFFIX
from flockbrush.behaviours.brush import Brush, load_brush
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.program import SUFFIX, Program, load_program
from flockbrush.engine.problems import ProblemsError
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import UseBrush
from flockbrush.systems.program_commands import UseProgram


class BrushFiles:
    """The brushes of a run, once their files are read again for a run that begins anew.

    Parameters
    ----------
    own : sequence of Brush
        Of the run, as they were tuned.
    branch : Branch
        Of the run: what it began with.
    library : BrushLibrary
        The files as they are now.

    Attributes
    ----------
    changed : dict of str to (Brush, Brush)
        Those whose files were changed meanwhile: as they were when they were loaded, and as they are now.
    brushes : list of Brush
        What the new run has, one after another: a brush as its file is before the same as it was tuned.
    """

    def __init__(self, own: Iterable[Brush], branch, library):
        self.changed: dict[str, tuple[Brush, Brush]] = {}
        self.brushes: list[Brush] = []
        for brush in own:
            loaded = _loaded(branch, brush.name)
            with suppress(ProblemsError):  # it has no file, or none that can be read
                now = library.get(brush.name)
                if loaded is not None and now != loaded:
                    self.changed[brush.name] = loaded, now
            loaded = self.changed.get(brush.name, (loaded, loaded))[1]
            self.brushes += [*([] if loaded is None else [loaded]), self._renewed(brush)]

    def _renewed(self, brush):
        return _with_tuned(*self.changed[brush.name], brush) if brush.name in self.changed else brush

    def renewed(self, command):
        """A command that brings a brush, with the file of now where that was changed; others stay."""
        if not isinstance(command, UseBrush) or command.name not in self.changed:
            return command
        return UseBrush(command.name, brush_to_toml(self._renewed(command.brush())))


def _loaded(branch, name) -> Brush | None:
    """A brush as a branch began with it, or as the first command that brought it."""
    base = name + BRUSH_SUFFIX
    data = next((data for file, data in branch.assets.items() if PurePosixPath(file).name == base), None)
    if data is not None:
        return load_brush(data, base)
    brought = (command for _, command in branch.commands if isinstance(command, UseBrush) and command.name == name)
    first = next(brought, None)
    return None if first is None else first.brush()


def _with_tuned(loaded: Brush, now: Brush, tuned: Brush) -> Brush:
    """The brush of a file that was changed since it was loaded, with what was tuned where the file is as before."""
    if not loaded.model == now.model == tuned.model:
        return now
    kept = {}
    for name in Brush.model_fields:
        before, after, own = (getattr(brush, name) for brush in (loaded, now, tuned))
        kept[name] = after
        if isinstance(after, BaseModel) and type(before) is type(after) is type(own):
            mine = {k: v for k, v in own if v != getattr(before, k) and getattr(after, k) == getattr(before, k)}
            with suppress(ValidationError):  # it does not go with what is new in the file
                kept[name] = type(after)(**{**dict(after), **mine})
        elif own != before and after == before:
            kept[name] = own
    return now.model_copy(update=kept)


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
