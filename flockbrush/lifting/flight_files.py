"""Flights in space as tables, and how birds lie in the air on their paths."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from flockbrush.engine.files import write_text
from flockbrush.film.tracks import central_differences
from flockbrush.lifting.lift_solver import LiftedFlight
from flockbrush.output.trajectory_table import BANK, COLUMNS

GRAVITY = 9.81  # m/s²
NUMBERS = "x", "y", "z", "vx", "vy", "vz", "heading", "speed", "pitch", "bank"


def write_flight(path, flight: LiftedFlight, species="bird", flies=True, forward=None, length=None):
    """Write a flight as a trajectory table; of animals that fly with one more column, ``bank``, radians.

    Parameters
    ----------
    forward : (F, N, 3) ndarray, optional
        Unit vectors of the bodies, where these are known; by default they face where they move.
    length : float, optional
        Of a body, metres, where it is known.
    """
    velocity, pitch, bank = attitude(flight.xyz, flight.fps)
    columns = (*COLUMNS, *([BANK] if flies else []))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    ahead = velocity if forward is None else forward
    heading, pitch = np.arctan2(ahead[..., 1], ahead[..., 0]), pitch if forward is None else np.arcsin(forward[..., 2])
    speed = np.linalg.norm(velocity, axis=-1)
    words = {"species": species, "role": "follower", "reference": "0"}
    words |= {} if length is None else {"length": f"{length:.6f}"}
    for f, time in enumerate(flight.times.tolist()):
        for n in np.flatnonzero(np.isfinite(flight.xyz[f, :, 0])):
            places = (*flight.xyz[f, n], *velocity[f, n], heading[f, n], speed[f, n], pitch[f, n], bank[f, n])
            cells = {"frame": str(flight.frames[f]), "time": f"{time:.6f}", "id": flight.names[n], **words}
            cells |= {name: f"{value + 0.0:.6f}" for name, value in zip(NUMBERS, places, strict=True)}
            writer.writerow([cells.get(name, "") for name in columns])
    write_text(Path(path), text.getvalue())


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
    velocity = central_differences(xyz) * fps
    acceleration = central_differences(velocity) * fps
    flat = np.hypot(velocity[..., 0], velocity[..., 1])
    pitch = np.arctan2(velocity[..., 2], flat)
    right = np.stack([velocity[..., 1], -velocity[..., 0]], axis=-1) / np.maximum(flat, 1e-9)[..., None]
    across = (acceleration[..., :2] * right).sum(-1)
    return velocity, pitch, np.arctan2(across, GRAVITY + acceleration[..., 2])
