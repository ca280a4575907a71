"""Tracks from files of other programs and from our own exports, read in one way by every command."""

import json

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError

from flockbrush.cli.main import called
from flockbrush.film.observations import SIGHT_COLUMNS
from flockbrush.film.open_clip import Looking, drawn_tracks, look_at, looked_apart
from flockbrush.film.track_files import is_tracks, read_trajectories
from flockbrush.output.run_table import read_run_table

FPS, FRAMES, ANIMALS = 10.0, 40, 6


def paths_of(seed=0):
    """Animals that go round a middle with 2 m/s, (FRAMES, ANIMALS, 2) m."""
    t = np.arange(FRAMES)[:, None] / FPS
    radius = 3.0 + 0.5 * np.arange(ANIMALS)
    angle = np.arange(ANIMALS) + seed + 2.0 * t / radius
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)


def long_rows(xy, name="id"):
    """Rows frame, id, x, y of what is there."""
    return [(t, f"{name}{n}", *xy[t, n]) for t, n in np.argwhere(np.isfinite(xy[..., 0]))]


def written(path, head, rows):
    path.write_text(head + "\n" + "\n".join(",".join(map(str, row)) for row in rows) + "\n", encoding="utf-8")
    return path


def same(found, xy, **close):
    """Whether places are the same but for where the origin lies."""
    a, b = found.xy - np.nanmean(found.xy, (0, 1)), xy - np.nanmean(xy, (0, 1))
    np.testing.assert_allclose(a, b, **({"atol": 1e-6} | close))


# formats ------------------------------------------------------------------------------------------------


def test_a_table_with_frames_and_seconds_says_its_frame_rate(tmp_path):
    xy = paths_of()
    rows = [(t, t / FPS, who, x, y) for t, who, x, y in long_rows(xy)]
    found = read_trajectories(written(tmp_path / "a.csv", "frame,time,id,x,y", rows), unit="m")
    assert found.fps == pytest.approx(FPS) and found.ids == tuple(f"id{n}" for n in range(ANIMALS))
    same(found, xy)


def test_times_alone_become_frames(tmp_path):
    """trackdf: id, t, x, y."""
    xy = paths_of()
    rows = [(who, t / FPS, x, y) for t, who, x, y in long_rows(xy)]
    found = read_trajectories(written(tmp_path / "a.csv", "id,t,x,y", rows), unit="m")
    assert found.fps == pytest.approx(FPS)
    same(found, xy)


def test_movebank_degrees_become_metres(tmp_path):
    xy, east = paths_of(), np.cos(np.radians(47.0))
    rows = [
        (f"2024-05-01 10:00:{t / FPS:06.3f}", 8.0 + x / 111_319.49079 / east, 47.0 + y / 111_319.49079, who)
        for t, who, x, y in long_rows(xy)
    ]
    head = "timestamp,location-long,location-lat,individual-local-identifier"
    found = read_trajectories(written(tmp_path / "m.csv", head, rows))
    assert found.unit == "m" and found.fps == pytest.approx(FPS)
    same(found, xy, atol=1e-3)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_outliers_of_movebank_are_left_out(ending, tmp_path):
    xy = paths_of()
    rows = [(who, t / FPS, x + 500 * (t == 9), y, "FALSE" if t == 9 else "true") for t, who, x, y in long_rows(xy)]
    path = written(tmp_path / "m.csv", "individual-local-identifier,time,utm-easting,utm-northing,visible", rows)
    if ending == ".parquet":
        table = pytest.importorskip("pyarrow.csv").read_csv(path)  # truth values, not words
        path = path.with_suffix(ending)
        pytest.importorskip("pyarrow.parquet").write_table(table, path)
    found = read_trajectories(path)
    assert any(f"{ANIMALS} rows with visible = false were left out; the first is" in note for note in found.notes)
    xy[9] = np.nan
    same(found, xy)


def test_deeplabcut_takes_the_middle_of_the_parts_that_are_sure(tmp_path):
    xy = paths_of() * 20
    who = [n for n in range(ANIMALS) for _ in range(6)]
    head = [
        ["scorer", *["net"] * len(who)],
        ["individuals", *(f"a{n}" for n in who)],
        ["bodyparts", *["nose", "nose", "nose", "tail", "tail", "tail"] * ANIMALS],
        ["coords", *["x", "y", "likelihood"] * (2 * ANIMALS)],
    ]
    rows = [
        [
            t,
            *(
                v
                for n in range(ANIMALS)
                for v in (xy[t, n, 0] + 2, xy[t, n, 1], 0.9, xy[t, n, 0] - 2, xy[t, n, 1], 0.9)
            ),
        ]
        for t in range(FRAMES)
    ]
    rows[3][4:7] = [9999, 9999, 0.1]  # the tail of a0, a guess
    path = written(tmp_path / "dlc.csv", ",".join(head[0]), [*head[1:], *rows])
    found = read_trajectories(path, unit="px", fps=25)
    assert found.unit == "px" and found.xy.shape == (FRAMES, ANIMALS, 2)
    np.testing.assert_allclose(found.xy[5, 2], xy[5, 2] * (1, -1), atol=1e-9)
    np.testing.assert_allclose(found.xy[3, 0], (xy[3, 0] + (2, 0)) * (1, -1), atol=1e-9)


def test_idtracker_has_a_column_for_each_coordinate(tmp_path):
    xy = paths_of() * 20
    xy[4, 1] = np.nan
    head = "time," + ",".join(f"x{n + 1},y{n + 1}" for n in range(ANIMALS))
    found = read_trajectories(
        written(tmp_path / "i.csv", head, [(t / FPS, *xy[t].ravel()) for t in range(FRAMES)]), unit="px"
    )
    assert found.fps == pytest.approx(FPS) and not found.seen[4, 1]
    same(found, xy * (1, -1))


def test_another_unit_than_that_of_the_file_is_refused(tmp_path):
    path = tmp_path / "herd.csv"
    path.write_text("id,frame,time,x_m,y_m\n" + "".join(f"0,{k},{k / FPS},{k},0\n" for k in range(FRAMES)))
    assert read_trajectories(path, "m").unit == "m"
    with pytest.raises(ProblemsError, match="its columns are in m, --unit says px: leave it out"):
        read_trajectories(path, "px")


def test_spots_of_trackmate_are_read_below_their_four_headers(tmp_path):
    path = tmp_path / "spots.csv"
    head = "LABEL,ID,TRACK_ID,POSITION_X,POSITION_Y,FRAME\nLabel,Spot ID,Track ID,X,Y,Frame\n"
    head += "Label,ID,ID,X,Y,Frame\n,,,(pixel),(pixel),\n"
    rows = "".join(f"s{k},{k},{k % 2},{k}.5,{2 * k},{k // 2}\n" for k in range(2 * FRAMES))
    path.write_text(head + rows)
    found = read_trajectories(path, "px", FPS)
    assert found.xy.shape == (FRAMES, 2, 2) and found.xy[3, 1, 0] == 7.5


@pytest.mark.parametrize(("name", "told"), [("a.slp", "export it there as Analysis HDF5"), ("a.xml", "spots as CSV")])
def test_files_of_other_programs_that_are_not_read_are_told_from_films(name, told, tmp_path):
    (tmp_path / name).write_text("?")
    assert is_tracks(tmp_path / name)
    with pytest.raises(ProblemsError, match=told):
        read_trajectories(tmp_path / name, "px", FPS)


def test_a_folder_of_trex_files_is_one_herd(tmp_path):
    xy = paths_of() * 100
    for n in range(ANIMALS):
        missing = np.zeros(FRAMES)
        missing[7] = n == 2
        np.savez(
            tmp_path / f"film_fish{n}.npz", **{"X#wcentroid": xy[:, n, 0], "Y#wcentroid": xy[:, n, 1]},
            frame=np.arange(FRAMES), missing=missing, frame_rate=np.array([FPS]),
        )  # fmt: skip
    np.savez(tmp_path / "film_posture_fish0.npz", offset=np.zeros((3, 2)), frames=np.arange(3))
    (tmp_path / "film_posture_fish1.csv").write_text("frame,offset\n0,1\n")
    never = np.full(FRAMES, np.inf)
    np.savez(tmp_path / "film_unseen.npz", **{"X#wcentroid": never, "Y#wcentroid": never}, frame=np.arange(FRAMES))
    found = read_trajectories(tmp_path)
    others = "film_posture_fish0.npz, film_posture_fish1.csv, film_unseen.npz"
    assert found.notes == (f"files without places were left out: {others}",)
    assert is_tracks(tmp_path)  # for every command
    assert found.unit == "m" and found.fps == FPS and not found.seen[7, 2]
    expected = paths_of() * (1, -1)
    expected[7, 2] = np.nan
    same(found, expected)


def test_an_array_is_frames_by_animals(tmp_path):
    np.save(tmp_path / "a.npy", paths_of())
    found = read_trajectories(tmp_path / "a.npy", unit="m", fps=FPS)
    assert found.unit == "m" and found.fps == FPS and found.seen.all()
    same(found, paths_of())


def test_sleap_has_animals_first(tmp_path):
    netcdf = pytest.importorskip("netCDF4")
    xy = paths_of() * 20
    with netcdf.Dataset(tmp_path / "s.h5", "w") as data:
        for name, size in (("a", ANIMALS), ("b", 2), ("c", 2), ("d", FRAMES)):
            data.createDimension(name, size)
        tracks = np.stack([xy + (3, 0), xy - (3, 0)])  # parts
        data.createVariable("tracks", "f8", ("a", "b", "c", "d"))[:] = tracks.transpose(2, 3, 0, 1)
    found = read_trajectories(tmp_path / "s.h5", fps=30)
    assert found.unit == "px"
    same(found, xy * (1, -1))


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".nc", ".movebank.csv"])
def test_our_own_exports_are_read_back(tmp_path, ending):
    pytest.importorskip({".parquet": "pyarrow", ".nc": "netCDF4"}.get(ending, "csv"))
    out = tmp_path / f"run{ending}"
    rate = ["--fps", "16"] if ending == ".movebank.csv" else []
    assert (
        called(["run", "meadow", "--seconds", "3", "--agents", "20", "--seed", "1", "--export", str(out), *rate]) == 0
    )
    found = read_trajectories(out)
    from flockbrush.components import Body, Position

    import flockbrush

    simulation = flockbrush.start("meadow", 1, 20)
    simulation.run(96)
    last = simulation.agents[Position.xyz][:, :2]
    assert found.body_length == pytest.approx(np.median(simulation.agents[Body.length]), rel=1e-4)
    if ending == ".movebank.csv":  # degrees have no origin and no heading
        return
    assert found.unit == "m" and found.heading is not None
    assert sorted(map(tuple, np.round(found.xy[-1], 3).tolist())) == sorted(map(tuple, np.round(last, 3).tolist()))


ABOUT = {
    "schema": "flockbrush.trajectory/1", "fps": FPS, "unit": "m", "level": "pen", "width": 40.0, "height": 30.0,
    "boundary": "wall", "flying": [], "body_length": {"sheep": 1.0}, "programs": {},
}  # fmt: skip


def run_table(path, group="1", family="", schema="flockbrush.trajectory/1"):
    """A table of a run as it is exported, of two animals in ten frames, with the metadata beside it."""
    head = "frame,time,id,x,y,z,vx,vy,vz,heading,species,brush,group,family,state"
    rows = [
        (t, t / FPS, n, t / 9, n, 0, 1, 0, 0, 0, "sheep", "march", group, family, "") for t in range(10) for n in (1, 2)
    ]
    path.with_name(f"{path.name}.json").write_text(json.dumps({**ABOUT, "schema": schema}))
    return written(path, head, rows)


def test_groups_of_a_table_that_another_program_wrote_are_whole_numbers(tmp_path):
    """Pandas writes 1.0 where a column has empty cells."""
    table = read_run_table(run_table(tmp_path / "r.csv", "1.0", ""))
    assert set(table.numbers["group"]) == {1} and set(table.numbers["family"]) == {0}
    with pytest.raises(ProblemsError, match=r"r.csv:2: group: must be a whole number, got '1.5'"):
        read_run_table(run_table(tmp_path / "r.csv", "1.5"))


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("version", [2, 10])
def test_a_table_of_a_newer_version_is_refused(version, ending, tmp_path):
    schema = f"flockbrush.trajectory/{version}"
    path = run_table(tmp_path / "r.csv", schema=schema)
    if ending == ".parquet":
        table = pytest.importorskip("pyarrow.csv").read_csv(path).replace_schema_metadata({"schema": schema})
        path = path.with_suffix(ending)
        pytest.importorskip("pyarrow.parquet").write_table(table, path)
    for read in (read_trajectories, read_run_table) if ending == ".csv" else (read_trajectories,):
        with pytest.raises(ProblemsError, match=f"schema '{schema}' is of a newer Flockbrush; this one reads"):
            read(path)


# what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "rows", "words"),
    [
        ("frame,id,x", [(0, 1, 2)], "y: there is no such column"),
        ("frame,id,x,y", [(0, 1, "two", 3)], ":2"),
        ("frame,id,x,y", [(0.5, 1, 2, 3)], "whole number"),
        ("frame,id,x,y", [(0, 1, 2, 3), (0, 1, 2, 3)], "twice"),
        ("frame,id,x,y", [(t, 1, t, t) for t in range(3)], "at least 8"),
        ("frame,id,x,y", [], "no row"),
        ("frame,id,x,y", [(0, 1, 2, 3), (1, 1, "inf", 3)], ":3: x: must be a number below 1e12, got 'inf'"),
        ("frame,id,x,y", [(0, 1, 2, "1e300")], ":2: y: must be a number below 1e12"),
        ("frame,id,x,y", [(0, 1, 2, 3, 4)], ":2: has 5 cells, the header has 4"),
    ],
)
def test_what_is_wrong_with_a_table_is_said(tmp_path, head, rows, words):
    with pytest.raises(ProblemsError) as caught:
        read_trajectories(written(tmp_path / "a.csv", head, rows), "m", 10)
    assert words in str(caught.value)


def test_separators_are_those_of_the_header(tmp_path):
    rows = long_rows(paths_of())
    plain = read_trajectories(written(tmp_path / "a.csv", "frame,id,x,y", rows), "m", 10)
    for mark in ";\t":
        text = (tmp_path / "a.csv").read_text().replace(",", mark)
        (tmp_path / "b.csv").write_text(f"\n{text}")
        assert np.array_equal(read_trajectories(tmp_path / "b.csv", "m", 10).xy, plain.xy, equal_nan=True)


def test_unit_and_frame_rate_are_asked_for(tmp_path):
    path = written(tmp_path / "a.csv", "frame,id,x,y", long_rows(paths_of()))
    for given, words in (({}, "--unit"), ({"unit": "m"}, "--fps")):
        with pytest.raises(ProblemsError, match=words):
            read_trajectories(path, **given)


def test_pickled_arrays_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{"trajectories": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ProblemsError, match="not read for security"):
        read_trajectories(tmp_path / "a.npy", "px", 30)


# what tracks tell ------------------------------------------------------------------------------------------


@pytest.fixture
def circling(tmp_path):
    """Tracks with noise, gaps, an animal that comes late and one that was hardly seen."""
    xy = paths_of() + np.random.default_rng(3).normal(0, 0.01, (FRAMES, ANIMALS, 2))
    xy[10:13, 0] = np.nan
    xy[:15, 1] = np.nan
    xy[6:, 2] = np.nan
    np.save(tmp_path / "c.npy", xy)
    return tmp_path / "c.npy"


HOW = Looking(unit="m", fps=FPS, body_length_m=0.5)


def test_gaps_are_filled_and_late_animals_come_late(circling):
    seen = look_at(circling, HOW).sightings
    there = [seen.of(t).stop - seen.of(t).start for t in range(len(seen))]
    assert there[0] == ANIMALS - 2 and there[11] == ANIMALS - 2 and there[20] == ANIMALS - 1
    assert np.isfinite(seen.xy).all() and np.isfinite(seen.forward).all() and np.isfinite(seen.speed).all()


def test_speed_heading_and_turning_are_those_of_the_animals(circling):
    evidence = look_at(circling, HOW)
    seen = evidence.sightings
    assert np.median(seen.speed) == pytest.approx(2.0 / 0.5, rel=0.03)
    radius = np.hypot(*seen.xy.T)
    ahead = np.column_stack([-seen.xy[:, 1], seen.xy[:, 0]]) / radius[:, None]
    middle = seen.frame[np.isfinite(seen.turn)]
    inner = np.isfinite(seen.turn) & (seen.frame > 3) & (seen.frame < FRAMES - 4)
    assert len(middle) and np.median((seen.forward * ahead).sum(1)) > 0.999
    np.testing.assert_allclose(np.median(seen.turn[inner] * radius[inner]), 4.0, rtol=0.05)
    assert 0.0 < evidence.place_noise < 0.02 / 0.5


def test_another_unit_of_length_changes_nothing(circling, tmp_path):
    np.save(tmp_path / "px.npy", np.load(circling) * (100.0, -100.0))
    one = look_at(circling, HOW)
    other = look_at(tmp_path / "px.npy", Looking(unit="px", fps=FPS, body_length_px=50.0))
    np.testing.assert_allclose(one.sightings.xy, other.sightings.xy, atol=1e-6)
    assert one.speed.mean == pytest.approx(other.speed.mean)


def test_held_out_frames_of_tracks_change_nothing_of_what_is_learned_from(circling, tmp_path):
    xy = np.load(circling)
    xy[FRAMES // 2 :] = xy[: FRAMES // 2 - 1 : -1]
    np.save(tmp_path / "other.npy", xy)
    parts = [looked_apart(path, HOW, look_at(path, HOW), 0.5)[0] for path in (circling, tmp_path / "other.npy")]
    (one, held), (other, replaced) = parts
    assert not np.array_equal(held.sightings.xy, replaced.sightings.xy)
    for name in SIGHT_COLUMNS:
        assert np.array_equal(getattr(one.sightings, name), getattr(other.sightings, name), equal_nan=True), name


def test_frames_are_drawn(circling):
    evidence = look_at(circling, HOW)
    image = drawn_tracks(evidence, 20)
    assert image.shape == evidence.picture.shape and (image != evidence.picture).any()


def test_two_recordings_in_one_file_are_noticed(tmp_path):
    xy = paths_of()
    xy[20:] += 50
    np.save(tmp_path / "two.npy", xy)
    assert any("jumps between frames 19 and 20" in note for note in look_at(tmp_path / "two.npy", HOW).notes)


# commands -----------------------------------------------------------------------------------------------


def test_measure_measures_tracks(circling, tmp_path, capsys):
    options = ["--unit", "m", "--fps", "10", "--body-length-m", "0.5"]
    plot = tmp_path / "p.png"
    assert called(["measure", str(circling), *options, "--every", "1", "--json", "--plot", str(plot)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["unit"] == "m" and told["mean"]["milling"] > 0.9
    assert told["mean"]["speed_mean"] == pytest.approx(2.0, rel=0.05) and plot.stat().st_size > 0


def test_play_shows_animals_on_the_ground(circling, capsys, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert called(["play", str(circling), "--unit", "m", "--fps", "10", "--frames", "2", "--size", "640x480"]) == 0
    assert called(["play", str(circling), "--frames", "2"]) == 1
    assert "--unit" in capsys.readouterr().err


def test_animals_on_the_ground_have_no_wings_and_stand_on_it(circling):
    from flockbrush.lifting.ground_show import open_show

    show = open_show(circling, None, HOW)
    herd = show.herd(20)
    assert herd.wings is None and show.floor == 0.0 and herd.length == 0.5
    assert "animals" in show.facts(20)[0]


def named(path, head="frame,time,id,x,y"):
    """Three animals in every tenth frame from 100, 10 s; the first leaps in the middle."""
    xy = paths_of()[:, :3] + np.where(np.arange(FRAMES)[:, None, None] < 20, 0.0, [[[90.0, 0], [0, 0], [0, 0]]])
    called_so = list(enumerate(("Ada", "Bob", "7")))
    rows = [(100 + 10 * t, 10 + t, name, *xy[t, n]) for t in range(FRAMES) for n, name in called_so]
    return written(path, head, rows)


def test_animals_that_are_shown_keep_names_frames_and_times(tmp_path, capsys):
    from flockbrush.lifting.flight_table import read_flight
    from flockbrush.lifting.ground_show import open_show

    show = open_show(named(tmp_path / "a.csv"), None, Looking(unit="m", body_length_m=0.5))
    assert any("leap 1 times" in note for note in show.evidence.notes)
    assert show.flight.names == ("7", "Ada", "Bob") and show.facts(5)[0].startswith("3 animals at")
    assert show.about(30, show.flight.ids[1]).startswith("animal Ada:")
    show.export(tmp_path / "b.csv")
    head, *rows = [line.split(",") for line in (tmp_path / "b.csv").read_text().splitlines()]
    assert "bank" not in head and {row[head.index("species")] for row in rows} == {"animal"}
    assert rows[0][:3] == ["100", "10.000000", "7"] and rows[-1][:3] == ["490", "49.000000", "Bob"]
    again = open_show(tmp_path / "b.csv")
    assert type(again) is type(show) and again.flight.names == show.flight.names
    np.testing.assert_allclose(again.flight.frames, show.flight.frames)
    assert again.flight.start == pytest.approx(10.0) and read_flight(tmp_path / "b.csv").names == ("7", "Ada", "Bob")


def test_animals_in_body_lengths_are_not_said_to_be_in_metres(tmp_path):
    from flockbrush.lifting.ground_show import open_show

    show = open_show(named(tmp_path / "a.csv"), None, Looking(unit="px", body_length_px=0.5))
    assert " BL/s" in show.facts(5)[0] and "BL from the origin" in show.facts(5)[2] and "BL, " in show.about(5, 0)
    with pytest.raises(ProblemsError, match=r"is shown in body lengths, and flights are written in metres"):
        show.export(tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()


def test_shown_animals_are_no_birds_in_other_formats(circling, tmp_path):
    from flockbrush.lifting.ground_show import open_show

    parquet = pytest.importorskip("pyarrow.parquet")
    open_show(circling, None, HOW).export(tmp_path / "b.parquet")
    assert set(parquet.read_table(tmp_path / "b.parquet").to_pydict()["species"]) == {"animal"}
    assert read_run_table(tmp_path / "b.parquet").about.flying == []


def test_reenact_takes_tracks(circling, tmp_path, capsys):
    out = tmp_path / "again.csv"
    command = ["reenact", str(circling), "--brush", "swarm", "--unit", "m", "--fps", "10", "--body-length-m", "0.5"]
    assert called([*command, "--runs", "1", "--export", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["figures"]["reenacted horizon, s"] == pytest.approx((FRAMES - 1) / FPS)
    head, first = out.read_text().splitlines()[:2]
    assert head.endswith("x_m,y_m")
    cells = dict(zip(head.split(","), map(float, first.split(",")), strict=True))
    assert cells["x_m"] == pytest.approx(0.5 * cells["x_bl"], rel=1e-3)
    assert called(["measure", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["unit"], told["fps"]) == ("body lengths", pytest.approx(FPS))


def test_options_of_films_are_refused_for_tracks(circling, tmp_path, capsys):
    command = ["learn", str(circling), "-o", str(tmp_path / "a.brush.toml"), "--unit", "m", "--fps", "10"]
    assert called([*command, "--obstacles", str(tmp_path / "no.png")]) == 1
    assert "--obstacles can only be used with videos and pictures" in capsys.readouterr().err
    command = ["fields", str(circling), "-o", str(tmp_path / "a.npz"), "--unit", "m", "--fps", "10"]
    for option, value in (("--preview", str(tmp_path / "m.mp4")), ("--body-colour", "10,20,30")):
        assert called([*command, option, value]) == 1
        assert f"{option} can only be used with videos and pictures" in capsys.readouterr().err
    assert called([*command, "--body-length-px", "9"]) == 1
    assert "is in m: give the body length with --body-length-m" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.npz"))


def test_fields_tells_the_unit_of_the_body_length(circling, tmp_path, capsys):
    command = ["fields", str(circling), "-o", str(tmp_path / "a.npz"), "--fps", "10"]
    assert called([*command, "--unit", "m", "--body-length-m", "1.2"]) == 0
    assert "1.2 m (given)" in capsys.readouterr().out
    assert called([*command, "--unit", "m", "--body-length-m", "1.2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["body_length_m"] == 1.2 and "body_length_px" not in told


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_the_lengths_that_an_export_states_are_taken(tmp_path, ending):
    """The median, unless a length is given; a column of that name in other tables may be anything."""
    head = "frame,time,id,x,y,vx,vy,vz,speed,species,role,reference,length"
    rows = [(t, t / FPS, who, x, y, 0, 0, 0, 2, "sheep", "follower", 0, 0.5 + 0.1 * int(who[2:]))
            for t, who, x, y in long_rows(paths_of())]  # fmt: skip
    path = written(tmp_path / "a.csv", head, rows)
    if ending == "parquet":
        csv = pytest.importorskip("pyarrow.csv").read_csv(path)
        path = tmp_path / "a.parquet"
        pytest.importorskip("pyarrow.parquet").write_table(csv, path)
    seen, given = look_at(path, Looking(usual_length_m=3.0)), look_at(path, Looking(body_length_m=2.0))
    assert seen.body_length_px == pytest.approx(0.75) and seen.length_told == "0.75 m (stated in the file)"
    assert "one body length is 0.75 m, the median of those that the file states (set --body-length-m)" in seen.notes
    assert given.length_told == "2 m (given)"
    other = written(tmp_path / "b.csv", "frame,id,x,y,length", [(*row, 7) for row in long_rows(paths_of())])
    found = look_at(other, Looking(unit="m", fps=FPS, usual_length_m=3.0))
    assert found.length_told == "3 m (assumed)"
    assert "one body length is assumed to be 3 m (set --body-length-m)" in found.notes
