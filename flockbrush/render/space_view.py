"""Pictures of herds in space: ground and grid to the horizon, what stands there, animals that climb and bank.

::

    painter = SpacePainter(level, size=(1280, 720))      # or without a level: a grid and the flock
    painter.look(painter.around(herd))                   # as near as all of them fit in
    frame = painter.frame(herd, time=2.0, selected=17)

A herd is that of the plan, with heights over the ground and headings in space: `Herd.xy` and `Herd.forward` of shape
(n, 3), and `Herd.up` for those that bank.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.engine.seam import with_images, wrap_of
from flockbrush.render.animal_figures import KINDS, NO_WINGS
from flockbrush.render.body_meshes import SMALLEST, SpaceHerd, draw_bodies, standing
from flockbrush.render.drawn_herd import EMPTY, DrawnHerd, checked, refuse_nan
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.facets import Haze, draw_faces, draw_grid, draw_spots, draw_ways, haze_ground, paint_sky
from flockbrush.render.ground_texture import CLOSE, FINER, GroundTexture, close_view, identity_of, plan_of
from flockbrush.render.hud import Hud, Layout
from flockbrush.render.mesh_bodies import MOST, NO_LOOK, large, meshes, usual_lengths
from flockbrush.render.orbit import OrbitCamera, box_corners
from flockbrush.render.painter import brush_rgb, brushes_in_sight, copied
from flockbrush.render.see_through import opacities
from flockbrush.render.shapes import FrameBuffer, ink_of
from flockbrush.render.solid_meshes import stood_up, together
from flockbrush.render.space_marks import SpaceMarks
from flockbrush.render.sprites import look_colours, looks_of
from flockbrush.render.style import SUN, mix, theme_of, worn
from flockbrush.render.view_camera import ViewCamera, checked_size
from flockbrush.render.wakes import wakes_in_space
from flockbrush.render.ways import Ways

SIGHT = 7.0  # times the size of the scene: what is farther is more haze than colour
LINES = 90.0  # pixels between two thin lines of the grid, about
GRID = 42.0  # lines from its middle to where it has faded
MANY = 30  # animals: the ways of more are fainter, that one still sees who flies there
WALL = 1.6  # m, or body lengths if those are longer: what has been told no height
TRAILS = 1.5  # s; in space there is less room for them than on the plan
GLIDE = 0.8  # s in which a camera that chases a herd has made up for most of what it is behind
ELBOW = 1.5  # body lengths free around a herd that is looked at


class SpacePainter:
    """Draws the animals of a level, or of no place at all, as a camera sees them that circles about them.

    What does not move is drawn once for each camera and copied; a frame costs what its animals cost.

    Parameters
    ----------
    level : Level, optional
        Or a `Scenery`, or anything with `width` and `height` in metres; its ground lies flat, hills and all.
    size : (int, int)
        Width and height of the picture, pixels.
    theme : {"light", "dark"} or Theme
    brushes : dict of str to "#rrggbb", optional
        Colours of brushes by name.
    trails : float or None
        How long trails are, seconds; None or 0 for no trails.
    words : bool
        Leave room for title, clock and legend.
    shadows : bool
    live : bool
        For a window: the ground is shown as far as it is drawn, and `refine` goes on with it.
    floor : float
        Height of the ground where there is no level, m.

    Attributes
    ----------
    dust : bool
        As of `Painter`.
    see_through : bool
        Whether obstacles before what the camera looks at are drawn clear: for a view that follows animals.
    """

    dust, see_through = True, False

    def __init__(
        self, level=None, size=(1280, 720), theme="light", brushes=None, trails=TRAILS, words=True, shadows=True,
        live=False, floor=0.0,
    ):  # fmt: skip
        self.level, self.size, self.theme = level, checked_size(size), theme_of(theme)
        self.shadows, self.live = shadows, live
        self.floor = 0.0 if level is not None else float(floor)
        unit = float(np.clip(min(self.size[0] / 1280, self.size[1] / 720), 0.45, 6))
        self.layout = Layout.of(self.size) if words else Layout(self.size, unit, 0, 0, 0)
        self.hud = Hud(self.layout, self.theme)
        self.trails = Ways(trails) if trails else None
        # draws the picture that lies on the ground
        self.plan = None if level is None else plan_of(level, self.theme, brushes, live)
        self._close = None if self.plan is None else close_view(self.plan)
        self._ground, self._near = GroundTexture(), GroundTexture()
        self._stood: tuple = (None, None)
        self._standing: list = []  # of `faces`
        self._world: tuple = (None, None, None)
        self._sheets = np.empty((*self.size[::-1], 3), np.uint8), np.zeros(self.size[::-1], np.float32)
        self._sheets[0][:] = self.theme.paper
        self._colours: tuple = (None, None)
        self._bodies: SpaceHerd | None = None
        self._chased: np.ndarray | None = None
        self.bare = False  # without grid and compass
        self.backdrop: np.ndarray | None = None  # a picture instead of sky and ground; obstacles hide what is behind
        self.camera = self.home  # change it with `look`

    # the camera --------------------------------------------------------------------

    @property
    def view(self):
        """Left, top, right and bottom of the part of the picture that shows the scene."""
        return tuple(int(side) for side in self.layout.view)

    @property
    def home(self) -> OrbitCamera:
        """The camera that shows the whole level, from the south."""
        return self.whole(np.pi / 2, np.radians(30.0))

    def whole(self, azimuth, elevation) -> OrbitCamera:
        """The camera in this direction that shows the whole level."""
        if self.level is None:
            low, high = np.array([-20.0, -20.0, self.floor]), np.array([20.0, 20.0, self.floor + 10.0])
        else:
            low, high = np.zeros(3), np.array([self.level.width, self.level.height, 0.0])
        return OrbitCamera.of(
            box_corners(low, high), self.size, self.view, azimuth, elevation, floor=self.floor, margin=0.02
        )

    def around(self, herd: DrawnHerd, camera: OrbitCamera | None = None) -> OrbitCamera:
        """A camera in the direction of another one (that of now, by default) that shows all of a herd."""
        camera = camera or self.camera
        bodies = self.bodies_of(checked(herd), herd)
        if not len(bodies.xyz):
            return self.whole(camera.azimuth, camera.elevation)
        room = ELBOW * float(np.max(herd.length))
        corners = [box_corners(point - room, point + room) for point in bodies.xyz]
        return camera.fitted(np.concatenate(corners))

    def look(self, camera: OrbitCamera):
        """Look from somewhere else from now on."""
        self.camera = camera

    def chase(self, herd: DrawnHerd, passed=None):
        """Let the camera go with a herd, and glide to where it shows all of it.

        `passed` is how many seconds ago it was there last; None lets it jump.
        """
        target_camera = self.around(herd)
        middle = np.append(np.median(np.asarray(herd.xy, float)[:, :2], axis=0), 0.0)
        share, step = 1.0, np.zeros(3)
        if passed is not None and self._chased is not None:
            share, step = 1 - np.exp(-passed / GLIDE), middle - self._chased
        self._chased = middle
        target = (np.asarray(self.camera.target) + step) * (1 - share) + np.asarray(target_camera.target) * share
        distance = self.camera.distance ** (1 - share) * target_camera.distance**share
        self.look(replace(target_camera, distance=float(distance)).at(*target))
        self.see_through = True

    # what lies there -----------------------------------------------------------------

    def repaint(self, box):
        """Draw a part of the ground anew: (west, south, east, north) in metres, or "all"."""
        for painter, texture in self._pictures():
            painter.repaint(box)
            texture.stale = True

    def refine(self, budget=0.004) -> bool:
        """Go on drawing the ground for about so many seconds; True when nothing is left to draw."""
        complete = True
        for painter, texture in self._pictures():
            if painter.tiles.camera is None or painter.tiles.stale:
                texture.stale = True
                complete &= painter.refine(budget)
        return complete

    def _pictures(self):
        """(painter, texture) of the whole level, and of what one looks at where that is too coarse."""
        if self.plan is None:
            return []
        aim = self._aim()
        if aim is None:
            self._near.sizes = []
            return [(self.plan, self._ground)]
        if aim != self._close.camera:
            self._close.look(aim)
            self._near.stale = True
        return [(self.plan, self._ground), (self._close, self._near)]

    def _aim(self):
        """The view straight down on what the camera looks at, None where the picture of the whole level will do.

        It moves in quarters of its side and by powers of two, so that it is seldom drawn anew, and then in part.
        """
        wanted = 2.0 ** np.floor(np.log2(0.8 * self.camera.scale))
        scale = float(min(wanted, 512.0))
        if scale < FINER * self.plan.camera.scale:
            return None
        side = CLOSE / scale
        x, y = np.round(self._grid_middle() / (side / 4)) * (side / 4)
        if not (-side / 2 < x < self.level.width + side / 2 and -side / 2 < y < self.level.height + side / 2):
            return None
        return ViewCamera((float(x), float(y)), scale, (CLOSE, CLOSE), (0, 0, CLOSE, CLOSE))

    def faces(self, tall):
        """(faces, colours, obstacle of each) of the obstacles; those without a height are `tall` m high."""
        obstacles = [o for o, _ in with_images(getattr(self.level, "obstacles", None) or [], wrap_of(self.level))]
        key = (round(tall, 2), tuple(identity_of(o) for o in obstacles))
        if self._stood[0] != key:
            parts = [stood_up(obstacle, tall) for obstacle in obstacles]
            faces, owner = together(parts), np.repeat(np.arange(len(parts)), [len(part.alphas) for part in parts])
            self._standing = obstacles
            self._stood = (key, (faces, faces.lit(mix(self.theme.obstacle, self.theme.paper, 0.22), SUN), owner))
        return self._stood[1]

    # a frame -----------------------------------------------------------------------------

    def bodies_of(self, herd, original: DrawnHerd) -> SpaceHerd:
        """Places and attitudes in space of a `checked` herd from its input `told`; ValueError names a bad row."""
        count = len(herd.xy)
        above = np.asarray(herd.z, float)
        if original.z is None and np.ndim(original.xy) == 2 and np.shape(original.xy)[1] == 3:
            above = np.ascontiguousarray(np.asarray(original.xy, float)[:, 2])
            refuse_nan(above, "height")
        forward = np.zeros((count, 3))
        forward[:, : np.shape(original.forward)[1]] = original.forward
        refuse_nan(forward, "heading")
        winged = np.isfinite(np.asarray(herd.wings, float))
        ground = self.floor
        walks = ~winged & (above < ground + 0.5 * herd.length)
        if self.level is not None:
            above = np.where(winged, np.maximum(above, 0.6 * herd.length), above)
        forward[walks, 2] = 0.0
        up = standing(forward)
        if original.up is not None:
            up_given = np.asarray(original.up, float)
            if up_given.shape != (count, 3):
                raise ValueError(f"up of {count} animals has shape ({count}, 3), got {up_given.shape}")
            refuse_nan(up_given, "back")
            up = np.where(walks[:, None], up, up_given)
        look = looks_of(herd, len(brush_rgb(herd.brush_colours)))
        beat = np.where(winged, herd.wings, NO_WINGS)
        xyz = np.column_stack([herd.xy, above])
        return SpaceHerd(xyz, forward, up, walks, herd.length, herd.radius, beat, look, herd.postures)

    def frame(
        self, herd: DrawnHerd = EMPTY, time=None, title=None, measures=None, legend=True, trails=True, out=None,
        under=None, selected=None,
    ):  # fmt: skip
        """The animals of one moment.

        Parameters
        ----------
        time : float, optional
            Seconds on the clock.
        title : str, optional
            The level's name unless given.
        measures : str or dict of str to float, optional
        legend, trails : bool
        out : (h, w, 3) uint8 array, optional
            Draw into this one, and return it.
        under : Underlay, optional
            Draws on the picture of the ground.
        selected : int, optional
            Of `Herd.ids`: who is marked.

        Returns
        -------
        (h, w, 3) uint8

        Raises
        ------
        ValueError
            When a column does not fit or is not finite, naming the animal.
        """
        original, herd = herd, checked(herd._replace(brush_colours=worn(herd.brush_colours, self.theme)))
        bodies = self._bodies = self.bodies_of(herd, original)
        if self.plan is not None:
            self.plan._learn(herd)
        frame, depth = self._backdrop(herd, out, under)
        colours = self._looks(herd)
        buffer, cam = FrameBuffer(frame, depth, np.array(self.view, np.int64)), self.camera.numbers()
        if self.shadows:
            self._shadows(buffer, cam, bodies)
        if trails and self.trails is not None:
            self.trails.go(bodies.xyz, original.ids, time)
            self._ways(buffer, cam, bodies, colours)
        row = self._row(original, selected)
        if row is not None:
            marks, long = self._marks(frame), float((bodies.length * self._grown(bodies))[row])
            marks.stand(bodies.xyz[row], long, self.floor)
        if self.dust:
            wakes_in_space(buffer, self.camera, self.floor, self.theme, herd, bodies.xyz, time)
        self._animals(buffer, cam, bodies, colours, usual_lengths(herd))
        if row is not None:
            marks.ring(middles(bodies)[row : row + 1], long)
        self._words(frame, herd, title, time, measures, legend, colours)
        return frame

    def pick(self, pixel, reach=9.0):
        """Row of the animal of the last frame that is drawn at a pixel, the nearest to the eye; None for none.

        `reach` is how far (pixels) from its body one may miss it.
        """
        bodies = self._bodies
        if bodies is None or not len(bodies.xyz):
            return None
        at, depth = self.camera.project(middles(bodies))
        half = 0.5 * np.maximum(bodies.length * self.camera.focal / np.maximum(depth, 1e-9), SMALLEST)
        away = np.hypot(*(at - pixel).T)
        hit = (depth > 0) & (away <= half + reach)
        if not hit.any():
            return None
        rows = np.flatnonzero(hit)
        inside = away[rows] <= half[rows]
        if inside.any():
            rows = rows[inside]
            return int(rows[np.argmin(depth[rows])])
        return int(rows[np.argmin(away[rows] - half[rows])])

    # its parts ---------------------------------------------------------------------------

    def _backdrop(self, herd, out, under):
        """A copy of everything that does not move, and its depths."""
        tall = max(WALL, float(np.median(herd.length)) if len(herd.xy) else 0.0)
        faces, lit, owner = self.faces(tall)
        if self.plan is not None and not self.live:
            for box in getattr(self.level, "changes", list)():
                self.repaint(box)
        for painter, texture in self._pictures():
            self._take(painter, texture, under)
        how = self.bare, self.see_through, id(self.backdrop)
        key = (self.camera, self._ground.version, self._near.version, id(faces), *how)
        if self._world[0] != key:
            self._world = (key, *self._paint_world(faces, lit, owner))
        _, image, depth = self._world
        return copied(image, out), depth

    def _take(self, painter, texture, under):
        """Bring a picture of the ground up to date, with what lies upon it."""
        picture = painter.ground
        news = None if under is None else under.news
        if not texture.stale and texture.source is picture and texture.news == news and texture.sizes:
            return
        if under is not None:
            laid = picture.copy()
            under.draw(laid, painter.camera)
            texture.take(laid, painter.camera, self.level, news)
        else:
            texture.take(picture, painter.camera, self.level)
        texture.source = picture

    def _paint_world(self, faces, lit, owner):
        theme, camera, (image, depth) = self.theme, self.camera, self._sheets
        depth[:] = 0.0
        sky, zenith = sky_of(theme)
        land = mix(theme.ground, theme.paper, 0.45)
        clip, cam = np.array(self.view, np.int64), camera.numbers()
        haze = self._haze
        if self._ground.sizes:
            land = mix(land, theme.ground, 0.3)
            paint_sky(image, clip, cam, self.floor, 1e12, np.array([sky, zenith, land], float))
            for texture in (self._ground, self._near):
                if texture.sizes:
                    texture.lay(image, self.view, camera)
            haze_ground(image, clip, cam, self.floor, haze)
        else:
            paint_sky(image, clip, cam, self.floor, self.clear, np.array([sky, zenith, land], float))
        if not self.bare:
            x, y = self._grid_middle()
            line = np.array(mix(theme.muted, theme.ground, 0.1), float)
            draw_grid(image, clip, cam, self.floor, x, y, self.spacing, GRID * self.spacing, line, 0.75)
        order, alphas = faces.seen(camera), faces.alphas
        if self.see_through and len(owner):
            alphas = np.minimum(alphas, opacities(self._standing, camera)[owner])
            order = order[np.argsort(alphas[order] < 1, kind="stable")]
        draw_faces(FrameBuffer(image, depth, clip), cam, faces.corners, order, lit, alphas, haze)
        if not self.bare:
            self._marks(image).compass(self.spacing)
        if self.backdrop is not None:
            image[:] = self.backdrop
        return image, depth

    @property
    def clear(self) -> float:
        """How far one sees well, m."""
        size = 0.0 if self.level is None else max(self.level.width, self.level.height)
        return SIGHT * max(self.camera.distance, 0.4 * size)

    @property
    def _haze(self):
        return Haze(self.clear, np.array(sky_of(self.theme)[0], float))

    @property
    def spacing(self) -> float:
        """Metres between two thin lines of the grid."""
        return nice(LINES * self.layout.unit / self.camera.scale_at(self._grid_middle()))

    def _grid_middle(self):
        """The point of the ground about which the grid is drawn: under the middle of the view, if it is not too far."""
        camera = self.camera
        target, seen = np.asarray(camera.target[:2]), camera.metres(camera.middle)
        away = seen - target
        return target + away * min(1.0, 2 * camera.distance / max(float(np.hypot(*away)), 1e-9))

    def _looks(self, herd):
        colours = brush_rgb(herd.brush_colours)
        if self._colours[0] != colours.tobytes():
            self._colours = (colours.tobytes(), look_colours(colours, self.theme))
        return self._colours[1]

    def _shadows(self, buffer, cam, bodies):
        high = np.maximum(bodies.xyz[:, 2] - self.floor, 0.0)
        grown = self._grown(bodies)
        long = bodies.length * grown
        soft = high / (high + 12.0 * long)  # the higher, the larger and fainter
        along = long * (0.55 + 0.5 * soft)
        spread = np.where(bodies.walks, np.maximum(bodies.radius * grown, 0.18 * long), 0.42 * long)
        aside = spread * (1.0 + 0.6 * soft)
        alpha = np.minimum(2.0 * self.theme.shadow_alpha * (1.0 - 0.72 * soft), 1)
        shade = ink_of(self.theme.shadow)
        draw_spots(buffer, cam, self.floor, bodies.xyz, bodies.forward, along, aside, shade, alpha)

    def _grown(self, bodies):
        """How much larger than life each animal is drawn, (n,), to be seen at all."""
        depth = np.maximum((bodies.xyz - self.camera.eye) @ self.camera.axes[2], 1e-3)
        return np.maximum(SMALLEST * self.layout.unit * depth / (self.camera.focal * bodies.length), 1.0)

    def _ways(self, buffer, cam, bodies, colours):
        ways, look = self.trails, bodies.look
        size = 1e9 if self.level is None else 0.4 * min(self.level.width, self.level.height)
        inks = colours[look // KINDS * KINDS, 0]
        longest = float(max(min(size, 1e9), 1.0))
        strength = self.theme.trail * min(1.0, (MANY / max(len(look), 1)) ** 0.35)
        draw_ways(buffer, cam, ways.places, ways.first, ways.last, inks, strength, longest, self._haze)

    def _animals(self, buffer, cam, bodies, colours, usual):
        far = (bodies.xyz - self.camera.eye) @ self.camera.axes[2]
        big = large(bodies, usual * self.camera.focal / np.maximum(far, 1e-3), False) & (far > 0)
        if self.live and big.sum() > MOST:
            big = np.zeros_like(big)
        postures = bodies.postures._replace(look=np.where(big, bodies.postures.look, NO_LOOK))
        bodies = bodies._replace(postures=postures)
        smallest = SMALLEST * self.layout.unit
        draw_bodies(buffer, cam, far_first(far), bodies, meshes(), colours, self._haze, SUN, smallest)

    # who is selected ------------------------------------------------------------------------

    def _marks(self, frame):
        return SpaceMarks(frame, self.view, self.camera, self.theme, self.layout.unit)

    def _row(self, herd, selected):
        """Row of the selected animal, None if it is not there."""
        if selected is None or herd.ids is None:
            return None
        rows = np.flatnonzero(np.asarray(herd.ids) == selected)
        return int(rows[0]) if len(rows) else None

    # words ------------------------------------------------------------------------------------

    def _words(self, frame, herd, title, time, measures, legend, colours):
        name = getattr(self.level, "name", "") if title is None else title
        self.hud.above(frame, name, time, measures)
        if legend:
            self.hud.legend(frame, self.size[0] - self.layout.pad, herd, colours, brushes_in_sight(self.level))


def sky_of(theme):
    """(at the horizon, above) of a theme."""
    return mix(theme.paper, theme.water, 0.30), mix(theme.paper, theme.water, 0.95)


def far_first(far):
    """Rows by depth (n,), the farthest first, those as deep in their order."""
    order = np.argsort(-far)  # faster than the stable one, and the same where no two are as deep
    return np.argsort(-far, kind="stable") if (np.diff(far[order]) == 0).any() else order


def middles(bodies):
    """The middle of each body (n, 3): beasts stand on their place."""
    places = bodies.xyz.copy()
    places[:, 2] += np.where(bodies.walks, 0.4 * bodies.length, 0.0)
    return places
