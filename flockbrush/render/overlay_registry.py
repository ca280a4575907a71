"""Which overlays there are: ours, and classes that others register."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from flockbrush.engine.plugins import PluginError, blaming, load_entry_points, load_modules
from flockbrush.render import own_overlays
from flockbrush.render.canvas import Canvas


@dataclass(frozen=True)
class Overlay:
    """One thing that can be shown: its name, and what a designer reads."""

    name: str
    title: str
    tip: str
    below: bool = False  # lies between ground and animals
    of_one: bool = False  # shows something of the selected animal
    in_space: bool = False  # drawn over the animals in space, too; others lie on the ground there, or are left out
    looks_at_world: bool = False  # and not only at the moment and the ground: while it is drawn no tick may run
    draw: Callable[[OverlayView], None] | None = None  # of those registered with `overlay`

    def drawn(self, view: OverlayView, failed: Callable[[str, PluginError], None] | None = None):
        """Draw it, if it was registered with `overlay`; ``failed(name, error)`` hears of what others do wrong."""
        if self.draw is None:
            return
        try:
            with blaming("overlay", self.name, self.draw.__module__):
                self.draw(view)
        except PluginError as error:
            if failed is None:
                raise
            failed(self.name, error)


class OverlayView(NamedTuple):
    """What an overlay draws into, and what it may draw."""

    canvas: Canvas
    camera: Any  # `camera.pixels(xyz)` gives pixels (n, 2)
    moment: Any  # what is shown: ids, xyz, forward ...
    world: Any
    theme: Any
    selected: int | None
    unit: float  # pixels of a hairline: 1 at 1280 x 720, more on larger pictures


EXPLAINED = frozenset({"forces", "field_of_view", "occlusion"})  # these show what `explain` says of an animal
OVERLAYS = {
    overlay.name: overlay
    for overlay in (
        Overlay("forces", "Forces", "Forces on the selected animal: one arrow for each force", of_one=True),
        Overlay("field_of_view", "Field of view", "View range and field of view of the selected animal", of_one=True),
        Overlay(
            "occlusion",
            "Hidden areas",
            "Areas that bodies and obstacles hide from the selected animal",
            of_one=True,
            looks_at_world=True,
        ),
        Overlay(
            "links",
            "Visible neighbours",
            "A line between animals that see each other; lines of the selected animal are highlighted",
            looks_at_world=True,
        ),
        Overlay(
            "leaders",
            "Leaders",
            "A ring around each leader, and a line from each bird to its reference bird",
            in_space=True,
        ),
        Overlay("density", "Density", "Animals per square metre", below=True),
        Overlay(
            "walkable",
            "Walkable",
            "Hatches areas where animals cannot walk: water, rock and obstacles",
            below=True,
        ),
        Overlay("regions", "Brush regions", "The painted brushes in strong colours, with their names", below=True),
        Overlay("caps", "Speed limits", "Areas with speed limits, and their limits", below=True),
        Overlay(
            "navigation",
            "Direction field",
            "Directions that leaders follow to guides and goals",
            below=True,
            looks_at_world=True,
        ),
    )
}


def overlay(cls):
    """Register a class with ``name``, ``title``, ``tip`` and ``draw(self, view: OverlayView)`` as an overlay.

    ``below = True`` draws it under the animals, ``in_space = True`` in space as well.  The View tab lists it, and
    `Overlays` draws it where its name is shown.  A class of the same name and module replaces the one before.

    Raises
    ------
    ValueError
        When the name is taken.
    """
    known = OVERLAYS.get(cls.name)
    if known is not None and (known.draw is None or known.draw.__self__.__class__.__module__ != cls.__module__):
        raise ValueError(f"overlay {cls.name!r} is registered already")
    below, in_space = getattr(cls, "below", False), getattr(cls, "in_space", False)
    OVERLAYS[cls.name] = Overlay(cls.name, cls.title, cls.tip, below, False, in_space, True, cls().draw)
    return cls


@cache
def load_overlays():
    """Import what lies in `flockbrush.render.own_overlays`, and what others have under ``flockbrush.overlays``."""
    load_modules(own_overlays)
    load_entry_points("flockbrush.overlays")
