"""What may be done to a running world: each command does what it says, and refuses before it changes anything."""

import typing

import numpy as np
import pytest
from edited_scene import land_of
from flockbrush.components import Body, BrushBinding, Destination, Heading, Position, Species, Vision
from flockbrush.engine.commands import COMMANDS, CommandError, Commands, from_record
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.state import state_hash
from flockbrush.levels.schema import Goal, Key
from flockbrush.systems.animal_commands import disc
from flockbrush.systems.commands import (
    AddAnimals,
    AddObstacle,
    MoveGoal,
    PaintBrush,
    PaintCap,
    RemoveAnimals,
    RemoveObstacle,
    SendTo,
    SetParameter,
    SwitchBrush,
)
from flockbrush.systems.life import inside_polygon
from flockbrush.systems.palette import Palette
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, brush, gaps_of, meadow, obstacle, put, straight, wall_gaps, xy_of

CALM = straight("calm", mean=0.0)
RUN = brush("run", mean=3.0, cohesion_weight=0.2)


def scene(**things):
    goals = [Goal(k, name, np.array(xy, float), 1.0, "stay", "") for k, (name, xy) in enumerate(GOALS.items())]
    simulation = meadow(CALM, RUN, goals=goals, obstacles=[obstacle(box(30, 30, 33, 33), "barn")], **things)
    put(simulation, [(10, 10), (12, 10), (20, 10)], 0.0, brush="calm", species="sheep")
    put(simulation, [(10, 14)], 0.0, brush="calm", species="dog")
    return simulation


GOALS = {"gate": (35, 5), "well": (5, 35)}


def do(simulation, *commands):
    for command in commands:
        simulation.submit(command)
    simulation.tick()
    return simulation


# what they do -----------------------------------------------------------------------------


def test_switching_gives_animals_another_brush_of_their_own():
    homes = lambda s: s.agents[BrushBinding.home].tolist()  # noqa: E731
    assert homes(do(scene(), SwitchBrush("run"))) == [1, 1, 1, 1]
    assert homes(do(scene(), SwitchBrush("run", species="dog"))) == [0, 0, 0, 1]
    assert homes(do(scene(), SwitchBrush("run", x=11.0, y=10.0, radius=2.0))) == [1, 1, 0, 0]
    assert homes(do(scene(), SwitchBrush("run", "sheep", 10.0, 12.0, 2.5))) == [1, 0, 0, 0]
    assert do(scene(), SwitchBrush("run")).agents[BrushBinding.brush].tolist() == [1, 1, 1, 1]


def test_painting_paints_a_disc_and_an_empty_name_erases():
    simulation = do(scene(), PaintBrush("run", 11.0, 10.0, 2.0))
    painted = land_of(simulation).brush
    y, x = np.nonzero(painted == 1)
    assert (np.hypot(x + 0.5 - 11, y + 0.5 - 10) <= 2.0).all()
    assert len(x) == 12  # cell centres within 2 m
    assert simulation.agents[BrushBinding.brush].tolist() == [1, 1, 0, 0]
    do(simulation, PaintBrush("", 11.0, 10.0, 3.0))
    assert (land_of(simulation).brush == -1).all()


def test_painting_off_the_map_paints_nothing_and_at_the_edge_what_there_is():
    simulation = do(scene(), PaintBrush("run", -50.0, 10.0, 5.0), PaintBrush("run", 0.0, 0.0, 1.6))
    assert (land_of(simulation).brush == 1).sum() == 3


def test_a_cap_is_painted_and_erased():
    simulation = do(scene(), PaintCap(0.5, 10.0, 10.0, 3.0))
    assert (
        np.isfinite(land_of(simulation).surface[..., 1]).sum()
        == (land_of(simulation).surface[..., 1] == 0.5).sum()
        > 20
    )
    do(simulation, PaintCap(0.0, 10.0, 10.0, 3.0))
    assert np.isinf(land_of(simulation).surface[..., 1]).all()


def test_an_obstacle_off_the_map_is_refused_as_in_a_level():
    with pytest.raises(CommandError, match="the obstacle is not on the map"):
        do(scene(), AddObstacle("wall", [[-9.0, 5.0], [-3.0, 5.0], [-3.0, 30.0]]))


def test_an_obstacle_comes_and_goes():
    simulation = do(scene(), AddObstacle("wall", [[16.0, 5.0], [17.0, 5.0], [17.0, 30.0], [16.0, 30.0]]))
    assert len(land_of(simulation).barriers) == 2
    assert land_of(simulation).blocked[10, 16]
    do(simulation, SwitchBrush("run"))
    for _ in range(60):
        simulation.tick()
        assert not inside_polygon(xy_of(simulation), box(16, 5, 17, 30)).any()
    do(simulation, RemoveObstacle("wall"))
    assert not land_of(simulation).blocked[10, 16]
    assert [b.name for b in land_of(simulation).barriers] == ["barn"]


@pytest.mark.parametrize("clockwise", [False, True])
def test_animals_on_the_spot_step_aside_and_touch_nobody(clockwise):
    simulation = scene()
    put(simulation, [(20 + 1.2 * i, 20 + 1.2 * j) for i in range(4) for j in range(4)], 0.6)
    before = xy_of(simulation)
    rock = box(19, 18.5, 24.5, 24)
    do(simulation, AddObstacle("rock", (rock[::-1] if clockwise else rock).tolist()))
    xy, agents = xy_of(simulation), simulation.agents
    edges = np.hstack([rock, np.roll(rock, -1, axis=0)])
    forward = agents[Heading.forward]
    assert wall_gaps(xy, forward, agents[Body.axis], agents[Body.radius], edges).min() > -1e-6
    assert not inside_polygon(xy, rock).any()
    assert gaps_of(simulation).min() > -1e-6
    assert np.hypot(*(xy - before).T).max() < 8
    assert np.hypot(*(xy - before).T)[:4].max() < 0.1  # the others stay where they are


def test_those_who_only_touch_a_new_wall_step_aside_too():
    simulation = scene()
    (entity,) = put(simulation, [(20, 20)], 0.0)
    wall = box(20.3, 15, 20.4, 25)  # through the head
    do(simulation, AddObstacle("wall", wall.tolist()))
    xy = simulation.world.component_for_entity(entity, Position).xyz
    assert xy[0] < 20.3 - 0.5 + 0.3 or xy[0] > 20.4  # its whole body stands on one side
    edges = np.hstack([wall, np.roll(wall, -1, axis=0)])
    agents = simulation.agents
    row = [agents.row(entity)]
    gap = wall_gaps(
        xy_of(simulation)[row], agents[Heading.forward][row], agents[Body.axis][row], agents[Body.radius][row], edges
    )
    assert gap.min() > -1e-6


def test_a_view_block_that_is_not_solid_moves_nobody():
    simulation = scene()
    before = xy_of(simulation)
    do(simulation, AddObstacle("mist", box(9, 9, 13, 15).tolist(), solid=False))
    assert np.abs(xy_of(simulation) - before).max() < 0.2
    assert len(land_of(simulation).opaque.ends) == 8
    assert len(land_of(simulation).solid.ends) == 4


def test_goals_move_and_animals_are_sent():
    simulation = do(
        scene(), MoveGoal("gate", 20.0, 35.0), SendTo("well", "dog"), SendTo("", x=20.0, y=10.0, radius=1.0)
    )
    assert land_of(simulation).goals[0].xy.tolist() == [20.0, 35.0]
    assert simulation.agents[Destination.goal].tolist() == [0, 0, -1, 1]
    assert land_of(simulation).navigation.times[0][35, 20] == 0.0


def test_animals_are_added_and_removed():
    simulation = do(scene(), AddAnimals("run", 30.0, 20.0, 5.0, 7, "cow", heading=1.0))
    assert len(simulation.agents) == 11
    cows = simulation.agents[Species.index] == 3
    assert cows.sum() == 7
    assert np.hypot(*(xy_of(simulation)[cows] - (30, 20)).T).max() < 5.2
    assert simulation.agents[BrushBinding.brush][cows].tolist() == [1] * 7
    assert simulation.agents[Vision.range][cows].tolist() == [4.0] * 7
    do(simulation, RemoveAnimals(30.0, 20.0, 20.0, "cow"))
    assert len(simulation.agents) == 4
    do(simulation, RemoveAnimals(0.0, 0.0, 0.0))
    assert len(simulation.agents) == 0
    simulation.run(3)


def test_two_strokes_in_one_tick_on_one_place_are_two_herds():
    simulation = scene()
    noisy = AddAnimals("run", 30.0, 15.0, 6.0, 5)
    do(simulation, noisy, noisy)
    assert len(simulation.agents) == 14
    assert gaps_of(simulation).min() > -1e-6
    headings = simulation.agents[Heading.forward][4:, 0]
    assert len(set(headings.round(9).tolist())) == 10


def test_a_parameter_is_set_in_the_running_world():
    simulation = do(scene(), SetParameter("run", "cohesion_weight", 0.9), SetParameter("run", "leader_neighbours", 5.0))
    palette = simulation.world.resource(Palette)
    assert palette.brushes[1].params.cohesion_weight == 0.9
    assert palette.brushes[1].params.leader_neighbours == 5
    assert palette.leader_neighbours.tolist() == [2, 5]
    assert RUN.params.cohesion_weight == 0.2  # the asset itself is as it was


def test_a_disc_is_round():
    assert np.hypot(*(disc(3.0, -2.0, 5.0) - (3, -2)).T) == pytest.approx(np.full(32, 5.0))


# what they refuse --------------------------------------------------------------------------------

BAD = [
    (SwitchBrush("rnu"), "no brush 'rnu'; it has calm, run"),
    (SwitchBrush("run", radius=-1.0), "radius must be at least 0 m, got -1"),
    (SwitchBrush("run", species="shep"), "no species 'shep'; did you mean 'sheep'"),
    (PaintBrush("nothing", 1.0, 1.0, 1.0), "no brush 'nothing'"),
    (PaintBrush("run", 1.0, 1.0, -2.0), "radius must be at least 0 m"),
    (PaintCap(1.0, 1.0, 1.0, -2.0), "radius must be at least 0 m"),
    (AddObstacle("line", [[0.0, 0.0], [1.0, 1.0]]), "3 to 2000 points, got 2"),
    (AddObstacle("line", [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), "lie in one line"),
    (AddObstacle("odd", [[0.0, 0.0], [1.0], [2.0, 2.0]]), "must be pairs of numbers"),
    (AddObstacle("odd", ["here", "there", "everywhere"]), "must be pairs of numbers"),
    (AddObstacle("all", box(-1, -1, 41, 41).tolist()), "has no room to step aside"),
    (RemoveObstacle("born"), "no obstacle 'born'; did you mean 'barn'"),
    (MoveGoal("gaet", 1.0, 1.0), "no goal 'gaet'; did you mean 'gate'"),
    (MoveGoal("gate", -1.0, 1.0), "not on the map, which is 40 x 40 m"),
    (SendTo("wel"), "no goal 'wel'; did you mean 'well'"),
    (SendTo("gate", radius=-1.0), "radius must be at least 0 m"),
    (AddAnimals("run", 10.0, 10.0, -1.0), "radius must be above 0 m"),
    (AddAnimals("cat", 10.0, 10.0, 1.0), "no brush 'cat'"),
    (AddAnimals("run", 10.0, 10.0, 1.0, 0), "count must be 1 to 1000000, got 0"),
    (AddAnimals("run", 10.0, 10.0, 1.0, 10**7), "count must be 1 to 1000000"),
    (AddAnimals("run", 25.0, 10.0, 1.0, 500, "cow"), "of 500 animals fit"),
    (AddAnimals("run", 10.0, 10.0, 1.0, species=""), "a species needs a name"),
    (AddAnimals("run", -30.0, -30.0, 2.0), "only 0 of 1 animals fit"),
    (RemoveAnimals(1.0, 1.0, -1.0), "radius must be at least 0 m"),
    (RemoveAnimals(1.0, 1.0, 1.0, "cow"), "no species 'cow'"),
    (SetParameter("run", "cohesion", 0.1), "cohesion"),
    (SetParameter("run", "cohesion_weight", 2.0), "cohesion_weight"),
    (SetParameter("run", "leader_neighbours", 2.5), "leader_neighbours"),
    (SetParameter("cat", "cohesion_weight", 0.2), "no brush 'cat'"),
]


@pytest.mark.parametrize(("command", "reason"), BAD, ids=lambda value: str(value)[:60])
def test_what_cannot_be_done_says_why_and_leaves_the_world_as_it_was(command, reason):
    simulation = scene(boundary="wall")
    simulation.run(3)
    before, queue = state_hash(simulation.world), simulation.world.resource(Commands)
    simulation.submit(command)
    with pytest.raises(CommandError) as caught:
        simulation.tick()
    assert reason in str(caught.value)
    assert str(caught.value).startswith(f"tick 3: {type(command).__name__}(")
    assert len(str(caught.value)) < 500
    assert caught.value.command == command
    assert state_hash(simulation.world) == before
    assert queue.log == []  # a replay does not do it again
    assert len(land_of(simulation).barriers) == 1
    assert len(simulation.agents) == 4
    simulation.run(2)  # and the world goes on


def test_after_a_refusal_the_commands_behind_it_are_still_done():
    simulation = scene()
    simulation.submit(SwitchBrush("nobody"))
    simulation.submit(SwitchBrush("run"))
    with pytest.raises(CommandError):
        simulation.tick()
    simulation.tick()
    assert simulation.agents[BrushBinding.home].tolist() == [1, 1, 1, 1]
    assert simulation.clock.tick == 1
    assert simulation.world.resource(Commands).log == [(0, SwitchBrush("run"))]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "far", None, True])
def test_what_is_no_number_is_refused_when_it_is_handed_in(value):
    simulation = scene()
    with pytest.raises(ValueError):
        simulation.submit(PaintBrush("run", value, 1.0, 1.0))
    with pytest.raises(ValueError):
        simulation.submit(AddObstacle("nan", [[0.0, 0.0], [float("nan"), 1.0], [2.0, 0.0]]))
    assert simulation.world.resource(Commands).pending == []


COMMAND_FILES = "commands", "animal_commands", "obstacle_commands", "paint_commands"
THEIRS = {f"flockbrush.systems.{name}" for name in COMMAND_FILES}

number = st.one_of(st.floats(-60, 60), st.sampled_from([0.0, -1.0, 1e9]))


@given(st.sampled_from(sorted(name for name, kind in COMMANDS.items() if kind.__module__ in THEIRS)), st.data())
def test_whatever_is_asked_is_done_or_refused_and_nothing_else_happens(name, data):
    simulation = SHARED[0] if SHARED else SHARED.append(scene(boundary="wall")) or SHARED[0]
    words = st.sampled_from(["run", "calm", "", "sheep", "gate", "barn", "cohesion_weight", "?"])
    makers = {float: number, int: st.integers(-3, 30), str: words, bool: st.booleans()}
    makers[str | float] = words | number
    makers[str | None] = st.none() | st.sampled_from(["box", "sphere", "plane", "cone", "hull"])
    corner = st.lists(st.sampled_from([-4.0, 0.0, 3.0, "up", None, 1e9]), min_size=2, max_size=3)
    pyramid = [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 5.0]]
    makers[list | None] = st.none() | st.just(pyramid) | st.lists(corner, max_size=6)
    makers[list] = st.lists(st.lists(number, min_size=1, max_size=3), max_size=5)
    hints = typing.get_type_hints(COMMANDS[name])
    values = {field: data.draw(makers.get(hint, st.one_of(st.none(), number))) for field, hint in hints.items()}
    before = state_hash(simulation.world)
    simulation.submit(from_record(name, values), simulation.clock.tick)
    try:
        simulation.world.resource(Commands).apply(simulation.world)
    except CommandError:
        assert state_hash(simulation.world) == before
    for column in (Position.xyz, Heading.forward):
        assert np.isfinite(simulation.agents[column]).all()
    if len(simulation.agents) < 300:
        simulation.tick()
    else:
        SHARED.clear()


SHARED = []


# from a level's script -------------------------------------------------------------------------------


def key(command, at=1.0, id=7, **args):
    return Key(id, "cue", at, command, args, np.zeros(2))


def test_a_script_is_done_at_its_time():
    simulation = scene(
        script=[
            key("SwitchBrush", 0.5, brush="run"),
            key("AddAnimals", 1.0, brush="run", x=30, y=20, radius=4, count=3),
        ]
    )
    simulation.run(16)
    assert simulation.agents[BrushBinding.home].tolist() == [0] * 4
    simulation.run(1)
    assert simulation.agents[BrushBinding.home].tolist() == [1] * 4
    simulation.run(16)
    assert len(simulation.agents) == 7


def test_all_that_is_wrong_with_a_script_is_said_before_the_run():
    script = [
        key("SwitchBursh", id=1, brush="run"),
        key("SwitchBrush", id=2, brush="run", radius=-3.0),
        key("SendTo", id=3, goal="nowhere"),
        key("AddObstacle", id=4, name="x", points=[[0.0, 0.0], [1.0, 1.0]]),
        key("PaintBrush", id=5, brush="run", x="left", y=1.0, radius=1.0),
        key("SetParameter", id=6, brush="run", name="cohesion_wieght", value=0.2),
        key("SwitchBrush", id=8, brush="run"),
    ]
    with pytest.raises(ProblemsError) as caught:
        scene(script=script)
    lines = str(caught.value).splitlines()
    assert len(lines) == 6
    assert lines[0] == (
        "test.tmj: object 1 'cue' in layer 'script': unknown command 'SwitchBursh'; did you mean 'SwitchBrush'?"
    )
    for line, word in zip(
        lines, ("SwitchBursh", "radius", "nowhere", "points", "number", "cohesion_wieght"), strict=True
    ):
        assert word in line
