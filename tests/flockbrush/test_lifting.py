"""`flockbrush lift`: from a table of tracks to a table of a flight."""

import csv
import json

import numpy as np
import pytest

from flockbrush.cli import called
from flockbrush.lift import GRAVITY, attitude

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


def test_a_flight_is_written_with_the_columns_of_every_trajectory(film, capsys):
    assert lifted(film, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["birds"], told["frames"]) == (4, 20)
    with open(film / "flock.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 80
    assert {"frame", "time", "id", "x", "y", "z", "vx", "heading", "speed", "pitch", "bank"} <= set(rows[0])
    speeds = [float(row["speed"]) for row in rows]
    assert np.mean(speeds) == pytest.approx(9, rel=0.02)


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
    assert "is what is read from" in capsys.readouterr().err


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
