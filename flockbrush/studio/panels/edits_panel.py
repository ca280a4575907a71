"""The Edits panel: changes of a recording after its run, in layers, which exports apply."""

from __future__ import annotations

import math

import pygame

from flockbrush.runs.edit_file import sentence_of
from flockbrush.runs.run_edits import ALWAYS
from flockbrush.runs.snapshots import words_of
from flockbrush.studio.forms import Form, FormRow, number
from flockbrush.studio.panels.panel import FieldsPanel

CHOOSE, EVERYBODY, NEW = "Select all ...", "all animals", "new layer ..."


class Change:
    """A kind of edit with what its form asks for: (field, label, text at first, tip)."""

    def __init__(self, title, tip, *rows):
        self.title, self.tip, self.rows = title, tip, [FormRow(*row) for row in rows]


CHANGES = {
    "delete": Change("Delete", "Hide the selected animals between the two times (key Delete)"),
    "freeze": Change("Freeze", "Stop the selected animals between the two times; then they continue from there"),
    "move": Change(
        "Move ...", "Shift and turn the selected animals; a drag on the view shifts them, too",
        ("x", "east, m", "0"), ("y", "north, m", "0"), ("z", "up, m", "0"),
        ("turn", "turn, degrees", "0", "counter-clockwise, about their mean position"),
        ("over", "over, s", "0", "duration of the transition at both ends"),
    ),
    "retime": Change(
        "Retime ...", "Slow the selected animals down, or speed them up along their paths",
        ("speed", "times as fast", "0.5"),
    ),
    "delay": Change(
        "Delay ...", "Show the whole motion of the selected animals later or earlier",
        ("seconds", "later by, s", "1", "negative: earlier"),
    ),
    "look": Change(
        "Look ...", "Draw the selected animals in the colour of another brush, as another species or larger",
        ("brush", "brush", ""), ("species", "species", ""),
        ("size", "times as large", "1", "1: unchanged"),
    ),
}  # fmt: skip


class EditsPanel(FieldsPanel):
    """Shows the layers of edits, and makes edits of the selected animals."""

    title = "Edits"
    tip = "Edits of the recording: exports apply them, the recording itself is not changed"

    def make(self):
        super().make()
        self.known = None
        self.refresh()

    @property
    def edits(self):
        return self.app.session.edits

    # events ------------------------------------------------------------------------

    def _select(self, words):
        if words == CHOOSE:
            return
        simulation = self.app.session.simulation
        column, _, name = ("", "", "") if words == EVERYBODY else words.partition(" ")
        self.app.guard_edits(self.edits.select_named, simulation, column, name)
        self.app.take_tool("edit")
        self.known = None

    def _choose_layer(self, words):
        if words == NEW:
            self.app.ask_text("Layer", "Name of the new layer:", "layout", self._name_layer)
        else:
            self.edits.layer = words

    def _name_layer(self, name):
        if name.strip():
            self.edits.layer = name.strip()
        self.known = None
        self.soon()

    def _take_times(self):
        """Take the times of the fields and restore invalid ones; whether all were valid."""
        self.known = None
        try:
            start = number(self.times["start"].get_text(), "From")
            text = self.times["end"].get_text().strip()
            end = ALWAYS if text in ("", "end") else number(text, "Until")
            if not 0 <= start < end:
                raise ValueError("the first time must be before the second one")
        except ValueError as error:
            self.app.notify(str(error), "error")
            return False
        self.edits.start, self.edits.end = start, end
        return True

    def _now(self, name):
        """Let edits begin or end at the moment that is shown."""
        self.times[name].set_text(f"{self.app.session.clock.now:.12g}")
        self._take_times()

    def _change(self, kind):
        change = CHANGES[kind]
        if not change.rows or not len(self.edits.selected):
            self.app.edit_recorded(kind)
            return

        labels = {row.name: row.label for row in change.rows}

        def give(texts):
            try:
                values = {name: text.strip() if name in ("brush", "species") else number(text, labels[name])
                          for name, text in texts.items()}  # fmt: skip
                self._check_names(values)
                values = self._move(values) if kind == "move" else values
            except ValueError as error:
                self.app.notify(str(error), "error")
                return False
            return self.app.edit_recorded(kind, **values)

        self.app.open_dialog(Form(self.app, change.title.rstrip(" ."), self._with_names(change.rows), give))

    def _with_names(self, rows):
        """The rows of a form; those for names list the known ones."""
        words = words_of(self.app.session.simulation)
        return [
            row._replace(tip=f"{', '.join(words[row.name])}; empty: unchanged") if row.name in words else row
            for row in rows
        ]

    def _check_names(self, values):
        words = words_of(self.app.session.simulation)
        for name in ("brush", "species"):
            if values.get(name) and values[name] not in words[name]:
                raise ValueError(f"there is no {name} {values[name]!r} here; there is {', '.join(words[name])}")

    def _move(self, values):
        about = self.app.canvas.middle_of(self.edits.selected)
        by = values["x"], values["y"], values["z"]
        turned = {"turn": values["turn"], "about": about} if values["turn"] else {}
        return {"by": by, "over": values["over"], **turned}

    # layout ------------------------------------------------------------------------

    def refresh(self):
        if self.edits is None:
            return
        edits = self.edits
        known = (
            len(edits.selected), edits.start, edits.end, edits.layer,
            [(layer.name, layer.on, len(layer.edits)) for layer in edits.file.layers],
            edits.waiting is None,
        )  # fmt: skip
        if known != self.known:
            self.known = known
            self._lay_out()
        if edits.waiting is not None and self.wait is not None:
            self.wait.set_text(f"Edits of time are prepared: {round(100 * edits.waiting)} %")

    def _lay_out(self):
        """Make the widgets of what there is now."""
        self.clear()
        self.boxes, self.wait = {}, None
        self.half = (self.inner - self.px(6)) // 2
        y = self._selection(0)
        y = self._times(y)
        y = self._changes(y)
        y = self._layers(y)
        self.scroll.set_scrollable_area_dimensions((self.inner, y + self.px(6)))

    def _selection(self, y):
        count = len(self.edits.selected)
        self.label(f"{count or 'No'} animal{'s' * (count != 1)} selected", 0, y, self.inner, "@heading")
        words = words_of(self.app.session.simulation)
        offered = [CHOOSE, EVERYBODY] + [f"{column} {name}" for column in ("species", "brush", "state")
                                         for name in words[column] if name]  # fmt: skip
        place = pygame.Rect(0, y + self.px(28), self.inner, self.px(28))
        self.menu(offered, CHOOSE, place, self._select)
        return y + self.px(64)

    def _times(self, y):
        self.times = {}
        ends = {"start": ("From, s", self.edits.start), "end": ("Until, s", self.edits.end)}
        for name, (words, value) in ends.items():
            self.label(words, 0, y, self.px(72))
            place = pygame.Rect(self.px(76), y, self.inner - self.px(76 + 66), self.px(28))
            self.times[name] = self.field("end" if math.isinf(value) else f"{value:.12g}", place, self._take_times)
            self.button("Now", lambda name=name: self._now(name), self.inner - self.px(60), y, self.px(60))
            y += self.px(32)
        return y + self.px(6)

    def _changes(self, y):
        for k, (kind, change) in enumerate(CHANGES.items()):
            x = k % 2 * (self.half + self.px(6))
            self.button(change.title, lambda kind=kind: self._change(kind), x, y, self.half, change.tip)
            y += self.px(32) * (k % 2)
        if self.edits.waiting is not None:
            self.wait = self.label("Edits of time are prepared", 0, y, self.inner)
            y += self.px(28)
        return y + self.px(8)

    def _layers(self, y):
        edits = self.edits
        names = list(dict.fromkeys([*(layer.name for layer in edits.file.layers), edits.layer]))
        self.label("New edits go to", 0, y, self.half)
        place = pygame.Rect(self.half, y, self.inner - self.half, self.px(28))
        self.menu([*names, NEW], edits.layer, place, self._choose_layer)
        y += self.px(36)
        for layer in edits.file.layers:
            switch = lambda on, name=layer.name: self.app.guard_edits(self.edits.switch, name, on)  # noqa: E731
            box = self.check(layer.name, y + self.px(4), layer.on, switch, "Whether exports apply this layer")
            self.boxes[box] = layer.name
            remove = lambda name=layer.name: self.app.guard_edits(self.edits.remove_layer, name)  # noqa: E731
            self.button("×", remove, self.inner - self.px(28), y, self.px(26))
            y += self.px(30)
            for edit in layer.edits:
                self.label(sentence_of(edit), self.px(10), y, self.inner - self.px(10), "@muted")
                y += self.px(22)
        return y
