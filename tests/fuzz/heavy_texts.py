"""Heavy brushes, sweeps, journals, tracks, marks and other texts and tables."""

import json
import zipfile

import numpy as np
from flockbrush.engine import limits
from heavy import MAKERS, MOST, filled, heavy

FILLED = {  # name: kind of file, its bytes, and what is written again and again, before and after
    "flight_of_mistakes": ("flights", MOST, b"0,bird,1,1,high\n", b"frame,id,x,y,z\n"),
    "formation_of_lists": ("formations", 16 << 20, b"[],", b"[", b"0]"),
    "species_too_long": ("species", MOST, b"a = 1\n"),  # all texts of this form are read in one way
    "program_too_long": ("programs", MOST, b"a = 1\n"),
    "camera_too_long": ("cameras", MOST, b"a = 1\n"),
    "session_of_lists": ("sessions", MOST, b"[],", b"[", b"0]"),
    "trials_of_lists": ("trials", MOST, b"[],", b"[", b"0]"),
    "settings_of_lists": ("settings", MOST, b"[],", b"[", b"0]"),
    "journal_of_edits": ("edits", MOST, b'{"event":"do"}\n'),
    "journal_of_edits_in_one_line": ("edits", MOST, b"[],", b'{"event":[', b"0]}\n"),
    "level_of_line_ends": ("levels", 60 * 10**6, b"\n"),
    "level_of_numbers": ("levels", 66 * 10**6, b"1,", b'{"layers":[{"data":[', b"0]}]}"),
}
for _name, (_kind, _size, *_parts) in FILLED.items():
    MAKERS[_name] = _kind, lambda path, kind, size=_size, parts=_parts: filled(path, *parts, size=size)


@heavy("brushes")
def brush_of_tables(path, kind):
    text = "".join(f"[t{k}]\na={{b=[[],[]]}}\n" for k in range(45_000))
    path.write_bytes(kind.sound[0] + text.encode()[: (1 << 20) - len(kind.sound[0]) - 1000])


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
def journal_of_rows(path, kind):
    """Runs of as many seeds as there is room for in a third of the file; in memory each takes more than in it."""
    head, row = kind.sound[0].decode().splitlines()[:2]
    before, after = json.dumps(json.loads(row) | {"seed": "SEED"}).split('"SEED"')
    table(path, f"{head}\n".encode(), 10**7, lambda k: f"{before}{k}{after}\n", MOST // 3)


def table(path, head, count, row, size=MOST):
    with open(path, "wb") as file:
        file.write(head)
        for start in range(0, count, 20_000):
            file.write("".join(row(k) for k in range(start, min(start + 20_000, count))).encode())
            if file.tell() > size:
                return


@heavy("tracks")
def tracks_of_names(path, kind):
    table(path, b"frame,id,x,y\n", limits.TRACK_ROWS - 9, lambda k: f"0,bird{k},1,1\n")


@heavy("tracktables")
def tracktable_of_long_names(path, kind):
    table(path, b"frame,id,x,y\n", 1000, lambda k: f"{k % 9},{'n' * 90_000}{k // 9},1,1\n", size=MOST - 10**7)


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
def netcdf_of_a_large_block(path, kind):
    hdf5(path, "position", (100_000, 2, 100), (100_000, 2, 100), ("time", "space", "individuals"))


@heavy("tracksleap")
def sleap_of_many_parts(path, kind):
    hdf5(path, "tracks", (4, 2, 80, 200_000), (1, 2, 80, 20_000))


@heavy("marks")
def marks_of_rows_and_a_mistake(path, kind):
    table(path, b"frame,bird,x_px,y_px,wingspan_px\n", 199_900, lambda k: f"{k // 1999},{k % 1999},1,{k % 1999},9\n")
    with open(path, "ab") as file:
        file.write(b"0,x,y,z,1\n")
