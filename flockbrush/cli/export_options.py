"""Options of commands that export, which come from the exporters, and the table of file formats."""

from __future__ import annotations

import enum
import inspect
from typing import Annotated

import typer
from typer.core import TyperCommand

from flockbrush.cli.shared_options import wrong

_CHOSEN = "flockbrush.exports"  # key of the values in the context


class WithExports(TyperCommand):
    """A command with the options of all exporters; `chosen` returns their values."""

    def get_params(self, ctx):
        return [*super().get_params(ctx), *_parameters(self)]

    def invoke(self, ctx):
        names = [parameter.name for parameter in _parameters(self)]
        ctx.meta[_CHOSEN] = {name: ctx.params.pop(name) for name in names}
        return super().invoke(ctx)


class WithExportTable(WithExports):
    """A command with the options of all exporters and a table of file formats below the help."""

    def format_help(self, ctx, formatter):
        super().format_help(ctx, formatter)
        from flockbrush.runs.terminal import show

        show(export_table())


def export_table():
    """A table of all export formats: file extension, contents and programs that open it."""
    from flockbrush.output.exporter import exporters
    from flockbrush.runs.terminal import table

    formats = table("file", "contents", "opens in", "frames/s", "needs", title="File formats")
    for kind in dict.fromkeys(exporters().values()):
        packages = ", ".join(package for _, package in kind.needs)
        formats.add_row(" ".join(kind.endings), kind.contents, kind.opens_in, f"{kind.fps:g}", packages)
    return formats


def _parameters(command):
    """The options of all exporters as parameters of typer; built once for each command while these are the same."""
    from flockbrush.output.exporter import all_options

    found = all_options()
    if getattr(command, "export_options", None) != found:
        export_options = [_asked(option, endings) for option, endings in found]

        def options():
            pass

        options.__signature__ = inspect.Signature(export_options)
        options.__annotations__ = {one.name: one.annotation for one in export_options}
        app = typer.Typer(add_completion=False)
        app.command(add_help_option=False)(options)
        command.export_options, command.export_parameters = found, typer.main.get_command(app).params
    return command.export_parameters


def _asked(option, endings):
    """An exporter option as a parameter of a function for typer; its value is None if it is not given."""
    kind = option.kind if option.default is None or option.many else type(option.default)
    help = f"{option.help} ({' '.join(endings)})"
    attributes = {"help": help, "metavar": option.metavar, "show_default": str(option.default)}
    if kind is bool or option.default is None or option.many:
        del attributes["show_default"]
    if option.low is not None or option.high is not None:
        attributes |= {"min": option.low, "max": option.high}
    if option.choices:
        kind = enum.Enum(option.name, {choice: choice for choice in option.choices})
    wanted = list[kind] | None if option.many else kind | None
    annotation = Annotated[wanted, typer.Option(_flag(option), **attributes)]
    return inspect.Parameter(option.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _flag(option):
    return "--" + (option.negated or option.name).replace("_", "-")


def chosen(context, paths) -> dict:
    """{option: value} of the exporter options that were given on the command line.

    Raises
    ------
    typer.BadParameter
        For an option that applies to none of the files.
    """
    from flockbrush.output.exporter import all_options, exporter_of

    known = {option.name for path in paths or () if (kind := exporter_of(path)) for option in kind.choices}
    options = {}
    for option, endings in all_options():
        value = context.meta[_CHOSEN][option.name]
        if value is None or value is False or value in ((), []):
            continue
        if option.name not in known and all(map(exporter_of, paths or ())):
            raise wrong(_flag(option), f"applies to {', '.join(endings)} only, and no such file is written")
        switch = isinstance(option.default, bool)
        options[option.name] = not option.default if switch else getattr(value, "value", value)
    return options
