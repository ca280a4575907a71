"""USD scenes: read back by USD itself, judged by its validators, and opened in Blender where that is installed."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from blender import WITHOUT_BLENDER, blender_python
from flockbrush.components import Heading, Position
from flockbrush.engine.locks import Advice
from flockbrush.systems.landscape import Landscape

from flockbrush.render.canvas import smooth
from flockbrush.runs.run import start
from flockbrush.runs.run_edits import rows_of
from flockbrush.runs.snapshots import Moment, words_of

pytest.importorskip("pxr.Usd")

MODES = ("instancer", "xforms", "skel")


@pytest.fixture(scope="module")
def scenes(shared, recording, command):
    """{mode: path} of the recording as USD."""
    paths = {mode: shared / f"pen-{mode}.usdc" for mode in MODES}
    for mode, path in paths.items():
        command("export", recording, "--to", path, "--fps", 16, "--usd-mode", mode)
    return paths


@pytest.fixture(scope="module")
def stages(scenes):
    from pxr import Usd

    return {mode: Usd.Stage.Open(str(path)) for mode, path in scenes.items()}


def herd_at(stage, frame):
    from pxr import UsdGeom

    herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
    primvars = UsdGeom.PrimvarsAPI(herd)
    got = {name: np.array(getattr(herd, f"Get{name}Attr")().Get(frame)) for name in ("Ids", "Positions", "Velocities")}
    got["ProtoIndices"] = np.array(herd.GetProtoIndicesAttr().Get(frame))
    got["Orientations"] = herd.GetOrientationsAttr().Get(frame)
    names = ("speed", "phase", "brush", "species", "leader")
    return got | {name: np.array(primvars.GetPrimvar(name).Get(frame)) for name in names}


def complaints(path):
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))


@pytest.mark.parametrize("mode", MODES)
def test_usd_validators_are_silent(scenes, mode):
    assert [error.GetMessage() for error in complaints(scenes[mode])] == []


def test_up_is_said_once_and_true(stages, lived):
    from pxr import UsdGeom

    for stage in stages.values():
        assert UsdGeom.GetStageUpAxis(stage) == "Z"
        assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
        assert "z up" in stage.GetRootLayer().customLayerData["flockbrush"]["axes"]
        ground = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/World/Place/Ground")).GetPointsAttr().Get())
        assert np.ptp(ground[:, 2]) == 0.0  # a flat pen
        assert (np.ptp(ground[:, 0]), np.ptp(ground[:, 1])) == (lived.level.width, lived.level.height)


def test_a_scene_has_everybody_where_they_were(stages, lived):
    stage = stages["instancer"]
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (16, 20)
    got, agents = herd_at(stage, 20), lived.agents
    assert np.allclose(got["Positions"], agents[Position.xyz], atol=1e-4)
    assert got["Ids"].tolist() == agents.ids.tolist()
    assert {len(values) for values in got.values()} == {24}
    assert np.allclose(got["speed"], np.linalg.norm(got["Velocities"], axis=1), atol=1e-4)
    assert ((got["phase"] >= 0) & (got["phase"] <= 1)).all()
    words = stage.GetPrimAtPath("/World/Herd").GetCustomDataByKey("brush_names")
    assert {words[k] for k in got["brush"].tolist()} == {"swarm"}


@pytest.mark.parametrize("mode", MODES)
def test_an_animal_looks_the_way_it_did_in_every_mode(stages, lived, mode):
    from pxr import Gf, UsdGeom

    if mode == "instancer":
        turns = herd_at(stages[mode], 20)["Orientations"]
        faces = [Gf.Quatd(q).GetNormalized().Transform(Gf.Vec3d(1, 0, 0)) for q in turns]
    else:
        prims = [stages[mode].GetPrimAtPath(f"/World/Herd/animal_{k}") for k in lived.agents.ids]
        placed = [UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(20) for prim in prims]
        faces = [matrix.TransformDir(Gf.Vec3d(1, 0, 0)).GetNormalized() for matrix in placed]
        at = [matrix.ExtractTranslation() for matrix in placed]
        assert np.allclose(at, lived.agents[Position.xyz], atol=1e-9)
    assert np.allclose(np.array(faces), lived.agents[Heading.forward], atol=3e-3)  # half floats


def test_the_place_is_there(stages, lived):
    from pxr import UsdGeom, UsdShade

    stage = stages["instancer"]
    stone = next(iter(stage.GetPrimAtPath("/World/Place/Obstacles").GetChildren()))
    points = np.array(UsdGeom.Mesh(stone).GetPointsAttr().Get())
    assert np.allclose(points[:, :2].min(0), (22, 13)) and np.allclose(points[:, :2].max(0), (26, 17))
    guide = UsdGeom.BasisCurves(stage.GetPrimAtPath("/World/Place/Guides"))
    curve = smooth([(4, 15), (20, 10), (36, 15)])
    assert np.allclose(np.array(guide.GetPointsAttr().Get())[:, :2], curve)
    assert UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera"))
    material = UsdShade.Material(stage.GetPrimAtPath("/World/Materials/ground"))
    picture = UsdShade.Shader(stage.GetPrimAtPath("/World/Materials/ground/Picture")).GetInput("file").Get()
    assert material and picture.resolvedPath.endswith("pen-instancer.ground.jpg")


def test_the_camera_sees_the_whole_level(stages, lived):
    from pxr import Gf, UsdGeom

    camera = UsdGeom.Camera(stages["instancer"].GetPrimAtPath("/World/Camera")).GetCamera(0)
    frustum = camera.frustum
    for x in (0.0, lived.level.width):
        for y in (0.0, lived.level.height):
            assert frustum.Intersects(Gf.Vec3d(x, y, 0))


def test_every_brush_has_its_material_and_every_pose_its_prototype(stages, lived):
    from pxr import UsdGeom, UsdShade

    stage = stages["instancer"]
    herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
    targets = herd.GetPrototypesRel().GetTargets()
    indices = [np.array(herd.GetProtoIndicesAttr().Get(frame)) for frame in range(21)]
    assert len({row for frame in indices for row in frame.tolist()}) == len(targets) > 4
    first = {indices[frame][0] for frame in range(21)}
    assert len(first) > 2  # its legs move
    bound = set()
    for path in targets:
        body = stage.GetPrimAtPath(path.AppendChild("Body"))
        bound.add(UsdShade.MaterialBindingAPI(body).ComputeBoundMaterial()[0].GetPath().name)
    assert bound == {"brush_march", "brush_swarm"}


def test_joints_put_feet_where_poses_have_them(stages, level):
    from pxr import Usd, UsdGeom, UsdSkel

    from flockbrush.render.animal_looks import mesh_of, posed
    from flockbrush.render.gaits import CLIPS, Gaits
    from flockbrush.runs.snapshots import Sampler

    run = start(level)
    gaits, sampler, told = Gaits(run), Sampler(run, 16), {}
    for tick in range(9):
        if tick:
            run.tick()
        for moment in sampler.due():
            told = (moment, *gaits.of(moment))
    moment, clip, phase = told
    stage = stages["skel"]
    animal = int(moment.ids[0])
    root = UsdSkel.Root(stage.GetPrimAtPath(f"/World/Herd/animal_{animal}"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath(f"{root.GetPath()}/Look/Skeleton")))
    skin = cache.GetSkinningQuery(stage.GetPrimAtPath(f"{root.GetPath()}/Look/Body"))
    points = UsdGeom.Mesh(skin.GetPrim()).GetPointsAttr().Get()
    skin.ComputeSkinnedPoints(query.ComputeSkinningTransforms(4), points, 4)
    mesh = mesh_of("beast")
    expected = posed(mesh, CLIPS[clip[0]], float(phase[0]))
    soles = mesh.points[:, 2] < 1e-9
    assert CLIPS[clip[0]] != "rest"
    assert np.allclose(np.array(points)[soles][:, 0], expected[soles][:, 0], atol=0.03)
    assert np.allclose(np.array(points)[soles][:, 2], expected[soles][:, 2], atol=0.03)


def turning(n=3, frames=40):
    """Moments of animals that turn round and round; one more is born half-way, the first dies at three quarters."""
    moments = []
    for k in range(frames):
        ids = np.arange(1 + (k >= 30), n + 1 + (k >= 20))
        a = ids + 0.5 * k
        forward = np.column_stack([np.cos(a), np.sin(a), 0 * a])
        one = np.ones(len(ids))
        moments.append(
            Moment(
                k / 24, ids, forward * 3, forward * 1.5, forward, one, 0.2 * one,
                *(np.zeros(len(ids), kind) for kind in (np.int32, np.int32, bool, np.int64)),
            )
        )  # fmt: skip
    return moments


def written(tmp_path, simulation, name, moments=None, **options):
    from pxr import Usd

    from flockbrush.output.formats.usd_scene import UsdScene

    scene = UsdScene(tmp_path / name, simulation, 24, **options)
    scene.open()
    for moment in moments or turning():
        scene.take(moment)
    scene.close()
    return Usd.Stage.Open(str(tmp_path / name))


def test_quaternions_keep_their_hemisphere_and_the_gait_goes_on_through_births_and_deaths(tmp_path, lived):
    from flockbrush.render.animal_looks import mesh_of

    stage = written(tmp_path, lived, "turning.usdc")
    before, phases, stride = {}, {}, mesh_of("beast").strides["walk"].length
    for frame in range(40):
        got = herd_at(stage, frame)
        assert {len(values) for values in got.values()} == {len(turning()[frame])}
        for animal, q, phase in zip(got["Ids"].tolist(), got["Orientations"], got["phase"].tolist(), strict=True):
            now = np.array([q.GetReal(), *q.GetImaginary()])
            if animal in before:
                assert now @ before[animal] > 0
                assert (phase - phases[animal]) % 1 == pytest.approx(1.5 / 24 / stride, abs=1e-3)
            before[animal], phases[animal] = now, phase
    assert sorted(before) == [1, 2, 3, 4]


@pytest.mark.parametrize("mode", MODES)
def test_an_animal_takes_the_short_way_over_the_seam_of_a_periodic_map(tmp_path, lived, monkeypatch, mode):
    from pxr import Usd, UsdGeom

    monkeypatch.setattr(Landscape, "wrap", property(lambda _: (40.0, 30.0)))
    moments = []
    for frame, x in enumerate((38.0, 39.0, 1.0, 2.0)):  # at the third frame one is over the seam, and another is born
        moment = turning(n=2 + (frame > 1), frames=1)[0]
        moment.xyz[0] = x, 29.5 + 0.5 * frame - 30 * (frame > 0), 0.0
        moments.append(replace(moment, time=frame / 24, velocity=np.zeros((len(moment), 3))))
    stage = written(tmp_path, lived, f"{mode}.usdc", moments, usd_mode=mode)

    def place(time):
        if mode != "instancer":
            prim = stage.GetPrimAtPath("/World/Herd/animal_1")
            return UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time).ExtractTranslation()
        herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
        read = (herd.GetPositionsAttr(), herd.GetVelocitiesAttr(), herd.GetIdsAttr())
        positions, velocities, ids = (attribute.Get(Usd.TimeCode(time)) for attribute in read)
        assert len(positions) == len(velocities) == len(ids)
        return positions[0]

    places = np.array([place(time) for time in (0.5, 1.5, 1.98, 2, 2.5)])[:, :2]
    assert np.allclose(places, [[38.5, 29.75], [40, 0.25], [41, 0.5], [1, 0.5], [1.5, 0.75]], atol=0.06)


@pytest.mark.parametrize("mode", ["xforms", "skel"])
def test_who_is_not_born_yet_or_dead_has_no_size_even_where_visibility_is_ignored(tmp_path, lived, mode):
    from pxr import Gf, UsdGeom

    stage = written(tmp_path, lived, "turning.usda", usd_mode=mode)

    def size(animal, frame):
        prim = UsdGeom.Xformable(stage.GetPrimAtPath(f"/World/Herd/animal_{animal}"))
        return prim.ComputeLocalToWorldTransform(frame).TransformDir(Gf.Vec3d(1, 0, 0)).GetLength()

    assert np.allclose([size(1, frame) for frame in (0, 15.5, 29, 30, 39)], [1, 1, 1, 0, 0], atol=1e-3)
    assert np.allclose([size(4, frame) for frame in (0, 10.5, 19, 20, 30.5, 39)], [0, 0, 0, 1, 1, 1], atol=1e-3)
    prim = UsdGeom.Imageable(stage.GetPrimAtPath("/World/Herd/animal_1"))
    assert [prim.ComputeVisibility(frame) for frame in (0, 30)] == ["inherited", "invisible"]


@pytest.mark.parametrize("mode", ["xforms", "skel"])
def test_an_animal_that_changes_its_look_or_is_away_for_a_while_is_shown_so(tmp_path, lived, mode):
    from pxr import Usd, UsdGeom, UsdShade

    names = words_of(lived)["brush"]
    brush = {frame: int(2 <= frame <= 6) for frame in range(10)}
    length = {frame: 2.0 if frame >= 7 else 1.0 for frame in range(10)}
    moments = []
    for frame, moment in enumerate(turning(frames=10)):
        kinds, lengths = moment.brush.copy(), moment.length.copy()
        kinds[0], lengths[0] = brush[frame], length[frame]
        rows = np.arange(3 <= frame <= 5, len(moment))  # animal 1 is away from 3 to 5
        moments.append(rows_of(replace(moment, brush=kinds, length=lengths), rows))
    stage = written(tmp_path, lived, "looks.usda", moments, usd_mode=mode)
    bodies = [prim for prim in stage.GetPrimAtPath("/World/Herd/animal_1").GetChildren() if "Look" in prim.GetName()]
    assert len(bodies) == 2
    for frame in range(10):
        shown = {}
        for body in bodies:
            size = UsdGeom.Xformable(body).ComputeLocalToWorldTransform(frame).TransformDir((1, 0, 0)).GetLength()
            visible = UsdGeom.Imageable(body).ComputeVisibility(frame) == UsdGeom.Tokens.inherited
            assert visible == (size > 1e-3)
            if visible:
                skin = next(p for p in Usd.PrimRange(body, Usd.TraverseInstanceProxies()) if p.GetTypeName() == "Mesh")
                shown[UsdShade.MaterialBindingAPI(skin).ComputeBoundMaterial()[0].GetPath().name] = round(size, 4)
        there = not 3 <= frame <= 5
        assert shown == ({f"brush_{names[brush[frame]]}": length[frame]} if there else {}), frame


def test_flyers_bank(tmp_path, lived):
    from dataclasses import replace

    from pxr import Gf

    moment = turning(frames=1)[0]
    forward = np.tile([1.0, 0.0, 0.0], (3, 1))
    up = np.array([[0, 0, 1.0], [0, np.sin(0.5), np.cos(0.5)], [0, -1.0, 0]])
    stage = written(tmp_path, lived, "bank.usda", [replace(moment, forward=forward, up=up)])
    turns = herd_at(stage, 0)["Orientations"]
    backs = [Gf.Quatd(q).GetNormalized().Transform(Gf.Vec3d(0, 0, 1)) for q in turns]
    assert np.allclose(np.array(backs), up, atol=3e-3)


def test_walkers_lie_along_the_slope(tmp_path):
    from pxr import Gf

    simulation = start("predators-valley")
    from flockbrush.systems.landscape import Landscape

    from flockbrush.runs.snapshots import moment_of

    moment = moment_of(simulation)
    stage = written(tmp_path, simulation, "slope.usda", [moment])
    backs = np.array(
        [Gf.Quatd(q).GetNormalized().Transform(Gf.Vec3d(0, 0, 1)) for q in herd_at(stage, 0)["Orientations"]]
    )
    land = simulation.world.resource(Landscape)
    index = np.clip((moment.xyz[:, :2] / land.relief_cell).astype(int), 0, np.array(land.relief.shape[1::-1]) - 1)
    slope = land.relief[index[:, 1], index[:, 0], 1:]
    normal = np.column_stack([-slope, np.ones(len(slope))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert (normal[:, 2] < 0.999).any()
    assert np.abs(backs - normal).max() < 0.05  # between cells the slope is interpolated


@pytest.fixture
def box(tmp_path):
    """A body of somebody's own: a box, y up, centimetres, 2 m long."""
    from pxr import Usd, UsdGeom

    path = tmp_path / "box.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    root = UsdGeom.Xform.Define(stage, "/Mine")
    cube = UsdGeom.Cube.Define(stage, "/Mine/Box")
    cube.CreateSizeAttr(200.0)
    cube.CreateExtentAttr([(-100, -100, -100), (100, 100, 100)])
    stage.SetDefaultPrim(root.GetPrim())
    stage.Save()
    return path


@pytest.mark.parametrize("mode", MODES)
def test_a_file_replaces_the_look_of_a_species(cli, recording, tmp_path, box, mode):
    from pxr import Usd, UsdGeom

    out = tmp_path / "a.usdc"
    done = cli("export", recording, "--to", out, "--fps", 4, "--usd-mode", mode, "--prototype", f"sheep={box}")
    assert done.code == 0, done.err
    assert complaints(out) == []
    stage = Usd.Stage.Open(str(out))
    cache = UsdGeom.BBoxCache(4, ["default"])
    if mode == "instancer":
        herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
        scale = np.array(herd.GetScalesAttr().Get(4))[0]
        box = cache.ComputeUntransformedBound(stage.GetPrimAtPath(herd.GetPrototypesRel().GetTargets()[0]))
        assert np.allclose(box.ComputeAlignedRange().GetSize(), 1.0)  # the instance's scale makes it as long as it is
    else:
        prim = stage.GetPrimAtPath("/World/Herd/animal_1")
        scale = np.array(prim.GetAttribute("xformOp:scale").Get(4))
        high = cache.ComputeWorldBound(prim.GetChild("Look")).ComputeAlignedRange().GetSize()[2]
        assert high == pytest.approx(scale[2], rel=0.01)
    assert np.allclose(scale, scale[0])  # it keeps its proportions


def test_a_scene_finds_the_look_of_a_species_where_both_were_moved_to(cli, recording, tmp_path, box):
    from pxr import Usd

    own, there = tmp_path / "here/models/box.usda", tmp_path / "there"
    own.parent.mkdir(parents=True)
    shutil.copy(box, own)
    done = cli("export", recording, "--to", own.parents[1] / "a.usda", "--fps", 4, "--prototype", f"sheep={own}")
    assert done.code == 0, done.err
    own.parents[1].rename(there)
    assert complaints(there / "a.usda") == []
    stage = Usd.Stage.Open(str(there / "a.usda"))
    used = {Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath}
    assert used == {there / "a.usda", there / "models/box.usda"}


@pytest.mark.parametrize("text", ["sheep", "sheep=", "=x.usd", "sheep=nowhere.usd", "sheep={tmp}/text.usd"])
def test_a_look_that_cannot_be_used_is_refused_before_the_run(cli, recording, tmp_path, text):
    (tmp_path / "text.usd").write_text("no usd")
    done = cli("export", recording, "--to", tmp_path / "a.usdc", "--prototype", text.format(tmp=tmp_path))
    assert done.code == 1
    assert "--prototype" in done.err
    assert not (tmp_path / "a.usdc").exists()


def test_a_look_is_not_replaced_by_the_scene_nor_given_twice_or_empty_or_to_nobody(cli, recording, tmp_path, box):
    before = box.read_bytes()
    done = cli("export", recording, "--to", box, "--prototype", f"sheep={box}")
    assert (done.code, box.read_bytes()) == (1, before) and "is also an input file" in done.err
    out, empty = tmp_path / "a.usdc", tmp_path / "empty.usda"
    empty.write_text('#usda 1.0\n(defaultPrim="E")\ndef Xform "E" {}\n')
    for words, said in (
        (["--prototype", f"sheep={box}", "--prototype", f"sheep={box}"], "there are several files for 'sheep'"),
        (["--prototype", f"sheep={empty}"], "its default prim has no geometry"),
    ):
        done = cli("export", recording, "--to", out, *words)
        assert done.code == 1 and done.err.count(said) == 1 and not out.exists()
    with pytest.warns(Advice, match="--prototype cow=.*: there is no such species here; there are .*sheep"):
        assert cli("export", recording, "--to", out, "--fps", 4, "--prototype", f"cow={box}").code == 0


@pytest.mark.tools
@pytest.mark.skipif(blender_python() is None, reason=WITHOUT_BLENDER)
@pytest.mark.parametrize("mode", MODES)
def test_blender_shows_the_herd_where_it_was(scenes, lived, mode):
    program = Path(__file__).parents[1] / "look_with_blender.py"
    done = subprocess.run([blender_python(), program, scenes[mode]], capture_output=True, text=True, timeout=300)
    assert "TOLD" in done.stdout, done.stderr
    told = json.loads(done.stdout.split("TOLD")[1].splitlines()[0])
    assert told["frames"] == [0, 20] and told["camera"]
    assert np.allclose(told["20"], sorted(lived.agents[Position.xyz].round(4).tolist()), atol=2e-3)
    assert told["0"] != told["20"]
