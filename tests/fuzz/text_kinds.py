"""Brushes, species, programs, sweeps, cameras, journals, tracks, flights, marks, formations."""

import json
from contextlib import contextmanager, suppress
from functools import cached_property

import mutations as m
import numpy as np
from flockbrush.engine.problems import ProblemsError
from kind import SHIPPED, Kind


class _Toml(Kind):
    ending, share, places = ".toml", 0.7, ""
    changes = staticmethod(m.changed_toml)

    @cached_property
    def sound(self):
        return [path.read_bytes() for path in sorted(SHIPPED.glob(self.places))]


@contextmanager
def _problems_in(path):
    """Problems of a file name it, say something, and where they name a line it is one of the file."""
    try:
        yield
    except ProblemsError as error:
        data = path.read_bytes()
        lines = data.count(b"\n") + data.count(b"\r") + 1
        assert error.problems and all(one.file == str(path) and one.message for one in error.problems)
        assert all(one.line is None or 1 <= one.line <= lines for one in error.problems)
        raise


class Brushes(_Toml):
    """Brushes."""

    ending, share, places = ".brush.toml", 4.0, "behaviours/brushes/*.brush.toml"

    def read(self, path):
        from flockbrush.behaviours.brush import load_brush
        from flockbrush.behaviours.brush_writer import brush_to_toml

        with _problems_in(path):
            brush = load_brush(path)
        assert load_brush(brush_to_toml(brush).encode(), str(path)) == brush


class Species(_Toml):
    """Species."""

    ending, places = ".species.toml", "behaviours/fauna/*.species.toml"

    def read(self, path):
        from flockbrush.behaviours.species import load_species

        load_species(path)


class Programs(_Toml):
    """Programs of states and triggers."""

    ending, share, places = ".program.toml", 2.0, "behaviours/programs/*.program.toml"

    def read(self, path):
        from flockbrush.behaviours.program import load_program

        with _problems_in(path):
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
        return [b"width = 1280\nheight = 720\nhorizontal_fov_deg = 60\nfps = 30\nmean_speed = 9\nnear = 5\nfar = 200\n"]

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
    changes = staticmethod(m.changed_table)

    @cached_property
    def sound(self):
        rows = [f"{f},{b},{100 + 3 * f + 9 * b},{50 + b * 5 - f}" for f in range(6) for b in range(4)]
        return [
            "\n".join(["frame,id,x,y", *rows]).encode(),
            "\n".join(["frame,id,x,y,gone", *(r + ",0" for r in rows)]).encode(),
        ]

    def read(self, path):
        from flockbrush.film.tracks import read_marks, read_tracks, smoothed

        with suppress(ProblemsError):
            read_marks(path)
        smoothed(read_tracks(path), 1.0)


class Flights(Kind):
    """Flights in space, shown."""

    ending = ".csv"
    changes = staticmethod(m.changed_table)

    @cached_property
    def sound(self):
        rows = [f"{f},{f / 30:.4f},{b},{3 * f},{2 * b},{10 + b}" for f in range(6) for b in range(4)]
        return ["\n".join(["frame,time,id,x,y,z", *rows]).encode(), "\n".join(["frame,id,x,y,z"]).encode()]

    def read(self, path):
        from flockbrush.lifting.flight_show import Show

        Show.open(path)


class Marks(Kind):
    """Marked birds, extracted."""

    ending = ".csv"
    changes = staticmethod(m.changed_table)

    @cached_property
    def sound(self):
        pixels = [f"{f},{b},{100 + 20 * b},{80 + 12 * abs(b - 3) + f},25" for f in range(2) for b in range(7)]
        spans = [f"{b},{1.3 * b},{-0.8 * abs(b - 3)}" for b in range(7)]
        return [
            "\n".join(["frame,bird,x_px,y_px,wingspan_px", *pixels]).encode(),
            "\n".join(["bird,x_b,y_b", *spans]).encode(),
        ]

    def read(self, path):
        from flockbrush.behaviours.formation.extraction import extract
        from flockbrush.behaviours.formation.formation_shapes import read_formation, to_json
        from flockbrush.behaviours.formation.marked_birds import read_marks

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
