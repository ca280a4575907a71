"""Random turns that last: their variance by the closed form, ticks of any length, and nothing to remember."""

import numpy as np
import pytest
from flockbrush.behaviours.wander import lasting, random_turns, rms_turn, wander_kernel
from flockbrush.engine.noise import Noise
from flockbrush.engine.state import restore, snapshot, state_hash
from small_herd import brush, forward_of, meadow, put

ANIMALS, WANDER = 20_000, 0.5
IDS, ROWS = np.arange(1, ANIMALS + 1), np.arange(ANIMALS, dtype=np.int32)


def turned(dt, wander_time, seconds, begin=0.0, seed=3):
    """(ticks + 1, n) rad: sums of random turns from a time on."""
    angle = [np.zeros(ANIMALS)]
    for tick in range(round(begin / dt), round((begin + seconds) / dt)):
        direction = np.tile([1.0, 0.0, 0.0], (ANIMALS, 1))
        wander_kernel(0, ANIMALS, ROWS, IDS, *random_turns(WANDER, wander_time, dt, tick, Noise(seed).key), direction)
        angle.append(angle[-1] + np.arctan2(direction[:, 1], direction[:, 0]))
    return np.array(angle)


@pytest.mark.parametrize("wander_time", [0.0, 0.125, 0.5])
def test_headings_spread_as_the_closed_form_says(wander_time):
    dt, spans = 1 / 32, np.array([0.125, 0.5, 2.0])
    found = [np.var(turned(dt, wander_time, span, begin)[-1]) for span in spans for begin in (0.0, 0.0625, 0.25, 0.375)]
    share = np.reshape(found, (3, 4)).mean(1) / (WANDER**2 * spans)  # over the phases of the waves
    assert share == pytest.approx(lasting(spans, wander_time), rel=0.03)


def test_in_the_long_run_headings_spread_as_far_however_long_turns_last():
    assert lasting([0.0625, 200.0], 1.0) == pytest.approx([(np.pi / 4) ** 2 * 0.0625, 1.0], rel=0.01)
    assert (lasting([0.1, 1.0, 10.0], 0.0) == 1.0).all()
    times = np.array([2.0, 3.0, 5.0])  # from twice that time on, the variance grows as fast as without
    assert np.diff(times * lasting(times, 1.0)) == pytest.approx(np.diff(times), rel=0.01)
    assert lasting(3.0, 1.0) == pytest.approx(0.83, abs=0.005)


def test_a_turn_that_lasts_is_the_same_in_ticks_of_any_length():
    coarse, fine = (turned(dt, 0.3, 1.0, begin=0.5)[-1] for dt in (1 / 16, 1 / 64))
    assert np.abs(coarse - fine).max() < 1e-12


def test_turns_last_about_as_long_as_asked_for():
    rate = np.diff(turned(1 / 32, 0.5, 4.0), axis=0)
    alike = [np.mean(rate[lag:] * rate[: len(rate) - lag]) / np.mean(rate**2) for lag in (4, 16, 32, 64)]
    lag = np.array([0.25, 1.0, 2.0])  # in wander times: the half wave beside itself, later
    told = 0.5 * (2.0 - lag) * np.cos(0.5 * np.pi * lag) + np.sin(0.5 * np.pi * lag) / np.pi
    assert alike == pytest.approx([*told, 0.0], abs=0.02)
    assert np.sqrt(np.mean(rate**2)) == pytest.approx(rms_turn(WANDER, 0.5, 1 / 32), rel=0.02)


def test_up_to_a_tick_each_tick_has_a_turn_of_its_own():
    plain, short = (turned(1 / 32, time, 0.5) for time in (0.0, 0.03))
    assert plain.tobytes() == short.tobytes()


def test_a_herd_that_is_taken_up_again_wanders_on_as_if_nothing_had_been():
    def wandering():
        simulation = meadow(brush(wander=0.4, wander_time=0.3, leader_neighbours=-1))
        put(simulation, [(20, 20), (30, 20), (20, 40)])
        return simulation

    whole, begun, later = wandering(), wandering(), wandering()
    whole.run(40)
    begun.run(17)
    restore(later.world, snapshot(begun.world))
    later.run(23)
    assert state_hash(later.world) == state_hash(whole.world)
    assert np.abs(forward_of(whole) - [1.0, 0.0]).max() > 0.05
