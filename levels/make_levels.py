"""Draws the shipped levels: ``python -m flockbrush.levels.make_levels [NAME ...]``.

Some of them were afterwards opened, changed and saved in Tiled (``shipped/README.md`` says which); those are left
alone unless named.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.levels import living_levels
from flockbrush.levels.drawing import LEVELS, level, near_line, new, polygon_about, rolling
from flockbrush.levels.tile_pictures import png
from flockbrush.levels.tiled import write_project

HERE = Path(__file__).parent
SAVED_BY_TILED = ("gorge", "meadow")  # changed by hand since


# ---------------------------------------------------------------- the levels


@level
def meadow():
    """Sixty by forty tiles of grass, a pond, a wood, a herd that wanders and one that crosses."""
    s = new(60, 40, 2.0, seed=7)
    hills = rolling(s.x, s.y, 1, 60)
    s.ground("grass")
    s.ground("meadow", hills > 0.35)
    s.ground("dry grass", hills < -1.1)
    wood = rolling(s.x, s.y, 2, 45) - 0.02 * np.hypot(s.x - 100, s.y - 66)
    s.ground("forest floor", wood > 0.2)
    pond = ((s.x - 34) / 13) ** 2 + ((s.y - 54) / 9) ** 2 + 0.25 * rolling(s.x, s.y, 3, 18, 4)
    s.ground("sand", pond < 1.55)
    s.ground("shallows", pond < 1.15)
    s.ground("deep water", pond < 0.75)
    path = [(0, 22), (28, 24), (56, 16), (88, 22), (120, 18)]
    s.ground("dirt", near_line(s.x, s.y, path) < 2.4)
    for k, (x, y, r) in enumerate([(98, 62, 2.2), (105, 58, 1.8), (108, 67, 2.6), (94, 70, 1.7), (113, 60, 1.9)]):
        s.box("Obstacle", x, y, 2 * r, 2 * r, f"tree {k + 1}", round_=True, shape="cylinder")
    s.draw("Obstacle", polygon_about(70, 42, 5, 7, 4), "boulder", margin=0.5)
    s.draw("Obstacle", polygon_about(78, 37, 2.5, 6, 5), "stone", margin=0.3)
    s.draw("Guide", path, "path", closed=False, strength=1, radius=6, decay=6)
    s.brush("graze", (s.x > 60) & (s.y > 44) & (wood <= 0.2))
    s.box("Spawn", 82, 58, 22, 16, "grazing", species="sheep", brush="graze", count=60, body_length=1.2)
    s.box("Spawn", 15, 23, 20, 10, "walking", species="sheep", brush="march", count=80, heading="east", body_length=1.2)
    s.box("Spawn", 3.5, 23, 5, 12, "following", species="sheep", brush="march", rate=2, start=10.5, heading="east",
          body_length=1.2)  # fmt: skip
    s.box("Exit", 116, 19, 8, 18, "down the road")
    s.draw("Line", [(60, 8), (60, 30)], "half way", closed=False)
    s.box("Area", 82, 58, 30, 24, "pasture")
    return s


@level
def sheep_pasture():
    """A corridor full of things in the way; one sinusoidal arrow, two brushes (Gong et al. 2025, fig. 1)."""
    s = new(120, 36, 2.0, seed=1)
    wave = [(x, 36 + 9 * np.sin(2 * np.pi * (x - 10) / 110)) for x in np.linspace(10, 205, 53)]
    s.ground("grass")
    s.ground("meadow", rolling(s.x, s.y, 11, 50) > 0.5)
    s.ground("dry grass", rolling(s.x, s.y, 12, 60) > 0.9)
    s.ground("dirt", near_line(s.x, s.y, wave) < 1.6 + 0.8 * rolling(s.x, s.y, 13, 25))
    pond = ((s.x - 62) / 9) ** 2 + ((s.y - 17) / 6) ** 2
    s.ground("sand", pond < 1.5)
    s.ground("deep water", pond < 0.8)
    s.ground("forest floor", (s.y < 6) | (s.y > 66))
    for y, name in ((2, "south hedge"), (70, "north hedge")):
        top = [(x, y + (-1 if y > 36 else 1) * (2.2 + np.sin(x / 7 + y))) for x in range(240, -1, -8)]
        s.draw("Obstacle", [(0, 72 if y > 36 else 0), (240, 72 if y > 36 else 0), *top], name)
    s.box("Obstacle", 62, 17, 15, 9.6, "pond", round_=True, blocks_view=False)
    s.box("Obstacle", 92, 46, 14, 8, "barn", turned=20, margin=0.5)
    s.draw("Obstacle", polygon_about(40, 50, 4.5, 7, 21), "boulder", margin=0.4)
    s.draw("Obstacle", polygon_about(128, 28, 5, 8, 22), "outcrop", margin=0.4)
    s.draw("Obstacle", polygon_about(165, 24, 3.2, 6, 23), "stone")
    s.draw("Obstacle", [(150, 44), (166, 50), (165.7, 50.8), (149.7, 44.8)], "broken fence", blocks_view=False)
    trees = [
        (28, 18, 1.6),
        (78, 58, 2.0),
        (112, 12, 1.8),
        (116, 56, 1.5),
        (142, 60, 2.0),
        (180, 58, 1.7),
        (186, 14, 1.9),
    ]
    for k, (x, y, r) in enumerate(trees, 1):
        s.box("Obstacle", x, y, 2 * r, 2 * r, f"tree {k}", round_=True, shape="cylinder")
    s.draw("Guide", wave, "sinus", closed=False, strength=1, radius=16, decay=8)
    s.brush("sheep-narrow", s.x < 110)
    s.brush("front", (s.x >= 110) & (s.x < 206))
    s.brush("graze", s.x >= 206)
    s.box(
        "Spawn",
        24,
        38,
        32,
        30,
        "herd",
        species="sheep",
        brush="sheep-narrow",
        count=300,
        heading="east",
        body_length=1.2,
    )
    s.draw("Line", [(110, 6), (110, 66)], "brush border", closed=False)
    s.box("Area", 222, 36, 32, 56, "fold")
    return s


@level
def anthill():
    """Ants around a square: narrow lanes left and right, broad ones above and below (Gong et al. 2025, fig. 17)."""
    s = new(56, 72, 0.25, seed=2)
    x, y = s.x - 7, s.y - 9
    s.ground("sand")
    s.ground("gravel", rolling(s.x, s.y, 31, 4) > 0.9)
    s.ground("dirt", np.maximum(np.abs(x), np.abs(y)) < 5.3 + 0.3 * rolling(s.x, s.y, 32, 3))
    s.ground("mud", np.maximum(np.abs(x), np.abs(y)) < 4.5)
    s.box("Obstacle", 7, 9, 9, 9, "ant hill", margin=0.05)
    a = np.linspace(0, 2 * np.pi, 41)[:-1]
    c, d = np.cos(a), np.sin(a)
    ring = np.column_stack([7 + 5.8 * np.sign(c) * np.sqrt(np.abs(c)), 9 + 6.8 * np.sign(d) * np.sqrt(np.abs(d))])
    s.draw("Guide", ring, "round the hill", closed=False, strength=1, radius=2.5, decay=1.0, loop=True)
    s.brush("ants-swarm", s.y >= 9)
    s.brush("ants-mill", s.y < 9)
    s.box("Spawn", 7, 16, 10, 2.4, "upper ants", species="ant", brush="ants-swarm", count=180, body_length=0.2)
    s.box("Spawn", 7, 2, 10, 2.4, "lower ants", species="ant", brush="ants-mill", count=180, body_length=0.2)
    s.draw("Line", [(0, 9), (2.5, 9)], "west lane", closed=False)
    s.draw("Line", [(11.5, 9), (14, 9)], "east lane", closed=False)
    return s


@level
def river():
    """Ducks between two banks turn around each other with nothing to turn around (Gong et al. 2025, fig. 8)."""
    s = new(56, 72, 1.0, seed=3)
    ys = np.arange(0, 73, 3.0)

    def bank(side):
        return 28 + side * (17 + 1.2 * np.sin(ys / 6 + side)) + 4 * np.sin(ys / 17)

    west, east = (np.interp(s.y, ys, bank(k)) for k in (-1, 1))
    inside = np.minimum(s.x - west, east - s.x)
    s.ground("meadow")
    s.ground("forest floor", (inside < -7) & (rolling(s.x, s.y, 41, 14) > -0.3))
    s.ground("sand", inside > -1.2)
    s.ground("shallows", inside > 0.2)
    s.ground("water", inside > 3 + 0.8 * rolling(s.x, s.y, 42, 16))
    s.draw("Obstacle", [(0, 0), *zip(bank(-1), ys, strict=True), (0, 72)], "west bank", blocks_view=False)
    s.draw("Obstacle", [(56, 0), *zip(bank(1), ys, strict=True), (56, 72)], "east bank", blocks_view=False)
    s.draw("Obstacle", polygon_about(35, 63, 2.2, 9, 43), "islet", blocks_view=False)
    s.brush("mill-filled", inside > 0.2)
    s.box(
        "Spawn",
        28,
        34,
        8.4,
        8.4,
        "flock",
        round_=True,
        species="duck",
        brush="mill-filled",
        count=160,
        body_length=0.5,
        formation="mill",
    )
    s.box("Area", 28, 34, 26, 40, "river")
    return s


@level
def gorge():
    """A wide herd, a narrow gap, a goal on the other side: nobody stays behind."""
    s = new(90, 50, 2.0, seed=4)
    south = [(62, 0), (74, 16), (80, 30), (86, 42), (92, 45), (100, 45), (106, 40), (112, 26), (124, 12), (132, 0)]
    north = [(64, 100), (72, 84), (78, 70), (86, 58), (92, 55), (100, 55), (108, 60), (116, 74), (126, 88), (134, 100)]
    low = np.interp(s.x, *np.transpose(south), left=-9, right=-9)
    high = np.interp(s.x, *np.transpose(north), left=109, right=109)
    s.ground("dry grass")
    s.ground("grass", rolling(s.x, s.y, 51, 55) + (s.x - 110) / 60 > 0.2)
    s.ground("gravel", np.hypot(s.x - 96, (s.y - 50) * 1.2) < 30 + 5 * rolling(s.x, s.y, 52, 25))
    s.ground("rock", (s.y < low + 2.5) | (s.y > high - 2.5))
    s.ground("cliff", (s.y < low - 3) | (s.y > high + 3))
    s.draw("Obstacle", [*south], "south wall", margin=0.3)
    s.draw("Obstacle", [*north], "north wall", margin=0.3)
    for k, (x, y, r) in enumerate([(24, 14, 2.2), (40, 88, 2.6), (150, 20, 2.2), (140, 80, 1.8)], 1):
        s.draw("Obstacle", polygon_about(x, y, r, 7, 53 + k), f"boulder {k}", margin=0.3)
    s.draw("Goal", [(166, 50)], "far side", radius=12, on_arrive="despawn")
    s.box(
        "Spawn",
        30,
        50,
        36,
        60,
        "herd",
        species="sheep",
        brush="sheep-narrow",
        count=400,
        heading="east",
        body_length=1.2,
    )
    s.draw("Line", [(96, 45), (96, 55)], "gap", closed=False)
    return s


@level
def predators_valley():
    """Reindeer graze in a snowy valley until the wolves come (Gong et al. 2025, section 7.5)."""
    s = new(80, 50, 4.0, seed=5)
    middle = 100 + 18 * np.sin(s.x / 60)
    away = np.abs(s.y - middle)
    s.ground("dry grass")
    s.ground("grass", rolling(s.x, s.y, 61, 110) > 0.3)
    s.ground("gravel", away > 58 + 8 * rolling(s.x, s.y, 62, 60))
    s.ground("snow", away > 66 + 8 * rolling(s.x, s.y, 63, 60))
    s.ground("rock", away > 84 + 6 * rolling(s.x, s.y, 64, 40))
    stream = [(0, 62), (50, 78), (110, 74), (170, 52), (230, 58), (320, 92)]
    s.ground("sand", near_line(s.x, s.y, stream) < 7)
    s.ground("shallows", near_line(s.x, s.y, stream) < 4.5)
    wood = np.hypot((s.x - 250) / 1.6, s.y - 148) + 8 * rolling(s.x, s.y, 65, 50)
    s.ground("forest floor", wood < 24)
    s.ground("thicket", wood < 9)
    for k, (x, y, r) in enumerate([(70, 140, 5), (128, 128, 3.5), (190, 96, 4), (262, 82, 5), (150, 40, 4)], 1):
        s.draw("Obstacle", polygon_about(x, y, r, 7, 65 + k), f"rock {k}", margin=0.5)
    for k, (x, y) in enumerate([(226, 146), (236, 158), (246, 138), (262, 150), (272, 142), (280, 156)], 1):
        s.box("Obstacle", x, y, 3, 3, f"spruce {k}", round_=True, shape="cylinder")
    s.speed(max_speed=2.0, where=near_line(s.x, s.y, stream) < 4.5)
    s.box("Spawn", 95, 108, 70, 44, "herd", species="reindeer", brush="reindeer-flee", count=160, body_length=2.0)
    s.box(
        "Spawn",
        200,
        112,
        14,
        22,
        "pack",
        species="wolf",
        brush="wolf-hunt",
        count=7,
        heading="west",
        body_length=1.5,
        start=5,
    )
    s.picture("height", "predators-valley-height.png", metres_per_level=0.2)
    return s


def valley_heights():
    """The grey picture of the predators' valley: flat in the middle, 40 m up the sides, (100, 160) uint8."""
    x, y = np.meshgrid((np.arange(160) + 0.5) * 2, 200 - (np.arange(100) + 0.5) * 2)
    side = np.clip((np.abs(y - 100 - 18 * np.sin(x / 60)) - 40) / 60, 0, 1)
    return (
        np.round(200 * side * side * (3 - 2 * side) + 4 * (1 + rolling(x, y, 66, 90) / 3)).clip(0, 255).astype(np.uint8)
    )


@level
def crowded():
    """Ten thousand animals, one on every 4 square metres: the scene that is timed."""
    s = new(100, 100, 2.0, seed=6)
    s.ground("dry grass")
    s.ground("dirt", rolling(s.x, s.y, 71, 70) > 0.4)
    s.ground("grass", rolling(s.x, s.y, 72, 80) > 0.8)
    s.box("Spawn", 100, 100, 200, 200, "crowd", species="sheep", brush="crowd", count=10_000)
    return s


@level
def pillars():
    """Starlings through a field of pillars, split by a great one, joined again, led through a gate (Reynolds 1987)."""
    s = new(170, 50, 2.0, boundary="open", seed=1)
    s.ground("grass")
    s.ground("meadow", rolling(s.x, s.y, 81, 60) > 0.5)
    s.ground("gravel", near_line(s.x, s.y, [(40, 50), (330, 50)]) < 5 + 1.5 * rolling(s.x, s.y, 82, 30))
    field = [
        (62, 44, 1.5), (66, 58, 1.8), (73, 36, 2.0), (76, 50, 1.4), (80, 64, 1.7), (87, 43, 1.8), (90, 56, 1.5),
        (96, 32, 2.2), (98, 49, 1.6), (103, 61, 1.9), (110, 41, 1.5), (113, 53, 1.8),
    ]  # fmt: skip
    for k, (x, y, r) in enumerate(field, 1):
        s.box("Obstacle", x, y, 2 * r, 2 * r, f"pillar {k}", round_=True, shape="cylinder", z_max=60)
    s.box("Obstacle", 160, 50, 14, 14, "tower", round_=True, shape="cylinder", z_max=80)
    s.box("Obstacle", 232, 18, 5, 36, "south wall", z_max=60)
    s.box("Obstacle", 232, 82, 5, 36, "north wall", z_max=60)
    s.box("Obstacle", 232, 50, 5, 28, "lintel", z_min=34, z_max=60, blocks_view=False)
    s.box("Spawn", 24, 50, 16, 16, "flock", species="starling", brush="starlings", count=200, heading="east",
          altitude=14, depth=10)  # fmt: skip
    s.migrate(0, 75, 50, 19, "lure", shown_at=(70, 50), species="starling")
    s.migrate(0.1, 400, 50, 19, "lure goes east", shown_at=(330, 50), seconds=34, species="starling")
    for k in range(16):  # back and forth for ten minutes
        x = 40 if k % 2 == 0 else 310
        s.migrate(26.0 + 38 * k, x, 50, 19, f"lure {k + 3}", seconds=30, species="starling")
    s.draw("Line", [(232, 36), (232, 64)], "gate", closed=False)
    return s


@level
def elephants():
    """Sparrows about a grazing herd of elephants, which are obstacles to them, until a falcon comes."""
    s = new(80, 60, 2.0, seed=9)
    s.ground("dry grass")
    s.ground("grass", rolling(s.x, s.y, 91, 50) > 0.4)
    s.ground("dirt", rolling(s.x, s.y, 92, 40) > 1.0)
    s.box("Obstacle", 52, 84, 5, 5, "baobab", round_=True, shape="cylinder", z_max=14)
    s.box("Obstacle", 112, 40, 4, 4, "acacia", round_=True, shape="sphere", z_max=8)
    s.box("Obstacle", 112, 40, 0.8, 0.8, "trunk of the acacia", round_=True, shape="cylinder", z_max=3)
    s.box("Obstacle", 118, 82, 16, 12, "kopje", shape="hull", z_max=9,
          corners="-8 -6 0; 8 -5 0; 7 6 0; -7 6 0; -5 -3 6; -1 1 9; 3 -2 8; 5 3 5; -4 4 5")  # fmt: skip
    s.box("Spawn", 80, 60, 60, 44, "herd", species="elephant", brush="graze", count=14, body_length=5)
    s.box("Spawn", 40, 60, 14, 14, "flock", species="sparrow", brush="sparrows", count=120, heading="east",
          altitude=2, depth=4)  # fmt: skip
    s.box("Spawn", 150, 100, 4, 4, "hunter", species="falcon", brush="falcon", count=1, heading="south-west",
          altitude=20, start=9)  # fmt: skip
    places = [(80, 60), (110, 70), (96, 40), (60, 48), (52, 72), (84, 84), (104, 60)]
    for k, (x, y) in enumerate(places):
        s.migrate(4 * k, x, y, 4, f"feed {k + 1}", seconds=3 if k else 0, species="sparrow")
    for k in range(len(places), 56):  # they go on for ten minutes, slower
        x, y = places[k % len(places)]
        s.migrate(28 + 12 * (k - len(places)), x, y, 4, f"feed {k + 1}", seconds=5, species="sparrow")
    for at, x, y, z in ((9.1, 84, 45, 4), (15.5, 40, 40, 25), (20, 76, 75, 5), (25.5, 130, 100, 25)):
        s.migrate(at, x, y, z, f"stoop {at:g}", species="falcon")
    for k in range(9):  # and so does the falcon, which rests from them for a minute
        x, y = places[(3 * k) % len(places)]
        s.migrate(85 + 60 * k, x, y, 5, f"stoop {85 + 60 * k}", species="falcon")
        s.migrate(92 + 60 * k, 130, 90, 25, f"away {92 + 60 * k}", species="falcon")
    return s


@level
def skein():
    """Geese that start anyhow, form a V by three rules and keep it through bends (Nathan & Barbosa 2008)."""
    s = new(190, 125, 4.0, boundary="open", seed=12)
    s.ground("meadow")
    s.ground("grass", rolling(s.x, s.y, 121, 160) > 0.1)
    s.ground("dry grass", rolling(s.x, s.y, 122, 130) > 1.0)
    lake = ((s.x - 250) / 110) ** 2 + ((s.y - 60) / 46) ** 2 + 0.25 * rolling(s.x, s.y, 123, 70, 4)
    s.ground("sand", lake < 1.15)
    s.ground("water", lake < 1.0)
    s.ground("forest floor", rolling(s.x, s.y, 124, 90) - 0.01 * np.hypot(s.x - 560, s.y - 50) > 0.25)
    s.box("Spawn", 45, 130, 28, 28, "flock", species="goose", brush="skein", count=17, heading="east", altitude=60)
    way = [(20, 130), (260, 130), (420, 136), (540, 170), (620, 230), (670, 310), (670, 380), (620, 430), (530, 450),
           (260, 450), (180, 435), (110, 385), (65, 300), (40, 215)]  # fmt: skip
    s.draw("Guide", way, "round", closed=False, radius=60, loop=True)
    s.draw("Line", [(420, 60), (420, 220)], "before the bend", closed=False)
    return s


@level
def geese():
    """Geese rest, take off, find into a V, round a hill, land by another lake, and go back (Klotsman & Tal 2012)."""
    s = new(155, 74, 10.0, boundary="open", seed=16)
    s.ground("meadow")
    s.ground("grass", rolling(s.x, s.y, 161, 260) > 0.2)
    s.ground("dry grass", rolling(s.x, s.y, 162, 220) > 1.1)
    shores = [((s.x - 150) / 120) ** 2 + ((s.y - 370) / 80) ** 2, ((s.x - 1400) / 110) ** 2 + ((s.y - 250) / 75) ** 2]
    for k, lake in enumerate(shores):
        lake = lake + 0.25 * rolling(s.x, s.y, 163 + k, 130, 4)
        s.ground("sand", lake < 1.2)
        s.ground("water", lake < 1.0)
    s.ground("forest floor", rolling(s.x, s.y, 168, 150) - 0.006 * np.hypot(s.x - 800, s.y - 120) > 0.15)
    s.brush("graze", np.hypot(s.x - 130, s.y - 190) < 75)
    s.box("Spawn", 130, 190, 44, 44, "flock", species="goose", brush="geese", count=21, heading="east")
    for begin in (0, 300):
        _there(s, begin)
        _back(s, begin + 150)
    s.draw("Line", [(560, 60), (560, 290)], "in formation", closed=False)
    s.draw("Line", [(900, 150), (900, 420)], "after the turn", closed=False)
    return s


def _there(s, begin):
    """Geese fly from the western lake to the eastern one, from a time in s on."""
    s.draw("Key", [(130, 190)], "rest until", at=begin + 4, command="PaintBrush", x=130, y=190, radius=150, brush="")
    s.migrate(begin, 640, 170, 45, "up and away", shown_at=(600, 170), species="goose")
    s.migrate(begin + 32, 1900, 620, 60, "round the hill", shown_at=(900, 330), seconds=12, species="goose")
    s.migrate(begin + 58, 1440, 420, -4, "down to the lake", shown_at=(1000, 360), species="goose")
    s.draw("Key", [(1380, 400)], "land", at=begin + 83, command="PaintBrush", x=1380, y=410, radius=130, brush="graze")


def _back(s, begin):
    """Geese fly from the eastern lake to the western one, from a time in s on."""
    s.draw("Key", [(1380, 380)], "again", at=begin + 4, command="PaintBrush", x=1380, y=410, radius=150, brush="")
    s.migrate(begin, 900, 360, 45, "home", shown_at=(900, 300), species="goose")
    s.migrate(begin + 32, -350, 40, 60, "the other way", shown_at=(600, 330), seconds=12, species="goose")
    s.migrate(begin + 58, 80, 180, -4, "down by the first lake", shown_at=(500, 300), species="goose")
    s.draw("Key", [(130, 230)], "land again", at=begin + 83, command="PaintBrush", x=130, y=190, radius=130,
           brush="graze")  # fmt: skip


def main(names):
    """Draw the project, the tilesets and the levels named, or all that Tiled has not changed since."""
    write_project(HERE, shipped())
    (HERE / "shipped" / "predators-valley-height.png").write_bytes(png(valley_heights()))
    (HERE / "shipped" / "ridge-height.png").write_bytes(png(living_levels.ridge_picture()))
    for name in names or (n for n in LEVELS if n not in SAVED_BY_TILED):
        LEVELS[name]().save(HERE / "shipped" / f"{name}.tmj")
        print(f"drew {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
