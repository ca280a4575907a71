"""The window over a film: scrubbed, marked, painted, put right and sketched in by hands, saved and taken up again."""

import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pygame
import pytest
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app as commands
from flockbrush.film.bird_marks import Birds
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film, Sky
from flockbrush.film.tracks import read_tracks
from tests.clip_film import STARTS, STEPS, bird_film, numbered_film
from tests.play.window import MODS, NAMES

from flockbrush.studio.film.clip_window import ClipWindow  # isort: skip  # the window of the tests has no screen
from flockbrush.studio.lift_window import LiftWindow  # isort: skip


class Hands(ClipWindow):
    """The window, with hands; places are pixels of the film."""

    def post(self, kind, **values):
        pygame.event.post(pygame.event.Event(kind, **values))
        self.frame(1 / 30)

    def pixel(self, place):
        x, y = self.at(place)
        return round(x + self.area.x), round(y + self.area.y)

    def click(self, place, button=1):
        for kind in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
            self.post(kind, pos=self.pixel(place), button=button)

    def drag(self, *places, steps=5):
        self.drag_pixels(*(self.pixel(place) for place in places), steps=steps)

    def drag_pixels(self, *pixels, steps=5):
        """Between pixels of the window."""
        self.post(pygame.MOUSEBUTTONDOWN, pos=pixels[0], button=1)
        for a, b in zip(pixels, pixels[1:], strict=False):
            for share in np.arange(1, steps + 1) / steps:
                pos = tuple(np.round(np.add(a, np.subtract(b, a) * share)).astype(int).tolist())
                self.post(pygame.MOUSEMOTION, pos=pos, rel=(0, 0), buttons=(1, 0, 0))
        self.post(pygame.MOUSEBUTTONUP, pos=pixels[-1], button=1)

    def key(self, text):
        *mods, name = text.split("+")
        code = pygame.key.key_code(NAMES.get(name, name))
        self.post(pygame.KEYDOWN, key=code, mod=sum(MODS[m] for m in mods), unicode="")

    def push(self, text):
        """Press the button with these words."""
        button = next(b for b in [*self.column.buttons, *self.buttons] if b.text == text)
        for kind in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
            self.post(kind, pos=button.rect.center, button=1)
        self.frame(1 / 30)

    def answer(self, text):
        """Press the button of the question that is asked."""
        self.dialog.answer(next(button for button in self.dialog.answers if button.text == text))
        self.frame(1 / 30)

    def wait(self, seconds=60):  # by the clock, which others use up too: who hangs is caught all the same
        """Until no work goes on beside the window."""
        end = time.monotonic() + seconds
        while self.jobs and time.monotonic() < end:
            self.frame(1 / 30)
        assert not self.jobs
        self.frame(1 / 30)

    def said(self):
        return [toast.text for toast in self.toasts.log]


@pytest.fixture(scope="module")
def sky_clip(tmp_path_factory):
    return bird_film(tmp_path_factory.mktemp("clips") / "birds.avi")


@pytest.fixture
def open_window(tmp_path, shown):
    def open_(film, mode="view", load=False, **options):
        book = Book(film, tmp_path / "out")
        if load:
            book.load()
        return shown(Hands(book, (900, 640), "light", mode=mode, **options))

    return open_


def true(k):
    """Where the birds of the film are in a frame."""
    return np.add(STARTS, np.multiply(STEPS, k))


def whose(window, k):
    """Number of the bird at each true place of a frame."""
    here = window.book.state.birds.at(k)
    near = lambda at: [bird for bird, place in here.items() if np.hypot(*np.subtract(place, at)) < 4]  # noqa: E731
    return [(near(at) or [None])[0] for at in true(k)]


# time -----------------------------------------------------------------------------------


def test_keys_and_strip_scrub_and_space_plays_to_the_end(sky_clip, open_window):
    window = open_window(Film(sky_clip))
    for key, k in (("right", 1), ("pagedown", 11), ("left", 10), ("end", 39), ("pageup", 29), ("home", 0)):
        window.key(key)
        assert window.k == k
    strip = window.bar.strip
    window.drag_pixels((strip.x, strip.centery), (strip.centerx, strip.centery))
    assert abs(window.k - 20) <= 1
    window.key("space")
    for _ in range(60):
        window.frame(1 / 30)
    assert window.k == 39 and not window.playing
    window.key("space")
    window.frame(1 / 30)
    assert window.playing and window.k <= 2
    assert "frame" in window.bar.clock.said and " s" in window.bar.clock.said


def test_the_wheel_zooms_about_the_mouse_and_a_drag_moves_the_view(sky_clip, open_window):
    window = open_window(Film(sky_clip))
    at = window.pixel((160, 90))
    window.view.wheel(5, window._inside(at), window.film.size, window.area)
    assert np.allclose(window.place(window._inside(at)), (160, 90), atol=1)
    before = window.zoom
    window.drag((160, 90), (140, 80))
    assert np.allclose(window.place(window._inside(at)), (180, 100), atol=1) and window.zoom == before
    window.key("0")
    assert window.view.zoom == 1


def test_the_part_that_is_used_is_told_to_the_command(sky_clip, open_window):
    window = open_window(Film(sky_clip))
    window.go(5)
    window.key("i")
    window.go(30)
    window.key("o")
    assert "--frames 5:30" in window.book.learn_line()
    window.push("All")
    assert "--frames" not in window.book.learn_line()


def test_marks_are_kept_elsewhere_if_their_folder_is_gone_when_the_program_ends(sky_clip, open_window, tmp_path):
    window = open_window(Film(sky_clip))
    window.use_to()
    window.go(5)
    window.key("i")
    (tmp_path / "out").write_text("a file in the way")
    told = window.leave(keep=True)
    saved = Path(told.splitlines()[-1].split(": marks were saved")[0])
    assert "out" in told.splitlines()[0] and saved.name.endswith(".marks.toml") and "first = 5" in saved.read_text()
    shutil.rmtree(saved.parent)


# herds ----------------------------------------------------------------------------------


def test_rectangles_are_followed_shown_and_told_to_the_command(tmp_path, open_window):
    window = open_window(Film(numbered_film(tmp_path / "n.avi", 10)), "landmarks")
    window.key("right")
    window.drag((66, 76), (96, 110))
    window.drag((20, 120), (50, 150))
    window.wait()
    assert "--landmark 1:66,76,30,34 --landmark 1:20,120,30,30" in window.book.learn_line()
    assert window.ground.motion(1, 5) is not None
    window.click((80, 90), button=3)
    assert len(window.book.state.marks.landmarks) == 1
    window.key("ctrl+z")
    assert len(window.book.state.marks.landmarks) == 2
    for x in (100, 140, 180):
        window.drag((x, 60), (x + 24, 84))
    assert len(window.mode.rows) == 5 and window.mode.rows[4].text.startswith("5: frame 1")


def test_obstacles_and_regions_are_painted_erased_filled_and_undone(sky_clip, open_window):
    window = open_window(Film(sky_clip), "mask")
    window.mode.set_size(20)
    window.drag((40, 90), (280, 90))
    walls = window.book.state.obstacles.array
    assert walls[90, 160] == 1 and walls[60, 160] == 0
    window.key("e")
    window.drag((160, 60), (160, 120))
    assert window.book.state.obstacles.array[90, 160] == 0
    window.push("Regions")
    window.mode.take_region(3)
    window.key("b")
    window.click((50, 50), button=3)
    assert (window.book.state.regions.array == 3).all()
    window.key("ctrl+z")
    window.key("ctrl+z")
    window.key("ctrl+z")
    assert window.book.state.obstacles.blank and window.book.state.regions.blank and not window.book.dirty


def test_paint_follows_the_ground_when_the_camera_moves(sky_clip, open_window):
    window = open_window(Film(sky_clip), "mask")
    window.mode.set_size(10)
    window.mode._to_first = lambda: np.array([[1.0, 0, 0], [0, 1, 0]]) + [[0, 0, 30], [0, 0, 0]]
    window.click((100, 90))
    assert window.book.state.obstacles.array[90, 130] == 1 and window.book.state.obstacles.array[90, 100] == 0


def test_a_click_takes_the_bodys_colour_and_a_drag_its_length(sky_clip, open_window):
    window = open_window(Film(sky_clip), "body")
    window.click(true(0)[2])
    assert np.abs(np.subtract(window.book.state.marks.body_colour, (40, 45, 50))).max() < 12
    x, y = true(0)[2]
    window.drag((x - 6, y), (x + 6, y))
    assert window.book.state.marks.body_length == pytest.approx(12, abs=0.6)
    assert 0 < window.mode._masked().mean() < 0.02
    window.push("Detect colour")
    assert window.book.state.marks.body_colour is None


# birds ----------------------------------------------------------------------------------


@pytest.fixture
def bird_window(sky_clip, open_window):
    window = open_window(Film(sky_clip), "birds")
    window.push("Track birds")
    window.wait()
    return window


def test_birds_are_followed_while_the_window_lives(bird_window):
    assert len(bird_window.book.state.birds.ids) == 3
    assert whose(bird_window, 0) == whose(bird_window, 39) and None not in whose(bird_window, 20)
    bird_window.key("ctrl+z")
    assert not bird_window.book.state.birds.ids


def test_a_bird_dragged_onto_another_is_followed_on_as_that_one(bird_window):
    names = whose(bird_window, 0)
    bird_window.go(30)
    bird_window.drag(true(30)[0], true(30)[0] + (0, 30))  # away: the patch becomes another bird
    assert bird_window.book.state.birds.pending == 30
    bird_window.drag(true(30)[0] + (0, 30), true(30)[0])
    bird_window.key("f")
    bird_window.wait()
    assert whose(bird_window, 39) == names and bird_window.book.state.birds.pending is None


def test_a_number_dragged_onto_another_bird_swaps_them(bird_window):
    a, b, c = whose(bird_window, 5)
    bird_window.go(5)
    bird_window.frame(1 / 30)
    label = bird_window.mode._labels[a].move(bird_window.area.topleft).center
    bird_window.drag_pixels(label, bird_window.pixel(true(5)[1]))
    assert whose(bird_window, 4)[:2] == [a, b] and whose(bird_window, 6)[:2] == [b, a]


def test_the_number_of_a_track_that_broke_off_is_dragged_onto_its_other_half(bird_window):
    bird, *others = whose(bird_window, 0)
    birds = bird_window.book.state.birds
    px, n = np.concatenate([birds.px, np.full_like(birds.px[:, :1], np.nan)], axis=1), birds.ids.index(bird)
    px[20:, -1], px[15:, n] = px[20:, n], np.nan
    bird_window.book.do("broken", "birds", 0, birds=replace(birds, px=px, ids=(*birds.ids, 90)))
    bird_window.go(22)
    bird_window.frame(1 / 30)
    label = bird_window.mode._labels[bird].move(bird_window.area.topleft).center
    bird_window.drag_pixels(label, bird_window.pixel(true(22)[0]))
    assert bird_window.book.state.birds.ids == birds.ids and whose(bird_window, 39) == [bird, *others]
    bird_window.key("ctrl+z")
    assert whose(bird_window, 39) == [90, *others]


def test_who_is_chosen_is_removed_from_here_on_or_altogether(bird_window):
    bird = whose(bird_window, 0)[2]
    bird_window.go(10)
    bird_window.click(true(10)[2])
    assert bird_window.mode.selected == bird
    bird_window.push("No bird from here on")
    assert bird_window.book.state.birds.sights()[bird] == 10
    assert bird_window.mode.breaks() == [9]
    bird_window.key("ctrl+z")
    bird_window.push("Never a bird")
    assert bird not in bird_window.book.state.birds.ids
    bird_window.key("ctrl+z")
    bird_window.click(true(bird_window.k)[2], button=3)
    assert whose(bird_window, bird_window.k + 1)[2] is None


def test_who_never_was_a_bird_does_not_rename_the_others(bird_window):
    names = whose(bird_window, 0)
    bird_window.go(20)
    bird_window.click(true(20)[0])
    bird_window.push("Never a bird")
    before = bird_window.book.state.birds
    bird_window.key("f")
    bird_window.wait()
    after = bird_window.book.state.birds
    assert after is not before and after.ids == tuple(sorted(names[1:]))
    assert np.array_equal(after.px[:20], before.px[:20], equal_nan=True)
    assert whose(bird_window, 39) == [None, *names[1:]]
    bird_window.go(0)
    bird_window.key("f")  # all birds anew: it asks
    bird_window.answer("Cancel")
    assert bird_window.book.state.birds is after


def test_a_click_on_the_sky_is_a_new_bird(bird_window):
    bird_window.click((250, 20))
    assert len(bird_window.book.state.birds.ids) == 4


def test_what_was_followed_for_a_state_that_is_gone_is_not_taken(bird_window):
    bird_window.go(20)
    bird_window.mode.follow()
    bird_window.click((250, 20))
    birds = bird_window.book.state.birds
    bird_window.wait()
    assert bird_window.book.state.birds is birds and "in the meantime" in " ".join(bird_window.said())


def test_corrections_of_the_window_are_those_of_the_command(bird_window, sky_clip, tmp_path):
    bird_window.click(true(0)[2], button=3)
    bird_window.key("f")
    bird_window.answer("Track again")
    bird_window.wait()
    bird_window.key("ctrl+s")
    out = tmp_path / "again.csv"
    correct = str(bird_window.book.place("corrections.csv"))
    done = CliRunner().invoke(commands, ["track", str(sky_clip), "--out", str(out), "--correct", correct])
    assert done.exit_code == 0, done.output
    mine, again = read_tracks(bird_window.book.place("tracks.csv")), read_tracks(out)
    assert len(mine.ids) == len(again.ids) == 2
    assert np.allclose(mine.px, again.px[: len(mine.px)], atol=0.01, equal_nan=True)


# sketches -------------------------------------------------------------------------------


def test_paths_drawn_on_an_empty_sky_become_tracks(open_window):
    window = open_window(Sky((640, 360), 60))
    window.push("Sketch")
    for y in (80, 160, 240):
        window.drag((60, y), (300, y + 30), (560, y), steps=12)
    assert len(window.book.state.sketch.paths) == 3
    window.push("As drawn")
    window.key("ctrl+s")
    tracks = read_tracks(window.book.place("sketch.csv"))
    assert tracks.px.shape == (60, 3, 2) and np.abs(tracks.px[0, 0] - (60, 80)).max() < 20
    window.click((300, 110), button=3)
    assert len(window.book.state.sketch.paths) == 2
    window.mode.set_length(33.0)
    window.frame(1 / 30)
    assert len(window.film) == 33
    window.key("ctrl+z")
    window.frame(1 / 30)
    assert len(window.film) == 60
    window.drag((60, 160), (60, 200))
    assert window.book.state.sketch.paths[0].points[0][1] == pytest.approx(200, abs=2)


def test_a_slide_after_undo_or_saving_is_a_step_of_its_own(open_window):
    window = open_window(Sky((640, 360), 60), "sketch")
    usual = window.book.state.sketch.smooth
    for smooth in (0.2, 0.3):  # one slide
        window.mode.set_smooth(smooth)
    window.drag((60, 80), (300, 110), (560, 80), steps=12)
    window.key("ctrl+z")
    window.mode.set_smooth(0.9)
    assert window.book.redo() is None and window.book.state.sketch.smooth == 0.9
    window.key("ctrl+s")
    window.mode.set_smooth(0.7)
    for smooth in (0.9, 0.3, usual):
        window.book.undo()
        assert window.book.state.sketch.smooth == smooth
    window.book.redo()
    assert window.book.state.sketch.smooth == 0.3  # where the slide ended


def test_a_sketch_is_lifted_and_shown_in_place_of_the_clip_until_it_is_closed(open_window, monkeypatch):
    window, flights = open_window(Sky((640, 360), 60), "sketch"), []
    window.drag((60, 80), (560, 90))
    window.push("Lift and view")
    assert window.dialog.alive()

    def look(flight, dt):
        flights.append((flight.show.name, len(flight.show), pygame.display.get_caption()[0]))
        flight.quit()

    monkeypatch.setattr(LiftWindow, "frame", look)
    window.dialog.answer(next(iter(window.dialog.answers)))
    assert "horizontal_fov_deg = 60" in window.book.place("camera.toml").read_text()
    window.run(frames=3)
    path = str(window.book.place("sketch.csv"))
    assert flights == [(path, 60, f"{path} – Flight – Flockbrush")]
    assert window.running and pygame.display.get_caption()[0] == window.title()
    window.book.place("camera.toml").unlink()
    window.push("Lift and view")
    assert window.dialog.question.startswith("Horizontal field of view of the camera")


def test_a_sketch_that_cannot_be_lifted_is_a_message(open_window, monkeypatch):
    window = open_window(Sky((640, 360), 60), "sketch")
    window.drag((60, 80), (560, 90))
    window.push("Lift and view")
    window.dialog.answer(next(iter(window.dialog.answers)))
    window.book.place("sketch.csv").write_text("frame,id,x\n")
    window.run(frames=2)
    assert "sketch.csv" in window.said()[-1] and window.running


# files ----------------------------------------------------------------------------------


def test_what_is_not_saved_is_asked_about_and_taken_up_again(sky_clip, open_window):
    window = open_window(Film(sky_clip), "landmarks")
    window.drag((20, 20), (60, 60))
    window.post(pygame.QUIT)
    assert window.running and window.dialog.alive()
    window.key("escape")
    assert window.running
    window.post(pygame.QUIT)
    window.key("return")
    assert not window.running
    again = open_window(Film(sky_clip), load=True)
    assert again.book.state.marks == window.book.state.marks
    again.post(pygame.QUIT)
    assert not again.running


def test_nothing_is_lost_where_nothing_can_be_written(sky_clip, open_window, tmp_path):
    window = open_window(Film(sky_clip), "landmarks")
    window.drag((20, 20), (60, 60))
    (tmp_path / "out").write_text("in the way")
    assert not window.save() and window.book.dirty and window.toasts.log[-1].kind == "error"


def test_every_mode_can_be_had_at_every_size(sky_clip, open_window):
    window = open_window(Film(sky_clip))
    window.book.do("birds", "birds", 0, birds=Birds.none(40).put(0, 1, 50, 50))
    for size in ((1600, 1000), (480, 360)):
        window.post(pygame.VIDEORESIZE, w=size[0], h=size[1], size=size)
        for number in range(1, 7):
            window.key(str(number))
            assert window.modes[number - 1] is window.mode
    assert window.said() == []


# the command ----------------------------------------------------------------------------


def test_the_command_opens_a_window_and_says_what_is_wrong(tmp_path, monkeypatch, sky_clip):
    runner, out = CliRunner(), ["--out", str(tmp_path / "marks")]
    done = runner.invoke(commands, ["play", "--clip", str(sky_clip), *out, "--frames", "2"])
    assert done.exit_code == 0, done.output
    assert runner.invoke(commands, ["play", "--clip", "sky", *out, "--frames", "2"]).exit_code == 0
    (tmp_path / "notes.mp4").write_text("no film")
    (tmp_path / "cam.toml").write_text("width = 3\n")
    for words, said in (
        (["--clip", str(tmp_path / "notes.mp4")], "is not a readable video"),
        (["--clip", str(tmp_path)], "is a folder"),
        (["--clip", str(sky_clip), "--tracks", str(tmp_path / "no.csv")], "no.csv"),
        (["--clip", str(sky_clip), "--camera", str(tmp_path / "cam.toml")], "height is missing"),
        (["--clip", str(sky_clip), "--out", str(tmp_path / "notes.mp4")], "is a file"),
    ):
        done = runner.invoke(commands, ["play", *words])
        assert isinstance(done.exception, ProblemsError) and said in str(done.exception)
    (tmp_path / "t.csv").write_text("frame,id,x,y\n")
    for words, option, what in (
        (["--clip", str(sky_clip), "--record", "r.flock"], "--record", "a clip"),
        (["meadow", "--tracks", "t.csv"], "--tracks", "a level or a recording"),
        (["meadow", "--unit", "m"], "--unit", "a level or a recording"),
        ([str(tmp_path / "t.csv"), "--text-size", "90"], "--text-size", "tracks"),
    ):
        done = runner.invoke(commands, ["play", *words])
        assert done.exit_code == 2 and option in done.output and f"does not apply to {what}" in done.output
    monkeypatch.setattr("flockbrush.studio.start_clip.missing_display", lambda: "none")
    done = runner.invoke(commands, ["play", "--clip", str(sky_clip), *out], standalone_mode=False)
    assert done.return_value == 2


def test_who_is_interrupted_loses_nothing(sky_clip, tmp_path, monkeypatch):
    from flockbrush.runs.terminal import Stopped
    from flockbrush.studio import start_clip

    def interrupted(window, frames, stop):
        window.book.mark("length", "body", 0, body_length=12.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(ClipWindow, "run", interrupted)
    with pytest.raises((KeyboardInterrupt, Stopped)):
        start_clip.mark_clip(sky_clip, tmp_path / "out", frames=1)
    assert "body_length_px = 12" in (tmp_path / "out" / "birds.marks.toml").read_text()
