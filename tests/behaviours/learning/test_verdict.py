"""What is said of a brush: the truth is praised, another herd is not, and of what a clip cannot tell nothing."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning import verdict
from flockbrush.learning.battery import MEASURES, Battery, BatteryRow
from flockbrush.learning.rollout import Run
from flockbrush.learning.simulate import simulated
from flockbrush.learning.verdict import (
    IDLE,
    ONWARDS,
    STILL,
    TRACKS,
    Contender,
    after_long,
    combined,
    concluded,
    idle,
    judge,
    once_fitted,
    settled,
)

BRUSH = "swarm"


@pytest.fixture(autouse=True)
def short(monkeypatch):
    for name, value in {"LONG_RUNS": 1, "RIVAL_RUNS": 1}.items():
        monkeypatch.setattr(verdict, name, value)


@pytest.fixture(scope="module")
def clip():
    """Two and a half seconds of forty animals under a shipped brush."""
    return evidence_of_truth(herd(f"own:{BRUSH}", 40, 2.56, 12.5, 4))


@pytest.fixture(scope="module")
def judged(clip):
    """The truth, and a brush of other herds, beside one another."""
    march = shipped().get("march").model_copy(update={"speed": shipped().get(BRUSH).speed})
    truth = judge(clip, shipped().get(BRUSH), {"march": march}, runs=3)
    return truth, judge(clip, march, {}, runs=3)


def test_the_truth_moves_like_the_film_and_another_herd_does_not(judged):
    truth, other = judged
    assert truth.kind == "like" and truth.sentence.startswith("It moves like the film: in "), truth
    assert other.kind in ("partly", "rival") and other.missed
    assert not truth.missed
    assert {r.name for r in truth.rivals} == {*IDLE, "random numbers", "march"}


def test_every_measure_has_limits_from_the_clip_and_from_chance(judged, clip):
    rows = {row.name: row for row in judged[0].brush.rows}
    assert set(rows) == set(MEASURES)
    assert all(row.limit >= MEASURES[name].floor for name, row in rows.items())
    assert rows["polarization"].by_chance == pytest.approx(1 / np.sqrt(40))
    assert rows["polarization"].boot > 0


def test_who_stands_and_who_goes_on_are_seen_as_that(clip):
    battery = Battery.of(clip)
    stand, on = (battery.measured(idle(clip, 0, moving)) for moving in IDLE.values())
    assert stand["share standing"] == pytest.approx(1.0) and np.all(stand["speeds"] == 0.0)
    assert np.all(on["turning"] < 1e-6) and on["growth"] > battery.values["growth"]
    assert np.median(on["speeds"]) > np.median(battery.values["speeds"])  # nobody stands in the way


def test_changes_of_speed_are_those_of_steady_acceleration(clip):
    battery = Battery.of(clip)
    run = idle(clip, 0, True)
    forward, n = run.forward[: len(run.ids) // len(run)], len(run.ids) // len(run)
    faster = run.times[:, None] ** 2 * (0.4 if n else 0.0)  # m: half of .8 BL/s²
    gained = (faster[:, :, None] * forward[None]).reshape(-1, 2)
    still, faster_and_faster = (
        np.median(battery.measured(replace(run, xy=xy))["changes of speed"]) for xy in (run.xy, run.xy + gained)
    )
    assert still == pytest.approx(0.0, abs=1e-6)
    assert faster_and_faster == pytest.approx(0.8, rel=1e-6)


def test_uneven_speeds_are_told(clip):
    brush = shipped().get(BRUSH)
    uneven = brush.model_copy(update={"speed": brush.speed.model_copy(update={"deviation": 0.8 * brush.speed.mean})})
    battery = Battery.of(clip)
    rows = {row.name: row for row in battery.compared([battery.measured(simulated(clip, uneven, s)) for s in (1, 2)])}
    assert not rows["changes of speed"].met


def test_a_herd_that_spreads_in_the_clip_may_go_on_spreading(clip):
    battery, grown = Battery.of(clip), []
    row = BatteryRow("spread", *battery.values["spread"], 0.0, 0.0, 0.1)
    for growth in (0.0, 0.05):
        series = replace(battery.series, growth=growth)
        ends = [replace(series, rows={**series.rows, "spread": series.rows["spread"] * times}) for times in (0.3, 2.6)]
        there = replace(battery, series=series, values=battery.values | {"growth": np.array([growth])})
        grown.append([after_long(there, [row], [end])[0] for end in ends])
    assert [[row.met for row in rows] for rows in grown] == [
        [False, False],
        [False, True],
    ]  # exp(.05 / s * 20 s) is 2.7
    spread = grown[1][1]
    assert spread.spreads_on and not grown[1][0].spreads_on
    said = concluded(contender("x", 0.5, 0.5, 0.5, 0.9, lasting=[spread]), [contender(STILL, 4, 4, 4, 4)], 3.0, 30)
    assert said.kind == "like" and said.sentence.endswith(
        "left alone for 20 s, in spread only if the herd of the film goes on spreading."
    )


def test_what_runs_do_alike_is_no_difference(clip):
    run = simulated(clip, shipped().get(BRUSH), 3)
    battery = Battery.of(clip)
    one = battery.measured(run)
    rows = Battery(clip, battery.every, battery.series, one, dict.fromkeys(one, 0.0), battery.chance).compared([one])
    assert all(row.off == 0.0 and row.met for row in rows)


def test_animals_that_leave_are_told_by_their_distance(clip):
    battery = Battery.of(clip)
    run = simulated(clip, shipped().get(BRUSH), 3)
    gone = replace(run, xy=run.xy + np.where(run.ids % 8 == 0, 100.0 + 10.0 * run.ids, 0.0)[:, None])
    stay, leave = (battery.measured(one)["nearest neighbour"] for one in (run, gone))
    assert leave[1] == pytest.approx(stay[1], rel=0.2) and leave[-1] > 2.0 * stay[-1]
    rows = {row.name: row for row in battery.compared([battery.measured(gone)])}
    assert not rows["nearest neighbour"].met


def test_distances_by_chance_are_those_of_places_at_random():
    rng, radius = np.random.default_rng(2), 10.0
    truth = herd("swarm", 400, 0.8, 12.5, 4)
    angle, far = rng.uniform(-np.pi, np.pi, truth.xy.shape[:2]), radius * np.sqrt(rng.uniform(size=truth.xy.shape[:2]))
    truth.xy[:] = np.stack([far * np.cos(angle), far * np.sin(angle)], -1)
    battery = Battery.of(evidence_of_truth(truth))
    assert battery.values["nearest neighbour"].mean() == pytest.approx(battery.chance["nearest neighbour"], rel=0.1)


def row(name, far):
    return BatteryRow(name, 0.5, 0.5 + 0.1 * far, 0.1 * far, 0.1)


def contender(name, *far, lasting=()):
    return Contender(name, [row(n, f) for n, f in zip(MEASURES, far, strict=False)], list(lasting))


def test_the_four_sentences():
    others = [contender("march", 3, 3, 3, 3), contender(STILL, 4, 4, 4, 4), contender(ONWARDS, 2, 2, 2, 2)]
    said = concluded(contender("x", 0.5, 0.5, 0.5, 0.9), others, 3.0, 30)
    assert said.kind == "like"
    said = concluded(contender("x", 0.5, 0.5, 0.5, 0.9, lasting=[row("milling", 2)]), others, 3.0, 30)
    assert said.sentence.endswith("not in milling after 20 s alone.")
    said = concluded(contender("x", 0.5, 1.5, 0.5, 0.9), others, 3.0, 30)
    assert said.kind == "partly" and said.sentence.endswith("nearest neighbour and speeds, not in milling.")
    said = concluded(contender("x", 0.5, 5, 5, 0.9), [*others, contender("mill", 0.5, 1.2, 0.5, 0.5)], 3.0, 30)
    assert said.sentence == "It is no better than the brush mill."
    assert concluded(contender("x", 0.5, 0.5, 0.5, 0.9), others, 0.5, 30).kind == "untold"
    idle_too = [*others[:2], contender(ONWARDS, 0.2, 0.2, 0.2, 0.2)]
    said = concluded(contender("x", 0.5, 0.5, 0.5, 0.9), idle_too, 3.0, 30)
    assert said.kind == "untold" and ONWARDS in said.sentence


def test_of_tracks_the_sentences_say_so():
    others = [contender(STILL, 4, 4, 4, 4)]
    like, partly = (concluded(contender("x", far, 0.1, 0.1, 0.1), others, 3.0, 30, source=TRACKS) for far in (0.2, 1.5))
    assert like.sentence.startswith("It moves like the tracks: in ")
    assert combined([like, partly]).sentence.startswith("It moves like the tracks in ")
    untold = concluded(contender("x", 0.5, 0.5, 0.5, 0.9), others, 0.5, 30, source=TRACKS)
    assert untold.sentence.startswith("How it moves cannot be told from these tracks: 0.50 s of 30 animals tell ")


@pytest.mark.parametrize(
    ("seconds", "count", "told", "lacking"),
    [(0.5, 30, 4, "0.8 s"), (3.0, 4, 4, "5 animals"), (3.0, 30, 2, "3 measures"), (0.5, 4, 4, "0.8 s and 5 animals")],
)
def test_why_nothing_can_be_told_is_said(seconds, count, told, lacking):
    far = [0.2] * told
    said = concluded(contender("x", *far), [contender(STILL, *(4.0 for _ in far))], seconds, count)
    assert said.kind == "untold"
    assert said.sentence.endswith(f"animals tell {told} of 12 measures; at least {lacking} are needed.")


def test_brushes_of_several_parts_are_judged_together():
    others = [contender(STILL, 4, 4, 4, 4)]
    parts = [concluded(contender("x", far, 0.1, 0.1, 0.1), others, 3.0, 30) for far in (0.2, 1.5)]
    assert [p.kind for p in parts] == ["like", "partly"]
    both = combined(parts)
    assert both.kind == "partly" and both.seconds == 6.0
    assert both.brush.rows[0].far == pytest.approx(np.sqrt((0.2**2 + 1.5**2) / 2))
    assert combined([parts[0], concluded(contender("x", 1.1, 0.1, 0.1, 0.1), others, 3.0, 30)]).kind == "like"


def test_a_brush_is_not_praised_for_what_it_misses_once_it_is_fitted_to_all_frames():
    others = [contender(STILL, 4, 4, 4, 4)]
    strayed = [row("milling", 2)]
    like, partly, strays = (
        concluded(contender("x", far, 0.1, 0.1, 0.1, lasting=lasting), others, 3.0, 30)
        for far, lasting in ((0.2, ()), (1.5, ()), (0.2, strayed))
    )
    said = once_fitted(like, strays)
    assert said.kind == "partly" and said.brush is like.brush
    assert said.sentence == (
        "It moves like the film in polarization, milling, nearest neighbour and speeds; fitted to all frames, not in "
        "milling after 20 s alone."
    )
    assert once_fitted(like, partly).sentence.endswith("and speeds; fitted to all frames, not in polarization.")
    assert once_fitted(like, like) is like and once_fitted(partly, strays) is partly


@pytest.mark.parametrize(("name", "share"), [("polarization", 1.0), ("nearest neighbour", 0.5)])
def test_what_changes_in_a_clip_is_excused_after_it_and_of_distances_half(clip, name, share):
    battery, limits = Battery.of(clip), []
    n, size = battery.series.rows[name].shape
    third, rising = n // 3, np.linspace(0.0, 0.9, n)[:, None] + np.zeros(size)
    for values in (np.full((n, size), 0.45), rising):
        series = replace(battery.series, rows={**battery.series.rows, name: values})
        row_beside = BatteryRow(name, 0.5, 0.5, 0.0, 0.1)
        limits.append(after_long(replace(battery, series=series), [row_beside], [battery.series])[0].limit)
    change = rising[-third:].mean() - rising[:third].mean()
    assert limits[1] - limits[0] == pytest.approx(share * change)


def test_nothing_is_told_by_a_clip_whose_animals_are_taken_for_ground(clip):
    doubted = replace(clip, doubt="animals move 0.1 body lengths in this clip")
    told = judge(doubted, shipped().get(BRUSH), {}, runs=2)
    assert told.kind == "untold" and told.sentence.endswith(
        "from this clip: animals move 0.1 body lengths in this clip."
    )
    assert combined([told, replace(told, doubt="")]).kind == "untold"


def every(clip, seconds):
    """The same clip as if its frames were so far apart."""
    return replace(clip, fps=1.0 / seconds, fields=replace(clip.fields, fps=1.0 / seconds))


def circling(seconds=verdict.ALONE, fps=verdict.FPS, animals=8):
    """Animals that go round in circles of 1 BL at 1 BL/s, each in its own."""
    times = np.arange(int(seconds * fps) + 1) / fps
    angle = np.repeat(times, animals)
    forward = np.column_stack([-np.sin(angle), np.cos(angle)])
    xy = np.column_stack([np.cos(angle), np.sin(angle)]) + 5.0 * np.tile(np.arange(animals), len(times))[:, None]
    first, ids = animals * np.arange(len(times) + 1), np.tile(np.arange(animals), len(times))
    return Run(times, first, ids, xy, forward, forward)


def test_herds_left_alone_are_looked_at_over_the_steps_of_the_clip(clip):
    """Where frames are far apart, animals turn between them, and seem slower."""
    for apart, span in ((0.5, 1.5), (4.0, 4.0)):
        battery = Battery.of(every(clip, apart))
        assert battery.series.yard.span == span
        chord = 2.0 * np.sin(0.5 * span) / span
        np.testing.assert_allclose(settled(battery, circling()).value("speeds"), chord, rtol=1e-6)


def test_steps_of_which_no_two_fit_in_the_time_alone_are_left_out(clip):
    battery = Battery.of(every(clip, 15.0))
    rows = [BatteryRow(name, 1.0, 1.0, 0.0, 1.0) for name in battery.values]
    lasting = {row.name for row in after_long(battery, rows, [settled(battery, circling())])}
    assert "nearest neighbour" in lasting and not lasting & {"speeds", "share standing"}


def test_a_part_of_a_herd_is_not_said_to_last():
    said = concluded(contender("x", 0.5, 0.5, 0.5, 0.9), [contender(STILL, 4, 4, 4, 4)], 3.0, 30)
    assert said.sentence.endswith("speeds; a part of a herd cannot be left alone for 20 s.")
