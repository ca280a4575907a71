"""What birds of a line formation save by flying in the upwash of others."""

from __future__ import annotations

import numpy as np

from flockbrush.components import FormationPlace
from flockbrush.render.overlay_registry import overlay
from flockbrush.render.style import mix, rgb
from flockbrush.runs.power_savings import savings_of

MOST_TOLD = 200  # birds whose savings are written beside them
MUCH, LITTLE = rgb("#0f7a5a"), rgb("#b8721f")
IS_MUCH = 0.35  # of the induced power


@overlay
class PowerSaved:
    """A per cent beside each bird in a formation, where there is room, and the mean in the corner."""

    name, title = "saved", "Power saved"
    tip = "Power that each bird of a line formation saves in the upwash of others"
    in_space = True

    def draw(self, view):
        """Write the savings of the birds that fly in a formation; nothing where there are none."""
        agents, moment = view.world.agents, view.moment
        flying = np.flatnonzero(agents[FormationPlace.track].any(axis=1))
        if not len(flying) or len(agents) != len(moment):
            return
        saved, u = savings_of(view.world), view.unit
        at, aside = view.camera.pixels(moment.xyz), 0.9 * moment.length * view.camera.scale
        for row in flying if len(flying) <= MOST_TOLD else ():
            beside = (at[row, 0] + max(9.0 * u, float(aside[row])), at[row, 1])
            ink = mix(LITTLE, MUCH, float(np.clip(saved[row] / IS_MUCH, 0.0, 1.0)))
            self._write(view, f"{100 * saved[row]:.0f} %", beside, 11, ink, (0, 0.5))
        text = f"{100 * saved[flying].mean():.0f} % of induced power saved, mean of {len(flying):,}"
        corner = (view.camera.view[2] - 14 * u, view.camera.view[3] - 40 * u)
        self._write(view, text, corner, 13, view.theme.ink, (1, 0.5))

    def _write(self, view, text, at, height, ink, anchor):
        view.canvas.words(text, at, round(height * view.unit), ink, anchor=anchor, halo=view.theme.paper)
