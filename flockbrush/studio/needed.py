"""What a command names that the running world has not loaded yet, and the commands that load it."""

from __future__ import annotations

from flockbrush.behaviours.program import ProgramLibrary, shipped_programs
from flockbrush.levels.libraries import program_folders
from flockbrush.systems.mark_commands import DrawZone
from flockbrush.systems.program_commands import UseProgram
from flockbrush.systems.programs import Programs
from flockbrush.systems.undo import MixBrush, UseBrush


def needed(session, command):
    """Commands that load the brush and the program that a command names, and the mixed brushes of a zone.

    Raises
    ------
    ProblemsError
        When there is no such brush or program, or its file is wrong.
    """
    brush, program = getattr(command, "brush", ""), getattr(command, "program", "")
    commands = brush_needed(session, brush) if brush else []
    if program and program not in session.simulation.world.resource(Programs).names:
        commands += program_needed(session, programs_of(session).get(program))
    return commands + (_mixtures(session, command) if brush and isinstance(command, DrawZone) else [])


def programs_of(session):
    """The available programs: those beside the level, and the shipped ones."""
    folders = program_folders(session.path) if session.path else []
    return ProgramLibrary([*folders, *shipped_programs().folders])


def brush_needed(session, name):
    """Commands that load a brush into the world, if it is not loaded yet."""
    palette = session.palette
    if name in palette.index:
        return []
    brush = session.library.get(name)
    source = brush.source.decode() if isinstance(brush.source, bytes) else brush.source
    paths = {end: _paths_to(session, end, [name]) for end in palette.over}
    return [UseBrush(name, source), *(MixBrush(end, files) for end, files in paths.items() if files)]


def program_needed(session, program):
    """Commands that load a program, with the brushes of its states."""
    brushes = (one for name in program.brushes for one in brush_needed(session, name))
    return [*brushes, UseProgram(program.name, program.source.decode())]


def _mixtures(session, command):
    palette, brush = session.palette, command.brush
    if command.zone().bounds.blend != "mix" or brush in palette.over:
        return []
    return [MixBrush(brush, _paths_to(session, brush, [one.name for one in palette.own]))]


def _paths_to(session, end, starts):
    """{file: text} of the measured paths from some brushes to another."""
    paths = (session.library.path_between(start, end) for start in starts if start != end)
    return {file.name: text.decode() for file, text in filter(None, paths)}
