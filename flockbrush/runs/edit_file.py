"""Files with edits of a recording: ``RUN.edits.toml`` beside ``RUN.flock``.

::

    schema = "flockbrush.edits/1"
    recording = "run.flock"
    sha256 = "0f3c..."        # of the recording: edits of another one are refused

    [[layers]]
    name = "edits"
    on = true

    [[layers.edits]]
    kind = "move"
    ids = "1-40, 52"
    by = [0, 5, 0]
    because = "brush swarm at 2 s"

Tables ``[[undone]]`` hold what ``--undo`` took back, with the name of their layer.
"""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.tomlfile import TomlFile, is_number, parse_toml, read_bytes
from flockbrush.engine.files import sha256_of, write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.steps import UndoStack
from flockbrush.runs.run_edits import ALWAYS, KINDS, Edit, Layer

SUFFIX = ".edits.toml"
SCHEMA = "flockbrush.edits/1"
FIRST = "edits"  # name of the layer that there is by default
USES = {
    "delete": (), "move": ("by", "turn", "about", "over"), "retime": ("speed",), "freeze": (), "delay": ("seconds",),
    "look": ("brush", "species", "size"),
}  # fmt: skip
HOW = ("about", "over")  # what alone changes nothing
BOUNDS = {
    "start": (0.0, 1e6), "end": (0.0, 1e6), "turn": (-36000.0, 36000.0), "over": (0.0, 1e4), "speed": (0.01, 100.0),
    "seconds": (-1e6, 1e6), "size": (0.01, 100.0),
}  # fmt: skip
FARTHEST = 1e6  # m


class LayerEdit(NamedTuple):
    """An edit, and the name of its layer."""

    layer: str
    edit: Edit

    @property
    def label(self):
        """The edit in words."""
        return sentence_of(self.edit)


class EditFile(UndoStack):
    """Layers of edits of one recording, with an undo stack that is kept in the file.

    Parameters
    ----------
    path : path
    sha256, recording : str
        Of the recording, and its name.
    """

    def __init__(self, path, sha256, recording):
        super().__init__()
        self.path, self.sha256, self.recording = Path(path), sha256, recording
        self.layers: list[Layer] = []  # the first applies first

    def edits(self) -> list[Edit]:
        """Edits of all layers that are on, in the order in which they apply."""
        return [edit for layer in self.layers if layer.on for edit in layer.edits]

    def layer(self, name) -> Layer | None:
        """The layer of a name."""
        return next((layer for layer in self.layers if layer.name == name), None)

    def add(self, edit: Edit, name=FIRST):
        """Add an edit to a layer, which is created if needed; undone edits cannot be redone afterwards.

        Raises
        ------
        ValueError
            For numbers out of their bounds and blank names, which the file would be refused for, and where nothing
            would change.
        """
        if not name.strip():
            raise ValueError("a layer must have a name")
        for one, (low, high) in BOUNDS.items():
            value = getattr(edit, one)
            if not (low <= value <= high or value == getattr(Edit, one)):
                raise ValueError(f"{one} must be from {low:g} to {high:g}, got {value:g}")
        if edit.end <= edit.start:
            raise ValueError(f"the end must be later than the start at {edit.start:g} s, got {edit.end:g} s")
        if max(map(abs, edit.by)) > FARTHEST:
            raise ValueError(f"animals can be moved by at most {FARTHEST:g} m")
        changes = [name for name in USES[edit.kind] if name not in HOW]
        if changes and all(getattr(edit, name) == getattr(Edit, name) for name in changes):
            raise ValueError(f"this changes nothing: give {' or '.join(changes)} another value")
        self.push(LayerEdit(name, edit))
        self._put(name, edit)

    def undo(self) -> Edit | None:
        """Undo the last edit; returns it, or None."""
        step = self.take_back()
        if step is None:
            return None
        layer = self.layer(step.layer)
        assert layer is not None
        return layer.edits.pop()

    def redo(self) -> Edit | None:
        """Redo the edit that was undone last; returns it, or None."""
        step = self.do_again()
        if step is None:
            return None
        self._put(*step)
        return step.edit

    def remove(self, name):
        """Remove a layer with its edits, for good."""
        self.layers = [layer for layer in self.layers if layer.name != name]
        self.done = [step for step in self.done if step.layer != name]
        self.undone = [step for step in self.undone if step.layer != name]

    def _put(self, name, edit):
        layer = self.layer(name)
        if layer is None:
            layer = Layer(name)
            self.layers.append(layer)
        layer.edits.append(edit)

    def save(self):
        """Write the file, even if it is empty."""
        write_bytes(self.path, _text(self).encode())


def beside(recording) -> Path:
    """The file with the edits of a recording."""
    return Path(recording).with_suffix(SUFFIX)


def edits_of(recording) -> EditFile:
    """The edits beside a recording; an empty file object where there are none.

    Raises
    ------
    ProblemsError
        With everything that is wrong with the file; when it is of another recording.
    """
    path = beside(recording)
    if not path.exists():
        return EditFile(path, sha256_of(recording), Path(recording).name)
    edits = parse_edits(read_bytes(path), path)
    if edits.sha256 != sha256_of(recording):
        message = f"these edits belong to another recording than {Path(recording).name}: rename or remove this file"
        raise ProblemsError([Problem(str(path), None, "sha256", message)])
    return edits


def parse_edits(data: bytes, path) -> EditFile:
    """Edits from the bytes of a file; ProblemsError."""
    toml = parse_toml(data, str(path))
    document = check_schema(toml, SCHEMA, needed=False)
    problems = toml.unknown_names((), document, ("recording", "sha256", "order", "layers", "undone"))
    sha256 = toml.data.get("sha256")
    if not isinstance(sha256, str) or not re.fullmatch("[0-9a-f]{64}", sha256):
        problems.append(toml.problem(("sha256",), "must be the SHA-256 of the recording, 64 hexadecimal digits"))
    layers, undone = _tables(toml, "layers", problems), _tables(toml, "undone", problems)
    edit_file = EditFile(Path(path), str(sha256), str(toml.data.get("recording", "")))
    for k, table in enumerate(layers):
        edit_file.layers.append(_layer(toml, ("layers", k), table, problems))
    for k, table in enumerate(undone):
        fields = {name: value for name, value in table.items() if name != "layer"}
        edit = _edit(toml, ("undone", k), fields, problems)
        if edit is not None:
            edit_file.undone.append(LayerEdit(str(table.get("layer", FIRST)), edit))
    names = [layer.name for layer in edit_file.layers]
    if len(set(names)) < len(names):
        problems.append(toml.problem(("layers",), "two layers have the same name"))
    every = [layer.name for layer in edit_file.layers for _ in layer.edits]
    order = toml.data.get("order", every)
    if not isinstance(order, list) or sorted(map(str, order)) != sorted(every):
        problems.append(toml.problem(("order",), "must name the layer of each edit, in the order they were made"))
    if problems:
        raise ProblemsError(problems)
    coming = {layer.name: iter(layer.edits) for layer in edit_file.layers}
    edit_file.done = [LayerEdit(name, next(coming[name])) for name in map(str, order)]
    return edit_file


def _tables(toml, name, problems):
    tables = toml.data.get(name, [])
    if isinstance(tables, list) and all(isinstance(table, dict) for table in tables):
        return tables
    problems.append(toml.problem((name,), f"must be [[{name}]] tables"))
    return []


def _layer(toml: TomlFile, at, table, problems):
    problems += toml.unknown_names(at, table, ("name", "on", "edits"))
    name, on, edits = table.get("name"), table.get("on", True), table.get("edits", [])
    if not isinstance(name, str) or not name.strip():
        problems.append(toml.problem((*at, "name"), "a layer must have a name"))
    if not isinstance(on, bool):
        problems.append(toml.problem((*at, "on"), f"must be true or false, got {on!r}"))
    layer = Layer(str(name), bool(on))
    if not isinstance(edits, list) or not all(isinstance(edit, dict) for edit in edits):
        problems.append(toml.problem((*at, "edits"), "must be [[layers.edits]] tables"))
        return layer
    parsed = [_edit(toml, (*at, "edits", k), edit, problems) for k, edit in enumerate(edits)]
    layer.edits = [edit for edit in parsed if edit is not None]
    return layer


def _edit(toml, at, table, problems) -> Edit | None:
    """One edit of a file, None when something is wrong with it."""
    kind, before = table.get("kind"), len(problems)
    if kind not in KINDS:
        problems.append(toml.problem((*at, "kind"), f"must be one of {', '.join(KINDS)}, got {kind!r}"))
        return None
    problems += toml.unknown_names(at, table, ("kind", "ids", "start", "end", "because", *USES[kind]))
    values = dict(table)
    try:
        values["ids"] = ids_of(table.get("ids"))
    except ValueError as error:
        problems.append(toml.problem((*at, "ids"), str(error)))
    for name, (low, high) in BOUNDS.items():
        if name in values and not (is_number(values[name]) and low <= values[name] <= high):
            problems.append(
                toml.problem((*at, name), f"must be a number from {low:g} to {high:g}, got {values[name]!r}")
            )
    for name, count in (("by", 3), ("about", 2)):
        if name in values:
            if not _is_point(values[name], count):
                problems.append(toml.problem((*at, name), f"must be {count} numbers in metres, got {values[name]!r}"))
            else:
                values[name] = tuple(map(float, values[name]))
    for name in ("brush", "species", "because"):
        if not isinstance(values.get(name, ""), str):
            problems.append(toml.problem((*at, name), f"must be a string, got {values[name]!r}"))
    if len(problems) == before and values.get("start", 0.0) >= values.get("end", ALWAYS):
        problems.append(toml.problem((*at, "end"), "must be later than the start"))
    return Edit(**values) if len(problems) == before else None


def sentence_of(edit: Edit) -> str:
    """An edit in words: "move 12 animals from 0.5 s: by (5.0, 0.0, 0.0)"."""
    changes = [
        f"{name} {getattr(edit, name)}" for name in USES[edit.kind] if getattr(edit, name) != getattr(Edit, name)
    ]
    when = f" from {edit.start:g} s" if edit.start else ""
    when += f" until {edit.end:g} s" if edit.end != ALWAYS else ""
    animals = f"{len(edit.ids)} animals" if len(edit.ids) > 1 else f"animal {edit.ids[0]}"
    return f"{edit.kind} {animals}{when}{': ' if changes else ''}{', '.join(changes)}"


def ids_of(text) -> tuple[int, ...]:
    """The ids of a text as "1-40, 52"; ValueError."""
    if not isinstance(text, str) or not re.fullmatch(r"\s*\d+(-\d+)?(\s*,\s*\d+(-\d+)?)*\s*", text):
        raise ValueError(f'must be ids such as "1-40, 52", got {text!r}')
    ids: set[int] = set()
    for part in text.split(","):
        low, _, high = part.strip().partition("-")
        first, last = int(low), int(high or low)
        if not 1 <= first <= last <= 10**9 or last - first > 10**7:
            raise ValueError(f'must be ids such as "1-40, 52", the smaller id first; got {part.strip()!r}')
        ids.update(range(first, last + 1))
    return tuple(sorted(ids))


def ids_text(ids) -> str:
    """Ids as `ids_of` reads them."""
    parts: list[list[int]] = []
    for animal in sorted(set(ids)):
        if parts and animal == parts[-1][1] + 1:
            parts[-1][1] = animal
        else:
            parts.append([animal, animal])
    return ", ".join(f"{low}" if low == high else f"{low}-{high}" for low, high in parts)


def _text(edits: EditFile) -> str:
    lines = [f'schema = "{SCHEMA}"', f"recording = {_toml(edits.recording)}", f'sha256 = "{edits.sha256}"']
    if edits.done:
        lines.append(f"order = {_toml([step.layer for step in edits.done])}")
    for layer in edits.layers:
        lines += ["", "[[layers]]", f"name = {_toml(layer.name)}", f"on = {str(layer.on).lower()}"]
        for edit in layer.edits:
            lines += ["", "[[layers.edits]]", *_lines(edit)]
    for name, edit in edits.undone:
        lines += ["", "[[undone]]", f"layer = {_toml(name)}", *_lines(edit)]
    return "\n".join(lines) + "\n"


def _toml(value) -> str:
    """A value as TOML has it: as JSON, but letters beyond the basic plane must not be written as surrogates."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _lines(edit: Edit):
    lines = [f'kind = "{edit.kind}"', f'ids = "{ids_text(edit.ids)}"']
    for one in fields(edit):
        value = getattr(edit, one.name)
        if one.name not in ("kind", "ids") and value != one.default:
            lines.append(f"{one.name} = {_toml(list(value) if isinstance(value, tuple) else value)}")
    return lines


def _is_point(value, count):
    return isinstance(value, list) and len(value) == count and all(is_number(v) and abs(v) <= FARTHEST for v in value)
