"""The undo stack of every window: what was done and can be undone, by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple


class UndoStack:
    """Steps that were done and steps that were undone, newest last; every step has a ``label``.

    Parameters
    ----------
    most : int, optional
        Steps that are kept; all unless given.
    """

    def __init__(self, most=None):
        self.most = most
        self.done: list[Any] = []
        self.undone: list[Any] = []
        self._joinable = False  # whether the next step may continue the last one

    @property
    def undo_label(self) -> str | None:
        """What undo would take back, or None."""
        return self.done[-1].label if self.done else None

    @property
    def redo_label(self) -> str | None:
        """What redo would do again, or None."""
        return self.undone[-1].label if self.undone else None

    def push(self, step, join=None):
        """Note a step; those that were undone are forgotten."""
        self.done.append(step)
        if self.most is not None:
            del self.done[: -self.most]
        self.undone.clear()
        self._joinable = join is not None

    def take_back(self) -> Any:
        """Move the last step to those that were undone; returns it, or None."""
        return self._move(self.done, self.undone)

    def do_again(self) -> Any:
        """Move the step that was undone last back; returns it, or None."""
        return self._move(self.undone, self.done)

    def _move(self, source, target):
        self._joinable = False
        if not source:
            return None
        target.append(source.pop())
        return target[-1]


class StateStep(NamedTuple):
    """A step of a document whose whole state is replaced."""

    label: str
    where: Any  # what the window is to show when the step is undone or redone
    before: Any
    after: Any


class StateStack(UndoStack):
    """The undo stack of a document whose state is never changed, only replaced.

    Parameters
    ----------
    state
        The document at first.
    """

    def __init__(self, state, most=None):
        super().__init__(most)
        self.state = self.saved = state

    @property
    def dirty(self) -> bool:
        """Whether the state is not the one that was saved."""
        return self.state is not self.saved

    def replace(self, label, where, state):
        """Take a step to another state."""
        self.push(StateStep(label, where, self.state, state))
        self.state = state

    def amend(self, state):
        """Have the last step lead to another state."""
        self.done[-1] = self.done[-1]._replace(after=state)
        self.state = state

    def undo(self) -> StateStep | None:
        """Take the last step back; returns it."""
        step = self.take_back()
        if step is not None:
            self.state = step.before
        return step

    def redo(self) -> StateStep | None:
        """Take the step again that was undone last; returns it."""
        step = self.do_again()
        if step is not None:
            self.state = step.after
        return step


@dataclass
class EditStep:
    """A step of commands to the running world."""

    label: str
    commands: list
    back: list  # what takes them back
    tick: int
    join: str | None = None  # steps of one key that follow each other are one
    serial: int = 0  # another number after every change of it
    again: list | None = None  # what brings it back in the world just as it was; None: ``commands``
    changes: list | None = field(default=None, repr=False)  # of the document; None: not done to this one yet

    def forward(self):
        """What does it again in the world."""
        return list(self.commands if self.again is None else self.again)

    def copy(self) -> EditStep:
        """The same step, not done in a document or a world yet."""
        return EditStep(self.label, list(self.commands), list(self.back), self.tick, self.join, self.serial)


class CommandStack(UndoStack):
    """The undo stack of edits of the running world."""

    def undo_label_at(self, tick):
        """What undo would take back of what was done up to a tick, or None."""
        return next((step.label for step in reversed(self.done) if step.tick <= tick), None)

    def redo_label_at(self, tick):
        """What redo would do again at a tick: the first step that was done later, or the last one undone; or None."""
        return next((step.label for step in self.done if step.tick > tick), self.redo_label)

    @property
    def undo_commands(self):
        """What undo does to the world, or None."""
        return list(self.done[-1].back) if self.done else None

    @property
    def redo_commands(self):
        """What redo does to the world, or None."""
        return self.undone[-1].forward() if self.undone else None

    def note(self, label, commands, back, tick, join) -> EditStep:
        """Note an edit that the world has taken: in the last step if it has the same ``join``, else in a new one."""
        joined = join is not None and self._joinable and self.done and self.done[-1].join == join
        if joined:
            self.undone.clear()
        else:
            self.push(EditStep(label, [], [], tick, join), join)
        step = self.done[-1]
        step.commands += commands
        step.back = [*back, *step.back]
        return step
