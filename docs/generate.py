"""Rewrite the parts of the documentation that are generated from the code: ``python docs/generate.py``.

The JSON schemas in ``docs/schemas``, and the tables in ``docs/models.md`` (parameters), ``docs/brushes.md`` (sliders,
and what "order" was measured to do), ``docs/species.md`` (numbers of a species) and ``docs/programs.md`` (conditions).
"""

from __future__ import annotations

import json
import re
import textwrap
import typing
from pathlib import Path

from flockbrush.behaviours import validation
from flockbrush.behaviours.behaviour import Behaviour, Parameters, behaviours
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.spec import Spec
from flockbrush.behaviours.species import SpeciesSpec
from flockbrush.behaviours.trigger import conditions, dimension_of

DOCS = Path(__file__).parent
WIDE = 100  # columns of prose


def schema_texts() -> dict[Path, str]:
    """Return the JSON schemas of Flockbrush's file formats."""
    from flockbrush.cli.json_schemas import SCHEMAS

    return {
        DOCS / "schemas" / f"{name}.schema.json": json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"
        for name, schema in SCHEMAS.items()
    }


def parameter_table(model: Behaviour) -> str:
    """Return the parameters that a model adds to its base model, as a Markdown table below a marker."""
    inherited = {name for other in behaviours().values() if other.Params in model.Params.__mro__[1:]
                 for name in other.Params.model_fields}  # fmt: skip
    rows = [_marker(model), "| parameter | default | range | unit | meaning |", "|---|---|---|---|---|"]
    for name, field in model.Params.model_fields.items():
        if name not in inherited:
            unit = field.json_schema_extra["unit"]
            rows.append(f"| `{name}` | {field.default} | {_range(field)} | {unit} | {field.description} |")
    return "\n".join(rows)


def _marker(model):
    return f"<!-- parameters of {model.name} -->"


def _range(field) -> str:
    if field.annotation is bool:
        return "false, true"
    choices = getattr(field.annotation, "__args__", ())
    if choices and all(isinstance(choice, str) for choice in choices):
        return ", ".join(choices)
    bounds = {type(bound).__name__: bound for bound in field.metadata}
    low, above, high = (getattr(bounds.get(name), name.lower(), None) for name in ("Ge", "Gt", "Le"))
    if low is None and above is None:
        return "any"
    start = f"{low:g}" if above is None else f"above {above:g}"
    return f"{start} to {high:g}" if high is not None else start if low is None else f"from {start}"


def models_page(text: str) -> str:
    """Return the page of models with updated tables, and a section, from the docstring, for every model without one."""
    shown = {model.Params for model in behaviours().values() if _marker(model) in text}
    for model in behaviours().values():
        words = f"<!-- words of {model.name} -->"
        if _marker(model) in text:
            before, _, after = text.partition(_marker(model))
            _, _, after = after.partition("\n\n")
            if words in before:  # written here before
                before = f"{before.partition(words)[0]}{words}\n\n{model_words(model)}\n\n"
            text = f"{before}{parameter_table(model)}\n\n{after}"
        elif model.Params not in shown:
            section = f"## `{model.name}`\n\n{words}\n\n{model_words(model)}\n\n{parameter_table(model)}"
            text = f"{text.rstrip()}\n\n{section}"
    return text.rstrip() + "\n"


def model_words(model: Behaviour) -> str:
    """The docstring of a model's module as Markdown, its references in a sentence."""
    words, *sources = re.split(r"^\.\. \[\d+\]", model.doc, flags=re.MULTILINE)
    words = re.sub(r"\s*\[\d+\]_|^References\n-+$", "", words, flags=re.MULTILINE).replace("``", "`")
    paragraphs = [" ".join(part.split()) for part in words.split("\n\n")]
    paragraphs += [" ".join(f"Source: {' '.join(sources)}".split())] if sources else []
    wide = {"width": WIDE, "break_long_words": False, "break_on_hyphens": False}
    return "\n\n".join(textwrap.fill(paragraph, **wide) for paragraph in paragraphs if paragraph)


def slider_table() -> str:
    """The sliders that each model declares, as a Markdown table below a marker."""
    rows = ["<!-- sliders -->", "| model | slider | from one end to the other | moves |", "|---|---|---|---|"]
    owners = {Parameters: "all"}
    for model in behaviours().values():
        owners.setdefault(model.Params, model.name)
    for params, owner in owners.items():
        inherited = [base.sliders for base in params.__mro__[1:] if hasattr(base, "sliders")]
        for name, slider in params.sliders.items():
            if slider not in [sliders.get(name) for sliders in inherited]:
                moves = ", ".join(f"`{part.name}` {part.low:g} to {part.high:g}" for part in slider.ranges)
                rows.append(f"| {owner} | {name} | {slider.ends[:1].lower() + slider.ends[1:]} | {moves} |")
    return "\n".join(rows)


def species_table() -> str:
    """The numbers of a species, as a Markdown table below a marker."""
    rows = ["<!-- numbers of a species -->", "| key | default | range | unit | meaning |", "|---|---|---|---|---|"]
    for section, part in SpeciesSpec.model_fields.items():
        if isinstance(part.annotation, type) and issubclass(part.annotation, Spec):
            for name, field in part.annotation.model_fields.items():
                unit = (field.json_schema_extra or {"unit": "-"})["unit"]
                row = f"`{section}.{name}`", field.default, _range(field), unit, field.description
                rows.append(f"| {' | '.join(map(str, row))} |")
    return "\n".join(rows)


def order_table() -> str:
    """What was measured of the slider order, by brush, as a Markdown table below a marker."""
    from flockbrush.studio.panels.knobs import SENTENCE
    from flockbrush.studio.panels.macros import macros_of, measured_sliders

    moved = ("milling", "nnd", "group_spread", "largest_part", "speed_mean")
    rows = [
        "<!-- order -->\n| brush | ranges | polarization at 0, 1/4, 1/2, 3/4, 1 | polarization | "
        f"{' | '.join(moved)} | ratio | called |",
        "|---" * (len(moved) + 6) + "|",
    ]
    for name, entry in measured_sliders()["order"].items():
        slider = next(one for one in macros_of(shipped().get(name)) if one.slider == "order")
        best, low, high = entry["ratio"]
        moves = " | ".join(f"{entry['moves'][one]:.1f}" for one in ("polarization", *moved))
        course = ", ".join(f"{value:.2f}" for value in entry["polarization"])
        ranges = "own" if "ranges" in entry else "general"
        called = "(message)" if slider.kind == SENTENCE else slider.name
        rows.append(f"| {name} | {ranges} | {course} | {moves} | {best:.1f} ({low:.1f} to {high:.1f}) | {called} |")
    return "\n".join(rows)


def with_table(text: str, table: str) -> str:
    """A page with one of its tables as it is now; the marker is the table's first line."""
    before, marker, after = text.partition(table.split("\n")[0])
    return f"{before}{table}\n\n{after.partition(chr(10) * 2)[2]}" if marker else text


def condition_table() -> str:
    """The kinds of condition of programs and their fields, as a Markdown table below a marker."""
    rows = ["<!-- conditions -->", "| condition | holds when | fields |", "|---|---|---|"]
    for word, kind in conditions().items():
        first, *others = kind.model_fields.items()
        parts = [f"`{word}`: {first[1].description}" + ("" if kind.inner else f" ({_takes(first[1])})")]
        parts += [f"`{name}`: {field.description} ({_takes(field)})" for name, field in others]
        meaning = " ".join((kind.__doc__ or "").split()).split(". ")[0].rstrip(".")
        rows.append(f"| `{word}` | {meaning} | {'; '.join(parts)} |")
    return "\n".join(rows)


def _takes(field) -> str:
    """What a field takes, in words: "a length, from 0 to 1e+06 m"."""
    dimension = dimension_of(field)
    if dimension is not None:
        return f"{dimension.name}, {dimension.span}"
    words = str(validation.bounds(field))
    kind = field.annotation
    descriptions = {bool: "true or false", int: "a whole number", float: "a number", str: "a name"}
    description = next(
        (text for typ, text in descriptions.items() if kind is typ or typ in typing.get_args(kind)), "a name or names"
    )
    return f"{description}, {words}" if words else description


def texts() -> dict[Path, str]:
    """Return the text of every generated file."""
    page = DOCS / "models.md"
    out = schema_texts() | {page: models_page(page.read_text(encoding="utf-8"))}
    pages = {
        "brushes.md": (slider_table(), order_table()), "species.md": (species_table(),),
        "programs.md": (condition_table(),),
    }  # fmt: skip
    for name, found in pages.items():
        text = (DOCS / name).read_text(encoding="utf-8")
        for table in found:
            text = with_table(text, table)
        out[DOCS / name] = text
    return out


if __name__ == "__main__":
    for path, text in texts().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
            print("rewrote", path.relative_to(DOCS.parent))
