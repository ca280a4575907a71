# A herd of `flockbrush serve LEVEL`, drawn and steered in Godot 4.2 or later.
#
# Attach this to a Node3D, paste the address that `flockbrush serve` printed into `address`, and
# give `body` a mesh that looks along -Z and is one unit long (a wedge is made where there is none).
# `steer_to` sends the tenth of the herd that is nearest to a place there, as leaders; a click on
# the ground does so through the current camera.
# One metre is one unit. Flockbrush has x east, y north, z up; Godot has x east, y up, -z north.
extends Node3D

signal told(message: Dictionary)  # every text of the server: hello, names, place, done, error

const HEADER := 32  # bytes
const ROW := 40  # bytes of each animal
const RETRY := 1.0  # seconds until a link that was closed is opened again

@export var address := "ws://127.0.0.1:8765/?token="
@export var body: Mesh

var ids := PackedInt32Array()
var places := PackedVector3Array()  # in Godot's axes
var names := {}  # species, brush, state: what the numbers mean
var _socket := WebSocketPeer.new()
var _herd := MultiMeshInstance3D.new()
var _asked := 0
var _closed := false
var _wait := RETRY


func _ready() -> void:
	_herd.multimesh = MultiMesh.new()
	_herd.multimesh.transform_format = MultiMesh.TRANSFORM_3D
	_herd.multimesh.use_colors = true
	_herd.multimesh.mesh = body if body else _wedge()
	add_child(_herd)
	connect_to(address)


# Opens the link, or opens it again; while it is closed this is tried every second.
func connect_to(where: String) -> void:
	address = where
	_wait = RETRY
	_socket = WebSocketPeer.new()
	_socket.inbound_buffer_size = 1 << 24
	_socket.outbound_buffer_size = 1 << 20
	var failed := _socket.connect_to_url(address)
	if failed != OK:
		push_error("no live link at %s: error %d" % [address, failed])
	set_process(failed == OK)


func _process(delta: float) -> void:
	_socket.poll()
	var state := _socket.get_ready_state()
	if state == WebSocketPeer.STATE_CLOSED:
		if not _closed:
			var reason := _socket.get_close_reason()
			push_warning("the live link is closed: %d %s" % [_socket.get_close_code(), reason])
		_closed = true
		_wait -= delta
		if _wait <= 0.0:
			connect_to(address)
		return
	if state == WebSocketPeer.STATE_OPEN:
		_closed = false
	var newest := PackedByteArray()
	while _socket.get_available_packet_count() > 0:
		var packet := _socket.get_packet()
		if _socket.was_string_packet():
			_take(packet.get_string_from_utf8())
		else:
			newest = packet
	if newest.size() >= HEADER:
		_show(newest)


func _take(text: String) -> void:
	var message: Variant = JSON.parse_string(text)
	if not message is Dictionary:
		return
	if message["type"] == "names":
		names = message
	elif message["type"] == "error":
		push_warning(message["message"])
	told.emit(message)


# Columns stand one after the other: id, xyz, heading, pitch, bank, length, then species, brush,
# state and flags.
func _show(frame: PackedByteArray) -> void:
	if frame.slice(0, 4).get_string_from_ascii() != "FLK1":
		push_error("this is not a frame of a live link")
		return
	var count := frame.decode_u32(4)
	if frame.size() != HEADER + count * ROW:
		push_error("a frame of %d animals has another size" % count)
		return
	ids = frame.slice(HEADER, HEADER + 4 * count).to_int32_array()
	var xyz := frame.slice(HEADER + 4 * count, HEADER + 16 * count).to_float32_array()
	var angles := frame.slice(HEADER + 16 * count, HEADER + 32 * count).to_float32_array()
	var brush_at := HEADER + 34 * count
	places.resize(count)
	var herd := _herd.multimesh
	if herd.instance_count != count:
		herd.instance_count = count
	for i in count:
		places[i] = Vector3(xyz[3 * i], xyz[3 * i + 2], -xyz[3 * i + 1])
		var turned := Vector3(angles[count + i], angles[i] - PI / 2, -angles[2 * count + i])
		var stands := Transform3D(Basis.from_euler(turned, EULER_ORDER_YXZ), places[i])
		var size := Vector3.ONE * angles[3 * count + i]
		herd.set_instance_transform(i, stands.scaled_local(size))
		var hue := fmod(0.1 + 0.618 * frame.decode_u16(brush_at + 2 * i), 1.0)
		herd.set_instance_color(i, Color.from_hsv(hue, 0.5, 0.9))


# A command of Flockbrush by its name, such as ask("Gust", {"x": 2.0, "y": 0.0}); the answer comes
# by `told`.
func ask(command: String, fields: Dictionary) -> int:
	return _send("command", [command, fields])


func undo() -> void:
	_send("undo", true)


func play(on: bool) -> void:
	_send("play", on)


# Returns the number of the request; 0 while there is no connection.
func _send(kind: String, value: Variant) -> int:
	if _socket.get_ready_state() != WebSocketPeer.STATE_OPEN:
		push_warning("the live link is not open: nothing was sent")
		return 0
	_asked += 1
	_socket.send_text(JSON.stringify({"id": _asked, kind: value}))
	return _asked


func steer_to(place: Vector3) -> void:
	var order := range(ids.size())
	order.sort_custom(
		func(a: int, b: int) -> bool:
			return places[a].distance_to(place) < places[b].distance_to(place)
	)
	var leaders := []
	for i in order.slice(0, maxi(1, ids.size() / 10)):
		leaders.append(ids[i])
	ask("Appoint", {"entities": leaders})
	ask("Steer", {"entities": leaders, "x": place.x, "y": -place.z, "kind": "place"})


func _unhandled_input(event: InputEvent) -> void:
	var camera := get_viewport().get_camera_3d()
	var click := event as InputEventMouseButton
	if camera and click and click.pressed and click.button_index == MOUSE_BUTTON_LEFT:
		var from := camera.project_ray_origin(click.position)
		var along := camera.project_ray_normal(click.position)
		var hit: Variant = Plane(Vector3.UP, 0.0).intersects_ray(from, along)
		if hit != null and not ids.is_empty():
			steer_to(hit)


func _wedge() -> Mesh:
	var tip := Vector3(0, 0.15, -0.5)
	var left := Vector3(-0.2, 0, 0.5)
	var right := Vector3(0.2, 0, 0.5)
	var top := Vector3(0, 0.4, 0.5)
	var tool := SurfaceTool.new()
	tool.begin(Mesh.PRIMITIVE_TRIANGLES)
	for corner in [tip, top, left, tip, right, top, left, top, right, tip, left, right]:
		tool.add_vertex(corner)
	tool.generate_normals()
	var mesh := tool.commit()
	var colour := StandardMaterial3D.new()
	colour.vertex_color_use_as_albedo = true
	colour.cull_mode = BaseMaterial3D.CULL_DISABLED
	mesh.surface_set_material(0, colour)
	return mesh
