"""Files that leave us, read back by the readers they are for."""

import csv
import json
import tracemalloc
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from pens import pen
from processes import other_process

from components import BrushBinding, Heading, Position, Role, Velocity
from engine.recording import open_recording, resume
from flockbrush.export import COLUMNS, Exporter, Exports, picture_size
from flockbrush.moments import Moment, Sampler, between
from flockbrush.run import rebuild, start


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def exported(shared, recording):
    """A folder with the recording as every kind of file."""
    names = ("pen.csv", "pen.parquet", "pen.usdc", "pen.mp4", "pen.png")
    arguments = [word for name in names for word in ("--to", shared / name)]
    done = other_process("export", recording, *arguments, "--fps", 16)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"wrote {shared / name}" for name in names]
    return shared


@pytest.fixture(scope="module")
def lived(recording):
    """The simulation at the last moment of those exports (tick 40)."""
    run = open_recording(recording)
    simulation = rebuild(run)
    resume(run, simulation.world)
    simulation.run(40)
    return simulation


# tables ------------------------------------------------------------------------------


def test_a_csv_has_the_columns_that_were_promised(exported):
    head = (exported / "pen.csv").read_text().splitlines()[0]
    assert head == "frame,time,id,x,y,z,vx,vy,vz,heading,speed,species,brush,role,reference" == ",".join(COLUMNS)


def test_a_csv_tells_where_everybody_was(exported, lived):
    rows = rows_of(exported / "pen.csv")
    assert len(rows) == 21 * 24  # every other tick of 40, and the start
    last = [row for row in rows if row["frame"] == "20"]
    agents = lived.agents
    assert [int(row["id"]) for row in last] == agents.ids.tolist()
    for names, column in ((("x", "y", "z"), Position.xyz), (("vx", "vy", "vz"), Velocity.xyz)):
        assert np.allclose([[float(row[n]) for n in names] for row in last], agents[column], atol=1e-6)
    forward = agents[Heading.forward]
    assert np.allclose([float(row["heading"]) for row in last], np.arctan2(forward[:, 1], forward[:, 0]), atol=1e-6)
    assert np.allclose([float(row["speed"]) for row in last], np.linalg.norm(agents[Velocity.xyz], axis=1), atol=1e-6)
    assert {row["time"] for row in last} == {"1.250000"}
    assert {row["species"] for row in rows} == {"sheep"}
    assert [row["role"] == "leader" for row in last] == agents[Role.leader].astype(bool).tolist()


def test_a_csv_tells_which_brush_moved_whom(exported, lived):
    rows = rows_of(exported / "pen.csv")
    assert {row["brush"] for row in rows if row["frame"] == "0"} == {"march"}
    assert {row["brush"] for row in rows if row["frame"] == "20"} == {"swarm"}  # the script switched it
    assert len(set(lived.agents[BrushBinding.brush].tolist())) == 1


def test_the_metadata_of_a_csv_lie_beside_it(exported, level):
    about = json.loads((exported / "pen.csv.json").read_text())
    assert (about["fps"], about["unit"], about["seed"], about["frames"]) == (16, "m", 3, 21)
    import hashlib

    assert about["level_sha256"] == hashlib.sha256(level.read_bytes()).hexdigest()


def test_parquet_says_the_same_as_csv_but_exactly(exported, lived):
    pq = pytest.importorskip("pyarrow.parquet")
    table = pq.read_table(exported / "pen.parquet")
    assert table.column_names == list(COLUMNS)
    assert str(table.schema.field("frame").type) == "int32"
    rows = rows_of(exported / "pen.csv")
    for name in ("species", "brush", "role"):
        assert table[name].to_pylist() == [row[name] for row in rows]
    assert np.allclose(table["x"].to_numpy(), [float(row["x"]) for row in rows], atol=1e-6)
    last = table.slice(20 * 24)
    assert np.array_equal(np.column_stack([last[n].to_numpy() for n in "xyz"]), lived.agents[Position.xyz])
    about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert (about["schema"], about["unit"], about["seed"]) == ("flockbrush.trajectory/1", "m", "3")


def test_names_with_commas_and_quotes_are_read_back_as_they_were(cli, tmp_path):
    path = pen(tmp_path)
    path.write_text(path.read_text().replace('"sheep"', '"sheep, \\"black\\""'))
    assert cli("run", path, "--ticks", 1, "--export", tmp_path / "a.csv").code == 0
    assert {row["species"] for row in rows_of(tmp_path / "a.csv")} == {'sheep, "black"'}


def test_pictures_may_be_of_space_from_where_one_wishes(recording, tmp_path):
    for name, more in (("north", ()), ("east", ("--azimuth", 0, "--elevation", 50))):
        picture = tmp_path / f"{name}.png"
        done = other_process("export", recording, "--to", picture, "--view", "space", *more, "--fps", 2)
        assert done.returncode == 0, done.stderr
    north, east = (cv2.imread(str(tmp_path / f"{name}.png")) for name in ("north", "east"))
    assert north.shape == east.shape == (720, 1280, 3) and (north != east).any()


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.png", "a.mp4"])
def test_the_same_recording_gives_the_same_bytes(cli, recording, tmp_path, name):
    (tmp_path / "again").mkdir()
    for folder in (tmp_path, tmp_path / "again"):
        assert cli("export", recording, "--to", folder / name, "--fps", 4).code == 0
    assert (tmp_path / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_exporting_while_running_and_from_the_recording_is_the_same(cli, level, exported, tmp_path):
    cli("run", level, "--ticks", 40, "--export", tmp_path / "a.csv", "--fps", 16)
    assert (tmp_path / "a.csv").read_text() == (exported / "pen.csv").read_text()


def test_what_was_there_before_is_replaced_whole(cli, recording, tmp_path):
    (tmp_path / "a.csv").write_text("old\n" * 100_000)
    assert cli("export", recording, "--to", tmp_path / "a.csv").code == 0
    assert len(rows_of(tmp_path / "a.csv")) == 41 * 24


def test_a_missing_package_is_named_with_the_way_to_get_it(cli, recording, tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    done = cli("export", recording, "--to", tmp_path / "a.parquet", "--to", tmp_path / "a.usdc")
    assert done.code == 1
    assert "pip install pyarrow" in done.err
    assert "pip install usd-core" in done.err


# pictures ------------------------------------------------------------------------------


def test_a_video_has_a_frame_for_every_moment_in_the_colours_of_the_level(exported):
    import av

    with av.open(str(exported / "pen.mp4")) as film:
        stream = film.streams.video[0]
        assert (stream.codec_context.name, stream.pix_fmt) == ("h264", "yuv420p")
        assert float(stream.average_rate) == 16
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 21
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 60  # somebody moved


def test_a_picture_is_the_last_frame_of_the_video(exported):
    import av
    import cv2

    picture = cv2.imread(str(exported / "pen.png"))[:, :, ::-1]
    with av.open(str(exported / "pen.mp4")) as film:
        last = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)][-1]
    assert picture.shape == last.shape
    assert np.abs(picture.astype(int) - last).mean() < 4


@pytest.mark.parametrize("size", [(240, 72), (14, 18), (1, 400), (2048, 2048)])
def test_pictures_have_even_sides_and_are_never_huge(size):
    width, height = picture_size(SimpleNamespace(width=size[0], height=size[1]))
    assert width % 2 == height % 2 == 0
    assert 300 <= width <= 1920
    assert 200 <= height <= 1080


# USD -------------------------------------------------------------------------------------


def herd_at(stage, frame):
    from pxr import UsdGeom

    herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
    primvars = UsdGeom.PrimvarsAPI(herd)
    got = {name: np.array(getattr(herd, f"Get{name}Attr")().Get(frame)) for name in ("Ids", "Positions", "Velocities")}
    got["ProtoIndices"] = np.array(herd.GetProtoIndicesAttr().Get(frame))
    got["Orientations"] = herd.GetOrientationsAttr().Get(frame)
    return got | {name: np.array(primvars.GetPrimvar(name).Get(frame)) for name in ("speed", "phase", "brush")}


def complaints(path):
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))


def test_a_usd_scene_has_everybody_where_they_were_with_y_up(exported, lived):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom

    stage = Usd.Stage.Open(str(exported / "pen.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (16, 20)
    got, agents = herd_at(stage, 20), lived.agents
    x, y, z = agents[Position.xyz].T
    assert np.allclose(got["Positions"], np.column_stack([x, z, -y]), atol=1e-4)
    assert got["Ids"].tolist() == agents.ids.tolist()
    assert {len(values) for values in got.values()} == {24}
    assert set(got["ProtoIndices"].tolist()) == {0}
    assert np.allclose(got["speed"], np.linalg.norm(got["Velocities"], axis=1), atol=1e-4)
    assert ((got["phase"] >= 0) & (got["phase"] <= 1)).all()


def test_an_animal_in_usd_faces_the_way_it_did(exported, lived):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import Gf

    got = herd_at(Usd.Stage.Open(str(exported / "pen.usdc")), 20)
    faces = np.array([Gf.Quatd(q).GetNormalized().Transform(Gf.Vec3d(1, 0, 0)) for q in got["Orientations"]])
    x, y, z = lived.agents[Heading.forward].T
    assert np.allclose(faces, np.column_stack([x, z, -y]), atol=3e-3)  # half floats


def test_quaternions_turn_x_to_any_direction_and_keep_the_feet_below():
    pytest.importorskip("pxr")
    from pxr import Gf

    from flockbrush.export_usd import orientations, y_up

    forward = np.random.default_rng(1).normal(size=(50, 3))
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    for quaternion, wanted in zip(orientations(forward), y_up(forward), strict=True):
        turn = Gf.Rotation(Gf.Quatd(*quaternion))
        assert np.allclose(turn.TransformDir(Gf.Vec3d(1, 0, 0)), wanted, atol=1e-9)
        assert abs(turn.TransformDir(Gf.Vec3d(0, 0, 1))[1]) < 1e-9  # no bank


def test_usd_validators_are_silent(exported, cli, recording, tmp_path):
    pytest.importorskip("pxr")
    cli("export", recording, "--to", tmp_path / "a.usda", "--usd-mode", "xforms", "--fps", 4)
    assert complaints(exported / "pen.usdc") == []
    assert complaints(tmp_path / "a.usda") == []


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


def written(tmp_path, simulation, name, **options):
    from flockbrush.export_usd import UsdScene

    scene = UsdScene(tmp_path / name, simulation, 24, **options)
    scene.open()
    for moment in turning():
        scene.take(moment)
    scene.close()
    from pxr import Usd

    return Usd.Stage.Open(str(tmp_path / name))


def test_quaternions_keep_their_hemisphere_and_the_gait_goes_on_through_births_and_deaths(tmp_path, lived):
    pytest.importorskip("pxr")
    stage = written(tmp_path, lived, "turning.usdc")
    before, phases = {}, {}
    for frame in range(40):
        got = herd_at(stage, frame)
        assert {len(values) for values in got.values()} == {len(turning()[frame])}
        for animal, q, phase in zip(got["Ids"].tolist(), got["Orientations"], got["phase"].tolist(), strict=True):
            now = np.array([q.GetReal(), *q.GetImaginary()])
            if animal in before:
                assert now @ before[animal] > 0
                assert (phase - phases[animal]) % 1 == pytest.approx(1.5 / 24, abs=1e-3)
            before[animal], phases[animal] = now, phase
    assert sorted(before) == [1, 2, 3, 4]


def test_xforms_hide_who_is_not_born_yet_and_who_is_dead(tmp_path, lived):
    pytest.importorskip("pxr")
    from pxr import UsdGeom

    stage = written(tmp_path, lived, "turning.usda", usd_mode="xforms")

    def seen(animal, frame):
        prim = UsdGeom.Imageable(stage.GetPrimAtPath(f"/World/Herd/animal_{animal}"))
        return prim.ComputeVisibility(frame) != "invisible"

    assert [seen(1, frame) for frame in (0, 29, 30, 39)] == [True, True, False, False]
    assert [seen(4, frame) for frame in (0, 19, 20, 39)] == [False, False, True, True]


# moments between ticks -----------------------------------------------------------------------


def moment(time, ids, x, y=0.0):
    n = len(ids)
    forward = np.tile([1.0, 0.0, 0.0], (n, 1))
    xyz = np.column_stack([x, np.full(n, y), np.zeros(n)])
    zeros = [np.zeros(n, kind) for kind in (np.int32, np.int32, bool, np.int64)]
    return Moment(time, np.array(ids), xyz, forward * 2, forward, np.ones(n), np.ones(n), *zeros)


def test_half_way_between_two_moments_everybody_is_half_way():
    middle = between(moment(0, [1, 2], [0.0, 10.0]), moment(1, [1, 2], [4.0, 12.0]), 0.5)
    assert middle.xyz[:, 0].tolist() == [2.0, 11.0]
    assert middle.time == 0.5


def test_between_two_moments_the_new_one_is_where_it_was_born_and_the_dead_one_gone():
    middle = between(moment(0, [1, 2], [0.0, 10.0]), moment(1, [2, 3], [12.0, 50.0]), 0.5)
    assert middle.ids.tolist() == [2, 3]
    assert middle.xyz[:, 0].tolist() == [11.0, 50.0]


def test_who_crosses_the_seam_takes_the_short_way():
    middle = between(moment(0, [1], [98.0]), moment(1, [1], [4.0]), 0.25, wrap=(100.0, 50.0))
    assert middle.xyz[0, 0] == pytest.approx(99.5)
    assert between(moment(0, [1], [98.0]), moment(1, [1], [4.0]), 0.5, wrap=(100.0, 50.0)).xyz[0, 0] == pytest.approx(1)


def test_from_nobody_to_somebody_is_no_trouble():
    assert len(between(moment(0, [], []), moment(1, [1], [4.0]), 0.5)) == 1
    assert len(between(moment(0, [1], [4.0]), moment(1, [], []), 0.5)) == 0


@pytest.mark.parametrize(("fps", "expected"), [(32, 17), (16, 9), (30, 16), (24, 13), (7, 4), (0.1, 1)])
def test_moments_come_at_a_steady_rate(level, fps, expected):
    simulation = start(level)
    sampler = Sampler(simulation, fps)
    times = [m.time for m in sampler.due()]
    for _ in range(16):
        simulation.tick()
        times += [m.time for m in sampler.due()]
    assert len(times) == expected
    assert np.allclose(times, np.arange(expected) / fps)


def test_moments_that_fall_on_ticks_are_the_very_states(level):
    simulation = start(level)
    sampler = Sampler(simulation, 16)
    list(sampler.due())
    simulation.run(2)
    (only,) = sampler.due()
    assert np.array_equal(only.xyz, simulation.agents[Position.xyz])


# memory -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_a_long_export_takes_no_more_memory_than_a_short_one(level, tmp_path, monkeypatch, name):
    monkeypatch.setattr("flockbrush.export.Parquet._ROWS", 1 << 12)
    simulation = start(level, agents=60)

    def peak(ticks):
        tracemalloc.start()
        with Exports([tmp_path / name], simulation) as exports:
            for _ in range(ticks):
                exports.take()
                simulation.clock.tick += 1  # nobody moves: only the writing is measured
        high = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return high

    short = peak(100)
    assert peak(500) < 1.5 * short + 1e6


def test_exports_that_cannot_all_be_opened_leave_nothing(level, tmp_path, monkeypatch):
    class Broken(Exporter):
        def open(self):
            raise OSError(13, "Permission denied", str(self.path))

    monkeypatch.setitem(Exports.__init__.__globals__["EXPORTERS"], ".parquet", Broken)
    with pytest.raises(OSError, match="Permission denied"):
        Exports([tmp_path / "a.csv", tmp_path / "a.parquet"], start(level))
    assert list(tmp_path.iterdir()) == []
