"""The animals' rasteriser: oriented, anti-aliased bodies by the ten thousand.

`figure` draws one animal from the distance of each pixel to its outline.  Most animals on a screen look alike but for
place and heading, so `Stamps` keeps sheets of such figures (at 96 headings and quarters of a pixel), and drawing an
animal is laying a small block of bytes over the frame: about 0.1 microseconds.  Animals too large for a sheet are
drawn by `figure` itself, which is also the oracle of the tests.

Birds on the wing have sheets of their own, one for each of five poses of a wing beat.
"""

from __future__ import annotations

import numpy as np

from flockbrush.render.blocks import LANES, lay16
from flockbrush.render.shapes import kernel, over, window
from flockbrush.render.style import Theme, mix

PLAIN, LEADER, PREDATOR, SHADOW = 0, 1, 2, 3
KINDS = 4
DART = 6.0  # pixels; a shorter animal is drawn as a dart, so that its heading can still be seen
SHORTEST = 4.0  # pixels; no dart is shorter
RINGED = 9.0  # pixels; a shorter leader is recoloured, for want of room for a ring
LARGEST = 24.0  # pixels; longer animals are drawn without a sheet, whose memory grows with the square
ROOM = 64  # pixels; no block is wider
HEADINGS, QUARTERS = 96, 4
LENGTHS, RADII = int(2 * LARGEST) + 1, int(2 * LARGEST) + 1  # half pixels of length, quarter pixels of radius
BUDGET = 192 << 20  # bytes of sheets kept
NO_WINGS = -9.0  # instead of a beat
ALOFT, STANDING, POSES = 0, 1, 5  # stances: no shadow of its own, one right under it, and then the poses of a beat
STANCES = 2 + POSES
WINGSPAN = 1.9  # body lengths
SHORTEST_BIRD = 5.0  # pixels of its body
HALVES = 2  # of a pixel: so many poses are to be cut that quarters would be too many
HIDDEN, LARGE = -1, -2  # codes of animals out of sight, and of those without a sheet

_SECTORS = 1024  # per quarter turn


def _compass() -> np.ndarray:
    """The nearest of the sheet's headings for every diamond angle (`_bearing`), (4 * _SECTORS,) int32."""
    part = (np.arange(4 * _SECTORS) + 0.5) / _SECTORS
    quarter, along = part.astype(int), part % 1
    angle = np.arctan2(along, 1 - along) + quarter * np.pi / 2
    return (np.rint(angle * HEADINGS / (2 * np.pi)).astype(np.int32)) % HEADINGS


COMPASS = _compass()


@kernel
def _bearing(fx, fy):
    """Which entry of the compass a direction has: its diamond angle, which takes one division."""
    share = abs(fy) / (abs(fx) + abs(fy))
    if fx >= 0:
        turn = share if fy >= 0 else 4.0 - share
    else:
        turn = 2.0 - share if fy >= 0 else 2.0 + share
    return min(int(turn * 1024), 4095)


@kernel
def _outline(long, thick, kite):
    """Half axis, rear radius and nose radius of an animal so long and thick, all in pixels."""
    if kite:
        long = max(long * 1.2, 10.0)
        rear = max(thick * 1.3, long * 0.27)
        nose = rear * 0.12
        return (long - rear - nose) / 2, rear, nose
    if long < DART:
        long = max(long, SHORTEST)
        rear = max(thick, long * 0.30)
        nose = rear * 0.55
        return max(long - rear - nose, 0.0) / 2, rear, nose
    rear = min(max(thick, long * 0.16), long / 2)
    nose = rear * 0.78
    return max(long - rear - nose, 0.0) / 2, rear, nose


@kernel
def _span(dy, fx, fy, long, wide, reach):
    """Between which offsets in x a row at offset dy can meet the box `long` along and `wide` across the heading."""
    low, high = -reach, reach
    if abs(fx) > 1e-3:
        middle, half = -dy * fy / fx, long / abs(fx)
        low, high = max(low, middle - half), min(high, middle + half)
    if abs(fy) > 1e-3:
        middle, half = dy * fx / fy, wide / abs(fy)
        low, high = max(low, middle - half), min(high, middle + half)
    return low, high


@kernel
def _capsule(frame, clip, x, y, fx, fy, half, rear, nose, body, head, edge, rim, alpha):
    """A capsule from radius `rear` behind to `nose` in front, with a light head end and an edge `rim` pixels wide."""
    wide = max(rear, nose) + 0.5
    reach = abs(fx) * half + wide
    left, right, top, bottom = window(clip, x, y, reach, abs(fy) * half + wide)
    middle, slope = (rear + nose) / 2 + 0.5, (nose - rear) / 2 / max(half, 1e-9)
    neck, soft = 0.30 * half - 0.1 * nose + max(0.5 - 0.1 * half, 0.0), 1.0 / max(0.8, 0.22 * half)
    b0, b1, b2 = body[0], body[1], body[2]
    h0, h1, h2 = head[0] - b0, head[1] - b1, head[2] - b2
    for row in range(top, bottom):
        dy = row + 0.5 - y
        low, high = _span(dy, fx, fy, half + wide, wide, reach)
        for col in range(max(left, int(np.floor(x + low))), min(right, int(np.ceil(x + high)))):
            dx = col + 0.5 - x
            along, aside = dx * fx + dy * fy, dx * fy - dy * fx
            foot = min(max(along, -half), half)
            inside = middle + slope * foot - np.sqrt((along - foot) ** 2 + aside * aside)
            if not (fx != 0 or fy != 0):
                inside = middle - np.sqrt(dx * dx + dy * dy)
            if inside <= 0:
                continue
            light = min(max((along - neck) * soft + 0.5, 0.0), 1.0)
            red, green, blue = b0 + h0 * light, b1 + h1 * light, b2 + h2 * light
            if rim > 0:
                dark = min(max(rim + 1.0 - inside, 0.0), 1.0)
                red += (edge[0] - red) * dark
                green += (edge[1] - green) * dark
                blue += (edge[2] - blue) * dark
            over(frame, row, col, red, green, blue, min(inside, 1.0) * alpha)


@kernel
def _taper(px, py, ax, ay, bx, by, start, stop):
    """How far inside the line from a to b, tapering from radius `start` to `stop`, a point lies."""
    dx, dy = bx - ax, by - ay
    t = min(max(((px - ax) * dx + (py - ay) * dy) / max(dx * dx + dy * dy, 1e-9), 0.0), 1.0)
    return start + (stop - start) * t - np.sqrt((px - ax - t * dx) ** 2 + (py - ay - t * dy) ** 2)


@kernel
def _silhouette(frame, clip, x, y, fx, fy, long, beat, grown, body, head, edge, rim, alpha):
    """A bird from above, `grown` pixels larger all around; the head is light, and so is the wings' middle."""
    spread, sweep = np.cos(0.75 * beat), 0.11 * beat * long
    wing = 0.5 * WINGSPAN * long * spread
    wrist, hand = 0.12 * long - 0.3 * sweep, -0.16 * long - sweep  # how far ahead wrist and wing tip are
    more = min(max(0.6 - 0.03 * long, 0.1), 0.45)  # small ones need their room for colour
    arm, tip = 0.105 * long + more, 0.03 * long + 0.7 * more
    thick = 0.09 * long + 0.2 + more
    reach = np.sqrt(wing * wing + 0.09 * long * long) + 0.15 * long + grown + 1.5
    left, right, top, bottom = window(clip, x, y, reach, reach)
    wide = max(wing, 0.1 * long) + tip + 0.15 * long + grown + 1.0
    deep = max(abs(hand) + tip, 0.36 * long + thick) + grown + 1.0
    for row in range(top, bottom):
        dy = row + 0.5 - y
        low, high = _span(dy, fx, fy, deep, wide, reach)
        for col in range(max(left, int(np.floor(x + low))), min(right, int(np.ceil(x + high)))):
            dx = col + 0.5 - x
            along, aside = dx * fx + dy * fy, abs(dx * fy - dy * fx)
            inside = _taper(aside, along, 0.0, 0.06 * long, 0.42 * wing, wrist, 1.15 * arm, arm)
            if aside < 2 * thick + grown + 1:
                inside = max(
                    inside, _taper(aside, along, 0.0, -0.36 * long, 0.0, 0.36 * long, 0.8 * thick, 0.85 * thick),
                    _taper(aside, along, 0.0, 0.02 * long, 0.0, 0.12 * long, 1.35 * thick, thick),
                )  # fmt: skip
            if aside > 0.42 * wing - arm - grown - 1:
                inside = max(inside, _taper(aside, along, 0.42 * wing, wrist, wing, hand, arm, tip))
            inside += 0.5 + grown
            if inside <= 0:
                continue
            light = min(max((along - 0.24 * long) * 0.9 + 0.5, 0.0), 1.0) if aside < 1.5 * thick + grown else 0.0
            dark = 0.55 * min(max(aside / wing - 0.45, 0.0) * 2.2, 1.0)
            if rim > 0:
                dark = max(dark, min(max(rim + 1.0 - inside, 0.0), 1.0))
            red, green, blue = (
                body[0] + (head[0] - body[0]) * light,
                body[1] + (head[1] - body[1]) * light,
                body[2] + (head[2] - body[2]) * light,
            )
            over(
                frame, row, col, red + (edge[0] - red) * dark, green + (edge[1] - green) * dark,
                blue + (edge[2] - blue) * dark, min(inside, 1.0) * alpha,
            )  # fmt: skip


@kernel
def _bird(frame, clip, x, y, fx, fy, long, kind, beat, colours):
    """A bird with spread wings, or its shadow; see `figure`."""
    long = max(long, SHORTEST_BIRD)
    body, head, edge, mark, dark, shade = colours[0], colours[1], colours[2], colours[3], colours[4], colours[5]
    if kind == SHADOW:
        _silhouette(frame, clip, x, y, fx, fy, long, beat, 0.0, shade, shade, shade, 0.0, 0.5 * colours[6, 0])
        return
    if kind == LEADER:
        ring = min(max(0.07 * long, 0.9), 2.4)
        _silhouette(frame, clip, x, y, fx, fy, long, beat, ring + 0.8, dark, dark, dark, 0.0, 0.85)
        _silhouette(frame, clip, x, y, fx, fy, long, beat, ring, mark, mark, mark, 0.0, 1.0)
        if long < RINGED:
            return
    rim = min(max(0.05 * long - 0.4, 0.0), 1.0)
    _silhouette(frame, clip, x, y, fx, fy, long, beat, 0.0, body, head, edge, rim, 1.0)


@kernel
def figure(frame, clip, x, y, fx, fy, long, thick, kind, grounded, colours, beat=NO_WINGS):
    """Draw one animal `long` and `thick` pixels in size, heading along the unit vector (fx, fy) or (0, 0) for a dot.

    Parameters
    ----------
    kind : int
        PLAIN, LEADER, PREDATOR or SHADOW.
    grounded : bool
        Its shadow lies right under it.
    colours : (7, 3) float64
        Body, head, edge, mark of leaders, dark, shadow; and the shadow's opacity, first in the last row.
    beat : float
        Of a bird on the wing: from -1, wings down, to 1, wings up; else NO_WINGS.
    """
    if beat > NO_WINGS and kind != PREDATOR and (fx != 0 or fy != 0):
        _bird(frame, clip, x, y, fx, fy, long, kind, beat, colours)
        return
    long = max(long, SHORTEST)
    half, rear, nose = _outline(long, thick, kind == PREDATOR)
    if fx == 0 and fy == 0:
        half = 0.0
    x, y = x + fx * (rear - nose) / 2, y + fy * (rear - nose) / 2  # so that both tips are as far off
    body, head, edge, mark, dark, shade = colours[0], colours[1], colours[2], colours[3], colours[4], colours[5]
    opacity = colours[6, 0]
    if (grounded or kind == SHADOW) and opacity > 0:
        lift = 0.10 * long + 0.45 if grounded else 0.0
        wide = rear + 0.2 if kind == SHADOW else rear + 0.3
        _capsule(
            frame, clip, x + 0.8 * lift, y + lift, fx, fy, half, wide, nose + 0.2, shade, shade, shade, 0.0, opacity
        )
    if kind == SHADOW:
        return
    rim = min(rear * 0.34, 1.1) * min(max(rear - 1.1, 0.0), 1.0)  # small ones need their room for colour
    if kind == PLAIN:
        _capsule(frame, clip, x, y, fx, fy, half, rear, nose, body, head, edge, rim, 1.0)
    elif kind == PREDATOR:
        _capsule(frame, clip, x, y, fx, fy, half, rear + 1.1, nose + 1.1, dark, dark, dark, 0.0, 0.95)
        _capsule(frame, clip, x, y, fx, fy, half, rear, nose, body, head, edge, 0.0, 1.0)
    elif long < RINGED:
        _capsule(frame, clip, x, y, fx, fy, half, rear + 1.3, nose + 1.3, dark, dark, dark, 0.0, 0.95)
        _capsule(frame, clip, x, y, fx, fy, half, rear + 0.4, nose + 0.4, mark, head, edge, 0.0, 1.0)
    else:
        ring = min(max(rear * 0.42, 1.3), 3.0)
        _capsule(frame, clip, x, y, fx, fy, half, rear + ring + 0.9, nose + ring + 0.9, dark, dark, dark, 0.0, 0.85)
        _capsule(frame, clip, x, y, fx, fy, half, rear + ring, nose + ring, mark, mark, mark, 0.0, 1.0)
        _capsule(frame, clip, x, y, fx, fy, half, rear, nose, body, head, edge, rim * 0.7, 1.0)


@kernel
def _cut(sheets, source, tall, wide, before, tile, turn, sub, long, thick, kind, grounded, colours, beat, ink):
    """Cut one block of a sheet: the animal at this heading (`turn`) and quarter of a pixel (`sub`).

    Drawn once over black and once over white: what black shows is to be added, and the difference is how much of the
    ground stays.  `tile` (2, side, side, 3) uint8 is room to draw in; `ink` (4,) is told between which rows and chunks
    there is anything.
    """
    clip = np.array([0, 0, wide, tall])
    angle = 2 * np.pi * turn / HEADINGS
    parts = HALVES if beat > NO_WINGS else QUARTERS
    x, y = before + (sub % parts) / parts, before + (sub // parts) / parts
    for shade in range(2):
        tile[shade, :tall, :wide] = 255 * shade
        figure(tile[shade], clip, x, y, np.cos(angle), np.sin(angle), long, thick, kind, grounded, colours, beat)
    chunks = (3 * wide + LANES - 1) // LANES
    ink[0], ink[1], ink[2], ink[3] = tall, 0, chunks, 0
    for row in range(tall):
        for byte in range(chunks * LANES):
            added, white = 0, 255
            if byte < 3 * wide:
                added, white = int(tile[0, row, byte // 3, byte % 3]), int(tile[1, row, byte // 3, byte % 3])
            place = source + (row * chunks + byte // LANES) * 2 * LANES + byte % LANES
            sheets[place] = max(white - added, 0)
            sheets[place + LANES] = added
            if white - added < 255 or added > 0:
                ink[0], ink[1] = min(ink[0], row), row + 1
                ink[2], ink[3] = min(ink[2], byte // LANES), max(ink[3], byte // LANES + 1)


@kernel
def _size(code):
    """Length and radius in pixels of the animals on the sheet of this code."""
    size = code % (LENGTHS * RADII)
    return size // RADII / 2, size % RADII / 4


@kernel
def _beat(code):
    """How high the wings are on the sheet of this code, or NO_WINGS."""
    stance = code // (LENGTHS * RADII) % STANCES
    return (stance - 2) * 2.0 / (POSES - 1) - 1.0 if stance >= 2 else NO_WINGS


@kernel
def sort_out(codes, slots, wanted, clip, at, z, length, radius, look, scale, beats):
    """Which sheet each animal needs: its code, or HIDDEN, or LARGE; returns how many sheets are `wanted` first.

    A code counts look, stance, half pixels of length and quarter pixels of radius; `slots[code]` is the sheet's
    number, -1 for one not cut yet and -2 for one already wanted.  `beats` is as in `figure`.
    """
    missing = 0
    for i in range(len(at)):
        x, y = at[i, 0], at[i, 1]
        long, thick = length[i] * scale, radius[i] * scale
        far = 2 * long + thick + 16
        winged = beats[i] > NO_WINGS and look[i] % KINDS != PREDATOR
        if x < clip[0] - far or x > clip[2] + far or y < clip[1] - far or y > clip[3] + far:
            codes[i] = HIDDEN
            continue
        if long > LARGEST or 4 * thick > RADII - 1 or look[i] < 0:
            codes[i] = LARGE
            continue
        size = max(int(2 * long + 0.5), int(2 * SHORTEST)) * RADII + int(4 * thick + 0.5)
        stance = STANDING if z[i] <= 0 else ALOFT
        if winged:
            stance = 2 + int((min(max(beats[i], -1.0), 1.0) + 1.0) * 0.5 * (POSES - 1) + 0.5)
            size = max(int(2 * long + 0.5), int(2 * SHORTEST_BIRD)) * RADII  # however thick
        code = (look[i] * STANCES + stance) * (LENGTHS * RADII) + size
        codes[i] = code
        if slots[code] == -1:
            slots[code] = -2
            wanted[missing] = code
            missing += 1
    return missing


@kernel
def stamp(
    frame, clip, at, forward, codes, slots, places, sheets, ready, inks, compass, length, radius, look, colours, z,
    scale, beats,
):  # fmt: skip
    """Lay the animals over the frame in the order of their rows.

    Parameters
    ----------
    at : (n, 2) pixels
    forward : (n, 2)
        Headings in the picture's axes, y down.
    codes : (n,) int64
        From `sort_out`; `slots` finds the sheet.
    places : (s, 3) int64
        Of each sheet: where it starts in `sheets`, its side, and the animal's place in it.
    ready : (s, HEADINGS * 16) bool
        Which of a sheet's blocks have been cut; the others are when first needed.
    inks : (s, HEADINGS * 16, 4) int16
        Between which rows and chunks each block has anything.
    colours : (looks, 7, 3) float64
    """
    flat, pitch = frame.reshape(-1), 3 * frame.shape[1]
    tile = np.empty((2, ROOM, ROOM, 3), np.uint8)
    for i in range(len(at)):
        code = codes[i]
        if code == HIDDEN:
            continue
        fx, fy = forward[i, 0], forward[i, 1]
        norm = np.sqrt(fx * fx + fy * fy)
        kind = look[i] % KINDS
        if code == LARGE or norm < 1e-6 or slots[code] < 0:
            fx, fy = (fx / norm, fy / norm) if norm >= 1e-6 else (0.0, 0.0)
            long, thick, grounded = length[i] * scale, radius[i] * scale, z[i] <= 0
            figure(frame, clip, at[i, 0], at[i, 1], fx, fy, long, thick, kind, grounded, colours[look[i]], beats[i])
            continue
        beat = _beat(code)
        parts = HALVES if beat > NO_WINGS else QUARTERS
        qx, qy = int(np.floor(at[i, 0] * parts + 0.5)), int(np.floor(at[i, 1] * parts + 0.5))
        sheet = slots[code]
        side, before = places[sheet, 1], places[sheet, 2]
        chunks = (3 * side + LANES - 1) // LANES
        top, left = qy // parts - before, qx // parts - before
        turn, sub = compass[_bearing(fx, fy)], qy % parts * parts + qx % parts
        block = turn * parts * parts + sub
        source = places[sheet, 0] + block * side * chunks * 2 * LANES
        if not ready[sheet, block]:
            ready[sheet, block] = True
            long, thick = _size(code)
            _cut(
                sheets, source, side, side, before, tile, turn, sub, long, thick, kind, z[i] <= 0, colours[look[i]],
                beat, inks[sheet, block],
            )  # fmt: skip
        inside = left >= clip[0] and top >= clip[1] and top + side <= clip[3]
        if inside and 3 * left + chunks * LANES <= 3 * clip[2]:
            first, last, start, stop = inks[sheet, block]
            for row in range(first, last):
                for chunk in range(start, stop):
                    place = (top + row) * pitch + 3 * left + chunk * LANES
                    lay16(flat, place, sheets, source + (row * chunks + chunk) * 2 * LANES)
        else:
            _lay_clipped(frame, clip, top, left, side, side, sheets, source)


@kernel
def _lay_clipped(frame, clip, top, left, tall, wide, sheets, source):
    """Lay a block that reaches over the clip's edge, byte by byte."""
    chunks = (3 * wide + LANES - 1) // LANES
    for row in range(max(top, clip[1]), min(top + tall, clip[3])):
        for col in range(max(left, clip[0]), min(left + wide, clip[2])):
            for c in range(3):
                byte = 3 * (col - left) + c
                place = source + ((row - top) * chunks + byte // LANES) * 2 * LANES + byte % LANES
                kept = (np.int64(frame[row, col, c]) * sheets[place] + 255) >> 8
                frame[row, col, c] = np.uint8(kept + sheets[place + LANES])


def extent(code: int) -> tuple[int, int]:
    """Pixels from a block's corner to the animal, and the block's side, for the animals of this code."""
    kind, stance = code // (STANCES * LENGTHS * RADII) % KINDS, code // (LENGTHS * RADII) % STANCES
    grounded = stance == STANDING
    long, thick = _size(code)
    if stance > STANDING:
        ring = min(max(0.07 * long, 0.9), 2.4) + 0.8 if kind == LEADER else 0.0
        reach = np.hypot(0.5 * WINGSPAN * np.cos(0.75 * _beat(code)), 0.3) * long + 0.1 * long + ring + 0.7
        reach = max(reach, 0.36 * long + 0.08 * long + ring + 1.5)
        return int(np.ceil(reach)), int(np.ceil(reach)) + int(np.ceil(reach + 1 - 1 / QUARTERS))
    half, rear, _ = _outline(long, thick, kind == PREDATOR)
    mark = (0.0, max(1.3, min(max(rear * 0.42, 1.3), 3.0) + 0.9 if long >= RINGED else 0.0), 1.1, 0.2)[kind]
    shade = (0.10 * long + 0.45 if grounded else 0.0) + 0.3
    reach = half + rear + 0.5
    before = int(np.ceil(reach + mark))
    return before, before + int(np.ceil(reach + max(mark, shade) + 1 - 1 / QUARTERS))


class Stamps:
    """The sheets of one set of brush colours in one theme, cut when first needed."""

    def __init__(self, brush_colours: np.ndarray, theme: Theme):
        self.brush_colours = np.asarray(brush_colours).reshape(-1, 3)
        self.colours = look_colours(self.brush_colours, theme)
        self.halos = halo_colours(self.colours)
        self.slots = np.full(len(self.colours) * STANCES * LENGTHS * RADII, -1, np.int32)
        self.sheets = np.zeros(BUDGET, np.uint8)  # the system gives memory for it page by page, as sheets are cut
        self._forget()

    def _forget(self):
        self.slots[:] = -1
        self.used = 0
        self.places = np.zeros((0, 3), np.int64)
        self.ready = np.zeros((0, HEADINGS * QUARTERS * QUARTERS), np.bool_)
        self.inks = np.zeros((0, HEADINGS * QUARTERS * QUARTERS, 4), np.int16)

    def looks(self, brush: np.ndarray, leader: np.ndarray, predator: np.ndarray) -> np.ndarray:
        """Row of `colours` for each animal, (n,) int64; brushes out of range have the colour of none."""
        known = len(self.brush_colours)
        looks = np.where((brush >= 0) & (brush < known), brush + 1, 0) * KINDS
        return looks + np.where(predator, PREDATOR, leader.astype(np.int64))

    def draw(self, frame, clip, at, forward, length, radius, look, z, scale, beats=None):
        """Draw animals at pixels `at` (n, 2), heading `forward` (n, 2) with y down, in the order of their rows.

        `length`, `radius` and `z` in metres, `scale` in pixels per metre; animals with z <= 0 stand on their shadow.
        `beats` (n,) says how high wings are, as `figure` wants it.
        """
        beats = np.full(len(at), NO_WINGS) if beats is None else beats
        codes = np.empty(len(at), np.int64)
        wanted = np.empty(len(at), np.int64)
        missing = sort_out(codes, self.slots, wanted, clip, at, z, length, radius, look, scale, beats)
        for code in np.sort(wanted[:missing]):
            self._reserve(int(code))
        sheets = (codes, self.slots, self.places, self.sheets, self.ready, self.inks, COMPASS)
        stamp(frame, clip, at, forward, *sheets, length, radius, look, self.colours, z, scale, beats)

    def _reserve(self, code: int):
        """Room for the sheet of this code; when the budget is spent, older sheets go."""
        before, side = extent(code)
        parts = HALVES if code // (LENGTHS * RADII) % STANCES > STANDING else QUARTERS
        bytes_ = HEADINGS * parts * parts * side * -(-3 * side // LANES) * 2 * LANES
        if self.used + bytes_ > BUDGET:
            self._forget()
        self.slots[code] = len(self.places)
        self.places = np.vstack([self.places, np.array([[self.used, side, before]], np.int64)])
        self.ready = np.vstack([self.ready, np.zeros((1, self.ready.shape[1]), np.bool_)])
        self.inks = np.vstack([self.inks, np.zeros((1, *self.inks.shape[1:]), np.int16)])
        self.used += bytes_


def look_colours(brush_colours: np.ndarray, theme: Theme) -> np.ndarray:
    """Colours of every look, ((brushes + 1) * KINDS, 7, 3) float64; the first brush is that of animals without one."""
    none = np.array([mix(theme.muted, theme.ground, 0.25)], float)
    looks = []
    for body in np.concatenate([none, np.asarray(brush_colours, float).reshape(-1, 3)]):
        body = body + (255 - body) * theme.lift
        for kind in range(KINDS):
            skin = np.array(theme.predator, float) if kind == PREDATOR else body
            head = skin + (np.array(theme.head) - skin) * theme.head_share
            edge = skin + (np.array(theme.outline) - skin) * theme.rim
            opacity = (theme.shadow_alpha, 0, 0)
            looks.append([skin, head, edge, theme.leader, theme.outline, theme.shadow, opacity])
    return np.array(looks, float)


def halo_colours(colours: np.ndarray) -> np.ndarray:
    """Colours of the marks that lie under leaders and predators with legs: yellow, and pale in their own colour."""
    halos = colours.copy()
    halos[LEADER::KINDS, :3] = colours[LEADER::KINDS, 3:4]
    skin = colours[PREDATOR::KINDS, 0:1]
    halos[PREDATOR::KINDS, :3] = skin + (255 - skin) * 0.6
    return halos
