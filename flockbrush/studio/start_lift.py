"""Opens the window of a flight from the command line, or prints why no window can be opened."""

from __future__ import annotations

from pathlib import Path

from flockbrush.runs.terminal import USAGE, Interrupts, compiling, say
from flockbrush.studio.start import missing_display, size_of, stay

NO_SCREEN = (
    "no window can be opened: there is no display. Without one, `flockbrush lift TRACKS --camera CAM --out F.csv`"
    " lifts a flock."
)


def show_flight(path, camera=None, theme=None, size="1280x720", frames=None, looking=None) -> int:
    """Open the window on a flight, or on one lifted from tracks, and stay; the exit code, 2 where there is no display.

    Parameters
    ----------
    path : path
        A table of a flight, or of tracks in pixels; any file of tracks of animals on the ground.
    camera : path, optional
        That filmed the tracks.
    looking : Looking, optional
        Unit, frame rate and body length of tracks on the ground.

    Raises
    ------
    ProblemsError
        When table or camera cannot be read, or nothing can be lifted.
    """
    place = size_of(size)
    from flockbrush.lifting.ground_show import open_show

    with Interrupts() as interrupts, compiling():
        if missing_display():
            open_show(path, camera, looking)  # what is wrong with the files is told first
            say(NO_SCREEN)
            return USAGE
        from flockbrush.studio.flight_opening import flight_opening

        read = lambda: open_show(path, camera, looking)  # noqa: E731
        stay(flight_opening(Path(path).name, place, theme, read), interrupts, frames)
        interrupts.check()
    return 0
