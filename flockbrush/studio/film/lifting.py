"""Lifts the tracks of a clip and shows the flight in place of the clip until it is closed."""

from __future__ import annotations

from pathlib import Path

from flockbrush.engine.files import refused, write_text
from flockbrush.lifting.lens import SCHEMA, Camera, check_camera, read_camera

FOV, SPEED = 60.0, 10.0  # degrees, m/s: what is offered where nobody knows
NEAR, FAR = 2.0, 1000.0  # m


class Lifting:
    """Shows a lifted flock over the window of a clip.

    Parameters
    ----------
    window : ClipWindow
    camera : path, optional
        TOML; asked for unless given.
    """

    def __init__(self, window, camera=None):
        self.window, self.camera = window, None if camera is None else Path(camera)

    def begin(self, part):
        """Save, and show the tracks of a part ("tracks.csv" or "sketch.csv") in space."""
        camera = self.camera or self.window.book.place("camera.toml")
        if self.camera is None and not camera.is_file():
            question = "Horizontal field of view of the camera, degrees, and mean speed of the birds, m/s:"
            answers = [("Lift", lambda text: self._with(text, part)), ("Cancel", None)]
            self.window.ask("Camera", question, answers, f"{FOV:g}, {SPEED:g}")
            return
        if slow := check_camera(camera, read_camera(camera), self.window.film):
            self.window.toasts.say(slow)
        if self.window.save():
            self._open(self.window.book.place(part), camera)

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
        lines = [f'schema = "{SCHEMA}"', *(f"{name} = {value}" for name, value in camera.model_dump().items())]
        write_text(place, "\n".join(lines) + "\n")
        self.begin(part)

    def _open(self, tracks, camera):
        from flockbrush.lifting.ground_show import open_show
        from flockbrush.studio.flight_opening import flight_opening

        window = self.window
        read = lambda: open_show(tracks, camera)  # noqa: E731
        size, theme = window.screen.get_size(), window.theme.name
        window.open_over(flight_opening(tracks.name, size, theme, read, "the film"))
