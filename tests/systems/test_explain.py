"""Why an animal turns: the reasons given are those it acts on, and asking changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as behaviour_module
from flockbrush.behaviours.behaviour import Wishes, behaviours
from flockbrush.behaviours.drive import drives
from flockbrush.components import Role, Thrust, Wish
from flockbrush.components.agent import BY_VELOCITY
from flockbrush.engine.state import state_hash
from flockbrush.levels.schema import BrushLayer, Guide, Zone
from flockbrush.systems.explain import explain
from small_herd import box, brush, meadow, obstacle, put, put_aloft, spawn

from flockbrush.runs.run import start
from tests.behaviours.test_models import lively


def pushed(reasons):
    """The direction in which reasons add up."""
    total = sum(vector[:2] for _, vector in reasons)
    return total / np.hypot(*total)


def wished(agents, animal):
    """The direction in which an animal wishes to go, in space."""
    row = agents.row(animal)
    if agents[Thrust.kind][row] == BY_VELOCITY:
        return agents[Thrust.velocity][row] / np.linalg.norm(agents[Thrust.velocity][row])
    return agents[Wish.direction][row]


EXPLAINED = [model for model in behaviours().values() if model.explain is not None]
MODELS = ["herd", "flee", "hunt", "boids", "raptor", "v_rules", "line_formation", "zones", "morse", "force_map"]


ASKED = [
    pytest.param(model, more, id=f"{model.name}-{more}")
    for model in EXPLAINED
    for more in (
        {},
        {"wander": 2.0},
        {"wander": 2.0, "wander_time": 0.5},
        {"unled": "keep"},
        {"leader_blend": 0.4},
        {"turn_bias": 1.0},
    )
    if more.keys() <= model.Params.model_fields.keys()
]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("model", "more"), ASKED)
def test_the_reasons_add_up_to_the_wish(model, more, seed):
    scene, params = lively(seed), model.Params(**more)
    for row in range(len(scene.ids)):
        rows = np.flatnonzero(scene.species == scene.species[row]).astype(np.int32)  # the V rules ask a flock at once
        wishes, at = model.steer(scene, rows, params), int(np.flatnonzero(rows == row)[0])
        reasons = model.explain(scene, row, params)
        wish = wishes.direction[at, :2] if wishes.velocity is None else wishes.velocity[at, :2]
        wish = wish / np.hypot(*wish)
        assert pushed(reasons.items()) == pytest.approx(wish, abs=1e-9), (row, reasons)


def valley(seed=3):
    """Reindeer, a few wolves, a rock, a guide and a painted corner."""
    deer, wolf = brush("deer", "flee", mean=1.0, wander=0.3), brush("wolf", "hunt", mean=2.0)
    other = brush("other", mean=2.0, transition=2.0)
    painted = np.full((40, 40), -1)
    painted[:18, 18:] = 0  # the wolves stay what they are
    return meadow(
        deer, wolf, other, seed=seed, boundary="wrap",
        brush_layers=[BrushLayer("brush", 1.0, ["other"], painted)],
        obstacles=[obstacle(box(12, 12, 15, 15))],
        guides=[Guide(1, "way", np.array([(2.0, 5.0), (30.0, 30.0)]), 1.0, 8.0, 8.0, "", False)],
        zones=[Zone(2, "corner", box(0, 30, 10, 40), None, 0.5, 1.0, 0.5)],
        spawns=[
            spawn(box(5, 5, 25, 25), "deer", 60, heading=None, species="deer", id=1),
            spawn(box(19, 19, 25, 25), "wolf", 4, heading=None, species="wolf", id=2),
        ],
    )  # fmt: skip


def test_what_is_explained_is_what_the_animal_does_next():
    simulation = valley()
    simulation.run(20)
    told = [explain(simulation.world, entity) for entity in simulation.agents.ids.tolist()]
    simulation.tick()
    agents = simulation.agents
    assert np.array_equal([e.entity for e in told], agents.ids)
    assert np.array([e.result for e in told]) == pytest.approx(agents[Wish.direction][:, :2], abs=1e-9)
    assert np.array([e.pace for e in told]) == pytest.approx(agents[Wish.pace], abs=1e-9)
    assert np.array_equal([e.leader for e in told], agents[Role.leader].astype(bool))
    assert np.array([pushed(e.terms) for e in told]) == pytest.approx(agents[Wish.direction][:, :2], abs=1e-9)
    names = {name for e in told for name, _ in e.terms}
    assert {"heading", "cohesion", "avoidance", "alignment", "obstacles", "fear", "guide", "wander"} <= names
    assert any(e.previous for e in told)  # some are just taking up another brush


@pytest.mark.parametrize("more", [{}, {"arbitration": "average"}, {"avoid": "field"}], ids=str)
def test_a_bird_in_the_air_turns_for_the_reasons_it_is_said_to_have(more):
    """Between a pillar and a falcon, with a place to go to: every urge has a say."""
    birds = brush("birds", "boids", mean=40.0, body={"length": 0.2, "radius": 0.04}, **more)
    falcon = brush("falcon", "raptor", mean=60.0, body={"length": 0.4, "radius": 0.08})
    simulation = meadow(
        birds, falcon, boundary="open", obstacles=[obstacle(box(19, 17, 21, 23))],
        spawns=[
            spawn(box(4, 12, 16, 28), "birds", 24, heading=0.0, species="bird", id=1, altitude=6.0),
            spawn(box(8, 18, 9, 22), "falcon", 1, heading=0.0, species="falcon", id=2, altitude=6.0),
        ],
    )  # fmt: skip
    names = set()
    for _ in range(4):
        simulation.run(4)
        told = [explain(simulation.world, entity) for entity in simulation.agents.ids.tolist()]
        simulation.tick()
        wish = simulation.agents[Wish.direction][:, :2]
        for one, way in zip(told, wish / np.hypot(*wish.T)[:, None], strict=True):
            assert pushed(one.terms) == pytest.approx(way, abs=1e-9)
        names |= {name for one in told for name, _ in one.terms}
    assert {"heading", "avoidance", "cohesion", "alignment", "obstacles", "fear"} <= names


def test_asking_changes_nothing():
    simulation, other = valley(), valley()
    simulation.run(10), other.run(10)
    for entity in simulation.agents.ids.tolist():
        explain(simulation.world, entity)
    assert state_hash(simulation.world) == state_hash(other.world)
    simulation.tick(), other.tick()
    assert state_hash(simulation.world) == state_hash(other.world)


def test_a_follower_tells_whom_it_sees_and_by_whom_it_keeps_its_place():
    simulation = meadow(brush(leader_neighbours=0))
    me, ahead, behind, far = put(simulation, [(10, 10), (12, 10), (8.5, 10), (30, 10)])
    told = explain(simulation.world, me)
    assert sorted(told.sees) == [ahead, behind]
    assert told.reference == ahead
    assert not told.leader
    assert dict(zip(told.sees, told.offsets.tolist(), strict=True))[ahead] == pytest.approx([2, 0])
    assert told.numbers["body length"] == (1.0, "m")
    assert explain(simulation.world, far).leader


def test_an_animal_beside_a_wall_is_pushed_off_it():
    simulation = meadow(brush(obstacle_weight=1.0), obstacles=[obstacle(box(0, 12, 40, 13))])
    (me,) = put(simulation, [(10, 11)])
    terms = dict(explain(simulation.world, me).terms)
    assert terms["obstacles"][1] < 0 and abs(terms["obstacles"][0]) < 1e-9
    assert len(explain(simulation.world, me).obstacles) == 1


def test_across_the_seam_neighbours_are_near():
    simulation = meadow(brush(), boundary="wrap")
    me, other = put(simulation, [(0.5, 20), (39.0, 20)])
    assert explain(simulation.world, me).offsets == pytest.approx(np.array([[-1.5, 0]]))
    assert explain(simulation.world, me).sees == [other]


def test_a_model_that_does_not_explain_itself_is_shown_without_reasons(monkeypatch):
    from flockbrush.behaviours import behaviour as registry

    behaviours()
    monkeypatch.setitem(registry._registry, "turner", None)
    monkeypatch.delitem(registry._registry, "turner")

    def steer(scene, rows, params):
        return Wishes(np.tile([0.0, 1.0, 0.0], (len(rows), 1)), np.ones(len(rows)))

    registry.behaviour("turner", registry.Parameters)(steer)
    try:
        simulation = meadow(brush(model="turner"))
        (me,) = put(simulation, [(10, 10)])
        told = explain(simulation.world, me)
        assert [name for name, _ in told.terms] == ["heading", "turner"]
        assert pushed(told.terms) == pytest.approx([0, 1])
        assert told.result == pytest.approx([0, 1]) and told.turn == pytest.approx(np.pi / 2)
    finally:
        registry._registry.pop("turner")


def test_who_is_dead_explains_nothing():
    with pytest.raises(KeyError, match="not alive"):
        explain(meadow(brush()).world, 7)


def test_every_shipped_model_explains_itself():
    assert {model.name for model in EXPLAINED} >= set(MODELS)


@pytest.mark.parametrize("model", [*MODELS, "sunward"])
def test_reasons_of_models_and_drives_together_add_up_to_the_wish_in_every_medium(model, monkeypatch):
    """A danger near by, a wall, a drive that asks for a share: terms of the model and drives are told together."""
    flies = model in behaviours() and behaviours()[model].flight is not None
    if model == "sunward":  # somebody else's, who does not explain it
        monkeypatch.setitem(behaviour_module._registry, model, replace(behaviours()["herd"], name=model, explain=None))
    more = {"mean": 20.0, "body": {"length": 0.8, "radius": 0.16, "contact": "disc"}} if flies else {"mean": 0.5}
    if model in ("boids", "raptor"):
        more["min_speed"] = 2.0
    asset = brush("one", model, **more)
    told = {"keep_group": drives()["keep_group"].Params(distance=0.1, strength=0.4), "flee": drives()["flee"].Params()}
    asset = asset.model_copy(update={"drives": told})
    simulation = meadow(asset, brush("stand", mean=0.0), obstacles=[obstacle(box(30, 17, 31, 23))])
    place = put_aloft if flies else put
    prey, danger = ("goose", "falcon") if flies else ("sheep", "wolf")
    spots = [(18 + 2 * (k % 3), 16 + 2.5 * (k // 3), *((6.0 + 0.2 * k,) if flies else ())) for k in range(9)]
    place(simulation, spots, species=prey, brush="one")
    place(simulation, (34.0, 29.0, 6.0) if flies else (34.0, 25.0), species=danger, brush="stand")
    simulation.run(6)
    names, shares = set(), set()
    for _ in range(3):
        simulation.run(2)
        told = [explain(simulation.world, entity) for entity in simulation.agents.ids.tolist()[:9]]
        simulation.tick()
        agents = simulation.agents
        for one in told:
            wish = wished(agents, one.entity)
            assert one.wish == pytest.approx(wish, abs=1e-9)
            total = sum(vector for _, vector in one.reasons)
            assert total / np.linalg.norm(total) == pytest.approx(wish, abs=1e-7), one.reasons
            names |= {name for name, _ in one.reasons}
            shares |= set(one.shares)
    assert {"heading", "keep_group"} <= names
    assert "flee" in shares


def test_an_animal_in_a_program_says_its_state_and_why():
    from small_program import program, world

    text = "[state.calm]\n[state.run]\n[[trigger]]\nname = 'the alarm'\nto = 'run'\nwhen = { event = 'go' }"
    scene = world(program(text), [(0, 0), (3, 0)], ["sheep", "goat"])
    scene.event("go")
    scene.run(9)
    found = explain(scene.world, int(scene.agents.ids[0]))
    assert (found.program, found.state, found.why) == ("small", "run", "from calm: the alarm, for 0.3 s")
    assert explain(scene.world, int(scene.agents.ids[1])).state == ""


@pytest.mark.parametrize("level", ["river", "lake", "ridge"])  # ducks that swim, birds that land, sheep on slopes
def test_reasons_add_up_to_the_wish_in_shipped_scenes(level):
    simulation = start(level)
    for _ in range(3):
        simulation.run(64)
        told = [explain(simulation.world, entity) for entity in simulation.agents.ids.tolist()[::7]]
        simulation.tick()
        for one in told:
            wish, total = wished(simulation.agents, one.entity), sum(vector for _, vector in one.reasons)
            assert one.wish == pytest.approx(wish, abs=1e-9)
            assert total / np.linalg.norm(total) == pytest.approx(wish, abs=1e-7), one.reasons
