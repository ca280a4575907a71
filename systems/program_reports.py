"""Reports on programs: animals in each state, transitions, and the reasons of one animal."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.program_writer import toml
from flockbrush.behaviours.trigger import plain
from flockbrush.components import ProgramState
from flockbrush.components.program_state import BY_COMMAND, BY_END, BY_START
from flockbrush.engine.clock import Clock
from flockbrush.systems.programs import Programs


def count_by_state(world):
    """{program: {state: how many animals}}."""
    programs, agents = world.resource(Programs), world.agents
    counted = {}
    for number, compiled in enumerate(programs.compiled):
        states = agents[ProgramState.state][agents[ProgramState.program] == number]
        tally = np.bincount(states, minlength=len(compiled.names))
        counted[compiled.program.name] = dict(zip(compiled.names, tally.tolist(), strict=True))
    return counted


def transitions(world):
    """{program: {from: {to: how often}}}, without what never happened."""
    programs, counted = world.resource(Programs), {}
    for compiled in programs.compiled:
        matrix = programs.transitions[compiled.program.name]
        rows = {
            name: {compiled.names[j]: int(n) for j, n in enumerate(matrix[i]) if n}
            for i, name in enumerate(compiled.names)
        }
        counted[compiled.program.name] = {name: row for name, row in rows.items() if row}
    return counted


def reason(world, row):
    """(program, state, why) of one animal in words; None for one without a program."""
    programs, agents = world.resource(Programs), world.agents
    number = int(agents[ProgramState.program][row])
    if number < 0:
        return None
    compiled = programs.compiled[number]
    name = compiled.names[agents[ProgramState.state][row]]
    clock = world.resource(Clock)
    seconds = (clock.tick - int(agents[ProgramState.since][row])) * clock.dt
    return compiled.program.name, name, f"{_why(compiled, agents, row)}, for {seconds:.1f} s"


def _why(compiled, agents, row):
    cause, previous = int(agents[ProgramState.cause][row]), int(agents[ProgramState.previous][row])
    if cause == BY_START:
        return "from the start"
    if cause == BY_COMMAND:
        return "by command"
    was = compiled.names[previous] if previous >= 0 else "?"
    if cause == BY_END:
        return f"after its time in {was}"
    trigger = compiled.program.triggers[cause]
    return f"from {was}: {trigger.name or trigger_in_words(trigger)}"


def trigger_in_words(trigger):
    """A trigger's condition as its file has it."""
    return toml(plain(trigger.when))


def state_names(world):
    """Names of all states as one list, "" first for who follows no program; none in a world without programs."""
    compiled = world.resource(Programs).compiled
    if not compiled:
        return []
    names = [name for one in compiled for name in one.names]
    return ["", *(_label(one, name, names) for one in compiled for name in one.names)]


def _label(compiled, name, names):
    """A state by its name; with its program where two have one of that name."""
    return name if names.count(name) == 1 else f"{compiled.program.name}/{name}"


def state_keys(world):
    """PROGRAM/STATE of all states in the order of `state_names`: they stay when other programs come."""
    return "", *(f"{one.program.name}/{name}" for one in world.resource(Programs).compiled for name in one.names)


def state_codes(world):
    """(n,) int: the state of each animal as an index into `state_names`."""
    programs, agents = world.resource(Programs), world.agents
    first = np.cumsum([1, *(len(compiled.names) for compiled in programs.compiled)])
    number = agents[ProgramState.program]
    return np.where(number < 0, 0, first[np.maximum(number, 0)] + agents[ProgramState.state])


OTHERWISE = ("#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#76b7b2", "#edc948", "#9c755f")  # by number


def state_colours(world):
    """{state by its name in `state_names`: its colour, #rrggbb}: as its file says, or one of a series."""
    names = state_names(world)
    states = [state for one in world.resource(Programs).compiled for state in one.states]
    named_states = zip(names[1:], states, strict=True)
    return {name: state.colour or OTHERWISE[k % len(OTHERWISE)] for k, (name, state) in enumerate(named_states)}
