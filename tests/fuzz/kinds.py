"""Every kind of file that is read from outside: sound ones, how they are changed, and how far in they are read.

A kind is a class here with a docstring.  `Kind.read` may raise what `kind.TOLD` lists; anything else is a bug.
"""

import json
import math
import random
import struct
from dataclasses import fields
from functools import cached_property
from pathlib import Path

import crafted
import mutations as m
import numpy as np
from flockbrush.engine import limits
from flockbrush.engine.commands import COMMANDS
from flockbrush.engine.plugins import is_ours
from kind import Kind
from picture_kinds import FieldFiles, Films, Pictures, changed_png
from state_kinds import Edits, Sessions, Settings, Trials
from text_kinds import Brushes, Cameras, Flights, Formations, Journals, Marks, Programs, Species, Sweeps, Tracks
from track_kinds import track_kinds


def _own_commands():
    """Names of the commands of this repository: tests register others, which fail."""
    return sorted(name for name, kind in COMMANDS.items() if is_ours(kind.__module__))


class Recordings(Kind):
    """Recordings with right checksums: headers, files, commands, ticks and snapshots that are not as they were."""

    ending, share = ".flock", 2.5

    @cached_property
    def level(self):
        from pens import pen

        self.folder.mkdir(parents=True, exist_ok=True)
        return pen(self.folder, sheep=8)

    @cached_property
    def sound(self):
        from flockbrush.engine.recording import Recorder, Recording

        from flockbrush.runs.run import beginning_of, start

        simulation, path = start(self.level), self.folder / "sound.flock"
        recorder = Recorder(Recording.create(path, *beginning_of(simulation)), simulation.world, 1, 4)
        for _ in range(9):
            simulation.tick()
            recorder.take()
        recorder.close()
        simulation.close()
        return [path.read_bytes()]

    def changed(self, rng, data):
        records = crafted.records_of(data)
        for _ in range(rng.choice([1, 1, 2])):
            records = self._one(rng, records)
        if rng.random() < 0.9:
            try:
                records = crafted.with_true_assets(records)
            except (ValueError, TypeError, IndexError):
                pass
        return crafted.recording_of(records)

    def _one(self, rng, records):
        how, at = rng.randrange(14), rng.randrange(len(records))
        kind, tick, content = records[at]
        if how in (0, 12):
            return self._of_kind(rng, records, b"H", m.changed_json)
        if how == 1:
            return self._of_kind(rng, records, b"A", self._asset)
        if how == 2:
            return self._of_kind(rng, records, b"K", self._snapshot)
        if how == 3:
            moved = kind, rng.choice([0, 1, tick + 1, 1919, 1921, 2**31, 2**62]), content
            return [*records[:at], moved, *records[at + 1 :]]
        if how == 4:
            return records[:at] + records[at + 1 :] or records
        if how == 5:
            return [*records[:at], records[at], *records[at:]]
        if how == 6:
            return [*records[:at], (kind, tick, m.changed_bytes(rng, content)), *records[at + 1 :]]
        new = b"C", rng.randrange(8), self._command(rng)
        at = next((k for k, r in enumerate(records) if r[0] == b"S" and r[1] >= new[1]), len(records))
        return [*records[:at], new, *records[at:]]

    @staticmethod
    def _of_kind(rng, records, kind, change):
        chosen = [k for k, r in enumerate(records) if r[0] == kind]
        if not chosen:
            return records
        at = rng.choice(chosen)
        return [*records[:at], (kind, records[at][1], change(rng, records[at][2])), *records[at + 1 :]]

    @staticmethod
    def _asset(rng, content):
        name, _, data = content.partition(b"\0")
        change = m.changed_toml if name.endswith(b".toml") else m.changed_json
        return name + b"\0" + (change(rng, data) if data[:1] in b"{[s#n" else m.changed_bytes(rng, data))

    @staticmethod
    def _snapshot(rng, content):
        (size,) = struct.unpack_from("<Q", content, 8)
        head, body = content[16 : 16 + size], content[16 + size :]
        if rng.random() < 0.3:
            head = m.changed_json(rng, head)
        elif rng.random() < 0.5:
            at = rng.randrange(max(1, len(body) // 8)) * 8
            body = body[:at] + struct.pack("<d", rng.choice([math.nan, math.inf, 1e308, -1.0])) + body[at + 8 :]
        else:
            body = m.changed_bytes(rng, body)
        return content[:8] + struct.pack("<Q", len(head)) + head + body[: len(content)]

    @cached_property
    def done(self):
        """{name: [[name, values]]} of commands that could be done, and of those that take them back."""
        from flockbrush.engine.commands import Commands, from_record, to_json

        from flockbrush.runs.run import start

        rng, simulation, found = random.Random("commands"), start(self.level), {}
        queue = simulation.world.resource(Commands)
        for k in range(900):
            try:
                wanted = from_record(*self._made(rng, rng.choice(_own_commands()), 0.0))
                back = queue.perform(simulation.world, [wanted])
            except (ValueError, LookupError):
                continue
            for command in (wanted, *back):
                found.setdefault(type(command).__name__, []).append(json.loads(to_json(command)))
            if k % 50 == 0:
                simulation.tick()
        simulation.close()
        return {name: tries[:20] for name, tries in sorted(found.items())}

    def _command(self, rng):
        """A command that was done once, mostly with some of it changed; or one with values that make some sense."""
        if rng.random() < 0.3:
            return m.as_json(rng, self._made(rng, rng.choice(_own_commands()), 0.15))
        name, values = rng.choice(self.done[rng.choice(list(self.done))])
        return m.as_json(rng, [name, m.changed_tree(rng, values) if rng.random() < 0.8 else values])

    def _made(self, rng, name, odds):
        """[name, values] of a command."""
        return [name, {f.name: self._value(rng, f, odds) for f in fields(COMMANDS[name]) if rng.random() < 0.95}]

    @staticmethod
    def _value(rng, field, odds):
        hint = str(field.type)
        if rng.random() < odds:
            return m.odd(rng)
        if "None" in hint and rng.random() < 0.5:
            return None
        if "str" in hint:
            words = "march swarm sheep stone way gate flock loosen graze brush cap surface grass west home Guide Goal"
            return rng.choice([*words.split(), "#a0b0c0", "box", ""])
        if "bool" in hint:
            return rng.random() < 0.5
        if "int" in hint and "float" not in hint:
            return rng.choice([0, 1, 2, 3, 5, 8, 9, 12, 25, -1, 2**31, 2**63 - 1])
        if "float" in hint:
            far = rng.choice([1e15, -1e15, 1e9, 1e-300, 1e6])
            return rng.choice([0.0, 0.5, 1.0, 3.0, rng.uniform(-5, 40), rng.uniform(0, 20), rng.uniform(0, 20), far])
        if "dict" in hint:
            return {rng.choice(["brush", "speed", "sheep", "x"]): m.odd(rng)}
        corners = [[rng.uniform(-5, 45), rng.uniform(-5, 35)] for _ in range(rng.choice([1, 2, 3, 4, 5, 40]))]
        far = [[rng.choice([1e15, -1e15, 1e9, 0.0, 20.0]), rng.choice([1e15, 1e-12, 15.0])] for _ in range(4)]
        whole = [[rng.randrange(-1, 30), rng.randrange(-1, 41), rng.randrange(6), rng.randrange(2)] for _ in range(3)]
        some = rng.sample(range(1, 14), 3)
        return rng.choice([corners, corners, far, whole, some, ["march", "swarm"], ["swarm"], [], [0.5, 1.5], [2**62]])

    def read(self, path):
        from flockbrush.engine.recording import first_difference, open_recording

        from flockbrush.cli.level_commands import differing
        from flockbrush.runs.run import go_to, rebuild

        run = open_recording(path)
        differing(run)
        assert run.last_tick <= path.stat().st_size * limits.SILENT_TICKS / 28, "a recording of few bytes is endless"
        simulation, end = rebuild(run), min(run.last_tick, 12)
        try:
            if path.stat().st_size % 2:
                first_difference(run, simulation.world, simulation.tick, end)
            else:
                go_to(run, simulation, end)
            simulation.measures()
        finally:
            simulation.close()


class Levels(Kind):
    """Levels with their tilesets, brushes and species, read and built."""

    ending, share = ".tmj", 8.0

    @cached_property
    def sound(self):
        from pens import pen
        from small_level import rich

        self.folder.mkdir(parents=True, exist_ok=True)
        files = rich()
        texts = [json.dumps(files).encode(), json.dumps(files["small.tmj"], indent=1).encode()]
        return [pen(self.folder, sheep=8).read_bytes(), *2 * texts]

    def read(self, path):
        from small_level import survives, tileset

        from flockbrush.runs.run import start

        data = path.read_bytes()
        if b"small.tmj" in data or b"kinds.tsj" in data:  # one of everything, which is read and not built
            try:
                files = {name: json.dumps(part).encode() for name, part in json.loads(data).items()}
                files = files if "small.tmj" in files else {"small.tmj": data}
            except (ValueError, AttributeError):
                files = {"small.tmj": data}
            survives({"kinds.tsj": json.dumps(tileset()).encode()} | files)
            return

        simulation = start(path)
        simulation.tick()
        simulation.close()


class Tilesets(Kind):
    """Tilesets of a level."""

    ending, share = ".tsj", 0.5

    @cached_property
    def sound(self):
        from pens import pen

        self.folder.mkdir(parents=True, exist_ok=True)
        self.level = pen(self.folder, sheep=8)
        return [path.read_bytes() for path in sorted((self.folder / "tilesets").glob("*.tsj"))]

    def read(self, path):
        from flockbrush.levels.reader import read_level

        document = json.loads(self.level.read_bytes())
        names = [entry["source"] for entry in document["tilesets"]]
        for entry in document["tilesets"]:
            entry["source"] = path.name if Path(entry["source"]).name == Path(names[0]).name else entry["source"]
        other = self.folder / "other.tmj"
        other.write_text(json.dumps(document))
        read_level(other)


class Heights(Kind):
    """Height pictures of levels, with right checksums."""

    ending, share = ".png", 0.5

    @cached_property
    def sound(self):
        import cv2

        grey = np.arange(24 * 18, dtype=np.uint16).reshape(18, 24)
        return [cv2.imencode(".png", kind(grey))[1].tobytes() for kind in (np.uint16, np.uint8)]

    def changed(self, rng, data):
        return changed_png(rng, data)

    def read(self, path):
        from flockbrush.levels.height_picture import read_grey

        try:
            read_grey(path.read_bytes())
        except ValueError:  # the reader of levels says where
            pass


def kinds(folder):
    """{name: kind} of all kinds, each with a folder of its own."""
    classes = [
        Recordings, Levels, Tilesets, Heights, Brushes, Species, Programs, Sweeps, Cameras, Journals, Tracks, Flights,
        Marks, Formations, Pictures, Films, FieldFiles, Sessions, Edits, Trials, Settings, *track_kinds(),
    ]  # fmt: skip
    return {kind.__name__.lower(): kind(Path(folder) / kind.__name__.lower()) for kind in classes}
