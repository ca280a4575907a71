"""From the command line to the window of a flight, with plain words when there cannot be one."""

from __future__ import annotations

import os

from flockbrush.play.start import missing_display, size_of
from flockbrush.terminal import USAGE, Interrupts, compiling, say

NO_SCREEN = (
    "no window can be opened here: there is no display. Without one, `flockbrush lift TRACKS --camera CAM --out F.csv`"
    " lifts a flock."
)


def show_flight(path, camera=None, theme=None, size="1280x720", frames=None) -> int:
    """Open the window on a flight, or on one lifted from tracks, and stay; the exit code, 2 where there is no display.

    Parameters
    ----------
    path : path
        A table of a flight, or of tracks in pixels.
    camera : path, optional
        That filmed the tracks.

    Raises
    ------
    ProblemsError
        When table or camera cannot be read, or nothing can be lifted.
    """
    place = size_of(size)
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    from flockbrush.flight_show import Show

    with Interrupts() as interrupts, compiling():
        show = Show.open(path, camera)
        if missing_display():
            say(NO_SCREEN)
            return USAGE
        interrupts.gently()
        _stay(show, place, theme, frames, interrupts)
        interrupts.check()
    return 0


def _stay(show, size, theme, frames, interrupts):
    from flockbrush.play.lift_window import LiftWindow

    window = LiftWindow(show, size, theme)
    try:
        window.run(frames, stop=lambda: interrupts.asked)
    finally:
        window.close()
