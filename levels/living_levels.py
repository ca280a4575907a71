"""Draws the shipped scenes that teach directing: species, programs and events in one level (docs/directing.md)."""

from __future__ import annotations

import numpy as np
from flockbrush.levels.drawing import level, near_line, new, polygon_about, rolling


@level
def savanna():
    """Zebras graze and go to the water by thirst; lions come out of a thicket."""
    s = new(100, 64, 2.5, seed=21)
    s.ground("dry grass")
    s.ground("grass", rolling(s.x, s.y, 211, 90) > 0.2)
    s.ground("dirt", rolling(s.x, s.y, 212, 70) > 1.2)
    pool = ((s.x - 205) / 24) ** 2 + ((s.y - 84) / 17) ** 2 + 0.2 * rolling(s.x, s.y, 213, 40, 4)
    s.ground("mud", pool < 1.6)
    s.ground("shallows", pool < 1.0)
    s.ground("deep water", pool < 0.4)
    cover = np.hypot((s.x - 135) / 1.9, s.y - 126) + 3 * rolling(s.x, s.y, 214, 30)
    s.ground("thicket", cover < 13)
    for k, (x, y, r) in enumerate([(40, 36, 1.6), (132, 30, 1.9), (190, 128, 2.2), (30, 118, 1.7), (222, 36, 1.8)], 1):
        s.box("Obstacle", x, y, 2 * r, 2 * r, f"acacia {k}", round_=True, shape="cylinder", z_max=7)
    s.draw("Obstacle", polygon_about(150, 38, 6, 8, 215), "kopje", margin=0.5, z_max=5)
    bank = np.linspace(0, 2 * np.pi, 17)[:-1]
    s.draw("Goal", np.column_stack([205 + 32 * np.cos(bank), 84 + 24 * np.sin(bank)]), "water", on_arrive="stay")
    s.box(
        "Spawn", 118, 70, 44, 36, "herd", species="zebra", brush="zebra-graze", count=90, program="zebra", family_size=6
    )
    s.box("Spawn", 132, 117, 24, 4, "pride", species="lion", brush="rest", count=3, heading="south", program="lion")
    s.draw("Line", [(172, 60), (172, 110)], "on the way to the water", closed=False)
    return s


@level
def lake():
    """Two skeins of geese meet over a lake, land, rest and leave; a falcon scatters starlings."""
    s = new(150, 100, 8.0, boundary="open", seed=22)
    s.ground("meadow")
    s.ground("grass", rolling(s.x, s.y, 221, 240) > 0.2)
    s.ground("dry grass", rolling(s.x, s.y, 222, 200) > 1.1)
    water = ((s.x - 640) / 190) ** 2 + ((s.y - 400) / 120) ** 2 + 0.2 * rolling(s.x, s.y, 223, 160, 4)
    s.ground("sand", water < 1.15)
    s.ground("shallows", water < 1.0)
    s.ground("water", water < 0.85)
    s.ground("forest floor", rolling(s.x, s.y, 224, 150) - 0.004 * np.hypot(s.x - 250, s.y - 120) > 0.2)
    s.box("Area", 640, 400, 300, 180, "lake")
    s.box("Spawn", 90, 430, 40, 40, "western skein", species="goose", brush="geese", count=11, heading="east",
          altitude=45, program="lake-goose")  # fmt: skip
    s.box("Spawn", 110, 300, 30, 30, "southern skein", species="goose", brush="geese", count=9, heading="east",
          altitude=45, program="lake-goose")  # fmt: skip
    s.migrate(0, 660, 400, 40, "to the lake", shown_at=(90, 430), species="goose")
    s.draw("Key", [(640, 400)], "leave", at=80, command="Event", name="leave")
    s.migrate(79, 2200, 1100, 60, "north-east", shown_at=(660, 400), species="goose")
    s.box("Spawn", 720, 560, 16, 16, "starlings", species="starling", brush="starlings", count=150, heading="west",
          altitude=18, depth=8)  # fmt: skip
    places = [(560, 520), (480, 400), (560, 300), (720, 300), (800, 420), (720, 540)]
    for k in range(20):
        x, y = places[k % len(places)]
        s.migrate(6 * k, x, y, 22, f"over the lake {k + 1}", seconds=5 if k else 0, species="starling")
    s.box("Spawn", 900, 640, 4, 4, "falcon", species="falcon", brush="falcon", count=1, heading="south-west",
          altitude=60, start=30, program="falcon")  # fmt: skip
    for at, x, y, z in ((30.1, 640, 420, 30), (50, 500, -900, 80)):
        s.migrate(at, x, y, z, f"falcon {at:g}", species="falcon")
    return s


@level
def merino():
    """A hundred merino sheep on a pasture spread slowly and pack suddenly (Ginelli et al. 2015)."""
    s = new(40, 40, 2.0, seed=23)
    s.ground("grass")
    s.ground("dry grass", rolling(s.x, s.y, 231, 40) > 0.5)
    s.ground("meadow", rolling(s.x, s.y, 232, 30) > 0.9)
    s.box("Spawn", 40, 40, 30, 30, "flock", species="sheep", brush="merino-rest", count=100, program="merino")
    s.box("Area", 40, 40, 80, 80, "pasture")
    return s


@level
def ridge():
    """Reindeer take the pass over a ridge, starlings fly over it; a dog gathers sheep for a shepherd who is steered."""
    s = new(120, 80, 2.5, seed=24)
    high = ridge_heights(s.x, s.y)
    s.ground("grass")
    s.ground("meadow", rolling(s.x, s.y, 241, 80) > 0.4)
    s.ground("gravel", high > 9 + 2 * rolling(s.x, s.y, 242, 30))
    s.ground("rock", high > 16 + 3 * rolling(s.x, s.y, 243, 40))
    s.ground("dirt", near_line(s.x, s.y, [(20, 110), (90, 134), (140, 140), (190, 132), (262, 150)]) < 3)
    s.picture("height", "ridge-height.png", metres_per_level=0.2)
    s.draw("Goal", [(264, 150)], "summer pasture", radius=16, on_arrive="disperse")
    s.brush("graze", np.hypot(s.x - 264, s.y - 150) < 30)
    s.box("Spawn", 40, 70, 40, 50, "herd", species="reindeer", brush="to-goal", count=100, heading="east")
    s.box("Spawn", 30, 30, 14, 14, "flock", species="starling", brush="starlings", count=80, heading="east",
          altitude=12, depth=5)  # fmt: skip
    for at, x in ((0, 270), (32, 40), (66, 270), (100, 40), (134, 270)):
        s.migrate(at, x, 60, 16, f"over the ridge {at}", shown_at=(40, 30 + at / 8), species="starling")
    s.box("Spawn", 226, 66, 44, 36, "sheep", species="sheep", brush="pasture", count=36, program="pasture-sheep")
    s.box("Spawn", 236, 20, 3, 3, "shepherd", species="human", brush="stroll", count=1, heading="north")
    s.box("Spawn", 242, 22, 3, 3, "dog", species="dog", brush="rest", count=1, heading="north", program="sheepdog")
    s.draw("Key", [(236, 22)], "the shepherd stands", at=0, command="Appoint", species="human")
    s.draw("Key", [(236, 24)], "until you steer", at=0, command="Steer", kind="direction", x=0, y=0, species="human")
    s.draw("Key", [(242, 22)], "fetch", at=5, command="Event", name="fetch")
    s.draw("Line", [(150, 120), (150, 160)], "pass", closed=False)
    s.draw("Line", [(150, 0), (150, 120)], "ridge", closed=False)
    return s


def ridge_heights(x, y):
    """m: a ridge from south to north, 40 m high, with a pass of 6 m where y is 140."""
    crest = np.exp(-(((x - 150 - 8 * np.sin(y / 40)) / 22) ** 2))
    low = np.exp(-(((y - 140) / 16) ** 2))
    return crest * (40 - 34 * low) * (1 + 0.08 * rolling(x, y, 244, 50))


def ridge_picture():
    """The grey picture of the ridge, 5 levels a metre, (160, 240) uint8."""
    x, y = np.meshgrid((np.arange(240) + 0.5) * 1.25, 200 - (np.arange(160) + 0.5) * 1.25)
    return np.round(5 * ridge_heights(x, y)).clip(0, 255).astype(np.uint8)


@level
def city():
    """People leave a square by three gates when the alarm is raised; others come, until the next alarm."""
    s = new(60, 48, 1.0, seed=25)
    s.ground("road")
    s.ground("gravel", (abs(s.x - 30) < 16) & (abs(s.y - 24) < 12))
    s.ground("dirt", np.hypot(s.x - 30, s.y - 24) < 5)
    houses = {
        "west house": [(10, 8), (14, 8), (14, 40), (10, 40)],
        "east house": [(46, 8), (50, 8), (50, 40), (46, 40)],
        "south-west house": [(14, 8), (28.4, 8), (28.4, 12), (14, 12)],
        "south-east house": [(31.6, 8), (46, 8), (46, 12), (31.6, 12)],
        "north-west house": [(14, 36), (21, 36), (21, 40), (14, 40)],
        "north house": [(23.4, 36), (36.6, 36), (36.6, 40), (23.4, 40)],
        "north-east house": [(39, 36), (46, 36), (46, 40), (39, 40)],
    }
    for name, corners in houses.items():
        s.draw("Obstacle", corners, name, z_max=12)
    s.box("Obstacle", 30, 24, 4, 4, "fountain", round_=True, blocks_view=False, shape="cylinder", z_max=1)
    outside = [
        (2, 2),
        (58, 2),
        (58, 46),
        (2, 46),
        (2, 25),
        (5, 25),
        (5, 43),
        (55, 43),
        (55, 5),
        (5, 5),
        (5, 23),
        (2, 23),
    ]
    s.draw("Goal", outside, "out of the square", on_arrive="despawn")
    for name, x, y, width in (
        ("south gate", 30, 7, 6),
        ("north-west gate", 22.2, 41, 5),
        ("north-east gate", 37.8, 41, 5),
    ):
        s.box("Exit", x, y, width, 2, name)
    s.box("Spawn", 30, 24, 28, 20, "people", species="human", brush="stroll", count=200, program="evacuation")
    s.box("Spawn", 30, 15, 8, 3, "visitors", species="human", brush="stroll", rate=1, start=95, heading="north",
          program="evacuation")  # fmt: skip
    for at in (12, 200, 400):  # the square fills again, and is cleared again
        s.draw("Key", [(30, 24 + at / 100)], f"alarm {at}", at=at, command="Event", name="alarm")
    s.draw("Line", [(28.4, 10), (31.6, 10)], "south", closed=False)
    s.draw("Line", [(21, 38), (23.4, 38)], "north-west", closed=False)
    s.draw("Line", [(36.6, 38), (39, 38)], "north-east", closed=False)
    s.box("Area", 30, 14, 6, 4, "before the south gate")
    return s
