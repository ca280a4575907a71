"""Who sees whom in the air, against brute force."""

import numpy as np
import pytest
from flockbrush.engine.solids import no_solids, packed, prism, sphere
from flockbrush.systems.space import EyesInSpace, sort_in_space, visible_in_space
from flockbrush.systems.visibility import lists_of
from hypothesis import given, settings
from hypothesis import strategies as st


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def segment_meets_ball(offset, centre, radius):
    """Whether the segment from the origin comes nearer to a point than ``radius``."""
    t = np.clip(centre @ offset / (offset @ offset), 0, 1)
    return np.linalg.norm(centre - t * offset) < radius


def brute(xyz, forward, reach, cosine, through, radius, solids, wrap):
    """Sets of visible rows, one pair after the other."""
    n, seen = len(xyz), []
    for i in range(n):
        offset = xyz - xyz[i]
        if wrap is not None:
            offset[:, :2] -= np.array(wrap) * np.round(offset[:, :2] / wrap)
        d = np.linalg.norm(offset, axis=1)
        mine = set()
        for j in range(n):
            if j == i or d[j] > reach[i]:
                continue
            if cosine[i] > -1 and offset[j] @ forward[i] < cosine[i] * d[j]:
                continue
            hidden = not through[i] and any(
                d[k] < d[j] and d[k] > radius[k] and segment_meets_ball(offset[j], offset[k], radius[k])
                for k in range(n)
                if k not in (i, j)
            )
            hidden |= not through[i] and any(segment_meets_ball(offset[j], s.centre - xyz[i], s.radius) for s in solids)
            if not hidden:
                mine.add(j)
        seen.append(mine)
    return seen


def all_round(n, reach, through, radius):
    """The eyes of n animals who see all round."""
    return EyesInSpace(np.full(n, reach), np.full(n, -1.0), np.full(n, through, np.uint8), np.full(n, radius))


@settings(max_examples=60)
@given(
    st.integers(0, 10_000), st.integers(1, 60), st.sampled_from([2.0, 6.0, 20.0]), st.booleans(), st.booleans(),
    st.sampled_from([-1.0, -0.87, 0.0, 0.6]),
)  # fmt: skip
def test_everybody_sees_whom_brute_force_sees(seed, n, size, wrapped, through, cosine):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, size, (n, 3))
    forward = unit(rng.normal(size=(n, 3)))
    reach, radius = rng.uniform(0.5, 2.9, n), rng.uniform(0.05, 0.4, n)
    wrap = (size, size) if wrapped and size >= 6 else None
    balls = [sphere(rng.uniform(0, size, 3), 0.5)]
    through = np.full(n, through, np.uint8)
    cosines = np.full(n, cosine)
    space = sort_in_space(xyz, forward, np.arange(n), float(reach.max()), wrap)
    solids = packed(balls) if wrap is None else None
    lists = lists_of(visible_in_space(space, EyesInSpace(reach, cosines, through, radius), solids, width=4))
    expected = brute(xyz, forward, reach, cosines, through, radius, balls if wrap is None else [], wrap)
    for i in range(n):
        mine = lists.of(i).tolist()
        assert len(mine) == len(set(mine))
        assert set(mine) == expected[i]
    away = xyz[lists.near] - np.repeat(xyz, np.diff(lists.first), axis=0)
    if wrap is not None:
        away[:, :2] -= np.array(wrap) * np.round(away[:, :2] / wrap)
    assert lists.offset == pytest.approx(away, abs=1e-12)


def test_only_some_rows_are_in_the_air():
    xyz = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5)], float)
    forward = np.tile([1.0, 0, 0], (4, 1))
    space = sort_in_space(xyz, forward, [1, 2, 3], 2.0)
    lists = lists_of(visible_in_space(space, all_round(4, 2.0, 1.0, 0.1)))
    assert [lists.of(i).tolist() for i in range(4)] == [[], [2], [1], []]


def test_a_crowd_in_one_place_finds_room_in_the_lists():
    n = 300
    xyz = np.random.default_rng(1).uniform(0, 0.5, (n, 3))
    space = sort_in_space(xyz, np.tile([1.0, 0, 0], (n, 1)), np.arange(n), 2.0)
    for through in (0, 1):
        lists = lists_of(visible_in_space(space, all_round(n, 2.0, through, 1e-9), no_solids(), width=2))
        assert (np.diff(lists.first) == n - 1).all()


def test_strays_far_away_cost_no_map_of_empty_cubes():
    xyz = np.vstack([np.random.default_rng(2).uniform(0, 5, (50, 3)), [(1e6, -1e6, 1e5)]])
    space = sort_in_space(xyz, np.tile([1.0, 0, 0], (51, 1)), np.arange(51), 1.0)
    assert len(space.start) < 1 << 16
    lists = lists_of(visible_in_space(space, all_round(51, 1.0, 1.0, 0.1)))
    assert lists.first[51] == lists.first[50]


def test_a_wall_hides_those_behind_it():
    xyz = np.array([(0, 0, 5), (4, 0, 5), (4, 0, 45)], float)
    wall = packed([prism([(1, -9), (2, -9), (2, 9), (1, 9)], 0.0, 10.0)])
    space = sort_in_space(xyz, np.tile([1.0, 0, 0], (3, 1)), np.arange(3), 50.0)
    lists = lists_of(visible_in_space(space, all_round(3, 50.0, 0.0, 0.1), wall))
    assert lists.of(0).tolist() == [2]


def test_a_place_that_is_no_number_is_told():
    xyz = np.zeros((3, 3))
    xyz[1, 2] = np.nan
    with pytest.raises(ValueError, match="position of row 1 is not a number"):
        sort_in_space(xyz, xyz, np.arange(3), 1.0)


def test_an_empty_sky_is_fine():
    space = sort_in_space(np.zeros((0, 3)), np.zeros((0, 3)), [], 1.0)
    lists = lists_of(visible_in_space(space, all_round(0, 1.0, 0.0, 0.1)))
    assert lists.first.tolist() == [0]
