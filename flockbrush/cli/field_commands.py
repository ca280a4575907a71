"""The command ``flockbrush fields``: density, motion and single animals of a clip, and a preview video."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from flockbrush.engine.files import held, output_problems, refused, whole
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.camera_maps import after, back
from flockbrush.film.observations import Evidence
from flockbrush.film.observe import Glance, Watch
from flockbrush.film.open_clip import Looking, look_at, tell_notes
from flockbrush.render.picture_files import Video
from flockbrush.runs.terminal import Interrupts, compiling, print_json, say, show, table

WIDE, LARGER = 640, 2.0  # px of each half of the preview, if a small clip is not made larger than so many times
FULL = 3.0  # animals a BL² that are drawn in the strongest colour: shoulder to shoulder
FONT = cv2.FONT_HERSHEY_SIMPLEX


def fields_of_clip(clip, out, looking: Looking, preview=None, as_json=False) -> Evidence:
    """Measure the fields of a clip, write them and a preview, and print a summary.

    Parameters
    ----------
    clip : path
    out : path
        An npz file for `flockbrush.film.observations.Evidence.load`.
    preview : path, optional
        An mp4 file: left the clip with outlines and motion of the bodies, right density and mean motion.

    Raises
    ------
    ProblemsError
        When the clip is not sufficient; no file has been written then.
    """
    _check(clip, out, preview, looking)
    begin = time.perf_counter()
    with held(out), Interrupts(), compiling(), ExitStack() as stack:
        preview_video = _Preview(preview, stack) if preview else None
        evidence = look_at(clip, looking, preview_video)
        with whole(out) as temporary:
            evidence.save(temporary)
    _tell(out, preview, evidence, time.perf_counter() - begin, as_json)
    return evidence


def _check(clip, out, preview, looking):
    inputs = [path for path in (clip, looking.obstacles, looking.regions) if path is not None]
    problems = output_problems([path for path in (out, preview) if path is not None], inputs)
    if problems:
        raise ProblemsError(problems)
    for path, ending in ((out, ".npz"), (preview, ".mp4")):
        if path is not None and Path(path).suffix.lower() != ending:
            raise refused(path, f"its name must end in {ending}")


def _tell(out, preview, evidence, seconds, as_json):
    fields, speed = evidence.fields, evidence.speed
    facts = {
        "frames": len(fields),
        "fps": evidence.fps,
        "animals": float(np.median(fields.count)),
        "told_apart": evidence.sightings is not None,
        f"body_length_{evidence.length_unit}": evidence.clip_body_px,
        "body_length_source": evidence.length_source,
        "body_radius_bl": evidence.radius_bl,
        "cells": [fields.shape[1], fields.shape[0]],
        "cell_bl": fields.cell,
        "speed_bl_s": speed.mean if speed else None,
        "speed_deviation_bl_s": speed.deviation if speed else None,
        "speed_reversion_1_s": speed.reversion if speed else None,
        "speed_individual_bl_s": speed.individual if speed else None,
        "speed_common_bl_s": speed.common if speed else None,
        "seconds_a_frame": seconds / len(fields),
        "notes": evidence.notes,
        "files": [str(path) for path in (out, preview) if path is not None],
    }
    if as_json:
        print_json(facts)
        return
    rows = (
        [("frames", facts["frames"])]
        if evidence.still
        else [("frames", facts["frames"]), ("frames per second", facts["fps"])]
    )
    rows += [
        ("animals" if evidence.still else "animals per frame (median)", f"{facts['animals']:.1f}"),
        ("body length", evidence.length_told), ("half body width, body lengths", facts["body_radius_bl"]),
        ("cells, x and y", "{} x {}".format(*facts["cells"])), ("cell size, body lengths", facts["cell_bl"]),
    ]  # fmt: skip
    if speed:
        rows += [("speed, body lengths/s", speed.mean), ("standard deviation of the speed", speed.deviation)]
        rows += [("reversion rate of the speed, 1/s", speed.reversion)]
    rows.append(("processing time per frame, ms", 1e3 * facts["seconds_a_frame"]))
    show(table("what", "value", rows=rows, right=("value",)))
    tell_notes(evidence.name, evidence)
    for path in facts["files"]:
        say(f"wrote {path}")


# the preview -----------------------------------------------------------------------------


class _Preview:
    """Writes the preview video, frame by frame; the file gets its name when it is complete."""

    def __init__(self, path, stack):
        self.path, self.stack, self.video = path, stack, None

    def __call__(self, glance: Glance, watch: Watch, fields: dict):
        picture = drawing(glance, watch, fields)
        if self.video is None:
            size = picture.shape[1::-1]
            fps = float(np.clip(watch.clip.fps, 1, 60)) if not watch.clip.still else 1.0
            self.video = self.stack.enter_context(Video(self.path, fps=fps, size=size))
        self.video.write(np.ascontiguousarray(picture[..., ::-1]))


def drawing(glance: Glance, watch: Watch, fields: dict) -> np.ndarray:
    """The left and right half of a preview frame, (h, w, 3) BGR.

    Parameters
    ----------
    fields : dict
        ``density`` (ny, nx) and ``velocity`` (ny, nx, 2) of this frame.
    """
    scale = min(LARGER, WIDE / watch.clip.size[0])
    size = tuple(2 * max(1, round(side * scale / 2)) for side in watch.clip.size)
    small = cv2.resize(glance.picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
    left = _bodies(small.copy(), glance, watch, scale)
    right = _cells(small, glance, watch, fields, scale)
    cv2.line(right, (0, 0), (0, size[1]), (255, 255, 255), 1)
    return np.hstack([left, right])


def _bodies(picture, glance, watch, scale):
    """Draw outlines of the bodies and arrows of their motion, coloured by direction."""
    outlines, _ = cv2.findContours(glance.mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    lines = [np.round((o + 0.5) * scale * 16).astype(np.int32) for o in outlines]
    cv2.polylines(picture, lines, True, (0, 0, 0), 2, cv2.LINE_AA, 4)
    cv2.polylines(picture, lines, True, (255, 255, 255), 1, cv2.LINE_AA, 4)
    at, move = _thinned(glance, watch)
    quick = float(np.quantile(np.hypot(*move.T), 0.9)) if len(move) else 1.0
    length = 1.2 * watch.size.length / max(quick, 1e-6)
    for (x, y), (u, v) in zip(at * scale, move * scale * length, strict=True):
        _arrow(picture, (x, y), (x + u, y + v), _hue(u, v))
    _says(picture, f"frame {int(watch.clip.numbers[glance.k])}   {_animals(glance, watch):.0f} animals", (8, 18))
    return picture


def _thinned(glance, watch):
    """(at, move) of about one point per body."""
    if not len(glance.at):
        return np.empty((0, 2)), np.empty((0, 2))
    side = 0.8 * watch.size.length
    key = np.floor(glance.at / side).astype(np.int64) @ (1, 1 << 20)
    _, where = np.unique(key, return_inverse=True)
    count = np.bincount(where)
    mean = [np.bincount(where, values) / count for values in (*glance.at.T, *glance.move.T)]
    full = count > 0.15 * count.max()
    return np.column_stack(mean[:2])[full], np.column_stack(mean[2:])[full]


def _animals(glance, watch):
    zoom = abs(np.linalg.det(watch.steady.maps[glance.k][:, :2]))
    return glance.mask.sum() * zoom / watch.size.area


def _cells(picture, glance, watch, fields, scale):
    """Draw density as colour and mean velocity as arrows for each cell, over the picture."""
    grid, density = watch.grid, np.nan_to_num(fields["density"])
    ground = cv2.addWeighted(picture, 0.45, np.full_like(picture, 255 if picture.mean() > 128 else 0), 0.55, 0)
    tint = cv2.applyColorMap(np.uint8(255 * np.clip(density / FULL, 0, 1) ** 0.5), cv2.COLORMAP_INFERNO)
    to_picture = after(
        np.array([[scale, 0, 0], [0, scale, 0]]), after(back(watch.steady.maps[glance.k]), grid.to_pixels)
    )
    cells = np.array([[grid.cell, 0, grid.origin[0] + grid.cell / 2], [0, grid.cell, grid.origin[1] + grid.cell / 2]])
    way, size = after(to_picture, cells), picture.shape[1::-1]
    tint = cv2.warpAffine(tint, way, size, flags=cv2.INTER_NEAREST)
    alpha = cv2.warpAffine((density > 0.02).astype(np.float32), way, size, flags=cv2.INTER_NEAREST)[..., None] * 0.65
    blended = (ground * (1 - alpha) + tint * alpha).astype(np.uint8)
    velocity = fields["velocity"]
    rows, columns = np.nonzero(np.isfinite(velocity[..., 0]) & (density > 0.05))
    v = velocity[rows, columns]
    usual, quick = np.quantile(np.hypot(*v.T), (0.5, 0.9)) if len(v) else (0.0, 0.0)
    pace = f", their median speed {usual:.2g} body lengths/s" if len(v) else ""
    longest = 1.2 * grid.cell / max(quick, 1e-6)
    middle = grid.origin + grid.cell * (np.column_stack([columns, rows]) + 0.5)
    for a, b in zip(middle - 0.5 * longest * v, middle + 0.5 * longest * v, strict=True):
        _arrow(
            blended, to_picture[:, :2] @ a + to_picture[:, 2], to_picture[:, :2] @ b + to_picture[:, 2], (255, 255, 255)
        )
    _says(blended, f"cells of {grid.cell:.2g} body lengths{pace}", (8, 18))
    _scale_bar(blended, scale * watch.length)
    return blended


def _arrow(picture, a, b, colour):
    a, b = (tuple(int(v) for v in np.round(np.asarray(p) * 8)) for p in (a, b))
    if max(map(abs, (*a, *b))) > 1 << 20:
        return
    cv2.line(picture, a, b, (0, 0, 0), 3, cv2.LINE_AA, 3)
    cv2.arrowedLine(picture, a, b, (0, 0, 0), 3, cv2.LINE_AA, 3, 0.35)
    cv2.arrowedLine(picture, a, b, colour, 1, cv2.LINE_AA, 3, 0.35)


def _hue(u, v):
    """The BGR colour of a direction."""
    hue = np.uint8(round((np.degrees(np.arctan2(-v, u)) % 360) / 2) % 180)
    return tuple(int(c) for c in cv2.cvtColor(np.uint8([[[hue, 200, 255]]]), cv2.COLOR_HSV2BGR)[0, 0])


def _scale_bar(picture, length):
    """Draw a scale bar of 5 body lengths at the bottom left."""
    y = picture.shape[0] - 12
    cv2.line(picture, (10, y), (10 + round(5 * length), y), (0, 0, 0), 4)
    cv2.line(picture, (10, y), (10 + round(5 * length), y), (255, 255, 255), 2)
    _says(picture, "5 body lengths", (10, y - 8))


def _says(picture, text, at):
    """Write white text on a dark band, smaller if it does not fit."""
    letters, (x, y) = 0.45, at
    (wide, tall), base = cv2.getTextSize(text, FONT, letters, 1)
    letters *= min(1.0, (picture.shape[1] - 2 * x) / wide)
    (wide, tall), base = cv2.getTextSize(text, FONT, letters, 1)
    band = picture[max(0, y - tall - 3) : y + base + 1, max(0, x - 4) : x + wide + 4]
    band[:] = band // 4
    cv2.putText(picture, text, at, FONT, letters, (255, 255, 255), 1, cv2.LINE_AA)
