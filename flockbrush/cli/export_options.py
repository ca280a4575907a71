"""Options of commands that export, as the exporters declare them, and the table of who opens what."""

from __future__ import annotations

import enum
import inspect
from typing import Annotated

import typer
from typer.core import TyperCommand

_CHOSEN = "flockbrush.exports"  # key of the values in the context


class WithExports(TyperCommand):
    """A command that takes the options of all exporters, too; `chosen` gives their values."""

    def get_params(self, ctx):
        return [*super().get_params(ctx), *_parameters(self)]

    def invoke(self, ctx):
        names = [parameter.name for parameter in _parameters(self)]
        ctx.meta[_CHOSEN] = {name: ctx.params.pop(name) for name in names}
        return super().invoke(ctx)


class WithExportTable(WithExports):
    """The same with a table of all kinds of files below the help."""

    def format_help(self, ctx, formatter):
        super().format_help(ctx, formatter)
        from flockbrush.runs.terminal import show

        show(export_table())


def export_table():
    """A table of all kinds of files, what is in them and who opens them."""
    from flockbrush.output.exporter import exporters
    from flockbrush.runs.terminal import table

    made = table("file", "what is in it", "who opens it", "frames/s", "needs", title="Kinds of files")
    for kind in dict.fromkeys(exporters().values()):
        packages = ", ".join(package for _, package in kind.needs)
        made.add_row(" ".join(kind.endings), kind.contents, kind.opens_in, f"{kind.fps:g}", packages)
    return made


def _parameters(command):
    """The options of all exporters as the command line has them; made once for each command."""
    if not hasattr(command, "export_parameters"):
        from flockbrush.output.exporter import all_options

        asked = [_asked(option, endings) for option, endings in all_options()]

        def options():
            pass

        options.__signature__ = inspect.Signature(asked)
        options.__annotations__ = {one.name: one.annotation for one in asked}
        app = typer.Typer(add_completion=False)
        app.command(add_help_option=False)(options)
        command.export_parameters = typer.main.get_command(app).params
    return command.export_parameters


def _asked(option, endings):
    """An option as a parameter of a function that typer reads; None when it is not given."""
    kind = option.kind if option.default is None or option.many else type(option.default)
    help = f"{option.help} ({' '.join(endings)})"
    said = {"help": help, "metavar": option.metavar, "show_default": str(option.default)}
    if kind is bool or option.default is None or option.many:
        del said["show_default"]
    if option.low is not None or option.high is not None:
        said |= {"min": option.low, "max": option.high}
    if option.choices:
        kind = enum.Enum(option.name, {choice: choice for choice in option.choices})
    wanted = list[kind] | None if option.many else kind | None
    annotation = Annotated[wanted, typer.Option(_flag(option), **said)]
    return inspect.Parameter(option.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _flag(option):
    return "--" + (option.negated or option.name).replace("_", "-")


def chosen(context, paths) -> dict:
    """{option: value} of what was given on the command line, for the files that will be written.

    Raises
    ------
    typer.BadParameter
        For an option that none of the files knows.
    """
    from flockbrush.output.exporter import all_options, exporter_of

    known = {option.name for path in paths or () if (kind := exporter_of(path)) for option in kind.choices}
    given = {}
    for option, endings in all_options():
        value = context.meta[_CHOSEN][option.name]
        if value is None or value is False or value in ((), []):
            continue
        if option.name not in known and paths and all(map(exporter_of, paths)):
            raise typer.BadParameter(f"is for {', '.join(endings)}; no such file is written", param_hint=_flag(option))
        switch = isinstance(option.default, bool)
        given[option.name] = not option.default if switch else getattr(value, "value", value)
    return given
