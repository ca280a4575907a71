"""Lines of a scene as exporters write them: on the drawn curve, and on the ground, hills included."""

import numpy as np
import pytest
from flockbrush.levels.geometry import inside
from flockbrush.systems.edits import PlaceGoal

from flockbrush.output.live.messages import place as place_message
from flockbrush.output.scene_meshes import CELLS, SceneMeshes, divided
from flockbrush.render.canvas import smooth
from flockbrush.runs.run import start


def test_guides_follow_the_curve_that_the_ground_shows():
    simulation = start("meadow", agents=4)
    for guide, line in zip(simulation.level.guides, SceneMeshes(simulation).guides(), strict=True):
        assert line.points[:, :2] == pytest.approx(smooth(np.asarray(guide.points)[:, :2], guide.loop))


def test_lines_follow_hills_between_their_corners():
    place = SceneMeshes(start("ridge", agents=4))
    cell = max(place.width, place.height) / CELLS + 1e-9
    for line in [*place.guides(), *(line for _, lines, _ in place.outlines() for line in lines)]:
        ends = np.roll(line.points, -1, axis=0) if line.closed else line.points[1:]
        steps = ends - line.points[: len(ends)]
        middles = 0.5 * (ends + line.points[: len(ends)])
        assert np.hypot(steps[:, 0], steps[:, 1]).max() <= cell
        assert np.abs(middles[:, 2] - place.heights(middles[:, :2])).max() < 0.5


def test_a_divided_line_keeps_its_corners_and_its_length():
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    for closed, length in ((False, 7.0), (True, 12.0)):
        line = divided(corners, 0.7, closed)
        around = np.vstack([line, line[:1]]) if closed else line
        steps = np.hypot(*np.diff(around, axis=0).T)
        assert steps.sum() == pytest.approx(length) and steps.max() <= 0.7
        assert all((np.abs(line - corner).sum(axis=1) == 0).any() for corner in corners)
    assert divided(corners[:1], 0.7).tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("name", ["skein", "meadow", "ridge"])
def test_the_picture_of_the_ground_lies_on_the_ground_and_has_no_margin(name):
    place = SceneMeshes(start(name, agents=4))
    painter, ground = place.painter(), place.ground()
    at = ground.uv * painter.size  # pixels, from the lower left corner
    points = ground.points.reshape(-1, 3)[:, :2]
    assert at == pytest.approx(painter.camera.pixels(points) * (1, -1) + (0, painter.size[1]), abs=1e-6)
    assert at.min() > -0.5 and (at.max(axis=0) > np.subtract(painter.size, 0.5)).all()
    picture = place.painter(256).ground
    assert not (picture[2] == painter.theme.paper).all(axis=1).any()  # at the edge, all is painted


def test_the_picture_of_a_ground_that_is_a_mere_strip_lies_on_it_too():
    place = SceneMeshes(start("meadow", agents=4))
    place.height = 0.001 * place.width
    at = place.ground().uv * place.painter(2048).size
    assert np.ptp(at, axis=0) == pytest.approx((2048, 2.048)) and at.mean(axis=0) == pytest.approx((1024, 4))


def test_measured_areas_do_not_look_like_exits():
    place = SceneMeshes(start("meadow", agents=4), "dark")
    look = place.theme
    told = [(kind, [line.name for line in lines], colour) for kind, lines, colour in place.outlines()]
    assert told == [
        ("Exits", ["down the road"], look.exit), ("Areas", ["pasture"], look.muted), ("Goal areas", [], look.goal),
    ]  # fmt: skip
    assert look.exit != look.muted


def test_a_goal_that_is_an_area_has_its_outline_and_a_point_in_it():
    simulation = start("meadow", agents=4)
    before = len(SceneMeshes(simulation).goals())
    ring = [[10, 10], [20, 10], [20, 20], [10, 20], [10, 18], [18, 18], [18, 12], [10, 12]]
    simulation.submit(PlaceGoal(901, "fold", None, None, points=ring))
    simulation.tick()
    place = SceneMeshes(simulation)
    goal, (outline,) = place.goals()[-1], place.outlines()[2][1]
    assert len(place.goals()) == before + 1 and goal.radius == 0.0 and outline.closed
    assert {tuple(corner) for corner in ring} <= {tuple(point) for point in outline.points[:, :2].tolist()}
    assert inside(goal.at[None, :2], np.array(ring, float))[0]
    told = place_message(simulation)["goals"][-1]
    assert told["outline"] == ring and told["radius"] == 0.0
    assert told["xy"] == pytest.approx(goal.at[:2].tolist())
