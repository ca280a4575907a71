"""Moments on disk while a scene is written: a record for each animal in each frame.

Records are written frame by frame and read animal by animal, so memory does not grow with the length of the run.
"""

from __future__ import annotations

import numpy as np

from flockbrush.output.attitude import AttitudeTurns
from flockbrush.output.body_list import BodyList
from flockbrush.runs.catalogue import LABELS
from flockbrush.runs.snapshots import borne

PRESENT, LEADER = 1, 2  # bits of `flags`
TURN = 32767  # of a quaternion's component 1
PHASE = 65535  # of a whole cycle
BASE = (
    ("place", "<f4", (3,)),  # m, z up
    ("turn", "<i2", (4,)),  # quaternion x, y, z, w times `TURN`
    ("pose", "<u2"),  # which mesh shows it
    ("phase", "<u2"),  # of its gait, times `PHASE`
    ("flags", "<u2"),
    ("brush", "<u2"),
    ("speed", "<f2"),  # m/s
    ("body", "<u2"),  # which of the animal's own bodies
)


def record_type(labels) -> np.dtype:
    """The dtype of a record: `BASE`, and a code for each label."""
    return np.dtype([*BASE, *((name, "<u4") for name in labels)])


class Records:
    """The records of a run.

    Parameters
    ----------
    folder : Path
        Of temporary files.

    Attributes
    ----------
    frames : int
    labels : list of str
        Group, family and state, as far as some animal had one.
    slots : dict of int to int
        Row of each animal that was ever there, by id, in the order in which they came.
    bodies : BodyList
    """

    def __init__(self, folder, simulation):
        self.simulation, self.labels, self._whole = simulation, [], record_type(LABELS)
        self.frames, self.slots, self.bodies = 0, {}, BodyList()
        self._turns, self._folder, self._counts = AttitudeTurns(simulation), folder, []
        self._spool = open(folder / "frames", "w+b")

    @property
    def type(self) -> np.dtype:
        """The dtype of what is read."""
        return record_type(self.labels)

    def take(self, moment, pose, phase):
        """Keep one moment, with pose and phase of the gait of each animal."""
        for animal in moment.ids.tolist():
            self.slots.setdefault(animal, len(self.slots))
        record = np.zeros(len(moment), self._whole)
        record["place"] = moment.xyz
        record["turn"] = np.round(np.roll(self._turns.of(moment), -1, axis=1) * TURN)
        record["pose"], record["brush"] = pose, moment.brush
        record["phase"] = np.round(phase * PHASE)
        record["flags"] = PRESENT + LEADER * moment.leader
        record["body"] = self.bodies.take(moment)
        record["speed"] = np.linalg.norm(moment.velocity, axis=1)
        for name, codes in moment.labels.items():
            record[name] = codes
        self.labels += [name for name in borne(self.simulation, moment) if name not in self.labels]
        rows = np.array([self.slots[animal] for animal in moment.ids.tolist()], "<u4")
        self._spool.write(rows.tobytes() + record.tobytes())
        self._counts.append(len(moment))
        self.frames += 1

    def by_frame(self):
        """Each frame as an array of records, one for each animal that is ever there; ``flags`` 0: not now."""
        self._spool.flush()
        self._spool.seek(0)
        kind, names = self.type, [*self.type.names]
        last = np.zeros(len(self.slots), kind)
        last["turn"][:, 3] = TURN
        for count in self._counts:
            rows = np.frombuffer(self._spool.read(4 * count), "<u4")
            here = np.frombuffer(self._spool.read(self._whole.itemsize * count), self._whole)
            last["flags"] = 0
            last[rows] = here[names]
            yield last

    def by_animal(self):
        """All records as a memory map (animals, frames); absent animals keep their last place, or their first."""
        shape = (len(self.slots), self.frames)
        table = np.memmap(self._folder / "animals", self.type, "w+", shape=shape)
        for frame, here in enumerate(self.by_frame()):
            table[:, frame] = here
        for row in range(shape[0]):
            first = int(np.argmax(table[row]["flags"] & PRESENT))
            before = table[row, :first]
            before[:] = table[row, first]
            before["flags"] = 0
        return table

    def close(self):
        """Close the temporary file."""
        self._spool.close()
