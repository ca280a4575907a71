"""Draw the pictures of the README: ``python -m docs.pictures``."""

from pathlib import Path

from docs.contact_sheet import contact_sheet
from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import write_png
from flockbrush.render.style import THEMES
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

HERE = Path(__file__).parent
TRAIL = 2  # s
LARGE = "sheep-pasture"  # also drawn alone
THEMED = "meadow"  # drawn in all themes
STILLS = {  # level: simulated seconds, view
    LARGE: (26, "plan"),
    "meadow": (8, "plan"),
    "gorge": (22, "plan"),
    "anthill": (12, "plan"),
    "river": (20, "plan"),
    "predators-valley": (20, "plan"),
    "savanna": (45, "plan"),
    "merino": (66, "plan"),
    "ridge": (40, "plan"),
    "city": (16, "plan"),
    "crowded": (2, "plan"),
    "lake": (40, "space"),
    "pillars": (16, "space"),
    "elephants": (15, "space"),
    "geese": (24, "space"),
    "skein": (14, "space"),
}


def walked(name, size=None, theme="light"):
    """Return a picture of a level after its seconds, with trails, (h, w, 3)."""
    seconds, view = STILLS[name]
    simulation = start(name)
    in_space = view == "space"
    painter = painter_of(simulation, size, theme, view=view, elevation=16.0 if in_space else None)
    simulation.run(round(seconds / simulation.clock.dt) - 32 * TRAIL)
    for step in range(8 * TRAIL + 1):
        herd = herd_of(simulation, moment_of(simulation))
        if in_space:
            painter.chase(herd, 0.125 if step else None)
        picture = painter.frame(herd, time=simulation.clock.now, title=name)
        if step < 8 * TRAIL:
            simulation.run(4)
    simulation.close()
    return picture


if __name__ == "__main__":
    write_png(HERE / f"{LARGE}.png", walked(LARGE))
    stills = [(name, walked(name, (560, 354))) for name in STILLS if name != LARGE]
    themes = [(f"{THEMED}, {theme}", walked(THEMED, (620, 420), theme)) for theme in THEMES]
    write_png(HERE / "themes.png", contact_sheet(themes, columns=3))
    write_png(HERE / "levels.png", contact_sheet(stills, columns=3))
