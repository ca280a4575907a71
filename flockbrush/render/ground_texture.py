"""The picture of a level that lies on the ground of the view in space."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import numpy as np

from flockbrush.render.painter import Painter
from flockbrush.render.view_camera import ViewCamera

TEXTURE = 1536  # pixels of the longer side of a level's picture on the ground
CLOSE = 1536  # pixels of a side of the picture of what one looks at, which is finer
FINER = 1.4  # times finer it must be than the whole to be worth drawing


class Underlay(NamedTuple):
    """What is drawn on a picture of the ground, given that and its `Camera`; `news` changes when it draws otherwise."""

    draw: Callable
    news: Hashable


class GroundTexture:
    """A picture that lies on the ground, in ever smaller sizes, so that what is far does not glitter."""

    def __init__(self):
        self.source, self.stale, self.version = None, True, 0
        self.sizes: list = []
        self.camera: Any = None  # Camera, of the picture
        self.news: Any = None

    def take(self, picture, camera, level, news=None):
        """Take over the part of a picture (h, w, 3) that shows the level, and the camera that drew it."""
        import cv2

        (left, bottom), (right, top) = camera.pixels(((0, 0), (level.width, level.height)))
        left, top = max(round(left), 0), max(round(top), 0)
        right, bottom = min(round(right), camera.size[0]), min(round(bottom), camera.size[1])
        self.stale, self.news = False, news
        self.version += 1
        self.sizes = []
        if right - left < 2 or bottom - top < 2:
            return
        middle = tuple(camera.metres(((left + right) / 2, (top + bottom) / 2)).tolist())
        size = (right - left, bottom - top)
        camera = ViewCamera(middle, camera.scale, size, (0, 0, *size))
        sizes, image = [], picture[top:bottom, left:right]
        while True:
            sizes.append(image)
            height, width = image.shape[:2]
            if max(height, width) <= 16:
                break
            image = cv2.resize(image, (max(1, width // 2), max(1, height // 2)), interpolation=cv2.INTER_AREA)
        self.sizes, self.camera = sizes, camera

    def lay(self, image, view, camera):
        """Draw it on the ground as a camera sees it, in bands of rows: a row is of one depth, and takes one size."""
        left, top, right, bottom = view
        rows = np.arange(top, bottom) + 0.5
        fall = camera.rays(np.column_stack([np.zeros(len(rows)), rows]))[:, 2]
        depth = (camera.eye[2] - camera.floor) / np.maximum(-fall, 1e-9)
        flat = depth / camera.focal  # m of ground in a pixel across, and down
        down = np.minimum(flat * depth / max(camera.eye[2] - camera.floor, 1e-9), 6.0 * flat)
        texels = np.sqrt(flat * down) * self.camera.scale
        level = np.floor(np.log2(np.maximum(texels, 1e-9)) + 0.4)
        level = np.where(fall < -1e-6, np.clip(level, 0, len(self.sizes) - 1), -1).astype(int)
        ends = np.flatnonzero(np.diff(level)) + 1
        for start, stop in zip([0, *ends], [*ends, len(level)], strict=True):
            if level[start] >= 0:
                self._band(image[top + start : top + stop, left:right], level[start], (left, top + start), camera)

    def _band(self, part, level, corner, camera):
        """Draw some rows of the picture, whose upper left pixel is `corner`, from one of the sizes."""
        import cv2

        size = self.sizes[level]
        right, up, ahead = camera.axes
        (mx, my), focal, eye = camera.middle, camera.focal, camera.eye
        # a pixel's ray, then where it meets the ground, then the pixel of the picture there: three matrices
        ray = np.column_stack([right / focal, -up / focal, ahead - right * mx / focal + up * my / focal])
        high = eye[2] - camera.floor
        ground = np.array([[high, 0, -eye[0]], [0, high, -eye[1]], [0, 0, -1.0]])
        own = self.camera
        wide, tall = size.shape[1] / self.sizes[0].shape[1], size.shape[0] / self.sizes[0].shape[0]
        x, y = own.middle
        texel = np.array(
            [
                [own.scale * wide, 0, (x - own.centre[0] * own.scale) * wide - 0.5],
                [0, -own.scale * tall, (y + own.centre[1] * own.scale) * tall - 0.5],
                [0, 0, 1.0],
            ]
        )
        shift = np.array([[1.0, 0, corner[0] + 0.5], [0, 1.0, corner[1] + 0.5], [0, 0, 1.0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        whole = texel @ ground @ ray @ shift
        cv2.warpPerspective(size, whole, part.shape[1::-1], dst=part, flags=flags, borderMode=cv2.BORDER_TRANSPARENT)


def plan_of(level, theme, brushes, live):
    """What draws the ground's picture."""
    scale = TEXTURE / max(level.width, level.height)
    size = [int(np.clip(round(side * scale), 8, TEXTURE)) for side in (level.width, level.height)]
    return Painter(level, size, theme, brushes, trails=None, words=False, labels=False, live=live)


def close_view(plan):
    """What draws a finer picture of a part of the level, in the colours that the whole has."""
    painter = Painter(plan.level, (CLOSE, CLOSE), plan.theme, trails=None, words=False, labels=False, live=plan.live)
    painter.brushes = painter.tiles.brushes = plan.brushes
    return painter


def identity_of(obstacle):
    """What an obstacle's faces depend on."""
    values = (getattr(obstacle, name, None) for name in ("z_min", "z_max", "shape", "blocks_view"))
    corners = getattr(obstacle, "corners", None)
    return (np.asarray(obstacle.polygon).tobytes(), *values, None if corners is None else np.asarray(corners).tobytes())
