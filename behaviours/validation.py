"""Values against their pydantic model: every mistake at once, in the words of the person who wrote the value."""

from __future__ import annotations

import datetime
import math
import re
from typing import Any, NamedTuple, TypeVar, get_origin

from flockbrush.engine.plugins import blaming
from flockbrush.engine.problems import did_you_mean
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

LARGEST = 2**63 - 1  # TOML promises no larger whole number

Key = tuple[str | int, ...]
Mistake = tuple[Key, str]
Model = TypeVar("Model", bound=BaseModel)


class Bounds(NamedTuple):
    """What a field asks of a number; None where there is no bound."""

    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None

    def __str__(self):
        if self.least is not None and self.most is not None:
            return f"from {self.least:g} to {self.most:g}"
        words = ("at least", self.least), ("above", self.above), ("at most", self.most), ("below", self.below)
        return " and ".join(f"{word} {bound:g}" for word, bound in words if bound is not None)

    def nearest(self, value: float) -> float:
        """The number within the bounds that is nearest to this one."""
        for bound in (self.least, None if self.above is None else math.nextafter(self.above, math.inf)):
            value = value if bound is None else max(value, bound)
        for bound in (self.most, None if self.below is None else math.nextafter(self.below, -math.inf)):
            value = value if bound is None else min(value, bound)
        return value


def bounds(field: FieldInfo) -> Bounds:
    """The bounds of a pydantic field."""
    limits = {name: value for item in field.metadata for name, value in _bounds_in(item)}
    return Bounds(limits.get("ge"), limits.get("le"), limits.get("gt"), limits.get("lt"))


def _bounds_in(item):
    return [(name, float(getattr(item, name))) for name in ("ge", "le", "gt", "lt") if hasattr(item, name)]


def unit(field: FieldInfo) -> str:
    """The unit of a field, "" when it has none."""
    extra = field.json_schema_extra
    unit = extra.get("unit") if isinstance(extra, dict) else None
    return "" if unit in (None, "", "1", "-") else str(unit)


def meaning(field: FieldInfo) -> str:
    """What a field stands for, in one line: description, unit and bounds."""
    parts = [" ".join((field.description or "").split()).rstrip("."), span(field), choices(field)]
    return "; ".join(part for part in parts if part)


def span(field: FieldInfo) -> str:
    """Bounds and unit of a field: "from 0 to 60 s", "from 0.001 to 1 times 180°", "" when it has neither."""
    measure = unit(field)
    if measure[:1].isdigit():  # "1/s" must not be read as one more digit; "180°" multiplies
        measure = f"({measure})" if "/" in measure else f"times {measure}"
    return " ".join(part for part in (str(bounds(field)), measure) if part)


def choices(field: FieldInfo) -> str:
    """The words a field takes, "" when it takes others."""
    values = getattr(field.annotation, "__args__", ())
    if not values or not all(isinstance(value, str) for value in values):
        return ""
    return ", ".join(values[:-1]) + f" or {values[-1]}" if len(values) > 1 else values[0]


def validated(model: type[Model], data: dict[str, Any], where: Key = ()) -> tuple[Model | None, list[Mistake]]:
    """Make a model of plain data.

    Numbers are numbers: no bool and no text is taken for one, and none is infinite or not a number.

    Parameters
    ----------
    model : type of BaseModel
        Nested models are tables.
    data : dict
        As read from a file.
    where : tuple
        Path of ``data`` in the file.

    Returns
    -------
    made : BaseModel or None
        None when there is a mistake.
    mistakes : list of (path, message)
    """
    known, mistakes = _known(model, data, where)
    mistakes += _unfit(known, where)
    reported = {path for path, _ in mistakes}
    model_object = None
    try:
        with blaming("class", model.__name__, model.__module__, (ValidationError,)):
            model_object = model.model_validate(_tuples(known), strict=True)
    except ValidationError as error:
        for item in error.errors(include_url=False):
            path = where + item["loc"]
            if not any(path[: len(other)] == other for other in reported):
                mistakes.append((path, _message(model, item)))
    return (model_object if not mistakes else None), mistakes


def _known(model: type[BaseModel], data: dict, where: Key) -> tuple[dict, list[Mistake]]:
    """The data without the names the model does not have, and a mistake for each of those."""
    values, mistakes = {}, []
    for name, value in data.items():
        field = model.model_fields.get(name)
        inner = _table_of(field)
        if field is None:
            mistakes.append((where + (name,), f"unknown name{did_you_mean(name, model.model_fields)}"))
        elif inner and isinstance(value, dict) and _is_open(field):
            values[name] = dict(value)
            for key, table in value.items():
                if isinstance(table, dict):
                    values[name][key], more = _known(inner, table, where + (name, key))
                    mistakes += more
        elif inner and isinstance(value, dict):
            values[name], more = _known(inner, value, where + (name,))
            mistakes += more
        else:
            values[name] = value
    return values, mistakes


def _table_of(field: FieldInfo | None) -> type[BaseModel] | None:
    """The model of a field that is a table."""
    if field is None:
        return None
    for kind in (field.annotation, *getattr(field.annotation, "__args__", ())):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None


def _is_open(field: FieldInfo) -> bool:
    """Whether a field holds tables under names of the writer's own."""
    return get_origin(field.annotation) is dict


def _unfit(value: Any, where: Key) -> list[Mistake]:
    """Numbers that no field may have."""
    if isinstance(value, float) and not math.isfinite(value):
        return [(where, f"must be a finite number, got {value}")]
    if isinstance(value, int) and abs(value) > LARGEST:
        return [(where, f"whole numbers go up to {LARGEST}, got {shown(value)}")]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [mistake for key, item in items for mistake in _unfit(item, where + (key,))]


def _tuples(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_tuples(item) for item in value)
    return {key: _tuples(item) for key, item in value.items()} if isinstance(value, dict) else value


def _field_at(model: type[BaseModel], path: Key) -> FieldInfo | None:
    field: FieldInfo | None = None
    table: type[BaseModel] | None = model
    by_name = False  # the part is a name of the writer's own
    for part in path:
        if by_name:
            by_name = False
            continue
        if table is None or part not in table.model_fields:
            return None
        field = table.model_fields[str(part)]
        table, by_name = _table_of(field), _is_open(field)
    return field


_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "date_type": "a date such as 2026-11-21",
    "tuple_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
}
_RANGES = {"greater_than_equal", "less_than_equal", "greater_than", "less_than"}
_WITH_UNIT = re.compile(r"\s*[-+]?\d+(\.\d*)?([eE][-+]?\d+)?\s*\S")


def _message(model: type[BaseModel], item: ErrorDetails) -> str:
    kind, value = item["type"], item["input"]
    field = _field_at(model, item["loc"])
    if kind == "missing":
        return _missing(field)
    if kind in _KINDS:
        return f"must be {_kind(kind, field)}, got {shown(value)}{_hint(kind, value)}"
    if kind in _RANGES:
        return f"must be {_range(field, item['ctx'])}, got {shown(value)}"
    if kind == "literal_error":
        words = choices(field) if field else item["ctx"]["expected"]
        return f"must be {words}, got {shown(value)}"
    if kind == "string_pattern_mismatch" and field and field.examples:
        return f"must look like {field.examples[0]}, got {shown(value)}"
    if kind == "string_too_short":
        return "must not be empty"
    if kind in ("too_long", "too_short") and isinstance(value, tuple):
        least, most = item["ctx"].get("min_length"), item["ctx"].get("max_length")
        return f"must have {'at most' if most else 'at least'} {most or least} items, got {len(value)}"
    message = item["msg"].removeprefix("Value error, ")
    return message if not item["loc"] or isinstance(value, (dict, tuple)) else f"{message}, got {shown(value)}"


def _missing(field: FieldInfo | None) -> str:
    table = _table_of(field)
    if field is None or table is None:
        return f"is missing; it takes {meaning(field) if field else 'a value'}"
    needed = [name for name, inner in table.model_fields.items() if inner.is_required()]
    return f"is missing; a table with {', '.join(needed)} is needed: {field.description}"


def _kind(kind: str, field: FieldInfo | None) -> str:
    measure = unit(field) if field and kind == "float_type" else ""
    return _KINDS[kind] + (f" ({measure})" if measure else "")


def _hint(kind: str, value: Any) -> str:
    if kind not in ("float_type", "int_type") or not isinstance(value, str):
        return ""
    return "; write the number alone, without quotes or unit" if _WITH_UNIT.match(value) else ""


def _range(field: FieldInfo | None, context: dict) -> str:
    if field and str(bounds(field)):
        return span(field)
    names = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
    return " and ".join(f"{names[name]} {bound:g}" for name, bound in context.items() if name in names)


def shown(value: Any) -> str:
    """A value as its file has it, short enough for a line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"an array of {len(value)}"
    if isinstance(value, int):
        digits = int(value.bit_length() * math.log10(2)) + 1
        return str(value) if digits < 20 else f"a number of {digits} digits"
    if isinstance(value, str):
        return repr(value) if len(value) <= 40 else f"{value[:37]!r}..."
    return value.isoformat() if isinstance(value, (datetime.date, datetime.time)) else repr(value)
