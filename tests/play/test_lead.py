"""An animal is led with the mouse and with keys."""

import numpy as np
import pytest
from flockbrush.components import Leading, Position
from flockbrush.components.agent import DIRECTION, NOWHERE, POINT
from flockbrush.engine.state import state_hash
from flockbrush.systems.edits import PlaceExit
from small_pasture import pasture
from window import Window, pygame


@pytest.fixture
def window(tmp_path, in_own_folder):
    """A window on a pasture with the tool in hand and one sheep chosen; time stands still."""
    window = Window(pasture(tmp_path, script=False))
    window.key("l")
    window.click(window.agents[Position.xyz][0, :2])
    yield window
    assert window.said("error") == []
    window.close()


def hold(window, key):
    window.post(pygame.KEYDOWN, key=pygame.key.key_code(key), mod=0, unicode=key if len(key) == 1 else "")


def let_go(window, key):
    window.post(pygame.KEYUP, key=pygame.key.key_code(key), mod=0, unicode="")


def led(window):
    agents = window.agents
    return int(agents[Leading.kind][0]), agents[Leading.target][0].round(3).tolist()


def test_an_animal_goes_where_the_mouse_is_held_and_is_free_when_it_is_let_go(window):
    assert window.selected == int(window.agents.ids[0])
    window.press((12, 4))
    assert led(window)[0] == POINT and led(window)[1] == pytest.approx([12, 4], abs=0.1)
    assert window.agents[Leading.appointed].tolist() == [1] + [0] * 8
    for k in range(40):  # commands only where it has gone a way
        window.move((12 + 0.02 * k, 4))
    window.move((16, 6))
    assert led(window)[1] == pytest.approx([16, 6], abs=0.1)
    start = window.standing()[0]
    window.session.play()
    window.frames(32)
    window.session.pause()
    assert np.hypot(*(window.standing()[0] - (16, 6))) < np.hypot(*(start - (16, 6)))
    window.release((16, 6))
    assert led(window) == (NOWHERE, [0.0, 0.0])


def test_keys_steer_and_belong_to_the_tool_while_it_is_in_hand(window):
    hold(window, "w")
    assert led(window) == (DIRECTION, [0.0, 1.0]) and window.tool.name == "lead"
    hold(window, "right")
    assert led(window)[1] == pytest.approx([0.707, 0.707], abs=1e-3)
    let_go(window, "w")
    assert led(window)[1] == [1.0, 0.0]
    let_go(window, "right")
    assert led(window) == (NOWHERE, [0.0, 0.0])
    hold(window, "a")
    window.post(pygame.WINDOWFOCUSLOST)
    assert led(window)[0] == NOWHERE
    window.key("v")
    window.key("w")
    assert window.tool.name == "predator"


def test_one_hold_is_one_step_of_undo_and_replays_the_same_bits(window):
    before = state_hash(window.session.simulation.world)
    hold(window, "d")
    hold(window, "s")
    let_go(window, "d")
    let_go(window, "s")
    window.key("ctrl+z")
    assert state_hash(window.session.simulation.world) == before
    hold(window, "d")
    window.session.play()
    window.frames(24)
    let_go(window, "d")
    window.frames(8)
    window.session.pause()
    tick, there = window.session.tick, state_hash(window.session.simulation.world)
    window.session.scrub(2)
    window.session.scrub(tick)
    assert state_hash(window.session.simulation.world) == there


@pytest.mark.parametrize("by", ["mouse", "keys"])
def test_an_animal_that_is_led_out_of_the_world_is_let_go(window, by):
    window.do("exit", [PlaceExit(window.new_id(), "gate", [[0.0, 0.0], [24.0, 0.0], [24.0, 16.0], [0.0, 16.0]])])
    if by == "mouse":
        window.press((12, 4))
    else:
        hold(window, "d")
        hold(window, "s")
    window.session.step(2)
    assert not len(window.agents)
    for x in (14, 16):
        window.move((x, 8))
    let_go(window, "s")
    let_go(window, "d")
    window.release((16, 8))
    assert window.said() == ["no animal is led: click an animal first"] * (by == "mouse")
    assert window.tool.place is None and not window.tool.held


def test_without_an_animal_it_says_what_to_do(window):
    window.select(None)
    window.press((20, 2))
    hold(window, "w")
    assert (window.agents[Leading.kind] == NOWHERE).all()
    assert any("click an animal first" in text for text in window.said("info"))


@pytest.mark.parametrize("key", ["a", "s", "w"])
def test_letters_that_steer_take_no_other_tool_when_nobody_is_led(window, key):
    window.select(None)
    hold(window, key)
    assert window.tool.name == "lead" and "click an animal first" in window.said()[-1]
