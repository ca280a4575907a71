"""One animal: who it is, what it sees, and what turns it."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.components import Heading, Role, Velocity
from flockbrush.systems.commands import RemoveAnimals, SwitchBrush
from flockbrush.systems.explain import explain
from flockbrush.systems.senses import SightInSpace
from small_pasture import pasture
from small_window import SmallWindow

from flockbrush.render.body_meshes import attitude_of
from flockbrush.studio.panels.animal import AnimalPanel, attitude, compass, facts_of, pulls_of, row_of, turning
from flockbrush.studio.session import Session


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("watched"))


@pytest.fixture
def window(level):
    made = SmallWindow(level, AnimalPanel)
    made.session.step(24)
    yield made
    made.close()


def select(window, row=0):
    window.selected = int(window.session.simulation.agents.ids[row])
    window.wait()
    return window.selected


def test_nobody_is_selected_at_first_and_the_panel_says_what_to_do(window):
    assert window.panel.pictures.keys() == {"nobody"}
    assert "Select tool" in window.panel.pictures["nobody"].said[0][1]


def test_the_panel_shows_the_selected_animal(window):
    empty = window.picture().copy()
    select(window)
    assert window.panel.pictures.keys() == {"facts", "pulls"}
    assert (window.picture() != empty).any()


def test_the_facts_are_those_of_the_world(window):
    agents, row = window.session.simulation.agents, 3
    window.session.do("back", [SwitchBrush("march")])
    window.session.step(4)
    facts = dict(facts_of(window.session, row))
    assert facts["speed"].startswith(f"{np.linalg.norm(agents[Velocity.xyz][row]):.2f} m/s")
    assert facts["role"] == ("leader" if agents[Role.leader][row] else "follower")
    assert facts["brush"].startswith("march, ") and facts["brush"].endswith(" % (from swarm)")
    x, y = agents[Heading.forward][row, :2]
    assert facts["heading"].endswith(compass(x, y))


def test_a_bird_tells_how_it_lies_in_the_air_and_whom_it_sees_there():
    session = Session.open("elephants")
    session.step(24)
    sparrow = 20
    facts = dict(facts_of(session, sparrow))
    lists = session.simulation.world.resource(SightInSpace).lists
    assert facts["visible neighbours"] == str(lists.first[sparrow + 1] - lists.first[sparrow]) != "0"
    assert "height" in facts["position"] and "ground" not in facts and "flies" in facts
    elephant = dict(facts_of(session, 0))
    assert "flies" not in elephant and elephant.get("reference bird") != "none"
    session.close()


@pytest.mark.parametrize(
    ("pitch", "bank", "words"),
    [
        (0, 0, "level"),
        (10, 0, "climbs 10°"),
        (-40, 30, "sinks 40°, banks 30° right"),
        (0, -5, "banks 5° left"),
    ],
)
def test_how_a_bird_lies_in_the_air_in_words(pitch, bank, words):
    forward, up = attitude_of([0.7], np.radians([pitch]), np.radians([bank]))
    assert attitude(forward[0], up[0]) == words


def test_what_each_force_adds_comes_to_the_turn(window):
    session = window.session
    session.step(64)  # the change of brush is over
    for row in range(len(session.simulation.agents)):
        entity, dt = int(session.simulation.agents.ids[row]), session.clock.dt
        found = explain(session.simulation.world, entity)
        pulls, total = pulls_of(found, dt), sum(v for _, v in found.terms)
        (fx, fy), size = found.forward, np.hypot(*total)
        assert sum(pulls.values()) == pytest.approx(np.degrees((fx * total[1] - fy * total[0]) / dt), abs=1e-6)
        assert np.sin(found.turn) * size == pytest.approx(np.radians(sum(pulls.values()) * dt), abs=1e-6)


def test_an_animal_that_is_gone_is_said_to_be_gone(window):
    entity = select(window)
    window.session.do("away", [RemoveAnimals(0.0, 0.0, 0.0)])
    window.wait()
    assert f"Animal {entity} does not exist any more." in window.panel.pictures["nobody"].said[0]


def test_the_buttons_lead_to_the_reference_bird_and_to_nobody(window):
    from flockbrush.components import ReferenceBird

    agents = window.session.simulation.agents
    row = int(np.flatnonzero(agents[ReferenceBird.entity] > 0)[0])
    bird = int(agents[ReferenceBird.entity][row])
    select(window, row)
    window.click(window.panel.buttons["reference"])
    assert window.selected == bird
    window.wait()
    window.click(window.panel.buttons["nobody"])
    assert window.selected is None
    assert window.panel.pictures.keys() == {"nobody"}


def test_rows_are_found_by_id(window):
    session = window.session
    ids = session.simulation.agents.ids
    assert [row_of(session, int(entity)) for entity in ids] == list(range(len(ids)))
    assert row_of(session, None) is row_of(session, 0) is row_of(session, 10**9) is None


def test_turns_in_words():
    assert turning(np.radians(40)) == "Sum: left, 40°/s"
    assert turning(np.radians(-40), np.radians(20)) == "Sum: right, 20°/s (maximum)"
    assert turning(0.0) == "Sum: keeps its heading"
    assert [compass(*v) for v in ((1, 0), (0, 1), (-1, -1), (1, -0.9))] == ["east", "north", "south-west", "south-east"]


def test_every_shipped_model_on_the_ground_tells_its_forces():
    assert [name for name, model in behaviours().items() if not model.flight and not model.explain] == []
