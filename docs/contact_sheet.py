"""Many pictures in one: contact sheets."""

from __future__ import annotations

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.style import theme_of
from flockbrush.render.text import shortened
from flockbrush.render.view_camera import checked_size


def contact_sheet(pictures, columns=None, theme="light", title=None, font=15) -> np.ndarray:
    """Pictures side by side, each with its name below.

    Parameters
    ----------
    pictures : list of (str, (h, w, 3) uint8)
        They need not be of one size: each is centred in its place.
    columns : int, optional
        As many as make the sheet about as wide as a screen, unless given.
    title : str, optional

    Returns
    -------
    (h, w, 3) uint8
    """
    pictures = list(pictures)
    if not pictures:
        raise ValueError("a contact sheet needs at least one picture")
    theme, gap = theme_of(theme), round(1.6 * font)
    tall, wide = (max(picture.shape[side] for _, picture in pictures) for side in (0, 1))
    columns = min(columns or max(1, round(np.sqrt(len(pictures) * 1.6 * tall / wide))), len(pictures))
    rows = [pictures[k : k + columns] for k in range(0, len(pictures), columns)]
    heights = [max(picture.shape[0] for _, picture in row) for row in rows]
    head = 3 * font if title else gap
    step = gap + 2 * font
    size = checked_size((gap + columns * (wide + gap), head + sum(heights) + len(rows) * step))
    sheet = np.empty((size[1], size[0], 3), np.uint8)
    sheet[:] = theme.paper
    canvas = Canvas(sheet)
    if title:
        text = shortened(str(title), round(1.3 * font), size[0] - 2 * gap)
        canvas.words(text, (gap, head / 2), round(1.3 * font), theme.ink, anchor=(0, 0.5))
    top = head
    for row, tall in zip(rows, heights, strict=True):
        for k, (name, picture) in enumerate(row):
            left = gap + k * (wide + gap)
            x, y = left + (wide - picture.shape[1]) // 2, top + (tall - picture.shape[0]) // 2
            sheet[y : y + picture.shape[0], x : x + picture.shape[1]] = picture
            canvas.words(shortened(str(name), font, wide), (left, top + tall + 0.5 * font), font, theme.ink)
        top += tall + step
    return sheet
