"""Tables for other people's tools, opened by their own loaders where those are installed."""

import csv
import sqlite3

import numpy as np
import pytest
from flockbrush.components import Body, Position
from flockbrush.engine.commands import Commands
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.obstacle_commands import AddObstacle, MoveObstacle

import flockbrush
from flockbrush.output.export import Exports
from flockbrush.runs.run import start
from tests.flockbrush.pens import pen


@pytest.fixture(scope="module")
def lived(level):
    simulation = start(level)
    simulation.run(40)
    return simulation


def test_a_database_holds_positions_headings_and_names(cli, recording, tmp_path, lived):
    pytest.importorskip("shapely")
    done = cli("export", recording, "--to", tmp_path / "a.sqlite", "--fps", 16)
    assert done.code == 0, done.err
    base = sqlite3.connect(tmp_path / "a.sqlite")
    rows = base.execute("SELECT id, pos_x, pos_y, pos_z FROM trajectory_data WHERE frame = 20 ORDER BY id").fetchall()
    assert [row[0] for row in rows] == lived.agents.ids.tolist()
    assert np.array_equal([row[1:] for row in rows], lived.agents[Position.xyz])
    ahead = np.array(base.execute("SELECT ori_x, ori_y FROM trajectory_data").fetchall())
    np.testing.assert_allclose(np.hypot(*ahead.T), 1.0, atol=1e-12)
    names = "SELECT DISTINCT name FROM trajectory_data JOIN names USING (names) WHERE frame = 20 AND kind = 'brush'"
    assert base.execute(names).fetchall() == [("swarm",)]
    lengths = lived.agents[Body.length].tolist()
    assert [length for (length,) in base.execute("SELECT length FROM bodies ORDER BY id")] == lengths
    base.close()


def test_pedpy_opens_the_database(cli, recording, tmp_path, lived):
    pedpy = pytest.importorskip("pedpy")
    assert cli("export", recording, "--to", tmp_path / "a.sqlite", "--fps", 16).code == 0
    tracks = pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=tmp_path / "a.sqlite")
    area = pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=tmp_path / "a.sqlite")
    assert tracks.frame_rate == 16
    last = tracks.data[tracks.data.frame == 20].sort_values("id")
    assert np.array_equal(last[["x", "y"]].to_numpy(), lived.agents[Position.xyz][:, :2])
    assert area.area == pytest.approx(40 * 30 - 4 * 4)  # the pen without its stone


def test_the_walkable_area_of_a_frame_is_without_the_obstacles_of_then(level, tmp_path):
    shapely = pytest.importorskip("shapely")
    simulation = start(level)
    (stone,) = [b.name for b in simulation.world.resource(Landscape).obstacles]
    box = [[5.0, 5.0], [7.0, 5.0], [7.0, 7.0], [5.0, 7.0]]
    commands = simulation.world.resource(Commands)
    commands.submit(AddObstacle("new", box), 2)
    commands.submit(MoveObstacle(stone, 30.0, 20.0), 3)
    with Exports([tmp_path / "a.sqlite"], simulation, 32) as exports:
        exports.take()
        for _ in range(5):
            simulation.tick()
            exports.take()
    base = sqlite3.connect(tmp_path / "a.sqlite")
    query = "SELECT geometry_hash, wkt FROM frame_data JOIN geometry ON hash = geometry_hash ORDER BY frame"
    hashes, texts = zip(*base.execute(query).fetchall(), strict=True)
    base.close()
    assert hashes == (1, 1, 1, 2, 3, 3)
    areas = [shapely.from_wkt(text) for text in texts]
    whole = 40 * 30 - 4 * 4
    assert [area.area for area in areas[::2]] == pytest.approx([whole, whole, whole - 4])
    assert not areas[-1].contains(shapely.Point(30, 20)) and areas[0].contains(shapely.Point(30, 20))


def test_an_obstacle_on_the_border_of_a_periodic_map_takes_ground_at_both(tmp_path):
    shapely = pytest.importorskip("shapely")
    simulation = start(pen(tmp_path, sheep=1, script=False, boundary="wrap"))
    simulation.submit(MoveObstacle("stone", 0.0, 15.0))
    simulation.tick()
    with Exports([tmp_path / "a.sqlite"], simulation, 32) as exports:
        exports.take()
    base = sqlite3.connect(tmp_path / "a.sqlite")
    ((text,),) = base.execute("SELECT wkt FROM geometry").fetchall()
    base.close()
    assert shapely.from_wkt(text).area == pytest.approx(40 * 30 - 4 * 4)
    simulation.close()


def test_netcdf_has_movements_layout(cli, recording, tmp_path, lived):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("netCDF4")
    done = cli("export", recording, "--to", tmp_path / "a.nc", "--fps", 16)
    assert done.code == 0, done.err
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.position.dims == ("time", "space", "keypoints", "individuals")
        assert (data.attrs["ds_type"], data.attrs["fps"], data.attrs["time_unit"]) == ("poses", 16, "seconds")
        assert data.space.values.tolist() == ["x", "y", "z"]
        last = data.position.sel(time=1.25, keypoints="centroid")
        assert np.array_equal(last.values.T, lived.agents[Position.xyz])
        assert data.individuals.values.tolist() == [f"animal_{k}" for k in lived.agents.ids]


def test_movement_takes_the_netcdf(cli, recording, tmp_path):
    datasets = pytest.importorskip("movement.validators.datasets", exc_type=ImportError)
    import xarray

    assert cli("export", recording, "--to", tmp_path / "a.nc", "--fps", 16).code == 0
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        datasets.ValidPosesInputs.validate(data)


def test_movebank_rows_lie_where_the_origin_says(cli, recording, tmp_path, lived):
    out = tmp_path / "a.movebank.csv"
    done = cli("export", recording, "--to", out, "--fps", 16, "--origin", "47.5,8.25")
    assert done.code == 0, done.err
    with open(out, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 21 * 24
    last = [row for row in rows if row["timestamp"] == "2000-01-01 00:00:01.250"]
    north = [(float(row["location-lat"]) - 47.5) * 111_319.49 for row in last]
    assert np.allclose(north, lived.agents[Position.xyz][:, 1], atol=0.01)
    assert {row["individual-taxon-canonical-name"] for row in rows} == {"sheep"}
    assert list(tmp_path.iterdir()) == [out]  # and not the other CSV's metadata


def test_an_origin_that_is_no_place_is_refused(cli, recording, tmp_path):
    for text in ("north", "95,0", "1,2,3"):
        done = cli("export", recording, "--to", tmp_path / "a.movebank.csv", "--origin", text)
        assert done.code == 1 and "--origin" in done.err


def test_a_recording_is_a_dataframe_and_a_dataset(recording, lived):
    pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    run = flockbrush.open_recording(recording)
    table = run.to_dataframe(fps=16)
    assert np.array_equal(table[table.frame == 20][["x", "y", "z"]].to_numpy(), lived.agents[Position.xyz])
    pytest.importorskip("xarray")
    pytest.importorskip("netCDF4")
    assert run.to_xarray(fps=4).position.shape == (6, 3, 1, 24)
    for made in (run.to_dataframe, run.to_xarray):
        with pytest.raises(flockbrush.ProblemsError, match="^fps: must be above 0 and at most 32"):
            made(fps=100)
