"""A binary glTF 2.0 file: a document of JSON objects, and the numbers they point into."""

from __future__ import annotations

import json
import shutil
import struct

import numpy as np

MAGIC, VERSION, JSON, BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
LONGEST = 2**32 - 1  # bytes: the header's length is a uint32
VERTICES, INDICES = 34962, 34963  # targets of buffer views
KINDS = {"f4": 5126, "u1": 5121, "u2": 5123, "i2": 5122, "u4": 5125}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class GltfDocument:
    """What becomes a GLB file.

    Parameters
    ----------
    folder : Path
        Of a temporary file for the numbers.
    """

    def __init__(self, folder):
        self.lists: dict[str, list] = {}  # nodes, meshes, materials and so on, as glTF names them
        self.used: list[str] = []
        self.top: dict = {}
        self._run: dict = {"name": "run", "channels": [], "samplers": []}
        self._path = folder / "numbers"
        self._file = open(self._path, "wb")
        self._size = 0

    def add(self, kind, **entry) -> int:
        """Index of a new entry of a list."""
        entries = self.lists.setdefault(kind, [])
        entries.append({name: value for name, value in entry.items() if value is not None})
        return len(entries) - 1

    def node(self, name, parent=None, **entry) -> int:
        """Index of a new node, a child of another or of the scene."""
        number = self.add("nodes", name=name, **entry)
        if parent is not None:
            self.lists["nodes"][parent].setdefault("children", []).append(number)
        return number

    def animate(self, node, path, times, output, interpolation="LINEAR"):
        """Move a node by keyframes, two accessors; all are one animation, for Blender plays only one."""
        channels, samplers = self._run["channels"], self._run["samplers"]
        samplers.append({"input": times, "output": output, "interpolation": interpolation})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    def show(self, node, keys, fps):
        """Give a node a size from some frames on: [(frame, scale)], one number or three; 0 hides it."""
        times = np.array([frame for frame, _ in keys], np.float32) / np.float32(fps)
        sizes = np.array([np.multiply((1.0, 1.0, 1.0), scale) for _, scale in keys], np.float32)
        self.animate(node, "scale", self.numbers(times, bounds=True), self.numbers(sizes), "STEP")

    def extension(self, name):
        """Say that an extension is used; readers may do without."""
        if name not in self.used:
            self.used.append(name)

    def bytes(self, data, target=None) -> int:
        """Index of a buffer view of these bytes."""
        view = self.begin()
        self.more(data)
        return self.end(view, target)

    def begin(self) -> int:
        """Where the next buffer view begins; `more` adds to it."""
        self.more(b"\0" * (-self._size % 4))
        return self._size

    def more(self, data):
        """Write bytes of the buffer view that was begun."""
        self._file.write(data)
        self._size += len(data)

    def end(self, start, target=None) -> int:
        """Index of the buffer view from `start` to here."""
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=self._size - start, target=target)

    def numbers(self, values, target=None, normalized=None, bounds=False) -> int:
        """Index of an accessor of an array (n,) or (n, k); it must fill whole words of four bytes."""
        values = np.ascontiguousarray(values)
        low, high = (values.min(axis=0), values.max(axis=0)) if bounds else (None, None)
        return self.add(
            "accessors", bufferView=self.bytes(values.tobytes(), target), componentType=KINDS[values.dtype.str[1:]],
            count=len(values), type=SHAPES[1 if values.ndim == 1 else values.shape[1]], normalized=normalized,
            min=None if low is None else np.atleast_1d(low).tolist(),
            max=None if high is None else np.atleast_1d(high).tolist(),
        )  # fmt: skip

    def write(self, path, generator):
        """Write the file; `OSError` (EFBIG) where glTF cannot say its length."""
        self.more(b"\0" * (-self._size % 4))
        self._file.close()
        if self._run["channels"]:
            self.add("animations", **self._run)
        lists = {name: entries for name, entries in self.lists.items() if entries}
        document = {"asset": {"version": "2.0", "generator": generator}, **self.top, **lists}
        if self.used:
            document["extensionsUsed"] = self.used
        if self._size:
            document["buffers"] = [{"byteLength": self._size}]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + (8 + self._size if self._size else 0)
        if total > LONGEST:
            from flockbrush.engine.files import refused

            raise refused(
                path.name, "a .glb file cannot be larger than 4 GiB: export a shorter run, or use a smaller --fps"
            )
        with open(path, "wb") as file, open(self._path, "rb") as numbers:
            file.write(struct.pack("<3I", MAGIC, VERSION, total) + struct.pack("<2I", len(text), JSON) + text)
            if self._size:
                file.write(struct.pack("<2I", self._size, BIN))
                shutil.copyfileobj(numbers, file, 1 << 20)

    def close(self):
        """Close the temporary file."""
        self._file.close()
