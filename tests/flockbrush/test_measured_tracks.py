"""Measures of tracks and of tables of runs: what they must not depend on, and the runs that they agree with."""

import json

import numpy as np
import pytest
from flockbrush.levels.sketch import LevelSketch

from flockbrush.cli.measure import as_series
from flockbrush.cli.measure_tracks import frames_every
from flockbrush.film.track_files import read_trajectories


def table(path, xy, fps=10.0, start=0.0, heading=None):
    """Tracks (T, N, 2) m as a CSV."""
    lines = ["time,id,x,y" + (",heading" if heading is not None else "")]
    for t, row in enumerate(xy):
        for k, (x, y) in enumerate(row):
            more = "" if heading is None else f",{heading:.6f}"
            lines.append(f"{start + t / fps:.3f},{k + 1},{x:.6f},{y:.6f}{more}")
    path.write_text("\n".join(lines) + "\n")
    return path


def measured(cli, path, *words):
    done = cli("measure", path, "--unit", "m", "--body-length-m", 1, "--json", *words)
    assert done.code == 0, done.err
    return json.loads(done.out), done.err


def walkers(angle, resting=15):
    """100 frames of thirty animals, of which some never move and the others walk one way at 1.8 m/s."""
    rng = np.random.default_rng(3)
    places = rng.uniform(0, 20, (30, 2))
    way = np.arange(100)[:, None, None] * 0.18 * np.array([np.cos(angle), np.sin(angle)])
    return places + way * (np.arange(30) >= resting)[None, :, None]


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, np.pi, 4.0])
def test_animals_that_never_move_have_no_heading(cli, tmp_path, angle):
    found, _ = measured(cli, table(tmp_path / "a.csv", walkers(angle)))
    assert found["mean"]["polarization"] == pytest.approx(1.0, abs=1e-3)
    assert found["mean"]["animals"] == 30
    assert found["mean"]["speed_mean"] == pytest.approx(0.9, rel=1e-3)
    assert any("15 tracks are never faster: they have no heading" in note for note in found["notes"])


@pytest.mark.parametrize("aside", [0.0, 0.35, 1.4])
def test_speeds_do_not_depend_on_headings(cli, tmp_path, aside):
    found, _ = measured(cli, table(tmp_path / "a.csv", walkers(0.7, 0), heading=0.7 + aside))
    assert found["mean"]["speed_mean"] == pytest.approx(1.8, rel=1e-3)


def test_times_are_those_of_the_file(cli, tmp_path):
    path = table(tmp_path / "a.csv", walkers(0.7, 0), start=100.0)
    found, _ = measured(cli, path)
    assert found["series"]["time"][0] == pytest.approx(100.0)
    assert found["series"]["time"][-1] == pytest.approx(109.9)
    assert read_trajectories(path, "m").part(50, 89).start == pytest.approx(105.0)


def test_times_of_a_column_for_each_coordinate_are_those_of_the_file(tmp_path):
    rows = [f"{100 + t / 10},{t * 0.1},{1.0},{t * 0.1},{2.0}" for t in range(40)]
    path = tmp_path / "wide.csv"
    path.write_text("\n".join(["time,x1,y1,x2,y2", *rows]) + "\n")
    assert read_trajectories(path, "m").start == pytest.approx(100.0)


def test_times_of_netcdf_are_those_of_the_file(tmp_path):
    netcdf = pytest.importorskip("netCDF4")
    path = tmp_path / "a.nc"
    with netcdf.Dataset(path, "w") as data:
        for name, size in (("time", 40), ("space", 2), ("individuals", 2)):
            data.createDimension(name, size)
        data.time_unit = "seconds"
        data.createVariable("time", "f8", ("time",))[:] = 100.0 + np.arange(40) / 10
        data.createVariable("position", "f8", ("time", "space", "individuals"))[:] = np.arange(160).reshape(40, 2, 2)
    found = read_trajectories(path, "m")
    assert found.start == pytest.approx(100.0) and found.fps == pytest.approx(10.0)


def heights_told(path):
    return [note for note in read_trajectories(path, "m", 10).notes if note.startswith("heights, from ")]


@pytest.mark.parametrize(("column", "fixed"), [("z", "id,x,y"), ("height-above-msl", "id,utm-easting,utm-northing")])
def test_heights_of_a_table_are_told_where_they_vary(tmp_path, column, fixed):
    def write(heights):
        rows = (f"{t},{who},{t},{3 * who},{z}" for t, z in enumerate(heights) for who in (1, 2))
        path = tmp_path / "a.csv"
        path.write_text("\n".join([f"frame,{fixed},{column}", *rows]) + "\n")
        return path

    (note,) = heights_told(write([40, "", *range(50, 60)]))
    assert note.startswith("heights, from 40 to 59, are left out: distances and speeds are those in plan")
    assert (
        not heights_told(write([7] * 12)) and not heights_told(write([""] * 12)) and not heights_told(write("?" * 12))
    )


@pytest.mark.parametrize("keypoints", [False, True])
def test_heights_of_netcdf_are_told_where_they_vary(tmp_path, keypoints):
    netcdf = pytest.importorskip("netCDF4")
    names = "time", "space", *["keypoints"] * keypoints, "individuals"
    places = np.arange(12.0)[:, None, None] + np.array([[0.0], [0.0], [20.0]]) + np.array([0.0, 5.0])
    for path, heights in ((tmp_path / "a.nc", places[:, 2]), (tmp_path / "b.nc", 7.0)):
        places[:, 2] = heights
        with netcdf.Dataset(path, "w") as data:
            for name, size in {"time": 12, "space": 3, "keypoints": 1, "individuals": 2}.items():
                data.createDimension(name, size)
            position = data.createVariable("position", "f8", names)
            position[:] = places[:, :, None] if keypoints else places
    (note,) = heights_told(tmp_path / "a.nc")
    assert note.startswith("heights, from 20 to 36, are left out") and not heights_told(tmp_path / "b.nc")
    assert read_trajectories(tmp_path / "a.nc", "m", 10).xy[-1].tolist() == [[11, 11], [16, 16]]


def test_units_are_those_of_the_file(cli, tmp_path):
    path = table(tmp_path / "a.csv", 10 * walkers(0.7, 0))
    told = cli("measure", path, "--unit", "px", "--body-length-px", 10).out
    assert "mean speed, BL/s" in told and "1/BL²" in told and "m/s" not in told


def test_a_table_has_the_frames_in_which_nobody_is_there(cli, tmp_path):
    """Everybody leaves the map long before the run ends."""
    sketch = LevelSketch(24, 12, 1.0, ".", boundary="despawn")
    sketch.document.data["tilesets"] = []
    sketch.box("Spawn", 18, 6, 4, 6, "herd", species="sheep", brush="march", count=6, heading="east")
    level = sketch.save(tmp_path / "out.tmj")
    run, csv = tmp_path / "out.flock", tmp_path / "out.csv"
    assert cli("run", level, "--seconds", 9, "--record", run, "--export", csv).code == 0
    by_run, by_table = (json.loads(cli("measure", path, "--json").out) for path in (run, csv))
    assert by_run["measures"]["animals"] == 0
    for name in ("time", "animals", "polarization", "speed_mean"):
        there = np.array(by_table["series"][name], float)
        assert there == pytest.approx(np.array(by_run["series"][name], float), abs=1e-4, nan_ok=True)


@pytest.fixture(scope="module")
def walked(command, tmp_path_factory):
    """The lines of the table of a run, and the metadata beside it."""
    csv = tmp_path_factory.mktemp("walked") / "w.csv"
    command("run", "meadow", "--agents", 12, "--seconds", 3, "--export", csv)
    return csv.read_text().splitlines(), csv.with_name("w.csv.json").read_text()


def test_an_animal_that_is_twice_in_a_frame_is_told_with_both_lines(cli, walked, tmp_path):
    lines, about = walked
    (tmp_path / "t.csv").write_text("\n".join([*lines, lines[1]]))
    (tmp_path / "t.csv.json").write_text(about)
    done = cli("measure", tmp_path / "t.csv")
    assert done.code == 1 and f"t.csv:{len(lines) + 1}: animal 1 is in frame 0 twice, here and in line 2" in done.err


def test_metadata_that_contradict_the_times_of_their_table_are_refused(cli, walked, tmp_path):
    lines, about = walked
    rows = [line.split(",", 1) for line in lines[1:]]
    fewer = [f"{int(frame) // 4},{rest}" for frame, rest in rows if int(frame) % 4 == 0]
    (tmp_path / "t.csv").write_text("\n".join([lines[0], *fewer]))
    (tmp_path / "t.csv.json").write_text(about)
    for more in ([], ["--unit", "m"]):
        done = cli("measure", tmp_path / "t.csv", *more)
        assert done.code == 1 and "8 frames per second, t.csv.json beside it says 32: correct or remove" in done.err
    (tmp_path / "t.csv.json").unlink()
    told = json.loads(cli("measure", tmp_path / "t.csv", "--unit", "m", "--json").out)
    assert told["fps"] == pytest.approx(8)


def test_frames_without_rows_are_told(cli, walked, tmp_path):
    lines, about = walked
    kept = [line for line in lines[1:] if int(line.split(",")[0]) < 40]
    (tmp_path / "t.csv").write_text("\n".join([lines[0], *kept]))
    (tmp_path / "t.csv.json").write_text(about)
    assert "57 of 97 frames have no animals" in cli("measure", tmp_path / "t.csv").err


def test_a_table_of_a_wrapped_level_says_so_where_it_is_read_as_tracks(cli, tmp_path):
    sketch = LevelSketch(24, 12, 1.0, ".", boundary="wrap")
    sketch.document.data["tilesets"] = []
    sketch.box("Spawn", 8, 3, 6, 6, "herd", species="sheep", brush="march", count=6, heading="east")
    csv = tmp_path / "w.csv"
    assert cli("run", sketch.save(tmp_path / "w.tmj"), "--seconds", 1, "--export", csv).code == 0
    assert "is wrapped" in cli("measure", csv, "--unit", "m").err
    assert "is wrapped" not in cli("measure", csv).err


def test_a_table_tells_how_birds_climb(cli, tmp_path):
    run, csv = tmp_path / "lake.flock", tmp_path / "lake.csv"
    assert cli("run", "lake", "--seconds", 6, "--agents", 40, "--record", run, "--export", csv).code == 0
    by_run, by_table = (json.loads(cli("measure", path, "--json").out)["series"] for path in (run, csv))
    assert by_table["polarization"] == pytest.approx(by_run["polarization"], abs=1e-4)
    assert by_table["aspect_ratio"] == pytest.approx(by_run["aspect_ratio"], abs=1e-3)


@pytest.mark.parametrize(
    ("last", "every", "fps", "frames"),
    [(8, 1.0, 2.5, [0, 2, 5, 8]), (96, 1.0, 32.0, [0, 32, 64, 96]), (3, 0.01, 10.0, [0, 1, 2, 3]), (0, 1.0, 10.0, [0])],
)
def test_moments_are_the_frames_nearest_to_the_times_asked_for(last, every, fps, frames):
    assert frames_every(last, every, fps) == frames


def test_a_measure_that_comes_later_stays_beside_its_times():
    series = as_series([{"time": 0.0, "a": 1.0}, {"time": 1.0, "a": 2.0, "b": 3.0}])
    assert series["time"] == [0.0, 1.0] and series["a"] == [1.0, 2.0]
    assert np.isnan(series["b"][0]) and series["b"][1] == 3.0


def test_a_recording_has_no_use_for_options_of_tracks(cli, tmp_path):
    (tmp_path / "walk.flock").write_bytes(b"")
    for option, value in (("--unit", "bl"), ("--fps", "10"), ("--body-length-m", "1")):
        done = cli("measure", tmp_path / "walk.flock", option, value)
        assert done.code == 2 and f"{option}: does not apply to a recording" in done.err
