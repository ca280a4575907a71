"""Flocks in steady flight: key shapes, and what lies between them."""

import json

import numpy as np
import pytest
from example_formations import movie
from flockbrush.behaviours.formation.extraction import Marks, extract
from flockbrush.behaviours.formation.formation_shapes import read_formation, textbook, to_json
from flockbrush.behaviours.formation.hummel import power, relative_power, total_power
from flockbrush.behaviours.formation.key_shapes import NoShape, project, solve_levenberg_marquardt, solve_proximal
from flockbrush.behaviours.formation.steady_flight import Drawing, SteadyFlight, correspond
from flockbrush.engine.problems import ProblemsError
from hypothesis import given, settings
from hypothesis import strategies as st

# nine birds 1.25 wingspans apart, their shares changed, and where they fly then: an independent solver's answer
Y1 = np.array([-2.9, -2.1, -0.8, 0.0, -1.1, -1.9, -3.2, -3.9, -5.2])
SHARES = np.array([
    0.10861318064690043, 0.12729707649421407, 0.1055384132190106, 0.046429576073648574, 0.11872383056351773,
    0.11781674727924904, 0.13866593643243175, 0.11672622564175077, 0.12018901364927692,
])  # fmt: skip
Y2 = np.array([
    -2.8073584008276855, -1.9499622394022174, -0.7417281628788184, 0.0, -0.9840586972930003, -1.8487431075447815,
    -3.2456447303572262, -3.990425384618776, -5.458302148899485,
])  # fmt: skip
GRID = 1.25 * np.arange(9)


@pytest.mark.parametrize(
    "solve", [solve_levenberg_marquardt, lambda x, e, y: solve_proximal(x, e, y, mu=0.0)], ids=["paper", "Newton"]
)
def test_nine_birds_find_the_only_shape_with_their_shares(solve):
    wanted = SHARES / SHARES.sum() * total_power(GRID)
    y = solve(GRID, wanted, Y1)
    assert y - y[3] == pytest.approx(Y2, abs=1e-6)
    assert power(GRID, y) == pytest.approx(wanted, abs=1e-12)
    again = solve(GRID, wanted, Y2 + 5.0)
    assert again - again[3] == pytest.approx(y - y[3], abs=1e-8)  # from anywhere


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), n=st.integers(2, 30), dx=st.floats(0.9, 2.0))
def test_birds_find_back_to_the_shape_whose_shares_they_have(seed, n, dx):
    rng = np.random.default_rng(seed)
    x, y = dx * np.arange(n), rng.normal(0, 2, n)
    found = solve_proximal(x, power(x, y), rng.normal(0, 2, n), mu=0.0)
    assert found - found.mean() == pytest.approx(y - y.mean(), abs=1e-5)


def test_shares_that_no_shape_has_are_refused_exactly_and_met_half_way_by_the_proximal_form():
    greedy = np.full(9, 0.02)
    greedy[0] = 1 - 0.16
    with pytest.raises(NoShape):
        solve_proximal(GRID, greedy * total_power(GRID), Y1, mu=0.0)
    with pytest.raises(NoShape):
        solve_levenberg_marquardt(GRID, greedy * total_power(GRID), Y1)
    y = solve_proximal(GRID, greedy * total_power(GRID), Y1)
    assert y[0] < Y1[0] - 1  # who shall save more falls back
    assert y.mean() == pytest.approx(Y1.mean())


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(-3, 3)), min_size=1, max_size=12))
def test_projected_shares_keep_their_ranges_and_sum_to_one(rows):
    low, wide, value = np.array(rows).T
    low, high = low / len(low), low / len(low) + wide
    if not low.sum() <= 1 <= high.sum():
        with pytest.raises(ValueError, match="do not allow"):
            project(value, low, high)
        return
    near = project(value, low, high)
    assert ((near >= low) & (near <= high)).all()
    assert near.sum() == pytest.approx(1)
    assert project(near, low, high) == pytest.approx(near, abs=1e-12)


# correspondence ---------------------------------------------------------------------


def test_as_many_birds_as_in_the_movie_are_the_birds_of_the_movie():
    match, swap = correspond(movie("V", 9).frames[0], 9, 4)
    assert match.tolist() == list(range(9))
    assert not swap


def test_more_birds_find_the_ends_of_the_arms_and_fill_in_between():
    match, swap = correspond(movie("V", 5).frames[0], 13, 6)
    assert match.tolist() == [0, -1, -1, -1, -1, 1, 2, 3, -1, -1, -1, -1, 4]
    assert not swap


def test_fewer_birds_keep_the_ends():
    match, _ = correspond(movie("V", 13).frames[0], 7, 3)
    assert match.tolist() == [0, 4, 5, 6, 7, 8, 12]


def test_the_longer_side_goes_with_the_longer_side():
    example = movie("J", 12).frames[0]  # two to the left of the leader
    assert example.leader == 2
    match, swap = correspond(example, 12, 9)
    assert swap
    assert match.tolist() == list(range(11, -1, -1))


# flights ------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "example", "birds"), [("V", 9, 14), ("U", 9, 9), ("J", 16, 28), ("line", 9, 5)])
def test_a_flock_keeps_to_the_savings_of_the_example_however_long_it_flies(kind, example, birds):
    flight = SteadyFlight(movie(kind, example), birds, seed=3)
    frames = flight.frames(400, fps=2.0)
    said = flight.report(frames, fps=2.0)
    assert said["outside"] < 0.01
    assert said["beyond"] < 0.2
    assert said["fastest"] <= Drawing().drift
    assert said["leader_in_front"] == 1.0
    assert np.abs(frames[-1] - frames[0]).max() > 0.1  # and it is not frozen


def test_a_flight_repeats_itself_and_may_be_looked_at_anywhere():
    one, other = SteadyFlight(movie("V", 9), 12, seed=5), SteadyFlight(movie("V", 9), 12, seed=5)
    late = one.at(200.0)
    assert other.at(3.0).tolist() == one.at(3.0).tolist()
    assert other.at(200.0).tolist() == late.tolist()
    assert SteadyFlight(movie("V", 9), 12, seed=6).at(200.0).tolist() != late.tolist()


def test_between_key_shapes_nothing_jumps():
    flight = SteadyFlight(movie("V", 9), 9, seed=1)
    time = np.arange(0, 40, 0.05)
    y = np.array([flight.at(t)[:, 1] for t in time])
    assert np.abs(np.diff(y, axis=0)).max() <= 0.4 * 0.05
    assert np.abs(np.diff(y, n=2, axis=0)).max() < 0.01
    assert flight.at(0.0).tolist() == flight.key(0).tolist()


def test_a_leader_elsewhere_and_sides_exchanged():
    right = SteadyFlight(movie("J", 12), 20, seed=2, left=17)
    assert right.x[17] == 0
    assert right.key(0)[:17, 1].min() < right.key(0)[18:, 1].min()  # the long arm is on the left now
    there = SteadyFlight(movie("J", 12), 12, seed=2, exchange=True)
    assert there.left == 9


def test_a_bird_out_of_line_in_the_example_is_out_of_line_in_the_flight():
    example = movie("V", 9, frames=1)
    frame = example.frames[0]
    y = list(frame.y)
    y[7] -= 3.0
    strayed = type(frame)(**{**vars(frame), "y": tuple(y), "outliers": (7,)})
    flight = SteadyFlight(type(example)("strayed", (strayed,)), 9, seed=2)
    assert flight.key(0)[7, 1] < flight.key(0)[8, 1] - 1


def test_every_bird_saves_as_much_behind_a_larger_flock_of_the_same_look():
    small, large = SteadyFlight(movie("U", 16), 16, seed=1), SteadyFlight(movie("U", 16), 31, seed=1)
    depth = [flight.key(0)[:, 1].min() / np.abs(flight.x).max() for flight in (small, large)]
    assert depth[1] == pytest.approx(depth[0], rel=0.25)  # as deep for its width
    assert relative_power(large.key(0)[:, 1], large.spacing).sum() == pytest.approx(1)


def test_impossible_flights_are_refused_in_words():
    nothing = type(movie("V", 9))("row", (type(movie("V", 9).frames[0])(
        **{**vars(movie("V", 9).frames[0]), "kind": "none", "why": "a row of birds abreast", "curve": None}
    ),))  # fmt: skip
    with pytest.raises(ProblemsError, match="a row of birds abreast"):
        SteadyFlight(nothing, 9)
    with pytest.raises(ProblemsError, match="at least two"):
        SteadyFlight(movie("V", 9), 1)
    with pytest.raises(ProblemsError, match="at most 8"):
        SteadyFlight(movie("V", 9), 9, left=9)
    with pytest.raises(ValueError, match="begins at 0"):
        SteadyFlight(movie("V", 9), 9).at(-1.0)


def test_the_papers_solver_flies_too_and_where_it_finds_nothing_the_other_does():
    flight = SteadyFlight(movie("V", 9), 14, seed=1, drawing=Drawing(method="levenberg-marquardt"))
    said = flight.report(flight.frames(60, fps=2.0), fps=2.0)
    assert said["outside"] < 0.05
    assert said["leader_in_front"] == 1.0


def odd_formation(**changes):
    """A V of seven in one frame, with some of it changed."""
    x, y = textbook("V", 7)
    formation = extract(Marks(("0",), tuple("abcdefg"), x[None], y[None]), "odd")
    document = json.loads(to_json(formation))
    document["frames"][0] |= changes
    return document


@pytest.mark.parametrize("spacing", [[1.3, 0.0], [1e4, 0.0], [0.0, 1e4]])
@pytest.mark.parametrize("deviation", [[0.0, 0.0], [0.0, 1e4], [-1e4, 1e4]])
@pytest.mark.parametrize("numbers", [[0.0, 0.8, 0.8], [0.0, 1e4, -1e4], [1e4, 0.0, 0.0]])
@pytest.mark.parametrize("birds", [2, 9])
def test_odd_shapes_are_flown_or_refused_in_a_sentence(spacing, deviation, numbers, birds):
    curve = {"model": "v", "numbers": numbers}
    formation = read_formation(odd_formation(spacing=spacing, deviation=deviation, curve=curve), "odd.json")
    try:
        places = SteadyFlight(formation, birds).frames(12, 1.0)
    except ProblemsError as error:
        assert "no shape saves the shares of power that this one does" in str(error)
    else:
        assert np.isfinite(places).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"birds": "abcdefg"}, "birds must be 1 to 2,000 different names"),
        ({"birds": ["a"] * 7}, "birds must be 1 to 2,000 different names"),
        ({"x": [0, 1, 2, 3, 4, 5]}, "x must be 7 numbers"),
        ({"x": [3, 2, 1, 0, -1, -2, -3]}, "birds are ordered from left to right"),
        ({"y": [0, 1, 2, 3, 4, 5, float("nan")]}, "y must be 7 numbers, at most 10000 away from 0"),
        ({"y": [0, 1, 2, 3, 4, 5, 1e300]}, "y must be 7 numbers, at most 10000 away from 0"),
        ({"leader": 7}, "leader and outliers are places from 0 to 6"),
        ({"leader": True}, "leader and outliers are places from 0 to 6"),
        ({"outliers": [1.5]}, "leader and outliers are places from 0 to 6"),
        ({"outliers": 3}, "outliers must be a list, got int"),
        ({"spacing": [-1, 0]}, "spacing must be [mean, deviation]"),
        ({"deviation": [0, -1]}, "deviation must be [mean, deviation]"),
        ({"curve": {"model": "v", "numbers": [0, 1e99, 0]}}, "numbers of a v must be 3 numbers"),
        ({"curve": {"model": "spiral", "numbers": []}}, "curve.model must be one of"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_formation_file_is_refused_by_what_is_wrong_with_it(changes, words):
    with pytest.raises(ProblemsError) as caught:
        read_formation(odd_formation(**changes), "odd.json")
    assert str(caught.value).startswith("odd.json: frames[0]: ") and words in str(caught.value)


def test_a_look_far_into_a_flight_draws_no_more_than_a_chapter():
    far, near = SteadyFlight(movie("V", 9), 9, seed=4), SteadyFlight(movie("V", 9), 9, seed=4)
    near.at(0.9 * near.chapter)
    drawn = []
    draw = far.drawn
    far.drawn = lambda *told: drawn.append(told[0]) or draw(*told)
    far.at(1000.9 * far.chapter)
    assert 0 < len(drawn) <= 1.5 * len(near._chapters[0].keys) + 4


def test_a_flight_comes_by_the_shapes_of_all_frames_of_the_example_in_their_order():
    flight = SteadyFlight(movie("J", 9, frames=4), 11, seed=4)
    assert len({y.tobytes() for y in flight.initial}) == 4
    for k, y in enumerate([*flight.initial, flight.initial[0]]):
        assert flight.at(k * flight.chapter) == pytest.approx(y, abs=1e-12)
    time = np.linspace(0.0, 4.5 * flight.chapter, 600)
    y = np.array([flight.at(t)[:, 1] for t in time])
    assert np.abs(np.diff(y, axis=0)).max() <= 0.4 * (time[1] - time[0]) + 1e-9
    assert flight.report(np.stack([np.broadcast_to(flight.x, y.shape), y], -1))["outside"] < 0.01
