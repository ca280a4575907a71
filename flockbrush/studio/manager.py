"""A faster pygame_gui manager, for windows that are rebuilt at every change of size."""

from __future__ import annotations

import json
import warnings
from collections import OrderedDict, deque

import i18n
import pygame_gui
from pygame_gui.core.ui_appearance_theme import UIAppearanceTheme
from pygame_gui.core.utility import get_default_manager, set_default_manager

LOOKS = 8  # themes that are kept, of the last windows
PIXELS = 4_000_000  # of the shapes that a theme keeps: 16 MB

_NAMES: dict = {}  # of elements in the theme, by where they stand: the same in every window
_THEMES: OrderedDict = OrderedDict()  # by what they say: each is made once, for every window that looks so


class Manager(pygame_gui.UIManager):
    """The manager of the playground's controls."""

    def __init__(self, size, look: dict):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of fonts that it then finds
            super().__init__(size, look, enable_live_theme_updates=False)
            self._load_bold(int(look["@page"]["font"]["size"]))
        if get_default_manager() is self:
            set_default_manager(None)  # all controls are told theirs, and it would keep the first window for ever
        i18n.load_path[:] = dict.fromkeys(i18n.load_path)  # each manager adds the same, and each word is sought in all

    def _load_bold(self, size):
        fonts = self.get_theme().get_font_dictionary()
        if not fonts.check_font_preloaded(fonts.create_font_id(size, "noto_sans", True, False)):
            self.preload_fonts([{"name": "noto_sans", "point_size": size, "style": "bold", "antialiased": "1"}])

    def create_new_theme(self, theme_path=None):
        key = json.dumps(theme_path), self._locale
        if key not in _THEMES:
            _THEMES[key] = theme = _Theme(self.resource_loader, self._locale)
            if theme_path is not None:
                theme.load_theme(theme_path)
        _THEMES.move_to_end(key)
        while len(_THEMES) > LOOKS:
            _THEMES.popitem(last=False)
        return _THEMES[key]

    def update(self, time_delta):
        """A control's states are drawn when they are shown first, not all of them as soon as there is time."""
        for element in self.ui_group.sprites():
            shape = element.drawable_shape
            if shape is not None and shape.states_to_redraw_queue:
                generated = [name for name in shape.states_to_redraw_queue if shape.states[name].generated]
                shape.states_to_redraw_queue = deque(generated)
        super().update(time_delta)


class _Names(list):
    """Names by which an element is looked up; known by which list it is, not by what is in it."""

    __hash__ = object.__hash__  # type: ignore[assignment]


class _Theme(UIAppearanceTheme):
    """Remembers what was looked up; pygame_gui's own memory costs more than it saves.  Nobody changes it once made."""

    def __init__(self, loader, locale):
        self._found: dict = {}
        super().__init__(loader, locale)
        self.shape_cache = _Shapes()

    def build_all_combined_ids(self, element_base_ids, element_ids, class_ids, object_ids):
        key = tuple(tuple(ids or ()) for ids in (element_base_ids, element_ids, class_ids, object_ids))
        if key not in _NAMES:
            self.unique_theming_ids.clear()
            _NAMES[key] = _Names(super().build_all_combined_ids(element_base_ids, element_ids, class_ids, object_ids))
        return _NAMES[key]

    def get_misc_data(self, misc_data_id, combined_element_ids):
        return self._once(super().get_misc_data, misc_data_id, combined_element_ids)

    def get_image_details(self, image_id, combined_element_ids):
        return self._once(super().get_image_details, image_id, combined_element_ids)

    def _once(self, look_up, what, names):
        if not isinstance(names, _Names):
            return look_up(what, names)
        key = look_up.__name__, what, names
        if key not in self._found:
            try:
                self._found[key] = look_up(what, names), None
            except LookupError as error:
                self._found[key] = None, str(error)
        value, missing = self._found[key]
        if missing is not None:
            raise LookupError(missing)
        return value


class _Shapes:
    """The drawn backgrounds of controls, in place of pygame_gui's cache that copies each onto a large sheet."""

    def __init__(self):
        self._drawn, self._pixels = OrderedDict(), 0

    @staticmethod
    def build_cache_id(shape, size, shadow_width, border_widths, border_colour, bg_colour, corner_radius=None):
        """What a shape looks like."""
        colours = (str(colour) for colour in (border_colour, bg_colour))
        return (shape, *size, shadow_width, *border_widths.values(), *colours, *(corner_radius or ()))

    def find_surface_in_cache(self, lookup_id):
        """The shape that looks so, or None."""
        surface = self._drawn.get(lookup_id)
        if surface is not None:
            self._drawn.move_to_end(lookup_id)
        return surface

    def add_surface_to_cache(self, surface, string_id):
        """Cache a shape; shapes that were not used lately are dropped."""
        if string_id in self._drawn:
            return
        self._drawn[string_id] = surface
        self._pixels += surface.get_width() * surface.get_height()
        while self._pixels > PIXELS:
            _, old = self._drawn.popitem(last=False)
            self._pixels -= old.get_width() * old.get_height()

    def remove_user_from_cache_item(self, string_id):
        """Nobody counts users."""

    def remove_user_and_request_clean_up_of_cached_item(self, string_id):
        """Nobody counts users."""

    def update(self):
        """Nothing is to be done between frames."""
