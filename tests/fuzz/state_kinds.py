"""Files that the program keeps for itself and reads again: sessions, their journals, trials, settings, marked films."""

import json
from functools import cached_property

import mutations as m
from kind import Kind


class Sessions(Kind):
    """The note of a playground session that a crash ended."""

    ending, share = ".json", 0.3

    @cached_property
    def sound(self):
        branch = {"recording": "a.flock", "journal": "a.journal", "parent": "", "left": 0}
        return [json.dumps({"level": "a.tmj", "current": "main", "branches": {"main": branch}}).encode()]

    def read(self, path):
        from flockbrush.studio.recovery import NOTE, leftovers

        root = self.folder / "sessions"
        folder = root / "pen-1-1"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / NOTE).unlink(missing_ok=True)
        (folder / NOTE).hardlink_to(path)
        told = []
        assert all(left.folder == folder for left in leftovers(root=root, tell=told.append))
        assert all(str(root) in text for text in told)


class Edits(Kind):
    """The journal of what was done to a level in the playground."""

    ending, share = ".journal", 0.5

    @cached_property
    def sound(self):
        from flockbrush.levels.editor import Editor
        from flockbrush.systems.edits import PlaceGoal
        from pens import pen

        self.folder.mkdir(parents=True, exist_ok=True)
        editor = Editor.open(pen(self.folder, sheep=8))
        editor.journal(self.folder / "sound.journal")
        for k in range(3):
            editor.do("Goal", [PlaceGoal(900 + k, f"goal {k}", 5.0 + k, 6.0)], (), k)
        editor.undo(4)
        editor.redo(5)
        editor.close_journal()
        data = (self.folder / "sound.journal").read_bytes()
        return [data.replace(json.dumps(str(self.folder))[1:-1].encode(), b"/pens")]

    def changed(self, rng, data):
        lines = data.splitlines()
        at = rng.randrange(len(lines))
        lines[at] = m.changed_json(rng, lines[at]).replace(b"\n", b" ")
        return b"\n".join(lines) + b"\n"

    def read(self, path):
        from flockbrush.engine.files import refused
        from flockbrush.levels.editor import Editor, JournalError

        from flockbrush.studio.recovery import _is_unsaved

        _is_unsaved(path)
        try:
            Editor.recover(path)
        except JournalError as error:
            raise refused(path, str(error)) from None


class Trials(Kind):
    """What an interrupted `learn` keeps."""

    ending, share = ".json", 0.2

    @cached_property
    def sound(self):
        return [json.dumps({"signature": "x", "done": {"a": [1.5, {"b": None}], "c": 2}}).encode()]

    def read(self, path):
        from flockbrush.learning.workers import Workers

        Workers(None, 1, "x", path)


class Settings(Kind):
    """Settings of the playground."""

    ending, share = ".json", 0.2

    @cached_property
    def sound(self):
        from flockbrush.studio.settings import Settings as Chosen

        return [Chosen().model_dump_json().encode()]

    def read(self, path):
        from flockbrush.studio.settings import load_settings

        load_settings(path)
