"""An editor of a level: the document, what was done to it and when, and a journal that a crash cannot take away.

A step is what one undo takes back: a stroke of many pieces, or one arrow.  Each has two sides: ``commands`` for the
living world, with ``back`` for the way back (`flockbrush.engine.commands.Commands.perform` gives both), and the
changes of the
document, which undo to the byte.
"""

from __future__ import annotations

import copy
import json
from itertools import chain, count
from pathlib import Path
from typing import Any

from flockbrush.engine.commands import from_record, to_record
from flockbrush.engine.files import write_bytes
from flockbrush.engine.plain_json import json_lines
from flockbrush.levels.carried_files import renamed_files
from flockbrush.levels.document_changes import EditError, KeySet
from flockbrush.levels.document_nodes import file_names, file_references
from flockbrush.levels.level_files import MemoryFiles
from flockbrush.levels.level_writer import Document, dump, refuse_xml
from flockbrush.levels.libraries import brush_library
from flockbrush.levels.map_edits import EditedMap
from flockbrush.levels.playground_tiles import PLAYGROUND, is_playground
from flockbrush.levels.steps import CommandStack, EditStep

FORMAT = 1  # of the journal

__all__ = ["EditError", "Editor", "JournalError"]


class JournalError(ValueError):
    """A journal that cannot be read; the text says why."""


class Editor(CommandStack):
    """A level open for editing.

    Parameters
    ----------
    document : Document
        Edited in place.
    library : BrushLibrary, optional
        The brushes there are; those the level can name by default.
    files : DiskFiles or MemoryFiles, optional
        Where its tilesets are; beside the level by default.

    Raises
    ------
    ProblemsError
        When a tileset cannot be read.
    """

    def __init__(self, document, library=None, files=None):
        super().__init__()
        self._document = document
        self.library = brush_library(document.path) if library is None else library
        self.sheet = EditedMap(document, self.library, files)
        self._base, self._base_path = dump(document.data), str(document.path)
        self._events: list[dict] = []
        self._serial = self._saved = self._highest = 0
        self._journal: Any = None
        self.journal_problem = ""  # why the journal could not be written, "" while all is well

    @classmethod
    def open(cls, path, library=None) -> Editor:
        """An editor for a level's file; ProblemsError when it cannot be edited."""
        return cls(Document.load(path), library)

    # ------------------------------------------------------------ what is there

    @property
    def document(self):
        """The document as it is now."""
        self.sheet.settle()
        return self._document

    @property
    def path(self):
        """Where it is saved."""
        return self._document.path

    def text(self):
        """The level as it would be saved."""
        return dump(self.document.data)

    @property
    def dirty(self):
        """Whether the document is another than the one last saved."""
        return self._mark() != self._saved

    def _mark(self):
        return next((step.serial for step in reversed(self.done) if step.changes), 0)

    def new_id(self):
        """A new object id, never given twice."""
        self._highest = max(self._highest + 1, self.sheet.next_free("nextobjectid"))
        return self._highest

    # ------------------------------------------------------------ doing and undoing

    def check(self, commands):
        """Whether the level's file can take this edit; the document stays as it is.

        Raises
        ------
        EditError
            With the reason.
        """
        for change in reversed(self._change(commands)):
            change.back()

    def do(self, label, commands, back=(), tick=0, join=None):
        """Note an edit that the world has taken, and do it to the document.

        Parameters
        ----------
        label : str
            What a designer calls it.
        commands, back : sequence of command
            Done to the world, and what takes them back.
        tick : int
            When.
        join : str, optional
            Edits of one key that follow each other are one step.

        Raises
        ------
        EditError
            When the file cannot take it.  Nothing has changed then.
        """
        changes = self._change(commands)
        step = self.note(label, commands, back, tick, join)
        step.changes = [*(step.changes or []), *changes]
        step.serial = self._next_serial()
        entry = {"label": label, "commands": _records(commands), "back": _records(back), "join": join}
        self._note("do", tick, serial=step.serial, **entry)

    def recorded(self, commands, tick):
        """Do to the document what was done in the recorded run that is edited on; undo does not go back before it.

        Raises
        ------
        EditError
            When the file cannot take it.  Nothing has changed then.
        """
        self._change(commands)
        self._note("recorded", tick, commands=_records(commands))

    def undo(self, tick=0, again=None):
        """Take the last step back in the document; the commands that do so in the world.

        Parameters
        ----------
        again : sequence of command, optional
            What brings exactly this back in the world, as `Commands.perform` gave it for `undo_commands`.
        """
        step = self.done[-1]
        for change in reversed(step.changes or []):
            change.back()
        self.take_back()
        step.again = None if again is None else list(again)
        self._note("undo", tick, again=None if again is None else _records(again))
        return list(step.back)

    def redo(self, tick=0, back=None):
        """Do the step last taken back again in the document; the commands that do so in the world.

        Parameters
        ----------
        back : sequence of command, optional
            What takes it back, as `Commands.perform` gave it for `redo_commands`.
        """
        step = self.undone[-1]
        if step.changes is None:
            step.changes = self._change(step.commands)
            step.serial = self._next_serial()
        else:
            for change in step.changes:
                change.again()
        self.do_again()
        if back is not None:
            step.back = list(back)
        self._note("redo", tick, serial=step.serial, back=None if back is None else _records(back))
        return step.forward()

    def _change(self, commands):
        """The changes of the document by these commands, done; none and EditError when one cannot be."""
        try:
            for command in commands:
                self.sheet.do(command)
        except BaseException:
            for change in reversed(self.sheet.taken()):
                change.back()
            raise
        return self.sheet.taken()

    def _next_serial(self):
        self._serial += 1
        return self._serial

    # ------------------------------------------------------------ other times

    def at(self, tick, after=False) -> Editor:
        """Another editor with the document as it was when this tick began.

        Its undo goes back from there; what was done since, in this tick too, can be done again with redo.

        Parameters
        ----------
        after : bool
            As it was after what was done in this tick.
        """
        early = [event for event in self._events if event["tick"] < tick + after or event["event"] == "save"]
        other = self._replayed(early)
        known, own_serials = ([step.serial for step in each.done] for each in (other, self))
        later = self.done[len(known) :] if own_serials[: len(known)] == known else []
        if later:  # built on what is there; after an undo it would be built on something else
            other.undone = [step.copy() for step in reversed(later)]
        other._serial, other._saved, other._highest = self._serial, self._saved, self._highest
        other._note("ahead", tick, steps=[_step_record(step) for step in other.undone])
        return other

    def restarted(self, renewed=lambda command: command) -> Editor:
        """Another editor with the same document, undo and all, for a run that begins anew: all was done at tick 0.

        What a step would do to single animals is forgotten, for they are born anew.

        Parameters
        ----------
        renewed : callable
            What a command of the steps becomes, now that files may have changed.
        """

        def records(those):
            return _records(map(renewed, _commands(those)))

        self.sheet.settle()
        shared = {id(thing): thing for thing in (self.library, *self.sheet.constants())}
        other = copy.deepcopy(self, {**shared, id(self._journal): None})
        other.sheet.find_grids()
        for event in other._events:
            event |= {"tick": 0} | {key: _of_nobody(event[key]) for key in ("back", "again") if event.get(key)}
            event |= {key: records(event[key]) for key in ("commands", "back", "again") if event.get(key)}
        for step in (*other.done, *other.undone):
            step.tick, step.again = 0, None
            step.commands = list(map(renewed, step.commands))
            step.back = list(map(renewed, _commands(_of_nobody(_records(step.back)))))
        return other

    def _replayed(self, events):
        """An editor that began as this one and has lived through these events."""
        files = MemoryFiles({Path(self._base_path).name: b"", **self._files()})
        other = Editor(_document(self._base, self._base_path), self.library, files)
        for event in events:
            other._live(event)
        return other

    def _live(self, event):
        """Do what an event of a journal says."""
        kind, tick = event["event"], event["tick"]
        if kind == "do":
            self.do(event["label"], _commands(event["commands"]), _commands(event["back"]), tick, event["join"])
            self.done[-1].serial = self._serial = event["serial"]
            self._events[-1]["serial"] = event["serial"]
        elif kind == "undo":
            self.undo(tick, event["again"] and _commands(event["again"]))
        elif kind == "redo":
            self.redo(tick, event["back"] and _commands(event["back"]))
            self.done[-1].serial = event["serial"]
            self._serial = max(self._serial, event["serial"])
        elif kind == "recorded":
            self.recorded(_commands(event["commands"]), tick)
        elif kind == "ahead":
            self.undone = [_step_of(step) for step in event["steps"]]
            self._note("ahead", tick, steps=event["steps"])
        elif kind == "save":
            self._moved(event["path"], event["moved"])
            self._note("save", tick, path=event["path"], moved=event["moved"])
        else:
            raise JournalError(f"the journal contains {kind!r}, which this version does not know")

    # ------------------------------------------------------------ saving

    def save(self, path=None, backup=True) -> Path:
        """Save the level, in its place or under another name, all of it or nothing.

        In another folder the tilesets, pictures and brushes it needs are copied below it, unless they are in the same
        project.

        Raises
        ------
        ProblemsError
            When it cannot be written; the file there is then untouched.
        """
        to = Path(path) if path is not None else self.path
        refuse_xml(to)
        before, saved = self.path, self._saved
        ours = {entry["image"] for entry, _ in self.sheet.tiles.playgrounds()}
        others = [entry for entry in file_names(self._states()) if entry[0] not in ours]
        moved = renamed_files(others, before, to)
        pictures = self._pictures(to, {moved.get(name, name) for name, _ in others})
        moved |= {old: new for old, (new, _) in pictures.items() if new != old}
        self._moved(str(to), moved)
        try:
            for name, data in pictures.values():
                write_bytes(to.parent / name, data)
            self.document.save(to, backup)
        except BaseException:
            self._moved(str(before), {new: old for old, new in moved.items()})
            self._saved = saved  # it is not
            raise
        self._note("save", self.done[-1].tick if self.done else 0, path=str(to), moved=moved)
        return to

    def _moved(self, path, moved):
        """Take another place for the file; what it names is called as ``moved`` says, also after undo."""
        found = file_references(self._states())
        for node, key in {(id(node), key): (node, key) for node, key in found}.values():
            node[key] = moved.get(node[key], node[key])
        files = self.sheet.brush_files
        files.update({brush: moved.get(name, name) for brush, name in files.items()})
        self._document.path = Path(path)
        self._saved = self._mark()

    def _states(self):
        """The document as it is now, and what undo and redo put into it again."""
        steps = [change for step in (*self.done, *self.undone) for change in step.changes or ()]
        sets = [change for change in steps if isinstance(change, KeySet)]
        return [self._document.data, *(value for change in sets for value in (change.before, change.after))]

    def _pictures(self, to, others):
        """{name: (new name, PNG file)} of what was added here: called as the level, in place of no file of others."""
        ours, pictures = _pictures_in(to), {}
        for entry, meanings in self.sheet.tiles.playgrounds():
            stem, data = f"{to.stem}-{PLAYGROUND}", _picture(meanings, entry, self.library)
            taken = others | {name for name, _ in pictures.values()}
            now = entry["image"]
            wanted = [now] if now.startswith(stem) and Path(now).name == now else []
            names = chain(wanted, (f"{stem}{k}.png" for k in chain([""], count(2))))
            free = (n for n in names if n not in taken and (n in ours or _is_free(to.parent / n, data)))
            pictures[now] = next(free), data
        return pictures

    # ------------------------------------------------------------ the journal

    def journal(self, path):
        """Write what is done from now on, and all before, to a file: one line each, at once.

        Raises
        ------
        OSError
            When it cannot be begun.
        """
        self.close_journal()
        file = open(path, "w", encoding="utf-8")
        head = {
            "event": "open", "format": FORMAT, "path": self._base_path, "document": self._base,
            "files": {name: data.decode() for name, data in self._files().items()},
        }  # fmt: skip
        for event in (head, *self._events):
            file.write(json.dumps(event, separators=(",", ":")) + "\n")
        file.flush()
        self._journal = file

    def _files(self):
        """The tilesets and brushes it was read with, by name."""
        own = Path(self._base_path).name
        return {name: data for name, data in self.sheet.files.got.items() if name != own}

    def close_journal(self):
        """Let go of the journal's file."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def _note(self, event, tick, **values):
        """Keep an event, and hand it to the system at once: a crash of this program cannot take it back."""
        self._events.append({"event": event, "tick": tick, **values})
        if self._journal is None:
            return
        try:
            self._journal.write(json.dumps(self._events[-1], separators=(",", ":")) + "\n")
            self._journal.flush()
        except (OSError, ValueError) as error:
            self.journal_problem = f"{self._journal.name}: cannot be written: {getattr(error, 'strerror', error)}"
            self._journal = None

    @classmethod
    def recover(cls, journal, library=None, path=None) -> Editor:
        """The editor that wrote a journal, as it was after the last line that is whole.

        Parameters
        ----------
        path : path, optional
            Where the level lies now; where it lay by default.

        Raises
        ------
        JournalError
            When the file is no journal.
        """
        try:
            events = json_lines(journal)
            head = next(events, None) or {}
            if head["event"] != "open" or head["format"] != FORMAT:
                raise ValueError
            path, text = str(path or head["path"]), head["document"]
            files = MemoryFiles({Path(path).name: b"", **{n: data.encode() for n, data in head["files"].items()}})
            editor = cls(_document(text, path), library, files)
        except OSError as error:
            raise JournalError(f"{journal}: cannot be read: {error.strerror or error}") from None
        except (ValueError, LookupError, TypeError, AttributeError):
            raise JournalError(f"{journal}: this is not the journal of an editor") from None
        try:
            for event in events:  # what follows the last line's end was cut off
                editor._live(event)
        except OSError as error:
            raise JournalError(f"{journal}: cannot be read: {error.strerror or error}") from None
        except (ValueError, LookupError, TypeError) as error:
            raise JournalError(f"{journal}: cannot be replayed: {error}") from None
        return editor


def _document(text, path):
    return Document(json.loads(text), path)


def _records(commands):
    return [list(to_record(command)) for command in commands]


def _commands(records):
    return [from_record(name, values) for name, values in records]


def _of_nobody(records):
    """Commands, as `_records`, without those that name single animals."""
    return [[name, values] for name, values in records if "entities" not in values]


def _step_record(step):
    sides = {"commands": _records(step.commands), "back": _records(step.back)}
    return {"label": step.label, "tick": step.tick, "join": step.join, "serial": step.serial, **sides}


def _step_of(record):
    sides = _commands(record["commands"]), _commands(record["back"])
    return EditStep(record["label"], *sides, record["tick"], record["join"], record["serial"])


def _pictures_in(path):
    """Names of the pictures that the level at a path has of tiles that were added here; none where there is none."""
    try:
        data = json.loads(Path(path).read_bytes())
        return {entry["image"] for entry in data.get("tilesets", []) if is_playground(entry)}
    except (OSError, ValueError, AttributeError, LookupError, TypeError):
        return set()


def _is_free(path, data):
    """Whether a file can be written without replacing another one."""
    return not path.exists() or (path.is_file() and path.read_bytes() == data)


def _picture(meanings, entry, library):
    """The picture of a tileset "playground", as a PNG file."""
    from flockbrush.levels.tile_pictures import tile_sheet

    return tile_sheet(meanings, entry["tilewidth"], library)
