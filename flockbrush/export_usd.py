"""USD scenes: a point instancer that every renderer reads, or one prim for each animal where instancers are unknown.

Our axes (x east, y north, z up) become USD's (x, z, -y): y up, metres.  A prototype looks along +X and is one metre
long; scales make it as long as the animal.  Samples are handed to the file as the run goes on.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

from flockbrush.export import Exporter, metadata_of
from flockbrush.moments import Moment, names_of

STRIDE = 1.0  # body lengths of the way in one cycle of the gait; by eye, clips are fitted to it
PENDING = 64 << 20  # bytes of samples in memory before they are handed to the file
ROOT, HERD, PROTOTYPES = "/World", "/World/Herd", "/World/Herd/Prototypes"
CLASSES = "/Prototypes"  # abstract: they are drawn only where referenced


def y_up(vectors):
    """(n, 3) from x east, y north, z up to USD's axes: (x, z, -y)."""
    x, y, z = np.asarray(vectors, float).T
    return np.column_stack([x, z, -y])


def orientations(forward):
    """Unit quaternions (n, 4), w first, that turn +X to these directions (ours), without bank.

    First up or down about z, then about y: an animal's feet stay below it.
    """
    forward = np.asarray(forward, float)
    yaw = np.arctan2(forward[:, 1], forward[:, 0]) / 2
    pitch = np.arcsin(np.clip(forward[:, 2], -1, 1)) / 2
    a, b, c, d = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    return np.column_stack([a * c, b * d, b * c, a * d])  # (a + b j)(c + d k); j k = i


class UsdScene(Exporter):
    """A USD scene of a run; option ``usd_mode``: instancer or xforms."""

    def open(self):
        self.temporary.unlink()  # Sdf makes the file itself
        self._layer = Sdf.Layer.CreateNew(str(self.temporary))
        self._stage = stage = Usd.Stage.Open(self._layer)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(self.fps)
        stage.SetFramesPerSecond(self.fps)
        world = UsdGeom.Xform.Define(stage, ROOT)
        stage.SetDefaultPrim(world.GetPrim())
        Usd.ModelAPI(world).SetKind("assembly")
        about = {key: _plain(value) for key, value in metadata_of(self.simulation, self.fps).items()}
        self._layer.customLayerData = {"flockbrush": about}
        self._prototypes: list[str] = []
        self._phase = np.zeros(0)
        self._ids = np.zeros(0, np.int64)
        self._last = np.zeros((0, 4))
        self._time = 0.0
        self._pending = 0
        xforms = self.options.get("usd_mode") == "xforms"
        self._writer = _Xforms(stage) if xforms else _Instancer(stage)

    def take(self, moment: Moment):
        species, brushes = names_of(self.simulation)
        self._know(species)
        speed = np.linalg.norm(moment.velocity, axis=1)
        quaternions, phase = self._continued(moment, speed)
        self._pending += self._writer.write(self.frames, moment, quaternions, speed, phase, brushes)
        self.frames += 1
        if self._pending > PENDING:
            self._layer.Save()
            self._pending = 0

    def _know(self, species):
        """A prototype for each species."""
        for name in species[len(self._prototypes) :]:
            self._writer.prototype(name, len(self._prototypes))
            self._prototypes.append(name)

    def _continued(self, moment, speed):
        """(quaternions, phases) that go on from the last moment: the same hemisphere, the gait without a jump."""
        now = orientations(moment.forward)
        phase = np.zeros(len(moment))
        _, old, new = np.intersect1d(self._ids, moment.ids, assume_unique=True, return_indices=True)
        now[new[(now[new] * self._last[old]).sum(1) < 0]] *= -1
        way = speed[new] * (moment.time - self._time) / (STRIDE * moment.length[new])
        phase[new] = (self._phase[old] + way) % 1
        self._ids, self._last, self._phase, self._time = moment.ids, now, phase, moment.time
        return now, phase

    def finish(self):
        self._stage.SetStartTimeCode(0)
        self._stage.SetEndTimeCode(max(0, self.frames - 1))
        self._writer.finish(names_of(self.simulation)[1])
        self._layer.Save()
        self.let_go()

    def let_go(self):
        self._writer = self._stage = self._layer = None


class _Instancer:
    """All animals as one PointInstancer; the many arrays of a frame have one entry for each."""

    def __init__(self, stage):
        self._stage = stage
        self._herd = UsdGeom.PointInstancer.Define(stage, HERD)
        Usd.ModelAPI(self._herd).SetKind("component")
        UsdGeom.Scope.Define(stage, PROTOTYPES)
        herd = self._herd
        self._attributes = {
            "ids": herd.CreateIdsAttr(),
            "protoIndices": herd.CreateProtoIndicesAttr(),
            "positions": herd.CreatePositionsAttr(),
            "orientations": herd.CreateOrientationsAttr(),
            "scales": herd.CreateScalesAttr(),
            "velocities": herd.CreateVelocitiesAttr(),
            "extent": herd.CreateExtentAttr(),
        }
        primvars, kinds = UsdGeom.PrimvarsAPI(herd), Sdf.ValueTypeNames
        for name, kind in (("speed", kinds.FloatArray), ("phase", kinds.FloatArray), ("brush", kinds.IntArray)):
            self._attributes[name] = primvars.CreatePrimvar(name, kind, UsdGeom.Tokens.vertex).GetAttr()

    def prototype(self, species, number):
        path = _prototype(self._stage, PROTOTYPES, species, number)
        self._herd.CreatePrototypesRel().AddTarget(path)

    def write(self, frame, moment, quaternions, speed, phase, brushes):
        """Set all arrays of a frame; the bytes they take."""
        at = y_up(moment.xyz).astype(np.float32)
        scales = _scales(moment).astype(np.float32)
        reach = scales.max(initial=0.0)
        corners = np.array([at.min(0) - reach, at.max(0) + reach]) if len(at) else np.zeros((2, 3), np.float32)
        values = {
            "ids": Vt.Int64Array.FromNumpy(moment.ids),
            "protoIndices": Vt.IntArray.FromNumpy(moment.species.astype(np.int32)),
            "positions": Vt.Vec3fArray.FromNumpy(at),
            "orientations": Vt.QuathArray.FromNumpy(np.roll(quaternions, -1, axis=1).astype(np.float16)),
            "scales": Vt.Vec3fArray.FromNumpy(scales),
            "velocities": Vt.Vec3fArray.FromNumpy(y_up(moment.velocity).astype(np.float32)),
            "extent": Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)),
            "speed": Vt.FloatArray.FromNumpy(speed.astype(np.float32)),
            "phase": Vt.FloatArray.FromNumpy(phase.astype(np.float32)),
            "brush": Vt.IntArray.FromNumpy(moment.brush.astype(np.int32)),
        }
        for name, value in values.items():
            self._attributes[name].Set(value, frame)
        return 76 * len(moment)

    def finish(self, brushes):
        self._herd.GetPrim().SetCustomDataByKey("brushes", Vt.StringArray(brushes))


class _Xforms:
    """Each animal as a prim of its own, hidden before its birth and after its death."""

    def __init__(self, stage):
        self._stage = stage
        UsdGeom.Xform.Define(stage, HERD)
        stage.CreateClassPrim(CLASSES)
        self._paths: list[str] = []
        self._living: dict[int, dict] = {}

    def prototype(self, species, number):
        self._paths.append(_prototype(self._stage, CLASSES, species, number))

    def write(self, frame, moment, quaternions, speed, phase, brushes):
        """Set every animal of a frame; the bytes that takes."""
        ids = moment.ids.tolist()
        here = set(ids)
        for gone in [animal for animal in self._living if animal not in here]:
            self._living.pop(gone)["visibility"].Set(UsdGeom.Tokens.invisible, frame)
        at, scales = y_up(moment.xyz).tolist(), _scales(moment).tolist()
        for row, animal in enumerate(ids):
            if animal not in self._living:
                self._living[animal] = self._born(frame, animal, int(moment.species[row]), scales[row])
            attributes = self._living[animal]
            attributes["translate"].Set(Gf.Vec3d(*at[row]), frame)
            attributes["orient"].Set(Gf.Quatf(*quaternions[row].tolist()), frame)
            attributes["speed"].Set(float(speed[row]), frame)
            attributes["phase"].Set(float(phase[row]), frame)
            attributes["brush"].Set(brushes[moment.brush[row]], frame)
        return 120 * len(moment)

    def _born(self, frame, animal, species, scale):
        """The attributes of a new prim."""
        prim = UsdGeom.Xform.Define(self._stage, f"{HERD}/animal_{animal}")
        prim.GetPrim().GetReferences().AddInternalReference(self._paths[species])
        prim.GetPrim().SetInstanceable(True)
        found = {
            "translate": prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).GetAttr(),
            "orient": prim.AddOrientOp(UsdGeom.XformOp.PrecisionFloat).GetAttr(),
            "visibility": prim.CreateVisibilityAttr(),
        }
        prim.AddScaleOp(UsdGeom.XformOp.PrecisionFloat).Set(Gf.Vec3f(*scale))
        primvars, kinds = UsdGeom.PrimvarsAPI(prim), Sdf.ValueTypeNames
        for name, kind in (("speed", kinds.Float), ("phase", kinds.Float), ("brush", kinds.String)):
            found[name] = primvars.CreatePrimvar(name, kind, UsdGeom.Tokens.constant).GetAttr()
        if frame > 0:
            found["visibility"].Set(UsdGeom.Tokens.invisible, 0)
        found["visibility"].Set(UsdGeom.Tokens.inherited, frame)
        return found

    def finish(self, brushes):
        pass


def _plain(value):
    """A value that a layer's metadata can hold."""
    return str(value) if isinstance(value, int) and abs(value) >= 2**31 else value


def _scales(moment):
    """(n, 3): the prototype is 1 m long and 0.4 m wide."""
    wide = moment.radius / 0.2
    return np.column_stack([moment.length, wide, wide])


def _prototype(stage, parent, species, number):
    """Path of a new prototype: a body of 1 m that looks along +X, with a head to see which way."""
    path = f"{parent}/{Tf.MakeValidIdentifier(species)}_{number}"
    UsdGeom.Xform.Define(stage, path)
    body = UsdGeom.Capsule.Define(stage, f"{path}/Body")
    body.CreateAxisAttr(UsdGeom.Tokens.x)
    body.CreateHeightAttr(0.6)
    body.CreateRadiusAttr(0.2)
    body.CreateExtentAttr([(-0.5, -0.2, -0.2), (0.5, 0.2, 0.2)])
    body.AddTranslateOp().Set(Gf.Vec3d(0, 0.2, 0))
    head = UsdGeom.Sphere.Define(stage, f"{path}/Head")
    head.CreateRadiusAttr(0.12)
    head.CreateExtentAttr([(-0.12, -0.12, -0.12), (0.12, 0.12, 0.12)])
    head.AddTranslateOp().Set(Gf.Vec3d(0.38, 0.38, 0))
    for shape, shade in ((body, 0.8), (head, 0.25)):
        tint = Gf.Vec3f(shade, shade * (1.0 - 0.12 * (number % 4)), shade * (1.0 - 0.2 * (number % 3)))
        shape.CreateDisplayColorAttr([tint])
    return path
