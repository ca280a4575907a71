"""Test films of birds with known positions: a flock in space, seen by a virtual camera and drawn on a plain sky."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

SPAN = 0.6  # m, of a bird's wings


def film(xyz, camera, seed=0, span=SPAN):
    """Yield pictures (h, w) uint8 of dark birds that beat their wings in an unevenly lit sky.

    Parameters
    ----------
    xyz : (F, N, 3) ndarray
        Metres, the camera at the origin, y forward.
    camera : Camera
    """
    chance = np.random.default_rng(seed)
    high, wide = camera.height, camera.width
    sky = (np.linspace(190, 225, high)[:, None] + 6 * np.sin(np.arange(wide) / 170)[None]).astype(np.float32)
    phase = chance.uniform(0, 2 * np.pi, xyz.shape[1])
    px = camera.project(xyz)
    for f in range(len(xyz)):
        picture = sky.copy()
        way = px[min(f + 1, len(px) - 1)] - px[max(f - 1, 0)]
        for n in np.argsort(-xyz[f, :, 1]):  # the nearest last
            size = span * camera.focal / xyz[f, n, 1]
            _bird(picture, px[f, n], np.degrees(np.arctan2(way[n, 1], way[n, 0])), size, np.sin(phase[n] + 0.9 * f))
        blurred = cv2.GaussianBlur(picture, (0, 0), 0.6) + chance.normal(0, 2, picture.shape).astype(np.float32)
        yield np.clip(blurred, 0, 255).astype(np.uint8)


def _bird(picture, at, angle, size, beat, fine=64):
    """Draw body and wings as two ellipses; positions in 64ths of a pixel."""
    body, half = max(1.2, 0.13 * size), 0.5 * size * (0.75 + 0.25 * beat)

    def ellipse(x, y, along, across, ink):
        centre, axes = (round(x * fine), round(y * fine)), (int(along * fine), int(across * fine))
        cv2.ellipse(picture, centre, axes, angle, 0, 360, ink, -1, cv2.LINE_AA, 6)

    ellipse(at[0], at[1], 0.62 * half, body, 50.0)
    ellipse(at[0], at[1] - 0.08 * size * beat, 0.8 * body, half, 60.0)


def compute_tracking(truth, visible, tracks, gate=6.0):
    """Return the quality of tracks: CLEAR MOT measures and IDF1.

    Parameters
    ----------
    truth : (F, N, 2) ndarray
        Pixels.
    visible : (F, N) bool ndarray
    tracks : Tracks
    gate : float
        Largest distance in pixels at which a track matches a bird.

    Returns
    -------
    dict
        recall, precision, switches, idf1, tracks.
    """
    found = np.full((len(truth), len(tracks.ids), 2), np.nan)
    found[tracks.first : tracks.first + len(tracks.px)] = tracks.px[: len(truth) - tracks.first]
    hits = wrong = missed = switches = 0
    last: dict[int, int] = {}
    together = np.zeros((truth.shape[1], len(tracks.ids)))
    for f in range(len(truth)):
        birds, names = np.flatnonzero(visible[f]), np.flatnonzero(np.isfinite(found[f, :, 0]))
        gap = np.linalg.norm(truth[f, birds][:, None] - found[f, names][None], axis=-1)
        cost = np.where(gap <= gate, gap, 1e6)
        for i, bird in enumerate(birds):  # keep earlier matches
            cost[i, (names == last.get(bird, -1)) & (gap[i] <= gate)] -= 100
        matched = 0
        for i, j in zip(*linear_sum_assignment(cost), strict=True):
            if gap[i, j] <= gate:
                matched += 1
                switches += last.get(birds[i], names[j]) != names[j]
                last[birds[i]] = names[j]
        together[np.ix_(birds, names)] += gap <= gate
        hits, wrong, missed = hits + matched, wrong + len(names) - matched, missed + len(birds) - matched
    rows, columns = linear_sum_assignment(-together)
    same = together[rows, columns].sum()
    return {
        "recall": hits / max(hits + missed, 1),
        "precision": hits / max(hits + wrong, 1),
        "switches": int(switches),
        "idf1": 2 * same / (visible.sum() + np.isfinite(found[..., 0]).sum()),
        "tracks": len(tracks.ids),
    }
