"""Drives: each does what it says on top of a model, and takes no more of the body than its share."""

import numpy as np
import pytest
from flockbrush.behaviours import drive as drive_module
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, drives
from flockbrush.behaviours.drives.land import LANDING, TAKING_OFF
from flockbrush.behaviours.species import SpeciesLibrary, shipped_species
from flockbrush.components import Family, Heading, Position, Speed, Thrust, Transit, Urge, Velocity, Wish
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.raster import Raster
from flockbrush.systems.allocation import allocated_shares, with_wishes
from flockbrush.systems.commands import Migrate
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.steer import scene_of
from small_herd import box, brush, meadow, obstacle, put, put_aloft, straight, xy_of

GOOSE = {"mean": 20.0, "body": {"length": 0.8, "radius": 0.16, "contact": "disc"}, "vision": {"range": 60.0}}


def driven(name, asset, **params):
    """A brush with one drive."""
    return asset.model_copy(update={"drives": {name: drives()[name].Params(**params)}})


def speeds(simulation):
    return np.linalg.norm(simulation.agents[Velocity.xyz], axis=1)


def test_a_dog_that_hunts_comes_to_the_sheep_and_one_that_does_not_goes_on():
    for asset, near in ((driven("hunt", straight(mean=1.0)), True), (straight(mean=1.0), False)):
        simulation = meadow(asset, brush("stand", mean=0.0))
        put(simulation, (5, 20), 0.0, species="dog", brush="straight")
        put(simulation, (20, 26), species="sheep", brush="stand")
        simulation.agents[Velocity.xyz][:] = 0.0
        apart = []
        for _ in range(20):
            simulation.run(16)
            xy = xy_of(simulation)
            apart.append(np.hypot(*(xy[0] - xy[1])))
        assert (min(apart) < 4.0) == near


def test_a_dog_follows_its_shepherd_and_is_content_beside_him():
    simulation = meadow(driven("follow", brush("stay", mean=0.2)), straight(mean=2.0))
    put(simulation, (2, 20), species="dog", brush="stay")
    put(simulation, (20, 20), 0.0, species="human", brush="straight")
    simulation.run(32 * 12)
    xy = xy_of(simulation)
    assert 2.0 < np.hypot(*(xy[1] - xy[0])) < 9.0
    assert xy[0, 0] > 25.0


def test_a_stray_that_keeps_its_group_goes_back():
    for asset, back in ((driven("keep_group", straight(vision={"range": 60.0}, mean=0.5)), True),
                        (straight(vision={"range": 60.0}, mean=0.5), False)):  # fmt: skip
        simulation = meadow(asset)
        put(simulation, [(20, 20), (21, 21), (19, 21), (20, 22), (35, 20)], [0, 0, 0, 0, 0], species="sheep")
        simulation.run(32 * 8)
        xy = xy_of(simulation)
        assert (np.hypot(*(xy[4] - xy[:4].mean(0))) < 10.0) == back


def test_who_seeks_a_place_gets_there():
    simulation = meadow(driven("seek", straight(mean=2.0), what="place", x=30.0, y=35.0))
    put(simulation, (5, 5), np.pi, species="sheep")
    simulation.run(32 * 20)
    assert np.hypot(*(xy_of(simulation)[0] - (30, 35))) < 5.0


@pytest.mark.parametrize(("boundary", "x"), [("wrap", (0.0, 4.0)), ("open", (6.0, 40.0))])
def test_a_place_is_sought_over_the_border_where_that_is_shorter(boundary, x):
    simulation = meadow(driven("seek", straight(mean=2.0), what="place", x=36.0, y=20.0), boundary=boundary)
    put(simulation, (6, 20), np.pi / 2, species="sheep")
    simulation.run(32 * 3)
    assert x[0] < xy_of(simulation)[0, 0] < x[1]


def test_a_dog_with_two_shepherds_drives_the_herd_to_the_nearer_one():
    simulation = meadow(driven("gather", brush("stay", mean=0.5)))
    put(simulation, [(15 + 0.5 * k, 20) for k in range(4)], species="sheep")
    put(simulation, (20, 12), np.pi, species="dog")
    put(simulation, [(-5, 20), (31, 20)], species="human")
    simulation.tick()
    drive_them = Urges(*drives()["gather"].urge(scene_of(simulation.world), np.array([4]), drives()["gather"].Params()))
    assert drive_them.acceleration[0, 0] < 0.0  # to the west of them: the shepherd in the east is the nearer one


def test_who_rests_stands_and_half_a_rest_is_half_the_speed():
    for depth, speed in ((1.0, 0.0), (0.5, 1.0)):
        simulation = meadow(driven("rest", straight(mean=2.0), depth=depth))
        put(simulation, (5, 20), species="yak")
        simulation.run(32 * 8)
        assert speeds(simulation)[0] == pytest.approx(speed, abs=0.05)


@pytest.mark.parametrize("model", ["line_formation", "v_rules"])
def test_a_flock_that_keeps_its_height_comes_to_it(model):
    simulation = meadow(driven("keep_height", brush("fly", model, **GOOSE), height=25.0))
    put_aloft(simulation, [(20, 20 + 3 * k, 10.0) for k in range(4)], species="goose")
    simulation.run(32 * 30)
    assert simulation.agents[Position.xyz][:, 2] == pytest.approx(25.0, abs=2.0)


def test_who_foresees_a_wall_goes_round_it_and_who_does_not_touches_it():
    wall = obstacle(box(20, 14, 21, 26))
    foresees = driven("avoid_obstacles", straight(mean=2.0, max_turn=3.0))
    for asset, round_ in ((foresees, True), (straight(mean=2.0), False)):
        simulation = meadow(asset, obstacles=[wall])
        put(simulation, (5, 20.3), 0.0, species="yak")
        least = np.inf
        for _ in range(32 * 14):
            simulation.tick()
            x, y = xy_of(simulation)[0]
            least = min(least, np.hypot(max(20 - x, 0, x - 21), max(14 - y, 0, y - 26)))
        assert (least > 0.6) == round_
        assert (xy_of(simulation)[0, 0] > 22.0) == round_


@pytest.mark.parametrize("model", ["line_formation", "boids", "v_rules"])
def test_birds_bound_beyond_a_cliff_climb_over_it_as_fast_as_they_can_and_no_faster(model):
    heights, goose = np.zeros((40, 40)), shipped_species().get("goose").fly
    heights[:, 20:] = 80.0
    more = {"min_speed": 2.0} if model == "boids" else {}
    simulation = meadow(brush("fly", model, **GOOSE, **more), height_map=Raster(10.0, heights), width=400, height=400)
    put_aloft(simulation, [(30, 200 + 3 * k, 20.0) for k in range(3)], species="goose")
    simulation.submit(Migrate(x=350.0, y=200.0, z=95.0))
    xyz, rises, fastest = simulation.agents[Position.xyz], 0.0, 0.0
    while simulation.clock.now < 90 and xyz[:, 0].min() < 220:
        simulation.tick()
        xyz = simulation.agents[Position.xyz]
        rises = max(rises, simulation.agents[Velocity.xyz][:, 2].max())
        fastest = max(fastest, speeds(simulation).max())
        assert (xyz[:, 2] >= -1e-9).all() and (xyz[xyz[:, 0] > 205, 2] >= 80.0 - 1e-6).all()
    assert xyz[:, 0].min() >= 220  # all are over it
    assert rises == pytest.approx(goose.climb, rel=0.02) and fastest <= goose.speed
    assert simulation.clock.now > 60 / goose.climb  # they had so far to climb


def test_birds_that_foresee_a_slope_climb_before_they_touch_it():
    heights = np.clip((np.arange(40) * 10.0 + 5 - 200) * 0.1, 0, 15)[None, :].repeat(40, 0)
    simulation = meadow(
        brush("fly", "line_formation", **GOOSE), height_map=Raster(10.0, heights), width=400, height=400
    )
    put_aloft(simulation, [(60, 200 + 3 * k, 6.0) for k in range(4)], species="goose")
    least = np.inf
    for _ in range(32 * 18):
        simulation.tick()
        xyz = simulation.agents[Position.xyz]
        ground = Raster(10.0, heights).sample(xyz[:, :2])
        least = min(least, (xyz[:, 2] - ground).min())
    assert xyz[0, 0] > 300.0
    assert least > 1.0


@pytest.mark.parametrize("speed", [11.0, 14.0])
def test_birds_climb_straight_on_where_their_slowest_flight_is_slow_enough(speed):
    """At 14 m/s all have to slow down for this slope, and none at 11 m/s; no rounding makes one turn aside."""
    heights = np.clip((np.arange(40) * 10.0 + 5 - 100) * 0.2, 0, 60)[None, :].repeat(40, 0)
    simulation = meadow(
        brush("fly", "line_formation", **GOOSE), height_map=Raster(10.0, heights), width=400, height=400
    )
    places = np.random.default_rng(2).uniform((100, 50), (200, 350), (200, 2))
    xyz = np.column_stack([places, Raster(10.0, heights).sample(places) + 3.0])
    put_aloft(simulation, xyz, species="goose", speed=speed)
    simulation.tick()
    simulation.agents[Position.xyz][:], simulation.agents[Velocity.xyz][:] = xyz, (speed, 0.0, 0.0)
    params, rows = drives()["clear_terrain"].Params(foresight=4.0), np.arange(200)
    urges = drives()["clear_terrain"].urge(scene_of(simulation.world), rows, params)
    assert (urges.acceleration[:, 1] == 0.0).all()
    assert ((urges.acceleration[:, 0] < 0.0).all()) == (speed > 12.5)


def test_drives_take_their_shares_in_order_and_the_model_gets_the_rest():
    class One:
        def __init__(self, name, urgency):
            self.name, self.urgency = name, urgency

        def urge(self, scene, rows, params):
            return Urges(np.ones((len(rows), 3)), np.full(len(rows), self.urgency))

    order = [
        (One("first", 0.7), None),
        (One("nothing", 0.0), None),
        (One("second", 0.6), None),
        (One("third", 1.0), None),
    ]
    taken = allocated_shares(None, np.arange(2), order)
    assert taken.names == ["first", "second", "third"]
    assert taken.share.tolist() == [[0.7, 0.7], pytest.approx([0.3, 0.3]), [0.0, 0.0]]
    assert allocated_shares(None, np.arange(2), order[1:2]) is None


@pytest.mark.parametrize(
    ("urges", "words"),
    [
        (lambda k: np.zeros((k, 3)), "drive 'mine' must return Urges or None, got ndarray"),
        (lambda k: Urges(np.zeros((k, 2)), np.ones(k)), r"drive 'mine' was asked for 1 animals: .* got \(1, 2\)"),
        (lambda k: Urges(np.full((k, 3), np.nan), np.ones(k)), "drive 'mine' gave .* not finite"),
    ],
)
def test_what_a_drive_must_not_return_is_told_with_its_name(urges, words, monkeypatch):
    """And a cell of a notebook that registers it may be run again."""
    monkeypatch.setattr(drive_module, "_registry", dict(drives()))
    for _ in range(2):
        drive("mine", DriveParameters)(lambda scene, rows, params: urges(len(rows)))
    simulation = meadow(brush().model_copy(update={"drives": {"mine": DriveParameters()}}))
    put(simulation, [(20, 20)])
    with pytest.raises(PluginError, match=words):
        simulation.run(2)


def test_a_drive_without_strength_changes_no_bit():
    one = meadow(driven("rest", straight(mean=2.0), strength=0.0))
    other = meadow(straight(mean=2.0))
    for simulation in (one, other):
        put(simulation, [(5, 20), (8, 22)], species="sheep")
        simulation.run(40)
    fields = (Position.xyz, Velocity.xyz, Heading.forward, Speed.target, Wish.pace, Urge.share, Thrust.acceleration)
    assert all(np.array_equal(one.agents[f], other.agents[f]) for f in fields)


def test_a_brush_names_its_drives_and_a_mistake_is_told_with_its_line(tmp_path):
    from flockbrush.behaviours.brush import load_brush, shipped
    from flockbrush.behaviours.brush_writer import brush_to_toml
    from flockbrush.engine.problems import ProblemsError

    asset = driven("flee", shipped().get("march"), strength=0.5)
    text = brush_to_toml(asset)
    assert load_brush(text.encode(), "march.brush.toml") == asset
    wrong = text.replace("[drives.flee]", "[drives.flea]")
    with pytest.raises(ProblemsError, match="there is no drive 'flea'; did you mean 'flee'"):
        load_brush(wrong.encode(), "march.brush.toml")
    with pytest.raises(ProblemsError, match=r"march.brush.toml:\d+: drives.flee.strength: must be from 0 to 1"):
        load_brush(text.replace("strength = 0.5", "strength = 5.0").encode(), "march.brush.toml")


def tiger_and_sheep(catch, hunter, tiger_at):
    """A tiger under the brush ``hunter``, and a sheep at (20, 20); one of the other brushes hunts."""
    simulation = meadow(driven("hunt", straight("chase", mean=1.0)), brush("stand", mean=0.0), brush("wolf", "hunt"))
    fauna = simulation.world.resource(SpeciesList)
    text = (
        'schema = "flockbrush.species/1"\nmedia = ["walk"]\n[body]\nlength = 1.5\nradius = 0.3\n[relations]\n'
        f'sheep = {{ hunt = 1.0, notice = "60 m", catch = "{catch}" }}\n'
    )
    fauna.library = SpeciesLibrary(shipped_species().folders, {"tiger.species.toml": text.encode()})
    put(simulation, tiger_at, 0.0, species="tiger", brush=hunter)
    put(simulation, (20, 20), species="sheep", brush="stand")
    return simulation


@pytest.mark.parametrize("catch", ["none", "remove"])
def test_a_catch_takes_the_prey_out_of_the_world_where_the_species_says_so(catch):
    simulation = tiger_and_sheep(catch, "chase", (10, 20))
    simulation.run(32 * 15)
    assert len(simulation.agents) == (1 if catch == "remove" else 2)


@pytest.mark.parametrize("hunter", ["chase", "wolf", "stand"])
def test_only_who_hunts_under_its_own_brush_catches(hunter):
    simulation = tiger_and_sheep("remove", hunter, (18.8, 20))
    simulation.tick()
    assert len(simulation.agents) == (2 if hunter == "stand" else 1)


# what every drive promises -----------------------------------------------------------------


@pytest.fixture(scope="module")
def lively():
    """The scene of a world where every drive has something to do: with fear, a hunt, a leader, flight, a family."""
    everything = {name: one.Params(strength=0.5) for name, one in drives().items()}
    walk, fly = straight("walk", vision={"range": 60.0}), brush("fly", "line_formation", **GOOSE)
    heights = np.zeros((40, 40))
    heights[:, 26:] = 30.0
    simulation = meadow(
        *(asset.model_copy(update={"drives": everything}) for asset in (walk, fly)),
        obstacles=[obstacle(box(12, 18, 13, 24))], height_map=Raster(1.0, heights),
    )  # fmt: skip
    put(simulation, [(10, 20), (10.5, 21), (9, 22), (4, 30)], species="sheep", brush="walk")
    for species, place in (("dog", (6, 21)), ("wolf", (16, 10)), ("human", (2, 5))):
        put(simulation, place, species=species, brush="walk")
    put_aloft(simulation, [(22.0, 10.0 + 3.0 * k, 20.0) for k in range(3)], species="goose", brush="fly")
    simulation.agents[Family.number][:4] = 1
    simulation.run(8)
    simulation.agents[Transit.kind][-2:] = (LANDING, TAKING_OFF)
    return with_wishes(simulation.world, scene_of(simulation.world))


@pytest.mark.parametrize("name", sorted(drives()))
def test_every_drive_answers_for_the_rows_asked_and_the_same_again(lively, name):
    """And it does not write to the scene, whose arrays cannot be written."""
    one = drives()[name]
    params = one.Params(what="place", x=30.0, y=30.0) if name == "seek" else one.Params()

    def urges_of(rows):
        urges = one.urge(lively, rows, params) or Urges(np.zeros((len(rows), 3)), np.zeros(len(rows)))
        assert urges.acceleration.shape == (len(rows), 3) and urges.urgency.shape == (len(rows),)
        assert np.isfinite(urges.acceleration).all() and np.isfinite(urges.urgency).all()
        return np.where(urges.urgency > 0.0, urges.acceleration.T, 0.0).T, urges.urgency

    everybody, some = np.arange(len(lively.ids)), np.array([7, 2, 4])
    whole = urges_of(everybody)
    assert whole[1].any()
    assert len(urges_of(everybody[:0])[1]) == 0
    for told, again, part in zip(whole, urges_of(everybody), urges_of(some), strict=True):
        assert np.array_equal(told, again), "keep nothing from call to call: use a component and a system"
        assert np.array_equal(told[some], part), "answer for `rows` only, from what each of them perceives"
