"""How the bodies in a picture move to a later one: Farneback's flow, after the camera has been taken out.

The later picture is first laid over the earlier by the maps of the stabilised clip; what is left of the camera, a
jitter, is the median flow of the ground and is taken off.  The flow is computed where animals are, in a picture small
enough that a body is some ten pixels long, and averaged over half a body, since its details are noise.
"""

from __future__ import annotations

import cv2
import numpy as np

from flockbrush.film.camera_maps import after, back

# Constants of the paper's authors, but for the window (theirs is 3, and nine frames' mean; that is too slow to follow)
# and two rounds for their three, which change nothing that is measured.
FARNEBACK = dict(pyr_scale=0.5, levels=3, winsize=5, iterations=2, poly_n=5, poly_sigma=1.1, flags=0)
BODY = 12.0  # px that a body is long in the picture in which flow is computed
MOST = 180_000  # px of that picture
THIN = 3  # every how manieth pixel of the ground, across and down, tells its drift
ENOUGH = 20  # of those pixels
LONGEST_GAP = 5  # frames
STEP = 0.12  # BL that an animal should move between the two pictures: more than noise, less than a neighbour's distance


class Flow:
    """Computes the flow of a clip's bodies.

    Parameters
    ----------
    size : (int, int)
        Of the pictures, px.
    body_px : float
        Length of a body, px.
    """

    def __init__(self, size, body_px):
        fine = min(1.0, max(BODY / max(body_px, 1.0), 0.2))
        self.scale = min(fine, float(np.sqrt(MOST / (size[0] * size[1]))))
        self.size = tuple(max(16, round(side * self.scale)) for side in size)
        self.scale = self.size[0] / size[0]
        self.width = max(3, 2 * int(0.25 * body_px * self.scale) + 1)

    def small(self, picture, mask):
        """(grey, mask) of the size in which flow is computed."""
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        inside = cv2.resize(mask * np.uint8(255), self.size, interpolation=cv2.INTER_AREA)
        return cv2.resize(grey, self.size, interpolation=cv2.INTER_AREA), (inside > 127).astype(np.uint8)

    def between(self, one, other, map_one, map_other):
        """How the bodies of one picture move to the other, as if the camera stood as in the first.

        Parameters
        ----------
        one, other : (grey, mask)
            As `small` makes them.
        map_one, map_other : (2, 3) ndarray
            From full pixels of each to the first picture of the clip.

        Returns
        -------
        at : (n, 2) ndarray
            Pixels of bodies in ``one``, full px.
        move : (n, 2) ndarray
            What each moves, averaged over half a body, full px.
        noise : float
            Deviation of the averaged flow of the ground, full px.
        """
        (a, inside), (b, inside_b) = one, other
        way = after(back(map_one), map_other)  # from the other picture to this
        way[:, 2] *= self.scale
        b = cv2.warpAffine(b, way, self.size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        inside_b = cv2.warpAffine(inside_b, way, self.size, flags=cv2.INTER_NEAREST)
        box = _box(cv2.bitwise_or(inside, inside_b), 4 * self.width)
        if box is None:
            return np.empty((0, 2)), np.empty((0, 2)), float("nan")
        x0, y0, x1, y1 = box
        cut = np.s_[y0:y1, x0:x1]
        flow = cv2.calcOpticalFlowFarneback(_level(a, b)[cut], b[cut], None, **FARNEBACK)
        inside, inside_b = inside[cut], inside_b[cut]
        ground = cv2.dilate(cv2.bitwise_or(inside, inside_b), np.ones((self.width, self.width), np.uint8)) == 0
        some = flow[::THIN, ::THIN][ground[::THIN, ::THIN]]
        flow -= np.median(some, axis=0) if len(some) > ENOUGH else np.zeros(2, np.float32)
        mean = _averaged(flow, inside, self.width)
        y, x = np.nonzero(inside)
        at = (np.column_stack([x, y]) + (x0 + 0.5, y0 + 0.5)) / self.scale - 0.5
        return at, mean[y, x] / self.scale, self._noise(flow, ground)

    def _noise(self, flow, ground):
        """Robust deviation along one direction of the ground's averaged flow, full px."""
        mean = _averaged(flow, ground.view(np.uint8), self.width)[::THIN, ::THIN][ground[::THIN, ::THIN]]
        return 1.4826 * float(np.median(np.abs(mean))) / self.scale if len(mean) > ENOUGH else float("nan")


def _level(a, b):
    """The picture ``a`` at the exposure of ``b``, by their medians and spreads."""
    ma, mb = cv2.meanStdDev(a), cv2.meanStdDev(b)
    if abs(ma[0][0, 0] - mb[0][0, 0]) < 2 and abs(ma[1][0, 0] - mb[1][0, 0]) < 2:
        return a
    ratio = mb[1][0, 0] / max(ma[1][0, 0], 1e-3)
    return cv2.convertScaleAbs(a, alpha=ratio, beta=float(mb[0][0, 0] - ratio * ma[0][0, 0]))


def _box(mask, margin):
    """(left, top, right, bottom) around what is in the mask, with a margin; None where nothing is."""
    x, y, w, h = cv2.boundingRect(mask)
    if not w:
        return None
    margin = max(margin, 8)
    x0, y0 = max(0, x - margin), max(0, y - margin)
    x1, y1 = min(mask.shape[1], x + w + margin), min(mask.shape[0], y + h + margin)
    return x0, y0, max(x1, x0 + 16), max(y1, y0 + 16)


def _averaged(flow, inside, width):
    """Flow averaged over a window, by what is inside alone."""
    weight = cv2.merge([inside.astype(np.float32)] * 2)
    total = cv2.blur(weight, (width, width))
    mean = cv2.blur(cv2.multiply(flow, weight), (width, width))
    return cv2.divide(mean, cv2.max(total, 1e-6))


def gap_of(steps, body_px, fps) -> int:
    """How many frames apart two pictures should be, 1 to `LONGEST_GAP`.

    Parameters
    ----------
    steps : (k,) ndarray
        Pixels that animals move from one frame to the next.
    body_px, fps : float
    """
    usual = float(np.median(steps)) if len(steps) else 0.0
    most = int(np.clip(round(fps / 5.0), 1, LONGEST_GAP))  # a fifth of a second
    return int(np.clip(round(STEP * body_px / max(usual, 1e-6)), 1, most))
