"""Fear: whom animals flee from says their species, under every model, and only what is noticed frightens."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import SpeciesLibrary, SpeciesSpec, load_species, shipped_species
from flockbrush.components import Alarm, Heading, Individual, Position, Speed, Urge, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.systems.commands import AddAnimals
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from small_herd import boids, box, brush, meadow, obstacle, put, put_aloft, xy_of

from flockbrush.runs.run import start


def speeds(simulation):
    return np.linalg.norm(simulation.agents[Velocity.xyz], axis=1)


def herd_and_wolf(model="herd", wolf_at=(15.0, 20.0), species="wolf", heading=np.pi, **things):
    """A dozen sheep around (20, 20), who face the wolf west of them."""
    simulation = meadow(brush("graze", model, mean=0.3), brush("stand", mean=0.0), **things)
    put(simulation, [(20 + 2 * (k % 4), 18 + 2 * (k // 4)) for k in range(12)], heading, species="sheep")
    put(simulation, wolf_at, species=species, brush="stand")
    return simulation


@pytest.mark.parametrize("model", ["herd", "boids", "v_rules", "line_formation"])
def test_prey_flees_under_every_model(model):
    if model == "herd":
        simulation = herd_and_wolf()
    else:
        birds = brush("graze", model, mean=20.0, body={"length": 0.8, "radius": 0.16, "contact": "disc"},
                      vision={"range": 60.0})  # fmt: skip
        simulation = meadow(birds, brush("stand", mean=0.0), boundary="open")
        put_aloft(simulation, [(20 + 3 * k, 20 + 2 * k, 12) for k in range(6)], (-1, 0, 0), species="goose")
        put_aloft(simulation, (0.0, 20.0, 12.0), species="falcon", brush="stand")
    before = xy_of(simulation)
    simulation.run(64)
    assert (simulation.agents[Alarm.level][:-1] > 0.3).all()
    danger = simulation.agents[Position.xyz][-1, :2]
    fled = np.linalg.norm(xy_of(simulation)[:-1] - danger, axis=1) - np.linalg.norm(before[:-1] - before[-1], axis=1)
    if model == "herd":
        assert (fled > 4.0).all()
        assert speeds(simulation)[:-1].mean() > 4.0
    else:  # they were on their way towards it at 16 m/s
        turned = simulation.agents[Heading.forward][:-1, 0]
        assert (turned > 0.0).all()


def test_a_danger_out_of_notice_changes_no_bit():
    near, far = herd_and_wolf(wolf_at=(-200.0, 20.0)), herd_and_wolf(wolf_at=(-200.0, 20.0), species="sheep")
    near.run(32), far.run(32)
    assert not near.agents[Alarm.level].any()
    for field in (Position.xyz, Velocity.xyz, Heading.forward):
        assert np.array_equal(near.agents[field][:12], far.agents[field][:12])


def test_alarm_fades_with_the_time_constant_that_the_species_file_says():
    simulation = herd_and_wolf(wolf_at=(-200.0, 20.0))
    level, ticks = simulation.agents[Alarm.level], int(32 * 6.0)  # sheep calm down with 6 s
    level[:] = 1.0
    simulation.run(ticks)
    after = simulation.agents[Alarm.level][0]
    assert after == pytest.approx(np.exp(-1.0), rel=1e-6)
    simulation.run(ticks * 3)
    assert not simulation.agents[Alarm.level][:12].any()
    meaning = SpeciesSpec.model_fields["calm"].description
    assert f"falls to {after:.0%}".replace("%", " %") in meaning and "4 times as long" in meaning


def test_calm_prey_does_not_see_what_is_behind_it_and_bold_prey_notices_later():
    behind = herd_and_wolf(heading=0.0)
    behind.run(1)
    dead_ahead = herd_and_wolf()
    dead_ahead.run(1)
    assert (dead_ahead.agents[Alarm.level][:12] > 0).all()
    assert (behind.agents[Alarm.level][:12] > 0).sum() < 12
    bold = herd_and_wolf(wolf_at=(-8.0, 20.0))
    bold.agents[Individual.boldness][:6] = 1.5
    bold.run(1)
    assert not bold.agents[Alarm.level][:6].any()
    assert (bold.agents[Alarm.level][6:12] > 0).all()


@pytest.mark.parametrize("opaque", [True, False])
def test_a_danger_behind_an_opaque_wall_frightens_nobody(opaque):
    wall = obstacle(box(16.5, 0, 17, 40), blocks_view=opaque)
    simulation = herd_and_wolf(obstacles=[wall])
    simulation.run(8)
    assert simulation.agents[Alarm.level][:12].any() != opaque


@pytest.mark.parametrize("opaque", [True, False])
def test_a_falcon_behind_an_opaque_wall_frightens_no_starling(opaque):
    wall = obstacle(box(16.5, 0, 17, 40), blocks_view=opaque)
    simulation = meadow(boids(), brush("stand", "raptor", mean=0.0), obstacles=[wall])
    put_aloft(simulation, [(20, 18 + k, 5) for k in range(4)], (-1, 0, 0), species="starling")
    put_aloft(simulation, (14.0, 20.0, 5.0), species="falcon", brush="stand")
    simulation.run(2)
    assert simulation.agents[Alarm.level][:4].any() != opaque


def test_a_danger_behind_a_hill_frightens_nobody():
    ridge = np.zeros((40, 40))
    for height, frightened in ((0.0, True), (6.0, False)):
        ridge[:, 15:18] = height
        simulation = herd_and_wolf(wolf_at=(8.0, 20.0), height_map=Raster(1.0, ridge.copy()))
        simulation.run(1)
        assert simulation.agents[Alarm.level][:12].any() == frightened


def test_the_fright_fades_and_the_herd_goes_on_as_its_brush_says():
    simulation = herd_and_wolf()
    simulation.run(32)
    simulation.world.delete_entity(int(simulation.agents.ids[-1]))
    simulation.run(32 * 40)
    agents = simulation.agents
    assert not agents[Alarm.level].any() and not agents[Urge.driven].any()
    assert np.array_equal(agents[Alarm.place], np.zeros_like(agents[Alarm.place]))
    assert speeds(simulation).max() < 0.5


@pytest.mark.parametrize("x", [0.2, 39.8])
def test_who_has_fled_over_the_seam_runs_on_from_where_the_danger_was(x):
    simulation = meadow(brush("graze", mean=0.3), boundary="wrap")
    put(simulation, (x, 20.0), np.pi, species="sheep")
    simulation.agents[Alarm.level][:], simulation.agents[Alarm.place][:] = 1.0, (3.0, 20.0, 0.0)
    simulation.run(8)
    assert simulation.agents[Velocity.xyz][0, 0] < -0.5


def test_nobody_is_faster_or_gets_faster_sooner_than_its_species_can():
    sheep = SpeciesList(["sheep"]).assets[0]
    simulation = herd_and_wolf()
    before = simulation.agents[Speed.target].copy()
    for _ in range(160):
        simulation.tick()
        now = simulation.agents[Speed.target].copy()
        assert now.max() <= sheep.walk.speed
        assert (now - before)[:12].max() <= sheep.walk.acceleration / 32 + 1e-9
        before = now


def test_files_of_species_are_read_once_for_each_list_of_names(tmp_path):
    file = tmp_path / "yak.species.toml"
    file.write_bytes(shipped_species().file_of("sheep").read_bytes())
    fauna = SpeciesList(["yak"], SpeciesLibrary([tmp_path]))
    first = fauna.assets
    file.unlink()
    assert fauna.assets == first and first[0].name == "yak"
    assert fauna.index("ox") == 1 and fauna.assets == [None, None]


def test_who_is_prey_and_who_is_not_says_the_species():
    fearless = herd_and_wolf(species="elephant")
    fearless.run(8)
    assert not fearless.agents[Alarm.level].any()
    told = SpeciesList(["sheep", "wolf", "elephant", "unheard-of"]).relations
    assert told.verb[2 * 0, 2 * 1] and not told.verb[2 * 0, 2 * 2]
    assert told.verb[2 * 0, 2 * 3 + 1] and not told.verb[2 * 0, 2 * 3]  # a hunting brush makes the unknown a danger
    assert told.verb[2 * 3, 2 * 1 + 1] and not told.verb[2 * 3, 2 * 1]
    assert not told.verb[2 * 1 + 1, 2 * 3 + 1]  # hunters do not fear each other unless told


def test_species_that_name_each_other_kin_keep_together():
    goat = load_species(
        b'schema = "flockbrush.species/1"\nmedia = ["walk"]\n[body]\nlength = 1.2\n[relations]\n'
        b'ewe = { kin = 1.0 }\ngoat = { avoid = 1.0 }\n', "goat.species.toml",
    )  # fmt: skip
    ewe = load_species(
        b'schema = "flockbrush.species/1"\nmedia = ["walk"]\n[body]\nlength = 1.2\n[relations]\n'
        b"goat = { kin = 1.0 }\n", "ewe.species.toml",
    )  # fmt: skip
    from flockbrush.systems.fauna import SOLITARY, species_table

    assert species_table(["ewe", "goat"], [ewe, goat]).kin.tolist() == [0, SOLITARY]
    friendly = goat.model_copy(update={"relations": {"ewe": goat.relations["ewe"]}})
    assert len(set(species_table(["ewe", "goat"], [ewe, friendly]).kin.tolist())) == 1


def test_a_wolf_on_the_meadow_frightens_grazers_and_marchers():
    simulation = start("meadow", seed=7)
    simulation.world.resource(Palette).add(shipped().get("wolf-hunt"))
    simulation.run(32)
    xy = xy_of(simulation)
    for k, herd in enumerate((xy[:60], xy[60:])):
        x, y = (herd.mean(0) + (4.0, 0.0)).tolist()
        simulation.submit(AddAnimals("wolf-hunt", x, y, 3.0, 1, "wolf"), 33 + k)
    simulation.run(64)
    agents = simulation.agents
    assert (agents[Alarm.level][:60] > 0).mean() > 0.8
    assert (agents[Alarm.level][60:140] > 0).mean() > 0.8
    assert speeds(simulation)[:60].mean() > 3.0  # grazing they go a third of a metre in a second
