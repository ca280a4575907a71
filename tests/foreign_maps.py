"""Maps as game developers have them, in Tiled's XML: like Tiled's own examples, and those where Tiled is installed."""

import json
import os
import shutil
import subprocess
import zlib
from base64 import b64encode
from pathlib import Path

import cv2
import numpy as np

EXAMPLES = Path("/usr/share/doc/tiled/examples")
OF_TILED = {
    "desert": "desert.tmx",
    "sewers": "sewers.tmx",
    "island": "rpg/island.tmx",
    "perspective_walls": "perspective_walls.tmx",
}


# a level of ten by ten tiles in Tiled's XML, and its tileset
LEVEL = (
    '<map width="10" height="10" tilewidth="16" tileheight="16" orientation="orthogonal">\n <properties>\n'
    '  <property name="schema" value="flockbrush-level/1"/>\n'
    '  <property name="metres_per_tile" type="float" value="2"/>\n'
    ' </properties>\n <tileset firstgid="1" source="kinds.tsx"/>\n'
    ' <layer id="1" name="terrain" width="10" height="10"><data encoding="csv">\n'
    + ",\n".join([",".join(["1"] * 10)] * 9 + [",".join(["2"] * 10)])
    + '\n</data></layer>\n <objectgroup id="2" name="spawns">\n'
    '  <object id="1" x="32" y="32" width="64" height="64">\n   <properties>\n'
    '    <property name="brush" value="march"/>\n    <property name="count" type="int" value="5"/>\n'
    "   </properties>\n  </object>\n </objectgroup>\n</map>\n"
)
KINDS = (
    '<tileset name="kinds" tilewidth="16" tileheight="16" tilecount="2" columns="2">\n'
    ' <tile id="0" type="Terrain"/>\n <tile id="1" type="Terrain">\n  <properties>\n'
    '   <property name="walkable" type="bool" value="false"/>\n  </properties>\n </tile>\n</tileset>\n'
)


def level_in_tmx(folder) -> Path:
    """A level in a .tmx file, with its tileset."""
    (folder / "kinds.tsx").write_text(KINDS)
    (folder / "small.tmx").write_text(LEVEL)
    return folder / "small.tmx"


def png(path, tile, columns, rows, margin=0, spacing=0, alpha=True):
    """A sheet of tiles, each with a colour of its own and a bright corner in the north-west."""
    sheet = np.zeros(
        (2 * margin + rows * (tile + spacing) - spacing, 2 * margin + columns * (tile + spacing) - spacing, 4)
    )
    for k in range(columns * rows):
        y, x = margin + k // columns * (tile + spacing), margin + k % columns * (tile + spacing)
        sheet[y : y + tile, x : x + tile] = (40 + 31 * k % 200, 90 + 53 * k % 160, 30 + 17 * k % 220, 255)
        sheet[y : y + tile // 3, x : x + tile // 4] = (250, 250, 250, 255)
        sheet[y + tile - 2 : y + tile, x + tile // 2 :][:, : tile // 2] = (0, 0, 0, 0 if alpha else 255)
    cv2.imwrite(str(path), sheet[:, :, : 4 if alpha else 3].astype(np.uint8))


def packed(gids):
    """Tile data as Tiled writes it: base64 of zlib."""
    return b64encode(zlib.compress(np.asarray(gids, "<u4").tobytes())).decode()


def layer(name, gids, more=""):
    """A tile layer, its tiles packed."""
    ny, nx = gids.shape
    data = f'<data encoding="base64" compression="zlib">\n   {packed(gids)}\n  </data>'
    return f' <layer name="{name}" width="{nx}" height="{ny}"{more}>\n  {data}\n </layer>\n'


def tmx(nx, ny, tile, inner, more=""):
    """A map without ids, as old versions wrote it."""
    head = (
        f'<map version="1.0" orientation="orthogonal" width="{nx}" height="{ny}" tilewidth="{tile}" tileheight="{tile}"'
    )
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}{more}>\n{inner}</map>\n'


def desert(folder):
    """A tileset of its own with margin, spacing and terrains."""
    png(folder / "sand.png", 32, 4, 2, margin=1, spacing=1)
    (folder / "sand.tsx").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<tileset version="1.4" name="Sand" tilewidth="32" tileheight="32" '
        'spacing="1" margin="1" tilecount="8" columns="4">\n <image source="sand.png" width="133" height="67"/>\n'
        ' <tile id="3" probability="0.01"/>\n <wangsets>\n  <wangset name="Sand" type="corner" tile="0">\n'
        '   <wangcolor name="Desert" color="#ff0000" tile="0" probability="1"/>\n'
        '   <wangcolor name="Water" color="#00ff00" tile="1" probability="1"/>\n'
        '   <wangtile tileid="0" wangid="0,1,0,1,0,1,0,1"/>\n   <wangtile tileid="1" wangid="0,2,0,2,0,2,0,2"/>\n'
        '   <wangtile tileid="2" wangid="0,1,0,1,0,2,0,2"/>\n  </wangset>\n </wangsets>\n</tileset>\n'
    )
    gids = np.ones((30, 40), np.uint32)
    gids[8:14, 10:20], gids[8:14, 9] = 2, 3
    gids[20, 5:15] = 4 | 0x80000000
    path = folder / "desert.tmx"
    path.write_text(tmx(40, 30, 32, ' <tileset firstgid="1" source="sand.tsx"/>\n' + layer("Ground", gids)))
    return path


def sewers(folder):
    """A tileset in the map with a transparent colour and no count, and a faint layer on top."""
    png(folder / "sewer.png", 24, 8, 9, alpha=False)
    rng = np.random.default_rng(4)
    bottom = rng.integers(1, 9, (40, 40)).astype(np.uint32)
    top = np.where(rng.random((40, 40)) < 0.3, rng.integers(1, 73, (40, 40)), 0).astype(np.uint32)
    tileset = (
        ' <tileset firstgid="1" name="sewer" tilewidth="24" tileheight="24">\n'
        '  <image source="sewer.png" trans="fafafa" width="192" height="216"/>\n </tileset>\n'
    )
    path = folder / "sewers.tmx"
    path.write_text(tmx(40, 40, 24, tileset + layer("Bottom", bottom) + layer("Top", top, ' opacity="0.49"')))
    return path


def island(folder):
    """Turned tiles, an animated one, and objects with classes of the game."""
    png(folder / "beach.png", 16, 6, 3)
    (folder / "beach.tsx").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<tileset name="beach" tilewidth="16" tileheight="16" tilecount="18" '
        'columns="6">\n <image source="beach.png" width="96" height="48"/>\n'
        ' <tile id="4" type="Water">\n  <properties>\n'
        '   <property name="walkable" type="bool" value="false"/>\n  </properties>\n  <animation>\n'
        '   <frame tileid="5" duration="1000"/>\n   <frame tileid="4" duration="1000"/>\n  </animation>\n </tile>\n'
        ' <tile id="7">\n  <objectgroup draworder="index">\n   <object id="1" x="0" y="0" width="16" height="16"/>\n'
        "  </objectgroup>\n </tile>\n</tileset>\n"
    )
    gids = np.full((40, 50), 5, np.uint32)
    gids[8:34, 8:44] = 1
    fringe = np.zeros_like(gids)
    flags = [0, 0x80000000, 0x40000000, 0x20000000, 0xA0000000, 0x60000000, 0xC0000000, 0xE0000000]
    fringe[10, 10:18] = [9 | flag for flag in flags]
    fringe[15, 20:26] = 8
    things = (
        ' <objectgroup name="Objects">\n  <object id="1" name="Start" type="start" x="400" y="300">\n   <point/>\n'
        '  </object>\n  <object id="5" name="Exit" type="exit" x="336" y="208" width="48" height="48"/>\n'
        '  <object id="7" gid="3" x="200" y="200" width="32" height="16" rotation="30"/>\n </objectgroup>\n'
    )
    path = folder / "island.tmx"
    inner = ' <tileset firstgid="1" source="beach.tsx"/>\n' + layer("Ground", gids) + layer("Fringe", fringe) + things
    path.write_text(tmx(50, 40, 16, inner, ' nextobjectid="8"'))
    return path


def perspective_walls(folder):
    """Tiles larger than their cells, shifted, of a picture whose size the tileset does not say."""
    png(folder / "walls.png", 64, 4, 4)
    (folder / "walls.tsx").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<tileset name="walls" tilewidth="64" tileheight="64">\n'
        ' <tileoffset x="-32" y="0"/>\n <image source="walls.png"/>\n <tile id="13">\n  <properties>\n'
        '   <property name="door" value="true"/>\n  </properties>\n </tile>\n</tileset>\n'
    )
    walls = np.zeros((32, 32), np.uint32)
    walls[5, 5:15], walls[5:15, 5] = 2, 3
    inner = (
        ' <tileset firstgid="1" source="walls.tsx"/>\n'
        + layer("Walls", walls)
        + layer("Walls level 2", np.roll(walls, 8, 0))
    )
    path = folder / "perspective_walls.tmx"
    path.write_text(tmx(32, 32, 31, inner))
    return path


def foreign_map(name, folder, of_tiled=False) -> Path:
    """A map of this name in a folder of its own: made here, or a copy of Tiled's example."""
    folder.mkdir(parents=True, exist_ok=True)
    if not of_tiled:
        return globals()[name](folder)
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    return folder / OF_TILED[name]


def exported(path, out):
    """What Tiled makes of a map as JSON."""
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    command = ["tiled", "--export-map", "json", str(path), str(out)]
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60)
    return json.loads(out.read_bytes())
