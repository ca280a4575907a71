"""Options of the commands ``flockbrush track`` and ``flockbrush lift``."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from flockbrush.cli.shared_options import Json, argument, grouped, option, wrong

LiftMethod = enum.Enum("LiftMethod", {"smooth": "smooth", "cobyla": "cobyla"}, type=str)  # of finding depths


def track(
    clip: Annotated[Path, argument("CLIP", "Clip (video) of birds against the sky.")],
    out: Annotated[Path, option("FILE", "Table of tracks to write: frame, id, x, y in pixels.")],
    seed_points: Annotated[
        Path | None, option("FILE", "Table of known positions to start from: frame, id, x, y.")
    ] = None,
    correct: Annotated[
        Path | None, option("FILE", "Table of corrected positions to track on from: frame, id, x, y.")
    ] = None,
    reach: Annotated[
        float | None, option("PX", "Largest distance between predicted and detected position of a bird, pixels.", min=1)
    ] = None,
    json: Json = False,
):
    """Track birds in a clip: each bird keeps its id through crossings and gaps."""
    from flockbrush.film.track_clip import track_clip

    return track_clip(clip, out, seed_points, correct, reach, json)


@dataclass
class LiftWeights:
    """What a flight should be like, as `LiftWish` has it."""

    smoothness: Annotated[float, option("--lambda-t", "W", "Weight λ_t of smooth paths.", min=0)] = 1.0
    flock: Annotated[float, option("--lambda-f", "W", "Weight λ_f of alignment and cohesion.", min=0)] = 1.0
    evenness: Annotated[float, option("W", "Weight of a constant mean speed of the flock.", min=0)] = 1.0
    separation: Annotated[
        float, option("W", "Weight of separation between birds; only for a better appearance.", min=0, max=1)
    ] = 0.0
    separation_distance: Annotated[float, option("M", "Distance below which separation acts, m.", min=0)] = 1.2


@dataclass
class FormationOptions:
    """A formation brush that is made of a flight."""

    brush: Annotated[Path | None, option("FILE", "Formation brush to write as well, from the birds of one frame.")] = (
        None
    )
    frame: Annotated[int | None, option("N", "Frame number for --brush; default: the middle frame.")] = None
    wingspan: Annotated[float | None, option("M", "Wingspan of the birds for --brush, m; default: estimated.")] = None


@grouped
def lift(
    tracks: Annotated[Path, argument("TRACKS", "Table of tracks: frame, id, x, y in pixels.")],
    camera: Annotated[Path, option("FILE", "TOML file of the camera: width, height, horizontal_fov_deg, fps, ...")],
    out: Annotated[Path, option("FILE", "Trajectory to write, CSV in metres.")],
    weights: LiftWeights = LiftWeights(),  # noqa: B008  its fields become the options
    near: Annotated[
        float | None, option("M", "Smallest distance from the camera, m; default: from the camera file.")
    ] = None,
    far: Annotated[
        float | None, option("M", "Largest distance from the camera, m; default: from the camera file.")
    ] = None,
    method: Annotated[
        LiftMethod, option("smooth: one global solve; cobyla: frame-by-frame descent of Lin's thesis.")
    ] = LiftMethod.smooth,
    formation: FormationOptions = FormationOptions(),  # noqa: B008
    json: Json = False,
):
    """Lift a flock from one camera to 3D: convert tracks in pixels to a flight in metres."""
    from flockbrush.cli.lift_commands import lift_tracks

    for name in ("frame", "wingspan"):
        if formation.brush is None and getattr(formation, name) is not None:
            raise wrong(f"--{name}", "is only for a formation brush: add --brush FILE")
    brush_options = (formation.brush, formation.frame, formation.wingspan) if formation.brush is not None else None
    lift_tracks(tracks, camera, out, method.value, near, far, json, brush_options, **vars(weights))
