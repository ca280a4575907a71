"""The panels of the right-hand column, in the order of their tabs."""

from flockbrush.studio.panels.animal import AnimalPanel
from flockbrush.studio.panels.brush_panel import BrushPanel
from flockbrush.studio.panels.chart_panel import ChartsPanel
from flockbrush.studio.panels.edits_panel import EditsPanel
from flockbrush.studio.panels.panel import Panel
from flockbrush.studio.panels.profile import ProfilePanel
from flockbrush.studio.panels.program_panel import StatesPanel
from flockbrush.studio.panels.view import ViewPanel

PANELS: tuple[type[Panel], ...] = (BrushPanel, StatesPanel, AnimalPanel, ViewPanel, ChartsPanel, ProfilePanel)

OF_RECORDINGS = (EditsPanel,)  # offered where a recording is open


def offered(session) -> tuple[type[Panel], ...]:
    """The panels for what is open."""
    return PANELS if session.edits is None else OF_RECORDINGS + PANELS


__all__ = ["OF_RECORDINGS", "PANELS", "Panel", "offered"]
