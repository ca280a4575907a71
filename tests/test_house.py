"""The house: who may import whom, and what must not be known where."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
ROOMS = ("engine", "components", "behaviours", "systems", "levels", "flockbrush")  # each imports only to its left
LIVING = ("engine", "components", "behaviours", "systems")  # no windows, no learning; behaviours/learning is offline
CLOCKS = {"now", "today", "utcnow"}  # of datetime; the module time is not imported at all


def files(*rooms):
    """The Python files of rooms, without what is offline."""
    found = [path for room in rooms for path in sorted((HOUSE / room).rglob("*.py"))]
    return [path for path in found if "learning" not in path.relative_to(HOUSE).parts]


def named(path):
    return str(path.relative_to(HOUSE))


def imports(source, package=()):
    """(line, dotted name) of every import in a source, wherever it stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            stem = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{stem}.{alias.name}") for alias in node.names)


def imports_of(path):
    return list(imports(path.read_text(encoding="utf-8"), path.relative_to(HOUSE).parent.parts))


def rooms_to_the_right(room, found):
    """Sentences about imports that look to the right."""
    forbidden = {*ROOMS[ROOMS.index(room) + 1 :], "tests", "benchmarks"}
    return [f"line {line}: {name}" for line, name in found if name.split(".")[0] in forbidden]


@pytest.mark.parametrize("path", files(*ROOMS), ids=named)
def test_every_room_imports_only_what_stands_left_of_it(path):
    assert rooms_to_the_right(path.relative_to(HOUSE).parts[0], imports_of(path)) == []


@pytest.mark.parametrize("path", files(*LIVING), ids=named)
def test_the_living_know_no_windows_and_no_learning(path):
    assert [name for _, name in imports_of(path) if name.split(".")[0] in ("pygame", "pygame_gui", "torch")] == []


@pytest.mark.parametrize("path", files("behaviours"), ids=named)
def test_behaviours_do_not_know_esper(path):
    assert [name for _, name in imports_of(path) if name.split(".")[0] == "esper"] == []


def offline():
    """The files of the offline shop."""
    return sorted((HOUSE / "behaviours" / "learning").rglob("*.py"))


@pytest.mark.parametrize("path", offline(), ids=named)
def test_the_offline_shop_uses_what_lives_and_knows_no_levels_and_no_face(path):
    """Learning looks through the eyes the animals have, so it may import systems; torch stays in files that say so."""
    found = {name.split(".")[0] for _, name in imports_of(path)}
    assert found.isdisjoint({"levels", "flockbrush", "pygame", "tests", "benchmarks"})
    assert "torch" not in found or path.name.startswith("torch_")


@pytest.mark.parametrize("path", files(*LIVING, "levels"), ids=named)
def test_what_runs_never_imports_the_offline_shop(path):
    assert [name for _, name in imports_of(path) if name.startswith("behaviours.learning")] == []


def chance_and_clocks(source):
    """Lines of a source that read the wall clock, or draw numbers that are not named noise."""
    found = [(n, name) for n, name in imports(source) if name.split(".")[0] in ("random", "secrets", "uuid", "time")]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            chain = ast.unparse(node)
            if chain.startswith(("np.random", "numpy.random")) or (
                node.attr in CLOCKS and chain.split(".")[0] in ("datetime", "date")
            ):
                found.append((node.lineno, chain))
    return found


@pytest.mark.parametrize("path", files("components", "behaviours", "systems"), ids=named)
def test_nothing_in_a_tick_is_timed_or_drawn_without_a_name(path):
    assert chance_and_clocks(path.read_text(encoding="utf-8")) == []


EXACT = {"nnan", "ninf", "nsz"}  # these change no rounding; reassoc, contract, arcp and afn do


def machine_dependent(source):
    """Lines where compiled code is allowed to round as the machine likes."""
    keywords = [k for k in ast.walk(ast.parse(source)) if isinstance(k, ast.keyword) and k.arg == "fastmath"]
    return [k.value.lineno for k in keywords if not _is_exact(k.value)]


def _is_exact(value):
    try:
        flags = ast.literal_eval(value)
    except ValueError:
        return False
    return flags is False or (isinstance(flags, set) and flags <= EXACT)


@pytest.mark.parametrize("path", files("engine", "behaviours", "systems"), ids=named)
def test_nothing_that_writes_state_is_compiled_loosely(path):
    assert machine_dependent(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", files(*ROOMS), ids=named)
def test_nothing_is_unpickled(path):
    assert [name for _, name in imports_of(path) if name.split(".")[0] in ("pickle", "marshal", "shelve", "dill")] == []


def test_the_rules_find_those_who_break_them():
    assert rooms_to_the_right("systems", imports("from levels import reader\nimport flockbrush.cli, engine\n")) == [
        "line 1: levels.reader",
        "line 2: flockbrush.cli",
    ]
    inside = "def f():\n    from ...systems.grid import Cells\n"
    assert rooms_to_the_right("behaviours", imports(inside, ("behaviours", "models"))) == ["line 2: systems.grid.Cells"]
    for source in (
        "import random",
        "from time import time",
        "np.random.default_rng(3)",
        "import datetime\ndatetime.date.today()",
    ):
        assert chance_and_clocks(source) != [], source
    assert chance_and_clocks("from engine.clock import Clock\nclock.now\n") == []
    assert machine_dependent("@njit(fastmath=True)\ndef f(): pass") == [1]
    assert machine_dependent("@njit(fastmath={'nnan', 'reassoc'})\ndef f(): pass") == [1]
    assert machine_dependent("@njit(fastmath={'nnan'})\ndef f(): pass") == []
    assert machine_dependent("@njit(fastmath=False)\ndef f(): pass") == []


@pytest.fixture(scope="module")
def loaded():
    """Top-level names in memory once every module of the running rooms has been imported."""
    rooms = [room for room in ROOMS[:-1] if (HOUSE / room).is_dir()]
    modules = [".".join(p.relative_to(HOUSE).with_suffix("").parts).removesuffix(".__init__") for p in files(*rooms)]
    program = (
        f"import importlib, sys\nfor name in {modules!r}: importlib.import_module(name)\n"
        "print(*sorted({m.split('.')[0] for m in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=HOUSE, env=os.environ | {"PYTHONPATH": str(HOUSE)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "heavy", ["torch", "pygame", "pygame_gui", "av", "cv2", "pyarrow", "pxr", "dask", "matplotlib"]
)
def test_running_a_level_does_not_load(loaded, heavy):
    assert heavy not in loaded
    assert "numba" in loaded
