"""Movies of formations that never flew: birds on a curve with deviations, outliers and names."""

import numpy as np
from flockbrush.behaviours.formation.formation_shapes import Curve, Formation, FrameShape
from flockbrush.engine.noise import Noise

CURVES = {
    "V": Curve("v", (0.0, 0.8, 0.8)),
    "U": Curve("parabola", (0.0, 0.0, -0.05)),
    "J": Curve("parabola", (0.0, -0.3, -0.03)),
    "line": Curve("line", (0.0, -0.8)),
}


def left_of_leader(kind, birds):
    return {"V": birds // 2, "U": birds // 2, "J": max(1, birds // 6), "line": 0}[kind]


def places(kind, birds, seed=0, frame=0, deviation=0.15, outliers=0, spacing=(1.25, 0.1)):
    """(x, y, leader, who is out) of one frame, leader at the origin and in front."""
    left, noise = left_of_leader(kind, birds), Noise(seed)
    draws = noise.normal("places", frame, np.arange(birds), 4)
    dx = np.maximum(spacing[0] + spacing[1] * draws[:, 0], 0.9)
    x = np.concatenate([-np.cumsum(dx[:left])[::-1], [0.0], np.cumsum(dx[left + 1 :])])
    y = CURVES[kind].y(x) + deviation * np.clip(draws[:, 1], -2, 2)
    others = np.delete(np.arange(birds), left)
    out = others[np.argsort(draws[others, 2])[:outliers]]
    far = 1.2 + np.abs(draws[out, 3])
    y[out] += np.where((np.arange(len(out)) % 2 == 0) & (y[out] + far < -0.3), far, -far)
    front = y[left] = 0.0
    y[others] = np.minimum(y[others], front - 0.02)
    return x, y, left, sorted(out.tolist())


def movie(kind, birds, frames=6, seed=0, deviation=0.15):
    """An example as extraction would leave it."""
    made = []
    for f in range(frames):
        x, y, left, _ = places(kind, birds, seed, f, deviation)
        names = tuple(map(str, range(birds)))
        made.append(
            FrameShape(
                str(f), names, tuple(x), tuple(y), left, kind, "made so", CURVES[kind], (), (1.25, 0.1),
                (0.0, deviation),
            )
        )  # fmt: skip
    return Formation(f"{kind} of {birds}", tuple(made))
