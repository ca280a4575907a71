"""Obstacles that are moved, added or removed during a run: their places in each frame."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flockbrush.engine.seam import with_images, wrap_of
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.render.solid_meshes import Faces

SAME = 1e-6  # m; what moves by less stands


class SolidKey(NamedTuple):
    """A keyframe of an obstacle; motion between two keys is linear."""

    frame: int
    shown: bool
    offset: tuple[float, float, float]  # (x, y, z); from where it was first, m


class MovingSolid:
    """An obstacle, or its copy at another border, with its faces, as it was when it was first there."""

    def __init__(self, thing, copy, name, faces, lit, first):
        # lit: (m, 3); colours of the faces in the sun, 0 to 255
        self.thing, self.name, self.faces, self.lit = thing, name, faces, lit
        self.keys = [SolidKey(0, first == 0, (0.0, 0.0, 0.0))]  # of Key; one for an obstacle that never moves
        self.outline = _outline(copy)
        if first > 0:
            self.keys += [SolidKey(first - 1, False, (0.0, 0.0, 0.0))] * (first > 1)
            self.keys.append(SolidKey(first, True, (0.0, 0.0, 0.0)))

    @property
    def moves(self) -> bool:
        """Whether anything ever changes."""
        return len(self.keys) > 1


class MovingSolids:
    """All obstacles of a run, followed frame by frame.

    Parameters
    ----------
    place : SceneMeshes
        Of the simulation that goes on.
    """

    def __init__(self, place: SceneMeshes):
        self.place, self.frame = place, 0
        self.solids: list[MovingSolid] = []
        self.tall = place.wall()
        self._known: dict[tuple, MovingSolid] = {}
        for key, (thing, copy) in self._here().items():
            self._add(key, thing, copy)

    def _here(self):
        """{(id of an obstacle, way): (it, it or its copy at another border)} of what is on the map now."""
        things, wrap = self.place.scenery.obstacles, wrap_of(self.place.level)
        return {(id(one), way): (one, copy) for one in things for copy, way in with_images([one], wrap)}

    def take(self) -> list[tuple[MovingSolid, list[SolidKey]]]:
        """Look at them for the next frame; what is new: (obstacle, its new keys)."""
        here, news = self._here(), []
        for key, (thing, copy) in here.items():
            if key not in self._known:
                solid = self._add(key, thing, copy)
                if solid.moves:
                    news.append((solid, list(solid.keys)))
        for key, solid in self._known.items():
            count = len(solid.keys)
            self._follow(solid, here.get(key, (None, None))[1])
            if len(solid.keys) > count:
                news.append((solid, solid.keys[count:]))
        self.frame += 1
        return news

    def _add(self, key, thing, copy):
        faces, lit = self.place.faces_of_thing(copy, self.tall)
        name = getattr(thing, "name", "") or f"obstacle_{len(self.solids)}"
        solid = MovingSolid(thing, copy, name, faces, lit, self.frame)
        self._known[key] = solid
        self.solids.append(solid)
        return solid

    def _follow(self, solid, copy):
        """Note a key where a solid has another place; None: it is not on the map."""
        last, offset, shown = solid.keys[-1], solid.keys[-1].offset, copy is not None
        if shown and _outline(copy) != solid.outline:
            solid.outline = _outline(copy)
            faces: Faces = self.place.faces_of_thing(copy, self.tall)[0]
            x, y, z = (faces.corners.mean(axis=(0, 1)) - solid.faces.corners.mean(axis=(0, 1))).tolist()
            offset = (x, y, z)
        if shown == last.shown and np.allclose(offset, last.offset, atol=SAME):
            return
        if last.frame < self.frame - 1:
            solid.keys.append(SolidKey(self.frame - 1, last.shown, last.offset))  # until then it stood
        solid.keys.append(SolidKey(self.frame, shown, offset))


def _outline(thing) -> Any:
    """What changes when a thing is moved."""
    return thing.polygon.tobytes(), float(thing.z_min), float(thing.z_max)
