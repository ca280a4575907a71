"""Herds filmed from above, with the truth beside the film.

`shoot` films a `Truth` (`benchmarks.foreign_herds`) with a camera that drifts, turns and zooms, over textured ground,
with noise and compression, and gives a `HerdFilm`: the file, and where every animal is in every frame.
`evidence_of_truth` is what a perfect observer would know.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from benchmarks.foreign_herds import HALF, RADIUS, Truth, units
from flockbrush.render.picture_files import STEADY

FINE = 6  # points to a pixel, along each side, that decide how much of it a body covers


# the film -------------------------------------------------------------------------------------------------------------


@dataclass
class Appearance:
    """How animals and ground look; colours are BGR."""

    body: tuple[int, int, int] = (214, 222, 226)
    head: tuple[int, int, int] | None = (70, 70, 74)
    ground: tuple[int, int, int] = (62, 112, 92)
    texture: float = 16.0  # grey levels of the ground's unevenness
    varied: float = 10.0  # grey levels by which animals differ
    shadow: tuple[float, float] | None = None  # BL, x and y of the picture
    noise: float = 3.0  # grey levels of the sensor
    blur: float = 0.6  # px
    crf: int = 23  # of x264; larger compresses more


LOOKS = {
    "sheep": Appearance(),
    "shadowed sheep": Appearance(shadow=(0.18, 0.22)),
    "cattle": Appearance(body=(38, 44, 60), head=(30, 34, 44), ground=(110, 158, 168)),
    "dun": Appearance(
        body=(86, 104, 122), head=(60, 72, 88), ground=(112, 146, 160), texture=9.0, varied=6.0
    ),  # low contrast
    "fish": Appearance(body=(96, 84, 70), head=None, ground=(158, 142, 108), texture=7.0, varied=5.0),
    "poor": Appearance(noise=8.0, blur=1.0, crf=32, texture=20.0),
}


@dataclass
class CameraDrift:
    """A camera above: where it looks, how it is turned and how near, at each moment.  `still` stands."""

    drift: tuple[float, float] = (0.5, 0.25)  # BL/s
    turn: float = 0.05  # rad/s
    zoom: float = 0.02  # share a second
    shake: float = 0.06  # BL, of a hand; and so many hundredths of a radian
    follow: float = 0.0  # share of the herd's own motion that the camera goes along with
    look_at: tuple[float, float] | None = None  # BL; the herd's middle over the film unless given

    def transforms(self, truth, size, body_px, seed):
        """World (BL, y up) to pixels, (T, 2, 3)."""
        rng, count = np.random.default_rng([seed, 77]), len(truth.xy)
        t = (np.arange(count) - count / 2) / truth.fps
        kernel = np.exp(-0.5 * (np.arange(-12, 13) / 4) ** 2)
        kernel /= np.sqrt((kernel**2).sum())
        wobble = self.shake * np.array([np.convolve(w, kernel, "valid") for w in rng.normal(size=(3, count + 24))])
        middle = truth.xy.mean(1)
        still = middle.mean(0) if self.look_at is None else np.asarray(self.look_at, float)
        centre = still + self.follow * (middle - middle.mean(0)) + t[:, None] * self.drift + wobble[:2].T
        angle = self.turn * t + 0.1 * wobble[2] * (self.shake > 0)
        scale = body_px * (1 + self.zoom * np.sin(t))
        return np.array([_similarity(c, a, s, size) for c, a, s in zip(centre, angle, scale, strict=True)])


STILL = CameraDrift((0.0, 0.0), 0.0, 0.0, 0.0)


def _similarity(centre, angle, scale, size):
    """World to pixels for a camera that looks at a centre, turned by an angle."""
    c, s = math.cos(angle) * scale, math.sin(angle) * scale
    linear = np.array([[c, s], [s, -c]])  # y of the picture is down
    return np.column_stack([linear, np.array(size) / 2 - linear @ centre])


@dataclass
class HerdFilm:
    """A film and what is true in it."""

    path: Path | None
    truth: Truth
    to_pixels: np.ndarray  # (T, 2, 3) from BL, y up, to pixels of that frame
    size: tuple[int, int]  # width, height, px
    body_px: float
    frames: list = field(default_factory=list)  # (h, w, 3) BGR before compression, where kept

    def pixels(self, frame):
        """(n, 2) px of the animals' middles in a frame."""
        m = self.to_pixels[frame]
        return self.truth.xy[frame] @ m[:, :2].T + m[:, 2]

    def inside(self, frame, margin=0.0):
        """(n,) whose middle lies in the picture, so many pixels from its edge."""
        x, y = self.pixels(frame).T
        w, h = self.size
        return (x >= margin) & (y >= margin) & (x < w - margin) & (y < h - margin)

    def between(self, frame, reference=0):
        """(2, 3) from pixels of a frame to pixels of the reference frame: what stabilising should find."""
        return _after(self.to_pixels[reference], _inverse(self.to_pixels[frame]))

    def seen_from(self, reference=0, body_px=None, corner=(0.0, 0.0)) -> Truth:
        """The truth in BL of the reference frame's picture, y up, from its lower-left corner: what an observer reports.

        Parameters
        ----------
        body_px : float
            Pixels the observer takes for a body length; the true ones in the reference frame unless given.
        """
        m = self.to_pixels[reference]
        scale = math.hypot(*m[:, 0])
        length = body_px or scale
        flip = np.array([1.0, -1.0])
        xy = (self.truth.xy @ m[:, :2].T + m[:, 2] - (0, self.size[1])) * flip / length - corner
        forward = (self.truth.forward @ m[:, :2].T) * flip / scale
        return Truth(self.truth.name, self.truth.fps, xy, forward, self.truth.speed * scale / length)


def _inverse(m):
    linear = np.linalg.inv(m[:, :2])
    return np.column_stack([linear, -linear @ m[:, 2]])


def _after(second, first):
    return np.column_stack([second[:, :2] @ first[:, :2], second[:, :2] @ first[:, 2] + second[:, 2]])


def ground(look, seed=0, side=1024):
    """A tile of ground that goes on at its edges, (side, side, 3) float32: uneven at all sizes, with tufts."""
    rng = np.random.default_rng([seed, 5])
    f = np.hypot(*np.meshgrid(np.fft.fftfreq(side) * side, np.fft.rfftfreq(side) * side, indexing="ij"))
    rough = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(side, side))) / np.maximum(f, 6) ** 0.9, (side, side))
    tile = rough / rough.std() * 0.75
    for _ in range(side * side // 2200):
        x, y = rng.integers(6, side - 6, 2)
        r, dark = rng.integers(1, 4), rng.normal(0, 1.6)
        tile[y - r : y + r, x - r : x + r] += dark * rng.random((2 * r, 2 * r))
    hue = 1 + 0.25 * rng.normal(size=3)
    return (np.array(look.ground) + look.texture * tile[..., None] * hue).astype(np.float32)


def shoot(
    truth, path=None, size=(640, 480), body_px=14.0, camera=None, look="sheep", seed=0, keep=False, hide=()
) -> HerdFilm:
    """Film a herd.

    Parameters
    ----------
    path : path, optional
        Of an mp4; None writes nothing, and `HerdFilm.frames` has the pictures.
    body_px : float
        Length of a body in the middle of the film.
    camera : CameraDrift, optional
        One that drifts, turns and zooms a little.
    look : str or Appearance
        One of LOOKS.
    hide : iterable of int
        Frames on which nobody is drawn.
    """
    look = LOOKS[look] if isinstance(look, str) else look
    camera = camera or CameraDrift()
    transforms = camera.transforms(truth, size, body_px, seed)
    film = HerdFilm(Path(path) if path else None, truth, transforms, tuple(size), float(body_px))
    tile, rng = ground(look, seed), np.random.default_rng([seed, 9])
    shade = rng.normal(0, look.varied, truth.xy.shape[1])
    grain = rng.standard_normal((size[1], size[0], 3), np.float32)
    writer = _Writer(path, truth.fps, size, look.crf) if path else None
    for frame, m in enumerate(transforms):
        picture = _picture(truth, frame, m, size, tile, look, shade if frame not in hide else None)
        picture += look.noise * np.roll(grain, rng.integers(0, max(size), 2), (0, 1))
        picture = np.clip(picture, 0, 255).astype(np.uint8)
        if writer:
            writer.write(picture)
        if keep or not path:
            film.frames.append(picture)
    if writer:
        writer.close()
    return film


class _Writer:
    """An mp4 by x264."""

    def __init__(self, path, fps, size, crf):
        import av

        self.av = av
        self.container = av.open(str(path), "w")
        self.stream = self.container.add_stream("libx264", rate=round(fps))
        self.stream.width, self.stream.height = size
        self.stream.pix_fmt = "yuv420p"
        self.stream.options = {"crf": str(crf), "preset": "veryfast", "threads": "1"} | STEADY

    def write(self, picture):
        frame = self.av.VideoFrame.from_ndarray(picture, format="bgr24")
        self.container.mux(self.stream.encode(frame))

    def close(self):
        self.container.mux(self.stream.encode())
        self.container.close()


def _picture(truth, frame, m, size, tile, look, shade):
    """One picture, (h, w, 3) float32."""
    scale = math.hypot(*m[:, 0])
    per_px = 12.0 / scale  # the ground's grain belongs to the ground: 12 texels to a body length
    texels = np.array([[12.0, 0.0, 0.0], [0.0, 12.0, 0.0]])
    back = _after(texels, _inverse(m))
    back[:, 2] %= tile.shape[0]
    smooth = cv2.GaussianBlur(tile, (0, 0), 0.5 * per_px) if per_px > 1.5 else tile
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    picture = cv2.warpAffine(smooth, back, size, flags=flags, borderMode=cv2.BORDER_WRAP)
    if shade is not None:
        _draw(
            picture,
            truth.xy[frame] @ m[:, :2].T + m[:, 2],
            units(truth.forward[frame] @ m[:, :2].T),
            scale,
            look,
            shade,
        )
    return cv2.GaussianBlur(picture, (0, 0), look.blur) if look.blur else picture


def _draw(picture, at, forward, scale, look, shade):
    """Draw everybody: shadows below, then bodies, lighter along the back, then heads."""
    h, w = picture.shape[:2]
    near = (at > -2 * scale).all(1) & (at[:, 0] < w + 2 * scale) & (at[:, 1] < h + 2 * scale)
    at, forward, shade = at[near], forward[near], shade[near]
    if look.shadow:
        dark = np.zeros((h, w), np.uint8)
        for outline in _capsules(at + np.array(look.shadow) * scale, forward, scale, 0.95):
            _fill(dark, outline, 255)
        picture *= 1 - 0.45 * (cv2.GaussianBlur(dark, (0, 0), 0.7) / 255.0).astype(np.float32)[..., None]
    body, head = np.array(look.body, float), None if look.head is None else np.array(look.head, float)
    hull = _capsules(at, forward, scale, 1.0)
    ridge = _capsules(at - 0.04 * scale * forward, forward, scale, 0.55)
    tops = _capsules(at + 0.37 * scale * forward, forward, scale, 0.55, 0.08)
    for k in range(len(at)):
        _blend(picture, hull[k], np.clip(body + shade[k] - 8, 0, 255))
        _blend(picture, ridge[k], np.clip(body + shade[k] + 8, 0, 255))
        if head is not None:
            _blend(picture, tops[k], head)


def _capsules(at, forward, scale, thick, half=HALF):
    """Outlines of capsules, (n, 20, 2) px."""
    side = np.column_stack([-forward[:, 1], forward[:, 0]])
    a = np.linspace(-math.pi / 2, math.pi / 2, 10)
    along = np.concatenate([half + RADIUS * thick * np.cos(a), -half - RADIUS * thick * np.cos(a)])
    across = np.concatenate([RADIUS * thick * np.sin(a), -RADIUS * thick * np.sin(a)])
    return at[:, None] + scale * (along[None, :, None] * forward[:, None] + across[None, :, None] * side[:, None])


def _fill(layer, outline, value):
    """Fill a convex outline."""
    cv2.fillConvexPoly(layer, np.round((outline - 0.5) * 16).astype(np.int32), value, cv2.LINE_8, 4)


def _blend(picture, outline, colour):
    """Lay a filled outline with soft edges over the picture."""
    x0, y0 = np.maximum(np.floor(outline.min(0)).astype(int) - 1, 0)
    x1, y1 = np.minimum(np.ceil(outline.max(0)).astype(int) + 2, picture.shape[1::-1])
    if x1 <= x0 or y1 <= y0:
        return
    fine = np.zeros((FINE * (y1 - y0), FINE * (x1 - x0)), np.uint8)
    _fill(fine, FINE * (outline - (x0, y0)), 255)
    cover = cv2.resize(fine, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
    alpha = (cover / 255.0)[..., None].astype(np.float32)
    picture[y0:y1, x0:x1] += alpha * (colour.astype(np.float32) - picture[y0:y1, x0:x1])


def mask_of(picture, look="sheep"):
    """(h, w) uint8, 1 where a picture is nearer in colour to the animals than to the ground: a plain mask."""
    look = LOOKS[look] if isinstance(look, str) else look
    low, high = np.array(look.ground, np.float32), np.array(look.body, np.float32)
    soft = cv2.GaussianBlur(picture, (0, 0), 0.6).astype(np.float32)
    mask = ((soft - low) @ (high - low) > 0.5 * ((high - low) ** 2).sum()).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    mask[(stats[:, cv2.CC_STAT_AREA] < 6)[labels]] = 0
    return mask


# what a perfect observer would know ----------------------------------------------------------------------------------


def evidence_of_truth(truth: Truth, grid=30, cell=None, name=None, window=None, sight=True):
    """Fields and sightings without a film: an `Evidence` as `observe` gives, from the truth.

    Parameters
    ----------
    grid : int
        Cells along the longer side.
    cell : float, optional
        BL; instead of grid.
    window : (x0, y0, x1, y1), optional
        BL that the picture shows; everybody is in it unless given.
    sight : bool
        False leaves the sightings out, as where bodies do not separate.
    """
    from flockbrush.film.observations import Evidence, Fields, Sightings, SpeedEvidence

    low, high = truth.xy.min((0, 1)) - 1.0, truth.xy.max((0, 1)) + 1.0
    if window is not None:
        low, high = np.array(window[:2], float), np.array(window[2:], float)
    elif cell is None:  # nobody in the outermost cells, which would say that the picture cuts the herd
        room = max(1.2 * float((high - low).max() - 2.0) / (grid - 2.4) - 1.0, 0.0)
        low, high = low - room, high + room
    cell = cell or float((high - low).max() / grid)
    nx, ny = np.maximum(np.ceil((high - low) / cell - 1e-9).astype(int), 1)
    values = [_cells(truth, t, low, high, cell, nx, ny) for t in range(len(truth.xy))]
    density, velocity, speed_variance, angular_variance, count = (np.array(v) for v in zip(*values, strict=True))
    shape = density.shape
    fields = Fields(
        fps=truth.fps, cell=cell, origin=low.copy(), density=density, velocity=velocity, speed_variance=speed_variance,
        angular_variance=angular_variance, seen=np.ones(shape, bool), obstacle=np.zeros(shape[1:], bool),
        region=np.zeros(shape[1:], np.uint8), count=count, frames=np.arange(shape[0]),
    )  # fmt: skip
    speeds = truth.speed
    speed = SpeedEvidence(float(speeds.mean()), float(speeds.std()))
    return Evidence(
        name=name or truth.name, sha256="", fps=truth.fps, body_length_px=math.nan, length_source="given",
        radius_bl=RADIUS, fields=fields, sightings=_sightings(truth, low, high, Sightings) if sight else None,
        speed=speed, notes=["from the truth, not from a film"],
    )  # fmt: skip


def _cells(truth, t, low, high, cell, nx, ny):
    """Density, velocity, variances of speed and of (unsigned) direction in degrees², and the count of a frame."""
    at = np.floor((truth.xy[t] - low) / cell).astype(int)
    here = ((truth.xy[t] >= low) & (truth.xy[t] < high)).all(1) & (at < (nx, ny)).all(1)
    at, forward, speed = at[here], truth.forward[t][here], truth.speed[t][here]
    flat, size = at[:, 1] * nx + at[:, 0], nx * ny

    def mean(values):
        return np.bincount(flat, values, size) / np.where(number > 0, number, np.nan)

    number = np.bincount(flat, minlength=size)
    vx, vy = mean(forward[:, 0] * speed), mean(forward[:, 1] * speed)
    fast = mean(speed**2) - mean(speed) ** 2
    mx, my = mean(forward[:, 0])[flat], mean(forward[:, 1])[flat]
    off = np.degrees(
        np.abs(np.arctan2(mx * forward[:, 1] - my * forward[:, 0], mx * forward[:, 0] + my * forward[:, 1]))
    )
    spread = mean(off**2) - mean(off) ** 2
    grids = [v.reshape(ny, nx) for v in (number / cell**2, vx, vy, np.maximum(fast, 0), np.maximum(spread, 0))]
    return grids[0], np.stack(grids[1:3], -1), grids[3], grids[4], int(here.sum())


def _sightings(truth, low, high, kind):
    """Everybody in the picture, in every frame."""
    here = ((truth.xy >= low) & (truth.xy < high)).all(2)
    who = np.broadcast_to(np.arange(truth.xy.shape[1]), here.shape)
    turn = truth.turn
    return kind(
        first=np.concatenate([[0], np.cumsum(here.sum(1))]), xy=truth.xy[here], forward=truth.forward[here],
        speed=truth.speed[here], turn=turn[here], track=who[here].astype(np.int64),
    )  # fmt: skip
