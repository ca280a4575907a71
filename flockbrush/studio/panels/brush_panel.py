"""The Brush panel: sliders for all parameters of a brush, applied to the running herd, and saved as a new brush."""

from __future__ import annotations

import html

import pygame
from pygame_gui.elements import UIButton, UIDropDownMenu

from flockbrush.behaviours.brush import Brush
from flockbrush.components import BrushBinding
from flockbrush.engine.problems import ProblemsError
from flockbrush.studio.brush_palette import whence
from flockbrush.studio.panels.knobs import TABLES, Knob, knobs_of
from flockbrush.studio.panels.macros import macros_of
from flockbrush.studio.panels.panel import Panel, Picture, blank, write
from flockbrush.studio.panels.rows import PanelRow, row_of
from flockbrush.studio.panels.tuning import changes, command_of, turned, use
from flockbrush.studio.widgets import Shelf, enabled


class BrushPanel(Panel):
    """Changes the parameters of the selected brush."""

    title = "Brush"
    tip = "Change all parameters of the selected brush while the herd runs, and save them as a new brush"
    name: str | None
    rows: list[PanelRow]
    heads: list[Picture]
    menu: UIDropDownMenu | None
    scroll: Shelf | None

    def make(self):
        self.name = None
        self.known = ""  # what the rows were made for
        self.drag, self.held = 0, False  # counts strokes of the mouse: one drag is one step of undo
        self.rows, self.heads = [], []
        self.menu = self.scroll = None
        px, area, pad = self.px, self.area, self.px(8)
        self.about = Picture(pygame.Rect(pad, px(42), area.width - 2 * pad, px(20)), self.manager, self.container)
        tip = "Save these parameters as a new brush; its file names the original brush"
        self.save = self._button(0, "Save as…", self.ask_name, tip)
        tip = "Undo all changes of this brush: all parameters as in its file"
        self.drop = self._button(1, "Revert", self.drop_changes, tip)
        tip = "Simple: a few sliders; Advanced: all parameters"
        self.mode = self._button(2, self._mode_words(), self._switch_mode, tip)
        self.refresh()

    def _button(self, k, words, do, tip):
        """One of the three buttons below the rows."""
        pad, tall = self.px(8), self.px(30)
        wide = (self.area.width - 4 * pad) // 3
        place = pygame.Rect(pad + k * (wide + pad), self.area.height - tall - pad, wide, tall)
        button = UIButton(place, words, self.manager, self.container, tool_tip_text=tip, object_id="@small_button")
        self.does[button] = lambda event: do()
        return button

    def close(self):
        self._clear_rows()
        for thing in (self.menu, self.scroll, self.save, self.drop, self.mode, self.about):
            if thing is not None:
                thing.kill()
        self.menu = self.scroll = None

    # what is shown ----------------------------------------------------------------

    @property
    def is_simple(self) -> bool:
        """Whether the panel shows a few sliders instead of all parameters."""
        return self.app.memory.get("brush panel", "simple") == "simple"

    def _mode_words(self):
        return "Advanced" if self.is_simple else "Simple"

    @property
    def brush(self) -> Brush | None:
        """The selected brush as in the running world, or as in its file if it is not loaded."""
        return self._found(self.name)

    def _found(self, name) -> Brush | None:
        palette = self.app.session.palette
        if name in palette.index:
            return palette.brushes[palette.index[name]]
        try:
            return self.app.session.library.get(name) if name else None
        except ProblemsError:
            return None

    @property
    def is_in_world(self) -> bool:
        """Whether the selected brush is loaded in the running world."""
        return self.name in self.app.session.palette.index

    def asset_of(self, brush: Brush) -> Brush:
        """A brush as its file has it; as it was when first seen, if it has none."""
        first = self.app.memory.setdefault("first seen brushes", {})
        try:
            asset = self.app.session.library.get(brush.name)
        except ProblemsError:
            asset = first.setdefault(brush.name, brush)
        return asset if asset.model == brush.model else first.setdefault(brush.name, brush)

    def refresh(self):
        for row in self.rows:
            row.settle()
        self._show()

    def _show(self):
        """The brush as it is now."""
        names = [brush.name for brush in self.app.session.palette.own]
        candidates = (self._found(name) for name in (self.app.brush, self.name, *names))
        brush = next((brush for brush in candidates if brush is not None), None)
        if brush is None:
            return
        self.name = brush.name
        self._offer(names if self.name in names else [*names, self.name])
        asset = self.asset_of(brush)
        kind = f"{brush.name} {brush.model} {self.is_simple}"
        if kind != self.known:
            self._make_rows(brush)
            self.known = kind
        for row in self.rows:
            row.show(row.knob.value(brush), row.knob.value(asset))
        self._say(brush, asset)

    def _offer(self, names):
        """A drop-down of the world's brushes."""
        if self.menu is not None and self.offered == names and self.menu.selected_option[0] == self.name:
            return
        if self.menu is not None:
            if self.menu.current_state is not self.menu.menu_states["closed"] and self.offered == names:
                return  # somebody is choosing
            del self.does[self.menu]
            self.menu.kill()
        pad, self.offered = self.px(8), list(names)
        rect = pygame.Rect(pad, pad, self.area.width - 2 * pad, self.px(28))
        self.menu = UIDropDownMenu(names, self.name, rect, self.manager, container=self.container, object_id="@choice")
        self.does[self.menu] = lambda event: self._choose(event.text)

    def _say(self, brush, asset):
        count = len(changes(brush, asset))
        animals = self._animals(brush)
        texts = f"{brush.model} · {brush.provenance.kind} · {animals}", f"{count} changed" if count else "unchanged"
        if self.about.said != (texts, self.app.theme.name):
            surface, height, px = blank(self.about.size), self.px(13), self.px
            middle = surface.get_height() / 2
            colour = self.colours.accent if count else self.colours.muted
            right = surface.get_width() - write(
                surface, texts[1], (surface.get_width(), middle), height, colour, (1, 0.5)
            )
            pygame.draw.circle(surface, self.app.colour_of(brush.name), (px(7), middle), px(6))
            write(surface, texts[0], (px(18), middle), height, self.colours.muted, room=right - px(24))
            self.about.show(surface, (texts, self.app.theme.name))
            title, more = brush.title or brush.name, brush.description or "No description."
            self.about.element.set_tooltip(f"<b>{html.escape(title)}</b><br>{html.escape(more)}<br>{whence(brush)}")
        enabled(self.drop, count)

    def _animals(self, brush):
        if not self.is_in_world:
            return "not used here"
        world = self.app.session.simulation.world
        count = int((world.agents[BrushBinding.brush] == self.app.session.palette.index[brush.name]).sum())
        return f"{count:,} {'animal' if count == 1 else 'animals'}"

    # rows -------------------------------------------------------------------------

    def _make_rows(self, brush):
        self._clear_rows()
        px, area, pad = self.px, self.area, self.px(8)
        top, bottom = px(66), area.height - px(30) - 2 * pad
        if self.scroll is not None:
            self.scroll.kill()
        place = pygame.Rect(pad, top, area.width - pad, max(px(40), bottom - top))
        self.scroll = Shelf(place, self.manager, container=self.container)
        width, y, table = self.inner, 0, None
        for knob in macros_of(brush) if self.is_simple else knobs_of(brush):
            if knob.table != table:
                table, y = knob.table, self._head(knob.table, brush, y, width)
            row = row_of(self, knob, self.scroll, y, width, self.turn)
            y += row.height
            self.rows.append(row)
        self.scroll.set_scrollable_area_dimensions((width + px(2), y + px(6)))
        if not self.container.visible:
            self.scroll.hide()

    def _head(self, table, brush, y, width) -> int:
        """A heading over the knobs of one table; returns where the first of them begins."""
        px = self.px
        tall = px(26)
        words = {**TABLES, "macro": "Feel"}[table] + (f": {brush.model}" if table == "params" else "")
        head = Picture(pygame.Rect(0, y, width, tall), self.manager, self.scroll)
        surface = blank((width, tall))
        x = write(surface, words, (0, tall - px(9)), px(12), self.colours.muted, bold=True) + px(8)
        pygame.draw.line(surface, self.colours.border, (x, tall - px(9)), (width, tall - px(9)))
        head.show(surface)
        self.heads.append(head)
        return y + tall

    def _clear_rows(self):
        for row in self.rows:
            row.kill()
        for head in self.heads:
            head.kill()
        self.rows, self.heads, self.known = [], [], ""

    def update(self, dt):
        held = any(getattr(row, "held", False) for row in self.rows)
        self.drag += self.held and not held
        self.held = held
        super().update(dt)

    # what is done -----------------------------------------------------------------

    def turn(self, knob: Knob, value, done: bool):
        """Turn a knob of the running brush; one drag of the mouse is one step of undo."""
        brush = self.brush
        if brush is None or knob.value(brush) == value:
            return
        label = f"{knob.words} of {brush.name}: {knob.said(value)}"
        self._do(label, lambda: [self._command(brush, knob, value)], f"tune {brush.name} {knob.name} {self.drag}")
        if done:
            self.drag += 1

    def _command(self, brush, knob, value):
        """A brush that the world has not yet is brought there, with the knob turned."""
        return command_of(brush, knob, value) if self.is_in_world else use(turned(brush, knob, value))

    def _do(self, label, commands, join=None):
        """Submit the request and show its result."""
        try:
            new_commands = commands()
        except ValueError as error:
            self.app.notify(str(error), "warning")
        else:
            self.app.session.do(label, new_commands, join=join)
        self._show()

    def handle(self, event):
        return super().handle(event) or any(row.handle(event) for row in self.rows)

    def _choose(self, name):
        self.app.brush = self.name = name
        self.refresh()

    def _switch_mode(self):
        self.app.memory["brush panel"] = "advanced" if self.is_simple else "simple"
        self.mode.set_text(self._mode_words())
        self.refresh()

    def drop_changes(self):
        """Reset all parameters to the values in the file."""
        brush = self.brush
        if brush is not None:
            asset = self.asset_of(brush)
            self._do(f"changes of {asset.name} reverted", lambda: [use(asset)])
            self.drag += 1

    def ask_name(self):
        """Ask what the new brush shall be called, save it, bring it into the world, and take it in hand."""
        if self.brush is not None:
            self.app.ask_for_brush(self.brush, self.asset_of(self.brush), self._take)

    def _take(self, new_brush):
        self.app.session.do(f"new brush {new_brush.name}", [use(new_brush)])
        self.app.brush = self.name = new_brush.name
        self.refresh()
