"""A model may see by hidden-point removal; others do not pay for it."""

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as registry
from flockbrush.behaviours.behaviour import Parameters, Wishes, behaviour
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Position
from flockbrush.levels.build import plane
from flockbrush.systems.hidden_points import hidden_point_removal
from flockbrush.systems.senses import SightByHiddenPoints


class Nothing(Parameters):
    """No numbers."""


@pytest.fixture
def watcher(monkeypatch):
    """A brush whose animals walk on and note whom they see by hidden-point removal."""
    registry.behaviours()
    registry.behaviours()  # all known before, so that all are known again afterwards
    monkeypatch.setattr(registry, "_registry", dict(registry._registry))
    seen = []

    @behaviour("watcher", Nothing, hidden_points=True)
    def steer(scene, rows, params):
        lists = scene.hidden_points
        seen.append([set(lists.near[a:b]) for a, b in zip(lists.first, lists.first[1:], strict=False)])
        return Wishes(scene.forward[rows].copy(), np.ones(len(rows)))

    brush = shipped().get("swarm").model_copy(update={"model": "watcher", "params": Nothing()})
    return brush, seen


def test_a_model_that_asks_gets_whom_hidden_point_removal_leaves(watcher):
    brush, seen = watcher
    herd = plane(brush, 40, seed=3)
    xy = herd.agents[Position.xyz][:, :2].copy()
    herd.tick()
    for me in range(40):
        away = np.linalg.norm(xy - xy[me], axis=1)
        near = np.flatnonzero((away < 4 * brush.body.length) & (away > 0))
        assert seen[0][me] == set(near[hidden_point_removal(xy[near], xy[me])])


def test_a_herd_without_such_a_model_does_not_pay_for_it():
    herd = plane(shipped().get("swarm"), 10)
    herd.tick()
    assert herd.world.resource(SightByHiddenPoints).lists is None
