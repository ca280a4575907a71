"""Programs to files: TOML that reads back the same."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from flockbrush.behaviours.trigger import plain

if TYPE_CHECKING:
    from flockbrush.behaviours.program import Program


def program_to_toml(program: Program) -> str:
    """The text of a program's file; `load_program` makes an equal program of it."""
    lines = ['schema = "flockbrush.program/1"']
    head = {"title": program.title, "description": program.description, "source": program.source_note}
    lines += [f"{name} = {toml(value)}" for name, value in head.items() if value]
    if program.start is not None:
        lines.append(f"start = {toml(shares(program.start))}")
    for name, state in program.states.items():
        lines += ["", f"[state.{name}]", *_pairs(state_table(state))]
    for trigger in program.triggers:
        lines += ["", "[[trigger]]", *_pairs(trigger_table(trigger))]
    return "\n".join(lines) + "\n"


def state_table(state) -> dict[str, Any]:
    """What a file says of a state."""
    entries = {
        "brush": state.brush,
        "for": state.lasts,
        "then": None if state.then is None else shares(state.then),
        "emits": state.emits,
        "emits_within": state.emits_within,
        "colour": state.colour,
    }
    return {name: value for name, value in entries.items() if value is not None}


def trigger_table(trigger) -> dict[str, Any]:
    """What a file says of a trigger."""
    sources = trigger.sources[0] if len(trigger.sources) == 1 else list(trigger.sources)
    entries = {"name": trigger.name or None, "from": sources, "to": trigger.to, "when": plain(trigger.when)}
    return {name: value for name, value in (entries | {"delay": trigger.delay}).items() if value is not None}


def shares(pairs):
    """One state by its name, several as a table of weights."""
    return pairs[0][0] if len(pairs) == 1 else dict(pairs)


def _pairs(table):
    return [f"{name} = {toml(value)}" for name, value in table.items()]


def toml(value) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(name)} = {toml(inner)}" for name, inner in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, (int, float)):
        return repr(value)
    return json.dumps(str(value), ensure_ascii=False)


def _key(name):
    bare = name.replace("-", "").replace("_", "").isalnum() and name.isascii()
    return name if bare else json.dumps(name, ensure_ascii=False)
