"""Flights in space as tables, and how birds lie in the air on their paths."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flockbrush.engine.files import write_text
from flockbrush.film.tracks import central_differences
from flockbrush.lifting.lift_solver import LiftedFlight
from flockbrush.output.trajectory_table import COLUMNS

GRAVITY = 9.81  # m/s²
NUMBERS = "x", "y", "z", "vx", "vy", "vz", "heading", "speed", "pitch", "bank"


def write_flight(path, flight: LiftedFlight):
    """Write a flight as a trajectory table with one more column, ``bank``, radians."""
    velocity, pitch, bank = attitude(flight.xyz, flight.fps)
    rows = [",".join((*COLUMNS, "bank"))]
    heading = np.arctan2(velocity[..., 1], velocity[..., 0])
    speed = np.linalg.norm(velocity, axis=-1)
    words = {"species": "bird", "role": "follower", "reference": "-1"}
    for f in range(len(flight.xyz)):
        for n in np.flatnonzero(np.isfinite(flight.xyz[f, :, 0])):
            places = (*flight.xyz[f, n], *velocity[f, n], heading[f, n], speed[f, n], pitch[f, n], bank[f, n])
            frame = flight.first + f
            cells = {"frame": str(frame), "time": f"{frame / flight.fps:.6f}", "id": str(flight.ids[n]), **words}
            cells |= {name: f"{value + 0.0:.6f}" for name, value in zip(NUMBERS, places, strict=True)}
            rows.append(",".join(cells.get(name, "") for name in (*COLUMNS, "bank")))
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
    velocity = central_differences(xyz) * fps
    acceleration = central_differences(velocity) * fps
    flat = np.hypot(velocity[..., 0], velocity[..., 1])
    pitch = np.arctan2(velocity[..., 2], flat)
    right = np.stack([velocity[..., 1], -velocity[..., 0]], axis=-1) / np.maximum(flat, 1e-9)[..., None]
    across = (acceleration[..., :2] * right).sum(-1)
    return velocity, pitch, np.arctan2(across, GRAVITY + acceleration[..., 2])
