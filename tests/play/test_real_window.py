"""The command in a real window of a real screen, with a real mouse: what a designer sees on the desk."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from flockbrush.behaviours.brush import shipped
from small_pasture import pasture

from flockbrush.render.style import theme_of
from flockbrush.studio import thumbnails
from flockbrush.studio.brush_palette import Thumbnails

HOUSE = Path(__file__).parents[2]
MISSING = [tool for tool in ("Xvfb", "xdotool", "tiled") if shutil.which(tool) is None]
PATIENCE = 240  # s for anything; kernels may have to be compiled
SIZE = 800, 600

pytestmark = [
    pytest.mark.tools,
    pytest.mark.skipif(bool(MISSING), reason=f"a real window needs {' and '.join(MISSING)}, not installed here"),
    pytest.mark.skipif(os.name != "posix", reason="Xvfb is of Unix"),
]


@pytest.fixture(scope="module")
def display():
    """The name of a screen that nobody else uses."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1024x768x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as said:
            number = said.readline().strip()  # written as soon as it can be used; "" when it has ended
        if not number:
            pytest.skip("Xvfb does not start here")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Where the playground keeps the pictures of brushes; there are some, so that no window has them made."""
    folder, library = tmp_path_factory.mktemp("pictures"), shipped()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLOCKBRUSH_CACHE", str(folder))
        for brush in map(library.get, library.names()):
            path = thumbnails._path(brush, Thumbnails.SIDE, theme_of("light"), None, None)
            thumbnails._keep(path, thumbnails.placeholder(brush, Thumbnails.SIDE))
    return folder


@pytest.fixture
def desk(display, tmp_path, pictures):
    """Opens windows, and sees to it that none stays."""
    desk = Desk(display, tmp_path, pictures)
    yield desk
    desk.clear()


class Desk:
    """A screen, a mouse and a keyboard, and the playground on it."""

    def __init__(self, display, folder, pictures):
        self.folder, self.path = folder, pasture(folder / "levels", script=False)
        own = {f"FLOCKBRUSH_{name}": str(folder / name) for name in ("CONFIG", "STATE")}
        own["FLOCKBRUSH_CACHE"] = str(pictures)
        screen = {
            "DISPLAY": display,
            "SDL_VIDEODRIVER": "x11",
            "SDL_AUDIODRIVER": "dummy",
            "SDL_MOUSE_FOCUS_CLICKTHROUGH": "1",  # else a click is lost that is heard as soon as that one is looked at
            "FLOCKBRUSH_SCALE": "1",
            "LC_ALL": "C.UTF-8",
        }
        self.env = os.environ | own | screen | {"PYTHONPATH": str(HOUSE)}
        self.env.pop("WAYLAND_DISPLAY", None)
        self.child, self.window = None, ""

    def open(self, *options):
        """Open the level, and wait until the herd can be seen."""
        command = [sys.executable, "-m", "flockbrush", "play", str(self.path), "--brush", "graze", *options]
        command += ["--size", f"{SIZE[0]}x{SIZE[1]}"]
        self.child = subprocess.Popen(
            command, cwd=self.folder, env=self.env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.window = self.until(lambda: self.focused(f"{self.path.stem} – Flockbrush"), "no window")

    def focused(self, title):
        """The number of our window, once it has this title and hears the keyboard; "" before."""
        for window in self.do("search", "--onlyvisible", "--class", "^flockbrush$", check=False).split():
            if self.do("getwindowname", window, check=False).strip() == title:
                self.do("windowfocus", window, check=False)
                if self.do("getwindowfocus", check=False).strip() == window:
                    return window
        return ""

    def do(self, *command, check=True):
        """What xdotool answers."""
        return subprocess.run(
            ["xdotool", *map(str, command)], env=self.env, capture_output=True, text=True, check=check, timeout=PATIENCE
        ).stdout

    def until(self, answer, why):
        """The answer, as soon as there is one."""
        end = time.monotonic() + PATIENCE
        while not (found := answer()):
            assert self.child.poll() is None, self.child.communicate()
            assert time.monotonic() < end, why
            time.sleep(0.2)  # to ask costs processor time, which the window needs
        return found

    def key(self, name):
        self.do("key", "--clearmodifiers", name)

    def stroke(self, release=True):
        """Draw with the left button down, through the middle of the map."""
        x, y = self.middle()
        self.do("mousemove", "--window", self.window, x - 40, y, "mousedown", 1)
        for k in range(-3, 5):
            self.do("mousemove", "--window", self.window, x + 10 * k, y)
        if release:
            self.do("mouseup", 1)

    def middle(self):
        """Where the middle of the map is in the window, pixels."""
        from flockbrush.studio.layout import places

        return places(SIZE, 1.0, True).canvas.center

    def painted(self):
        """Cells of the level file in which something is painted."""
        return painted(self.path)

    def saved(self, wanted):
        """Save until the file is as wanted."""
        self.key("ctrl+s")
        self.until(lambda: bool(self.painted()) == wanted, f"the file should be {'painted' if wanted else 'bare'}")

    def end(self):
        """(exit code, what it said on stderr)."""
        said, errors = self.child.communicate(timeout=PATIENCE)
        assert said == "", said
        return self.child.returncode, "\n".join(line for line in errors.splitlines() if "compiling kernels" not in line)

    def clear(self):
        if self.child is not None and self.child.poll() is None:
            self.child.kill()
            self.child.wait()


def painted(path):
    """Cells of a level file in which a brush is painted, {(column, row)}."""
    found = set()
    for layer in json.loads(Path(path).read_text())["layers"]:
        if layer["type"] == "tilelayer" and "brush" in (layer["name"], layer.get("class")):
            found |= {(k % layer["width"], k // layer["width"]) for k, tile in enumerate(layer["data"]) if tile}
    return found


def test_a_stroke_of_the_mouse_is_undone_redone_saved_also_by_tiled_and_opened_again(desk):
    desk.open()
    desk.stroke()
    desk.saved(True)
    there = desk.painted()
    assert (12, 8) in there and len(there) < 0.5 * 24 * 16
    desk.key("ctrl+z")
    desk.saved(False)
    desk.key("ctrl+shift+z")
    desk.saved(True)
    assert desk.painted() == there
    desk.key("ctrl+q")
    assert desk.end() == (0, "")
    tiled(desk.path, desk.folder)
    assert desk.painted() == there
    desk.open()
    desk.key("ctrl+q")
    assert desk.end() == (0, "") and desk.painted() == there


def test_after_ctrl_c_and_after_a_kill_while_painting_the_work_is_taken_up(desk):
    desk.open()
    desk.stroke()
    desk.key("ctrl+s")
    desk.until(desk.painted, "not saved")
    desk.key("ctrl+z")
    desk.until(lambda: '{"event":"undo"' in journal(desk), "not undone")
    desk.child.send_signal(signal.SIGINT)
    code, errors = desk.end()
    assert code == 130 and "Traceback" not in errors and "unsaved changes are kept" in errors
    desk.open()
    desk.key("Return")  # go on from there
    desk.saved(False)
    before = journal(desk).count('{"event":"do"')
    desk.stroke(release=False)
    desk.until(lambda: journal(desk).count('{"event":"do"') >= before + 3, "nothing painted")
    desk.child.kill()
    assert desk.end()[0] == -signal.SIGKILL and not desk.painted()
    desk.do("mouseup", 1)
    desk.open()
    desk.key("Return")
    desk.saved(True)
    assert (12, 8) in desk.painted() or (10, 8) in desk.painted()
    desk.key("ctrl+q")
    assert desk.end() == (0, "") and not journal(desk)


def journal(desk):
    """What the session that runs has written down of its edits."""
    files = (desk.folder / "STATE").glob("flockbrush/sessions/*/*.journal")
    return "".join(file.read_text() for file in files)


def tiled(path, folder):
    """Have Tiled read the level and write it in its own way."""
    env = os.environ | {"QT_QPA_PLATFORM": "offscreen", "HOME": str(folder), "XDG_RUNTIME_DIR": str(folder)}
    again = path.with_name("again.tmj")
    subprocess.run(
        ["tiled", "--export-map", "json", path, again], env=env, check=True, capture_output=True, timeout=PATIENCE
    )
    again.replace(path)
