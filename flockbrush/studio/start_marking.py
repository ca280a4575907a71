"""Opens the window for marks from the command line, or prints why no window can be opened."""

from __future__ import annotations

from pathlib import Path

from flockbrush.engine.files import claimed
from flockbrush.film.picture_marks import PictureBook, PictureFilm
from flockbrush.runs.terminal import USAGE, Interrupts, compiling, progress, say
from flockbrush.studio.start import missing_display, size_of, stay

NO_SCREEN = (
    "no window can be opened: there is no display. Without one, `flockbrush formation detect` writes the marks"
    " of the birds that are found without help."
)


def mark_birds(paths, out=None, every=1, theme=None, size="1280x720", frames=None) -> int:
    """Open the window on pictures or clips, and stay until it is closed; the exit code, 2 where there is no display.

    Marks that `out` has already are taken up.

    Raises
    ------
    ProblemsError
        When a picture or the marks cannot be read, or could not be written.
    """
    place, out = size_of(size), out or Path(f"{Path(paths[0]).stem}.marks.csv")
    with claimed([out], paths), Interrupts() as interrupts, compiling():
        with progress("detecting birds", len(paths)) as moved:
            book = PictureBook(PictureFilm(paths, every, moved), out)
        if missing_display():
            say(NO_SCREEN)
            return USAGE
        from flockbrush.studio.film.clip_window import ClipWindow

        stay(ClipWindow(book, place, theme), interrupts, frames)
        interrupts.check()
    return 0
