"""What is in the tileset of speeds that one can paint.

The order is the tile ids that saved levels use: add at the end only.
"""

TILE = 32  # px
COLUMNS = 8


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
