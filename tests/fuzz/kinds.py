"""Every kind of file that is read from outside: sound ones, how they are changed, and how far in they are read.

A kind is a class here with a docstring.  `Kind.read` may raise what `TOLD` lists; anything else is a bug.
"""

import io
import json
import math
import random
import struct
import zipfile
from dataclasses import fields
from functools import cached_property
from pathlib import Path

import crafted
import mutations as m
import numpy as np
from flockbrush.engine import limits
from flockbrush.engine.commands import COMMANDS, CommandError
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from flockbrush.systems.steer import NotFinite

TOLD = (ProblemsError, RecordingError, CommandError, NotFinite)
SHIPPED = Path(__file__).parents[2]


class Kind:
    """One kind of file."""

    ending = ""
    share = 1.0  # of all cases, before they are scaled to sum to 1

    def __init__(self, folder):
        self.folder = Path(folder)

    @cached_property
    def sound(self) -> list[bytes]:
        """Files that are read without a complaint."""
        raise NotImplementedError

    def changed(self, rng, data) -> bytes:
        """One of them, changed."""
        raise NotImplementedError

    def read(self, path):
        """Read a file as far as the program would."""
        raise NotImplementedError

    def case(self, rng) -> bytes:
        """A file to be read: mostly one whose structure is whole, now and then mere bytes."""
        data = rng.choice(self.sound)
        return m.changed_bytes(rng, data) if rng.random() < 0.1 else self.changed(rng, data)


# recordings and levels -------------------------------------------------------------------------


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
                wanted = from_record(*self._made(rng, rng.choice(sorted(COMMANDS)), 0.0))
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
            return m.as_json(rng, self._made(rng, rng.choice(sorted(COMMANDS)), 0.15))
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
        from flockbrush.engine.recording import first_difference, open_recording, resume

        from flockbrush.cli.commands import differing
        from flockbrush.runs.run import go_to, rebuild

        run = open_recording(path)
        differing(run)
        assert run.last_tick <= path.stat().st_size * limits.SILENT_TICKS / 28, "a recording of few bytes is endless"
        simulation, end = rebuild(run), min(run.last_tick, 12)
        try:
            if path.stat().st_size % 2:
                resume(run, simulation.world)
                first_difference(run, simulation.world, simulation.tick, end)
            else:
                go_to(run, simulation, end)
            simulation.measures()
        finally:
            simulation.close()


class Levels(Kind):
    """Levels with their tilesets, brushes and species, read and built."""

    ending, share = ".tmj", 1.5

    @cached_property
    def sound(self):
        from pens import pen

        self.folder.mkdir(parents=True, exist_ok=True)
        return [pen(self.folder, sheep=8).read_bytes()]

    def changed(self, rng, data):
        return m.changed_json(rng, data)

    def read(self, path):
        from flockbrush.runs.run import start

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

    def changed(self, rng, data):
        return m.changed_json(rng, data)

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


def changed_png(rng, data):
    """A PNG with one of its chunks changed, and right checksums."""
    chunks = crafted.png_chunks(data)
    at = rng.randrange(len(chunks))
    kind, content = chunks[at]
    how = rng.randrange(6)
    if how == 0:
        sides = [rng.choice([0, 1, 2, 24, 18, 53, 4000, 65535, 2**31 - 1, 2**32 - 1]) for _ in range(2)]
        modes = [rng.choice([0, 1, 2, 3, 4, 6, 8, 16, 255]) for _ in range(5)]
        chunks[0] = (
            b"IHDR",
            struct.pack(">IIBBBBB", *sides, *modes)
            if rng.random() < 0.5
            else (struct.pack(">II", *sides) + chunks[0][1][8:]),
        )
    elif how == 1:
        chunks = [(k, m.packed_again(rng, c, m.changed_bytes) if k == b"IDAT" else c) for k, c in chunks]
    elif how == 2:
        chunks.insert(
            at,
            (
                rng.choice([b"PLTE", b"tRNS", b"iCCP", b"zTXt", b"acTL", b"fcTL", b"IDAT", b"eXIf", b"IEND"]),
                rng.randbytes(20),
            ),
        )
    elif how == 3:
        del chunks[at]
    else:
        chunks[at] = kind, m.changed_bytes(rng, content)
    return crafted.png_of(chunks)


# texts -----------------------------------------------------------------------------------------


class _Toml(Kind):
    ending, share, places = ".toml", 0.7, ""

    @cached_property
    def sound(self):
        return [path.read_bytes() for path in sorted(SHIPPED.glob(self.places))]

    def changed(self, rng, data):
        return m.changed_toml(rng, data)


class Brushes(_Toml):
    """Brushes."""

    ending, places = ".brush.toml", "behaviours/brushes/*.brush.toml"

    def read(self, path):
        from flockbrush.behaviours.brush import load_brush
        from flockbrush.behaviours.brush_writer import brush_to_toml

        brush_to_toml(load_brush(path))


class Species(_Toml):
    """Species."""

    ending, places = ".species.toml", "behaviours/fauna/*.species.toml"

    def read(self, path):
        from flockbrush.behaviours.species import load_species

        load_species(path)


class Programs(_Toml):
    """Programs of states and triggers."""

    ending, places = ".program.toml", "behaviours/programs/*.program.toml"

    def read(self, path):
        from flockbrush.behaviours.program import load_program

        load_program(path)


class Sweeps(_Toml):
    """Sweeps, up to the first job."""

    ending, places = ".sweep.toml", "levels/*.sweep.toml"

    def read(self, path):
        from flockbrush.studies.sweep import Journal, jobs_of, runs_done
        from flockbrush.studies.sweep_file import read_sweep

        sweep, journal = read_sweep(path), Journal(path.with_suffix(".jsonl"))
        next(jobs_of(sweep, journal), None)
        runs_done(sweep, journal)


class Cameras(_Toml):
    """Cameras that filmed birds."""

    ending = ".toml"

    @cached_property
    def sound(self):
        return [
            b"width = 1280\nheight = 720\nhorizontal_fov_deg = 60\nfps = 30\nmean_speed = 9\nnear = 5\nfar = 200\n",
        ]

    def read(self, path):
        from flockbrush.lifting.lens import read_camera

        camera = read_camera(path)
        assert np.isfinite(camera.rays([[0, 0], [1280, 720]])).all()


class Journals(Kind):
    """Journals of sweeps that go on."""

    ending, share = ".jsonl", 0.5

    @cached_property
    def sound(self):
        row = {"scenario": "a1", "seed": 3, "status": "ok", "seconds": 0.5, "measures": {"time": 5, "shape": "V"}}
        bad = {"scenario": "a1", "seed": 4, "status": "failed", "seconds": 0.5, "error": "no"}
        build = {"build": {"code": "x", "sources": {"a.py": "12"}, "packages": {}, "cpu": "y"}}
        return ["".join(json.dumps(line) + "\n" for line in (build, row, bad, row)).encode()]

    def changed(self, rng, data):
        lines = [
            m.as_json(rng, m.changed_tree(rng, json.loads(line))).replace(b"\n", b"") for line in data.splitlines()
        ]
        return b"\n".join(rng.sample(lines, rng.randrange(1, len(lines) + 1))) + rng.choice([b"\n", b"\n", b""])

    def read(self, path):
        from flockbrush.runs.builds import build_of_sweep, differences
        from flockbrush.studies.sweep import Journal

        differences(Journal(path).build, build_of_sweep())


class Tracks(Kind):
    """Tracks of birds, smoothed."""

    ending = ".csv"

    @cached_property
    def sound(self):
        rows = [f"{f},{b},{100 + 3 * f + 9 * b},{50 + b * 5 - f}" for f in range(6) for b in range(4)]
        return [
            "\n".join(["frame,id,x,y", *rows]).encode(),
            "\n".join(["frame,id,x,y,gone", *(r + ",0" for r in rows)]).encode(),
        ]

    def changed(self, rng, data):
        return m.changed_table(rng, data)

    def read(self, path):
        from flockbrush.film.tracks import read_marks, read_tracks, smoothed

        for read in (read_marks, lambda file: smoothed(read_tracks(file), 1.0)):
            try:
                read(path)
            except ProblemsError as error:
                told = error
            else:
                told = None
        if told is not None:
            raise told


class Flights(Kind):
    """Flights in space, shown."""

    ending = ".csv"

    @cached_property
    def sound(self):
        rows = [f"{f},{f / 30:.4f},{b},{3 * f},{2 * b},{10 + b}" for f in range(6) for b in range(4)]
        return ["\n".join(["frame,time,id,x,y,z", *rows]).encode(), "\n".join(["frame,id,x,y,z"]).encode()]

    def changed(self, rng, data):
        return m.changed_table(rng, data)

    def read(self, path):
        from flockbrush.lifting.flight_show import Show

        Show.open(path)


class Marks(Kind):
    """Marked birds, extracted."""

    ending = ".csv"

    @cached_property
    def sound(self):
        pixels = [f"{f},{b},{100 + 20 * b},{80 + 12 * abs(b - 3) + f},25" for f in range(2) for b in range(7)]
        spans = [f"{b},{1.3 * b},{-0.8 * abs(b - 3)}" for b in range(7)]
        return [
            "\n".join(["frame,bird,x_px,y_px,wingspan_px", *pixels]).encode(),
            "\n".join(["bird,x_b,y_b", *spans]).encode(),
        ]

    def changed(self, rng, data):
        return m.changed_table(rng, data)

    def read(self, path):
        from flockbrush.behaviours.formation.extraction import extract
        from flockbrush.behaviours.formation.formation_shapes import read_formation, to_json
        from flockbrush.behaviours.formation.marks import read_marks

        marks, _ = read_marks(path)
        read_formation(json.loads(to_json(extract(marks))), str(path))


class Formations(Kind):
    """Formations, flown and made into brushes."""

    ending, share = ".json", 1.5

    @cached_property
    def sound(self):
        from flockbrush.behaviours.formation.extraction import Marks as Marked
        from flockbrush.behaviours.formation.extraction import extract
        from flockbrush.behaviours.formation.formation_shapes import textbook, to_json

        found = []
        for kind in ("V", "U", "J", "line"):
            x, y = textbook(kind, 7)
            frames = np.array([x, x * 1.05]), np.array([y, y * 0.95])
            found.append(to_json(extract(Marked(("0", "1"), tuple("abcdefg"), *frames), kind)).encode())
        return found

    def changed(self, rng, data):
        return m.changed_json(rng, data)

    def read(self, path):
        from flockbrush.behaviours.formation.formation_shapes import load_formation
        from flockbrush.behaviours.formation.steady_flight import Drawing, SteadyFlight

        from flockbrush.output.formation_brush import parameters_of

        formation = load_formation(path)
        try:
            assert np.isfinite([v for v in parameters_of(formation).values() if isinstance(v, float)]).all()
        except ProblemsError:
            pass
        flown = ((9, "proximal", 0.1, False), (2, "levenberg-marquardt", 0.1, False), (24, "proximal", 0.0, True))
        for birds, method, epsilon, exchange in flown:
            flight = SteadyFlight(formation, birds, 0, None, Drawing(epsilon=epsilon, method=method), exchange)
            places = flight.frames(8, 2.0)
            assert np.isfinite(places).all()
            flight.report(places)


# pictures, films, fields -----------------------------------------------------------------------


class Pictures(Kind):
    """Photographs and masks."""

    ending = ".png"

    @cached_property
    def sound(self):
        import cv2

        picture = np.full((80, 120, 3), 220, np.uint8)
        for k in range(5):
            cv2.ellipse(picture, (16 + 22 * k, 40), (4, 2), 0, 0, 360, (40, 40, 40), -1)
        return [cv2.imencode(ending, picture)[1].tobytes() for ending in (".png", ".jpg", ".webp", ".bmp")]

    def changed(self, rng, data):
        return changed_png(rng, data) if data[:4] == b"\x89PNG" else m.changed_bytes(rng, data, 8)

    def read(self, path):
        from flockbrush.film.birds_in_sky import mark
        from flockbrush.film.clip_reader import open_clip

        open_clip(path)
        mark([path])


class Films(Kind):
    """Films, their boxes changed where they stand."""

    ending, share = ".mp4", 0.7

    @cached_property
    def sound(self):
        from clip_film import film

        self.folder.mkdir(parents=True, exist_ok=True)
        pictures = [np.full((32, 48, 3), 200, np.uint8) for _ in range(8)]
        for k, picture in enumerate(pictures):
            picture[10:14, 4 + 3 * k : 9 + 3 * k] = 30
        found = []
        for name in ("a.mp4", "a.mkv", "a.avi"):
            film(self.folder / name, pictures)
            found.append((self.folder / name).read_bytes())
        return found

    def changed(self, rng, data):
        return m.changed_bytes(rng, data, 10)

    def read(self, path):
        from flockbrush.film.clip_frames import Film
        from flockbrush.film.clip_reader import open_clip

        film = Film(path)
        for k in (0, len(film) - 1, 3, 5, 4):
            film.frame(k)
        film.close()
        clip = open_clip(path)
        assert sum(1 for _ in clip.read()) <= 100_000


class FieldFiles(Kind):
    """Files of fields: zip archives of arrays, with right checksums."""

    ending, share = ".npz", 0.7

    @cached_property
    def sound(self):
        from flockbrush.film.observations import Evidence, Fields

        self.folder.mkdir(parents=True, exist_ok=True)
        cells = 3, 4, 5
        grid = {name: np.ones(cells) for name in ("density", "speed_variance", "angular_variance", "speed")}
        made = Fields(
            fps=10.0, cell=1.0, origin=np.zeros(2), velocity=np.ones((*cells, 2)), seen=np.ones(cells, bool),
            obstacle=np.zeros(cells[1:], bool), region=np.zeros(cells[1:], np.uint8), count=np.ones(3),
            frames=np.arange(3), **grid,
        )  # fmt: skip
        evidence = Evidence("a.mp4", "0" * 64, 10.0, 20.0, "given", 0.2, made, picture=np.zeros((9, 9, 3), np.uint8))
        evidence.save(self.folder / "sound.npz")
        return [(self.folder / "sound.npz").read_bytes()]

    def changed(self, rng, data):
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            members = {name: old.read(name) for name in old.namelist()}
        name = rng.choice(sorted(members))
        how = rng.randrange(5)
        if how == 0:
            del members[name]
        elif how == 1:
            members[name] = members[rng.choice(sorted(members))]
        elif how == 2:
            head, size = members[name][:8], struct.unpack_from("<H", members[name], 8)[0]
            text = m.changed_bytes(rng, members[name][10 : 10 + size])[:60000]
            members[name] = head + struct.pack("<H", len(text)) + text + members[name][10 + size :]
        elif how == 3:
            value = m.odd(rng)
            members[name] = _array(value)
        else:
            members[name] = m.changed_bytes(rng, members[name])
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
            for key, content in members.items():
                new.writestr(key, content)
        return packed.getvalue()

    def read(self, path):
        from flockbrush.film.observations import Evidence

        Evidence.load(path)


def _array(value):
    """A value as an array in a file, where it can be one."""
    packed = io.BytesIO()
    try:
        np.save(packed, np.array(value), allow_pickle=False)
    except (ValueError, OverflowError, UnicodeEncodeError):
        np.save(packed, np.zeros((2, 0, 3)))
    return packed.getvalue()


def kinds(folder):
    """{name: kind} of all kinds, each with a folder of its own."""
    from state_kinds import Edits, Sessions, Settings, Trials
    from track_kinds import track_kinds

    classes = [
        Recordings, Levels, Tilesets, Heights, Brushes, Species, Programs, Sweeps, Cameras, Journals, Tracks, Flights,
        Marks, Formations, Pictures, Films, FieldFiles, Sessions, Edits, Trials, Settings, *track_kinds(),
    ]  # fmt: skip
    return {kind.__name__.lower(): kind(Path(folder) / kind.__name__.lower()) for kind in classes}
