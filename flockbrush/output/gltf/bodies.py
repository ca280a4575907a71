"""Bodies in glTF: flat-shaded meshes of parts and poses, and the colours of brushes."""

from __future__ import annotations

import numpy as np

from flockbrush.output.gltf.document import VERTICES
from flockbrush.render.animal_looks import CLIPS, LIGHT, WIDE, mesh_of, phased, poses_of
from flockbrush.render.gaits import looks_of
from flockbrush.render.style import linear_rgb, worn_rgb
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.runs.snapshots import words_of

EVERY = 2  # every so manieth pose of a cycle becomes a mesh


class GltfBodies:
    """Meshes of looks in a document, each written once.

    Parameters
    ----------
    theme : Theme
        What brushes look like.
    """

    def __init__(self, document, simulation, theme):
        self.document, self.simulation, self.theme = document, simulation, theme
        self.poses: dict[tuple[str, str, int], int] = {}  # number of each pose that was shown
        self._parts: dict[tuple, dict] = {}
        self._materials: dict[int, int] = {}
        self._white: int | None = None

    def looks(self) -> list[str]:
        """The look of each species."""
        return looks_of(self.simulation)

    def colour(self, brush) -> tuple[int, int, int]:
        """Red, green, blue of a brush, 0 to 255, sRGB."""
        known = catalogue_of(self.simulation.world).palette.brushes
        return worn_rgb(brush, tuple(each.colour for each in known), self.theme)

    def brush_name(self, brush) -> str:
        """The name of a brush."""
        names = words_of(self.simulation)["brush"]
        return names[brush] if brush < len(names) else f"brush {brush}"

    def shown(self, moment, clip, phase):
        """(n,) int: which pose shows each animal of a moment; `poses` has what the numbers mean."""
        numbers, looks = np.zeros(len(moment), int), self.looks()
        for k, look in enumerate(looks):
            mine = moment.species == k
            for c in np.unique(clip[mine]):
                rows = mine & (clip == c)
                pose = phased(look, CLIPS[c], phase[rows]) // EVERY * EVERY
                for p in np.unique(pose):
                    number = self.poses.setdefault((look, CLIPS[c], int(p)), len(self.poses))
                    numbers[np.flatnonzero(rows)[pose == p]] = number
        return numbers

    def pose_mesh(self, look, clip, pose) -> int:
        """Index of the mesh of a look in one pose; its colours are brightness, to be multiplied by a brush's."""
        mesh = mesh_of(look)
        if self._white is None:
            self._white = self.material("herd", (255, 255, 255))
        primitive = {**self.flat(poses_of(look)[clip][pose], mesh.triangles, mesh.shade), "material": self._white}
        return self.document.add("meshes", name=f"{look}_{clip}_{pose:02d}", primitives=[primitive])

    def part_mesh(self, look, part, brush) -> int | None:
        """Index of the mesh of a part of a look (-1: the body) about its own pivot, in a brush's colour."""
        mesh = mesh_of(look)
        faces = mesh.triangles[(mesh.part[mesh.triangles] == part).all(axis=1)]
        if not len(faces):
            return None
        if (look, part) not in self._parts:
            pivot = mesh.parts[part].pivot if part >= 0 else (0.0, 0.0, 0.0)
            self._parts[look, part] = self.flat(mesh.points - pivot, faces, mesh.shade)
        if (look, part, brush) not in self._parts:
            if brush not in self._materials:
                share = np.minimum(linear_rgb(self.colour(brush)) * LIGHT, 1.0)
                self._materials[brush] = self.material(f"brush {self.brush_name(brush)}", share, linear=True)
            primitive = {**self._parts[look, part], "material": self._materials[brush]}
            name = f"{look} {mesh.parts[part].name if part >= 0 else 'body'} {self.brush_name(brush)}"
            self._parts[look, part, brush] = {"mesh": self.document.add("meshes", name=name, primitives=[primitive])}
        return self._parts[look, part, brush]["mesh"]

    def flat(self, points, triangles, shade) -> dict:
        """A primitive with flat faces; COLOR_0 is brightness over that of light parts."""
        corners = np.asarray(points, np.float32)[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.where(size > 1e-12, normals / np.maximum(size, 1e-12), (0.0, 0.0, 1.0))
        bright = np.round(shade[triangles].reshape(-1, 1) / LIGHT * 255).astype(np.uint8)
        colours = np.hstack([np.repeat(bright, 3, axis=1), np.full_like(bright, 255)])
        number = self.document.numbers
        attributes = {
            "POSITION": number(corners.reshape(-1, 3), VERTICES, bounds=True),
            "NORMAL": number(np.repeat(normals, 3, axis=0).astype(np.float32), VERTICES),
            "COLOR_0": number(colours, VERTICES, normalized=True),
        }
        return {"attributes": attributes}

    def material(self, name, colour, linear=False, **more) -> int:
        """Index of a new plain material of a colour: 0 to 255 in sRGB, or 0 to 1 in linear light."""
        share = colour if linear else linear_rgb(colour)
        about = {"baseColorFactor": [*np.round(share, 5).tolist(), 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.85}
        return self.document.add("materials", name=name, pbrMetallicRoughness=about, **more)


def scale_of(body) -> list[float]:
    """The scale that makes a mesh, 1 m long and `WIDE` m wide, as long and wide as a body."""
    return [body.length, body.width / WIDE, body.length]
