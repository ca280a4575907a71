"""A property of the ground that an installed package declares."""

import json

from processes import HOUSE, other_process

BOGS = """
from flockbrush.levels.terrain_kinds import terrain_property

terrain_property("depth", 0.0, "how deep animals sink in", "m", low=0, high=2)
"""


def test_commands_know_the_properties_of_installed_packages(tmp_path):
    told = tmp_path / "site" / "bogs-1.0.dist-info"
    told.mkdir(parents=True)
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: bogs\nVersion: 1.0\n")
    (told / "entry_points.txt").write_text("[flockbrush.terrain]\nbogs = bogs\n")
    (tmp_path / "site" / "bogs.py").write_text(BOGS)
    installed = {"PYTHONPATH": f"{HOUSE}:{tmp_path / 'site'}"}
    levels = tmp_path / "levels"
    assert other_process("level", "init", levels, **installed).returncode == 0
    assert '"depth"' in (levels / "flockbrush.tiled-project").read_text()

    path = levels / "tilesets" / "terrain.tsj"
    tileset = json.loads(path.read_text())
    mud = next(t for t in tileset["tiles"] if {"name": "name", "type": "string", "value": "mud"} in t["properties"])
    mud["properties"] = [p for p in mud["properties"] if p["name"] != "depth"]
    mud["properties"].append({"name": "depth", "type": "float", "value": 0.3})
    path.write_text(json.dumps(tileset))
    done = other_process("level", "check", levels / "first.tmj", **installed)
    assert done.returncode == 0, done.stderr
    without = other_process("level", "check", levels / "first.tmj")
    assert without.returncode == 1 and "Terrain has no property 'depth'" in without.stdout
