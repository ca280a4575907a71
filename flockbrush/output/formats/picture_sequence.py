"""PNG sequence export: one numbered picture per frame, for compositing."""

from __future__ import annotations

import glob
import os
from pathlib import Path

from flockbrush.output.exporter import exporter
from flockbrush.output.picture_exporter import ALPHA, Pictures

MARK = "####"


@exporter(".####.png")
class PngSequence(Pictures):
    """Numbered pictures: ``shot.####.png`` becomes ``shot.0000.png``, ``shot.0001.png`` and so on."""

    contents = "one picture per frame, #### is the frame number; --alpha for a transparent ground"
    opens_in = "Nuke, After Effects, Blender, DaVinci Resolve, ffmpeg"
    fps = 24.0
    choices = (*Pictures.choices, ALPHA)

    @classmethod
    def problems(cls, path, options):
        problems = super().problems(path, options)
        head, _, tail = Path(path).name.rpartition(MARK)
        others = Path(path).parent.glob(f"{glob.escape(head)}*{glob.escape(tail)}")
        taken = sorted(one.name for one in others if one.name[len(head) : len(one.name) - len(tail)].isdigit())
        if taken:
            problems.append(f"{taken[0]} already exists; choose another name, or an empty folder")
        return problems

    def take(self, moment):
        from flockbrush.render.picture_files import png_bytes

        picture = self.cut_out(moment) if self.options["alpha"] else self.draw(moment)
        self._frame(self.frames).write_bytes(png_bytes(picture))
        self.frames += 1

    def close(self):
        """Give all pictures their names; a name that was taken in the meantime is an error."""
        targets = [numbered(self.path, frame) for frame in range(self.frames)]
        if taken := [str(target) for target in targets if target.exists()]:
            raise FileExistsError(17, "a picture with this number already exists", taken[0])
        for frame, target in enumerate(targets):
            os.replace(self._frame(frame), target)
        self._work.close()

    def _frame(self, number):
        """Where a picture is until all have their names."""
        return self.temporary.with_name(f"frame-{number}.png")


def numbered(path, frame) -> Path:
    """The name of a frame."""
    path = Path(path)
    head, mark, tail = path.name.rpartition(MARK)
    return path.with_name(f"{head}{frame:04d}{tail}") if mark else path
