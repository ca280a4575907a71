"""What is left out of the method leaves every loss, whether animals are told apart or only fields are seen."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning import trials
from flockbrush.learning.recipe import SearchSettings
from flockbrush.learning.trials import USE, Setting, attempt, descend

THETA, EXTRAS = np.full(12, 0.4), {"neighbour_range": 8.0}


@pytest.fixture(scope="module")
def clip():
    return evidence_of_truth(herd("swarm", 30, 1.2, 12.5, 2), grid=6)  # cells with several animals have a variance


@pytest.fixture(scope="module", params=["told apart", "fields"])
def seen(request, clip):
    """The clip, and what a trial of some numbers says of it, with everything and without a part."""
    shown = clip if request.param == "told apart" else replace(clip, sightings=None)

    def tried(*parts):
        return attempt(Setting.of((shown,), SearchSettings(use=USE - set(parts))), THETA, EXTRAS, [1], False)

    return shown, tried


@pytest.mark.parametrize("part", ["density", "variance"])
def test_a_part_that_is_left_out_is_not_compared(seen, part):
    whole, without = seen[1](), seen[1](part)
    gone = {
        name.removeprefix("lasting ").removeprefix(trials.OFF)
        for name in set(whole["figures"]) - set(without["figures"])
    }
    assert gone and gone <= set({"density": trials.WHERE_DENSITY_COUNTS, "variance": trials.WHERE_ORDER_COUNTS}[part])
    assert without["score"] != whole["score"]


@pytest.mark.parametrize("part", sorted(USE))
def test_descents_on_fields_leave_it_out(clip, part, monkeypatch):
    monkeypatch.setattr(trials, "DESCENT", 3)
    fields = replace(clip, sightings=None)
    losses = [
        descend(Setting.of((fields,), SearchSettings(use=use)), THETA, EXTRAS, 5)["loss"] for use in (USE, USE - {part})
    ]
    assert len(losses[0]) and not np.allclose(*losses)


@pytest.mark.parametrize("part", ["angular", "occlusion"])
def test_descents_on_turns_leave_out_how_animals_see(clip, part):
    whole, without = (
        descend(Setting.of((clip,), SearchSettings(use=use)), THETA, EXTRAS, 5) for use in (USE, USE - {part})
    )
    assert whole["loss"][-1] != without["loss"][-1]
    assert (np.array(without["theta"])[2::3] == THETA[2::3]).all() == (part == "angular")
