"""Herds on hills: the pictures have them at their height above the ground, which they show flat."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.systems.landscape import Landscape

from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import Painter, Scenery
from flockbrush.render.space_view import SpacePainter
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

SIZE = (320, 240)


def test_hills_are_drawn_flat_and_those_who_stand_on_them_stand_on_the_ground():
    simulation = start("predators-valley", seed=1)
    one, moment = SpacePainter(Scenery(simulation), SIZE, trails=None, words=False), moment_of(simulation)
    between_ticks = replace(moment, xyz=moment.xyz + (0.0, 0.0, 0.01))
    for herd in (herd_of(simulation, moment), herd_of(simulation, between_ticks)):
        one.look(one.around(herd))
        one.frame(herd)
        assert moment.xyz[:, 2].max() > 0.3 and not herd.z.any()
        assert not one._bodies.xyz[:, 2].any() and one._bodies.walks.all()
    aloft = herd_of(simulation, replace(moment, xyz=moment.xyz + (0.0, 0.0, 9.0)))
    assert aloft.z == pytest.approx(9.0)


def test_on_the_plan_the_shadow_of_an_animal_on_a_mountain_lies_beside_it():
    simulation = start("predators-valley", agents=20)
    simulation.world.resource(Landscape).relief[..., 0] += 40.0
    moment = moment_of(simulation)
    herd = herd_of(simulation, replace(moment, xyz=moment.xyz + (0.0, 0.0, 40.0)))
    one = Painter(Scenery(simulation), (600, 400), words=False, trails=None)
    rows, columns = np.nonzero(np.abs(one.frame(herd).astype(int) - one.ground).max(axis=2) > 12)
    away = np.hypot(*(one.camera.pixels(herd.xy)[:, None] - np.column_stack([columns, rows])).transpose(2, 0, 1))
    assert away.min(axis=0).max() < 2.0 * herd.length.max() * one.camera.scale


def test_the_camera_looks_as_high_at_a_herd_on_hills_as_at_one_on_flat_ground():
    simulation = start("predators-valley", seed=1)
    simulation.agents[Position.xyz][:, 2] += 30.0
    simulation.world.resource(Landscape).relief[..., 0] += 30.0
    assert np.degrees(painter_of(simulation, SIZE, view="space").camera.elevation) == pytest.approx(30.0)
