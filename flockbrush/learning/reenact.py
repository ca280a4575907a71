"""A clip done again by a brush: begun as the clip begins, then left alone, and compared frame by frame."""

from __future__ import annotations

import csv
import io
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from flockbrush.behaviours.brush import SUFFIX, load_brush, shipped
from flockbrush.engine.files import held, output_problems, refused, whole, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.observations import Evidence
from flockbrush.film.open_clip import Looking, look_at, moving_pictures, tell_notes
from flockbrush.learning.comparison import ERRORS, JUDGED, Comparison, compared
from flockbrush.learning.model_fit import kinds_of_models
from flockbrush.learning.rollout import Run
from flockbrush.learning.side_by_side import ComparisonGround
from flockbrush.learning.simulate import longest_way, simulated
from flockbrush.learning.words_of_tracks import words_for
from flockbrush.learning.world_rollout import needs_world
from flockbrush.render import Video
from flockbrush.runs.terminal import INTERRUPTED, Interrupts, compiling, measure, print_json, progress, say, show, table

SLOWEST = 10.0  # pictures a second of a video: slower clips are shown in real time by repeating frames
ROWS = 6  # horizons in the table


def reenact_clip(clip, brush_name, looking: Looking, runs=3, seed=0, export=None, video=None, as_json=False) -> int:
    """Simulate a clip with a brush, print how well it agrees, write the requested files, and return the exit code.

    Parameters
    ----------
    clip : path
    brush_name : str
        A file, or a shipped name.
    runs : int
        Simulations with different chance.
    export, video : path, optional
        Positions in body lengths and pixels (CSV); clip beside simulation (MP4).

    Raises
    ------
    ProblemsError
    """
    brush = _brush(brush_name)
    _checked(clip, export, video)
    looking = replace(looking, usual_length_m=brush.body.length)
    with held(*([export] if export is not None else [])), Interrupts(), compiling():
        evidence = look_at(clip, looking)
        if evidence.still:
            raise refused(clip, "is one picture; there is no motion to compare with")
        tell_notes(clip, evidence)
        if needs_world(brush.params) and (evidence.fields.obstacle.any() or evidence.fields.shows_part):
            shows = "obstacles" if evidence.fields.obstacle.any() else "a part of a herd"
            raise refused(
                clip, f"it shows {shows}, and animals of the model {brush.model} are simulated on open ground only; "
                f"use a brush of another model, not {brush.name}",
            )  # fmt: skip
        try:
            done = [simulated(evidence, brush, seed + k) for k in range(runs)]
        except ValueError as error:
            raise refused(clip, f"{error}; start at another frame with --frames") from None
        comparison = compared(evidence, done)
        if export is not None:
            write_text(export, _csv(evidence, done[0]))
            say(f"wrote {export}")
        if as_json:
            print_json(_as_json(evidence, brush, comparison))
        else:
            _show(brush, comparison)
        if video is not None:
            try:
                _film(clip, evidence, brush, done[0], video)
            except KeyboardInterrupt:
                say(f"stopped; {video} {'is still the earlier file' if Path(video).exists() else 'was not written'}")
                return INTERRUPTED
            say(f"wrote {video}")
    return 0


def _brush(name):
    brush = load_brush(name) if str(name).endswith(SUFFIX) else shipped().get(str(name))
    if brush.model not in kinds_of_models() or not getattr(brush.params, "grounded", True):
        kinds = (
            f"a brush of the model herd, or of another model on the ground that learn fits, and this is {brush.model}"
        )
        raise refused(name, f"reenact needs {kinds}")
    return brush


def _checked(clip, export, video):
    problems = output_problems([path for path in (export, video) if path is not None], [clip])
    for path, ending in ((export, ".csv"), (video, ".mp4")):
        if path is not None and Path(path).suffix.lower() != ending:
            problems += refused(path, f"its name must end in {ending}").problems
    if problems:
        raise ProblemsError(problems)


# what comes of it -----------------------------------------------------------------------------


def _csv(evidence: Evidence, run: Run) -> str:
    """Frame, id, place and heading in body lengths, and the place in pixels of the first frame or as tracked."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    unit, to_pixels = _to_clip(evidence)
    own = [] if unit == "bl" else [f"x_{unit}", f"y_{unit}"]
    writer.writerow(["frame", "time_s", "id", "x_bl", "y_bl", "forward_x", "forward_y", "speed_bl_s", *own])
    for t, frame in enumerate(evidence.fields.frames):
        rows = run.of(t)
        xy, forward, speed = run.xy[rows], run.forward[rows], run.speed[rows]
        pixels = xy @ to_pixels[:, :2].T + to_pixels[:, 2]
        for k, who in enumerate(run.ids[rows]):
            values = [*xy[k], *forward[k], speed[k], *pixels[k][: len(own)]]
            writer.writerow([frame, f"{evidence.start + run.times[t]:.5f}", who, *(f"{v:.5g}" for v in values)])
    return text.getvalue()


def _to_clip(evidence):
    """(unit, (2, 3) map) from body lengths to the places of the clip or of the file of tracks."""
    if evidence.to_file is not None:
        return evidence.file_unit, evidence.to_file
    return "px", np.full((2, 3), np.nan) if evidence.to_pixels is None else np.asarray(evidence.to_pixels)


def _film(clip, evidence, brush, run, path):
    """Clip left, simulation right."""
    pictures, scale = moving_pictures(clip, evidence)
    stage = ComparisonGround(evidence, brush, [longest_way(run)], scale)
    fps = evidence.fps
    again = max(1, int(np.ceil(SLOWEST / fps)))
    with progress("filming", len(evidence.fields)) as bar, whole(path) as temporary, ExitStack() as stack:
        video = None
        for t, frame in pictures:
            image = _picture(stage, evidence, brush, run, frame, t)
            if video is None:
                video = stack.enter_context(Video(temporary, fps * again, image.shape[1::-1]))
            for _ in range(again):
                video.write(image)
            bar(t + 1)


def _picture(stage, evidence, brush, run, frame, t):
    rows = run.of(t)
    words = (
        words_for(evidence)(f"clip, frame {evidence.fields.frames[t]}"),
        f"{brush.name}, {run.times[t]:.1f} s after the same start",
    )
    return stage.beside(frame, t, run.xy[rows], run.forward[rows], float(run.times[t]), words, run.ids[rows])


def _as_json(evidence, brush, comparison: Comparison):
    return {
        "clip": evidence.name,
        "sha256": evidence.sha256,
        "brush": brush.name,
        "frames": [int(evidence.fields.frames[0]), int(evidence.fields.frames[-1])],
        "met": comparison.met,
        "compared": [vars(v) | {"off": v.off, "met": v.met} for v in comparison.verdicts()],
        "figures": comparison.figures("reenacted"),
        "series": {
            "frame": comparison.frames,
            "time": comparison.times,
            "clip": comparison.clip,
            "simulation": {name: comparison.herd(name) for name in comparison.herds[0]},
        },
    }


def _show(brush, comparison: Comparison):
    names = [v.name for v in comparison.verdicts() if v.name in (*JUDGED, "aspect", "nearest neighbour")]
    columns = ["seconds", "frame", *(f"{name}\n{comparison.subject} / {brush.name}" for name in names), *ERRORS]
    made = table(*columns, title=f"{brush.name} against the {comparison.subject}", right=columns)
    for t in np.unique(np.linspace(0, len(comparison.times) - 1, ROWS).round().astype(int)):
        pairs = [f"{measure(comparison.clip[n][t])} / {measure(float(comparison.herd(n)[t]))}" for n in names]
        errors = [measure(float(comparison.herd(error)[t])) for error in ERRORS]
        made.add_row(f"{comparison.times[t]:.2f}", str(comparison.frames[t]), *pairs, *errors)
    show(made)
    for v in comparison.verdicts():
        if v.name in JUDGED:
            met = "met" if v.met else "MISSED"
            told = f"{v.clip:.3f} in the {comparison.subject}, {v.herd:.3f} simulated, difference {v.off:.3f}"
            say(f"{v.name}: {told} (allowed: {v.allowed:.3f}): {met}")
