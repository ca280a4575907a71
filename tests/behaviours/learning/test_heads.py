"""Heads of animals that stand are known by what heads of those look like that walk."""

import numpy as np
import pytest

from benchmarks import foreign_herds, herd_film
from flockbrush.film.body_outlines import bodies_of, size_of_bodies
from flockbrush.film.body_shapes import Outlines
from flockbrush.film.heads import by_looks
from flockbrush.film.sightings import sightings_of

FPS, FRAMES = 25, 40
TO_BL = np.array([[0.1, 0.0, 0.0], [0.0, -0.1, 40.0]])  # 10 px to a body length
LOOK = np.array([0.0, -1.0, -2.0])  # of a head, less a tail


def herd(walking=12, standing=10, look=LOOK, light=0.0, backwards=0.0, blur=0.5, seed=0):
    """Bodies of animals three BL apart, of which some walk and some stand or are pushed back; and their headings."""
    rng = np.random.default_rng(seed)
    count = walking + standing
    angle = rng.uniform(-np.pi, np.pi, count)
    forward = np.column_stack([np.cos(angle), np.sin(angle)])
    speed = np.where(np.arange(count) < walking, 2.0, -backwards)
    start = 10 + 3.5 * np.column_stack([np.arange(count) % 5, np.arange(count) // 5])
    frames = []
    for t in range(FRAMES):
        xy = start + (speed * t / FPS)[:, None] * forward + rng.normal(0, 0.01, (count, 2))
        way = rng.choice([-1.0, 1.0], count)
        axis = way[:, None] * forward
        ends = way[:, None] * look + light * axis[:, :1] + rng.normal(0, blur, (count, len(LOOK)))
        one = np.full(count, 10.0)
        at = (xy - TO_BL[:, 2]) / [0.1, -0.1]
        frames.append(Outlines(at, axis * (1, -1), one, 0.4 * one, 3.6 * one, one > 0, ends))
    return frames, forward


def wrong(frames, forward, of):
    """Share of the sights of some animals with the head at the other end."""
    sightings, _ = sightings_of(frames, FPS, TO_BL)
    where = 10 + 3.5 * np.column_stack([np.arange(len(forward)) % 5, np.arange(len(forward)) // 5])
    near = np.linalg.norm(sightings.xy[:, None] - where, axis=2).argmin(1)
    chosen = np.isin(near, np.arange(len(forward))[of]) & (sightings.frame < 10)
    return np.mean((sightings.forward[chosen] * forward[near[chosen]]).sum(1) < 0)


def test_animals_that_stand_have_their_heads_where_those_of_walkers_would_be():
    frames, forward = herd()
    assert wrong(frames, forward, slice(12, None)) == 0


def test_who_is_pushed_back_a_little_does_not_turn_about():
    frames, forward = herd(backwards=0.1)
    plain = [Outlines(f.xy, f.axis, f.length, f.width, f.area, f.alone) for f in frames]
    assert wrong(plain, forward, slice(12, None)) > 0.8  # by motion alone
    assert wrong(frames, forward, slice(12, None)) == 0


def test_who_walks_is_believed_before_the_looks_of_his_ends():
    frames, forward = herd(blur=2.0)
    assert wrong(frames, forward, slice(12)) == 0


@pytest.mark.parametrize("light", [0.0, 3.0])
def test_ends_that_are_alike_tell_nothing_also_in_light_from_one_side(light):
    frames, _ = herd(look=0 * LOOK, light=light, walking=22, standing=0)
    assert not told(frames).any()


def test_heads_are_told_in_light_from_one_side():
    frames, forward = herd(light=3.0, walking=20)
    assert wrong(frames, forward, slice(20, None)) == 0


def test_of_a_few_walkers_or_of_a_herd_of_one_mind_nothing_is_learned():
    frames, _ = herd(walking=6, standing=16)
    assert not told(frames).any()
    frames, _ = herd(walking=22, standing=0)
    assert told(frames).any()
    assert not told(frames, turned_to=(1.0, 0.0)).any()


def told(frames, turned_to=None):
    """What the looks say of the bodies of a herd whose motion is known."""
    count = len(frames[0])
    order = np.arange(FRAMES * count).reshape(FRAMES, count).T.ravel()
    at, axis, ends = (np.concatenate([getattr(f, name) for f in frames])[order] for name in ("xy", "axis", "ends"))
    at, begin = at * 0.1, np.arange(0, FRAMES * count + 1, FRAMES)
    moved = np.repeat(at[begin[1:] - 1] - at[begin[:-1]], FRAMES, axis=0)
    forward = moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-9)
    if turned_to is not None:
        forward = np.tile(turned_to, (len(at), 1))
        at = np.arange(len(at))[:, None] * 0.08 * forward
    return by_looks(ends, axis, forward, at, begin, 0.01, FPS)


def test_a_dark_head_is_seen_at_the_end_where_it_is():
    truth = foreign_herds.herd("swarm", 40, 0.1)
    film = herd_film.shoot(truth, size=(480, 360), body_px=16)
    mask = herd_film.mask_of(film.frames[0])
    bodies = bodies_of(mask, size_of_bodies([mask]), film.frames[0])
    off = np.linalg.norm(bodies.xy[:, None] - film.pixels(0), axis=2)
    near = off.min(1) < 5
    linear = film.to_pixels[0][:, :2]
    way = np.sign((bodies.axis * (truth.forward[0] @ linear.T)[off.argmin(1)]).sum(1))
    light = (way[:, None] * bodies.ends)[near, 3:6].mean(1)
    assert near.sum() > 30 and (light < -0.3).all()
    assert bodies_of(mask, size_of_bodies([mask])).ends.shape == (len(bodies), 0)  # nothing without a picture
