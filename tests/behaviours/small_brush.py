"""A brush file to be read, changed and spoiled."""

from flockbrush.behaviours.behaviour import behaviours
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

HERD = behaviours()["herd"].Params

GOOD = """\
schema = "flockbrush.brush/1"
model = "herd"
colour = "#c9a24b"

[parameters]
avoidance_weight = 0.5
unled = "keep"

[speed]
mean = 2

[provenance]
kind = "hand-set"
source = "a test"
date = 2026-11-21
by = "the tests"
"""


def replaced(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


# to a file and back

line = st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), max_size=120).filter(str.isprintable)
text = st.text(
    st.sampled_from("ab \n\t\"'\\#=é中🐑\u00a0") | st.characters(exclude_categories=["C", "Z"]), max_size=400
).filter(lambda text: all(character.isprintable() or character in "\n\t" for character in text))


def quick(examples):
    return settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


# the shipped brushes

EXPECTED = [
    "column",
    "front",
    "graze",
    "lanes",
    "march",
    "mill-filled",
    "mill-hollow",
    "sheep-drone",
    "sheep-gps",
    "sheep-narrow",
    "stampede",
    "swarm",
    "zebrafish",
]
