"""What a bird in a line formation knows of its place."""

import numpy as np
from flockbrush.engine.columns import Component, Field


class FormationPlace(Component):
    """Whom the bird follows, and where its place is from there (Klotsman & Tal, section 6)."""

    optional = True
    reference = Field(0, np.int64)  # entity id of the reference bird, 0 for none
    arm = Field(0, np.int8)  # side of the leader: -1 left, 1 right, 0 open
    place = Field(-1, np.int32)  # 0 leads, 1 is next on its arm ...; -1 open
    offset = Field((0.0, 0.0))  # m, to the right of and ahead of the reference bird; of leaders see `Lost`
    track = Field((0.0, 0.0))  # unit vector the flock flies along; (0, 0): in no flock
    climb = Field(0.0)  # m/s, to keep clear of others on the way and come back to the flock's height
    led = Field(0.0)  # s since this bird took the lead
    gust = Field((0.0, 0.0, 0.0))  # m/s, what blows at the bird
    wind = Field((0.0, 0.0, 0.0))  # m/s, what it feels of that by now
    felt = Field((0.0, 0.0, 0.0))  # m/s, what it felt in the last tick: so much of its velocity is not its own
    lull = Field(1.0)  # s in which the gust dies down


class Lost(Component):
    """Who led the skein of a bird in formation, and where that one would be now, bound for where this one is.

    While a bird flies in less than that company, it keeps that in mind; a skein that is less than half of what one of
    it remembers makes for there, and ``FormationPlace.offset`` of its leader is m east and north to where.
    """

    optional = True
    entity = Field(0, np.int64)  # 0: none
    place = Field((0.0, 0.0))  # m
    velocity = Field((0.0, 0.0))  # m/s
    ticks = Field(0, np.int32)  # since the bird was in that skein
    company = Field(0, np.int32)  # birds of that skein
