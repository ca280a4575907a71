"""Commands for programs: events, states given by hand, programs put into the running world."""

from __future__ import annotations

import math

import numpy as np
from flockbrush.behaviours.program import known_brushes, load_program
from flockbrush.behaviours.trigger import Happening
from flockbrush.components import ProgramState
from flockbrush.components.program_state import BY_COMMAND
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs, enrol, put_in_state, replace_program
from flockbrush.systems.selection import OfAnimals, check_circle
from flockbrush.systems.undo import columns_now, need

COLUMNS = tuple(ProgramState.fields.values())


@command
class Event:
    """Have animals hear a named event in this tick: all, or those within ``radius`` of (x, y)."""

    name: str
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        check_circle(self)
        known = heard(world)
        need(known, f"no program of this world listens for an event, so {self.name!r} would change nothing")
        need(self.name in known, f"no program listens for the event {self.name!r}{did_you_mean(self.name, known)}")

    def inverse(self, world):
        return [TakeBackEvent(self.name, self.x, self.y, self.radius), *columns_now(world, in_programs(world), COLUMNS)]

    def happening(self):
        """The event as programs hear it."""
        return Happening(self.name, (self.x, self.y, 0.0), self.radius if self.radius > 0 else math.inf)

    def apply(self, world):
        world.resource(Programs).raise_event(self.happening())


@command
class TakeBackEvent:
    """Take an event back that nobody has heard yet."""

    name: str
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m

    def inverse(self, world):
        mine = Event(self.name, self.x, self.y, self.radius)
        return [mine] if mine.happening() in world.resource(Programs).events else []

    def apply(self, world):
        mine = Event(self.name, self.x, self.y, self.radius).happening()
        programs = world.resource(Programs)
        programs.events = [event for event in programs.events if event != mine]


def heard(world):
    """Names of events that some program of the world listens for."""
    return sorted({name for program in world.resource(Programs).programs for name in program.events})


def in_programs(world):
    """(k,) rows of the animals that follow a program."""
    return np.flatnonzero(world.agents[ProgramState.program] >= 0)


@command
class SetState(OfAnimals):
    """Put animals into a state of their program: all of a program, one species, or those in a circle.

    It is not counted as a transition, and raises no event.
    """

    changes = COLUMNS
    program: str
    state: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        check_circle(self)
        programs = world.resource(Programs)
        known = programs.compiled[programs.named(self.program)].names
        need(self.state in known, f"{self.program} has no state {self.state!r}{did_you_mean(self.state, known)}")

    def chosen(self, world):
        number = world.resource(Programs).named(self.program)
        return super().chosen(world) & (world.agents[ProgramState.program] == number)

    def apply(self, world):
        programs, rows = world.resource(Programs), self.rows(world)
        compiled = programs.compiled[programs.named(self.program)]
        to, cause = np.full(len(rows), compiled.number[self.state]), np.full(len(rows), BY_COMMAND)
        if len(rows):
            put_in_state(world, compiled, rows, to, cause, world.resource(Clock).tick)


@command
class GiveProgram(OfAnimals):
    """Have animals follow a program from its start; an empty name: none.  All, one species, or those in a circle."""

    changes = COLUMNS
    program: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        check_circle(self)
        if self.program:
            world.resource(Programs).named(self.program)

    def apply(self, world):
        enrol(world, world.agents.ids[self.rows(world)], self.program)


@command
class UseProgram:
    """Bring a program into the world: its name, and the text of its file.  One of the same name is replaced."""

    name: str
    source: str
    counts: list | None = None  # transitions so far, states by states; None: as they are, by the names of states

    def check(self, world):
        self.program(world)

    def program(self, world):
        """The asset; ValueError with what is wrong with it."""
        try:
            program = load_program(self.source.encode(), f"{self.name}.program.toml")
        except ProblemsError as error:
            raise ValueError(str(error)) from None
        wrong = known_brushes(program, world.resource(Palette).names, f"{self.name}.program.toml")
        need(not wrong, "\n".join(map(str, wrong)))
        if self.counts is not None:
            size = len(program.states)
            fits = np.shape(self.counts) == (size, size) and np.array(self.counts).dtype.kind == "i"
            need(fits, f"counts must be {size} rows of {size} whole numbers")
        return program

    def inverse(self, world):
        return program_now(world, self.name)

    def apply(self, world):
        replace_program(world, self.program(world))
        if self.counts is not None:
            world.resource(Programs).transitions[self.name] = np.array(self.counts, np.int64)


def program_now(world, name):
    """Commands that have a program in the world as it is there now, with the states of its animals, or not."""
    programs = world.resource(Programs)
    if name not in programs.names:
        return [ForgetProgram(name)]
    number = programs.named(name)
    source, matrix = programs.programs[number].source.decode(), programs.transitions[name]
    rows = np.flatnonzero(world.agents[ProgramState.program] == number)
    return [UseProgram(name, source, matrix.tolist()), *columns_now(world, rows, COLUMNS)]


@command
class ForgetProgram:
    """Take the newest program out of the world again; one that somebody follows stays."""

    name: str

    def inverse(self, world):
        return program_now(world, self.name)

    def apply(self, world):
        programs = world.resource(Programs)
        number = programs.named(self.name)
        followed = (world.agents[ProgramState.program] == number).any()
        if not followed and number == len(programs) - 1:
            programs.forget(self.name)


__all__ = ["Event", "ForgetProgram", "GiveProgram", "SetState", "TakeBackEvent", "UseProgram"]
