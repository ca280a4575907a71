"""Commands for programs: events, states given by hand, programs put into the running world."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.program import known_brushes, load_program
from flockbrush.behaviours.trigger import Happening
from flockbrush.components import ProgramState, Species
from flockbrush.components.program_state import BY_COMMAND
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.programs import Programs, enrol, put_in_state, replace_program
from flockbrush.systems.selection import OfAnimals, check_can_follow, check_circle
from flockbrush.systems.undo import TouchedColumns, need, need_plain

COLUMNS = tuple(ProgramState.fields.values())


class TouchedEvents(NamedTuple):
    """Events that were raised and not heard yet."""

    @staticmethod
    def taken(world):
        return list(world.resource(Programs).events)

    @staticmethod
    def back(world, taken):
        now = world.resource(Programs).events
        return [
            *(TakeBackEvent(*_event(event)) for event in now if event not in taken),
            *(Event(*_event(event)) for event in taken if event not in now),
        ]


def _event(happening):
    """The fields of the command for an event."""
    return happening.name, *happening.xyz[:2], 0.0 if math.isinf(happening.reach) else happening.reach


@command
class Event:
    """Have animals hear a named event in this tick: all, or those within ``radius`` of (x, y)."""

    name: str
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        check_circle(self)
        known = event_names(world)
        need(known, f"no program of this world listens for an event, so {self.name!r} would change nothing")
        need(self.name in known, f"no program listens for the event {self.name!r}{did_you_mean(self.name, known)}")

    def touches(self, world):
        return [TouchedEvents(), TouchedColumns(in_programs(world), COLUMNS, later=True)]

    def happening(self):
        """The event as programs hear it."""
        return Happening(self.name, (self.x, self.y, 0.0), self.radius if self.radius > 0 else math.inf)

    def apply(self, world):
        world.resource(Programs).raise_event(self.happening())


@command
class TakeBackEvent:
    """Take back an event that was not heard yet."""

    name: str
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m

    def touches(self, world):
        return [TouchedEvents()]

    def apply(self, world):
        happening = Event(self.name, self.x, self.y, self.radius).happening()
        programs = world.resource(Programs)
        programs.events = [event for event in programs.events if event != happening]


def event_names(world):
    """Names of events that some program of the world listens for."""
    return sorted({name for program in world.resource(Programs).programs for name in program.events})


def fauna_of(world, rows):
    """`SpeciesList` of the species of some animals."""
    fauna, kinds = world.resource(SpeciesList), np.unique(world.agents[Species.index][rows])
    return SpeciesList([fauna.names[k] for k in kinds], fauna.library)


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
        super().check(world)
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
        super().check(world)
        if self.program:
            programs = world.resource(Programs)
            check_can_follow(world, programs.programs[programs.named(self.program)], fauna_of(world, self.rows(world)))

    def apply(self, world):
        enrol(world, world.agents.ids[self.rows(world)], self.program)


class TouchedProgram(NamedTuple):
    """A program of the world by its name, with the states of the animals that follow it."""

    name: str

    def taken(self, world):
        programs = world.resource(Programs)
        if self.name not in programs.names:
            return None
        number = programs.named(self.name)
        states = TouchedColumns(np.flatnonzero(world.agents[ProgramState.program] == number), COLUMNS, later=True)
        return programs.programs[number], programs.transitions[self.name].tolist(), states, states.taken(world)

    def back(self, world, taken):
        programs = world.resource(Programs)
        known = self.name in programs.names
        if taken is None:
            return [ForgetProgram(self.name)] if known else []
        program, counts, states, before = taken
        if known and programs.programs[programs.named(self.name)] is program:
            return []
        return [UseProgram(self.name, program.source.decode(), counts), *states.back(world, before)]


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
        need_plain(self.name)
        try:
            program = load_program(self.source.encode(), f"{self.name}.program.toml")
        except ProblemsError as error:
            raise ValueError(str(error)) from None
        wrong = known_brushes(program, world.resource(Palette).names, f"{self.name}.program.toml")
        need(not wrong, "\n".join(map(str, wrong)))
        programs = world.resource(Programs)
        if self.name in programs.names:
            follow = world.agents[ProgramState.program] == programs.named(self.name)
            check_can_follow(world, program, fauna_of(world, np.flatnonzero(follow)))
        if self.counts is not None:
            size = len(program.states)
            fits = np.shape(self.counts) == (size, size) and np.array(self.counts).dtype.kind == "i"
            need(fits, f"counts must be {size} rows of {size} whole numbers")
        return program

    def touches(self, world):
        return [TouchedProgram(self.name)]

    def foresee(self, world):
        world.resource(Programs).put(self.program(world))

    def apply(self, world):
        replace_program(world, self.program(world))
        if self.counts is not None:
            world.resource(Programs).transitions[self.name] = np.array(self.counts, np.int64)


@command
class ForgetProgram:
    """Take the newest program out of the world again; one that somebody follows stays."""

    name: str

    def touches(self, world):
        return [TouchedProgram(self.name)]

    def apply(self, world):
        programs = world.resource(Programs)
        number = programs.named(self.name)
        followed = (world.agents[ProgramState.program] == number).any()
        if not followed and number == len(programs) - 1:
            programs.forget(self.name)


__all__ = ["Event", "ForgetProgram", "GiveProgram", "SetState", "TakeBackEvent", "UseProgram"]
