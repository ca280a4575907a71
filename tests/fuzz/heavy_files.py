"""Files of less than 100 MB that ask for as much memory as their kind can be made to ask for.

By hand, from the root of the repository: ``python tests/fuzz/heavy_files.py [NAME...]`` prints what each took.
Each is read in a forked process of its own, whose peak of memory the system counts.
"""

import os
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE.parents[1], HERE, HERE.parent, HERE.parent / "flockbrush"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))

import heavy_binaries  # noqa: F401  its makers find their place
import heavy_texts  # noqa: F401
from heavy import MAKERS
from kind import TOLD
from kinds import kinds

FRESH = 140.0  # MiB of a process that has imported all this and read nothing

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
