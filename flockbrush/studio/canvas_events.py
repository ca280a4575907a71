"""Mouse and keyboard events of the canvas: they use the tool, and move and turn the view."""

from __future__ import annotations

import pygame

from flockbrush.studio.shortcuts import BY_KEY, key_of
from flockbrush.studio.tools import OF_RECORDINGS, TOOLS

TOOL_KEYS = {kind.key: kind.name for kind in TOOLS + OF_RECORDINGS}


class CanvasEvents:
    """Methods of the App that handle events outside the controls."""

    def _mouse(self, event):
        """Mouse, and keys that come up, that are not for a control."""
        does = {
            pygame.KEYUP: self._key_up, pygame.MOUSEBUTTONDOWN: self._press, pygame.MOUSEBUTTONUP: self._release,
            pygame.MOUSEMOTION: self._move, pygame.MOUSEWHEEL: self._wheel,
        }  # fmt: skip
        if event.type in does:
            does[event.type](event)

    def _pressed_key(self, event):
        key = key_of(event)
        if key == "space":  # alone it is play or pause; held while dragging it moves the view
            if not self._space:
                self._space, self._space_used = True, False
        elif self.tool.hear(pygame.key.name(event.key), True):
            pass
        elif TOOL_KEYS.get(key) in self.tools:
            self.take_tool(TOOL_KEYS[key])
        elif key in BY_KEY:
            BY_KEY[key].do(self)

    def _key_up(self, event):
        if event.key == pygame.K_SPACE and self._space:
            self._space = False
            if not self._space_used:
                self.toggle_play()
        self.tool.hear(pygame.key.name(event.key), False)

    def _press(self, event):
        if self._stroking or self._panning:
            if event.button != self._button:
                return  # one thing at a time
            self._release(event)  # it came up where nobody heard it
        if not self.canvas.rect.collidepoint(event.pos) or event.button > 3:
            return
        if event.button == 1 and self.toasts.click(event.pos):
            return
        self.manager.set_focus_set(None)  # keys are for tools again, not for a field one has typed in
        self._button = event.button
        mods = pygame.key.get_mods()
        around = self.canvas.in_space and not mods & pygame.KMOD_SHIFT and not self._space
        self._turning = around and (event.button == 2 or (event.button == 1 and bool(mods & pygame.KMOD_ALT)))
        if event.button == 2 or self._turning or (event.button == 1 and self._space):
            self._panning = self._space_used = True
            return
        self._stroking = True
        self.canvas.pointer = event.pos
        xy = self.tool.at = self.canvas.metres(event.pos)
        self.tool.press(xy, event.button, mods)

    def _release(self, event):
        if event.button != self._button:
            return
        if self._panning:
            self._panning = False
        elif self._stroking:
            self._stroking = False
            self.tool.release(self.canvas.metres(event.pos))

    def _move(self, event):
        inside = self.canvas.rect.collidepoint(event.pos)
        self.canvas.pointer = event.pos if inside else None
        xy = self.canvas.metres(event.pos)
        if self._panning:
            (self.canvas.orbit if self._turning else self.canvas.pan)(*event.rel)
        elif self._stroking:
            self.tool.at = xy
            self.tool.drag(xy)
        else:
            self.tool.at = xy if inside else None
            if inside:
                self.tool.move(xy)

    def _wheel(self, event):
        position = pygame.mouse.get_pos()
        turn = getattr(event, "precise_y", 0.0) or event.y
        if pygame.key.get_mods() & pygame.KMOD_CTRL:
            self.change_size(1.15**turn)
        elif self.canvas.rect.collidepoint(position):
            self.canvas.zoom(1.2**turn, position)

    def _left(self, event):
        """Finish the drawing when the mouse leaves the window or the window loses the keyboard."""
        if event.type == pygame.WINDOWFOCUSLOST:
            self.let_go()
        if not self._stroking:
            self.tool.at = None

    def let_go(self):
        """Release mouse and keys: without focus the window may miss when they come up."""
        self._space = self._panning = False
        if self._stroking:
            self._stroking = False
            self.tool.release(self.tool.at)
        self.tool.let_go()
        if self.timebar is not None:
            self.timebar.dragging = False
