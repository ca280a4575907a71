"""Tracks with gaps of half their length: learned from, and said."""

import numpy as np
import pytest

from flockbrush.film import track_evidence
from flockbrush.film.arena import Arena
from flockbrush.film.track_evidence import AT_BORDER, INSIDE, evidence_of_tracks
from flockbrush.film.track_files import Trajectories


def walking(frames=120, animals=12):
    """Animals that walk side by side, 10 frames a second, BL."""
    x = 0.2 * np.arange(frames)[:, None] + np.arange(animals) % 3
    return np.stack([x + 0.02 * np.sin(x), np.broadcast_to(1.5 * (np.arange(animals) // 3), x.shape)], axis=-1)


def told(xy):
    """(evidence, what it says of animals that are missing)."""
    evidence = evidence_of_tracks(Trajectories(xy, tuple(map(str, range(xy.shape[1]))), 10.0, "m"), 1.0)
    return evidence, [note for note in evidence.notes if note.startswith("animals are missing")]


def test_whole_tracks_and_short_gaps_say_nothing():
    xy = walking()
    assert told(xy)[1] == []
    xy[40:45, ::2] = np.nan  # filled
    assert told(xy)[1] == []


def test_animals_that_are_missing_half_the_time_are_used_and_said():
    xy = walking()
    xy[30:90] = np.where((np.arange(12) % 2 == 0)[:, None], np.nan, xy[30:90])  # every second one, half of the film
    evidence, said = told(xy)
    assert len(said) == 1 and said[0].startswith("animals are missing for 25% of the time")
    seen = evidence.sightings
    assert [len(seen.xy[seen.of(t)]) for t in (10, 60, 110)] == [12, 6, 12]
    assert np.nanmean(seen.speed) == pytest.approx(2.0, rel=0.05)


def test_an_animal_that_comes_late_is_not_missing_before():
    xy = walking()
    xy[:60, :6] = np.nan
    assert told(xy)[1] == []


def going_by(wide=8.0, animals=60, frames=80):
    """Animals that go through a picture of so many BL, NaN outside."""
    rng = np.random.default_rng(0)
    angle = rng.normal(0, 0.3, animals) + np.cumsum(rng.normal(0, 0.05, (frames, animals)), axis=0)
    steps = 0.15 * np.stack([np.cos(angle), np.sin(angle)], -1)
    xy = np.column_stack([rng.uniform(-14, 4, animals), rng.uniform(-8, 8, animals)]) + np.cumsum(steps, axis=0)
    xy[(np.abs(xy) > wide / 2).any(-1)] = np.nan
    return xy


def test_one_that_comes_late_among_the_others_does_not_make_a_herd_a_part_of_one():
    """A part of a herd is not left alone, nor are its spread and growth compared."""
    xy = walking(60, 6)
    xy[:25, 1] = np.nan
    evidence, _ = told(xy)
    assert INSIDE in evidence.notes and evidence.fields.holds_all and not evidence.fields.shows_part
    assert evidence.part(slice(30, 60)).fields.holds_all


def test_animals_that_come_and_go_at_the_border_are_a_part_of_a_herd_but_within_walls():
    xy = going_by()
    seen, _ = told(xy)
    assert AT_BORDER in seen.notes and not seen.fields.holds_all and seen.fields.shows_part
    tracks = Trajectories(xy, tuple(map(str, range(xy.shape[1]))), 10.0, "m")
    walled = evidence_of_tracks(tracks, 1.0, arena=Arena.read("rectangle"))
    assert INSIDE in walled.notes and walled.fields.holds_all


def test_where_tracks_end_is_not_asked_of_herds_that_are_always_whole(monkeypatch):
    monkeypatch.delattr(track_evidence, "_crossed")
    evidence, _ = told(walking())
    assert evidence.fields.holds_all and not {AT_BORDER, INSIDE} & set(evidence.notes)
