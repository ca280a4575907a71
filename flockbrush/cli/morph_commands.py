"""The command ``flockbrush brush morph``: measure a path between two brushes."""

from __future__ import annotations

import shlex
from pathlib import Path

from flockbrush.behaviours.brush import PATH_SUFFIX
from flockbrush.behaviours.mixture import can_mix, path_to_toml
from flockbrush.cli.level_commands import find_brush
from flockbrush.engine.files import held, refused, write_bytes
from flockbrush.runs.terminal import print_line, say
from flockbrush.studies.morph import Route, Trial, morph, table


def morph_brushes(start, end, output, trials: list[Trial], route: Route):
    """Measure the path between two brushes, print the table and write the path."""
    first, last = find_brush(start), find_brush(end)
    if not can_mix(first, last) or first.name == last.name:
        models = f"their models are {first.model} and {last.model}"
        why = "both brushes are the same" if first.name == last.name else models
        raise refused(f"{first.name} to {last.name}", f"there is no path: {why}")
    for option, names in (("--wander", ["wander"] if route.wander else []), ("--first", route.first)):
        for name in names:
            if not any(field.startswith(name) for field in type(first.params).model_fields):
                raise refused(first.name, f"model {first.model!r} has no parameter {name} ({option})")
    bases = [f"{one}--{two}{PATH_SUFFIX}" for one, two in ((first.name, last.name), (last.name, first.name))]
    file = Path(output or bases[0])
    if file.name not in bases:
        raise refused(file, f"levels find a path by its name: this one must be {bases[0]} or {bases[1]}")
    if file.parent.parent.is_dir():
        file.parent.mkdir(exist_ok=True)
    with held(file):
        found = morph(first, last, trials, route, say)
        text = table(found)
        told = (
            f"{shlex.join(['flockbrush', 'brush', 'morph', str(start), str(end)])} "
            f"{' '.join(f'--animals {trial.animals}' for trial in trials)} --seeds {trials[0].seeds} "
            f"--steps {trials[0].steps} --seconds {trials[0].seconds:g} --begin {trials[0].begin}"
            f"{f' --wander {route.wander:g}' if route.wander else ''}"
            f"{''.join(f' --first {name}' for name in route.first)}\n{text}\n"
        )
        digests = {"start_sha256": first.sha256, "end_sha256": last.sha256}
        path = found.path.model_copy(update={"measured": told, **digests})
        print_line(text)
        write_bytes(file, path_to_toml(path).encode(), overwrite=True)
    print_line(f"wrote {file}")
