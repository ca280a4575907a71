"""Run with Blender's Python (package bpy): what a .glb shows at some seconds, as a line of JSON and as pictures."""

import json
import sys

import bpy

file, picture, *moments = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=file, export_import_convert_lighting_mode="COMPAT")  # else the sun's 3 lux are dark
scene = bpy.context.scene
scene.camera = next(thing for thing in bpy.data.objects if thing.type == "CAMERA")
scene.render.engine = "CYCLES"  # needs no display
scene.cycles.samples, scene.cycles.device = 8, "CPU"
scene.render.resolution_x, scene.render.resolution_y = 480, 270
told = {}
for moment in moments:
    frame = float(moment) * scene.render.fps
    scene.frame_set(int(frame), subframe=frame % 1)
    animals = {o.name: list(o.matrix_world.translation) for o in bpy.data.objects if o.name.startswith("animal ")}
    grounds = [o.name for o in bpy.data.objects if o.name.startswith("Ground") and o.matrix_world.to_scale().x > 0.5]
    told[moment] = {"animals": animals, "grounds": grounds, "camera": list(scene.camera.matrix_world.translation)}
    scene.render.filepath = f"{picture}{moment}.png"
    bpy.ops.render.render(write_still=True)
print("TOLD" + json.dumps(told))
