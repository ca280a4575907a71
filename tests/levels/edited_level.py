"""A small level under an editor, and a copy of a shipped one, alive and edited as in the playground."""

from flockbrush.behaviours.brush import shipped
from flockbrush.levels.editor import Editor
from flockbrush.levels.level_writer import Document
from flockbrush.levels.reader import read_level_text
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from small_level import level


def small(*layers, **more):
    """The document of a small level: ten by ten tiles of 2 m."""
    return level(*layers, nextobjectid=20, nextlayerid=9, **more)


def editor(*layers, path="small.tmj", **more):
    return Editor(Document(small(*layers, **more), path), shipped())


def done(edit, *commands, **more):
    edit.do("edit", list(commands), **more)
    return edit


def read(edit):
    """The level as it would be saved, read again."""
    return read_level_text(edit.text().encode(), edit.path, shipped())


def names_on(simulation):
    names = [*simulation.world.resource(Palette).names, ""]
    return [[names[k] for k in row] for row in simulation.world.resource(Landscape).brush.tolist()]
