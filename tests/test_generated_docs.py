"""What the documentation takes from the code is what the code says, and our own files satisfy the schemas."""

import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.engine.commands import COMMANDS
from flockbrush.engine.plugins import is_ours, load_modules
from flockbrush.levels.schema import CLASSES
from test_house import long_lines

from flockbrush import systems

HOUSE = Path(__file__).parents[1]
FILES = [
    *sorted((HOUSE / "behaviours" / "brushes").glob("*.brush.toml")),
    *sorted((HOUSE / "levels").glob("*.sweep.toml")),
    *sorted((HOUSE / "levels" / "shipped").glob("*.tmj")),
]


@pytest.fixture(scope="module")
def generate():
    """The program docs/generate.py."""
    return program("generate")


def program(name):
    spec = importlib.util.spec_from_file_location(name, HOUSE / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_generated_documentation_is_up_to_date(generate):
    stale = [path.name for path, text in generate.texts().items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "run: python docs/generate.py"


def test_the_documentation_has_a_row_for_each_kind_of_condition(generate):
    page = (HOUSE / "docs" / "programs.md").read_text(encoding="utf-8")
    assert generate.condition_table() in page, "run: python docs/generate.py"


def test_the_site_names_every_property_of_level_classes():
    pytest.importorskip("mkdocs")
    text = program("site_pages").level_classes_page()
    assert all(f"`{p.name}`" in text for c in CLASSES.values() for p in c.properties)
    assert "| `on_arrive` | stay \\| despawn \\| next \\| disperse | stay |" in text


def test_the_site_has_a_section_for_each_command():
    """In a process that has not imported what registers them."""
    pytest.importorskip("mkdocs")
    code = "import site_pages; print(site_pages.script_commands_page())"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(HOUSE / "docs"), *filter(None, sys.path)])}
    page = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    load_modules(systems)
    wanted = sorted(name for name, cls in COMMANDS.items() if is_ours(cls.__module__))
    assert [line[3:] for line in page.stdout.splitlines() if line.startswith("## ")] == wanted


def test_a_new_model_gets_a_section_of_its_own(generate, monkeypatch):
    new = dataclasses.replace(behaviours()["herd"], name="invented")
    monkeypatch.setattr(generate, "behaviours", lambda: {"invented": new})
    page = generate.models_page("# Models\n")
    assert "## `invented`\n\n" in page and "| `sensitivity` | 10.0 | 0 to 1000 | 1/s |" in page
    assert "\n\nSource: Gong" in page
    assert long_lines(page) == [] and "References" not in page and "[1]" not in page.partition("Source")[2][:20]
    new = dataclasses.replace(new, doc="It says\nsomething else.\n\nReferences\n----------\n.. [1] Breder 1954.\n")
    again = generate.models_page(page)
    assert "\n\nIt says something else.\n\nSource: Breder 1954.\n\n" in again and again.count("<!--") == 2


def schema_of(path):
    kind = {".toml": path.name.split(".")[-2], ".tmj": "level"}[path.suffix]
    return json.loads((HOUSE / "docs" / "schemas" / f"{kind}.schema.json").read_text(encoding="utf-8"))


def content(path):
    """A file as editors hand it to a schema: dates are texts."""
    text = path.read_text(encoding="utf-8")
    return json.loads(text) if path.suffix == ".tmj" else json.loads(json.dumps(tomllib.loads(text), default=str))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_shipped_files_satisfy_their_schema(path):
    assert list(jsonschema.Draft202012Validator(schema_of(path)).iter_errors(content(path))) == []


def test_the_map_of_a_game_satisfies_the_schema_with_properties_of_its_own():
    (path,) = [path for path in FILES if path.name == "meadow.tmj"]
    file = content(path)
    file["properties"].append({"name": "music", "type": "string", "value": "theme.ogg"})
    check = jsonschema.Draft202012Validator(schema_of(path)).iter_errors
    assert list(check(file))
    file["layers"] = [{"name": "flockbrush", "type": "group", "layers": file["layers"]}]
    assert list(check(file)) == []


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("march.brush.toml", lambda file: file["parameters"].update(sensitivity=-1)),
        ("march.brush.toml", lambda file: file["parameters"].update(sensitivty=1)),
        ("march.brush.toml", lambda file: file.update(model="heard")),
        ("march.brush.toml", lambda file: file.pop("speed")),
        ("v_rules.sweep.toml", lambda file: file["seeds"].update(count=0)),
        ("meadow.tmj", lambda file: file["properties"][0].update(name="boundry")),
        ("meadow.tmj", lambda file: file.update(orientation="isometric")),
        ("meadow.tmj", lambda file: spawn(file)["properties"].append({"name": "count", "value": -5})),
    ],
)
def test_schemas_refuse_mistakes(name, change):
    (path,) = [path for path in FILES if path.name == name]
    file = content(path)
    change(file)
    assert list(jsonschema.Draft202012Validator(schema_of(path)).iter_errors(file))


@pytest.mark.parametrize(("name", "fits"), [("seed", True), ("sede", False)])
def test_the_schema_knows_properties_that_are_one_class(name, fits):
    (path,) = [path for path in FILES if path.name == "meadow.tmj"]
    file = content(path)
    members = {one["name"]: one["value"] for one in file["properties"]} | {name: 3}
    file["properties"] = [{"name": "level", "type": "class", "propertytype": "FlockbrushLevel", "value": members}]
    assert (not list(jsonschema.Draft202012Validator(schema_of(path)).iter_errors(file))) == fits


def spawn(level):
    return next(o for layer in level["layers"] for o in layer.get("objects", []) if o["type"] == "Spawn")
