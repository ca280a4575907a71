"""The artwork of a map under everything else: its own tiles, where the level stands on them."""

from __future__ import annotations

import numpy as np

THROUGH = 0.35  # share of artwork that is seen where ground was painted over it
_HALVINGS = 8


def draw_art(sketcher):
    """Lay the artwork of a level over its ground, in the box that is being drawn.

    Every pixel takes the nearest pixel of the artwork, of a smaller copy where it is seen from afar: a box drawn alone
    has the pixels that it has in the whole.
    """
    level, camera = sketcher.level, sketcher.camera
    art = getattr(level, "art", None)
    if art is None:
        return
    left, top, right, bottom = sketcher.canvas.clip
    fine = level.cell * camera.scale / art.side  # pixels of a pixel of the artwork
    picture = art.shrunk(min(max(int(np.floor(np.log2(1 / fine))), 0), _HALVINGS))
    xs = camera.metres(np.stack([np.arange(left, right) + 0.5, np.zeros(right - left)], axis=1))[:, 0]
    ys = camera.metres(np.stack([np.zeros(bottom - top), np.arange(top, bottom) + 0.5], axis=1))[:, 1]
    rows = _indices((level.height - ys) / level.height, picture.shape[0])
    over = picture[np.ix_(rows, _indices(xs / level.width, picture.shape[1]))].astype(np.float32)
    over *= _share(level, art, xs, ys)[..., None]
    part = sketcher.image[top:bottom, left:right]
    part[:] = (over[..., 2::-1] + part * (1 - over[..., 3:] / 255) + 0.5).astype(np.uint8)


def _indices(shares, count):
    """Shares of a length as whole numbers below a count."""
    return np.clip((shares * count).astype(int), 0, count - 1)


def _share(level, art, xs, ys):
    """How much of the artwork is seen at pixels, 0 to 1: less where ground was painted over it."""
    painted, live = art.painted, getattr(level, "painted_ground", None)
    if live is not None:
        painted = live if painted is None else live | painted
    if painted is None or not painted.any():
        return np.ones((len(ys), len(xs)), np.float32)
    rows, columns = _indices(ys / level.height, painted.shape[0]), _indices(xs / level.width, painted.shape[1])
    return np.where(painted[np.ix_(rows, columns)], np.float32(THROUGH), np.float32(1))
