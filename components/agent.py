"""The components of every animal, with one column per field."""

import numpy as np
from flockbrush.components.formation import FormationPlace, Lost
from flockbrush.components.program_state import ProgramState
from flockbrush.engine.columns import Component, Field

FOLLOWER, LEADER = 0, 1
BY_HEADING, BY_ACCELERATION, BY_VELOCITY = 0, 1, 2  # what moves a body in the air
SETTLED, LANDING, TAKING_OFF = 0, 1, 2  # between media
NOWHERE, DIRECTION, POINT = 0, 1, 2  # where a migrating animal is bound


class Position(Component):
    """Metres east, north and up of the level's south-west corner."""

    xyz = Field((0.0, 0.0, 0.0))


class Velocity(Component):
    """The velocity of the animal in the last tick, m/s."""

    xyz = Field((0.0, 0.0, 0.0))


class Heading(Component):
    """The heading of the body, a unit vector.  Direction is separate from speed (Gong et al. 2025, eq. 2)."""

    forward = Field((1.0, 0.0, 0.0))


class Body(Component):
    """A capsule along the heading; a disc where its ``axis`` is 0."""

    length = Field(1.0)  # m, nose to tail: the unit of the models
    radius = Field(0.2)  # m, half the width
    axis = Field(0.3)  # m, half the length of the capsule's axis: what touches and hides


class Species(Component):
    """What kind of animal this is, as an index into the level's list of species."""

    index = Field(0, np.int32)


class Role(Component):
    """LEADER (1) sees at most two neighbours and follows the navigation field; FOLLOWER (0) obeys the herd."""

    leader = Field(FOLLOWER, np.uint8)


class Leading(Component):
    """An animal that was appointed to lead, and where it is steered."""

    optional = True
    appointed = Field(0, np.uint8)
    kind = Field(NOWHERE, np.uint8)  # how it is steered: NOWHERE follows the guides
    target = Field((0.0, 0.0))  # m for POINT; a vector of length at most 1 for DIRECTION


class ReferenceBird(Component):
    """The animal this one keeps its place by: an entity id, 0 for none."""

    entity = Field(0, np.int64)


class Vision(Component):
    """View range and field of view of the animal."""

    range = Field(4.0)  # m
    field_of_view = Field(2 * np.pi)  # rad, full angle


class BrushBinding(Component):
    """Which brush moves the animal, and which one did before while the two blend.

    Indices into the world's `Palette`.
    """

    brush = Field(0, np.int32)
    previous = Field(0, np.int32)
    blend = Field(1.0)  # 0: still the previous brush, 1: the brush alone
    home = Field(0, np.int32)  # the brush it was born with, taken up again on unpainted ground


class Speed(Component):
    """The Ornstein-Uhlenbeck state (Gong et al. 2025, eq. 6) and what becomes of it."""

    drawn = Field(0.0)  # m/s, the process alone
    effort = Field(1.0)  # the pace that the model wishes, reached gradually
    target = Field(0.0)  # m/s, after slope, surface, density and caps: what the animal tries to do


class Ground(Component):
    """The ground under the animal."""

    factor = Field(1.0)  # surface, painted factors: multiplies speed
    cap = Field(np.inf, finite=False)  # m/s, painted maximum
    slope = Field((0.0, 0.0))  # rise per metre, east and north
    guidance = Field((0.0, 0.0))  # the navigation field: direction, length at most 1


class Destination(Component):
    """Which goal of the level the animal is bound to: -1 for none."""

    goal = Field(-1, np.int32)


class Memory(Component):
    """The place where the animal last saw others; a stray returns there."""

    herd = Field((0.0, 0.0))  # m
    known = Field(0, np.uint8)


class Individual(Component):
    """How this animal differs from others of its species; its size is in `Body`."""

    optional = True
    pace = Field(1.0)  # times the speed that its brush wants
    boldness = Field(1.0)  # times as near a danger may come before it is noticed


class Family(Component):
    """The family that an animal was born into: a group inside its group."""

    optional = True
    number = Field(0, np.int32)  # the smallest id that was born into it; 0: no family


class Alarm(Component):
    """The alarm of the animal, which lasts for a while after the danger is out of sight."""

    optional = True
    level = Field(0.0)  # 0 calm, 1 full fear
    place = Field((0.0, 0.0, 0.0))  # m, where the danger was last seen


class Wish(Component):
    """The wish of the models in this tick.  Rewritten every tick."""

    direction = Field((1.0, 0.0, 0.0))  # unit vector
    pace = Field(1.0)  # multiplies the speed (a sprint, a halt)


class Urge(Component):
    """The share of the body's limits that drives used in this tick, and the speed they ask for."""

    optional = True
    share = Field(0.0)  # 0: the model alone
    speed = Field(0.0)  # m/s that are wished while drives act
    driven = Field(0, np.uint8)  # 1 until the speed is again what the brush says


class Transit(Component):
    """The transition between media: a bird that lands or takes off."""

    optional = True
    kind = Field(SETTLED, np.uint8)


class Airborne(Component):
    """How a body is held in the air; its heading and `up` are two axes of its own frame, at right angles."""

    optional = True
    up = Field((0.0, 0.0, 1.0))  # unit vector out of the back: where it leans, the animal banks


class Thrust(Component):
    """The wish of a model in the air.  Rewritten every tick."""

    optional = True
    kind = Field(BY_HEADING, np.uint8)
    acceleration = Field((0.0, 0.0, 0.0))  # m/s^2
    velocity = Field((0.0, 0.0, 0.0))  # m/s


class Migration(Component):
    """The migratory urge's own register: where the animal is bound, and where that is moving (Reynolds 1987)."""

    optional = True
    kind = Field(NOWHERE, np.uint8)
    target = Field((0.0, 0.0, 0.0))  # m for a point; a vector for a direction
    next = Field((0.0, 0.0, 0.0))  # what `target` becomes, evenly
    left = Field(0.0)  # s until it has


AGENT = (
    Position,
    Velocity,
    Heading,
    Body,
    Species,
    Role,
    ReferenceBird,
    Vision,
    BrushBinding,
    Speed,
    Ground,
    Destination,
    Memory,
    Wish,
    Airborne,
    Thrust,
    Migration,
    FormationPlace,
    Lost,
    Individual,
    Family,
    Alarm,
    Urge,
    ProgramState,
    Transit,
    Leading,
)
