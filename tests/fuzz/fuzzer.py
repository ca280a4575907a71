"""The fuzzer: changed files are read, and end in a result or in a sentence, soon, and within memory.

By hand, from the root of the repository::

    python tests/fuzz/fuzzer.py --cases 20000 --seed 5 --keep found
    python tests/fuzz/fuzzer.py --kind recordings --seed 5 --case 1234      # one of them again, with its traceback

A case hangs on kind, seed and number alone.  Inputs that end in anything else are kept in the folder.
"""

import argparse
import contextlib
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
import unicodedata
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE.parents[1], HERE, HERE.parent, HERE.parent / "flockbrush", HERE.parent / "levels"):  # package first
    if str(folder) not in sys.path:
        sys.path.append(str(folder))

from flockbrush.engine.plain_text import plain
from kind import TOLD
from kinds import kinds

SECONDS = 30  # one case may take so long, on a busy machine
MEBIBYTES = 700  # by which one case may raise the peak of memory


class TooLong(BaseException):
    """A case did not end."""


@dataclass
class Found:
    """A case that ended badly."""

    kind: str
    number: int
    what: str
    data: bytes


def run_case(kind, name, seed, number):
    """None when all is well, else what is wrong."""
    rng = random.Random(f"{seed} {name} {number}")
    data = kind.case(rng)
    kind.folder.mkdir(exist_ok=True)
    path = kind.folder / f"case{kind.ending}"
    path.write_bytes(data)
    before = _peak()
    try:
        with _alarm(SECONDS):
            kind.read(path)
        what = None
    except TOLD as error:
        what = _unclear(plain(str(error)))  # as it is printed
    except TooLong:
        what = f"took more than {SECONDS} s\n{traceback.format_exc()}"
    except Exception:  # noqa: BLE001  whatever it is, it is what we look for
        what = traceback.format_exc()
    if what is None and _peak() - before > MEBIBYTES:
        what = f"took {_peak() - before:.0f} MiB"
    return Found(name, number, what, data) if what else None


def _unclear(said):
    """What is wrong with a sentence for people; None when nothing is."""
    lines = said.split("\n")
    if not said.strip():
        return "said nothing"
    if max(map(len, lines)) > 3000 or len(lines) > 60:
        return f"said too much: {said[:500]}..."
    odd = {c for c in said if c != "\n" and unicodedata.category(c) in ("Cc", "Cs")}
    return f"said letters that nobody can read, {sorted(odd)}: {said[:500]!r}" if odd else None


@contextlib.contextmanager
def _alarm(seconds):
    if not hasattr(signal, "SIGALRM"):
        yield
        return

    def ring(*_):
        raise TooLong

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _peak():
    """MiB that this process has held at most."""
    from flockbrush.runs.run import peak_memory

    peak = peak_memory()
    return peak if peak == peak else 0.0


def cases_of(found, total):
    """{name: how many cases} by the shares of the kinds."""
    whole = sum(kind.share for kind in found.values())
    return {name: max(1, round(total * kind.share / whole)) for name, kind in found.items()}


def fuzz(folder, total, seed=0, only=None, first=0, say=lambda text: None):
    """Run so many cases of all kinds, or of one; yields what ended badly."""
    found = {name: kind for name, kind in kinds(folder).items() if only in (None, name)}
    for name, count in cases_of(found, total).items():
        began = time.monotonic()
        for number in range(first, first + count):
            bad = run_case(found[name], name, seed, number)
            if bad:
                yield bad
        say(f"{name}: {count} cases in {time.monotonic() - began:.1f} s")


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", help="one kind alone")
    parser.add_argument("--case", type=int, help="one case alone, by its number")
    parser.add_argument("--keep", type=Path, help="folder for inputs that end badly")
    parser.add_argument("--most", type=int, default=20, help="stop after so many that end badly")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="fuzz"))
    bad = 0
    try:
        first, total = (0, options.cases) if options.case is None else (options.case, 1)
        for one in fuzz(folder, total, options.seed, options.kind, first, print):
            bad += 1
            print(f"\n--kind {one.kind} --seed {options.seed} --case {one.number}\n{one.what}", flush=True)
            if options.keep:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / f"{one.kind}-{options.seed}-{one.number}").write_bytes(one.data)
            if bad >= options.most:
                break
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{bad} ended badly")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
