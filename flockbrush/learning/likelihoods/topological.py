"""The forces of the herd over the nearest few, however far these are, or over the first shell about an animal.

Ballerini et al. 2008 [1]_ found that starlings heed six or seven others, not those within a distance; Camperi et al.
2012 [2]_ compare that with the first shell of Voronoi neighbours.  Here it is the herd model with ``sight =
"topological"`` or ``"voronoi"`` in the brush's ``[vision]``.

.. [1] Ballerini, M. et al. (2008). Interaction ruling animal collective behavior depends on topological rather than
   metric distance. PNAS 105(4), 1232-1237.
.. [2] Camperi, M., Cavagna, A., Giardina, I., Parisi, G. & Silvestri, E. (2012). Spatially balanced topological
   interaction grants optimal cohesion in flocking models. Interface Focus 2(6), 715-725.
"""

from __future__ import annotations

from flockbrush.behaviours.brush import VisionSpec
from flockbrush.learning.likelihood import Likelihood, register
from flockbrush.learning.likelihoods.herd import BY_WALLS, NUMBERS, fitted

REACH = 20.0  # BL, as far as the herd model can heed
NEAREST = 2, 3, 4, 5, 6, 7, 8, 10, 12
VIEWS = (
    *(VisionSpec(range=REACH, occlusion=False, sight="topological", neighbours=k) for k in NEAREST),
    VisionSpec(range=REACH, occlusion=False, sight="voronoi"),
)

register(Likelihood("topological", "herd", VIEWS, fitted, NUMBERS, by_walls=BY_WALLS))
