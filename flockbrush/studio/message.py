"""A message window, for programs such as Tiled that hide the output of commands."""

from __future__ import annotations

import os

MOST_LINES, LONGEST = 25, 160  # of what is shown; all of it is printed


def show_message(title, text, bad=False) -> bool:
    """Show a text until it is closed; False where there is no screen."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    try:
        pygame.display.init()
        pygame.display.message_box(title, shortened(text), message_type="error" if bad else "info", buttons=("OK",))
        pygame.display.quit()
    except pygame.error:
        return False
    return True


def shortened(text) -> str:
    """As much of a text as a window can show, and how many lines are missing."""
    lines = text.splitlines()
    shown = [line if len(line) <= LONGEST else line[: LONGEST - 1] + "…" for line in lines[:MOST_LINES]]
    more = len(lines) - len(shown)
    return "\n".join([*shown, *([f"and {more} more lines; see the console of Tiled"] if more else [])])
