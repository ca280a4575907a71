"""Every kind of condition, in a scene made by hand."""

import numpy as np
import pytest
import small_herd
from flockbrush.behaviours import trigger as trigger_module
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.trigger import conditions
from flockbrush.components import Ground, Position, ProgramState, Velocity
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.raster import Raster
from flockbrush.systems.commands import AddAnimals, RemoveAnimals
from flockbrush.systems.program_commands import Event, GiveProgram, SetState, UseProgram
from small_program import SIZE, area, at, goal, moved, program, put, region, states, two_states, wall, world, zone

HERE, FAR = (0, 0), (60, 0)
TICK = 1 / 32


def test_every_kind_of_condition_has_a_test_by_hand():
    import sys

    text = open(sys.modules[__name__].__file__, encoding="utf-8").read()
    ours = [word for word, kind in conditions().items() if kind.__module__.startswith("flockbrush.behaviours.triggers")]
    assert len(ours) > 20
    missing = [word for word in ours if f"{word} =" not in text and f'("{word}", ' not in text]
    assert missing == [], "add a test to this file in which the condition holds, and in which it does not"


# who is seen ------------------------------------------------------------------------


def sees_wolf(places, within="20 m", **more):
    kinds = ["sheep"] * (len(places) - 1) + ["wolf"]
    names = ["graze"] * (len(places) - 1) + ["wolf-hunt"]
    return moved(world(two_states(f'{{ sees = "wolf", within = "{within}" }}'), places, kinds, names, **more))[0]


def test_sees_a_wolf_within_a_distance():
    assert sees_wolf([HERE, (19.9, 0)])
    assert not sees_wolf([HERE, (20.1, 0)])
    assert sees_wolf([HERE, (-15, 10)])


def test_sees_farther_than_its_brush_looks_for_neighbours():
    assert shipped().get("graze").vision.range == 4.0
    assert sees_wolf([HERE, (50, 0)], within="60 m")


def test_sees_nobody_behind_a_wall():
    assert not sees_wolf([HERE, (10, 0)], obstacles=[wall(4, -3, 5, 3)])
    assert sees_wolf([HERE, (10, 0)], obstacles=[wall(4, 1, 5, 3)])


def test_sees_a_wolf_over_the_backs_of_others_but_no_neighbour_behind_another():
    assert sees_wolf([HERE, (8, 0), (16, 0)])
    assert moved(world(two_states("{ sees_more_than = 1 }"), [HERE, (1.5, 0), (3, 0)])) == [False, True, False]


@pytest.mark.parametrize("bystander", [(), (-60, -60, 30.0)])
def test_a_named_species_is_seen_by_the_eyes_at_any_distance_whoever_else_is_there(bystander):
    """The wolf is within the range of the brush, behind another sheep; a bird far away changes nothing."""
    places, kinds, names = [HERE, (1.5, 0), (3, 0)], ["sheep", "sheep", "wolf"], ["graze", "graze", "wolf-hunt"]
    if bystander:
        places, kinds, names = [*places, bystander], [*kinds, "falcon"], [*names, "falcon"]
    assert moved(world(two_states('{ sees = "wolf", within = "3.5 m" }'), places, kinds, names))[:2] == [True, True]


def test_a_share_of_a_named_species_counts_all_whom_the_eyes_see():
    """One of the two sheep within 12 m runs, farther away than the brush sees (4 m)."""
    text = (
        "[state.calm]\n[state.run]\n[[trigger]]\nfrom = 'calm'\nto = 'run'\n"
        "when = {{ share_of_seen_in = 'run', at_least = {share}, species = 'sheep', within = '12 m' }}"
    )
    for share, expected in ((0.5, "run"), (0.51, "calm")):
        scene = world(program(text.format(share=share)), [HERE, (3, 0), (9, 2)])
        scene.submit(SetState("small", "run", x=SIZE / 2 + 9, y=SIZE / 2 + 2, radius=0.5))
        scene.run(1)
        assert states(scene)[0] == expected


@pytest.mark.parametrize("within", [20, 99, 150, 400])
def test_named_species_are_counted_once_over_the_seam(within):
    places, kinds = [(-99, 0), (99, 0), (-95, 2), (97, 6)], ["sheep", "sheep", "goat", "goat"]
    for more, expected in ((1, True), (2, False)):
        prog = two_states(f'{{ sees_more_than = {more}, species = "goat", within = "{within} m" }}')
        assert moved(world(prog, places, kinds, level={"boundary": "wrap"}))[:2] == [expected] * 2


def test_sees_nobody_behind_its_back():
    """The eyes of a sheep leave 60 degrees behind it."""
    assert not sees_wolf([HERE, (-10, 0)]) and not sees_wolf([HERE, (-10, 5)])
    assert sees_wolf([HERE, (-10, 7)]) and sees_wolf([HERE, (10, 2)])


def test_sees_who_is_in_the_air_over_a_wall():
    def under(height, **things):
        scene = world(
            two_states('{ sees = "falcon", within = "20 m" }'), [HERE, (12, 0)], ["sheep", "falcon"],
            ["graze", "falcon"], **things,
        )  # fmt: skip
        scene.agents[Position.xyz][1, 2] = height
        return moved(scene)[0]

    assert under(14.0)  # 18.4 m away
    assert not under(18.0)  # 21.6 m
    assert under(14.0, obstacles=[wall(4, -3, 5, 3)])  # 3 m high
    assert not under(2.0, obstacles=[wall(4, -3, 5, 3)])


def test_sees_its_own_kind_or_any_other():
    for word, other, expected in (
        ("kin", "sheep", True), ("kin", "goat", False), ("others", "sheep", False), ("others", "goat", True),
        ("anyone", "goat", True),
    ):  # fmt: skip
        scene = world(two_states(f'{{ sees = "{word}" }}'), [HERE, (2, 0)], ["sheep", other])
        assert moved(scene)[0] == expected, (word, other)


def test_anyone_within_a_distance_in_body_lengths():
    condition = '{ anyone_within = "2 BL" }'  # a sheep is 1 m long
    assert moved(world(two_states(condition), [HERE, (1.9, 0)], ["sheep", "goat"]))[0]
    assert not moved(world(two_states(condition), [HERE, (2.1, 0)], ["sheep", "goat"]))[0]


def test_sees_more_than_and_fewer_than_so_many():
    places = [HERE, (2, 0), (0, 2), (-2, 0)]
    assert moved(world(two_states("{ sees_more_than = 2 }"), places)) == [True, False, True, False]
    assert moved(world(two_states("{ sees_fewer_than = 3 }"), places)) == [False, True, False, True]
    assert moved(world(two_states('{ sees_more_than = 2, within = "1 m" }'), places)) == [False] * 4
    assert moved(world(two_states('{ sees_more_than = 2, species = "goat" }'), places)) == [False] * 4


def test_alone_for_some_time():
    scene = world(two_states('{ alone_for = "0.5 s" }'), [HERE, (2, 0), FAR])
    assert moved(scene, 16 - 2) == [False, False, False]
    assert moved(scene, 4) == [False, False, True]
    put(scene, [HERE, (40, 0), FAR])
    assert moved(scene, 15) == [False, False, True]  # these two have just seen each other
    assert moved(scene, 3) == [True, True, True]


def test_share_of_seen_in_a_state():
    text = (
        "[state.calm]\n[state.run]\n[[trigger]]\nfrom = 'calm'\nto = 'run'\n"
        "when = {{ share_of_seen_in = 'run', at_least = {share} }}"
    )
    places = [HERE, (2, 0), (0, 2), (-2, 0)]
    for share, expected in ((0.34, "calm"), (0.33, "run")):
        scene = world(program(text.format(share=share)), places)
        scene.submit(SetState("small", "run", x=SIZE / 2 + 2, y=SIZE / 2, radius=0.5))
        scene.run(1)
        assert states(scene)[:2] == [expected, "run"]
    scene = world(program(text.format(share=0.1)), [HERE, FAR])
    scene.submit(SetState("small", "run", x=SIZE / 2 + 60, y=SIZE / 2, radius=0.5))
    scene.run(1)
    assert states(scene) == ["calm", "run"]  # who sees nobody catches nothing


@pytest.mark.parametrize(("state", "spreads"), [("run", False), ("other/run", True)])
@pytest.mark.parametrize("asks", ["{{ share_of_seen_in = '{0}', at_least = 0.5 }}",
                                  "{{ rate = '.0001 /s', imitating = '{0}', gain = 10000, power = 9 }}"])  # fmt: skip
def test_a_state_is_that_of_the_own_program_unless_it_names_another(asks, state, spreads):
    own = "[state.calm]\n[state.run]\n[[trigger]]\nfrom = 'calm'\nto = 'run'\nwhen = " + asks.format(state)
    other = program("[state.run]\n", "other")
    scene = world(program(own), [HERE, (2, 0)])
    scene.submit(UseProgram("other", other.source.decode()))
    scene.submit(GiveProgram("other", x=SIZE / 2 + 2, y=SIZE / 2, radius=0.5))
    scene.run(2)
    assert states(scene) == ["run" if spreads else "calm", "run"]


# where -----------------------------------------------------------------------------


def test_inside_a_zone_an_area_or_a_goal():
    places = [HERE, (10, 0), (20, 0)]
    for thing in ({"zones": [zone("pond", -2, -2, 2, 2)]}, {"areas": [area("pond", -2, -2, 2, 2)]}):
        assert moved(world(two_states('{ inside = "pond" }'), places, **thing)) == [True, False, False]
    assert moved(world(two_states('{ inside = "pond" }'), places, goals=[goal("pond", 10, 1)])) == [False, True, False]


def test_enters_a_region_and_leaves_it():
    for word, first, then in (("enters", FAR, HERE), ("leaves", HERE, FAR)):
        scene = world(two_states(f'{{ {word} = "pond" }}'), [first], areas=[area("pond", -2, -2, 2, 2)])
        assert moved(scene, 3) == [False]
        put(scene, [then])
        assert moved(scene) == [True], word


def test_who_is_born_in_a_region_does_not_enter_it():
    scene = world(two_states('{ enters = "all" }'), [HERE], areas=[area("all", -99, -99, 99, 99)])
    scene.submit(AddAnimals("graze", *at(20, 20).tolist(), 3.0, 4, "sheep", program="small"))
    assert moved(scene, 4) == [False] * 5


def test_since_in_a_region():
    scene = world(two_states('{ since_in = "pond", at_least = "0.5 s" }'), [HERE], areas=[area("pond", -2, -2, 2, 2)])
    assert moved(scene, 40) == [False]
    put(scene, [FAR])
    assert moved(scene, 15) == [False]
    assert moved(scene, 2) == [True]


def test_since_a_state():
    scene = world(
        program(
            "[state.rest]\nfor = '0.25 s'\nthen = 'walk'\n[state.walk]\n[[trigger]]\nfrom = 'walk'\nto = 'rest'\n"
            "when = { since_state = 'rest', at_least = '0.5 s' }"
        ),
        [HERE],
    )
    seen = []
    for _ in range(96):
        scene.run(1)
        seen.append(states(scene)[0])
    changes = [k for k in range(1, 96) if seen[k] != seen[k - 1]]
    assert np.diff(changes).tolist() == [16, 8, 16, 8, 16, 8]


def test_reaches_a_goal_or_its_own():
    goals = [goal("gate", 0, 0), goal("pond", 10, 0)]  # newborns are bound to the first
    assert moved(world(two_states('{ reaches_goal = "pond" }'), [HERE, (10, 0)], goals=goals)) == [False, True]
    assert moved(world(two_states('{ reaches_goal = "its own" }'), [HERE, (10, 0)], goals=goals)) == [True, False]


def test_distance_to_a_place():
    places = [(9, 0), (11, 0)]
    condition = '{ distance_to = "gate", below = "10 m" }'
    assert moved(world(two_states(condition), places, goals=[goal("gate", 0, 0)])) == [True, False]
    condition = '{ distance_to = "yard", above = "10 m" }'
    assert moved(world(two_states(condition), places, areas=[area("yard", -2, -2, 2, 2)])) == [False, True]


def test_distance_to_the_centre_of_an_area_whatever_its_corners_and_of_several_to_the_nearest():
    yard = area("yard", -2, -2, 2, 2)
    yard.polygon = np.insert(yard.polygon, 0, at(-2, 0) + [(0.0, 0.4 - 0.1 * k) for k in range(4)], axis=0)
    places = [(9, 0), (11, 0), (0, 58), (0, 39)]
    scene = world(
        two_states('{ distance_to = "yard", above = "10 m" }'), places, areas=[yard, area("yard", -2, 48, 2, 52)]
    )
    assert moved(scene) == [False, True, False, True]


# time ------------------------------------------------------------------------------


def test_level_time():
    scene = world(two_states('{ level_time = "0.5 s" }'), [HERE])
    assert moved(scene, 16) == [False]
    assert moved(scene) == [True]
    scene = world(two_states('{ all = [{ level_time = "0.5 s", until = "0.6 s" }, { event = "go" }] }'), [HERE])
    scene.submit(Event("go"), tick=24)
    assert moved(scene, 30) == [False]


def test_time_in_state():
    scene = world(two_states('{ time_in_state = "0.5 s" }'), [HERE])
    assert moved(scene, 16) == [False]
    assert moved(scene) == [True]


def test_a_range_of_time_is_drawn_by_each_animal():
    scene = world(two_states('{ time_in_state = "0.5..1 s" }'), [(4 * k, 0) for k in range(12)])
    left = []
    for _ in range(34):
        left.append(sum(moved(scene)))
    assert left[15] == 0 and left[-1] == 12 and len(set(left)) > 4


# motion ------------------------------------------------------------------------------


def at_speed(condition, speed, before=None):
    scene = world(two_states(condition), [HERE])
    scene.agents[Velocity.xyz][0] = (0.6 * speed, 0.8 * speed, 0.0)
    scene.agents[ProgramState.before][0] = scene.agents[Velocity.xyz][0] if before is None else before
    return moved(scene)[0]


def test_speed_above_and_below():
    assert at_speed('{ speed_above = "3 m/s" }', 3.1) and not at_speed('{ speed_above = "3 m/s" }', 2.9)
    assert at_speed('{ speed_below = "3 m/s" }', 2.9) and not at_speed('{ speed_below = "3 m/s" }', 3.1)
    assert at_speed('{ speed_above = "3.6 km/h" }', 1.1) and not at_speed('{ speed_above = "2 BL/s" }', 1.9)


def test_acceleration_above():
    condition = '{ acceleration_above = "10 m/s²" }'
    assert at_speed(condition, 1.0, before=(0.6, 0.8 - 11 * TICK, 0.0))
    assert not at_speed(condition, 1.0, before=(0.6, 0.8 - 9 * TICK, 0.0))
    scene = world(two_states(condition), [HERE])
    scene.run(2)
    scene.agents[Velocity.xyz][0] = (0.5, 0.0, 0.0)  # 16 m/s² more than in the last tick
    assert moved(scene) == [True]


@pytest.mark.parametrize("begins", ["given", "replaced"])
def test_who_begins_a_program_has_not_just_been_accelerated(begins):
    asks = two_states('{ acceleration_above = "10 m/s²" }')
    scene = world(asks if begins == "given" else two_states('{ level_time = "100 s" }'), [HERE])
    scene.agents[Velocity.xyz][0] = (3.0, 0.0, 0.0)
    scene.submit(GiveProgram("small") if begins == "given" else UseProgram("small", asks.source.decode()))
    assert moved(scene) == [False]
    scene.agents[Velocity.xyz][0] = (2.0, 0.0, 0.0)
    scene.run(1)
    assert moved(scene) == [True]


def test_a_condition_of_a_user_gets_what_it_says_that_it_needs(monkeypatch):
    monkeypatch.setattr(trigger_module, "_kinds", dict(trigger_module.conditions()))

    @trigger_module.condition
    class Brakes(trigger_module.Condition):
        needs = ("before",)
        brakes: float

        def holds(self, senses, rows):
            return (senses.before[rows] - senses.velocity[rows])[:, 0] > self.brakes

    def braking():
        scene = world(two_states("{ brakes = 0.4 }"), [HERE])
        scene.agents[Velocity.xyz][0] = (1.0, 0.0, 0.0)
        scene.run(1)
        scene.agents[Velocity.xyz][0] = (0.5, 0.0, 0.0)
        return moved(scene)

    assert braking() == [True]
    Brakes.needs = ()
    with pytest.raises(PluginError, match=r'asks for senses.before must say so: needs = \("before",\)'):
        braking()


def ramp(rise):
    """Ground that rises to the east by so much a metre."""
    x = (np.arange(50) + 0.5) * SIZE / 50
    return Raster(SIZE / 50, np.tile(rise * x, (50, 1)))


def test_slope_above_and_below():
    for condition, rise, expected in (
        ("{ slope_above = 0.3 }", 0.31, True), ("{ slope_above = 0.3 }", 0.29, False),
        ('{ slope_above = "17°" }', 0.31, True), ('{ slope_above = "30 %" }', 0.29, False),
        ("{ slope_below = 0.3 }", 0.29, True), ("{ slope_below = 0.3 }", 0.31, False),
    ):  # fmt: skip
        scene = world(two_states(condition), [HERE], relief=ramp(rise))
        assert moved(scene)[0] == expected, (condition, rise)
        assert scene.agents[Ground.slope][0, 0] == pytest.approx(rise)


def test_height_above_and_below():
    def high(condition, z, **more):
        scene = world(two_states(condition), [HERE], **more)
        scene.agents[Position.xyz][0, 2] = z
        return moved(scene)[0]

    assert high('{ height_above = "5 m" }', 6.0) and not high('{ height_above = "5 m" }', 4.0)
    assert high('{ height_below = "5 m" }', 4.0) and not high('{ height_below = "5 m" }', 6.0)
    relief = ramp(0.1)  # 10 m high in the middle
    assert not high('{ height_above = "5 m" }', 10.0, relief=relief)
    assert high('{ height_above = "5 m", over = "sea" }', 10.0, relief=relief)


# what happens -----------------------------------------------------------------------


def test_an_event_is_heard_by_all_or_near_by_in_the_same_tick():
    for told, expected in ({}, [True, True]), ({"x": SIZE / 2, "y": SIZE / 2, "radius": 5.0}, [True, False]):
        scene = world(two_states('{ event = "alarm" }'), [HERE, FAR])
        assert moved(scene) == [False, False]
        scene.submit(Event("alarm", **told), tick=1)
        assert moved(scene) == expected
        assert moved(scene, 3) == expected


def test_a_zone_raises_an_event():
    for reach, expected in ((0.0, [True, False, False]), (10.0, [True, True, False]), (-1.0, [True, True, True])):
        scene = world(
            two_states('{ event = "gate" }'), [FAR, (8, 0), (-50, 0)],
            zones=[zone("gate", -2, -2, 2, 2, event="gate", event_reach=reach)],
        )  # fmt: skip
        assert moved(scene, 2) == [False] * 3
        put(scene, [HERE, (8, 0), (-50, 0)])
        assert moved(scene) == expected, reach


def test_who_is_born_in_a_zone_or_begins_there_does_not_enter_it():
    gate = zone("gate", -2, -2, 2, 2, event="gate", event_reach=-1.0)
    scene = world(two_states('{ event = "gate" }'), [HERE, FAR], zones=[gate])
    scene.agents[Velocity.xyz][0] = (5 * 32, 0, 0)
    assert moved(scene, 2) == [False] * 2
    newborn = small_herd.put(scene, at(0, 0), species="sheep", brush="graze", speed=5 * 32.0)
    assert moved(scene, 2)[:2] == [False] * 2
    scene.world.delete_entity(int(newborn[0]))
    put(scene, [FAR, FAR, FAR])
    assert moved(scene, 2) == [False] * 2
    put(scene, [HERE, FAR])
    assert moved(scene) == [True] * 2


def test_a_state_raises_an_event():
    text = (
        "[state.calm]\n[state.run]\nemits = 'alarm'\nemits_within = '10 m'\n[[trigger]]\nfrom = 'calm'\nto = 'run'\n"
        "when = { any = [{ event = 'alarm' }, { sees_more_than = 1 }] }"
    )
    scene = world(program(text), [HERE, (2, 0), (0, 2), (9, 0), (25, 0)])
    scene.run(1)
    assert states(scene) == ["run", "run", "run", "calm", "calm"]
    scene.run(1)
    assert states(scene) == ["run", "run", "run", "run", "calm"]


def test_a_death_is_seen_near_by_and_not_behind_a_wall():
    places = [HERE, (3, 0), (30, 0), (-3, -8)]
    condition = '{ death_of = "goat", within = "10 m" }'
    for things, expected in ({}, [True, False, True]), ({"obstacles": [wall(-4, -6, 4, -5)]}, [True, False, False]):
        kinds = ["sheep", "goat", "sheep", "sheep"]
        scene = world(two_states(condition), places, kinds, **things)
        assert moved(scene, 2) == [False] * 4
        scene.submit(RemoveAnimals(*at(3, 0).tolist(), 0.5))
        assert moved(scene) == expected
    scene = world(two_states('{ death_of = "kin", within = "10 m" }'), places, kinds)
    scene.run(2)
    scene.submit(RemoveAnimals(*at(3, 0).tolist(), 0.5))
    assert not any(moved(scene))


def test_a_birth_is_seen():
    scene = world(two_states('{ birth_of = "goat", within = "3 m" }'), [HERE, FAR])
    assert moved(scene, 2) == [False, False]
    scene.submit(AddAnimals("graze", *at(2, 0).tolist(), 0.6, 1, "goat"))
    assert moved(scene)[:2] == [True, False]


# chance and logic ---------------------------------------------------------------------


def test_a_random_rate_is_the_rate_of_leaving():
    scene = world(two_states('{ rate = "0.5 /s" }'), [(4 * (k % 20) - 40, 4 * (k // 20) - 40) for k in range(26)])
    totals = []
    for seed in range(12):
        scene = world(two_states('{ rate = "0.5 /s" }'), [(4 * k, 0) for k in range(26)], level={"seed": seed})
        totals.append(sum(moved(scene, 32)))
    share = np.sum(totals) / (12 * 26)
    expected = 1 - np.exp(-0.5)
    assert abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / (12 * 26))


def test_a_rate_grows_with_neighbours_in_a_state_and_with_the_distance_to_them():
    """Ginelli et al. 2015, eqs. 1 and 2, computed by hand for one animal with three neighbours."""
    from flockbrush.behaviours.trigger import read_condition
    from flockbrush.behaviours.triggers.rate import RandomRate

    asked = {"rate": "2 /s", "imitating": "moved", "gain": 15.0, "power": 2.0, "spread": "4 m", "nearest": 2}
    condition, mistakes = read_condition(asked)
    assert isinstance(condition, RandomRate) and not mistakes
    factor = factors(condition, [HERE, (1, 0), (0, 2), (-3, 0)], x=1)
    assert factor[0] == pytest.approx((1.5 / 4) * (1 + 15 * 1))  # nearest two at 1 and 2 m; one of them has moved
    condition, _ = read_condition({"rate": "2 /s", "packed": "4 m", "imitating": "moved", "gain": 3.0})
    assert factors(condition, [HERE, (1, 0), (0, 2), (-3, 0)], x=-3)[0] == pytest.approx(4 / 2.0 * (1 + 3))


def factors(condition, places, x):
    """What multiplies the rate of each animal, while the one at (x, 0) has moved."""
    from flockbrush.components import Species
    from flockbrush.systems.program_senses import WorldSenses
    from flockbrush.systems.programs import Programs

    scene = world(two_states('{ level_time = "100 s" }'), places)
    scene.submit(SetState("small", "moved", x=SIZE / 2 + x, y=SIZE / 2, radius=0.5))
    scene.run(1)
    put(scene, places)
    senses = WorldSenses(scene.world, scene.world.resource(Programs), [])
    senses.program(scene.world.resource(Programs).compiled[0])
    rows = np.arange(len(places))
    flags, out = senses.in_state("moved"), np.ones(len(places))
    assert scene.agents[Species.index].max() == 0
    condition._weigh(senses, rows, flags, out)
    return out


def test_all_any_and_not():
    goals = [goal("gate", 0, 0)]
    a, b = '{ reaches_goal = "gate" }', "{ sees_more_than = 0 }"
    places = [HERE, (1.5, 0), (20, 0), (21.5, 0), (-1.8, -30), (0, -60)]
    near = [True, True, False, False, False, False]
    seen = [True, True, True, True, False, False]

    def held(condition):
        return moved(world(two_states(condition), places, goals=goals))

    assert held(f"{{ all = [{a}, {b}] }}") == [x and y for x, y in zip(near, seen, strict=True)]
    assert held(f"{{ any = [{a}, {b}] }}") == [x or y for x, y in zip(near, seen, strict=True)]
    assert held(f"{{ not = {b} }}") == [not y for y in seen]
    assert held(f"{{ all = [{{ not = {a} }}, {b}] }}") == [False, False, True, True, False, False]
    assert region(0, 0, 1, 1).shape == (4, 2)
