"""What can be laid over a running herd to understand it: who sees whom, where the ways lead, how dense it is.

::

    overlays = Overlays(scenery, theme)
    frame = painter.frame(herd, under=lambda frame: overlays.under(frame, painter.camera, {"density"}, moment))
    overlays.over(frame, painter.camera, {"links", "forces"}, moment, selected)
"""

from __future__ import annotations

import numpy as np

from flockbrush.components import Body, Destination, Position, Species
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_ground import Sketcher, placed
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.explanation_cache import ExplanationCache
from flockbrush.render.forces import draw_forces, reason_colour
from flockbrush.render.overlay_layers import box_of, full_width, hearts, is_same, lattice, layer, strong
from flockbrush.render.overlay_registry import EXPLAINED, OVERLAYS, OverlayView, load_overlays
from flockbrush.render.shapes import Pose, ink_of
from flockbrush.render.strokes import (
    RAYS,
    count_in_cells,
    draw_lines,
    draw_plate,
    draw_rings,
    how_far,
    lay_mask,
    lay_over,
    links_of,
    sight_mask,
)
from flockbrush.render.style import mix, rgb, scale_colours, theme_of, worn
from flockbrush.render.text import words
from flockbrush.render.walkable_overlay import walkable_layer
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.senses import Sight

LINKS = 60_000  # lines at most
INK = 100_000  # pixels of lines at most: beyond, only some animals show theirs
LATTICE = 40  # pixels between two arrows of the navigation field
DENSITY_CELL = 12  # pixels of a cell in which animals are counted
REFRESH = 0.1  # s between two countings


class Overlays:
    """Draws overlays over the frames of one world.

    What depends only on ground and camera is kept ready, and made anew when either changes.

    Parameters
    ----------
    theme : {"light", "dark"} or Theme
    unit : float
        Pixels of a hairline.
    explanations : ExplanationCache, optional
        What other overlays of the same world were told.
    failed : callable, optional
        ``failed(name, error)`` is told which overlay of others raises a `PluginError`; without it that is raised.
    """

    def __init__(self, scenery, theme="light", unit=1.0, explanations=None, failed=None):
        load_overlays()
        self.scenery, self.theme, self.unit, self.failed = scenery, theme_of(theme), unit, failed
        self._layers: dict[str, tuple] = {}
        self._counted = (None, None, None)
        self.explanations = explanations or ExplanationCache(scenery.simulation)

    @property
    def world(self):
        """The running world."""
        return self.scenery.simulation.world

    def under(self, frame, camera, shown, moment=None, free=0):
        """Draw those of these names that lie below the animals; legends leave so many pixels `free` below them."""
        foot = camera.view[3] - free - 12 * self.unit
        if "walkable" in shown:
            self._kept(frame, camera, "walkable", (self.scenery.land.blocked,), self._walkable)
        if "regions" in shown:
            self._kept(frame, camera, "regions", self._brushes(camera), self._regions)
        if "caps" in shown:
            caps = self._caps(camera)
            self._kept(frame, camera, "caps", caps, self._cap_layer)
            foot = self._cap_legend(frame, camera, caps[0], foot)
        if "density" in shown:
            foot = self._density(frame, camera, moment, foot)
        if "navigation" in shown:
            self._kept(frame, camera, "navigation", self._ways(), self._way_layer)
        self._registered(frame, camera, shown, moment, None, below=True)

    def over(self, frame, camera, shown, moment, selected=None):
        """Draw those that lie above the animals of a moment; `selected` is an entity or None."""
        row, at = self._row(moment, selected), camera.pixels(moment.xyz)
        if "links" in shown:
            self._links(frame, camera, moment, at, row)
        if "leaders" in shown:
            self._leaders(frame, camera, moment, at)
        if row is not None:
            self._one(frame, camera, shown, moment, at, row)
        self._registered(frame, camera, shown, moment, selected, below=False)

    def _registered(self, frame, camera, shown, moment, selected, below):
        """Those of others, in the order in which they were registered."""
        for name, known in OVERLAYS.items():
            if name in shown and known.below == below:
                view = OverlayView(
                    Canvas(frame, camera.view), camera, moment, self.world, self.theme, selected, self.unit
                )
                known.drawn(view, self.failed)

    def _row(self, moment, selected):
        if selected is None or not len(moment):
            return None
        row = int(np.searchsorted(moment.ids, selected))
        return row if row < len(moment) and moment.ids[row] == selected else None

    # kept layers -------------------------------------------------------------------

    def _kept(self, frame, camera, name, made_of, prepare):
        """Lay over what `prepare(camera, made_of)` returns, made once for the same things and camera."""
        known = self._layers.get(name)
        if known is None or known[0] != camera or not is_same(known[1], made_of):
            draw = prepare(camera, made_of)
            self._layers[name] = known = (camera, made_of, layer(camera, self._ground(camera), draw))
        top, alpha, ink = known[2]
        if len(alpha):
            lay_over(frame[top : top + len(alpha)].reshape(-1), alpha.reshape(-1), ink.reshape(-1))

    def _sketcher(self, camera):
        """What draws regions with the very outlines that the ground has."""
        sketcher = Sketcher(
            self.scenery, camera, self.theme, self.unit, {}, np.empty((*camera.size[::-1], 3), np.uint8)
        )
        sketcher.aim(camera.view)
        return sketcher

    def _ground(self, camera):
        """The part of the picture that shows the level."""
        return self._sketcher(camera).canvas.clip

    def _cells(self, camera):
        """(rows, columns) slices of the cells in view, in steps so that they are never more than some thousand."""
        land = self.scenery.land
        left, top, right, bottom = camera.view
        low, high = camera.metres((left, bottom)) / land.cell, camera.metres((right, top)) / land.cell
        ny, nx = land.brush.shape
        sides = [(max(int(low[k]) - 1, 0), min(int(high[k]) + 2, n)) for k, n in ((1, ny), (0, nx))]
        step = max(1, *(-(-(stop - start) // 256) for start, stop in sides))
        return tuple(slice(start // step * step, max(stop, start), step) for start, stop in sides)

    def _brushes(self, camera):
        rows, columns = self._cells(camera)
        colours = self.scenery.brush_colours
        named = tuple(zip(colours, worn(tuple(colours.values()), self.theme), strict=True))
        return self.scenery.land.brush[rows, columns].copy(), rows, columns, named

    def _caps(self, camera):
        rows, columns = self._cells(camera)
        return self.scenery.land.surface[rows, columns, 1].copy(), rows, columns

    def _walkable(self, camera, made_of):
        return walkable_layer(self._sketcher(camera), self.scenery.land, self.theme, self.unit)

    # regions and caps ----------------------------------------------------------------

    def _regions(self, camera, made_of):
        _, rows, columns, colours = made_of
        regions = [(k, name, strong(rgb(colour), self.theme)) for k, (name, colour) in enumerate(colours)]
        return self._filled(camera, self.scenery.land.brush, rows, columns, regions, 0.34)

    def _cap_layer(self, camera, made_of):
        values, rows, columns = made_of
        caps = np.unique(values[np.isfinite(values)])
        regions = [(value, f"max {value:g} m/s", self._cap_colour(value, caps)) for value in caps]
        return self._filled(camera, self.scenery.land.surface[..., 1], rows, columns, regions, 0.45)

    def _filled(self, camera, raster, rows, columns, regions, alpha):
        """Draws regions of cells that have a value: (value, name, colour) each, filled, outlined and named."""
        sketcher, cell = self._sketcher(camera), self.scenery.cell
        fills, names = [], []
        if sketcher.canvas.clip[2] > sketcher.canvas.clip[0]:
            around = sketcher.cells(cell, raster.shape)
            near, in_view = raster[around], raster[rows, columns]
            for value, name, colour in regions:
                if not (in_view == value).any():
                    continue
                edge = sketcher.region(near == value, cell, (around[0].start, around[1].start))
                fills.append((np.clip(edge + 0.5, 0, 1) * alpha, np.clip(1.8 * self.unit - np.abs(edge), 0, 1), colour))
                for at in hearts(in_view == value):
                    names.append((name, self._pixel(camera, rows, columns, at), colour))

        def draw(canvas):
            left, top = sketcher.canvas.clip[:2]
            for inside, edge, colour in fills:
                canvas.blend(inside, left, top, colour)
                canvas.blend(edge, left, top, colour, 0.95)
            self._names(canvas, names, 15)

        return draw

    def _cap_colour(self, value, values):
        """Slow is dark on light ground, and light on dark ground: what stands out is where one is held up."""
        share = 0.0 if len(values) < 2 else float(np.searchsorted(values, value)) / (len(values) - 1)
        return tuple(int(c) for c in scale_colours(self.theme.name)[round(255 * (0.95 - 0.8 * share))])

    def _cap_legend(self, frame, camera, values, foot):
        caps = np.unique(values[np.isfinite(values)])
        if not len(caps):
            return self._note(frame, camera, "no speed limits in view", foot)
        canvas, u = Canvas(frame, camera.view), self.unit
        chosen = caps if len(caps) <= 6 else caps[np.linspace(0, len(caps) - 1, 6).astype(int)]
        left, wide, tall = camera.view[0] + 12 * u, 62 * u, 16 * u
        box = (left, foot - 46 * u, left + max(len(chosen) * wide + 16 * u, 140 * u), foot)
        self._panel(canvas, box, "speed limits, m/s")
        for k, value in enumerate(chosen):
            x = left + 8 * u + k * wide
            canvas.area(box_of(x, foot - 22 * u, x + tall, foot - 22 * u + tall), self._cap_colour(value, caps), 0.85)
            canvas.words(
                f"{value:g}", (x + tall + 5 * u, foot - 14 * u), round(13 * u), self.theme.ink, anchor=(0, 0.5)
            )
        return box[1] - 8 * u

    def _pixel(self, camera, rows, columns, at):
        iy, ix = at
        cell = self.scenery.cell
        return camera.pixels(
            ((columns.start + (ix + 0.5) * columns.step) * cell, (rows.start + (iy + 0.5) * rows.step) * cell)
        )

    def _names(self, canvas, names, height):
        height = round(height * self.unit)
        clip = np.array(canvas.clip, np.int64)
        for text, x, y, colour in placed(names, canvas.clip, height):
            tall, wide = words(text, height).shape
            box = (x - 6, y - 4, x + wide + 6, y + tall + 4)
            draw_plate(canvas.image, clip, *box, np.array(self.theme.paper, float), 0.85, np.array(colour, float), 0.9)
            canvas.words(text, (x, y), height, mix(colour, self.theme.ink, 0.8))

    # ways ----------------------------------------------------------------------------

    def _ways(self):
        """(navigation, goal) of the field that most animals follow."""
        agents, land = self.world.agents, self.scenery.land
        steepest = self.world.resource(SpeciesList).table.steepest
        ways = land.ways_for(steepest, agents[Species.index], agents[Destination.goal])
        count = np.bincount(ways + 1) if len(ways) else np.zeros(1, int)
        return land.navigation, int(np.argmax(count)) - 1

    def _way_layer(self, camera, made_of):
        lines = self._arrows(camera, *made_of)
        colour = mix(self.theme.guide, self.theme.ink, 0.15)

        def draw(canvas):
            clip = np.array(canvas.clip, np.int64)
            for segments, alpha in lines:
                draw_lines(canvas.image, clip, segments, 3.4 * self.unit, ink_of(self.theme.paper), 0.5 * alpha)
                draw_lines(canvas.image, clip, segments, 1.7 * self.unit, ink_of(colour), alpha)

        return draw

    def _arrows(self, camera, navigation, goal):
        """[(lines, opacity)] of arrows on a lattice that stays where it is on the ground; strong ones are long."""
        land, step = self.scenery.land, LATTICE * self.unit
        at = lattice(camera, step)
        xy = camera.metres(at)
        inside = ((xy > 0) & (xy < (land.width, land.height))).all(axis=1)
        at, xy = at[inside], xy[inside]
        if not len(at) or navigation is None:
            return []
        ny, nx = land.brush.shape
        iy, ix = (np.minimum((xy[:, k] / land.cell).astype(int), n - 1) for k, n in ((1, ny), (0, nx)))
        way = navigation.at(xy, goal if goal < len(navigation.fields) - 1 else -1) * (1, -1)
        strength = np.hypot(*way.T)
        drawn = (strength > 0.02) & ~land.blocked[iy, ix]
        at, strength = at[drawn], strength[drawn]
        along = way[drawn] / strength[:, None]
        long = (0.30 + 0.34 * np.minimum(strength, 1))[:, None] * step
        tail, tip, aside = at - along * long / 2, at + along * long / 2, along[:, ::-1] * (-1, 1) * 0.14 * step
        back = tip - along * 0.24 * step
        lines = np.stack([np.hstack([tail, tip]), np.hstack([tip, back + aside]), np.hstack([tip, back - aside])])
        classes = ((0.0, 0.25, 0.5), (0.25, 0.6, 0.7), (0.6, np.inf, 0.95))
        parts = [
            (lines[:, (strength > low) & (strength <= high)].reshape(-1, 4), alpha) for low, high, alpha in classes
        ]
        return [(segments, alpha) for segments, alpha in parts if len(segments)]

    # density -------------------------------------------------------------------------

    def _density(self, frame, camera, moment, foot):
        """A coloured map of animals per square metre, with its legend."""
        import cv2

        xy = self.world.agents[Position.xyz] if moment is None else moment.xyz
        now = self.scenery.simulation.clock.now if moment is None else moment.time
        seen, then, kept = self._counted
        length = float((self.world.agents[Body.length] if moment is None else moment.length).mean()) if len(xy) else 1.0
        most = nice(2.5 / length**2)
        if kept is None or seen != camera or not 0 <= now - then < REFRESH:
            left, top, right, bottom = camera.view
            step = DENSITY_CELL * self.unit
            shape = (-(-int(bottom - top) // int(step)), -(-int(right - left) // int(step)))
            counts = np.zeros(shape, np.float32)
            west, north = camera.metres((left, top))
            cell = step / camera.scale
            count_in_cells(np.ascontiguousarray(xy[:, :2]), west, north, cell, counts)
            blur = max(1.0, 1.6 * length * camera.scale / step)
            smooth = cv2.GaussianBlur(counts, (0, 0), blur) / cell**2
            index = np.clip(smooth / most * 255, 0, 255)
            alpha = np.clip(smooth / most * 6, 0, 1) * 0.72
            alpha = alpha.astype(np.float32)
            ink = scale_colours(self.theme.name)[index.astype(np.uint8)].astype(np.float32) * alpha[..., None]
            size = (round(shape[1] * step), round(shape[0] * step))
            wide = cv2.resize(np.dstack([alpha * 255, ink]).astype(np.uint8), size, interpolation=cv2.INTER_LINEAR)
            wide = wide[: bottom - top, : right - left]
            kept = full_width(wide, camera)
            self._counted = (camera, now, kept)
        top, alpha, ink = kept
        if len(alpha):
            lay_over(frame[top : top + len(alpha)].reshape(-1), alpha.reshape(-1), ink.reshape(-1))
        return self._density_legend(frame, camera, most, foot)

    def _density_legend(self, frame, camera, most, foot):
        canvas, u = Canvas(frame, camera.view), self.unit
        left, wide, tall = round(camera.view[0] + 12 * u), round(170 * u), round(11 * u)
        box = (left, foot - 52 * u, left + wide + 20 * u, foot)
        self._panel(canvas, box, "animals per m²")
        x, y = left + round(10 * u), round(foot - 30 * u)
        colours = scale_colours(self.theme.name)[np.linspace(0, 255, wide).astype(int)]
        right, low = min(x + wide, frame.shape[1]), min(y + tall, frame.shape[0])
        if y >= 0 and right > x:
            frame[y:low, x:right] = colours[None, : right - x]
        for share in (0, 0.5, 1):
            text = f"{share * most:g}" + ("+" if share == 1 else "")
            canvas.words(text, (x + share * wide, foot - 10 * u), round(12 * u), self.theme.ink, anchor=(share, 0.5))
        return box[1] - 8 * u

    def _panel(self, canvas, box, title):
        """A quiet box with a title, for a legend."""
        left, top, right, bottom = box
        u = self.unit
        canvas.area(box_of(left, top, right, bottom), self.theme.paper, 0.82)
        canvas.words(title, (left + 10 * u, top + 11 * u), round(12 * u), self.theme.muted, anchor=(0, 0.5))

    def _note(self, frame, camera, text, foot):
        """A line where a legend would stand."""
        canvas, u = Canvas(frame, camera.view), self.unit
        left = camera.view[0] + 12 * u
        canvas.words(
            text, (left + 4 * u, foot - 10 * u), round(13 * u), self.theme.muted, anchor=(0, 0.5), halo=self.theme.paper
        )
        return foot - 26 * u

    # the many --------------------------------------------------------------------------

    def _clip(self, camera):
        return np.array(camera.view, np.int64)

    def _lists(self, moment):
        """Who sees whom, if the lists are of these animals."""
        lists = self.world.resource(Sight).lists
        if lists is None or len(lists.first) != len(moment) + 1 or len(self.world.agents) != len(moment):
            return None
        return lists

    def _links(self, frame, camera, moment, at, row):
        lists = self._lists(moment)
        if lists is None:
            return
        left, top, right, bottom = camera.view
        shown = (at[:, 0] > left) & (at[:, 0] < right) & (at[:, 1] > top) & (at[:, 1] < bottom)
        if not shown.any():
            return
        some = lists.offset[:: max(1, len(lists.offset) // 1000)]
        long = float(np.hypot(*some.T).mean()) * camera.scale if len(some) else 0.0
        many = float((lists.first[1:] - lists.first[:-1])[shown].sum()) * long / 2  # each is drawn once
        every = max(1, int(np.ceil(many / INK)))
        segments = np.empty((LINKS, 4))
        some = shown & (moment.ids % every == 0)
        count = links_of(lists.first, lists.near, lists.offset, at, some, camera.scale, segments)
        faint = (0.4 if row is None else 0.25) * min(1.0, np.sqrt(50_000 / max(many / every, 1.0)))
        draw_lines(frame, self._clip(camera), segments[:count], 0.8 * self.unit, ink_of(self.theme.link), faint)
        if row is not None:
            mine = np.zeros(len(at), bool)
            mine[row] = True
            count = links_of(lists.first, lists.near, lists.offset, at, mine, camera.scale, segments)
            strong = segments[:count]
            draw_lines(frame, self._clip(camera), strong, 3.6 * self.unit, ink_of(self.theme.paper), 0.55)
            draw_lines(frame, self._clip(camera), strong, 1.7 * self.unit, ink_of(self.theme.link), 0.95)
            ends = np.ascontiguousarray(strong[:, 2:])
            ring = np.full(count, max(3.5 * self.unit, 0.62 * float(moment.length[row]) * camera.scale))
            draw_rings(frame, self._clip(camera), ends, ring, 1.2 * self.unit, ink_of(self.theme.link), 0.9)

    def _leaders(self, frame, camera, moment, at):
        """Lines to the reference birds, rings around leaders."""
        rows = np.clip(np.searchsorted(moment.ids, moment.reference), 0, max(len(moment) - 1, 0))
        linked = (moment.reference > 0) & (moment.ids[rows] == moment.reference) if len(moment) else np.zeros(0, bool)
        tail, tip = at[linked], at[rows[linked]]
        if self.scenery.land.wrap is not None:
            near = np.abs(moment.xyz[linked] - moment.xyz[rows[linked]])[:, :2] < np.array(self.scenery.land.wrap) / 2
            tail, tip = tail[near.all(axis=1)], tip[near.all(axis=1)]
        clip, u = self._clip(camera), self.unit
        draw_lines(frame, clip, np.hstack([tail, tip]), 1.1 * u, ink_of(self.theme.link), 0.6)
        leaders = at[moment.leader]
        radius = np.maximum(6.0 * u, 0.8 * moment.length[moment.leader] * camera.scale)
        draw_rings(frame, clip, leaders, radius, 4.2 * u, ink_of(self.theme.outline), 0.75)
        draw_rings(frame, clip, leaders, radius, 2.2 * u, ink_of(self.theme.leader), 1.0)
        self._note_leaders(frame, camera, moment)

    def _note_leaders(self, frame, camera, moment):
        count, canvas, u = int(moment.leader.sum()), Canvas(frame, camera.view), self.unit
        text = f"{count:,} leader{'' if count == 1 else 's'} of {len(moment):,}"
        at = (camera.view[2] - 14 * u, camera.view[3] - 22 * u)
        canvas.words(text, at, round(13 * u), self.theme.ink, anchor=(1, 0.5), halo=self.theme.paper)

    # the one --------------------------------------------------------------------------

    def _one(self, frame, camera, shown, moment, at, row):
        """What is shown of the selected animal."""
        explanation = None
        if shown & EXPLAINED:
            explanation = self.explanations.of(int(moment.ids[row]))
        x, y = (float(side) for side in at[row])
        if explanation is not None and shown & {"field_of_view", "occlusion"}:
            self._sight(frame, camera, shown, moment, row, explanation)
        ring = np.array([max(8.0 * self.unit, 0.95 * float(moment.length[row]) * camera.scale)])
        centre, clip = np.array([[x, y]]), self._clip(camera)
        draw_rings(frame, clip, centre, ring, 4.4 * self.unit, ink_of(self.theme.paper), 0.8)
        draw_rings(frame, clip, centre, ring, 2.0 * self.unit, ink_of(self.theme.ink), 1.0)
        if explanation is not None and "forces" in shown:
            forward = moment.forward[row, :2] * (1, -1)
            draw_forces(frame, camera, (x, y), forward, explanation, self.theme, self.unit, float(ring[0]))

    def _sight(self, frame, camera, shown, moment, row, explanation):
        """The field of view as a wedge; what is hidden in it shaded."""
        reach, scale = explanation.view_range, camera.scale
        depth = self._depth(moment, row, reach) * scale if "occlusion" in shown else np.full(RAYS, np.inf)
        cosine = (
            np.cos(min(explanation.field_of_view, 2 * np.pi) / 2)
            if explanation.field_of_view < 2 * np.pi - 1e-9
            else -1.0
        )
        x, y = (float(side) for side in camera.pixels(moment.xyz[row]))
        eye = Pose(x, y, float(moment.forward[row, 0]), -float(moment.forward[row, 1]))
        lit = 0.18 if "field_of_view" in shown else 0.0
        self._lay_sight(frame, camera, eye, (cosine, depth, reach * scale), lit)
        self._wedge(frame, camera, eye, explanation.field_of_view, reach * scale)

    def _lay_sight(self, frame, camera, eye, view, lit):
        """Lay what is seen and what is hidden over the frame; large views are worked out coarsely and smoothed."""
        import cv2

        x, y, far = eye.x, eye.y, view[-1]
        low = np.maximum(np.floor((x - far - 1, y - far - 1)), camera.view[:2]).astype(int)
        high = np.minimum(np.ceil((x + far + 1, y + far + 1)), camera.view[2:]).astype(int)
        if (high <= low).any():
            return
        step = float(np.clip(np.sqrt((high - low).prod()) // 200, 1, 3))
        size = np.ceil((high - low) / step).astype(int)
        colours = ink_of(self.theme.sight), ink_of(self.theme.hidden)
        eye = eye._replace(x=x - low[0], y=y - low[1])
        mask = sight_mask(tuple(size.tolist()), step, eye, *view, *colours, lit, 0.45)
        if step > 1:
            mask = cv2.resize(mask, None, fx=step, fy=step, interpolation=cv2.INTER_LINEAR)
        lay_mask(frame, self._clip(camera), *low, mask)

    def _wedge(self, frame, camera, eye, angle, reach):
        """The outline of the field of view."""
        at, middle = (eye.x, eye.y), np.arctan2(eye.fy, eye.fx)
        turn = np.linspace(middle - angle / 2, middle + angle / 2, int(np.clip(reach * angle / 6, 12, 200)))
        arc = np.array(at) + reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        if angle < 2 * np.pi - 1e-9:
            arc = np.vstack([at, arc, at])
        segments = np.hstack([arc[:-1], arc[1:]])
        draw_lines(frame, self._clip(camera), segments, 1.6 * self.unit, ink_of(self.theme.sight), 0.85)

    def _depth(self, moment, row, reach):
        """How far the animal sees in every direction, m."""
        agents, land, size = self.world.agents, self.world.resource(Landscape), moment.length
        offset = moment.xyz[:, :2] - moment.xyz[row, :2]
        if land.wrap is not None:
            offset = offset - np.round(offset / land.wrap) * land.wrap
        near = (np.abs(offset) < (reach + size)[:, None]).all(axis=1)
        near[row] = False
        if catalogue_of(self.world, labels=()).palette.sees_through[moment.brush].all():
            near[:] = False
        axis = np.where(near, 0.5 * size - moment.radius, 0.0)
        if len(agents) == len(moment):
            axis = agents[Body.axis]
        edges = land.opaque.ends - np.tile(moment.xyz[row, :2], 2)
        low, high = np.minimum(edges[:, :2], edges[:, 2:]), np.maximum(edges[:, :2], edges[:, 2:])
        edges = edges[((low < reach) & (high > -reach)).all(axis=1)]
        bodies = (offset[near], moment.forward[near, :2], axis[near], moment.radius[near])
        return how_far(*(np.ascontiguousarray(part, np.float64) for part in (*bodies, edges)), float(reach))


__all__ = ["OVERLAYS", "Overlays", "layer", "reason_colour"]
