"""Pictures of a living level, one frame after another."""

from __future__ import annotations

import numpy as np

from flockbrush.render.animal_figures import KINDS, NO_WINGS, SHADOW
from flockbrush.render.drawn_ground import brush_key
from flockbrush.render.drawn_herd import EMPTY, DrawnHerd, checked
from flockbrush.render.hud import Hud, Layout, things_of
from flockbrush.render.mesh_bodies import FROM, large, meshes, usual_lengths
from flockbrush.render.shapes import FrameBuffer
from flockbrush.render.sprites import Sprites, Stamps, looks_of
from flockbrush.render.style import PALETTE, PLAN_SUN, Theme, rgb, theme_of, worn
from flockbrush.render.tiles import Tiles
from flockbrush.render.top_views import MOST_ABOVE, DrawnBodies, draw_plan, draw_shadows, from_above, top_views
from flockbrush.render.trails import Trails
from flockbrush.render.view_camera import ViewCamera, checked_size
from flockbrush.render.wakes import wakes_on_plan


class Painter:
    """Draws the animals of a level.

    The ground is drawn once and copied; a frame costs what its animals cost.

    Parameters
    ----------
    level : Level
        Or anything with `width` and `height` in metres; what it lacks is not drawn.
    size : (int, int)
        Width and height of the picture, pixels.
    theme : {"light", "dark"} or Theme
    brushes : dict of str to "#rrggbb", optional
        Colours of brushes by name, for those painted on the level; others are found among the shipped brushes, and
        those that a herd brings are learned from it.
    trails : float or None
        How long trails are to be seen, seconds; None or 0 for no trails.
    words : bool
        Leave room for title, legend and scale bar.  Pictures under 300 x 200 have none.
    labels : bool, optional
        Write the names of goals, exits and lines on the ground; where there is room for words, by default.
    shadows : bool
    live : bool
        For a window: the ground is shown as far as it is drawn, and `refine` goes on with it; else it is always whole.

    Attributes
    ----------
    limbs : float
        Pixels of an animal's length or width from which it has legs and wings.
    dust : bool
        Draw dust behind runners and ripples behind swimmers, for herds with wakes.
    """

    limbs, dust = FROM, True

    def __init__(
        self,
        level,
        size=(1280, 720),
        theme="light",
        brushes=None,
        trails=3.0,
        words=True,
        labels=None,
        shadows=True,
        live=False,
    ):
        self.level, self.size, self.theme = level, checked_size(size), theme_of(theme)
        self.brushes = {brush_key(name): rgb(colour) for name, colour in (brushes or {}).items()}
        self.things = things_of(level)
        self.layout = (
            Layout.of(self.size, 2 if self.things else 1) if words else Layout(self.size, _unit(self.size), 0, 0, 0)
        )
        self.shadows, self.live = shadows, live
        self.hud = Hud(self.layout, self.theme)
        self.home = ViewCamera.fit(level.width, level.height, self.size, self.layout.view, self.layout.pad)
        self.camera = self.home  # where the ground lands in the picture; `look` changes it
        self.trails = Trails(trails) if trails else None
        labels = bool(self.layout.font) if labels is None else labels
        self.tiles = Tiles(level, self.theme, self.layout.unit, self.brushes, labels)
        self.backdrop: np.ndarray | None = None  # a picture of one's own instead of the level
        self._bar = 0.0
        self._depth: np.ndarray | None = None  # nothing hides animals on the plan
        self._taught: tuple = ()
        self._looked = False  # whether the ground is that of the camera
        self._stamps: Stamps | None = None
        self._stamp_key = None

    def look(self, camera: ViewCamera):
        """Look at another part of the level from now on; the trails move along.

        The old ground is shown, shifted or scaled, until it is drawn anew: by `refine`, or when next needed.
        """
        if camera != self.camera:
            self.camera = camera
            self._looked = False

    def repaint(self, box):
        """Draw a part of the ground anew: (west, south, east, north) in metres, or "all".

        What it costs depends on the box alone; the picture is the very one that drawing the whole would give.
        """
        if self._ready():
            self._know_painted_brushes()
            self.tiles.repaint(box)

    def refine(self, budget=0.004) -> bool:
        """Go on drawing the ground for about so many seconds; True when nothing is left to draw."""
        self._ready()
        return self.tiles.refine(budget)

    def _ready(self):
        """Let the ground follow the camera; False when it is new anyway."""
        if self._looked:
            return True
        first = self.tiles.camera is None
        if first:
            self._know_painted_brushes()
        self.tiles.look(self.camera)
        self._around()
        self._looked = True
        return not first

    def _around(self):
        """Draw what stands around the level."""
        self.hud.things(self.tiles.image, self.things)
        self._bar = self.hud.scale_bar(self.tiles.image, self.camera)

    @property
    def ground(self) -> np.ndarray:
        """The level without animals, (h, w, 3) uint8; shared, do not write to it."""
        if self.backdrop is not None:
            return self.backdrop
        self._ready()
        if not self.live:
            self._follow()
            self.tiles.complete()
        return self.tiles.image

    def _follow(self):
        """Draw anew what has changed on a level that lives (`Scenery`)."""
        for box in getattr(self.level, "changes", list)():
            self.repaint(box)

    def frame(
        self,
        herd: DrawnHerd = EMPTY,
        time=None,
        title=None,
        measures=None,
        legend=True,
        trails=True,
        out=None,
        under=None,
    ):
        """The animals of one moment on their ground.

        Parameters
        ----------
        herd : Herd
            Animals at a place or heading that is not a number are refused.
        time : float, optional
            Seconds on the clock; also tells how far trails have faded since the last frame (1/30 s when not given).
        title : str, optional
            The level's name unless given.
        measures : str or dict of str to float, optional
        legend : bool
        trails : bool or Trails
            Whether to draw trails, or trails of one's own to draw.
        out : (h, w, 3) uint8 array, optional
            Draw into this one, and return it.
        under : callable, optional
            Draws on the frame it is given what lies on the ground below the animals (`Overlays.under`).

        Returns
        -------
        (h, w, 3) uint8
            Red, green, blue; the first row is the top.

        Raises
        ------
        ValueError
            When a column does not fit or is not finite, naming the animal.
        """
        herd = checked(herd)
        herd = herd._replace(brush_colours=worn(herd.brush_colours, self.theme))
        self._learn(herd)
        frame = copied(self.ground, out)
        if under is not None:
            under(frame)
        stamps = self._stamps_of(herd)
        look = looks_of(herd, len(stamps.brush_colours))
        self._trails_of(trails, frame, herd, look // KINDS, stamps, time)
        if self.dust:
            wakes_on_plan(self._buffer(frame), self.camera, self.theme, herd, time)
        self._animals(frame, herd, look, stamps)
        self._words(frame, herd, title, time, measures, legend, stamps)
        return frame

    @property
    def _clip(self):
        return np.array(self.camera.view, np.int64)

    def _animals(self, frame, herd, look, stamps):
        at, winged = self.camera.pixels(herd.xy), np.isfinite(herd.wings)
        forward = herd.forward * (1.0, -1.0)
        beats = np.where(winged, herd.wings, NO_WINGS)
        lift = np.maximum(herd.z, winged * herd.length) * (0.35 * self.camera.scale)
        below = np.stack([0.8 * lift, lift], axis=1)
        big = large(herd, usual_lengths(herd) * self.camera.scale, True, self.limbs)
        if self.live and self._in_view(at[big], herd.length[big]).sum() > MOST_ABOVE:
            big = np.zeros_like(big)
        standing = herd.z if self.shadows else np.ones(len(at))
        animals = Sprites(at, forward, herd.length, herd.radius, look, standing, beats)
        flying = ((herd.z > 0) | winged) & self.shadows & ~big
        if flying.any():
            flat_wings = np.where(winged & ~herd.predator, 0.0, NO_WINGS)
            shade, aloft = look // KINDS * KINDS + SHADOW, np.ones(len(at))
            self._stamp(frame, flying, animals._replace(at=at + below, look=shade, z=aloft, beats=flat_wings))
        self._stamp(frame, ~big, animals)
        if not big.any():
            return
        lift = 0.10 * herd.length * self.camera.scale + 0.45
        below = np.where((herd.z > 0)[:, None] | winged[:, None], below, np.stack([0.8 * lift, lift], axis=1))
        shade = np.where(winged, 0.5, 1.0) * stamps.colours[look, 6, 0]
        bodies = DrawnBodies(animals, herd.xy, below, shade, herd.postures)
        self._with_legs(frame, np.flatnonzero(big & self._in_view(at, herd.length)), bodies)

    def _stamp(self, frame, rows, animals):
        """Animals of these rows (bool) without legs."""
        if not rows.all():
            animals = Sprites(*(column[rows] for column in animals))
        self._stamps.draw(frame, self._clip, animals, self.camera.scale)

    def _with_legs(self, frame, rows, bodies):
        """Animals of these rows, which are large enough in the picture for legs and wings."""
        buffer, views, stamps = self._buffer(frame), top_views(), self._stamps
        if self.shadows:
            draw_shadows(frame, buffer.clip, self.camera.scale, rows, bodies, views, meshes(), stamps.colours)
        draw_plan(
            buffer, from_above(self.camera), rows, bodies, views, meshes(), stamps.colours, stamps.halos, PLAN_SUN
        )

    def _buffer(self, frame):
        """The frame with nothing that hides animals."""
        if self._depth is None:
            self._depth = np.zeros(frame.shape[:2], np.float32)
        return FrameBuffer(frame, self._depth, self._clip)

    def _in_view(self, at, length):
        reach = 2.0 * length[:, None] * self.camera.scale
        return ((at + reach > self._clip[:2]) & (at - reach < self._clip[2:])).all(axis=1)

    def _trails_of(self, trails, frame, herd, brush, stamps, time):
        trails = self.trails if trails is True else trails
        if not trails:
            return
        colours = stamps.colours[::KINDS, 0]
        trails.frame(frame, self._clip, self.camera, herd.xy, herd.ids, brush, colours, self.theme.trail, time)

    def _words(self, frame, herd, title, time, measures, legend, stamps):
        self.hud.above(frame, getattr(self.level, "name", "") if title is None else title, time, measures)
        if legend:
            self.hud.legend(frame, self._bar, herd, stamps.colours, brushes_in_sight(self.level))

    # colours ---------------------------------------------------------------------

    def _stamps_of(self, herd) -> Stamps:
        colours = brush_rgb(herd.brush_colours)
        if self._stamps is None or colours.tobytes() != self._stamp_key:
            self._stamps, self._stamp_key = Stamps(colours, self.theme), colours.tobytes()
        return self._stamps

    def _learn(self, herd):
        """Take the colours of painted brushes from the herd that has them."""
        if not len(herd.brush_names):
            return
        known = (herd.brush_names, brush_rgb(herd.brush_colours).tobytes())
        if known == self._taught:
            return
        self._taught = known
        colours = map(tuple, brush_rgb(herd.brush_colours).tolist())
        by_name = dict(zip(map(brush_key, herd.brush_names), colours, strict=False))
        painted = painted_brushes(self.level)
        news = {name: colour for name, colour in by_name.items() if self.brushes.get(name) != colour}
        self.brushes |= news
        if any(name in painted for name in news):
            self.repaint("all")

    def _know_painted_brushes(self):
        """Find the colours of painted brushes that were not given."""
        known = getattr(self.level, "brush_colours", {})
        for name, colour in zip(known, worn(tuple(known.values()), self.theme), strict=True):
            self.brushes[brush_key(name)] = rgb(colour)
        unknown = [name for name in painted_brushes(self.level) if name not in self.brushes]
        if unknown:
            known = shipped_colours()
            for name in unknown:
                self.brushes[name] = known.get(name, rgb(PALETTE[len(self.brushes) % len(PALETTE)]))


def copied(picture: np.ndarray, out: np.ndarray | None) -> np.ndarray:
    """A copy of a picture, in ``out`` if that is given; ValueError where it does not fit there."""
    if out is None:
        return picture.copy()
    if out.shape != picture.shape or out.dtype != np.uint8 or not out.flags.c_contiguous:
        raise ValueError(f"out must be a contiguous uint8 array of shape {picture.shape}, got {out.dtype} {out.shape}")
    np.copyto(out, picture)
    return out


def _unit(size):
    return float(np.clip(min(size[0] / 1280, size[1] / 720), 0.45, 6))


def brush_rgb(colours) -> np.ndarray:
    """Colours as (k, 3) uint8, from an array or from strings."""
    if isinstance(colours, np.ndarray) and colours.dtype == np.uint8:
        return colours.reshape(-1, 3)
    return np.array([rgb(colour) for colour in colours], np.uint8).reshape(-1, 3)


def painted_brushes(level) -> list[str]:
    """Names of the brushes that are painted on a level, or apply in its zones."""
    layers = [asset for layer in getattr(level, "brush_layers", None) or [] for asset in layer.assets]
    zones = [zone.brush for zone in getattr(level, "zones", None) or [] if zone.brush]
    return list(dict.fromkeys(brush_key(name) for name in [*layers, *zones]))


def brushes_in_sight(level) -> set[str]:
    """Names of the brushes that some cell of a level is painted with, or that apply in its zones."""
    visible = {brush_key(zone.brush) for zone in getattr(level, "zones", None) or [] if zone.brush}
    for layer in getattr(level, "brush_layers", None) or []:
        counts = np.bincount(np.maximum(np.asarray(layer.index).ravel(), -1) + 1, minlength=len(layer.assets) + 1)
        visible |= {brush_key(name) for name, count in zip(layer.assets, counts[1:], strict=False) if count}
    return visible


def shipped_colours() -> dict:
    """Colours of the brushes that come with Flockbrush, by name."""
    from flockbrush.behaviours.brush import shipped

    library = shipped()
    return {name: rgb(library.get(name).colour) for name in library.names()}


__all__ = ["PALETTE", "Painter", "Theme", "brush_rgb"]
