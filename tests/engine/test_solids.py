"""Convex solids: rays against marching, silhouettes against every corner, steps that never enter."""

import numpy as np
import pytest
from flockbrush.engine.solid_queries import BodyFrame, ahead_, blocks_, entry_, out_of_, past_, slide_, surface_
from flockbrush.engine.solids import (
    convex_parts,
    cylinder,
    half_space,
    no_solids,
    packed,
    polyhedron,
    prism,
    sphere,
    with_cylinders,
)
from hypothesis import given
from hypothesis import strategies as st
from small_herd import gaps_to_solid

SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def shapes(seed=0):
    """One of each kind, anywhere."""
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return [
        sphere(rng.uniform(-3, 3, 3), 1.3),
        cylinder(rng.uniform(-3, 3, 3), 0.8, 1.5),
        cylinder(rng.uniform(-3, 3, 3), 0.5, 2.0, axis=rng.normal(size=3)),
        prism(SQUARE * (2.0, 0.5) + rng.uniform(-2, 2, 2), -1.0, 2.0),
        polyhedron(CUBE @ turned + rng.uniform(-2, 2, 3)),
        polyhedron(rng.normal(size=(9, 3))),
        half_space((0, 0, -2), (0.1, 0.2, 1)),
    ]


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


# shapes ------------------------------------------------------------------------


def test_a_cube_has_six_faces_and_twelve_edges():
    cube = polyhedron(CUBE)
    assert len(cube.faces) == 6
    assert len(cube.edges) == 12
    assert cube.bound == pytest.approx(3**0.5)
    assert sorted(map(tuple, np.abs(cube.faces[:, :3]).round(9).tolist())) == sorted(
        [(1, 0, 0), (0, 1, 0), (0, 0, 1)] * 2
    )


def test_a_prism_is_the_polyhedron_of_its_corners():
    tower = prism(SQUARE, 0.0, 3.0)
    same = polyhedron(np.vstack([np.c_[SQUARE, np.zeros(4)], np.c_[SQUARE, np.full(4, 3.0)]]))
    rng = np.random.default_rng(1)
    for p in rng.uniform(-4, 4, (50, 3)):
        assert surface_(packed([tower]), 0, *p)[0] == pytest.approx(surface_(packed([same]), 0, *p)[0])
    assert len(tower.edges) == len(same.edges) == 12


def test_points_in_a_plane_are_no_polyhedron():
    with pytest.raises(ValueError, match="plane"):
        polyhedron(np.c_[SQUARE, np.zeros(4)])


@pytest.mark.parametrize("solid", shapes(), ids=range(7))
def test_the_gap_is_never_more_than_the_way_to_the_surface(solid):
    s = packed([solid])
    for p in np.random.default_rng(2).uniform(-6, 6, (200, 3)):
        gap, *normal = surface_(s, 0, *p)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        if gap > 0:
            assert entry_(s, 0, *p, *(-np.array(normal)), 0.0) >= gap - 1e-9
            assert entry_(s, 0, *p, *unit(solid.centre - p), 0.0) >= gap - 1e-9


@pytest.mark.parametrize("degrees", [3, 20, 60, 90, 120])
def test_a_sharp_corner_grows_by_little_more_than_it_is_asked_to(degrees):
    a = np.radians(degrees) / 2
    wedge = packed([prism([(0, 0), (-9 * np.cos(a), 9 * np.sin(a)), (-9 * np.cos(a), -9 * np.sin(a))], -1.0, 1.0)])
    assert surface_(wedge, 0, 2.5, 0.0, 0.0)[0] > 1.0
    assert surface_(wedge, 0, -0.01, 0.0, 0.0)[0] < 0.0
    steep = packed([polyhedron([(0, 0, 0), (-9, 0.3, 0), (-9, -0.3, 0), (-9, 0, 0.5)])])
    assert surface_(steep, 0, 2.5, 0.0, 0.0)[0] > 1.0


def test_moved_solids_are_where_they_were_moved():
    rng = np.random.default_rng(3)
    for solid in shapes():
        by = rng.uniform(-5, 5, 3)
        here, there = packed([solid]), packed([solid.moved(by)])
        for p in rng.uniform(-6, 6, (20, 3)):
            assert surface_(there, 0, *(p + by)) == pytest.approx(surface_(here, 0, *p))


L_SHAPE = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], float)
STAR = np.array([(r * np.cos(a), r * np.sin(a)) for a, r in zip(np.arange(10) * np.pi / 5, [2, 0.7] * 5, strict=True)])


def area(polygon):
    x, y = polygon.T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


@pytest.mark.parametrize("polygon", [L_SHAPE, STAR, SQUARE])
def test_a_polygon_is_the_sum_of_its_convex_parts(polygon):
    parts = convex_parts(polygon)
    assert sum(map(area, parts)) == pytest.approx(area(polygon))
    for part in parts:
        edge = np.roll(part, -1, axis=0) - part
        after = np.roll(edge, -1, axis=0)
        assert (edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0] >= -1e-12).all()


# rays --------------------------------------------------------------------------------


@given(st.integers(0, 10_000))
def test_the_gap_is_what_plain_numpy_says_and_the_normal_is_its_slope(seed):
    solids, points = packed(shapes(seed)), np.random.default_rng(seed).uniform(-6, 6, (6, 3))
    for k in range(7):
        found = np.array([surface_(solids, k, *point) for point in points])
        assert found[:, 0] == pytest.approx(gaps_to_solid(solids, k, points), abs=1e-12)
        further = gaps_to_solid(solids, k, points + 1e-6 * found[:, 1:])
        assert further - found[:, 0] == pytest.approx(np.full(6, 1e-6), abs=1e-9)


@given(st.integers(0, 10_000), st.floats(0, 0.7))
def test_a_ray_enters_where_marching_along_it_finds_the_surface(seed, w):
    rng = np.random.default_rng(seed)
    solids = packed(shapes(seed))
    p, u = rng.uniform(-8, 8, 3), unit(rng.normal(size=3))
    t = np.arange(0, 20, 0.01)
    for k in range(7):
        gaps = gaps_to_solid(solids, k, p + t[::5, None] * u)
        inside = np.flatnonzero(gaps < w - 0.05)
        hit = entry_(solids, k, *p, *u, w)
        if len(inside):
            assert hit <= t[::5][inside[0]] + 1e-9
        if np.isfinite(hit) and hit < 20:
            assert surface_(solids, k, *(p + hit * u))[0] == pytest.approx(w, abs=1e-6) or hit == 0.0
            assert gaps[t[::5] < hit - 1e-9].min(initial=9.0) > w - 1e-6


def test_who_flies_along_a_wall_has_nothing_ahead_and_who_flies_at_it_has():
    wall = packed([half_space((0, 0, 0), (0, 1, 0))])
    assert ahead_(wall, 0.0, 0.2, 0.0, 1.0, 0.0, 0.0, 50.0, 0.5) == (-1, np.inf)
    who, hit = ahead_(wall, 0.0, 0.2, 0.0, *unit((10, -0.1, 0)), 50.0, 0.5)
    assert who == 0
    assert hit < 1.0


def test_a_solid_hides_what_is_behind_it_and_not_what_is_before():
    s = packed([sphere((5, 0, 0), 1.0), sphere((0, 5, 0), 1.0, opaque=False)])
    assert blocks_(s, 0.0, 0.0, 0.0, 10.0, 0.5, 0.0)
    assert not blocks_(s, 0.0, 0.0, 0.0, 3.9, 0.0, 0.0)
    assert not blocks_(s, 0.0, 0.0, 0.0, 10.0, 3.0, 0.0)
    assert not blocks_(s, 0.0, 0.0, 0.0, 0.0, 10.0, 0.0)


# silhouettes --------------------------------------------------------------------------


def aim(solid, heading=(1, 0, 0), beyond=0.5, up=(0, 0, 1), lowest=100.0, at=(0, 0, 0), odd=0):
    pose = BodyFrame(tuple(map(float, at)), tuple(unit(heading)), tuple(map(float, up)))
    return np.array(past_(packed([solid]), 0, pose, beyond, lowest, odd))


@given(st.integers(0, 10_000))
def test_the_aim_misses_the_solid(seed):
    rng = np.random.default_rng(seed)
    for solid in shapes(seed)[:6]:
        away = unit(rng.normal(size=3))
        here = solid.centre + away * (solid.bound + rng.uniform(0.5, 8))
        heading = unit(solid.centre + rng.uniform(-0.3, 0.3, 3) - here)
        up = unit(np.cross(heading, rng.normal(size=3)))
        there = aim(solid, heading, 0.3, up, at=here)
        assert np.linalg.norm(there) == pytest.approx(1.0)
        if solid.kind != 1 or abs(heading @ solid.axis) < 0.5:  # over the end of a cylinder the rim may be nearer
            assert entry_(packed([solid]), 0, *here, *there, 0.0) == np.inf


def test_a_sphere_is_passed_on_the_side_to_which_the_heading_leans_one_length_beyond():
    ball = sphere((10, 0, 0), 2.0)
    there = aim(ball, (1, 0.05, 0), beyond=0.5)
    tangent = np.arcsin(0.25)  # to the ball that is .5 m larger
    assert there[2] == pytest.approx(0.0, abs=1e-12)
    assert np.arctan2(there[1], there[0]) == pytest.approx(tangent)
    assert aim(ball, (1, -0.05, 0))[1] < 0
    assert aim(ball, (1, 0, 0))[2] > 0  # dead ahead: over its top


def test_a_standing_pillar_is_passed_at_the_side_and_by_halves_when_dead_ahead():
    pillar = cylinder((10, 0, 0), 1.0, 50.0)
    left, right = aim(pillar, (1, 0.01, 0)), aim(pillar, (1, -0.01, 0))
    assert left[1] > 0 > right[1]
    assert abs(left[2]) < 1e-9
    assert aim(pillar, odd=0)[1] * aim(pillar, odd=1)[1] < 0


def test_a_low_pillar_is_passed_over_its_top_but_not_through_the_ground():
    low = cylinder((10, 0, 0), 4.0, 1.0)
    assert aim(low, (1, 0, 0.09))[2] > 0.09
    assert aim(low, (1, 0, -0.09), lowest=0.5)[2] > -0.05


def nearest_silhouette_angle(points, faces, here, heading):
    """The least angle from a heading to the silhouette of a convex body: the hull of its corners in perspective."""
    right = unit(np.cross(heading, (0, 0, 1)))
    up = np.cross(right, heading)
    local = (points - here) @ np.array([right, up, heading]).T
    flat = local[:, :2] / local[:, 2:]
    from scipy.spatial import ConvexHull

    ring = flat[ConvexHull(flat).vertices]
    best = np.inf
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        t = np.clip(-(a @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        best = min(best, np.linalg.norm(a + t * (b - a)))
    return np.arctan(best)


@given(st.integers(0, 10_000))
def test_a_polyhedron_is_passed_at_the_silhouette_edge_nearest_in_perspective(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(9, 3))
    solid = polyhedron(points)
    here = np.array([-12.0, *rng.uniform(-2, 2, 2)])
    heading = unit(solid.centre + rng.uniform(-0.3, 0.3, 3) - here)
    if not np.isfinite(entry_(packed([solid]), 0, *here, *heading, 0.0)):
        return
    up = np.cross(unit(np.cross(heading, (0, 0, 1))), heading)
    there = aim(solid, heading, 0.0, up, at=here)
    expected = nearest_silhouette_angle(points, None, here, heading)
    assert np.arccos(np.clip(there @ heading, -1, 1)) == pytest.approx(expected, abs=1e-6)


def test_at_a_plane_the_aim_is_along_it():
    wall = half_space((5, 0, 0), (-1, 0, 0))
    there = aim(wall, (1, 0.3, 0))
    assert there[1] > 0.9
    assert there[0] < 0
    assert aim(half_space((0, 0, 9), (0, 0, -1)), (0, 0, 1), up=(1, 0, 0))[0] > 0.9  # dead ahead: upwards of the body


@pytest.mark.parametrize("odd", [0, 1])
def test_along_a_wall_the_aim_is_level(odd):
    wall = half_space((5, 0, 0), (-1, 0, 0))
    ahead = aim(wall, (1, 0, 0), odd=odd)
    assert abs(ahead[1]) > 0.9 and (ahead[1] > 0) == (odd == 0) and ahead[2] == 0.0
    climbing = aim(wall, (0.2, 0.1, 0.97), odd=odd)
    assert climbing[1] > 0.9 and climbing[2] == 0.0


# steps --------------------------------------------------------------------------------


@given(st.integers(0, 10_000))
def test_nobody_enters_a_solid_by_any_step(seed):
    rng = np.random.default_rng(seed)
    solids = packed(shapes(seed))
    w = rng.uniform(0, 0.5)
    free, *p = out_of_(solids, *rng.uniform(-5, 5, 3), w)
    if not free:
        return
    for _ in range(20):
        _, *p = slide_(solids, *p, *(rng.normal(size=3) * rng.choice([0.1, 1.0, 10.0])), w)
        assert min(surface_(solids, k, *p)[0] for k in range(7)) > w - 2e-6


def test_a_step_along_a_wall_goes_on_and_one_into_it_stops():
    wall = packed([half_space((0, 0, 0), (0, 0, 1))])
    touched, x, y, z = slide_(wall, 0.0, 0.0, 0.3, 3.0, 0.0, -1.0, 0.2)
    assert touched
    assert (x, y, z) == pytest.approx((3.0, 0.0, 0.2), abs=1e-4)
    assert slide_(wall, 0.0, 0.0, 0.2, 0.0, 0.0, -5.0, 0.2)[3] == pytest.approx(0.2, abs=1e-5)


def test_a_thin_wall_stops_a_long_step():
    wall = packed([prism(SQUARE * (0.01, 50), -50, 50)])
    assert slide_(wall, -3.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.1)[1] < 0


def test_a_solid_that_came_over_a_body_pushes_it_out_by_the_nearest_face():
    s = packed([prism(SQUARE, -1.0, 1.0)])
    free, *p = out_of_(s, 0.8, 0.1, 0.0, 0.1)
    assert free
    assert p == pytest.approx([1.1, 0.1, 0.0], abs=1e-5)
    free, *p = out_of_(packed([sphere((0, 0, 0), 1.0)]), 0.0, 0.0, 0.0, 0.1)
    assert free
    assert p == pytest.approx([0, 0, 1.1], abs=1e-5)


def test_bodies_of_animals_stand_among_the_solids():
    s = with_cylinders(packed(shapes()), np.array([[50.0, 0, 1.0]]), np.array([2.0]), np.array([1.0]))
    assert len(s.kind) == 8
    assert surface_(s, 7, 53.0, 0.0, 1.0)[0] == pytest.approx(1.0)
    alone = with_cylinders(no_solids(), np.array([[0.0, 0, 1.0]]), np.array([2.0]), np.array([1.0]))
    assert surface_(alone, 0, 0.0, 0.0, 3.0)[0] == pytest.approx(1.0)
