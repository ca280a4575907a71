"""TMX and TSX are read as Tiled itself would export them, and nothing hostile in them costs more than a sentence."""

import base64
import shutil

import cv2
import numpy as np
import pytest
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.editor import Editor
from flockbrush.levels.json_lines import JsonError
from flockbrush.levels.reader import read_level, read_level_files
from flockbrush.levels.tmx import is_xml, read_xml
from flockbrush.systems.edits import PlaceGoal
from foreign_maps import EXAMPLES, KINDS, LEVEL, OF_TILED, exported, foreign_map, level_in_tmx
from small_level import Shelf, level, problem
from small_level import tileset as small_tileset

MAPS = sorted(OF_TILED)
OF_VERSION = {"version", "tiledversion", "compressionlevel", "renderorder"}  # Tiled writes its own
tiled = pytest.mark.skipif(shutil.which("tiled") is None, reason="Tiled is not installed")
examples = pytest.mark.skipif(not (EXAMPLES / "desert.tmx").is_file(), reason="Tiled's examples are not installed")


def plain(document):
    return {key: value for key, value in document.items() if key not in OF_VERSION}


@tiled
@pytest.mark.tools
@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("of_tiled", [False, pytest.param(True, marks=examples)])
def test_a_map_is_what_tiled_exports(name, of_tiled, tmp_path):
    path = foreign_map(name, tmp_path / "maps", of_tiled)
    assert plain(read_xml(path.read_bytes())) == plain(exported(path, path.with_suffix(".json")))


@tiled
@pytest.mark.tools
def test_everything_that_tiled_can_say_is_read_as_tiled_exports_it(tmp_path):
    path = tmp_path / "all.tmx"
    path.write_text(ALL)
    assert plain(read_xml(path.read_bytes())) == plain(exported(path, path.with_suffix(".json")))


ALL = """<?xml version="1.0" encoding="UTF-8"?>
<map version="1.8" tiledversion="1.8.2" orientation="orthogonal" renderorder="right-down" width="4" height="2"
 tilewidth="16" tileheight="16" infinite="0" backgroundcolor="#336699" nextlayerid="9" nextobjectid="12">
 <properties>
  <property name="flag" type="bool" value="true"/>
  <property name="number" type="float" value="2.5"/>
  <property name="text" value="a &amp; b"/>
  <property name="lines">one
two</property>
  <property name="whole" type="int" value="3"/>
 </properties>
 <layer id="1" name="csv" width="4" height="2" tintcolor="#ff0000" offsetx="3" parallaxx="0.5">
  <data encoding="csv">
0,0,0,0,
0,0,0,0
</data>
 </layer>
 <group id="2" name="all" opacity="0.5" visible="0">
  <imagelayer id="3" name="sky" offsetx="1" offsety="2.5">
   <image source="t.png" trans="ff00ff" width="2" height="2"/>
  </imagelayer>
  <objectgroup id="4" name="things" color="#aa0000">
   <object id="1" name="e" x="1" y="2" width="3" height="4.5" rotation="30"><ellipse/></object>
   <object id="2" x="1" y="2"><polygon points="0,0 5,0 5,5.5"/></object>
   <object id="3" x="1" y="2" visible="0"><polyline points="0,0 -5,1"/></object>
   <object id="4" type="Spawn" x="1" y="2"><point/></object>
   <object id="5" x="1" y="2" width="20" height="8"><text wrap="1" bold="1">Hello</text></object>
  </objectgroup>
 </group>
</map>
"""


def test_json_and_xml_are_told_apart_by_their_first_letter():
    assert is_xml(b"\xef\xbb\xbf <?xml") and not is_xml(b' {"type": "map"}') and not is_xml(b"")


def test_a_level_in_tmx_is_read_with_its_tileset_in_tsx():
    text, tsx = LEVEL, KINDS
    found = read_level_files({"small.tmx": text.encode(), "kinds.tsx": tsx.encode()}, library=Shelf(), commands={})
    assert found.width == 20 and found.agents == 5
    assert not found.terrain.walkable[0].any() and found.terrain.walkable[1:].all()
    broken = text.replace('value="5"', 'value="-5"')
    with pytest.raises(Exception, match=r"small\.tmx:23: object 1 in layer 'spawns': count must be at least 0"):
        read_level_files({"small.tmx": broken.encode(), "kinds.tsx": tsx.encode()}, library=Shelf(), commands={})


def test_a_level_in_tmx_is_edited_and_saved_as_tmj(tmp_path):
    path = level_in_tmx(tmp_path)
    editor = Editor.open(path)
    editor.do("goal", [PlaceGoal(id=editor.new_id(), name="fold", x=5.0, y=6.0)])
    with pytest.raises(ProblemsError, match=r"saved as Tiled's JSON; save it under another name, such as small\.tmj"):
        editor.save()
    assert path.read_text() == LEVEL and editor.dirty
    before, saved = read_level(path), read_level(editor.save(tmp_path / "small.tmj"))
    assert saved.goals[0].xy.tolist() == [5.0, 6.0] and not before.goals
    assert np.array_equal(saved.terrain.walkable, before.terrain.walkable) and saved.agents == before.agents == 5


def of_chunks(name, data):
    """An infinite map of 32 by 16 tiles in two chunks."""
    chunk = '<chunk x="{}" y="0" width="16" height="16">' + data + "</chunk>"
    return (
        '<map width="16" height="16" tilewidth="16" tileheight="16" infinite="1" orientation="orthogonal">\n'
        ' <properties><property name="schema" value="flockbrush-level/1"/></properties>\n'
        ' <tileset firstgid="1" source="kinds.tsx"/>\n <layer id="1" name="terrain" width="16" height="16">\n'
        f'  <data encoding="{name}">{chunk.format(0)}{chunk.format(16)}</data></layer>\n'
        ' <imagelayer id="3" name="art"><image source="art.png" width="4" height="4"/></imagelayer>\n'
        ' <objectgroup id="2" name="spawns"><object id="1" x="32" y="32" width="64" height="64"><properties>\n'
        '    <property name="brush" value="march"/><property name="count" type="int" value="5"/>\n'
        "   </properties></object></objectgroup>\n</map>\n"
    )


@pytest.mark.parametrize("encoding", ["csv", "base64"])
def test_an_infinite_map_and_a_picture_on_a_layer_of_its_own_are_read(encoding):
    data = {"csv": ",".join(["1"] * 256), "base64": base64.b64encode(b"\1\0\0\0" * 256).decode()}[encoding]
    tsx = (
        '<tileset name="kinds" tilewidth="16" tileheight="16" tilecount="1" columns="1">'
        '<tile id="0" type="Terrain"/></tileset>'
    )
    picture = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()
    files = {"far.tmx": of_chunks(encoding, data).encode(), "kinds.tsx": tsx.encode(), "art.png": picture}
    found = read_level_files(files, library=Shelf(), commands={})
    assert found.width == 2 * found.height and found.agents == 5
    assert (
        found.terrain.walkable.shape == (16, 32)
        and found.terrain.walkable.all()
        and [layer.name for layer in found.art.layers] == ["art"]
    )


BOMB = '<!DOCTYPE map [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><map>&b;</map>'


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        (BOMB, "a DTD or entities are not supported", 1),
        (
            '<?xml version="1.0"?>\n<!DOCTYPE map SYSTEM "file:///etc/passwd">\n<map/>',
            "a DTD or entities are not supported",
            2,
        ),
        ("<map>\n&b;</map>", "not valid XML: undefined entity", 2),
        ("<map>\n<layer>", "not valid XML: no element found", 2),
        ("<map", "not valid XML: unclosed token", 1),
        ("<html/>", "this is not a map or tileset of Tiled: it begins with <html>", 1),
        ('<map width="wide"/>', "width must be a number, got 'wide'", 1),
        (
            '<map><properties>\n<property name="solid" type="bool" value="maybe"/></properties></map>',
            "property 'solid' must be true or false, got 'maybe'",
            2,
        ),
        (
            '<map><properties><property name="species" type="list"/></properties></map>',
            "property 'species' has the type 'list'; types are bool, class, color, file, float, int, object, string",
            1,
        ),
        (
            '<map><properties><property name="own" type="class"><properties>\n<property value="1"/>'
            "</properties></property></properties></map>",
            "property 'own' has a member without a name",
            2,
        ),
        ('<map width="4_0"/>', "width must be a number, got '4_0'", 1),
        ('<map width="1e999"/>', "width must be a finite number, got '1e999'", 1),
        (
            '<map><objectgroup>\n<object name="pond" width="wide"/></objectgroup></map>',
            "object 'pond': width must be a number, got 'wide'",
            2,
        ),
        (
            '<map><objectgroup>\n<object>\n<polygon points="0,0 1,x"/></object></objectgroup></map>',
            "object without a name: y must be a number, got 'x'",
            3,
        ),
        ('<map>\n<layer name="x"/></map>', "layer 'x' has no data", 2),
        ('<map><layer name="x">\n<data encoding="csv">1,b</data></layer></map>', "whole numbers with commas", 2),
        ("<g>" * (limits.JSON_DEPTH + 1), "nested deeper than", 1),
        ('<?xml version="1.0" encoding="klingon"?><map/>', "not valid XML", 1),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text, message, line):
    with pytest.raises(JsonError, match=message) as caught:
        read_xml(text.encode())
    assert caught.value.line == line


def test_more_elements_than_there_may_be_are_refused(monkeypatch):
    monkeypatch.setattr(limits, "JSON_VALUES", limits.Limit(100, "values", "a level file"))
    with pytest.raises(JsonError, match="more than 100 values"):
        read_xml(b"<map>" + b"<property/>" * 200 + b"</map>")


def test_a_world_names_its_maps():
    document = {"type": "world", "maps": [{"fileName": "north.tmj"}, {"fileName": "south.tmx"}]}
    assert (
        problem(document)
        == "small.tmj:1: this is a Tiled world of several maps; open one of its maps: north.tmj, south.tmx"
    )


def test_a_tileset_in_tsx_that_is_broken_is_named():
    document = level(tilesets=[{"firstgid": 1, "source": "kinds.tsx"}])
    assert small_tileset()["name"] == "kinds"
    assert problem(document, {"kinds.tsx": b"<tileset\n"}) == "kinds.tsx:1: not valid XML: unclosed token"
