"""What tiles of a map that was not made for Flockbrush mean: rules in a property of the map, one in each line.

    class Water = deep water
    property walkable:false = walkable=false
    property speed = speed_factor=property
    terrain Road = road
    tileset Desert 30-31, 37 = walkable=false, blocks_view=true
    layer Walls = cliff
    collision = walkable=false

Left of the equals sign is which tiles, right of it a kind of ground by name, or properties of the class Terrain.  Of
several rules for one tile the first counts, of several layers the uppermost that has a rule.
"""

from __future__ import annotations

import re
from collections import Counter

from flockbrush.engine import limits
from flockbrush.engine.problems import did_you_mean
from flockbrush.levels.checked_nodes import dicts, tiles_by_id
from flockbrush.levels.properties import Refused, convert
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.terrain_kinds import TERRAINS

CONDITIONS = ("class", "property", "terrain", "tileset", "layer", "collision")
OF_PROPERTY = "property"  # a value that the property itself gives
_IDS = re.compile(r"\s((?:\d+(?:-\d+)?(?:,\s*)?)+)$")
_TERRAIN = CLASSES["Terrain"]

# words of other people's maps, and the ground they suggest
_WORDS = {
    "water": "deep water", "deep water": "deep water", "sea": "deep water", "ocean": "deep water", "lake": "deep water",
    "river": "deep water", "shallow water": "shallows", "shallows": "shallows", "wall": "cliff", "walls": "cliff",
    "cliff": "cliff", "mountain": "cliff", "sand": "sand", "desert": "sand", "beach": "sand", "road": "road",
    "path": "road", "brick": "road", "cobblestone": "road", "mud": "mud", "swamp": "mud", "grass": "grass",
    "snow": "snow", "dirt": "dirt", "rock": "rock", "gravel": "gravel", "forest": "forest floor",
}  # fmt: skip
_BLOCKS = ("collides", "collision", "solid", "blocked", "blocking", "obstacle", "impassable", "wall")
_OPENS = ("walkable", "passable")


class GroundRules:
    """The rules of a map.

    Parameters
    ----------
    text : str
    tell : function (message)
        Told of every line that is no rule, and once of every tile whose property gives a value that cannot be.
    tilesets : sequence of documents
        Of the map.
    """

    def __init__(self, text, tell, tilesets=()):
        self.rules, self._tell, self._told, self._tilesets = [], tell, set(), tilesets
        for line in text.splitlines():
            if line.strip() and not line.strip().startswith("#"):
                try:
                    self.rules.append(_rule(line, [tileset.get("name") for tileset in tilesets]))
                except Refused as error:
                    tell(f"ground_rules: {line.strip()[:60]!r}: {error}")
        if len(self.rules) > limits.GROUND_RULES:
            tell(f"ground_rules: there are more than {limits.GROUND_RULES.text}")

    def ground(self, layer, facts):
        """The values of class Terrain for a tile of a layer, or None.

        Parameters
        ----------
        layer : str
            Its name.
        facts : TileFacts
        """
        for matches, ground, name, _ in self.rules:
            rule = matches(layer, facts)
            if rule is None or rule is False:
                continue
            try:
                values = {key: self._value(key, value, rule) for key, value in ground.items()}
            except Refused as error:
                self._tell_once(f"ground_rules: {name}: tile {facts.number} of tileset {facts.tileset!r}: {error}")
                continue
            return {**{p.name: p.default for p in _TERRAIN.properties}, "name": name, **values}
        return None

    def unmatched(self, layers):
        """A message about each rule whose condition fits nothing in the map, with the name that is perhaps meant.

        Parameters
        ----------
        layers : sequence of str
            Names of the tile layers to which rules apply, without those of groups.
        """
        if not self.rules:
            return []
        there = _names_of(self._tilesets, layers)
        told = [(condition, _why_nothing(condition, there, self._tilesets)) for *_, condition in self.rules]
        return [f"ground_rules: {condition!r} matches nothing: {why}" for condition, why in told if why]

    def _value(self, key, value, of_tile):
        """The value of a ground, or the one that the property of a tile gives; Refused."""
        if value != OF_PROPERTY:
            return value
        try:
            return convert(_TERRAIN.property(key), of_tile)
        except Refused as error:
            raise Refused(f"{key} {error}") from None

    def _tell_once(self, message):
        if message not in self._told:
            self._told.add(message)
            self._tell(message)


class TileFacts:
    """What a tileset says of one of its tiles."""

    def __init__(self, tileset_name, number, node, terrains):
        self.tileset, self.number, self.terrains = tileset_name, number, terrains
        self.cls = class_of(node)
        self.properties = {p["name"]: p.get("value") for p in dicts(node, "properties") if "name" in p}
        self.collides = collides(node)


def class_of(node):
    """The class of a tile, "" for none."""
    cls = node.get("class") or node.get("type")
    return cls if isinstance(cls, str) else ""


def collides(node):
    """Whether a tile has collision shapes."""
    shapes = node.get("objectgroup")
    return isinstance(shapes, dict) and bool(dicts(shapes, "objects"))


def terrains_of(tileset):
    """{tile: names of the terrains (Wang colours) that more than half of its corners and edges are}."""
    terrains: dict[int, set] = {}
    for wangset in dicts(tileset, "wangsets"):
        names = {k + 1: str(colour.get("name", "")) for k, colour in enumerate(dicts(wangset, "colors"))}
        for tile in dicts(wangset, "wangtiles"):
            marks = tile.get("wangid")
            marks = [mark for mark in marks if type(mark) is int and mark] if isinstance(marks, list) else []
            for mark, count in Counter(marks).items():
                if 2 * count > len(marks) and mark in names and type(tile.get("tileid")) is int:
                    terrains.setdefault(tile["tileid"], set()).add(names[mark].lower())
    return terrains


def facts_of(tileset):
    """A function (number) -> TileFacts of a tileset's document."""
    nodes = tiles_by_id(tileset)
    terrains = terrains_of(tileset)
    name = tileset.get("name", "")
    return lambda number: TileFacts(name, number, nodes.get(number, {}), terrains.get(number, set()))


# ---------------------------------------------------------------- what rules can name


def _names_of(tilesets, layers):
    """{kind of condition: names that it finds in a map}."""
    tiles = [tile for tileset in tilesets for tile in dicts(tileset, "tiles")]
    told = [entry for tile in tiles for entry in dicts(tile, "properties")]
    colours = [colour for tileset in tilesets for one in dicts(tileset, "wangsets") for colour in dicts(one, "colors")]
    return {
        "class": [cls for cls in map(class_of, tiles) if cls],
        "property": [str(entry.get("name")) for entry in told],
        "value": [f"{entry.get('name')}:{str(entry.get('value')).lower()}" for entry in told],
        "terrain": [str(colour.get("name")) for colour in colours],
        "tileset": [str(tileset.get("name")) for tileset in tilesets],
        "layer": list(layers),
        "collision": [""] if any(map(collides, tiles)) else [],
    }


def _why_nothing(condition, there, tilesets):
    """Why a condition fits nothing in a map, or ""."""
    kind, rest = _parts(condition)
    if kind == "collision":
        return "" if there[kind] else "no tile has a collision shape"
    name, value, numbers = rest, "", None
    if kind == "tileset":
        name, numbers = _name_and_ids(rest, there[kind])
    elif kind == "property":
        name, _, value = (part.strip() for part in rest.partition(":"))
    known = there[kind] if kind in ("property", "tileset") else [one.lower() for one in there[kind]]
    if (name if known is there[kind] else name.lower()) not in known:
        return f"there is no {kind} {name[:60]!r}{did_you_mean(name, there[kind])}"
    values = [pair.removeprefix(f"{name}:") for pair in there["value"] if pair.startswith(f"{name}:")]
    if value and value.lower() not in values:
        return f"no tile has the value {value[:60]!r}{did_you_mean(value, values)}"
    if numbers is not None and not any(_has(tileset, name, numbers) for tileset in tilesets):
        return f"tileset {name[:60]!r} has no such tile"
    return ""


def _has(tileset, name, numbers):
    """Whether a tileset has this name and one of these tiles."""
    ids = tiles_by_id(tileset)
    return tileset.get("name") == name and any(k < tileset.get("tilecount", 0) or k in ids for k in numbers)


# ---------------------------------------------------------------- reading a rule


def _rule(line, tilesets):
    """(function (layer, facts) -> value or None, values of Terrain, name of the ground, its condition)."""
    condition, equals, ground = line.partition("=")
    if not equals:
        raise Refused("a rule is 'CONDITION = GROUND', such as 'class Water = deep water'")
    condition, ground = condition.strip(), ground.strip()
    values, name = _ground(ground, condition)
    return _condition(condition, tilesets), values, name, condition


def _ground(text, condition):
    known = {kind["name"]: kind for kind in TERRAINS}
    if text.lower() in known:
        return dict(known[text.lower()]), text.lower()
    values = {}
    for part in text.split(","):
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals:
            raise Refused(f"there is no ground {part.strip()[:40]!r}{did_you_mean(part.strip(), known)}")
        settable = [p.name for p in _TERRAIN.properties if p.name != "name"]
        if key not in settable:
            raise Refused(f"ground has no {key[:40]!r}{did_you_mean(key, settable)}")
        values[key] = _value(key, value, condition)
    return values, condition


def _value(key, text, condition):
    if text == OF_PROPERTY:
        if not condition.startswith("property "):
            raise Refused("only a rule for a property can take a value from it")
        return OF_PROPERTY
    kind = _TERRAIN.property(key)
    try:
        parsed = {"bool": {"true": True, "false": False}.get(text, text), "colour": text}.get(kind.kind)
        return convert(kind, float(text) if parsed is None else parsed)
    except Refused as error:
        raise Refused(f"{key} {error}") from None
    except ValueError:
        raise Refused(f"{key} must be a number, got {text[:40]!r}") from None


def _parts(condition):
    """(kind of a condition, what it names)."""
    kind, _, rest = condition.partition(" ")
    return kind, rest.strip()


def _condition(text, tilesets):
    kind, rest = _parts(text)
    if kind not in CONDITIONS:
        raise Refused(f"there is no condition {kind[:40]!r}{did_you_mean(kind, CONDITIONS)}")
    if not rest and kind != "collision":
        raise Refused(f"{kind} needs a name, such as '{kind} Water'")
    return _by_tileset(rest, tilesets) if kind == "tileset" else _MATCHES[kind](rest)


def _by_property(rest):
    name, colon, wanted = (part.strip() for part in rest.partition(":"))

    def matches(layer, facts):
        value = facts.properties.get(name)
        if colon:
            return None if value is None or str(value).lower() != wanted.lower() else True
        return None if value is False or value == "" else value

    return matches


def _name_and_ids(rest, tilesets):
    """(name of a tileset, numbers of its tiles or None for all); a name that there is may end in a number."""
    ids = None if rest in tilesets else _IDS.search(rest)
    if ids is None:
        return rest, None
    return rest[: ids.start()].strip(), set().union(*map(_span, re.findall(r"\d+(?:-\d+)?", ids[1])))


def _by_tileset(rest, tilesets):
    name, wanted = _name_and_ids(rest, tilesets)
    return lambda layer, facts: facts.tileset == name and (wanted is None or facts.number in wanted)


def _span(text):
    low, _, high = text.partition("-")
    low, high = int(low), int(high or low)
    if high - low > limits.TILES:
        raise Refused(f"{text} are too many tiles; a tileset has at most {int(limits.TILES)}")
    return range(low, high + 1)


_MATCHES = {
    "class": lambda rest: lambda layer, facts: facts.cls.lower() == rest.lower(),
    "property": _by_property,
    "terrain": lambda rest: lambda layer, facts: rest.lower() in facts.terrains,
    "layer": lambda rest: lambda layer, facts: layer.lower() == rest.lower(),
    "collision": lambda rest: lambda layer, facts: facts.collides,
}


# ---------------------------------------------------------------- suggestions


def suggest_rules(tilesets, layers) -> list[str]:
    """Rules that the names in a map suggest.

    Parameters
    ----------
    tilesets : list of documents
    layers : list of str
        Names of its tile layers.
    """
    rules = []
    for tileset in tilesets:
        rules += _of_tiles(tileset)
        for wangset in dicts(tileset, "wangsets"):
            names = [str(colour.get("name", "")) for colour in dicts(wangset, "colors")]
            rules += [f"terrain {name} = {_WORDS[name.lower()]}" for name in names if name.lower() in _WORDS]
    base_names = {name.rsplit("/", 1)[-1] for name in layers}
    rules += [
        f"layer {name} = {_WORDS[_first_word(name)]}" for name in sorted(base_names) if _is_solid(_first_word(name))
    ]
    return [rule for rule in dict.fromkeys(rules) if _fits(rule, tilesets, base_names)][: limits.GROUND_RULES]


def _fits(rule, tilesets, layers):
    """Whether a rule can be read and matches something, and the property that it takes a value from fits in all."""
    told: list[str] = []
    rules = GroundRules(rule, told.append, tilesets)
    for tileset in tilesets if rule.endswith(f"={OF_PROPERTY}") else ():
        facts = facts_of(tileset)
        for node in dicts(tileset, "tiles"):
            rules.ground("", facts(node.get("id")))
    return not told and not rules.unmatched(layers)


def _of_tiles(tileset):
    for node in dicts(tileset, "tiles"):
        cls = class_of(node)
        if cls.lower() in _WORDS:
            yield f"class {cls} = {_WORDS[cls.lower()]}"
        for entry in dicts(node, "properties"):
            yield from _of_property(str(entry.get("name", "")), entry.get("value"))
        if collides(node):
            yield "collision = walkable=false"


def _of_property(name, value):
    word = name.lower()
    if word in _OPENS:
        yield f"property {name}:false = walkable=false"
    elif word in _BLOCKS:
        yield f"property {name}:true = walkable=false"
    elif word in _WORDS:
        yield f"property {name}:true = {_WORDS[word]}"
    elif word in ("speed", "speed_factor") and isinstance(value, float | int) and not isinstance(value, bool):
        yield f"property {name} = speed_factor=property"


def _first_word(name):
    return (name.lower().split() or [""])[0]


def _is_solid(word):
    """Whether a layer of this name is full of impassable ground."""
    return _WORDS.get(word) in ("cliff", "deep water")
