"""Opens the playground from the command line, or prints why no window can be opened."""

from __future__ import annotations

import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import typer

from flockbrush.runs.terminal import USAGE, Interrupts, compiling, say

LARGEST = 16384  # pixels of a window's side
NO_SCREEN = (
    "no window can be opened ({}); flockbrush play needs a screen."
    " Without one, `flockbrush run LEVEL --export herd.mp4` makes a video."
)


@dataclass(frozen=True)
class StartOptions:
    """The options of ``flockbrush play``; None: not given."""

    level: str
    brush: str | None = None
    seed: int | None = None
    agents: int | None = None
    record: Path | None = None
    theme: str | None = None
    palette: str | None = None  # of brushes
    size: str = "1280x720"
    frames: int | None = None
    text_size: float | None = None  # %, of text and buttons


def play_level(wishes: StartOptions) -> int:
    """Open the window and stay until it is closed; the exit code, 2 where there is no display.

    Raises
    ------
    ProblemsError
        With everything that is wrong with the level.
    """
    size = size_of(wishes.size)
    problem = missing_display()
    if problem:
        say(problem)
        return USAGE
    import pygame

    with Interrupts() as interrupts, _compiling(wishes):
        try:
            opening = opening_of(wishes, size)
        except pygame.error as error:  # a screen that was there just now
            say(NO_SCREEN.format(error))
            return USAGE
        stay(opening, interrupts, wishes.frames)
        interrupts.check()
    return 0


def stay(window, interrupts, frames=None):
    """Run the main loop of a window until it is closed; unsaved work is kept after an interrupt or a failure."""
    interrupts.gently()
    ended_well = False
    try:
        window.run(frames, stop=lambda: interrupts.asked)
        ended_well = not interrupts.asked
    finally:
        window.close(keep=not ended_well)


def opening_of(wishes, size):
    """The window that reads a level or a recording and then shows the playground."""
    from flockbrush.studio.opening import Opening

    return Opening(
        Path(wishes.level).stem, size, wishes.theme, lambda: _open(wishes),
        lambda session, size: _playground(session, wishes, size),
    )  # fmt: skip


def _compiling(wishes):
    """Tells of compiling; for a level, several processes do it."""
    from flockbrush.runs.compile_ahead import compiling_ahead
    from flockbrush.studio.recorded_session import is_recording

    return compiling() if is_recording(wishes.level) else compiling_ahead(wishes.level, wishes.seed, wishes.agents)


def _open(wishes):
    """The session, with all kernels ready."""
    from flockbrush.studio.opening import try_kernels
    from flockbrush.studio.recorded_session import is_recording, open_recorded
    from flockbrush.studio.session import Session

    if is_recording(wishes.level):
        refuse_wishes(wishes)
        return open_recorded(wishes.level)
    session = Session.open(wishes.level, seed=wishes.seed, agents=wishes.agents, record=wishes.record)
    try_kernels(wishes.level, wishes.seed)
    return session


def refuse_wishes(wishes):
    """Raise BadParameter for options that a recording determines itself."""
    for option in ("seed", "agents", "record"):
        if getattr(wishes, option) is not None:
            raise typer.BadParameter("cannot be used with a recording, which has its own", param_hint=f"--{option}")


def _playground(session, wishes, size):
    from flockbrush.studio.app import App
    from flockbrush.studio.session import Session

    scale = wishes.text_size and wishes.text_size / 100
    try:
        app = App(session, size, wishes.theme, scale, wishes.brush, wishes.palette)
    except BaseException:
        session.close(keep=True)
        raise
    left = Session.recoverable(wishes.level, tell=lambda text: app.notify(text, "warning"))
    if left:
        app.offer_recovery(left[0])
    return app


def size_of(text: str) -> tuple[int, int]:
    """Width and height of "1280x720"; BadParameter when it is no size."""
    match = re.fullmatch(r"\s*(\d+)\s*[xX×]\s*(\d+)\s*", text)
    width, height = map(int, match.groups()) if match else (0, 0)
    if not (0 < width <= LARGEST and 0 < height <= LARGEST):
        raise typer.BadParameter(
            f"the size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {text!r}", param_hint="--size"
        )
    return width, height


def missing_display() -> str:
    """Why no window can be opened here; "" when one can.  The environment is then ready for one."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_APP_NAME", "Flockbrush")
    for system in ("X11", "WAYLAND"):  # by which desktops know whose windows are whose
        os.environ.setdefault(f"SDL_VIDEO_{system}_WMCLASS", "flockbrush")
    import pygame

    bare = "XDG_RUNTIME_DIR" not in os.environ
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())  # a library of desktops complains where it is not
    try:
        pygame.display.init()
        pygame.display.set_mode((1, 1), pygame.HIDDEN)
        hidden = pygame.display.get_driver() in ("offscreen", "dummy") and not os.environ.get("SDL_VIDEODRIVER")
        pygame.display.quit()
        return NO_SCREEN.format("there is no display") if hidden else ""
    except pygame.error as error:
        return NO_SCREEN.format(error)
    finally:
        if bare:
            del os.environ["XDG_RUNTIME_DIR"]
