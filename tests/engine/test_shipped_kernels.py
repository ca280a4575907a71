"""Kernels that came with a wheel are used where they fit, and only there."""

import json
import os

import llvmlite.binding
import pytest
from flockbrush.engine import shipped_kernels
from flockbrush.engine.shipped_kernels import CPUS, FOLDER, TABLE, cache_name, kind, use_shipped_kernels


@pytest.fixture
def house(tmp_path, monkeypatch):
    """A folder in which a package with a kernel is installed, on a processor that can do what x86-64-v3 names."""
    monkeypatch.setattr(os, "environ", {"HOME": str(tmp_path)})
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: dict.fromkeys(CPUS["x86-64-v3"], True))
    shipped = tmp_path / "house" / FOLDER
    (shipped / "systems").mkdir(parents=True)
    (shipped / "systems" / "sight.nbi").write_text("index")
    (shipped / "systems" / "sight.1.nbc").write_text("code")
    (tmp_path / "place").mkdir()
    _tell(tmp_path / "house", kind(), list(CPUS))
    return tmp_path / "house"


def _tell(house, made_for, cpus):
    (house / FOLDER / TABLE).write_text(json.dumps({"kind": made_for, "cpus": cpus}))


def _copied(house):
    return {path.name for path in (house.parent / "place").rglob("*") if path.is_file()}


def test_they_are_copied_to_where_numba_looks(house):
    use_shipped_kernels(house, house.parent / "place")
    place = house.parent / "place" / cache_name(house / "flockbrush" / "systems")
    assert (place / "sight.nbi").read_text() == "index" and (place / "sight.1.nbc").read_text() == "code"
    assert os.environ["NUMBA_CPU_NAME"] == "x86-64-v3" and os.environ["NUMBA_CPU_FEATURES"] == ""


def test_numba_looks_there(house):
    from numba.core.caching import _CacheLocator

    file = house / "flockbrush" / "systems" / "sight.py"
    assert _CacheLocator.get_suitable_cache_subpath(str(file)) == cache_name(file.parent)


def test_the_best_processor_is_taken(house, monkeypatch):
    able = dict.fromkeys(CPUS["x86-64-v4"], True)
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: able)
    use_shipped_kernels(house, house.parent / "place")
    assert os.environ["NUMBA_CPU_NAME"] == "x86-64-v4"


@pytest.mark.parametrize("what", ["numba", "python", "machine", "processor", "wish", "none"])
def test_they_are_left_where_they_do_not_fit(house, monkeypatch, what):
    if what == "processor":
        monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", dict)
    elif what == "wish":
        os.environ["NUMBA_CPU_NAME"] = "generic"
    elif what == "none":
        (house / FOLDER / TABLE).unlink()
    else:
        _tell(house, kind() | {what: "0.1"}, list(CPUS))
    use_shipped_kernels(house, house.parent / "place")
    assert _copied(house) == set() and os.environ.get("NUMBA_CPU_NAME") in (None, "generic")


def test_they_are_copied_once_and_whoever_has_no_room_compiles(house, monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(shipped_kernels.shutil, "copyfile", full)
    use_shipped_kernels(house, house.parent / "place")
    assert "NUMBA_CPU_NAME" not in os.environ
    monkeypatch.undo()
    monkeypatch.setattr(os, "environ", {})
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: dict.fromkeys(CPUS["x86-64-v3"], True))
    use_shipped_kernels(house, house.parent / "place")
    before = _copied(house)
    (house / FOLDER / "systems" / "later.nbc").write_text("code")
    monkeypatch.setattr(os, "environ", {})
    use_shipped_kernels(house, house.parent / "place")
    assert _copied(house) == before and len(before) == 3 and os.environ["NUMBA_CPU_NAME"] == "x86-64-v3"
