"""Formations that meet pillars, or a falcon: nobody touches anything, and they are one again."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Position
from small_herd import box, meadow, obstacle, put_aloft, room_in_the_air

from benchmarks.formation_scenes import passage
from benchmarks.formations import formed_up

KINDS = "geese", "skein"


@pytest.mark.parametrize("kind", KINDS)
def test_a_formation_passes_a_field_of_pillars_and_is_one_again(kind):
    found = passage("pillars", kind, 1, birds=5, forms=6.0)
    assert found.passed and found.room > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_a_formation_that_a_falcon_scatters_is_one_again(kind):
    found = passage("falcon", kind, 4, birds=7, forms=10.0)
    assert found.passed and found.nearest < 25.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", ["cylinder", "box"])
def test_who_foresees_a_pillar_keeps_off_it_and_who_does_not_touches_it(kind, shape):
    for foresight, clear in ((2.0, True), (0.0, False)):
        asset = shipped().get(kind).with_parameters(foresight=foresight)
        pillar = obstacle(box(48, 46, 56, 54))
        pillar.shape, pillar.z_max = shape, 100.0
        simulation = meadow(asset, width=100, height=100, obstacles=[pillar])
        put_aloft(simulation, [(20.0, 49.5, 40.0)], species="goose", length=0.8)
        least = np.inf
        while simulation.agents[Position.xyz][0, 0] < 58.0 and simulation.clock.now < 6.0:
            simulation.tick()
            least = min(least, room_in_the_air(simulation)[0])
        assert (least > 0.1) == clear


def test_by_v_rules_birds_at_several_heights_come_to_that_of_those_ahead():
    simulation = meadow(shipped().get("skein"), width=2000, height=200)
    put_aloft(simulation, [(40.0, 100.0, 30.0), (36.0, 98.0, 34.0), (32.0, 103.0, 22.0)], species="goose", length=0.8)
    simulation.run(32 * 16)
    assert simulation.agents[Position.xyz][:, 2] == pytest.approx(30.0, abs=0.2)


def test_flocks_form_up_in_time_if_they_see_one_another_and_have_the_time():
    seeds = range(1, 4)
    assert formed_up("V", 9, seeds, np.inf) == 3
    assert formed_up("V", 9, seeds, 0.5) == 0  # nobody sees anybody
    assert formed_up("V", 9, seeds, np.inf, within=3.0) == 0
