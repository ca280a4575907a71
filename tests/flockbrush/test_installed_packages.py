"""What installed packages declare: properties of the ground, commands; and packages that are broken."""

import json

import pytest
from flockbrush.behaviours.brush import shipped
from pens import pen
from processes import HOUSE, other_process

BOGS = """
from flockbrush.levels.terrain_kinds import terrain_property

terrain_property("depth", 0.0, "how deep animals sink in", "m", low=0, high=2)
"""
DIVES = """
from flockbrush.behaviours.drive import DriveParameters, drive


@drive("dive", DriveParameters)
def dive(scene, rows, params):
    raise ArithmeticError(f"{scene.ground('depth').max():g} m deep")
"""
SHEARS = """
from flockbrush.components import Speed
from flockbrush.engine.commands import command


@command
class Shear:
    brush: str

    def apply(self, world):
        world.agents[Speed.drawn][:] = 0.0
"""


def installed(folder, name, group, code):
    """The environment of a process in which a package with this module is installed, under one or several groups."""
    told = folder / "site" / f"{name}-1.0.dist-info"
    told.mkdir(parents=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    points = "".join(f"[flockbrush.{one}]\n{name} = {name}\n" for one in group.split())
    (told / "entry_points.txt").write_text(points)
    (folder / "site" / f"{name}.py").write_text(code)
    return {"PYTHONPATH": f"{HOUSE}:{folder / 'site'}"}


def test_commands_know_the_properties_of_installed_packages(tmp_path):
    bogs, levels = installed(tmp_path, "bogs", "terrain", BOGS), tmp_path / "levels"
    assert other_process("level", "init", levels, **bogs).returncode == 0
    assert '"depth"' in (levels / "flockbrush.tiled-project").read_text()

    path = levels / "tilesets" / "terrain.tsj"
    tileset = json.loads(path.read_text())
    mud = next(t for t in tileset["tiles"] if {"name": "name", "type": "string", "value": "mud"} in t["properties"])
    mud["properties"] = [p for p in mud["properties"] if p["name"] != "depth"]
    mud["properties"].append({"name": "depth", "type": "float", "value": 0.3})
    path.write_text(json.dumps(tileset))
    done = other_process("level", "check", levels / "first.tmj", **bogs)
    assert done.returncode == 0, done.stderr
    without = other_process("level", "check", levels / "first.tmj")
    assert without.returncode == 1 and "Terrain has no property 'depth'" in without.stdout


def test_one_module_may_have_a_property_and_the_drive_that_uses_it(tmp_path):
    bogs = installed(tmp_path, "bogs", "terrain drives", BOGS + DIVES)
    brush = tmp_path / "diving.brush.toml"
    brush.write_bytes(shipped().get("graze").source + b"\n[drives.dive]\n")
    done = other_process("run", "meadow", "--agents", 3, "--ticks", 2, "--brush", brush, **bogs)
    assert done.returncode == 1 and "bug" not in done.stderr
    assert "bogs.py:11: drive 'dive' of bogs failed: ArithmeticError: 0 m deep" in done.stderr


def test_levels_and_recordings_know_the_commands_of_installed_packages(tmp_path):
    shears = installed(tmp_path, "shears", "commands", SHEARS)
    path, walk = pen(tmp_path), tmp_path / "walk.flock"
    path.write_text(path.read_text().replace('"SwitchBrush"', '"Shear"'))
    done = other_process("run", path, "--ticks", 12, "--record", walk, **shears)
    assert done.returncode == 0, done.stderr
    assert other_process("replay", walk, "--verify", **shears).returncode == 0
    without = other_process("replay", walk, "--verify")
    assert without.returncode == 1 and "there is no command 'Shear'" in without.stderr


@pytest.mark.parametrize(
    ("group", "words"), [("exporters", ("run", "--help")), ("terrain", ("level", "check", "a.tmj"))]
)
def test_a_package_that_cannot_be_loaded_is_named(group, words, tmp_path):
    done = other_process(*words, **installed(tmp_path, "stilts", group, "import no_such_module"))
    assert done.returncode == 1 and "bug" not in done.stderr
    assert f"package stilts: entry point stilts = stilts in group flockbrush.{group}: cannot be loaded" in done.stderr
    assert "No module named 'no_such_module'" in done.stderr
