"""Edits of the recording that is open in the playground: who is selected, what is changed, and what is shown.

The edits lie in the file beside the recording that ``flockbrush edit`` writes and every export applies
(`flockbrush.runs.edit_file`).  The recording itself is only read.
"""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

from flockbrush.behaviours.tomlfile import read_bytes
from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import open_recording
from flockbrush.runs import run as running
from flockbrush.runs.edit_file import FIRST, EditFile, edits_of, parse_edits, sentence_of
from flockbrush.runs.recording_selection import Selection, chosen
from flockbrush.runs.run_edits import ALWAYS, IN_TIME, Edit, EditedMoments, Past, needs_past
from flockbrush.runs.snapshots import moment_of, words_of
from flockbrush.studio.session_files import file_version
from flockbrush.systems.landscape import Landscape


class RecordingEdits:
    """The edits of one recording.

    Parameters
    ----------
    path : path
        Of the recording.

    Attributes
    ----------
    file : EditFile
    selected : (k,) int64 array
        Ids of the animals that the next edit changes, in order.
    start, end : float
        Seconds from which and until which the next edit holds.
    layer : str
        Name of the layer that the next edit is put on.
    edition : int
        How many times what is shown was changed.

    Raises
    ------
    ProblemsError
        When the file with edits cannot be read, or is of another recording.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.file: EditFile = edits_of(path)
        self._written = file_version(self.file.path)
        self.selected = np.zeros(0, np.int64)
        self.start, self.end, self.layer, self.edition = 0.0, ALWAYS, FIRST, 0
        self._view: EditedMoments | None = None
        self._pass: PassBeside | None = None
        self._prepare()

    # selection ---------------------------------------------------------------------

    def select(self, ids, more=False):
        """Select animals; with ``more`` besides those that are selected."""
        ids = np.unique(np.asarray(ids, np.int64))
        self.selected = np.union1d(self.selected, ids) if more else ids

    def toggle(self, animal):
        """Select one more animal, or one less."""
        one = np.array([animal], np.int64)
        self.selected = np.setdiff1d(self.selected, one) if animal in self.selected else np.union1d(self.selected, one)

    def select_named(self, simulation, column="", name=""):
        """Select all animals that are shown with a species, brush or state now; without a name all that are shown."""
        selection = Selection(**{column: name}) if column else Selection()
        moment = self.shown(simulation, moment_of(simulation))
        self.select(chosen(selection, moment, words_of(simulation)))

    # changes -----------------------------------------------------------------------

    def add(self, kind, now, **values):
        """Make an edit of the selected animals; its sentence.

        Raises
        ------
        ValueError
            Where nobody is selected, and for values that an edit cannot have.
        ProblemsError
            When the file cannot be written; nothing was changed then.
        """
        if not len(self.selected):
            raise ValueError("select animals first: click one, or drag a box around several")
        span = {} if kind == "delay" else {"start": self.start, "end": self.end}
        because = f"selected at {now:g} s"
        edit = Edit(kind, tuple(self.selected.tolist()), **span, **values, because=because)
        self._change(lambda file: file.add(edit, self.layer))
        return sentence_of(edit)

    def undo(self):
        """Take back the edit that was made last; its sentence, or None."""
        return self._step(EditFile.undo)

    def redo(self):
        """Make the edit again that was taken back last; its sentence, or None."""
        return self._step(EditFile.redo)

    @property
    def undo_label(self):
        """What undo takes back, or None."""
        return self.file.undo_label

    @property
    def redo_label(self):
        """What redo makes again, or None."""
        return self.file.redo_label

    def switch(self, name, on):
        """Switch a layer on or off."""
        self._change(lambda file: setattr(file.layer(name), "on", on))

    def remove_layer(self, name):
        """Remove a layer with its edits."""
        self._change(lambda file: file.remove(name))

    def _step(self, step):
        if (self.undo_label if step is EditFile.undo else self.redo_label) is None:
            return None
        new_layers = []
        self._change(lambda file: new_layers.append(step(file)))
        return sentence_of(new_layers[0]) if new_layers[0] is not None else None

    def _change(self, change):
        """Change the file as it is now on the disk, where another program may have written to it."""
        file = self._on_disk()
        change(file)
        file.save()
        self.file, self._written = file, file_version(file.path)
        self._prepare()

    def follow(self):
        """Show what another program wrote to the file meanwhile; ProblemsError, once, where that cannot be read."""
        written = file_version(self.file.path)
        if written != self._written:
            self._written = written
            self.file = self._on_disk()
            self._prepare()

    def _on_disk(self) -> EditFile:
        path = self.file.path
        if not path.exists():
            return EditFile(path, self.file.sha256, self.file.recording)
        edits = parse_edits(read_bytes(path), path)
        if edits.sha256 != self.file.sha256:
            raise refused(path, "has the edits of another recording now: rename or remove this file")
        return edits

    # what is shown -----------------------------------------------------------------

    def shown(self, simulation, moment):
        """A moment of the recording as the edits show it; those of time count once the pass for them is over."""
        if self._pass is not None and self._pass.news():
            self._outdate()
        if self._view is None or self._view.simulation is not simulation:
            if self._pass is None and needs_past(self.file.edits(), simulation):
                self._pass = PassBeside(self.path, ())  # it finds the brushes and species that come later
            self._view = EditedMoments(simulation, self._ready(), self._pass and self._pass.past)
        return self._view.at(moment) if self._view.edits else moment

    @property
    def waiting(self):
        """Share of the pass over the recording that edits of time wait for, 0 to 1; None where none is needed."""
        return None if self._pass is None or self._pass.done or self._pass.error else self._pass.share

    def _outdate(self):
        self._view = None
        self.edition += 1

    def _ready(self):
        edits = self.file.edits()
        if self._pass is not None and self._pass.done:
            return edits
        return [edit for edit in edits if edit.kind not in IN_TIME]

    def _prepare(self):
        """Begin a pass over the recording where an edit of time needs animals that none has watched."""
        self._outdate()
        ids = {animal for edit in self.file.edits() if edit.kind in IN_TIME for animal in edit.ids}
        if ids and (self._pass is None or self._pass.error is not None or not ids <= self._pass.ids):
            self.close()
            self._pass = PassBeside(self.path, ids)

    def close(self):
        """End what goes on."""
        if self._pass is not None:
            self._pass.close()
            self._pass = None


class _Ended(Exception):
    """The pass is no longer wanted."""


class PassBeside:
    """The whole recording simulated once in a thread, to know some animals at all times.

    Attributes
    ----------
    ids : set of int
    done : bool
        Whether it came to the end; `past` has the animals then.
    share : float
        How much of it is over, 0 to 1.
    """

    def __init__(self, path, ids):
        self.ids, self.done, self.share, self.past = set(ids), False, 0.0, None
        self.error: BaseException | None = None
        self._path, self._reported, self._end = path, False, False
        self._thread = threading.Thread(target=self._go, name="edits of time", daemon=True)
        self._thread.start()

    def news(self):
        """Whether it has come to its end since the last call; raises what went wrong in it, once."""
        if self._reported or self._thread.is_alive():
            return False
        self._reported = True
        if self.error is not None:
            raise refused(self._path, f"edits of time are not shown: {self.error}")
        return True

    def _go(self):
        try:
            run = open_recording(self._path)
            simulation = running.rebuild(run)
            try:
                past = Past(list(self.ids), simulation.world.resource(Landscape).wrap)
                self._watch(run, simulation, past)
            finally:
                simulation.close()
        except _Ended:
            pass
        except Exception as error:  # noqa: BLE001  a model is anybody's, and may fail in any way
            self.error = error

    def _watch(self, run, simulation, past):
        def stepped():
            self.share = simulation.clock.tick / run.last_tick
            if self._end:
                raise _Ended

        try:
            past.watch(simulation, run.last_tick, stepped)
        except BaseException:
            past.close()
            raise
        self.past, self.done = past, True

    def close(self):
        """End it, and forget the animals."""
        self._end = True
        self._thread.join()
        if self.past is not None:
            self.past.close()


def edits_of_recording(path):
    """(edits, why there are none): `RecordingEdits` of a recording, or None and a sentence."""
    try:
        return RecordingEdits(path), ""
    except ProblemsError as error:
        return None, f"the edits of this recording are not shown: {error}"
