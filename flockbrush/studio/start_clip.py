"""Opens the window for clips from the command line, or prints why no window can be opened."""

from __future__ import annotations

import tempfile
from pathlib import Path

import typer

from flockbrush.engine.files import refused
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import SKY, Film, Sky
from flockbrush.film.looking import MODES, MODES_OF_SKY
from flockbrush.lifting.lens import check_camera, read_camera
from flockbrush.runs.terminal import USAGE, Interrupts, compiling, progress, say
from flockbrush.studio.start import missing_display, size_of, stay

NO_SCREEN = (
    "no window can be opened: there is no display. Without one, `flockbrush track CLIP` tracks birds, and"
    " `flockbrush learn CLIP` takes --landmark, --body-colour and masks."
)


def mark_clip(clip, out=None, tracks=None, camera=None, mode=None, theme=None, size="1280x720", frames=None) -> int:
    """Open the window on a film, or on an empty sky, and stay until it is closed; the exit code, 2 without a display.

    What was marked before is taken up.

    Parameters
    ----------
    clip : path or "sky"
    out : path, optional
        The folder for what is made; the current one unless given.
    tracks : path, optional
        Tracks of birds to begin with.
    camera : path, optional
        The camera that filmed, for lifting; an empty sky has its size.
    mode : str, optional
        The first mode.

    Raises
    ------
    ProblemsError
        When film, tracks, camera or what was marked before cannot be read.
    """
    place = size_of(size)
    sky = str(clip) == SKY and not Path(clip).exists()
    modes = MODES_OF_SKY if sky else MODES
    if mode is not None and mode not in modes:
        raise typer.BadParameter(f"the mode must be one of {', '.join(modes)}, got {mode!r}", param_hint="--mode")
    folder = Path(out or ".")
    if folder.exists() and not folder.is_dir():
        raise refused(folder, "is a file; --out must be the folder for all output files")
    if not folder.exists() and not folder.parent.is_dir():
        raise refused(folder, f"there is no folder {str(folder.parent)!r}")
    _writable(folder)
    lens = None if camera is None else read_camera(camera)
    with Interrupts() as interrupts, compiling():
        film = _sky(lens) if sky else _film(clip)
        try:
            book = Book(film, folder)
            book.load(tracks)
            if lens is not None and (slow := check_camera(camera, lens, film)):
                say(slow)
            if missing_display():
                say(NO_SCREEN)
                return USAGE
            from flockbrush.studio.film.clip_window import ClipWindow

            first = mode or ("sketch" if sky else "birds" if tracks is not None else "view")
            stay(ClipWindow(book, place, theme, camera, first), interrupts, frames)
            _tell_next(book, camera)
        finally:
            film.close()
        interrupts.check()
    return 0


def _writable(folder):
    """ProblemsError where nothing can be saved in a folder; one that is not there yet stays so."""
    new = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        if new:
            folder.rmdir()
    except OSError as error:
        raise refused(
            folder, f"nothing can be saved here: {error.strerror}; choose another folder with --out"
        ) from None


def _sky(lens):
    """An empty one, as its camera sees it."""
    return Sky() if lens is None else Sky((lens.width, lens.height), fps=lens.fps)


def _film(clip):
    with progress("reading the clip", 0) as moved:
        return Film(clip, moved)


def _tell_next(book, camera):
    """Print the commands that go on from what was saved."""
    if book.film.path is not None and book.place("marks.toml").is_file() and book.learns:
        say(book.learn_line(book.saved))
    for line in book.lift_lines(camera):
        say(line)
