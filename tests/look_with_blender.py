"""Run with Blender's Python (package bpy): where a USD file shows its animals, as one line of JSON."""

import json
import sys

import bpy


def above(thing):
    """Names of an object and of everything it hangs on."""
    names = []
    while thing:
        names.append(thing.name)
        thing = thing.parent
    return " ".join(names)


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=sys.argv[1])
scene = bpy.context.scene
told = {"frames": [scene.frame_start, scene.frame_end], "camera": any(o.type == "CAMERA" for o in bpy.data.objects)}
for frame in (0, 20):
    scene.frame_set(frame)
    places = []
    for drawn in bpy.context.evaluated_depsgraph_get().object_instances:  # each lives until the next
        hidden = max(drawn.matrix_world.to_scale()) < 1e-3  # bodies of other brushes, and who is not there
        if drawn.object.type == "MESH" and not hidden and (drawn.is_instance or "animal_" in above(drawn.object)):
            places.append([round(value, 4) for value in drawn.matrix_world.translation])
    told[str(frame)] = sorted(places)
print("TOLD" + json.dumps(told))
