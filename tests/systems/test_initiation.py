"""Scattered birds that find into a line formation."""

import numpy as np
import pytest
from flockbrush.behaviours.formation.formation_shapes import textbook
from flockbrush.behaviours.formation.reaching import FormingRules, home_, part_in_height, reach_
from flockbrush.systems.initiation import Flying, Following, decide, initiate, random_flock, target_of

ALONE = FormingRules(
    hidden_points=True,
    ahead_only=False,
    loyal=False,
    signed_gain=False,
    homing=False,
    capacity=False,
    apart=False,
    farthest=float("inf"),
    look_ahead=0.0,
    onward=np.pi,
)  # fmt: skip  the paper, and nothing else


def target(kind="V", birds=9):
    return target_of(*textbook(kind, birds))


# what one bird does ---------------------------------------------------------------


def test_speed_and_direction_are_equations_5_and_6():
    rules = ALONE._replace(most_faster=10.0, most_turn=10.0, slowest=0.0, fastest=10.0)
    x, y, heading, speed = 0.0, 0.0, 0.1, 0.3
    tx, ty, lead = 3.0, 4.0, 0.35
    off = np.arctan2(tx, ty) - heading
    v, theta = reach_(x, y, heading, speed, tx, ty, lead, 0.0, rules)
    assert v == pytest.approx(lead * (1 - abs(off) / np.pi + 0.06 * np.sqrt(5.0 - lead)))
    assert theta == pytest.approx(heading + 0.2 * off / 5.0)


def test_nobody_changes_faster_than_a_goose_can():
    rules = FormingRules()
    v, theta = reach_(0.0, 0.0, 0.0, rules.cruise, 30.0, 2.0, rules.cruise, 0.0, rules)
    assert abs(v - rules.cruise) <= 0.02 * rules.cruise + 1e-15
    assert 0 < theta <= np.radians(4) + 1e-15


def test_who_is_before_its_place_slows_and_who_is_behind_hurries():
    rules, v0 = FormingRules(), FormingRules().cruise
    behind = reach_(0.0, 0.0, 0.0, v0, 0.0, 5.0, v0, 0.0, rules)
    before = reach_(0.0, 0.0, 0.0, v0, 0.0, -2.0, v0, 0.0, rules)
    assert before[0] < v0 < behind[0]
    assert behind[1] == before[1] == 0.0


def test_in_place_a_bird_keeps_pace():
    v0 = FormingRules().cruise
    assert reach_(0.0, 0.0, 0.0, v0, 0.0, v0, v0, 0.0, FormingRules()) == pytest.approx((v0, 0.0))


def test_who_follows_nobody_turns_to_the_track_and_waits_for_the_leader():
    v0 = FormingRules().cruise
    assert 0 < home_(0.5, v0, False, FormingRules())[1] < 0.5
    assert home_(0.0, v0, True, FormingRules())[0] < v0


def test_two_on_a_course_for_one_another_part_in_height_and_come_back():
    climb = np.zeros(2)
    part_in_height(
        np.array([0.0, 4.0]), np.zeros(2), np.zeros(2), np.array([0.5, -0.5]), np.full(2, 0.5), FormingRules(), climb
    )
    assert climb[0] < 0 < climb[1]
    part_in_height(
        np.array([0.0, 4.0]), np.zeros(2), np.array([1.0, 0.0]), np.zeros(2), np.full(2, 0.5), FormingRules(), climb
    )
    assert climb[0] < 0 == climb[1]


# whom a bird follows ----------------------------------------------------------------


def decided(x, y, reference, side, slot, rules=None, leader=0, heading=0.0, count=(4, 4), perceived=None):
    """One decision of a flock whose first bird leads."""
    n = len(x)
    birds = Flying(np.array(x, float), np.array(y, float), np.full(n, float(heading)))
    now = Following(np.array(reference), np.array(side), np.array(slot))
    new = Following(np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64))
    perceived = np.ones((n, n), bool) if perceived is None else perceived
    decide(birds, leader, now, np.array(count), rules or FormingRules(), perceived, new)
    return [column.tolist() for column in new]


def test_the_nearest_visible_bird_ahead_becomes_the_reference():
    reference, side, _ = decided([0, 2, 3, 4], [9, 5, 0, -9], [-1, 0, -1, -1], [0, 1, 0, 0], [0, 1, -1, -1])
    assert reference == [-1, 0, 1, 2]
    assert side == [0, 1, 1, 1]  # as the reference, or the side one is on


def test_whom_a_bird_does_not_perceive_it_does_not_follow_and_a_lost_reference_is_given_up():
    told = [0, 2, 3], [9, 5, 0], [-1, 0, 1], [0, 1, 1], [0, 1, 2]
    assert decided(*told)[0] == [-1, 0, 1]
    perceived = np.ones((3, 3), bool)
    perceived[2, 1] = False
    assert decided(*told, perceived=perceived)[0] == [-1, 0, 0]
    perceived[2, :] = False
    assert decided(*told, perceived=perceived)[0] == [-1, 0, -1]


def test_birds_that_see_far_enough_find_their_places_and_those_that_do_not_never():
    x, y, heading = random_flock(9, 3)
    target = target_of(0.9 * np.arange(-4, 5), -0.8 * np.abs(0.9 * np.arange(-4, 5)))
    whole = initiate(x, y, heading, target)
    assert initiate(x, y, heading, target, reach=60.0).frames == whole.frames > 0
    assert initiate(x, y, heading, target, reach=0.5, most=1500).frames == -1


def test_a_goose_hidden_behind_another_is_not_followed():
    # 2 lies exactly behind 1, seen from 3; 1 is on the other side of 3's narrow volume border
    x, y = [0, 0, 0, 0], [30, 10, 11, 0]
    reference, *_ = decided(x, y, [-1, 0, 0, -1], [0, 1, 1, 0], [0, 1, 1, -1], FormingRules(separation=False))
    assert reference[3] == 1
    seen = decided(
        [0, 5, 8, 0], [30, 1, 1.6, 0], [-1, 0, 0, -1], [0, 1, 1, 0], [0, 1, 1, -1], FormingRules(separation=False)
    )
    assert seen[0][3] in (0, 1)  # 2 is hidden by 1


def test_of_two_rivals_the_rear_one_takes_another():
    reference, side, slot = decided([0, 2, 3], [9, 5, 4], [-1, 0, 0], [0, 1, 1], [0, 1, 1])
    assert reference == [-1, 0, 1]
    assert slot == [0, 1, 2]
    far = decided([0, 2, 16], [9, 5, 4], [-1, 0, 0], [0, 1, 1], [0, 1, 1])
    assert far[0] == [-1, 0, 0]  # not yet: they are more than ten wingspans apart
    sides = decided([0, 2, -2], [9, 5, 4], [-1, 0, 0], [0, 1, -1], [0, 1, 1])
    assert sides[0] == [-1, 0, 0]  # the leader has two sides
    without = decided([0, 2, 3], [9, 5, 4], [-1, 0, 0], [0, 1, 1], [0, 1, 1], FormingRules(separation=False))
    assert without[0] == [-1, 0, 0]


def test_who_is_beyond_the_end_of_an_arm_goes_to_the_other():
    x, y = [0, 1.2, 2.4, 3.6], [0, -1, -2, -3]
    before = [-1, 0, 1, 2], [0, 1, 1, 1], [0, 1, 2, 3]
    reference, side, slot = decided(x, y, *before, count=(1, 2))
    assert (reference[3], side[3], slot[3]) == (0, -1, 1)
    assert decided(x, y, *before, FormingRules(capacity=False), count=(1, 2))[0] == [-1, 0, 1, 2]


def test_birds_that_follow_one_another_in_a_ring_look_again():
    reference, *_ = decided([0, 2, 3, 4], [9, 3, 4, 5], [-1, 2, 3, 1], [0, 1, 1, 1], [0, -1, -1, -1])
    assert reference[3] == 0


# whole flocks -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["V", "U", "J", "line"])
@pytest.mark.parametrize("birds", [9, 28])
def test_scattered_birds_find_their_places_and_touch_nobody_on_the_way(kind, birds):
    for seed in (11, 12, 13):
        went = initiate(*random_flock(birds, seed), target(kind, birds))
        assert 0 < went.frames < 1500
        assert went.least >= 0.5
        assert went.longest < 4 * birds


@pytest.mark.parametrize("start", ["column", "row", "two flocks", "cluster"])
def test_they_find_them_from_anywhere(start):
    n = 14
    x, y, heading = random_flock(n, 5)
    if start == "column":
        x, y = 0.2 * np.sin(np.arange(n)), -1.5 * np.arange(n)
    elif start == "row":
        x, y = 1.5 * np.arange(n), 0.3 * np.sin(np.arange(n))
    elif start == "two flocks":
        x = x + np.where(np.arange(n) < 7, -15, 15)
    else:
        x, y, heading = *random_flock(n, 5, density=2.0, gap=0.9)[:2], 0.2 * heading
    went = initiate(x, y, heading, target("V", n))
    assert went.frames > 0
    assert went.least >= 0.5


def test_a_bird_may_have_its_place_level_with_or_ahead_of_the_one_it_follows():
    x, y = textbook("V", 9)
    y = np.array([-1.0, -0.4, -1.0, -0.4, 0.0, -0.4, -1.0, -0.4, -0.4])
    assert (target_of(x, y).dy[:, 1:] <= 0).sum() == 3
    for seed in range(4):
        assert initiate(*random_flock(9, 40 + seed), target_of(x, y)).frames > 0


def test_the_papers_rules_alone_do_not_get_there():
    assert [initiate(*random_flock(9, seed), target(), ALONE, most=3000).frames for seed in range(3)] == [-1] * 3


def test_a_flock_that_stands_in_formation_stays():
    x, y = textbook("V", 9)
    went = initiate(x, y, np.zeros(9), target())
    assert went.frames < 40


def test_positions_are_kept_when_asked():
    went = initiate(*random_flock(5, 1), target("V", 5), step=10)
    assert went.track.shape[1:] == (5, 3)
    assert len(went.track) == (went.frames + 60) // 10 + 1
    assert initiate(*random_flock(5, 1), target("V", 5)).track.shape[0] == 0
    again = initiate(*random_flock(5, 1), target("V", 5), step=10)
    assert again.track.tolist() == went.track.tolist()
