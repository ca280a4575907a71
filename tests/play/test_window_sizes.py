"""Pictures of the window, its sizes, and bad use."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pygame
import pytest
from small_pasture import pasture
from window import Window

from flockbrush.cli.main import called
from flockbrush.studio.opening import Opening
from flockbrush.studio.window import Window as StudioWindow

pytestmark = pytest.mark.usefixtures("in_own_folder")
HOUSE = Path(__file__).parents[2]


# pictures -----------------------------------------------------------------------------------


def test_a_screenshot_is_the_window(window):
    window.key("f12")
    (path,) = Path().glob("flockbrush-pasture-*.png")
    assert pygame.image.load(path).get_size() == window.screen.get_size()


def test_a_disk_that_refuses_the_screenshot_is_told(window, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    monkeypatch.setattr(os, "replace", full)
    window.key("f12")
    assert "No space left" in window.said("error")[-1] and not list(Path().glob("*.png"))


def test_a_video_is_recorded_while_one_plays(window):
    import av

    window.key("f9")
    window.session.play()
    window.frames(20)
    window.resize((700, 500))
    window.frames(10)
    window.key("f9")
    (path,) = Path().glob("flockbrush-pasture-*.mp4")
    assert str(path) in window.said()[-1]
    with av.open(str(path)) as file:
        assert sum(1 for _ in file.decode(video=0)) + 2 >= 10


def test_a_disk_that_refuses_the_video_is_told(window, monkeypatch):
    import flockbrush.render

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(flockbrush.render.Video, "write", full)
    window.key("f9")
    window.frames(30)
    window.key("f9")
    assert "No space left" in window.said("error")[-1]


# sizes and bad use ---------------------------------------------------------------------------


SIZES = (200, 200), (200, 600), (420, 300), (900, 600), (1920, 1080)


@pytest.mark.parametrize(("size", "theme"), [*((size, "light") for size in SIZES), ((900, 600), "dark")])
def test_a_window_of_any_size_is_drawn(tmp_path, size, theme):
    window = Window(pasture(tmp_path), size, theme=theme)
    window.drag((12, 3), (14, 3))
    window.key("f1")
    window.frames(2)
    window.key("escape")
    window.frames(2)
    assert window.said("error") == [] and window.screen.get_size() == size
    window.close()


def test_legends_of_overlays_stand_above_the_scale_bar(window):
    bar = window.scale_bar.height(window.canvas.rect.size, window.canvas.camera)
    pictures = []
    for window.overlays in (set(), {"caps"}):
        window.frames(1)
        pictures.append(window.canvas.frame.copy())
    rows = np.nonzero((pictures[0] != pictures[1]).any(axis=(1, 2)))[0]
    assert len(rows) and bar > 20 and rows.max() < window.canvas.rect.height - bar


def test_parts_stand_beside_each_other():
    from flockbrush.studio.layout import places

    for size in [(200, 120), (320, 200), (640, 480), (900, 600), (1280, 720), (1920, 1080), (3840, 2160)]:
        for scale in (0.8, 1.0, 1.5, 3.0):
            place = places(size, scale)
            parts = [p for p in vars(place).values() if p is not None]
            assert sum(p.width * p.height for p in parts) == size[0] * size[1], (size, scale)
            assert all(a is b or not a.colliderect(b) for a in parts for b in parts), (size, scale)


def test_a_stroke_ends_when_the_window_loses_the_mouse(window):
    window.choose("brush", "graze")
    window.press((12, 3))
    window.move((14, 3))
    window.post(pygame.WINDOWFOCUSLOST)
    window.move((20, 3))
    assert window.painted((14, 3)) == "graze" and window.painted((20, 3)) is None
    window.key("ctrl+z")
    assert window.painted((14, 3)) is None


def test_a_stroke_survives_a_change_of_size(window):
    window.choose("brush", "graze")
    window.press((12, 3))
    window.move((14, 3))
    window.post(pygame.VIDEORESIZE, size=(760, 520), w=760, h=520)
    window.move((20, 3))
    window.release((20, 3))
    assert window.painted((14, 3)) == "graze" and window.said("error") == []


def test_the_theme_is_remembered(window, tmp_path):
    window.key("f2")
    assert window.theme.name == "dark"
    other = Window(pasture(tmp_path, "other"), theme=None)
    assert other.theme.name == "dark"
    other.close()


def test_columns_can_be_hidden(window):
    width = window.canvas.rect.width
    window.key("f3")
    assert window.canvas.rect.width > width and window.toolbox is None and window.column is None
    window.key("g")
    window.key("f3")
    assert window.canvas.rect.width == width


def test_words_can_be_read_on_what_they_stand():
    from flockbrush.render.style import THEMES
    from flockbrush.studio.theme import chrome

    def light(colour):
        parts = [(c / 255 / 12.92 if c < 10 else ((c / 255 + 0.055) / 1.055) ** 2.4) for c in colour]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    def contrast(a, b):
        low, high = sorted((light(a), light(b)))
        return (high + 0.05) / (low + 0.05)

    for theme in THEMES.values():
        c = chrome(theme)
        for ink in (c.ink, c.muted, c.accent):
            assert all(contrast(ink, paper) >= 4.5 for paper in (c.panel, c.bar, c.raised)), (theme.name, ink)
        assert contrast(c.on_accent, c.accent) >= 4.5


def test_messages_come_count_and_go(window):
    for _ in range(3):
        window.notify("pasture.tmj:3: object 12 'herd A': " + "long " * 60, "error")
    (toast,) = window.toasts.shown
    window.frames(1)
    assert toast.times == 3 and window.canvas.rect.contains(toast.rect)
    window.post(pygame.MOUSEBUTTONDOWN, pos=toast.rect.center, button=1)
    assert window.toasts.shown == []


def test_without_a_display_there_is_one_sentence_and_code_2(tmp_path):
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")}
    done = subprocess.run(
        [sys.executable, "-m", "flockbrush", "play", "meadow", "--frames", "2"],
        cwd=HOUSE, env=env | {"FLOCKBRUSH_CONFIG": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "no window can be opened" in done.stderr and "Traceback" not in done.stderr


def test_a_size_that_is_none_is_refused(capsys):
    assert called(["play", "meadow", "--size", "huge"]) == 2
    assert "1280x720" in capsys.readouterr().err


def test_ctrl_c_closes_the_window_in_good_order(tmp_path):
    recording = tmp_path / "run.flock"
    child = subprocess.Popen(
        [sys.executable, "-m", "flockbrush", "play", str(pasture(tmp_path)), "--record", str(recording)],
        cwd=HOUSE, env=os.environ | {"FLOCKBRUSH_CONFIG": str(tmp_path)}, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while child.poll() is None and not (recording.exists() and recording.stat().st_size > 10_000):
        time.sleep(0.1)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=240)
    assert child.returncode == 130 and "Traceback" not in err, err


class Shown(StudioWindow):
    """A window that notes its size and closes after some frames."""

    def __init__(self, size, frames):
        super().__init__("light")
        self.size, self.left, self.builds, self.kept = size, frames, 0, None
        self.open(size)

    def build(self):
        self.builds += 1

    def frame(self, dt):
        self.events()
        self.left -= 1
        if not self.left:
            self.quit()

    def leave(self, keep=False):
        self.kept = keep
        return ""


def test_while_the_level_is_opened_the_window_says_so_and_can_be_closed():
    made = []

    def then(result, size):
        made.append((result, Shown(size, 3)))
        return made[-1][1]

    opening = Opening("pasture", (400, 300), "light", lambda: time.sleep(0.2) or "ready", then)
    before = pygame.surfarray.array3d(opening.screen)
    opening.run()
    assert not np.array_equal(before, pygame.surfarray.array3d(opening.screen))
    (result, window) = made[0]
    assert (result, window.size, window.left, window.kept) == ("ready", (400, 300), 0, False)
    opening = Opening("pasture", (400, 300), "light", lambda: time.sleep(30), then)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    opening.run()
    assert len(made) == 1
    opening.close()


def test_a_window_opened_over_another_gives_way_to_it_again():
    below, above = Shown((400, 300), 5), Shown((400, 300), 2)
    below.open_over(above)
    below.run()
    assert (below.left, above.left, above.kept, below.builds) == (0, 0, False, 2)
    below, above = Shown((400, 300), 5), Shown((400, 300), 9)
    below.open_over(above)
    below.run(frames=3, stop=lambda: above.left < 9)
    assert above.kept is True  # interrupted
    below.close()


def test_what_fails_over_a_window_is_a_message_there(monkeypatch):
    monkeypatch.delenv("FLOCKBRUSH_DEBUG", raising=False)
    window = Shown((400, 300), 4)
    opening = Opening("x", (400, 300), "light", lambda: [].remove(1), Shown)
    window.open_over(opening)
    window.run()
    assert "list.remove" in window.toasts.log[-1].text and window.left == 0
    window, above = Shown((400, 300), 4), Shown((400, 300), 9)
    window.open_over(above)
    above.events = lambda: 1 / 0
    window.run()
    assert "ZeroDivisionError" in window.toasts.log[-1].text and (window.left, above.kept) == (0, True)
    opening = Opening("x", (400, 300), "light", lambda: [].remove(1), Shown)
    with pytest.raises(ValueError, match="list.remove"):
        opening.run()
    opening.close()


def test_what_goes_wrong_while_opening_is_told_by_the_command(capsys):
    assert called(["play", "medow"]) == 1
    assert "did you mean 'meadow'" in capsys.readouterr().err


def test_work_that_a_crash_left_is_offered(window, tmp_path):
    from types import SimpleNamespace

    forgotten = []
    window.offer_recovery(SimpleNamespace(discard=lambda: forgotten.append(True)))
    window.push(list(window.dialog.answers)[1])
    assert forgotten == [True]


def test_windows_leave_nothing_behind(tmp_path):
    import gc
    import weakref

    path = pasture(tmp_path)
    left = []
    for _ in range(2):
        window = Window(path)
        left += [weakref.ref(thing) for thing in (window, window.manager, window.session.simulation, window.painter)]
        window.close()
    del window
    gc.collect()
    default = 1  # pygame_gui keeps the first manager there ever was
    assert sum(thing() is not None for thing in left) <= default
