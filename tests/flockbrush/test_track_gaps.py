"""Tracks with gaps of half their length: learned from, and said."""

import numpy as np
import pytest

from flockbrush.film.track_evidence import evidence_of_tracks
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
