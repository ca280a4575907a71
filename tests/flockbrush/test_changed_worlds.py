"""A world that is changed while exports run: every file shows animals, obstacles and ground as they were.

Animals come and go, take another brush, an obstacle is moved and the ground is painted, as in the playground.
"""

import base64
import csv
import importlib.util
import json
import re
import sqlite3
import struct
import zlib
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.systems.animal_commands import AddAnimals, RemoveAnimals, SwitchBrush
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.obstacle_commands import MoveObstacle
from flockbrush.systems.paint_commands import PaintCells
from flockbrush.systems.undo import UseBrush
from test_gltf import Scene

from flockbrush.output.export import Exports
from flockbrush.output.exporter import exporters
from flockbrush.output.page.frames import COLUMNS
from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of, words_of
from tests.flockbrush.pens import pen

FPS, TICKS, SIZE = 16, 64, (320, 240)
CHANGES = {  # by the tick after which they are submitted
    5: UseBrush("graze", shipped().get("graze").source.decode()),
    7: AddAnimals("graze", 34.0, 24.0, 4.0, 5, "sheep"),
    15: RemoveAnimals(10.0, 15.0, 3.0),
    23: SwitchBrush("march"),
    31: MoveObstacle("stone", 30.0, 8.0),
    39: PaintCells("surface", ["mud"], [[row, 4, 8, 0] for row in range(20, 28)]),  # 4 to 12 m east, 20 to 28 m north
    57: MoveObstacle("stone", 30.0, 18.0),
}
OTHERS = {".usdc"}  # the same as .usda


@pytest.fixture(scope="module")
def lived(tmp_path_factory):
    """(folder, [truth of each frame]); the files are called after how they end."""
    folder = tmp_path_factory.mktemp("changed")
    simulation, truth = start(pen(folder, script=False)), []
    there = [ending for ending, kind in exporters().items() if ending not in OTHERS and all(map(found, kind.needs))]
    options = {"size": SIZE, "overlays": False, "dust": False, "origin": "0,0"}
    with Exports([folder / f"run{ending}" for ending in there], simulation, FPS, **options) as exports:
        for tick in range(TICKS + 1):
            if tick:
                simulation.tick()
            exports.take()
            if tick % 2 == 0:
                truth.append(seen(simulation))
            if tick in CHANGES:
                simulation.submit(CHANGES[tick])
    return folder, truth


def found(needed):
    """Whether what an exporter needs, (module, package), is installed."""
    return importlib.util.find_spec(needed[0].split(".")[0]) is not None


def seen(simulation):
    """What the playground shows of a moment."""
    moment = moment_of(simulation)
    herd = herd_of(simulation, moment)
    painter = painter_of(simulation, SIZE, clean=True, dust=False)
    words = words_of(simulation)["brush"]
    animals = zip(moment.ids.tolist(), moment.xyz.tolist(), moment.brush.tolist(), strict=True)
    return SimpleNamespace(
        herd={animal: (*xyz, words[code]) for animal, xyz, code in animals},
        stone=simulation.world.resource(Landscape).find("stone")[0].polygon.mean(axis=0),
        ground=cv2.blur(SceneMeshes(simulation).painter(1024).ground, (9, 9)),
        picture=painter.frame(herd._replace(leader=herd.leader & False), time=moment.time).copy(),
    )


def file_of(lived, ending):
    path = lived[0] / f"run{ending}"
    if not path.exists():
        pytest.skip(f"a package for {ending} is not installed")
    return path


def test_the_run_is_the_one_that_is_meant(lived):
    first, last = lived[1][0], lived[1][-1]
    assert len(lived[1]) == TICKS // 2 + 1
    assert len(last.herd.keys() - first.herd.keys()) == 5 and len(first.herd.keys() - last.herd.keys()) > 2
    assert {brush for *_, brush in first.herd.values()} == {brush for *_, brush in last.herd.values()} == {"march"}
    assert "graze" in {brush for *_, brush in lived[1][8].herd.values()}
    assert first.stone.tolist() == [24.0, 15.0] and last.stone.tolist() == [30.0, 18.0]


def rows_of(rows):
    """{frame: {id: (x, y, z, brush)}} of rows with these names."""
    frames = {}
    for row in rows:
        place = tuple(float(row[axis]) for axis in "xyz")
        frames.setdefault(int(row["frame"]), {})[int(row["id"])] = (*place, row["brush"])
    return frames


def from_csv(path):
    with open(path, newline="") as file:
        return rows_of(csv.DictReader(file))


def from_parquet(path):
    import pyarrow.parquet as pq

    return rows_of(pq.read_table(path).to_pylist())


def from_sqlite(path):
    query = """SELECT frame, id, pos_x AS x, pos_y AS y, pos_z AS z, name AS brush
               FROM trajectory_data JOIN names USING (names) WHERE kind = 'brush'"""
    base = sqlite3.connect(path)
    base.row_factory = sqlite3.Row
    found = rows_of(base.execute(query).fetchall())
    base.close()
    return found


def from_page(path):
    """As its script unpacks the one chunk."""
    parts = dict(re.findall('data-kind="(about|frames|labels)">([^<]+)<', path.read_text()))
    data = zlib.decompress(base64.b64decode(parts["frames"]))
    about, labels = (json.loads(zlib.decompress(base64.b64decode(parts[name]))) for name in ("about", "labels"))
    frames, animals, bodies = struct.unpack_from("<III", data)
    low, size = np.frombuffer(data, "<f4", 6, 12).astype(float).reshape(2, 3)
    ids = np.frombuffer(data, "<u4", animals, 36)
    numbers = np.frombuffer(data, np.uint8, offset=36 + 8 * animals + 8 * bodies)
    halves = numbers.astype(np.int64).reshape(len(COLUMNS) + len(labels), 2, animals, frames)
    table = dict(zip(COLUMNS, np.cumsum(halves[:, 0] + 256 * halves[:, 1], axis=-1) % 65536, strict=False))
    places = np.stack([table[axis] for axis in "xyz"], axis=-1) / 65535 * size + low
    words = about["words"]["brush"]
    return {
        k: {
            int(one): (*places[row, k], words[table["brush"][row, k]])
            for row, one in enumerate(ids) if table["present"][row, k]
        }
        for k in range(frames)
    }  # fmt: skip


def from_gltf(path):
    scene, frames = Scene(path), {}
    animals = {node["extras"]["id"]: k for k, node in enumerate(scene.nodes) if node["name"].startswith("animal ")}
    for frame in range(TICKS // 2 + 1):
        seconds, frames[frame] = frame / FPS, {}
        for animal, node in animals.items():
            worn = [k for k in scene.nodes[node]["children"] if scene.matrix(k, seconds)[:3, :3].any()]
            brushes = [word for second, word in scene.nodes[node]["extras"]["brush"] if second <= seconds + 1e-3]
            if worn:
                x, z, y = scene.matrix(node, seconds)[:3, 3] * (1, 1, -1)
                frames[frame][animal] = (x, y, z, brushes[-1])
                assert [scene.nodes[k]["name"] for k in worn] == brushes[-1:]
    return frames


def from_usd(path):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    herd = UsdGeom.PointInstancer(next(prim for prim in stage.Traverse() if prim.IsA(UsdGeom.PointInstancer)))
    words = stage.GetPrimAtPath("/World/Herd").GetCustomDataByKey("brush_names")
    brush = UsdGeom.PrimvarsAPI(herd.GetPrim()).GetPrimvar("brush")
    return {
        frame: {
            int(one): (*place, words[code])
            for one, place, code in zip(
                herd.GetIdsAttr().Get(frame), herd.GetPositionsAttr().Get(frame), brush.Get(frame), strict=True
            )
        }
        for frame in range(TICKS // 2 + 1)
    }


def from_netcdf(path):
    import xarray

    data = xarray.load_dataset(path, mask_and_scale=False)
    words, ids = data.brush.names.split(", "), [int(name.split("_")[1]) for name in data.individuals.values]
    places, codes = data.position.values[:, :, 0], data.brush.values
    return {
        frame: {
            ids[k]: (*places[frame, :, k], words[codes[frame, k]])
            for k in np.flatnonzero(np.isfinite(places[frame, 0]))
        }
        for frame in range(len(places))
    }


def from_movebank(path):
    """The brush is in the comment; degrees are rounded."""
    frames = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            seconds = float(row["timestamp"].rsplit(":", 1)[1])
            x, y = (float(row[f"location-{axis}"]) * 111_319.49 for axis in ("long", "lat"))
            animal = int(re.search(r"\d+$", row["individual-local-identifier"])[0])
            brush = re.search("brush ([^;]+)", row["comments"])[1]
            frames.setdefault(round(seconds * FPS), {})[animal] = (round(x, 2), round(y, 2), 0.0, brush)
    return frames


READERS = {
    ".csv": from_csv, ".parquet": from_parquet, ".sqlite": from_sqlite, ".html": from_page, ".glb": from_gltf,
    ".usda": from_usd, ".nc": from_netcdf, ".movebank.csv": from_movebank,
}  # fmt: skip


@pytest.mark.parametrize("ending", READERS)
def test_animals_that_come_go_and_change_are_in_each_frame_as_they_were(lived, ending):
    frames = READERS[ending](file_of(lived, ending))
    assert sorted(frames) == list(range(len(lived[1])))
    for frame, truth in enumerate(lived[1]):
        assert frames[frame].keys() == truth.herd.keys(), frame
        for animal, there in truth.herd.items():
            told = frames[frame][animal]
            near = 0.02 if ending == ".movebank.csv" else 2e-3
            assert np.allclose(told[:3], there[:3], atol=near) and told[3] == there[3], (frame, animal)


def test_every_picture_is_of_the_world_as_it_was(lived):
    """As a painter draws it who has just come."""
    shown = [cv2.imread(str(path))[..., ::-1] for path in sorted(lived[0].glob("run.[0-9]*.png"))]
    assert len(shown) == len(lived[1])
    assert all(np.array_equal(one, truth.picture) for one, truth in zip(shown, lived[1], strict=True))
    assert np.array_equal(cv2.imread(str(lived[0] / "run.png"))[..., ::-1], shown[-1])


def test_every_frame_of_a_film_is_nearest_to_the_picture_of_its_time(lived):
    film = cv2.VideoCapture(str(lived[0] / "run.mp4"))
    pictures = np.array([truth.picture for truth in lived[1]], float)
    for frame in range(len(pictures)):
        off = np.abs(film.read()[1][..., ::-1] - pictures).mean(axis=(1, 2, 3))
        assert off.argmin() == frame and off[frame] < 2.5
    assert not film.read()[0]


def grounds_of_usd(path):
    from pxr import Usd, UsdShade

    stage = Usd.Stage.Open(str(path))
    (shader,) = (UsdShade.Shader(prim) for prim in stage.Traverse() if prim.GetName() == "Picture")
    file = shader.GetInput("file").GetAttr()
    return [cv2.imread(str(path.parent / file.Get(frame).path)) for frame in (0, TICKS // 2)]


def grounds_of_gltf(path):
    scene, found = Scene(path), {}
    for node in (k for k, one in enumerate(scene.nodes) if re.fullmatch(r"Ground( \d+)?", one["name"])):
        (part,) = scene.document["meshes"][scene.nodes[node]["mesh"]]["primitives"]
        look = scene.document["materials"][part["material"]]["pbrMetallicRoughness"]["baseColorTexture"]
        image = scene.document["images"][scene.document["textures"][look["index"]]["source"]]
        view = scene.document["bufferViews"][image["bufferView"]]
        data = np.frombuffer(scene.data, np.uint8, view["byteLength"], view["byteOffset"])
        for seconds in (0.0, TICKS / 2 / FPS):
            if scene.local(node, seconds)[2].any():
                found[seconds] = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return list(found.values())


def grounds_of_page(path):
    text = path.read_text()
    about = json.loads(zlib.decompress(base64.b64decode(re.search('data-kind="about">([^<]+)<', text)[1])))
    first, *patches = (
        cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
        for data in re.findall('data-kind="(?:ground|patch)">([^<]+)<', text)
    )
    last = first.copy()
    for (_, left, top), patch in zip(about["patches"], patches, strict=True):
        last[top : top + len(patch), left : left + patch.shape[1]] = patch
    return [first, last]


@pytest.mark.parametrize(
    ("ending", "grounds"), [(".usda", grounds_of_usd), (".glb", grounds_of_gltf), (".html", grounds_of_page)]
)
def test_the_ground_is_that_of_the_first_and_of_the_last_moment(lived, ending, grounds):
    """With what was painted, and with the obstacle that was moved just before the end."""
    truths = [lived[1][frame].ground for frame in (0, -1)]
    shown = [cv2.resize(picture[..., ::-1], truths[0].shape[1::-1]) for picture in grounds(file_of(lived, ending))]
    off = [[np.abs(cv2.blur(one, (9, 9)).astype(float) - truth).mean() for truth in truths] for one in shown]
    compressed = off[0][0]
    assert off[1][1] < 1.1 * compressed and compressed < 0.2 * min(off[0][1], off[1][0]), off


def stones_of_usd(path):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    (stone,) = (UsdGeom.Mesh(prim) for prim in stage.GetPrimAtPath("/World/Place/Obstacles").GetChildren())
    matrices = (stone.ComputeLocalToWorldTransform(frame) for frame in range(TICKS // 2 + 1))
    corners = [[matrix.Transform(point) for point in stone.GetPointsAttr().Get()] for matrix in matrices]
    return [(np.min(points, axis=0) + np.max(points, axis=0))[:2] / 2 for points in corners]


def stones_of_gltf(path):
    scene = Scene(path)
    node, began = scene.node("stone"), np.array([24.0, 15.0])
    return [began + scene.local(node, frame / FPS)[0][:2] for frame in range(TICKS // 2 + 1)]


def stones_of_page(path):
    data = re.search('data-kind="about">([^<]+)<', path.read_text())[1]
    ((track,)) = (one["track"] for one in json.loads(zlib.decompress(base64.b64decode(data)))["moving"])
    seconds, _, x, y, _ = np.transpose(track)
    times = np.arange(TICKS // 2 + 1) / FPS
    return np.column_stack([24.0 + np.interp(times, seconds, x), 15.0 + np.interp(times, seconds, y)])


def stones_of_sqlite(path):
    import shapely

    base = sqlite3.connect(path)
    query = "SELECT wkt FROM frame_data JOIN geometry ON hash = geometry_hash ORDER BY frame"
    areas = [shapely.from_wkt(text) for (text,) in base.execute(query)]
    base.close()
    return [(shapely.box(0, 0, 40, 30) - area).centroid.coords[0] for area in areas]


STONES = {".usda": stones_of_usd, ".glb": stones_of_gltf, ".html": stones_of_page, ".sqlite": stones_of_sqlite}


@pytest.mark.parametrize("ending", STONES)
def test_an_obstacle_that_was_moved_is_where_it_was(lived, ending):
    stones = STONES[ending](file_of(lived, ending))
    assert np.allclose(stones, [truth.stone for truth in lived[1]], atol=1e-3)
