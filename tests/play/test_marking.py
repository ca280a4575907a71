"""Marks corrected by hands in the window, carried on, undone, saved and read again."""

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app as commands
from flockbrush.film.picture_marks import PictureBook, PictureFilm
from tests.flock_film import V, film
from tests.play.test_clip_window import Hands


@pytest.fixture
def open_window(tmp_path, shown):
    def open_(paths):
        return shown(Hands(PictureBook(PictureFilm(paths), tmp_path / "marks.csv"), (1100, 640), "light"))

    return open_


def places(window, k):
    return {bird: (round(x), round(y)) for bird, (x, y) in window.book.state.birds.at(k).items()}


def number(window, bird):
    """Where the number of a bird is in the window, pixels."""
    return window.mode._labels[bird].move(window.area.topleft).center


def test_birds_are_found_and_keep_their_numbers_through_the_frames(tmp_path, open_window):
    window = open_window(film(tmp_path))
    assert all(places(window, k) == {b: (x + 3 * k, y + 2 * k) for b, (x, y) in enumerate(V)} for k in range(4))
    assert window.mode.kind.said == "V" and "two straight arms" in window.mode.shape().why


def test_a_bird_that_is_added_is_carried_on_but_not_into_frames_somebody_has_touched(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("end")
    window.click((30, 260))
    window.key("home")
    window.click((60, 220))
    assert [len(places(window, k)) for k in range(4)] == [10, 10, 10, 10]
    assert places(window, 2)[10] == (66, 224)
    assert places(window, 3)[9] == (30, 260)
    window.key("ctrl+z")
    assert [len(places(window, k)) for k in range(4)] == [9, 9, 9, 10]
    window.key("ctrl+shift+z")
    assert len(places(window, 0)) == 10


def test_a_bird_that_is_removed_does_not_come_back_in_later_frames(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("right")
    window.click(places(window, 1)[2], button=3)
    assert [2 in places(window, k) for k in range(4)] == [True, False, False, False]
    assert [len(places(window, k)) for k in range(4)] == [9, 8, 8, 8]
    assert window.book.state.birds.partly() == {2: 1}


def test_a_bird_that_is_removed_is_gone_from_later_frames_that_were_corrected(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("end")
    window.click((30, 260))
    window.key("home")
    window.click(V[2], button=3)
    assert [2 in places(window, k) for k in range(4)] == [False] * 4
    assert [len(places(window, k)) for k in range(4)] == [8, 8, 8, 9]


def test_a_mark_beside_another_bird_is_carried_on(tmp_path, open_window):
    window = open_window(film(tmp_path))
    x, y = V[3]
    window.book.do("add", "formation", 0, birds=window.book.state.birds.put(0, 9, x, y + 10))
    assert [places(window, k)[9] for k in range(4)] == [(x + 3 * k, y + 10 + 2 * k) for k in range(4)]


def test_a_bird_that_is_dragged_is_there_and_goes_on_from_there(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.drag(V[0], (60, 120))
    assert np.allclose(places(window, 0)[0], (60, 120), atol=1)
    assert np.allclose(places(window, 3)[0], (69, 126), atol=1)
    assert len(places(window, 3)) == 9  # what it was taken for is no bird


def test_a_number_dragged_onto_another_bird_swaps_them_from_there_on(tmp_path, open_window):
    window = open_window(film(tmp_path))
    window.key("right")
    old = [places(window, k) for k in range(4)]
    window.drag_pixels(number(window, 1), window.pixel(places(window, 1)[6]))
    assert places(window, 0) == old[0]
    assert all(places(window, k)[1] == old[k][6] and places(window, k)[6] == old[k][1] for k in (1, 2, 3))


def test_a_click_where_a_bird_was_lost_finds_it_again_with_its_number(tmp_path, open_window):
    window = open_window(film(tmp_path, without={1: 3}))
    assert [3 in places(window, k) for k in range(4)] == [True, False, False, False]
    window.key("right")
    window.click((V[3][0] + 3, V[3][1] + 2))
    assert places(window, 3)[3] == (V[3][0] + 9, V[3][1] + 6)
    assert window.book.state.birds.partly() == {}


def test_what_was_saved_is_extracted_and_taken_up_again(tmp_path, open_window):
    paths = film(tmp_path)
    window = open_window(paths)
    window.click(places(window, 0)[8], button=3)
    window.drag(V[7], (V[7][0] + 4, V[7][1] + 3))
    assert window.book.dirty
    window.key("ctrl+s")
    assert not window.book.dirty
    done = CliRunner().invoke(commands, ["formation", "extract", str(window.book.out), "--json"])
    assert done.exit_code == 0, done.output
    assert done.output.count('"kind": "V"') == 4
    again = PictureBook(PictureFilm(paths), window.book.out)
    mine, theirs = again.state.birds, window.book.state.birds
    assert [mine.at(k).keys() for k in range(4)] == [theirs.at(k).keys() for k in range(4)]
    assert not again.dirty


def test_marks_with_gaps_are_kept_when_the_program_is_interrupted(tmp_path, open_window):
    paths = film(tmp_path, 2)
    window = open_window(paths)
    window.key("right")
    for bird in list(places(window, 1))[1:]:
        window.book.do("gone", "formation", 1, birds=window.book.state.birds.remove(1, bird))
    window.book.do("gone", "formation", 0, birds=window.book.state.birds.remove(0, 0))
    window.click((30, 260))
    assert len(window.book.state.birds.partly()) == len(window.book.state.birds.ids) == len(V)
    assert not window.save() and not window.book.out.exists()
    assert window.leave(keep=True) == f"{window.book.out}: marks were saved before the program ended"
    again = PictureBook(PictureFilm(paths), window.book.out)
    assert all(again.state.birds.at(k).keys() == window.book.state.birds.at(k).keys() for k in (0, 1))
    done = CliRunner().invoke(commands, ["formation", "extract", str(window.book.out)])
    assert "has 1 birds, frame" in str(done.exception)


def test_one_photograph_works(tmp_path, open_window):
    window = open_window(film(tmp_path, 1))
    window.click((30, 30))
    window.key("ctrl+s")
    assert len(window.book.out.read_text().splitlines()) == 11


def test_marks_of_other_pictures_are_not_overwritten(tmp_path):
    (tmp_path / "m.csv").write_text("frame,bird,x_px,y_px\nother.png,0,3,4\n")
    with pytest.raises(ProblemsError, match="no marks for these pictures"):
        PictureBook(PictureFilm(film(tmp_path, 1)), tmp_path / "m.csv")


def test_the_command_opens_a_window_and_says_what_is_wrong(tmp_path, monkeypatch):
    runner, paths = CliRunner(), [str(path) for path in film(tmp_path, 2)]
    out = ["--out", str(tmp_path / "m.csv")]
    assert runner.invoke(commands, ["formation", "mark", *paths, *out, "--frames", "2"]).exit_code == 0
    (tmp_path / "no.png").write_text("no picture")
    done = runner.invoke(commands, ["formation", "mark", str(tmp_path / "no.png"), *out])
    assert isinstance(done.exception, ProblemsError) and "is not a readable picture" in str(done.exception)
    monkeypatch.setattr("flockbrush.studio.start_marking.missing_display", lambda: "none")
    assert runner.invoke(commands, ["formation", "mark", *paths, *out], standalone_mode=False).return_value == 2
