"""The States panel: a program of the running world as cards and rows, changed while it runs."""

from __future__ import annotations

import pygame

from flockbrush.behaviours.program import load_program
from flockbrush.engine.problems import ProblemsError
from flockbrush.studio.needed import program_needed, programs_of
from flockbrush.studio.panels.panel import FieldsPanel
from flockbrush.studio.panels.program_form import cards_of, changed, with_state, with_trigger, without
from flockbrush.systems.program_commands import Event, GiveProgram, event_names
from flockbrush.systems.program_reports import count_by_state
from flockbrush.systems.programs import Programs


class StatesPanel(FieldsPanel):
    """Shows one program and changes it by commands, which can be undone."""

    title = "States"
    tip = "Change the states of animals and the triggers between them while the herd runs"

    def make(self):
        super().make()
        self.number, self.shown, self.rows = 0, None, {}
        self.counted: dict = {}
        self.refresh()

    # the world ---------------------------------------------------------------------

    @property
    def world(self):
        return self.app.session.simulation.world

    @property
    def program(self):
        """The program that is shown, or None."""
        programs = self.world.resource(Programs).programs
        return programs[min(self.number, len(programs) - 1)] if programs else None

    def put(self, label, source, name, more=()):
        """Bring a program's file into the world, with the brushes of its states; whether it was done."""
        session, program = self.app.session, load_program(source.encode(), f"{name}.program.toml")
        applied = session.do(label, [*program_needed(session, program), *more])
        self.shown = None
        self.soon()
        return applied

    def give(self, name):
        """Have all animals follow a program that there is: one of the level's folders, or a shipped one."""
        try:
            program = programs_of(self.app.session).get(name.strip())
        except ProblemsError as error:
            self.app.notify(error.problems[0].message)
            return
        self.put(f"program {program.name}", program.source.decode(), program.name, [GiveProgram(program.name)])

    # events ------------------------------------------------------------------------

    def _change(self, row, text):
        """Change a row; False when the text is refused."""
        return text == row.text or self._edit(f"{row.label} of {row.path[1]}", lambda: changed(self.program, row, text))

    def _edit(self, label, make):
        """Make a new file; problems become a message, and the form is reset to the state of the file."""
        try:
            source = make()
            return self.put(label, source, self.program.name)
        except (ValueError, ProblemsError) as error:
            self.app.notify(str(error).splitlines()[0])
            self.shown = None
            self.soon()
            return False

    def _ask_state(self):
        add = lambda name: self._edit(f"state {name}", lambda: with_state(self.program, name.strip()))  # noqa: E731
        self.app.ask_text("State", "Name of the new state:", "new", add)

    def _ask_program(self):
        names = ", ".join(programs_of(self.app.session).names())
        self.app.ask_text("Program", f"Program for all animals ({names}):", "stampede", self.give)

    def _next(self):
        self.number = (self.number + 1) % max(len(self.world.resource(Programs)), 1)
        self.shown = None
        self.soon()

    # layout ------------------------------------------------------------------------

    def refresh(self):
        program = self.program
        known = (None if program is None else (program.name, program.source), tuple(self._brushes()))
        if known != self.shown:
            self.shown = known
            self._lay_out(program)
        if program is not None:
            state_counts = count_by_state(self.world)[program.name]
            for state, label in self.counted.items():
                text = f"{state}   {state_counts.get(state, 0):,}"
                if label.text != text:
                    label.set_text(text)

    def _brushes(self):
        return self.app.session.library.names()

    def _lay_out(self, program):
        """Make the widgets of a program's cards."""
        self.clear()
        self.rows, self.counted = {}, {}
        y = self._top(program)
        if program is not None:
            for card in cards_of(program, self._brushes()):
                y = self._card(card, y)
            half = (self.inner - self.px(6)) // 2
            self.button("Add state", self._ask_state, 0, y, half)
            add = lambda: self._edit("trigger", lambda: with_trigger(self.program))  # noqa: E731
            self.button("Add trigger", add, half + self.px(6), y, half)
            y += self.px(34)
            self.button("Save program", lambda: self.app.ask_for_program(self.program), 0, y, self.inner)
            y += self.px(34)
        self.scroll.set_scrollable_area_dimensions((self.inner, y + self.px(6)))

    def _top(self, program):
        px, half = self.px, (self.inner - self.px(6)) // 2
        if program is None:
            self.label("No animal follows a program.", 0, 0, self.inner)
            self.button("Choose a program", self._ask_program, 0, px(30), self.inner)
            return px(66)
        self.label(program.title or program.name, 0, 0, self.inner, "@heading")
        y, events = px(28), event_names(self.world)
        several = len(self.world.resource(Programs)) > 1
        if several:
            self.button("Next program", self._next, 0, y, half)
        self.button("Choose a program", self._ask_program, (half + px(6)) * several, y, half)
        y += px(32)
        for k, name in enumerate(events):
            event = lambda name=name: self.app.session.do(f"event {name}", [Event(name)])  # noqa: E731
            self.button(f"Event: {name}", event, (k % 2) * (half + px(6)), y + (k // 2) * px(32), half)
        return y + -(-len(events) // 2) * px(32) + px(4)

    def _card(self, card, y):
        px = self.px
        label = self.label(card.title, 0, y, self.inner - px(34), "@heading")
        if card.path[0] == "state":
            self.counted[card.title] = label
        remove = lambda: self._edit(f"remove {card.title}", lambda: without(self.program, card.path))  # noqa: E731
        self.button("×", remove, self.inner - px(28), y, px(26))
        y += px(28)
        for row in card.rows:
            self._row(row, y)
            y += px(28)
        return y + px(8)

    def _row(self, row, y):
        px, left = self.px, round(0.42 * self.inner)
        self.label(row.label, px(6 + 10 * row.depth), y, left - px(8 + 10 * row.depth))
        place = pygame.Rect(left, y, self.inner - left, px(26))
        if row.choices and row.text in row.choices:
            widget = self.menu(row.choices, row.text, place, lambda text: self._change(row, text))
        else:
            widget = self.field(row.text, place, lambda: self._change(row, widget.get_text()))
        self.rows[widget] = row
