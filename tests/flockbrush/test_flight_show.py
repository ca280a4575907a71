"""A flight that is shown: read or lifted, solved anew, exported, made into a formation brush."""

import csv
import json
import time

import numpy as np
import pytest
from flockbrush.behaviours.brush import load_brush
from flockbrush.engine.problems import ProblemsError

from flockbrush.cli.main import called
from flockbrush.film.looking import Looking
from flockbrush.film.track_files import read_trajectories
from flockbrush.lifting.flight_show import Show, Solver, Wanted, with_wish
from flockbrush.lifting.flight_table import read_flight
from flockbrush.lifting.ground_show import open_show
from flockbrush.lifting.lift_solver import LiftWish
from flockbrush.output.run_table import read_run_table
from tests.flock_in_v import CAMERA, SPAN, geese, seen, written


@pytest.fixture(scope="module")
def lifted():
    return Show.lifted(seen(geese()), CAMERA, "geese.csv", SPAN)


@pytest.fixture
def show(lifted):
    """A show that a test may change."""
    return Show(lifted.flight, lifted.name, CAMERA, lifted.tracks, lifted.sight, lifted.wanted, SPAN)


def test_a_flight_that_was_written_is_read_as_it_was(tmp_path, show):
    show.export(tmp_path / "flock.csv")
    again = read_flight(tmp_path / "flock.csv")
    assert again.xyz == pytest.approx(show.flight.xyz, abs=1e-5)
    assert again.fps == pytest.approx(25) and again.ids.tolist() == show.flight.ids.tolist()


def test_a_flight_has_its_units_beside_it_where_an_earlier_table_had_others(tmp_path, show):
    (tmp_path / "flock.csv.json").write_text('{"schema": "flockbrush.trajectory/1", "fps": 4, "unit": "bl"}')
    show.export(tmp_path / "flock.csv")
    about = json.loads((tmp_path / "flock.csv.json").read_text())
    assert (about["schema"], about["unit"], about["level"]) == ("flockbrush.trajectory/1", "m", "geese.csv")
    tracks = read_trajectories(tmp_path / "flock.csv")
    assert (tracks.unit, tracks.fps, about["fps"]) == ("m", 25.0, 25.0)
    assert type(open_show(tmp_path / "flock.csv")) is Show
    one = show.flight
    Show(type(one)(one.xyz, one.depth, one.ids, 10 * one.frames, 25.0), "every tenth").export(tmp_path / "t.csv")
    assert json.loads((tmp_path / "t.csv.json").read_text())["fps"] == pytest.approx(250.0)
    assert read_trajectories(tmp_path / "t.csv").fps == pytest.approx(25.0)  # of frames that there are


def test_a_trajectory_of_a_level_can_be_shown(tmp_path):
    assert called(["run", "geese", "--seconds", "1", "--export", str(tmp_path / "geese.csv")]) == 0
    show = Show.open(tmp_path / "geese.csv")
    assert len(show) == 33 and show.flight.fps == pytest.approx(32)
    assert len(show.herd(3).xy) == 21


def test_birds_that_come_late_are_drawn_while_they_are_there(tmp_path):
    rows = ["frame,id,x,y,z"] + [f"{f},{n},{f},{n},5" for f in range(6) for n in (1, 2) if n == 1 or f > 2]
    (tmp_path / "f.csv").write_text("\n".join(rows))
    show = Show.open(tmp_path / "f.csv")
    assert [len(show.herd(k).xy) for k in range(6)] == [1, 1, 1, 2, 2, 2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frame,id,x,y\n1,1,2,3\n", "--camera"),
        ("frame,id,x,y,z\n1,1,2,3,4\n", "only one frame"),
        ("frame,id,x,y,z\n1,1,2,3,4\n2,1,2,up,4\n", "f.csv:3: y: must be a finite number, at most 1e+12, got 'up'"),
        ("frame,time,id,x,y,z\n1,0,1,2,3,4\n2,0,1,2,3,4\n", "time does not increase"),
        ("frame,id,x,y,z\n", "no bird"),
        ("", "f.csv: is empty"),
    ],
)
def test_what_is_no_flight_is_refused_in_words(tmp_path, text, said):
    (tmp_path / "f.csv").write_text(text)
    with pytest.raises(ProblemsError) as told:
        Show.open(tmp_path / "f.csv")
    assert said in str(told.value)


# solving anew ------------------------------------------------------------------------


def until_idle(solver):
    """Whether the flight has changed until nothing is solved any more."""
    changed = False
    while solver.busy:
        time.sleep(0.005)
        changed |= solver.look()
    return changed


def test_only_the_latest_wish_counts(show):
    solver = Solver(show)
    for flock in (0.1, 5.0, 0.5, 2.0):
        solver.ask(with_wish(show.wanted, flock=flock), glance=flock < 1)
    assert solver.busy
    assert until_idle(solver) and solver.has(with_wish(Wanted(), flock=2.0))
    assert show.wanted.wish.flock == 2.0
    assert show.flight.depth == pytest.approx(show.solved(Wanted(LiftWish(flock=2.0))).depth)


def test_a_solve_that_fails_leaves_the_flight_as_it_is(show):
    solver, before = Solver(show), show.flight
    show.sight = None
    solver.ask(with_wish(show.wanted, flock=2.0))
    with pytest.raises(ProblemsError, match="cannot be lifted again"):
        until_idle(solver)
    assert show.flight is before and not solver.busy and not solver.has(with_wish(show.wanted, flock=2.0))


def test_a_flight_without_tracks_is_not_solved(tmp_path, show):
    show.export(tmp_path / "flock.csv")
    with pytest.raises(ProblemsError, match="cannot be lifted again"):
        Show.open(tmp_path / "flock.csv").solved(Wanted())


def test_the_thesis_method_keeps_the_bounds_of_the_camera():
    pytest.importorskip("nlopt")
    camera = CAMERA.model_copy(update={"near": 40.0, "far": 90.0})
    some = Show.lifted(seen(geese(3, 8)), camera, "geese.csv")
    flight = some.solved(Wanted(method="cobyla"))
    assert flight.depth.min() >= 40.0 and flight.depth.max() <= 90.0


# what is to be seen --------------------------------------------------------------------


def test_birds_lie_in_the_picture_where_they_were_seen(show):
    corners, spots = show.frustum(20)
    px = CAMERA.project(spots)
    assert px == pytest.approx(show.sight.px[20], abs=1e-6)
    assert CAMERA.project(corners) == pytest.approx(np.array([(0, 0), (1280, 0), (1280, 720), (0, 720)]), abs=1e-6)


def test_a_bird_that_turns_right_banks_to_the_right():
    from flockbrush.lifting.lift_solver import LiftedFlight

    angle = -np.arange(60)[:, None] / 30 * 0.5
    xyz = np.stack([20 * np.cos(angle), 20 * np.sin(angle), 0 * angle], -1)
    show = Show(LiftedFlight(xyz, np.linalg.norm(xyz, axis=-1), np.array([7]), np.arange(60), 30.0), "turn.csv")
    assert show.about(30, 7).endswith("right")
    assert show.about(30, 8) == ""


# keeping ---------------------------------------------------------------------------------


def test_a_flight_becomes_a_parquet_table_with_every_bird_of_every_frame(tmp_path, show):
    parquet = pytest.importorskip("pyarrow.parquet")
    show.export(tmp_path / "flock.parquet")
    table = parquet.read_table(tmp_path / "flock.parquet").to_pydict()
    assert len(table["x"]) == 60 * 11 and set(table["species"]) == {"bird"}
    assert np.array(table["x"]).reshape(60, 11) == pytest.approx(show.flight.xyz[..., 0])
    show.export(tmp_path / "flock.csv")
    rows = list(csv.DictReader((tmp_path / "flock.csv").read_text().splitlines()))
    assert list(table) == list(rows[0]) and np.abs(table["bank"]).max() > 0.01
    for name in ("bank", "pitch", "heading", "reference"):
        assert table[name] == pytest.approx([float(row[name]) for row in rows], abs=1e-6)
    assert set(table["reference"]) == {0}
    run = read_run_table(tmp_path / "flock.parquet")
    assert len(run) == 60 and run.about.flying == [""]


def test_a_flight_becomes_a_scene(tmp_path, show):
    pxr = pytest.importorskip("pxr")
    show.export(tmp_path / "flock.usdc")
    stage = pxr.Usd.Stage.Open(str(tmp_path / "flock.usdc")) if hasattr(pxr, "Usd") else None
    if stage is not None:
        assert stage.GetEndTimeCode() == 59
    assert (tmp_path / "flock.usdc").stat().st_size > 0


@pytest.mark.parametrize("name", ["flock.abc", "flock", "nowhere/flock.csv"])
def test_a_file_that_cannot_be_is_refused(tmp_path, show, name):
    with pytest.raises(ProblemsError):
        show.export(tmp_path / name)


def test_animals_that_are_shown_are_written_as_they_face_and_as_long_as_they_are(tmp_path):
    """One goes backwards: its body faces west while it moves east."""
    rows = [f"{t},{t / 10},{n},{0.2 * t},{3.0 * n},{np.pi * (n == 1)}" for t in range(40) for n in range(3)]
    (tmp_path / "a.csv").write_text("frame,time,id,x,y,heading\n" + "\n".join(rows))
    show = open_show(tmp_path / "a.csv", None, Looking(unit="m", body_length_m=0.5))
    show.export(tmp_path / "b.csv")
    head, *rows = [line.split(",") for line in (tmp_path / "b.csv").read_text().splitlines()]
    told = [dict(zip(head, row, strict=True)) for row in rows]
    assert {round(abs(float(row["heading"])), 3) for row in told if row["id"] == "1"} == {3.142}
    assert {round(abs(float(row["heading"])), 3) for row in told if row["id"] != "1"} == {0.0}
    assert all(float(row["vx"]) > 0 and float(row["length"]) == 0.5 for row in told)
    assert read_trajectories(tmp_path / "b.csv").body_length == 0.5
    assert show._moment(3).length.tolist() == [0.5] * 3


def test_geese_lifted_from_a_film_make_a_brush_that_flies_as_they_did(tmp_path, show):
    path = tmp_path / "mine.brush.toml"
    assert "V of 11 birds" in show.formation_brush(30, path)
    made = load_brush(path)
    assert made.parameters["shape"] == "V"
    assert made.parameters["spacing"] == pytest.approx(1.25, rel=0.1)
    assert made.parameters["slope"] == pytest.approx(0.8, rel=0.35)


def test_birds_in_no_formation_make_none(show):
    chance = np.random.default_rng(0)
    rest = 3.0 * chance.normal(size=(1, 11, 3))
    show.take(type(show.flight)(show.flight.xyz + rest, show.flight.depth, show.flight.ids, show.flight.frames, 25.0))
    with pytest.raises(ProblemsError, match="frame 30: the birds do not fly in a line formation: a cluster"):
        show.formation(30)


def test_a_level_comes_with_the_brush(tmp_path, show):
    level = show.formation_level(30, tmp_path / "mine.brush.toml")
    assert (tmp_path / "brushes" / "mine.brush.toml").is_file()
    assert called(["run", str(level), "--seconds", "0.5"]) == 0


def test_lift_makes_the_brush_without_a_window(tmp_path, capsys):
    tracks, camera = written(tmp_path, seen(geese()))
    words = ["lift", str(tracks), "--camera", str(camera), "--out", str(tmp_path / "flock.csv")]
    (tmp_path / "flock.csv.json").write_text('{"schema": "flockbrush.trajectory/1", "fps": 4, "unit": "bl"}')
    assert called([*words, "--brush", str(tmp_path / "v.brush.toml"), "--frame", "30", "--wingspan", "1.5"]) == 0
    assert "V of 11 birds" in capsys.readouterr().err
    assert called([*words, "--brush", str(tmp_path / "v.brush.toml"), "--frame", "99"]) == 1
    assert "frames 0 to 59; there is no frame 99" in capsys.readouterr().err
    about = json.loads((tmp_path / "flock.csv.json").read_text())
    assert (about["fps"], about["unit"], about["level"]) == (25.0, "m", tracks.name)
    with open(tmp_path / "flock.csv") as file:
        assert len(list(csv.DictReader(file))) == 60 * 11
    for option in ("--frame", "--wingspan"):
        assert called([*words, option, "30"]) == 2
        assert "only for a formation brush" in " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert called(["play", str(tmp_path / "flock.csv"), "--camera", str(camera)]) == 1
    assert "is a flight in metres; leave out --camera" in capsys.readouterr().err
