"""Files of less than 100 MB that ask for as much memory as their kind can be made to ask for.

By hand, from the root of the repository: ``python tests/fuzz/heavy_files.py [NAME...]`` prints what each took.
Each is read in a forked process of its own, whose peak of memory the system counts.
"""

import functools
import os
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE.parents[1], HERE, HERE.parent, HERE.parent / "flockbrush", HERE.parent / "levels"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))

import heavy_binaries  # noqa: F401  its makers find their place
import heavy_texts  # noqa: F401
from heavy import MAKERS
from kind import TOLD
from kinds import kinds

FRESH = 140.0  # MiB of a process that has imported all this and read nothing

kinds_in = functools.cache(kinds)  # their sound files are made once

WORST = tuple(name for name, (kind, _) in MAKERS.items() if kind in kinds(""))


# measured --------------------------------------------------------------------------------------


def peak_of(name, folder):
    """(MiB at most, what came of it) of reading one heavy file in a process of its own."""
    what, maker = MAKERS[name]
    kind = kinds_in(folder)[what]
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
