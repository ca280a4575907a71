"""Paint of part weight: opacity and soft edges move animals part of the way to the painted brush."""

import numpy as np
import pytest
from flockbrush.behaviours.mixture import STEPS, BrushPath, load_path, mixed, path_to_toml, step_name, steps_between
from flockbrush.components import BrushBinding
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.schema import BrushLayer, PaintBounds, Zone
from flockbrush.systems import palette as palette_module
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import MarkSpawn, Paint
from flockbrush.systems.mark_commands import DrawZone
from flockbrush.systems.palette import Palette
from flockbrush.systems.undo import ForgetBrush, MixBrush, UnmixBrush, UseBrush
from small_herd import box, brush, meadow, put, straight

WALK, RUN = straight("walk", mean=1.0, max_turn=2.0), straight("run", mean=5.0, max_turn=10.0)
TROT = straight("trot", mean=3.0, max_turn=3.0)
FLOCK = brush("flock", "boids", mean=20.0, min_speed=5.0)
MIX = PaintBounds(blend="mix")


def layer(name="run", weight=0.25, bounds=MIX, west=0):
    index = np.full((40, 40), -1)
    index[:, west:] = 0
    return BrushLayer("brush", weight, [name], index, bounds)


def herd(*layers, zones=(), many=400, **more):
    simulation = meadow(WALK, RUN, FLOCK, brush_layers=list(layers), zones=list(zones), **more)
    put(simulation, np.random.default_rng(1).uniform(1, 39, (many, 2)), brush="walk")
    return simulation


def names_of(simulation):
    names = simulation.world.resource(Palette).names
    return np.array([names[k] for k in simulation.agents[BrushBinding.brush]])


def test_half_way_between_two_brushes_numbers_lie_half_way():
    half = mixed(WALK, RUN, 0.5)
    assert (half.params.max_turn, half.speed.mean) == (6.0, 3.0)
    assert mixed(WALK, RUN, 0.0).params == WALK.params and mixed(WALK, RUN, 1.0).speed == RUN.speed


def test_a_path_says_how_far_along_the_line_and_what_is_added():
    path = BrushPath(start="walk", end="run", along=(0, 0.1, 1), detour={"wander": (0, 0.5, 0)})
    half = mixed(WALK, RUN, 0.5, path)
    assert half.speed.mean == pytest.approx(1.4) and half.params.wander == 0.5
    assert mixed(RUN, WALK, 0.5, path.reversed()).speed.mean == pytest.approx(1.4)
    assert load_path(path_to_toml(path).encode(), "walk--run.path.toml") == path


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("along = [0, 0.5]", "'along' must rise from 0 to 1"),
        ("along = [0, 0.6, 0.5, 1]", "must rise from 0 to 1"),
        ("along = [0, 1]\n[detour]\nwander = [0, 1]", "detour.wander must have 2 numbers, 0 at both ends"),
    ],
)
def test_a_path_that_is_none_is_refused(line, said):
    text = f'schema = "flockbrush.path/1"\nstart = "walk"\nend = "run"\n{line}\n'
    with pytest.raises(ProblemsError, match=said):
        load_path(text.encode(), "walk--run.path.toml")


def test_opacity_moves_all_animals_part_of_the_way():
    simulation = herd(layer(weight=0.25))
    simulation.tick()
    assert set(names_of(simulation)) == {step_name("walk", "run", STEPS // 4)}
    assert simulation.world.resource(Palette).brushes[simulation.agents[BrushBinding.brush][0]].speed.mean == 2.0


def test_between_two_steps_as_many_animals_are_a_step_further_as_the_weight_says():
    simulation = herd(layer(weight=(STEPS // 4 + 0.4) / STEPS))
    simulation.tick()
    names, counts = np.unique(names_of(simulation), return_counts=True)
    assert list(names) == [step_name("walk", "run", STEPS // 4), step_name("walk", "run", STEPS // 4 + 1)]
    assert counts[1] / counts.sum() == pytest.approx(0.4, abs=0.08)


def test_share_takes_a_share_of_the_animals_always_the_same_ones():
    simulation = herd(layer(weight=0.3, bounds=PaintBounds(blend="share")), boundary="wall")
    simulation.tick()
    first = names_of(simulation)
    assert (first == "run").mean() == pytest.approx(0.3, abs=0.08) and set(first) == {"walk", "run"}
    simulation.run(40)
    assert (names_of(simulation) == first).all()


def test_a_soft_edge_grows_evenly_inwards_and_is_there_from_outside_too():
    simulation = herd(layer(weight=1.0, bounds=PaintBounds(blend="mix", edge=16.0), west=20), many=0)
    put(simulation, np.column_stack([np.linspace(15, 39.5, 200), np.full(200, 20.0)]), brush="walk")
    simulation.tick()
    palette, x = simulation.world.resource(Palette), np.linspace(15, 39.5, 200)
    mean = np.array([palette.mean[k] for k in simulation.agents[BrushBinding.brush]])
    weight = (mean - 1.0) / 4.0
    np.testing.assert_allclose(weight, np.clip((x - 20) / 16, 0, 1), atol=1.01 / STEPS + 0.02)
    assert (weight[x < 19] == 0).all() and (weight[x > 37] == 1).all()


@pytest.mark.parametrize("shift", [0, 12, 20, 31])
def test_a_soft_edge_goes_on_over_the_border_of_a_wrapped_map(shift):
    band = layer(weight=1.0, bounds=PaintBounds(blend="mix", edge=6.0), west=24)
    band.index = np.roll(band.index, shift, axis=1)
    simulation, places = herd(band, many=0, boundary="wrap"), np.linspace(20.1, 43.9, 150)
    put(simulation, np.column_stack([(places + shift) % 40.0, np.full(150, 20.0)]), brush="walk")
    simulation.tick()
    palette = simulation.world.resource(Palette)
    weight = (np.array([palette.mean[k] for k in simulation.agents[BrushBinding.brush]]) - 1.0) / 4.0
    inwards = np.minimum(places - 24.0, 40.0 - places) / 6.0
    np.testing.assert_allclose(weight, np.clip(inwards, 0.0, 1.0), atol=1.01 / STEPS + 0.1)


def test_a_zone_has_a_strength_and_unlike_models_fall_back_to_a_share():
    bounds = PaintBounds(blend="mix", strength=0.5, medium="any")
    simulation = herd(zones=[Zone(1, "half", box(0, 0, 40, 40), "run", np.inf, 1.0, 0.5, bounds=bounds)])
    simulation.tick()
    assert set(names_of(simulation)) == {step_name("walk", "run", STEPS // 2)}
    simulation = herd(layer("flock", 0.5, bounds))
    assert not (simulation.world.resource(Palette).mixes[0] >= 0).any()
    simulation.tick()
    assert (names_of(simulation) == "flock").mean() == pytest.approx(0.5, abs=0.08)
    assert set(names_of(simulation)) == {"walk", "flock"}


def test_the_uppermost_mixes_with_what_covers_below():
    below = layer("run", 0.4, PaintBounds())
    third = straight("third", mean=9.0)
    index = np.zeros((40, 40), int)
    simulation = meadow(WALK, RUN, third, brush_layers=[below, BrushLayer("brush 2", 0.5, ["third"], index, MIX)])
    put(simulation, (20, 20), brush="walk")
    simulation.tick()
    assert list(names_of(simulation)) == [step_name("run", "third", STEPS // 2)]


def test_tuning_a_brush_and_taking_it_back_reaches_the_brushes_between():
    simulation = herd(layer(weight=0.5), many=3)
    simulation.tick()
    palette = simulation.world.resource(Palette)
    middle = palette.index[step_name("walk", "run", STEPS // 2)]
    before = state_hash(simulation.world)
    queue = simulation.world.resource(Commands)
    back = queue.perform(simulation.world, [SetParameter("run", "max_turn", 4.0)])
    assert palette.max_turn[middle] == 3.0
    queue.perform(simulation.world, back)
    assert palette.max_turn[middle] == 6.0 and state_hash(simulation.world) == before


def test_a_new_brush_is_mixed_too_and_can_be_forgotten():
    simulation = herd(layer(weight=0.5), many=1)
    palette, queue = simulation.world.resource(Palette), simulation.world.resource(Commands)
    count = len(palette)
    back = queue.perform(simulation.world, [UseBrush("trot", straight("trot", mean=3.0).source.decode())])
    assert palette.mixes[palette.named("trot"), palette.named("run")] >= 0 and len(palette) == count + STEPS
    assert [type(one) for one in back] == [ForgetBrush]
    queue.perform(simulation.world, back)
    assert len(palette) == count and palette.names == list(palette.index)


def zone(strength, **more):
    return DrawZone(9, "pen", box(0, 0, 40, 40).tolist(), "run", strength=strength, medium="any", **more)


def test_a_zone_of_a_running_world_mixes_once_it_has_the_brushes_between():
    simulation = herd(many=20)
    palette, queue = simulation.world.resource(Palette), simulation.world.resource(Commands)
    before, count = state_hash(simulation.world), len(palette)
    back = queue.perform(simulation.world, [MixBrush("run", {}), zone(0.5)])
    assert len(palette) == count + STEPS - 1  # walk to run; flock is of another model
    again = queue.perform(simulation.world, back)
    assert len(palette) == count and state_hash(simulation.world) == before
    queue.perform(simulation.world, again)
    simulation.tick()
    assert set(names_of(simulation)) == {step_name("walk", "run", STEPS // 2)}
    back = queue.perform(simulation.world, [zone(0.25)])
    simulation.tick()
    assert set(names_of(simulation)) == {step_name("walk", "run", STEPS // 4)}
    queue.perform(simulation.world, back)
    simulation.tick()
    assert set(names_of(simulation)) == {step_name("walk", "run", STEPS // 2)}
    queue.perform(simulation.world, [UnmixBrush("run", [])])
    assert "run" in palette.over  # animals and the zone still have them


def test_a_live_mix_goes_on_from_its_state_by_its_measured_path():
    path = BrushPath(start="walk", end="run", along=(0, 0.1, 1))
    one, two = herd(many=30), herd(many=30)
    steps = [MixBrush("run", {"walk--run.path.toml": path_to_toml(path)}), zone(0.5, edge=8.0)]
    for _ in range(3):  # done, undone and done again
        steps = one.world.resource(Commands).perform(one.world, steps)
    one.run(8)
    palette, saved = two.world.resource(Palette), snapshot(one.world)
    restore(two.world, saved)
    assert palette.mean[palette.named(step_name("walk", "run", STEPS // 2))] == pytest.approx(1.4)
    for world in (one.world, two.world):  # what comes later is mixed on the same path
        world.resource(Commands).perform(world, [SetParameter("run", "max_turn", 4.0)])
    one.run(8)
    two.run(8)
    assert state_hash(one.world) == state_hash(two.world)
    restore(two.world, snapshot(herd(many=30).world))
    assert palette.over == () and (palette.mixes < 0).all()


@pytest.mark.parametrize("order", [("run", "walk"), ("walk", "run")])
def test_of_two_paths_between_brushes_each_way_has_that_which_is_named_so(order):
    simulation = herd(many=1)
    there = BrushPath(start="walk", end="run", along=(0, 0.1, 1))
    back = BrushPath(start="run", end="walk", along=(0, 0.4, 1))
    files = {"run": {"walk--run.path.toml": path_to_toml(there)}, "walk": {"run--walk.path.toml": path_to_toml(back)}}
    simulation.world.resource(Commands).perform(simulation.world, [MixBrush(name, files[name]) for name in order])
    paths = simulation.world.resource(Palette).paths
    assert (paths["walk", "run"], paths["run", "walk"]) == (there, back)


def test_brushes_between_outlive_an_older_brush_that_is_forgotten():
    simulation = herd(many=1)
    palette, queue = simulation.world.resource(Palette), simulation.world.resource(Commands)
    back = queue.perform(simulation.world, [UseBrush("trot", straight("trot", mean=3.0).source.decode())])
    queue.perform(simulation.world, [MixBrush("run", {})])
    queue.perform(simulation.world, back)
    assert "trot" not in palette.index and palette.mixes[palette.named("walk"), palette.named("run")] >= 0


HERE = BrushPath(start="walk", end="run", along=(0, 0.5, 1), detour={"max_turn": (0, -50, 0), "wander": (0, -1, 0)})
DETOUR = HERE.model_copy(update={"end_sha256": 64 * "0"})  # measured with another brush


def refusing(start, end, path):
    """A model that refuses the numbers between two brushes."""
    if path is not None or {start.params.max_turn, end.params.max_turn} != {2.0, 10.0}:
        raise ValueError("max_turn must be 10")
    return steps_between(start, end, path)


def test_a_mix_that_cannot_be_says_why_and_changes_nothing(monkeypatch):
    simulation = herd(many=1)
    queue, before = simulation.world.resource(Commands), state_hash(simulation.world)
    own = {brush.name: brush.sha256 for brush in simulation.world.resource(Palette).own}
    digests = {"start_sha256": own["walk"], "end_sha256": own["run"]}
    for command, said in (
        (MixBrush("rnu", {}), "no brush 'rnu'"),
        (MixBrush("run", {"a--b.path.toml": "schema = 3"}), "a--b.path.toml"),
        (MixBrush("run", {"walk--rnu.path.toml": path_to_toml(DETOUR)}), "walk--rnu.path.toml:3: end: the file of a"),
        (MixBrush("flock", {"walk--run.path.toml": path_to_toml(DETOUR)}), "neither begins nor ends at 'flock'"),
        (
            MixBrush("run", {"walk--run.path.toml": path_to_toml(HERE.model_copy(update=digests))}),
            "walk--run.path.toml:15: detour.max_turn.1.: mak",
        ),
        (MixBrush("run", {"walk--run.path.toml": path_to_toml(DETOUR)}), "max_turn must be 10"),
    ):
        monkeypatch.setattr(palette_module, "steps_between", refusing)
        with pytest.raises(ValueError, match=said):
            queue.perform(simulation.world, [command])
        assert state_hash(simulation.world) == before and simulation.world.resource(Palette).path_files == {}


@pytest.mark.parametrize("command", [SetParameter("run", "max_turn", 4.0), UseBrush("trot", TROT.source.decode())])
def test_a_brush_that_cannot_be_mixed_leaves_the_palette_as_it_was(monkeypatch, command):
    simulation = herd(layer(weight=0.5), many=1)
    palette, queue = simulation.world.resource(Palette), simulation.world.resource(Commands)
    before, brushes, hash = palette.state(), list(palette.brushes), state_hash(simulation.world)
    monkeypatch.setattr(palette_module, "steps_between", refusing)
    with pytest.raises(CommandError, match="max_turn must be 10"):
        queue.perform(simulation.world, [command])
    assert palette.state() == before and state_hash(simulation.world) == hash
    assert palette.names == list(palette.index) and palette.brushes == brushes


def test_a_detour_measured_with_another_brush_stays_within_the_bounds():
    simulation = herd(layer(weight=0.5), many=1)
    palette, queue = simulation.world.resource(Palette), simulation.world.resource(Commands)
    queue.perform(simulation.world, [MixBrush("run", {"walk--run.path.toml": path_to_toml(DETOUR)})])
    half = palette.brushes[palette.named(step_name("walk", "run", STEPS // 2))]
    assert (half.params.max_turn, half.params.wander) == (0.1, 0.0)
    queue.perform(simulation.world, [SetParameter("run", "max_turn", 4.0)])


@pytest.mark.parametrize(
    "command",
    [
        Paint("brush", step_name("walk", "run", 6), 5.0, 5.0, 9.0, 9.0, 2.0),
        DrawZone(9, "pen", box(0, 0, 9, 9).tolist(), step_name("walk", "run", 6)),
        MarkSpawn(9, "herd", box(0, 0, 9, 9).tolist(), step_name("walk", "run", 6), count=2),
    ],
    ids=["paint", "zone", "spawn"],
)
def test_a_level_is_given_no_brush_between_two_for_it_is_in_no_file(command):
    simulation = herd(layer(), many=20)
    palette = simulation.world.resource(Palette)
    middle = palette.named(step_name("walk", "run", 6))
    ends = [palette.end(k) for k in (middle, palette.named("walk"))]
    assert [palette.names[k] for k in ends] == ["run", "walk"]
    with pytest.raises(CommandError, match="no brush 'walk--run--6of12'; it has flock, run, walk"):
        simulation.world.resource(Commands).perform(simulation.world, [command])
