"""A pasture to play in: a few sheep, a stone, a guide and a timed command; and runs of it without a session."""

from functools import lru_cache

from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import shipped_species
from flockbrush.engine.recording import first_difference, open_recording
from flockbrush.engine.state import state_hash
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tiled import project_files
from flockbrush.systems.edits import Paint

from flockbrush.runs.run import rebuild, start

GOAT = shipped_species().get("sheep").source


@lru_cache(maxsize=1)
def tiles():
    """What `write_project` writes: the same for every pasture, so that it is drawn once."""
    return project_files(shipped())


def pasture(folder, name="pasture", sheep=9, script=True, boundary="wall", **flock):
    """The path of a new level, 24 x 16 m: sheep march past a stone; after a quarter second they swarm."""
    (folder / "tilesets").mkdir(parents=True, exist_ok=True)
    for file, content in tiles().items():
        (folder / file).write_bytes(content)
    sketch = LevelSketch(24, 16, 1.0, "tilesets", boundary, 3)
    sketch.ground("grass")
    sketch.box("Obstacle", 16, 8, 2, 2, "stone")
    sketch.draw("Guide", [(3, 8), (21, 8)], "way", closed=False, radius=4)
    if sheep:
        flock = {"species": "sheep", "brush": "march", "count": sheep, "heading": "east", **flock}
        sketch.box("Spawn", 6, 8, 6, 6, "flock", **flock)
    if script:
        sketch.draw("Key", [(1, 1)], "loosen", at=0.25, command="SwitchBrush", brush="swarm")
    return sketch.save(folder / f"{name}.tmj")


WARY = """schema = "flockbrush.program/1"

[state.calm]
brush = "march"

[state.wary]
brush = "swarm"
for = "2..3 s"
then = "calm"

[[trigger]]
from = "calm"
to = "wary"
when = { event = "alarm" }
"""


def of_ones_own(folder, **options):
    """A pasture whose animals are of the designer's own species, and follow the designer's own program."""
    for name, source in (("programs/wary.program.toml", WARY.encode()), ("species/goat.species.toml", GOAT)):
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_bytes(source)
    return pasture(folder, species="goat", program="wary", **options)


def stroke(brush, x, y, radius):
    """A dab of behaviour on the ground."""
    return Paint("brush", brush, x, y, x, y, radius)


def straight_run(path, commands, ticks, **options):
    """{tick: hash} of a run without a session: these (tick, command) beside the level's script."""
    simulation = start(path, **options)
    for tick, cmd in commands:
        simulation.submit(cmd, tick)
    hashes = {0: state_hash(simulation.world)}
    while simulation.clock.tick < ticks:
        simulation.tick()
        hashes[simulation.clock.tick] = state_hash(simulation.world)
    simulation.close()
    return hashes


def verified(path):
    """A recording lived again from nothing but its file; the last tick when every hash is the same."""
    run = open_recording(path)
    simulation = rebuild(run)
    assert first_difference(run, simulation.world, simulation.tick) is None
    simulation.close()
    return run


def by_hand(session, branch=None):
    """(tick, command) of a branch without those of the level's script."""
    branch = session.branches[branch or session.branch_name]
    script = [entry[:2] for entry in branch.script]
    return [entry for entry in branch.commands if entry not in script]


def texts(session):
    """What a session has said, in words."""
    return [notice.text for notice in session.notices()]


def advance(session, wall_seconds, budget_s):
    """A whole frame of a session at once: the ticks that have passed."""
    session.catch_up(wall_seconds, budget_s)
    session._behind, session._passed = 0.0, 0
    session.set_off(budget_s)
    session._collect()
    ticks, session._passed = session._passed, 0
    session._pace.passed(0.0, ticks * session.scene.clock.dt)
    return ticks
