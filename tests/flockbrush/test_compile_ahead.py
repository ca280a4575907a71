"""The first run: what it will call is found without compiling, and compiled by several processes."""

import gc
import multiprocessing
import subprocess
import sys
import threading

from flockbrush.engine import kernel_cache
from flockbrush.engine.kernel_calls import KernelCall
from flockbrush.engine.recording import state_hash
from numba import njit, types
from numba.core import event
from processes import environment
from small_sweep import sweep_file

from flockbrush.cli import bench
from flockbrush.cli.main import called
from flockbrush.learning import rehearsal
from flockbrush.runs import compile_ahead, kernel_helper, run
from flockbrush.runs.compile_ahead import CompileAhead
from flockbrush.studies.sweep_file import read_sweep

SHARED = """
import multiprocessing
from numba import types
from flockbrush.engine import maths
from flockbrush.engine.kernel_calls import KernelCall, stored_kernels
from flockbrush.runs import kernel_helper
from flockbrush.runs.compile_ahead import CompileAhead

assert stored_kernels() == 0
ahead = CompileAhead({"name": "meadow"})
out, scout = multiprocessing.Pipe()
for name in ("sincos_", "exp_", "log_"):
    scout.send(KernelCall("flockbrush.engine.maths", name, (types.float64,), 1))
scout.close()
ahead._listen(out)
ahead._start(ahead._serve, kernel_helper.compile_calls)
with ahead._changed:
    assert ahead._changed.wait_for(lambda: ahead.done == 3, 200)
ahead.close()
assert stored_kernels() == 3, stored_kernels()
maths.exp_(1.0)
assert not maths.exp_.stats.cache_misses and maths.exp_.stats.cache_hits
"""


def _found(ahead, calls):
    """Let a scout have found these."""
    out, scout = multiprocessing.Pipe()
    for call in calls:
        scout.send(call)
    scout.close()
    ahead._listen(out)


def test_a_scout_finds_the_kernels_of_a_run_with_the_types_of_the_run(level):
    calls = _scouted(level)
    simulation = run.start(level)
    simulation.run(2)
    simulation.measures()
    simulation.parts()
    state_hash(simulation.world)
    names = {f"{call.module}.{call.name}" for call in calls}
    assert {"flockbrush.systems.sight.look", "flockbrush.systems.grid._sort"} <= names
    strange = [call.key for call in calls if call.types not in _compiled(call)]
    assert not strange


def _scouted(name):
    """Calls that a scout finds."""
    return _rehearsed(CompileAhead({"name": name, "seed": None, "agents": None, "brush": None}))


def _rehearsed(ahead):
    ahead._scouting = True
    ahead._start(ahead._listen, kernel_helper.scout, ahead.rehearsal, ahead.work)
    with ahead._changed:
        assert ahead._changed.wait_for(lambda: not ahead._scouting, 200)
    calls = [ahead._next() for _ in range(ahead.found)]
    ahead.close()
    return calls


def _compiled(call):
    return getattr(sys.modules[call.module], call.name).overloads


def test_a_helper_compiles_into_the_cache_of_the_process_that_asked(tmp_path):
    words = [sys.executable, "-c", SHARED]
    done = subprocess.run(words, env=environment(NUMBA_CACHE_DIR=tmp_path), timeout=300, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.rglob("*.nbc"))


def test_calls_that_take_long_come_first_and_none_comes_twice():
    ahead = CompileAhead({"name": "meadow"})
    calls = [KernelCall("flockbrush.engine.maths", name, (), weight) for name, weight in (("a", 1), ("b", 3), ("c", 2))]
    _found(ahead, [*calls, *calls])
    assert [ahead._next().name for _ in calls] == ["b", "c", "a"]
    assert ahead._next() is None and ahead.found == 3


def test_what_a_helper_dies_of_is_left_to_who_needs_it():
    ahead = CompileAhead({"name": "meadow"})
    _found(ahead, [KernelCall("flockbrush.engine.maths", "no_such_kernel", (), 1)])
    ahead._start(ahead._serve, kernel_helper.compile_calls)
    with ahead._changed:
        assert ahead._changed.wait_for(lambda: ahead.done == 1, 200)
    ahead.close()


def test_helpers_end_with_the_work_they_help():
    ahead = CompileAhead({"name": "meadow"})
    ahead._scouting = True
    ahead._start(ahead._serve, kernel_helper.compile_calls)
    ahead.close()
    assert len(ahead._helpers) == 1 and not ahead._helpers[0].is_alive()
    assert ahead._next() is None


def test_where_kernels_are_stored_or_there_is_one_core_no_helper_starts(level, monkeypatch):
    started = []
    monkeypatch.setattr(CompileAhead, "_start", lambda *arguments: started.append(arguments[2].__name__))
    monkeypatch.setattr(compile_ahead, "threads", lambda: 1)
    _meets(level)
    monkeypatch.setattr(compile_ahead, "threads", lambda: 2)
    monkeypatch.setattr(compile_ahead, "stored_kernels", lambda: 100)
    _meets(level)
    assert not started
    monkeypatch.setattr(compile_ahead, "stored_kernels", lambda: 0)
    _meets(level)
    assert started == ["scout", "compile_calls"]


def test_whatever_opens_a_level_first_compiles_for_it(level, tmp_path, monkeypatch, capsys):
    """The window too, whose session is opened beside it."""
    work = []
    monkeypatch.setattr(CompileAhead, "meet", lambda ahead, kernel, types: None)
    monkeypatch.setattr(CompileAhead, "close", lambda ahead: work.append(ahead.work))
    monkeypatch.setenv("FLOCKBRUSH_STATE", str(tmp_path))
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    for options in (
        ["run", level, "--ticks", "1", "--seed", "3"],
        ["level", "render", level, "--seed", "3", "-o", tmp_path / "level.png"],
        ["serve", level, "--seed", "3", "--seconds", "0"],
        ["play", level, "--seed", "3", "--frames", "1"],
    ):
        assert called(list(map(str, options))) == 0, capsys.readouterr().err
    assert [(one["name"], one["seed"]) for one in work] == [(str(level), 3)] * 4


def test_a_recording_is_lived_again_by_kernels_compiled_together(level, tmp_path, monkeypatch, capsys):
    recording = str(tmp_path / "walk.flock")
    assert called(["run", str(level), "--ticks", "4", "--record", recording]) == 0
    calls = _scouted(recording)
    assert "flockbrush.systems.sight.look" in {f"{call.module}.{call.name}" for call in calls}
    assert not [call.key for call in calls if call.types not in _compiled(call)]
    work = []
    monkeypatch.setattr(CompileAhead, "meet", lambda ahead, kernel, types: None)
    monkeypatch.setattr(CompileAhead, "close", lambda ahead: work.append(ahead.work["name"]))
    for options in (["replay"], ["measure"], ["export", "--to", str(tmp_path / "walk.csv")]):
        assert called([*options, recording]) == 0, capsys.readouterr().err
    assert work == [recording] * 3


SWEEP = """
schema = "flockbrush.sweep/1"
seeds.count = 1
fixed = { plane = "march", agents = 4, seconds = 0.1 }
"""


def _works(tmp_path):
    """What bench, sweep and learn do: (rehearsal, its arguments, the same here)."""
    sweep = read_sweep(sweep_file(tmp_path, SWEEP))
    scenario, runs = sweep.scenarios[0], sweep.experiment
    return (
        ("flockbrush.cli.bench:rehearse", {}, lambda: bench.timed(bench.scene(40), 1)),
        (
            "flockbrush.studies.sweep_file:rehearse",
            {"path": str(tmp_path / "flocks.sweep.toml")},
            lambda: (read_sweep(tmp_path / "flocks.sweep.toml"), runs.run(scenario.parameters, scenario.files, [0])),
        ),
        ("flockbrush.learning.rehearsal:rehearse", {}, rehearsal.rehearse),
    )


def test_rehearsals_call_the_kernels_of_the_work_with_its_types(tmp_path):
    for name, arguments, work in _works(tmp_path):
        calls = _rehearsed(CompileAhead(arguments, name))
        work()
        assert "flockbrush.systems.sight.look" in {f"{call.module}.{call.name}" for call in calls}, name
        assert not [call.key for call in calls if call.types not in _compiled(call)], name


def test_bench_sweep_and_learn_compile_in_several_processes(tmp_path, monkeypatch):
    begun = []
    monkeypatch.setattr(CompileAhead, "meet", lambda ahead, kernel, types: None)
    monkeypatch.setattr(CompileAhead, "close", lambda ahead: begun.append((ahead.rehearsal, ahead.work)))
    flocks, tracks = sweep_file(tmp_path, SWEEP), tmp_path / "tracks.csv"
    tracks.write_text("id,frame,x,y\n1,0,0,0\n")
    called(["bench", "--agents", "4", "--ticks", "2"])
    called(["sweep", str(flocks), "--out", str(tmp_path / "out"), "--jobs", "1"])
    called(["learn", str(tracks), "-o", str(tmp_path / "x.brush.toml"), "--fps", "16", "--unit", "bl"])
    assert begun == [
        ("flockbrush.cli.bench:rehearse", {}),
        ("flockbrush.studies.sweep_file:rehearse", {"path": str(flocks)}),
        ("flockbrush.learning.rehearsal:rehearse", {}),
    ]


def _meets(level):
    from flockbrush.engine.maths import exp_

    ahead = CompileAhead({"name": level, "seed": None, "agents": None, "brush": None})
    ahead.meet(exp_, ())
    ahead.close()


def test_processes_take_turns_at_storing_kernels(tmp_path):
    from numba.core.caching import IndexDataCacheFile

    kernel_cache.save_one_at_a_time()
    stored = IndexDataCacheFile(str(tmp_path), "kernel", "stamp")
    saving = threading.Thread(target=stored.save, args=("key", "compiled"))
    with kernel_cache._turn(tmp_path):
        saving.start()
        saving.join(0.2)
        assert stored.load("key") is None
    saving.join(60)
    assert stored.load("key") == "compiled"


def test_garbage_is_left_alone_while_a_kernel_is_compiled_and_no_longer():
    collects = []

    class Asked(event.Listener):
        on_start = on_end = lambda self, _: collects.append(gc.isenabled())

    with event.install_listener("numba:compile", Asked()):
        njit(lambda x: x + 1).compile((types.int64,))
    assert not collects[0] and gc.isenabled()
