"""On a periodic map each animal is seen once, over the shorter way, and none sees itself, however far it could see."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Position, Vision
from flockbrush.engine.seam import short_way
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Spawn
from flockbrush.systems.commands import SwitchBrush
from flockbrush.systems.senses import Sight, SightInSpace
from small_program import box


def periodic(side, species, brushes, **more):
    """A level of ``side`` m whose borders are joined, with so many animals of each brush anywhere."""
    spawns = [
        Spawn(k + 1, "", box(1, 1, side - 1, side - 1), species, brush, count, **more)
        for k, (brush, count) in enumerate(brushes.items())
    ]
    return build(Level("seam", None, side, side, 1.0, "wrap", 3, spawns=spawns), library=shipped())


def check(scene, lists, side):
    """The visible of each row: none twice, none itself, all by the shorter way."""
    (first, near, offset), xy, total = lists, scene.agents[Position.xyz][:, :2], 0
    for row in range(len(scene.agents)):
        seen = slice(first[row], first[row + 1])
        who, there = near[seen], offset[seen, :2]
        assert len(set(who.tolist())) == len(who) and row not in who
        way = short_way(xy[who] - xy[row], (side, side))
        near_enough = np.abs(way) < side / 2 - 2.0  # animals have moved since
        assert (np.abs(there - way)[near_enough] < 2.0).all() and (np.hypot(*there.T) <= side / 2).all()
        total += len(who)
    return total


@pytest.mark.parametrize("brushes", [{"to-goal": 1}, {"march": 1, "to-goal": 1}, {"march": 6, "to-goal": 6}])
def test_walkers_are_seen_once(brushes):
    """They could see 20 body lengths; those who march begin to when they change the brush."""
    scene = periodic(15.0, "sheep", brushes)
    scene.run(1)
    scene.submit(SwitchBrush(brush="to-goal"))
    scene.run(64)
    assert (np.abs(scene.agents[Vision.range] - 7.5) < 1e-4).all()
    count = sum(brushes.values())
    assert (check(scene, scene.world.resource(Sight).lists, 15.0) > 0) == (count > 1)


def test_birds_of_a_skein_are_seen_once():
    """They could see 300 body lengths."""
    scene = periodic(200.0, "goose", {"skein": 9}, altitude=30.0, heading=0.0)
    scene.run(32)
    assert check(scene, scene.world.resource(SightInSpace).lists, 200.0) > 9
