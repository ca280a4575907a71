"""Programs: when animals change their behaviour.  States, and the triggers between them.

A program is a file ``NAME.program.toml`` (``behaviours/programs`` has the shipped ones)::

    schema = "flockbrush.program/1"
    start = "graze"

    [state.graze]
    brush = "graze"

    [state.stampede]
    brush = "stampede"
    for = "8..12 s"  # drawn by each animal
    then = "graze"

    [[trigger]]
    from = "graze"
    to = "stampede"
    when = { sees = "wolf", within = "20 m" }
    delay = "0..0.6 s"
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from flockbrush.behaviours.amounts import Length, TimeRange
from flockbrush.behaviours.file_library import NAME, FileLibrary, check_schema, name_in, read_source
from flockbrush.behaviours.spec import FileSpec, Line, Spec, Text, spec_field
from flockbrush.behaviours.tomlfile import Key, TomlFile, parse_toml
from flockbrush.behaviours.trigger import Condition, read_condition
from flockbrush.behaviours.validation import shown, validated
from flockbrush.engine.files import write_bytes
from flockbrush.engine.limits import PROGRAM_MEMORIES, PROGRAM_STATES, PROGRAM_TRIGGERS
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from pydantic import BeforeValidator, Field

SCHEMA = "flockbrush.program/1"
SUFFIX = ".program.toml"
EVERY = "*"  # as ``from``: every state but the one it leads to


def _shares(value):
    """States and their weights: "graze", or a table of them."""
    if isinstance(value, str):
        return ((value, 1.0),)
    if isinstance(value, dict) and value:
        weights = [isinstance(w, (int, float)) and not isinstance(w, bool) and 0 < w <= 1e6 for w in value.values()]
        if all(weights) and len(value) == 1:
            return ((next(iter(value)), 1.0),)
        if all(weights):
            return tuple((name, float(weight)) for name, weight in value.items())
    if isinstance(value, tuple) and value and all(isinstance(pair, tuple) for pair in value):
        return value
    raise ValueError("must be a state, or a table of states and weights above 0")


def _several(value):
    names = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, (list, tuple)) else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise ValueError("must be a state or an array of states")
    return names


Shares = Annotated[tuple[tuple[str, float], ...], BeforeValidator(_shares)]
States = Annotated[tuple[str, ...], BeforeValidator(_several)]
Name = Annotated[str, Field(pattern=f"^{NAME.pattern}$", examples=["graze"])]
Word = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_ -]{0,63}$", examples=["alarm"])]


class State(Spec):
    """What an animal does until a trigger, or the end of its time, leads it elsewhere."""

    brush: Name | None = spec_field(
        None, "the brush that moves the animal; by default the painted brush or the animal's own", examples=["graze"]
    )
    lasts: TimeRange | None = Field(
        None, alias="for", description="duration of the state; with a range, each animal draws its own"
    )
    then: Shares | None = spec_field(None, "the next state, or a table of states and weights")
    emits: Word | None = spec_field(
        None, "name of the event raised when an animal enters the state", examples=["alarm"]
    )
    emits_within: Length | None = spec_field(None, "radius within which animals hear the event; default: everywhere")
    colour: Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")] | None = spec_field(
        None, "colour in charts and tables, #rrggbb", examples=["#c9a24b"]
    )

    model_config = {**Spec.model_config, "populate_by_name": True}


class Trigger(Spec):
    """What leads from some states to another."""

    name: Line = spec_field("", "name of the trigger in explanations")
    sources: States = Field(
        (EVERY,), alias="from", description="states that the trigger leads out of; default: every other state"
    )
    to: Name = spec_field(..., "the state that the trigger leads to")
    when: Condition = spec_field(..., "the condition")
    delay: TimeRange | None = spec_field(
        None, "time from the condition to the change; with a range, each animal draws its own"
    )

    model_config = {**Spec.model_config, "populate_by_name": True, "arbitrary_types_allowed": True}


class Program(FileSpec):
    """States and triggers, checked.

    Parameters
    ----------
    states : dict of str to State
        In the order of the file, which is the order of their numbers.
    triggers : tuple of Trigger
        In the order of the file: of two in one tick the first counts.
    """

    name: Name = spec_field(..., "the file's name without .program.toml")
    title: Line = spec_field("", "the name for people")
    description: Text = spec_field("", "what the animals do")
    source_note: Text = Field("", alias="source", description="the paper or person that the program is from")
    start: Shares | None = spec_field(None, "initial state, or a table of states and weights; default: the first state")
    states: dict[str, State] = spec_field(..., "what animals do")
    triggers: tuple[Trigger, ...] = spec_field((), "transitions from one state to another")

    model_config = {**Spec.model_config, "populate_by_name": True}

    def _as_file(self) -> str:
        from flockbrush.behaviours.program_writer import program_to_toml

        return program_to_toml(self)

    @property
    def beginnings(self) -> tuple[tuple[str, float], ...]:
        """States that animals begin in, with weights."""
        return self.start or ((next(iter(self.states)), 1.0),)

    @property
    def brushes(self) -> list[str]:
        """The brushes its states name, sorted."""
        return sorted({state.brush for state in self.states.values() if state.brush})

    def references(self, what: str) -> list[str]:
        """Names of a kind ("region", "goal", "place", "species", "event") in its conditions, each once."""
        names = (
            ref.name for t in self.triggers for part in t.when.walk() for ref in part.references() if ref.what == what
        )
        return list(dict.fromkeys(names))

    @property
    def events(self) -> list[str]:
        """Named events that its triggers listen for."""
        return self.references("event")

    def memories(self) -> list[Condition]:
        """Conditions that remember something, one for each thing remembered."""
        conditions = {part.memory(): part for t in self.triggers for part in t.when.walk() if part.remembers}
        return list(conditions.values())

    def __eq__(self, other):
        return isinstance(other, Program) and self.__dict__ == other.__dict__

    def __hash__(self):
        return hash(self.name)


# reading ---------------------------------------------------------------------------------------


def load_program(source: str | os.PathLike | bytes, file: str | None = None) -> Program:
    """Read a program.

    Parameters
    ----------
    source : path or bytes
        A ``NAME.program.toml`` file, or what is in it.
    file : str, optional
        Its name for messages; the program's name is its last part.  Needed with bytes.

    Raises
    ------
    ProblemsError
        With everything that is wrong with the file.
    """
    toml, source = read_source(source, file, SUFFIX)
    program = _read(toml)
    program._source = source
    return program


def _read(toml: TomlFile) -> Program:
    document = check_schema(toml, SCHEMA)
    name, problems = name_in(toml, SUFFIX)
    states, mistakes = _read_states(document.pop("state", None))
    triggers, more = _read_triggers(document.pop("trigger", ()), states)
    mistakes += more
    for word in [word for word in document if word not in WORDS]:
        mistakes.append(((word,), _misspelt(word)))
        del document[word]
    whole = {**document, "name": name, "states": {}, "triggers": ()}
    program, wrong = _validated(Program, whole, ())
    mistakes += wrong
    if program is not None and states is not None:
        program = program.model_copy(update={"states": states, "triggers": triggers})
        mistakes += _meanings(program)
    problems += [toml.problem(path, message) for path, message in mistakes]
    if program is None or problems:
        raise ProblemsError(sorted(problems, key=lambda problem: problem.line or 0))
    return _with_streams(program)


WORDS = "title", "description", "source", "start"  # of a program, besides its schema, states and triggers


def _misspelt(word):
    if word == "name":
        return "the name of a program is its file name; remove this line"
    if word in ("states", "triggers"):
        return f"unknown name; write {'[state.NAME]' if word == 'states' else '[[trigger]]'} tables"
    return f"unknown name{did_you_mean(word, (*WORDS, 'schema', 'state', 'trigger'))}"


def _read_states(tables) -> tuple[dict[str, State] | None, list[tuple[Key, str]]]:
    if not isinstance(tables, dict) or not tables:
        return None, [(("state",), "is missing; a program has at least one table [state.NAME]")]
    if len(tables) > PROGRAM_STATES:
        return None, [(("state",), f"there may be at most {PROGRAM_STATES} states, got {len(tables)}")]
    states, mistakes = {}, []
    for name, table in tables.items():
        path: Key = ("state", name)
        if not NAME.fullmatch(name):
            mistakes.append((path, "a state's name has letters, digits, - and _, at most 64"))
        elif not isinstance(table, dict):
            mistakes.append((path, f"must be a table [state.{name}], got {shown(table)}"))
        else:
            states[name], wrong = _validated(State, table, path)
            mistakes += wrong
    return states, mistakes


def _read_triggers(tables, states) -> tuple[tuple[Trigger, ...], list[tuple[Key, str]]]:
    if not isinstance(tables, (list, tuple)) or not all(isinstance(table, dict) for table in tables):
        return (), [(("trigger",), "must be tables [[trigger]]")]
    if len(tables) > PROGRAM_TRIGGERS:
        return (), [(("trigger",), f"there may be at most {PROGRAM_TRIGGERS} triggers, got {len(tables)}")]
    triggers, mistakes = [], []
    for k, table in enumerate(tables):
        path: Key = ("trigger", k)
        if "when" not in table:
            mistakes.append((path, "has no condition; give it when = { ... }"))
            mistakes += _validated(Trigger, {**table, "when": _NEVER}, path)[1]
            continue
        when, wrong = read_condition(table["when"], path + ("when",))
        mistakes += wrong
        trigger, wrong = _validated(Trigger, {**table, "when": when or _NEVER}, path)
        mistakes += wrong
        triggers.append(trigger)
    return tuple(triggers), mistakes


_NEVER = Condition()  # stands for a condition that could not be read while the rest is checked


def _validated(model, table, path):
    """`validated`, for models whose fields have aliases."""
    aliases = {field.alias: name for name, field in model.model_fields.items() if field.alias}
    back = {name: alias for alias, name in aliases.items()}
    hidden = [name for name in table if name in back]
    plain = {aliases.get(name, name): value for name, value in table.items() if name not in back}
    made, mistakes = validated(model, plain, path)
    names = [back.get(name, name) for name in model.model_fields]
    problems = [
        (_renamed(where, len(path), back), _respelt(where, path, message, names)) for where, message in mistakes
    ]
    problems += [(path + (name,), f"unknown name; did you mean '{back[name]}'?") for name in hidden]
    return (made if not problems else None), problems


def _respelt(where, path, message, names):
    """The hint of an unknown name from the names that the file knows."""
    if message.startswith("unknown name") and len(where) == len(path) + 1:
        return f"unknown name{did_you_mean(str(where[-1]), names)}"
    return message


def _renamed(where, depth, back):
    """A path in which a field has the name that it has in the file."""
    if len(where) > depth and where[depth] in back:
        return where[:depth] + (back[where[depth]],) + where[depth + 1 :]
    return where


def _meanings(program) -> list[tuple[Key, str]]:
    """What is wrong with names of states, and with times that lead nowhere."""
    states, mistakes = program.states, []

    def check(name, path):
        if name not in states:
            mistakes.append((path, f"there is no state {shown(name)}{did_you_mean(name, states)}"))

    for name, _ in program.start or ():
        check(name, ("start",))
    for name, state in states.items():
        if state is None:
            continue
        if (state.lasts is None) != (state.then is None):
            missing = "then" if state.then is None else "for"
            mistakes.append((("state", name), f"`for` and `then` go together; {missing} is missing"))
        for after, _ in state.then or ():
            check(after, ("state", name, "then"))
        if state.emits_within is not None and state.emits is None:
            mistakes.append(
                (("state", name, "emits_within"), "is the radius of an event, but there is no event; add emits")
            )
    for k, trigger in enumerate(program.triggers):
        if trigger is not None:
            _check_trigger(trigger, ("trigger", k), check, mistakes)
    _check_memories(program, mistakes)
    return mistakes


def _check_trigger(trigger, path, check, mistakes):
    check(trigger.to, path + ("to",))
    for part in trigger.when.walk():
        for ref in part.references():
            if ref.what == "state" and "/" not in ref.name:  # PROGRAM/STATE is of another
                check(ref.name, path + ("when", part.word))
    for name in trigger.sources:
        if name != EVERY:
            check(name, path + ("from",))
    if EVERY in trigger.sources and len(trigger.sources) > 1:
        mistakes.append((path + ("from",), f"'{EVERY}' already means every state; remove the other names"))


def _check_memories(program, mistakes):
    triggers = [trigger for trigger in program.triggers if trigger is not None]
    needed = {part.memory() for t in triggers for part in t.when.walk() if part.remembers}
    if len(needed) > PROGRAM_MEMORIES:
        message = f"the triggers store times of {len(needed)} different things; the maximum is {PROGRAM_MEMORIES}"
        mistakes.append((("trigger",), message))


def _with_streams(program) -> Program:
    """The program with a stream of noise of its own for each condition."""
    for k, trigger in enumerate(program.triggers):
        for m, part in enumerate(trigger.when.walk()):
            part._stream = f"program {program.name} {k}.{m}"
    return program


# libraries --------------------------------------------------------------------------------------


class ProgramLibrary(FileLibrary):
    """The programs in some folders, by name."""

    suffix = SUFFIX

    def get(self, name: str) -> Program:
        """A program by name.

        Raises
        ------
        ProblemsError
            When there is none, or with everything that is wrong with its file.
        """
        file = self.file_of(name) if isinstance(name, str) and NAME.fullmatch(name) else None
        if file:
            return load_program(self.bytes_of(file), str(file))
        known = self.names()
        message = f"there is no program {shown(name)}{did_you_mean(str(name), known)}"
        raise ProblemsError([Problem(str(name), None, None, message)])


@functools.cache
def shipped_programs() -> ProgramLibrary:
    """The programs that come with Flockbrush."""
    return ProgramLibrary([Path(__file__).parent / "programs"])


def save_program(program: Program, folder: str | os.PathLike, overwrite: bool = False) -> Path:
    """Save a program as ``NAME.program.toml``, all of it or nothing; ProblemsError."""
    return write_bytes(Path(folder) / (program.name + SUFFIX), program.source, overwrite)


def known_brushes(program: Program, names: Iterable[str], file: str) -> list[Problem]:
    """Problems with brushes of its states that are not among these names."""
    names = list(names)
    wrong = [(name, state.brush) for name, state in program.states.items() if state.brush and state.brush not in names]
    return [
        Problem(file, parse_toml(program.source, program.name).line(("state", name, "brush")), f"state.{name}.brush",
                f"there is no brush {shown(brush)}{did_you_mean(brush, names)}")
        for name, brush in wrong
    ]  # fmt: skip


__all__ = ["Any", "Program", "ProgramLibrary", "State", "Trigger", "load_program", "save_program", "shipped_programs"]
