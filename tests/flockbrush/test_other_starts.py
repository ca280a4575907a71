"""From which starts a brush does what the clip shows: measured, and said in the report and in the brush's notes."""

from types import SimpleNamespace

import numpy as np
import pytest

import flockbrush
from flockbrush.learning.other_starts import with_other_starts
from flockbrush.learning.result import Findings
from flockbrush.learning.rollout import HerdStart


def begun(animals=60):
    """A turning disc of as many animals, .6 to a square body length."""
    chance = np.random.default_rng(1)
    radius, angle = np.sqrt(animals / 0.6 / np.pi * chance.random(animals)), chance.uniform(0, 2 * np.pi, animals)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    return HerdStart(radius[:, None] * way, way[:, ::-1] * (-1, 1))


def found(brush, polarization, milling, seconds=20.0):
    """Findings on a clip with this polarization and milling."""
    verdicts = {"polarization": SimpleNamespace(clip=polarization), "milling": SimpleNamespace(clip=milling)}
    fields = SimpleNamespace(count=np.array([60]), velocity=np.zeros((1, 1)))
    one = Findings(brush, [], SimpleNamespace(fields=fields), None)
    one.comparison = SimpleNamespace(verdict=verdicts.get)
    one.starts = with_other_starts(brush, begun(), seconds=seconds)
    return one


@pytest.fixture(scope="module")
def march():
    return flockbrush.shipped().get("march")


def ring_mill():
    """A mill of animals that see all round: it turns on from a ring, and never begins."""
    brush = flockbrush.shipped().get("mill-hollow").with_parameters(
        avoidance_weight=0.7, avoidance_radial=0.22, avoidance_angular=0.72, neighbour_range=8.0,
        cohesion_weight=0.3, cohesion_radial=0.92, cohesion_angular=0.68, sensitivity=10.0,
        alignment_weight=0.24, alignment_radial=0.31, alignment_angular=0.95, max_turn=1.7,
    )  # fmt: skip
    speed = brush.speed.model_copy(update={"mean": 6.0, "deviation": 0.6})
    vision = brush.vision.model_copy(update={"range": 8.0, "field_of_view": 360.0})
    return brush.model_copy(update={"speed": speed, "vision": vision})


def test_a_mill_that_never_forms_from_a_scatter_says_so():
    mill = found(ring_mill(), 0.1, 0.9)
    by = {row["start"]: row for row in mill.starts}
    assert min(by["ring"]["milling"]) > 0.7 > max(by["scatter"]["milling"])
    said = mill.starts_sentence()
    assert "of 3 herds of 60 animals for each start" in said
    assert "0 from a scatter with random headings" in said and "3 from a turning ring" in said


def test_a_march_holds_from_a_scatter_and_every_herd_is_another(march):
    one = found(march, 0.98, 0.05, seconds=12.0)
    scatter = one.starts[0]
    assert "3 from a scatter with random headings" in one.starts_sentence()
    assert len(set(scatter["polarization"])) == 3 and scatter["animals"] == 60


def test_two_animals_have_no_crowd_and_one_has_no_start(march):
    assert with_other_starts(march, begun(1)) == []
    assert len(with_other_starts(march, begun(2), seconds=1.0)) == 3
