"""Pictures of levels: every thing a designer draws is seen, where it is; words fit and lie on nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.components.level_things import Exit, Obstacle
from flockbrush.engine.raster import Raster
from flockbrush.levels.schema import BrushLayer, PaintBounds
from flockbrush.systems.palette import Palette

from docs.contact_sheet import contact_sheet
from flockbrush.render.canvas import Canvas, dashes, smooth
from flockbrush.render.drawn_ground import brush_key
from flockbrush.render.drawn_herd import DrawnHerd
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.hud import GLYPHS, Layout, clock, say, things_of
from flockbrush.render.painter import Painter
from flockbrush.render.scenery import Scenery
from flockbrush.render.shapes import cover_polygon, cover_segments
from flockbrush.render.style import DARK, LIGHT, PALETTE, rgb, theme_of
from flockbrush.render.text import shortened, width_of, words


def test_layers_that_say_whom_they_bind_are_drawn_above_what_is_painted():
    bounded, bare = (BrushLayer("high", 0.7, ["graze"], np.full((2, 2), k), PaintBounds(z_min=5.0)) for k in (0, -1))
    palette = SimpleNamespace(names=["march"], brushes=[])
    land = SimpleNamespace(painted=SimpleNamespace(brush=np.zeros((2, 2), int)))
    scenery = Scenery.__new__(Scenery)
    world = SimpleNamespace(resource=lambda kind: palette if kind is Palette else land)
    plain = BrushLayer("brush", 0.4, ["march"], np.zeros((2, 2), int))
    scenery.simulation = SimpleNamespace(world=world)
    scenery.level = SimpleNamespace(brush_layers=[plain, bounded, bare])
    assert [layer.assets for layer in scenery.brush_layers] == [["march"], ["graze"], ["graze"]]


def box(left, low, right, high):
    """A rectangle in metres."""
    return np.array([[left, low], [right, low], [right, high], [left, high]], float)


def level(**things):
    """A level of 40 x 30 m with these things in it."""
    return SimpleNamespace(**{"name": "field", "width": 40.0, "height": 30.0, "cell": 1.0} | things)


def cells(left, low, right, high, value=1, rest=0, dtype=float):
    """Cells [iy, ix] of the level, with one rectangle of them painted."""
    raster = np.full((30, 40), rest, dtype)
    raster[low:high, left:right] = value
    return raster


def kinds(index, colours=("#9cb86a", "#3060c0")):
    """Terrain of two kinds."""
    flat = np.ones(index.shape)
    return SimpleNamespace(
        index=index, names=["grass", "water"], colours=list(colours), walkable=index != 1, speed_factor=flat, cost=flat,
        blocks_view=index > 5,
    )  # fmt: skip


THINGS = {
    "obstacle": {"obstacles": [SimpleNamespace(polygon=box(10, 5, 18, 12), solid=True, blocks_view=True)]},
    "spawn": {"spawns": [SimpleNamespace(polygon=box(10, 5, 18, 12))]},
    "exit": {"exits": [SimpleNamespace(polygon=box(10, 5, 18, 12), name="")]},
    "area": {"areas": [SimpleNamespace(polygon=box(10, 5, 18, 12), name="")]},
    "goal": {"goals": [SimpleNamespace(xy=np.array([14.0, 8.5]), radius=3.5, polygon=None, name="")]},
    "line": {"lines": [SimpleNamespace(points=np.array([[10.0, 5.0], [18.0, 12.0]]), name="")]},
    "guide": {"guides": [SimpleNamespace(points=np.array([[10, 5], [14, 12], [18, 8.0]]), radius=1.0, loop=False)]},
    "brush": {
        "brush_layers": [SimpleNamespace(assets=["march"], weight=1.0, index=cells(10, 5, 18, 12, 0, -1, int), name="")]
    },
    "cap": {"cap": Raster(1.0, cells(10, 5, 18, 12, 0.5, np.inf))},
    "factor": {"factor": Raster(1.0, cells(10, 5, 18, 12, 0.5, 1.0))},
    "zone": {"zones": [SimpleNamespace(polygon=box(10, 5, 18, 12), brush="march", max_speed=1.0, factor=1.0)]},
}


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("thing", THINGS)
def test_everything_on_a_level_is_seen_where_it_is(thing, theme):
    p = Painter(level(**THINGS[thing]), (320, 240), theme, words=False)
    bare = Painter(level(), (320, 240), theme, words=False)
    rows, cols = np.nonzero(np.abs(p.ground.astype(int) - bare.ground).max(axis=2) > 12)
    low, high = p.camera.pixels((10, 12)), p.camera.pixels((18, 5))
    assert cols.min() >= low[0] - 14 and cols.max() <= high[0] + 14
    assert rows.min() >= low[1] - 14 and rows.max() <= high[1] + 14
    assert len(rows) > 60


def test_terrain_has_its_colours_and_leaves_no_gaps():
    p = Painter(level(terrain=kinds(cells(20, 0, 40, 30, 1, 0, int))), (320, 240), words=False)
    grass, water = p.ground[100, 60].astype(int), p.ground[100, 260].astype(int)
    assert water[2] > water[0] + 15  # blue
    assert grass[1] > grass[2]
    row = p.ground[100, 100:220].astype(int)
    between = np.minimum(np.abs(row - grass).sum(axis=1), np.abs(row - water).sum(axis=1))
    assert (between > 60).sum() < 12  # one border, and no strip of anything else


def test_north_is_up():
    p = Painter(level(terrain=kinds(cells(0, 20, 40, 30, 1, 0, int))), (320, 240), words=False)
    assert p.ground[30, 160, 2] > p.ground[200, 160, 2] + 10


def test_a_single_painted_cell_is_seen():
    p = Painter(level(terrain=kinds(cells(20, 15, 21, 16, 1, 0, int))), (640, 480), words=False)
    x, y = p.camera.pixels((20.5, 15.5)).astype(int)
    assert int(p.ground[y, x, 2]) - int(p.ground[y, x, 0]) > 15


def test_terrain_without_kinds_is_drawn_by_what_it_does():
    flat = np.ones((30, 40))
    water = cells(20, 0, 40, 30) > 0
    ground = SimpleNamespace(walkable=~water, speed_factor=flat, cost=flat, blocks_view=np.zeros((30, 40), bool))
    p = Painter(level(terrain=ground), (320, 240), words=False)
    assert p.ground[100, 260, 2] > p.ground[100, 60, 2]


def test_slopes_to_the_north_west_are_light():
    heights = np.add.outer(np.zeros(30), -np.abs(np.arange(40) - 20.0))  # a ridge from south to north
    p = Painter(level(height_map=Raster(1.0, heights)), (320, 240), words=False)
    assert p.ground[60:180, 40:130].mean() > p.ground[60:180, 190:280].mean() + 4


def test_painted_brushes_have_the_colour_they_are_told():
    painted = level(**THINGS["brush"])
    red = Painter(painted, (320, 240), brushes={"march": "#ff0000"}, words=False).ground
    blue = Painter(painted, (320, 240), brushes={"path/march.brush.toml": "#0000ff"}, words=False).ground
    y, x = 170, 112
    assert red[y, x, 0] > blue[y, x, 0] and blue[y, x, 2] > red[y, x, 2]


def test_a_herd_teaches_the_colours_of_its_brushes():
    p = Painter(level(**THINGS["brush"]), (320, 240), brushes={"march": "#ff0000"}, words=False)
    before = p.ground.copy()
    animals = DrawnHerd(
        np.array([[30.0, 25.0]]), np.array([[1.0, 0.0]]), brush_colours=("#0000ff",), brush_names=("march",)
    )
    p.frame(animals)
    ground = p.ground
    assert not np.array_equal(ground, before)
    p.frame(animals)
    assert p.ground is ground  # once is enough


def test_the_ground_is_drawn_once():
    p = Painter(level(**THINGS["guide"]), (320, 240))
    assert p.ground is p.ground
    p.frame()
    p.look(p.camera)
    assert p.ground is p.ground


def test_things_outside_the_view_cost_nothing_and_break_nothing():
    p = Painter(level(**{k: v for thing in THINGS.values() for k, v in thing.items()}), (320, 240))
    p.look(p.camera.at(1e5, -1e5))
    assert np.array_equal(np.unique(p.ground[100:120, 100:200].reshape(-1, 3), axis=0), [p.theme.paper])
    p.look(p.home.at(14, 8).zoomed(400))
    assert p.ground.shape == (240, 320, 3)


def test_a_level_fits_with_its_proportions():
    for size in ((320, 240), (1280, 300), (400, 900)):
        p = Painter(level(), size)
        corners = p.camera.pixels([(0, 0), (40, 30)])
        left, top, right, bottom = p.layout.view
        assert (corners[:, 0] >= left).all() and (corners[:, 0] <= right).all()
        assert (corners[:, 1] >= top).all() and (corners[:, 1] <= bottom).all()
        wide, tall = np.abs(corners[1] - corners[0])
        assert wide / tall == pytest.approx(40 / 30)


def test_the_legend_stays_off_the_scale_bar():
    names = tuple(f"a brush with a long name {k}" for k in range(12))
    many = DrawnHerd(
        np.full((12, 2), 15.0), np.tile([1.0, 0.0], (12, 1)), brush=np.arange(12), brush_names=names,
        brush_colours=tuple(PALETTE[k % 8] for k in range(12)),
    )  # fmt: skip
    for size in ((400, 300), (800, 600), (1280, 720)):
        p = Painter(level(), size)
        p.frame()
        frame = p.frame(many)
        left = int(p._bar)
        below = slice(size[1] - p.layout.below, size[1])
        assert np.array_equal(frame[below, left:], p.ground[below, left:])
        assert not np.array_equal(frame[below, :left], p.ground[below, :left])


def test_title_measures_and_clock_stay_apart():
    p = Painter(level(), (500, 300))
    title = "a level with a very long name that goes on and on " * 3
    frame = p.frame(title=title, measures={"polarization": 0.5, "milling": 0.25}, time=12.0)
    band = (np.abs(frame[: p.layout.above].astype(int) - p.theme.paper).max(axis=2) > 40).any(axis=0)
    clock_starts = 500 - p.layout.pad - width_of("0:00.0", p.layout.font)
    assert not band[clock_starts - p.layout.font : clock_starts - 1].any()


def test_what_is_in_the_legend_is_on_the_level():
    assert things_of(level()) == []
    assert things_of(level(**THINGS["cap"])) == ["speed limit"]
    assert things_of(level(**THINGS["goal"], **THINGS["guide"])) == ["guide", "goal"]
    assert set(things_of(level(**{k: v for thing in THINGS.values() for k, v in thing.items()}))) == set(GLYPHS)


def test_small_pictures_have_no_words_and_more_ground():
    assert Layout.of((160, 90)).font == 0
    assert Layout.of((160, 90)).view == (0, 0, 160, 90)


@pytest.mark.parametrize(("value", "round_"), [(7, 5), (1, 1), (0.3, 0.2), (99, 50), (2000, 2000), (0, 1)])
def test_round_numbers(value, round_):
    assert nice(value) == pytest.approx(round_)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0, "0:00.0"), (65.25, "1:05.2"), (3600, "1:00:00.0"), (59.99, "0:59.9")]
)
def test_clock(seconds, text):
    assert clock(seconds) == text


def test_measures_are_said_by_name():
    assert say({"speed_mean": 1.234}) == "speed mean  1.23"
    assert say("as it is") == "as it is" and say(None) == ""


def test_words_are_shortened_to_their_room():
    assert shortened("sheep", 14, 500) == "sheep"
    short = shortened("a very long name indeed", 14, 80)
    assert short.endswith("...") and width_of(short, 14) <= 80
    assert shortened("sheep", 14, 2) == ""


def test_words_no_font_has_do_no_harm():
    assert words("", 14).shape[1] == 0
    assert words("a\nb\x00\U0001f411", 14).shape[1] == words("ab", 14).shape[1]


def test_a_polygon_covers_its_area():
    rng = np.random.default_rng(0)
    for _ in range(20):
        turn = np.sort(rng.uniform(0, 2 * np.pi, 7))
        points = 30 + rng.uniform(8, 25, 7)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        x, y = points.T
        area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
        assert cover_polygon(points, 0, 0, 60, 60).sum() == pytest.approx(area, rel=0.02)


def test_a_line_covers_its_length_times_its_width():
    mask = cover_segments(np.array([[10.3, 12.1, 40.7, 31.9]]), 1.5, 0, 0, 60, 60)
    long = np.hypot(30.4, 19.8)
    assert mask.sum() == pytest.approx(long * 3 + np.pi * 1.5**2, rel=0.03)
    assert mask.max() <= 1


def test_dashes_leave_gaps():
    parts = dashes(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), 3, 2)
    assert np.hypot(parts[:, 2] - parts[:, 0], parts[:, 3] - parts[:, 1]).sum() == pytest.approx(12)
    assert len(dashes(np.array([[1.0, 1.0], [1.0, 1.0]]), 3, 2)) == 0


def test_a_smooth_curve_goes_through_its_points():
    points = np.array([[0.0, 0.0], [10.0, 5.0], [20.0, 0.0], [30.0, 9.0]])
    for closed in (False, True):
        curve = smooth(points, closed)
        near = np.hypot(*(curve[:, None] - points[None]).T).min(axis=1)
        assert near.max() < 1e-9


def test_nothing_is_drawn_outside_the_clip():
    image = np.zeros((40, 60, 3), np.uint8)
    canvas = Canvas(image, (20, 10, 40, 30))
    canvas.area(np.array([[-99.0, -99], [999, -99], [999, 999], [-99, 999]]), (255, 255, 255))
    canvas.words("words far too wide for it", (0, 15), 12, (255, 0, 0), halo=(0, 0, 255))
    inside = image[10:30, 20:40]
    assert inside.any() and image.sum() == inside.sum()


def test_colours_are_read_or_refused():
    assert rgb("#0a141E") == (10, 20, 30)
    for wrong in ("#12", "#gggggg", "blue"):
        with pytest.raises(ValueError, match="#rrggbb"):
            rgb(wrong)
    with pytest.raises(ValueError, match="light, dark"):
        theme_of("sepia")
    assert brush_key("brushes/mill-hollow.brush.toml") == "mill-hollow"


def test_a_contact_sheet_shows_every_picture():
    pictures = [(f"picture {k}", np.full((30 + 10 * k, 50, 3), 40 * k, np.uint8)) for k in range(5)]
    sheet = contact_sheet(pictures, columns=3, title="five")
    for k in range(5):
        assert (sheet == 40 * k).all(axis=2).sum() >= (30 + 10 * k) * 50
    with pytest.raises(ValueError, match="at least one"):
        contact_sheet([])


@pytest.mark.parametrize("what", ["exits", "obstacles"])
def test_what_reaches_over_the_border_of_a_periodic_map_is_drawn_on_the_other_side(what):
    def drawn(boundary, polygon):
        herd = DrawnHerd(np.full((1, 2), 5.0), np.zeros((1, 2)))
        thing = Exit(1, "", polygon) if what == "exits" else Obstacle(1, "", polygon, True, True)
        return Painter(level(**{what: [thing]}, boundary=boundary), (320, 240), LIGHT).frame(herd)

    over, beyond = box(-4, 10, 1, 20), box(36, 10, 41, 20)
    assert np.array_equal(drawn("wrap", over), drawn("wrap", beyond))
    assert not np.array_equal(drawn("open", over), drawn("open", beyond))
    assert not np.array_equal(drawn("wrap", over), drawn("open", over))


def test_the_same_level_gives_the_same_ground():
    everything = level(**{k: v for thing in THINGS.values() for k, v in thing.items()})
    still = DrawnHerd(np.full((1, 2), 5.0), np.zeros((1, 2)))
    one, other = (Painter(everything, (320, 240), LIGHT).frame(still) for _ in range(2))
    assert np.array_equal(one, other)
