"""What is in the tilesets: the kinds of ground, and the speeds one can paint.

The order is the tile ids that saved levels use: add at the end only.
"""

TILE = 32  # px
COLUMNS = 8


def _ground(name, colour, walkable=True, speed_factor=1.0, cost=1.0, blocks_view=False):
    return {
        "name": name,
        "colour": colour,
        "walkable": walkable,
        "speed_factor": speed_factor,
        "cost": cost,
        "blocks_view": blocks_view,
    }


# speed factors and costs by eye
TERRAINS = [
    _ground("grass", "#9cb86a"),
    _ground("meadow", "#aac476"),
    _ground("dry grass", "#c9bb7c"),
    _ground("dirt", "#b08d62"),
    _ground("road", "#cbb993", speed_factor=1.1, cost=0.7),
    _ground("sand", "#e0d2a0", speed_factor=0.85, cost=1.3),
    _ground("gravel", "#b3ada0", speed_factor=0.9, cost=1.2),
    _ground("mud", "#83705a", speed_factor=0.5, cost=3.0),
    _ground("rock", "#928d86", speed_factor=0.7, cost=2.5),
    _ground("cliff", "#5f5a55", walkable=False, cost=1.0, blocks_view=True),
    _ground("deep water", "#4f86b5", walkable=False),
    _ground("water", "#6ea6cc", speed_factor=0.8, cost=1.5),
    _ground("shallows", "#9cc8dc", speed_factor=0.6, cost=2.0),
    _ground("snow", "#eef1f4", speed_factor=0.75, cost=1.5),
    _ground("forest floor", "#6f8f52", speed_factor=0.85, cost=1.4),
    _ground("thicket", "#47683c", speed_factor=0.4, cost=5.0, blocks_view=True),
]


def _speed(max_speed=0.0, factor=1.0):
    return {"max_speed": max_speed, "factor": factor}


SPEEDS = [
    _speed(max_speed=0.25),
    _speed(max_speed=0.5),
    _speed(max_speed=1.0),
    _speed(max_speed=2.0),
    _speed(max_speed=4.0),
    _speed(max_speed=8.0),
    _speed(max_speed=16.0),
    _speed(factor=0.25),
    _speed(factor=0.5),
    _speed(factor=0.75),
    _speed(factor=1.25),
    _speed(factor=1.5),
    _speed(factor=2.0),
]
