"""The command ``flockbrush brush morph``: measure a path between two brushes."""

from __future__ import annotations

from pathlib import Path

from flockbrush.behaviours.brush import PATH_SUFFIX
from flockbrush.behaviours.mixture import can_mix, path_to_toml
from flockbrush.cli.level_commands import find_brush
from flockbrush.engine.files import held, write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.runs.terminal import print_line, say
from flockbrush.studies.morph import Trial, morph, table


def morph_brushes(start, end, output, trial: Trial, wander=0.0):
    """Measure the path between two brushes, print the table and write the path."""
    first, last = find_brush(start), find_brush(end)
    if not can_mix(first, last) or first.name == last.name:
        why = (
            "both brushes are the same"
            if first.name == last.name
            else f"their models are {first.model} and {last.model}"
        )
        raise ProblemsError([Problem(f"{first.name} to {last.name}", None, None, f"there is no path: {why}")])
    if wander and not hasattr(first.params, "wander"):
        raise ProblemsError(
            [Problem(first.name, None, None, f"model {first.model!r} has no parameter wander (--wander)")]
        )
    file = Path(output) if output else Path(f"{first.name}--{last.name}{PATH_SUFFIX}")
    with held(file):
        measured = morph(first, last, trial, wander, say)
        text = table(measured)
        summary = (
            f"flockbrush brush morph {first.name} {last.name} --animals {trial.animals} --seeds {trial.seeds} "
            f"--seconds {trial.seconds:g} --begin {trial.begin}{f' --wander {wander:g}' if wander else ''}\n{text}\n"
        )
        path = measured.path.model_copy(update={"measured": summary})
        print_line(text)
        write_bytes(file, path_to_toml(path).encode(), overwrite=True)
    print_line(f"wrote {file}")
