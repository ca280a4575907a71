"""Birds that keep the V rules: one alone with two others first, then whole flocks, then flocks in a world."""

import numpy as np
import pytest
from flockbrush.behaviours.v_rules.flights import SIDE, fly, starts
from flockbrush.behaviours.v_rules.indicators import SHAPES, indicators, leaders_of, lines_of
from flockbrush.behaviours.v_rules.rules import OVERLAP, VRuleSettings, law_of, wish
from flockbrush.components import Position, Velocity
from flockbrush.engine.noise import Noise, key_
from flockbrush.engine.state import restore, snapshot
from hypothesis import given
from hypothesis import strategies as st
from small_herd import brush, forward_of, meadow, point_to_segment, put

from flockbrush.runs.v_measures import flying_alike

BEST = 1 + OVERLAP  # wingspans from body to body where upwash is best
STEP = 0.06


def wished(*others, chance=0.0, **rules):
    """What a bird at the origin would do (to the side, forward) when others are at these places."""
    x, y = np.array([(0.0, 0.0), *others], float).T.copy()
    law = law_of(VRuleSettings(**rules))
    side, forward, _ = wish(law, 0, len(x), x, y, np.zeros(len(x)), np.argsort(x), chance)
    return pytest.approx((side, forward), abs=1e-12)


def flock(*xy):
    """A formation as the indicators want it: (1, n, 3)."""
    return np.column_stack([np.array(xy, float), np.zeros(len(xy))])[None]


def shape_of(*xy):
    return SHAPES[indicators(flock(*xy)).shape[0]]


def arm(birds, side, x=0.0, y=0.0, slope=0.4):
    """Birds one behind the other at the best places."""
    return [(x + side * BEST * k, y - slope * k) for k in range(1, birds + 1)]


# one bird ----------------------------------------------------------------------------------


def test_a_bird_far_behind_comes_forward_to_the_nearest():
    assert wished((0.3, 5.0), (4.0, 9.0)) == (0, STEP)


def test_a_bird_beside_the_wake_goes_sideways_or_forward_by_the_distances_that_are_left():
    # 3 to the side, 1 behind: three times in four to the side
    assert wished((3.0, 1.0), chance=0.74) == (STEP, 0)
    assert wished((-3.0, 1.0), chance=0.74) == (-STEP, 0)
    assert wished((3.0, 1.0), chance=0.76) == (0, STEP)


def test_a_bird_in_the_wake_shifts_to_the_best_place_and_stays_there():
    assert wished((0.2, 0.5)) == (-STEP, 0)
    assert wished((BEST - 0.02, 0.5)) == (-0.02, 0)  # the last step ends at the place
    assert wished((BEST, 0.5)) == (0, 0)


def test_who_sees_nobody_ahead_leads():
    assert wished((0.5, -1.0), (-3.0, -0.2)) == (0, 0)
    level = (3.0, 0.1)  # 88° to the side
    assert wished(level) != (0, 0)
    assert wished(level, angle=170.0) == (0, 0)


def test_a_bird_does_not_enter_a_gap_too_narrow_for_it():
    narrow, wide = 2 * BEST - 0.05, 2 * BEST + 0.05
    behind = 0.3  # it flies behind the left one of two
    assert wished((0.1, behind), (0.1 + narrow, behind)) == (-STEP, 0)
    assert wished((-0.1, behind), (-0.1 + wide, behind)) == (STEP, 0)
    assert wished((-0.1, behind), (-0.1 + narrow, behind)) == (-STEP, 0)


def test_birds_behind_do_not_make_gaps_narrow():
    ahead, behind = (-0.1, 0.3), (1.4, -0.2)
    assert wished(ahead, behind) == (STEP, 0)
    assert wished(ahead, behind, gaps_between="all") == (-STEP, 0)


def test_a_place_hidden_by_a_wing_is_not_sought():
    # four abreast with no room between: the place to the right is nearer, and behind the wing of the second from right
    row = [(-1.3, 0.4), (-0.2, 0.3), (0.9, 0.35), (1.1, 0.6)]
    assert wished(*row, sight="free") == (STEP, 0)
    assert wished(*row) == (-STEP, 0)


def test_with_spacing_alone_birds_stack():
    # at the best place behind one, right behind another
    assert wished((BEST, 0.5), (0.0, 0.9), station="spaced") == (0, 0)
    assert wished((BEST, 0.5), (0.0, 0.9)) != (0, 0)


def test_noise_keys_inside_a_kernel_are_those_of_the_world():
    noise = Noise(7)
    assert key_(noise.stream("v_rules"), 12) == noise.key("v_rules", 12)


# flocks ------------------------------------------------------------------------------------


@given(st.integers(0, 10**6), st.sampled_from([5, 9]), st.sampled_from([180.0, 150.0]))
def test_birds_never_come_too_near_one_another(seed, birds, angle):
    rules = VRuleSettings(angle=angle)
    series = fly(starts([seed], birds, rules), [seed], rules, 120, every=10).series[0]
    for xyz in series:
        dx, dy = (np.abs(xyz[:, None, k] - xyz[None, :, k])[np.triu_indices(birds, 1)] for k in (0, 1))
        assert ((dx >= 1 - 1e-5) | (dy >= rules.margin - 1e-5)).all()


def test_a_flock_flies_the_same_alone_in_a_batch_and_on_more_threads():
    from flockbrush.engine.parallel import set_threads

    seeds = range(3000)
    begin = starts(seeds, 4)
    many = fly(begin, seeds, steps=40)
    before = set_threads(1)
    again = fly(begin, seeds, steps=40)
    set_threads(before)
    one = fly(begin[[7]], [7], steps=40)
    assert many.xyz.tobytes() == again.xyz.tobytes()
    assert many.xyz[7].tobytes() == one.xyz[0].tobytes()
    assert np.unique(many.xyz[:, 0, 0]).size == 3000  # each its own chance


def test_a_settled_flock_stays_as_it_is():
    once = fly(starts([3], 9), [3])
    later = fly(once.xyz, [99], steps=50)
    assert once.settled[0] and later.steps[0] == 0
    assert later.xyz.tobytes() == once.xyz.tobytes()


def test_the_ground_sees_the_same_flock_fly_on():
    begin = starts([3], 6)
    flock, world = (fly(begin, [3], steps=60, frame=frame, every=20) for frame in ("flock", "world"))
    way = VRuleSettings().cruise * np.arange(4) * 20
    assert world.series[0, :, :, 1] == pytest.approx(flock.series[0, :, :, 1] + way[:, None])
    assert world.series[0, :, :, 0].tolist() == flock.series[0, :, :, 0].tolist()


def test_birds_begin_apart_unless_told():
    def close(xyz):
        dx, dy = (np.abs(xyz[:, :, None, k] - xyz[:, None, :, k]) for k in (0, 1))
        return ((dx < 1) & (dy < 0.18))[:, *np.triu_indices(30, 1)].any()

    assert not close(starts(range(20), 30))
    assert close(starts(range(20), 30, apart=False))
    assert starts([1], 30)[:, :, :2].min() >= 0
    assert starts([1], 30).max() <= SIDE


# what the paper claims, on few flocks; `flockbrush sweep v_rules` has a thousand each


@pytest.fixture(scope="module")
def paper():
    seeds = range(60)
    return {
        angle: (flights := fly(starts(seeds, 15), seeds, VRuleSettings(angle=angle)), indicators(flights.xyz))
        for angle in (180.0, 170.0)
    }


def test_at_180_degrees_a_flock_settles_with_one_lead_in_one_group_and_two_lines(paper):
    flights, found = paper[180.0]
    assert flights.settled.mean() >= 0.97
    assert found.leads.mean() == pytest.approx(1.0, abs=0.05)
    assert found.groups.mean() == pytest.approx(1.0, abs=0.05)
    assert found.segments.mean() == pytest.approx(2.0, abs=0.15)
    assert np.isin(found.shape, [SHAPES.index(name) for name in ("V", "J", "echelon")]).mean() > 0.95


def test_at_170_degrees_it_takes_longer_and_there_is_more_of_everything(paper):
    (fast, few), (slow, many) = paper[180.0], paper[170.0]
    assert slow.steps.mean() > fast.steps.mean()
    assert many.leads.mean() > few.leads.mean() + 0.5
    assert many.groups.mean() > few.groups.mean() + 0.3
    assert many.segments.mean() > few.segments.mean() + 0.7


OTHERWISE = {
    "update": "together",
    "approach": "box",
    "gaps_between": "all",
    "station": "spaced",
    "sight": "free",
    "nearest": "lateral",
    "shift": "fixed",
    "blocked": "stay",
    "wake_begins": "wingtip",
}


@pytest.mark.parametrize(("detail", "choice"), OTHERWISE.items())
def test_every_open_detail_can_be_settled_otherwise(detail, choice):
    begin = starts(range(6), 15)
    usual, other = (fly(begin, range(6), rules, 400) for rules in (VRuleSettings(), VRuleSettings(**{detail: choice})))
    assert not np.array_equal(usual.xyz, other.xyz)


def test_without_the_coin_birds_block_one_another_for_ever():
    seeds = range(20)
    assert fly(starts(seeds, 15), seeds, VRuleSettings(blocked="stay")).settled.mean() < 0.2


# beyond the paper


def test_birds_that_must_turn_to_get_sideways_settle_too():
    seeds = range(20)
    rules = VRuleSettings(turn=0.06)
    flights = fly(starts(seeds, 15), seeds, rules)
    assert flights.settled.mean() >= 0.9
    assert indicators(flights.xyz).leads.mean() == pytest.approx(1.0, abs=0.05)


def test_a_flock_that_is_blown_about_never_settles_and_still_has_one_lead():
    rules = VRuleSettings(perturbation=0.01)
    flights = fly(starts([1, 2], 9), [1, 2], rules, 1500, every=50)
    assert not flights.settled.any()
    for series in flights.series:
        late = indicators(series[20:], rules)
        assert late.leads.mean() < 1.5
        assert len(np.unique(series[-5:, 0, 0])) == 5


def test_in_three_dimensions_a_flock_comes_together_at_one_height():
    seeds = range(8)
    rules = VRuleSettings(layer=1.0)
    flights = fly(starts(seeds, 9, rules), seeds, rules)
    before, after = starts(seeds, 9, rules)[:, :, 2].std(1), flights.xyz[:, :, 2].std(1)
    assert (before > 2.0).all()
    assert np.median(after) < 0.5


# indicators --------------------------------------------------------------------------------


def test_shapes_are_told_by_their_names():
    v = [(0, 0), *arm(4, 1), *arm(3, -1)]
    assert shape_of(*v) == "V"
    assert shape_of((0, 0), *arm(5, 1), *arm(2, -1)) == "J"
    assert shape_of((0, 0), *arm(5, 1)) == "echelon"
    assert shape_of((0, 0), *arm(5, 1), *arm(2, -1, slope=0.05)) == "echelon"  # nearly level: one line
    assert shape_of((0, 0), *arm(3, 1, slope=-0.4), *arm(3, -1, slope=-0.4)) == "inverted V"
    assert shape_of(*v, *[(x + 30, y) for x, y in v]) == "several groups"
    assert shape_of(*v, (0.1, -0.3)) == "cluttered"


def test_a_w_has_two_leads_and_four_lines():
    left = [(0, 0), *arm(2, -1), *arm(2, 1)]
    right = [(4 * BEST, 0), *arm(2, 1, 4 * BEST), *arm(1, -1, 4 * BEST)]
    found = indicators(flock(*left, *right))
    assert SHAPES[found.shape[0]] == "W"
    assert (found.leads[0], found.groups[0], found.segments[0]) == (2, 1, 4)


def test_a_straight_v_lies_on_its_two_lines_and_a_bird_beside_it_does_not():
    v = [(0, 0), *arm(4, 1), *arm(4, -1)]
    found = indicators(flock(*v))
    assert (found.leads[0], found.groups[0], found.segments[0]) == (1, 1, 2)
    assert found.distance[0] == pytest.approx(0.0, abs=1e-12)
    v[2] = (v[2][0], v[2][1] + 0.3)
    slope = np.hypot(BEST, 0.4)
    assert indicators(flock(*v)).distance[0] == pytest.approx(0.3 * BEST / slope / 9)


def test_lines_run_from_the_last_birds_to_the_lead():
    v = flock((0, 0), *arm(2, 1), *arm(3, -1))[0]
    assert sorted(map(tuple, lines_of(v).tolist())) == [(2, 0), (5, 0)]
    assert leaders_of(v).tolist() == [True] + [False] * 5


def test_lines_end_where_two_birds_follow_one():
    # a lead, one behind it, and two arms behind that one
    birds = flock((0, 0), (BEST, -0.6), *arm(2, 1, BEST, -0.6), *arm(2, -1, BEST, -1.0))
    found = indicators(birds)
    assert (found.leads[0], found.segments[0]) == (1, 2)
    assert sorted(map(tuple, lines_of(birds[0]).tolist())) == [(3, 1), (5, 1)]
    # the lead stands on neither: it counts with both
    xy = birds[0, :, :2]
    ends = [point_to_segment(xy, xy[[last]], xy[[1]]) for last in (3, 5)]
    expected = np.where(np.arange(6) < 2, np.mean(ends, axis=0), np.min(ends, axis=0))
    assert expected[0] > np.min(ends, axis=0)[0] + 0.01
    assert found.distance[0] == pytest.approx(expected.mean())


def test_two_flocks_far_apart_have_their_own_lines():
    v = [(0, 0), *arm(3, 1), *arm(3, -1)]
    found = indicators(flock(*v, *[(x + 30, y) for x, y in v]))
    assert (found.leads[0], found.groups[0], found.segments[0]) == (2, 2, 4)


def test_a_bird_alone_has_no_line():
    found = indicators(flock((0, 0)))
    assert (found.leads[0], found.groups[0], found.segments[0]) == (1, 1, 0)
    assert np.isnan(found.distance[0])


# in a world --------------------------------------------------------------------------------

W = 1.5  # m, a wingspan


def geese(seed=3, birds=9, heading=np.pi / 2, guides=(), boundary="open", **rules):
    """A world with birds at the places of `starts`, flying at 8 m/s."""
    asset = brush("geese", model="v_rules", mean=8.0, vision={"range": 100.0, "occlusion": False}, wingspan=W, **rules)
    ground = {"width": 2000, "height": 2000, "cell": 50.0, "boundary": boundary, "guides": list(guides)}
    simulation = meadow(asset, seed=seed, **ground)
    begin = starts([seed], birds, VRuleSettings(**{k: v for k, v in rules.items() if k in VRuleSettings.model_fields}))
    along = np.array([np.cos(heading), np.sin(heading)])
    right = np.array([along[1], -along[0]])
    put(simulation, begin[0, :, :1] * W * right + begin[0, :, 1:2] * W * along + 900, heading, brush="geese")
    simulation.agents[Position.xyz][:, 2] = 100 + begin[0, :, 2] * W
    return simulation, begin, right, along


@pytest.mark.parametrize(
    "rules",
    [
        {},
        {"angle": 170.0},
        {"update": "together"},
        {"layer": 0.5},
        {"perturbation": 0.02},
        {"approach": "coin"},
        {"turn": 0.06, "cruise": 8 / 32 / 1.5},
    ],
    ids=str,
)
def test_a_flock_in_a_world_flies_as_the_experiment_does(rules):
    simulation, begin, _, _ = geese(**rules)
    series = fly(begin, [3], VRuleSettings(**rules), 150, every=1).series[0] * W
    for expected in series:
        xyz = simulation.agents[Position.xyz]
        assert xyz - xyz[0] == pytest.approx(expected - expected[0], abs=1e-8)
        simulation.tick()


def test_a_flock_flies_the_same_to_every_side():
    simulation, begin, right, along = geese(heading=2.0)
    expected = fly(begin, [3], steps=100).xyz[0] * W
    simulation.run(100)
    xy = simulation.agents[Position.xyz][:, :2]
    xy = np.column_stack([xy @ right, xy @ along])
    assert xy - xy[0] == pytest.approx((expected - expected[0])[:, :2], abs=1e-7)


def test_a_settled_flock_flies_straight_on_at_the_speed_of_its_brush():
    simulation, _, _, _ = geese(birds=5)
    simulation.run(600)
    assert simulation.agents[Velocity.xyz] == pytest.approx(np.tile([0, 8.0, 0], (5, 1)), abs=1e-9)
    assert forward_of(simulation) == pytest.approx(np.tile([0, 1.0], (5, 1)))


def test_a_flock_in_formation_follows_its_guide_through_a_bend():
    from flockbrush.runs.run import start
    from flockbrush.runs.v_measures import v_indicators

    skein = start("skein", seed=3)
    skein.run(32 * 20)
    assert v_indicators(skein)["leads"] == 1
    before = forward_of(skein).mean(0)
    skein.run(32 * 26)
    after = forward_of(skein).mean(0)
    assert before @ (1, 0) > 0.99
    assert after[1] > 0.5  # it has turned to the north-east with the guide
    assert v_indicators(skein)["groups"] == 1
    spread = skein.agents[Position.xyz].std(0)
    assert np.hypot(*spread[:2]) < 15 and spread[2] < 1e-6


def test_indicators_take_a_flock_on_the_seam_of_a_map_as_one():
    from flockbrush.runs.v_measures import v_indicators

    told = []
    for x in (900.0, 1999.0):  # of the first bird
        simulation = geese(boundary="wrap")[0]
        xyz = simulation.agents[Position.xyz]
        xyz[:, 0] = np.mod(xyz[:, 0] - xyz[0, 0] + x, 2000.0)
        told.append(v_indicators(simulation))
    assert np.ptp(xyz[:, 0]) > 1900.0
    assert told[1] == pytest.approx(told[0])


def test_skeins_that_fly_different_ways_are_measured_along_their_own():
    from flockbrush.runs.v_measures import v_indicators

    simulation, *_ = geese(birds=9)
    simulation.run(1200)
    one, alone = v_indicators(simulation), snapshot(simulation.world)
    xy = simulation.agents[Position.xyz][:, :2] - 900
    for turn in range(3):  # quarters
        restore(simulation.world, alone)
        there = np.linalg.matrix_power([[0.0, -1.0], [1.0, 0.0]], turn)
        put(simulation, xy @ there.T + 300, np.pi / 2 * (1 + turn), brush="geese")
        simulation.agents[Position.xyz][9:, 2] = 100
        both = v_indicators(simulation)
        assert one["segments"] > 0 and both["shape"] == "several groups"
        assert [both[name] for name in ("leads", "groups", "segments")] == [
            2 * one[name] for name in ("leads", "groups", "segments")
        ]
        assert both["distance"] == pytest.approx(one["distance"], abs=1e-6)


def test_birds_fly_alike_where_no_gap_of_headings_is_between_them():
    degrees = np.array([350, 10, 100, 95, 220, 30, 105])
    forward = np.column_stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    assert sorted(map(list, flying_alike(forward))) == [[0, 1, 5], [2, 3, 6], [4]]
    assert [len(rows) for rows in flying_alike(forward[:1])] == [1] and flying_alike(forward[:0]) == []
    angle = np.radians(np.arange(0, 360, 20))
    assert len(flying_alike(np.column_stack([np.cos(angle), np.sin(angle)]))) == 1


def test_birds_that_turn_face_the_way_they_shift():
    simulation, _, _, _ = geese(seed=4, birds=6, turn=0.06)
    simulation.run(30)
    velocity = simulation.agents[Velocity.xyz][:, :2]
    facing = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    assert forward_of(simulation) == pytest.approx(facing, abs=1e-9)
    assert np.abs(facing[:, 0]).max() > 0.05
    simulation.run(900)
    assert np.ptp(forward_of(simulation), axis=0).max() < 1e-6  # settled: all the same way again
