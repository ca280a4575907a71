"""A lifted flight in its window: looked at from all sides, solved anew by sliders, kept."""

import threading
import time

import numpy as np
import pygame
import pytest

from flockbrush.cli.main import called
from flockbrush.lifting.flight_show import Show, with_wish
from flockbrush.lifting.flight_table import read_flight
from tests.flock_in_v import SPAN, geese, seen, written
from tests.play.window import MODS

from flockbrush.studio.app import App  # isort: skip
from flockbrush.studio.lift_window import SETTLE, SLIDERS, LiftWindow  # isort: skip  # the window of the tests has no screen


class Hands(LiftWindow):
    """The window, with hands."""

    def post(self, kind, **values):
        pygame.event.post(pygame.event.Event(kind, **values))
        self.frame(1 / 30)

    def drag(self, start, end, button=1):
        """Between pixels of the window."""
        self.post(pygame.MOUSEBUTTONDOWN, pos=start, button=button)
        for share in (0.5, 1.0):
            pos = tuple(np.round(np.add(start, np.subtract(end, start) * share)).astype(int).tolist())
            self.post(pygame.MOUSEMOTION, pos=pos, rel=(0, 0), buttons=(1, 0, 0))
        self.post(pygame.MOUSEBUTTONUP, pos=end, button=button)

    def key(self, name, *mods):
        self.post(pygame.KEYDOWN, key=pygame.key.key_code(name), mod=sum(MODS[m] for m in mods), unicode="")

    def slide(self, number, way):
        """Move a slider of the column to a place between 0 and 1000."""
        import pygame_gui

        widget = self.column.sliders[number].slider
        self.post(pygame_gui.UI_HORIZONTAL_SLIDER_MOVED, value=way, ui_element=widget)

    def until_solved(self):
        end = time.perf_counter() + 120
        while (self.solver.busy or self._due < np.inf) and time.perf_counter() < end:
            self.frame(0.05)

    def birds_at(self):
        """Pixels of the birds of the frame that is shown."""
        rows = self.show.there(self.k)
        return self.painter.camera.project(self.show.flight.xyz[self.k, rows])[0]


@pytest.fixture
def window(tmp_path):
    tracks, camera = written(tmp_path, seen(geese(11, 50)))
    made = Hands(Show.open(tracks, camera, SPAN), (900, 620), "light")
    pygame.event.get()
    made.playing = False
    made.frame(1 / 30)
    yield made
    made.close()


def test_time_goes_on_and_can_be_stopped_and_stepped_through(window):
    window.key("space")
    for _ in range(6):
        window.frame(0.1)
    assert 10 <= window.k <= 20
    window.key("space")
    k = window.k
    window.frame(0.5)
    assert window.k == k
    window.key("right")
    assert window.k == k + 1
    window.key("end")
    assert window.k == 49
    window.key("right")
    assert window.k == 49


def test_a_drag_goes_round_and_a_right_drag_moves(window):
    before = window.painter.camera
    for button in (1, 2):  # the middle one as in the playground
        window.drag((300, 300), (400, 300), button=button)
        turned = window.painter.camera
        assert turned.azimuth != before.azimuth and turned.target == before.target
        before = turned
    window.drag((300, 300), (400, 300), button=3)
    moved = window.painter.camera
    assert moved.azimuth == turned.azimuth and moved.target != turned.target
    window.key("0")
    at = window.birds_at()
    assert ((at > 0) & (at < window.area.size)).all()


def test_from_the_camera_birds_are_where_they_were_filmed(window):
    window.key("c")
    window.step(25)
    seen_at, px = window.birds_at(), window.show.sight.px[25]
    size = np.array([1280, 720])
    middle = (seen_at - np.array(window.area.size) / 2) / (px - size / 2)
    assert np.allclose(middle, middle.mean(), rtol=1e-6)  # the same picture, of another size
    assert (middle.mean() * size <= window.area.size).all()  # all of it


def test_escape_goes_back_to_the_film_where_no_bird_is_picked(window):
    window.key("escape")
    assert window.running and "Escape" not in window.hint.text  # of the command line, under which there is nothing
    over = Hands(window.show, (900, 620), "light", "the film")
    assert over.hint.text.startswith("Escape: back to the film")
    over.bird = 3
    over.key("escape")
    assert over.bird is None and over.running
    over.key("escape")
    assert not over.running
    over.close()


def test_a_click_picks_a_bird_and_escape_lets_it_go(window):
    window.step(25)
    window.key("0")
    at = window.birds_at()[3]
    window.post(pygame.MOUSEBUTTONDOWN, pos=tuple(np.round(at).astype(int).tolist()), button=1)
    window.post(pygame.MOUSEBUTTONUP, pos=tuple(np.round(at).astype(int).tolist()), button=1)
    assert window.bird in window.show.flight.ids
    assert window.show.about(25, window.bird).startswith(f"bird {window.bird}: ")
    window.key("escape")
    assert window.bird is None


def test_a_slider_solves_the_flight_anew(window):
    before = window.show.flight.depth.copy()
    window.slide(1, 900)
    assert window.wanted.wish.flock > 5
    window.until_solved()
    assert window.show.wanted.wish.flock == window.wanted.wish.flock
    assert not np.allclose(window.show.flight.depth, before)
    assert "solved in" in window.solved.said
    window.reset()
    window.until_solved()
    assert window.show.flight.depth == pytest.approx(before)


def test_all_frames_are_solved_when_the_hand_rests(window):
    window.slide(0, 300)
    window.until_solved()
    whole = window.show.solved(window.wanted)
    assert window.show.flight.depth == pytest.approx(whole.depth)
    assert SETTLE < 1


@pytest.mark.parametrize("key", [key for _, key, *_ in SLIDERS])
def test_every_slider_changes_the_flight(window, key):
    show, base = window.show, with_wish(window.wanted, separation=0.5, separation_distance=5.0)
    value = getattr(base.wish, key)
    assert value > 0
    other = with_wish(base, **{key: 0.5 * value})
    assert show.solved(other).depth != pytest.approx(show.solved(base).depth, rel=1e-6)


def test_the_flight_is_exported_under_the_name_that_is_typed(window, tmp_path):
    window.key("s", "ctrl")
    assert window.dialog.entry.get_text().endswith("tracks.flock.csv")
    window.dialog.entry.set_text(str(tmp_path / "flight.csv"))
    window.key("return")
    window.run(frames=2)
    assert len((tmp_path / "flight.csv").read_text().splitlines()) == 1 + 50 * 11


def test_what_is_kept_is_written_when_the_flight_that_is_wished_is_solved(window, tmp_path, monkeypatch):
    solved, go, wrote = window.show.solved, threading.Event(), tmp_path / "flight.csv"
    monkeypatch.setattr(window.show, "solved", lambda *wish: go.wait(60) and solved(*wish))
    before = window.show.flight
    window.wish("flock", 5.0)
    window._export(wrote)
    window._export(other := tmp_path / "other.csv")
    for _ in range(10):
        window.frame(0.05)
    assert not wrote.exists() and window.show.flight is before and window.solver.busy  # and the window goes on
    go.set()
    window.until_solved()
    assert read_flight(wrote).xyz == pytest.approx(solved(with_wish(window.wanted, flock=5.0)).xyz, abs=1e-5)
    assert other.read_bytes() == wrote.read_bytes()


def slowly(window, monkeypatch):
    """An event; until it is set, nothing is solved."""
    solve, go = window.show.solved, threading.Event()
    monkeypatch.setattr(window.show, "solved", lambda *how: go.wait(60) and solve(*how))
    return go


@pytest.mark.parametrize("keys", [("q", "ctrl"), ("escape",)])
def test_a_window_that_is_closed_finishes_what_waits_to_be_written(window, tmp_path, monkeypatch, keys):
    monkeypatch.setattr(window, "under", "the film")
    out, go = tmp_path / "out.csv", slowly(window, monkeypatch)
    window.slide(0, 1000.0)
    window._export(out)
    window.key(*keys)
    assert window.running and f"{out} will be written when the flight is solved" in window.dialog.question
    window.key("return")
    window.frame(0.05)
    assert window.running and not out.exists()
    go.set()
    window.until_solved()
    window.frame(0.05)
    assert out.exists() and not window.running and window.leave() == ""


def test_what_a_window_has_not_written_is_told(window, tmp_path, monkeypatch, capsys):
    out, go = tmp_path / "out.csv", slowly(window, monkeypatch)
    window.slide(0, 1000.0)
    window._export(out)
    window.leave_saying()
    go.set()
    assert f"not written, since the flight was not solved: {out}" in capsys.readouterr().err


def test_nothing_is_kept_of_a_flight_that_cannot_be_solved(window, tmp_path, monkeypatch):
    def fails(*wish):
        raise ValueError("no such flight")

    monkeypatch.setattr(window.show, "solved", fails)
    window.reset()
    window.wish("flock", 5.0)
    window.until_solved()
    for keep, name in ((window._export, "flight.csv"), (window._brush, "v.brush.toml"), (window._fly, "w.brush.toml")):
        keep(tmp_path / name)
        window.until_solved()
        assert [toast.text for toast in window.toasts.log][-1].startswith("Nothing was written"), name
    assert not [*tmp_path.glob("flight*"), *tmp_path.rglob("*.brush.toml")]


def test_files_that_are_there_are_replaced_only_if_that_is_wished(window, tmp_path):
    mine = tmp_path / "flight.csv"
    mine.write_text("mine")
    for answer, kept in ((-1, True), (0, False)):
        window.key("s", "ctrl")
        window.dialog.entry.set_text(str(mine))
        window.key("return")
        window.run(frames=2)
        assert "flight.csv already exists" in window.dialog.question
        window.dialog.answer(list(window.dialog.answers)[answer])
        assert (mine.read_text() == "mine") == kept
    level = tmp_path / "tracks-v.tmj"
    level.write_text("mine, too")
    window.key("b")
    dialog = window.dialog
    dialog.answer(list(dialog.answers)[1])
    assert "tracks-v.tmj already exists" in window.dialog.question and level.read_text() == "mine, too"
    window.dialog.answer(list(window.dialog.answers)[-1])
    assert level.read_text() == "mine, too" and not (tmp_path / "brushes").exists()


def test_a_name_with_a_wrong_ending_is_told(window, tmp_path):
    window.key("s", "ctrl")
    window.dialog.entry.set_text(str(tmp_path / "flight.obj"))
    window.key("return")
    window.run(frames=2)
    assert any("the file extension of a flight" in toast.text for toast in window.toasts.log)


def test_the_birds_of_a_frame_become_a_brush_and_a_level_that_is_played_in_its_place(window, tmp_path, monkeypatch):
    window.step(25)
    played = []
    monkeypatch.setattr(App, "frame", lambda app, dt: (played.append((app.level_name(), app.brush)), app.quit()))
    window.key("b")
    dialog = window.dialog
    assert dialog.entry.get_text().endswith("tracks-v.brush.toml")
    dialog.answer(list(dialog.answers)[1])
    assert (tmp_path / "tracks-v.tmj").is_file() and (tmp_path / "brushes" / "tracks-v.brush.toml").is_file()
    window.run(frames=3)
    assert played == [("tracks-v", "tracks-v")] and window.running


def test_a_flight_that_was_only_read_is_shown_without_sliders_of_the_solve(window, tmp_path):
    window.show.export(tmp_path / "flock.csv")
    window.close()
    other = Hands(Show.open(tmp_path / "flock.csv"), (900, 620), "dark")
    other.frame(1 / 30)
    assert len(other.column.sliders) == 1
    other.key("c")
    other.key("b")
    other.close()


def test_the_window_can_become_small(window):
    window.post(pygame.VIDEORESIZE, w=500, h=380, size=(500, 380))
    assert window.screen.get_size() == (500, 380)
    window.frame(1 / 30)


def test_play_takes_tracks_with_their_camera(tmp_path):
    tracks, camera = written(tmp_path, seen(geese(4, 20)))
    assert called(["play", str(tracks), "--camera", str(camera), "--frames", "2", "--size", "640x480"]) == 0


def test_play_tells_what_is_missing(tmp_path, capsys):
    tracks, _ = written(tmp_path, seen(geese(4, 20)))
    assert called(["play", str(tracks)]) == 1
    assert "--camera" in capsys.readouterr().err


def test_without_a_display_play_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("flockbrush.studio.start_lift.missing_display", lambda: "none")
    tracks, camera = written(tmp_path, seen(geese(4, 20)))
    assert called(["play", str(tracks), "--camera", str(camera)]) == 2
    assert "flockbrush lift TRACKS" in capsys.readouterr().err


def test_the_letter_that_opens_a_dialog_is_not_typed_into_it(window):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_b, mod=0, unicode="b"))
    pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text="b"))
    window.frame(1 / 30)
    assert window.dialog.entry.get_text().endswith("tracks-v.brush.toml")
    window.post(pygame.KEYUP, key=pygame.K_b, mod=0, unicode="b")
    window.post(pygame.TEXTINPUT, text="b")
    assert window.dialog.entry.get_text() == "b"  # the proposed path was selected, and makes way


def test_the_window_closes_though_a_dialog_asks_something(window):
    window.key("b")
    window.post(pygame.QUIT)
    assert not window.running
