"""The animals' rasteriser: oriented, anti-aliased bodies by the ten thousand.

Most animals on a screen look alike but for
place and heading, so `Stamps` keeps sheets of such figures (at 96 headings and quarters of a pixel), and drawing an
animal is laying a small block of bytes over the frame: about 0.1 microseconds.  Animals too large for a sheet are
drawn by `figure` itself, which is also the oracle of the tests.

Birds on the wing have sheets of their own, one for each of five poses of a wing beat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_figures import (
    KINDS,
    LEADER,
    NO_WINGS,
    PREDATOR,
    RINGED,
    SHORTEST,
    SHORTEST_BIRD,
    WINGSPAN,
    figure,
    outline,
)
from flockbrush.render.blocks import LANES, lay16
from flockbrush.render.shapes import Pose, kernel
from flockbrush.render.style import Theme, mix

LARGEST = 24.0  # pixels; longer animals are drawn without a sheet, whose memory grows with the square
ROOM = 64  # pixels; no block is wider
HEADINGS, QUARTERS = 96, 4
LENGTHS, RADII = int(2 * LARGEST) + 1, int(2 * LARGEST) + 1  # half pixels of length, quarter pixels of radius
BUDGET = 192 << 20  # bytes of sheets kept
ALOFT, STANDING, POSES = 0, 1, 5  # stances: no shadow of its own, one right under it, and then the poses of a beat
STANCES = 2 + POSES
HALVES = 2  # of a pixel: so many poses are to be cut that quarters would be too many
HIDDEN, LARGE = -1, -2  # codes of animals out of sight, and of those without a sheet

_SECTORS = 1024  # per quarter turn


class Sprites(NamedTuple):
    """Animals of a picture without legs, one row each."""

    # at, forward: (n, 2); pixels; headings in the picture's axes, y down
    at: np.ndarray
    forward: np.ndarray
    # length, radius: (n,); m
    length: np.ndarray
    radius: np.ndarray
    look: np.ndarray  # (n,) int64; row of `Stamps.colours`
    z: np.ndarray  # (n,); m; animals with z <= 0 stand on their shadow
    beats: np.ndarray  # (n,); how high wings are, -1 to 1, or NO_WINGS


class StampSheets(NamedTuple):
    """The sheets that have been cut, and which code each has."""

    slots: np.ndarray  # (codes,) int32; the sheet's number, -1 for one not cut yet and -2 for one already wanted
    places: np.ndarray  # (s, 3) int64; where a sheet starts in `blocks`, its side, and the animal's place in it
    blocks: np.ndarray  # (bytes,) uint8
    ready: np.ndarray  # (s, HEADINGS * 16) bool; which of a sheet's blocks have been cut
    inks: np.ndarray  # (s, HEADINGS * 16, 4) int16; between which rows and chunks each block has anything


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
def _source(places, sheet, block):
    """Where a block of a sheet begins, and how many chunks its rows have."""
    start, side, _ = places[sheet]
    chunks = (3 * side + LANES - 1) // LANES
    return start + block * side * chunks * 2 * LANES, chunks


@kernel
def _cut(sheets, sheet, block, tile, code, kind, grounded, colours):
    """Cut one block of a sheet: the animal at a heading and a part of a pixel.

    Drawn once over black and once over white: what black shows is to be added, and the difference is how much of the
    ground stays.  `tile` (2, ROOM, ROOM, 3) uint8 is room to draw in.
    """
    side, before, beat = sheets.places[sheet, 1], sheets.places[sheet, 2], _beat(code)
    source, chunks = _source(sheets.places, sheet, block)
    parts = HALVES if beat > NO_WINGS else QUARTERS
    turn, sub = block // (parts * parts), block % (parts * parts)
    clip = np.array([0, 0, side, side])
    angle = 2 * np.pi * turn / HEADINGS
    pose = Pose(before + (sub % parts) / parts, before + (sub // parts) / parts, np.cos(angle), np.sin(angle))
    long, thick = _size(code)
    for shade in range(2):
        tile[shade, :side, :side] = 255 * shade
        figure(tile[shade], clip, pose, long, thick, kind, grounded, colours, beat)
    blocks, ink = sheets.blocks, sheets.inks[sheet, block]
    ink[0], ink[1], ink[2], ink[3] = side, 0, chunks, 0
    for row in range(side):
        for byte in range(chunks * LANES):
            added, white = 0, 255
            if byte < 3 * side:
                added, white = int(tile[0, row, byte // 3, byte % 3]), int(tile[1, row, byte // 3, byte % 3])
            place = source + (row * chunks + byte // LANES) * 2 * LANES + byte % LANES
            blocks[place] = max(white - added, 0)
            blocks[place + LANES] = added
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
def sort_out(codes, slots, wanted, clip, animals, scale):
    """Which sheet each animal needs: its code, or HIDDEN, or LARGE; returns how many sheets are `wanted` first.

    A code counts look, stance, half pixels of length and quarter pixels of radius; `slots` are those of `StampSheets`.
    """
    at, z, look, beats, missing = animals.at, animals.z, animals.look, animals.beats, 0
    for i in range(len(at)):
        x, y = at[i, 0], at[i, 1]
        long, thick = animals.length[i] * scale, animals.radius[i] * scale
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
def stamp(frame, clip, animals, codes, sheets, compass, colours, scale):
    """Lay `Sprites` over the frame in the order of their rows.

    Parameters
    ----------
    codes : (n,) int64
        From `sort_out`.
    sheets : StampSheets
        Blocks that have not been cut are cut when first needed.
    compass : COMPASS
    colours : (looks, 7, 3) float64
    """
    at, forward, look, z = animals.at, animals.forward, animals.look, animals.z
    slots, places, blocks, ready = sheets.slots, sheets.places, sheets.blocks, sheets.ready
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
            pose, long, thick = Pose(at[i, 0], at[i, 1], fx, fy), animals.length[i] * scale, animals.radius[i] * scale
            figure(frame, clip, pose, long, thick, kind, z[i] <= 0, colours[look[i]], animals.beats[i])
            continue
        parts = HALVES if _beat(code) > NO_WINGS else QUARTERS
        qx, qy = int(np.floor(at[i, 0] * parts + 0.5)), int(np.floor(at[i, 1] * parts + 0.5))
        sheet = slots[code]
        side, before = places[sheet, 1], places[sheet, 2]
        top, left = qy // parts - before, qx // parts - before
        block = (compass[_bearing(fx, fy)] * parts + qy % parts) * parts + qx % parts
        source, chunks = _source(places, sheet, block)
        if not ready[sheet, block]:
            ready[sheet, block] = True
            _cut(sheets, sheet, block, tile, code, kind, z[i] <= 0, colours[look[i]])
        inside = left >= clip[0] and top >= clip[1] and top + side <= clip[3]
        if inside and 3 * left + chunks * LANES <= 3 * clip[2]:
            first, last, start, stop = sheets.inks[sheet, block]
            for row in range(first, last):
                for chunk in range(start, stop):
                    place = (top + row) * pitch + 3 * left + chunk * LANES
                    lay16(flat, place, blocks, source + (row * chunks + chunk) * 2 * LANES)
        else:
            _lay_clipped(frame, clip, top, left, side, blocks, source)


@kernel
def _lay_clipped(frame, clip, top, left, side, blocks, source):
    """Lay a block that reaches over the clip's edge, byte by byte."""
    chunks = (3 * side + LANES - 1) // LANES
    for row in range(max(top, clip[1]), min(top + side, clip[3])):
        for col in range(max(left, clip[0]), min(left + side, clip[2])):
            for c in range(3):
                byte = 3 * (col - left) + c
                place = source + ((row - top) * chunks + byte // LANES) * 2 * LANES + byte % LANES
                kept = (np.int64(frame[row, col, c]) * blocks[place] + 255) >> 8
                frame[row, col, c] = np.uint8(kept + blocks[place + LANES])


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
    half, rear, _ = outline(long, thick, kind == PREDATOR)
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
        slots = np.full(len(self.colours) * STANCES * LENGTHS * RADII, -1, np.int32)
        blocks = np.zeros(BUDGET, np.uint8)  # the system gives memory for it page by page, as sheets are cut
        parts = HEADINGS * QUARTERS * QUARTERS
        none = np.zeros((0, 3), np.int64), blocks, np.zeros((0, parts), np.bool_), np.zeros((0, parts, 4), np.int16)
        self._none = self.sheets = StampSheets(slots, *none)
        self.used = 0

    def _forget(self):
        self.sheets, self.used = self._none, 0
        self.sheets.slots[:] = -1

    def draw(self, frame, clip, animals: Sprites, scale):
        """Draw animals in the order of their rows, `scale` pixels to a metre."""
        codes, wanted = np.empty((2, len(animals.at)), np.int64)
        missing = sort_out(codes, self.sheets.slots, wanted, clip, animals, scale)
        for code in np.sort(wanted[:missing]):
            self._reserve(int(code))
        stamp(frame, clip, animals, codes, self.sheets, COMPASS, self.colours, scale)

    def _reserve(self, code: int):
        """Room for the sheet of this code; when the budget is spent, older sheets go."""
        before, side = extent(code)
        parts = HALVES if code // (LENGTHS * RADII) % STANCES > STANDING else QUARTERS
        bytes_ = HEADINGS * parts * parts * side * -(-3 * side // LANES) * 2 * LANES
        if self.used + bytes_ > BUDGET:
            self._forget()
        sheets = self.sheets
        sheets.slots[code] = len(sheets.places)
        self.sheets = sheets._replace(
            places=np.vstack([sheets.places, np.array([[self.used, side, before]], np.int64)]),
            ready=np.vstack([sheets.ready, np.zeros((1, sheets.ready.shape[1]), np.bool_)]),
            inks=np.vstack([sheets.inks, np.zeros((1, *sheets.inks.shape[1:]), np.int16)]),
        )
        self.used += bytes_


def looks_of(herd, known: int) -> np.ndarray:
    """Row of `look_colours` for each animal of a checked herd, (n,) int64; brushes from `known` on are none."""
    looks = np.where((herd.brush >= 0) & (herd.brush < known), herd.brush + 1, 0) * KINDS
    return looks + np.where(herd.predator, PREDATOR, herd.leader.astype(np.int64))


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
