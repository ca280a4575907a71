"""Commands for changed parameters, and new brushes from changed ones."""

from __future__ import annotations

import datetime

from pydantic import ValidationError

from flockbrush.behaviours.brush import Brush, Provenance
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.problems import ProblemsError
from flockbrush.studio.panels.knobs import NUMBER, WHOLE, Knob, knobs_of
from flockbrush.studio.panels.macros import Macro
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import UseBrush


def turned(brush: Brush, knob: Knob, value) -> Brush:
    """The brush with one knob turned; ValueError when it may not have that value."""
    if isinstance(knob, Macro):
        return knob.turned(brush, value)
    if knob.table == "params":
        try:
            return brush.with_parameters(**{knob.name: value})
        except ProblemsError as error:
            raise ValueError(str(error)) from None
    table = getattr(brush, knob.table)
    if knob.kind == WHOLE and value == round(value):  # ends of sliders are floats
        value = int(value)
    try:
        made = type(table)(**{**dict(table), knob.name: value})
    except ValidationError as error:
        raise ValueError(f"{knob.words}: {error.errors()[0]['msg']}") from None
    return brush.model_copy(update={knob.table: made})


def command_of(brush, knob, value):
    """The command that turns a knob of a brush in the running world."""
    if knob.table == "params" and knob.kind in (NUMBER, WHOLE):
        return SetParameter(brush.name, knob.name, float(value))
    return use(turned(brush, knob, value))


def use(brush):
    """The command that brings a brush into the running world, or changes the one of its name there."""
    return UseBrush(brush.name, brush_to_toml(brush))


def changes(brush: Brush, asset: Brush) -> list[tuple[Knob, object, object]]:
    """(knob, value, the asset's value) of everything that differs."""
    if brush.model != asset.model:
        return []
    pairs = [(knob, knob.value(brush), knob.value(asset)) for knob in knobs_of(brush)]
    return [(knob, value, was) for knob, value, was in pairs if value != was]


def as_new(brush: Brush, asset: Brush, name: str, today: datetime.date) -> Brush:
    """A changed brush under a new name; its provenance names the original brush.

    Raises
    ------
    ValueError
        When the name is none for a brush.
    """
    differences = [f"{knob.words} {knob.said(was)} -> {knob.said(value)}" for knob, value, was in changes(brush, asset)]
    provenance = Provenance(
        kind="hand-set",
        source=f"brush '{asset.name}' (SHA-256 {asset.sha256[:16]}), tuned in a running simulation",
        date=today,
        by="Flockbrush playground",
        notes=f"Changed: {'; '.join(differences)}." if differences else f"Same parameters as '{asset.name}'.",
    )
    fields = dict(brush) | {"name": name, "title": name.replace("-", " ").replace("_", " "), "provenance": provenance}
    try:
        return Brush(**fields)
    except ValidationError:
        raise ValueError(
            f"invalid brush name {name!r}: letters, digits, - and _, at most 64, beginning with a letter or digit"
        ) from None
