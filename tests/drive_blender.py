"""Run with Blender's Python (package bpy): draw and steer a herd of ``flockbrush serve`` with the example add-on."""

import importlib.util
import json
import sys
import time

import bpy
import numpy as np

spec = importlib.util.spec_from_file_location("live_herd", sys.argv[1])
live_herd = importlib.util.module_from_spec(spec)
spec.loader.exec_module(live_herd)
bpy.ops.wm.read_factory_settings(use_empty=True)
live_herd.register()
scene = bpy.context.scene
scene.flockbrush_address = sys.argv[2].replace("token=", "token=wrong")
try:
    refused = str(bpy.ops.flockbrush.connect())
except RuntimeError as error:  # outside of a window Blender raises what it reports
    refused = str(error)
scene.flockbrush_address = sys.argv[2]
connected = bpy.ops.flockbrush.connect()
target = np.array([float(word) for word in sys.argv[3].split(",")])
scene.cursor.location = (*target, 0)


def herd():
    """Draw the newest frame: ids of its animals, and the vertices of all bodies (animals, 4, 3)."""
    animals = live_herd.link.animals()
    live_herd.draw(animals)
    mesh = bpy.data.objects["Herd"].data
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    return animals["id"], vertices.reshape(-1, 4, 3)


while live_herd.link.frame is None:
    time.sleep(0.05)
drawn_again = live_herd.refresh()
ids_before, before = herd()
steered = bpy.ops.flockbrush.steer()
time.sleep(6)
ids, after = herd()
_, were, are = np.intersect1d(ids_before, ids, return_indices=True)
middles = before[were][:, :, :2].mean(1), after[are][:, :, :2].mean(1)
ways = [np.linalg.norm(middle - target, axis=1) for middle in middles]
moved = middles[1] - middles[0]
looks = after[are][:, 0, :2] - after[are][:, 1:, :2].mean(1)
told = {
    "refused": refused,
    "connected": str(connected),
    "drawn_again": drawn_again,
    "steered": str(steered),
    "animals": [len(ids), len(after)],
    "nearer": float((np.sort(ways[0])[:5] - np.sort(ways[1])[:5]).mean()),
    "ahead": float(np.mean((moved * looks).sum(1) > 0)),
    "species": sorted({int(d.value) for d in bpy.data.objects["Herd"].data.attributes["species"].data}),
}
for _ in range(12):  # more often than a server has clients: each ends the one before
    told["connected"] = str(bpy.ops.flockbrush.connect())
live_herd.unregister()
live_herd.link.join(5)
told["left"] = not live_herd.link.is_alive() and not bpy.app.timers.is_registered(live_herd.refresh)
print("TOLD" + json.dumps(told))
