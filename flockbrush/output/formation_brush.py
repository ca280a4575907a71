"""Brushes made from an extracted formation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flockbrush
from flockbrush.engine.files import refused, write_text


def write_brush(formation, out, like, source):
    """Write a brush that flies as a formation does; the parameters it took from that.  The caller has claimed the file.

    Parameters
    ----------
    out : path
        Ends in ``.brush.toml``.
    like : str
        A brush of line_formation, by name or file: speed, body and everything else are its.
    source : str
        What the formation is from, for the brush's provenance.

    Raises
    ------
    ProblemsError
    """
    from datetime import date

    from flockbrush.behaviours.brush import Brush, Provenance, load_brush, shipped
    from flockbrush.behaviours.brush_writer import brush_to_toml

    out = Path(out)
    if not out.name.endswith(".brush.toml"):
        raise refused(out, "the name of a brush must end in .brush.toml")
    learned = parameters_of(formation)
    base = load_brush(like) if like.endswith(".brush.toml") else shipped().get(like)
    if base.model != "line_formation":
        raise refused(
            like, f"is a brush of the model {base.model}; a formation needs a brush of line_formation, such as geese"
        )
    made = Brush(
        name=out.name.removesuffix(".brush.toml"),
        model=base.model,
        description=f"Flies as in {formation.name or source}.",
        colour=base.colour,
        transition=base.transition,
        parameters=base.params.model_dump() | learned,
        speed=base.speed,
        body=base.body,
        vision=base.vision,
        provenance=Provenance(
            kind="learned",
            source=source,
            date=date.today(),
            by=f"flockbrush {flockbrush.__version__}",
            notes=f"{len(formation.usable)} of {len(formation.frames)} frames; speed and body of {like}",
        ),
    )
    write_text(out, brush_to_toml(made))
    load_brush(out)
    return learned


def parameters_of(formation):
    """Parameters of the model line_formation from an extracted formation."""
    frames = formation.usable
    if not frames:
        raise refused(formation.name or "formation", "has no frame with a line formation")
    kinds = formation.kinds()
    kind = max((k for k in kinds if k != "none"), key=lambda k: kinds[k])
    same = [frame for frame in frames if frame.kind == kind]
    slopes, bends = [], []
    for frame in same:
        numbers = frame.curve.numbers
        if frame.curve.model == "parabola":
            bends.append(-numbers[2])
        else:  # of a V left and right, of a line one
            slopes.append([abs(numbers[1]), abs(numbers[-1])])
    others = [len(frame.birds) - 1 for frame in same]
    parameters = {
        "shape": kind,
        "spacing": float(np.clip(np.mean([frame.spacing[0] for frame in same]), 0.9, 10)),
        "left": float(np.mean([frame.leader / max(n, 1) for frame, n in zip(same, others, strict=True)])),
        "deviation": float(np.clip(np.mean([frame.deviation[1] for frame in same]), 0, 2)),
        "lateral": float(np.clip(np.mean([frame.spacing[1] for frame in same]), 0, 2)),
    }
    if slopes:
        left, right = np.clip(np.mean(slopes, axis=0), 0.1, 5)
        parameters |= {"slope": float(left), "slope_right": float(right) if kind == "V" else 0.0}
    if bends:
        parameters["curvature"] = float(np.clip(np.mean(bends), 0.001, 1))
    return parameters
