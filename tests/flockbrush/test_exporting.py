"""Files that leave us, read back by the readers they are for."""

import csv
import json
import tracemalloc
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from flockbrush.components import BrushBinding, Heading, Position, Role, Velocity
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.level_writer import Document
from flockbrush.systems.groups import groups_of
from pens import pen

from flockbrush.output.export import Exports, check_exports
from flockbrush.output.exporter import Exporter, exporters
from flockbrush.output.pictures import picture_size
from flockbrush.output.trajectory_table import COLUMNS
from flockbrush.runs import catalogue
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import Moment, Sampler, between


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def exported(shared, recording, command):
    """A folder with the recording as every kind of file."""
    names = ("pen.csv", "pen.parquet", "pen.usdc", "pen.mp4", "pen.png")
    command("export", recording, *[word for name in names for word in ("--to", shared / name)], "--fps", 16)
    return shared


# all kinds -----------------------------------------------------------------------------


def test_the_help_says_who_opens_every_kind_of_file(cli):
    from flockbrush.output.exporter import exporters

    done = cli("export", "--help")
    assert done.code == 0
    for ending, kind in exporters().items():
        assert kind.contents and kind.opens_in
        assert ending in done.out
        assert kind.opens_in.split(",")[0] in done.out


def test_a_new_exporter_brings_its_options_and_its_line_in_the_help(cli, level, tmp_path, monkeypatch):
    from flockbrush.output import exporter as room

    class Counted(Exporter):
        endings, contents, opens_in = (".count",), "how many animals there are", "eyes"
        choices = (room.Option("shout", False, "In capitals."), room.Option("times", 1, "Over again.", low=1, high=3))

        def take(self, moment):
            word = f"{len(moment)} sheep " * self.options["times"]
            self.temporary.write_text(word.upper() if self.options["shout"] else word)

    assert ".csv" in exporters()  # all of ours are registered before
    monkeypatch.setitem(room._registry, ".count", Counted)
    assert "how many animals" in cli("export", "--help").out
    out = tmp_path / "a.count"
    assert cli("run", level, "--ticks", 1, "--export", out, "--shout", "--times", 2).code == 0
    assert out.read_text() == "24 SHEEP 24 SHEEP "
    done = cli("run", level, "--ticks", 1, "--export", out, "--times", 4)
    assert done.code == 2
    assert "--times" in done.err


def test_an_option_for_a_file_that_is_not_written_is_refused(cli, level, tmp_path):
    done = cli("run", level, "--ticks", 1, "--export", tmp_path / "a.csv", "--usd-mode", "xforms")
    assert done.code == 2
    assert "--usd-mode" in done.err and ".usda, .usdc" in done.err
    assert list(tmp_path.glob("a.*")) == []


def test_tables_carry_the_labels_that_a_world_has(level, tmp_path, monkeypatch):
    codes = catalogue.Label(lambda world: ("calm", "alert, up"), lambda world: world.agents.ids % 2)
    monkeypatch.setitem(catalogue.LABELS, "state", codes)
    paths = [tmp_path / "a.csv", tmp_path / "a.parquet"]
    with Exports(paths, start(level)) as exports:
        exports.take()
    rows = rows_of(paths[0])
    assert [row["state"] for row in rows] == [("calm", "alert, up")[int(row["id"]) % 2] for row in rows]
    pq = pytest.importorskip("pyarrow.parquet")
    assert pq.read_table(paths[1])["state"].to_pylist() == [row["state"] for row in rows]


# tables ------------------------------------------------------------------------------


def test_a_csv_has_the_columns_that_were_promised(exported):
    head = (exported / "pen.csv").read_text().splitlines()[0]
    promised = "frame,time,id,x,y,z,vx,vy,vz,heading,speed,species,brush,role,reference,group,family,state,pitch,length"
    assert head == promised == ",".join(COLUMNS)


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
    assert table.column_names == [*COLUMNS]
    assert str(table.schema.field("frame").type) == "int32"
    rows = rows_of(exported / "pen.csv")
    for name in ("species", "brush", "role", "group"):
        assert table[name].to_pylist() == [row[name] for row in rows]
    assert np.allclose(table["x"].to_numpy(), [float(row["x"]) for row in rows], atol=1e-6)
    last = table.slice(20 * 24)
    assert last["group"].to_pylist() == [str(number) for number in groups_of(lived.world)]
    assert np.array_equal(np.column_stack([last[n].to_numpy() for n in "xyz"]), lived.agents[Position.xyz])
    about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert (about["schema"], about["unit"], about["seed"]) == ("flockbrush.trajectory/1", "m", "3")


def test_names_with_commas_and_quotes_are_read_back_as_they_were(cli, tmp_path):
    path = pen(tmp_path)
    path.write_text(path.read_text().replace('"sheep"', '"sheep, \\"black\\""'))
    assert cli("run", path, "--ticks", 1, "--export", tmp_path / "a.csv").code == 0
    assert {row["species"] for row in rows_of(tmp_path / "a.csv")} == {'sheep, "black"'}


def test_pictures_may_be_of_space_from_where_one_wishes(cli, recording, tmp_path):
    for name, more in (("north", ()), ("east", ("--azimuth", 0, "--elevation", 50))):
        picture = tmp_path / f"{name}.png"
        assert cli("export", recording, "--to", picture, "--view", "space", *more, "--fps", 2).code == 0
    north, east = (cv2.imread(str(tmp_path / f"{name}.png")) for name in ("north", "east"))
    assert north.shape == east.shape == (720, 1280, 3) and (north != east).any()


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.png", "a.mp4", "a.glb", "a.html"])
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
    done = cli("export", recording, "--to", tmp_path / "a.csv", "--to", tmp_path / "b.csv")
    assert (done.code, done.out) == (0, f"wrote {tmp_path / 'a.csv'}\nwrote {tmp_path / 'b.csv'}\n")
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


def test_rates_that_a_run_does_not_have_name_the_option_that_asked_for_them(cli, level, tmp_path):
    told = cli("run", level, "--ticks", 8, "--export", tmp_path / "a.csv", "--fps", 100)
    assert told.code == 1
    assert "--fps: must be above 0 and at most 32 (ticks per second), got 100" in told.err
    with pytest.raises(ProblemsError, match="^fps: must be above 0"):
        Exports([tmp_path / "a.csv"], start(level), fps=100)


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
    monkeypatch.setattr("flockbrush.output.formats.parquet_table.Parquet._ROWS", 1 << 12)
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

    short = peak(50)
    assert peak(250) < 1.5 * short + 1e6


def test_exports_that_cannot_all_be_opened_leave_nothing(level, tmp_path, monkeypatch):
    class Broken(Exporter):
        def open(self):
            raise OSError(13, "Permission denied", str(self.path))

    assert ".parquet" in exporters()
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".parquet": Broken})
    with pytest.raises(OSError, match="Permission denied"):
        Exports([tmp_path / "a.csv", tmp_path / "a.parquet"], start(level))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("module", "extra"), [("somebodys", False), ("flockbrush.output.formats.mine", True)])
def test_a_missing_package_is_in_an_extra_only_where_the_exporter_is_ours(module, extra, monkeypatch):
    class Mine(Exporter):
        needs = (("no_such_module", "no-such-package"),)

    Mine.__module__ = module
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".mine": Mine})
    with pytest.raises(ProblemsError, match="pip install no-such-package") as caught:
        check_exports(["a.mine"])
    assert ("flockbrush[export]" in str(caught.value)) is extra


def test_paint_bounded_in_height_is_lived_again_and_exported(cli, tmp_path):
    document = Document.load(pen(tmp_path, script=False))
    document.data["layers"].append({"id": 99, "name": "zones", "type": "objectgroup", "objects": []})
    for z_max, brush in ((5.0, "graze"), (-1.0, "swarm")):
        bounds = {"z_min": -2.0, "z_max": z_max}
        document.add_object("zones", "Zone", [(0, 0), (40, 0), (40, 30), (0, 30)], "low", brush=brush, **bounds)
    document.save()
    recording, table = tmp_path / "high.flock", tmp_path / "high.csv"
    assert cli("run", document.path, "--seconds", 0.25, "--record", recording).code == 0
    assert cli("replay", recording).code == 0
    assert cli("export", recording, "--to", table, "--fps", 32).code == 0
    assert {row["brush"] for row in rows_of(table) if row["frame"] != "0"} == {"graze"}
