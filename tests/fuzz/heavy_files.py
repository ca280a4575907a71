"""Files of less than 100 MB that ask for as much memory as their kind can be made to ask for.

By hand, from the root of the repository: ``python tests/fuzz/heavy_files.py [NAME...]`` prints what each took.
Each is read in a forked process of its own, whose peak of memory the system counts.
"""

import json
import os
import struct
import sys
import tempfile
import zipfile
import zlib
from itertools import chain, repeat
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE.parents[1], HERE, HERE.parent, HERE.parent / "flockbrush"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))

import crafted
import numpy as np
from flockbrush.engine import limits, recording_format
from kinds import TOLD, kinds

MOST = 99 * 10**6  # bytes of a file
FRESH = 140.0  # MiB of a process that has imported all this and read nothing
MAKERS = {}  # {name: (kind, maker)}


def heavy(kind):
    """Register a function that writes a file of this kind (see `kinds.py`)."""

    def registered(function):
        MAKERS[function.__name__] = kind, function
        return function

    return registered


def filled(path, piece, head=b"", tail=b"", size=MOST):
    """Write a file of about this size: a head, one piece again and again, a tail."""
    block = piece * max(1, (1 << 20) // len(piece))
    with open(path, "wb") as file:
        file.write(head)
        for _ in range((size - len(head) - len(tail)) // len(block)):
            file.write(block)
        file.write(tail)


# pictures, films, fields -----------------------------------------------------------------------


def side_of(pixels):
    return int(pixels**0.5)


@heavy("pictures")
def picture_of_claims(path, kind):
    path.write_bytes(crafted.plain_png(65535, 65535, lines=1))


@heavy("pictures")
def picture_of_16000_by_16000(path, kind):
    path.write_bytes(crafted.plain_png(16000, 16000))


@heavy("pictures")
def largest_picture(path, kind):
    side = side_of(limits.PICTURE_PIXELS)
    path.write_bytes(crafted.plain_png(side, side, depth=8, colour=2, lines=side // 2))


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


@heavy("pictures")
def largest_bitmap_cut_off(path, kind):
    import cv2

    packed = cv2.imencode(".bmp", np.zeros((5700, 5700, 3), np.uint8))[1].tobytes()
    path.write_bytes(packed[:-1000])


@heavy("heights")
def height_picture_cut_off(path, kind):
    path.write_bytes(crafted.plain_png(4096, 4096, depth=16, lines=4000))


@heavy("heights")
def height_picture_too_large(path, kind):
    path.write_bytes(crafted.plain_png(30000, 30000, depth=16, lines=2))


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
    with zipfile.ZipFile(sound) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
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


@heavy("fieldfiles")
def fields_of_claims(path, kind):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new, new.open("velocity.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)})
        file.write(bytes(100))


# levels ----------------------------------------------------------------------------------------


@heavy("levels")
def level_of_line_ends(path, kind):
    filled(path, b"\n", size=60 * 10**6)


@heavy("levels")
def level_of_lists(path, kind):
    filled(path, b"[],", b'{"layers":[', b"0]}", size=66 * 10**6)


@heavy("levels")
def level_of_numbers(path, kind):
    filled(path, b"1,", b'{"layers":[{"data":[', b"0]}]}", size=66 * 10**6)


@heavy("levels")
def level_of_keys(path, kind):
    with open(path, "wb") as file:
        file.write(b"{")
        for start in range(0, 5_000_000, 50_000):
            file.write(b"".join(b'"%x":%d,' % (k, k) for k in range(start, start + 50_000)))
        file.write(b'"a":1}')


@heavy("levels")
def level_of_packed_tiles(path, kind):
    import base64

    document = json.loads(kind.sound[0])
    stream = zlib.compressobj(9)
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


@heavy("levels")
def level_of_objects(path, kind):
    document = json.loads(kind.sound[0])
    objects = next(layer for layer in document["layers"] if layer["type"] == "objectgroup")
    one = objects["objects"][0]
    objects["objects"] = [one | {"id": 1000 + k} for k in range(limits.OBJECTS + 5)]
    path.write_text(json.dumps(document))


@heavy("tilesets")
def tileset_of_tiles(path, kind):
    sound = [data for data in kind.sound if b'"tiles"' in data] or kind.sound
    document = json.loads(sound[0])
    document["tiles"] = "TILES"
    head, tail = json.dumps(document).encode().split(b'"TILES"')
    filled(path, b'{"id":1,"type":"a"},', head + b"[", b'{"id":1}]' + tail, size=66 * 10**6)


# recordings ------------------------------------------------------------------------------------

HEADER = {"seed": 1, "dt": 1 / 32, "assets": {}, "packages": {}, "level": "a.tmj", "agents": None}


def recording(path, records, header=HEADER, sound=None):
    """Write a recording of records that are made as they are written; with the assets of a sound one if given."""
    records = chain(
        [(b"H", 0, json.dumps(header).encode())] if sound is None else [r for r in sound if r[0] in (b"H", b"A")],
        records,
    )
    with open(path, "wb") as file:
        file.write(crafted.recording_of([]))
        for one in records:
            file.write(crafted.record(*one))


def many_records(path, kind, letter, data):
    """Write a recording of as many records of one kind as there is room for, each of another tick."""
    head = [r for r in crafted.records_of(kind.sound[0]) if r[0] in (b"H", b"A")]
    start = crafted.recording_of([*head, (b"S", 0, b"12345678")])
    begin = recording_format.RECORD.pack(letter, False, 0, len(data), len(data), 0, 0)[:-12]
    with open(path, "wb") as file:
        file.write(start)
        for first in range(0, (MOST - len(start)) // (len(data) + recording_format.RECORD.size) - 1000, 1000):
            heads = [begin + struct.pack("<q", tick) for tick in range(first, first + 1000)]
            file.write(b"".join([h + struct.pack("<I", zlib.crc32(data, zlib.crc32(h))) + data for h in heads]))


@heavy("recordings")
def recording_of_hashes(path, kind):
    many_records(path, kind, b"S", b"12345678")


@heavy("recordings")
def recording_of_snapshots(path, kind):
    many_records(path, kind, b"K", b"1")


@heavy("recordings")
def recording_of_small_commands(path, kind):
    many_records(path, kind, b"C", b'["B",{}]')


@heavy("recordings")
def recording_of_lists(path, kind):
    sound = crafted.records_of(kind.sound[0])
    text = b'["Paint",{"cells":[' + b"[]," * 900_000 + b"[]]}]"
    recording(path, repeat((b"C", 1, text), 60), sound=sound)


@heavy("recordings")
def recording_of_texts(path, kind):
    sound = crafted.records_of(kind.sound[0])
    text = b'["Paint",{"brush":"' + b"x" * (15 << 20) + b'"}]'
    recording(path, repeat((b"C", 1, text), 30), sound=sound)


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


@heavy("recordings")
def recording_of_a_large_snapshot(path, kind):
    sound = crafted.records_of(kind.sound[0])
    real = next(content for k, _, content in sound if k == b"K")
    stream = zlib.compressobj(1)
    zeros = bytes(1 << 20)
    packed = stream.compress(real) + b"".join(stream.compress(zeros) for _ in range(1000)) + stream.flush()
    del zeros
    head = [r for r in sound if r[0] in (b"H", b"A")]
    size = len(real) + 1000 * (1 << 20)
    start = recording_format.RECORD.pack(b"K", True, 0, len(packed), size, 0, 0)[:-4]
    odd = start + struct.pack("<I", zlib.crc32(packed, zlib.crc32(start))) + packed
    data = crafted.recording_of([*head, (b"S", 0, b"12345678")]) + odd
    path.write_bytes(data + b"x" * (len(data) % 2 == 0))


# texts -----------------------------------------------------------------------------------------


def _toml(name, kind):
    """Three heavy texts of a kind: far too long, deep, and as many tables as there is room for."""

    def too_long(path, kind):
        filled(path, b"a = 1\n")

    def of_tables(path, kind):
        text = "".join(f"[t{k}]\na={{b=[[],[]]}}\n" for k in range(45_000))
        path.write_bytes(kind.sound[0] + text.encode()[: (1 << 20) - len(kind.sound[0]) - 1000])

    def of_lists(path, kind):
        path.write_bytes(kind.sound[0] + b"\nzz=[" + b"[]," * 340_000 + b"[]]\n")

    def deep(path, kind):
        path.write_bytes(kind.sound[0] + b"\nzz=" + b"[" * 500_000 + b"]" * 500_000)

    for function in (too_long, of_tables, of_lists, deep):
        MAKERS[f"{name}_{function.__name__}"] = kind, function


for _name, _kind in (("brush", "brushes"), ("species", "species"), ("program", "programs"), ("sweep", "sweeps"),
                     ("camera", "cameras")):  # fmt: skip
    _toml(_name, _kind)


def sweep_with(kind, **values):
    """A sound sweep with other values of some keys."""
    lines = []
    for line in kind.sound[0].decode().splitlines():
        key = line.partition("=")[0].strip()
        lines.append(f"{key} = {values.pop(key)}" if key in values else line)
    assert not values, values
    return "\n".join(lines).encode()


@heavy("sweeps")
def sweep_of_all_seeds(path, kind):
    path.write_bytes(sweep_with(kind, count=100_000_000))


@heavy("sweeps")
def sweep_of_many_combinations(path, kind):
    values = ", ".join(f"{1 + k / 1000:.3f}" for k in range(500))
    text = kind.sound[0] + f'\n[vary]\n"a.x" = [{values}]\n"a.y" = [{values}]\n"a.z" = [{values}]\n'.encode()
    path.write_bytes(text)


@heavy("journals")
def journal_of_short_lines(path, kind):
    filled(path, b'{"scenario":"a","seed":1,"status":"x"}\n', head=kind.sound[0])


@heavy("journals")
def journal_of_rows(path, kind):
    head, row = kind.sound[0].splitlines()[:2]
    row = json.loads(row)
    with open(path, "wb") as file:
        file.write(head + b"\n")
        while file.tell() < MOST - 1000:
            file.write(b"".join(json.dumps(row | {"seed": k}).encode() + b"\n" for k in range(1000)))


def table(path, head, count, row, size=MOST):
    with open(path, "wb") as file:
        file.write(head)
        for start in range(0, count, 20_000):
            file.write("".join(row(k) for k in range(start, min(start + 20_000, count))).encode())
            if file.tell() > size:
                return


@heavy("tracks")
def tracks_of_many_rows(path, kind):
    table(path, b"frame,id,x,y\n", 20_000_000, lambda k: f"{k % 9999},{k // 9999},1,1\n")


def full_table(path, head, row, mistake, frames=1000):
    """Write a table of about `TRACK_ROWS` rows, each with a frame and a bird of its own, and a mistake at its end."""
    ends = [f",{bird}{row}" for bird in range((limits.TRACK_ROWS - 10) // frames)]
    with open(path, "w") as file:
        file.write(head)
        for frame in range(frames):
            file.write(str(frame).join(["", *ends]))
        file.write(mistake)


@heavy("tracks")
def tracks_of_many_rows_and_a_mistake(path, kind):
    full_table(path, "frame,id,x,y\n", ",1,1\n", "1,2,x,3\n")


@heavy("tracks")
def tracks_of_long_names(path, kind):
    table(path, b"frame,id,x,y\n", 20_000_000, lambda k: f"0,{'n' * 90_000}{k},1,1\n")


@heavy("tracks")
def tracks_of_names(path, kind):
    table(path, b"frame,id,x,y\n", limits.TRACK_ROWS - 9, lambda k: f"0,bird{k},1,1\n")


@heavy("tracks")
def tracks_of_one_long_line(path, kind):
    filled(path, b"x")


@heavy("tracktables")
def tracktable_of_many_rows_and_a_mistake(path, kind):
    full_table(path, "frame,id,x,y,heading\n", ",1,1,0\n", "1,2,x,3,0\n")


@heavy("tracktables")
def tracktable_of_many_rows(path, kind):
    full_table(path, "frame,id,x,y\n", ",1,1\n", "")


@heavy("tracktables")
def tracktable_of_names(path, kind):
    table(path, b"frame,id,x,y\n", limits.TRACK_ROWS - 9, lambda k: f"0,bird{k},1,1\n")


@heavy("tracktables")
def tracktable_of_long_names(path, kind):
    table(path, b"frame,id,x,y\n", 1000, lambda k: f"{k % 9},{'n' * 90_000}{k // 9},1,1\n", size=MOST - 10**7)


@heavy("tracktables")
def tracktable_of_body_parts(path, kind):
    count = 400
    head = ["scorer" + ",n" * count, "bodyparts" + ",p" * count, "coords" + ",x,y" * (count // 2)]
    filled(path, b"1" + b",1" * count + b"\n", head="\n".join([*head, ""]).encode())


@heavy("tracktables")
def tracktable_of_columns(path, kind):
    filled(path, b"1,1" + b",1,1" * 4999 + b"\n", head=",".join(f"x{k},y{k}" for k in range(5000)).encode() + b"\n")


def packed_array(path, members):
    """Write an npz of arrays (name, type, length) of nothing but zeros."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed:
        for name, kind, length in members:
            with packed.open(f"{name}.npy", "w", force_zip64=True) as member:
                head = {"descr": np.dtype(kind).str, "fortran_order": False, "shape": (length,)}
                np.lib.format.write_array_header_1_0(member, head)
                left = length * np.dtype(kind).itemsize
                while left > 0:
                    member.write(bytes(min(left, 1 << 20)))
                    left -= 1 << 20


@heavy("trexfiles")
def trex_file_of_zeros(path, kind):
    packed_array(path, [("X#wcentroid", "f8", 15 * 10**7), ("Y#wcentroid", "f8", 10)])


@heavy("trexfiles")
def trex_file_of_many_frames(path, kind):
    packed_array(path, [(n, "f8", limits.TRACK_FRAMES) for n in ("X#wcentroid", "Y#wcentroid", "frame", "missing")])


@heavy("trackarrays")
def track_array_of_bytes(path, kind):
    np.save(path, np.zeros((1000, 49_000, 2), np.int8))


@heavy("trackarrays")
def track_array_of_the_most(path, kind):
    np.save(path, np.zeros((1000, limits.TRACK_CELLS // 1000, 2), np.int8))


@heavy("trackparquet")
def parquet_of_long_names(path, kind):
    import pyarrow
    import pyarrow.parquet as parquet

    rows, long = 60_000, 20_000
    schema = [(name, pyarrow.float64()) for name in ("frame", "x", "y")] + [("id", pyarrow.string())]
    with parquet.ParquetWriter(path, pyarrow.schema(schema), compression="zstd", use_dictionary=False) as writer:
        names = pyarrow.array([f"{'n' * long}{k}" for k in range(1000)])
        for first in range(0, rows, 1000):
            numbers = pyarrow.array(np.full(1000, float(first)))
            writer.write_table(pyarrow.table({"frame": numbers, "x": numbers, "y": numbers, "id": names}))


@heavy("trackparquet")
def parquet_of_many_rows(path, kind):
    import pyarrow
    import pyarrow.parquet as parquet

    k = np.arange(limits.TRACK_ROWS)
    columns = {"frame": k % 5000, "id": k // 5000, "x": np.zeros(len(k)), "y": np.zeros(len(k)), "heading": 0.0 * k}
    parquet.write_table(pyarrow.table(columns), path, compression="zstd")


def hdf5(path, name, shape, block, names=None):
    """Write a file with one packed variable in which there is nothing but zeros."""
    import netCDF4

    with netCDF4.Dataset(path, "w") as data:
        names = names or "abcd"[: len(shape)]
        for key, size in zip(names, shape, strict=True):
            data.createDimension(key, size)
        made = data.createVariable(name, "f4", tuple(names), zlib=True, complevel=1, chunksizes=block, fill_value=0)
        part = np.zeros(block, np.float32)
        for start in range(0, shape[0], block[0]):
            made[start : start + block[0]] = part[: min(block[0], shape[0] - start)]


@heavy("tracknetcdf")
def netcdf_of_the_most(path, kind):
    names = "time", "space", "individuals"
    hdf5(path, "position", (10_000, 2, limits.TRACK_CELLS // 10_000), (1000, 2, 1000), names)


@heavy("tracknetcdf")
def netcdf_of_a_large_block(path, kind):
    hdf5(path, "position", (100_000, 2, 100), (100_000, 2, 100), ("time", "space", "individuals"))


@heavy("tracksleap")
def sleap_of_many_parts(path, kind):
    hdf5(path, "tracks", (4, 2, 80, 200_000), (1, 2, 80, 20_000))


@heavy("flights")
def flight_of_many_rows_and_a_mistake(path, kind):
    full_table(path, "frame,id,x,y,z\n", ",1,1,1\n", "1,2,x,3,1\n")


@heavy("flights")
def flight_of_mistakes(path, kind):
    filled(path, b"0,bird,1,1,high\n", head=b"frame,id,x,y,z\n")


@heavy("marks")
def marks_of_many_rows(path, kind):
    filled(path, b"0,a,1,1,1\n", head=b"frame,bird,x_px,y_px,wingspan_px\n")


@heavy("marks")
def marks_of_rows_and_a_mistake(path, kind):
    table(path, b"frame,bird,x_px,y_px,wingspan_px\n", 199_900, lambda k: f"{k // 1999},{k % 1999},1,{k % 1999},9\n")
    with open(path, "ab") as file:
        file.write(b"0,x,y,z,1\n")


@heavy("formations")
def formation_too_long(path, kind):
    filled(path, b"[],", b"[", b"0]")


@heavy("formations")
def formation_of_lists(path, kind):
    filled(path, b"[],", b"[", b"0]", size=16 << 20)


@heavy("formations")
def formation_of_frames(path, kind):
    document = json.loads(kind.sound[0])
    frame = json.dumps(document["frames"][0]).encode() + b","
    head, tail = json.dumps(document | {"frames": "FRAMES"}).encode().split(b'"FRAMES"')
    filled(path, frame, head + b"[", b"{}]" + tail, size=15 << 20)


@heavy("sessions")
def session_of_lists(path, kind):
    filled(path, b"[],", b"[", b"0]")


@heavy("sessions")
def session_of_branches(path, kind):
    entry = b'"%d":{"recording":null,"journal":null},'
    text = b"".join(entry % k for k in range(200_000))
    path.write_bytes(b'{"level":"a","current":"b","branches":{' + text + b'"b":3}}')


@heavy("edits")
def journal_of_edits(path, kind):
    filled(path, b'{"event":"do"}\n')


@heavy("edits")
def journal_of_edits_in_one_line(path, kind):
    filled(path, b"[],", b'{"event":[', b"0]}\n")


@heavy("trials")
def trials_of_lists(path, kind):
    filled(path, b"[],", b"[", b"0]")


@heavy("descents")
def descent_of_lists(path, kind):
    filled(path, b"[],", b"[", b"0]")


@heavy("settings")
def settings_of_lists(path, kind):
    filled(path, b"[],", b"[", b"0]")


CHOSEN = (  # those that the suite reads; some that take a minute of reading are left to be read by hand
    "largest_picture_of_four_long_channels", "largest_jpeg_cut_off", "picture_of_claims", "height_picture_cut_off",
    "film_of_large_frames", "fields_of_zeros", "level_of_line_ends", "level_of_numbers", "level_of_large_layers",
    "level_of_packed_tiles", "tileset_of_tiles", "recording_of_small_commands", "recording_of_lists",
    "recording_of_large_headers", "recording_of_a_large_asset", "brush_of_tables", "species_of_lists",
    "program_of_lists", "sweep_of_all_seeds", "sweep_of_many_combinations", "camera_of_lists", "journal_of_rows",
    "tracks_of_names", "flight_of_mistakes",
    "marks_of_rows_and_a_mistake", "formation_of_lists", "session_of_lists", "journal_of_edits",
    "journal_of_edits_in_one_line", "trials_of_lists", "settings_of_lists",
    "tracktable_of_long_names", "trex_file_of_zeros", "track_array_of_the_most", "parquet_of_long_names",
    "netcdf_of_a_large_block", "sleap_of_many_parts",
)  # fmt: skip
WORST = tuple(name for name in CHOSEN if MAKERS[name][0] in kinds(""))


# measured --------------------------------------------------------------------------------------


def peak_of(name, folder):
    """(MiB at most, what came of it) of reading one heavy file in a process of its own."""
    what, maker = MAKERS[name]
    kind = kinds(folder)[what]
    kind.folder.mkdir(parents=True, exist_ok=True)
    assert kind.sound
    path = kind.folder / f"heavy{kind.ending}"
    in_child(lambda: maker(path, kind))
    assert path.stat().st_size < 100 * 10**6, path.stat().st_size
    try:
        return in_child(lambda: kind.read(path))
    finally:
        path.unlink()


def in_child(work):
    """(MiB at most, what came of it) of some work in a forked process.

    What this process holds already, such as the herds of other tests, is not counted; a fresh one that only reads is.
    """
    receive, send = os.pipe()
    child = os.fork()  # its peak is its own
    if child == 0:
        try:
            os.write(send, f"{_resident():.1f}\n".encode())  # less than here: a fork maps no files yet
            try:
                work()
                told = "read"
            except TOLD as error:
                told = f"refused: {error}"
            except BaseException as error:  # noqa: BLE001  it is told, and the test fails of it
                told = f"ended in {type(error).__name__}: {error}"
            os.write(send, told.encode(errors="replace")[:2000])
        finally:
            os._exit(0)
    os.close(send)
    _, status, usage = os.wait4(child, 0)
    with os.fdopen(receive, "rb") as file:
        held, _, told = file.read().decode(errors="replace").partition("\n")
    peak = usage.ru_maxrss / (1024 if sys.platform != "darwin" else 1 << 20)
    return peak - max(float(held or 0.0) - FRESH, 0.0), told or f"killed: {status}"


def _resident():
    """MiB that this process holds now; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    except OSError:
        return 0.0


if __name__ == "__main__":
    import time

    with tempfile.TemporaryDirectory(prefix="heavy") as place:
        for chosen in sys.argv[1:] or MAKERS:
            began = time.monotonic()
            mebibytes, came = peak_of(chosen, Path(place))
            print(f"{mebibytes:6.0f} MiB {time.monotonic() - began:5.1f} s  {chosen}: {came[:150]}", flush=True)
