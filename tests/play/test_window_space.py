"""The playground's view in space: going round, picking who flies, painting through it, and what stays as it was."""

import numpy as np
import pygame
import pytest
from flockbrush.components import Position
from flockbrush.systems.landscape import Landscape
from window import Window

from flockbrush.render.orbit import OrbitCamera
from flockbrush.render.view_camera import ViewCamera


@pytest.fixture
def flock(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    window = Window("pillars", size=(800, 560))
    window.session.play()
    window.frames(8)
    window.session.pause()
    window.key("t")  # it opens in space and goes with the flock; here it stays
    window.frames(2)
    assert window.canvas.in_space and not window.canvas.follows
    yield window
    window.close()


def over(window, row):
    """Where in the window an animal is drawn."""
    herd = window.canvas.herd
    at, _ = window.canvas.camera.project(np.column_stack([herd.xy, herd.z])[row : row + 1])
    return tuple(int(v) for v in at[0] + window.canvas.rect.topleft)


def middle(camera):
    """What of the ground a camera looks at, m."""
    return camera.target[:2] if isinstance(camera, OrbitCamera) else camera.centre


def loose(window):
    """Row of an animal that no other one is near, in the picture."""
    herd = window.canvas.herd
    at, _ = window.canvas.camera.project(np.column_stack([herd.xy, herd.z]))
    away = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) + 1e9 * np.eye(len(at))
    return int(np.argmax(away.min(axis=1)))


def test_a_key_and_a_button_look_from_the_plan_into_space_and_back(window):
    before = window.canvas.camera
    window.key("3")
    assert window.canvas.in_space and isinstance(window.canvas.camera, OrbitCamera)
    window.push(window.top.buttons["space"])
    assert not window.canvas.in_space and window.canvas.camera == before
    window.column.show_titled("View")
    window.frames(2)
    panel = next(panel for panel in window.panels if panel.title == "View")
    window.push(panel.camera["space"])
    window.frames(2)
    assert window.canvas.in_space and panel.camera["space"].is_checked


def test_the_first_look_shows_the_whole_herd(flock):
    herd = flock.canvas.herd
    at, depth = flock.canvas.camera.project(np.column_stack([herd.xy, herd.z]))
    assert (depth > 0).all() and (at > 0).all() and (at < flock.canvas.rect.size).all()


def test_the_middle_button_goes_round_and_with_shift_it_drags(window, monkeypatch):
    window.key("3")
    window.key("home")
    before, sheep = window.canvas.camera, window.standing()
    window.press((12, 8), button=2)
    window.move((12, 8), rel=(40, 10))
    window.release((12, 8), button=2)
    turned = window.canvas.camera
    assert turned.azimuth != before.azimuth and turned.elevation > before.elevation
    assert turned.target == before.target and turned.distance == before.distance
    monkeypatch.setattr(pygame.key, "get_mods", lambda: pygame.KMOD_LSHIFT)
    window.press((12, 8), button=2)
    window.move((12, 8), rel=(40, 0))
    window.release((12, 8), button=2)
    assert window.canvas.camera.azimuth == turned.azimuth and window.canvas.camera.target != turned.target
    assert np.array_equal(window.standing(), sheep)


def test_alt_and_the_left_button_go_round_and_paint_nothing(window, monkeypatch):
    window.key("3")
    window.key("home")
    azimuth = window.canvas.camera.azimuth
    monkeypatch.setattr(pygame.key, "get_mods", lambda: pygame.KMOD_LALT)
    window.press((12, 8))
    window.move((12, 8), rel=(40, 0))
    window.release((12, 8))
    assert window.canvas.camera.azimuth != azimuth and window.painted((12, 8)) is None


def test_the_wheel_comes_nearer(window):
    window.key("3")
    distance = window.canvas.camera.distance
    window.canvas.zoom(1.2, window.at((12, 8)))
    assert window.canvas.camera.distance == pytest.approx(distance / 1.2)


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_a_stroke_in_space_paints_the_ground_under_the_mouse(window, turn):
    window.key("3")
    window.canvas.fit()
    window.canvas.look(window.canvas.camera.turned(turn, 0.2))
    window.choose("brush", "graze")
    window.drag((10, 6), (13, 6))
    window.frames(4)
    assert window.painted((11.5, 6)) == "graze" and window.painted((11.5, 12)) is None
    window.undo()
    window.frames(3)
    assert window.painted((11.5, 6)) is None


def test_every_tool_shows_its_cursor_in_space(window):
    window.key("3")
    for tool in list(window.tools):
        window.take_tool(tool)
        for xy in ((12, 8), (15, 5)):
            window.post(pygame.MOUSEMOTION, pos=window.at(xy), rel=(0, 0), buttons=(0, 0, 0))
    above = window.canvas.rect.midtop
    window.post(pygame.MOUSEMOTION, pos=(above[0], above[1] + 2), rel=(0, 0), buttons=(0, 0, 0))
    window.drag((12, 8), (15, 5))
    window.frames(2)
    assert not window.said("error")


def test_a_click_on_a_bird_in_the_air_selects_it_and_it_is_marked(flock):
    row = loose(flock)
    flock.take_tool("select")
    position = over(flock, row)
    bare = flock.canvas.frame.copy()
    flock.post(pygame.MOUSEBUTTONDOWN, pos=position, button=1)
    flock.post(pygame.MOUSEBUTTONUP, pos=position, button=1)
    assert flock.selected == flock.canvas.herd.ids[row]
    flock.frames(2)
    x, y = position[0] - flock.canvas.rect.left, position[1] - flock.canvas.rect.top
    assert (flock.canvas.frame[y - 12 : y + 12, x - 12 : x + 12] != bare[y - 12 : y + 12, x - 12 : x + 12]).any()


def test_the_mouse_over_a_bird_says_who_it_is_and_how_high(flock):
    row = loose(flock)
    flock.post(pygame.MOUSEMOTION, pos=over(flock, row), rel=(0, 0), buttons=(0, 0, 0))
    herd = flock.canvas.herd
    assert flock._under_mouse() == f"starlings {herd.ids[row]}   {herd.z[row]:.1f} m up"


def test_a_herd_on_a_mountain_is_not_taken_to_fly_and_followed_on_the_flat_ground(window):
    simulation = window.session.simulation
    simulation.world.resource(Landscape).relief[..., 0] += 40.0
    simulation.agents[Position.xyz][:, 2] += 40.0
    window.session.step()
    window.frames(2)
    assert window.session.view().xyz[:, 2] == pytest.approx(40.0, abs=0.2) and not window.canvas.herd.z.any()
    window.canvas.show_flyers()
    assert not window.canvas.in_space
    window.canvas.toggle_space()
    window.key("t")
    window.frames(2)
    assert window.canvas.follows and window.canvas.camera.target[2] < 2.0


def test_the_view_follows_the_herd_in_space_and_on_the_plan(flock):
    flock.key("t")
    flock.session.play()
    for kind in (OrbitCamera, ViewCamera):
        flock.frames(4)
        assert isinstance(flock.canvas.camera, kind)
        place, camera = np.median(flock.canvas.herd.xy, axis=0), flock.canvas.camera
        flock.frames(24)
        now = np.median(flock.canvas.herd.xy, axis=0)
        moved = np.subtract(middle(flock.canvas.camera), middle(camera))
        near = 0.2 if kind is OrbitCamera else 1.0 / flock.canvas.camera.scale  # the plan goes by whole pixels
        assert np.hypot(*(now - place)) > 1 and np.allclose(moved, now - place, atol=near)
        flock.key("3")


def test_home_shows_the_whole_map_and_z_the_herd(flock):
    flock.key("home")
    level = flock.session.level
    corners = [(x, y) for x in (0, level.width) for y in (0, level.height)]
    at = flock.canvas.camera.pixels(corners)
    assert (at >= -1).all() and (at <= np.array(flock.canvas.rect.size) + 1).all()
    far = flock.canvas.camera.distance
    flock.key("z")
    assert flock.canvas.camera.distance < far / 3


def test_pause_scrubbing_size_theme_and_restart_keep_the_camera(window):
    window.session.play()
    window.frames(20)
    window.key("3")
    camera = window.canvas.camera.turned(0.4, 0.1)
    window.canvas.look(camera)
    window.scrub(4)
    window.frames(20)
    window.resize((900, 600))
    window.toggle_theme()
    window.frames(2)
    window.key("ctrl+r")
    window.frames(3)
    now = window.canvas.camera
    assert (now.azimuth, now.elevation, now.target) == (camera.azimuth, camera.elevation, camera.target)
    assert window.canvas.frame.shape[1::-1] == now.size == window.canvas.rect.size and not window.said("error")


def test_overlays_are_laid_on_the_ground_in_space(window):
    window.step(4)  # who sees whom is known after a tick
    window.key("3")
    window.overlays = set()
    while not window.canvas.painter.refine():
        pass
    window.frames(2)
    bare = window.canvas.frame.copy()
    for name in ("density", "navigation", "links"):
        window.overlays = {name}
        window.frames(6)
        assert (window.canvas.frame != bare).any(), name
    window.overlays = set()
    window.frames(6)
    assert np.array_equal(window.canvas.frame, bare) and not window.said("error")


def test_a_film_and_a_picture_are_made_of_what_is_seen(window, tmp_path):
    window.key("3")
    window.key("f9")
    window.session.play()
    window.frames(12, dt=1 / 15)
    window.key("f9")
    window.frames(2)
    films = list(tmp_path.rglob("*.mp4"))
    assert len(films) == 1 and films[0].stat().st_size > 1000


def test_drawing_in_space_does_not_touch_the_world(tmp_path, monkeypatch):
    from flockbrush.engine.state import state_hash

    hashes = []
    for space in (False, True):
        window = Window("elephants", size=(700, 520))
        if space:
            window.key("3")
        window.session.pause()
        window.step(12)
        window.frames(3)
        hashes.append(state_hash(window.session.simulation.world))
        window.close()
    assert hashes[0] == hashes[1]
