"""Whatever is done to a level, the reader answers with a level or with problems, and soon."""

import copy
import json
import math
import time

import pytest
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.reader import read_level_files
from flockbrush.levels.schema import Level
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from small_level import (
    MARCH,
    SLOW,
    Gust,
    Shelf,
    herd,
    level,
    objects,
    polygon,
    polyline,
    thing,
    tiles,
    tileset,
)

SOON = 60.0  # s, on a busy machine; a hang takes longer


def rich():
    """A level with one of everything."""
    point = {"point": True}
    layers = [
        tiles(),
        {"type": "group", "name": "g", "layers": [tiles("brush", [MARCH] * 100, opacity=0.5)], "offsetx": 16},
        tiles("speed", [SLOW] * 100, encoding="base64", data="BAAAAA==" * 1, width=1, height=1),
        objects("spawns", herd()),
        objects(
            "obstacles",
            thing(2, "Obstacle", 16, 16, 16, 16, extra={"rotation": 30, "ellipse": True}, margin=0.5),
            thing(3, "Obstacle", 140, 16, extra=polygon((0, 0), (10, 0), (10, 10))),
            thing(4, "", 16, 160, 8, 8, extra={"gid": 1}),
        ),
        objects("guides", thing(5, "Guide", 16, 144, extra=polyline((0, 0), (128, -64)), goal="fold")),
        objects("goals", thing(6, "Goal", 80, 80, name="fold", extra=point, on_arrive="stay")),
        objects("zones", thing(7, "Zone", 0, 0, 50, 50, brush="graze", factor=0.5)),
        objects("script", thing(8, "Key", 0, 0, extra=point, at=1.0, command="Gust", strength=2.0)),
        objects("measure", thing(9, "Line", 0, 0, extra=polyline((0, 0), (9, 9))), thing(10, "Area", 0, 0, 9, 9)),
        objects("exits", thing(11, "Exit", 0, 0, 9, 9)),
    ]
    return level(*layers, tilesets=[{"firstgid": 1, "source": "kinds.tsj"}])


FILES = {"small.tmj": rich(), "kinds.tsj": tileset()}


def survives(files, soon=SOON):
    """Read; only a level or problems come out, every problem one line, in good time."""
    start = time.perf_counter()
    try:
        result = read_level_files(files, library=Shelf(), commands={"Gust": Gust})
    except ProblemsError as error:
        assert error.problems
        assert all("\n" not in str(p) and len(str(p)) < 2000 for p in error.problems)
    else:
        assert isinstance(result, Level)
        assert all(math.isfinite(v) for s in result.spawns for v in s.polygon.ravel())
    assert time.perf_counter() - start < soon


def paths(node, here=()):
    """The way to every value of a document."""
    yield here
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        if not (isinstance(node, list) and len(node) > 20 and key > 3):
            yield from paths(value, (*here, key))


PATHS = [(name, path) for name, document in FILES.items() for path in paths(document) if path]
ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from([0, -1, 1, 2**31, 2**32, 2**63, 10**30, -(10**30), 1e308, -1e308, 1e-308, 0.5, 4_000_000]),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(
        ["", "map", "zlib", "base64", "zstd", "../x.tsj", "/etc/passwd", "Spawn", "Key", "class", "a\nb", "\ud800"]
    ),
    st.lists(st.integers(-5, 5), max_size=3),
    st.dictionaries(st.sampled_from(["x", "y", "id", "name", "value"]), st.integers(-5, 5), max_size=3),
    st.just([[[[{}]]]]),
)


def change(document, path, how, value):
    """Delete, replace, double or wrap what is at a path, if it is still there."""
    *way, last = path
    node = document
    try:
        for key in way:
            node = node[key]
        if how == "delete":
            del node[last]
        elif how == "double" and isinstance(node, list):
            node.insert(last, copy.deepcopy(node[last]))
        elif how == "wrap":
            node[last] = [node[last]]
        else:
            node[last] = value
    except (LookupError, TypeError):
        pass


CHANGES = st.lists(
    st.tuples(st.sampled_from(PATHS), st.sampled_from(["delete", "replace", "replace", "double", "wrap"]), ODD),
    min_size=1,
    max_size=4,
)


def test_the_level_that_is_spoiled_is_sound_at_first():
    document = rich()
    document["layers"][2] = tiles("speed", [SLOW] * 100)
    files = {"small.tmj": json.dumps(document).encode(), "kinds.tsj": json.dumps(tileset()).encode()}
    found = read_level_files(files, library=Shelf(), commands={"Gust": Gust})
    assert (len(found.obstacles), len(found.goals), len(found.script)) == (3, 1, 1)


@settings(max_examples=700, deadline=None, suppress_health_check=list(HealthCheck))
@given(CHANGES)
@example([(("small.tmj", ("layers", 4, "objects", 0, "width")), "replace", 10**30)])
@example([(("small.tmj", ("layers", 4, "objects", 1, "polygon")), "replace", [])])
def test_changed_documents(changes):
    documents = copy.deepcopy(FILES)
    for (name, path), how, value in changes:
        change(documents[name], path, how, value)
    survives({name: json.dumps(d).encode("utf-8", "surrogatepass") for name, d in documents.items()})


TEXT = json.dumps(rich(), indent=1).encode()


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, len(TEXT)), st.binary(max_size=6), st.integers(0, 40))
def test_changed_bytes(at, new, cut):
    survives({"small.tmj": TEXT[:at] + new + TEXT[at + cut :], "kinds.tsj": json.dumps(tileset()).encode()})


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, len(TEXT)))
def test_truncated_files(length):
    survives({"small.tmj": TEXT[:length], "kinds.tsj": json.dumps(tileset()).encode()})


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.binary(max_size=200))
def test_noise(data):
    survives({"small.tmj": data})


@pytest.mark.parametrize(
    "text",
    [
        "[" * 500_000,
        '{"a":' * 500_000,
        "9" * 1_000_000,
        "-" * 1_000_000,
        '"' + "\\u00e9" * 200_000,
        '{"layers": [' + "{}," * 50_000 + "{}]}",
        " " * 1_000_000,
        '{"width": 1e400}',
        "1." + "0" * 1_000_000,
        "[" + "1," * 300_000,
    ],
    ids=lambda t: t[:8],
)
def test_hostile_texts(text):
    survives({"small.tmj": text.encode()}, 10 * SOON)


def test_many_objects_with_many_corners():
    star = [
        (80 + 40 * (1 + k % 2 / 2) * math.cos(k / 287), 80 + 40 * (1 + k % 2 / 2) * math.sin(k / 287))
        for k in range(1800)
    ]
    rocks = [thing(k, "Obstacle", 0, 0, extra=polygon(*star)) for k in range(2, 10)]
    survives(
        {"small.tmj": json.dumps(level(tiles(), objects("spawns", herd()), objects("obstacles", *rocks))).encode()},
        5 * SOON,
    )
