"""Lifts the tracks of a clip and opens the flight with `flockbrush play TRACKS --camera CAM`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from flockbrush.engine.files import refused, write_text
from flockbrush.lifting.lens import Camera, read_camera

FOV, SPEED = 60.0, 10.0  # degrees, m/s: what is offered where nobody knows
NEAR, FAR = 2.0, 1000.0  # m


class Lifting:
    """Opens the window of a lifted flock.

    Parameters
    ----------
    window : ClipWindow
    camera : path, optional
        TOML; asked for unless given.
    """

    def __init__(self, window, camera=None):
        self.window, self.camera = window, None if camera is None else Path(camera)
        self._running: list[tuple[subprocess.Popen, object]] = []

    def begin(self, part):
        """Save, and show the tracks of a part ("tracks.csv" or "sketch.csv") in space."""
        if self.camera is None:
            place = self.window.book.place("camera.toml")
            self.camera = place if place.is_file() else None
        if self.camera is None:
            question = "Horizontal field of view of the camera, degrees, and mean speed of the birds, m/s:"
            answers = [("Lift", lambda text: self._with(text, part)), ("Cancel", None)]
            self.window.ask("Camera", question, answers, f"{FOV:g}, {SPEED:g}")
            return
        read_camera(self.camera)
        if self.window.save():
            self._open(self.window.book.place(part))

    def _with(self, text, part):
        """Make the camera that was described."""
        try:
            fov, speed = (float(value) for value in text.replace(";", ",").split(","))
        except ValueError:
            self.window.toasts.say(f"Enter two numbers, such as {FOV:g}, {SPEED:g}, not {text!r}.", "warning")
            return
        film, place = self.window.film, self.window.book.place("camera.toml")
        if not (0 < fov < 180 and 0 < speed <= 1000):
            raise refused(
                place, f"the field of view must be 0 to 180 degrees, the speed 0 to 1000 m/s; got {fov:g} and {speed:g}"
            )
        camera = Camera(
            width=film.size[0], height=film.size[1], horizontal_fov_deg=fov, fps=film.fps, mean_speed=speed,
            near=NEAR, far=FAR,
        )  # fmt: skip
        self.window.book.folder.mkdir(parents=True, exist_ok=True)
        write_text(place, "".join(f"{name} = {value}\n" for name, value in camera.model_dump().items()))
        self.camera = place
        self.begin(part)

    def command(self, tracks):
        """What is run, a list of words."""
        return [sys.executable, "-m", "flockbrush", "play", str(tracks), "--camera", str(self.camera)]

    def _open(self, tracks):
        said = tempfile.TemporaryFile("w+")
        self._running.append((subprocess.Popen(self.command(tracks), stderr=said, stdout=said), said))
        self.window.toasts.say("The flock is lifted; a new window opens.")

    def look(self):
        """Tell when a window of a flock could not be opened."""
        for process, said in list(self._running):
            if process.poll() is None:
                continue
            self._running.remove((process, said))
            said.seek(0)
            text = said.read().strip()
            said.close()
            if process.returncode:
                self.window.toasts.say(text.splitlines()[-1] if text else "The flock could not be lifted.", "error")
