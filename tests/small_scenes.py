"""Small scenes in which models of behaviour are tried."""

import numpy as np
from flockbrush.behaviours.behaviour import Scene, behaviours
from flockbrush.engine.noise import Noise


def scene(xy, heading, length=1.0, seed=0, leader=None, obstacles=(), guidance=(0.0, 0.0), slope=(0.0, 0.0), **more):
    """What animals see who all see one another."""
    xy, n = np.asarray(xy, float), len(xy)
    heading = np.broadcast_to(np.asarray(heading, float), n)
    forward = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)])
    near = np.array([j for i in range(n) for j in range(n) if j != i], np.int32)
    offset = np.array([xy[j] - xy[i] for i in range(n) for j in range(n) if j != i]).reshape(-1, 2)
    seen = np.array([np.asarray(o, float) - xy[i] for i in range(n) for o in obstacles]).reshape(-1, 2)
    values = {
        "dt": 1 / 32,
        "tick": 7,
        "key": lambda stream, tick=7: Noise(seed).key(stream, tick),
        "ids": np.arange(10, 10 + n),
        "xyz": np.column_stack([xy, np.zeros(n)]),
        "velocity": 1.2 * forward,
        "forward": forward,
        "speed": np.full(n, 1.2),
        "effort": np.ones(n),
        "length": np.broadcast_to(np.asarray(length, float), n).copy(),
        "leader": np.zeros(n, np.uint8) if leader is None else np.asarray(leader, np.uint8),
        "species": np.zeros(n, np.int32),
        "danger": np.zeros(n, np.uint8),
        "first": np.arange(n + 1, dtype=np.int64) * max(n - 1, 0),
        "near": near,
        "offset": offset,
        "obstacle_first": np.arange(n + 1, dtype=np.int64) * len(obstacles),
        "obstacle_offset": seen,
        "guidance": np.broadcast_to(np.asarray(guidance, float), (n, 2)).copy(),
        "slope": np.broadcast_to(np.asarray(slope, float), (n, 2)).copy(),
        "memory": np.zeros((n, 2)),
        "known": np.zeros(n, np.uint8),
        "order": np.arange(n, dtype=np.int32),
    }
    return frozen(Scene(**(values | more)))


def frozen(scene, **changes):
    """The scene with some columns changed, none of which can be written."""
    scene = scene._replace(**changes)
    for column in scene:
        if isinstance(column, np.ndarray):
            column.flags.writeable = False
    return scene


def steer(model, scene, rows=None, **parameters):
    return model.steer(scene, rows_(range(len(scene.ids)) if rows is None else rows), model.Params(**parameters))


def quiet(model):
    """Parameters without chance."""
    fields = model.Params.model_fields.items()
    return {name: 0.0 for name, field in fields if (field.json_schema_extra or {}).get("chance")}


def rows_(numbers):
    """Rows as the systems give them to a model."""
    return np.array(numbers, np.int32)


HERD = behaviours()["herd"]
