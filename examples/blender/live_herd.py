"""A Blender add-on that draws and steers a herd of ``flockbrush serve`` (Blender 4.2 and later).

Install it under Edit > Preferences > Add-ons > Install from Disk, start ``flockbrush serve LEVEL``, open the sidebar
of the 3D view (N), tab Flockbrush, paste the address, and connect.  One metre is one unit; x is east, y north, z up.
"""

import base64
import contextlib
import json
import os
import socket
import struct
import threading
from urllib.parse import urlsplit

import bpy
import numpy as np

bl_info = {"name": "Flockbrush live herd", "blender": (4, 2, 0), "category": "Animation"}

HEADER = struct.Struct("<4sIQdd")
COLUMNS = (
    *(("id", "<u4", 1), ("xyz", "<f4", 3), ("heading", "<f4", 1), ("pitch", "<f4", 1), ("bank", "<f4", 1)),
    *(("length", "<f4", 1), ("species", "<u2", 1), ("brush", "<u2", 1), ("state", "<u2", 1), ("flags", "<u2", 1)),
)
BODY = np.array([(0.5, 0, 0.15), (-0.5, 0.2, 0), (-0.5, -0.2, 0), (-0.5, 0, 0.4)])  # a wedge that looks along +x
SIDES = np.array([(0, 1, 3), (0, 3, 2), (1, 2, 3), (0, 2, 1)])
TEXT, BYTES, CLOSE, PING, PONG = 1, 2, 8, 9, 10
RETRY = 1.0  # s until a link that was closed is opened again


class LiveThread(threading.Thread):
    """A WebSocket client of the standard library (Blender's Python has no other), connected until it is closed here."""

    def __init__(self, address):
        super().__init__(daemon=True)
        self.where = where = urlsplit(address.strip())
        if where.scheme != "ws" or not where.hostname or not where.port:
            raise ValueError("an address is what flockbrush serve prints, such as ws://127.0.0.1:8765/?token=...")
        self.frame, self.names, self.asked, self.ended = None, {}, 0, threading.Event()
        self.open()
        self.start()

    def open(self):
        """Connect; OSError says why that fails."""
        where = self.where
        self.socket = socket.create_connection((where.hostname, where.port), timeout=5)
        key = base64.b64encode(os.urandom(16)).decode()
        wish = f"GET {where.path or '/'}?{where.query} HTTP/1.1\r\nHost: {where.netloc}\r\nUpgrade: websocket\r\n"
        wish += f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        self.socket.sendall(wish.encode())
        self.stream = self.socket.makefile("rb")
        answer, headers = self.stream.readline().decode("latin-1").strip(), {}
        while (line := self.stream.readline().strip()) != b"":
            name, _, value = line.decode("latin-1").partition(":")
            headers[name.lower()] = value.strip()
        if not answer.startswith("HTTP/1.1 101"):
            text = "text/plain" in headers.get("content-type", "")
            said = self.stream.readline().decode(errors="replace").strip() if text else ""
            self.shut()
            raise ConnectionError(said or "this port is not one of flockbrush serve")
        self.socket.settimeout(None)
        self.status = "connected"

    def run(self):
        act = self.hear
        while not self.ended.is_set():
            try:
                act()
                act = self.hear
            except (OSError, ValueError) as error:
                self.status, act = f"closed, trying again: {error}", self.open
                self.shut()
                self.ended.wait(RETRY)
        self.shut()

    def hear(self):
        kind, data = self.read()
        if kind == BYTES:
            self.frame = data
        elif kind == PING:
            self.write(PONG, data)
        elif kind == TEXT:
            self.take(json.loads(data))
        elif kind == CLOSE:
            raise ConnectionError(data[2:].decode(errors="replace") or "the server has closed the link")

    def close(self):
        self.ended.set()
        self.shut()

    def shut(self):
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)  # ends what is being read, too
        self.socket.close()

    def take(self, message):
        if message["type"] == "error":
            print("Flockbrush:", message["message"])
        self.names = message if message["type"] == "names" else self.names

    def read(self):
        kind, size = self.exactly(2)
        size = int.from_bytes(self.exactly(2 if size == 126 else 8)) if size > 125 else size
        return kind & 15, self.exactly(size)

    def exactly(self, size):
        if len(data := self.stream.read(size)) == size:
            return data
        raise ConnectionError("the server has gone")

    def write(self, kind, data):
        form, mark = ("!BH", 254) if len(data) < 1 << 16 else ("!BQ", 255)
        size = bytes([128 | len(data)]) if len(data) < 126 else struct.pack(form, mark, len(data))
        mask = np.frombuffer(os.urandom(4), np.uint8)
        masked = np.frombuffer(data, np.uint8) ^ np.resize(mask, len(data))
        self.socket.sendall(bytes([128 | kind]) + size + mask.tobytes() + masked.tobytes())

    def ask(self, command, **fields):
        self.asked += 1
        self.write(TEXT, json.dumps({"id": self.asked, "command": [command, fields]}).encode())

    def animals(self):
        """The columns of the newest frame, or None."""
        data, columns, at = self.frame, {}, HEADER.size
        if data is None:
            return None
        count = HEADER.unpack_from(data)[1]
        for name, kind, width in COLUMNS:
            columns[name] = np.frombuffer(data, kind, count * width, at)
            at += columns[name].nbytes
        columns["xyz"] = columns["xyz"].reshape(-1, 3)
        return columns


link, shown = None, ""


def herd_mesh():
    """The mesh of the object "Herd", made where there is none."""
    if (thing := bpy.data.objects.get("Herd")) is None:
        thing = bpy.data.objects.new("Herd", bpy.data.meshes.new("Herd"))
        bpy.context.scene.collection.objects.link(thing)
    return thing.data


def draw(animals):
    """Put a body where each animal is, in one mesh with the attributes brush, species and state."""
    mesh, count = herd_mesh(), len(animals["id"])
    angles = (animals[name][:, None] for name in ("heading", "pitch", "bank"))
    (ch, sh), (cp, sp), (cb, sb) = ((np.cos(angle), np.sin(angle)) for angle in angles)
    x, y, z = (BODY[None, :, k] * animals["length"][:, None] for k in range(3))
    y, z = y * cb + z * sb, z * cb - y * sb  # right wing down
    x, z = x * cp - z * sp, x * sp + z * cp  # nose up
    x, y = x * ch - y * sh, x * sh + y * ch
    points = np.stack([x, y, z], -1) + animals["xyz"][:, None]
    if len(mesh.vertices) != count * len(BODY):
        mesh.clear_geometry()
        faces = (SIDES[None] + np.arange(count)[:, None, None] * len(BODY)).reshape(-1, 3)
        mesh.from_pydata(points.reshape(-1, 3), [], faces.tolist())
    else:
        mesh.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    for name in ("brush", "species", "state"):
        column = mesh.attributes.get(name) or mesh.attributes.new(name, "INT", "POINT")
        column.data.foreach_set("value", np.repeat(animals[name].astype(np.int32), len(BODY)))
    mesh.update()


def refresh():
    """Draw the newest frame; Blender's timer calls this."""
    global shown
    if link.status != shown:
        shown = link.status
        for area in (area for window in bpy.context.window_manager.windows for area in window.screen.areas):
            area.tag_redraw()  # the panel shows it
    animals = link.animals()
    if animals is not None:
        draw(animals)
    return 1 / 30


def leave():
    """End the link there is, and stop drawing."""
    if link is not None:
        link.close()
    if bpy.app.timers.is_registered(refresh):
        bpy.app.timers.unregister(refresh)


class ConnectHerd(bpy.types.Operator):
    """Show the herd of the address"""

    bl_idname, bl_label = "flockbrush.connect", "Connect"

    def execute(self, context):
        global link
        leave()
        try:
            link = LiveThread(context.scene.flockbrush_address)
        except (OSError, ValueError) as error:
            self.report({"ERROR"}, f"no live link there: {error}")
            return {"CANCELLED"}
        bpy.app.timers.register(refresh, persistent=True)  # also after another file was opened
        return {"FINISHED"}


class SteerHerd(bpy.types.Operator):
    """Send the tenth of the herd that is nearest to the 3D cursor there, as leaders"""

    bl_idname, bl_label = "flockbrush.steer", "Steer to 3D cursor"

    def execute(self, context):
        animals = link.animals() if link is not None and link.is_alive() else None
        if animals is None:
            self.report({"ERROR"}, "not connected")
            return {"CANCELLED"}
        x, y = context.scene.cursor.location.xy
        nearest = np.argsort(np.hypot(*(animals["xyz"][:, :2] - (x, y)).T))[: max(1, len(animals["id"]) // 10)]
        leaders = [int(number) for number in animals["id"][nearest]]
        try:
            link.ask("Appoint", entities=leaders)
            link.ask("Steer", entities=leaders, x=x, y=y, kind="place")
        except OSError as error:
            self.report({"ERROR"}, f"the link is closed: {error}")
            return {"CANCELLED"}
        return {"FINISHED"}


class HerdPanel(bpy.types.Panel):
    bl_idname, bl_label, bl_category = "VIEW3D_PT_flockbrush", "Live herd", "Flockbrush"
    bl_space_type, bl_region_type = "VIEW_3D", "UI"  # the sidebar

    def draw(self, context):
        self.layout.prop(context.scene, "flockbrush_address")
        self.layout.operator("flockbrush.connect")
        self.layout.label(text=link.status if link is not None and link.is_alive() else "not connected")
        self.layout.operator("flockbrush.steer")


def register():
    bpy.types.Scene.flockbrush_address = bpy.props.StringProperty(name="Address")
    for cls in (ConnectHerd, SteerHerd, HerdPanel):
        bpy.utils.register_class(cls)


def unregister():
    leave()
    for cls in (HerdPanel, SteerHerd, ConnectHerd):
        bpy.utils.unregister_class(cls)
    del bpy.types.Scene.flockbrush_address
