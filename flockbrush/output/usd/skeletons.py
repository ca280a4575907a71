"""The herd in USD with a skeleton for each animal (UsdSkel): for up to some hundreds of them."""

from __future__ import annotations

from functools import cache

import numpy as np
from pxr import Gf, UsdGeom, UsdSkel, Vt

from flockbrush.engine.files import refused
from flockbrush.output.joints import offsets, pivot, posture
from flockbrush.output.usd.bodies import write_mesh
from flockbrush.output.usd.herd_prims import Xforms
from flockbrush.render.animal_looks import CLIPS, mesh_of

MOST = 1000  # animals: more need the instancer
RIGS = "/Rigs"
STEPS = 256  # of a cycle: as finely as joints are posed


class Skeletons(Xforms):
    """Each animal as a skinned prim of its own with a `SkelAnimation`."""

    def __init__(self, stage, bodies, simulation):
        super().__init__(stage, bodies, simulation)
        stage.CreateClassPrim(RIGS)

    def root(self, path):
        if len(self._animals) >= MOST:
            raise refused("--usd-mode skel", f"skeletons are limited to {MOST} animals; use --usd-mode instancer")
        return UsdSkel.Root.Define(self._stage, path)

    def body(self, path, moment, row):
        species, looks, brushes = self._names
        kind, brush = int(moment.species[row]), int(moment.brush[row])
        if species[kind] in self._bodies.given:
            super().body(path, moment, row)
            return
        rig = self._rig(looks[kind])
        inner = UsdGeom.Xform.Define(self._stage, path).GetPrim()
        inner.GetReferences().AddInternalReference(rig)
        animation = UsdSkel.Animation.Define(self._stage, _gait_of(path))
        animation.CreateJointsAttr(_joints(mesh_of(looks[kind])))
        skeleton = self._stage.OverridePrim(f"{path}/Skeleton")
        UsdSkel.BindingAPI.Apply(skeleton).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        skin = self._stage.OverridePrim(f"{path}/Body")
        self._bodies.bind(skin, brushes[brush] if brush < len(brushes) else "", brush)

    def pose(self, attributes, frame, row, moment, clip, phase):
        look = self._names[1][moment.species[row]]
        animation = UsdSkel.Animation(self._stage.GetPrimAtPath(_gait_of(attributes["body"])))
        if not animation:
            return
        places, turns, scales = _samples(look, CLIPS[clip[row]], round(float(phase[row]) * STEPS) % STEPS)
        animation.CreateTranslationsAttr().Set(places, frame)
        animation.CreateRotationsAttr().Set(turns, frame)
        animation.CreateScalesAttr().Set(scales, frame)

    def _rig(self, look):
        """Path of the mesh and skeleton of a look, to be referenced."""
        path = f"{RIGS}/{look}"
        if self._stage.GetPrimAtPath(path):
            return path
        mesh = mesh_of(look)
        UsdGeom.Xform.Define(self._stage, path)
        joints = _joints(mesh)
        places = [Gf.Matrix4d().SetTranslate(Gf.Vec3d(*pivot(mesh, k))) for k in range(-1, len(mesh.parts))]
        skeleton = UsdSkel.Skeleton.Define(self._stage, f"{path}/Skeleton")
        skeleton.CreateJointsAttr(joints)
        skeleton.CreateBindTransformsAttr(places)
        skeleton.CreateRestTransformsAttr(
            [Gf.Matrix4d().SetTranslate(Gf.Vec3d(*offset)) for offset in offsets(mesh).tolist()]
        )
        skin = write_mesh(self._stage, f"{path}/Body", mesh, mesh.points)
        binding = UsdSkel.BindingAPI.Apply(skin.GetPrim())
        binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
        indices = Vt.IntArray.FromNumpy((mesh.part + 1).astype(np.int32))
        binding.CreateJointIndicesPrimvar(False, 1).Set(indices)
        binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray(len(mesh.points), 1.0))
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
        return path


def _gait_of(path):
    """Path of the animation of a body, beside it."""
    animal, _, name = path.rpartition("/")
    return f"{animal}/{name.replace('Look', 'Gait')}"


@cache
def _samples(look, clip, step):
    """(translations, rotations, scales) of the joints of a look at a step of a cycle, as USD takes them."""
    places, turns, scales = posture(look, clip, step / STEPS)
    turns = np.ascontiguousarray(np.roll(turns, -1, axis=1), np.float32)
    return (
        Vt.Vec3fArray.FromNumpy(places.astype(np.float32)),
        Vt.QuatfArray.FromNumpy(turns),
        Vt.Vec3hArray.FromNumpy(scales.astype(np.float16)),
    )


def _joints(mesh):
    """Paths of all joints: the body, and the parts below it."""
    paths = {"": "body"}
    for part in mesh.parts:
        paths[part.name] = f"{paths[part.parent]}/{part.name}"
    return Vt.TokenArray(list(paths.values()))
