"""What makes shipped levels worth watching for ten minutes; `benchmarks/ten_minutes.py` watches all of them in full."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours

from benchmarks.ten_minutes import Minute, watched
from flockbrush.runs.run import open_level, shipped_levels


@pytest.mark.parametrize(("name", "animals", "seconds"), [("skein", 5, 65), ("gorge", 20, 115), ("city", 20, 110)])
def test_a_level_keeps_animals_on_its_map_when_its_first_scene_is_over(name, animals, seconds):
    look = watched(name, seconds, animals)
    assert look.alive > 0
    assert look.on_map == 1.0  # geese flew away to the north
    assert look.moved == 1.0 and look.jammed == 0.0


def test_who_is_held_up_in_the_open_is_jammed_and_who_rests_or_mills_is_not():
    walking, _, pressed, milling = ids = np.arange(4)
    minute, speed, target = Minute(), np.array([1.0, 0.0, 0.1, 1.0]), np.array([1.0, 0.0, 1.0, 1.0])
    for second in range(70):
        xyz = np.full((4, 3), 500.0)
        xyz[walking, 0] += second
        xyz[milling, :2] += np.cos(second), np.sin(second)
        minute.see(ids, xyz, speed, target)
    assert np.flatnonzero(minute.jammed(ids, np.ones(4))).tolist() == [pressed]
    assert minute.jammed(ids[:0], np.ones(0)).shape == (0,)


@pytest.mark.parametrize("name", shipped_levels())
def test_only_birds_live_on_maps_without_a_border(name):
    level, library = open_level(name)
    walkers = [spawn.name for spawn in level.spawns if behaviours()[library.get(spawn.brush).model].flight is None]
    assert level.boundary != "open" or not walkers  # elephants wandered off
