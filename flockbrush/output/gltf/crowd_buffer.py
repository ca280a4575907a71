"""The herd in glTF as a crowd buffer: a record for each animal in each frame, and a mesh for each pose.

The layout is documented in docs/exports.md; `examples/` has readers for three.js and Godot.
"""

from __future__ import annotations

import numpy as np

from flockbrush.output.gltf.bodies import scale_of
from flockbrush.output.gltf.records import PHASE, TURN
from flockbrush.render.style import linear_rgb
from flockbrush.runs.snapshots import words_of
from flockbrush.systems.landscape import Landscape

SCHEMA = "flockbrush.crowd/2"
NAMES = {"<f4": "float32", "<i2": "int16", "<u2": "uint16", "<u4": "uint32", "<f2": "float16"}


def write_crowd(document, bodies, records, world, fps):
    """Write the poses as a second scene and the records as a buffer view that the node "Herd" names in its extras."""
    poses = _poses(document, bodies)
    start = document.begin()
    for frame in records.by_frame():
        document.more(frame.tobytes())
    view = document.end(start) if records.frames and records.slots else None
    wrap = bodies.simulation.world.resource(Landscape).wrap
    had = [records.bodies.of[animal] for animal in records.slots]
    bodies_of_all = [body for those in had for body in those]
    about = {
        "schema": SCHEMA, "bufferView": view, "fps": fps, "frames": records.frames, "animals": len(records.slots),
        "stride": records.type.itemsize, "fields": fields_of(records.type),
        "turn_scale": TURN, "phase_scale": PHASE, "flags": {"present": 1, "leader": 2},
        "wrap": wrap and [float(side) for side in wrap], "poses": poses, **_names(bodies, records),
        "ids": list(records.slots), "first_body": np.cumsum([0, *map(len, had)])[:-1].tolist(),
        "species_of": [body.species for body in bodies_of_all],
        "scales": [[round(side, 5) for side in scale_of(body)] for body in bodies_of_all],
    }  # fmt: skip
    document.node("Herd", world, extras={"crowd": {key: value for key, value in about.items() if value is not None}})


def fields_of(kind: np.dtype) -> list[dict]:
    """Name, offset in bytes, type and count of each field of a record."""
    layout = []
    assert kind.names is not None and kind.fields is not None, "a record has fields"
    for name in kind.names:
        part, offset = kind.fields[name][:2]
        count = part.shape[0] if part.shape else 1
        layout.append({"name": name, "offset": offset, "type": NAMES[part.base.str], "count": count})
    return layout


def _poses(document, bodies):
    """[{mesh, look, clip, pose}] by the number in the records; their nodes are in a scene of their own."""
    poses, nodes = [], []
    for look, clip, pose in bodies.poses:
        mesh = bodies.pose_mesh(look, clip, pose)
        nodes.append(document.node(f"pose {look} {clip} {pose}", mesh=mesh))
        poses.append({"mesh": mesh, "look": look, "clip": clip, "pose": pose})
    document.add("scenes", name="Poses", nodes=nodes or None)
    return poses


def _names(bodies, records):
    """Names behind codes, and the colours of brushes in linear light."""
    known = words_of(bodies.simulation)
    words = {name: known[name] for name in ("species", "brush", *records.labels)}
    colours = [np.round(linear_rgb(bodies.colour(k)), 5).tolist() for k in range(len(words["brush"]))]
    return {"words": words, "brush_colours": colours, "brightest": 1.25}
