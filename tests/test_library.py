"""What somebody meets who types in a notebook: lazy names, models defined again, objects that say what they are."""

import ast
import copy
import pickle
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as registry
from flockbrush.components import BrushBinding, Heading, Position
from flockbrush.engine.locks import Advice
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import RemoveAnimals
from flockbrush.systems.palette import Palette

import flockbrush
from flockbrush.runs.run import find_level

CELL = '''
import numpy as np
from flockbrush.behaviours.behaviour import Parameters, Wishes, behaviour, quantity

class Params(Parameters):
    pull: float = quantity(5.0, "1/s", "larger turns sooner", low=0, high=100)

@behaviour("compass", Params)
def steer(scene, rows, params):
    """Turn to one side."""
    direction = scene.forward[rows] + params.pull * scene.dt * np.array([0.0, SIGN, 0.0])
    return Wishes(direction / np.linalg.norm(direction, axis=1, keepdims=True), np.ones(len(rows)))
'''
BRUSH = b"""
schema = "flockbrush.brush/1"
model = "compass"
[speed]
mean = 1.0
[provenance]
kind = "hand-set"
source = "a test"
date = 2026-11-22
by = "a test"
"""


@pytest.fixture
def notebook(monkeypatch):
    """Runs cells as the module __main__."""
    registry.behaviours()
    monkeypatch.setattr(registry, "_registry", dict(registry._registry))
    main = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", main)
    return lambda text: exec(text, main.__dict__)


def north(simulation):
    simulation.run(96)
    return simulation.agents[Heading.forward][:, 1].mean()


def test_a_cell_that_is_run_again_replaces_its_model(notebook):
    notebook(CELL.replace("SIGN", "1.0"))
    assert north(flockbrush.plane(flockbrush.load_brush(BRUSH, "c.brush.toml"), 9)) > 0.9
    notebook(CELL.replace("SIGN", "-1.0"))
    assert north(flockbrush.plane(flockbrush.load_brush(BRUSH, "c.brush.toml"), 9)) < -0.9


def test_a_notebook_does_not_replace_a_model_of_ours_or_of_a_module(notebook):
    with pytest.raises(ValueError, match=r"'herd' is already in flockbrush\.behaviours\.models\.herd"):
        notebook(CELL.replace("SIGN", "1.0").replace('"compass"', '"herd"'))


def test_objects_say_what_they_are(tmp_path):
    march = flockbrush.shipped().get("march")
    assert repr(march).startswith("<Brush march") and ": herd, 4 BL/s, " in repr(march)
    meadow = flockbrush.start("meadow", seed=3, agents=5)
    with flockbrush.record(tmp_path / "walk.flock", meadow) as recorder:
        for _ in range(16):
            meadow.tick()
            recorder.take()
    assert repr(meadow) == "<Simulation meadow: 5 animals, tick 16 (0.5 s)>"
    assert repr(meadow.agents).startswith("<Table: 5 animals, ")
    assert repr(flockbrush.shipped()).startswith("<BrushLibrary: ") and ", march, " in repr(flockbrush.shipped())
    with pytest.raises(KeyError, match="no column .*Position.*; write Position.xyz"):
        meadow.agents[Position]
    run = flockbrush.open_recording(tmp_path / "walk.flock")
    assert repr(run) == f"<RecordedRun {run.path}: {run.header['level']}, 16 ticks (0.5 s), seed 3, 0 commands>"


def test_type_checkers_see_every_name_that_is_loaded_later():
    tree = ast.parse(Path(flockbrush.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    seen = {alias.name: node.module for node in block.body for alias in node.names}
    assert seen == flockbrush._HOMES
    assert sorted(flockbrush.__all__) == sorted([*seen, "__version__"])
    assert all(getattr(flockbrush, name) for name in flockbrush.__all__)


@pytest.mark.parametrize("level", ["meadow", "city", "lake", "sheep-pasture"])
def test_copies_of_a_simulation_continue_bit_for_bit_and_by_themselves(level):
    first = flockbrush.start(level, seed=3, agents=24)  # with paint, births, programs, flight and species that fear
    first.run(8)
    first.submit(RemoveAnimals(0, 0, 0), tick=14)
    now = state_hash(first.world)
    copies = [copy.deepcopy(first), pickle.loads(pickle.dumps(first)), copy.copy(first)]
    assert {state_hash(one.world) for one in copies} == {now}
    for one in copies:
        one.run(4)
    assert state_hash(first.world) == now != state_hash(copies[0].world)
    first.run(4)
    assert {state_hash(one.world) for one in copies} == {state_hash(first.world)}
    alive = len(first.agents)
    first.close()
    copies[0].run(4)
    assert (len(copies[0].agents), len(copies[1].agents)) == (0, alive)
    assert copies[0].agents[Position.xyz].shape == (0, 3)


def test_a_rebuilt_recording_applies_the_recorded_commands(tmp_path):
    herd = flockbrush.start("meadow", seed=7, agents=12)
    herd.submit(RemoveAnimals(0, 0, 0), tick=3)
    with flockbrush.record(tmp_path / "gone.flock", herd) as recorder:
        for _ in range(6):
            herd.tick()
            recorder.take()
    run = flockbrush.open_recording(tmp_path / "gone.flock")
    again = flockbrush.rebuild(run)
    again.run(3)
    assert len(again.agents) == 12
    again.run(3)
    assert len(again.agents) == 0 and state_hash(again.world) == run.hashes[6]


def test_a_levels_brushes_are_overridden_and_recordings_know_it(tmp_path):
    swarm = flockbrush.start("meadow", seed=3, agents=12, brush="swarm")
    names = [brush.name for brush in swarm.world.resource(Palette).brushes]
    assert {names[k] for k in swarm.agents[BrushBinding.brush]} <= {"swarm", "march"}  # march is painted there
    assert {spawn.brush for spawn in swarm.level.spawns} == {"swarm"}
    with flockbrush.record(tmp_path / "swarm.flock", swarm) as recorder:
        for _ in range(8):
            swarm.tick()
            recorder.take()
    hash = state_hash(swarm.world)
    again = flockbrush.rebuild(flockbrush.open_recording(tmp_path / "swarm.flock"))
    again.run(8)
    assert state_hash(again.world) == hash


@pytest.mark.parametrize(("level", "brush"), [("city", "stroll"), ("lake", "geese"), ("ridge", "graze")])
def test_a_level_whose_script_commands_programs_takes_another_brush(level, brush):
    with pytest.warns(Advice, match=f"{level}: all animals have the brush {brush}, without programs: .* left out"):
        herd = flockbrush.start(level, agents=12, brush=brush)
    assert not {key.command for key in herd.level.script} & {"Event", "SetState", "GiveProgram"}
    herd.run(32)
    assert herd.states() == {}


def test_a_brush_that_is_in_no_file_moves_a_level_and_its_recording(tmp_path):
    keen = flockbrush.shipped().get("march").with_parameters(sensitivity=9.0)
    herd = flockbrush.start("meadow", seed=3, agents=12, brush=keen)
    assert herd.world.resource(Palette).brushes[herd.agents[BrushBinding.home][0]].parameters == keen.parameters
    with flockbrush.record(tmp_path / "keen.flock", herd) as recorder:
        herd.tick()
        recorder.take()
    again = flockbrush.rebuild(flockbrush.open_recording(tmp_path / "keen.flock"))
    again.tick()
    assert again.world.resource(Palette).brushes[again.agents[BrushBinding.home][0]].parameters == keen.parameters
    assert state_hash(again.world) == state_hash(herd.world)
    with pytest.raises(TypeError, match="brush must be a Brush, the name of one or a .brush.toml file, got 5"):
        flockbrush.start("meadow", brush=5)


def test_a_file_and_a_wrong_name_as_the_brush_of_a_level(tmp_path):
    (tmp_path / "mine.brush.toml").write_bytes(flockbrush.shipped().get("march").source)
    mine = flockbrush.start("crowded", seed=1, agents=4, brush=tmp_path / "mine.brush.toml")
    assert {spawn.brush for spawn in mine.level.spawns} == {"mine"}
    with pytest.raises(flockbrush.ProblemsError, match="did you mean 'march'"):
        flockbrush.start("crowded", brush="marsh")


def test_a_broken_measure_is_named_until_it_is_registered_again(monkeypatch):
    from flockbrush.systems import measures

    monkeypatch.setattr(measures, "_registry", dict(measures._registry))
    herd = flockbrush.plane(flockbrush.shipped().get("march"), 5)

    def register(result):
        measures.measure("mine")(lambda _: result())

    register(lambda: 1 // 0)
    with pytest.raises(PluginError, match="/test_library.py:[0-9]+: measure 'mine' of .* failed: ZeroDivisionError"):
        herd.measures()
    register(lambda: np.zeros(3))
    with pytest.raises(PluginError, match="/test_library.py: measure 'mine' must return a number, got ndarray"):
        herd.measures()
    register(lambda: np.float32(0.5))
    assert herd.measures()["mine"] == 0.5
    with pytest.raises(TypeError, match=r'write @measure\("register"'):
        measures.measure(register)


MARCH = flockbrush.shipped().get("march")
WRONG = [
    ("start", (3,), {}, "name must be the name of a shipped level or a path, got 3"),
    ("start", ("meadow",), {"agents": 1.5}, "agents must be a whole number, got 1.5"),
    ("start", ("meadow",), {"seed": "7"}, "seed must be a whole number, got '7'"),
    ("start", ("meadow",), {"seed": True}, "seed must be a whole number, got True"),
    ("plane", ("march", 10), {}, r"brush must be a Brush, such as flockbrush.shipped\(\).get\('march'\), got 'march'"),
    ("plane", (MARCH, 2.5), {}, "count must be a whole number, got 2.5"),
    ("plane", (MARCH, 10), {"density": "a"}, "density must be a number, got 'a'"),
    ("plane", (MARCH, 10), {"heading": "north"}, "heading must be a number, got 'north'"),
    ("plane", (MARCH, 10), {"heading": np.float32("nan")}, "heading must be a finite number, got nan"),
    ("plane", (MARCH, 10), {"density": 10**400}, r"density must be a finite number, got 10+\.\.\."),
    ("plane", (MARCH, 10), {"seed": None}, "seed must be a whole number, got None"),
    ("build", ("meadow",), {}, "level must be a Level, such as flockbrush.read_level.*, got 'meadow'"),
    ("rebuild", ("a.flock",), {}, "run must be a recording, such as flockbrush.open_recording.*, got 'a.flock'"),
    ("record", ("a.flock", 3), {}, "simulation must be a Simulation, such as flockbrush.start.*, got 3"),
    ("record", (3, 4), {}, "path must be a string or a path, got 3"),
    ("save_brush", ("a.brush.toml", MARCH), {}, "brush must be a Brush, such as .*, got 'a.brush.toml'"),
    ("load_brush", (3,), {}, "source must be a string or a path or bytes, got 3"),
    ("read_level", (3,), {}, "path must be a string or a path, got 3"),
    ("read_level", ("a.tmj", {"march": MARCH}), {}, "library must be a BrushLibrary, got .*"),
    ("open_recording", (3,), {}, "path must be a string or a path, got 3"),
    ("learn", (3,), {}, "tracks must be a file of tracks or a film, an array, or a sequence of these, got 3"),
    ("learn", (["a.csv"],), {"fps": "10"}, "fps must be a number, got '10'"),
]


@pytest.mark.parametrize(("name", "args", "kwargs", "words"), WRONG, ids=lambda part: str(part)[:40])
def test_an_argument_of_the_wrong_kind_is_told_with_its_name(name, args, kwargs, words):
    with pytest.raises(ValueError if "finite" in words else TypeError, match=f"^{words}$"):
        getattr(flockbrush, name)(*args, **kwargs)


def test_arguments_of_a_simulation_are_told_with_their_names(tmp_path):
    herd = flockbrush.plane(MARCH, 2)
    gone, meadow = RemoveAnimals(0, 0, 0), flockbrush.start("meadow", agents=2)
    for call, words in (
        (lambda: herd.run("5"), "ticks must be a whole number, got '5'"),
        (lambda: herd.submit(gone, tick=2.9), "tick must be a whole number, got 2.9"),
        (lambda: herd.submit(gone, tick="x"), "tick must be a whole number, got 'x'"),
        (lambda: herd.submit(gone, tick=-5), "tick must be at least 0, got -5"),
        (lambda: flockbrush.build(meadow.level, library=3), "library must be a BrushLibrary, got 3"),
        (lambda: flockbrush.start("meadow", seed=10**400), "seed must be a whole number from 0 to"),
        (lambda: flockbrush.plane(MARCH, 10**400), r"count must be 0 to 1000000, density and body_length > 0: \(1000"),
        (lambda: find_level(3), "name must be the name of a shipped level or a path, got 3"),
        (lambda: flockbrush.build(herd.level, agents="3"), "agents must be a whole number, got '3'"),
        (lambda: flockbrush.record(tmp_path / "a.flock", meadow, -1), "keyframes must be at least 0"),
        (lambda: flockbrush.plane(count=3), r"plane\(\) missing 1 required positional argument: 'brush'"),
    ):
        with pytest.raises((TypeError, ValueError), match=words):
            call()


class EmptyShelf:
    def get(self, name):
        return None


@pytest.mark.parametrize(
    ("library", "words"),
    [
        ({"march": MARCH}, r"library must be a BrushLibrary, got \{'march': <Brush march .*"),
        (flockbrush.BrushLibrary, "library must be a BrushLibrary, got <class .*"),
        (EmptyShelf(), r"library must be a BrushLibrary; its get\('.*'\) gave None"),
    ],
)
def test_what_is_no_library_of_brushes_is_refused_by_name(library, words):
    meadow = flockbrush.start("meadow", agents=2)
    with pytest.raises(TypeError, match=f"^{words}$"):
        flockbrush.build(meadow.level, library=library)


@pytest.mark.parametrize("folders", ["brushes", MARCH, [MARCH], {"march": MARCH}])
def test_a_library_is_made_of_folders(folders):
    with pytest.raises(TypeError, match=r"^folders must be a list of folders, such as \['brushes'\], got "):
        flockbrush.BrushLibrary(folders)


def test_a_herd_too_dense_for_a_plane_is_told_by_the_density():
    with pytest.raises(flockbrush.ProblemsError, match=r"^density: only \d+ of 10 animals fit at 1e\+09 per square"):
        flockbrush.plane(MARCH, 10, density=1e9)


def test_a_measure_is_one_function(monkeypatch):
    from flockbrush.systems import measures

    monkeypatch.setattr(measures, "_registry", dict(measures._registry))

    @measures.measure("width", "m", low=0)
    def width(herd):
        """Extent from west to east."""
        return float(np.ptp(herd.xy[:, 0])) if len(herd.xy) else np.nan

    herd = flockbrush.plane(flockbrush.shipped().get("march"), 9, seed=1)
    assert herd.measures()["width"] == pytest.approx(np.ptp(herd.agents[Position.xyz][:, 0]))
    assert measures.measures()["width"].meaning == "Extent from west to east"

    from flockbrush.cli.level_commands import meaning_of
    from flockbrush.studies.experiments import experiments

    assert meaning_of("width") == "Extent from west to east, m"
    assert experiments()["level"]().units["mean width"] == "m"
    other = types.FunctionType(width.__code__, {"__name__": "elsewhere"})
    other.__module__ = "elsewhere"
    with pytest.raises(ValueError, match="measure 'width' is already in"):
        measures.measure("width")(other)
