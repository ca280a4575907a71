"""The panels of the right-hand column, in the order of their tabs."""

from flockbrush.play.panels.animal import AnimalPanel
from flockbrush.play.panels.brush import BrushPanel
from flockbrush.play.panels.charts import ChartsPanel
from flockbrush.play.panels.panel import Panel
from flockbrush.play.panels.profile import ProfilePanel
from flockbrush.play.panels.view import ViewPanel

PANELS = (BrushPanel, AnimalPanel, ViewPanel, ChartsPanel, ProfilePanel)

__all__ = ["PANELS", "Panel"]
