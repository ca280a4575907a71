"""No file below 100 MB takes a gigabyte before it is refused, whatever is in it; more by hand: `heavy_files.py`."""

import sys

import pytest
from fuzzer import kinds
from heavy_files import MAKERS, WORST, peak_of

MEBIBYTES = 10**9 / 2**20  # a gigabyte


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("heavy")


@pytest.mark.skipif(sys.platform == "win32", reason="the system counts no peaks of forked processes")
@pytest.mark.parametrize("name", WORST)
def test_a_heavy_file_is_read_or_refused_within_a_gigabyte(name, folder):
    peak, told = peak_of(name, folder)
    assert told == "read" or told.startswith("refused: "), told
    assert peak < MEBIBYTES, f"{peak:.0f} MiB: {told}"


def test_there_is_a_heavy_file_of_every_kind():
    assert {MAKERS[name][0] for name in WORST} == set(kinds(""))


@pytest.mark.skipif(sys.platform == "win32", reason="the system counts no peaks of forked processes")
def test_a_reader_that_takes_a_gigabyte_is_found(folder, monkeypatch):
    monkeypatch.setitem(MAKERS, "greedy", ("settings", lambda path, kind: path.write_bytes(b"{}")))
    monkeypatch.setattr("state_kinds.Settings.read", lambda self, path: b"x" * 1_100_000_000)
    assert peak_of("greedy", folder)[0] > MEBIBYTES
    held = b"y" * 500_000_000  # by other tests
    assert MEBIBYTES < peak_of("greedy", folder)[0] < 1.4 * MEBIBYTES, len(held)
