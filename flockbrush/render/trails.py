"""Fading trails in a buffer the size of the frame: what they cost does not grow with how long they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.render.blocks import LANES, lay16, pack
from flockbrush.render.shapes import kernel
from flockbrush.render.strokes import lay_over
from flockbrush.render.view_camera import ViewCamera

LONGEST = 48.0  # pixels; a longer step is a jump (round the edge of the level, or by hand) and leaves no line
FRAME = 1 / 30  # s between two frames that do not tell their time
SOON = 1 / 40  # s; trails fade no more often, for it takes as long as showing them
SIDE, MIDDLE = 5, 2  # pixels of a dab's block: as many as fit sixteen bytes
PATCH, PATCH_BYTES = 32, 192  # rows, and bytes of a row (64 pixels), of the patches that are inked or not


@kernel
def lay_steps(alpha, ink, inked, clip, before, now, colour, opacities, inks, longest):
    """Ink every animal's step from pixel position `before` to `now`, both (n, 2); a jump inks only its end.

    Parameters
    ----------
    alpha, ink : (h, w, 3) uint8
        How dense the trail is (the same for all three colours), and its colour times that.
    inked : bool
        Which patches have a trail.
    colour : (n,) int64
        Row of `inks`.
    opacities : (16, SIDE, 1, 2, 16) uint8
        Blocks of a dab at every quarter of a pixel, for `alpha`.
    inks : (colours, 16, SIDE, 1, 2, 16) uint8
        The same in each colour, for `ink`.
    """
    dense, dyed, pitch = alpha.reshape(-1), ink.reshape(-1), 3 * alpha.shape[1]
    opacity, dyes = opacities.reshape(-1), inks.reshape(-1)
    block = SIDE * 2 * LANES
    for i in range(len(now)):
        x, y = now[i, 0], now[i, 1]
        if not (clip[0] - longest < x < clip[2] + longest and clip[1] - longest < y < clip[3] + longest):
            continue
        dx, dy = before[i, 0] - x, before[i, 1] - y
        far = np.sqrt(dx * dx + dy * dy)
        dabs = int(far) + 1 if far <= longest else 1
        for step in range(dabs):
            qx = int(np.floor((x + dx * step / dabs) * 4 + 0.5))
            qy = int(np.floor((y + dy * step / dabs) * 4 + 0.5))
            left, top = (qx >> 2) - MIDDLE, (qy >> 2) - MIDDLE
            if left < clip[0] or top < clip[1] or left + SIDE + 1 > clip[2] or top + SIDE > clip[3]:
                continue
            sub = (qy & 3) * 4 + (qx & 3)
            west, east = 3 * left // PATCH_BYTES, (3 * (left + SIDE) - 1) // PATCH_BYTES
            north, south = top // PATCH, (top + SIDE - 1) // PATCH
            inked[north, west] = inked[north, east] = inked[south, west] = inked[south, east] = True
            for row in range(SIDE):
                at, line = (top + row) * pitch + 3 * left, row * 2 * LANES
                lay16(dense, at, opacity, sub * block + line)
                lay16(dyed, at, dyes, (colour[i] * 16 + sub) * block + line)


@kernel
def show(frame, alpha, ink, inked):
    """Lay the trails over the frame, all (h, w * 3) uint8; only patches that are `inked` (bool) are looked at."""
    height, pitch = frame.shape
    for down in range(inked.shape[0]):
        for across in range(inked.shape[1]):
            if not inked[down, across]:
                continue
            left, right = across * PATCH_BYTES, min((across + 1) * PATCH_BYTES, pitch)
            for row in range(down * PATCH, min((down + 1) * PATCH, height)):
                lay_over(frame[row, left:right], alpha[row, left:right], ink[row, left:right])


@kernel
def fade(alpha, ink, inked, keep):
    """Let trails fade: of their ink, `keep` of 256 stays; patches without any are inked no more."""
    height, pitch = alpha.shape
    for down in range(inked.shape[0]):
        for across in range(inked.shape[1]):
            if not inked[down, across]:
                continue
            left, right = across * PATCH_BYTES, min((across + 1) * PATCH_BYTES, pitch)
            some = np.uint8(0)
            for row in range(down * PATCH, min((down + 1) * PATCH, height)):
                some |= _fade(alpha[row, left:right], keep)
                _fade(ink[row, left:right], keep)
            inked[down, across] = some > 0


@kernel
def _fade(values, keep):
    """Let one row of ink fade; all that is left of it, bit by bit."""
    some = np.uint8(0)
    for k in range(len(values)):
        stays = np.uint8((np.uint16(values[k]) * np.uint16(keep)) >> 8)
        values[k] = stays
        some |= stays
    return some


def cut_dabs(colours, width: float, strength: float) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of round dabs `width` pixels across, as `lay_steps` takes them, in `colours` (k, 3)."""
    place = np.arange(16)
    x, y = MIDDLE + place % 4 / 4, MIDDLE + place // 4 / 4
    centre = np.arange(SIDE) + 0.5
    far = np.hypot(centre[None, None, :] - x[:, None, None], centre[None, :, None] - y[:, None, None])
    cover = np.clip(width / 2 + 0.5 - far, 0, 1)[..., None] * np.ones(3)
    stays = np.round(255 * (1 - cover)).astype(np.uint8)
    dense = 255 - stays.astype(float)
    opacities = pack(stays, np.floor(dense * strength).astype(np.uint8))
    inks = [pack(stays, np.floor(dense * strength * colour / 255).astype(np.uint8)) for colour in np.asarray(colours)]
    return opacities, np.array(inks, np.uint8)


class Trails:
    """What the animals of the last frames have left on the ground.

    Parameters
    ----------
    seconds : float
        After this time a trail is down to a twentieth of its ink.
    """

    def __init__(self, seconds: float = 3.0):
        if not (np.isfinite(seconds) and seconds > 0):
            raise ValueError(f"trails last a positive time, got {seconds} s")
        self.seconds, self.time = float(seconds), None
        self.camera: ViewCamera | None = None
        self._key: tuple | None = None
        self._dabs: tuple = ()
        self.alpha: np.ndarray
        self.ink: np.ndarray
        self._inked: np.ndarray
        self._unfaded = 0.0  # s
        self.before: np.ndarray = np.zeros((0, 2))
        self.ids: np.ndarray | None = None

    def look(self, camera: ViewCamera):
        """Follow the camera: what is on the ground moves with it, what comes into view is bare."""
        if camera == self.camera:
            return
        old, self.camera = self.camera, camera
        width, height = camera.size
        self._inked = np.ones((-(-height // PATCH), -(-3 * width // PATCH_BYTES)), np.bool_)
        if old is None or replace(old, centre=camera.centre, scale=camera.scale) != camera:
            self.alpha, self.ink = np.zeros((2, height, width, 3), np.uint8)
            self._inked[:] = False
            return
        import cv2

        corner, step = old.pixels(camera.metres((0, 0))), old.scale / camera.scale
        back = np.array([[step, 0, corner[0] + step / 2 - 0.5], [0, step, corner[1] + step / 2 - 0.5]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        self.alpha = cv2.warpAffine(self.alpha, back, (width, height), flags=flags)
        self.ink = np.minimum(cv2.warpAffine(self.ink, back, (width, height), flags=flags), self.alpha)

    def clear(self):
        """Forget all trails, as after a jump in time."""
        self.camera, self.before, self.ids, self.time = None, np.zeros((0, 2)), None, None

    def frame(self, frame, clip, camera: ViewCamera, xy, ids, colour, colours, strength, time=None):
        """Ink the last steps, lay the trails over the frame, and let them fade.

        `xy` (n, 2) m, `colour` (n,) rows of `colours` (k, 3); `strength`, 0 to 1, is the opacity of fresh ink; `time`
        in seconds.  A step back in time, or one longer than trails last, clears them.
        """
        passed = FRAME if time is None or self.time is None else time - self.time
        self.time = time
        if not 0 <= passed <= self.seconds:
            self.clear()
            self.time, passed = time, FRAME
        self.look(camera)
        width = float(np.clip(0.25 * camera.scale, 1.0, 2.6))
        key = (np.asarray(colours, np.uint8).tobytes(), round(width, 1), strength)
        if key != self._key:
            self._key, self._dabs = key, cut_dabs(colours, round(width, 1), strength)
        before, now = camera.pixels(self._previous(xy, ids)), camera.pixels(xy)
        lay_steps(self.alpha, self.ink, self._inked, clip, before, now, colour, *self._dabs, LONGEST)
        flat = len(frame), -1
        alpha, ink = self.alpha.reshape(flat), self.ink.reshape(flat)
        show(frame.reshape(flat), alpha, ink, self._inked)
        self._unfaded += passed
        if self._unfaded >= SOON:
            fade(alpha, ink, self._inked, self._keep(self._unfaded))
            self._unfaded = 0.0

    def _keep(self, passed) -> int:
        return int(np.clip(round(256 * 0.05 ** (passed / self.seconds)), 0, 255)) if passed > 0 else 256

    def _previous(self, xy, ids) -> np.ndarray:
        """Where each animal was a frame ago (m); where it is now for one that was not there."""
        before, known = self.before, self.ids
        self.before, self.ids = xy.copy(), None if ids is None else np.array(ids)
        if len(before) == len(xy) and (ids is None or known is None or np.array_equal(ids, known)):
            return before
        if ids is None or known is None or not len(known):
            return xy
        order = np.argsort(known)
        found = order[np.clip(np.searchsorted(known, ids, sorter=order), 0, len(known) - 1)]
        return np.where((known[found] == ids)[:, None], before[found], xy)
