"""TMX and TSX, Tiled's XML files, as the JSON documents that Tiled would export of them.

The standard library's expat reads.  Documents with a DTD or entities are refused (they can unpack to gigabytes), and
depth and number of elements are limited as in JSON files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from xml.parsers import expat

from flockbrush.engine import limits
from flockbrush.levels.json_lines import JsonError, Node

_LAYERS = {"layer": "tilelayer", "objectgroup": "objectgroup", "imagelayer": "imagelayer", "group": "group"}
_NUMBERS = (
    "width height tilewidth tileheight nextlayerid nextobjectid compressionlevel hexsidelength id firstgid tilecount "
    "columns spacing margin gid tileid duration x y offsetx offsety opacity parallaxx parallaxy rotation probability "
    "parallaxoriginx parallaxoriginy tile pixelsize"
)
_SWITCHES = "infinite visible repeatx repeaty locked wrap bold italic underline strikeout kerning"
_WORDS = frozenset({"color", "file", "string"})  # types of properties
_TYPES = _WORDS | {"bool", "class", "float", "int", "object"}
_TEXTS = frozenset({"chunk", "data", "property", "text"})  # elements whose text counts


@dataclass
class Element:
    """An XML element."""

    tag: str
    attributes: dict
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def all(self, tag):
        """Its children of a kind."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag):
        """Its first child of a kind, or None."""
        return next((child for child in self.children if child.tag == tag), None)


def is_xml(data: bytes) -> bool:
    """Whether a file is XML and no JSON."""
    return data.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] == b"<"


def read_xml(data: bytes) -> Node:
    """The document of a TMX or TSX file: a map, a tileset or a template.

    Raises
    ------
    JsonError
        With the line and what is wrong: not XML, a DTD, nested too deeply, or no file of Tiled's.
    """
    root = _parse(data)
    if root.tag == "map":
        return _map(root)
    if root.tag == "tileset":
        return _tileset(root)
    raise JsonError(f"this is not a map or tileset of Tiled: it begins with <{root.tag[:40]}>", root.line)


def _parse(data):
    parser = expat.ParserCreate()
    parser.buffer_text = True
    stack, roots, counted = [], [], 0

    def start(tag, attributes):
        nonlocal counted
        counted += 1
        line = parser.CurrentLineNumber
        if counted > limits.JSON_VALUES:
            raise JsonError(f"there are more than {limits.JSON_VALUES.text} in this file", line)
        if len(stack) >= limits.JSON_DEPTH:
            raise JsonError(f"nested deeper than {limits.JSON_DEPTH} levels", line)
        element = Element(tag, attributes, line)
        (stack[-1].children if stack else roots).append(element)
        stack.append(element)

    def end(tag):
        stack.pop()

    def text(words):
        if stack and stack[-1].tag in _TEXTS:
            stack[-1].text += words

    def refuse(*_):
        raise JsonError("XML files with a DTD or entities are not supported", parser.CurrentLineNumber)

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise JsonError(f"not valid XML: {expat.ErrorString(error.code)}", error.lineno) from None
    except (ValueError, LookupError) as error:  # an encoding that there is not
        if isinstance(error, JsonError):
            raise
        raise JsonError(f"not valid XML: {error}", parser.CurrentLineNumber) from None
    return roots[0]


# ---------------------------------------------------------------- values


def _node(element, *left_out, **more):
    """The attributes as Tiled's JSON has them, then `more`."""
    node = Node()
    node.line = element.line
    for name, value in element.attributes.items():
        if name not in left_out:
            node[name] = _value(name, value, element.line)
    node.update(more)
    return node


def _value(name, text, line):
    if name in _NUMBERS.split():
        return _number(text, line, name)
    if name in _SWITCHES.split():
        return text in ("1", "true")
    return text


def _number(text, line, name):
    try:
        if len(text) > limits.JSON_DIGITS or "_" in text:  # Python reads 4_0 as 40
            raise ValueError
        value = float(text)
    except ValueError:
        raise JsonError(f"{name} must be a number, got {text[:40]!r}", line) from None
    if not math.isfinite(value):
        raise JsonError(f"{name} must be a finite number, got {text[:40]!r}", line)
    return int(value) if value == int(value) else value


def _properties(element):
    """{"properties": [...]} where an element has some."""
    inner = element.first("properties")
    entries = [_property(one) for one in inner.all("property")] if inner else []
    entries.sort(key=lambda entry: str(entry.get("name", "")))  # as Tiled does
    return {"properties": entries} if entries else {}


def _property(element):
    kind = element.attributes.get("type", "string")
    node = _node(element, "value", "type", type=kind)
    if kind == "class":
        inner = element.first("properties")
        members = [_property(one) for one in inner.all("property")] if inner else []
        nameless = next((member.line for member in members if "name" not in member), None)
        if nameless is not None:
            raise JsonError(f"{_called(element)} has a member without a name", nameless)
        node["value"] = Node({member["name"]: member["value"] for member in members})
        node["value"].line = element.line
        return node
    text = element.attributes.get("value", element.text)
    name = _called(element)
    if kind in ("int", "float", "object"):
        node["value"] = _number(text, element.line, name)
    elif kind == "bool":
        if text not in ("true", "false"):
            raise JsonError(f"{name} must be true or false, got {text[:40]!r}", element.line)
        node["value"] = text == "true"
    elif kind in _WORDS:
        node["value"] = text
    else:
        raise JsonError(f"{name} has the type {kind[:40]!r}; types are {', '.join(sorted(_TYPES))}", element.line)
    return node


def _called(element):
    """A property, for messages."""
    return f"property {element.attributes.get('name', '')[:40]!r}"


# ---------------------------------------------------------------- maps


def _map(root):
    doc = _node(root, type="map")
    _with_defaults(doc, {"infinite": False, "renderorder": "right-down"})
    doc["tilesets"] = [_tileset(one) for one in root.all("tileset")]
    doc["layers"] = _layers(root)
    doc.update(_properties(root))
    _number_what_has_no_id(doc)
    return doc


def _layers(element):
    return [_READ[child.tag](child) for child in element.children if child.tag in _LAYERS]


def _layer(element, **more):
    defaults = {"name": "", "opacity": 1, "visible": True, "x": 0, "y": 0}
    node = _node(element, **more, **_properties(element), type=_LAYERS[element.tag])
    if "offsetx" in node or "offsety" in node:
        _with_defaults(node, {"offsetx": 0, "offsety": 0})
    return _with_defaults(node, defaults)


def _with_defaults(node, defaults):
    for name, value in defaults.items():
        node.setdefault(name, value)
    return node


def _tile_layer(element):
    data = element.first("data")
    node = _layer(element)
    if data is None:
        raise JsonError(f"layer {node['name'][:60]!r} has no data", element.line)
    encoding, compression = data.attributes.get("encoding"), data.attributes.get("compression")
    if encoding == "base64":
        node["encoding"] = "base64"
        node["compression"] = compression or ""
    elif encoding not in (None, "csv"):
        node["encoding"] = encoding
    chunks = data.all("chunk")
    if chunks:
        node["chunks"] = [_node(chunk, data=_tiles(chunk, encoding)) for chunk in chunks]
    else:
        node["data"] = _tiles(data, encoding)
    return node


def _tiles(element, encoding):
    if encoding == "base64":
        return element.text.strip()
    if encoding is None:
        return [_number(tile.attributes.get("gid", "0"), tile.line, "gid") for tile in element.all("tile")]
    try:
        return [int(word) for word in element.text.split(",")] if element.text.strip() else []
    except ValueError:
        raise JsonError("tile data must be whole numbers with commas", element.line) from None


def _object_layer(element):
    node = _layer(element, objects=[_object(one) for one in element.all("object")])
    return _with_defaults(node, {"draworder": "topdown"})


def _image_layer(element):
    node = _layer(element)
    image = element.first("image")
    node["image"] = image.attributes.get("source", "") if image else ""
    if image:
        node.update(_transparent(image))
    return node


def _group(element):
    return _layer(element, layers=_layers(element))


_READ = {"layer": _tile_layer, "objectgroup": _object_layer, "imagelayer": _image_layer, "group": _group}


def _object(element):
    """An object; its mistakes are reported with its name."""
    try:
        return _object_node(element)
    except JsonError as error:
        name = element.attributes.get("name", "")[:60]
        owner = f"object {name!r}" if name else "object without a name"
        raise JsonError(f"{owner}: {error}", error.line) from None


def _object_node(element):
    node = _node(element, **_properties(element))
    if "template" not in node:
        plain = {"name": "", "height": 0, "width": 0, "rotation": 0, "visible": True}
        _with_defaults(node, plain if "class" in node else {**plain, "type": ""})
    for child in element.children:
        if child.tag in ("ellipse", "point", "capsule"):
            node[child.tag] = True
        elif child.tag in ("polygon", "polyline"):
            node[child.tag] = _corners(child)
        elif child.tag == "text":
            node["text"] = _node(child, text=child.text)
    return node


def _corners(element):
    corners = []
    for pair in element.attributes.get("points", "").split():
        x, _, y = pair.partition(",")
        corner = Node(x=_number(x, element.line, "x"), y=_number(y, element.line, "y"))
        corner.line = element.line
        corners.append(corner)
    return corners


def _number_what_has_no_id(doc):
    """Give layers and objects of old maps an id, and say which is next, as Tiled does."""
    layers, objects, waiting = [], [], list(doc["layers"])
    while waiting:
        layer = waiting.pop(0)
        layers.append(layer)
        objects += layer.get("objects", [])
        waiting[:0] = layer.get("layers", [])
    for things, key in ((layers, "nextlayerid"), (objects, "nextobjectid")):
        free = max([thing["id"] for thing in things if "id" in thing], default=0) + 1
        for thing in things:
            if "id" not in thing:
                thing["id"], free = free, free + 1
        doc[key] = max(free, doc.get(key, 1))


# ---------------------------------------------------------------- tilesets


def _tileset(element):
    node = _node(element, **_properties(element))
    if "source" in node:
        return node
    _with_defaults(node, {"margin": 0, "spacing": 0, "name": ""})
    if "firstgid" not in node:
        node["type"] = "tileset"
    _take_image(node, element.first("image"))
    count_tiles(node)
    for name in ("tileoffset", "grid", "transformations"):
        child = element.first(name)
        if child is not None:
            node[name] = _node(child)
    tiles = [_tile(one) for one in element.all("tile")]
    if tiles:
        node["tiles"] = tiles
    wangsets = element.first("wangsets")
    if wangsets is not None:
        node["wangsets"] = [_wangset(one) for one in wangsets.all("wangset")]
    return node


def _take_image(node, image):
    if image is None:
        return
    node["image"] = image.attributes.get("source", "")
    for name, attribute in (("imagewidth", "width"), ("imageheight", "height")):
        if attribute in image.attributes:
            node[name] = _number(image.attributes[attribute], image.line, attribute)
    node.update(_transparent(image))


def count_tiles(node):
    """Say how many tiles a tileset's image has, where old files leave it out and the size of the image is known."""
    sizes = [node.get(key) for key in ("imagewidth", "imageheight", "tilewidth", "tileheight")]
    if "tilecount" in node or not all(type(size) is int and size > 0 for size in sizes):
        return
    margin, spacing = (node.get(key) if type(node.get(key)) is int else 0 for key in ("margin", "spacing"))
    columns, rows = ((sizes[k] - margin + spacing) // max(sizes[k + 2] + spacing, 1) for k in (0, 1))
    node["columns"], node["tilecount"] = columns, max(columns * rows, 0)


def _transparent(image):
    colour = image.attributes.get("trans", "")
    return {"transparentcolor": "#" + colour.removeprefix("#")} if colour else {}


def _tile(element):
    node = _node(element, **_properties(element))
    _take_image(node, element.first("image"))
    collision = element.first("objectgroup")
    if collision is not None:
        node["objectgroup"] = _object_layer(collision)
    animation = element.first("animation")
    if animation is not None:
        node["animation"] = [_node(frame) for frame in animation.all("frame")]
    return node


def _wangset(element):
    wangtiles = []
    for one in element.all("wangtile"):
        node = _node(one, "wangid")
        words = one.attributes.get("wangid", "").split(",")
        node["wangid"] = [_number(word, one.line, "wangid") for word in words if word]
        wangtiles.append(node)
    return _node(
        element,
        **_properties(element),
        colors=[_node(one, **_properties(one)) for one in element.all("wangcolor")],
        wangtiles=wangtiles,
    )
