"""Heavy pictures, films, fields, levels and recordings."""

import json
import struct
import zipfile
import zlib
from itertools import repeat

import crafted
import numpy as np
from flockbrush.engine import limits, recording_format
from heavy import MOST, filled, heavy

# pictures, films, fields -----------------------------------------------------------------------


def side_of(pixels):
    return int(pixels**0.5)


@heavy("pictures")
def picture_of_claims(path, kind):
    path.write_bytes(crafted.plain_png(65535, 65535, lines=1))


@heavy("pictures")
def largest_picture_of_four_long_channels(path, kind):
    side = side_of(limits.PICTURE_PIXELS)
    path.write_bytes(crafted.plain_png(side, side, depth=16, colour=6, lines=side - 1))


@heavy("pictures")
def largest_jpeg_cut_off(path, kind):
    import cv2

    side = side_of(limits.PICTURE_PIXELS)
    packed = cv2.imencode(".jpg", np.zeros((side, side, 3), np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1]
    path.write_bytes(packed.tobytes()[: -len(packed) // 8])


@heavy("heights")
def height_picture_cut_off(path, kind):
    path.write_bytes(crafted.plain_png(4096, 4096, depth=16, lines=4000))


@heavy("films")
def film_of_large_frames(path, kind):
    import cv2

    side = side_of(limits.FILM_PIXELS)
    path.with_suffix(".avi").unlink(missing_ok=True)
    writer = cv2.VideoWriter(str(path.with_suffix(".avi")), cv2.VideoWriter_fourcc(*"MJPG"), 25, (side, side))
    for _ in range(6):
        writer.write(np.zeros((side, side, 3), np.uint8))
    writer.release()
    data = path.with_suffix(".avi").read_bytes()
    path.write_bytes(data[: len(data) * 3 // 4])


@heavy("fieldfiles")
def fields_of_zeros(path, kind):
    sound = kind.folder / "sound.npz"
    sound.write_bytes(kind.sound[0])
    with zipfile.ZipFile(sound) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as new:
        for name in old.namelist():
            if name != "velocity.npy":
                new.writestr(name, old.read(name))
        with new.open("velocity.npy", "w", force_zip64=True) as file:
            cells = (limits.FIELDS_BYTES - (8 << 20)) // 16
            np.lib.format.write_array_header_1_0(
                file, {"descr": "<f8", "fortran_order": False, "shape": (3, 4, cells // 12, 2)}
            )
            for _ in range(cells * 16 // (1 << 20)):
                file.write(bytes(1 << 20))


# levels ----------------------------------------------------------------------------------------


@heavy("levels")
def level_of_packed_tiles(path, kind):
    import base64

    document = json.loads(kind.sound[0])
    stream = zlib.compressobj(1)
    packed = b"".join(stream.compress(bytes(1 << 20)) for _ in range(900)) + stream.flush()
    text = base64.b64encode(packed).decode()
    side = side_of(limits.LAYER_CELLS)
    document |= {"width": side, "height": side}
    for layer in document["layers"]:
        if layer["type"] == "tilelayer":
            layer |= {"encoding": "base64", "compression": "zlib", "data": text, "width": side, "height": side}
    path.write_text(json.dumps(document))


@heavy("levels")
def level_of_large_layers(path, kind):
    document = json.loads(kind.sound[0])
    side, cells = side_of(limits.LAYER_CELLS), "0," * (limits.LAYER_CELLS - 1) + "0"
    document |= {"width": side, "height": side}
    for layer in document["layers"]:
        if layer["type"] == "tilelayer":
            layer |= {"data": "CELLS", "width": side, "height": side}
    document["layers"].append({"type": "objectgroup", "name": "spawns", "objects": [{"id": 9}, 3]})
    path.write_text(json.dumps(document).replace('"CELLS"', f"[{cells}]"))


@heavy("tilesets")
def tileset_of_tiles(path, kind):
    sound = [data for data in kind.sound if b'"tiles"' in data] or kind.sound
    document = json.loads(sound[0])
    document["tiles"] = "TILES"
    head, tail = json.dumps(document).encode().split(b'"TILES"')
    filled(path, b'{"id":1,"type":"a"},', head + b"[", b'{"id":1}]' + tail, size=66 * 10**6)


# recordings ------------------------------------------------------------------------------------

HEADER = {"seed": 1, "dt": 1 / 32, "assets": {}, "packages": {}, "level": "a.tmj", "agents": None}


@heavy("recordings")
def recording_of_small_commands(path, kind):
    """As many commands as there is room for, each of another tick."""
    data = b'["B",{}]'
    head = [r for r in crafted.records_of(kind.sound[0]) if r[0] in (b"H", b"A")]
    start = crafted.recording_of([*head, (b"S", 0, b"12345678")])
    begin = recording_format.RECORD.pack(b"C", False, 0, len(data), len(data), 0, 0)[:-12]
    with open(path, "wb") as file:
        file.write(start)
        for first in range(0, (MOST - len(start)) // (len(data) + recording_format.RECORD.size) - 1000, 1000):
            heads = [begin + struct.pack("<q", tick) for tick in range(first, first + 1000)]
            file.write(b"".join([h + struct.pack("<I", zlib.crc32(data, zlib.crc32(h))) + data for h in heads]))


@heavy("recordings")
def recording_of_lists(path, kind):
    head = [r for r in crafted.records_of(kind.sound[0]) if r[0] in (b"H", b"A")]
    text = b'["Paint",{"cells":[' + b"[]," * 900_000 + b"[]]}]"
    path.write_bytes(crafted.recording_of([*head, *repeat((b"C", 1, text), 60)]))


@heavy("recordings")
def recording_of_large_headers(path, kind):
    header = HEADER | {"more": "LISTS"}
    head, tail = json.dumps(header).encode().split(b'"LISTS"')
    text = head + b"[" + b"[]," * 5_000_000 + b"[]]" + tail
    with open(path, "wb") as file:
        file.write(crafted.recording_of([(b"H", 0, text)]))


@heavy("recordings")
def recording_of_a_large_asset(path, kind):
    data = bytes(limits.RECORDING_ASSETS_BYTES - 100)
    records = crafted.with_true_assets([(b"H", 0, json.dumps(HEADER).encode()), (b"A", 0, b"a.tmj\0" + data)])
    path.write_bytes(crafted.recording_of(records))
