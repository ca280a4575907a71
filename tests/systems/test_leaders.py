"""Who follows a guide, and leaders that are appointed and steered."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.components import Ground, Heading, Leading, Position, Role
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.recording import state_hash
from flockbrush.engine.state import restore, snapshot
from flockbrush.levels.build import plane
from flockbrush.systems.leaders import Appoint, Steer, lead_by_brush, steer_leaders
from flockbrush.systems.undo import rows_of


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
        lead_by_brush(simulation.world)
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


def test_a_direction_takes_the_place_of_the_guide_for_steered_animals_alone():
    simulation = packed()
    simulation.submit(Appoint([7]))
    simulation.submit(Steer([7], 0.0, -1.0))
    simulation.run(1)
    agents = simulation.agents
    agents[Ground.guidance][:] = (1.0, 0.0)
    steer_leaders(agents)
    row = rows_of(simulation.world, [7])[0]
    assert agents[Ground.guidance][row].tolist() == [0.0, -1.0]
    others = np.delete(agents[Ground.guidance], row, axis=0)
    assert (others == (1.0, 0.0)).all()


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
