"""A run that cannot go on says why in one line, and never shows a traceback."""

from functools import partial

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as model_module
from flockbrush.behaviours import drive as drive_module
from flockbrush.behaviours.behaviour import Wishes
from flockbrush.components import Position
from flockbrush.engine.commands import CommandError, Commands, command
from flockbrush.engine.plugins import PluginError, blaming
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.engine.recording import open_recording, resume, state_hash
from flockbrush.systems.animal_commands import AddAnimals
from flockbrush.systems.commands import MoveObstacle, SwitchBrush

import flockbrush
from flockbrush.cli.level_commands import recorder_of, stepping
from flockbrush.cli.main import called
from flockbrush.output.export import Exports, check_exports
from flockbrush.output.exporter import Exporter, Option, all_options, exporters
from flockbrush.output.formats.gltf_scene import GltfScene
from flockbrush.output.gltf import animated_nodes
from flockbrush.runs.run import rebuild
from flockbrush.runs.terminal import Interrupts, Stopped, exit_code_of


@pytest.mark.parametrize(
    "error",
    [
        CommandError(32, SwitchBrush("rnu"), "no brush 'rnu'"),
        PluginError([Problem("ill.py", None, None, "model 'ill' gave no number")]),
    ],
)
def test_it_says_what_happened_in_one_line(error, capsys):
    assert exit_code_of(error) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.strip().splitlines() == [str(error)]


def test_a_refused_command_names_tick_command_and_reason():
    text = str(CommandError(32, SwitchBrush("rnu"), "no brush 'rnu'"))
    assert text == "tick 32: SwitchBrush(brush='rnu', species='', x=0.0, y=0.0, radius=0.0): no brush 'rnu'"


def run_on(simulation, run, table):
    """Run, record and export 64 ticks."""
    with (
        recorder_of(run, simulation) as recorder,
        Exports([table], simulation) as exports,
        stepping("meadow", simulation, 64, Interrupts(), True) as stepped,
    ):
        for _ in range(64):
            simulation.tick()
            recorder.take()
            exports.take()
            stepped()


def test_a_key_that_fails_is_named_and_what_was_written_before_it_is_kept(tmp_path, capsys):
    run, table = tmp_path / "k.flock", tmp_path / "k.csv"
    simulation = flockbrush.start("meadow", 1, 10)
    simulation.world.resource(Commands).follow(11, 32, MoveObstacle("rock", 3.0, 3.0))
    with pytest.raises(CommandError, match="^tick 32, object 11 in layer 'script': .*: there is no obstacle 'rock'"):
        run_on(simulation, run, table)
    assert "stopped after tick 32; the written files are complete up to this tick" in capsys.readouterr().err
    assert table.read_text().splitlines()[-1].startswith("32,")
    assert called(["replay", str(run), "--verify"]) == 0


@pytest.mark.parametrize("begun", [recorder_of, lambda path, simulation: flockbrush.record(path, simulation)])
def test_a_recording_ends_before_the_tick_that_failed(tmp_path, begun):
    """What was done in that tick before is in none of its snapshots."""
    simulation = flockbrush.start("meadow", 1, 10)
    for cmd in (SwitchBrush("march"), MoveObstacle("rock", 3.0, 3.0)):
        simulation.submit(cmd, 4)
    with pytest.raises(CommandError, match="rock"), begun(tmp_path / "k.flock", simulation) as recorder:
        for _ in range(8):
            simulation.tick()
            recorder.take()
    run = open_recording(tmp_path / "k.flock")
    assert (run.last_tick, run.truncated, run.commands) == (4, False, [])
    again = rebuild(run)
    resume(run, again.world, 4)
    while again.clock.tick < 4:
        again.tick()
    assert state_hash(again.world) == run.hashes[4]


# what others register ---------------------------------------------------------------------------------


@command
class Overturn:
    """Fails half-way."""

    metres: float = 1.0

    def apply(self, world):
        world.agents[Position.xyz][0] += self.metres
        return self.metres / 0


def urge(scene, rows, params):
    return None if scene.tick < 3 else 1 / 0


def steer(scene, rows, params):
    return Wishes(scene.forward[rows], np.ones(len(rows))) if scene.tick < 3 else np.zeros((len(rows), 1))


class Torn(Exporter):
    endings = (".torn",)

    def take(self, moment):
        raise RuntimeError("torn")


def with_drive(monkeypatch):
    monkeypatch.setattr(drive_module, "_registry", dict(drive_module.drives()))
    drive_module.drive("mine", drive_module.DriveParameters)(urge)
    graze = flockbrush.shipped().get("graze")
    return graze.model_copy(update={"drives": {"mine": drive_module.DriveParameters()}})


def stray(scene, rows, params):
    return Wishes(scene.forward[rows], np.full(len(rows), 1.0 if scene.tick < 3 else np.nan))


def with_model(monkeypatch, acts=steer):
    monkeypatch.setattr(model_module, "_registry", dict(model_module.behaviours()))
    model_module.behaviour("ill", model_module.Parameters)(acts)
    graze = flockbrush.shipped().get("graze")
    return graze.model_copy(update={"model": "ill", "params": model_module.Parameters()})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (with_drive, ":[0-9]+: drive 'mine' of .*test_broken_runs failed: ZeroDivisionError: division by zero"),
        (with_model, ": model 'ill' must return Wishes, got ndarray"),
        (
            partial(with_model, acts=stray),
            r": model 'ill' \(brush 'graze'\) gave a wish that is not finite.* in tick 3",
        ),
    ],
)
def test_what_others_registered_is_named_with_its_file_and_what_was_written_is_kept(
    make, words, tmp_path, capsys, monkeypatch
):
    run, table = tmp_path / "k.flock", tmp_path / "k.csv"
    simulation = flockbrush.start("meadow", 1, 10, make(monkeypatch))
    with pytest.raises(PluginError, match=f"^.*test_broken_runs.py{words}$") as caught:
        run_on(simulation, run, table)
    assert "stopped after tick 3; the written files are complete up to this tick" in capsys.readouterr().err
    assert table.read_text().splitlines()[-1].startswith("3,")
    assert (open_recording(run).last_tick, open_recording(run).truncated) == (3, False)
    assert exit_code_of(caught.value) == 1
    assert capsys.readouterr().err.strip() == str(caught.value)


def test_a_number_that_is_none_ends_a_run_of_a_shipped_model_in_good_order(tmp_path, monkeypatch):
    """What was recorded and exported before is kept, and the message names model, animal and tick."""
    monkeypatch.setattr(stray, "__module__", "flockbrush.behaviours.models.herd")
    run, table = tmp_path / "k.flock", tmp_path / "k.csv"
    simulation = flockbrush.start("meadow", 1, 10, with_model(monkeypatch, stray))
    words = r"models.herd\.py: model 'ill' \(brush 'graze'\) gave a wish that is not finite, for entity \d+ in tick 3$"
    with pytest.raises(PluginError, match=words):
        run_on(simulation, run, table)
    assert table.read_text().splitlines()[-1].startswith("3,")
    assert (open_recording(run).last_tick, open_recording(run).truncated) == (3, False)


def test_an_exporter_of_others_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".torn": Torn})
    with pytest.raises(PluginError, match=r"test_broken_runs.py:[0-9]+: exporter 'Torn' of .* RuntimeError: torn"):
        exported_with_births([tmp_path / "a.torn"])
    assert list(tmp_path.iterdir()) == []


def failing(*_):
    return 1 / 0


@pytest.mark.parametrize("method", ["problems", "beside", "reads"])
def test_an_exporter_of_others_that_fails_before_the_run_is_named(method, monkeypatch):
    torn = type("Torn", (Torn,), {method: classmethod(failing), "__module__": __name__})
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".torn": torn})
    with pytest.raises(PluginError, match=r"test_broken_runs.py:[0-9]+: exporter 'Torn' of .* ZeroDivisionError"):
        check_exports(["a.torn"])


def test_an_exporter_that_needs_a_part_of_a_package_that_is_missing_says_so(monkeypatch):
    torn = type("Torn", (Torn,), {"needs": (("no_such_package.part", "such"),)})
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".torn": torn})
    with pytest.raises(ProblemsError, match=r"^a.torn: this needs the package such: pip install such$"):
        check_exports(["a.torn"])


def test_an_exporter_whose_option_is_another_one_of_this_name_is_named(monkeypatch):
    torn = type("Torn", (Torn,), {"choices": (Option("theme", 1, "mine"),), "__module__": __name__})
    monkeypatch.setattr("flockbrush.output.exporter._registry", exporters() | {".torn": torn})
    with pytest.raises(PluginError, match=r"test_broken_runs.py: two exporters declare --theme differently: .* and "):
        all_options()


def test_a_command_of_others_is_named():
    simulation = flockbrush.start("meadow", 1, 10)
    queue = simulation.world.resource(Commands)
    with pytest.raises(PluginError, match=r"test_broken_runs.py:[0-9]+: command 'Overturn' of .* ZeroDivisionError"):
        queue.perform(simulation.world, [Overturn()])
    simulation.submit(Overturn())
    with pytest.raises(PluginError, match="command 'Overturn'"):
        simulation.tick()


def test_what_is_ours_is_still_a_bug():
    with pytest.raises(ZeroDivisionError), blaming("drive", "flee", "flockbrush.behaviours.drives.flee"):
        print(1 / 0)


def test_a_run_that_is_stopped_keeps_the_earlier_file_of_a_name(tmp_path, capsys):
    old, new = tmp_path / "old.csv", tmp_path / "new.csv"
    old.write_text("mine")
    simulation = flockbrush.start("meadow", 1, 10)
    with pytest.raises(Stopped), Exports([old, new], simulation) as exports:
        exports.take()
        simulation.tick()
        exports.take()
        raise Stopped
    assert old.read_text() == "mine" and new.read_text().splitlines()[-1].startswith("1,")
    assert f"{old} is still the earlier file: the new one is not complete" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.csv", "new.csv.json", "old.csv"]


def exported_with_births(paths):
    """Export a run of 4 ticks with a birth in the third."""
    simulation = flockbrush.start("meadow", 1, 10)
    simulation.world.resource(Commands).submit(AddAnimals("graze", 20.0, 20.0, 5.0, species="sheep"), 3)
    with Exports(paths, simulation, 32) as exports:
        exports.take()
        for _ in range(4):
            simulation.tick()
            exports.take()


def test_a_file_that_fails_in_the_run_is_told_then_and_the_others_are_whole(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(animated_nodes, "MOST", 10)
    with pytest.raises(ProblemsError, match="this run has 11; use --gltf-mode crowd"):
        exported_with_births([tmp_path / "a.glb", tmp_path / "a.csv"])
    assert (tmp_path / "a.csv").read_text().splitlines()[-1].startswith("4,")
    assert f"{tmp_path / 'a.glb'} is left out: --gltf-mode nodes: animated nodes are limited" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.csv.json"]


def test_the_last_file_that_fails_ends_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(animated_nodes, "MOST", 10)
    with pytest.raises(ProblemsError, match="this run has 11"):
        exported_with_births([tmp_path / "a.glb"])
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_fails_at_the_end_takes_no_other_with_it(tmp_path, monkeypatch):
    def fail(self):
        raise OSError("no room")

    monkeypatch.setattr(GltfScene, "finish", fail)
    with pytest.raises(OSError, match="no room"):
        exported_with_births([tmp_path / "a.glb", tmp_path / "a.csv"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.csv.json"]
