## Draws the crowd buffer of a Flockbrush .glb in Godot 4 (layout: docs/exports.md).
##
## flockbrush export run.flock --to run.glb --gltf-mode crowd; put run.glb into the project as a file that Godot keeps
## (Import > Keep File), add a Node3D with this script, and set `path`.
extends Node3D

@export_file("*.glb") var path := "res://run.glb"
@export var speed := 1.0
var about: Dictionary
var data: PackedByteArray
var at := {}
var poses: Array[MultiMesh] = []
var seconds := 0.0


func _ready() -> void:
	var document := GLTFDocument.new()
	var state := GLTFState.new()
	if document.append_from_file(path, state) != OK:
		push_error("cannot read %s" % path)
		return
	var scene := document.generate_scene(state)  # ground, obstacles, camera, sun
	for sun in scene.find_children("*", "DirectionalLight3D"):
		sun.light_energy /= PI  # glTF counts lux; here 1 lights a white surface white
	add_child(scene)
	for node in state.json["nodes"]:
		if node.get("extras", {}).has("crowd"):
			about = node["extras"]["crowd"]
	data = numbers(int(about["bufferView"]), state.json["bufferViews"])
	for field in about["fields"]:
		at[field["name"]] = int(field["offset"])
	var herd := Node3D.new()
	herd.rotate_x(-PI / 2)  # z up becomes y up
	add_child(herd)
	var meshes := state.get_meshes()
	for pose in about["poses"]:
		var many := MultiMesh.new()
		many.transform_format = MultiMesh.TRANSFORM_3D
		many.use_colors = true
		many.mesh = meshes[int(pose["mesh"])].mesh.get_mesh()
		many.mesh.surface_get_material(0).vertex_color_use_as_albedo = true
		many.instance_count = int(about["animals"])
		var shown := MultiMeshInstance3D.new()
		shown.multimesh = many
		herd.add_child(shown)
		poses.append(many)


## The bytes of a buffer view: behind the header (12 bytes), the JSON chunk, and the header of the next chunk.
func numbers(view: int, views: Array) -> PackedByteArray:
	var file := FileAccess.open(path, FileAccess.READ)
	file.seek(12)
	var first := 20 + file.get_32() + 8 + int(views[view].get("byteOffset", 0))
	file.seek(first)
	return file.get_buffer(int(views[view]["byteLength"]))


func _process(delta: float) -> void:
	seconds = fmod(seconds + speed * delta, about["frames"] / about["fps"])
	show_frame(int(seconds * about["fps"]))


func show_frame(frame: int) -> void:
	var counts := []
	counts.resize(poses.size())
	counts.fill(0)
	for animal in int(about["animals"]):
		var record: int = (frame * int(about["animals"]) + animal) * int(about["stride"])
		if not data.decode_u16(record + at["flags"]) & 1:
			continue
		var p: int = record + at["place"]
		var place := Vector3(data.decode_float(p), data.decode_float(p + 4), data.decode_float(p + 8))
		var q: int = record + at["turn"]
		var turn := Quaternion(data.decode_s16(q), data.decode_s16(q + 2), data.decode_s16(q + 4), data.decode_s16(q + 6))
		var size: Array = about["scales"][int(about["first_body"][animal]) + data.decode_u16(record + at["body"])]
		var body := Basis(turn.normalized()) * Basis.from_scale(Vector3(size[0], size[1], size[2]))
		var rgb: Array = about["brush_colours"][data.decode_u16(record + at["brush"])]
		var light := Color(rgb[0], rgb[1], rgb[2]) * float(about["brightest"])
		var pose := data.decode_u16(record + at["pose"])
		poses[pose].set_instance_transform(counts[pose], Transform3D(body, place))
		poses[pose].set_instance_color(counts[pose], light)
		counts[pose] += 1
	for pose in poses.size():
		poses[pose].visible_instance_count = counts[pose]
