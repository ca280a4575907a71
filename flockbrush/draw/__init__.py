"""Pictures of herds: `Painter` draws frames, `Video` and `write_png` keep them.

::

    painter = Painter(level, size=(1280, 720), theme="dark")
    with Video("herd.mp4", fps=30, size=painter.size) as video:
        for herd, time in moments:
            video.write(painter.frame(herd, time=time))
"""

from flockbrush.draw.camera import Camera
from flockbrush.draw.files import Video, write_png
from flockbrush.draw.herd import Herd
from flockbrush.draw.painter import Painter
from flockbrush.draw.scenery import Scenery
from flockbrush.draw.sheet import contact_sheet, level_sheet, preview
from flockbrush.draw.style import DARK, LIGHT, THEMES, Theme
from flockbrush.draw.trails import Trails

__all__ = [
    "DARK",
    "LIGHT",
    "THEMES",
    "Camera",
    "Herd",
    "Painter",
    "Scenery",
    "Theme",
    "Trails",
    "Video",
    "contact_sheet",
    "level_sheet",
    "preview",
    "write_png",
]
