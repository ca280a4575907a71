"""Changes to files that leave their structure whole enough to be read a long way in.

Every function takes a ``random.Random`` first and gives a changed copy.
"""

import copy
import io
import json
import math
import struct
import zipfile
import zlib

import numpy as np

WORDS = [
    "", "a", "x" * 300, "x" * 70_000, "a\nb", "a\rb", "\0", "\x1b[2J", "\ud800", "é" * 40, "../../etc/passwd",
    "/dev/zero", "C:\\con", "file:///etc/passwd", "http://localhost/", "${HOME}", "%s%n", "{0.__class__}", "nan",
    "-1", "inf", "1e999", "true", "null", "NaN", "🦆" * 9, "march", "sheep", "*", "__proto__",
]  # fmt: skip
NUMBERS = [
    0, 1, -1, 2, 3, 7, 100, -100, 255, 256, 65535, 65536, 4_000_000, 2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63 - 1,
    2**63,    -(2**63) - 1, 10**30, 0.0, -0.0, 0.5, -0.5, 1e-308, 5e-324, 1e-9, 1e9, 1e15, 1e16, 1e300, 1e308, -1e308,
    math.inf, -math.inf, math.nan,
]  # fmt: skip


def odd(rng, depth=0):
    """A value that nobody asked for."""
    kind = rng.randrange(9 if depth < 2 else 6)
    if kind < 3:
        return rng.choice([math.nan, math.inf, -math.inf, 1e300, 2**64] if rng.random() < 0.3 else NUMBERS)
    if kind == 3:
        return rng.choice(WORDS)
    if kind == 4:
        return rng.choice([None, True, False])
    if kind == 5:
        return rng.uniform(-50, 50) if rng.random() < 0.5 else rng.randrange(-50, 50)
    if kind == 6:
        return [odd(rng, depth + 1) for _ in range(rng.randrange(4))]
    if kind == 7:
        return {rng.choice(WORDS): odd(rng, depth + 1) for _ in range(rng.randrange(3))}
    return [[rng.uniform(-50, 50), rng.uniform(-50, 50)] for _ in range(rng.randrange(6))]


# trees -----------------------------------------------------------------------------------------


def places(node, here=()):
    """The way to every value of a tree, long lists only in part."""
    found = [here] if here else []
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys if len(keys) < 30 else [*keys[:6], *keys[-2:]]:
        found += places(node[key], (*here, key))
    return found


def changed_tree(rng, tree, times=None):
    """A tree of dicts and lists with a few of its values changed, moved, doubled or gone."""
    tree = copy.deepcopy(tree)
    for _ in range(times or rng.choice([1, 1, 1, 2, 3])):
        ways = places(tree)
        if not ways:
            return odd(rng)
        shallow = [way for way in ways if len(way) == 1]
        *way, last = rng.choice(shallow if rng.random() < 0.4 else ways)
        node = tree
        for key in way:
            node = node[key]
        how = rng.randrange(8)
        if how == 0:
            del node[last]
        elif how == 1 and isinstance(node, list):
            node.insert(last, copy.deepcopy(node[last]))
        elif how == 1:
            node[rng.choice(WORDS)] = copy.deepcopy(node[last])
        elif how == 2:
            node[last] = [node[last]]
        elif how == 3:
            node[last] = nudged(rng, node[last])
        elif how == 4:
            other = tree
            for key in rng.choice(ways):
                other = other[key] if _has(other, key) else other
            node[last] = copy.deepcopy(other)
        else:
            node[last] = odd(rng)
    return tree


def _has(node, key):
    if isinstance(node, dict):
        return key in node
    return isinstance(node, list) and isinstance(key, int) and -len(node) <= key < len(node)


def nudged(rng, value):
    """A value of the same type, and another one."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice([value + 1, value - 1, -value, 2 * value, value + 2**31, value * 10**6])
    if isinstance(value, float):
        return rng.choice([-value, value * 1e6, value * 1e-6, value + 0.5, value * 1e200])
    if isinstance(value, str):
        at = rng.randrange(len(value) + 1)
        return rng.choice([value[:at], value[:at] + rng.choice(WORDS) + value[at:], value.upper(), value * 3])
    if isinstance(value, list):
        return rng.choice([value[::-1], value * 2, value[: len(value) // 2]])
    return value


def as_json(rng, tree):
    """The text of a tree; now and then with a name twice, a number that is none, or cut off."""
    text = json.dumps(tree, indent=rng.choice([None, 1]))
    if rng.random() < 0.05:
        text = text[: rng.randrange(len(text) + 1)]
    if rng.random() < 0.05:
        text = text.replace('": ', '": 1, "twice": 2, "twice": ', 1)
    return text.encode("utf-8", "surrogatepass")


def changed_json(rng, data):
    """A JSON document with some of it changed."""
    try:
        return as_json(rng, changed_tree(rng, json.loads(data)))
    except ValueError:  # it is none any more
        return changed_bytes(rng, data)


# texts -----------------------------------------------------------------------------------------

TOML_VALUES = [
    "nan", "-inf", "1e308", "1e999", "-1", "0", "9" * 40, "9223372036854775808", '""', '"x"', "'a'", "true", "[]", "{}",
    "[1, 2]", "[[1, 2], [3]]", "{ a = 1 }", "1979-05-27", "1979-13-47", "0x7fffffffffffffff", '"""\na\n"""',
    '"\\ud800"', '"\\u001b[2J"', "[" * 40 + "]" * 40, "1_000_000", ".5", '"' + "x" * 5000 + '"', "[0.1, 0.2, nan]",
    '"""', "{", "[1,", "07:30:00", "1e-320", "0x" + "f" * 500, "9" * 4400, '"🐑"', '"9..1 s"', "{a=" * 40,
]  # fmt: skip


def changed_toml(rng, data):
    """A TOML document with values, lines or tables changed."""
    lines = data.decode().split("\n")
    for _ in range(rng.choice([1, 1, 2, 3])):
        at = rng.randrange(len(lines))
        key, equals, value = lines[at].partition("=")
        how = rng.randrange(9)
        if how < 4 and equals:
            lines[at] = f"{key}= {rng.choice(TOML_VALUES)}"
        elif how == 4 and equals:
            lines[at] = f"{rng.choice(['', 'x.', 'a b '])}{key.strip()}{rng.choice(['', '_', '.x'])} ={value}"
        elif how == 5:
            del lines[at]
        elif how == 6:
            lines.insert(at, lines[rng.randrange(len(lines))])
        elif how == 7:
            lines.insert(
                at, rng.choice(["[x]", "[[x]]", "[speed]", "[a.b.c]", "]", '"', "'''", "a = ", "= 1", "# \x07"])
            )
        else:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
        lines = lines or [""]
    return rng.choice(["\n", "\n", "\n", "\r\n", "\r"]).join(lines).encode()


def changed_table(rng, data):
    """A CSV with cells, rows, columns or ends of lines changed."""
    rows = [line.split(",") for line in data.decode().split("\n")]
    for _ in range(rng.choice([1, 1, 2, 4])):
        at = rng.randrange(len(rows))
        cell = rng.randrange(len(rows[at])) if rows[at] else 0
        how = rng.randrange(9)
        if how < 3 and rows[at]:
            value = odd(rng, 2)
            rows[at][cell] = value.encode("utf-8", "ignore").decode() if isinstance(value, str) else str(value)
        elif how == 3 and rows[at]:
            rows[at][cell] = nudged(rng, rows[at][cell])
        elif how == 4:
            rows.insert(at, list(rows[rng.randrange(len(rows))]))
        elif how == 5:
            del rows[at]
        elif how == 6 and rows[at]:
            del rows[at][cell]
        elif how == 7 and rows[at]:
            rows[at].insert(cell, rng.choice(["", '"', '"a,b"', ";", "\t", " 1 ", "0x10", "1e3", "1_0", "١"]))
        elif how == 8:
            rng.shuffle(rows)
        rows = rows or [[]]
    end = rng.choice(["\n", "\n", "\n", "\r\n", "\r", "\n\n"])
    begin = rng.choice(["", "", "", "\ufeff"])
    return (begin + end.join(map(",".join, rows))).encode("utf-8", "surrogatepass")


# bytes -----------------------------------------------------------------------------------------


def changed_bytes(rng, data, most=4):
    """Bytes turned over, put in, left out or cut off."""
    data = bytearray(data)
    for _ in range(rng.randrange(1, most + 1)):
        at = rng.randrange(len(data) + 1)
        how = rng.randrange(7)
        if how < 3 and at < len(data):
            data[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, data[at] ^ 1 << rng.randrange(8)])
        elif how == 3:
            data[at:at] = rng.randbytes(rng.randrange(1, 9))
        elif how == 4:
            del data[at : at + rng.randrange(1, 40)]
        elif how == 5:
            data[at : at + 4] = struct.pack(rng.choice("<>") + "I", rng.choice([0, 1, 2**31, 2**32 - 1, len(data)]))
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def packed_again(rng, data, change):
    """What a zlib stream holds, changed and packed; or the stream itself changed."""
    try:
        return zlib.compress(change(rng, zlib.decompress(data)))
    except zlib.error:
        return changed_bytes(rng, data)


# archives of arrays ----------------------------------------------------------------------------


def changed_archive(rng, data):
    """A zip archive of arrays with one of them changed, gone or in the place of another, and right checksums."""
    with zipfile.ZipFile(io.BytesIO(data)) as old:
        members = {name: old.read(name) for name in old.namelist()}
    name, how = rng.choice(sorted(members)), rng.randrange(6)
    if how == 0:
        del members[name]
    elif how == 1:
        members[name] = members[rng.choice(sorted(members))]
    elif how == 2:
        members[name] = array_of(odd(rng))
    elif how == 3:
        members[name] = array_of(odd_array(rng))
    elif how == 4:
        members[name] = changed_head(rng, members[name])
    else:
        members[name] = changed_bytes(rng, members[name])
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
        for key, content in members.items():
            new.writestr(zipfile.ZipInfo(key), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def array_of(value):
    """A value as an array in a file, where it can be one."""
    packed = io.BytesIO()
    try:
        np.save(packed, np.array(value), allow_pickle=False)
    except (ValueError, OverflowError, UnicodeEncodeError):
        np.save(packed, np.zeros((2, 0, 3)))
    return packed.getvalue()


def changed_head(rng, data):
    """The file of an array with another shape, another type or a broken head."""
    size = int.from_bytes(data[8:10], "little")
    text = data[10 : 10 + size].decode()
    how = rng.randrange(3)
    if how == 0:
        shapes = "(0, 0, 2)", "(12, 3)", "(1000000000, 3, 2)", "(-1, 3, 2)", "(2**40,)", "()", "(12, 3, 2, 1)"
        text = f"{text[: text.index('(')]}{rng.choice(shapes)}{text[text.index(')') + 1 :]}"
    elif how == 1:
        text = text.replace("<f8", rng.choice(["<f4", "|O", "<c16", "|S9", "<M8[s]", "<i8", ">f8", "|V0", "<U99"]))
    else:
        text = changed_bytes(rng, text.encode()).decode(errors="replace")
    text = text.encode("latin-1", "replace")[:60_000]
    return data[:8] + len(text).to_bytes(2, "little") + text + data[10 + size :]


def odd_array(rng):
    """An array of another shape, type or of values that are no places."""
    shape = rng.choice([(), (0,), (12,), (12, 1), (12, 3, 2), (2, 0, 3), (1, 1, 1, 1)])
    kind = rng.choice([np.float64, np.float32, np.int8, np.uint64, np.bool_, np.complex128, "S3", "U2", "M8[s]"])
    values = np.ones(shape).astype(kind)
    if values.size and values.dtype.kind == "f":
        values.flat[rng.randrange(values.size)] = rng.choice([np.nan, np.inf, -1e30, 1e-30])
    return values
