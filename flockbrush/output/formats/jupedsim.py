"""SQLite export in the schema of JuPedSim: trajectories and walkable area, for PedPy."""

from __future__ import annotations

import math
import sqlite3

from flockbrush.output.exporter import Exporter, exporter

VERSION = 2  # of JuPedSim's schema
SCHEMA = """
CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, pos_y REAL NOT NULL,
                              ori_x REAL NOT NULL, ori_y REAL NOT NULL, pos_z REAL NOT NULL, names INTEGER NOT NULL);
CREATE TABLE bodies (id INTEGER NOT NULL PRIMARY KEY, length REAL NOT NULL);
CREATE TABLE names (names INTEGER NOT NULL, kind TEXT NOT NULL, name TEXT NOT NULL);
CREATE TABLE metadata (key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE geometry (hash INTEGER NOT NULL, wkt TEXT NOT NULL);
CREATE TABLE frame_data (frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);
"""


@exporter(".sqlite")
class Sqlite(Exporter):
    """A database in JuPedSim's layout; the geometry of a frame is the level without the obstacles it has then."""

    contents = "trajectories and walkable area (WKT) in JuPedSim's schema, metres"
    opens_in = "PedPy, JuPedSim, DB Browser for SQLite"
    fps = 16.0
    needs = (("shapely", "shapely"),)

    def open(self):
        from flockbrush.render.scenery import Scenery

        self.temporary.unlink(missing_ok=True)
        self._base = sqlite3.connect(self.temporary)
        self._base.executescript(SCHEMA)
        self._scenery = Scenery(self.simulation)
        self._outlines, self._hash = None, 0
        self._areas: dict[str, int] = {}  # hash by WKT
        self._known: dict[tuple, int] = {}
        self._lengths: dict[int, float] = {}  # m, of each animal when it was there last

    def take(self, moment):
        from flockbrush.runs.snapshots import words_of

        words = words_of(self.simulation)
        codes = {"species": moment.species, "brush": moment.brush, **moment.labels}
        borne = {kind: [words[kind][code] for code in codes[kind].tolist()] for kind in codes}
        numbers = [
            self._number(tuple((kind, word) for kind, word in zip(borne, row, strict=True) if word))
            for row in zip(*borne.values(), strict=True)
        ]
        self._lengths.update(zip(moment.ids.tolist(), moment.length.tolist(), strict=True))
        x, y, z = moment.xyz.T.tolist()
        ways = [(ahead, aside, math.hypot(ahead, aside) or 1.0) for ahead, aside in moment.forward[:, :2].tolist()]
        ahead, aside = ([way[k] / way[2] for way in ways] for k in (0, 1))
        rows = zip([self.frames] * len(moment), moment.ids.tolist(), x, y, ahead, aside, z, numbers, strict=True)
        self._base.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?, ?, ?)", rows)
        self._base.execute("INSERT INTO frame_data VALUES (?, ?)", (self.frames, self._geometry()))
        self.frames += 1

    def _geometry(self):
        """Hash of the walkable area there is now: a row of the table ``geometry`` for each that is new."""
        from flockbrush.systems.ground_edges import solid_images

        land = self._scenery.land
        barriers = [o.polygon for o in solid_images(land.barriers, land.wrap)]
        outlines = [outline.tobytes() for outline in barriers]
        if outlines != self._outlines:
            self._outlines, area = outlines, walkable(self.simulation, barriers)
            if area not in self._areas:
                self._areas[area] = len(self._areas) + 1
                self._base.execute("INSERT INTO geometry VALUES (?, ?)", (self._areas[area], area))
            self._hash = self._areas[area]
        return self._hash

    def _number(self, names):
        """Number of a set of names that an animal bears: rows of the table ``names``."""
        if names not in self._known:
            self._known[names] = len(self._known)
            rows = [(self._known[names], kind, name) for kind, name in names]
            self._base.executemany("INSERT INTO names VALUES (?, ?, ?)", rows)
        return self._known[names]

    def finish(self):
        from flockbrush.output.trajectory_table import metadata_of

        about = metadata_of(self.simulation, self.fps)
        level = self.simulation.level
        metadata = {
            "version": VERSION,
            "fps": self.fps,
            "xmin": 0,
            "ymin": 0,
            "xmax": level.width,
            "ymax": level.height,
        }
        metadata |= {f"flockbrush_{key}": value for key, value in about.items() if key != "fps"}
        self._base.executemany("INSERT INTO metadata VALUES (?, ?)", [(key, str(metadata[key])) for key in metadata])
        self._base.executemany("INSERT INTO bodies VALUES (?, ?)", self._lengths.items())
        self._base.execute("CREATE INDEX frame_id_idx ON trajectory_data(frame, id)")
        self._base.commit()
        self._base.close()

    def let_go(self):
        self._base.close()


def walkable(simulation, barriers) -> str:
    """WKT of the level without obstacles, (k, 2) m each: the part with most animals, where they divide it."""
    import shapely

    from flockbrush.components import Position

    level = simulation.level
    stones = [shapely.Polygon(outline).buffer(0) for outline in barriers]
    whole = shapely.box(0, 0, level.width, level.height)
    left = whole.difference(shapely.union_all(stones)) if stones else whole
    parts = [part for part in shapely.get_parts(left) if part.area > 0]
    points = shapely.points(simulation.agents[Position.xyz][:, :2])
    best = max(parts, key=lambda part: (shapely.contains(part, points).sum(), part.area), default=whole)
    return shapely.to_wkt(best, rounding_precision=6)
