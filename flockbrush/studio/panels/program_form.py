"""A program as a form of cards and rows, and the edits of the program file by a changed row."""

from __future__ import annotations

import copy
import tomllib
from dataclasses import dataclass
from typing import Any

from flockbrush.behaviours.program import SCHEMA, Program, load_program
from flockbrush.behaviours.program_writer import state_table, toml, trigger_table
from flockbrush.behaviours.trigger import conditions, dimension_of
from flockbrush.engine.problems import ProblemsError

Path = tuple[str | int, ...]
STATE_ROWS = ("brush", "for", "then", "emits")
TRIGGER_ROWS = ("name", "from", "to", "delay")
KIND = "condition"  # label of the row that says which condition it is


@dataclass(frozen=True)
class ProgramRow:
    """One field: its label, its place in the file, its value, and its allowed values."""

    label: str
    path: Path
    text: str
    choices: tuple[str, ...] = ()  # none: any text
    depth: int = 0  # of a condition inside others


@dataclass(frozen=True)
class Card:
    """A state or a trigger."""

    title: str
    path: Path
    rows: tuple[ProgramRow, ...]


def document_of(program: Program) -> dict[str, Any]:
    """The file of a program as plain data."""
    document = tomllib.loads(program.source.decode("utf-8-sig"))
    top: dict[str, Any] = {
        name: document[name] for name in ("title", "description", "source", "start") if name in document
    }
    states = {name: state_table(state) for name, state in program.states.items()}
    return {"schema": SCHEMA, **top, "state": states, "trigger": [trigger_table(t) for t in program.triggers]}


def text_of(document: dict[str, Any]) -> str:
    """The file of a document."""
    lines = [f"{name} = {toml(value)}" for name, value in document.items() if name not in ("state", "trigger")]
    for name, table in document["state"].items():
        lines += ["", f"[state.{name}]", *(f"{key} = {toml(value)}" for key, value in table.items())]
    for table in document["trigger"]:
        lines += ["", "[[trigger]]", *(f"{key} = {toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def cards_of(program: Program, brushes=()) -> list[Card]:
    """States, then triggers, in the order of the file."""
    document, states = document_of(program), tuple(program.states)
    cards = []
    for name, table in document["state"].items():
        path: Path = ("state", name)
        choices = {"brush": ("", *brushes), "then": ("", *states) if isinstance(table.get("then", ""), str) else ()}
        rows = [ProgramRow(key, (*path, key), _said(table.get(key)), choices.get(key, ())) for key in STATE_ROWS]
        cards.append(Card(name, path, tuple(rows)))
    for k, table in enumerate(document["trigger"]):
        path = ("trigger", k)
        choices = {"to": states}
        rows = [ProgramRow(key, (*path, key), _said(table.get(key)), choices.get(key, ())) for key in TRIGGER_ROWS]
        rows += _condition_rows(table["when"], (*path, "when"), 0)
        cards.append(Card(table.get("name") or f"to {table['to']}", path, tuple(rows)))
    return cards


def _condition_rows(condition, path, depth):
    """A row for the kind of a condition, and one for each of its fields; those inside it below."""
    kinds = conditions()
    word = next(name for name in condition if name in kinds)
    rows = [ProgramRow(KIND, path, word, tuple(kinds), depth)]
    if kinds[word].inner == "one":
        return rows + _condition_rows(condition[word], (*path, word), depth + 1)
    if kinds[word].inner == "many":
        for k, part in enumerate(condition[word]):
            rows += _condition_rows(part, (*path, word, k), depth + 1)
        return rows
    fields = kinds[word].model_fields
    return rows + [ProgramRow(name, (*path, name), _said(condition.get(name)), (), depth) for name in fields]


def _said(value) -> str:
    plain = isinstance(value, (bool, int, float, list, tuple, dict))
    return "" if value is None else toml(value) if plain else str(value)


def changed(program: Program, row: ProgramRow, text: str) -> str:
    """The program's file with a row changed; ValueError with what is wrong with it."""
    document = copy.deepcopy(document_of(program))
    *way, key = row.path
    table = _at(document, way)
    if row.label == KIND and row.choices:
        table[key] = sample(text, tuple(program.states))
    elif text.strip():
        table[key] = _value(text.strip())
    elif isinstance(table, dict):
        table.pop(key, None)
    if key in PAIR and way[0] == "state":
        _keep_pair(table, key, list(program.states))
    return checked(program.name, document)


PAIR = {"for": "then", "then": "for"}  # the time of a state and what comes after it go together


def _keep_pair(table, key, states):
    """Give the other of a pair something to begin with, or take it away with the one that is gone."""
    if key not in table:
        table.pop(PAIR[key], None)
    elif PAIR[key] not in table:
        table[PAIR[key]] = "5 s" if key == "then" else states[0]


def checked(name: str, document: dict[str, Any]) -> str:
    """The text of a document that is a program; ValueError with the first thing that is wrong."""
    text = text_of(document)
    try:
        load_program(text.encode(), f"{name}.program.toml")
    except ProblemsError as error:
        problem = error.problems[0]
        raise ValueError(f"{problem.where}: {problem.message}" if problem.where else problem.message) from None
    return text


def with_state(program: Program, name: str) -> str:
    """The file with one more state; ValueError."""
    document = document_of(program)
    if name in document["state"]:
        raise ValueError(f"a state {name!r} already exists")
    document["state"][name] = {}
    return checked(program.name, document)


def with_trigger(program: Program) -> str:
    """The file with one more trigger, which listens for an event."""
    document = document_of(program)
    document["trigger"].append({"to": list(program.states)[-1], "when": sample("event", tuple(program.states))})
    return checked(program.name, document)


def without(program: Program, path: Path) -> str:
    """The file without a state or a trigger; ValueError where others lead to it."""
    document = document_of(program)
    del document[str(path[0])][path[1]]
    return checked(program.name, document)


def sample(word: str, states) -> dict[str, Any]:
    """A condition of a kind as a file has it, with values to begin with."""
    kind = conditions()[word]
    if kind.inner:
        inner = sample("event", states)
        return {word: inner if kind.inner == "one" else [inner]}
    values = {}
    for k, (name, field) in enumerate(kind.model_fields.items()):
        if k == 0 or field.is_required():
            values[name] = _first_value(name, field, states)
    return values


def _first_value(name, field, states):
    dimension = dimension_of(field)
    if dimension is not None:
        return dimension.example.split(" or ")[0]
    if field.annotation in (int, float):
        return 3 if field.annotation is int else 0.5
    known = {"sees": "wolf", "share_of_seen_in": states[-1], "since_state": states[0], "event": "alarm",
             "death_of": "kin", "birth_of": "kin", "reaches_goal": "its own"}  # fmt: skip
    return known.get(name, "pond")


def _at(document, way):
    for part in way:
        document = document[part]
    return document


def _value(text):
    """What a person typed: a number, an array or a table of TOML, else text."""
    try:
        value = tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text
    return value if isinstance(value, (int, float, list, dict)) else text
