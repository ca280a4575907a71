"""The documentation works: every code block is run as a reader would, from top to bottom in an empty folder.

Blocks marked ``python`` and ``sh`` are run; of all other blocks the commands must exist with the options they show.
"""

import dataclasses
import functools
import json
import re
import shlex
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from flockbrush.systems.measures import measures

from flockbrush.cli.main import called
from flockbrush.render.overlay_registry import OVERLAYS, load_overlays

HOUSE = Path(__file__).parents[1]
sys.path.insert(0, str(HOUSE / "tests" / "behaviours"))  # the contract of models
PAGES = [HOUSE / "README.md", *sorted((HOUSE / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^    (?:\.venv/bin/)?(flockbrush .*)$", re.MULTILINE)
SLOW = {"learn-a-brush.md"}  # learning takes minutes


def named(path):
    return str(path.relative_to(HOUSE))


def blocks(path):
    """(language, text, line) of every fenced block of a page."""
    text = path.read_text(encoding="utf-8")
    return [(m[1], m[2], text.count("\n", 0, m.start()) + 1) for m in BLOCK.finditer(text)]


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """An empty folder, registries that forget what a page registers, and no shell between page and command."""
    import flockbrush.levels.build  # noqa: F401  what registers commands is known before
    from flockbrush.behaviours import behaviour, drive, trigger
    from flockbrush.engine import commands
    from flockbrush.engine.parallel import set_threads, threads
    from flockbrush.levels import terrain_kinds

    from flockbrush.learning import likelihood
    from flockbrush.output import exporter
    from flockbrush.studies import experiments

    before, properties = threads(), list(terrain_kinds.PROPERTIES)
    exporter.exporters()
    monkeypatch.setattr(exporter, "_registry", dict(exporter._registry))
    monkeypatch.chdir(tmp_path)
    behaviour.behaviours()  # all known before, so that all are known again afterwards
    monkeypatch.setattr(behaviour, "_registry", dict(behaviour._registry))
    monkeypatch.setattr(drive, "_registry", dict(drive.drives()))
    monkeypatch.setattr(trigger, "_kinds", dict(trigger.conditions()))
    monkeypatch.setattr(likelihood, "_registry", likelihood.likelihoods())
    monkeypatch.setattr(experiments, "_registry", experiments.experiments())
    monkeypatch.setattr(commands, "COMMANDS", dict(commands.COMMANDS))
    monkeypatch.setitem(sys.modules, "page", types.ModuleType("page"))
    _level_of_the_readers(tmp_path)
    yield
    set_threads(before)
    terrain_kinds.PROPERTIES[:] = properties


def _level_of_the_readers(folder):
    """The file my-level.tmj that pages may start: the first level of a new project, whose animals follow a program."""
    from flockbrush.behaviours.brush import shipped
    from flockbrush.levels.tiled import init

    init(folder, shipped())
    level = json.loads((folder / "first.tmj").read_text())
    spawns = [o for layer in level["layers"] for o in layer.get("objects", []) if o["type"] == "Spawn"]
    assert spawns
    for spawn in spawns:
        spawn["properties"].append({"name": "program", "type": "string", "value": "stampede"})
    (folder / "my-level.tmj").write_text(json.dumps(level))


RUN = [
    pytest.param(path, marks=[pytest.mark.slow] if path.name in SLOW else [], id=named(path))
    for path in PAGES
    if any(language in ("python", "sh") for language, _, _ in blocks(path))
]


@pytest.mark.parametrize("path", RUN)
def test_every_block_of_the_page_runs(path, reader, hasty_learning, short_trials, monkeypatch):
    session = {"__name__": "page"}
    load_overlays()  # as above
    monkeypatch.setattr("flockbrush.render.overlay_registry.OVERLAYS", dict(OVERLAYS))
    monkeypatch.setattr("flockbrush.systems.measures._registry", dict(measures()))
    for language, text, line in blocks(path):
        if language == "python":
            exec(compile("\n" * line + text, named(path), "exec"), session)
        elif language == "sh":
            for command in text.splitlines():
                words = shlex.split(command, comments=True)
                assert words[0] == "flockbrush", f"{named(path)}:{line}: only flockbrush can be run everywhere"
                assert called(words[1:]) == 0, f"{named(path)}:{line}: {command}"


@pytest.mark.parametrize("path", sorted((HOUSE / "docs" / "notebooks").glob("*.ipynb")), ids=lambda path: path.name)
def test_the_notebook_runs(path, reader, monkeypatch):
    """Its cells are run as a kernel does, in the module __main__, after one another; no output is kept in the file."""
    main = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", main)
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 3 and all(cell["outputs"] == [] for cell in cells)
    for number, cell in enumerate(cells, 1):
        exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), main.__dict__)


def test_the_model_of_the_how_to_page_keeps_the_contract_of_models(reader, tmp_path):
    import test_models
    from flockbrush.behaviours.behaviour import behaviours

    text = next(text for _, text, _ in blocks(HOUSE / "docs" / "how-to.md") if "@behaviour" in text)
    session = {"__name__": "page", "__doc__": ""}
    exec(compile(text, "how-to.md", "exec"), session)
    model = behaviours()["mean_heading"]
    model = dataclasses.replace(model, doc=text.split('"""')[1])
    contract = test_models.TestEveryModel()
    for name in dir(contract):
        if name.startswith("test_") and name not in (
            "test_turns_with_the_scene",
            "test_is_finite_for_one_alone_and_for_many_on_one_spot",
        ):
            getattr(contract, name)(model)
    for turn in (0.4, np.pi / 2):
        contract.test_turns_with_the_scene(model, turn)
    for n in (1, 7):
        contract.test_is_finite_for_one_alone_and_for_many_on_one_spot(model, n)


@functools.cache
def help_of(*words):
    """Text of ``flockbrush WORDS --help``, or None where there is no such command."""
    import contextlib
    import io

    text = io.StringIO()
    with (
        contextlib.redirect_stdout(text),
        contextlib.redirect_stderr(io.StringIO()),
        pytest.MonkeyPatch.context() as env,
    ):
        env.setenv("COLUMNS", "250")
        env.setenv("NO_COLOR", "1")
        return text.getvalue() if called([*words, "--help"]) == 0 else None


def commands_shown(path):
    """Every command on a page that no test runs; ``a | b`` shows two."""
    text = path.read_text(encoding="utf-8")
    lines = [
        line for language, block, _ in blocks(path) if language not in ("python", "sh") for line in block.splitlines()
    ]
    for line in [*lines, *INDENTED.findall(text)]:
        if line.startswith("flockbrush "):
            yield line


@pytest.mark.parametrize("path", PAGES, ids=named)
def test_commands_on_the_page_exist_with_their_options(path):
    for line in commands_shown(path):
        first, *others = re.split(r" \| ", re.split(r" #|  +| \.\.\.| -> | > ", line.replace("\\", ""))[0])
        words = first.split()[1:]
        group = words[:1] if help_of(words[0]) and "Commands" in help_of(words[0]) and others else []
        for shown in [words, *([*group, *other.split()] for other in others)]:
            deep = "COMMAND [ARGS]" in (help_of(shown[0]) or "") and len(shown) > 1
            name = shown[: 2 if deep else 1]
            text = help_of(*name)
            assert text, f"{named(path)}: there is no command: flockbrush {' '.join(name)}"
            for flag in re.findall(r"--?[a-z][a-z-]*", " ".join(w for w in shown if w.startswith("-"))):
                assert re.search(rf"(?<![\w-]){flag}(?![\w-])", text), f"{named(path)}: {line}: no option {flag}"
