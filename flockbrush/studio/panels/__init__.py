"""The panels of the right-hand column, in the order of their tabs."""

from flockbrush.studio.panels.animal import AnimalPanel
from flockbrush.studio.panels.brush_panel import BrushPanel
from flockbrush.studio.panels.chart_panel import ChartsPanel
from flockbrush.studio.panels.panel import Panel
from flockbrush.studio.panels.profile import ProfilePanel
from flockbrush.studio.panels.program_panel import StatesPanel
from flockbrush.studio.panels.view import ViewPanel

PANELS = (BrushPanel, StatesPanel, AnimalPanel, ViewPanel, ChartsPanel, ProfilePanel)

__all__ = ["PANELS", "Panel"]
