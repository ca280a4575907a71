"""The herd in USD: one PointInstancer whose instances switch poses, or one prim for each animal."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from flockbrush.output.attitude import AttitudeTurns, land_of

HERD, PROTOTYPES = "/World/Herd", "/World/Herd/Prototypes"
NOTHING = 1e-4  # scale of animals that are not there: 0 cannot be inverted, and some tools ignore visibility
AT_ONCE = 1 / 64  # frames between two samples of what jumps


class Seam:
    """Who goes over the seam of a periodic map: an animal leaves the map, and is on its other side at once."""

    def __init__(self, simulation):
        land = land_of(simulation)
        self._wrap = None if land is None else land.wrap
        self._ids, self._at = np.zeros(0, np.int64), np.zeros((0, 3))

    def crossed(self, moment):
        """(ids, places (n, 3), over (n,) bool) of the animals of the frame before, as they are just before this frame.

        Those that go `over` the seam are outside the map.
        """
        ids, at, places = self._ids, self._at, self._at.copy()
        self._ids, self._at = moment.ids, moment.xyz
        over = np.zeros(len(ids), bool)
        if self._wrap is not None:
            _, old, new = np.intersect1d(ids, moment.ids, assume_unique=True, return_indices=True)
            places[old] = moment.xyz[new]
            step = np.round((places[:, :2] - at[:, :2]) / self._wrap) * self._wrap
            places[:, :2] -= step
            over = step.any(axis=1)
        return ids, places, over


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
        self._last: dict[str, np.ndarray] = {}
        self._seam, self._velocities = Seam(simulation), np.zeros((0, 3))

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
        scales = self._bodies.scales(moment).astype(np.float32)
        _, places, over = self._seam.crossed(moment)
        if over.any():
            self._place(frame - AT_ONCE, places, self._velocities, scales)
        self._velocities = moment.velocity
        self._place(frame, moment.xyz, moment.velocity, scales)
        turns = np.roll(self._turns.of(moment), -1, axis=1).astype(np.float16)
        values = {
            "ids": Vt.Int64Array.FromNumpy(moment.ids),
            "protoIndices": Vt.IntArray.FromNumpy(numbers[which.ravel()] if len(numbers) else numbers),
            "orientations": Vt.QuathArray.FromNumpy(turns),
            "scales": Vt.Vec3fArray.FromNumpy(scales),
        }
        for name, value in values.items():
            self._attributes[name].Set(value, frame)
        for name, (kind, value) in primvars_of(moment, phase).items():
            if name not in self._attributes:
                interpolation = UsdGeom.Tokens.vertex
                self._attributes[name] = self._primvars.CreatePrimvar(name, _MANY[kind], interpolation).GetAttr()
            if kind == "int" and np.array_equal(value, self._last.get(name)):
                continue  # whole numbers hold until the next sample
            self._last[name] = value
            array = Vt.FloatArray if kind == "float" else Vt.IntArray
            self._attributes[name].Set(array.FromNumpy(value), frame)
        return (64 + 4 * len(primvars_of(moment, phase))) * len(moment)

    def _place(self, time, places, velocities, scales):
        """Set where the animals are at a time, in frames, and how they go on from there."""
        reach = 2 * scales.max(initial=0.0)
        corners = [places.min(0) - reach, places.max(0) + reach] if len(places) else np.zeros((2, 3))
        for name, values in (("positions", places), ("velocities", velocities), ("extent", np.array(corners))):
            self._attributes[name].Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)), time)

    def finish(self):
        """Nothing is left to do."""


_MANY = {"float": Sdf.ValueTypeNames.FloatArray, "int": Sdf.ValueTypeNames.IntArray}
_ONE = {"float": Sdf.ValueTypeNames.Float, "int": Sdf.ValueTypeNames.Int}


def primvars_of(moment, phase):
    """{primvar: (kind, (n,) values)} of a moment: what instances carry besides where they are."""
    floats = {"speed": np.linalg.norm(moment.velocity, axis=1), "phase": phase}
    codes = {"brush": moment.brush, "species": moment.species, "leader": moment.leader, **moment.labels}
    primvars = {name: ("float", np.asarray(values, np.float32)) for name, values in floats.items()}
    return primvars | {name: ("int", np.asarray(values, np.int32)) for name, values in codes.items()}


class Shown:
    """A prim that is there or not, at a size: an animal, or the body of one of its looks.

    Where it is not there it is invisible and has almost no size.
    """

    def __init__(self, prim):
        self._scale = prim.AddScaleOp(UsdGeom.XformOp.PrecisionFloat).GetAttr()
        self._visibility = prim.CreateVisibilityAttr()
        self._size = None

    def show(self, frame, size):
        """From this frame on it is there at a size (3,), at once: values are interpolated between samples."""
        size = Gf.Vec3f(*size)
        if size == self._size:
            return
        if frame > 0:
            if not self._visibility.HasAuthoredValue():
                self._visibility.Set(UsdGeom.Tokens.invisible, 0)
            self._scale.Set(self._size or Gf.Vec3f(NOTHING), frame - 1)
        if self._size is None:
            self._visibility.Set(UsdGeom.Tokens.inherited, frame)
        self._scale.Set(size, frame)
        self._size = size

    def hide(self, frame):
        """From this frame on it is not there."""
        self._scale.Set(self._size, frame - 1)
        self._scale.Set(Gf.Vec3f(NOTHING), frame)
        self._visibility.Set(UsdGeom.Tokens.invisible, frame)
        self._size = None


class Xforms:
    """Each animal as a prim of its own, without a gait; before its birth and after its death it has no size.

    It has a body for each species and brush that it has had, of which one is shown.
    """

    def __init__(self, stage, bodies, simulation):
        self._stage, self._bodies, self._turns = stage, bodies, AttitudeTurns(simulation)
        UsdGeom.Xform.Define(stage, HERD)
        self._animals: dict[int, dict] = {}
        self._here: set[int] = set()
        self._seam = Seam(simulation)

    def write(self, frame, moment, clip, phase):
        """Set every animal of a frame; the bytes that takes."""
        ids, here = moment.ids.tolist(), set(moment.ids.tolist())
        for vanished in sorted(self._here - here):
            self._animals[vanished]["shown"].hide(frame)
        before, places, over = self._seam.crossed(moment)
        for animal, place in zip(before[over].tolist(), places[over].tolist(), strict=True):
            self._animals[animal]["translate"].Set(Gf.Vec3d(*place), frame - AT_ONCE)
        self._names = self._bodies.names()
        at, scales, turns = moment.xyz.tolist(), self._bodies.scales(moment).tolist(), self._turns.of(moment).tolist()
        carried = primvars_of(moment, phase)
        for row, animal in enumerate(ids):
            if animal not in self._animals:
                self._animals[animal] = self._born(animal)
            attributes = self._animals[animal]
            attributes["translate"].Set(Gf.Vec3d(*at[row]), frame)
            attributes["orient"].Set(Gf.Quatf(*turns[row]), frame)
            attributes["shown"].show(frame, scales[row])
            self._dress(attributes, frame, moment, row)
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

    def _dress(self, attributes, frame, moment, row):
        """Show the body of the species and brush that an animal has now."""
        species, bodies = int(moment.species[row]), attributes["bodies"]
        plain = self._names[0][species] in self._bodies.given  # the same with every brush
        key = species, 0 if plain else int(moment.brush[row])
        if key == attributes["worn"]:
            return
        if key not in bodies:
            path = f"{attributes['path']}/Look{f'_{len(bodies)}' if bodies else ''}"
            self.body(path, moment, row)
            bodies[key] = path, Shown(UsdGeom.Xform.Get(self._stage, path))
        if attributes["worn"] is not None:
            bodies[attributes["worn"]][1].hide(frame)
        attributes["body"], shown = bodies[key]
        shown.show(frame, (1.0, 1.0, 1.0))
        attributes["worn"] = key

    def body(self, path, moment, row):
        """Define what an animal looks like: a standing body, shared by all that look alike."""
        looks = self._names[1]
        clip = 0 if moment.xyz[row, 2] < moment.length[row] or looks[moment.species[row]] != "bird" else 4
        key = (int(moment.species[row]), int(moment.brush[row]), clip, 0)
        shared = f"/Prototypes/body_{'_'.join(map(str, key))}"
        if not self._stage.GetPrimAtPath(shared):
            self._stage.CreateClassPrim("/Prototypes")
            self._bodies.define(shared, key)
        inner = UsdGeom.Xform.Define(self._stage, path).GetPrim()
        inner.GetReferences().AddInternalReference(shared)
        inner.SetInstanceable(True)

    def _born(self, animal):
        """The attributes of a new prim."""
        path = f"{HERD}/animal_{animal}"
        prim = self.root(path)
        return {
            "translate": prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).GetAttr(),
            "orient": prim.AddOrientOp(UsdGeom.XformOp.PrecisionFloat).GetAttr(),
            "shown": Shown(prim),
            "primvars": UsdGeom.PrimvarsAPI(prim),
            "last": {},
            "path": path,
            "bodies": {},
            "worn": None,
        }

    def root(self, path):
        """The prim of a new animal."""
        return UsdGeom.Xform.Define(self._stage, path)

    def finish(self):
        """Nothing is left to do."""
