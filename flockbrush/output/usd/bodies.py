"""Bodies in USD: a mesh for each pose of a look, a material for each brush, a prototype where both meet."""

from __future__ import annotations

import os

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

from flockbrush.render.animal_looks import CLIPS, DARK, WIDE, mesh_of, phased, poses_of
from flockbrush.render.gaits import looks_of
from flockbrush.render.style import linear_rgb, mix, worn_rgb
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.runs.snapshots import words_of

LOOKS, MATERIALS = "/Looks", "/World/Materials"
EVERY = 2  # every so manieth pose of a cycle becomes a prototype


class UsdBodies:
    """Prototypes of animals on a USD stage.

    Parameters
    ----------
    stage : Usd.Stage
    given : dict of str to Path
        Files that replace the look of a species.
    theme : Theme
        What brushes look like.
    """

    def __init__(self, stage, simulation, given, theme):
        self.stage, self.simulation, self.given, self.theme = stage, simulation, given, theme
        self._materials: dict[tuple[str, str], str] = {}
        stage.CreateClassPrim(LOOKS)
        UsdGeom.Scope.Define(stage, MATERIALS)

    def names(self):
        """(species, looks, brushes) by index."""
        words = words_of(self.simulation)
        return words["species"], looks_of(self.simulation), words["brush"]

    def scales(self, moment):
        """(n, 3): bodies are 1 m long and `WIDE` wide; those of given files keep their proportions."""
        wide = 2 * moment.radius / WIDE
        species = self.names()[0]
        own = np.array([name in self.given for name in species], bool)
        wide = np.where(own[moment.species], moment.length, wide) if len(moment) and own.any() else wide
        return np.column_stack([moment.length, wide, moment.length])

    def shown(self, moment, clip, phase):
        """(n, 4) int: species, brush, clip, pose of each animal, for `prototype`."""
        species, looks, _ = self.names()
        pose = np.zeros(len(moment), int)
        clip = clip.copy()
        for k, (name, look) in enumerate(zip(species, looks, strict=True)):
            mine = moment.species == k
            if name in self.given:
                clip[mine] = 0
                continue
            for c in np.unique(clip[mine]):
                rows = mine & (clip == c)
                pose[rows] = phased(look, CLIPS[c], phase[rows]) // EVERY * EVERY
        return np.column_stack([moment.species, moment.brush, clip, pose])

    def define(self, path, key):
        """Define a prototype at a path: a body in one pose with the material of a brush."""
        species, looks, brushes = self.names()
        kind, brush, clip, pose = (int(part) for part in key)
        prim = UsdGeom.Xform.Define(self.stage, path).GetPrim()
        if species[kind] in self.given:
            self._given(path, self.given[species[kind]])
            return
        body = self.stage.DefinePrim(f"{path}/Body")
        body.GetReferences().AddInternalReference(self.pose(looks[kind], CLIPS[clip], pose))
        self.bind(body, brushes[brush] if brush < len(brushes) else "", brush)
        prim.SetMetadata("comment", f"{species[kind]}, {CLIPS[clip]} {pose}")

    def pose(self, look, clip, pose):
        """Path of the mesh of a look in one pose."""
        path = f"{LOOKS}/{look}_{clip}_{pose:02d}"
        if not self.stage.GetPrimAtPath(path):
            write_mesh(self.stage, path, mesh_of(look), poses_of(look)[clip][pose])
        return path

    def bind(self, prim, name, brush):
        """Give a mesh the material of a brush, and its dark and light parts shades of it."""
        for part in ("", "dark", "light"):
            inner = prim.GetPath().AppendChild(part) if part else prim.GetPath()
            if not self.stage.GetPrimAtPath(inner):
                continue
            if (name, part) not in self._materials:
                self._materials[name, part] = self._material(name, brush, part)
            material = UsdShade.Material.Get(self.stage, self._materials[name, part])
            UsdShade.MaterialBindingAPI.Apply(self.stage.OverridePrim(inner)).Bind(material)

    def _material(self, name, brush, part):
        """A material of the colour of a brush: its own, for hooves and wing tips (dark) or for heads (light)."""
        known = catalogue_of(self.simulation.world).palette.brushes
        colour = worn_rgb(brush, tuple(each.colour for each in known), self.theme)
        shades = {"dark": mix((0, 0, 0), colour, DARK), "light": mix(colour, (255, 255, 255), 0.4)}
        word = f"brush_{name}_{part}" if part else f"brush_{name}"
        return write_material(self.stage, f"{MATERIALS}/{Tf.MakeValidIdentifier(word)}", shades.get(part, colour))

    def _given(self, path, file):
        """A reference to a file, turned and scaled so that it looks along +X, z up, and is 1 m long."""
        theirs = Usd.Stage.Open(str(file))
        root = theirs.GetDefaultPrim()
        long = bounds_of(root).GetSize()[0]
        body = UsdGeom.Xform.Define(self.stage, f"{path}/Body")
        if long > 0:
            body.AddScaleOp().Set(Gf.Vec3f(1.0 / long))
        if UsdGeom.GetStageUpAxis(theirs) == UsdGeom.Tokens.y:
            body.AddRotateXOp().Set(90.0)
        inner = self.stage.DefinePrim(f"{path}/Body/Given")
        inner.GetReferences().AddReference(os.path.abspath(file))


def bounds_of(prim):
    """The box around all that a prim shows, in its own unit."""
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    return cache.ComputeWorldBound(prim).ComputeAlignedRange()


def plain_mesh(stage, path, points, triangles, counts=None):
    """A mesh with flat faces: triangles, or with so many corners each."""
    made = UsdGeom.Mesh.Define(stage, path)
    points = np.ascontiguousarray(points, np.float32)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    counts = np.full(len(triangles), 3) if counts is None else counts
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.asarray(counts, np.int32)))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(triangles, np.int32).ravel()))
    made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    made.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([points.min(0), points.max(0)], np.float32)))
    return made


def write_mesh(stage, path, mesh, points):
    """A `plain_mesh` of a body, with the brightness of its parts as a primvar."""
    made = plain_mesh(stage, path, points, mesh.triangles)
    shade = mesh.shade[mesh.triangles[:, 0]].astype(np.float32)
    grey = np.repeat(shade[:, None], 3, axis=1)
    made.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform).Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(grey)))
    for name, faces in (("dark", shade < 0.8), ("light", shade > 1.1)):
        if faces.any():
            rows = Vt.IntArray.FromNumpy(np.flatnonzero(faces).astype(np.int32))
            UsdGeom.Subset.CreateGeomSubset(made, name, UsdGeom.Tokens.face, rows, UsdShade.Tokens.materialBind)
    UsdGeom.Subset.SetFamilyType(made, UsdShade.Tokens.materialBind, UsdGeom.Tokens.nonOverlapping)
    return made


def write_material(stage, path, colour, roughness=0.8):
    """Path of a new plain material of a colour, 0 to 255."""
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*linear_rgb(colour).tolist()))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return path
