"""What is underfoot and which brush it gives: painted ground, zones, homes, and the time a change takes."""

import numpy as np
import pytest
from flockbrush.components import BrushBinding, Vision, Wish
from flockbrush.levels.schema import BrushLayer, Zone
from flockbrush.systems.commands import PaintBrush, SwitchBrush
from flockbrush.systems.edits import UseBrush
from small_herd import box, forward_of, meadow, put, straight, xy_of

DT = 1 / 32
HOME = straight("home", mean=2.0)
OTHER = straight("other", mean=2.0, transition=1.0, vision={"range": 6.0, "field_of_view": 180.0})


def painted(first, last, name="other", weight=1.0, shape=(40, 40)):
    """A layer with the columns ``first`` to ``last`` painted."""
    index = np.full(shape, -1, np.int16)
    index[:, first:last] = 0
    return BrushLayer("brush", weight, [name], index)


def walker(**things):
    simulation = meadow(HOME, OTHER, **things)
    put(simulation, [(15, 20)], 0.0, brush="home")
    return simulation


def binding(simulation):
    b = BrushBinding
    agents = simulation.agents
    return int(agents[b.brush][0]), int(agents[b.previous][0]), float(agents[b.blend][0])


def test_painted_ground_gives_its_brush_over_the_transition_and_leaving_gives_it_back():
    simulation = walker(brush_layers=[painted(20, 30)])
    home, other = 0, 1
    blends = []
    for _ in range(32 * 12):
        x = xy_of(simulation)[0, 0]
        simulation.tick()
        brush, previous, blend = binding(simulation)
        assert brush == (other if 20 <= x < 30 else home)
        if brush == other:
            assert previous == home
            blends.append(blend)
    assert blends[:33] == pytest.approx([min(1.0, (k + 1) * DT / 1.0) for k in range(33)])  # one second
    assert binding(simulation) == (home, other, 1.0)


def test_sight_goes_with_the_brush():
    simulation = walker(brush_layers=[painted(20, 30)])
    simulation.run(32 * 4)
    agents = simulation.agents
    assert agents[Vision.range][0] == 6.0
    assert agents[Vision.field_of_view][0] == pytest.approx(np.pi)
    simulation.run(32 * 5)
    assert agents[Vision.range][0] == 4.0
    assert agents[Vision.field_of_view][0] == pytest.approx(2 * np.pi)


def test_a_brush_that_is_replaced_changes_what_its_animals_see_at_once():
    simulation = walker()
    simulation.run(2)
    home = straight("home", mean=2.0, vision={"range": 12.0, "field_of_view": 90.0})
    simulation.submit(UseBrush("home", home.source.decode()))
    simulation.tick()
    assert simulation.agents[Vision.range][0] == 12.0
    assert simulation.agents[Vision.field_of_view][0] == pytest.approx(np.pi / 2)


def test_a_zone_lies_above_the_paint_and_takes_its_own_time():
    zone = Zone(1, "fold", box(20, 0, 30, 40), "other", np.inf, 1.0, 4.0)
    simulation = walker(zones=[zone], brush_layers=[painted(10, 40, "home")])
    for _ in range(32 * 3):
        simulation.tick()
    brush, _, blend = binding(simulation)
    entered = np.ceil((20 - 15) / 2 * 32)  # ticks on the way there
    assert brush == 1
    assert blend == pytest.approx((96 - entered) * DT / 4.0, abs=2 * DT / 4)
    simulation.submit(PaintBrush("other", 25.0, 20.0, 3.0))  # painting over it is painting: the brush's own time
    simulation.run(2)
    here = binding(simulation)[2]
    simulation.tick()
    assert binding(simulation)[2] - here in (pytest.approx(DT / 4.0), pytest.approx(DT / 1.0))


def test_back_over_the_border_the_mixture_goes_on_where_it_was():
    simulation = walker(brush_layers=[painted(20, 30)])
    while binding(simulation)[0] == 0:
        simulation.tick()
    simulation.run(9)
    _, _, blend = binding(simulation)
    assert 0.2 < blend < 0.4
    simulation.submit(PaintBrush("", 25.0, 20.0, 50.0))  # the ground under the feet is unpainted again
    simulation.tick()
    brush, previous, back = binding(simulation)
    assert (brush, previous) == (0, 1)
    assert back == pytest.approx(1 - blend + DT / HOME.transition)


def test_half_way_between_two_a_third_begins_from_the_nearer():
    third = straight("third", transition=1.0)
    simulation = meadow(HOME, OTHER, third)
    put(simulation, [(15, 20)], 0.0, brush="home")
    home, other, last = 0, 1, 2
    for share, expected in ((0.25, home), (0.75, other)):
        agents = simulation.agents
        agents[BrushBinding.brush][:], agents[BrushBinding.previous][:] = other, home
        agents[BrushBinding.blend][:] = share
        agents[BrushBinding.home][:] = last
        simulation.tick()
        assert binding(simulation)[:2] == (last, expected)


def test_the_direction_wished_changes_little_by_little():
    left = straight("left", mean=0.0, transition=1.0, max_turn=200.0)
    # two models of mind: straight on, and 90 degrees to the left by a guide that only leaders follow
    simulation = meadow(HOME, left)
    put(simulation, [(20, 20)], 0.0, brush="home")
    simulation.submit(SwitchBrush("left"))
    for _ in range(40):
        before = simulation.agents[Wish.direction].copy()
        simulation.tick()
        assert (before * simulation.agents[Wish.direction]).sum(1).min() > 0.99
    assert forward_of(simulation)[0] == pytest.approx((1, 0))
