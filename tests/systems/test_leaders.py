"""Who follows a guide, and leaders that are appointed and steered."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.drive import drives
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import (
    Alarm,
    Body,
    Ground,
    Heading,
    Leading,
    Position,
    Role,
    Speed,
    Thrust,
    Urge,
    Velocity,
    Wish,
)
from flockbrush.components.agent import BY_VELOCITY
from flockbrush.components.formation import FormationPlace
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.recording import first_difference, open_recording, state_hash
from flockbrush.engine.state import restore, snapshot
from flockbrush.levels.build import plane
from flockbrush.systems.explain import explain
from flockbrush.systems.leaders import Appoint, Steer, assign_leaders
from flockbrush.systems.undo import rows_of
from small_herd import boids, meadow, obstacle, put, put_aloft
from small_herd import box as square
from small_herd import brush as small_brush

from flockbrush.runs.run import open_level, rebuild, record, start
from flockbrush.studio.branches import Beginning
from flockbrush.studio.timeline import Timeline


def brush(**changes):
    """March with some of its parameters changed."""
    text = shipped().get("march").source.decode()
    added = "".join(f"{name} = {value}\n" for name, value in changes.items())
    return load_brush(text.replace("[parameters]\n", f"[parameters]\n{added}", 1).encode(), "march.brush.toml")


def packed(**changes):
    """Sixty animals so close together that next to nobody sees at most two others."""
    return plane(brush(**changes), 60, density=0.9, seed=5)


def test_by_the_papers_rule_next_to_nobody_leads_in_a_packed_herd():
    simulation = packed()
    simulation.run(2)
    assert simulation.agents[Role.leader].mean() < 0.35


def test_a_guide_is_followed_by_those_whom_the_brush_names_and_only_where_there_is_one():
    for rule, low, high in (("everyone", 1.0, 1.0), ("share", 0.2, 0.8), ("front", 0.0, 0.35)):
        simulation = packed(guided=f'"{rule}"', guided_share=0.5)
        simulation.run(1)
        agents = simulation.agents
        agents[Ground.guidance][:] = (1.0, 0.0)
        assign_leaders(simulation.world)
        assert low <= agents[Role.leader].mean() <= high, rule
    away = packed(guided='"everyone"')
    away.run(2)
    assert away.agents[Role.leader].mean() < 0.35


def test_only_those_appointed_lead_where_the_brush_says_so():
    simulation = packed(guided='"appointed"')
    simulation.submit(Appoint([7, 9]))
    simulation.run(2)
    agents = simulation.agents
    assert sorted(agents.ids[agents[Role.leader] == 1].tolist()) == [7, 9]


def test_an_appointed_leader_goes_where_it_is_steered_and_is_free_when_it_is_there():
    simulation = packed()
    agents = simulation.agents
    start = agents[Position.xyz][rows_of(simulation.world, [7])][0, :2].copy()
    place = start + (0.0, 12.0)
    simulation.submit(Appoint([7]))
    simulation.submit(Steer([7], *place.tolist(), kind="place"))
    simulation.run(64)
    row = rows_of(simulation.world, [7])[0]
    assert agents[Heading.forward][row, 1] > 0.5
    simulation.run(32 * 60)
    row = rows_of(simulation.world, [7])[0]
    assert agents[Leading.kind][row] == 0
    assert (agents[Leading.target][row] == 0).all()


AIR = ("boids", "raptor", "v_rules", "line_formation")
SPECIES = {"boids": "starling", "raptor": "falcon"} | dict.fromkeys(("v_rules", "line_formation"), "goose")


def held(model):
    """(simulation, ids) of six animals of a model; drives hold them together, where they are, or send them east."""
    hold = {"keep_group": {"distance": 0.1, "hurry": 0.1}, "seek": {"what": "place", "x": 390.0, "y": 200.0}}
    hold |= {"follow": {"distance": 0.0}, "rest": {}}
    species = SPECIES.get(model, "sheep")
    body = shipped_species().get(species).body
    more = {"mean": 20.0, "min_speed": 5.0} if model in ("boids", "raptor") else {"mean": 18.0 if model in AIR else 1.0}
    asset = small_brush("held", model, body={"length": body.length, "radius": body.radius}, **more)
    asset = asset.model_copy(update={"drives": {name: drives()[name].Params(**p) for name, p in hold.items()}})
    simulation = meadow(asset, width=400.0, height=400.0)
    spots = [(200.0 + 3 * body.length * (k % 3), 200.0 + 3 * body.length * (k // 3)) for k in range(6)]
    if model not in AIR:
        return simulation, put(simulation, spots, species=species)
    return simulation, put_aloft(simulation, [(x, y, 20.0) for x, y in spots], species=species)


@pytest.mark.parametrize("model", sorted(behaviours()))
def test_a_steered_animal_of_any_model_goes_where_it_is_sent_whatever_holds_it(model):
    """To a place behind it, south, on the spot, and back to its own."""
    simulation, ids = held(model)
    world, agents, one = simulation.world, simulation.agents, int(ids[4])
    simulation.run(8)
    body = shipped_species().get(SPECIES.get(model, "sheep"))
    can = body.fly if model in AIR else body.walk
    xyz, row = agents[Position.xyz], agents.row(one)
    start = xyz[row].copy()
    far = 10.0 * np.linalg.norm(agents[Velocity.xyz][row]) if model in AIR else 8.0
    place = start[:2] + far * np.array([-0.8, 0.6])
    simulation.submit(Appoint([one]))
    simulation.submit(Steer([one], *place.tolist(), kind="place"))
    simulation.run(2)
    for _ in range(32 * 40):
        simulation.tick()
        assert np.linalg.norm(agents[Velocity.xyz][row]) <= can.speed * 1.001
        if agents[Leading.kind][row] == 0:
            break
    slowest, length = can.slowest if model in AIR else 0.0, agents[Body.length][row]
    within = max(length, 1.3 * slowest**2 / can.acceleration)  # it could go round in a narrower circle for ever
    assert np.hypot(*(xyz[row, :2] - place)) <= within + 1e-6
    assert abs(xyz[row, 2] - start[2]) < 2.0
    there = xyz[row].copy()
    simulation.submit(Steer([one], 0.0, -1.0))
    simulation.run(32 * 5)
    assert agents[Heading.forward][row, 1] < -0.95
    way = xyz[row] - there
    assert way[1] < -0.9 * np.linalg.norm(way) < -4.0
    assert agents[Urge.share][row] == pytest.approx(1.0)
    assert set(explain(world, one).shares) == {"steered"}
    simulation.submit(Steer([one], 0.0, 0.0))
    simulation.run(32 * 5)
    assert agents[Speed.target][row] == pytest.approx(slowest, abs=0.05)  # others may shove who stands
    assert model not in AIR or np.linalg.norm(agents[Velocity.xyz][row]) == pytest.approx(slowest, abs=0.05)
    simulation.submit(Steer([one], kind="free"))
    simulation.run(2)
    assert "steered" not in explain(world, one).shares
    assert agents[Leading.appointed][row] == 1


@pytest.mark.parametrize("model", sorted(behaviours()))
def test_the_reasons_of_a_steered_animal_add_up_to_its_wish(model):
    """While it turns, and while it flees with a part of its body."""
    simulation, ids = held(model)
    agents, one = simulation.agents, int(ids[4])
    simulation.run(4)
    simulation.submit(Appoint([one]))
    simulation.submit(Steer([one], -0.6, 0.8))
    simulation.run(2)
    row, names = agents.row(one), set()
    for tick in range(12):
        if tick == 6:
            agents[Alarm.level][row], agents[Alarm.place][row] = 0.5, agents[Position.xyz][row] + (0.0, 9.0, 0.0)
        told = explain(simulation.world, one)
        simulation.tick()
        wish = agents[Wish.direction][row]
        if model in AIR and agents[Thrust.kind][row] == BY_VELOCITY:
            wish = agents[Thrust.velocity][row] / np.linalg.norm(agents[Thrust.velocity][row])
        total = sum(vector for _, vector in told.reasons)
        assert total / np.linalg.norm(total) == pytest.approx(wish, abs=1e-7), told.reasons
        assert sum(told.shares.values()) == pytest.approx(1.0)
        names |= set(told.shares)
    assert names == {"steered", "flee"}


def test_what_keeps_a_body_whole_stands_above_steering():
    """A steered sheep runs from a wolf; a steered starling passes a pillar."""
    simulation = meadow(small_brush("walk"), small_brush("stand", mean=0.0))
    (sheep,) = put(simulation, [(20, 20)], species="sheep")
    put(simulation, [(28, 20)], species="wolf", brush="stand")
    simulation.submit(Appoint([int(sheep)]))
    simulation.submit(Steer([int(sheep)], 1.0, 0.0))
    simulation.run(64)
    assert simulation.agents[Position.xyz][0, 0] < 20.0
    assert explain(simulation.world, int(sheep)).shares["flee"] > 0.5
    sky = meadow(boids(min_speed=5.0), width=200.0, height=80.0, obstacles=[obstacle(square(58, 38, 62, 42))])
    (bird,) = put_aloft(sky, [(20.0, 40.0, 10.0)], species="starling")
    sky.submit(Appoint([int(bird)]))
    sky.submit(Steer([int(bird)], 180.0, 40.0, kind="place"))
    gap = []
    for _ in range(32 * 30):
        sky.tick()
        gap.append(np.abs(sky.agents[Position.xyz][0, :2] - (60.0, 40.0)).max() - 2.0)
        if sky.agents[Leading.kind][0] == 0:
            break
    assert sky.agents[Leading.kind][0] == 0
    assert min(gap) > 0.15


def test_an_appointed_bird_leads_its_formation_and_the_others_follow_it():
    geese = small_brush("geese", "line_formation", mean=18.0, body={"length": 0.8, "radius": 0.16},
                        vision={"range": 120.0, "field_of_view": 360.0, "occlusion": False})  # fmt: skip
    simulation = meadow(geese, width=1000.0, height=1000.0)
    spots = [(200.0 - 3.0 * abs(k), 500.0 + 3.0 * k, 20.0) for k in range(-3, 4)]
    ids = put_aloft(simulation, spots, species="goose")
    simulation.run(64)
    agents, one = simulation.agents, int(ids[6])
    assert agents[FormationPlace.place][agents.row(one)] > 0
    simulation.submit(Appoint([one]))
    simulation.submit(Steer([one], 0.6, 0.8))
    simulation.run(32 * 30)
    assert agents[FormationPlace.place].argmin() == agents.row(one)
    assert agents[Role.leader].tolist() == [0] * 6 + [1]
    assert (agents[Heading.forward][:, :2] @ (0.6, 0.8) > 0.99).all()


def test_steering_a_boid_is_undone_redone_and_replayed(tmp_path):
    simulation = start("pillars", agents=12)
    world, one = simulation.world, [int(simulation.agents.ids[3])]
    recorder = record(tmp_path / "run.flock", simulation, keyframes=40)
    for tick in range(160):
        if tick == 20:
            before, perform = state_hash(world), world.resource(Commands).perform
            undo = perform(world, [Appoint(one), Steer(one, 0.0, 1.0)])
            sent = state_hash(world)
            redo = perform(world, undo)
            assert state_hash(world) == before
            undo = perform(world, redo)
            assert state_hash(world) == sent
        elif tick == 100:
            assert simulation.agents[Heading.forward][3, 1] > 0.99
            perform(world, undo)
        simulation.tick()
        recorder.take()
    recorder.close()
    assert not world.agents[Leading.kind].any()
    simulation.close()
    run = open_recording(tmp_path / "run.flock")
    again = rebuild(run)
    assert first_difference(run, again.world, again.tick) is None
    again.close()


def test_steering_a_boid_in_a_branch_leaves_the_run_as_it_was():
    level, library = open_level("pillars")
    timeline = Timeline(Beginning(level, library, agents=12), "run")
    one = [int(timeline.simulation.agents.ids[3])]
    for tick in range(60):
        if tick == 10:
            timeline.perform([Appoint(one), Steer(one, 0.0, 1.0)])
        timeline.step()
    last = state_hash(timeline.simulation.world)
    timeline.go_to(30)
    timeline.fork("other")
    timeline.perform([Steer(one, 0.0, -1.0)])
    for _ in range(60):
        timeline.step()
    assert timeline.simulation.agents[Heading.forward][3, 1] < 0.0
    timeline.switch("run")
    timeline.go_to(60)
    assert state_hash(timeline.simulation.world) == last
    timeline.close()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (Appoint([999]), "there is no animal 999"),
        (Steer([7], 1.0, 0.0), "animal 7 is not appointed; give Appoint first"),
        (Steer([7], 2.0, 0.0), "a direction is at most 1 long"),
        (Steer([7], kind="north"), "kind must be one of direction, free, place"),
    ],
)
def test_what_cannot_be_done_is_refused_in_words(command, words):
    simulation = packed()
    with pytest.raises((ValueError, CommandError, LookupError)) as refusal:
        command.check(simulation.world)
    assert all(word in str(refusal.value) for word in words.split()[:3])


def test_appointing_and_steering_are_undone_and_come_back_with_a_snapshot():
    simulation = packed()
    simulation.run(3)
    world = simulation.world
    before = state_hash(world)
    undo = world.resource(Commands).perform(world, [Appoint([7])])
    Steer([7], 1.0, 0.0).apply(world)
    changed, kept = state_hash(world), snapshot(world)
    assert changed != before
    for command in undo:
        command.apply(world)
    assert state_hash(world) == before
    restore(world, kept)
    assert state_hash(world) == changed


def test_without_a_guide_the_ants_do_what_the_brush_they_come_from_does():
    """So the bands that were measured for the one hold for the other."""
    places = []
    for name in ("ants-swarm", "swarm"):
        simulation = plane(shipped().get(name), 60, seed=3)
        simulation.run(64)
        places.append(simulation.agents[Position.xyz].tolist())
    assert places[0] == places[1]


@pytest.mark.parametrize("model", ["herd", "zones", "boids"])
def test_who_is_sent_behind_a_wall_walks_round_it(model):
    scene = meadow(small_brush("walker", model, mean=1.0), obstacles=[obstacle(square(19, 17, 21, 23))])
    (leader,) = put(scene, [(8, 20)])
    scene.submit(Appoint([int(leader)]))
    scene.submit(Steer([int(leader)], 34.0, 20.0, "place"))
    ways = []
    for _ in range(40):
        scene.run(32)
        ways.append(scene.agents[Position.xyz][scene.agents.row(int(leader)), :2].copy())
    assert np.hypot(*(np.array(ways) - (34.0, 20.0)).T).min() < 1.5
