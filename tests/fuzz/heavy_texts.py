"""Heavy brushes, sweeps, journals, tracks, marks and other texts and tables."""

import json
import zipfile

import numpy as np
from flockbrush.engine import limits
from heavy import MAKERS, MOST, filled, heavy


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
