"""Undo and redo for a run whose level file cannot be edited: changes affect the run only."""

from __future__ import annotations

from flockbrush.engine.files import refused
from flockbrush.levels.steps import CommandStack

FIRST_ID = 1_000_000  # of new objects; those of level files are smaller


class History(CommandStack):
    """Takes the place of a `flockbrush.levels.editor.Editor`.

    Parameters
    ----------
    path : path
        The level.
    why : str
        What keeps its file from being edited.
    """

    dirty = False
    journal_problem = ""

    def __init__(self, path, why):
        super().__init__()
        self.path, self.why = path, why
        self._highest = FIRST_ID

    def new_id(self):
        """A new object id, never given twice."""
        self._highest += 1
        return self._highest

    def check(self, commands):
        """Nothing stands against an edit of the run."""

    def do(self, label, commands, back=(), tick=0, join=None):
        """Note what the world has taken."""
        self.note(label, commands, back, tick, join)

    def recorded(self, commands, tick):
        """New objects get other ids than those of the recorded run."""
        self._highest = max([self._highest, *(getattr(cmd, "id", 0) for cmd in commands)])

    def undo(self, tick=0, again=None):
        """Forget the last step, until it is done again."""
        step = self.take_back()
        step.again = None if again is None else list(again)

    def redo(self, tick=0, back=None):
        """Note the step again."""
        step = self.do_again()
        step.back = step.back if back is None else list(back)

    def at(self, tick, after=False) -> History:
        """Another one that goes back from this tick."""
        other = History(self.path, self.why)
        other._highest = self._highest
        early = [step.tick < tick + after for step in self.done]
        copies = [step.copy() for step in self.done]
        other.done = [step for step, old in zip(copies, early, strict=True) if old]
        other.undone = [step for step, old in zip(copies, early, strict=True) if not old][::-1]
        return other

    def restarted(self, renewed=None) -> History:
        """A run that begins anew has no past."""
        return History(self.path, self.why)

    def journal(self, path):
        """There is nothing that a crash could take from the file."""

    def close_journal(self):
        """There is none."""

    def save(self, path=None):
        """Raise ProblemsError with the reason."""
        raise refused(self.path, f"cannot be saved: {self.why}")
