"""The files of a session: level, recordings, own brushes, and the files for recovery after a crash."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from flockbrush.behaviours.brush import SUFFIX, Brush, save_brush
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.program import save_program
from flockbrush.engine.files import free_path, refused, write_bytes
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from flockbrush.levels.document_nodes import is_brush_file
from flockbrush.levels.editor import Editor
from flockbrush.levels.level_files import DiskFiles, is_of_project, project_folder
from flockbrush.levels.libraries import brush_library, program_library
from flockbrush.levels.reader import read_level_text
from flockbrush.levels.schema import PROJECT_FILE
from flockbrush.levels.tiled import renew_brushes
from flockbrush.runs import run as running
from flockbrush.studio.branches import Beginning, plain_name
from flockbrush.studio.history import History
from flockbrush.studio.needed import programs_of
from flockbrush.studio.recovery import RecoveryFolder
from flockbrush.studio.tuned_brushes import BrushFiles, changed_by, is_tuned, tuned_by
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs

AUTOSAVE_SECONDS = 1.0  # s; what a crash may take at most
LEVELS = (".tmj", ".json")  # what files of levels that were saved here end in
ADVICE = "Such a level could not be opened again: undo what is missing, or change or remove what names it.\n"
LITTLE_ROOM = 60  # minutes of the run that a disk has room for; with less, who records is warned


@dataclass(frozen=True)
class SessionNotice:
    """A message to the user, with its kind."""

    kind: str  # "info", "warning" or "error"
    text: str


class LevelFile:
    """A level's file as this session last knew it, to notice when another program writes it.

    Parameters
    ----------
    data : bytes, optional
        What was read from it; what is there now by default.
    """

    def __init__(self, path, data=None):
        self.path = Path(path)
        self._known = _digest(self._bytes() if data is None else data)
        self._seen = None  # its version when it was last compared

    def changed(self):
        """ "" as long as it is the same, "changed" or "deleted"."""
        stamp = file_version(self.path)
        if stamp is None:
            return "deleted" if self._known else ""
        if stamp == self._seen:
            return ""
        if _digest(self._bytes()) != self._known:
            return "changed"
        self._seen = stamp
        return ""

    def keep(self, version, data):
        """Keep another version of it beside it, in place of no other file; the path."""
        return write_bytes(free_path(self.path.with_name(f"{self.path.name}.{version}.bak")), data, overwrite=False)

    def _bytes(self):
        try:
            return self.path.read_bytes()
        except OSError:
            return None


def file_version(path):
    """Marks of a version of a file; None if there is no file."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _digest(data):
    return "" if data is None else hashlib.sha256(data).hexdigest()


class SessionFiles:
    """Methods of a session that read and write files."""

    _tuned: frozenset[str] = frozenset()  # brushes of which it was told that no file has their numbers
    _saved_brushes: frozenset[str] = frozenset()  # texts of changed ones, as they were saved under other names

    # the level -----------------------------------------------------------------

    @property
    def dirty(self):
        """Whether the level's file is not what is seen here."""
        return self.editor.dirty or self.timeline.current.outdated

    @property
    def needs_name(self):
        """Whether the level is saved under another name: its file is not the designer's, or is no JSON of Tiled's."""
        return self.lent or self.path.suffix.lower() not in LEVELS

    def save(self, path=None):
        """Write the level, in its place or elsewhere; the path, or False and a notice.

        What was there before is kept as NAME.tmj.bak.  A level that could not be opened again is not written.
        """
        to, advice = Path(os.path.abspath(self.path if path is None else path)), ""
        try:
            if to.parent == running.SHIPPED:  # whatever is open
                raise refused(to, "is part of Flockbrush and cannot be changed; save it under another name")
            if not to.parent.is_dir():
                raise refused(to, f"there is no folder {str(to.parent)!r}")
            advice = ADVICE
            needed, advice = self._needed(), ""
            self.editor.save(to)
        except (ProblemsError, OSError, ValueError) as error:
            self._say("error", f"{error}\n{advice}The level was not saved; your changes are kept in this window.")
            return False
        self._bring_along(to, needed)
        self.path, self._file, self.lent = to, LevelFile(to), False
        self.library = brush_library(to, self.level.files)
        self._tell_tuned()
        for branch in self.branches.values():
            branch.outdated = branch is not self.timeline.current
        self._note()
        return to

    def _level_now(self):
        """The level with all that was done to it; ProblemsError."""
        if isinstance(self.editor, History):
            return self.timeline.current.beginning.level
        files = self.simulation.assets()
        return read_level_text(self.editor.text().encode(), self.path, self.brushes_known(), files)

    def _read_again(self):
        """(the level with all that was done to it, its `BrushFiles` as they are on the disk now); ProblemsError."""
        level = self._level_now()
        files = {name: data for name, data in level.files.items() if is_brush_file(name)}
        self.library = self.library.with_files(files)
        return level, BrushFiles(self.palette.own, self.timeline.current, self.library)

    def _tell_changed(self, files):
        if files.changed:
            told = "changed on disk, so the file as it is now counts; what was tuned stays where the file is as before"
            self._say("info", f"{', '.join(files.changed)}: {told}")

    def _needed(self):
        """{name: bytes} of all files of the level as it is now; ProblemsError when it could not be opened."""
        simulation = running.begin(self._level_now(), self.brushes_known())
        files = simulation.assets()
        simulation.close()
        return files

    def _bring_along(self, to, needed):
        """Write beside a saved level those of the files it needs that it does not find from there."""
        brushes = brush_library(to)
        libraries = {"brushes": brushes, "species": brushes.species, "programs": program_library(DiskFiles(to))}
        try:
            level = read_level_text(self.editor.text().encode(), to, self.brushes_known(), needed)
            files = {name: (data, to.parent / name) for name, data in list(level.files.items())[1:]}
            own = {Path(name).name for name in files}
            for name, data in needed.items():
                library = libraries.get(name.partition("/")[0])
                if library is not None and Path(name).name not in own:
                    files[name] = data, library.file_called(Path(name).name) or to.parent / name
            for data, there in files.values():
                if there.exists():
                    if there.read_bytes() != data:
                        self._say("warning", f"{there} is another file of this name, which the level uses from now on")
                elif is_of_project(there.resolve(), project_folder(to)):
                    there.parent.mkdir(parents=True, exist_ok=True)
                    write_bytes(there, data, overwrite=False)
                else:
                    self._say("warning", f"{there} is missing, and is not written outside of the level's project")
        except (ProblemsError, OSError) as error:
            self._say("warning", f"{to} was saved, but cannot be opened yet: {error}")

    @property
    def unsaved_branches(self):
        """Names of the other branches whose level is in no file."""
        here = self.timeline.current
        return [name for name, branch in self.branches.items() if branch is not here and branch.editor.dirty]

    def _tell_tuned(self):
        """Say once which brushes have other numbers here than in their files, which is what the level will have."""
        tuned = {b.name for b in self.palette.own if is_tuned(b, self.library)}
        if tuned - self._tuned:
            names = ", ".join(sorted(tuned))
            told = f"{names}: changed in this run and not in the level, which has the brush files as they were"
            self._say("warning", f"{told}; save changed brushes as new ones and paint with those to keep them")
        self._tuned = frozenset(tuned)

    def changed_on_disk(self):
        """ "" as long as the level's file is as we know it, "changed" or "deleted" when another program did that."""
        return self._file.changed()

    def reload(self, keep="theirs"):
        """Settle whose level counts when the file was changed by another program; whether that worked.

        Parameters
        ----------
        keep : {"theirs", "mine"}
            "theirs": begin anew with the file as it is; what was not saved here is kept as NAME.tmj.mine.bak, and the
            run as a branch.  "mine": go on; the file as it is now is kept as NAME.tmj.theirs.bak.  Nothing is written
            beside a file that is not the designer's.
        """
        try:
            self._keep_mine() if keep == "mine" else self._take_theirs()
        except (ProblemsError, OSError) as error:
            self._say("error", f"{error}\nThe level in this window is not changed.")
            return False
        return True

    def _keep_mine(self):
        data = None if self.lent else self._file._bytes()  # which is not replaced
        if data is not None:
            self._say("info", f"the other version is kept as {self._file.keep('theirs', data)}")
        self._file = LevelFile(self.path)
        self.timeline.current.outdated = True

    def _take_theirs(self):
        if self.dirty and self.lent:
            raise self._lent("first save your changes elsewhere, then reload")
        level, library = running.open_level(self.path)
        if self.dirty:
            path = self._file.keep("mine", self.editor.text().encode())
            self._say("info", f"your unsaved changes are kept as {path}")
        now, before, self.library = self.timeline.current.beginning, self.library, library
        try:
            self._begin(Beginning(level, library, now.seed, now.agents), None)
        except ProblemsError:
            self.library = before
            raise
        self._file = LevelFile(self.path, level.files[level.path.name])
        self._saved_programs |= {program.source for program in level.programs.values()}

    # brushes ---------------------------------------------------------------------

    def brush_folder(self):
        """The folder for own brushes beside the level, created if missing; ProblemsError."""
        folder = self.path.parent / "brushes"
        if self.lent:
            raise self._lent("first save the level elsewhere, then save brushes beside it")
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise refused(folder, f"cannot be created: {error.strerror}") from None
        self.library = brush_library(self.path, self.level.files)
        return folder

    def _lent(self, advice):
        """The error that nothing is written beside a file that is not the designer's."""
        return refused(self.path, f"is part of Flockbrush or of a recording; {advice}")

    def brushes_known(self):
        """The library of the level, and the brushes that were made in the run and are in no file."""
        known = self.library.names()
        made = {b.name + SUFFIX: b.source for b in self.palette.own if b.name not in known}
        return self.library.with_files(made)

    def _done_on_branches(self):
        """The commands of all that was done in this window and not undone, branch by branch."""
        for branch in self.branches.values():
            yield [command for step in branch.editor.done for command in step.commands]

    def unsaved_brushes(self):
        """Brushes as they were changed in this window, on any branch, if no file has these numbers."""
        tuned = (brush for done in self._done_on_branches() for brush in tuned_by(done, self.library))
        brushes = {brush_to_toml(brush): brush for brush in tuned}
        return [brush for text, brush in brushes.items() if text not in self._saved_brushes]

    @property
    def palette(self):
        """The brushes of the running world."""
        return self.simulation.world.resource(Palette)

    @property
    def brush_names(self):
        """Names that a new brush cannot have."""
        return {*self.library.names(), *self.palette.names}

    def free_brush_name(self, name):
        """A name like this one that no brush has: march-2, and after that march-3."""
        stem, known = re.sub(r"-\d+$", "", name)[:58], self.brush_names
        return next(f"{stem}-{k}" for k in range(2, 10_000) if f"{stem}-{k}" not in known)

    def save_brush(self, brush: Brush, overwrite=False):
        """Save a brush beside the level; the path, or None and a notice."""
        try:
            path = save_brush(brush, self.brush_folder(), overwrite)
        except ProblemsError as error:
            self._say("error", str(error))
            return None
        self._tell_tiled(brush.name)
        return path

    def save_changed(self, brush: Brush, new: Brush):
        """Save what a changed brush became under a new name; as `save_brush`."""
        if path := self.save_brush(new):
            self._saved_brushes |= {brush_to_toml(brush)}
        return path

    def _tell_tiled(self, name):
        """Add own brushes to the Tiled project of the level, if it has one."""
        folder = project_folder(self.path)
        try:
            if renew_brushes(folder, brush_library(folder / self.path.name)):
                message = f"Tiled shows the brush {name!r} when the project is opened again"
                self._say("info", f"{folder / PROJECT_FILE}: {message}")
        except (ProblemsError, OSError) as error:
            self._say("warning", f"Tiled does not show the brush: {error}")

    # programs --------------------------------------------------------------------

    def unsaved_programs(self):
        """Programs as they were changed in this window, on any branch, if no file has them."""
        changed = (program for done in self._done_on_branches() for program in changed_by(done, programs_of(self)))
        programs = {program.source: program for program in changed}
        return [program for text, program in programs.items() if text not in self._saved_programs]

    def changed_programs(self):
        """Programs of the world that are not as the level had them when this run began."""
        known = self.level.programs
        programs = self.simulation.world.resource(Programs).programs
        return [p for p in programs if p.name not in known or known[p.name].source != p.source]

    @property
    def program_folder(self) -> Path:
        """The folder that is offered for programs: beside the level, or here if its folder is not the designer's."""
        return (Path.cwd() if self.lent else self.path.parent) / "programs"

    def save_program(self, program, folder):
        """Write a program's file, in place of none that is there; the path, or None and a notice."""
        folder = Path(os.path.abspath(Path(folder).expanduser()))
        try:
            if folder.resolve().is_relative_to(running.SHIPPED.resolve()):
                raise refused(folder, "is part of Flockbrush and cannot be changed; choose another folder")
            folder.mkdir(exist_ok=True)
            path = save_program(program, folder)
        except ProblemsError as error:
            self._say("error", str(error.problems[0]))
            return None
        except OSError as error:
            self._say("error", f"{folder}: {error.strerror or error}")
            return None
        self._saved_programs.add(program.source)
        self._say("info", f"saved {path}")
        return path

    # the run ------------------------------------------------------------------------

    def tell_size(self, path):
        """Say how fast the file of a recording will grow, and for how long the disk has room if that is not long."""
        rate = running.hashed_rate(self.simulation)
        message = f"{path.name} grows by about {60 * rate / 1e6:.2g} MB per minute of the run"
        with suppress(OSError):
            minutes = shutil.disk_usage(path.parent).free / (60 * rate)
            if minutes < LITTLE_ROOM:
                self._say("warning", f"{message}; the disk has room for {minutes:.0f} minutes")
                return
        self._say("info", message)

    def export_recording(self, path):
        """Write the current branch as a recording that ``flockbrush replay --verify`` accepts; whether it worked."""
        try:
            self.timeline.export(path)
        except (RecordingError, OSError) as error:
            self._say("error", str(error))
            return False
        self._say("info", f"wrote {path}")
        return True

    def autosave(self):
        """Once a second: hand what happened to the operating system, so that a crash cannot take it."""
        if time.monotonic() - self._flushed < AUTOSAVE_SECONDS:
            return
        self._flushed = time.monotonic()
        self.timeline.flush()
        if self.editor.journal_problem:
            self._say("warning", f"new changes are not protected against a crash: {self.editor.journal_problem}")
            self.editor.journal_problem = ""

    @property
    def unsaved(self) -> bool:
        """Whether anything would be lost without being saved."""
        return self.dirty or bool(self.unsaved_branches or self.unsaved_brushes() or self.unsaved_programs())

    def close(self, keep=False):
        """End the recordings in good order; whether something is left to recover.

        Parameters
        ----------
        keep : bool
            Whether what is not saved stays for next time.
        """
        unsaved = self.unsaved
        keep = keep and unsaved and self._recovery is not None
        if keep:
            self._note()
        for branch in self.branches.values():
            branch.editor.close_journal()
        self.timeline.close()
        if self._recovery is not None:
            self._recovery.close(keep, unsaved)
        return keep

    @staticmethod
    def _level_of(left, recovery, assets):
        """The path of the level with which a crashed session (`recovery.Leftover`) goes on."""
        return left.level

    def _adopt(self, editor, branch=None):
        """Have this editor on a branch, with a journal that a crash leaves."""
        branch = branch or self.timeline.current
        branch.editor = editor
        if self._recovery is None:
            return
        try:
            editor.journal(self._journal_of(branch.name))
        except OSError as error:
            self._say("warning", f"new changes are not protected against a crash: {error}")

    def _journal_of(self, name):
        return self._recovery.folder / f"{plain_name(name)}.journal"

    def _note(self):
        """Write the list of branches for a recovery."""
        if self._recovery is None:
            return
        self.timeline.flush()
        self._recovery.level = Path(os.path.abspath(self.path))
        self._recovery.recording = self.recording
        try:
            files = {name: self._files_of(branch) for name, branch in self.branches.items()}
            assets = ([asset.name for asset in assets] for assets in (self.unsaved_brushes(), self.unsaved_programs()))
            self._recovery.note(self.branch_name, files, *assets)
        except ProblemsError as error:
            self._say("warning", f"new changes are not protected against a crash: {error}")

    def _files_of(self, branch):
        """Where the files of a branch lie."""
        journal = self._journal_of(branch.name)
        return {
            "recording": branch.recorder and os.path.abspath(branch.recorder.path),
            "journal": str(journal) if journal.exists() else None,
            "parent": branch.parent,
            "left": branch.left,
        }

    def _say(self, kind, text):
        self._notices.append(SessionNotice(kind, text))


def editor_of(path, simulation, beginning, library):
    """(editor, why): the editor of a level, or of the run alone and the reason why its file cannot be edited."""
    why = ""
    if simulation.level.shape != beginning.level.shape:
        why = f"the map was enlarged for {beginning.agents:,} animals"
    else:
        try:
            return Editor.open(path, library), ""
        except ProblemsError as error:
            why = error.problems[0].message
    return History(path, why), f"changes affect only this run, not the level file: {why}"


@contextmanager
def recovery_folder(level, root, notices):
    """A folder for what a crash must not take, gone again when the body fails; None, and a notice, when none can be."""
    try:
        recovery = RecoveryFolder(level, root)
    except OSError as error:
        notices.append(
            SessionNotice(
                "warning", f"your changes are not protected against a crash: {error.filename}: {error.strerror}"
            )
        )
        recovery = None
    try:
        yield recovery
    except BaseException:
        if recovery is not None:
            recovery.close()
        raise
