"""Where the ground's metres land in the picture's pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

MAX_SIDE = 16384  # pixels; a larger picture is a slip of the pen, and would take gigabytes


def checked_size(size) -> tuple[int, int]:
    """Width and height as two ints; ValueError when no picture can have them."""
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        raise ValueError(f"a size is (width, height) in pixels, got {size!r}") from None
    if not (8 <= width <= MAX_SIDE and 8 <= height <= MAX_SIDE):
        raise ValueError(f"a picture is 8 to {MAX_SIDE} pixels wide and high, got {width}x{height}")
    return width, height


@dataclass(frozen=True)
class ViewCamera:
    """A view straight down.

    Pixels are counted from the top-left corner, y down; the pixel in column i and row j is centred at
    (i + 0.5, j + 0.5).
    """

    centre: tuple[float, float]  # the point of the ground (m) in the middle of the view
    scale: float  # pixels per metre
    size: tuple[int, int]  # width and height of the picture, pixels
    view: tuple[int, int, int, int]  # left, top, right and bottom of the part of the picture that shows the ground

    @classmethod
    def fit(cls, width: float, height: float, size, view=None, margin: float = 0, centre=None) -> ViewCamera:
        """The camera that shows all of width x height metres, as large as the view allows, in the right proportions.

        The ground starts at (0, 0) unless its `centre` is given; `margin` (pixels) stays free around it.
        """
        size = checked_size(size)
        view = tuple(view or (0, 0, *size))
        if not (np.isfinite([width, height]).all() and width > 0 and height > 0):
            raise ValueError(f"a level has a positive width and height in metres, got {width} x {height}")
        across, down = view[2] - view[0] - 2 * margin, view[3] - view[1] - 2 * margin
        scale = min(max(across, 2) / width, max(down, 2) / height)
        return cls(tuple(centre or (width / 2, height / 2)), float(scale), size, view)

    @property
    def middle(self) -> tuple[float, float]:
        """The pixel position that shows `centre`."""
        return (self.view[0] + self.view[2]) / 2, (self.view[1] + self.view[3]) / 2

    def pixels(self, xy) -> np.ndarray:
        """Pixel positions (..., 2) of points on the ground (..., 2) in metres."""
        xy = np.asarray(xy, float)
        pixels = np.empty((*xy.shape[:-1], 2))
        for k, (centre, middle, scale) in enumerate(
            zip(self.centre, self.middle, (self.scale, -self.scale), strict=True)
        ):  # column by column: four times as quick as both at once
            pixels[..., k] = (xy[..., k] - centre) * scale + middle
        return pixels

    def metres(self, pixels) -> np.ndarray:
        """Points on the ground (..., 2) in metres under pixel positions (..., 2)."""
        return (np.asarray(pixels, float) - self.middle) / (self.scale, -self.scale) + self.centre

    def scale_at(self, xy) -> float:
        """Pixels per metre at a point of the ground: from straight above everywhere the same."""
        return self.scale

    def zoomed(self, factor: float, about=None) -> ViewCamera:
        """The camera nearer by this factor, with the pixel `about` (default the middle) staying over its ground."""
        about = np.array(about or self.middle, float)
        still = self.metres(about)
        scale = self.scale * factor
        centre = still - (about - self.middle) / (scale, -scale)
        return replace(self, scale=float(scale), centre=(float(centre[0]), float(centre[1])))

    def moved(self, right: float, down: float) -> ViewCamera:
        """The camera after the ground has been dragged by so many pixels."""
        east, north = self.centre[0] - right / self.scale, self.centre[1] + down / self.scale
        return replace(self, centre=(east, north))

    def at(self, x: float, y: float) -> ViewCamera:
        """The camera looking at this point (m)."""
        return replace(self, centre=(float(x), float(y)))
