"""The house: who may import whom, and what must not be known where."""

import ast
import functools
import os
import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
TOP = ("engine", "components", "behaviours", "systems", "levels")  # folders of their own, imported as flockbrush.NAME
# Each room imports only from rooms before it; rooms in one set know nothing of each other.
ORDER = (
    *({name} for name in TOP),
    {"runs"},
    {"render"},
    {"film"},
    {"output"},
    {"learning", "lifting", "studies"},
    {"studio"},
    {"cli"},
)
ROOMS = tuple(sorted(set().union(*ORDER)))
MOST = 10  # arguments of a function
LINES = 80  # of a function
LIVING = ("engine", "components", "behaviours", "systems")  # no windows, no learning
CLOCKS = {"now", "today", "utcnow"}  # of datetime; the module time is not imported at all


def folder(room):
    return HOUSE / room if room in TOP else HOUSE / "flockbrush" / room


def files(*rooms):
    """The Python files of rooms; those at the root of `flockbrush/` start the command line, so they belong to it."""
    found = [path for room in rooms for path in sorted(folder(room).rglob("*.py"))]
    return found + (sorted((HOUSE / "flockbrush").glob("*.py")) if "cli" in rooms else [])


def module_of(path):
    """The dotted name under which a file is imported."""
    parts = path.relative_to(HOUSE).with_suffix("").parts
    return ".".join(("flockbrush", *parts) if parts[0] in TOP else parts).removesuffix(".__init__")


def room_of(name):
    """The room of a dotted name, or None where it is not one of ours."""
    parts = name.split(".")
    return parts[1] if parts[0] == "flockbrush" and len(parts) > 1 and parts[1] in ROOMS else None


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


@functools.cache
def imports_of(path):
    package = module_of(path).split(".")
    return list(imports(path.read_text(encoding="utf-8"), package if path.stem == "__init__" else package[:-1]))


def rooms_to_the_right(room, found):
    """Sentences about imports from rooms that do not stand before this one."""
    place = next(i for i, rooms in enumerate(ORDER) if room in rooms)
    allowed = set().union({room}, *ORDER[:place])
    return [
        f"line {line}: {name}"
        for line, name in found
        if name.split(".")[0] in ("tests", "benchmarks", *TOP) or room_of(name) not in {None, *allowed}
    ]


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_imports_only_what_stands_before_it(room):
    wrong = {named(path): rooms_to_the_right(room, imports_of(path)) for path in files(room)}
    assert {name: sentences for name, sentences in wrong.items() if sentences} == {}


def test_no_two_files_import_each_other():
    modules = {module_of(path): path for path in files(*ROOMS)}
    graph = {
        name: {m for _, found in _imports_at_run_time(path) if (m := _module_in(found, modules)) and m != name}
        for name, path in modules.items()
    }
    assert _circles(graph) == []


def _imports_at_run_time(path):
    """Imports of a file without those for the type checker alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    package = module_of(path).split(".")
    return imports(ast.unparse(tree), package if path.stem == "__init__" else package[:-1])


def _module_in(name, modules):
    return name if name in modules else name.rpartition(".")[0] if name.rpartition(".")[0] in modules else None


def _circles(graph):
    """Groups of names that lead back to themselves."""
    graph = {name: set(targets) for name, targets in graph.items()}
    while leaves := [name for name, targets in graph.items() if not targets & graph.keys()]:
        for name in leaves:
            del graph[name]
    while roots := [name for name in graph if not any(name in targets for targets in graph.values())]:
        for name in roots:
            del graph[name]
    return sorted(graph)


@pytest.mark.parametrize("path", files(*LIVING), ids=named)
def test_the_living_know_no_windows_and_no_learning(path):
    assert [name for _, name in imports_of(path) if name.split(".")[0] in ("pygame", "pygame_gui", "torch")] == []


@pytest.mark.parametrize("path", files("behaviours"), ids=named)
def test_behaviours_do_not_know_esper(path):
    assert [name for _, name in imports_of(path) if name.split(".")[0] == "esper"] == []


@pytest.mark.parametrize("path", files("learning", "lifting", "film"), ids=named)
def test_torch_stays_in_files_that_say_so(path):
    found = {name.split(".")[0] for _, name in imports_of(path)}
    assert found.isdisjoint({"pygame", "pygame_gui"})
    assert "torch" not in found or path.name.startswith("torch_")


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
    source = "from flockbrush.levels import reader\nimport flockbrush.cli.main, flockbrush.engine, engine\n"
    assert rooms_to_the_right("systems", imports(source)) == [
        "line 1: flockbrush.levels.reader",
        "line 2: flockbrush.cli.main",
        "line 2: engine",
    ]
    inside = "def f():\n    from ...systems.grid import Cells\n"
    found = imports(inside, ("flockbrush", "behaviours", "models"))
    assert rooms_to_the_right("behaviours", found) == ["line 2: flockbrush.systems.grid.Cells"]
    found = imports("import flockbrush.lifting.lens")
    assert rooms_to_the_right("learning", found) == ["line 1: flockbrush.lifting.lens"]
    assert _circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == ["b", "c"]
    for source in (
        "import random",
        "from time import time",
        "np.random.default_rng(3)",
        "import datetime\ndatetime.date.today()",
    ):
        assert chance_and_clocks(source) != [], source
    assert chance_and_clocks("from flockbrush.engine.clock import Clock\nclock.now\n") == []
    assert list(lengthy("def f():\n" + 80 * "    pass\n")) == [(1, "f")]
    assert list(lengthy("def f():\n" + 79 * "    pass\n")) == []
    assert list(crowded("def f(a, b, c, d, e, *, f, g, h, i, j, k): pass")) == [(1, "f")]
    assert machine_dependent("@njit(fastmath=True)\ndef f(): pass") == [1]
    assert machine_dependent("@njit(fastmath={'nnan', 'reassoc'})\ndef f(): pass") == [1]
    assert machine_dependent("@njit(fastmath={'nnan'})\ndef f(): pass") == []
    assert machine_dependent("@njit(fastmath=False)\ndef f(): pass") == []


LONG = 500  # lines of a file


@pytest.mark.parametrize("room", ROOMS)
def test_no_file_is_too_long(room):
    lines = {named(path): path.read_text(encoding="utf-8").count("\n") for path in files(room)}
    assert lines and {name: count for name, count in lines.items() if count > LONG} == {}, "split it by subject"


def crowded(source):
    """(line, name) of every function of a source that takes more than `MOST` arguments."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            taken = node.args
            if len(taken.posonlyargs) + len(taken.args) + len(taken.kwonlyargs) > MOST:
                yield node.lineno, node.name


@pytest.mark.parametrize("room", ROOMS)
def test_no_function_takes_too_many_arguments(room):
    found = {named(path): list(crowded(path.read_text(encoding="utf-8"))) for path in files(room)}
    assert {name: functions for name, functions in found.items() if functions} == {}, "pass a NamedTuple or a dataclass"


def lengthy(source):
    """(line, name) of every function of a source with more than `LINES` lines."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno - node.lineno >= LINES:
            yield node.lineno, node.name


@pytest.mark.parametrize("room", ROOMS)
def test_no_function_is_too_long(room):
    found = {named(path): list(lengthy(path.read_text(encoding="utf-8"))) for path in files(room)}
    assert {name: functions for name, functions in found.items() if functions} == {}, "split it by step"


def test_no_file_of_tests_benchmarks_and_pictures_is_too_long():
    paths = [path for folder in ("tests", "benchmarks", "docs") for path in (HOUSE / folder).rglob("*.py")]
    lines = {str(path.relative_to(HOUSE)): path.read_text(encoding="utf-8").count("\n") for path in paths}
    assert len(lines) > 100 and {name: count for name, count in lines.items() if count > LONG} == {}, "split it"


SHARED = {"Params"}  # every model names its parameters so; each is known by its model


def names_twice(sources):
    """Public classes that stand in more than one of these files, with the files: {file: source} -> {name: files}."""
    found = {}
    for file, source in sources.items():
        for node in ast.parse(source).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(file)
    return {name: where for name, where in found.items() if len(where) > 1 and name not in SHARED}


def test_the_name_of_a_class_has_one_meaning():
    sources = {named(path): path.read_text(encoding="utf-8") for path in files(*ROOMS)}
    assert len(sources) > 300 and names_twice(sources) == {}
    assert names_twice({"a": "class X: pass", "b": "class X(Y): pass\nclass _Z: pass", "c": "class _Z: pass"}) == {
        "X": ["a", "b"]
    }


def test_there_is_one_main_loop_one_undo_stack_and_no_inverse_of_a_command():
    sources = {named(path): path.read_text(encoding="utf-8") for path in files(*ROOMS)}

    def having(*words):
        return {file for file, source in sources.items() if any(word in source for word in words)}

    assert having("pygame.event.get", "pygame.time.Clock") == {"flockbrush/studio/window.py"}
    assert having("undone.append", "undone.pop") <= {"flockbrush/runs/edit_file.py"}  # which reads them from a file
    assert having("def inverse(") == set()


COMPILERS = (
    "njit",
    "cache",
    "kernel",
    "kernel_function",
    "inner_kernel",
    "lane_function",
    "dataclass",
)  # others register what is below


def names_used(tree):
    """Every name and attribute that is read, and every text that may be one: not what is only imported or exported."""
    tree.body = [n for n in tree.body if not isinstance(n, ast.Assign) or ast.unparse(n.targets) != "__all__"]
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def called_by_nobody(sources, callers=()):
    """Functions and classes of these sources that nothing there names, nor in the sources of `callers`."""
    used = {name for source in (*sources, *callers) for name in names_used(ast.parse(source))}
    found = [node for source in sources for node in ast.parse(source).body if hasattr(node, "decorator_list")]
    plain = [n for n in found if all(ast.unparse(d).partition("(")[0] in COMPILERS for d in n.decorator_list)]
    return [node.name for node in plain if node.name not in used and not node.name.startswith("__")]


def test_every_function_and_class_has_a_caller_besides_tests():
    callers = [path for name in ("benchmarks", "docs", "examples") for path in (HOUSE / name).rglob("*.py")]
    sources, others = ([path.read_text(encoding="utf-8") for path in p] for p in (files(*ROOMS), callers))
    assert len(sources) > 300 and called_by_nobody(sources, others) == []
    alone = "from a import f\n__all__ = ['f', 'g', 'C']\n@njit(cache=True)\ndef f(): pass\n"
    assert called_by_nobody([alone, "def g(): h()\ndef h(): pass", "class C: pass\n@command\nclass D: pass"]) == [
        "f", "g", "C",
    ]  # fmt: skip
    assert called_by_nobody([alone], ["import a\na.f()"]) == []


WIDE = 100  # columns of prose in Markdown
PAGES = [*HOUSE.glob("*.md"), *(HOUSE / "docs").rglob("*.md")]


def long_lines(text):
    """Numbers of the lines of prose that are too long: not code, tables, pictures, or words that cannot be broken."""
    code, found = False, []
    for number, line in enumerate(text.split("\n"), 1):
        fence = line.lstrip().startswith("```")
        code ^= fence
        prose = not (code or fence or line.startswith(("|", "    ", "![", "<")))
        if prose and len(line) > WIDE and " " in line.strip():
            found.append(number)
    return found


def test_prose_of_the_documentation_is_wrapped():
    pages = [path for path in PAGES if path.name != "CHANGELOG.md"]
    assert len(pages) > 15
    found = {named(path): long_lines(path.read_text(encoding="utf-8")) for path in pages}
    assert {page: lines for page, lines in found.items() if lines} == {}, f"wrap these lines at {WIDE} columns"
    assert long_lines("a " * 51 + "\n```\n" + "a " * 51 + "\n```\n| " + "a " * 51) == [1]


@pytest.fixture(scope="module")
def loaded():
    """Top-level names in memory once every module of the running rooms has been imported."""
    modules = [module_of(path) for path in files(*TOP)]
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
