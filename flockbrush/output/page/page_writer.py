"""Writes a run as one self-contained HTML page."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path

import numpy as np

from flockbrush.engine.recording import state_hash
from flockbrush.output.attitude import held
from flockbrush.output.body_list import BodyList
from flockbrush.output.moving_solids import MovingSolids
from flockbrush.output.page.coarse import coarse_triangles
from flockbrush.output.page.frames import COLUMNS, FRAMES, packed, row_of
from flockbrush.output.painted_ground import PaintedGround
from flockbrush.output.picture_exporter import chosen_theme
from flockbrush.output.scene_meshes import SceneMeshes, jpeg_of
from flockbrush.output.trajectory_table import metadata_of
from flockbrush.render.animal_looks import CLIPS, mesh_of, poses_of
from flockbrush.render.brush_marks import swatch
from flockbrush.render.drawn_ground import brush_key
from flockbrush.render.gaits import Gaits, looks_of
from flockbrush.render.leader_marks import LeaderMarks
from flockbrush.render.painter import brushes_in_sight
from flockbrush.render.per_run import of_run
from flockbrush.render.scenery import Scenery
from flockbrush.render.space_view import sky_of
from flockbrush.render.style import PALETTE, mix, rgb, worn
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.runs.run import versions
from flockbrush.runs.snapshots import borne
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_milling, compute_polarization

HERE = Path(__file__).parent
GROUND = (56, 32)  # pixels of a patch of painted ground in the legend, twice those on the page
SCRIPTS = ("unpack.js", "shaders.js", "place.js", "animals.js", "charts.js", "card.js", "main.js")
MEASURES = (
    ("polarization", "1", "0: headings in all directions, 1: all the same"),
    ("milling", "1", "0: no rotation, 1: all rotate about the centroid"),
    ("speed", "m/s", "mean speed"),
    ("spread", "m", "root mean square distance from the centroid"),
    ("animals", "", "number of animals"),
)


class PageWriter:
    """A page, written chunk by chunk.

    Parameters
    ----------
    file : binary file
    fps : float
    options : dict
        ``theme``, ``palette``; ``source``: what is known of the recording it comes from, by name.
    """

    def __init__(self, file, simulation, fps, options):
        self.file, self.simulation, self.fps, self.options = file, simulation, fps, options
        self.theme = chosen_theme(options)
        self.gaits, self.frames, self.times = Gaits(simulation), 0, []
        self.rows, self.bodies, self.measures = [], BodyList(), {name: [] for name, _, _ in MEASURES}
        self.labels: list[str] = []
        self.patches: list[tuple] = []  # of the ground's picture: when, left, top
        self._head()

    def take(self, moment):
        """Add one moment."""
        self.moving.take()
        self._ground(moment.time, self.painted.take(moment.time))
        body, attitude = self.bodies.take(moment), held(self.simulation, moment)
        marked = of_run(LeaderMarks, self.simulation).of(moment)
        self.rows.append(row_of(moment, body, attitude, *self.gaits.of(moment), marked))
        self.labels += [name for name in borne(self.simulation, moment) if name not in self.labels]
        self.times.append(round(moment.time, 6))
        for name, value in measured(moment).items():
            self.measures[name].append(None if value is None else float(f"{value:.4g}"))
        if len(self.rows) == FRAMES:
            self._chunk()

    def finish(self):
        """Write what is left, the place, the names and the programs."""
        if self.times:
            self._ground(self.times[-1], self.painted.late())
        self._chunk()
        self._data("about", json.dumps(self._about(), separators=(",", ":")).encode())
        for name in SCRIPTS:
            self._write(f"<script>\n{(HERE / name).read_text(encoding='utf-8')}</script>\n")
        self._write("</body>\n</html>\n")

    # parts -----------------------------------------------------------------------------

    def _write(self, text):
        self.file.write(text.encode())

    def _data(self, kind, data, compressed=False):
        """Bytes that the page finds by their kind."""
        data = data if compressed else zlib.compress(data, 9)
        self._write(f'<script type="application/octet-stream" data-kind="{kind}">')
        self.file.write(base64.b64encode(data))
        self._write("</script>\n")

    def _head(self):
        look = self.theme
        names = ("paper", "ink", "muted", "frame", "guide", "goal", "exit", "leader", "predator", "ground")
        colours = "".join(f"--{name}:rgb{getattr(look, name)};" for name in names)
        style = (HERE / "style.css").read_text(encoding="utf-8")
        text = (HERE / "page.html").read_text(encoding="utf-8")
        title = f"{self.simulation.level.name} · Flockbrush"
        for mark, value in (("TITLE", _escaped(title)), ("STYLE", f":root{{{colours}}}\n{style}"), ("MODE", look.name)):
            text = text.replace(f"{{{{{mark}}}}}", value)
        self._write(text)
        self._write(f"<!--\n{(HERE / 'three.LICENSE.txt').read_text(encoding='utf-8')}-->\n")
        self._data("three", (HERE / "three.min.js").read_bytes())
        place = SceneMeshes(self.simulation, self.theme)
        self.moving = MovingSolids(place)
        self.painted = PaintedGround(place)
        self._data("ground", jpeg_of(self.painted.picture), compressed=True)
        self._data("place", json.dumps(_place(place), separators=(",", ":")).encode())

    def _ground(self, time, patch):
        """Write what has changed of the ground's picture."""
        if patch is not None:
            self.patches.append((round(time, 6), patch.left, patch.top))
            self._data("patch", jpeg_of(patch.pixels), compressed=True)

    def _chunk(self):
        if self.rows:
            self._data("frames", packed(self.rows, self.bodies.of, self.labels), compressed=True)
            self._data("labels", json.dumps(self.labels).encode())
            self.frames += len(self.rows)
            self.rows = []

    def _grounds(self, palette):
        """A picture of the ground that each brush is painted on, as an address; None for those that are not."""
        grounds, colours = [], worn([brush.colour for brush in palette.brushes], self.theme)
        painted = brushes_in_sight(Scenery(self.simulation))
        for name, colour in zip(palette.names, colours, strict=True):
            patch = None
            if brush_key(name) in painted:
                patch = jpeg_of(swatch(name, rgb(colour), self.theme, GROUND, 1.2))
            grounds.append(patch and "data:image/jpeg;base64," + base64.b64encode(patch).decode())
        return grounds

    def _about(self):
        simulation, look = self.simulation, self.theme
        catalogue = catalogue_of(simulation.world)
        palette = catalogue.palette
        looks = looks_of(simulation)
        wrap = simulation.world.resource(Landscape).wrap
        return {
            **metadata_of(simulation, self.fps),
            "title": simulation.level.name,
            "versions": versions(),
            "state_hash": state_hash(simulation.world),
            "source": self.options.get("source") or {},
            "times": self.times,
            "columns": COLUMNS,
            "words": {name: catalogue.words[name] for name in ("species", "brush", *self.labels)},
            "brush_colours": worn([brush.colour for brush in palette.brushes], look),
            "brush_grounds": self._grounds(palette),
            "predators": [bool(danger) for danger in palette.danger],
            "other_colours": PALETTE,
            "leader": look.leader,
            "predator": look.predator,
            "looks": looks,
            "clips": CLIPS,
            "meshes": {name: _mesh(name) for name in sorted({*looks, "beast"})},
            "wrap": None if wrap is None else [float(side) for side in wrap],
            "measures": [
                {"name": name, "unit": unit, "meaning": meaning, "values": self.measures[name]}
                for name, unit, meaning in MEASURES
            ],
            "moving": _moving(self.moving.solids, self.times),
            "patches": self.patches,
            "sky": [list(colour) for colour in sky_of(look)],
            "land": mix(mix(look.ground, look.paper, 0.45), look.ground, 0.3),
            "shadow": [*look.shadow, look.shadow_alpha],
            "dark": look.name == "dark",
        }


def measured(moment):
    """{measure: number} of one moment, None if there are no animals."""
    if not len(moment):
        return {name: 0 if name == "animals" else None for name, _, _ in MEASURES}
    away = moment.xyz - moment.xyz.mean(axis=0)
    return {
        "polarization": compute_polarization(moment.forward),
        "milling": compute_milling(moment.xyz[:, :2], moment.forward),
        "speed": float(np.linalg.norm(moment.velocity, axis=1).mean()),
        "spread": float(np.sqrt((away**2).sum(1).mean())),
        "animals": len(moment),
    }


def _place(place: SceneMeshes):
    """What stands still, as numbers for the page."""
    ground = place.ground()
    faces, lit = place.obstacles()
    return {
        "width": place.width,
        "height": place.height,
        "columns": ground.points.shape[1],
        "picture": np.round(ground.box, 6).tolist(),
        "heights": np.round(ground.points[..., 2], 3).ravel().tolist() if len(ground.points) > 2 else [],
        "rows": ground.points.shape[0],
        **_faces(faces, lit),
        "goals": [{"name": g.name, "at": np.round(g.at, 3).tolist(), "radius": g.radius} for g in place.goals()],
        "guides": [_line(line) for line in place.guides()],
        "outlines": [_line(line) | {"colour": colour} for _, lines, colour in place.outlines() for line in lines],
    }


def _moving(solids, times):
    """Obstacles that do not stand where they are all the time: their faces, and where they are when.

    Those of the place as it begins are told by the number of their first face; others bring their faces.
    """
    entries, first = [], 0
    for solid in solids:
        count, began = len(solid.faces.alphas), solid.keys[0].shown
        if solid.moves:
            track = [[times[key.frame], int(key.shown), *(round(part, 4) for part in key.offset)] for key in solid.keys]
            entry = {"first": first, "count": count} if began else _faces(solid.faces, solid.lit)
            entries.append({"name": solid.name, "track": track, **entry})
        first += count if began else 0
    return entries


def _faces(faces, lit):
    """Faces as numbers for the page."""
    return {
        "faces": np.round(faces.corners, 3).ravel().tolist(),
        "face_colours": np.round(lit).astype(int).ravel().tolist(),
        "alphas": np.round(faces.alphas, 2).tolist(),
    }


def _line(line):
    return {"name": line.name, "points": np.round(line.points, 3).tolist(), "closed": line.closed}


def _mesh(look):
    """A look with its poses, one after the other, as the page's shader wants them."""
    mesh, poses = mesh_of(look), poses_of(look)
    first, count, at = {}, {}, 0
    for clip, points in poses.items():
        first[clip], count[clip], at = at, len(points), at + len(points)
    return {
        "triangles": mesh.triangles.ravel().tolist(),
        "coarse": coarse_triangles(mesh).ravel().tolist(),
        "shade": mesh.shade.tolist(),
        "points": np.round(np.concatenate(list(poses.values())), 4).ravel().tolist(),
        "vertices": len(mesh.points),
        "first": [first.get(clip, first.get("rest", 0)) for clip in CLIPS],
        "count": [count.get(clip, 1) for clip in CLIPS],
    }


def _escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
