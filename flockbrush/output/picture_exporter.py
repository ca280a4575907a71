"""The base class of picture and video exporters: themes, cameras, clean and transparent pictures."""

from __future__ import annotations

import re

from flockbrush.output.exporter import Exporter, Option

THEME = Option("theme", "light", "Colours of pictures and videos.", ("light", "dark", "vivid"))
PALETTE = Option(
    "palette", "own", "Colours of brushes: their own, or a palette for colour-blind viewers.",
    ("own", "okabe-ito", "tol"),
)  # fmt: skip
LOOKS = (
    THEME,
    Option("view", "plan", "plan: from straight above; space: 3D view that follows the herd.", ("plan", "space")),
    Option(
        "azimuth",
        90.0,
        "With --view space: viewing direction, degrees; 0 is east, 90 is north.",
        low=-360,
        high=360,
        metavar="DEG",
    ),
    Option(
        "elevation",
        None,
        "With --view space: angle of the camera above the horizon, degrees.",
        kind=float,
        low=0,
        high=90,
        metavar="DEG",
    ),
)
CAMERA = Option("camera", None, "Camera with keyframes: a .camera.toml file (see docs/exports.md).", metavar="FILE")
CLEAN = (
    CAMERA,
    Option(
        "overlays", True, "Draw only ground, obstacles and animals: no text, trails or dust.", negated="no_overlays"
    ),
    Option("dust", True, "Draw no dust behind runners and no ripples behind swimmers.", negated="no_dust"),
    Option("size", None, "Size of the picture, pixels, such as 1920x1080.", metavar="WxH"),
)
ALPHA = Option(
    "alpha", False, "Draw only animals and their shadows on a transparent ground: no text, guides or trails."
)


class Pictures(Exporter):
    """Draws every frame, because trails depend on all of them."""

    choices: tuple[Option, ...] = (*LOOKS, PALETTE, *CLEAN)
    labels = False

    @classmethod
    def problems(cls, path, options):
        return [*camera_problems(options), *_size_problems(options.get("size"))]

    def open(self):
        from flockbrush.output.pictures import painter_of

        options = {name: self.options.get(name) for name in ("size", "dust", *(option.name for option in LOOKS))}
        options["size"] = size_of(options["size"])
        options["theme"] = chosen_theme(self.options)
        self.camera = camera_of(self.options)
        if self.camera is not None:
            options["view"] = "space"
        self.space = options["view"] == "space"
        self.clean = options["clean"] = self.options.get("alpha", False) or not self.options["overlays"]
        self._painter = painter_of(self.simulation, **{n: value for n, value in options.items() if value is not None})

    def draw(self, moment):
        """The picture of a moment, (h, w, 3) uint8."""
        measures = _measured(moment) if len(moment) else None
        return self._painter.frame(self._seen(moment), time=moment.time, measures=measures)

    def cut_out(self, moment):
        """The animals of a moment and their shadows alone, (h, w, 4) uint8: opacity last, colours not multiplied."""
        import numpy as np

        herd, pictures = self._seen(moment), []
        for grey in (0, 255):
            self._painter.backdrop = np.full((*self._painter.size[::-1], 3), grey, np.uint8)
            pictures.append(self._painter.frame(herd, time=moment.time).astype(float))
        return matte(*pictures)

    def _seen(self, moment):
        """The animals of a moment for the painter; moves its camera to the place of that moment."""
        from flockbrush.output.pictures import herd_of

        herd = herd_of(self.simulation, moment)
        if self.clean:
            herd = herd._replace(leader=herd.leader & False)  # who leads is a mark of the designer's
        if self.camera is not None:
            self._painter.look(self.camera.at(moment.time, self._painter.size, self._painter.view, self._painter.floor))
        elif self.space and len(moment):
            self._painter.chase(herd, 1 / self.fps if self.frames else None)
        return herd


def matte(on_black, on_white):
    """(h, w, 4) uint8 of what was drawn over black and over white."""
    import numpy as np

    alpha = np.clip(1 - (on_white - on_black).mean(axis=2) / 255, 0, 1)
    colour = on_black / np.maximum(alpha, 1e-6)[..., None]
    return np.dstack([np.where(alpha[..., None] > 0, np.clip(colour, 0, 255), 0), 255 * alpha]).round().astype(np.uint8)


def chosen_theme(options):
    """The requested theme with its palette of brushes."""
    from flockbrush.render.style import theme_of

    return theme_of(options.get("theme") or "light", options.get("palette"))


def camera_of(options):
    """The requested camera with keyframes, or None."""
    if not options.get("camera"):
        return None
    from flockbrush.render.camera_path import read_camera

    return read_camera(options["camera"])


def camera_problems(options) -> list[str]:
    """Problems in a camera file, checked before the run."""
    from flockbrush.engine.problems import ProblemsError

    try:
        camera_of(options)
    except (ProblemsError, OSError) as error:
        return [f"--camera: {line}" for line in str(error).splitlines()]
    return []


def size_of(size):
    """(width, height) of a text as 1920x1080, or of two numbers; None for None."""
    if not isinstance(size, str):
        return size
    width, height = size.lower().split("x")
    return int(width), int(height)


def _size_problems(size):
    if not isinstance(size, str):
        return []
    good = re.fullmatch(r"[0-9]{1,5}[xX][0-9]{1,5}", size) and all(8 <= side <= 16384 for side in size_of(size))
    return [] if good else [f"--size must be WIDTHxHEIGHT, 8 to 16384 pixels each, such as 1920x1080; got {size!r}"]


def _measured(moment):
    """What is written above the ground."""
    from flockbrush.systems.measures import compute_milling, compute_polarization

    return {
        "polarization": compute_polarization(moment.forward),
        "milling": compute_milling(moment.xyz[:, :2], moment.forward),
    }
