"""Dust behind runners on dry ground and ripples behind swimmers: where, how strong, and the same in every picture."""

import numpy as np
import pytest
from flockbrush.systems.landscape import Landscape

from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render.drawn_herd import checked
from flockbrush.render.wakes import DUST, RING, Wakes, marks_of
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of
from tests.flockbrush.test_draw_animals import changed, herd, painter


def raised(dust=0.0, rings=0.0, speed=3.0, count=1):
    return Wakes(np.full(count, dust), np.full(count, rings), np.tile((speed, 0.0), (count, 1)))


@pytest.mark.parametrize("wakes", [raised(dust=1.0), raised(rings=1.0)])
def test_marks_lie_behind_who_leaves_them(wakes):
    p = painter()
    plain = p.frame(herd((20, 15)), time=3.0, trails=False)
    marked = p.frame(herd((20, 15), wakes=wakes), time=3.0, trails=False)
    x = changed(marked, plain)[:, 1]
    assert len(x) > 20
    assert np.quantile(x, 0.9) < p.camera.pixels((20.0, 15.0))[0]
    p.dust = False
    assert np.array_equal(p.frame(herd((20, 15), wakes=wakes), time=3.0, trails=False), plain)


def test_a_puff_stays_where_it_was_raised():
    """Of an animal that runs straight on, from one picture to the next."""
    one, other = (
        marks_of(checked(herd((20 + 3 * t, 15), wakes=raised(dust=1.0), ids=np.array([7]))), np.array([0]), t, DUST)
        for t in (2.0, 2.05)
    )
    away = np.linalg.norm(one.xy[:, None] - other.xy[None], axis=-1)
    assert (away.min(axis=1) < 1e-9).sum() >= len(one.xy) - 1  # the oldest may be gone
    assert (one.alpha >= 0).all() and (one.alpha <= 1).all()


def test_many_runners_raise_no_more_puffs_than_there_is_time_for():
    many = checked(herd(*[(20, 15)] * 3000, wakes=raised(dust=1.0, count=3000)))
    assert len(marks_of(many, np.arange(3000), 1.0, DUST).row) <= 4000


def test_dust_is_raised_on_dry_ground_and_ripples_in_water():
    run = start("sheep-pasture", seed=1)
    run.run(320)
    land, moment = run.world.resource(Landscape), moment_of(run)
    names = [kind.name for kind in land.kinds]

    def wakes(kind):
        land.painted.ground[:] = names.index(kind)
        return herd_of(run, moment).wakes

    dirt, water, grass = wakes("dirt"), wakes("water"), wakes("grass")
    run.close()
    assert (dirt.dust > 0).sum() > 50 and not dirt.rings.any()
    assert (water.rings > 0).sum() > 50 and not water.dust.any()
    assert not grass.dust.any() and not grass.rings.any()


@pytest.mark.parametrize("view", ["plan", "space"])
def test_a_film_shows_the_same_ripples_wherever_it_begins(view):
    run = start("river", seed=1)
    run.run(32)
    moment = moment_of(run)
    shown = herd_of(run, moment)

    def picture(**told):
        made = painter_of(run, (960, 720), view=view, **told)
        if view == "space":
            made.chase(shown)
        return made.frame(shown, time=moment.time, trails=False)

    one, other, still = picture(), picture(), picture(dust=False)
    run.close()
    assert np.array_equal(one, other) and (shown.wakes[RING] > 0).all()
    assert len(changed(one, still)) > 20
