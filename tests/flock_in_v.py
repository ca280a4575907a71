"""Geese in a V before a camera, with the truth: for what is lifted from tracks."""

import numpy as np

from flockbrush.film.tracks import Tracks
from flockbrush.lifting.lens import Camera

CAMERA = Camera(width=1280, height=720, horizontal_fov_deg=50, fps=25, mean_speed=12, near=10, far=300)
SPAN = 1.5  # m, from wing tip to wing tip


def geese(birds=11, frames=60, seed=1):
    """A V that passes overhead, turning gently; the camera looks up at it, (F, N, 3) m."""
    chance = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / 25
    heading = 0.35 + 0.05 * t
    way = 12 / 25 * np.cumsum(np.stack([np.cos(heading[:, 0]), np.sin(heading[:, 0]), 0 * t[:, 0]], -1), axis=0)
    side = np.arange(birds) - birds // 2
    x, y = 1.25 * SPAN * side, -SPAN * np.abs(side) + 0.1 * chance.normal(size=birds)
    ahead = np.stack([np.cos(heading), np.sin(heading), 0 * heading], -1)
    right = np.stack([np.sin(heading), -np.cos(heading), 0 * heading], -1)
    level = (way - way.mean(0))[:, None] + x[:, None] * right + y[:, None] * ahead
    c, s = np.cos(0.9), np.sin(0.9)
    return level @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]).T + (0, 60, 0)


def seen(xyz, noise=0.3, seed=0):
    """Their tracks."""
    px = CAMERA.project(xyz)
    return Tracks(px + noise * np.random.default_rng(seed).normal(size=px.shape), np.arange(1, px.shape[1] + 1))


def written(folder, tracks):
    """(tracks.csv, cam.toml) in a folder."""
    rows = []
    for f, row in enumerate(tracks.px):
        rows += [f"{f},{n},{x:.3f},{y:.3f}" for n, (x, y) in zip(tracks.ids, row, strict=True)]
    (folder / "tracks.csv").write_text("\n".join(["frame,id,x,y", *rows]))
    (folder / "cam.toml").write_text("".join(f"{name} = {value}\n" for name, value in CAMERA.model_dump().items()))
    return folder / "tracks.csv", folder / "cam.toml"
