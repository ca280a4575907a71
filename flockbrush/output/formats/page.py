"""HTML export: a self-contained page of the run."""

from __future__ import annotations

from flockbrush.output.exporter import Exporter, exporter
from flockbrush.output.picture_exporter import PALETTE, THEME


@exporter(".html")
class Html(Exporter):
    """A self-contained page of the run, written by `flockbrush.output.page`."""

    contents, opens_in = (
        "interactive page of the run: player, orbit camera, charts, animal cards",
        "any browser, also offline",
    )
    fps = 16.0
    choices = (THEME, PALETTE)

    def open(self):
        from flockbrush.output.page.page_writer import PageWriter

        self._file = open(self.temporary, "wb")
        self._page = PageWriter(self._file, self.simulation, self.fps, self.options)

    def take(self, moment):
        self._page.take(moment)
        self.frames += 1

    def finish(self):
        self._page.finish()
        self._file.close()

    def let_go(self):
        self._file.close()
