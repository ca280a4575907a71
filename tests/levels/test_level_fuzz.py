"""Hostile levels are read, or refused with problems, in good time; levels changed at random are in `tests/fuzz`."""

import json
import math

import pytest
from small_level import herd, level, objects, polygon, rich, survives, thing, tiles


def test_the_level_of_the_fuzzer_has_one_of_everything():
    found = survives({name: json.dumps(document).encode() for name, document in rich().items()})
    assert (len(found.obstacles), len(found.goals), len(found.script)) == (3, 1, 1)


@pytest.mark.parametrize(
    ("number", "name", "value"), [(0, "width", 10**30), (1, "polygon", []), (1, "polygon", [[[[{}]]]])]
)
def test_an_object_that_once_broke_the_reader_is_a_problem(number, name, value):
    documents = rich()
    documents["small.tmj"]["layers"][4]["objects"][number][name] = value
    assert survives({name: json.dumps(document).encode() for name, document in documents.items()}) is None


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
    assert survives({"small.tmj": text.encode()}, 600.0) is None  # none of them is a level


def test_many_objects_with_many_corners():
    star = [
        (80 + 40 * (1 + k % 2 / 2) * math.cos(k / 287), 80 + 40 * (1 + k % 2 / 2) * math.sin(k / 287))
        for k in range(1800)
    ]
    rocks = [thing(k, "Obstacle", 0, 0, extra=polygon(*star)) for k in range(2, 10)]
    document = level(tiles(), objects("spawns", herd()), objects("obstacles", *rocks))
    found = survives({"small.tmj": json.dumps(document).encode()}, 300.0)
    assert found is None or len(found.obstacles) == len(rocks)
