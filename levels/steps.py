"""What was done and can be undone, by name."""

from __future__ import annotations

from typing import Any


class Steps:
    """Two lists of steps, those done and those undone, newest last; every step has a ``label``."""

    def __init__(self):
        self._done: list[Any] = []
        self._undone: list[Any] = []

    @property
    def undo_label(self) -> str | None:
        """What undo would take back, or None."""
        return self._done[-1].label if self._done else None

    @property
    def redo_label(self) -> str | None:
        """What redo would do again, or None."""
        return self._undone[-1].label if self._undone else None
