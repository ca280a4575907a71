"""Pages of the site that are not in docs/: the README, the changelog, and references generated from the code.

`mkdocs build --strict` calls the functions whose names begin with ``on_``.
"""

from __future__ import annotations

import dataclasses
import re
import shutil
import tomllib
from pathlib import Path, PurePosixPath

import typer
from mkdocs.structure.files import File

HOUSE = Path(__file__).parents[1]
SOURCE = HOUSE / "build" / "site_source"
ELSEWHERE = {  # pages outside docs/
    "index.md": "README.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "SECURITY.md": "SECURITY.md",
    "timings.md": "benchmarks/README.md",
}
PYTHON = {  # contents of the Python page
    "Running": ["flockbrush.runs.run.start", "flockbrush.levels.build.Simulation", "flockbrush.levels.build.plane"],
    "Recordings": [
        "flockbrush.runs.run.record",
        "flockbrush.runs.run.rebuild",
        "flockbrush.engine.recording.open_recording",
        "flockbrush.engine.recording.RecordedRun",
    ],
    "Brushes": [
        "flockbrush.behaviours.brush.Brush",
        "flockbrush.behaviours.brush.BrushLibrary",
        "flockbrush.behaviours.brush.load_brush",
        "flockbrush.behaviours.brush.save_brush",
    ],
    "Models": ["flockbrush.behaviours.behaviour"],
    "Levels": ["flockbrush.levels.reader.read_level", "flockbrush.levels.schema"],
    "Worlds": [
        "flockbrush.engine.world.World",
        "flockbrush.engine.columns",
        "flockbrush.engine.schedule",
        "flockbrush.engine.commands",
        "flockbrush.engine.clock",
        "flockbrush.engine.noise",
    ],
    "Components": ["flockbrush.components.agent"],
    "Measures": ["flockbrush.systems.measures"],
    "Sweeps": ["flockbrush.studies.sweep", "flockbrush.studies.experiments.Experiment"],
    "Errors": ["flockbrush.engine.problems"],
}


def on_startup(command, dirty):
    """Copy the package in its installed layout, because mkdocstrings does not support package-dir."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    ignore = shutil.ignore_patterns("__pycache__", "*.json", "*.png", "*.tmj", "*.toml", "*.ttf")
    with open(HOUSE / "pyproject.toml", "rb") as file:
        rooms = tomllib.load(file)["tool"]["setuptools"]["package-dir"]
    for package, folder in rooms.items():
        shutil.copytree(HOUSE / folder, SOURCE / package.replace(".", "/"), ignore=ignore, dirs_exist_ok=True)


def on_files(files, config):
    """Add the generated pages."""
    for name, text in pages().items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown, page, config, files):
    """Point links to files outside docs/ at their pages."""
    for name, origin in ELSEWHERE.items():
        markdown = markdown.replace(f"](../{origin})", f"]({name})")
    return markdown


def pages() -> dict[str, str]:
    """Return all generated pages by name."""
    return {name: moved(HOUSE / origin) for name, origin in ELSEWHERE.items()} | {
        "reference/python.md": python_page(),
        "reference/commands.md": commands_page(),
        "reference/level-classes.md": level_classes_page(),
        "reference/script-commands.md": script_commands_page(),
        "reference/measures.md": measures_page(),
    }


def moved(path: Path) -> str:
    """Return a page with its links adapted to the top of the site; links to other files become text."""
    here = path.parent.relative_to(HOUSE)
    homes = {origin: name for name, origin in ELSEWHERE.items()}

    def link(match):
        start, target = match[1], match[2]
        if target.startswith(("http", "#", "mailto:")):
            return match[0]
        place = re.sub(r"[^/]+/\.\./", "", str(PurePosixPath(here.as_posix()) / target))
        if place in homes:
            return f"{start}({homes[place]})"
        if place.startswith("docs/") and (HOUSE / place.partition("#")[0]).is_file():
            return f"{start}({place.removeprefix('docs/')})"
        return start.lstrip("![").rstrip("]")

    return re.sub(r"(!?\[[^]]*\])\(([^)\s]*)\)", link, path.read_text(encoding="utf-8"))


def python_page() -> str:
    """Return the page of the Python interface, made from docstrings."""
    parts = ["# Python\n\n`import flockbrush` offers what most programs need. Import everything else from its module."]
    for title, names in PYTHON.items():
        parts += [f"## {title}", *(f"::: {name}" for name in names)]
    return "\n\n".join(parts) + "\n"


def commands_page() -> str:
    """Return the page of commands with their arguments and options."""
    from flockbrush.cli.main import app

    parts = ["# Commands\n\nEvery command has `--help`. Exit codes: 0 success, 1 an error in the input, "
             "2 wrong usage of the command, 130 interrupted."]  # fmt: skip
    _describe(typer.main.get_command(app), "flockbrush", parts)
    return "\n\n".join(parts) + "\n"


def _describe(command, name, parts):
    for child in getattr(command, "commands", {}).values():
        _describe(child, f"{name} {child.name}", parts)
    if hasattr(command, "commands"):
        return
    text = re.sub(r"\n[ \t]+", "\n", (command.help or "").split("\f")[0])
    arguments = [_metavar(p) for p in command.params if p.param_type_name == "argument"]
    rows = [_option_row(p) for p in command.params if p.param_type_name == "option" and not p.hidden]
    table = "| option | meaning |\n|---|---|\n" + "\n".join(rows) if rows else ""
    parts += [f"## {name}", f"    {name} {' '.join(arguments)}", text, table]


def _option_row(option) -> str:
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    metavar = "" if getattr(option, "is_flag", False) else f" `{_metavar(option)}`"
    metavar = metavar.replace("|", "\\|")
    return f"| {names}{metavar} | {(option.help or '').replace('|', chr(92) + '|')} |"


def _metavar(parameter) -> str:
    return parameter.metavar or parameter.name.upper()


def level_classes_page() -> str:
    """Return the page of level classes, from the schema."""
    from flockbrush.levels.schema import CLASSES

    start = "# Level classes\n\nCustom classes and properties of the Tiled project. A property is optional unless it "
    parts = [f"{start}is marked as required.\n"]
    for c in CLASSES.values():
        where = f"on layer `{c.home}{'*' if c.home in ('brush', 'speed') else ''}`" if c.home else "on the map"
        parts.append(f"## {c.name}\n\n{c.use.capitalize()} {where}: {c.meaning}.\n")
        if c.properties:
            rows = "\n".join(map(_property_row, c.properties))
            parts.append(f"| property | type | default | meaning |\n|---|---|---|---|\n{rows}\n")
    return "\n".join(parts)


def _property_row(p) -> str:
    kind = " \\| ".join(p.values) if p.kind == "enum" else p.kind + (f", {p.unit}" if p.unit else "")
    default = "required" if p.required else str(p.default).lower() if p.kind == "bool" else str(p.default) or "-"
    return f"| `{p.name}` | {kind} | {default} | {p.meaning} |"


def script_commands_page() -> str:
    """Return the page of commands for scripts, Python and recordings."""
    from flockbrush.engine.commands import COMMANDS
    from flockbrush.engine.plugins import is_ours, load_modules

    from flockbrush import systems

    load_modules(systems)  # these register commands
    parts = [
        "# Script commands\n\nAn object of class `Key` in the layer `script` gives a command at a set time. In Python, "
        "`simulation.submit(Command(...))` does the same. The playground uses the same commands."
    ]
    for name, cls in sorted(COMMANDS.items()):
        if not is_ours(cls.__module__):
            continue
        rows = [_field_row(field) for field in dataclasses.fields(cls)]
        table = "| field | type | default |\n|---|---|---|\n" + "\n".join(rows)
        parts += [f"## {name}", " ".join((cls.__doc__ or "").split()), table if rows else ""]
    return "\n\n".join(parts) + "\n"


def _field_row(field) -> str:
    default = "required" if field.default is dataclasses.MISSING else f"`{field.default!r}`"
    return f"| `{field.name}` | {str(field.type).replace('|', 'or')} | {default} |"


def measures_page() -> str:
    """Return the page of the measures of `flockbrush measure`, sweeps and plots."""
    from flockbrush.systems.measures import measures

    rows = [f"| `{m.name}` | {m.meaning} | {m.unit or '-'} | {_bounds(m)} |" for m in measures().values()]
    table = "| measure | meaning | unit | range |\n|---|---|---|---|\n" + "\n".join(rows)
    return f"# Measures\n\nMeasures of a herd at one moment. A measure is NaN where it is not defined.\n\n{table}\n"


def _bounds(measure) -> str:
    low, high = measure.low, measure.high
    if low is None and high is None:
        return "any"
    return f"from {low:g}" if high is None else f"{low:g} to {high:g}"
