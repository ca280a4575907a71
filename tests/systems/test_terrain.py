"""What is underfoot: painted ground, slopes and polygons."""

from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.systems.ground_height import Heights
from flockbrush.systems.terrain import (
    NO_BRUSH,
    Footing,
    compose_blocked,
    compose_brushes,
    compose_caps,
    point_in_polygon,
    rasterise_polygon,
    relief_of,
    sample_ground,
    slope_factor_,
)
from hypothesis import given, settings
from hypothesis import strategies as st

SQUARE = np.array([(2, 1), (6, 1), (6, 4), (2, 4)], float)
PALETTE = ["march", "graze", "swarm"]


def layer(name, index, assets, weight=1.0):
    return SimpleNamespace(name=name, index=np.array(index, np.int16), assets=assets, weight=weight)


def zone(polygon, brush=None, max_speed=np.inf, factor=1.0):
    return SimpleNamespace(
        name="pen", polygon=np.array(polygon, float), brush=brush, max_speed=max_speed, factor=factor
    )


def under(xyz, cell=1.0, surface=None, brush=None, relief=None, relief_cell=1.0):
    """Factor, cap, brush, slope and height under each animal."""
    xyz = np.array(xyz, float)
    surface = compose_caps((4, 8), cell) if surface is None else surface
    brush = np.full(surface.shape[:2], NO_BRUSH, np.int32) if brush is None else brush
    n = len(xyz)
    out = Footing(np.empty(n), np.empty(n), np.empty(n, np.int32), np.empty((n, 2)), np.empty(n))
    heights = Heights(relief_of() if relief is None else relief, relief_cell, (0.0, 0.0))
    sample_ground(0, n, xyz, cell, surface, brush, heights, out)
    return out


# Under the feet


def test_an_animal_has_the_brush_of_the_cell_that_it_stands_on():
    brush = np.arange(32, dtype=np.int32).reshape(4, 8)
    _, _, found, _, _ = under(
        [(0.1, 0.1, 0), (1.9, 0.0, 0), (2.0, 1.99, 0), (15.9, 7.9, 0)], 2.0, compose_caps((4, 8), 2.0), brush
    )
    np.testing.assert_array_equal(found, [0, 0, 1, 31])


def test_off_the_map_nothing_is_painted_and_the_ground_is_as_high_as_at_the_border():
    brush, surface = np.arange(32, dtype=np.int32).reshape(4, 8), np.full((4, 8, 2), 0.5)
    relief = relief_of(np.arange(32.0).reshape(4, 8), 1.0)
    places = [(-9, -9), (1e9, 0.5), (3.5, 1e300), (-0.0, 4.0), (8.0, 0.0), (8.001, 0.0)]
    factor, cap, found, _, z = under(places, surface=surface, brush=brush, relief=relief)
    assert found.tolist() == [NO_BRUSH, NO_BRUSH, NO_BRUSH, 24, 7, NO_BRUSH]
    assert factor.tolist() == [1.0, 1.0, 1.0, 0.5, 0.5, 1.0]
    assert cap.tolist() == [np.inf, np.inf, np.inf, 0.5, 0.5, np.inf]
    assert z.tolist() == [0.0, 7.0, 27.0, 24.0, 7.0, 7.0]


def test_flat_ground_asks_for_nothing():
    factor, cap, brush, slope, z = under([(1, 1, 5)])
    assert (factor[0], cap[0], brush[0], z[0]) == (1.0, np.inf, NO_BRUSH, 0.0)
    assert not slope.any()


def test_on_an_inclined_plane_height_and_slope_are_those_of_the_plane():
    y, x = (np.mgrid[:20, :30] + 0.5) * 0.5
    relief = relief_of(3 + 0.2 * x - 0.4 * y, 0.5)
    xyz = np.random.default_rng(0).random((50, 3)) * [14, 9, 0] + [0.5, 0.5, 0]
    _, _, _, slope, z = under(xyz, relief=relief, relief_cell=0.5)
    np.testing.assert_allclose(slope, np.broadcast_to([0.2, -0.4], (50, 2)), atol=1e-12)
    np.testing.assert_allclose(z, 3 + 0.2 * xyz[:, 0] - 0.4 * xyz[:, 1])


def test_height_and_slope_do_not_jump():
    relief = relief_of(np.random.default_rng(1).random((10, 10)), 1.0)
    way = np.c_[np.linspace(-1, 11, 24001), np.linspace(0, 9, 24001)]
    _, _, _, slope, z = under(way, relief=relief)
    assert np.abs(np.diff(z)).max() < 2e-3
    assert np.abs(np.diff(slope, axis=0)).max() < 2e-3


def test_only_the_rows_asked_are_written():
    nothing = np.full(4, -7.0), np.full(4, -7.0), np.full(4, -7, np.int32), np.full((4, 2), -7.0), np.full(4, -7.0)
    out, heights = Footing(*nothing), Heights(relief_of(), 1.0, (0.0, 0.0))
    sample_ground(1, 3, np.ones((4, 3)), 1.0, compose_caps((4, 8), 1.0), np.zeros((4, 8), np.int32), heights, out)
    np.testing.assert_array_equal(out[0], [-7, 1, 1, -7])
    np.testing.assert_array_equal(out[2], [-7, 0, 0, -7])


# Slope


def test_slopes_slow_as_tobler_measured():
    rises = np.array([0, 0.2, -0.05, -0.5])
    factors = [slope_factor_(rise) for rise in rises]
    np.testing.assert_allclose(factors, np.exp(-3.5 * np.abs(rises + 0.05)) / np.exp(-3.5 * 0.05), rtol=1e-12)
    assert factors[0] == 1.0


def test_up_is_slower_than_down_and_nothing_is_faster_than_gently_down():
    rises = np.linspace(-2, 2, 401)
    up, down = (np.array([slope_factor_(side * rise) for rise in rises]) for side in (1.0, -1.0))
    np.testing.assert_allclose(up, down[::-1], rtol=1e-12)
    assert rises[up.argmax()] == pytest.approx(-0.05)
    assert (up[201:] < up[:200][::-1]).all()


# Painting


def test_the_layer_of_greater_weight_wins_and_of_equals_the_later():
    low = layer("brush low", [[0, 0, 0, -1]], ["march"], 0.5)
    high = layer("brush high", [[0, -1, -1, -1]], ["graze"], 1.0)
    late = layer("brush late", [[1, 1, -1, -1]], ["march", "swarm"], 0.5)
    brush = compose_brushes([low, high, late], [], (1, 4), 1.0, PALETTE)
    np.testing.assert_array_equal(brush, [[1, 2, 0, NO_BRUSH]])
    assert brush.dtype == np.int32
    hidden = compose_brushes([layer("hidden", [[0] * 4], ["march"], 0.0)], [], (1, 4), 1.0, PALETTE)
    assert (hidden == NO_BRUSH).all()


def test_zones_lie_above_layers_and_later_zones_above_earlier():
    painted = layer("brush", np.zeros((5, 8)), ["march"])
    zones = [zone(SQUARE, "graze"), zone(SQUARE + [2, 0], "swarm"), zone(SQUARE, max_speed=1.0)]
    brush = compose_brushes([painted], zones, (5, 8), 1.0, PALETTE)
    np.testing.assert_array_equal(brush[2], [0, 0, 1, 1, 2, 2, 2, 2])
    np.testing.assert_array_equal(brush[4], 0)


def test_an_unknown_brush_is_named_with_where_it_is():
    with pytest.raises(ValueError, match=r"layer 'brush': no brush 'marsh'; there are march, graze, swarm"):
        compose_brushes([layer("brush", [[0]], ["marsh"])], [], (1, 1), 1.0, PALETTE)
    with pytest.raises(ValueError, match=r"zone 'pen': no brush 'marsh'"):
        compose_brushes([], [zone(SQUARE, "marsh")], (1, 1), 1.0, PALETTE)


def test_factors_multiply_and_the_smallest_cap_holds():
    cap = np.full((5, 8), np.inf)
    cap[2, :4] = 2.0
    zones = [zone(SQUARE, max_speed=3.0, factor=0.5), zone(SQUARE, factor=0.5), zone(SQUARE, "graze")]
    surface = compose_caps((5, 8), 1.0, speed_factor=np.full((5, 8), 0.8), cap=cap, zones=zones)
    np.testing.assert_allclose(surface[2, :, 0], [0.8, 0.8, 0.2, 0.2, 0.2, 0.2, 0.8, 0.8])
    np.testing.assert_array_equal(surface[2, :, 1], [2, 2, 2, 2, 3, 3, np.inf, np.inf])


def obstacle(polygon, margin=0.0):
    return SimpleNamespace(polygon=np.array(polygon, float), margin=margin)


def test_obstacles_and_ground_that_is_not_walkable_are_blocked():
    walkable = np.ones((5, 8), bool)
    walkable[0, 0] = False
    blocked = compose_blocked((5, 8), 1.0, walkable, [obstacle(SQUARE)])
    expected = ~walkable
    expected[1:4, 2:6] = True
    np.testing.assert_array_equal(blocked, expected)


def test_the_margin_of_an_obstacle_is_blocked_too():
    blocked = compose_blocked((20, 20), 1.0, None, [obstacle([(8, 8), (12, 8), (12, 12), (8, 12)], 3.0)])
    y, x = np.mgrid[:20, :20] + 0.5
    away = np.hypot(np.maximum(np.abs(x - 10) - 2, 0), np.maximum(np.abs(y - 10) - 2, 0))
    np.testing.assert_array_equal(blocked, away < 3.0)


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.8, 1.3, np.pi / 2])
def test_no_way_leads_through_a_fence_thinner_than_a_cell(angle):
    u, v = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)]) * 0.05
    middle = np.array([15.2, 15.3])
    fence = [middle - 40 * u - v, middle + 40 * u - v, middle + 40 * u + v, middle - 40 * u + v]
    blocked = compose_blocked((30, 30), 1.0, None, [obstacle(fence)])
    y, x = np.mgrid[:30, :30] + 0.5
    left = (x - middle[0]) * v[0] + (y - middle[1]) * v[1] > 0
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        assert not (~blocked[a] & ~blocked[b] & (left[a] != left[b])).any()
    assert blocked.sum() < 70, "one cell thick, or two at a step"


# Polygons


def winding(x, y, polygon):
    """How often the polygon goes round the point, by angles: the plain way."""
    ahead = polygon - [x, y]
    after = np.roll(ahead, -1, 0)
    turn = np.arctan2(ahead[:, 0] * after[:, 1] - ahead[:, 1] * after[:, 0], (ahead * after).sum(1))
    return round(turn.sum() / (2 * np.pi))


def star(rng, corners):
    a = np.sort(rng.random(corners)) * 2 * np.pi
    return np.c_[np.cos(a), np.sin(a)] * (0.3 + rng.random((corners, 1))) * 5 + 6


@pytest.mark.parametrize("seed", range(5))
def test_inside_is_where_the_outline_goes_round(seed):
    rng = np.random.default_rng(seed)
    polygon = star(rng, 9) if seed < 3 else rng.random((7, 2)) * 12
    for x, y in rng.random((400, 2)) * 12:
        assert point_in_polygon(x, y, polygon) == (winding(x, y, polygon) % 2 == 1)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_every_point_belongs_to_exactly_one_of_the_triangles_of_a_tiling(seed):
    rng = np.random.default_rng(seed)
    corners = np.round(rng.random((5, 5, 2)) * 0.8 * 8) / 8 + np.stack(np.meshgrid(np.arange(5), np.arange(5)), -1)
    tiles = []
    for iy in range(4):
        for ix in range(4):
            a, b, c, d = corners[iy, ix], corners[iy, ix + 1], corners[iy + 1, ix + 1], corners[iy + 1, ix]
            tiles += (
                [np.array([a, b, c]), np.array([d, c, a])] if seed % 2 else [np.array([a, b, d]), np.array([d, b, c])]
            )
    inner = corners.reshape(-1, 2)
    between = 0.5 * (corners[:, :-1] + corners[:, 1:]).reshape(-1, 2)
    outline = np.concatenate([corners[0, :-1], corners[:-1, -1], corners[-1, :0:-1], corners[:0:-1, 0]])
    turned = [tile[:: 1 if seed % 3 else -1].copy() for tile in tiles]
    for x, y in np.concatenate([inner, between, rng.random((40, 2)) * 5]):
        claims = sum(point_in_polygon(x, y, tile) for tile in turned)
        assert claims % 2 == point_in_polygon(x, y, outline)
        if abs(winding_area(tiles) - polygon_area(outline)) < 1e-9:
            assert claims == point_in_polygon(x, y, outline)


def polygon_area(polygon):
    after = np.roll(polygon, -1, 0)
    return 0.5 * (polygon[:, 0] * after[:, 1] - polygon[:, 1] * after[:, 0]).sum()


def winding_area(tiles):
    return sum(abs(polygon_area(tile)) for tile in tiles)


def test_the_western_and_southern_edges_belong_to_a_polygon():
    inside = [
        point_in_polygon(x, y, SQUARE) for x, y in np.array([(2, 2), (4, 1), (2, 1), (6, 2), (4, 4), (6, 4)], float)
    ]
    assert inside == [True, True, True, False, False, False]


def test_squares_side_by_side_never_share_an_animal():
    for x, y in np.array([(2, 2), (2, 2.5), (2.5, 2), (3, 3), (1, 1), (3, 1.5)]):
        squares = [
            np.array([(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)], float) for i in range(5) for j in range(5)
        ]
        assert sum(point_in_polygon(x, y, square) for square in squares) == 1


@pytest.mark.parametrize("seed", range(4))
def test_a_painted_polygon_covers_the_cells_whose_centre_is_inside(seed):
    rng = np.random.default_rng(seed)
    polygon = np.round(star(rng, 11) * 2) / 2 - [1, 0]  # corners on centres and borders of cells, some off the map
    mask = rasterise_polygon(polygon, (20, 22), 0.5)
    expected = [[point_in_polygon((ix + 0.5) * 0.5, (iy + 0.5) * 0.5, polygon) for ix in range(22)] for iy in range(20)]
    np.testing.assert_array_equal(mask, expected)
    np.testing.assert_array_equal(rasterise_polygon(polygon[::-1], (20, 22), 0.5), mask)
    assert mask.any()


@pytest.mark.parametrize("polygon", [np.zeros((0, 2)), [(1, 1)], [(1, 1), (3, 3)], [(2, 2)] * 4], ids=str)
def test_a_polygon_without_area_covers_nothing(polygon):
    assert not rasterise_polygon(polygon, (5, 5), 1.0).any()
