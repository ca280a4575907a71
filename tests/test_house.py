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


@functools.cache
def nodes(source):
    """All nodes of a source, which nobody may change."""
    return list(ast.walk(ast.parse(source)))


@pytest.fixture(scope="module", autouse=True)
def forgotten_at_the_end():
    yield
    nodes.cache_clear()  # they fill the memory of the tests that follow


def imports(source, package=(), at_run_time=False):
    """(line, dotted name) of every import in a source, wherever it stands; with or without those for type checkers."""
    left_out = set()
    if at_run_time:
        blocks = [n for n in nodes(source) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
        left_out = {id(node) for block in blocks for child in block.body for node in ast.walk(child)}
    for node in nodes(source):
        if id(node) in left_out:
            continue
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            stem = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{stem}.{alias.name}") for alias in node.names)


@functools.cache
def imports_of(path, at_run_time=False):
    package = module_of(path).split(".")
    package = package if path.stem == "__init__" else package[:-1]
    return list(imports(path.read_text(encoding="utf-8"), package, at_run_time))


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


def private_names(found):
    """Sentences about imports of what a file of ours keeps to itself."""
    parts = ((line, name, name.split(".")[-1]) for line, name in found if name.split(".")[0] == "flockbrush")
    return [f"line {line}: {name}" for line, name, last in parts if last.startswith("_") and not last.startswith("__")]


@pytest.mark.parametrize("room", ROOMS)
def test_what_a_file_keeps_to_itself_no_other_imports(room):
    wrong = {named(path): private_names(imports_of(path)) for path in files(room)}
    assert {name: sentences for name, sentences in wrong.items() if sentences} == {}


def test_no_two_files_import_each_other():
    modules = {module_of(path): path for path in files(*ROOMS)}
    graph = {
        name: {m for _, found in imports_of(path, at_run_time=True) if (m := _module_in(found, modules)) and m != name}
        for name, path in modules.items()
    }
    assert _circles(graph) == []


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


def importing(paths, *roots):
    """{file: names} of the files that import something of these packages, wherever it stands."""
    found = {named(path): [name for _, name in imports_of(path) if name.split(".")[0] in roots] for path in paths}
    assert found
    return {name: names for name, names in found.items() if names}


def test_rooms_import_no_library_that_is_not_theirs():
    """No windows and no learning in what lives, no esper in behaviours, torch only in files that say so."""
    looking = files("learning", "lifting", "film")
    assert importing(files(*LIVING), "pygame", "pygame_gui", "torch") == {}
    assert importing(files("behaviours"), "esper") == {}
    assert importing(looking, "pygame", "pygame_gui") == {}
    assert importing([path for path in looking if not path.name.startswith("torch_")], "torch") == {}


def chance_and_clocks(source):
    """Lines of a source that read the wall clock, or draw numbers that are not named noise."""
    found = [(n, name) for n, name in imports(source) if name.split(".")[0] in ("random", "secrets", "uuid", "time")]
    for node in nodes(source):
        if isinstance(node, ast.Attribute):
            chain = ast.unparse(node)
            if chain.startswith(("np.random", "numpy.random")) or (
                node.attr in CLOCKS and chain.split(".")[0] in ("datetime", "date")
            ):
                found.append((node.lineno, chain))
    return found


@pytest.mark.parametrize("room", ["components", "behaviours", "systems"])
def test_nothing_in_a_tick_is_timed_or_drawn_without_a_name(room):
    assert {path: found for path in files(room) if (found := chance_and_clocks(path.read_text("utf-8")))} == {}


EXACT = {"nnan", "ninf", "nsz"}  # these change no rounding; reassoc, contract, arcp and afn do


def machine_dependent(source):
    """Lines where compiled code is allowed to round as the machine likes."""
    keywords = [k for k in nodes(source) if isinstance(k, ast.keyword) and k.arg == "fastmath"]
    return [k.value.lineno for k in keywords if not _is_exact(k.value)]


def _is_exact(value):
    try:
        flags = ast.literal_eval(value)
    except ValueError:
        return False
    return flags is False or (isinstance(flags, set) and flags <= EXACT)


@pytest.mark.parametrize("room", ["engine", "behaviours", "systems"])
def test_nothing_that_writes_state_is_compiled_loosely(room):
    assert {path: found for path in files(room) if (found := machine_dependent(path.read_text("utf-8")))} == {}


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
    assert private_names(imports("from flockbrush.systems.contact import _edge, contact\nfrom os import _exit")) == [
        "line 1: flockbrush.systems.contact._edge"
    ]
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
    for node in nodes(source):
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
    for node in nodes(source):
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
        for node in nodes(source)[0].body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(file)
    return {name: where for name, where in found.items() if len(where) > 1 and name not in SHARED}


SAME_THING = [  # folders whose files of one name are one thing twice: formats of one scene, a model and its likelihood
    {"flockbrush/output/usd", "flockbrush/output/gltf"},
    {"behaviours/models", "flockbrush/learning/likelihoods"},
    {"engine", "systems"},  # commands: what they are, and those of a world
]


def test_the_name_of_a_file_has_one_meaning():
    folders = {}
    for path in files(*ROOMS):
        folders.setdefault(path.name, set()).add(named(path.parent))
    twice = {name: found for name, found in folders.items() if len(found) > 1 and name != "__init__.py"}
    assert len(folders) > 300
    assert {name: found for name, found in twice.items() if not any(found <= one for one in SAME_THING)} == {}


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


def names_used(source):
    """Every name and attribute that is read, and every text that may be one: not what is only imported or exported."""
    exports = [n for n in nodes(source)[0].body if isinstance(n, ast.Assign) and ast.unparse(n.targets) == "__all__"]
    exported = {id(node) for statement in exports for node in ast.walk(statement)}
    for node in nodes(source):
        if id(node) in exported:
            continue
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def called_by_nobody(sources, callers=()):
    """Functions and classes of these sources that nothing there names, nor in the sources of `callers`."""
    used = {name for source in (*sources, *callers) for name in names_used(source)}
    found = [node for source in sources for node in nodes(source)[0].body if hasattr(node, "decorator_list")]
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
