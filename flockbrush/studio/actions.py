"""Actions behind keys and buttons: time, undo, files, pictures, window settings."""

from __future__ import annotations

import datetime
import io
import warnings
from pathlib import Path

import pygame

from flockbrush.behaviours.brush import SUFFIX as BRUSH_SUFFIX
from flockbrush.behaviours.program import SUFFIX
from flockbrush.engine.commands import from_record
from flockbrush.engine.files import free_path, write_bytes
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from flockbrush.render.style import THEMES, theme_of
from flockbrush.studio.branches import plain_name
from flockbrush.studio.forms import Form, FormRow, blank, changed, live_commands, number, rows_of, said
from flockbrush.studio.help import Help
from flockbrush.studio.needed import needed
from flockbrush.studio.panels.tuning import as_new
from flockbrush.studio.recorded_session import recovered
from flockbrush.studio.session import RATES
from flockbrush.studio.session_files import LEVELS
from flockbrush.studio.tools.world_tools import KINDS, SPOKEN, free_name
from flockbrush.studio.video_recorder import RunningVideo
from flockbrush.systems.edits import as_command
from flockbrush.systems.level_lists import without_place
from flockbrush.systems.mark_commands import PlaceKey, default_place


class AppActions:
    """Methods of the App that actions call."""

    # time --------------------------------------------------------------------------

    def toggle_play(self):
        """Play or pause."""
        (self.session.pause if self.session.playing else self.session.play)()

    def step(self, ticks):
        """Step by some ticks, forwards or backwards, and pause."""
        self.session.pause()
        self.session.step(ticks)

    def scrub(self, tick):
        """Go to another tick."""
        self.session.scrub(tick, 0.008)

    def restart(self):
        """Restart the level."""
        playing = self.session.playing
        self.session.restart()
        if playing:
            self.session.play()

    def change_rate(self, factor):
        """Multiply the playback speed by a factor."""
        now = min(range(len(RATES)), key=lambda k: abs(RATES[k] - self.session.rate))
        self.session.rate = RATES[min(max(now + (1 if factor > 1 else -1), 0), len(RATES) - 1)]

    def branch(self):
        """Start a new branch at this tick."""
        self.notify(f"now on branch {self.session.branch()!r}; the branch before is kept")

    def switch(self, name):
        """Switch to another branch."""
        if name != self.session.branch_name:
            self.session.switch(name)

    # edit --------------------------------------------------------------------------

    def do(self, label, commands, join=None):
        """Apply commands to the world; returns whether it worked.  A refusal becomes a message."""
        applied = self.session.do(label, list(commands), join=join)
        self.tell()
        return applied

    def undo(self):
        """Undo the last change."""
        self.tool.interrupt()
        self._notify_step(self.session.undo_label, self.session.undo(), "undo")

    def redo(self):
        """Redo the change that was undone last."""
        self.tool.interrupt()
        self._notify_step(self.session.redo_label, self.session.redo(), "redo")

    def _notify_step(self, label, happened, step):
        """Show what was undone or redone; obstacles to it the session shows itself."""
        if happened:
            self.notify(f"{step[:-2]}done: {label}")
        elif not label:
            self.notify(f"there is nothing to {step}")

    def edit_recorded(self, kind, **values):
        """Make an edit of the recorded animals that are selected; whether it was made."""
        return self.guard_edits(lambda: self.session.edit(kind, **values))

    def guard_edits(self, change, *arguments):
        """Change the edits of a recording; whether it was done.  What stands against it becomes a message."""
        try:
            sentence = change(*arguments)
        except (ValueError, ProblemsError) as error:
            return self._refuse(error)
        if sentence:
            self.notify(sentence)
        return True

    def delete(self):
        """Delete what is selected."""
        if not self.tool.delete() and not self.tools["select"].delete():
            self.notify(f"nothing is selected: {self.tool.selects}")

    def cancel(self):
        """Close the help, or cancel the drawing, or clear the selection."""
        if self.help is not None and self.help.alive():
            self.help.kill()
        elif not self.tool.cancel():
            self.tools["select"].cancel()

    # files -------------------------------------------------------------------------

    def title(self):
        """The window title."""
        return f"{self.level_name()} – Flockbrush"

    def level_name(self):
        """The name of the level in the title."""
        return Path(self.session.path).stem if self.session.path else self.session.level.name

    def save(self):
        """Write the level to its file; ask for a file if that is shipped, from a recording or not Tiled's JSON."""
        return self.save_as() if self.session.needs_name else self._save(None)

    def save_as(self, then=lambda: None, branch=""):
        """Ask for a file (of a ``branch`` another one is offered) and write the level there; call `then` afterwards."""
        lent, path = self.session.lent, self.session.path
        other = self.session.needs_name and not lent
        start = Path.cwd() / f"{self.level_name()}.tmj" if lent else path.with_suffix(".tmj") if other else path
        if branch:
            start = start.with_name(f"{start.stem}-{plain_name(branch)}{start.suffix}")
        why = f"Branch {branch}. " if branch else ""
        why += "This level is part of Flockbrush or of a recording and cannot be changed.\n" if lent else ""
        why += f"Changes of a {path.suffix} file are saved as .tmj.\n" if other else ""
        self.ask_text("Save the level", f"{why}File to write:", str(start), lambda text: self._save_to(text, then))

    def _save_to(self, text, then):
        if not text:
            self.notify("enter a file name", "warning")
            return False
        path = Path(text).expanduser()
        path = path if path.suffix.lower() in LEVELS else path.with_name(f"{path.name}.tmj")
        if path.exists() and path.resolve() != Path(self.session.path or "").resolve():
            answers = [("Replace", lambda: self._save(path) and then()), ("Cancel", None)]
            return self.ask("Save the level", f"{path} already exists.", answers)
        return self._save(path) and then()

    def _save(self, path):
        written = self.session.save(path)
        self.tell()
        if written:
            self._known_disk = ""
            pygame.display.set_caption(self.title())
            past = self.session.in_past
            self.notify(f"saved {written}" + (", as the level is at the end of this branch" if past else ""))
        return written

    def reload(self):
        """Read the level file again; ask first if there are unsaved changes."""
        if not self.session.dirty or self.session.lent:  # which the session refuses to lose
            return self._reload()
        answers = [("Reload", self._reload), ("Cancel", None)]
        question = f"Your unsaved changes will be kept beside {Path(self.session.path).name}, in a .mine.bak file."
        return self.ask("Reload the level from disk?", question, answers)

    def _reload(self, keep="theirs"):
        self.tool.cancel()
        self.session.reload(keep)
        self.tell()
        if keep == "theirs":
            self.select(None)
            self.tool_changed()

    def reload_live(self):
        """Reload the level after another program changed it, when there are no unsaved changes here."""
        self._reload()
        if not self.session.changed_on_disk():
            self.notify("another program changed the level; it was reloaded, and the run before is kept as a branch")

    def offer_reload(self, how):
        """Ask what to do after another program changed or deleted the level file."""
        if how == "deleted":
            answers = [("Save again", self.save), ("Continue", None)]
            self.ask("The level file was deleted", f"{self.session.path} does not exist any more.", answers)
            return
        answers = [("Reload", self._reload), ("Keep mine", lambda: self._reload("mine"))]
        advice = "  Both versions are kept: yours in a .mine.bak file, the other in a .theirs.bak file."
        advice = advice if self.session.dirty and not self.session.lent else ""
        self.ask("The level file has changed", f"Another program has changed this level file.{advice}", answers)

    def offer_recovery(self, left):
        """Ask whether to recover the unsaved changes of a crashed session."""
        answers = [("Recover", lambda: self._recover(left)), ("Discard", left.discard), ("Not now", None)]
        why = f"A session with this level ended with unsaved changes:\n{left}"
        self.ask("Unsaved changes", why, answers)

    def _recover(self, left):
        try:
            session = recovered(left)
        except (RecordingError, ProblemsError, OSError) as error:
            return self.notify(f"these changes cannot be recovered: {error}", "error")
        self.session.close()
        self.session = session
        self.empty(self.brush if self.brush in self.brush_names() else None)
        self.select(None)
        self.build()
        self.tell()
        return self.notify("your unsaved changes were recovered")

    def export_recording(self):
        """Ask where to write the recording."""
        start = Path.cwd() / f"{self.level_name()}-{stamp()}.flock"
        self.ask_text("Export the recording", "File to write:", str(start), self._export)

    def _export(self, text):
        if not text:
            self.notify("enter a file name", "warning")
            return False
        written = self.session.export_recording(Path(text).expanduser())
        self.tell()
        return written

    # pictures ------------------------------------------------------------------------

    def screenshot(self):
        """Write a screenshot of the window into the current folder."""
        path = free_path(Path.cwd() / f"flockbrush-{self.level_name()}-{stamp()}.png")
        picture = io.BytesIO()
        try:
            pygame.image.save(self.screen, picture, "picture.png")
            write_bytes(path, picture.getvalue(), overwrite=False)
        except (pygame.error, ProblemsError) as error:
            return self.notify(f"the screenshot was not written: {error}", "error")
        return self.notify(f"wrote {path}")

    def toggle_video(self):
        """Start or stop a video."""
        if self.film is None:
            path = free_path(Path.cwd() / f"flockbrush-{self.level_name()}-{stamp()}.mp4")
            self.film = RunningVideo(path, self.canvas.rect.size)
            self.notify("recording a video of the canvas; F9 stops")
        else:
            self.end_video()

    def end_video(self):
        """Stop the video, if one is being recorded."""
        film, self.film = self.film, None
        if film is not None:
            message = film.close()
            self.notify(message, "error" if film.problem else "info")

    # the window ------------------------------------------------------------------------

    def set_theme(self, name):
        """Set the colours of the window: light, dark or vivid."""
        self.theme = theme_of(name, self.theme.palette)
        self.remember(theme=name)
        self.build()

    def set_palette(self, name):
        """Set the colours of brushes: their own, or a palette."""
        self.theme = theme_of(self.theme.name, name)
        self.remember(palette=name)
        self.build()

    def set_scale(self, scale):
        """Set the size of text and buttons; None: the size that suits the window and the screen."""
        self.wanted_scale = scale
        self.remember(ui_scale=scale)
        self.build()

    def toggle_theme(self):
        """Switch to the next theme."""
        names = list(THEMES)
        self.set_theme(names[(names.index(self.theme.name) + 1) % len(names)])

    def toggle_columns(self):
        """Hide or show the side columns."""
        self.columns = not self.columns
        self.build()

    def toggle_space(self):
        """Switch between plan and 3D view."""
        self.let_go()
        self.canvas.toggle_space()

    def toggle_follow(self):
        """Switch following of the herd on or off."""
        self.canvas.follow()
        whom = "herd" if self.selected is None else "selected animal"
        self.notify(f"the view follows the {whom}; T stops" if self.canvas.follows else "the view stays still")

    def toggle_fullscreen(self):
        """Switch full screen on or off."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "re-creating window")  # which is what was asked for
            pygame.display.toggle_fullscreen()

    def toggle_help(self):
        """Show or hide the help."""
        if self.help is not None and self.help.alive():
            self.help.kill()
        else:
            self.help = Help(self)

    def pan_by(self, right, down):
        """Move the view by a step of the arrow keys."""
        self.canvas.pan(60 * right * self.scale, 60 * down * self.scale)

    # questions ---------------------------------------------------------------------------

    def ask_properties(self):
        """Open a form with the properties of the selected object, or of the one under the mouse."""
        select = self.tools["select"]
        held = select.held()
        chosen = (select.thing[0], held) if held is not None else None
        if chosen is None and self.tool.at is not None:
            chosen = self.thing_under(self.tool.at, KINDS)
        if chosen is None:
            self.notify("first click an object (zone, goal, guide, obstacle) with the Select tool, or point at one")
            return
        kind, thing = chosen
        if not thing.id:
            self.notify(f"this {kind} is not an object of the level", "warning")
            return
        if kind == "key":
            return self.ask_key(None, thing)
        command = as_command(self.session.simulation.world, kind, thing.id)
        spoken = SPOKEN.get(kind, kind)
        self._open_form(f"{spoken.capitalize()} {command.name!r}", command, f"change the {spoken}", kind.capitalize())

    def ask_command(self, name="", xy=None):
        """Open a form for a script command and submit it."""
        level, known = self.session.simulation.level, live_commands()
        xy = xy or self.tool.at or (level.width / 2, level.height / 2)
        name = name or ("Gust" if "Gust" in known else next(iter(known)))
        menu = {"choices": list(known), "chosen": name, "choose": lambda other: self.ask_command(other, xy)}
        self._open_form("Command", blank(known[name], xy), name, **menu)

    def ask_key(self, xy, key=None, name=""):
        """Open a form for a key of the level's script: a new one at a point, or an existing one."""
        known, world = live_commands(), self.session.simulation
        if key is not None and key.command not in known:
            self.notify(f"{key.command} has values that this form cannot show; change this key in Tiled", "warning")
            return
        xy = tuple(key.xy.tolist()) if xy is None else tuple(round(float(value), 2) for value in xy)
        name = name or (key.command if key else "Gust" if "Gust" in known else next(iter(known)))
        same = key is not None and name == key.command
        shown_command = from_record(name, key.args) if same else blank(known[name], xy)
        when = key.at if key else round(world.clock.now, 2)
        called = key.name if key else free_name(world, "key")

        def give(texts):
            try:
                command = changed(shown_command, {row: text for row, text in texts.items() if row != "when"})
                args = said(command, default_place(name, vars(command), xy))
                at = number(texts["when"], "time")
                place = PlaceKey(key.id if key else self.new_id(), called, at, name, args, *xy)
                return self.do(f"{'change' if key else 'place'} a script key", [*needed(self.session, command), place])
            except (ValueError, ProblemsError) as error:
                return self._refuse(error)

        menu = {"choices": list(known), "chosen": name, "choose": lambda other: self.ask_key(xy, key, other)}
        rows = [
            FormRow("when", "time, s", f"{when:.12g}", "of the command after the start"),
            *rows_of(shown_command),
        ]
        self.open_dialog(Form(self, f"Script key {called!r}", rows, give, **menu))

    def _refuse(self, error):
        """Say what is wrong; a form stays open."""
        self.notify(str(error), "error")
        return False

    def _open_form(self, title, command, label, kind="", **menu):
        """Open a form that submits the command with the typed values."""

        def give(texts):
            try:
                edited = without_place(changed(command, texts), command)
                return self.do(label, [*needed(self.session, edited), edited])
            except (ValueError, ProblemsError) as error:
                return self._refuse(error)

        self.open_dialog(Form(self, title, rows_of(command, kind), give, **menu))

    def ask_text(self, title, question, default, on_ok):
        """Ask for a text and call a function with it."""
        self.ask(title, question, [("OK", on_ok), ("Cancel", None)], default)

    def ask_for_program(self, program, then=lambda: None):
        """Ask for a folder and write a program there; call `then` afterwards."""

        def save(folder):
            path = self.session.save_program(program, folder)
            self.tell()
            return path is not None and then()

        self.ask_text("Save program", f"Folder for {program.name}{SUFFIX}:", str(self.session.program_folder), save)

    def ask_for_brush(self, brush, asset, then):
        """Ask for a name, save a changed brush under it, and call `then` with the new brush.

        ``asset`` is what it was made of.
        """

        def save(name):
            name = name.strip().removesuffix(BRUSH_SUFFIX)
            try:
                new = as_new(brush, asset, name, datetime.date.today())
                if name in self.session.brush_names:
                    raise ValueError(f"a brush {name!r} already exists; choose another name")
            except ValueError as error:
                self.notify(str(error), "error")
                return False
            path = self.session.save_changed(brush, new)
            self.tell()
            if path is not None:
                then(new)
                self.notify(f"saved {path}")
            return None

        question = f"Name of the new brush, made from '{brush.name}' (letters, digits, - and _):"
        self.ask_text("Save as new brush", question, self.session.free_brush_name(brush.name), save)

    @property
    def unsaved(self):
        """A sentence about what is not saved, "" when everything is."""
        parts = [self.level_name()] if self.session.dirty else []
        parts += [f"the branch {name}" for name in self.session.unsaved_branches]
        parts += [f"the brush {brush.name}" for brush in self.session.unsaved_brushes()]
        parts += [f"the program {program.name}" for program in self.session.unsaved_programs()]
        return f"There are unsaved changes of {' and '.join(parts)}." if parts else ""

    def _save_and_quit(self):
        """Save the level, then each branch, brush and program that was changed, and quit if all of that was done."""
        session = self.session
        brushes = session.unsaved_brushes()
        if session.dirty or (brushes and session.lent):  # brushes lie beside a level
            if session.needs_name:
                self.save_as(then=self._save_and_quit)
            elif self._save(None):
                self._save_and_quit()
            return
        programs = session.unsaved_programs()
        if session.unsaved_branches:
            session.switch(session.unsaved_branches[0])
            self.save_as(self._save_and_quit, session.branch_name)
        elif brushes:
            self.ask_for_brush(brushes[0], session.library.get(brushes[0].name), lambda new: self._save_and_quit())
        elif programs:
            self.ask_for_program(programs[0], self._save_and_quit)
        else:
            self.quit()


def stamp():
    """Date and time for file names."""
    return datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
