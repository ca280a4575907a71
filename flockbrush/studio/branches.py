"""The branches of a session: their start, their commands and their snapshots."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from flockbrush.behaviours.brush import BrushLibrary
from flockbrush.engine.commands import Commands, script_after
from flockbrush.engine.files import output_problems, refused
from flockbrush.engine.problems import Problem
from flockbrush.engine.state import StateError, check_beginning, pieces, snapshot, state_hash
from flockbrush.levels.build import DT
from flockbrush.levels.schema import Level
from flockbrush.runs import run as running
from flockbrush.studio.branch_recorder import BranchRecorder


@dataclass(frozen=True, eq=False)
class Beginning:
    """The start of a run: a level with its brushes, the seed and the number of animals."""

    level: Level
    library: BrushLibrary
    seed: int | None = None
    agents: int | None = None

    def build(self):
        """The world before its first tick; ProblemsError."""
        return running.begin(self.level, self.library, self.seed, self.agents)


class Keyframes:
    """Snapshots by tick.  Parts that did not change between two snapshots are stored once."""

    def __init__(self, kept=None):
        self._kept: dict[int, list[bytes]] = kept or {}

    def keep(self, tick, data):
        """Store a snapshot of this tick."""
        cut, before = pieces(data), self.before(tick)
        known = [] if before is None else self._kept[before]
        if len(known) == len(cut):
            cut = [old if old == new else new for old, new in zip(known, cut, strict=True)]
        self._kept[tick] = cut

    def before(self, tick):
        """The last tick up to this one of which there is a snapshot."""
        return max((t for t in self._kept if t <= tick), default=None)

    def until(self, tick):
        """Those up to a tick, for a branch that leaves there."""
        return Keyframes({t: cut for t, cut in self._kept.items() if t <= tick})

    def parts(self):
        """{identity: bytes} of what is held, each part once."""
        return {id(part): part for cut in self._kept.values() for part in cut}

    def gaps(self):
        """(ticks between its neighbours, tick) of each snapshot that may be dropped: not the first or last."""
        ticks = sorted(self._kept)
        return [(after - before, tick) for before, tick, after in zip(ticks, ticks[1:], ticks[2:], strict=False)]

    def cut(self, tick):
        """The pieces of a snapshot, or None."""
        return self._kept.get(tick)

    def drop(self, tick):
        """Drop the snapshot of a tick."""
        del self._kept[tick]

    def let_go(self, count):
        """Keep only so many, the ones kept last."""
        while len(self._kept) > count:
            del self._kept[next(iter(self._kept))]

    def __getitem__(self, tick):
        return b"".join(self._kept[tick])

    def __iter__(self):
        return iter(sorted(self._kept))

    def __len__(self):
        return len(self._kept)


@dataclass(eq=False)
class Branch:
    """One course of a run: its start, its commands by tick, and what is recorded of it."""

    name: str
    beginning: Beginning
    # header, assets: what a recording of it begins with
    header: dict
    assets: dict[str, bytes]
    script: list  # list of (tick, command, key); what the level itself will do
    keyframes: Keyframes = field(default_factory=Keyframes)
    # list of (tick, command); as applied, in order; the script's among them
    commands: list = field(default_factory=list)
    # state hash after so many ticks, before anything was done there
    hashes: dict[int, str] = field(default_factory=dict)
    # list of (tick, box); where the ground changed: (west, south, east, north) in metres, or "all"
    changes: list = field(default_factory=list)
    samples: list = field(default_factory=list)
    # list of (tick, command, key); what of the script, as it is then, is still to come at its end
    waiting: list = field(default_factory=list)
    last_tick: int = 0
    # parent, left: str, int; the branch it comes from, and the tick at which it left that one
    parent: str = ""
    left: int = 0
    editor: Any = None  # flockbrush.levels.editor.Editor; of the level's document as it is at the branch's end
    recorder: BranchRecorder | None = None
    outdated: bool = False  # another branch was saved since
    differs: int | None = None  # the first tick that came out differently when it was lived again

    @classmethod
    def begun(cls, name, beginning, simulation):
        """A new branch at its first tick."""
        header, assets = running.beginning_of(simulation)
        branch = cls(name, beginning, header, assets, simulation.world.resource(Commands).waiting)
        branch.waiting = branch.script
        branch.hashes[0] = state_hash(simulation.world)
        branch.keyframes.keep(0, snapshot(simulation.world))
        return branch

    def take_over(self, run, world, budget):
        """Take hashes and commands from a recording, and its snapshots up to some bytes, evenly spaced."""
        self.commands, self.hashes, self.last_tick = run.commands, dict(sorted(run.hashes.items())), run.last_tick
        known = max([run.last_tick - 1, *(tick for tick, _ in run.commands)])
        self.waiting = self._to_come(known)
        self.changes = [(tick, "all") for tick, cmd in run.commands if hasattr(cmd, "ground_box")]
        for tick in _coarse_to_fine(sorted(run.keyframes)):
            try:
                data = run.keyframes.read(tick, partial(check_beginning, world))
            except StateError:
                continue  # of another version: the run is lived again from the one before
            budget -= len(data)
            if budget < 0:
                break
            self.keyframes.keep(tick, bytes(data))

    def done_at(self, tick):
        """Commands that were applied at the start of this tick."""
        return [cmd for _, cmd in between(self.commands, tick, tick)]

    def done_by_hand(self):
        """(tick, command) of what was done to the run beside what its level's script does."""
        script, by_hand = list(self.script), []
        for tick, cmd in self.commands:
            given = next((entry for entry in script if entry[:2] == (tick, cmd)), None)
            if given is None:
                by_hand.append((tick, cmd))
            else:
                script.remove(given)
            script = script_after(script, [(tick, cmd)], DT)
        return by_hand

    def _to_come(self, tick):
        """What of the script, as the commands left it, comes after a tick."""
        return [entry for entry in script_after(self.script, self.commands, DT) if entry[0] > tick]

    def until(self, tick, name):
        """A new branch with all that happened up to a tick, and what was done there."""
        new = Branch(name, self.beginning, self.header, self.assets, self.script, self.keyframes.until(tick))
        new.commands = between(self.commands, 0, tick)
        new.hashes = {t: digest for t, digest in self.hashes.items() if t <= tick}
        new.changes = between(self.changes, 0, tick)
        new.samples = [sample for sample in self.samples if sample.tick <= tick]
        new.waiting = new._to_come(tick)
        new.last_tick = new.left = tick
        new.parent, new.differs = self.name, self.differs
        return new


def _coarse_to_fine(ticks):
    """The last element, the middle, the quarters and so on, so that any prefix is evenly spaced."""
    steps = [1 << power for power in range(len(ticks).bit_length(), -1, -1)]
    return list(dict.fromkeys(tick for step in steps for tick in ticks[::-step]))


def between(entries, first, last):
    """Entries (tick, ...) in order of tick, from the first tick to the last."""
    return entries[bisect_left(entries, first, key=tick_of) : bisect_right(entries, last, key=tick_of)]


def tick_of(entry):
    return entry[0]


def recording_problems(record, inputs) -> list[Problem]:
    """What is wrong with the file of a recording, None without one; those of branches are named after it."""
    if record is None:
        return []
    plain = f"{plain_name(record.stem)}.flock"
    return output_problems([record], inputs) if record.name == plain else refused(record, f"name it {plain}").problems


def plain_name(name):
    """A name as a file of every system may have it."""
    return re.sub(r"[^\w.-]+", "-", name).strip("-.") or "branch"
