"""Pictures of herds: `Painter` draws frames, `Video` and `write_png` keep them.

::

    painter = Painter(level, size=(1280, 720), theme="dark")
    with Video("herd.mp4", fps=30, size=painter.size) as video:
        for herd, time in moments:
            video.write(painter.frame(herd, time=time))
"""

from flockbrush.render.drawn_herd import DrawnHerd
from flockbrush.render.painter import Painter
from flockbrush.render.picture_files import Video, write_png
from flockbrush.render.scenery import Scenery
from flockbrush.render.style import DARK, LIGHT, THEMES, Theme
from flockbrush.render.trails import Trails
from flockbrush.render.view_camera import ViewCamera

__all__ = [
    "DARK",
    "LIGHT",
    "THEMES",
    "ViewCamera",
    "DrawnHerd",
    "Painter",
    "Scenery",
    "Theme",
    "Trails",
    "Video",
    "write_png",
]
