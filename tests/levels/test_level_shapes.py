"""Shapes that a designer draws, and the corners of hulls."""

import math

import numpy as np
import pytest
from flockbrush.levels.geometry import centroid, inner_point, inside, signed_area
from small_level import GRASS, WALL, herd, level, objects, polygon, polyline, problem, read, thing, tiles, with_objects


def test_a_sign_stands_in_the_middle_of_an_area_or_in_the_ring():
    field = np.array([[0, 0], [4, 0], [4, 2], [0, 2]], float)
    outer, hole = (
        np.array([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]),
        np.array([[3, 3], [3, 7], [7, 7], [7, 3], [3, 3]]),
    )
    ring = np.vstack([outer, hole]).astype(float)
    assert inner_point(field) == pytest.approx([2, 1]) and not inside(centroid(ring)[None], ring)[0]
    at = inner_point(ring)
    assert inside(at[None], ring)[0] and 1.0 < min(*at, *(10 - at)) < 2.0


class TestShapes:
    """Pitfall 1: y is down and rotation clockwise in Tiled, offsets and groups add up."""

    def test_the_north_west_corner_of_tiled_is_the_top_of_our_y(self):
        spawn = read(level()).spawns[0]
        assert spawn.polygon.min(axis=0) == pytest.approx([4, 4])  # 32 px = 2 tiles = 4 m; 20 - (32+96)/16*2 = 4
        assert spawn.polygon.max(axis=0) == pytest.approx([20, 16])

    def test_every_area_is_counter_clockwise_however_it_was_drawn(self):
        corners = [(0, 0), (32, 0), (32, 32), (0, 16)]
        for points in (corners, corners[::-1]):
            rock = thing(2, "Obstacle", 16, 16, extra=polygon(*points))
            shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
            assert signed_area(shape) == pytest.approx(12)  # 768 px^2 at 64 px^2 a m^2

    def test_a_polyline_keeps_its_direction_and_starts_at_its_origin(self):
        arrow = thing(2, "Guide", 16, 144, extra=polyline((0, 0), (128, -64)))
        assert read(with_objects("guides", arrow)).guides[0].points == pytest.approx(np.array([(2, 2), (18, 10)]))

    def test_rotation_is_clockwise_about_the_top_left_corner(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 16, extra={"rotation": 90})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        assert shape.min(axis=0) == pytest.approx([8, 6])  # turned down and to the left of (10, 10) m
        assert shape.max(axis=0) == pytest.approx([10, 10])

    def test_a_quarter_turn_in_two_eighths_agrees_with_one_in_a_quarter(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 32, extra={"rotation": 45})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        diagonal = 4 * math.sqrt(2)
        assert shape.min(axis=0) == pytest.approx([10 - diagonal / 2, 10 - diagonal])
        assert shape.max(axis=0) == pytest.approx([10 + diagonal / 2, 10])

    def test_a_tile_object_stands_on_its_bottom_left_corner(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 16, extra={"gid": GRASS})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        assert shape.min(axis=0) == pytest.approx([10, 10])
        assert shape.max(axis=0) == pytest.approx([14, 12])

    def test_a_tileset_may_centre_its_tile_objects(self):
        document = with_objects("obstacles", thing(2, "Obstacle", 80, 80, 32, 16, extra={"gid": 0x80000000 | GRASS}))
        document["tilesets"][0]["objectalignment"] = "center"
        assert read(document).obstacles[0].polygon.mean(axis=0) == pytest.approx([10, 10])

    def test_an_ellipse_is_a_polygon_that_touches_its_box(self):
        pond = thing(2, "Obstacle", 16, 16, 64, 32, extra={"ellipse": True})
        shape = read(with_objects("obstacles", pond)).obstacles[0].polygon
        assert len(shape) == 32
        assert shape.min(axis=0) == pytest.approx([2, 14])
        assert shape.max(axis=0) == pytest.approx([10, 18])
        assert signed_area(shape) == pytest.approx(math.pi * 4 * 2, rel=0.01)

    def test_a_capsule_is_a_box_with_round_ends(self):
        log = thing(2, "Obstacle", 16, 16, 64, 16, extra={"capsule": True})
        shape = read(with_objects("obstacles", log)).obstacles[0].polygon
        assert shape.max(axis=0) - shape.min(axis=0) == pytest.approx([8, 2])
        assert signed_area(shape) == pytest.approx(6 * 2 + math.pi, rel=0.01)

    def test_offsets_of_nested_groups_and_layers_add_up(self):
        inner = objects("spawns", herd(), offsetx=-16, offsety=-8)
        group = {"type": "group", "name": "north", "offsetx": -8, "layers": [inner]}
        outer = {"type": "group", "name": "all", "offsety": 16, "layers": [group]}
        spawn = read(level(tiles(), outer)).spawns[0]
        assert spawn.polygon.min(axis=0) == pytest.approx([1, 3])

    def test_a_tile_layer_is_offset_by_whole_tiles_or_not_at_all(self):
        gids = [0] * 100
        gids[0] = WALL
        ground = read(level(tiles(gids=gids, offsetx=32, offsety=16), objects("spawns", herd()))).terrain
        assert np.argwhere(~ground.walkable).tolist() == [[8, 2]]
        assert "may be offset by whole tiles of 16 px only, got 8, 0" in problem(
            level(tiles(offsetx=8), objects("spawns", herd()))
        )

    def test_a_double_click_at_a_corner_does_no_harm(self):
        rock = thing(2, "Obstacle", 16, 16, extra=polygon((0, 0), (32, 0), (32, 0), (32, 32), (0, 0)))
        assert len(read(with_objects("obstacles", rock)).obstacles[0].polygon) == 3

    def test_an_outline_that_crosses_itself_is_refused(self):
        bow = thing(2, "Obstacle", 16, 16, name="bow", extra=polygon((0, 0), (32, 32), (32, 0), (0, 32)))
        assert "object 2 'bow' in layer 'obstacles': its outline crosses itself near (2.0, 18.0) m" in problem(
            with_objects("obstacles", bow)
        )

    @pytest.mark.parametrize(
        "shape", [{}, polygon((0, 0), (32, 32)), polygon((0, 0), (16, 16), (32, 32)), {"ellipse": True}, {"width": 32}]
    )
    def test_a_shape_without_area_is_refused(self, shape):
        assert "its area is zero; enlarge or delete it" in problem(
            with_objects("obstacles", thing(2, "Obstacle", 16, 16, extra=shape))
        )

    def test_a_shape_of_the_wrong_kind_says_which_is_right(self):
        assert "a Guide must be a polyline, but this is a rectangle, ellipse or polygon" in problem(
            with_objects("guides", thing(2, "Guide", 16, 16, 32, 32))
        )
        assert "an Exit must be a rectangle, ellipse or polygon, but this is a polyline" in problem(
            with_objects("exits", thing(2, "Exit", 16, 16, extra=polyline((0, 0), (9, 9))))
        )

    def test_an_area_goal_has_its_centre_of_mass(self):
        fold = thing(2, "Goal", 16, 16, 32, 64, name="fold")
        goal = read(with_objects("goals", fold)).goals[0]
        assert goal.xy == pytest.approx([4, 14])
        assert goal.polygon is not None


PYRAMID = "-2 -2 0; 2 -2 0; 2, 2, 0; -2 2 0; 0 0 5"


def rock_with(**values):
    return with_objects("obstacles", thing(2, "Obstacle", 16, 16, 32, 32, "rock", **values))


class TestHulls:
    """A solid with flat faces is told by its corners."""

    def test_corners_are_metres_from_the_middle_of_its_foot(self):
        rock = read(rock_with(shape="hull", corners=PYRAMID, z_max=5.0)).obstacles[0]
        assert rock.corners.shape == (5, 3)
        assert rock.corners[4].tolist() == [0.0, 0.0, 5.0]

    @pytest.mark.parametrize(
        ("corners", "told"),
        [
            ("", "4 to 32 corners of three numbers"),
            ("0 0 0; 1 0 0; 0 1 0", "4 to 32 corners"),
            ("0 0; 1 0; 0 1; 1 1", "three numbers"),
            ("0 0 0; 1 0 0; 0 1 0; 1 1 0", "must not lie in one plane"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 up", "could not convert"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 nan", "coordinates must be at most"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 1e300", "coordinates must be at most"),
            ("; ".join(f"{k} {k * k} {k**3}" for k in range(40)), "4 to 32 corners"),
        ],
    )
    def test_what_is_no_hull_is_told(self, corners, told):
        found = problem(rock_with(shape="hull", corners=corners))
        assert "rock" in found and "such as '-2 -2 0;" in found and told in found

    def test_corners_of_a_box_are_told(self):
        assert "corners can only be used with shape 'hull', and shape is 'box'" in problem(rock_with(corners=PYRAMID))
