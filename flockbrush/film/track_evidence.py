"""Evidence for learning from tracks: smooth paths, headings, speeds, rates of turning, and fields on a grid.

Positions are smoothed through noise and short gaps (`flockbrush.film.tracks.smoothed`: Whittaker's smoother, with one
stiffness for all animals by generalised cross-validation). If the file has no headings, an animal heads in its
direction of motion; while its speed is below the noise, it keeps its last heading. A track is cut where one step is far
longer than all others: ids were swapped there, or animals left on one side and came back on the other. The uncertainty
of positions and headings is estimated by a parametric bootstrap: noise of the estimated size is added to the smooth
paths, which are smoothed again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.special import bdtrc

from flockbrush.engine.files import refused
from flockbrush.film.arena import Arena, beyond, lines_of, ring, wall_of
from flockbrush.film.cell_statistics import cell_statistics
from flockbrush.film.missing_animals import missing_places, neighbours_seen
from flockbrush.film.observations import CannotObserve, Evidence, Fields, Sightings
from flockbrush.film.path_smoothing import PathSmoothing, headings_of, held
from flockbrush.film.several_kinds import speeds_told
from flockbrush.film.speeds import speed_evidence
from flockbrush.film.track_files import Trajectories
from flockbrush.film.tracks import Tracks, central_differences, smoothed

GAP = 1.0  # s, and at least so many frames: an animal that is away for longer is another animal afterwards
GAP_FRAMES = 5
SHORTEST = 8  # frames of a track
SLOW = 2.0  # deviations of the noise of speed: a slower animal keeps its heading
SLOWEST = 0.02  # of the speed of the fastest tenth, the same
WHOLE = 0.9  # share of the animals that is there at a time, above which the tracks are of one whole herd
RADIUS = 0.2  # BL, half the width of a body, which tracks do not tell
EDGE = 1.0  # BL of ground around a whole herd, at least
BORDER, BY_CHANCE = 0.5, 0.01  # BL from the border of all positions; probability that so many tracks end there
PICTURE = 900  # pixels across of a drawn frame
GROUND, BODY, TAIL, WALL = (214, 228, 221), (60, 70, 66), (150, 166, 158), (168, 176, 172)  # BGR
FEWEST = 2  # animals
AT_BORDER = (
    "animals come and go at the border of all positions: the tracks are taken for those of a part of a herd, of which "
    "spread and growth are unknown"
)
INSIDE = (
    "animals come and go, but not at the border of all positions: the tracks are taken for those of a whole herd, "
    "although not all of its animals are always seen"
)
JUMP, LEAST_JUMP = 5.0, 0.1  # times the long steps of the herd; BL, taken for such a step of a herd that stands
ASIDE = math.pi / 4  # rad between headings and motion, in the median: headings of another kind
MIRRORED = math.radians(3.0)  # the same, where headings measured the other way round would be half as far aside
LEAP, LONG_STEPS = 20.0, 0.95  # times its usual step an animal never goes; quantile of all steps, `JUMP` times likewise


def evidence_of_tracks(tracks: Trajectories, length: float, grid: int = 30, arena: Arena | None = None) -> Evidence:
    """The evidence of a herd in its tracks.

    Parameters
    ----------
    tracks : Trajectories
    length : float
        Body length in the unit of the tracks.
    grid : int
        Cells along the longer side of the ground.
    arena : Arena, optional
        A wall around the animals: an obstacle of the fields.

    Returns
    -------
    Evidence
        In body lengths and seconds.

    Raises
    ------
    CannotObserve
        When there are fewer than `SHORTEST` frames or `FEWEST` animals.
    ProblemsError
        When the body length is not positive, or an animal is outside the arena.
    """
    if not (math.isfinite(length) and length > 0):
        raise refused(tracks.name, f"a body length must be above 0 {tracks.unit}, got {length:g}")
    if len(tracks) < SHORTEST:
        raise CannotObserve(tracks.name, f"has {len(tracks)} frames; at least {SHORTEST} are needed")
    pieces = _pieces(tracks, length)
    if pieces.xy.shape[1] < FEWEST:
        raise CannotObserve(
            tracks.name,
            f"animals visible for {SHORTEST} frames without a gap of {GAP:g} s: {pieces.xy.shape[1]}; "
            f"at least {FEWEST} are needed",
        )
    motion = _Motion.of(pieces, tracks.fps)
    missing = _missing_places(tracks, pieces, motion, length)
    sightings, velocity = _sightings(pieces, motion, neighbours_seen(motion.xy, missing))
    arena = None if arena is None else arena.around(tracks, RADIUS * length)
    wall = None if arena is None else wall_of(arena, tracks, length)
    fields, at_border = _fields(tracks, missing, sightings, velocity, grid, wall)
    speed = speed_evidence(fields, sightings, math.nan, motion.window, motion.errors)
    notes = [*tracks.notes, *_notes(tracks, pieces, motion, length), *speeds_told(sightings, tracks.fps)]
    notes += [] if at_border is None else [AT_BORDER if at_border else INSIDE]
    if arena is not None:
        notes.append(arena.told(tracks.file_unit))
    evidence = Evidence(
        name=tracks.name, sha256=tracks.sha256, fps=tracks.fps, body_length_px=float(length), length_source="given",
        radius_bl=RADIUS, fields=fields, sightings=sightings, speed=speed, notes=notes,
        place_noise=motion.place_noise, heading_noise=motion.heading_noise, length_unit=tracks.unit, start=tracks.start,
        smoothing=motion.smoothing, to_file=np.column_stack([np.diag(length / np.array(tracks.axes)), np.zeros(2)]),
        file_unit=tracks.file_unit, animals=np.array([tracks.ids[animal] for animal in pieces.animal]),
    )  # fmt: skip
    return _drawable(evidence)


@dataclass
class _Pieces:
    """Tracks without long gaps, BL."""

    xy: np.ndarray  # (T, P, 2), NaN where not seen
    heading: np.ndarray | None  # (T, P)
    animal: np.ndarray  # (P,) column of the tracks
    gaps: int  # that were filled
    away: int  # animals with longer gaps
    leaps: list[tuple[int, int]]  # row and column of the tracks at which one was cut, since the animal leaps to there


def _pieces(tracks, length):
    """Each track cut at its long gaps and where it leaps."""
    has_place, most = tracks.seen, max(GAP_FRAMES, round(GAP * tracks.fps))
    spans, leaps, away = [], [], 0
    steps = [_steps(tracks, animal, length) for animal in range(has_place.shape[1])]
    every = np.concatenate([step for _, step in steps])
    long = JUMP * float(np.quantile(every, LONG_STEPS)) if len(every) else np.inf
    for animal, (rows, step) in enumerate(steps):
        leap = step > max(LEAP * float(np.median(step)) if len(step) else 0.0, long, JUMP * LEAST_JUMP)
        gone = np.diff(rows) > most
        away += bool(gone.any())
        leaps += [(int(row), animal) for row in rows[1:][leap]]
        for part in np.split(rows, np.flatnonzero(gone | leap) + 1):
            if len(part) >= SHORTEST:
                spans.append((animal, part))
    xy = np.full((len(has_place), len(spans), 2), np.nan)
    heading = None if tracks.heading is None else np.full(xy.shape[:2], np.nan)
    gaps = 0
    for k, (animal, rows) in enumerate(spans):
        xy[rows, k] = tracks.xy[rows, animal] / length
        gaps += int((np.diff(rows) > 1).sum())
        if heading is not None:
            heading[rows, k] = tracks.heading[rows, animal]
    return _Pieces(xy, heading, np.array([animal for animal, _ in spans], int), gaps, away, leaps)


def _steps(tracks, animal, length):
    """Rows (m,) in which an animal was seen, and how far it went a frame between them (m - 1,), BL."""
    rows = np.flatnonzero(tracks.seen[:, animal])
    way = np.diff(tracks.xy[rows, animal], axis=0) / length
    return rows, np.hypot(*way.T) / np.diff(rows)


@dataclass
class _Motion:
    """Smooth paths and what follows from them."""

    xy: np.ndarray  # (T, P, 2) BL; NaN where an animal is not there
    velocity: np.ndarray  # (T, P, 2) BL/s
    angle: np.ndarray  # (T, P) rad, unwrapped
    turn: np.ndarray  # (T, P) rad/s; NaN unknown
    smoothing: PathSmoothing
    place_noise: float
    heading_noise: float
    window: float  # s over which speeds are averages
    errors: np.ndarray  # (k,) covariances of the errors of speeds so many frames apart, BL²/s²
    headless: np.ndarray  # (P,) bool: no heading was ever observed

    @classmethod
    def of(cls, pieces, fps):
        paths = smoothed(Tracks(pieces.xy, np.arange(pieces.xy.shape[1])))
        velocity = central_differences(paths.px) * fps
        again = _again(pieces, paths)
        off, other = again - paths.px, central_differences(again) * fps
        speed = np.hypot(velocity[..., 0], velocity[..., 1])
        slow = max(SLOW * _spread(other - velocity), SLOWEST * float(np.nanquantile(speed, 0.9)), 1e-9)
        if pieces.heading is None:
            angle, sure = headings_of(velocity, slow, np.arctan2(velocity[..., 1], velocity[..., 0]))
        else:
            there, known = np.isfinite(velocity[..., 0]), np.isfinite(pieces.heading)
            angle, sure = held(pieces.heading, there, known, np.arctan2(velocity[..., 1], velocity[..., 0]))
        apart = _wrapped(np.arctan2(other[..., 1], other[..., 0]) - np.arctan2(velocity[..., 1], velocity[..., 0]))
        fast = speed > slow
        turn = np.where(sure, central_differences(angle) * fps, np.nan)
        window = 2.0 * (paths.stiffness ** (1 / 6) + 1.0) / fps
        wrong = ((other - velocity) * np.stack([np.cos(angle), np.sin(angle)], -1)).sum(-1)
        lags = range(min(len(wrong), round(2 * window * fps)))
        errors = np.nan_to_num([np.nanmean(wrong[: len(wrong) - k] * wrong[k:]) for k in lags])
        noise = float(np.sqrt(np.nanmean(apart[fast] ** 2))) if fast.any() else 0.0  # rad
        smoothing = PathSmoothing(paths.stiffness, paths.noise, slow, None if pieces.heading is None else noise)
        return cls(
            paths.px, velocity, angle, turn, smoothing, _spread(off), noise, float(window), errors,
            ~sure.any(0),
        )  # fmt: skip


def _again(pieces, paths):
    """The paths smoothed again with noise of the estimated size: a parametric bootstrap."""
    rng = np.random.default_rng(51)
    shaken = paths.px + paths.noise * rng.normal(size=paths.px.shape)
    shaken[~np.isfinite(pieces.xy).all(-1)] = np.nan
    return smoothed(Tracks(shaken, np.arange(shaken.shape[1])), paths.stiffness).px


def _spread(values):
    """Root mean square of one coordinate."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _missing_places(tracks, pieces, motion, length):
    """Estimated positions (T, A, 2), BL, of animals in frames in which they are missing."""
    here, there = np.isfinite(motion.xy[..., 0]), np.zeros(tracks.seen.shape, bool)
    for k, animal in enumerate(pieces.animal):
        there[:, animal] |= here[:, k]
    return missing_places(tracks.xy / length, there, tracks.fps)


def _sightings(pieces, motion, around):
    """Sightings of all pieces, and their velocities (m, 2) BL/s in the same order."""
    known = np.isfinite(motion.xy[..., 0])
    angle = motion.angle[known]
    forward = np.column_stack([np.cos(angle), np.sin(angle)])
    velocity = motion.velocity[known]
    speed = np.maximum((velocity * forward).sum(1), 0.0)
    track = np.broadcast_to(np.arange(known.shape[1]), known.shape)[known]
    first = np.concatenate([[0], np.cumsum(known.sum(1))])
    sightings = Sightings(
        first, motion.xy[known], forward, speed, motion.turn[known], track.astype(np.int64), around[known]
    )  # fmt: skip
    return sightings, velocity


# fields ---------------------------------------------------------------------------------------------


def _fields(tracks, missing, sightings, velocity, grid, wall=None):
    """(fields of all animals; whether they come and go at the border of the ground, None if they do not come and go).

    The ground has a margin unless they do, so that it shows the whole herd. Nobody crosses a wall.  Missing animals
    count in density and number where animals are seen; velocities are of visible animals only.
    """
    low, high = sightings.xy.min(0), sightings.xy.max(0)
    on_ground = ((missing >= low) & (missing <= high)).all(-1)
    gone, hidden = np.nonzero(on_ground)[0], missing[on_ground]
    here = np.diff(sightings.first) + on_ground.sum(1)
    at_border = None
    if here.min() < WHOLE * here.max():
        at_border = wall is None and _crossed(sightings, velocity / tracks.fps, low, high)
    room = 0.01 if at_border else max(1.2 * float((high - low).max()) / (grid - 2.4), EDGE)
    if wall is not None:
        low, high = np.minimum(low, wall.min(0)), np.maximum(high, wall.max(0))
    low, high = low - room, high + room
    cell = float(max((high - low).max() / grid, 0.1))
    nx, ny = np.maximum(np.ceil((high - low) / cell - 1e-9).astype(int), 1)
    shape = len(sightings), int(ny), int(nx)

    def cells(frame, xy):
        at = np.clip(np.floor((xy - low) / cell).astype(int), 0, (nx - 1, ny - 1))
        return (frame * ny + at[:, 1]) * nx + at[:, 0]

    grids = cell_statistics(cells(sightings.frame, sightings.xy), sightings.forward, velocity, shape)
    unseen = np.bincount(cells(gone, hidden), minlength=math.prod(shape)).reshape(shape)
    density = (grids.pop("number") + unseen) / cell**2
    fields = Fields(
        fps=tracks.fps, cell=cell, origin=low.copy(), density=density, seen=np.ones(shape, bool),
        obstacle=np.zeros(shape[1:], bool), region=np.zeros(shape[1:], np.uint8), count=here.astype(float),
        frames=np.asarray(tracks.frames), **grids,
    )  # fmt: skip
    if wall is None:
        return fields, at_border
    outline = ring(wall, low, low + cell * np.array([nx, ny]))
    return replace(fields, obstacle=beyond(wall, fields.centres), outline=outline), at_border


def _crossed(sightings, step, low, high):
    """Whether more tracks begin or end at the border of all positions than chance explains: animals cross it.

    ``step``: (m, 2) BL from frame to frame.
    """
    order = np.argsort(sightings.track, kind="stable")  # of one track, they stay in order of time
    bounds = np.flatnonzero(np.diff(sightings.track[order], prepend=-1, append=-1))
    first, last = order[bounds[:-1]], order[bounds[1:] - 1]
    frame = sightings.frame
    ends = np.concatenate([first[frame[first] > 0], last[frame[last] < len(sightings) - 1]])
    far = np.minimum(sightings.xy - low, high - sightings.xy).min(1)
    near = far <= np.maximum(BORDER, np.hypot(*step.T))
    return bool(len(ends) and bdtrc(int(near[ends].sum()) - 1, len(ends), near.mean()) < BY_CHANCE)


def _jumps(tracks, length):
    """Sentences about frames between which most animals jump: such a file contains two recordings."""
    steps = np.diff(tracks.xy, axis=0) / length
    way = np.hypot(steps[..., 0], steps[..., 1])
    usual = np.array([np.nanmedian(row) if np.isfinite(row).any() else 0.0 for row in way])
    for t in np.flatnonzero(usual > JUMP * max(float(np.quantile(usual, 0.9)), LEAST_JUMP))[:3]:
        a, b = tracks.frames[t], tracks.frames[t + 1]
        yield f"the herd jumps between frames {a} and {b}; if two recordings were joined, use --frames"


def _notes(tracks, pieces, motion, length):
    yield from _jumps(tracks, length)
    yield (
        f"from tracks: positions are smoothed over about {motion.window:.2g} s; "
        f"their noise is {motion.smoothing.noise * length:.2g} {tracks.unit}"
    )
    if pieces.leaps:
        row, animal = pieces.leaps[0]
        yield (
            f"animals leap {len(pieces.leaps)} times, first animal {tracks.ids[animal]} to frame {tracks.frames[row]}, "
            "as where ids are swapped: tracks are cut there, and what follows counts as another animal"
        )
    if pieces.gaps or pieces.away:
        if pieces.gaps:
            yield "1 gap was filled" if pieces.gaps == 1 else f"{pieces.gaps} gaps were filled"
        if pieces.away:
            who, new = ("1 animal was", "counts as a new animal")
            if pieces.away > 1:
                who, new = f"{pieces.away} animals were", "count as new animals"
            yield f"{who} missing for more than {GAP:g} s and {new} afterwards"
    missing = _missing(tracks, motion)
    if missing > 1 - WHOLE:
        yield (
            f"animals are missing for {missing:.0%} of the time between their first and last frame: densities count "
            "them where they may be, and turns and spacing of animals with missing neighbours count less"
        )
    if tracks.heading is not None:
        moves = np.hypot(*np.moveaxis(motion.velocity, -1, 0)) > motion.smoothing.slow
        way = np.arctan2(motion.velocity[..., 1], motion.velocity[..., 0])[moves]
        aside, mirrored = (
            float(np.median(np.abs(_wrapped(angle - way)))) if len(way) else 0.0
            for angle in (motion.angle[moves], -motion.angle[moves])
        )
        turned = aside > max(2.0 * mirrored, MIRRORED)
        if aside > ASIDE or turned:
            yield (
                f"animals move {math.degrees(aside):.0f} degrees aside of their headings, in the median: headings are "
                "in radians from x towards y, as the axes of the file lie"
                + f"; measured the other way round they would be {math.degrees(mirrored):.0f} degrees aside"
                * turned
            )
    else:
        slow = np.hypot(*motion.velocity[np.isfinite(motion.velocity).all(-1)].T) < motion.smoothing.slow
        yield (
            f"headings are directions of motion; below {motion.smoothing.slow * length:.2g} {tracks.unit}/s, as in "
            f"{slow.mean():.0%} of all sights, an animal keeps its last heading"
        )
        if motion.headless.any():
            yield (
                f"{motion.headless.sum()} tracks are never faster: they have no heading, and do not count in measures "
                "of headings"
            )
        if slow.mean() > 0.5:
            yield "most animals stand, or move less than their positions are uncertain: do not trust their headings"
    yield "tracks have no body width: half the width is assumed to be 0.2 body lengths"


def _missing(tracks, motion):
    """Share of the time from the first to the last sight of an animal in which it is not there, gaps being filled."""
    has_place = tracks.seen[:, tracks.seen.any(0)]
    stays = len(has_place) - has_place.argmax(0) - has_place[::-1].argmax(0)
    return 1.0 - np.isfinite(motion.xy[..., 0]).sum() / stays.sum()


# pictures -------------------------------------------------------------------------------------------


def _drawable(evidence):
    """The evidence with a plain ground as its picture, for the report."""
    fields = evidence.fields
    size = fields.cell * np.array(fields.shape[::-1])
    scale = PICTURE / float(size.max())
    low, high = np.asarray(fields.origin, float), fields.origin + size
    wide, tall = np.maximum(np.ceil(size * scale).astype(int), 2)
    to_pixels = np.array([[scale, 0.0, -scale * low[0]], [0.0, -scale, scale * high[1]]])
    picture = np.full((tall, wide, 3), GROUND, np.uint8)
    if fields.outline is not None:
        lines = [line @ to_pixels[:, :2].T + to_pixels[:, 2] for line in lines_of(fields.outline)]
        cv2.fillPoly(picture, [np.round(line).astype(np.int32) for line in lines], WALL, cv2.LINE_AA)
    return replace(evidence, picture=picture, to_pixels=to_pixels)


def drawn_tracks(evidence: Evidence, t: int) -> np.ndarray:
    """The animals of frame t on a plain ground, (h, w, 3) BGR."""
    assert evidence.picture is not None and evidence.sightings is not None, "tracks have both"
    image = evidence.picture.copy()
    sightings, way = evidence.sightings, np.asarray(evidence.to_pixels, float)
    rows = sightings.of(t)
    scale = float(way[0, 0])
    half = max(0.5 - evidence.radius_bl, 0.1) * sightings.forward[rows]
    ends = [(sightings.xy[rows] + sign * half) @ way[:, :2].T + way[:, 2] for sign in (-1, 1)]
    thick = max(2, round(2 * evidence.radius_bl * scale))
    for tail, head in zip(*(np.round(end * 16).astype(int).tolist() for end in ends), strict=True):
        cv2.line(image, tail, head, BODY, thick, cv2.LINE_AA, 4)
        cv2.circle(image, head, max(16, 6 * thick), TAIL, -1, cv2.LINE_AA, 4)
    return image
