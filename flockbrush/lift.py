"""Lifting a flock: tracks of birds in one camera become a flight in space, with headings and banking."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from behaviours.learning.camera import read_camera
from behaviours.learning.lift import Flight, LiftError, Wish, lift
from behaviours.learning.lift_thesis import lift_by_thesis
from behaviours.learning.tracks import read_tracks
from behaviours.problems import ProblemsError
from flockbrush.export import COLUMNS
from flockbrush.files import output_problems, refused, write_text
from flockbrush.terminal import number, print_json, say, show, table

GRAVITY = 9.81  # m/s^2
METHODS = {"smooth": lift, "cobyla": lift_by_thesis}


def lift_tracks(tracks, camera, out, method="smooth", near=None, far=None, as_json=False, made=None, **wishes):
    """Read tracks and camera, lift, write the flight, and print what there is to know of it.

    Parameters
    ----------
    tracks, camera, out : path
    method : {"smooth", "cobyla"}
        The global solve, or the thesis' frame-by-frame descent.
    near, far : float, optional
        Metres, instead of the camera's.
    made : (path, int or None, float or None), optional
        A formation brush to be made, from the birds of a frame, of a wingspan in metres.
    **wishes
        Of `behaviours.learning.lift.Wish`.

    Raises
    ------
    ProblemsError
        With file, line and column; nothing has been written then.
    """
    problems = output_problems([out, *(made or ())[:1]], [tracks, camera])
    if problems:
        raise ProblemsError(problems)
    lens = _with_bounds(camera, read_camera(camera), near, far)
    seen = read_tracks(tracks)
    begin = time.perf_counter()
    try:
        flight = METHODS[method](seen, lens, Wish(**wishes))
    except LiftError as error:
        raise refused(tracks, str(error)) from None
    seconds = time.perf_counter() - begin
    write_flight(out, flight)
    _tell(out, flight, seconds, method, as_json)
    if made is not None:
        _make_brush(tracks, flight, lens, *made, as_json)


def _make_brush(tracks, flight, lens, path, frame, wingspan, as_json):
    """Write the formation brush of a frame; the flight is written whatever becomes of that."""
    from flockbrush.flight_show import Show

    last = flight.first + len(flight.xyz) - 1
    frame = (flight.first + last) // 2 if frame is None else frame
    if not flight.first <= frame <= last:
        raise refused(tracks, f"has frames {flight.first} to {last}; there is no frame {frame}")
    if wingspan is not None and not (np.isfinite(wingspan) and wingspan > 0):
        raise refused("--wingspan", f"must be above 0 m, got {wingspan:g}")
    said = Show(flight, str(tracks), lens, span=wingspan).formation_brush(frame - flight.first, path)
    if not as_json:
        say(said)


def _with_bounds(path, camera, near, far):
    own = near, far
    near, far = camera.near if near is None else near, camera.far if far is None else far
    if not 0 < near < far:
        asked = [f"--{name}" for name, value in (("near", own[0]), ("far", own[1])) if value is not None]
        whose = f" with {' and '.join(asked)}" if asked else ""
        raise refused(path, f"near must be above 0 and less than far, got {near:g} and {far:g} m{whose}")
    return camera.model_copy(update={"near": near, "far": far})


def write_flight(path, flight: Flight):
    """Write a flight as a trajectory table with two more columns, ``pitch`` and ``bank``, radians."""
    velocity, pitch, bank = attitude(flight.xyz, flight.fps)
    rows = [",".join((*COLUMNS, "pitch", "bank"))]
    heading = np.arctan2(velocity[..., 1], velocity[..., 0])
    speed = np.linalg.norm(velocity, axis=-1)
    for f in range(len(flight.xyz)):
        for n in np.flatnonzero(np.isfinite(flight.xyz[f, :, 0])):
            places = (*flight.xyz[f, n], *velocity[f, n], heading[f, n], speed[f, n])
            numbers = ",".join(f"{value + 0.0:.6f}" for value in places)
            frame = flight.first + f
            rows.append(
                f"{frame},{frame / flight.fps:.6f},{flight.ids[n]},{numbers},bird,,follower,-1,"
                f"{pitch[f, n] + 0.0:.6f},{bank[f, n] + 0.0:.6f}"
            )
    write_text(Path(path), "\n".join(rows) + "\n")


def attitude(xyz, fps):
    """How birds lie in the air on their paths.

    Parameters
    ----------
    xyz : (F, N, 3) ndarray
        Metres, NaN where a bird is not there.
    fps : float

    Returns
    -------
    velocity : (F, N, 3) ndarray
        m/s, by central differences, one-sided at the ends.
    pitch : (F, N) ndarray
        Radians, positive upwards.
    bank : (F, N) ndarray
        Radians, positive with the right wing down: lift carries weight and turns, as in Reynolds 1987.
    """
    velocity = _slope(xyz) * fps
    acceleration = _slope(velocity) * fps
    flat = np.hypot(velocity[..., 0], velocity[..., 1])
    pitch = np.arctan2(velocity[..., 2], flat)
    right = np.stack([velocity[..., 1], -velocity[..., 0]], axis=-1) / np.maximum(flat, 1e-9)[..., None]
    across = (acceleration[..., :2] * right).sum(-1)
    return velocity, pitch, np.arctan2(across, GRAVITY + acceleration[..., 2])


def _slope(values):
    """Differences per frame along the first axis, central where both neighbours are there, (F, ...)."""
    ahead, behind = np.full_like(values, np.nan), np.full_like(values, np.nan)
    ahead[:-1] = values[1:] - values[:-1]
    behind[1:] = ahead[:-1]
    both = 0.5 * (ahead + behind)
    return np.where(np.isfinite(both), both, np.where(np.isfinite(ahead), ahead, behind))


def _tell(out, flight, seconds, method, as_json):
    low, high = float(np.nanmin(flight.depth)), float(np.nanmax(flight.depth))
    facts = {
        "birds": len(flight.ids),
        "frames": len(flight.xyz),
        "method": method,
        "nearest_m": low,
        "farthest_m": high,
        "noise_px": flight.noise,
        "seconds": seconds,
        "notes": flight.notes,
        "file": str(out),
    }
    if as_json:
        print_json(facts)
        return
    made = table("what", "value", right=("value",))
    for name, value in (
        ("birds", facts["birds"]),
        ("frames", facts["frames"]),
        ("nearest, m", low),
        ("farthest, m", high),
        ("noise of the tracks, px", flight.noise),
        ("solved in, s", seconds),
    ):
        made.add_row(name, number(value))
    show(made)
    for note in flight.notes:
        say(f"note: {note}")
    say(f"wrote {out}")
