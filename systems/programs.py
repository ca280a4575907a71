"""DECIDE: programs.  In which state every animal is, and what leads it to another."""

from __future__ import annotations

import base64
import json
import math

import numpy as np
from flockbrush.behaviours.program import EVERY, Program, load_program
from flockbrush.behaviours.trigger import Happening, answer
from flockbrush.components import (
    Alarm,
    Body,
    BrushBinding,
    Destination,
    Ground,
    Heading,
    Position,
    ProgramState,
    Species,
    Velocity,
    Vision,
)
from flockbrush.components.program_state import BY_COMMAND, BY_END
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.grid import farthest_sight
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.named_regions import in_region, zone_events, zones_with_event
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.program_senses import WorldSenses
from flockbrush.systems.senses import Near, Sight, SightInSpace

NEVER = np.iinfo(np.int64).max  # tick of what does not end


class Compiled:
    """A program as the system runs it."""

    def __init__(self, program: Program):
        self.program = program
        self.names = list(program.states)  # of the states by number
        number = {name: k for k, name in enumerate(self.names)}
        self.number = number
        self.to = np.array([number[t.to] for t in program.triggers], np.int32)  # (triggers,); the state it leads to
        # (triggers, states) bool; out of which states a trigger leads
        self.sources = np.zeros((len(program.triggers), len(self.names)), bool)
        for k, trigger in enumerate(program.triggers):
            for name in trigger.sources:
                if name == EVERY:
                    self.sources[k] = np.arange(len(self.names)) != self.to[k]
                else:
                    self.sources[k, number[name]] = True
        self.memories = program.memories()
        # place in `ProgramState.memory` of each thing remembered
        self.slots = {part.memory(): slot for slot, part in enumerate(self.memories)}
        self.states = list(program.states.values())
        parts = [part for trigger in program.triggers for part in trigger.when.walk()]
        self.needs = {need for part in parts for need in part.needs}

    def brush_numbers(self, palette):
        """(states,) index of each state's brush; -1 where it gives none."""
        return np.array([-1 if s.brush is None else palette.named(s.brush) for s in self.states], np.int32)


class Programs:
    """The programs of a world, what has just happened in it, and how often states changed."""

    def __init__(self):
        self.programs: list[Program] = []  # by number
        self.compiled: list[Compiled] = []
        self.events: list[Happening] = []  # raised since the last tick, and heard in the next
        # str to (states, states) int64; by program: how often animals went from the row's state to the column's
        self.transitions: dict[str, np.ndarray] = {}
        self.known: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # ids, xyz, species of the last tick

    def __len__(self):
        return len(self.programs)

    @property
    def hashed(self):
        """A world without programs has the state it always had."""
        return bool(self.programs)

    @property
    def names(self):
        return [program.name for program in self.programs]

    def named(self, name):
        """Number of the program of this name; LookupError with what there is."""
        if name not in self.names:
            raise LookupError(f"this world has no program {name!r}; it has {', '.join(self.names) or 'none'}")
        return self.names.index(name)

    def put(self, program):
        """Number of this program; one of the same name is replaced."""
        names = self.names
        number = names.index(program.name) if program.name in names else len(names)
        self.programs[number : number + 1] = [program]
        self.compiled[number : number + 1] = [Compiled(program)]
        self.transitions[program.name] = np.zeros((len(program.states),) * 2, np.int64)
        return number

    def forget(self, name):
        """Drop the newest program again."""
        if not self.programs or self.programs[-1].name != name:
            raise ValueError(f"{name!r} is not the newest program")
        self.programs.pop()
        self.compiled.pop()
        del self.transitions[name]

    @property
    def needs(self):
        """What some trigger asks the senses for that has to be kept from tick to tick (`Condition.needs`)."""
        return set().union(*(compiled.needs for compiled in self.compiled))

    def raise_event(self, event: Happening):
        """Have an event be heard in the next tick; the same one twice is one."""
        if event not in self.events:
            self.events.append(event)

    # the state of the world (see `flockbrush.engine.state`)

    def state(self):
        """Everything in it that changes while the world runs, and the programs, which commands may change."""
        known = None if self.known is None else [_packed(column) for column in self.known]
        saved = {
            "programs": [[p.name, p.source.decode()] for p in self.programs],
            "events": [[e.name, list(e.xyz), None if math.isinf(e.reach) else e.reach, e.entity] for e in self.events],
            "transitions": {name: matrix.tolist() for name, matrix in self.transitions.items()},
            "known": known,
        }
        return json.dumps(saved).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        saved = json.loads(data)
        before = {program.name: program for program in self.programs}
        self.programs, self.compiled, self.transitions = [], [], {}
        for name, source in saved["programs"]:
            same = name in before and before[name].source.decode() == source
            self.put(before[name] if same else load_program(source.encode(), f"{name}.program.toml"))
        for name, matrix in saved["transitions"].items():
            self.transitions[name] = np.array(matrix, np.int64).reshape(self.transitions[name].shape)
        self.events = [
            Happening(name, tuple(xyz), math.inf if reach is None else reach, entity)
            for name, xyz, reach, entity in saved["events"]
        ]
        known = saved["known"]
        shapes = (np.int64, (-1,)), (np.float64, (-1, 3)), (np.int32, (-1,))
        self.known = known and tuple(
            np.frombuffer(base64.b64decode(text), kind).reshape(shape)
            for text, (kind, shape) in zip(known, shapes, strict=True)
        )


def _packed(column):
    return base64.b64encode(np.ascontiguousarray(column).tobytes()).decode()


class RunPrograms(System):
    """Evaluates triggers, counts delays and durations, and changes states.

    Of two triggers in one tick the first in the file counts.  While the delay of one runs, an earlier one may take its
    place.  The end of a state's own time comes after all triggers.
    """

    stage = Stage.STEER
    reads = (
        Position, Velocity, Heading, Body, Species, Vision, Ground, Destination, BrushBinding, Alarm, Near, Sight,
        SightInSpace, Landscape, Palette, SpeciesList, Clock, Noise,
    )  # fmt: skip
    writes = (ProgramState, Programs)

    def process(self, world):
        programs = world.resource(Programs)
        if not programs.programs:
            programs.known = None
            return
        happened, programs.events = programs.events, []
        happened = happened + zone_events(world, programs.known)
        senses = WorldSenses(world, programs, happened)
        agents = world.agents
        for number, compiled in enumerate(programs.compiled):
            rows = np.flatnonzero(agents[ProgramState.program] == number)
            if len(rows):
                self._run(world, programs, compiled, senses, rows)
        programs.known, needs = None, programs.needs
        if needs & {"births", "deaths"} or zones_with_event(world.resource(Landscape)):
            programs.known = agents.ids.copy(), agents[Position.xyz].copy(), agents[Species.index].copy()
        if "before" in needs:
            agents[ProgramState.before][:] = agents[Velocity.xyz]

    def _run(self, world, programs, compiled, senses, rows):
        """One program's animals."""
        agents, tick = world.agents, senses.tick
        senses.program(compiled)
        state, pending = agents[ProgramState.state][rows], agents[ProgramState.pending][rows]
        open_ = np.ones(len(rows), bool)
        to, cause = state.copy(), np.full(len(rows), BY_END, np.int32)
        for k, trigger in enumerate(compiled.program.triggers):
            candidates = compiled.sources[k][state] & open_ & ((pending < 0) | (pending > k))
            if not candidates.any():
                continue
            held = np.flatnonzero(candidates)[answer(trigger.when, senses, rows[candidates])]
            if trigger.delay is not None and trigger.delay.high > 0.0:
                pending[held] = k
                wait = senses.drawn(f"program {compiled.program.name} delay {k}", trigger.delay, rows[held])
                agents[ProgramState.due][rows[held]] = tick + np.round(wait / senses.dt).astype(np.int64)
            else:
                to[held], cause[held], open_[held] = compiled.to[k], k, False
        due = open_ & (pending >= 0) & (agents[ProgramState.due][rows] <= tick)
        to[due], cause[due], open_[due] = compiled.to[pending[due]], pending[due], False
        over = np.flatnonzero(open_)
        over = over[ends(senses, compiled, rows[over]) <= tick]
        to[over], open_[over] = after(senses, compiled, rows[over]), False
        agents[ProgramState.pending][rows] = pending
        self._remember(agents, compiled, senses, rows)
        moved = np.flatnonzero(~open_)
        if len(moved):
            enter(world, programs, compiled, rows[moved], to[moved], cause[moved], tick)

    @staticmethod
    def _remember(agents, compiled, senses, rows):
        """Note who has just now what the program remembers."""
        for slot, part in enumerate(compiled.memories):
            held = rows[answer(part, senses, rows, "held")]
            agents[ProgramState.memory][held, slot] = senses.tick


def enter(world, programs, compiled, rows, to, cause, tick):
    """Lead animals into states: the columns, the counts, and the events these states raise."""
    was = put_in_state(world, compiled, rows, to, cause, tick)
    np.add.at(programs.transitions[compiled.program.name], (was, to), 1)
    agents = world.agents
    for number in np.unique(to).tolist():
        state = compiled.states[number]
        if state.emits is None:
            continue
        within = state.emits_within
        for row in rows[to == number].tolist():
            reach = math.inf if within is None else float(within.of(agents[Body.length][row]))
            xyz = tuple(agents[Position.xyz][row].tolist()) if within is not None else (0.0, 0.0, 0.0)
            programs.raise_event(Happening(state.emits, xyz, reach))


def put_in_state(world, compiled, rows, to, cause, tick):
    """Write the columns of animals that are in these states from now on; the states they were in."""
    agents = world.agents
    was = agents[ProgramState.state][rows]
    agents[ProgramState.previous][rows] = was
    agents[ProgramState.state][rows] = to
    agents[ProgramState.brush][rows] = compiled.brush_numbers(world.resource(Palette))[to]
    agents[ProgramState.since][rows] = tick
    agents[ProgramState.cause][rows] = cause
    agents[ProgramState.pending][rows] = -1
    return was


def ends(senses, compiled, rows):
    """(k,) tick in which the state of each animal ends by itself; `NEVER` where it does not."""
    state = senses.state[rows]
    out = np.full(len(rows), NEVER)
    for number in np.unique(state).tolist():
        lasts = compiled.states[number].lasts
        if lasts is not None:
            here = np.flatnonzero(state == number)
            stream = f"program {compiled.program.name} lasts {compiled.names[number]}"
            seconds = senses.drawn(stream, lasts, rows[here], senses.since[rows[here]])
            out[here] = senses.since[rows[here]] + np.maximum(np.round(seconds / senses.dt), 1).astype(np.int64)
    return out


def after(senses, compiled, rows):
    """(k,) the state after the one that has ended."""
    state = senses.state[rows]
    out = state.copy()
    for number in np.unique(state).tolist():
        here = np.flatnonzero(state == number)
        stream = f"program {compiled.program.name} then {compiled.names[number]}"
        out[here] = chosen(senses, compiled, compiled.states[number].then, stream, rows[here])
    return out


def chosen(senses, compiled, shares, stream, rows):
    """(k,) numbers of states, by their weights."""
    numbers = np.array([compiled.number[name] for name, _ in shares], np.int32)
    if len(numbers) == 1:
        return np.full(len(rows), numbers[0], np.int32)
    limits = np.cumsum([weight for _, weight in shares])
    chance = senses.uniform(stream, rows) * limits[-1]
    return numbers[np.minimum(np.searchsorted(limits, chance, side="right"), len(numbers) - 1)]


# births and changes from outside ----------------------------------------------------------------


def enrol(world, entities, name):
    """Have these animals follow a program from its start; "" has them follow none."""
    agents, tick = world.agents, world.resource(Clock).tick
    rows = np.searchsorted(agents.ids, np.asarray(entities, np.int64))
    for field in ProgramState.fields.values():
        agents[field][rows] = field.default
    if not name or not len(rows):
        return
    programs = world.resource(Programs)
    number = programs.named(name)
    compiled = programs.compiled[number]
    key = world.resource(Noise).uniform(f"program {name} start", tick, agents.ids[rows])[:, 0]
    begin = _beginnings(compiled, key)
    agents[ProgramState.program][rows] = number
    agents[ProgramState.state][rows] = begin
    agents[ProgramState.brush][rows] = compiled.brush_numbers(world.resource(Palette))[begin]
    agents[ProgramState.since][rows] = tick
    agents[ProgramState.memory][rows] = tick - 2
    if "before" in compiled.needs:
        agents[ProgramState.before][rows] = agents[Velocity.xyz][rows]
    land = world.resource(Landscape)
    for slot, part in enumerate(compiled.memories):  # animals born in a region do not enter it
        what, *names = part.memory()
        if what == "region":
            inside = in_region(names[0], agents[Position.xyz][rows], land)
            agents[ProgramState.memory][rows[inside], slot] = tick - 1


def _beginnings(compiled, chance):
    shares = compiled.program.beginnings
    numbers = np.array([compiled.number[name] for name, _ in shares], np.int32)
    limits = np.cumsum([weight for _, weight in shares])
    return numbers[np.minimum(np.searchsorted(limits, chance * limits[-1], side="right"), len(numbers) - 1)]


def enrol_newborns(world, entities, name):
    """`enrol` for newborns, who begin under the brush of their first state."""
    if not name:
        return
    enrol(world, entities, name)
    agents = world.agents
    rows = np.searchsorted(agents.ids, np.asarray(entities, np.int64))
    brush = agents[ProgramState.brush][rows]
    rows, brush = rows[brush >= 0], brush[brush >= 0]
    palette = world.resource(Palette)
    agents[BrushBinding.brush][rows] = brush
    agents[BrushBinding.previous][rows] = brush
    view_range = palette.view_range[brush] * agents[Body.length][rows]
    agents[Vision.range][rows] = np.minimum(view_range, farthest_sight(world.resource(Landscape).wrap))
    agents[Vision.field_of_view][rows] = palette.field_of_view[brush]


def replace_program(world, program):
    """Put a program into the world; animals in one of the same name stay in their states by name, or start anew."""
    programs, agents = world.resource(Programs), world.agents
    old = programs.compiled[programs.named(program.name)] if program.name in programs.names else None
    counted = programs.transitions.get(program.name)
    number = programs.put(program)
    if old is None:
        return
    compiled = programs.compiled[number]
    _keep_counts(programs, old, counted, compiled)
    rows = np.flatnonzero(agents[ProgramState.program] == number)
    state = agents[ProgramState.state][rows]
    there = np.array([compiled.number.get(name, -1) for name in old.names], np.int32)[state]
    agents[ProgramState.state][rows] = there
    agents[ProgramState.pending][rows] = -1
    agents[ProgramState.previous][rows] = -1
    agents[ProgramState.cause][rows] = BY_COMMAND
    memory = agents[ProgramState.memory]
    before = memory[rows].copy()
    memory[rows] = world.resource(Clock).tick - 2
    for part, slot in compiled.slots.items():
        if part in old.slots:
            memory[rows, slot] = before[:, old.slots[part]]
    if "before" in compiled.needs - old.needs:
        agents[ProgramState.before][rows] = agents[Velocity.xyz][rows]
    lost = rows[there < 0]
    if len(lost):
        enrol(world, agents.ids[lost], program.name)
    rows = rows[there >= 0]
    agents[ProgramState.brush][rows] = compiled.brush_numbers(world.resource(Palette))[agents[ProgramState.state][rows]]


def _keep_counts(programs, old, counted, compiled):
    """Transitions between states that are still there go on being counted."""
    names = [name for name in compiled.names if name in old.number]
    new_numbers, old_numbers = [compiled.number[name] for name in names], [old.number[name] for name in names]
    programs.transitions[compiled.program.name][np.ix_(new_numbers, new_numbers)] = counted[
        np.ix_(old_numbers, old_numbers)
    ]
