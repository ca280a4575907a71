"""Small levels to run: a pen with a few sheep, a stone, a guide and a timed command."""

from flockbrush.behaviours.brush import shipped
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tiled import write_project


def pen(folder, name="pen", sheep=24, seed=3, script=True, boundary="wall", size=(40, 30)):
    """The path of a new level: sheep march east along a guide, past a stone; after a quarter second they swarm."""
    write_project(folder, shipped())
    nx, ny = size
    sketch = LevelSketch(nx, ny, 1.0, "tilesets", boundary, seed)
    sketch.ground("grass")
    sketch.box("Obstacle", 24, 15, 4, 4, "stone")
    sketch.draw("Guide", [(4, 15), (20, 10), (36, 15)], "way", closed=False, radius=4)
    if sheep:
        sketch.box("Spawn", 10, 15, 12, 12, "flock", species="sheep", brush="march", count=sheep, heading="east")
    sketch.draw("Line", [(12, 0), (12, 30)], "gate", closed=False)
    sketch.box("Area", 10, 15, 20, 30, "west")
    if script:
        sketch.draw("Key", [(1, 1)], "loosen", at=0.25, command="SwitchBrush", brush="swarm")
    return sketch.save(folder / f"{name}.tmj")
