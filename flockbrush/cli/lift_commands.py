"""The command ``flockbrush lift``: tracks of birds from one camera to a 3D flight with headings and banking."""

from __future__ import annotations

import time

import numpy as np

from flockbrush.behaviours.brush import SUFFIX
from flockbrush.engine.files import claimed, need_ending, refused
from flockbrush.film.track_table import about_file
from flockbrush.film.tracks import read_tracks
from flockbrush.lifting.flight_show import Show
from flockbrush.lifting.lens import read_camera
from flockbrush.lifting.lift_solver import LiftError, LiftWish, lift
from flockbrush.lifting.lift_thesis import lift_by_thesis
from flockbrush.runs.terminal import print_json, say, show, table

METHODS = {"smooth": lift, "cobyla": lift_by_thesis}


def lift_tracks(tracks, camera, out, method="smooth", near=None, far=None, as_json=False, made=None, **wishes):
    """Read tracks and camera, lift the flock, write the flight and print a summary.

    Parameters
    ----------
    tracks, camera, out : path
    method : {"smooth", "cobyla"}
        The global solve, or the frame-by-frame descent of the thesis.
    near, far : float, optional
        Bounds of the depth in metres, instead of those in the camera file.
    made : (path, int or None, float or None), optional
        Formation brush to write: its path, the frame to take the birds from, the wingspan in metres.
    **wishes
        Of `flockbrush.lifting.lift_solver.LiftWish`.

    Raises
    ------
    ProblemsError
        With file, line and column; no file has been written then.
    """
    need_ending(out, ".csv")
    if made is not None:
        need_ending(made[0], SUFFIX)
        if made[2] is not None and not (np.isfinite(made[2]) and made[2] > 0):
            raise refused("--wingspan", f"must be above 0 m, got {made[2]:g}")
    with claimed([out, about_file(out), *(made or ())[:1]], [tracks, camera]):
        _lift(tracks, camera, out, method, (near, far), as_json, made, wishes)


def _lift(tracks, camera, out, method, bounds, as_json, made, wishes):
    """The work of `lift_tracks` while the output files are locked."""
    lens = _with_bounds(camera, read_camera(camera), *bounds)
    read = read_tracks(tracks)
    if made is not None and made[1] is not None and not 0 <= made[1] - read.first < len(read.px):
        last = read.first + len(read.px) - 1
        raise refused(tracks, f"has frames {read.first} to {last}; there is no frame {made[1]}")
    begin = time.perf_counter()
    try:
        flight = METHODS[method](read, lens, LiftWish(**wishes))
    except LiftError as error:
        raise refused(tracks, str(error)) from None
    seconds = time.perf_counter() - begin
    Show(flight, str(tracks), lens).write_table(out)
    _tell(out, flight, seconds, method, as_json)
    if made is not None:
        _make_brush(tracks, flight, lens, *made, as_json)


def _make_brush(tracks, flight, lens, path, frame, wingspan, as_json):
    """Write the formation brush of a frame; the flight has been written before, even if this fails."""
    k = (len(flight.xyz) - 1) // 2 if frame is None else frame - int(flight.frames[0])
    learned = Show(flight, str(tracks), lens, span=wingspan).formation_brush(k, path)
    if not as_json:
        say(learned)


def _with_bounds(path, camera, near, far):
    own = near, far
    near, far = camera.near if near is None else near, camera.far if far is None else far
    if not 0 < near < far:
        given = [f"--{name}" for name, value in (("near", own[0]), ("far", own[1])) if value is not None]
        whose = f" with {' and '.join(given)}" if given else ""
        raise refused(path, f"near must be above 0 and less than far, got {near:g} and {far:g} m{whose}")
    return camera.model_copy(update={"near": near, "far": far})


def _tell(out, flight, seconds, method, as_json):
    low, high = float(np.nanmin(flight.depth)), float(np.nanmax(flight.depth))
    facts = {
        "birds": len(flight.ids),
        "frames": len(flight.xyz),
        "method": method,
        "nearest_m": low,
        "farthest_m": high,
        "noise_px": flight.noise,
        "order": flight.order,
        "seconds": seconds,
        "notes": flight.notes,
        "file": str(out),
    }
    if as_json:
        print_json(facts)
        return
    rows = (
        ("birds", facts["birds"]),
        ("frames", facts["frames"]),
        ("smallest distance, m", low),
        ("largest distance, m", high),
        ("noise of the tracks, pixels", flight.noise),
        ("pairs expected in the right order", "-" if np.isnan(flight.order) else f"{flight.order:.0%}"),
        ("solve time, s", seconds),
    )
    show(table("what", "value", rows=rows, right=("value",)))
    for note in flight.notes:
        say(f"note: {note}")
    say(f"wrote {out}")
