"""What a kind of file is: sound files, how they are changed, and how far in they are read."""

from functools import cached_property
from pathlib import Path

import mutations as m
from flockbrush.engine.commands import CommandError
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError

TOLD = (ProblemsError, RecordingError, CommandError)
SHIPPED = Path(__file__).parents[2]


class Kind:
    """One kind of file."""

    ending = ""
    share = 1.0  # of all cases, before they are scaled to sum to 1
    changes = staticmethod(m.changed_json)

    def __init__(self, folder):
        self.folder = Path(folder)

    @cached_property
    def sound(self) -> list[bytes]:
        """Files that are read without a complaint."""
        raise NotImplementedError

    def changed(self, rng, data) -> bytes:
        """One of them, changed."""
        return self.changes(rng, data)

    def read(self, path):
        """Read a file as far as the program would."""
        raise NotImplementedError

    def case(self, rng) -> bytes:
        """A file to be read: mostly one whose structure is whole, now and then mere bytes."""
        data = rng.choice(self.sound)
        return m.changed_bytes(rng, data) if rng.random() < 0.1 else self.changed(rng, data)
