"""Pictures of a running simulation: the herd for painters, and painters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.components import Body, Position
from flockbrush.runs.snapshots import Moment

IN_SPACE = (1280, 720)  # pixels of a picture in space
WORDS = 90  # pixels for title, legend and scale


def herd_of(simulation, moment: Moment):
    """The animals of a moment as the painter wants them."""
    from flockbrush.render.drawn_herd import DrawnHerd
    from flockbrush.render.gaits import Gaits, above_ground, in_flight, wings_of
    from flockbrush.render.leader_marks import LeaderMarks
    from flockbrush.render.mesh_bodies import Postures
    from flockbrush.render.per_run import of_run
    from flockbrush.render.wakes import wakes_of
    from flockbrush.runs.catalogue import catalogue_of

    palette, gaits = catalogue_of(simulation.world, labels=()).palette, of_run(Gaits, simulation)
    clip, phase = gaits.of(moment)
    flying = in_flight(simulation.world, moment)
    danger = palette.danger.astype(bool)
    return DrawnHerd(
        xy=moment.xyz[:, :2],
        forward=moment.forward,
        length=moment.length,
        radius=moment.radius,
        leader=of_run(LeaderMarks, simulation).of(moment),
        brush=moment.brush,
        species=moment.species,
        brush_colours=tuple(brush.colour for brush in palette.brushes),
        brush_names=tuple(palette.names),
        predator=danger[moment.brush] if len(danger) else None,
        ids=moment.ids,
        z=above_ground(simulation.world, moment.xyz, moment.length),
        wings=wings_of(clip, phase, flying) if flying.any() else None,
        up=moment.up,
        postures=Postures(gaits.limbs().look[moment.species], clip, phase),
        wakes=wakes_of(simulation, moment, clip, flying),
    )


def painter_of(simulation, size=None, theme="light", view="plan", azimuth=90.0, elevation=None, clean=False, dust=True):
    """A painter for a running world: of the plan with the level's proportions unless a size is given, or of space.

    `azimuth` and `elevation`, in degrees, say from where one looks in space: counter-clockwise from east, and upwards;
    flocks in the air are looked at from lower down than herds on the ground by default.  `clean` leaves out words,
    trails and all that only the designer sees, and dust and ripples behind the animals, as does `dust` = False.
    """
    from flockbrush.render import Painter, Scenery
    from flockbrush.render.scenery import BareScenery

    scenery = BareScenery(simulation) if clean else Scenery(simulation)
    options = {"words": False, "trails": None} if clean else {}
    if view != "space":
        size = size or picture_size(simulation.level, words=0 if clean else WORDS)
        plan = Painter(scenery, size=size, theme=theme, **options)
        plan.dust = dust and not clean
        return plan
    from flockbrush.render.space_view import SpacePainter

    painter = SpacePainter(scenery, size or IN_SPACE, theme, **options)
    painter.dust, painter.bare = dust and not clean, clean
    if elevation is None:
        from flockbrush.render.gaits import above_ground

        agents = simulation.agents
        length = agents[Body.length]
        flying = len(agents) and (above_ground(simulation.world, agents[Position.xyz], length) > length).mean() > 0.5
        elevation = 14.0 if flying else 30.0
    painter.look(replace(painter.camera, azimuth=np.radians(azimuth), elevation=np.radians(elevation)))
    return painter


def picture_size(level, across=1920, ground=960, words=WORDS):
    """(width, height) in even pixels of a picture with a level's proportions, and room above and below for words."""
    scale = min(across / level.width, ground / level.height)
    width, height = max(640.0, scale * level.width), max(200.0, scale * level.height)
    return 2 * round(width / 2), 2 * round((height + words) / 2)
