"""MP4 export: a video of the whole level."""

from __future__ import annotations

from flockbrush.output.exporter import exporter
from flockbrush.output.picture_exporter import Pictures


@exporter(".mp4")
class Mp4(Pictures):
    """A video of the whole level."""

    contents, opens_in = "video of the level", "any player, browser or editor"

    def open(self):
        from flockbrush.render import Video

        super().open()
        self._video = Video(self.temporary, self.fps, self._painter.size)
        self._video.__enter__()

    def take(self, moment):
        self._video.write(self.draw(moment))
        self.frames += 1

    def finish(self):
        self._video.__exit__(None, None, None)

    def let_go(self):
        self._video.__exit__(Exception, None, None)
