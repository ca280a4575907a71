"""Small flocks of boids."""

import numpy as np
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.models.boids import URGES, Params
from flockbrush.components import Body
from flockbrush.systems.steer import scene_of

BOIDS = behaviours()["boids"]


def only(*urges, **more):
    """Parameters by which birds have no other urges than these."""
    return {f"{urge}_strength": 0.0 for urge in URGES if urge not in urges} | more


def wishes_of(simulation, tick=True, **parameters):
    """What the model wishes for all birds of a world, body lengths / s^2, as shares of the most."""
    if tick:
        simulation.tick()
    p = Params(**parameters)
    wishes = BOIDS.steer(scene_of(simulation.world), np.arange(len(simulation.agents), dtype=np.int32), p)
    return wishes.acceleration / (simulation.agents[Body.length][:, None] * p.max_acceleration * p.max_speed)
