"""The base class of exporters, and their registry.

An exporter is one file in ``flockbrush/output/formats``::

    @exporter(".csv")
    class Csv(Exporter):
        contents, opens_in = "a row for each animal in each frame", "pandas, R, Excel"

        def take(self, moment): ...

The folder is scanned; third parties register through the entry point group ``flockbrush.exporters``.  There is no
list to edit: the table of ``flockbrush export --help`` and the options of the command line come from the classes.
The help imports all these files, so what is heavy (numpy, too) they import where it is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from flockbrush.engine.files import hold
from flockbrush.engine.plugins import PluginError, file_of, is_ours, load_entry_points, load_modules
from flockbrush.engine.problems import Problem

if TYPE_CHECKING:
    from flockbrush.runs.snapshots import Moment


@dataclass(frozen=True)
class Option:
    """An option of an export, on the command line ``--name``."""

    name: str  # as Python writes it: ``usd_mode`` is ``--usd-mode``
    # its type is the option's type: a text, a number, or False for a switch. None: nothing unless given.
    default: object
    help: str
    choices: tuple[str, ...] = ()
    kind: type = str  # of options whose default is None
    # low, high: bounds of a number
    low: float | None = None
    high: float | None = None
    metavar: str | None = None
    many: bool = False  # may be given again; the value is a tuple
    # name of the switch on the command line, where it turns off what is on by default: ``no_overlays``
    negated: str | None = None


class Exporter:
    """Writes the frames of a run to one file, which is locked in the meantime.

    Subclasses get ready in `open`, write to ``self.temporary`` in `take`, and complete it in `finish`.

    Attributes
    ----------
    endings : tuple of str
        Of file names; the longest that fits decides.
    contents, opens_in : str
        What is in the file and who opens it, for ``flockbrush export --help``.
    fps : float
        Moments per second by default; 32 is every tick.
    labels : bool
        Whether it writes group, family and state, which take time to find.
    needs : tuple of (module, package)
        Beyond what Flockbrush itself needs.
    choices : tuple of Option
    """

    endings: tuple[str, ...] = ()
    contents = ""
    opens_in = ""
    fps = 32.0
    labels = True
    needs: tuple[tuple[str, str], ...] = ()
    choices: tuple[Option, ...] = ()

    def __init__(self, path, simulation, fps, **options):
        self.path, self.simulation, self.fps = Path(path), simulation, float(fps)
        self.options = {option.name: option.default for option in self.choices}
        known = {*self.options, "source"}  # of the recording that is exported
        self.options |= {name: value for name, value in options.items() if value is not None and name in known}
        self.frames = 0
        self.replaces = self.path.exists()  # an earlier file of this name
        self._work = hold(path)
        self.temporary = self._work.new

    @classmethod
    def beside(cls, path) -> list[Path]:
        """Files that are written beside the main file."""
        return []

    @classmethod
    def reads(cls, options) -> list[str]:
        """Files that the options name, and that no output may replace."""
        return [options["camera"]] if options.get("camera") else []

    @classmethod
    def problems(cls, path, options) -> list[str]:
        """Error messages about the file name or the options, checked before the run."""
        return []

    def open(self):
        """Prepare for the first frame."""

    def take(self, moment: Moment):
        """Write one frame."""
        raise NotImplementedError

    def finish(self):
        """Complete the temporary file."""

    def let_go(self):
        """Close open files without completing them."""

    def close(self):
        """Complete the file and give it its name."""
        self.finish()
        self._work.publish()
        self._work.close()

    def naming(self):
        """A context in which errors of the system name the file to write."""
        return self._work.naming()

    def abandon(self):
        """Remove the unfinished file; an existing file of this name is kept."""
        try:
            self.let_go()
        except Exception:  # noqa: BLE001  it is half written: it may complain about that
            pass
        self._work.close()


_registry: dict[str, type[Exporter]] = {}


def exporter(*endings):
    """Register a class of `Exporter` for these endings of file names, lower case with the dot; ValueError where not."""

    for ending in endings:
        if not (isinstance(ending, str) and ending.startswith(".") and ending == ending.lower()):
            raise ValueError(f"an ending must be lower case with a dot, such as '.csv', got {ending!r}")

    def register(kind):
        kind.endings = endings
        for ending in endings:
            known = _registry.get(ending, kind)
            if (known.__module__, known.__name__) != (kind.__module__, kind.__name__):
                raise ValueError(f"two exporters for {ending}: {known.__name__} and {kind.__name__}")
            _registry[ending] = kind
        return kind

    return register


@cache
def _scan() -> None:
    from flockbrush.output import formats

    load_modules(formats)
    load_entry_points("flockbrush.exporters")


def exporters() -> dict[str, type[Exporter]]:
    """{ending: exporter}, in alphabetical order of the endings."""
    _scan()
    return dict(sorted(_registry.items()))


def exporter_of(path) -> type[Exporter] | None:
    """The exporter for a file of this name, or None."""
    name = Path(path).name.lower()
    fitting = [ending for ending in exporters() if name.endswith(ending)]
    return exporters()[max(fitting, key=len)] if fitting else None


def all_options() -> list[tuple[Option, tuple[str, ...]]]:
    """Options of all exporters, each once, with the file extensions they apply to."""
    options: dict[str, tuple[Option, tuple[str, ...]]] = {}
    for ending, kind in exporters().items():
        for option in kind.choices:
            known, endings = options.get(option.name, (option, ()))
            if known != option:
                text = f"two exporters declare --{option.name} differently: {endings[0]} and {ending}"
                theirs = kind if not is_ours(kind.__module__) else exporters()[endings[0]]
                raise PluginError([Problem(file_of(theirs.__module__), None, None, text)])
            options[option.name] = option, (*endings, ending)
    return list(options.values())
