"""PNG export: a picture of the last frame."""

from __future__ import annotations

from flockbrush.output.exporter import exporter
from flockbrush.output.picture_exporter import Pictures


@exporter(".png")
class Png(Pictures):
    """A picture of the last frame."""

    contents, opens_in = "picture of the last frame", "everything"

    @classmethod
    def problems(cls, path, options):
        unmarked = ["a sequence of pictures is named NAME.####.png"] if "##" in path.name else []
        return [*super().problems(path, options), *unmarked]

    def take(self, moment):
        self._frame = self.draw(moment)
        self.frames += 1

    def finish(self):
        from flockbrush.render import write_png

        write_png(self.temporary, self._frame)
