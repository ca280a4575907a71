"""`flockbrush track`: from a film to a table, and from there into space."""

import csv
import json

import numpy as np
import pytest

from benchmarks.sky_film import film
from flockbrush.cli.main import called
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film
from flockbrush.film.tracks import read_tracks
from flockbrush.lifting.lens import Camera
from tests.clip_film import birds_at, damaged
from tests.clip_film import film as film_of

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


def test_frames_that_are_lost_are_gaps_of_the_tracks_and_told(tmp_path, capsys):
    whole = film_of(tmp_path / "whole.mp4", [birds_at(k) for k in range(20)], 30, g="1")
    hurt = damaged(tmp_path / "hurt.mp4", whole, 8, 9)
    tables = [tmp_path / "whole.csv", tmp_path / "hurt.csv"]
    assert called(["track", str(whole), "--out", str(tables[0])]) == 0
    capsys.readouterr()
    assert called(["track", str(hurt), "--out", str(tables[1]), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["frames"], told["frames_lost"]) == (20, 2)
    assert "18 can be read, the first that is lost is frame 8" in told["notes"][0]
    rows = [table.read_text().splitlines() for table in tables]
    assert rows[1] == [row for row in rows[0] if not row.startswith(("8,", "9,"))]
    short = damaged(tmp_path / "short.mp4", whole, 2)
    assert called(["track", str(short), "--out", str(tables[1])]) == 1
    assert "short.mp4: the file says it has 20 frames, 2 can be read" in capsys.readouterr().err


def test_tracks_of_an_uneven_film_have_times_and_are_not_lifted(tmp_path, capsys):
    at = [*range(12), *range(12, 40, 3)]
    clip = film_of(tmp_path / "uneven.mp4", [birds_at(k) for k in at], 30, at)
    tracks, camera, flock = (tmp_path / name for name in ("t.csv", "cam.toml", "flock.csv"))
    assert called(["track", str(clip), "--out", str(tracks)]) == 0
    uneven = "its frames are not evenly spaced in time, 0.0333 to 0.1 s apart"
    assert f"note: {uneven}: the table has their times" in capsys.readouterr().err
    times = {int(row["frame"]): float(row["time"]) for row in csv.DictReader(tracks.open())}
    assert times == pytest.approx({k: at[k] / 30 for k in times}, abs=1e-5) and len(times) > 18
    camera.write_text("".join(f"{name} = {value}\n" for name, value in CAMERA.model_dump().items()))
    assert called(["lift", str(tracks), "--camera", str(camera), "--out", str(flock)]) == 1
    assert f"t.csv: {uneven}" in (said := capsys.readouterr().err) and "-vf fps=10 EVEN.mp4" in said
    book = Book(film := Film(clip), tmp_path)
    book.load(tracks)
    book.save()
    assert film.fps == pytest.approx(30) and read_tracks(book.place("tracks.csv")).times[-1] == pytest.approx(1.3)


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
