"""`flockbrush lift`: from a table of tracks to a table of a flight."""

import csv
import json

import numpy as np
import pytest

from flockbrush.cli.main import called
from flockbrush.lifting.flight_files import GRAVITY, attitude
from flockbrush.output.trajectory_table import COLUMNS

CAMERA = "width = 1280\nheight = 720\nhorizontal_fov_deg = 60\nfps = 30\nmean_speed = 9\nnear = 5\nfar = 200\n"


@pytest.fixture
def film(tmp_path):
    """Four birds that fly past, in pixels, and their camera."""
    (tmp_path / "cam.toml").write_text(CAMERA)
    rows = ["frame,id,x,y"]
    for f in range(20):
        rows += [f"{f},{n},{300 + 8 * f + 60 * n + 0.1 * n * f},{300 + 20 * n + 0.02 * f * f}" for n in range(1, 5)]
    (tmp_path / "tracks.csv").write_text("\n".join(rows))
    return tmp_path


def lifted(film, *more):
    tracks, camera, out = (str(film / name) for name in ("tracks.csv", "cam.toml", "flock.csv"))
    return called(["lift", tracks, "--camera", camera, "--out", out, *more])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--brush", "b.txt"], "b.txt: its name must end in .brush.toml"),
        (["--brush", "b.brush.toml", "--wingspan", "nan"], "--wingspan"),
        (["--brush", "b.brush.toml", "--frame", "9999"], "has frames 0 to 19; there is no frame 9999"),
    ],
)
def test_a_brush_that_cannot_be_made_is_refused_before_the_work(words, said, film, capsys, monkeypatch):
    monkeypatch.chdir(film)
    (film / "flock.csv").unlink(missing_ok=True)
    assert lifted(film, *words) != 0
    assert said in capsys.readouterr().err and not (film / "flock.csv").exists()


def test_a_flight_is_written_with_the_columns_of_every_trajectory(film, capsys):
    assert lifted(film, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["birds"], told["frames"]) == (4, 20)
    with open(film / "flock.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 80
    assert tuple(rows[0]) == (*COLUMNS, "bank") and all(None not in row.values() and None not in row for row in rows)
    assert {row["species"] for row in rows} == {"bird"} and {row["group"] for row in rows} == {""}
    climb = [np.arctan2(float(row["vz"]), np.hypot(float(row["vx"]), float(row["vy"]))) for row in rows]
    np.testing.assert_allclose([float(row["pitch"]) for row in rows], climb, atol=1e-5)
    speeds = [float(row["speed"]) for row in rows]
    assert np.mean(speeds) == pytest.approx(9, rel=0.02)


def test_a_flight_is_in_metres_without_being_told(film, capsys):
    assert lifted(film) == 0
    capsys.readouterr()
    assert called(["measure", str(film / "flock.csv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["unit"], told["fps"], told["animals"]) == ("m", pytest.approx(30), 4)


def test_a_mistake_leaves_an_earlier_flight_as_it_was(film, capsys):
    (film / "flock.csv").write_text("precious")
    (film / "tracks.csv").write_text("frame,id,x,y\n1,1,a,2\n")
    assert lifted(film) == 1
    assert "tracks.csv:2: x: must be a number, got 'a'" in capsys.readouterr().err
    assert (film / "flock.csv").read_text() == "precious"


def test_bounds_in_the_wrong_order_are_refused(film, capsys):
    assert lifted(film, "--near", "50", "--far", "20") == 1
    assert "less than far" in capsys.readouterr().err


def test_writing_over_the_tracks_is_refused(film, capsys):
    camera = str(film / "cam.toml")
    assert called(["lift", str(film / "tracks.csv"), "--camera", camera, "--out", str(film / "tracks.csv")]) == 1
    assert "is also an input file" in capsys.readouterr().err


def test_a_bird_in_a_level_turn_banks_by_speed_and_radius():
    fps, radius, speed = 60, 20.0, 10.0
    angle = np.arange(120)[:, None] / fps * speed / radius
    right_turn = np.stack([radius * np.cos(-angle), radius * np.sin(-angle), 0 * angle], axis=-1)
    velocity, pitch, bank = attitude(right_turn, fps)
    assert np.linalg.norm(velocity[10:-10], axis=-1) == pytest.approx(speed, rel=1e-3)
    assert bank[10:-10] == pytest.approx(np.arctan(speed**2 / radius / GRAVITY), rel=1e-3)
    assert pitch == pytest.approx(0)


def test_a_climbing_bird_points_upwards():
    steps = np.arange(10)[:, None, None] / 30
    _, pitch, bank = attitude(steps * np.array([3.0, 4.0, 5.0]), 30)
    assert pitch == pytest.approx(np.pi / 4) and bank == pytest.approx(0)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "cam.toml:1: {name} is missing ("),
        ("{name} = -3", "cam.toml:{at}: {name}: must be greater than"),
        ("{name} = 0", "cam.toml:{at}: {name}: must be greater than"),
        ("{name} = 'wide'", "cam.toml:{at}: {name}: must be a"),
        ("{name} = true", "cam.toml:{at}: {name}: must be a"),
        ("{name} = nan", "cam.toml:{at}: {name}: must be a"),
        ("{name} = [1]", "cam.toml:{at}: {name}: must be a"),
    ],
)
@pytest.mark.parametrize("name", [line.split()[0] for line in CAMERA.splitlines()])
def test_nonsense_in_any_line_of_the_camera_is_told_with_its_line(film, capsys, name, line, said):
    lines = CAMERA.splitlines()
    at = [row.split()[0] for row in lines].index(name)
    lines[at] = line.format(name=name)
    (film / "cam.toml").write_text("\n".join(lines) + "\n")
    assert lifted(film) == 1
    assert said.format(name=name, at=at + 1) in capsys.readouterr().err
    assert not (film / "flock.csv").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CAMERA.replace("60", "180"), "cam.toml:3: horizontal_fov_deg: must be less than 180"),
        (CAMERA.replace("near = 5", "near = 300"), "cam.toml:6: near: must be less than far, got 300 and 200 m"),
        (CAMERA.replace("720", "720.5"), "cam.toml:2: height: must be a whole number"),
        (CAMERA.replace("mean_speed", "mean_sped"), "cam.toml:5: mean_sped: unknown name; did you mean 'mean_speed'?"),
        (CAMERA + "fps = 25\n", "cam.toml:8: is not TOML"),
        ("a camera", "cam.toml:1: is not TOML"),
    ],
)
def test_a_camera_that_contradicts_itself_is_told_what_would_be_right(film, capsys, text, said):
    (film / "cam.toml").write_text(text)
    assert lifted(film) == 1
    assert said in capsys.readouterr().err


def of_birds(*birds, frames=20):
    """A table of tracks of some birds, each a way (frame -> x, y or None)."""
    rows = ["frame,id,x,y"]
    for f in range(frames):
        for n, way in enumerate(birds, 1):
            if way(f) is not None:
                rows.append(f"{f},{n},{way(f)[0]},{way(f)[1]}")
    return "\n".join(rows) + "\n"


def east(f):
    return 300 + 8 * f, 300 + 0.1 * f * f


def beside(f):
    return 380 + 8.4 * f, 330 + 0.08 * f * f


@pytest.mark.parametrize(
    ("tracks", "birds", "said"),
    [
        (of_birds(east), 1, "the depth of a single bird is undetermined"),
        (
            of_birds(east, beside, lambda f: (5, 5) if f == 4 else None),
            2,
            "left out, visible in fewer than three frames",
        ),
        (of_birds(east, lambda f: None if 4 < f < 9 else beside(f)), 2, ""),
        (of_birds(east, east), 2, ""),
        (of_birds(east, beside, east), 3, ""),
        (of_birds(east, beside, frames=3), 2, ""),
        (of_birds(east, lambda f: beside(f) if f < 9 else None), 2, ""),
        (of_birds(lambda f: east(f) if f < 9 else None, lambda f: beside(f) if f > 9 else None), 2, "no two birds"),
        (of_birds(lambda f: (9000 + f, 5), lambda f: (9100 + f, 9)), 2, "the camera file may be wrong"),
    ],
    ids=[
        "one bird",
        "a point",
        "a gap",
        "one pixel",
        "one pixel of three",
        "three frames",
        "one leaves",
        "apart",
        "out",
    ],
)
@pytest.mark.parametrize("method", ["smooth", "cobyla"])
def test_what_can_be_lifted_is_and_the_rest_is_told(film, capsys, tracks, birds, said, method):
    if method == "cobyla":
        pytest.importorskip("nlopt")
    (film / "tracks.csv").write_text(tracks)
    assert lifted(film, "--json", "--method", method) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["birds"] == birds and said in " ".join(told["notes"])
    with open(film / "flock.csv") as file:
        assert np.isfinite([float(row[key]) for row in csv.DictReader(file) for key in ("x", "y", "z", "vx")]).all()


@pytest.mark.parametrize(
    ("tracks", "said"),
    [
        ("", "tracks.csv: is empty"),
        ("frame,id,x,y\n", "has no birds"),
        ("frame;id;x;y\n1;1;2,5;3\n", "tracks.csv:2: x: must be a number, got '2,5'"),
        ("frame,id,x,y\n1,1,2,5,3\n", "tracks.csv:2: has 5 cells, the header has 4; decimals need a point"),
        ("frame,bird,x,y\n1,1,2,3\n", "tracks.csv:1: id: there is no such column"),
        ("frame,id,x,y\n1,1,nan,3\n", "tracks.csv:2: x: must be a finite number of pixels"),
        ("frame,id,x,y\n1,1,2,3\n1,1,2,4\n", "tracks.csv:3: id: bird 1 is in frame 1 twice, here and in line 2"),
        ("frame,id,x,y\n1,1,,3\n", "tracks.csv:2: x: must be a number, got ''"),
        ("frame,id,x,y\n1.5,1,2,3\n", "tracks.csv:2: frame: must be a whole number, got '1.5'"),
        (of_birds(east, beside, frames=1), "a flight needs three"),
        (of_birds(lambda f: (5, 5), lambda f: (7, 7)), "nothing moves in these tracks"),
        ("\0\1\2", "is not a table"),
    ],
)
def test_tracks_without_a_flight_are_refused_in_plain_words(film, capsys, tracks, said):
    (film / "tracks.csv").write_text(tracks)
    assert lifted(film) == 1
    assert said in capsys.readouterr().err
    assert not (film / "flock.csv").exists()


@pytest.mark.parametrize("name", ["--lambda-t", "--lambda-f", "--evenness", "--separation-distance"])
@pytest.mark.parametrize("value", ["-1", "nan", "inf", "1e300", "much"])
def test_weights_of_nonsense_are_refused(film, capsys, name, value):
    assert lifted(film, name, value) in (1, 2)
    told = capsys.readouterr().err
    assert name in told or "must be from 0 to" in told


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["play", "{film}/tracks.csv"], "--camera cam.toml"),
        (["play", "{film}/none.csv"], "there is no such file"),
        (["play", "{film}/tracks.csv", "--camera", "{film}/none.toml"], "there is no such file"),
        (["play", "--clip", "{film}/none.mp4"], "there is no such file"),
        (["play", "--clip", "{film}/cam.toml"], "is not a readable video"),
        (["play", "--clip", "{film}"], "is a folder, not a clip"),
        (["play", "--clip", "sky", "--mode", "nonsense"], "the mode must be one of"),
    ],
)
def test_nothing_opens_for_what_cannot_be_shown(film, capsys, line, said):
    assert called([word.format(film=film) for word in line]) in (1, 2)
    assert said in " ".join(capsys.readouterr().err.replace("│", " ").split())
