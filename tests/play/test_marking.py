"""Marks corrected by hands in the window, carried on, undone, saved and read again."""

import numpy as np
import pygame
import pytest
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app as commands
from flockbrush.film.bird_marking import Album, read_frames
from tests.flock_film import V, film
from tests.play.window import MODS

from flockbrush.studio.bird_marking_window import Marking  # isort: skip  # the window of the tests has no screen


class Hands(Marking):
    """The window, with hands; places are pixels of the picture."""

    def post(self, kind, **values):
        pygame.event.post(pygame.event.Event(kind, **values))
        self.frame(1 / 30)

    def at(self, place):
        x, y = self._at(place)
        return round(x + self.area.x), round(y + self.area.y)

    def click(self, place, button=1):
        for kind in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
            self.post(kind, pos=self.at(place), button=button)

    def drag(self, start, end):
        """Between pixels of the window."""
        self.post(pygame.MOUSEBUTTONDOWN, pos=start, button=1)
        for share in (0.3, 0.7, 1.0):
            pos = tuple(np.round(np.add(start, np.subtract(end, start) * share)).astype(int).tolist())
            self.post(pygame.MOUSEMOTION, pos=pos, rel=(0, 0), buttons=(1, 0, 0))
        self.post(pygame.MOUSEBUTTONUP, pos=end, button=1)

    def key(self, name, *mods):
        mod = sum(MODS[m] for m in mods)
        self.post(pygame.KEYDOWN, key=pygame.key.key_code(name), mod=mod, unicode="")

    def number(self, bird):
        return self._labels[bird].move(self.area.topleft).center


@pytest.fixture
def open_window(tmp_path, shown):
    def open_(paths, **options):
        return shown(Hands(Album(read_frames(paths)), tmp_path / "marks.csv", (900, 640), "light", **options))

    return open_


def places(window, k):
    return {bird: (round(mark.x), round(mark.y)) for bird, mark in window.album.birds(k).items()}


def test_birds_are_found_and_keep_their_numbers_through_the_frames(tmp_path, open_window):
    window = open_window(film(tmp_path))
    assert all(places(window, k) == {b: (x + 3 * k, y + 2 * k) for b, (x, y) in enumerate(V)} for k in range(4))
    assert "V: two straight arms" in window.kind.said


def test_a_bird_that_is_added_is_carried_on_but_not_into_frames_somebody_has_touched(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("end")
    window.click((30, 260))
    window.key("home")
    window.click((60, 220))
    assert [len(places(window, k)) for k in range(4)] == [10, 10, 10, 10]
    assert places(window, 2)[10] == (66, 224)
    assert places(window, 3)[9] == (30, 260)
    window.key("z", "ctrl")
    assert [len(places(window, k)) for k in range(4)] == [9, 9, 9, 10]
    window.key("z", "ctrl", "shift")
    assert len(places(window, 0)) == 10


def test_a_bird_that_is_removed_does_not_come_back_in_later_frames(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("right")
    window.click(places(window, 1)[2], button=3)
    assert [2 in places(window, k) for k in range(4)] == [True, False, False, False]
    assert [len(places(window, k)) for k in range(4)] == [9, 8, 8, 8]
    assert window.album.partly() == {2: 1}


def test_a_bird_that_is_dragged_is_there_and_goes_on_from_there(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.drag(window.at(V[0]), window.at((60, 120)))
    assert np.allclose(places(window, 0)[0], (60, 120), atol=1)
    assert np.allclose(places(window, 3)[0], (69, 126), atol=1)
    assert len(places(window, 3)) == 9  # what it was taken for is no bird


def test_a_number_dragged_onto_another_bird_swaps_them_from_there_on(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("right")
    old = [places(window, k) for k in range(4)]
    window.drag(window.number(1), window.at(places(window, 1)[6]))
    assert places(window, 0) == old[0]
    assert all(places(window, k)[1] == old[k][6] and places(window, k)[6] == old[k][1] for k in (1, 2, 3))


def test_a_click_where_a_bird_was_lost_finds_it_again_with_its_number(tmp_path, open_window):
    window = open_window(film(tmp_path, without={1: 3}))
    assert [3 in places(window, k) for k in range(4)] == [True, False, False, False]
    window.key("right")
    window.click((V[3][0] + 3, V[3][1] + 2))
    assert places(window, 3)[3] == (V[3][0] + 9, V[3][1] + 6)
    assert window.album.partly() == {}


def test_what_was_saved_is_extracted_and_taken_up_again(tmp_path, open_window):
    paths = film(tmp_path)
    window = open_window(paths)
    window.click(places(window, 0)[8], button=3)
    window.drag(window.at(V[7]), window.at((V[7][0] + 4, V[7][1] + 3)))
    assert window.album.dirty
    window.key("s", "ctrl")
    assert not window.album.dirty
    done = CliRunner().invoke(commands, ["formation", "extract", str(window.out), "--json"])
    assert done.exit_code == 0, done.output
    assert done.output.count('"kind": "V"') == 4
    again = Album(read_frames(paths))
    again.load(window.out)
    assert [again.birds(k).keys() for k in range(4)] == [window.album.birds(k).keys() for k in range(4)]
    assert not again.dirty


def test_one_photograph_works(tmp_path, open_window):
    window = open_window(film(tmp_path, 1))
    assert window.slider is None
    window.click((30, 30))
    window.key("s", "ctrl")
    assert len(window.out.read_text().splitlines()) == 11


def test_unsaved_marks_are_asked_about(tmp_path, open_window):
    window = open_window(film(tmp_path, 1))
    window.click((30, 30))
    window.post(pygame.QUIT)
    assert window.running and window.dialog.alive()
    window.key("escape")
    assert window.running
    window.post(pygame.QUIT)
    window.key("return")
    assert not window.running and window.out.exists()


def test_nothing_is_written_where_nothing_can_be(tmp_path, open_window):
    window = open_window(film(tmp_path, 1))
    window.out = tmp_path / "away" / "marks.csv"
    assert not window.save()
    assert "marks.csv" in window.toasts.log[-1].text and window.toasts.log[-1].kind == "error"


def test_marks_of_other_pictures_are_not_overwritten(tmp_path):
    (tmp_path / "m.csv").write_text("frame,bird,x_px,y_px\nother.png,0,3,4\n")
    with pytest.raises(ProblemsError, match="no marks for these pictures"):
        Album(read_frames(film(tmp_path, 1))).load(tmp_path / "m.csv")


def test_the_command_opens_a_window_and_says_what_is_wrong(tmp_path, monkeypatch):
    runner, paths = CliRunner(), [str(path) for path in film(tmp_path, 2)]
    out = ["--out", str(tmp_path / "m.csv")]
    assert runner.invoke(commands, ["formation", "mark", *paths, *out, "--frames", "2"]).exit_code == 0
    (tmp_path / "no.png").write_text("no picture")
    done = runner.invoke(commands, ["formation", "mark", str(tmp_path / "no.png"), *out])
    assert isinstance(done.exception, ProblemsError) and "is not a readable picture" in str(done.exception)
    monkeypatch.setattr("flockbrush.studio.start_marking.missing_display", lambda: "none")
    assert runner.invoke(commands, ["formation", "mark", *paths, *out], standalone_mode=False).return_value == 2
