"""Each shipped herd brush does what its name says, and no change of brush makes an animal jerk.

`behaviours/brushes/bands.json` states the bands; `benchmarks/brush_bands.py` measures them on more herds than here.
"""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.program import shipped_programs
from flockbrush.components import Heading
from flockbrush.levels.build import plane

from benchmarks import brush_bands
from benchmarks.brush_bands import MEASURES, MOST, RATE, outside, stated, switch, watch

LIBRARY, PLAN = shipped(), stated()
HERD = {name: plan["small"] for name, plan in PLAN.items()}  # animals, seconds, since, seeds: quick and representative


@pytest.mark.parametrize("name", PLAN)
def test_a_small_herd_does_what_the_name_of_its_brush_says(name):
    """All herds tried must; of brushes that do not hold for every start, as many as stated."""
    small, bands, wrong, right = HERD[name], PLAN[name]["bands"], {}, 0
    for seed in small["seeds"]:
        if right == small["needed"]:
            break
        seen = watch(LIBRARY.get(name), PLAN[name]["scene"], small["animals"], seed, small["seconds"], small["since"])
        if out := outside(seen, bands):
            wrong[seed] = {m: round(seen[m], 3) for m in out}
        right += not out
    assert right >= small["needed"], f"{name}: by seed {wrong} against {bands}"


def test_every_shipped_herd_brush_says_what_it_does():
    of_herds = {name for name in LIBRARY.names() if LIBRARY.get(name).model == "herd"}
    programs = shipped_programs()
    of_programs = {brush for name in programs.names() for brush in programs.get(name).brushes}  # tested with those
    assert set(PLAN) <= of_herds <= set(PLAN) | of_programs
    for name, plan in PLAN.items():
        assert plan["bands"] and set(plan["bands"]) <= set(MEASURES), name
        assert all(low < high for low, high in plan["bands"].values()), name


@pytest.mark.parametrize("name", PLAN)
def test_what_the_study_measured_is_what_is_promised(name):
    """Every run of every promised herd size was in its band when the study was last made."""
    measured = PLAN[name]["measured"]
    for count in PLAN[name]["promised"]:
        assert measured[str(count)]["in band"] == measured[str(count)]["runs"], f"{name}, {count} animals"


def test_writing_what_was_measured_again_changes_no_byte(tmp_path, monkeypatch):
    before = brush_bands.BANDS.read_bytes()
    monkeypatch.setattr(brush_bands, "BANDS", tmp_path / "bands.json")
    brush_bands.store(PLAN, {name: plan["measured"] for name, plan in PLAN.items()})
    assert brush_bands.BANDS.read_bytes() == before


@pytest.mark.parametrize("other, name", [("march", "mill-filled"), ("swarm", "march"), ("march", "front")])
def test_a_band_tells_one_brush_from_another(other, name):
    scene, small = PLAN[name]["scene"], HERD[name]
    seen = watch(LIBRARY.get(other), scene, small["animals"], 1, small["seconds"], small["since"])
    assert outside(seen, PLAN[name]["bands"])


@pytest.mark.parametrize("old", PLAN)
def test_no_change_of_brush_jerks_an_animal_about(old):
    """In no tick does anybody turn 20° more than in the second before, whatever brush comes next."""
    news = [new for new in PLAN if new != old]
    found = switch(LIBRARY.get(old), map(LIBRARY.get, news), PLAN[old]["scene"], 60, settle=1.5, before=1.0, after=0.75)
    assert {new: more for new, more in zip(news, found, strict=True) if more > MOST} == {}, f"degrees more from {old}"


def test_without_a_limit_of_turning_and_a_transition_a_change_does_jerk():
    """The limit and the blend are what keeps it smooth: the measure above can fail."""
    old, new = (LIBRARY.get(name).with_parameters(max_turn=200.0) for name in ("swarm", "mill-filled"))
    rash = new.model_copy(update={"transition": 0.0})
    (more,) = switch(old, [rash], PLAN["swarm"]["scene"], 60, settle=1.5, before=1.0, after=0.75)
    assert np.isfinite(more) and more > MOST


def test_a_lone_animal_wanders_as_far_as_its_brush_says_and_straight_on_without():
    """Headings drift like a random walk: in t seconds by wander √t, root mean square."""
    still = {f"{force}_weight": 0.0 for force in ("avoidance", "cohesion", "alignment")}
    still |= {"unled": "keep", "leader_neighbours": -1, "max_turn": 200.0}
    for wander in (0.0, 0.2):
        brush = LIBRARY.get("graze").with_parameters(wander=wander, **still)
        herd = plane(brush, 300, 0.1, "grid", seed=3, heading=0.0)
        herd.run(2 * RATE)
        turned = np.arctan2(*herd.agents[Heading.forward][:, 1::-1].T)
        herd.close()
        assert np.sqrt(np.mean(turned**2)) == pytest.approx(wander * np.sqrt(2), rel=0.15, abs=1e-12)
