"""A herd that flies, held to an endless plane: the real tick, for what `flockbrush.learning.rollout` leaves out."""

from __future__ import annotations

import datetime

import numpy as np

from flockbrush.behaviours.behaviour import Behaviour, behaviours
from flockbrush.behaviours.brush import BodySpec, Brush, Provenance
from flockbrush.components import Heading, Position, Speed, Velocity
from flockbrush.levels.build import plane

SPACING = 0.5  # animals per BL² of the ground that they are put on first
NOTHING = Provenance(kind="learned", source="a rollout", date=datetime.date(2000, 1, 1), by="flockbrush")


def model_of(params) -> Behaviour:
    """The model of these parameters; of several that share their class, the first that is no danger to others."""
    models = [model for model in behaviours().values() if model.Params is type(params)]
    return min(models, key=lambda model: (model.danger, model.name))


def needs_world(params) -> bool:
    """Whether a herd can only be run in a world: one that flies, if only over the ground."""
    return model_of(params).flight is not None


def brush_of_parts(params, speed, body, vision) -> Brush:
    """A brush of these parts with animals one metre long, so that metres are body lengths."""
    return Brush(
        name="rollout", model=model_of(params).name, params=params, speed=speed, vision=vision,
        body=BodySpec(length=1.0, radius=min(body.radius / body.length, 0.5), contact=body.contact),
        provenance=NOTHING,
    )  # fmt: skip


def world_looks(start, params, speed, body, vision, seconds, fps, seed, around):
    """What a herd does, [(ids, xy, forward, velocity)] of each frame, in BL.

    Frames are at 0, 1/fps ... up to ``seconds``; between two ticks places and headings are interpolated.
    ValueError when something is ``around`` (`flockbrush.learning.rollout.Surroundings`).
    """
    if any(thing is not None for thing in around):
        name = model_of(params).name
        raise ValueError(f"animals of the model {name} cannot be simulated among walls or in part of a herd")
    simulation = plane(brush_of_parts(params, speed, body, vision), max(len(start), 1), SPACING, seed=int(seed) % 2**31)
    agents, n = simulation.agents, len(start)
    if not n:
        empty = np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        return [empty] * (int(seconds * fps + 1e-6) + 1)
    middle = agents[Position.xyz][:, :2].mean(0) - start.xy.mean(0)
    agents[Position.xyz][:, :2] = start.xy + middle
    agents[Heading.forward][:, :2] = start.forward
    if start.speed is not None:
        agents[Speed.drawn][:] = agents[Speed.target][:] = np.maximum(start.speed, 0.0)
    agents[Velocity.xyz][:, :2] = start.forward * agents[Speed.drawn][:, None]
    done, before, looks = 0, None, []
    for k in range(int(seconds * fps + 1e-6) + 1):
        after = k / fps / simulation.clock.dt
        while done < after - 1e-9:
            before = _look(agents, middle)
            simulation.run(1)
            done += 1
        now, share = _look(agents, middle), 1.0 - (done - after)
        looks.append(now if before is None or share > 1 - 1e-9 else between(before, now, share))
    return looks


def _look(agents, middle):
    order = np.argsort(agents.ids, kind="stable")
    columns = agents[Position.xyz][:, :2] - middle, agents[Heading.forward][:, :2], agents[Velocity.xyz][:, :2]
    return np.asarray(agents.ids)[order].astype(np.int64), *(column[order].copy() for column in columns)


def between(before, after, share):
    """Between two ticks, ``share`` of the way."""
    xy, forward, velocity = ((1.0 - share) * a + share * b for a, b in zip(before[1:], after[1:], strict=True))
    size = np.hypot(*forward.T)[:, None]
    return after[0], xy, np.where(size > 1e-9, forward / np.maximum(size, 1e-9), after[2]), velocity
