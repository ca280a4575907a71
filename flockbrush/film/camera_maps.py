"""Maps between the pictures of a moving camera: (2, 3) similarities of shift, rotation and zoom."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flockbrush.film.observations import CannotObserve

SMOOTH = 9  # frames [paper, section 4]
LOST = 3  # frames in a row in which a rectangle is not found again


@dataclass
class Steady:
    """Where the camera was."""

    maps: np.ndarray  # (n, 2, 3); from pixels of the k-th picture to those of the first
    moved: bool = True  # whether the camera moved at all
    notes: list[str] = field(default_factory=list)


def after(second, first):
    """The map that does ``first``, then ``second``; (2, 3) each."""
    return np.column_stack([second[:, :2] @ first[:, :2], second[:, :2] @ first[:, 2] + second[:, 2]])


def back(m):
    """The inverse of a map."""
    turn = np.linalg.inv(m[:, :2])
    return np.column_stack([turn, -turn @ m[:, 2]])


def moved_by(m, points):
    """Points (n, 2) through a map."""
    return np.asarray(points, float) @ m[:, :2].T + m[:, 2]


def zoom_of(m) -> float:
    """How much larger things are after the map."""
    return float(np.sqrt(abs(np.linalg.det(m[:, :2]))))


def fitted(a, b, weight=None):
    """The similarity that takes points a to b best, least squares, both (n, 2), n >= 2."""
    weight = np.ones(len(a)) if weight is None else weight
    ma, mb = np.average(a, axis=0, weights=weight), np.average(b, axis=0, weights=weight)
    za, zb = (a - ma) @ (1, 1j), (b - mb) @ (1, 1j)
    s = ((weight * za.conj()) @ zb) / max(((weight * za.conj()) @ za).real, 1e-12)
    turn = np.array([[s.real, -s.imag], [s.imag, s.real]])
    return np.column_stack([turn, mb - turn @ ma])


def scaled_maps(maps, scale):
    """Maps between pictures of another size: the same maps where pixels are ``scale`` times as many."""
    maps = np.array(maps, float)
    maps[..., 2] *= scale
    return maps


def joined_tracks(clip, tracks):
    """One map for each picture from all landmarks that are seen in it."""
    usable = [track for track in tracks if np.isfinite(track.maps[0]).all()]
    fine = np.array([np.isfinite(track.maps[:, 0, 0]) for track in tracks])
    lost = ~fine.any(0)
    notes = []
    if not usable or lost.mean() > 0.2 or _run(lost) >= LOST:
        track = max(tracks, key=lambda t: np.isfinite(t.maps[:, 0, 0]).sum())
        at = track.lost[0] if track.lost else int(np.flatnonzero(lost)[0]) if lost.any() else 0
        number = int(clip.numbers[at])
        raise CannotObserve(
            clip.name,
            f"the rectangle of frame {track.mark.frame} was lost at frame {number}; draw it around something with "
            "corners that stays in the picture and that no animal walks over, or leave --landmark out and the ground "
            "is followed by itself",
            {"frame": number, "pictures": {f"frame {number}": track.pictures[at][1]}},
        )
    for track in tracks:
        if track.lost:
            numbers = ", ".join(str(int(clip.numbers[k])) for k in sorted(track.lost))
            notes.append(
                f"the rectangle of frame {track.mark.frame} was lost at frame {numbers}; the other one was used"
            )
    maps = np.array([_one(usable, k) for k in range(len(clip))])
    gap = ~np.isfinite(maps[:, 0, 0])
    maps[gap] = _bridged(maps, gap)
    middle = np.mean([moved_by(track.maps[0], track.points).mean(0) for track in usable], axis=0)
    return Steady(smoothed(maps, middle), True, notes)


def _run(lost):
    """The longest row of True."""
    edges = np.flatnonzero(np.diff(np.r_[0, lost.astype(int), 0]))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _one(tracks, k):
    """From picture k to the first, by the corners of all landmarks seen in it."""
    tracked = [track for track in tracks if np.isfinite(track.maps[k, 0, 0])]
    if not tracked:
        return np.full((2, 3), np.nan)
    now = np.concatenate([moved_by(track.maps[k], track.points) for track in tracked])
    first = np.concatenate([moved_by(track.maps[0], track.points) for track in tracked])
    return fitted(now, first)


def _bridged(maps, gap):
    """Maps for pictures in which nothing was found, on the straight line between their neighbours."""
    known = np.flatnonzero(~gap)
    flat = maps.reshape(len(maps), 6)
    return np.stack([np.interp(np.flatnonzero(gap), known, flat[known, i]) for i in range(6)], axis=1).reshape(-1, 2, 3)


def smoothed(maps, middle):
    """Maps with centre, angle and zoom smoothed over nine frames; exact for a camera whose motion is a parabola.

    Parameters
    ----------
    maps : (n, 2, 3) ndarray
    middle : (2,) ndarray
        The landmarks' middle in the first picture, px: c of eq. 1.
    """
    from scipy.signal import savgol_filter  # takes 0.4 s to import, and only landmarks need it

    if len(maps) < SMOOTH:
        return maps
    inverse = np.array([back(m) for m in maps])  # from the first picture to each: where the landmark is
    centre = inverse[:, :, :2] @ middle + inverse[:, :, 2]
    angle = np.unwrap(np.arctan2(inverse[:, 1, 0], inverse[:, 0, 0]))
    zoom = np.log(np.hypot(inverse[:, 1, 0], inverse[:, 0, 0]))
    parts = savgol_filter(np.column_stack([centre, angle, zoom]), SMOOTH, 2, axis=0, mode="interp")
    maps_smoothed = []
    for x, y, turn, size in parts:
        a, b = np.exp(size) * np.cos(turn), np.exp(size) * np.sin(turn)
        rotation = np.array([[a, -b], [b, a]])
        maps_smoothed.append(back(np.column_stack([rotation, (x, y) - rotation @ middle])))
    first = back(maps_smoothed[0])
    return np.array([after(first, m) for m in maps_smoothed])
