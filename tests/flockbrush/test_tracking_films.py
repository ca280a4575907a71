"""`flockbrush track`: from a film to a table, and from there into space."""

import csv
import json

import numpy as np
import pytest

from benchmarks.sky_film import film
from flockbrush.cli.main import called
from flockbrush.lifting.lens import Camera

CAMERA = Camera(width=320, height=180, horizontal_fov_deg=60, fps=30, mean_speed=5, near=5, far=100)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Four birds that fly through the picture, one second."""
    from flockbrush.render import Video

    path = tmp_path_factory.mktemp("sky") / "birds.mp4"
    t = np.arange(30)[:, None] / 30
    start = np.array([[-5, 18, 2], [-4, 19, -2], [-6, 18.5, -3.5], [-2, 18, 3.5]])
    xyz = start + np.stack([5 * t + 0 * start[:, 0], 0 * t + 0 * start[:, 0], 0.3 * t * np.arange(4)], axis=-1)
    with Video(path, 30, (320, 180)) as video:
        for picture in film(xyz, CAMERA):
            video.write(np.repeat(picture[..., None], 3, axis=2))
    return path


def test_a_film_becomes_tracks_and_tracks_become_a_flight(clip, tmp_path, capsys):
    tracks, flock, camera = tmp_path / "tracks.csv", tmp_path / "flock.csv", tmp_path / "cam.toml"
    assert called(["track", str(clip), "--out", str(tracks), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["birds"], told["frames"]) == (4, 30)
    camera.write_text("".join(f"{name} = {value}\n" for name, value in CAMERA.model_dump().items()))
    assert called(["lift", str(tracks), "--camera", str(camera), "--out", str(flock)]) == 0
    with open(flock) as file:
        assert len({row["id"] for row in csv.DictReader(file)}) == 4


def test_a_correction_with_a_mistake_names_its_line(clip, tmp_path, capsys):
    (tmp_path / "fix.csv").write_text("frame,id,x,y\n3,1,ten,20\n")
    assert called(["track", str(clip), "--out", str(tmp_path / "t.csv"), "--correct", str(tmp_path / "fix.csv")]) == 1
    assert "fix.csv:2: x: must be a number, got 'ten'" in capsys.readouterr().err
    assert not (tmp_path / "t.csv").exists()


def test_marks_that_the_film_has_no_place_for_are_told(clip, tmp_path, capsys):
    (tmp_path / "fix.csv").write_text("frame,id,x,y\n5000,1,10,20\n3,7,-400,20\n")
    out, fix = str(tmp_path / "t.csv"), str(tmp_path / "fix.csv")
    assert called(["track", str(clip), "--out", out, "--correct", fix, "--json"]) == 0
    late, outside = json.loads(capsys.readouterr().out)["notes"]
    assert "frame 5000 is not in the clip, which has frames 0 to 29" in late
    assert "bird 7 in frame 3 is outside the 320 x 180 picture" in outside


def test_corrections_of_birds_that_nobody_tracked_are_told(clip, tmp_path, capsys):
    out, fix = str(tmp_path / "t.csv"), str(tmp_path / "fix.csv")
    assert called(["track", str(clip), "--out", out, "--json"]) == 0
    capsys.readouterr()
    with open(out) as file:
        at = next(row for row in csv.DictReader(file) if (row["frame"], row["id"]) == ("10", "2"))
    (tmp_path / "fix.csv").write_text(f"frame,id,x,y\n10,8,{at['x']},{at['y']}\n20,9,300,170\n")
    assert called(["track", str(clip), "--out", out, "--correct", fix, "--json"]) == 0
    begun, short = json.loads(capsys.readouterr().out)["notes"]
    assert "there was no bird 8 before frame 10, where it is corrected; it begins there" in begun
    assert "bird 9 of frame 20 could not be tracked through three frames; it is left out" in short


def test_what_was_followed_before_somebody_stops_it_is_kept(clip, tmp_path, capsys, monkeypatch):
    from flockbrush.film.tracking import Tracker

    step = Tracker.step

    def stopped(self, image):
        if self.frame == 19:
            raise KeyboardInterrupt
        step(self, image)

    monkeypatch.setattr(Tracker, "step", stopped)
    assert called(["track", str(clip), "--out", str(tmp_path / "t.csv")]) == 130
    assert "stopped after 20 frames" in capsys.readouterr().err
    with open(tmp_path / "t.csv") as file:
        assert {int(row["frame"]) for row in csv.DictReader(file)} == set(range(20))
    earlier = "frame,id,x,y\n0,1,2,3\n"
    (tmp_path / "t.csv").write_text(earlier)
    assert called(["track", str(clip), "--out", str(tmp_path / "t.csv")]) == 130
    assert "t.csv is still the earlier file" in capsys.readouterr().err
    assert (tmp_path / "t.csv").read_text() == earlier


def test_where_it_is_stopped_before_a_bird_is_known_nothing_is_written(clip, tmp_path, capsys, monkeypatch):
    from flockbrush.film.tracking import Tracker

    def stopped(self, image):
        raise KeyboardInterrupt

    monkeypatch.setattr(Tracker, "step", stopped)
    assert called(["track", str(clip), "--out", str(tmp_path / "t.csv")]) == 130
    assert "stopped after 0 frames, too few to track a bird; nothing was written" in capsys.readouterr().err
    assert not (tmp_path / "t.csv").exists()
