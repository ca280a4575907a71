"""The place in USD: ground with its picture, obstacles, guides, goals, areas, a camera and light."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Tf, UsdGeom, UsdLux, UsdShade, Vt

from flockbrush.levels.build import Simulation
from flockbrush.output.moving_solids import MovingSolids
from flockbrush.output.picture_exporter import chosen_theme
from flockbrush.output.scene_meshes import PICTURE, SceneMeshes
from flockbrush.output.usd.bodies import MATERIALS, plain_mesh, write_material
from flockbrush.output.usd.herd_prims import NOTHING
from flockbrush.render.style import SUN

PLACE, CAMERA = "/World/Place", "/World/Camera"
APERTURE = 24.0  # mm, height of the camera's film
THIN = 0.12  # m, width of curves


def write_place(stage, simulation, options, texture=None):
    """Write the place; returns the `Obstacles` to update, or None for flights without a place."""
    if not isinstance(simulation, Simulation):
        return None
    place = SceneMeshes(simulation, chosen_theme(options))
    UsdGeom.Xform.Define(stage, PLACE)
    _ground(stage, place, texture)
    obstacles = Obstacles(stage, place)
    for kind, lines, colour in [("Guides", place.guides(), place.theme.guide), *place.outlines()]:
        if lines:
            _curves(stage, kind.title().replace(" ", ""), lines, colour)
    _goals(stage, place)
    _camera(stage, place, options)
    _light(stage)
    return obstacles


def _bind(prim, path):
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material.Get(prim.GetStage(), path))


def _ground(stage, place, texture):
    ground = place.ground()
    made = plain_mesh(stage, f"{PLACE}/Ground", ground.points.reshape(-1, 3), ground.triangles)
    colour = np.array(place.theme.ground) / 255
    made.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([Gf.Vec3f(*colour.tolist())])
    coordinates = UsdGeom.PrimvarsAPI(made).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    coordinates.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(ground.uv, np.float32)))
    path = write_material(stage, f"{MATERIALS}/ground", place.theme.ground, 1.0)
    if texture:
        reader = UsdShade.Shader.Define(stage, f"{path}/Coordinates")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        picture = UsdShade.Shader.Define(stage, f"{path}/Picture")
        picture.CreateIdAttr("UsdUVTexture")
        picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{texture}")
        picture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        picture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        surface = UsdShade.Shader.Get(stage, f"{path}/Surface")
        surface.GetInput("diffuseColor").ConnectToSource(picture.ConnectableAPI(), "rgb")
    _bind(made.GetPrim(), path)


def sample_ground(stage, texture, frame):
    """Set a new picture of the ground from a frame on."""
    file = UsdShade.Shader.Get(stage, f"{MATERIALS}/ground/Picture").GetInput("file").GetAttr()
    if not file.GetNumTimeSamples():
        file.Set(file.Get(), 0)
    file.Set(Sdf.AssetPath(f"./{texture}"), frame)


class Obstacles:
    """Obstacles on a stage, a mesh each; those that are moved have samples of where they are."""

    def __init__(self, stage, place):
        self.stage, self.place, self.moving = stage, place, MovingSolids(place)
        self._paths: dict[int, str] = {}
        for solid in self.moving.solids:
            self._define(solid)

    def take(self):
        """Write what has changed in the next frame; the bytes that takes."""
        news = self.moving.take()
        for solid, keys in news:
            if id(solid) not in self._paths:
                self._define(solid)
            if id(solid) in self._paths:
                self._sample(solid, keys)
        return 200 * len(news)

    def _define(self, solid):
        if not len(solid.faces.corners):
            return
        UsdGeom.Scope.Define(self.stage, f"{PLACE}/Obstacles")
        path = write_material(self.stage, f"{MATERIALS}/obstacle", self.place.theme.obstacle)
        corners = solid.faces.corners
        triangle = (corners[:, 2] == corners[:, 3]).all(axis=1)  # the last corner is there twice
        counts = np.where(triangle, 3, 4)
        index = [4 * face + corner for face, count in enumerate(counts) for corner in range(count)]
        used, index = np.unique(index, return_inverse=True)
        points = corners.reshape(-1, 3)[used]
        name = f"{PLACE}/Obstacles/{Tf.MakeValidIdentifier(solid.name)}_{len(self._paths)}"
        _bind(plain_mesh(self.stage, name, points, index, counts).GetPrim(), path)
        self._paths[id(solid)] = name

    def _sample(self, solid, keys):
        mesh = UsdGeom.Mesh(self.stage.GetPrimAtPath(self._paths[id(solid)]))
        ops = mesh.GetOrderedXformOps()
        move, size = ops or (mesh.AddTranslateOp(), mesh.AddScaleOp())
        if not ops:
            keys = solid.keys
        for key in keys:
            move.Set(Gf.Vec3d(*key.offset), key.frame)
            size.Set(Gf.Vec3f(1.0 if key.shown else NOTHING), key.frame)
            mesh.CreateVisibilityAttr().Set(
                UsdGeom.Tokens.inherited if key.shown else UsdGeom.Tokens.invisible, key.frame
            )


def _curves(stage, kind, lines, colour):
    """Lines as linear curves: guides and outlines."""
    points = [np.vstack([line.points, line.points[:1]]) if line.closed else line.points for line in lines]
    made = UsdGeom.BasisCurves.Define(stage, f"{PLACE}/{kind}")
    made.CreateTypeAttr(UsdGeom.Tokens.linear)
    together = np.ascontiguousarray(np.concatenate(points) + (0, 0, 0.05), np.float32)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(together))
    made.CreateCurveVertexCountsAttr([len(part) for part in points])
    made.CreateWidthsAttr([THIN])
    made.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    made.CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(np.array([together.min(0) - THIN, together.max(0) + THIN], np.float32))
    )
    made.GetPrim().SetCustomDataByKey("names", Vt.StringArray([line.name for line in lines]))
    _bind(made.GetPrim(), write_material(stage, f"{MATERIALS}/{kind.lower()}", colour))


def _goals(stage, place):
    goals = place.goals()
    if not goals:
        return
    UsdGeom.Scope.Define(stage, f"{PLACE}/Goals")
    path = write_material(stage, f"{MATERIALS}/goal", place.theme.goal)
    tall = max(2.0, 0.02 * max(place.width, place.height))
    for k, goal in enumerate(goals):
        made = UsdGeom.Cone.Define(stage, f"{PLACE}/Goals/{Tf.MakeValidIdentifier(goal.name or 'goal')}_{k}")
        made.CreateHeightAttr(tall)
        made.CreateRadiusAttr(0.2 * tall)
        made.CreateAxisAttr(UsdGeom.Tokens.z)
        made.CreateExtentAttr([(-0.2 * tall, -0.2 * tall, -0.5 * tall), (0.2 * tall, 0.2 * tall, 0.5 * tall)])
        made.AddTranslateOp().Set(Gf.Vec3d(*(goal.at + (0, 0, 0.5 * tall)).tolist()))
        made.GetPrim().SetCustomDataByKey("radius", goal.radius)
        _bind(made.GetPrim(), path)


def _camera(stage, place, options):
    """The camera with keyframes, else one that shows the whole level from the given direction."""
    made = UsdGeom.Camera.Define(stage, CAMERA)
    made.CreateVerticalApertureAttr(APERTURE)
    if options.get("camera"):
        made.CreateHorizontalApertureAttr(APERTURE * PICTURE[0] / PICTURE[1])
        made.CreateClippingRangeAttr(Gf.Vec2f(0.1, float(50 * max(place.width, place.height))))
        return
    view = place.camera(options.get("azimuth"), options.get("elevation"))
    made.CreateHorizontalApertureAttr(APERTURE * view.size[0] / view.size[1])
    made.CreateClippingRangeAttr(Gf.Vec2f(0.1, float(50 * view.distance)))
    set_camera(stage, view)


def set_camera(stage, view, *frame):
    """Let the camera see what a view shows, from a frame on or always."""
    made = UsdGeom.Camera(stage.GetPrimAtPath(CAMERA))
    right, up, ahead = view.axes
    matrix = Gf.Matrix4d(*[[*right.tolist(), 0], [*up.tolist(), 0], [*(-ahead).tolist(), 0], [*view.eye.tolist(), 1]])
    made.MakeMatrixXform().Set(matrix, *frame)
    made.CreateFocalLengthAttr().Set(float(APERTURE / (2 * np.tan(view.fov / 2))), *frame)


def _light(stage):
    """The sun as in pictures, and light from the sky."""
    UsdGeom.Scope.Define(stage, "/World/Light")
    sun = UsdLux.DistantLight.Define(stage, "/World/Light/Sun")
    sun.CreateIntensityAttr(1.0)
    sun.CreateNormalizeAttr(True)  # else a small sun is a dark one
    sun.CreateAngleAttr(1.0)
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), Gf.Vec3d(*SUN.tolist()))
    sun.AddTransformOp().Set(Gf.Matrix4d(turn, Gf.Vec3d(0)))
    sky = UsdLux.DomeLight.Define(stage, "/World/Light/Sky")
    sky.CreateIntensityAttr(0.6)
    sky.CreateColorAttr(Gf.Vec3f(0.85, 0.92, 1.0))
