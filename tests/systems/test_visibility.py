"""Who sees whom, against the definition: every segment from an observer to a neighbour with every body and edge.

The oracle knows nothing of cells, cones and rings.  Segments that touch a body within a nanometre are left out of the
comparison; scenes that lie on such an edge on purpose say what they expect.
"""

from typing import NamedTuple

import numpy as np
import pytest
from flockbrush.engine import parallel
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.visibility import edges_by_cell, visible_neighbours
from hypothesis import given, settings
from hypothesis import strategies as st

TOUCH = 1e-9  # m


class Herd(NamedTuple):
    """Animals on a plane, and what they can see."""

    xy: np.ndarray  # (n, 2) m
    forward: np.ndarray  # (n, 2)
    length: np.ndarray  # (n,) m
    radius: np.ndarray  # (n,) m
    view_range: np.ndarray  # (n,) m
    cosine: np.ndarray  # (n,) of half the field of view


def herd(xy, heading=0.0, length=1.0, radius=0.5, view_range=10.0, view=360.0):
    """Discs of half a metre that see ten metres all round, unless said otherwise; angles in degrees."""
    xy = np.asarray(xy, float).reshape(-1, 2)
    heading, length, radius, view_range, view = (
        np.broadcast_to(np.asarray(v, float), len(xy)).copy() for v in (heading, length, radius, view_range, view)
    )
    angle = np.deg2rad(heading)
    cosine = np.where(view >= 360.0, -1.0, np.cos(np.deg2rad(view) / 2))
    return Herd(xy, np.c_[np.cos(angle), np.sin(angle)], length, radius, view_range, cosine)


def seen(animals, edges=(), wrap=None, occlusion=True, **more):
    """The lists of `visible_neighbours`."""
    flat = np.zeros((len(animals.xy), 1))
    xyz, forward = np.hstack([animals.xy, flat]), np.hstack([animals.forward, flat])
    reach = max(animals.view_range, default=1.0)
    cells = sort_into_cells(xyz, forward, animals.length, animals.radius, reach, wrap)
    given_edges = edges_by_cell(edges, reach) if len(edges) else None
    return visible_neighbours(cells, animals.view_range, animals.cosine, given_edges, occlusion, **more)


def sets(lists):
    return [set(map(int, lists.of(i))) for i in range(len(lists.first) - 1)]


# --- the oracle -------------------------------------------------------------------------------------------------------


def point_to_segment(p, a, b):
    """Distances from points to segments, (..., 2) each."""
    u = b - a
    uu = (u * u).sum(-1)
    t = np.clip(((p - a) * u).sum(-1) / np.where(uu > 0, uu, 1), 0, 1)
    return np.linalg.norm(a + t[..., None] * u - p, axis=-1)


def turn(a, b, c):
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def segment_to_segment(p, q, a, b):
    p, q, a, b = np.broadcast_arrays(p, q, a, b)
    apart = np.minimum.reduce([point_to_segment(*s) for s in ((p, a, b), (q, a, b), (a, p, q), (b, p, q))])
    crossing = (turn(a, b, p) * turn(a, b, q) < 0) & (turn(p, q, a) * turn(p, q, b) < 0)
    return np.where(crossing, 0.0, apart)


def look(animals, i, edges=(), wrap=None, occlusion=True):
    """(rows surely seen, rows in doubt) of animal i, from the definition."""
    shifts = [(0.0, 0.0)]
    if wrap is not None:
        shifts = [(a * wrap[0], b * wrap[1]) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    at = np.concatenate([animals.xy - animals.xy[i] + s for s in shifts])
    row = np.tile(np.arange(len(animals.xy)), len(shifts))
    d2 = at[:, 0] * at[:, 0] + at[:, 1] * at[:, 1]
    near = np.flatnonzero((d2 < animals.view_range[i] ** 2) & (row != i))
    at, row, d2 = at[near], row[near], d2[near]
    if not len(near):
        return set(), set()
    forward, c = animals.forward[i], animals.cosine[i]
    with np.errstate(invalid="ignore"):
        margin = np.where(d2 > 0, at @ forward / np.sqrt(d2) - c, 1.0)
    in_view, doubt = margin > 0, (np.abs(margin) < TOUCH) & (c > -1)
    if c == -1:
        in_view[:] = True
    hidden = np.zeros(len(row), bool)
    o = np.zeros(2)
    if occlusion:
        half = np.maximum(animals.length[row] / 2 - animals.radius[row], 0.0)[:, None] * animals.forward[row]
        a, b, radius = at - half, at + half, animals.radius[row]
        room = point_to_segment(o, a, b) - radius
        apart = segment_to_segment(o, at[:, None], a[None], b[None]) - radius
        nearer = d2[None] < d2[:, None]
        hidden |= (nearer & (room > TOUCH) & (apart < -TOUCH)).any(1)
        doubt |= (nearer & (room > -TOUCH) & (np.abs(apart) <= TOUCH)).any(1)
        doubt |= (nearer & (np.abs(room) <= TOUCH) & (apart < TOUCH)).any(1)
    for x0, y0, x1, y1 in np.reshape(edges, (-1, 4)):
        p, q = np.array([x0, y0]) - animals.xy[i], np.array([x1, y1]) - animals.xy[i]
        hidden |= (turn(p, q, o) * turn(p, q, at) < 0) & (turn(o, at, p) * turn(o, at, q) < 0)
    doubt &= ~hidden
    return set(map(int, row[in_view & ~hidden & ~doubt])), set(map(int, row[doubt]))


def assert_as_defined(animals, observers=None, **scene):
    found = sets(seen(animals, **scene))
    for i in range(len(animals.xy)) if observers is None else observers:
        surely, doubt = look(animals, i, **scene)
        assert found[i] - doubt == surely, f"animal {i} sees {found[i] ^ surely - doubt} otherwise"


def scattered(n, per_m2, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, (n / per_m2) ** 0.5, (n, 2)), rng


# --- small scenes -----------------------------------------------------------------------------------------------------


def test_nobody_alone_sees_anybody():
    assert sets(seen(herd([]))) == []
    assert sets(seen(herd([(3, 4)]))) == [set()]


def test_two_animals_see_one_another_within_range_and_not_at_its_end():
    assert sets(seen(herd([(0, 0), (3, 4)]))) == [{1}, {0}]
    assert sets(seen(herd([(0, 0), (6, 8)]))) == [set(), set()]
    assert sets(seen(herd([(0, 0), (6, 8)], view_range=[10, 10.001]))) == [set(), {0}]


def test_the_offset_goes_from_the_observer_to_the_neighbour():
    lists = seen(herd([(1, 2), (4, 6)]))
    assert lists.offset.tolist() == [[3, 4], [-3, -4]]
    assert lists.first.tolist() == [0, 1, 2] and lists.of(1).tolist() == [0]


def test_the_one_in_the_middle_hides_the_last():
    assert sets(seen(herd([(0, 0), (3, 0), (6, 0)]))) == [{1}, {0, 2}, {1}]
    assert sets(seen(herd([(0, 0), (3, 0), (6, 0)]), occlusion=False)) == [{1, 2}, {0, 2}, {0, 1}]


def test_a_body_hides_whom_the_segment_meets_and_nobody_beside_it():
    # 6 m away, seen past a disc of .5 m at 3 m: hidden up to 1.0142 m to the side (6 tan asin(.5 / 3))
    assert 2 not in sets(seen(herd([(0, 0), (3, 0), (6, 1.01)])))[0]
    assert 2 in sets(seen(herd([(0, 0), (3, 0), (6, 1.02)])))[0]


def test_lying_across_an_animal_hides_more_than_pointing_at_the_observer():
    for heading, expected in ((0.0, {1, 2, 3}), (90.0, {3})):
        scene = herd([(0, 0), (6, 1.2), (6, -1.2), (3, 0)], [0, 0, 0, heading], length=1.4, radius=0.2)
        assert sets(seen(scene))[0] == expected


def test_an_animal_at_the_same_distance_hides_nobody():
    assert sets(seen(herd([(0, 0), (5, 0), (4.9, 0.99498743710662), (4.9, -0.99498743710662)])))[0] == {1, 2, 3}


def test_the_body_an_observer_stands_in_hides_nobody():
    assert sets(seen(herd([(0, 0), (0.4, 0), (3, 0)])))[0] == {1, 2}
    assert sets(seen(herd([(0, 0), (0.5, 0), (3, 0)])))[0] == {1, 2}
    assert sets(seen(herd([(0, 0), (0.6, 0), (3, 0)])))[0] == {1}


def test_animals_at_the_very_same_place_see_one_another_whatever_their_field_of_view():
    assert sets(seen(herd([(2, 2), (2, 2), (2, 2), (5, 2)], heading=180, view=90))) == [
        {1, 2},
        {0, 2},
        {0, 1},
        {0, 1, 2},
    ]


def test_the_field_of_view_leaves_out_whom_one_turns_ones_back_to():
    around = [(0, 0), (3, 0), (0, 3), (-3, 0), (0, -3)]
    for view, expected in ((60, {1}), (170, {1}), (190, {1, 2, 4}), (270, {1, 2, 4}), (360, {1, 2, 3, 4})):
        assert sets(seen(herd(around, view=view)))[0] == expected


def test_whom_one_does_not_see_behind_hides_nobody_in_front():
    assert sets(seen(herd([(0, 0), (-1, 0), (3, 0)], view=180)))[0] == {2}


def test_a_wall_hides_those_behind_it_and_its_end_does_not():
    scene = herd([(0, 0), (6, 0), (6, 3)], radius=0.1, length=0.2)
    assert sets(seen(scene, edges=[(3, -1, 3, 1)])) == [{2}, {2}, {0, 1}]
    assert sets(seen(scene, edges=[(3, 2, 3, 4)])) == [{1, 2}, {0, 2}, {0, 1}]


def test_across_a_wrapped_seam_the_neighbour_is_seen_the_short_way():
    lists = seen(herd([(1, 15), (29, 15), (15, 15)]), wrap=(30, 30))
    assert sets(lists) == [{1}, {0}, set()]
    assert lists.offset.tolist() == [[-2, 0], [2, 0]]


def test_a_body_across_the_seam_hides_whom_it_stands_before():
    assert sets(seen(herd([(1, 15), (28, 15), (25, 15)]), wrap=(30, 30)))[0] == {1}


# --- herds against the oracle -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("per_m2", [0.02, 0.25, 1.0, 4.0])
def test_discs_scattered_at_random_see_whom_they_should(per_m2):
    xy, _ = scattered(250, per_m2)
    assert_as_defined(herd(xy), observers=range(0, 250, 3 if per_m2 < 1 else 12))


@pytest.mark.parametrize("per_m2", [0.1, 1.0, 3.0])
def test_animals_of_all_sizes_see_whom_they_should(per_m2):
    xy, rng = scattered(250, per_m2, seed=2)
    sizes = {"length": rng.uniform(0.1, 2.5, 250), "radius": rng.uniform(0.02, 0.6, 250)}
    scene = herd(
        xy, rng.uniform(0, 360, 250), view_range=rng.uniform(0, 9, 250), view=rng.uniform(20, 400, 250), **sizes
    )
    assert_as_defined(scene, observers=range(0, 250, 3))


def test_a_giant_among_mice_hides_whom_it_should():
    xy, rng = scattered(250, 1.0, seed=3)
    length, radius = np.full(250, 0.2), np.full(250, 0.05)
    length[:3], radius[:3] = 6.0, 1.0
    assert_as_defined(herd(xy, rng.uniform(0, 360, 250), length, radius), observers=range(0, 250, 9))


def test_a_clump_of_touching_animals_sees_its_own_rows_only():
    rng = np.random.default_rng(4)
    grid = np.stack(np.meshgrid(np.arange(20), np.arange(20)), -1).reshape(-1, 2) * (1.05, 0.46)
    scene = herd(grid + rng.normal(0, 0.02, grid.shape), rng.normal(0, 6, 400), radius=0.2, view_range=4)
    assert_as_defined(scene, observers=range(0, 400, 5))


def test_in_a_clump_with_a_hole_one_sees_across_the_hole():
    xy, rng = scattered(700, 1.5, seed=5)
    xy = xy[np.hypot(*(xy - 11).T) > 4]
    scene = herd(np.r_[[(11, 11)], xy], view=np.r_[360, rng.uniform(100, 400, len(xy))])
    assert_as_defined(scene, observers=range(0, len(xy), 25))
    assert len(sets(seen(scene))[0]) > 15


def test_in_a_herd_half_packed_and_half_sparse_each_half_sees_whom_it_should():
    packed, rng = scattered(300, 4.0, seed=6)
    sparse = rng.uniform(0, 60, (60, 2))
    assert_as_defined(herd(np.r_[packed, sparse], view_range=12), observers=range(0, 360, 13))


def test_on_a_lattice_with_many_equal_distances_only_nearer_bodies_hide():
    lattice = np.stack(np.meshgrid(np.arange(13.0), np.arange(13.0)), -1).reshape(-1, 2)
    for radius in (0.3, 0.45, 0.5):
        assert_as_defined(herd(lattice, radius=radius, view_range=6), observers=range(0, 169, 7))
    assert_as_defined(herd(lattice, 90.0, 0.95, 0.2, view_range=6), observers=range(0, 169, 7))


def test_animals_in_single_file_see_the_next_one_only():
    scene = herd(np.c_[np.arange(30) * 1.5, np.zeros(30)], length=1.2, radius=0.2)
    assert sets(seen(scene)) == [{j for j in (i - 1, i + 1) if 0 <= j < 30} for i in range(30)]


def test_many_at_a_few_places_see_whom_they_should():
    rng = np.random.default_rng(7)
    assert_as_defined(herd(rng.integers(0, 5, (60, 2)) * 1.5, rng.integers(0, 4, 60) * 90.0, 1.0, 0.2, view=250))


def test_on_a_wrapped_map_animals_see_across_all_seams():
    xy, rng = scattered(220, 0.5, seed=8)
    side = 220**0.5 / 0.5**0.5
    scene = herd(xy, rng.uniform(0, 360, 220), radius=0.3, view_range=8, view=300)
    assert_as_defined(scene, observers=range(0, 220, 3), wrap=(side, side))


def test_among_walls_animals_see_whom_they_should():
    xy, rng = scattered(200, 0.3, seed=9)
    ends = rng.uniform(0, 26, (12, 2))
    edges = np.c_[ends, ends + rng.uniform(-5, 5, (12, 2))]
    assert_as_defined(herd(xy, rng.uniform(0, 360, 200), radius=0.2, view=280), observers=range(0, 200, 3), edges=edges)


def test_without_occlusion_animals_see_all_in_range_and_in_view():
    xy, rng = scattered(300, 2.0, seed=10)
    scene = herd(xy, rng.uniform(0, 360, 300), view=200)
    assert_as_defined(scene, observers=range(0, 300, 5), occlusion=False)


def test_far_from_the_origin_nothing_changes():
    xy, _ = scattered(200, 0.5, seed=11)
    xy = np.round(xy * 64) / 64  # so that the shift is exact
    assert sets(seen(herd(xy))) == sets(seen(herd(xy + 2.0**20)))


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_small_herd_sees_whom_it_should(data):
    n = data.draw(st.integers(0, 14))
    place = st.one_of(st.integers(0, 6).map(float), st.floats(0, 6, allow_subnormal=False, width=32))
    column = lambda values: data.draw(st.lists(values, min_size=n, max_size=n))  # noqa: E731
    scene = herd(
        list(zip(column(place), column(place), strict=True)),
        column(st.sampled_from([0.0, 30.0, 90.0, 200.0])),
        column(st.sampled_from([0.2, 1.0, 3.0])),
        column(st.sampled_from([0.0, 0.05, 0.3, 0.5])),
        column(st.sampled_from([0.0, 1.0, 3.5, 9.0])),
        column(st.sampled_from([50.0, 180.0, 300.0, 360.0])),
    )
    assert_as_defined(scene)


# --- repeats ----------------------------------------------------------------------------------------------------------


def test_one_thread_and_many_find_the_same_neighbours_in_the_same_order():
    xy, rng = scattered(6000, 0.6, seed=12)
    scene = herd(xy, rng.uniform(0, 360, 6000), radius=0.3, view=300)
    before = parallel.set_threads(1)
    alone = seen(scene)
    try:
        for threads in (2, 3):
            parallel.set_threads(threads)
            for mine, theirs in zip(alone, seen(scene), strict=True):
                assert np.array_equal(mine, theirs)
    finally:
        parallel.set_threads(before)


def test_a_wrong_guess_of_the_length_of_the_lists_changes_nothing():
    xy, _ = scattered(400, 4.0, seed=13)
    for occlusion in (True, False):
        for mine, theirs in zip(
            seen(herd(xy), occlusion=occlusion, width=1), seen(herd(xy), occlusion=occlusion, width=512), strict=True
        ):
            assert np.array_equal(mine, theirs)


def test_seeing_leaves_the_herd_and_the_cells_as_they_were():
    xy, _ = scattered(50, 0.5, seed=14)
    scene = herd(xy)
    copies = [column.copy() for column in scene]
    seen(scene)
    assert all(np.array_equal(a, b) for a, b in zip(scene, copies, strict=True))
