"""Many pictures in one: contact sheets of levels, and what a brush does in three looks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_herd import DrawnHerd, checked
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.hud import clock, say
from flockbrush.render.painter import Painter
from flockbrush.render.style import theme_of
from flockbrush.render.text import shortened
from flockbrush.render.view_camera import ViewCamera, checked_size


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


def level_sheet(levels, herds=None, theme="light", thumbnail=(480, 300), columns=None, title=None) -> np.ndarray:
    """A contact sheet of levels, each with its animals if there are `herds` (one `Herd` or None for each level)."""
    levels = list(levels)
    herds = list(herds) if herds is not None else [None] * len(levels)
    pictures = []
    for level, herd in zip(levels, herds, strict=True):
        painter = Painter(level, _within(level, thumbnail), theme, words=False, trails=None)
        frame = painter.ground if herd is None else painter.frame(herd)
        pictures.append((f"{level.name}   {level.width:g} x {level.height:g} m", frame))
    return contact_sheet(pictures, columns, theme, title)


def _within(level, size):
    """The largest picture of a level's proportions inside this size."""
    scale = min(size[0] / level.width, size[1] / level.height)
    return max(8, round(level.width * scale)), max(8, round(level.height * scale))


def preview(herds, times, size=(1280, 460), theme="light", title="", measures=None, trails=4.0) -> np.ndarray:
    """What a brush does, in one picture: the herd at the start, in the middle and at the end, with its trails.

    All three looks have one scale and follow the herd; the grid on the ground stays where it is.

    Parameters
    ----------
    herds : list of Herd
        The animals over time, a few a second or more; the same brush colours in all.
    times : list of float
        Seconds, ascending.
    measures : list of (str or dict), optional
        Of each of the three looks.
    trails : float
        Seconds.

    Returns
    -------
    (h, w, 3) uint8
    """
    size, theme = checked_size(size), theme_of(theme)
    herds, times = [checked(herd) for herd in herds], [float(time) for time in times]
    if not herds or len(herds) != len(times):
        raise ValueError(f"a preview needs herds and as many times, got {len(herds)} and {len(times)}")
    looks = [0, (len(herds) - 1) // 2, len(herds) - 1]
    font = max(11, round(size[1] / 30))
    gap, head = font, round(2.4 * font)
    panel = ((size[0] - 4 * gap) // 3, size[1] - head - gap - round(2.2 * font))
    span = max(_span(herds[k]) for k in looks)
    sheet = np.empty((size[1], size[0], 3), np.uint8)
    sheet[:] = theme.paper
    canvas = Canvas(sheet)
    canvas.words(
        shortened(title, round(1.2 * font), size[0] - 2 * gap),
        (gap, head / 2),
        round(1.2 * font),
        theme.ink,
        anchor=(0, 0.5),
    )
    for k, look in enumerate(looks):
        left = gap + k * (panel[0] + gap)
        sheet[head : head + panel[1], left : left + panel[0]] = _panel(herds, times, look, panel, span, theme, trails)
        below = (left, head + panel[1] + 0.5 * font)
        said = f"{('start', 'middle', 'end')[k]}   {clock(times[look])}"
        wide = canvas.words(said, below, font, theme.ink)
        text = say(measures[k]) if measures else ""
        canvas.words(
            shortened(text, font, panel[0] - wide - font), (left + panel[0], below[1]), font, theme.muted, anchor=(1, 0)
        )
    return sheet


def _centre(herd):
    return np.median(herd.xy, axis=0) if len(herd.xy) else np.zeros(2)


def _span(herd: DrawnHerd) -> float:
    """Metres across that show nearly all of a herd; stragglers may be cut off."""
    if not len(herd.xy):
        return 10.0
    far = np.abs(herd.xy - _centre(herd)).max(axis=1)
    return float(2.3 * np.quantile(far, 0.97) + 6 * np.max(herd.length))


def _panel(herds, times, look, size, span, theme, seconds):
    """One look at the herd, with the trails that led up to it."""
    size = (max(size[0], 8), max(size[1], 8))
    nothing = SimpleNamespace(width=span, height=span, name="")
    painter = Painter(nothing, size, theme, trails=seconds, words=False)
    camera = ViewCamera.fit(span, span, size, centre=tuple(map(float, _centre(herds[look]))))
    painter.look(camera)
    painter.backdrop = _grid(camera, theme)
    first = next(k for k in range(look + 1) if times[k] >= times[look] - seconds)
    for k in range(first, look + 1):
        frame = painter.frame(herds[k], time=times[k], legend=False, title="")
    return frame


def _grid(camera, theme):
    """Bare ground with lines a round number of metres apart, and their distance written in the corner."""
    width, height = camera.size
    image = np.empty((height, width, 3), np.uint8)
    image[:] = theme.ground
    canvas = Canvas(image)
    every = nice(110 / camera.scale)
    low, high = camera.metres((0, height)), camera.metres((width, 0))
    lines = [
        [*camera.pixels((x, low[1])), *camera.pixels((x, high[1]))]
        for x in np.arange(np.ceil(low[0] / every), high[0] / every) * every
    ]
    lines += [
        [*camera.pixels((low[0], y)), *camera.pixels((high[0], y))]
        for y in np.arange(np.ceil(low[1] / every), high[1] / every) * every
    ]
    canvas.segments(lines, 1.0, theme.frame, 0.45)
    font = max(10, round(height / 28))
    canvas.words(
        f"grid {every:g} m",
        (width - 0.6 * font, height - 0.5 * font),
        font,
        theme.muted,
        anchor=(1, 1),
        halo=theme.ground,
    )
    return image
