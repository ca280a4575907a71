"""Lateral motion in steady flight, and birds that change sides (Klotsman & Tal, step 4 and fig. 14)."""

import numpy as np
import pytest
from example_formations import CURVES, movie
from flockbrush.behaviours.formation.formation_shapes import Formation, FrameShape
from flockbrush.behaviours.formation.hummel import power, total_power
from flockbrush.behaviours.formation.sides import NEAREST
from flockbrush.behaviours.formation.steady_flight import Drawing, SteadyFlight
from flockbrush.behaviours.models.line_formation import Params, places

ALIVE = Drawing(lateral=True)
LEFT, RIGHT = list("dcba"), list("fghijklm")  # of the leader e, from left to right


def frame(name, left, right, leader="e", spacing=1.25):
    birds = (*left, leader, *right)
    x = tuple(spacing * (k - len(left)) for k in range(len(birds)))
    return FrameShape(
        name, birds, x, tuple(CURVES["V"].y(np.array(x))), len(left), "V", "", CURVES["V"], (), (spacing, 0.1),
        (0.0, 0.1),
    )  # fmt: skip


def switching(*arms):
    """A flight after an example whose frames have these birds left and right of the leader."""
    return Formation("switching", tuple(frame(str(k), *arm) for k, arm in enumerate(arms)))


OUTERMOST = switching((LEFT, RIGHT), (["m", *LEFT], RIGHT[:-1]))
INNERMOST = switching((LEFT, RIGHT), ([*LEFT, "f"], RIGHT[1:]))


def flown(flight, seconds, fps=4.0):
    return flight.frames(int(seconds * fps), fps)


def test_lateral_distances_are_those_of_step_1_at_its_shapes_and_even_at_key_shapes():
    flight = SteadyFlight(movie("V", 9), 12, seed=3, drawing=ALIVE)
    for k, shape in enumerate(flight.initial):
        assert flight.at(k * flight.chapter) == pytest.approx(shape, abs=1e-12)
        assert np.ptp(np.diff(shape[:, 0])) > 0.05
    for k in (1, 2):
        assert np.diff(flight.key(k)[:, 0]) == pytest.approx(np.full(11, 1.25))
        x, y = np.ascontiguousarray(flight.key(k).T)
        assert power(x, y).sum() == pytest.approx(total_power(x))  # Munk's theorem


def test_even_distances_come_from_the_range_of_the_examples_means():
    frames = tuple(frame(str(s), LEFT, RIGHT, spacing=s) for s in (1.1, 1.4))
    flight = SteadyFlight(Formation("wide and narrow", frames), 13, seed=1, drawing=ALIVE)
    flight.at(flight.chapter - 1e-6)
    means = [float(np.diff(shape[:, 0]).mean()) for shape in flight._chapters[0].keys[1:-1]]
    assert len(set(means)) == len(means) > 3 and 1.1 <= min(means) < max(means) <= 1.4


@pytest.mark.parametrize("kind", ["V", "J", "line"])
def test_in_lateral_motion_the_order_is_kept_and_nobody_goes_too_fast_or_into_a_downwash(kind):
    flight = SteadyFlight(movie(kind, 12), 17, seed=5, drawing=ALIVE)
    frames = flown(flight, 3 * flight.chapter)
    gaps = np.diff(frames[:, :, 0], axis=1)
    assert gaps.min() >= NEAREST - 1e-9
    assert np.ptp(frames[:, :, 0], axis=0).max() > 0.1
    said = flight.report(frames, 4.0)
    assert said["fastest"] <= Drawing().drift + 1e-9 and said["outside"] < 0.01 and said["leader_in_front"] == 1.0


@pytest.mark.parametrize(("example", "who"), [(OUTERMOST, 12), (INNERMOST, 5)], ids=["outermost", "innermost"])
def test_a_bird_that_changes_sides_in_the_example_does_so_in_the_flight_and_all_others_keep_their_order(example, who):
    flight = SteadyFlight(example, 13, seed=2, drawing=ALIVE)
    frames = flown(flight, 2 * flight.chapter)
    right = frames[:, :, 0] > 0
    assert right[0].sum() == 8 and right[int(4 * flight.chapter)].sum() == 7 and not right[int(4 * flight.chapter), who]
    assert right[-1, who]  # and back
    others = np.delete(frames[:, :, 0], who, axis=1)
    assert (np.diff(others, axis=1) >= NEAREST - 1e-9).all()
    apart = np.linalg.norm(frames[:, who, None] - np.delete(frames, who, axis=1), axis=2)
    assert apart.min() >= NEAREST - 1e-6
    ways = np.linalg.norm(np.diff(frames, axis=0), axis=2) * 4.0
    assert ways[:, who].max() <= Drawing().crossing + 1e-9
    assert np.delete(ways, who, axis=1).max() <= Drawing().drift + 1e-9
    assert flight.report(frames, 4.0)["switches"] == 2


def test_where_the_sides_are_exchanged_the_bird_goes_the_opposite_way():
    for flight in (SteadyFlight(OUTERMOST, 13, left=8), SteadyFlight(OUTERMOST, 13, exchange=True)):
        assert [a.left for a in flight.arrangements] == [8, 7]
        assert flight.at(flight.chapter)[0, 0] > 0 > flight.at(0.0)[0, 0]


def test_of_a_larger_flock_the_bird_that_corresponds_changes_sides():
    flight = SteadyFlight(OUTERMOST, 41, seed=1)
    assert [crossing.birds.tolist() for crossing in flight.crossings] == [[40], [40]]
    assert flight.arrangements[1].order[0] == 40


def test_a_frame_in_which_another_leads_says_nothing_of_sides():
    example = Formation("two", (frame("0", LEFT, RIGHT), frame("1", ["d", "c", "b"], ["e", *RIGHT], leader="a")))
    assert SteadyFlight(example, 13).crossings == [None, None]


def test_the_places_of_a_brush_have_another_bird_on_the_left_in_every_second_minute():
    still, alive = Params(), Params(switching=0.5, lateral=0.1)
    left = [int((places(alive, 9, 1).at(t)[0] < -1e-9).sum()) for t in (1.0, 61.0, 121.0, 181.0)]
    assert left == [5, 4, 5, 4]
    steady = places(still, 9, 1)
    assert all((steady.at(t)[0] == 1.25 * np.arange(-4, 5)).all() for t in (0.0, 31.7, 200.0))
    x, _ = places(alive, 9, 1).at(1.0)
    assert np.diff(x).min() > 0.5  # while one crosses the places stay in order
