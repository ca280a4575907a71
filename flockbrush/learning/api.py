"""Learning from Python: `flockbrush.learn` and what it returns."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from flockbrush.behaviours.brush import Brush
from flockbrush.engine.arguments import checked
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.film.arena import Arena
from flockbrush.film.open_clip import Looking
from flockbrush.film.track_files import UNITS, is_tracks
from flockbrush.learning.confounding import Estimate, estimates_of
from flockbrush.learning.result import Findings
from flockbrush.learning.which_model import ModelComparison
from flockbrush.runs.terminal import Stopped, saying

OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*)(?: (\w+):(\w+))?")
ARGUMENTS = {"body-length-px": "body_length", "body-length-m": "body_length"}  # of options with another name
Tracks = str | os.PathLike | np.ndarray


@dataclass(frozen=True)
class LearnedBrush:
    """A brush learned from tracks or films, and how far it can be trusted.

    Attributes
    ----------
    brush : Brush
        Save it with ``flockbrush.save_brush(result.brush, folder)``.
    verdict : str
        One sentence: whether the simulated herd moves like the animals, judged on frames that were held out.
    kind : {"like", "partly", "rival", "untold"}
        Of the verdict: *moves like*, *moves like in some measures*, *no better than a rival*, *cannot be told*.
    measures : list of dict
        A row for each measure: name, clip, herd, off, limit, met, told.
    parameters : list of Estimate
        Each number of the model with its uncertainty, and what it is confounded with.
    notes : list of str
        What to know of the data and of the fit.
    models : ModelComparison or None
        With ``model="auto"``, if models could be compared: ``rows`` (name, perception, score, error, behind,
        told_apart, distance), ``equal``, ``sentence``, ``contenders``, ``learned`` and ``decision``.
    findings : Findings
        Everything else that the report shows.
    """

    brush: Brush
    verdict: str
    kind: str
    measures: list[dict[str, Any]]
    parameters: list[Estimate]
    notes: list[str]
    findings: Findings
    models: ModelComparison | None = None

    def __repr__(self):
        return f"<LearnedBrush {self.brush.name}: {self.verdict}>"

    def parameter(self, name: str) -> Estimate:
        """One number of the model, such as "alignment_weight".

        Raises
        ------
        KeyError
            When there is none of this name.
        """
        for one in self.parameters:
            if one.name == name:
                return one
        raise KeyError(f"there is no parameter {name!r}; there are {', '.join(p.name for p in self.parameters)}")


@checked(tracks="a file of tracks or a film, an array, or a sequence of these")
def learn(
    tracks: Tracks | Sequence[Tracks], *, unit: str | None = None, fps: float | None = None,
    body_length: float | None = None, frames: tuple[int, int] | None = None, arena: str | None = None,
    name: str = "learned", report: str | os.PathLike | None = None, cluster: str | None = None, **options: Any,
) -> LearnedBrush:  # fmt: skip
    """Learn a brush from tracks of animals, or from films.

    Parameters
    ----------
    tracks : path or (frames, animals, 2) ndarray, or a sequence of them
        Files that ``flockbrush learn`` reads; arrays have NaN, or are masked, where an animal was not seen.  Of
        several, each is held out in turn.
    unit : {"m", "px", "bl"}, optional
        Of the places; required for arrays and for files that do not say it.  y points up, in pixels down.
    fps : float, optional
        Frames a second; required for arrays and for files without times.
    body_length : float, optional
        Of one animal, in pixels for tracks in pixels, else in metres; by default what the tracks say, or 1 m.
    frames : (int, int), optional
        First and last frame to use, both included.
    arena : str, optional
        Wall around tracked animals, as for ``--arena``: "circle" or "rectangle" (the smallest), or with numbers.
    name : str
        Of the brush.
    report : path, optional
        Folder for the report with charts.
    cluster : str, optional
        Address of the scheduler of a Dask cluster, whose workers do what ``jobs`` processes would: ``tcp://host:8786``.
    **options
        Those of `LearnOptions`:

        seed : int, 0
            Of all chance: the same tracks, options and versions give the same brush.
        starts : int, 5
            Random starts of the search of the herd model.
        quick : bool, False
            A first impression.
        thorough : bool, False
            Search with four times as much work.
        share : float, .5
            Of the frames of one clip that the brush is learned from; the others judge it.
        jobs : int, 1
            Processes.
        licence : str, optional
            Of the data.
        beside : bool, optional
            Judge it beside the shipped brushes, too; by default, where it is not quick.
        model : str, "auto"
            "herd", "zones", "morse", "force_map", "topological", "boids" or another model on the ground; "auto"
            compares those with a likelihood (``result.models``) and learns the herd, or another by which turns are
            clearly likelier and whose herds are no farther from the tracks, or "force_map" if its herds are nearest.

    Raises
    ------
    ProblemsError
        When the tracks cannot be read or learned from.
    ValueError
        For a unit, body length, arena or number that is none.

    Examples
    --------
    >>> result = flockbrush.learn("sheep.csv", unit="m", fps=10, body_length=1.2)  # doctest: +SKIP
    >>> result.parameter("alignment_weight").told  # doctest: +SKIP
    '.098 ± .018'
    """
    from flockbrush.learning.learn import learn_brushes
    from flockbrush.learning.learn_options import LearnOptions
    from flockbrush.runs.cluster import Tls

    given = _given(tracks, name, options)
    of_tracks = all(isinstance(one, np.ndarray) or is_tracks(one) for one in given)
    looking = _looking(unit, fps, frames, body_length, of_tracks, arena)
    with tempfile.TemporaryDirectory(prefix="flockbrush-learn-") as folder, _words_of_python(folder):
        wishes = LearnOptions(
            clips=[_file(one, k, Path(folder)) for k, one in enumerate(given)],
            out=Path(folder) / f"{name}.brush.toml", looking=looking, report=None if report is None else Path(report),
            workers=None if cluster is None else (cluster, Tls()), command="flockbrush.learn(...)", silent=True,
            length_m=None if of_tracks and unit != "bl" else looking.body_length_m, **options,
        )  # fmt: skip
        return result_of(learn_brushes(wishes)[0])


@contextmanager
def _words_of_python(folder):
    """What is said and problems have the names of arguments for those of options, and not the folder of arrays.

    Ctrl-C is what it is in Python.
    """
    here = folder + os.sep
    try:
        with saying(lambda text: _in_python(text.replace(here, ""))):
            yield
    except Stopped:
        raise KeyboardInterrupt from None
    except ProblemsError as error:
        raise ProblemsError(
            replace(
                problem,
                file=_in_python(problem.file) if problem.file.startswith("--") else problem.file.removeprefix(here),
                message=_in_python(problem.message),
            )
            for problem in error.problems
        ) from None


def _in_python(text):
    """A text about options of the command line with the arguments of `learn` instead."""
    from flockbrush.learning.learn_options import LearnOptions

    known = {*signature(learn).parameters, *(field.name for field in fields(LearnOptions))}

    def argument(found):
        option, first, last = found.groups()
        name = ARGUMENTS.get(option, option.replace("-", "_"))
        if name not in known:
            return found[0]
        return name if first is None else f"{name}=({first}, {last})"

    return OPTION.sub(argument, text.replace("--unit m, px or bl", 'unit="m", "px" or "bl"'))


def _given(tracks, name, options) -> list:
    """The tracks one by one; ValueError where there are none, or where options ask for nothing."""
    from flockbrush.learning.learn_options import LearnOptions

    if not name or Path(name).name != name:
        raise ValueError(f"name must be a name and not a path, got {name!r}")
    for count in ("starts", "jobs"):
        if options.get(count, 1) < 1:
            raise ValueError(f"{count} must be at least 1, got {options[count]!r}")
    if not 0.1 <= options.get("share", 0.5) <= 1.0:
        raise ValueError(f"share must be .1 to 1, got {options['share']!r}")
    known = {field.name for field in fields(LearnOptions)}
    for option in options.keys() - known:
        raise TypeError(f"learn has no argument {option!r}{did_you_mean(option, known)}")
    given = list(tracks) if isinstance(tracks, Sequence) and not isinstance(tracks, str) else [tracks]
    if not given:
        raise ValueError("there are no tracks to learn from")
    return given


def _looking(unit, fps, frames, body_length, of_tracks, arena) -> Looking:
    """How tracks or films are looked at; the length counts in the unit that tracks name themselves."""
    if unit is not None and unit not in UNITS:
        raise ValueError(f"unit must be one of {', '.join(UNITS)}, got {unit!r}")
    if fps is not None and not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be above 0, got {fps!r}")
    if body_length is not None and not (np.isfinite(body_length) and body_length > 0):
        raise ValueError(f"body_length must be above 0, got {body_length!r}")
    in_pixels = unit == "px" or (unit is None and of_tracks)
    return Looking(
        unit=unit, fps=fps, frames=frames, body_length_px=body_length if in_pixels else None,
        body_length_m=None if unit == "px" else body_length, arena=None if arena is None else Arena.read(arena),
    )  # fmt: skip


def _file(one, number, folder):
    """The path of a file of tracks; arrays are written to one."""
    if not isinstance(one, np.ndarray):
        return Path(one)
    path = folder / f"tracks{number + 1}.npy"
    if np.iscomplexobj(one):
        raise ValueError("tracks must be real numbers")
    np.save(path, np.ma.filled(np.ma.asarray(one, float), np.nan), allow_pickle=False)
    return path


def _plain(value):
    """A number as Python has it."""
    return value.item() if isinstance(value, np.generic) else value


def result_of(found: Findings) -> LearnedBrush:
    """What a person is given of everything that came of learning."""
    judgement = found.judgement
    rows = [] if judgement is None else [
        {key: _plain(value) for key, value in vars(row).items()}
        | {"met": bool(row.met), "told": row.name in judgement.told} for row in judgement.brush.rows
    ]  # fmt: skip
    notes = [*found.notes, *(note for clip in found.clips for note in clip.notes), *found.learned.notes]
    told = list(dict.fromkeys(_in_python(found.words(note)) for note in notes))
    return LearnedBrush(
        found.brush, found.verdict(), "untold" if judgement is None else judgement.kind, rows,
        estimates_of(found.learned), told, found, found.models,
    )  # fmt: skip
