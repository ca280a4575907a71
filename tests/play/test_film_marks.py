"""Landmarks, masks and bodies that are marked in the window are ones that the commands take."""

import threading

import cv2
import numpy as np
import pytest

from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film
from flockbrush.film.landmarks import Landmark
from tests.clip_film import bird_film, birds_at, damaged, film
from tests.play.test_clip_window import Hands


@pytest.fixture(scope="module")
def sky_clip(tmp_path_factory):
    return bird_film(tmp_path_factory.mktemp("clips") / "birds.avi")


@pytest.fixture
def open_window(tmp_path, shown):
    def open_(film, mode="view", **options):
        return shown(Hands(Book(film, tmp_path / "out"), (900, 640), "light", mode=mode, **options))

    return open_


def test_a_body_is_as_long_as_learn_takes_it(sky_clip, open_window):
    window = open_window(Film(sky_clip), "body")
    window.view.wheel(10, np.array(window.area.size) / 2, window.film.size, window.area)
    window.drag((160, 90), (161.5, 90))
    assert window.book.state.marks.body_length is None
    assert window.said() == ["A body has 2 to 2000 pixels, not 1.5."]


def test_a_damaged_film_is_told_and_its_birds_fly_on_where_frames_are_lost(tmp_path, open_window):
    whole = film(tmp_path / "whole.mp4", [birds_at(k) for k in range(20)], 30, g="1")
    window = open_window(Film(damaged(tmp_path / "hurt.mp4", whole, 8, 9)), "birds")
    assert "hurt.mp4: the file says it has 20 frames, 18 can be read" in window.said()[0]
    window.push("Track birds")
    window.wait()
    sights = np.isfinite(window.book.state.birds.px[..., 0]).sum(1).tolist()
    assert sights[7:11] == [3, 0, 0, 3] and len(window.book.state.birds.ids) == 3


def test_birds_are_tracked_by_one_job_at_a_time(sky_clip, open_window, monkeypatch):
    from flockbrush.film.bird_marks import Follower

    window, reading, most = open_window(Film(sky_clip), "birds"), [], []
    frame_of = Follower.blobs

    def blobs(self, f):
        reading.append(f)
        most.append(len(reading))
        try:
            return frame_of(self, f)
        finally:
            reading.pop()

    monkeypatch.setattr(Follower, "blobs", blobs)
    window.push("Track birds")
    first = window.jobs["birds"]
    for _ in range(3):
        window.key("f")
    assert window.jobs["birds"] is first
    window.mode._follow(0)
    window.wait()
    assert len(window.book.state.birds.ids) == 3 and max(most) == 1


# landmarks and masks ----------------------------------------------------------------------

PAN = 4  # pixels a frame
RECTANGLES = Landmark(0, 100, 20, 40, 40), Landmark(0, 150, 110, 40, 40)


@pytest.fixture(scope="module")
def pan_clip(tmp_path_factory):
    """Rough ground that moves to the left in ten frames."""
    path = tmp_path_factory.mktemp("clips") / "pan.avi"
    ground = cv2.GaussianBlur(np.random.default_rng(4).integers(0, 255, (180, 400), dtype=np.uint8), (0, 0), 2)
    ground = cv2.cvtColor(cv2.normalize(ground, None, 0, 255, cv2.NORM_MINMAX), cv2.COLOR_GRAY2BGR)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, (320, 180))
    for k in range(10):
        writer.write(np.ascontiguousarray(ground[:, PAN * k : PAN * k + 320]))
    writer.release()
    return path


def with_landmarks(window, *landmarks, **marks):
    window.book.mark("landmarks", "landmarks", 0, landmarks=landmarks or RECTANGLES, **marks)
    window.frame(1 / 30)
    return window


def painted(window):
    """The middle of what is painted, pixels."""
    return np.argwhere(window.book.state.obstacles.array).mean(0)[::-1]


def test_masks_are_painted_where_the_ground_is_in_whatever_mode_the_window_opens(pan_clip, open_window):
    window = with_landmarks(open_window(Film(pan_clip), "mask"))
    window.wait()
    window.go(9)
    window.click((150, 90))
    assert np.abs(painted(window) - (150 + 9 * PAN, 90)).max() < 2
    assert window.mode.hint.startswith("Drag: paint")


def test_masks_are_not_painted_where_nobody_knows_the_ground(pan_clip, open_window, monkeypatch):
    free = threading.Event()

    def lost_soon(film, mark, say):
        free.wait(10)
        boxes = np.tile(np.array(mark[1:], float), (10, 1))
        boxes[5:] = np.nan
        return boxes

    monkeypatch.setattr("flockbrush.studio.film.followed_ground.followed", lost_soon)
    window = with_landmarks(open_window(Film(pan_clip), "mask"))
    window.go(4)
    for button in (1, 3):
        window.click((150, 90), button)
    assert window.book.state.obstacles.blank and "still being followed" in window.said()[-1]
    free.set()
    window.wait()
    window.go(7)
    window.drag((150, 90), (180, 90))
    assert window.book.state.obstacles.blank and "No landmark is found both here and in frame 0" in window.said()[-1]
    window.go(4)
    window.click((150, 90))
    assert not window.book.state.obstacles.blank


def test_landmarks_of_frames_that_are_not_used_are_carried_to_those_that_are(pan_clip, open_window):
    window = with_landmarks(open_window(Film(pan_clip)), first=3, last=8)
    window.wait()
    line = window.book.learn_line()
    (x, y), (other, _) = [map(float, part.split(",")[:2]) for part in line.split("--landmark 3:")[1:]]
    assert abs(x - (100 - 3 * PAN)) <= 2 and abs(y - 20) <= 2 and abs(other - (150 - 3 * PAN)) <= 2
    window.book.followed[RECTANGLES[0]][3:9] = np.nan
    assert "--landmark 0:100,20,40,40 --landmark 3:" in window.book.learn_line()
    window.copy_line()
    assert "The landmark of frame 0 is not found in any used frame: learn will refuse it." in window.said()


def test_a_landmark_that_cannot_be_followed_is_not_tried_for_ever(pan_clip, open_window, monkeypatch):
    calls = []

    def fails(film, mark, say):
        calls.append(mark)
        raise OSError("the film is gone")

    monkeypatch.setattr("flockbrush.studio.film.followed_ground.followed", fails)
    window = with_landmarks(open_window(Film(pan_clip), "landmarks"), RECTANGLES[0])
    for _ in range(5):
        window.wait()
    assert len(calls) == 1 and window.mode.rows[0].text == "1: frame 0, cannot be followed"


def test_a_rectangle_that_is_too_small_for_learn_is_refused(pan_clip, open_window):
    window = open_window(Film(pan_clip), "landmarks")
    window.drag((150, 90), (156, 140))
    assert not window.book.state.marks.landmarks and "at least 8 x 8 pixels" in window.said()[-1]
