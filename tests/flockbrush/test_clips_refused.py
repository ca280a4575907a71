"""Clips that tell nothing of a herd, through the command line: what was seen, what to try, and a page of it."""

import cv2
import numpy as np
import pytest
from clip_film import film, song

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import STILL, shoot
from flockbrush.cli.field_commands import _says

SIZE = (160, 120)


@pytest.fixture(autouse=True)
def one_core(monkeypatch):
    """No processes are started to help with pictures as small as these."""
    monkeypatch.setattr("flockbrush.engine.parallel.cores", lambda: 1)


def grass(seed=0, tint=(60, 110, 80)):
    """A picture of a meadow with nobody on it."""
    blades = np.random.default_rng(seed).normal(size=(SIZE[1], SIZE[0], 1)).astype(np.float32)
    return np.clip(cv2.GaussianBlur(blades, (0, 0), 1.5)[..., None] * 60 + np.array(tint), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """A folder of clips, each with something the matter."""
    folder = tmp_path_factory.mktemp("clips")
    (folder / "text.mp4").write_text("not a film at all " * 50)
    (folder / "empty.mp4").write_bytes(b"")
    song(folder / "song.mp4")
    film(folder / "still.mp4", [grass()] * 10)
    film(folder / "plain.mp4", [np.full((*SIZE[::-1], 3), 128, np.uint8)] * 10)
    film(folder / "cut.mp4", [grass()] * 9 + [grass(1, (200, 180, 160))] * 9)
    film(
        folder / "storm.mp4", [np.random.default_rng(k).integers(0, 255, (*SIZE[::-1], 3), np.uint8) for k in range(9)]
    )
    (folder / "folder.mp4").mkdir()
    truth = herd("swarm", count=12, seconds=0.5, fps=20, seed=3)
    shoot(truth, folder / "swarm.mp4", (240, 180), 14.0, STILL, seed=4)
    return folder


LANDMARKS = ("--landmark", "0:10,10,40,40", "--landmark", "9:90,50,40,40")
OUTSIDE = ("--landmark", "0:230,10,40,40", "--landmark", "9:5,5,40,40")
NEAR = "no animals were detected: nothing has a colour near the given 0,0,255"
REFUSED = [
    ("text.mp4", (), "is not a readable video (formats: ", True),
    ("empty.mp4", (), "is empty (0 bytes)", True),
    ("song.mp4", (), "has no video stream, only audio", True),
    ("still.mp4", (), "nothing moves in frames 0 to 9", True),
    ("plain.mp4", (), "--body-colour R,G,B", True),
    ("cut.mp4", (), "try --frames 0:8 or --frames 9:17", True),
    ("swarm.mp4", ("--body-colour", "90,120,60"), "of the picture looks like animals; give their colour", True),
    ("swarm.mp4", ("--body-colour", "0,0,255"), NEAR, True),
    ("swarm.mp4", ("--body-length-px", "150"), "covers the area of 0 animals of the given 150 pixels", True),
    ("swarm.mp4", ("--frames", "90:99"), "has frames 0 to 9, but none in 90:99", False),
    ("swarm.mp4", OUTSIDE, "inside the picture of 240 x 180", False),
    ("plain.mp4", LANDMARKS, "has no corners to track", True),
    ("folder.mp4", (), "is a folder, not a clip", False),
    ("missing.mp4", (), "there is no such file", False),
]


@pytest.mark.parametrize(("clip", "options", "words", "page"), REFUSED)
def test_a_clip_that_tells_nothing_is_refused_with_what_was_seen(cli, clips, tmp_path, clip, options, words, page):
    report = tmp_path / "report"
    done = cli("learn", clips / clip, "--out", tmp_path / "x.brush.toml", "--report", report, *options)
    assert done.code == 1
    assert f"{clip}: " in done.err and words in done.err
    assert (report / "report.html").exists() == page
    assert not (tmp_path / "x.brush.toml").exists()
    if page:
        told = (report / "report.html").read_text()
        assert clip in told and ("flockbrush play --clip" in told) == ("data:image" in told)


def test_a_mask_that_leaves_no_room_is_told(cli, clips, tmp_path):
    cv2.imwrite(str(tmp_path / "white.png"), np.full((180, 240), 255, np.uint8))
    done = cli("fields", clips / "swarm.mp4", "--out", tmp_path / "x.npz", "--obstacles", tmp_path / "white.png")
    assert done.code == 1 and "white.png: is almost completely white" in done.err


def test_a_herd_that_jumps_over_the_same_ground_may_be_a_cut(cli, tmp_path):
    ground, pictures = grass(), []
    for k in range(24):
        picture = ground.copy()
        for x, y in ((20, 20), (60, 30), (35, 70), (80, 90), (60, 60), (30, 100)):
            at = x + 2 * k + (20 if k > 11 else 0), y + (12 if k > 11 else 0)
            cv2.ellipse(picture, at, (7, 3), 0, 0, 360, (235, 240, 240), cv2.FILLED)
        pictures.append(picture)
    film(tmp_path / "jump.mp4", pictures)
    done = cli("fields", tmp_path / "jump.mp4", "--out", tmp_path / "jump.npz")
    assert done.code == 0, done.err
    assert "the herd jumps between frames 11 and 12; if this is a cut, use --frames 0:11 or --frames 12:23" in done.err


def test_the_preview_of_a_small_film_has_room_for_its_words(cli, clips, tmp_path):
    preview = tmp_path / "seen.mp4"
    done = cli("fields", clips / "swarm.mp4", "--out", tmp_path / "seen.npz", "--preview", preview)
    assert done.code == 0, done.err
    assert cv2.VideoCapture(str(preview)).read()[1].shape == (360, 960, 3)  # twice 240 x 180, two beside one another


def test_words_that_are_too_long_for_a_picture_are_written_smaller():
    picture = np.full((40, 120, 3), 200, np.uint8)
    _says(picture, "cells of 1.2 body lengths   usual speed 1.8 a second", (8, 18))
    assert (picture[:, 116:] == 200).all() and (picture[:, :100] != 200).any()


def test_one_frame_of_a_film_is_a_photograph(cli, clips, tmp_path):
    done = cli("fields", clips / "swarm.mp4", "--out", tmp_path / "one.npz", "--frames", "3:3")
    assert done.code == 0, done.err
    assert "not their motion" in done.err
    with np.load(tmp_path / "one.npz") as seen:
        assert seen["fields.density"].shape[0] == 1


def test_a_report_takes_no_place_of_other_files(cli, clips, tmp_path):
    """Pictures of earlier reports are replaced or removed; those of somebody else stay, and nothing is begun."""
    report = tmp_path / "report"
    report.mkdir()
    (report / "loss.png").write_bytes(b"mine")
    command = "learn", clips / "empty.mp4", "--out", tmp_path / "x.brush.toml", "--report", report
    done = cli(*command)
    assert done.code == 1 and "loss.png: would be replaced, but was not written by Flockbrush" in done.err
    assert [path.name for path in report.iterdir()] == ["loss.png"]
    (report / "report.html").write_text("<p>My notes on flockbrush learn</p>")
    assert "report.html: would be replaced" in cli(*command).err
    (report / "report.html").unlink()
    (report / "loss.png").rename(report / "notes.png")
    assert "is empty (0 bytes)" in cli(*command).err and "is empty (0 bytes)" in cli(*command).err
    assert {path.name for path in report.iterdir()} == {"notes.png", "report.html"}
