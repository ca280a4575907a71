"""Small films with a perfect observer and a learner who knows the answer: what is tested is what people see of it."""

import hashlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from flockbrush.behaviours.brush import VisionSpec, shipped

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import CameraDrift, evidence_of_truth, shoot
from flockbrush.learning.initial_conditions import body_of, speed_of
from flockbrush.learning.learned_parameters import Attempt, Learned
from flockbrush.learning.recipe import SearchSettings
from flockbrush.learning.rollout import theta_of
from flockbrush.learning.which_model import ModelComparison

FILMS = {}  # by path


def film_of(path, name="own:march", count=30, seconds=1.6, camera=None, body_px=12.0):
    """A film of a herd, remembered for `observe`."""
    truth = herd(name, count, seconds, 12.5, 1)
    FILMS[str(path)] = shoot(truth, path, (320, 240), body_px, camera or CameraDrift(), seed=1)
    return path


def observe(path, *, frames=None, grid=30, regions=None, say=None, **looking):
    """What somebody who sees everything would report of a film of `film_of`."""
    film = FILMS[str(path)]
    found = evidence_of_truth(film.seen_from(0), grid=12, name=Path(path).name)
    found.speed.body_pixels = 1.0
    scale = float(np.hypot(*film.to_pixels[0][:, 0]))
    tall = film.size[1]
    if regions is not None:
        found.fields.region[:] = _regions(found.fields, cv2.imread(str(regions))[:, :, ::-1], scale, tall)
    if say is not None:
        say("seeing", 1, 2)
    done, picture = cv2.VideoCapture(str(path)).read()
    whole = replace(
        found,
        sha256=hashlib.sha256(Path(path).read_bytes()).hexdigest(),
        body_length_px=scale,
        picture=picture,
        to_pixels=np.array([[scale, 0, 0], [0, -scale, tall]]),
        camera=np.array([film.between(t, 0) for t in range(len(found.fields))]),
    )
    return whole if frames is None else whole.part(slice(frames[0], frames[1] + 1))


def _regions(fields, mask, scale, tall):
    """Number of the region at the middle of every cell."""
    x, y = fields.centres[..., 0] * scale, tall - fields.centres[..., 1] * scale
    column, row = (np.clip(v.astype(int), 0, side - 1) for v, side in ((x, mask.shape[1]), (y, mask.shape[0])))
    colours = sorted({tuple(map(int, c)) for c in mask.reshape(-1, 3)} - {(0, 0, 0)})
    return np.select([(mask[row, column] == colour).all(-1) for colour in colours], range(1, len(colours) + 1), 0)


def comparison_of(clips, seed):
    """No other kind of model is tried: that takes a minute."""
    return ModelComparison([], np.nan, 0, "it is a film of a test")


SETTINGS = SearchSettings()


def learn(evidences, settings=SETTINGS, *, say=None, stop=None, resume=None, **rest):
    """The numbers of march, in no time."""
    theta = theta_of(shipped().get("march").params)
    rng = np.random.default_rng(settings.seed)
    attempts = [
        Attempt(
            f"random {k}", k, rng.random(12), np.clip(theta + 0.1 * k, 0, 1), {}, np.linspace(1, 0.1 + k, 9), 0.5 + k
        )
        for k in range(settings.starts)
    ]
    if say is not None:
        say(1, 2, 0.5, "descent")
    stopped = bool(stop and stop())
    if resume is not None:
        Path(resume).write_text("what was done")
    return Learned(
        shipped().get("march").params, speed_of(evidences), body_of(evidences), VisionSpec(), theta, {"wander": 0.1},
        attempts, 0, np.full(12, 0.05), None, np.arange(12) < 9, {"polarization": 0.1}, ["In no time."], stopped,
    )  # fmt: skip
