"""Families: groups inside groups, from the spawn to the table."""

import csv

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.drive import drives
from flockbrush.components import Family, Position
from flockbrush.engine.commands import Commands
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.reader import read_level
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tiled import write_project
from flockbrush.systems.edits import MarkSpawn
from flockbrush.systems.families import families_of
from flockbrush.systems.groups import groups_of, summary
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, brush, meadow, put, spawn, straight


def keeping(asset, **params):
    """A brush whose animals keep to their families."""
    return asset.model_copy(update={"drives": {"keep_family": drives()["keep_family"].Params(**params)}})


def herd_of(asset, count=30, size=5):
    here = spawn(box(5, 5, 20, 20), asset.name, count, species="sheep", family_size=size)
    return meadow(asset, spawns=[here], seed=1)


def written(folder, **told):
    """A level file with one spawn."""
    sketch = LevelSketch(40, 40, 1.0, "tilesets")
    sketch.box("Spawn", 10, 10, 20, 20, "herd", species="sheep", brush="graze", **told)
    write_project(folder, shipped())
    return sketch.save(folder / "families.tmj")


def apart(xy, family):
    """Mean distance of animals from the middle of their family, m."""
    return np.mean(
        [np.linalg.norm(xy[family == k] - xy[family == k].mean(0), axis=1).mean() for k in np.unique(family)]
    )


@given(st.integers(0, 60), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_families_are_no_larger_than_told_and_no_more_than_needed(n, size, seed):
    xyz = np.random.default_rng(seed).random((n, 3))
    label, count = np.unique(families_of(xyz, size), return_counts=True)
    assert len(label) == -(-n // size) and count.max(initial=0) <= size
    assert n == 0 or np.ptp(count) <= 1


def test_families_are_neighbours_and_bear_the_smallest_id():
    simulation = herd_of(brush("walk"))
    xy, family = simulation.agents[Position.xyz][:, :2], simulation.agents[Family.number]
    assert [int(simulation.agents.ids[family == k].min()) for k in np.unique(family)] == np.unique(family).tolist()
    assert len(np.unique(family)) == 6
    assert apart(xy, family) < 0.6 * apart(xy, np.random.default_rng(0).permutation(family))


def test_a_stray_goes_back_to_its_family_and_passes_the_others():
    def distance(asset):
        simulation = meadow(asset)
        put(simulation, [(10, 20), (12, 20), (28, 20), (30, 20)], heading=0.0)
        put(simulation, [(24, 20)], heading=0.0)  # stands by the eastern pair, and belongs to the western one
        simulation.agents[Family.number][:] = [1, 1, 3, 3, 1]
        simulation.run(320)
        x = simulation.agents[Position.xyz][:, 0]
        return abs(x[4] - x[:2].mean())

    asset = straight(vision={"range": 60.0}, mean=0.5)
    assert distance(keeping(asset)) < 5.0 < 10.0 < distance(asset)


def test_whoever_has_no_family_is_asked_for_nothing():
    def places(asset):
        simulation = meadow(asset)
        put(simulation, [(10, 20), (12, 20), (24, 20)], heading=0.0)
        simulation.run(64)
        return simulation.agents[Position.xyz].tobytes()

    asset = brush("walk", vision={"range": 60.0})
    assert places(keeping(asset)) == places(asset)


def test_an_undone_spawn_takes_its_families_with_it():
    simulation = herd_of(keeping(brush("walk")))
    before = simulation.agents[Family.number].copy()
    more = MarkSpawn(9, "more", box(22, 22, 30, 30).tolist(), "walk", "sheep", 12, family_size=4)
    undo = simulation.world.resource(Commands).perform(simulation.world, [more])
    assert len(np.unique(simulation.agents[Family.number])) == 6 + 3
    simulation.world.resource(Commands).perform(simulation.world, undo)
    assert np.array_equal(simulation.agents[Family.number], before)


def test_a_report_has_the_families_of_each_group():
    simulation = herd_of(brush("walk", vision={"range": 60.0}))
    told = summary(simulation.world)["groups"]
    assert len(told) == 1 and len(told[0]["families"]) == 6
    assert sum(family["animals"] for family in told[0]["families"]) == told[0]["animals"] == 30
    assert "families" not in summary(herd_of(brush("walk"), size=0).world)["groups"][0]
    assert len(np.unique(groups_of(simulation.world))) == 1


def test_a_level_tells_them_and_a_table_has_them(tmp_path):
    from flockbrush.output.export import Exports
    from flockbrush.runs.run import start

    simulation = start(written(tmp_path, count=20, family_size=4))
    exports = Exports([tmp_path / "families.csv"], simulation)
    exports.take()
    exports.close()
    rows = list(csv.DictReader((tmp_path / "families.csv").read_text().splitlines()))
    assert [int(row["family"]) for row in rows] == simulation.agents[Family.number].tolist()


def test_families_come_all_at_once(tmp_path):
    with pytest.raises(ProblemsError, match="families need a rate of 0"):
        read_level(written(tmp_path, rate=2.0, family_size=4))
    with pytest.raises(ValueError, match="families need a rate of 0"):
        MarkSpawn(1, "", box(5, 5, 9, 9).tolist(), "walk", rate=1.0, family_size=3).check(meadow(brush("walk")).world)
