"""Builds: what their digest depends on, and what differs between two."""

import shutil
import sys

import pytest
from flockbrush.engine.fingerprint import _sources, build_of, differing_files, differing_packages, first_names


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The folder of a package ``grassland`` that can be imported, with a package ``grassland.birds`` in it."""
    folder = tmp_path / "grassland"
    (folder / "birds").mkdir(parents=True)
    for name, text in (("__init__", ""), ("wind", "SPEED = 3\n"), ("birds/__init__", ""), ("birds/crane", "X = 1\n")):
        (folder / f"{name}.py").write_text(text, newline="")
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    _sources.cache_clear()
    for name in [name for name in sys.modules if name.startswith("grassland")]:
        del sys.modules[name]


def built(*packages, modules=()):
    _sources.cache_clear()
    return build_of(packages, modules)


def test_a_build_names_every_file_of_its_packages(package):
    build = built("grassland")
    names = ["grassland/__init__.py", "grassland/birds/__init__.py", "grassland/birds/crane.py", "grassland/wind.py"]
    assert list(build.sources) == names
    assert len(build.code) == 64
    assert {"python", "numba", "llvmlite", "numpy"} <= set(build.packages)
    assert len(build.cpu.split(", ")) == 3


def test_a_package_inside_another_counts_once(package):
    assert built("grassland", "grassland.birds").sources == built("grassland").sources


def test_a_changed_speed_changes_the_code_and_line_ends_do_not(package):
    before = built("grassland")
    (package / "wind.py").write_text("SPEED = 3\r\n", newline="")
    assert built("grassland") == before
    (package / "wind.py").write_text("SPEED = 4\n")
    after = built("grassland")
    assert after.code != before.code
    assert differing_files(before.sources, after.sources) == ["grassland/wind.py"]


def test_a_file_that_is_renamed_changes_the_code(package):
    before = built("grassland")
    (package / "wind.py").rename(package / "storm.py")
    after = built("grassland")
    assert after.code != before.code
    both = ["grassland/storm.py (only here)", "grassland/wind.py (not here)"]
    assert differing_files(before.sources, after.sources) == both
    assert differing_files(before.sources, after.sources, own={"flockbrush"}) == both[1:]


def test_the_code_is_what_was_loaded_not_what_is_on_the_disk_later(package):
    before = built("grassland")
    (package / "wind.py").write_text("SPEED = 4\n")
    assert build_of(("grassland",)) == before


def test_a_module_of_a_user_brings_its_whole_package(package):
    build = built("flockbrush.engine", modules=["grassland.birds.crane", "flockbrush.engine.state"])
    assert {name for name in build.sources if not name.startswith("flockbrush/")} == set(built("grassland").sources)
    assert build.code != built("flockbrush.engine").code


def test_a_single_file_of_a_user_counts_by_its_name(package):
    shutil.move(package / "wind.py", package.parent / "wind_of_mine.py")
    assert "wind_of_mine.py" in built("flockbrush.engine", modules=["wind_of_mine"]).sources


def test_a_module_that_has_no_file_is_left_out(package, monkeypatch):
    """As what is typed into a notebook."""
    monkeypatch.delattr(sys.modules["__main__"], "__file__", raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)
    assert built("flockbrush.engine", modules=["__main__", "gone"]) == built("flockbrush.engine")


def test_versions_that_differ_are_told_with_both():
    assert differing_packages({"numpy": "1", "numba": "2"}, {"numpy": "1", "numba": "3", "scipy": "4"}) == [
        "numba 2 (here 3)"
    ]


def test_many_names_are_cut():
    assert first_names(list("abcdefg")) == "a, b, c, d, e and 2 more"
    assert first_names(["a"]) == "a"
