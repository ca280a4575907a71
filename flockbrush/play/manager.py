"""pygame_gui's manager, made quick enough for windows that are built anew at every change of size."""

from __future__ import annotations

import warnings

import pygame_gui
from pygame_gui.core.ui_appearance_theme import UIAppearanceTheme

_NAMES: dict = {}  # of elements in the theme, by where they stand: the same in every window


class _Theme(UIAppearanceTheme):
    """Remembers the names by which an element is looked up; pygame_gui's own memory costs more than it saves."""

    def build_all_combined_ids(self, element_base_ids, element_ids, class_ids, object_ids):
        key = tuple(tuple(ids or ()) for ids in (element_base_ids, element_ids, class_ids, object_ids))
        if key not in _NAMES:
            self.unique_theming_ids.clear()
            _NAMES[key] = super().build_all_combined_ids(element_base_ids, element_ids, class_ids, object_ids)
        return _NAMES[key]


class Manager(pygame_gui.UIManager):
    """The manager of the playground's controls."""

    def __init__(self, size, look: dict):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of fonts that it then finds
            super().__init__(size, look, enable_live_theme_updates=False)
            small = int(look["@page"]["font"]["size"])
            self.preload_fonts([{"name": "noto_sans", "point_size": small, "style": "bold", "antialiased": "1"}])

    def create_new_theme(self, theme_path=None):
        theme = _Theme(self.resource_loader, self._locale)
        if theme_path is not None:
            theme.load_theme(theme_path)
        return theme
