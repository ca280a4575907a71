"""Opens the playground from the command line, or tells why no window can be opened."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import typer

from flockbrush.runs.terminal import USAGE, Interrupts, compiling, say

LARGEST = 16384  # pixels of a window's side
NO_SCREEN = (
    "no window can be opened ({}); flockbrush play needs a screen."
    " Without one, `flockbrush run LEVEL --export herd.mp4` makes a video."
)
KEPT = "unsaved changes are kept; flockbrush play offers to recover them when you open the level again"


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
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_APP_NAME", "Flockbrush")
    for system in ("X11", "WAYLAND"):  # by which desktops know whose windows are whose
        os.environ.setdefault(f"SDL_VIDEO_{system}_WMCLASS", "flockbrush")
    problem = missing_display()
    if problem:
        say(problem)
        return USAGE
    import pygame

    from flockbrush.render.style import theme_of
    from flockbrush.studio.opening import Opening
    from flockbrush.studio.settings import load_settings

    theme = theme_of(wishes.theme or load_settings()[0].theme or "light")
    with Interrupts() as interrupts, _compiling(wishes):
        interrupts.gently()
        try:
            opening = Opening(Path(wishes.level).stem, size, theme, lambda: _open(wishes))
        except pygame.error as error:  # a screen that was there just now
            say(NO_SCREEN.format(error))
            return USAGE
        session = opening.wait(stop=lambda: interrupts.asked)
        if session is not None:
            _play(session, wishes, opening.screen.get_size(), interrupts)
        interrupts.check()
    return 0


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


def _play(session, wishes, size, interrupts):
    from flockbrush.studio.app import App
    from flockbrush.studio.recorded_session import is_recording
    from flockbrush.studio.session import Session

    app, ended_well = None, False
    try:
        app = App(
            session, size, wishes.theme, wishes.text_size and wishes.text_size / 100, wishes.brush, wishes.palette
        )
        known = None if is_recording(wishes.level) else wishes.level
        left = known and Session.recoverable(known, tell=lambda text: app.notify(text, "warning"))
        if left:
            app.offer_recovery(left[0])
        app.run(wishes.frames, stop=lambda: interrupts.asked)
        ended_well = not interrupts.asked
    finally:
        if (app or session).close(keep=not ended_well):
            say(KEPT)


def size_of(text: str) -> tuple[int, int]:
    """Width and height of "1280x720"; BadParameter when it is no size."""
    found = re.fullmatch(r"\s*(\d+)\s*[xX×]\s*(\d+)\s*", text)
    width, height = map(int, found.groups()) if found else (0, 0)
    if not (0 < width <= LARGEST and 0 < height <= LARGEST):
        raise typer.BadParameter(
            f"the size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {text!r}", param_hint="--size"
        )
    return width, height


def missing_display() -> str:
    """Why no window can be opened here; "" when one can."""
    import pygame

    try:
        pygame.display.init()
        pygame.display.set_mode((1, 1), pygame.HIDDEN)
        hidden = pygame.display.get_driver() in ("offscreen", "dummy") and not os.environ.get("SDL_VIDEODRIVER")
        pygame.display.quit()
        return NO_SCREEN.format("there is no display") if hidden else ""
    except pygame.error as error:
        return NO_SCREEN.format(error)
