"""Which pixels show animals: a table of colours, given by a person or found in what moves over the ground.

Pictures of a clip are first brought to one exposure, that of the ground.  Then (`found_colours`) what differs from the
ground, the median of the stabilised clip, is counted by colour, and so is what does not; a colour that is common among
what moves is a colour of animals, even while an animal rests.  Shadows move too, but darken the ground without
changing its hue; they count as ground if anything else moves.  In a single picture (`found_in_picture`) animals are
what is lighter, darker or of another hue than the ground around it, in compact patches of like size.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from flockbrush.film import stones
from flockbrush.film.body_outlines import blobs_left
from flockbrush.film.camera_maps import Steady, after, back, moved_by
from flockbrush.film.colour_table import LEVELS, colours_at_home, index_of, lab_of_table, looked_up, valley
from flockbrush.film.ground_lines import lines_and_faces, without_lines
from flockbrush.film.observations import CannotObserve

SAMPLES = 15  # pictures from which the ground is made
SIDE = 400  # px, the longer side of pictures while colours are learned
CONTRAST, NOISE = 14.0, 5.0  # grey levels; robust deviations: what differs more from the ground is something else
STILL = 2e-4  # share of the pictures that differs from the ground, below which nothing moves
SHADE = 0.3, 0.92  # a shadow leaves this share of the ground's light
GHOST = 3.0  # times as common on the still ground as the colour that the ground's picture has there
PART = 0.3  # share of what moves that is enough to be the animals
CONTRAST_CHANGE = 0.6, 1.8  # of the pictures' contrast to that of the ground, beyond the change of light
EXPOSED = 160  # px, the longer side of the pictures that exposure is measured on
CROWDED = 0.6  # share of the picture; more cannot be animals
LEFT = 0.4  # a body stays whole if stones leave at least this share of it
FAR = 60.0  # grey levels (Lab): no colour so far from the one that a person gave is taken
_CANVAS = 4.0  # the stabilised ground may be this many pictures large, else it is made coarser


@dataclass
class ClipGround:
    """The ground without animals, as the stabilised clip shows it."""

    picture: np.ndarray  # (h, w, 3) uint8; BGR
    from_first: np.ndarray  # (2, 3); from pixels of the first picture to those of `picture`
    known: np.ndarray  # (h, w) bool; where it was ever seen


@dataclass
class BodyColours:
    """Separates animals from ground by colour."""

    table: np.ndarray  # (LEVELS ** 3,) uint8; 1 for colours of animals, by blue, green, red
    ground: ClipGround | None  # what pictures are brought to the exposure of; None leaves them as they are
    maps: np.ndarray  # (n, 2, 3); of the stabilised clip
    colour: tuple[int, int, int]  # red, green, blue that is most typical of the animals
    still: bool = False  # whether no motion was seen
    notes: list[str] = field(default_factory=list)
    bright: tuple[int, int, int] | None = None  # red, green, blue of what stands out most of them
    stones: np.ndarray | None = None  # (h, w) uint8 on the ground's picture: see `find_stones`
    lines: np.ndarray | None = None  # (h, w) uint8 on the first picture: see `find_lines`

    def mask(self, k: int, picture) -> np.ndarray:
        """(h, w) uint8, 1 where the k-th picture shows animals."""
        if self.ground is not None:
            picture = exposed(picture, self.exposure(k, picture))
        smooth = cv2.GaussianBlur(picture, (3, 3), 0)
        mask = looked_up(smooth, self.table)
        if self.stones is not None:
            self._leave_out_stones(k, smooth, mask)
        mask = cv2.medianBlur(mask, 3)
        if self.lines is None:
            return mask
        way, flags = back(self.maps[k]), cv2.INTER_NEAREST
        return without_lines(mask, cv2.warpAffine(self.lines, way, mask.shape[::-1], flags=flags))

    def find_lines(self, masks, pictures, size) -> bool:
        """Look for lines and plain faces of the ground in colours of animals; whether there are any.

        ``masks`` and ``pictures`` are by number of the picture; see `flockbrush.film.ground_lines`.
        """
        shape = next(iter(masks.values())).shape[::-1]
        laid = [cv2.warpAffine(mask, self.maps[k], shape, flags=cv2.INTER_NEAREST) for k, mask in masks.items()]
        self.lines = lines_and_faces(laid, [pictures[min(pictures)]], size)
        return self.lines is not None

    def find_stones(self, area: float) -> bool:
        """Look for what has colours of animals but belongs to the ground; whether there is any.

        See `flockbrush.film.stones`; an animal (``area`` pixels of the first picture) that rests all the while stands
        out as much as the others, and is kept.  If hardly any animal moves away, nothing is left out.
        """
        if self.ground is None or self.bright is None:
            return False
        coloured = _still_patches(self.ground, self.table)
        area *= abs(np.linalg.det(self.ground.from_first[:, :2]))
        faint = stones.faint_patches(self.ground.picture, coloured, np.array(self.bright[::-1], float), area)
        self.stones = cv2.dilate(faint, np.ones((5, 5), np.uint8)) if faint.any() else None
        return self.stones is not None

    def _leave_out_stones(self, k, picture, mask):
        """Take out of a mask what is where a stone is and looks more like it than like an animal.

        A body of which at least `LEFT` remains stays whole: under herds that rest or are dense, the ground's median is
        a mixture with animals, which looks like a stone.
        """
        way = after(self.ground.from_first, self.maps[k])
        size, flags = picture.shape[1::-1], cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        on_stones = (cv2.warpAffine(self.stones * np.uint8(255), way, size, flags=flags) > 0) & (mask > 0)
        if not on_stones.any():
            return
        ground = cv2.warpAffine(self.ground.picture, way, size, flags=flags)[on_stones].astype(float)
        colours_there = picture[on_stones].astype(float)
        like_ground = np.linalg.norm(colours_there - ground, axis=1) < np.linalg.norm(
            colours_there - self.bright[::-1], axis=1
        )
        before = mask.copy()
        mask[on_stones] = ~like_ground
        mask |= blobs_left(before, mask, LEFT)

    def exposure(self, k, picture):
        """What gives the k-th picture the exposure of the ground (see `gain`)."""
        scale = min(1.0, EXPOSED / max(picture.shape[:2]))
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        way = after(self.ground.from_first, self.maps[k])
        way[:, :2] /= scale
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = small.shape[1::-1]
        under = cv2.warpAffine(self.ground.picture, way, size, flags=flags)
        known = cv2.warpAffine(self.ground.known.astype(np.uint8), way, size, flags=flags) > 0
        return gain(small, under, known)


def gain(picture, ground, known):
    """(2, 3) factor and offset, by channel, that give a picture the light and contrast of the ground under it.

    Both are those of medians and of median deviations, which the few pixels of animals do not move.
    """
    if known.sum() < 50:
        return np.array([np.ones(3), np.zeros(3)])
    a, b = picture[known].astype(np.float32), ground[known].astype(np.float32)
    ma, mb = np.median(a, axis=0), np.median(b, axis=0)
    wide = (np.median(np.abs(b - mb), axis=0) + 2.0) / (np.median(np.abs(a - ma), axis=0) + 2.0)
    bright = (mb + 4.0) / (ma + 4.0)
    factor = np.clip(wide / bright, *CONTRAST_CHANGE) * bright if abs(np.log(wide / bright)).max() > 0.15 else bright
    return np.array([factor, mb - factor * ma])


def exposed(picture, change):
    """The picture with factor and offset applied, by channel."""
    factor, offset = change
    if np.abs(factor - 1).max() < 0.02 and np.abs(offset).max() < 2:
        return picture
    tables = np.clip(np.arange(256)[:, None] * factor + offset, 0, 255).astype(np.uint8)
    return cv2.LUT(picture, tables.reshape(256, 1, 3))


# the ground ------------------------------------------------------------------------------


@dataclass
class _Samples:
    """Some pictures of a clip laid on the ground."""

    ground: ClipGround
    pictures: np.ndarray  # (m, h, w, 3) uint8, at the ground's exposure
    known: np.ndarray  # (m, h, w) bool
    index: np.ndarray  # (m, h, w) rows of the table


def ground_of(clip, steady: Steady) -> _Samples:
    """The median of the stabilised clip, and the pictures that it is the median of."""
    rows = np.unique(np.linspace(0, len(clip) - 1, min(SAMPLES, len(clip))).round().astype(int))
    from_first, size = _canvas(clip.size, steady.maps)
    views, inside = [], []
    full = np.full(clip.size[::-1], 255, np.uint8)
    for k, picture in clip.read(rows):
        way = after(from_first, steady.maps[k])
        shrink = cv2.INTER_AREA if zoomed_out(way) else cv2.INTER_LINEAR
        small = cv2.GaussianBlur(picture, (3, 3), 0) if shrink == cv2.INTER_AREA else picture
        views.append(cv2.warpAffine(small, way, size, flags=cv2.INTER_LINEAR))
        inside.append(cv2.warpAffine(full, way, size, flags=cv2.INTER_NEAREST) > 0)
    pictures, known = np.array(views), np.array(inside)
    middle = _median(pictures, known)
    for picture, there in zip(pictures, known, strict=True):
        picture[:] = exposed(picture, _gain_of_small(picture, middle, there))
    index = np.array([index_of(picture) for picture in pictures])
    return _Samples(
        ClipGround(_median(pictures, known), from_first, np.logical_or.reduce(known)), pictures, known, index
    )


def _gain_of_small(picture, ground, known):
    """As `gain`, at the size at which the exposure of all pictures is measured."""
    scale = min(1.0, EXPOSED / max(picture.shape[:2]))
    small = [cv2.resize(p, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for p in (picture, ground)]
    return gain(*small, cv2.resize(known.astype(np.uint8), small[0].shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0)


def zoomed_out(m):
    """Whether a map makes things less than three quarters as large."""
    return abs(np.linalg.det(m[:, :2])) < 0.75**2


def _canvas(size, maps):
    """(map from the first picture, (width, height)) of a canvas that holds all pictures."""
    corners = np.array([(0, 0), (size[0], 0), (0, size[1]), size], float)
    at = np.concatenate([moved_by(m, corners) for m in maps])
    low, high = at.min(0), at.max(0)
    scale = min(1.0, SIDE / max(size))
    scale *= min(1.0, float(np.sqrt(_CANVAS * size[0] * size[1] / max(1.0, np.prod(high - low)))))
    wide, tall = np.maximum(1, np.ceil(scale * (high - low))).astype(int)
    return np.column_stack([scale * np.eye(2), -scale * low]), (int(wide), int(tall))


def _median(pictures, known):
    """Of the pictures where they are known, (h, w, 3) uint8."""
    filled = pictures.copy()
    for k in range(1, len(filled)):
        filled[k][~known[k]] = filled[k - 1][~known[k]]
    for k in range(len(filled) - 2, -1, -1):  # pixels unknown in the first pictures
        unknown = ~known[: k + 1].any(0)
        filled[k][unknown] = filled[k + 1][unknown]
    half = len(filled) // 2
    return np.partition(filled, half, axis=0)[half]


# colours ---------------------------------------------------------------------------------


def colours_of(clip, steady: Steady, colour="auto") -> BodyColours:
    """The colours of a clip's animals.

    Parameters
    ----------
    colour : "auto" or (int, int, int)
        Red, green and blue of the animals, 0 to 255.

    Raises
    ------
    CannotObserve
        When nothing moves, or everything looks like an animal.
    """
    samples = ground_of(clip, steady)
    if not isinstance(colour, str):
        colours = _given(samples, steady, colour)
    elif clip.still:
        colours = found_in_picture(samples, steady)
    else:
        colours = found_colours(clip, samples, steady)
    _check(clip, colours, samples, colour)
    return colours


def _check(clip, colours, samples, colour):
    """Refuse colours that match no pixel, or most of the picture."""
    share = float(colours.table[samples.index[samples.known]].mean())
    evidence = {"share of the picture": share, "pictures": {"ground": samples.ground.picture}}
    if share > CROWDED:
        raise CannotObserve(
            clip.name,
            f"{share:.0%} of the picture looks like animals; give their colour with --body-colour R,G,B, or choose "
            "frames that show more ground",
            evidence,
        )  # fmt: skip
    if share == 0:
        advice = "; give their colour with --body-colour R,G,B" if isinstance(colour, str) else (
            f": nothing has a colour near the given {','.join(map(str, colour))}; pick the colour in the clip with "
            "flockbrush play --clip, or leave --body-colour out"
        )  # fmt: skip
        raise CannotObserve(clip.name, f"no animals were detected{advice}", evidence)


def _given(samples, steady, colour):
    """Colours near the one that was given: nearer than the ground, separated at the valley between the two."""
    lab = lab_of_table()
    target = cv2.cvtColor(np.uint8([[colour[::-1]]]), cv2.COLOR_BGR2LAB)[0, 0].astype(np.float32)
    away = np.linalg.norm(lab - target, axis=1)
    counts = np.bincount(samples.index[samples.known], minlength=LEVELS**3)
    limit = float(np.clip(valley(away, counts), 12, FAR))
    return BodyColours((away < limit).astype(np.uint8), samples.ground, steady.maps, tuple(int(c) for c in colour))


def found_colours(clip, samples, steady) -> BodyColours:
    """The colours of what moves over the ground of a clip.

    Raises
    ------
    CannotObserve
        When nothing does.
    """
    moving, shade, lighter = _movers(samples)
    share = moving.sum() / samples.known.sum()
    if share < STILL:
        raise CannotObserve(
            clip.name,
            f"nothing moves in frames {clip.numbers[0]} to {clip.numbers[-1]}: {share:.2%} of the pictures differ from "
            "the ground; choose other or more frames. If there are animals that stand, give their colour "
            "(--body-colour R,G,B), or learn only their density from one frame, --frames A:A",
            {"share that differs": float(share), "pictures": {"ground": samples.ground.picture}},
        )  # fmt: skip
    ghosts = _ghosts(samples, moving)
    bodies, notes = _without_shadows(moving & ~ghosts, shade, lighter)
    table = colours_at_home(samples.index, bodies, samples.known & ~moving)
    table = colours_at_home(samples.index, *_again(samples, table, moving))
    coloured = table[samples.index].astype(bool) & samples.known
    bright = stones.bright_colour(
        samples.pictures, samples.ground.picture, coloured, _still_patches(samples.ground, table)
    )
    colour = _typical(samples, table, bodies)
    return BodyColours(table, samples.ground, steady.maps, colour, notes=notes, bright=bright)


def _ghosts(samples, moving):
    """(m, h, w) bool: differs because the ground contains an animal that hardly moves and is elsewhere now.

    What the picture shows there is common where nothing moves, and what the ground shows is rare.
    """
    still = np.bincount(samples.index[samples.known & ~moving], minlength=LEVELS**3).astype(float)
    common = gaussian_filter(still.reshape([LEVELS] * 3), 0.8).ravel()
    return moving & (common[samples.index] > GHOST * common[index_of(samples.ground.picture)])


def _without_shadows(moving, shade, lighter):
    """(what moves without shadows, notes): if much of it is lighter than the ground, what is darker is shadow."""
    whole = moving.sum()
    if (moving & lighter).sum() > PART * whole:
        bodies = moving & lighter
    elif (moving & ~shade).sum() > PART * whole:
        bodies = moving & ~shade
    else:
        return moving, []
    left = moving & ~bodies
    shadows = left.sum() > PART * whole and (left & shade).sum() > 0.5 * left.sum()
    return bodies, ["the shadows of the animals were left out"] if shadows else []


def _movers(samples):
    """(m, h, w) bool each: differs from the ground, is like a shadow on it, is lighter than it."""
    ground = samples.ground.picture
    low = cv2.erode(ground, np.ones((3, 3), np.uint8))
    high = cv2.dilate(ground, np.ones((3, 3), np.uint8))
    moving, shade, lighter = [], [], []
    for picture, known in zip(samples.pictures, samples.known, strict=True):
        away = cv2.max(cv2.subtract(picture, high), cv2.subtract(low, picture)).max(-1)
        plain = cv2.absdiff(picture, ground)[::2, ::2].max(-1)[known[::2, ::2]]
        limit = max(CONTRAST, NOISE * 1.4826 * float(np.median(plain)))
        there = (away > limit) & (cv2.erode(known.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
        dark = np.zeros_like(there)
        dark[there] = _shaded(picture[there], ground[there])
        moving.append(there)
        shade.append(dark)
        lighter.append(picture.sum(-1, dtype=np.int16) > ground.sum(-1, dtype=np.int16))
    return np.array(moving), np.array(shade), np.array(lighter)


def _shaded(colours, ground):
    """(n,) bool: darker than the ground, of the same hue; both (n, 3)."""
    ratio = (colours.astype(np.float32) + 4) / (ground.astype(np.float32) + 4)
    light = ratio.mean(-1)
    return (light > SHADE[0]) & (light < SHADE[1]) & (np.abs(ratio - light[:, None]).max(-1) < 0.12)


def _again(samples, table, moving):
    """(bodies, elsewhere) given a first table: resting animals are bodies too, their ghosts are ground."""
    index = samples.index
    coloured = table[index].astype(bool)
    return coloured & moving, samples.known & ~coloured


def _typical(samples, table, bodies):
    """Median red, green, blue of the bodies."""
    index = samples.index
    chosen = table[index].astype(bool) & bodies
    if not chosen.any():
        return 0, 0, 0
    b, g, r = np.median(samples.pictures[chosen], axis=0)
    return int(r), int(g), int(b)


def _still_patches(ground, table):
    """(h, w) uint8: where the ground's picture has colours of animals."""
    return looked_up(cv2.GaussianBlur(ground.picture, (3, 3), 0), table) & ground.known.astype(np.uint8)


# one picture -----------------------------------------------------------------------------


def found_in_picture(samples, steady) -> BodyColours:
    """The colours of patches that are alike in size and unlike the ground around them."""
    picture = samples.pictures[0]
    lab = cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)
    window = max(5, (min(picture.shape[:2]) // 4) | 1)
    away = lab.astype(np.float32) - _around(lab, window)
    best, chosen = 0.0, None
    for values in (away[..., 0], -away[..., 0], away[..., 1], -away[..., 1], away[..., 2], -away[..., 2]):
        mask = _outliers(values)
        score = _like_bodies(mask)
        if score > best:
            best, chosen = score, mask
    if chosen is None:
        return BodyColours(np.zeros(LEVELS**3, np.uint8), None, steady.maps, (0, 0, 0), True)
    bodies = chosen[None].astype(bool)
    table = colours_at_home(samples.index, bodies, samples.known & ~bodies)
    return BodyColours(table, None, steady.maps, _typical(samples, table, bodies), True)


def _around(lab, window):
    """The ground around each pixel, as if nothing small stood on it."""
    shrink = max(1, window // 31)
    small = cv2.resize(lab, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    median = cv2.medianBlur(small, max(3, (window // shrink) | 1))
    return cv2.resize(median, lab.shape[1::-1], interpolation=cv2.INTER_LINEAR).astype(np.float32)


def _outliers(values):
    """(h, w) uint8: far above the rest, by the valley between the rest and the extremes."""
    noise = 1.4826 * float(np.median(np.abs(values)))
    top = float(np.quantile(values, 0.999))
    limit = max(3.0 * noise, 0.5 * top, 10.0)
    return cv2.morphologyEx((values > limit).astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))


def _like_bodies(mask):
    """Area of a mask in compact patches of similar size, px."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    area = stats[1:, cv2.CC_STAT_AREA].astype(float)
    large = area > max(6.0, 0.05 * area.max(initial=0))
    if not large.any():
        return 0.0
    box = stats[1:, cv2.CC_STAT_WIDTH] * stats[1:, cv2.CC_STAT_HEIGHT]
    usual = float(np.median(area[large]))
    fine = large & (area > 0.4 * usual) & (area < 2.5 * usual) & (area > 0.4 * box)
    return float(area[fine].sum() * area[fine].sum() / area.sum()) if mask.mean() < CROWDED else 0.0
