"""Damaged and odd brush files give a brush or problems, and nothing else."""

import random
import time

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.problems import ProblemsError
from hypothesis import given
from hypothesis import strategies as st
from small_brush import EXPECTED, GOOD, quick

# fuzzing: whatever comes in, a brush or problems come out, soon

ODD = [
    "true",
    "nan",
    "-inf",
    "1e400",
    "0x" + "f" * 500,
    "9" * 4400,
    '"\\u0000"',
    '"""',
    "[[[]]]",
    "{}",
    "{a=1}",
    "[]",
    "-1",
    "''",
]
ODD += [
    "2026-13-01",
    "2026-11-21",
    "07:30:00",
    "1_000",
    "0b2",
    "[1,",
    "{",
    "é",
    '"🐑"',
    "[" * 50,
    "{a=" * 40,
    "0.5.5",
    "1e-320",
    "-0",
]
LINES = [
    "[speed]",
    "[[speed]]",
    "[parameters.speed]",
    "[",
    "]]",
    "speed = 1",
    "a.b.c.d = 1",
    "speed.mean.x = 2",
    "\ufeff",
    "\0",
]
LINES += [
    "[a" + ".a" * 40 + "]",
    '"" = 1',
    "'x y' = 2",
    "\u202e = 1",
    'model = ["herd"]',
    'schema = "flockbrush.brush/1"',
    "\r",
]


def mangled(source, rng):
    """A brush file with one to four wounds."""
    kinds = rng.choice([range(8), [2, 3], [3]])  # byte by byte, or line by line so that it is often TOML still
    for _ in range(rng.randint(1, 4)):
        lines = source.split(b"\n")
        i = rng.randrange(len(lines))
        wound = rng.choice(kinds)
        if wound == 0 and source:
            at = rng.randrange(len(source))
            source = source[:at] + bytes([source[at] ^ 1 << rng.randrange(8)]) + source[at + 1 :]
            continue
        if wound == 1:
            source = source[: rng.randrange(len(source) + 1)]
            continue
        if wound == 2:
            del lines[i]
        elif wound == 3:
            lines[i] = lines[i].split(b"=")[0] + b"= " + rng.choice(ODD).encode()
        elif wound == 4:
            lines.insert(i, rng.choice(LINES).encode())
        elif wound == 5:
            lines.insert(i, rng.choice(lines))
        elif wound == 6:
            lines[i] = rng.randbytes(rng.randint(1, 20))
        else:
            rng.shuffle(lines)
        source = b"\n".join(lines)
    return source


@quick(900)
@given(st.integers(0, 2**32), st.sampled_from([GOOD.encode(), *(shipped().get(name).source for name in EXPECTED)]))
def test_a_damaged_file_gives_a_brush_or_problems_and_nothing_else(seed, source):
    source = mangled(source, random.Random(seed))
    start = time.perf_counter()
    try:
        brush = load_brush(source, "f.brush.toml")
    except ProblemsError as error:
        assert error.problems
        assert all(problem.file == "f.brush.toml" and problem.message for problem in error.problems)
        assert all(problem.line is None or 1 <= problem.line <= source.count(b"\n") + 1 for problem in error.problems)
        assert str(error).replace("\n", "").isprintable()
    else:
        assert load_brush(brush_to_toml(brush).encode(), "f.brush.toml") == brush
    assert time.perf_counter() - start < 2


@quick(300)
@given(st.binary(max_size=300) | st.text(st.sampled_from("[]{}=.,\"'#\\\n ab1-:T+e_"), max_size=80).map(str.encode))
def test_noise_is_no_brush(data):
    with pytest.raises(ProblemsError):
        load_brush(data, "f.brush.toml")


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.dates() | st.times(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
KEYS = ["model", "colour", "parameters", "speed", "body", "vision", "provenance", "params", "title", "name"]


@quick(300)
@given(
    st.sampled_from(KEYS), plain, st.sampled_from(["mean", "by_density", "kind", "frames", "report", "versions", "x"])
)
def test_values_of_any_type_anywhere_give_a_brush_or_problems(key, value, inner):
    from flockbrush.behaviours.brush import _read
    from flockbrush.behaviours.tomlfile import TomlFile, parse_toml

    good = parse_toml(GOOD.encode(), "f.brush.toml").data
    for data in ({**good, key: value}, {**good, key: {inner: value}}):
        try:
            _read(TomlFile("f.brush.toml", data, {}), behaviours())
        except ProblemsError as error:
            assert str(error).replace("\n", "").isprintable()
