"""What every animal has."""

import ast
from pathlib import Path

import flockbrush.components.agent
import numpy as np
import pytest
from flockbrush.components.agent import AGENT, Heading, Position
from flockbrush.engine.world import World


@pytest.fixture(scope="module")
def flock():
    world = World(AGENT)
    world.create_agents(3, {Position.xyz: np.arange(9.0).reshape(3, 3)})
    return world


@pytest.mark.parametrize("kind", AGENT, ids=lambda kind: kind.__name__)
def test_every_animal_has_it_and_every_write_is_seen_by_kernels(flock, kind):
    window = flock.component_for_entity(2, kind)
    for name, field in kind.fields.items():
        fresh = np.ones_like(field.default) + (field.default == 1)
        setattr(window, name, fresh)
        assert np.array_equal(flock.agents[field][1], fresh)
        assert np.array_equal(getattr(window, name), fresh)
        assert np.array_equal(flock.component_for_entity(3, kind).fields[name].default, field.default)


@pytest.mark.parametrize("kind", AGENT, ids=lambda kind: kind.__name__)
def test_it_says_what_it_is(kind):
    assert kind.__doc__ and kind.__doc__.strip()[0].isupper()
    assert kind.fields


def test_names_are_given_once():
    assert len({kind.__name__ for kind in AGENT}) == len(AGENT)


def test_all_kinds_of_the_room_belong_to_an_animal():
    files = Path(flockbrush.components.agent.__file__).parent.glob("*.py")
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in files]
    kinds = {
        n.name
        for tree in trees
        for n in tree.body
        if isinstance(n, ast.ClassDef) and "Component" in [ast.unparse(b) for b in n.bases]
    }
    assert kinds == {kind.__name__ for kind in AGENT}


def test_a_fresh_animal_looks_along_a_unit_vector():
    assert np.linalg.norm(Heading().forward) == 1
    assert np.isfinite(Position().xyz).all()
