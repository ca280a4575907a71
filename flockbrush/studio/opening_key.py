"""The key that opened a dialog: its letter arrives once more, as text, and is not meant for the dialog."""

from __future__ import annotations

import pygame


class OpeningKey:
    """Recognises the text of the key press that opened a dialog, until that key is released."""

    def __init__(self):
        self._letter = ""

    def opened(self, event):
        """A dialog was opened by this KEYDOWN event."""
        self._letter = event.unicode

    def is_its_text(self, event) -> bool:
        """Whether an event is the text of that key press; every event before a dialog gets it must be asked about."""
        if event.type == pygame.TEXTINPUT:
            return bool(self._letter) and event.text == self._letter
        if event.type == pygame.KEYUP or (event.type == pygame.KEYDOWN and event.unicode != self._letter):
            self._letter = ""
        return False
