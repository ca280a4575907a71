"""From a level to a running world: all that is named gets there, in any number of animals, or is refused clearly."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import Body, BrushBinding, Destination, Ground, Heading, Position, Species, Speed, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands
from flockbrush.engine.noise import Noise
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.raster import Raster
from flockbrush.engine.state import state_hash
from flockbrush.levels.art import Art, ArtLayer
from flockbrush.levels.build import DT, brushes_used, build, herds_apart, plane, systems
from flockbrush.levels.reader import read_level
from flockbrush.levels.scaling import scaled
from flockbrush.levels.schema import Area, BrushLayer, Exit, Goal, Guide, Key, Line, Zone
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from small_herd import Shelf, box, brush, level, obstacle, spawn, straight, xy_of
from small_program import two_states

from flockbrush import levels

WALK, RUN = straight("walk", mean=2.0), brush("run", mean=3.0, speed={"deviation": 0.3})
SHELF = Shelf(WALK, RUN)


def made(*spawns, seed=None, agents=None, **things):
    return build(level(spawns=list(spawns), **things), seed, agents, SHELF)


def key(command, id=7, **args):
    return Key(id, "cue", 1.0, command, args, np.zeros(2))


# what a spawn says --------------------------------------------------------------------------


def test_animals_are_born_as_their_spawn_says():
    simulation = made(
        spawn(box(2, 2, 12, 12), "walk", 5, np.pi / 2, "sheep", 1, speed=1.5, altitude=3.0, body_length=0.5),
        spawn(box(20, 20, 38, 38), "run", 7, 0.0, "dog", 2),
    )
    agents = simulation.agents
    assert agents[Species.index].tolist() == [0] * 5 + [1] * 7
    assert agents[BrushBinding.home].tolist() == [1] * 5 + [0] * 7  # brushes in order of name
    lengths = agents[Body.length]
    spread = np.repeat([shipped_species().get(name).spread.size for name in ("sheep", "dog")], [5, 7])
    assert (np.abs(np.log(lengths / ([0.5] * 5 + [1.0] * 7))) <= 3.0 * spread).all()  # each its own size
    assert len(set(lengths[:5])) == 5
    assert agents[Body.radius] / lengths == pytest.approx([0.2] * 5 + [0.18] * 7)  # a sheep, a dog
    assert agents[Heading.forward][:5, 1] == pytest.approx(np.ones(5))
    assert agents[Speed.drawn][:5] == pytest.approx(np.full(5, 1.5))
    assert agents[Position.xyz][:, 2].tolist() == [3.0] * 5 + [0.0] * 7
    assert agents[Velocity.xyz] == pytest.approx(agents[Heading.forward] * agents[Speed.drawn][:, None])
    drawn = agents[Speed.drawn][5:]
    assert drawn.std() > 0.02  # each its own, about the mean
    assert abs(drawn.mean() - 3.0) < 0.5


def test_a_body_is_as_slender_as_the_brush_says_and_a_disc_has_no_axis():
    disc = brush("disc", body={"length": 1.0, "radius": 0.25, "contact": "disc"})
    simulation = build(level(spawns=[spawn(box(2, 2, 30, 30), "disc", 3, body_length=2.0)]), library=Shelf(disc))
    assert simulation.agents[Body.axis].tolist() == [0.0] * 3
    assert simulation.agents[Body.radius].tolist() == [0.5] * 3
    assert simulation.agents[Body.length].tolist() == [2.0] * 3


def test_everybody_is_bound_to_the_first_goal_if_there_is_one():
    goal = Goal(1, "g", np.array([5.0, 5.0]), 1.0, "stay", "")
    assert made(spawn(box(9, 9, 20, 20), "walk", 3)).agents[Destination.goal].tolist() == [-1] * 3
    assert made(spawn(box(9, 9, 20, 20), "walk", 3), goals=[goal]).agents[Destination.goal].tolist() == [0] * 3


def test_animals_stand_on_the_ground_of_a_hilly_level():
    y, x = np.mgrid[0.5:40, 0.5:40]
    hills = Raster(1.0, 0.3 * x + np.sin(y / 4))
    simulation = made(spawn(box(5, 5, 35, 35), "walk", 30, None), height_map=hills)
    xyz = simulation.agents[Position.xyz]
    assert xyz[:, 2] == pytest.approx(hills.sample(xyz[:, :2]))
    simulation.tick()
    assert simulation.agents[Ground.slope][:, 0] == pytest.approx(np.full(30, 0.3), abs=1e-9)


# resources ------------------------------------------------------------------------------------


def test_the_world_has_what_the_systems_ask_for():
    simulation = made(spawn(box(9, 9, 20, 20), "walk", 3), seed=99)
    world = simulation.world
    assert world.resource(Noise).seed == 99
    assert world.resource(Clock).dt == DT == 1 / 32
    assert world.resource(Palette).names == ["walk"]
    assert [type(s).__name__ for s in simulation.schedule.systems] == [type(s).__name__ for s in systems()]
    assert set(simulation.schedule.nanoseconds) == {type(s).__name__ for s in systems()} | {"flush"}
    simulation.tick()
    assert simulation.clock.tick == 1
    assert simulation.clock.now == 1 / 32


@pytest.mark.parametrize("seed", [-1, 2**63, 1.5, "1"])
def test_a_seed_that_no_recording_could_keep_is_refused(seed):
    with pytest.raises((ValueError, TypeError)):
        made(spawn(box(9, 9, 20, 20), "walk", 3), seed=seed)


def test_the_seed_of_the_level_counts_unless_another_is_given():
    area = spawn(box(9, 9, 30, 30), "run", 6, None)
    assert state_hash(made(area, seed=1).world) == state_hash(made(area).world)
    assert state_hash(made(area, seed=2).world) != state_hash(made(area).world)


def test_every_brush_that_is_named_is_in_the_palette():
    layer = BrushLayer("brush", 1.0, ["a", "b"], np.full((40, 40), -1, np.int16))
    zones = [Zone(k, "z", box(1, 1, 2, 2), name, np.inf, 1.0, 0.5) for k, name in enumerate(("c", None))]
    ground = level(
        spawns=[spawn(box(1, 1, 9, 9), "d", 1)], brush_layers=[layer], zones=zones,
        script=[key("SwitchBrush", brush="e"), key("PaintBrush", brush="", x=1, y=1, radius=1)],
    )  # fmt: skip
    assert brushes_used(ground) == ["a", "b", "c", "d", "e"]


def test_what_stands_above_the_ground_is_no_obstacle_to_walkers():
    bridge = obstacle(box(10, 10, 12, 30))
    bridge.z_min = 3.0
    assert len(made(spawn(box(1, 1, 9, 9), "walk", 1), obstacles=[bridge]).world.resource(Landscape).barriers) == 0


def test_a_script_is_queued_for_the_tick_at_or_after_its_time():
    ground = level(spawns=[spawn(box(1, 1, 9, 9), "walk", 1)], script=[key("SwitchBrush", brush="run")])
    ground.script[0].at = 1.01
    (entry,) = build(ground, library=SHELF).world.resource(Commands).pending
    assert entry[0] == 33  # 32.32 ticks


def timed(*keys):
    """A script of these keys, half a second apart, the last one first in the file."""
    for k, one in enumerate(keys):
        one.at, one.id = 0.1 + 0.5 * k, 7 + k
        one.args |= {"id": 77} if one.command == "PlaceGoal" else {}
    return list(reversed(keys))


SQUARE = [[20.0, 20.0], [22.0, 20.0], [22.0, 22.0], [20.0, 22.0]]
GATE = {"name": "gate", "points": SQUARE}
PLACE = {"name": "there", "x": 9.0, "y": 9.0}
COME = {"brush": "walk", "x": 30.0, "y": 30.0, "radius": 4.0, "species": "goat"}
NEW_BRUSH = {"name": "new", "source": shipped().get("march").source.decode()}
PROGRAM = {"name": "small", "source": two_states('{ event = "go" }').source.decode()}


@pytest.mark.parametrize(
    "keys",
    [
        (key("AddObstacle", **GATE), key("MoveObstacle", name="gate", x=25.0, y=25.0)),
        (key("AddObstacle", **GATE), key("RemoveObstacle", name="gate")),
        (key("PlaceGoal", **PLACE), key("SendTo", goal="there")),
        (key("PlaceGoal", **PLACE), key("MoveGoal", goal="there", x=5.0, y=5.0)),
        (key("AddAnimals", **COME), key("RemoveAnimals", species="goat", x=0.0, y=0.0, radius=0.0)),
        (key("UseProgram", **PROGRAM), key("GiveProgram", program="small")),
        (key("UseProgram", **PROGRAM), key("Event", name="go")),
    ],
)
def test_a_key_may_be_about_what_an_earlier_one_brings(keys):
    animals = [spawn(box(1, 1, 9, 9), "walk", 3)]
    simulation = build(level(spawns=animals, script=timed(*keys)), library=SHELF)
    land = simulation.world.resource(Landscape)
    assert not land.obstacles and not land.goals and simulation.world.resource(SpeciesList).names == ["animal"]
    simulation.run(24)
    simulation.close()
    with pytest.raises(ProblemsError, match="there is no (obsta|goal|species)|no program"):
        build(level(spawns=animals, script=timed(*reversed(keys))), library=SHELF)


def test_a_key_may_name_a_brush_that_an_earlier_one_brings():
    animals, use = [spawn(box(1, 1, 9, 9), "walk", 3)], key("UseBrush", **NEW_BRUSH)
    come = key("AddAnimals", **COME | {"brush": "new"})
    for script in (timed(use, come), timed(use, key("MixBrush", name="new", paths={}))):
        simulation = build(level(spawns=animals, script=script), library=SHELF)
        assert simulation.world.resource(Palette).names == ["walk"]
        simulation.run(24)
        assert "new" in simulation.world.resource(Palette).names
        simulation.close()
    assert brushes_used(level(spawns=animals, script=timed(come, use))) == ["new", "walk"]


@pytest.mark.parametrize("last", ["MoveObstacle", "RemoveObstacle"])
def test_a_key_about_what_is_gone_by_then_is_refused(last):
    there = {"x": 25.0, "y": 25.0} if last == "MoveObstacle" else {}
    script = timed(key("AddObstacle", **GATE), key("RemoveObstacle", name="gate"), key(last, name="gate", **there))
    with pytest.raises(ProblemsError, match="object 9 'cue' in layer 'script': there is no obstacle 'gate'"):
        build(level(spawns=[spawn(box(1, 1, 9, 9), "walk", 3)], script=script), library=SHELF)


def test_a_key_with_a_number_that_no_recording_could_keep_is_refused():
    script = timed(key("PaintBrush", brush="run", x=1e16, y=1.0, radius=1.0))
    with pytest.raises(ProblemsError, match=r"'cue' in layer 'script': PaintBrush.x must be within ±1e\+15"):
        build(level(spawns=[spawn(box(1, 1, 9, 9), "walk", 3)], script=script), library=SHELF)


def test_all_spawns_that_do_not_fit_are_named_at_once():
    small = [spawn(box(5, 5, 6, 6), "walk", 50, id=4, name="a"), spawn(box(9, 9, 10, 10), "walk", 60, id=5, name="b")]
    with pytest.raises(ProblemsError) as caught:
        made(*small)
    first, second = str(caught.value).splitlines()
    assert "object 4 'a' in layer 'spawns': only" in first
    assert "of 60 animals fit; enlarge the area" in second


def test_a_level_with_nobody_in_it_can_be_built():
    simulation = made()
    simulation.run(5)
    assert len(simulation.agents) == 0
    assert simulation.measures()["animals"] == 0


def test_assets_are_the_files_it_was_made_of():
    simulation = made(spawn(box(1, 1, 9, 9), "walk", 1), files={"x.tmj": b"{}"})
    assets = simulation.assets()
    assert assets["x.tmj"] == b"{}"
    assert b"walk" not in assets["brushes/walk.brush.toml"][:5]
    assert WALK.source == assets["brushes/walk.brush.toml"]


def test_a_world_can_be_closed_and_others_go_on():
    one, two = made(spawn(box(1, 1, 9, 9), "walk", 3)), made(spawn(box(1, 1, 9, 9), "walk", 3))
    one.close()
    two.run(3)
    assert len(two.agents) == 3


# more or fewer animals -----------------------------------------------------------------------------


def area_of(polygon):
    x, y = polygon.T
    return 0.5 * abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def two_herds(**things):
    herds = [spawn(box(10, 10, 20, 20), "walk", 30, id=1), spawn(box(25, 10, 35, 20), "run", 10, id=2)]
    return level(spawns=herds, **things)


@pytest.mark.parametrize("agents", [1, 3, 20, 40, 41, 160, 1000])
def test_other_numbers_of_animals_keep_shares_and_density(agents):
    ground = two_herds()
    other = scaled(ground, agents)
    assert sum(s.count for s in other.spawns) == agents
    for s in other.spawns:
        before = next(b for b in ground.spawns if b.id == s.id)
        if agents > 40:
            assert s.count / agents == pytest.approx(before.count / 40, abs=1 / agents)
            assert area_of(s.polygon) / area_of(before.polygon) == pytest.approx(agents / 40)
        elif s.count > 1:
            assert s.count / area_of(s.polygon) == pytest.approx(before.count / area_of(before.polygon), rel=0.01)
    assert len(build(ground, agents=agents, library=SHELF).agents) == agents
    assert ground.spawns[0].count == 30  # the level itself is as it was


def test_the_map_grows_where_a_larger_herd_would_not_fit_and_all_moves_along():
    shape = (40, 40)
    kinds = np.zeros(shape, np.int16)
    walkable = np.ones(shape, bool)
    walkable[0, 0] = False
    painted = {**Terrain.blank(shape).values, "walkable": walkable, "speed_factor": np.full(shape, 0.5)}
    ground = two_herds(
        boundary="wall",
        terrain=Terrain(painted, kinds, ["sand"], ["#fff000"]),
        height_map=Raster(2.0, np.arange(400.0).reshape(20, 20)),
        cap=Raster(1.0, np.full(shape, 2.0)), factor=Raster(1.0, np.full(shape, 0.5)),
        brush_layers=[BrushLayer("brush", 1.0, ["run"], np.zeros(shape, np.int16))],
        obstacles=[obstacle(box(30, 30, 32, 32))],
        guides=[Guide(1, "g", np.array([(1, 1), (9, 9)], float), 1, 1, 1, "", False)],
        goals=[Goal(1, "g", np.array([38.0, 38.0]), 1.0, "stay", "", box(37, 37, 39, 39))],
        zones=[Zone(1, "z", box(1, 1, 2, 2), None, 1.0, 1.0, 0.5)], exits=[Exit(1, "e", box(3, 3, 4, 4))],
        lines=[Line(1, "l", np.array([(0, 0), (1, 1)], float))], areas=[Area(1, "a", box(5, 5, 6, 6))],
        script=[
            key("PaintBrush", brush="run", x=5.0, y=6.0, radius=2.0),
            key("AddObstacle", name="n", points=[[7.0, 7.0], [8.0, 7.0], [8.0, 8.0]]),
        ],
    )  # fmt: skip
    grown = scaled(ground, 1000)
    assert grown.shape[0] > 40
    assert grown.shape == grown.terrain.walkable.shape == grown.cap.values.shape == grown.brush_layers[0].index.shape
    shift = grown.obstacles[0].polygon[0] - (30, 30)
    assert (shift > 0).any()
    for now, before in [
        (grown.goals[0].xy, (38, 38)), (grown.goals[0].polygon[0], (37, 37)), (grown.guides[0].points[0], (1, 1)),
        (grown.zones[0].polygon[0], (1, 1)), (grown.exits[0].polygon[0], (3, 3)), (grown.lines[0].points[0], (0, 0)),
        (grown.areas[0].polygon[0], (5, 5)), ([grown.script[0].args[k] for k in "xy"], (5, 6)),
        (grown.script[1].args["points"][0], (7, 7)),
    ]:  # fmt: skip
        assert now - shift == pytest.approx(before)
    ix, iy = shift.astype(int)
    assert not grown.terrain.walkable[iy, ix]
    assert (~grown.terrain.walkable).sum() == 1
    inside = np.zeros(grown.shape, bool)
    inside[iy : iy + 40, ix : ix + 40] = True
    assert (grown.terrain.speed_factor[~inside] == 1.0).all()  # plain ground around
    assert (grown.brush_layers[0].index[~inside] == -1).all()
    assert np.isinf(grown.cap.values[~inside]).all()
    simulation = build(ground, agents=1000, library=SHELF)
    assert len(simulation.agents) == 1000
    xy = xy_of(simulation)
    assert ((xy > 0) & (xy < (grown.width, grown.height))).all()
    simulation.run(35)  # the script, too, works there


@pytest.mark.parametrize("pixels", [40, 20, 4, 57])
def test_hills_stay_where_they_are_when_the_map_grows(pixels):
    heights = Raster(40 / pixels, np.zeros((pixels, pixels)))
    heights.values = np.sin(heights.centres() @ (0.2, 0.1))
    ground = two_herds(height_map=heights, obstacles=[obstacle(box(30, 30, 32, 32))])
    grown = scaled(ground, 600)
    shift = grown.obstacles[0].polygon[0] - (30, 30)
    assert shift.min() > 0
    places = np.random.default_rng(4).uniform(0, 40, (300, 2))
    assert np.abs(grown.height_map.sample(places + shift) - heights.sample(places)).mean() < 0.02


def test_artwork_keeps_its_place_when_the_map_grows():
    gids, painted = np.zeros((40, 40), np.uint32), np.zeros((40, 40), bool)
    gids[-1, 0], painted[0, 0] = 5, True  # the north row first, and the south row
    layers = [ArtLayer("ground", 1.0, 4.0, 0.0, gids=gids), ArtLayer("sky", 1.0, 1.0, 2.0, image="sky.png")]
    art = Art(layers, [], (40, 40), 16, painted=painted)
    grown = scaled(two_herds(art=art, zones=[Zone(1, "z", box(0, 0, 2, 2), None, 1.0, 1.0, 0.5)]), 1000)
    art, (ix, iy) = grown.art, grown.zones[0].polygon.min(0).astype(int)
    assert min(ix, iy) > 0
    assert art.shape == art.layers[0].gids.shape == art.painted.shape == grown.shape
    assert art.layers[0].gids[grown.shape[0] - 1 - iy, ix] == art.layers[0].gids.sum() == 5
    assert art.painted[iy, ix] and art.painted.sum() == 1
    assert (art.layers[0].dx, art.layers[1].dx) == (4.0, 1.0 + 16 * ix)
    assert art.layers[1].dy == 2.0 + 16 * (grown.shape[0] - 40 - iy)
    assert art.picture.shape == (16 * grown.shape[0], 16 * grown.shape[1], 4)


def test_places_of_a_command_move_with_the_map_and_directions_do_not():
    ground = level(
        spawns=[spawn(box(10, 10, 30, 30), "walk", 20, id=1)],
        script=[
            key("Gust", x=3.0, y=0.0, at_x=5.0, at_y=6.0, radius=4.0),
            key("Migrate", x=1.0, y=0.0, z=0.0, kind="direction"),
            key("Migrate", x=1.0, y=2.0, z=0.0), key("Steer", x=0.0, y=1.0), key("Steer", x=7.0, y=8.0, kind="place"),
            key("Paint", layer="brush", value="walk", x=1.0, y=1.0, to_x=2.0, to_y=3.0, radius=1.0),
        ],
    )  # fmt: skip
    shift = (scaled(ground, 2000).script[2].args["x"] - 1.0, scaled(ground, 2000).script[2].args["y"] - 2.0)
    assert min(shift) > 0
    args = [key.args for key in scaled(ground, 2000).script]
    assert (args[0]["x"], args[0]["y"]) == (3.0, 0.0) and args[0]["at_x"] == 5.0 + shift[0]
    assert (args[1]["x"], args[1]["y"]) == (1.0, 0.0) and (args[3]["x"], args[3]["y"]) == (0.0, 1.0)
    assert args[4]["x"] == 7.0 + shift[0] and args[5]["to_y"] == 3.0 + shift[1]


def test_fewer_animals_never_make_a_gate_endless():
    gate = spawn(box(5, 5, 9, 9), "walk", 3, id=2, rate=5.0)
    ground = level(
        spawns=[spawn(box(10, 10, 30, 30), "walk", 97, id=1), gate, spawn(box(5, 20, 9, 24), "walk", 0, id=3, rate=1.0)]
    )
    few = scaled(ground, 5)
    assert [(s.id, s.count) for s in few.spawns] == [
        (1, 4),
        (2, 1),
        (3, 0),
    ]  # no spawn is left out
    assert few.spawns[1].rate == pytest.approx(0.25) and few.spawns[2].rate == pytest.approx(0.05)
    assert [s.id for s in scaled(ground, 1).spawns] == [1, 3]


def test_there_must_be_somebody_to_scale():
    with pytest.raises(ValueError, match="at least 1 animal, got 0"):
        scaled(two_herds(), 0)
    with pytest.raises(ValueError, match="no spawn with a count"):
        scaled(level(), 10)


# without a level ------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", ["scatter", "grid", "ring", "line"])
def test_a_plane_holds_a_herd_at_its_density(start):
    herd = brush("herd", body={"length": 0.5, "radius": 0.1})
    simulation = plane(herd, 200, 0.7, start, seed=4)
    assert len(simulation.agents) == 200
    assert simulation.level.boundary == "open"
    if start in ("scatter", "grid"):
        extent = np.ptp(xy_of(simulation), axis=0) / 0.5  # body lengths
        assert 200 / extent.prod() == pytest.approx(0.7, rel=0.25)
    simulation.run(3)


def test_a_plane_takes_heading_seed_and_size():
    herd = brush("herd")
    a, b = plane(herd, 20, seed=1, heading=0.5), plane(herd, 20, seed=2, heading=0.5)
    assert a.agents[Heading.forward] == pytest.approx(b.agents[Heading.forward])
    assert not np.array_equal(xy_of(a), xy_of(b))
    assert plane(herd, 5, body_length=3.0).agents[Body.length].tolist() == [3.0] * 5


def test_herds_apart_have_each_their_rows_their_brush_and_their_place():
    brushes = [brush(name, model="herd") for name in ("one", "two", "three")]
    simulation = herds_apart(brushes, 20, apart=200.0)
    places = xy_of(simulation).reshape(3, 20, 2)
    middles = places.mean(1)
    assert np.linalg.norm(middles - np.roll(middles, 1, axis=0), axis=1).min() > 180
    assert np.ptp(places, axis=1).max() < 10
    home = simulation.agents[BrushBinding.home].reshape(3, 20)
    named = np.array(simulation.world.resource(Palette).names)[home]
    assert (named == np.array([["one"], ["two"], ["three"]])).all()
    simulation.run(3)
    assert np.linalg.norm(xy_of(simulation).reshape(3, 20, 2).mean(1) - middles, axis=1).max() < 5


def test_a_command_that_cannot_be_done_is_told_with_its_line(tmp_path):
    shipped = Path(levels.__path__[0])
    shutil.copytree(shipped / "tilesets", tmp_path / "tilesets")
    shutil.copy(shipped / "flockbrush.tiled-project", tmp_path)
    (tmp_path / "shipped").mkdir()
    text = (shipped / "shipped" / "geese.tmj").read_text()
    path = tmp_path / "shipped" / "geese.tmj"
    path.write_text(text.replace('"value":12', '"value":-12', 1))  # the seconds of the first turn
    with pytest.raises(ProblemsError) as told:
        build(read_level(path))
    line = int(str(told.value).split("geese.tmj:")[1].split(":")[0])
    assert "seconds must be at least 0, got -12" in str(told.value)
    assert '"round the hill"' in "".join(path.read_text().splitlines()[line - 1 : line + 60])
