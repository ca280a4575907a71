"""The herd in USD: one PointInstancer whose instances switch poses, or one prim for each animal."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from flockbrush.output.attitude import AttitudeTurns

HERD, PROTOTYPES = "/World/Herd", "/World/Herd/Prototypes"
NOTHING = 1e-4  # scale of animals that are not there: 0 cannot be inverted, and some tools ignore visibility


class Instancer:
    """All animals as one PointInstancer; the many arrays of a frame have one entry for each."""

    def __init__(self, stage, bodies, simulation):
        self._stage, self._bodies, self._turns = stage, bodies, AttitudeTurns(simulation)
        self._herd = herd = UsdGeom.PointInstancer.Define(stage, HERD)
        Usd.ModelAPI(herd).SetKind("component")
        UsdGeom.Scope.Define(stage, PROTOTYPES)
        self._targets = herd.CreatePrototypesRel()
        self._numbers: dict[tuple, int] = {}
        self._attributes = {
            "ids": herd.CreateIdsAttr(),
            "protoIndices": herd.CreateProtoIndicesAttr(),
            "positions": herd.CreatePositionsAttr(),
            "orientations": herd.CreateOrientationsAttr(),
            "scales": herd.CreateScalesAttr(),
            "velocities": herd.CreateVelocitiesAttr(),
            "extent": herd.CreateExtentAttr(),
        }
        self._primvars = UsdGeom.PrimvarsAPI(herd)

    def _number(self, key):
        """Index of the prototype that shows this, new or known."""
        if key not in self._numbers:
            path = f"{PROTOTYPES}/body_{len(self._numbers):03d}"
            self._bodies.define(path, key)
            self._targets.AddTarget(path)
            self._numbers[key] = len(self._numbers)
        return self._numbers[key]

    def write(self, frame, moment, clip, phase):
        """Set all arrays of a frame; the bytes they take."""
        shown, which = np.unique(self._bodies.shown(moment, clip, phase), axis=0, return_inverse=True)
        numbers = np.array([self._number(tuple(key)) for key in shown.tolist()], np.int32)
        at, scales = moment.xyz.astype(np.float32), self._bodies.scales(moment).astype(np.float32)
        reach = 2 * scales.max(initial=0.0)
        corners = np.array([at.min(0) - reach, at.max(0) + reach]) if len(at) else np.zeros((2, 3), np.float32)
        turns = np.roll(self._turns.of(moment), -1, axis=1).astype(np.float16)
        values = {
            "ids": Vt.Int64Array.FromNumpy(moment.ids),
            "protoIndices": Vt.IntArray.FromNumpy(numbers[which.ravel()] if len(numbers) else numbers),
            "positions": Vt.Vec3fArray.FromNumpy(at),
            "orientations": Vt.QuathArray.FromNumpy(turns),
            "scales": Vt.Vec3fArray.FromNumpy(scales),
            "velocities": Vt.Vec3fArray.FromNumpy(moment.velocity.astype(np.float32)),
            "extent": Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)),
        }
        for name, value in values.items():
            self._attributes[name].Set(value, frame)
        for name, (kind, value) in told(moment, phase).items():
            if name not in self._attributes:
                interpolation = UsdGeom.Tokens.vertex
                self._attributes[name] = self._primvars.CreatePrimvar(name, _MANY[kind], interpolation).GetAttr()
            array = Vt.FloatArray if kind == "float" else Vt.IntArray
            self._attributes[name].Set(array.FromNumpy(value), frame)
        return (64 + 4 * len(told(moment, phase))) * len(moment)

    def finish(self):
        """Nothing is left to do."""


_MANY = {"float": Sdf.ValueTypeNames.FloatArray, "int": Sdf.ValueTypeNames.IntArray}
_ONE = {"float": Sdf.ValueTypeNames.Float, "int": Sdf.ValueTypeNames.Int}


def told(moment, phase):
    """{primvar: (kind, (n,) values)} of a moment: what instances carry besides where they are."""
    floats = {"speed": np.linalg.norm(moment.velocity, axis=1), "phase": phase}
    codes = {"brush": moment.brush, "species": moment.species, "leader": moment.leader, **moment.labels}
    found = {name: ("float", np.asarray(values, np.float32)) for name, values in floats.items()}
    return found | {name: ("int", np.asarray(values, np.int32)) for name, values in codes.items()}


class Xforms:
    """Each animal as a prim of its own, without a gait; before its birth and after its death it has no size."""

    def __init__(self, stage, bodies, simulation):
        self._stage, self._bodies, self._turns = stage, bodies, AttitudeTurns(simulation)
        UsdGeom.Xform.Define(stage, HERD)
        self._animals: dict[int, dict] = {}
        self._here: set[int] = set()

    def write(self, frame, moment, clip, phase):
        """Set every animal of a frame; the bytes that takes."""
        ids, here = moment.ids.tolist(), set(moment.ids.tolist())
        for gone in sorted(self._here - here):
            self._vanish(self._animals[gone], frame)
        at, scales, turns = moment.xyz.tolist(), self._bodies.scales(moment).tolist(), self._turns.of(moment).tolist()
        carried = told(moment, phase)
        for row, animal in enumerate(ids):
            if animal not in self._animals:
                self._animals[animal] = self._born(frame, animal, moment, row)
            attributes = self._animals[animal]
            attributes["translate"].Set(Gf.Vec3d(*at[row]), frame)
            attributes["orient"].Set(Gf.Quatf(*turns[row]), frame)
            if animal not in self._here:
                attributes["scale"].Set(Gf.Vec3f(*scales[row]), frame)
            for name, (kind, values) in carried.items():
                value = values[row].item()
                if name not in attributes:
                    maker = attributes["primvars"]
                    attributes[name] = maker.CreatePrimvar(name, _ONE[kind], UsdGeom.Tokens.constant).GetAttr()
                if attributes["last"].get(name) != value:
                    attributes["last"][name] = value
                    attributes[name].Set(value, frame)
            self.pose(attributes, frame, row, moment, clip, phase)
        self._here = here
        return 140 * len(moment)

    def pose(self, attributes, frame, row, moment, clip, phase):
        """Set the limbs of one animal: here they do not move."""

    def body(self, path, moment, row):
        """Define what an animal looks like: a standing body, shared by all that look alike."""
        looks = self._bodies.names()[1]
        clip = 0 if moment.xyz[row, 2] < moment.length[row] or looks[moment.species[row]] != "bird" else 4
        key = (int(moment.species[row]), int(moment.brush[row]), clip, 0)
        shared = f"/Prototypes/body_{'_'.join(map(str, key))}"
        if not self._stage.GetPrimAtPath(shared):
            self._stage.CreateClassPrim("/Prototypes")
            self._bodies.define(shared, key)
        inner = UsdGeom.Xform.Define(self._stage, f"{path}/Look").GetPrim()
        inner.GetReferences().AddInternalReference(shared)
        inner.SetInstanceable(True)

    def _born(self, frame, animal, moment, row):
        """The attributes of a new prim."""
        path = f"{HERD}/animal_{animal}"
        prim = self.root(path)
        found = {
            "translate": prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).GetAttr(),
            "orient": prim.AddOrientOp(UsdGeom.XformOp.PrecisionFloat).GetAttr(),
            "scale": prim.AddScaleOp(UsdGeom.XformOp.PrecisionFloat).GetAttr(),
            "visibility": prim.CreateVisibilityAttr(),
            "primvars": UsdGeom.PrimvarsAPI(prim),
            "last": {},
            "path": path,
        }
        if frame > 0:
            self._vanish(found, 0)
            found["scale"].Set(Gf.Vec3f(NOTHING), frame - 1)  # scales are interpolated: it is small until it is born
        found["visibility"].Set(UsdGeom.Tokens.inherited, frame)
        self.body(path, moment, row)
        return found

    def root(self, path):
        """The prim of a new animal."""
        return UsdGeom.Xform.Define(self._stage, path)

    def _vanish(self, attributes, frame):
        """An animal is not there any more, or not yet."""
        scale = attributes["scale"]
        if frame > 0 and (last := scale.Get(frame - 1)) is not None:
            scale.Set(last, frame - 1)
        scale.Set(Gf.Vec3f(NOTHING), frame)
        attributes["visibility"].Set(UsdGeom.Tokens.invisible, frame)

    def finish(self):
        """Nothing is left to do."""
