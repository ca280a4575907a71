"""The part of a picture that is visible in the film window."""

from __future__ import annotations

import numpy as np

LARGEST_ZOOM = 24.0  # of the picture's size in the window


class PictureView:
    """The part of a picture that is visible, and its place in the window."""

    def __init__(self):
        self.zoom, self.shift = 1.0, np.zeros(2)

    def matrix(self, picture, area):
        """(scale, left, top): from pixels of the picture to those of the area."""
        scale = min(area.width / picture[0], area.height / picture[1]) * self.zoom
        corner = (np.array(area.size) - np.array(picture) * scale) / 2 + self.shift
        return scale, float(corner[0]), float(corner[1])

    def wheel(self, notches, at, picture, area):
        """Zoom at the mouse pointer."""
        scale, left, top = self.matrix(picture, area)
        point = (at[0] - left) / scale, (at[1] - top) / scale
        self.zoom = float(np.clip(self.zoom * 1.2**notches, 1.0, LARGEST_ZOOM))
        scale, left, top = self.matrix(picture, area)
        self.shift += (at[0] - point[0] * scale - left, at[1] - point[1] * scale - top)
        if self.zoom == 1.0:
            self.shift[:] = 0
