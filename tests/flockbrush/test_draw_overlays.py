"""What is laid over a herd: it says what is so, where it is so, and its words can be read."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.components import Body, FormationPlace, Position
from flockbrush.engine.commands import Commands
from flockbrush.levels.schema import Guide
from flockbrush.systems.edits import Paint, PlaceGoal
from flockbrush.systems.explain import explain
from flockbrush.systems.senses import Sight
from small_herd import box, brush, meadow, obstacle, put, spawn

from flockbrush.render import Painter, Scenery
from flockbrush.render.forces import arrows_of, place_names
from flockbrush.render.overlay_registry import OVERLAYS, load_overlays
from flockbrush.render.overlays import Overlays
from flockbrush.render.strokes import RAYS, count_in_cells, draw_arrow, draw_lines, how_far, links_of
from flockbrush.render.style import rgb, theme_of, worn
from flockbrush.runs.power_savings import savings_of
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

SIZE = (480, 360)
load_overlays()
ALL = set(OVERLAYS)


def small_world(boundary="wall", count=60, seed=4, **more):
    simulation = meadow(
        brush("sheep", vision={"range": 8.0, "field_of_view": 300.0, **more}), brush("other"),
        seed=seed, boundary=boundary, spawns=[spawn(box(8, 8, 30, 30), "sheep", count, heading=None)],
        obstacles=[obstacle(box(18, 18, 21, 24))],
        guides=[Guide(1, "way", np.array([(2.0, 5.0), (36.0, 34.0)]), 1.0, 30.0, 8.0, "", False)],
    )  # fmt: skip
    simulation.run(12)
    return simulation


class Look:
    """A world in a picture."""

    def __init__(self, simulation, theme="light", **options):
        self.simulation, self.scenery = simulation, Scenery(simulation)
        self.painter = Painter(self.scenery, SIZE, theme, words=False, **options)
        self.overlays = Overlays(self.scenery, theme)
        self.camera, self.moment = self.painter.home, moment_of(simulation)

    def frame(self, shown, selected=None):
        """The ground with these overlays."""
        frame = self.painter.ground.copy()
        self.overlays.under(frame, self.camera, shown, self.moment)
        self.overlays.over(frame, self.camera, shown, self.moment, selected)
        return frame

    def changed(self, shown, selected=None):
        """(h, w) bool, what they have drawn on."""
        return (self.frame(shown, selected) != self.painter.ground).any(axis=2)

    def of(self, xy):
        """Column and row of a place."""
        return self.camera.pixels(xy).astype(int)


@pytest.fixture(scope="module")
def look():
    return Look(small_world())


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("name", [name for name in OVERLAYS if name != "saved"])  # a herd on foot saves nothing
def test_every_overlay_draws_something_and_the_same_again(name, theme):
    one = Look(small_world(), theme)
    Paint("brush", "other", 10.0, 10.0, 20.0, 12.0, 4.0).apply(one.simulation.world)
    Paint("cap", 0.5, 10.0, 30.0, 20.0, 32.0, 3.0).apply(one.simulation.world)
    selected = int(one.moment.ids[20])
    first = one.frame({name}, selected)
    assert (first != one.painter.ground).any(axis=2).sum() > 40
    assert np.array_equal(first, one.frame({name}, selected))
    assert OVERLAYS[name].title and OVERLAYS[name].tip


@pytest.mark.parametrize("name", [name for name, overlay in OVERLAYS.items() if overlay.of_one])
def test_what_is_of_one_animal_needs_one(look, name):
    assert not look.changed({name}).any()
    assert not look.changed({name}, 10**6).any()  # nobody of that number lives
    assert look.changed({name}, int(look.moment.ids[0])).any()


def test_nothing_is_drawn_for_nothing(look):
    assert not look.changed(set()).any()
    assert not look.changed({"no such overlay"}).any()


def test_an_empty_world_has_overlays_too():
    simulation = meadow(brush())
    simulation.tick()
    assert Look(simulation).frame(ALL, 1).shape == (*SIZE[::-1], 3)


def test_overlays_stay_in_the_view(look):
    camera = Painter(look.scenery, SIZE).home  # with room for words above and below
    frame = np.zeros((*SIZE[::-1], 3), np.uint8)
    look.overlays.under(frame, camera, ALL, look.moment)
    look.overlays.over(frame, camera, ALL, look.moment, int(look.moment.ids[5]))
    left, top, right, bottom = camera.view
    assert frame[top:bottom].any() and not frame[:top].any() and not frame[bottom:].any()


# why it turns --------------------------------------------------------------------


def test_arrows_point_where_the_reasons_push():
    terms = [("heading", (1, 0)), ("cohesion", (0.0, 0.3)), ("avoidance", (-0.1, -0.1)), ("slope", (1e-6, 0))]
    arrows = dict(arrows_of(terms))
    assert set(arrows) == {"cohesion", "avoidance"}  # the heading turns nobody, the slope is too little to see
    assert arrows["cohesion"] == pytest.approx((0, -96))  # north is up
    assert arrows["avoidance"][0] < 0 < arrows["avoidance"][1]
    assert np.hypot(*arrows["avoidance"]) < 96


@pytest.mark.parametrize("seed", range(40))
def test_names_of_arrows_never_lie_on_one_another(seed):
    rng = np.random.default_rng(seed)
    at = rng.uniform((0, 0), (1280, 720))
    names = ["facing", "wish", "cohesion", "avoidance", "alignment", "obstacles", "back to the herd", "guide", "fear"]
    spread = rng.choice([0.05, 0.6, 6.3])  # from all in one direction to all round
    turn, long = rng.uniform(0, spread, len(names)), rng.uniform(20, 110, len(names))
    tips = at + long[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    boxes = place_names(names, at, tips, (0, 0, 1280, 720))
    assert (boxes[:, :2] >= -1e-9).all() and (boxes[:, 2:] <= (1280.001, 720.001)).all()
    for k, a in enumerate(boxes):
        for b in boxes[:k]:
            assert a[0] >= b[2] or b[0] >= a[2] or a[1] >= b[3] or b[1] >= a[3]
    wide = boxes[:, 2] - boxes[:, 0]
    assert (wide > 20).all()  # every name has found its place
    near = np.hypot(*(np.clip(tips, boxes[:, :2], boxes[:, 2:]) - tips).T)
    assert near.max() < 200


def test_an_arrow_reaches_its_tip_and_goes_no_farther():
    frame = np.zeros((60, 120, 3), np.uint8)
    white = (255.0, 255.0, 255.0)
    draw_arrow(frame, np.array([0, 0, 120, 60]), (10.0, 30.0, 100.0, 30.0), 3.0, 12.0, 0.0, white, 1.0)
    rows, columns = np.nonzero(frame[..., 0] > 100)
    assert columns.min() in (8, 9, 10) and columns.max() in (97, 98, 99)
    assert abs(rows.mean() - 29.5) < 0.2
    assert (frame[:, 93] > 100).sum() > (frame[:, 50] > 100).sum()  # the head is wider than the stem


# sight ---------------------------------------------------------------------------


@pytest.mark.parametrize("boundary", ["wall", "wrap"])
def test_who_is_seen_stands_in_the_light(boundary):
    simulation = small_world(boundary, 80, field_of_view=360.0)
    look = Look(simulation)
    agree = total = 0
    for row in range(0, len(look.moment), 3):
        told = explain(simulation.world, int(look.moment.ids[row]))
        depth = look.overlays._depth(look.moment, row, told.view_range)
        for other in range(len(look.moment)):
            way = look.moment.xyz[other, :2] - look.moment.xyz[row, :2]
            if boundary == "wrap":
                way -= np.round(way / 40.0) * 40.0
            far = np.hypot(*way)
            if 0 < far <= told.view_range:
                lit = depth[ray_of(*way)] >= far - 0.02
                agree += lit == (int(look.moment.ids[other]) in told.sees)
                total += 1
    assert total > 300 and agree / total > 0.97  # rays are not the line from middle to middle


def ray_of(x, y):
    """The compass's number for a direction."""
    size = abs(x) + abs(y)
    part = y / size if x >= 0 else 2 - y / size
    return int(part % 4 * RAYS / 4)


def test_a_wall_hides_what_is_behind_it():
    nobody = np.zeros((0, 2))
    edges = np.array([[3.0, -1.0, 3.0, 1.0]])
    depth = how_far(nobody, nobody, np.zeros(0), np.zeros(0), edges, 10.0)
    assert depth[ray_of(1, 0)] == pytest.approx(3, abs=0.01)
    assert depth[ray_of(3, 0.9)] == pytest.approx(np.hypot(3, 0.9), abs=0.02)
    assert depth[ray_of(3, 1.1)] == depth[ray_of(-1, 0)] == depth[ray_of(0, 1)] == 10
    assert depth.min() == pytest.approx(3, abs=0.001)


def test_a_body_is_seen_and_hides_what_is_behind_it():
    offset, forward = np.array([[0.0, 4.0]]), np.array([[1.0, 0.0]])
    depth = how_far(offset, forward, np.array([1.0]), np.array([0.5]), np.zeros((0, 4)), 10.0)
    assert depth[ray_of(0, 1)] == pytest.approx(4.5, abs=0.02)
    assert depth[ray_of(1.2, 4.0)] < 5 and depth[ray_of(1.9, 4.0)] == 10


def test_the_wedge_opens_forward(look):
    row = 10
    x, y = look.of(look.moment.xyz[row])
    changed = look.changed({"field_of_view"}, int(look.moment.ids[row]))
    forward = look.moment.forward[row, :2] * (1, -1)
    reach = 8.0 * float(look.moment.length[row]) * look.camera.scale
    ahead = np.array([x, y]) + forward * 0.6 * reach
    behind = np.array([x, y]) - forward * 0.6 * reach
    column, line = np.clip(ahead, 0, np.array(SIZE) - 1).astype(int)
    assert changed[line, column]
    column, line = np.clip(behind, 0, np.array(SIZE) - 1).astype(int)
    assert not changed[line, column]


# the many ------------------------------------------------------------------------


def test_links_join_those_that_see_each_other(look):
    lists = look.simulation.world.resource(Sight).lists
    at = look.camera.pixels(look.moment.xyz)
    segments = np.empty((5000, 4))
    everyone = np.ones(len(at), bool)
    count = links_of(lists.first, lists.near, lists.offset, at, everyone, look.camera.scale, segments)
    seen = {frozenset((i, int(j))) for i in range(len(at)) for j in lists.of(i) if j > i}
    assert 0 < count <= len(seen) or count > 0
    alone = np.zeros(len(at), bool)
    alone[7] = True
    count = links_of(lists.first, lists.near, lists.offset, at, alone, look.camera.scale, segments)
    assert count == len(lists.of(7))
    assert segments[:count, :2] == pytest.approx(np.tile(at[7], (count, 1)))


def test_a_thousand_thin_lines_have_the_colour_asked():
    frame = np.full((50, 50, 3), 100, np.uint8)
    draw_lines(frame, np.array([0, 0, 50, 50]), np.array([[5.0, 25.5, 45.0, 25.5]]), 1.0, (200.0, 0.0, 100.0), 1.0)
    assert tuple(frame[25, 25]) == pytest.approx((200, 0, 100), abs=1)
    assert (frame[[22, 28]] == 100).all()
    for segment in ([25.0, 5.0, 30.0, 49.0], [-40.0, -9.0, 90.0, 70.0], [3.0, 3.0, 3.0, 3.0], [np.nan, 0, 1, 1]):
        draw_lines(frame, np.array([0, 0, 50, 50]), np.array([segment]), 0.7, (0.0, 0.0, 0.0), 0.5)


def test_leaders_are_ringed(look):
    leaders = np.flatnonzero(look.moment.leader)
    assert len(leaders)
    frame = look.frame({"leaders"}).astype(int)
    yellow = np.abs(frame - look.overlays.theme.leader).max(axis=2) < 30
    for row in leaders:
        x, y = look.of(look.moment.xyz[row])
        assert yellow[max(y - 12, 0) : y + 13, max(x - 12, 0) : x + 13].any()


def test_everybody_is_counted_once():
    rng = np.random.default_rng(2)
    counts = np.zeros((30, 40), np.float32)
    count_in_cells(rng.uniform(2, 28, (500, 2)), 0.0, 30.0, 1.0, counts)
    assert counts.sum() == pytest.approx(500, rel=1e-5)
    assert counts[:1].sum() == 0


def test_where_many_stand_the_density_is_strong():
    simulation = meadow(brush())
    put(simulation, [(29 + 0.3 * k, 5 + 0.3 * j) for k in range(8) for j in range(8)] + [(30, 30)])
    look = Look(simulation)
    difference = np.abs(look.frame({"density"}).astype(int) - look.painter.ground).sum(axis=2)
    (x, y), (u, v), (a, b) = look.of((30, 6)), look.of((30, 30)), look.of((15, 25))
    assert difference[y, x] > 1.5 * difference[v, u] > 0
    assert difference[b, a] == 0


def test_ways_are_shown_on_free_ground_along_the_field(look):
    lines = np.concatenate([segments for segments, _ in look.overlays._arrows(look.camera, *look.overlays._ways())])
    stems = lines.reshape(-1, 4)
    middle = look.camera.metres((stems[:, :2] + stems[:, 2:]) / 2)
    inside = (middle > (18.6, 18.6)).all(axis=1) & (middle < (20.4, 23.4)).all(axis=1)
    assert len(stems) > 30 and not inside.any()
    long = stems[np.hypot(*(stems[:, 2:] - stems[:, :2]).T) > 15]
    way = (long[:, 2:] - long[:, :2]) * (1, -1)
    assert (way @ (1, 1) > 0).mean() > 0.8  # the guide leads north-east


# what is kept ready ----------------------------------------------------------------


def test_a_layer_is_drawn_once_until_something_is_painted():
    look = Look(small_world())
    world = look.simulation.world
    look.frame({"regions"})
    kept = look.overlays._layers["regions"]
    look.frame({"regions"})
    assert look.overlays._layers["regions"] is kept
    Paint("brush", "other", 30.0, 8.0, 33.0, 8.0, 2.0).apply(world)
    x, y = look.of((31.5, 8))
    assert look.changed({"regions"})[y, x]
    assert look.overlays._layers["regions"] is not kept


def test_caps_say_how_fast(look, monkeypatch):
    said = []
    monkeypatch.setattr("flockbrush.render.canvas.Canvas.words", lambda self, text, *a, **k: said.append(text) or 0)
    other = Look(small_world())
    Paint("cap", 0.5, 10.0, 30.0, 20.0, 32.0, 3.0).apply(other.simulation.world)
    other.frame({"caps"})
    assert "max 0.5 m/s" in said
    Paint("cap", 0.0, 10.0, 30.0, 20.0, 32.0, 6.0).apply(other.simulation.world)
    said.clear()
    other.frame({"caps"})
    assert said == ["no speed limits in view"]


@pytest.mark.parametrize("name", ["caps", "density"])
def test_legends_leave_free_what_they_are_told(look, name):
    camera = replace(look.camera, centre=(-500.0, 0.0))  # beside the map: only legends are drawn
    for free in (0, 40):
        frame = np.zeros((*SIZE[::-1], 3), np.uint8)
        look.overlays.under(frame, camera, {name}, look.moment, free)
        assert 0 <= SIZE[1] - free - 12 - np.nonzero(frame.any(axis=(1, 2)))[0].max() < 20


@pytest.mark.parametrize("palette", ["own", "okabe-ito"])
def test_brush_regions_have_the_colour_of_their_brush_in_the_palette(palette, monkeypatch):
    theme = theme_of("light", palette)
    other = Look(small_world(), theme)
    Paint("brush", "other", 10.0, 10.0, 20.0, 12.0, 4.0).apply(other.simulation.world)
    filled = []
    monkeypatch.setattr(Overlays, "_filled", lambda self, *args: filled.extend(args[-2]) or (lambda canvas: None))
    other.frame({"regions"})
    colours = other.scenery.brush_colours
    wanted = dict(zip(colours, map(rgb, worn(tuple(colours.values()), theme)), strict=True))
    assert {name: colour for _, name, colour in filled} == wanted


def test_bodies_are_as_large_as_they_touch(look):
    axis = look.simulation.agents[Body.axis]
    assert axis == pytest.approx(np.maximum(0.5 * look.moment.length - look.moment.radius, 0))
    assert len(look.simulation.agents[Position.xyz]) == len(look.moment)


def test_ways_are_drawn_anew_when_a_goal_has_moved():
    look = Look(small_world())
    world = look.simulation.world
    world.resource(Commands).perform(world, [PlaceGoal(7, "well", 35.0, 5.0)])
    before = look.changed({"navigation"})
    assert np.array_equal(look.changed({"navigation"}), before)
    world.resource(Commands).perform(world, [PlaceGoal(7, "well", 5.0, 35.0)])
    after = look.changed({"navigation"})
    assert before.any() and after.any() and not np.array_equal(before, after)


def test_geese_in_a_v_are_told_what_they_save_and_a_herd_is_not(look):
    assert not look.changed({"saved"}).any()
    simulation = start("geese")
    simulation.run(640)
    saved = savings_of(simulation.world)
    leader = simulation.agents[FormationPlace.place] == 0
    assert saved[leader].max() < 0.6 * np.median(saved[~leader])  # who leads saves least
    scenery, moment = Scenery(simulation), moment_of(simulation)
    painter = Painter(scenery, SIZE, "light", words=False)
    middle = painter.home.pixels(moment.xyz[:, :2].mean(0))
    painter.look(painter.home.zoomed(6.0, tuple(middle)))
    frame = painter.ground.copy()
    Overlays(scenery, "light").over(frame, painter.camera, {"saved"}, moment, None)
    assert (frame != painter.ground).any(axis=2).sum() > 500


def test_an_overlay_of_a_user_is_one_class(look, monkeypatch):
    from flockbrush.render import overlay_registry
    from flockbrush.studio.panels.view import overlays

    monkeypatch.setattr(overlay_registry, "OVERLAYS", OVERLAYS)
    monkeypatch.setitem(OVERLAYS, "halo", OVERLAYS["links"])  # restored, and so forgotten, afterwards
    del OVERLAYS["halo"]

    @overlay_registry.overlay
    class Halo:
        name, title, tip = "halo", "Halo", "A ring around every animal"
        in_space = True

        def draw(self, view):
            for x, y in view.camera.pixels(view.moment.xyz):
                view.canvas.ring((x, y), 12, 2, (255, 0, 0))

    drawn = look.changed({"halo"})
    columns, rows = look.of(look.moment.xyz[:, :2]).T
    ring = drawn[np.clip(rows - 12, 0, SIZE[1] - 1), np.clip(columns, 0, SIZE[0] - 1)]
    assert ring.mean() > 0.9 and not look.changed(set()).any()
    assert overlays()["Herd"]["halo"] == ("Halo", "A ring around every animal")
    with pytest.raises(ValueError, match="'links' is registered already"):
        overlay_registry.overlay(type("Links", (), {"name": "links", "title": "", "tip": "", "draw": None}))
