"""Implementation of ``flockbrush program ...``, and the events of --event."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import typer

from flockbrush.behaviours.brush import can_move
from flockbrush.behaviours.program import SUFFIX, known_brushes, load_program, shipped_programs
from flockbrush.behaviours.program_writer import shares, toml, trigger_table
from flockbrush.behaviours.trigger import ANYONE, KIN, OTHERS
from flockbrush.cli.shared_options import wrong
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from flockbrush.levels.build import build
from flockbrush.levels.libraries import library_for_file, programs_for_file
from flockbrush.levels.schema import Level, Spawn
from flockbrush.runs import terminal
from flockbrush.runs.terminal import any_refused, print_json, print_line, say, show, styled, table
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.program_commands import Event
from flockbrush.systems.program_reports import count_by_state, transitions
from flockbrush.systems.selection import check_can_follow

DENSITY = 0.25  # animals per square body length at the start of a test
INTRUDER_AFTER = 5.0  # s


# files ---------------------------------------------------------------------------------------


def find_program(name):
    """(program, file name) of a shipped name or a file; ProblemsError if there is none."""
    if Path(name).name != name or name.endswith(SUFFIX) or Path(name).suffix:
        return load_program(Path(name)), str(name)
    return shipped_programs().get(name), f"{name}{SUFFIX}"


def list_programs(json):
    """Print a table of the shipped programs, or a JSON list."""
    library = shipped_programs()
    programs = [library.get(name) for name in library.names()]
    if json:
        print_json([{"name": p.name, "title": p.title, "states": list(p.states), "sha256": p.sha256} for p in programs])
        return
    rows = ((p.name, ", ".join(p.states), len(p.triggers), p.description) for p in programs)
    show(table("program", "states", "triggers", "description", rows=rows, right=("triggers",)))


def show_program(name, json):
    """Print a program: its states and triggers."""
    program, _ = find_program(name)
    if json:
        print_json(as_json(program))
        return
    show(styled("[bold]{}[/]   {}", program.title or program.name, program.name))
    if program.description:
        show(program.description)
    if program.source_note:
        show(f"source: {program.source_note}")
    states_table = table("state", "brush", "for", "then", "emits")
    for state, entry in program.states.items():
        then = "-" if entry.then is None else _shares(entry.then)
        cells = (entry.brush or "(unchanged)", str(entry.lasts or "-"), then, entry.emits or "-")
        states_table.add_row(styled("[{}]██[/] {}", entry.colour, state) if entry.colour else state, *cells)
    show(states_table)
    rows = ((t.name or "-", ", ".join(t.sources), t.to, _when(t), str(t.delay or "-")) for t in program.triggers)
    show(table("trigger", "from", "to", "when", "delay", rows=rows))
    print_line(f"start: {_shares(program.beginnings)}; sha256 {program.sha256}")


def as_json(program):
    """A program as plain data."""
    return {
        "schema": "flockbrush.program/1",
        "sha256": program.sha256,
        "name": program.name,
        "title": program.title,
        "description": program.description,
        "start": dict(program.beginnings),
        "states": {
            name: {
                "brush": state.brush,
                "for": None if state.lasts is None else str(state.lasts),
                "then": None if state.then is None else dict(state.then),
                "emits": state.emits,
                "emits_within": None if state.emits_within is None else str(state.emits_within),
                "colour": state.colour,
            }
            for name, state in program.states.items()
        },
        "triggers": [
            {name: str(value) if name == "delay" else value for name, value in trigger_table(trigger).items()}
            for trigger in program.triggers
        ],
    }


def _shares(pairs):
    parts = shares(pairs)
    return parts if isinstance(parts, str) else ", ".join(f"{name} {weight:g}" for name, weight in parts.items())


def _when(trigger):
    return toml(trigger_table(trigger)["when"])


def check_programs(files):
    """Print every problem and note about some programs, one line each."""
    if any_refused(files, _check_program):
        raise typer.Exit(terminal.PROBLEM)


def _check_program(name):
    program, file = find_program(name)
    library = library_for_file(name)
    if wrong := known_brushes(program, library.names(), file):
        raise ProblemsError(wrong)
    for line in oddities(program, file, library.species.names(), programs_for_file(name)):
        say(f"note: {line}")
    size = f"{len(program.states)} states, {len(program.triggers)} triggers"
    print_line(f"{name}: ok: {program.title or program.name}, {size}")


def oddities(program, file, species, programs):
    """Notes that are not errors: states that no trigger leads to, unknown names, conditions that never change.

    Parameters
    ----------
    species : sequence of str
        Names that there are.
    programs : ProgramLibrary
        Those whose states the program can name.
    """
    reached = {name for name, _ in program.beginnings} | {trigger.to for trigger in program.triggers}
    reached |= {name for state in program.states.values() for name, _ in state.then or ()}
    for name in program.states:
        if name not in reached:
            yield Problem(file, None, f"state.{name}", "no trigger leads to this state; only a command can set it")
    for name in program.references("species"):
        if name not in (ANYONE, KIN, OTHERS, *species):
            message = f"there is no species {name!r}{did_you_mean(name, species)}"
            yield Problem(file, None, None, message)
    for k, trigger in enumerate(program.triggers):
        for odd in filter(None, (part.oddity() for part in trigger.when.walk())):
            yield Problem(file, None, f"trigger[{k}].when", odd)
    for name in program.references("state"):
        other, slash, state = name.partition("/")
        found = programs.get(other) if slash and other in programs.names() else None
        if found is not None and state not in found.states:
            message = f"the program {other!r} has no state {state!r}{did_you_mean(state, found.states)}"
            yield Problem(file, None, None, message)


# on a plane ------------------------------------------------------------------------------------


def species_for(program, library):
    """A species that can move by all brushes of a program: sheep, one that a brush is made for, or any other."""
    fauna, brushes = library.species, [library.get(name) for name in program.brushes]
    made_for = [name for brush in brushes for name in brush.made_for if name in fauna.names()]
    able = (
        name for name in ("sheep", *made_for, *fauna.names())
        if all(can_move(fauna.get(name), brush) for brush in brushes)
    )  # fmt: skip
    return next(able, "sheep")


def plane_for(program, library, animals, species, intruder, seed):
    """A simulation of a herd under the program on an endless plane; an intruder may arrive later.

    Parameters
    ----------
    intruder : (str, str) or None
        Species and brush.
    """
    brush = next(iter(program.brushes), "graze")
    side = math.sqrt(animals / DENSITY) * library.species.get(species).body.length
    size = side + 200.0
    low, high = 0.5 * (size - side), 0.5 * (size + side)
    herd = Spawn(1, "herd", _box(low, low, high, high), species, brush, animals, program=program.name)
    spawns = [herd]
    if intruder is not None:
        west = low - 40.0
        place = _box(west, 0.5 * size - 4.0, west + 8.0, 0.5 * size + 4.0)
        spawns.append(Spawn(2, "intruder", place, *intruder, 1, 0.0, start=INTRUDER_AFTER))
    level = Level("plane", None, size, size, max(size / 64, 4.0), "open", seed, spawns=spawns)
    level.programs = {program.name: program}
    return build(level, library=library)


def _box(west, south, east, north):
    return np.array([(west, south), (east, south), (east, north), (west, north)], float)


def test_program(name, animals, seconds, seed, species, intruder, events, json):
    """Run a program on a plane; print the number of animals in each state over time, and the transitions."""
    program, file = find_program(name)
    library = library_for_file(name)
    wrong = known_brushes(program, library.names(), file)
    if wrong:
        raise ProblemsError(wrong)
    for what in ("region", "goal", "place"):
        for place in program.references(what):
            say(f"note: {file}: the plane has no {what} {place!r}: no animal is ever in it or near it")
    newcomer = read_intruder(intruder, library)
    species = known_species(species, library, "--species") if species else species_for(program, library)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = plane_for(program, library, animals, species, newcomer, seed)
        try:
            check_can_follow(simulation.world, program, SpeciesList([species], library.species))
        except ValueError as error:
            raise refused("--species", str(error)) from None
        submit_events(simulation, events)
        series, every = [], max(1, round(seconds / 8 / simulation.clock.dt))
        ticks = round(seconds / simulation.clock.dt)
        with terminal.progress(program.name, ticks) as bar:
            for tick in range(ticks + 1):
                if tick:
                    simulation.tick()
                if tick % every == 0 or tick == ticks:
                    series.append((simulation.clock.now, count_by_state(simulation.world)[program.name]))
                interrupts.check()
                bar(tick)
    report = {
        "program": program.name,
        "animals": animals,
        "seconds": seconds,
        "seed": seed,
        "species": species,
        "states": [{"time": time, **here} for time, here in series],
        "transitions": transitions(simulation.world)[program.name],
    }
    print_json(report) if json else _show_test(program, series, report)


def _show_test(program, series, report):
    names = list(program.states)
    title = f"{program.name}: {report['animals']} animals ({report['species']}) on a plane, seed {report['seed']}"
    rows = ((f"{time:g}", *(str(state_counts[name]) for name in names)) for time, state_counts in series)
    show(table("seconds", *names, rows=rows, title=title, right=("seconds", *names)))
    show(transition_table(names, report["transitions"]))
    silent = [t for t in program.triggers if not any(t.to in report["transitions"].get(s, {}) for s in program.states)]
    for trigger in silent:
        say(f"note: no animal entered {trigger.to} ({trigger.name or _when(trigger)})")


def transition_table(names, went):
    """Table of the number of transitions from the state of each row to the state of each column."""
    rows = ((name, *(str(went.get(name, {}).get(to, "·")) for to in names)) for name in names)
    return table("from \\ to", *names, rows=rows, title="transitions", right=tuple(names))


def read_intruder(text, library):
    """(species, brush) of "wolf:wolf-hunt"; None for an empty text."""
    if not text:
        return None
    species, _, brush = text.partition(":")
    if not species or not brush:
        raise wrong("--intruder", f"must be SPECIES:BRUSH such as wolf:wolf-hunt, got {text!r}")
    if brush not in library.names():
        hint = did_you_mean(brush, library.names())
        raise wrong("--intruder", f"there is no brush {brush!r}{hint}")
    return known_species(species, library, "--intruder"), brush


def known_species(name, library, option):
    """The name of a species that there is; typer.BadParameter that names the option."""
    names = library.species.names()
    if name not in names:
        raise wrong(option, f"there is no species {name!r}{did_you_mean(name, names)}")
    return name


# events of a run ---------------------------------------------------------------------------------

_EVENT = re.compile(r"(?P<at>[^:]+):(?P<name>[^@]+)(?:@(?P<place>.+))?")


def read_event(text):
    """(seconds, `Event`) of "2.5:alarm", or of "2.5:alarm@120,80,15" for those within 15 m of (120, 80)."""
    match = _EVENT.fullmatch(text)
    error = wrong("--event", f"must be SECONDS:NAME or SECONDS:NAME@X,Y,RADIUS such as 2.5:alarm, got {text!r}")
    if match is None:
        raise error
    try:
        at = float(match["at"])
        place = [float(word) for word in match["place"].split(",")] if match["place"] else [0.0, 0.0, 0.0]
    except ValueError:
        raise error from None
    if len(place) != 3 or not all(map(math.isfinite, (at, *place))) or at < 0 or place[2] < 0 or at > 1e7:
        raise error
    return at, Event(match["name"].strip(), *place)


def submit_events(simulation, texts, ticks=None):
    """Schedule the events of a command line; typer.BadParameter if no program listens for an event.

    Or if it is after the end of a run of so many ticks.
    """
    for text in texts or ():
        at, event = read_event(text)
        try:
            event.check(simulation.world)
        except ValueError as error:
            raise wrong("--event", str(error)) from None
        end = math.inf if ticks is None else ticks * simulation.clock.dt
        if at >= end:
            raise wrong("--event", f"{text}: the run ends at {end:g} s, before this event")
        simulation.submit(event, math.ceil(at / simulation.clock.dt - 1e-9))
