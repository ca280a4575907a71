"""Landmarks, masks and bodies that are marked in the window are ones that the commands take."""

import numpy as np
import pytest

from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film
from tests.clip_film import bird_film
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
