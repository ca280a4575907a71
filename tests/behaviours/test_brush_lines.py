"""Every value of a TOML file knows its line, and what is no TOML is refused with one."""

import time

import pytest
from flockbrush.behaviours.tomlfile import key_text, parse_toml, read_bytes
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError

MEADOW = '''# line 1
title = "a # b"  # 2
"two words" = 1
dotted.key.deep = 2  # 4
text = """
[not.a.table]
x = 1 \\""" "quoted" """""  # ends on 7
after = 8

[sheep]  # 10
weight = { avoidance = 1, 'cohe sion'.x = 2 }
range = [
  1,  # 13
  [2, 3],

  { deep = """
  """ },  # 16
]
when = 2026-11-21 10:00:00  # 19
[ sheep . "lamb" ]
age = 21
[[dog]]
name = \'\'\'[[dog]]
age = 1\'\'\'
[[dog]]  # 25
name = \'Rex\'  # 26
[dog.bone]
size = 28
[[dog.bone.flea]]
legs = 6  # 30
'''


@pytest.fixture(scope="module")
def meadow():
    return parse_toml(MEADOW.encode(), "meadow.toml")


@pytest.mark.parametrize(
    ("key", "line"),
    [
        (("title",), 2),
        (("two words",), 3),
        (("dotted",), 4),
        (("dotted", "key", "deep"), 4),
        (("text",), 5),
        (("after",), 8),
        (("sheep",), 10),
        (("sheep", "weight"), 11),
        (("sheep", "weight", "cohe sion", "x"), 11),
        (("sheep", "range"), 12),
        (("sheep", "range", 0), 13),
        (("sheep", "range", 1, 1), 14),
        (("sheep", "range", 2, "deep"), 16),
        (("sheep", "when"), 19),
        (("sheep", "lamb"), 20),
        (("sheep", "lamb", "age"), 21),
        (("dog",), 22),
        (("dog", 0, "name"), 23),
        (("dog", 1), 25),
        (("dog", 1, "name"), 26),
        (("dog", 1, "bone"), 27),
        (("dog", 1, "bone", "size"), 28),
        (("dog", 1, "bone", "flea", 0, "legs"), 30),
    ],
)
def test_every_kind_of_key_has_its_line(meadow, key, line):
    assert meadow.lines[key] == line


def test_no_key_is_missed_and_none_is_invented(meadow):
    def keys(value, path=()):
        inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for part, item in inner:
            yield (*path, part)
            yield from keys(item, (*path, part))

    assert set(keys(meadow.data)) == set(meadow.lines)


def test_a_key_that_is_missing_has_the_line_of_its_table(meadow):
    assert meadow.line(("dog", 1, "age")) == 25
    assert meadow.line(("cat",)) == 1


def test_keys_are_spelled_as_people_write_them():
    assert key_text(("speed", "by_density", 2, 0)) == "speed.by_density[2][0]"
    assert key_text(("two words", "\x1b[31m")) == "'two words'.'\\x1b[31m'"


def test_lines_count_the_same_with_the_line_ends_of_windows_and_a_byte_order_mark():
    data = b"\xef\xbb\xbf" + MEADOW.replace("\n", "\r\n").encode()
    toml = parse_toml(data, "meadow.toml")
    assert toml.lines == parse_toml(MEADOW.encode(), "").lines


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"a = 1\nb = \n", "f:2: is not TOML at column 5: Invalid value"),
        (b"a = 1\na = 2\n", "f:2: is not TOML at column 6: Cannot overwrite a value"),
        (b"a = 1\nb = [1,\n", "f:2: is not TOML at the end of the file: Invalid value"),
        (b"a = 1\nb = 'caf\xe9'\n", "f:2: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        ("a = 1".encode("utf-16"), "f:1: is UTF-16; save it as UTF-8"),
        (b"a = 2026-02-31", "f:1: is not TOML"),
        (b"a = " + b"9" * 5000, "f: a value is out of bounds: a number has thousands of digits"),
        (b"\n\na = " + b"[" * 100, "f:3: is nested more than 32 deep"),
        (b"\n" + b"a." * 100 + b"a = 1", "f:2: is nested more than 32 deep"),
        (b"[" + b"a." * 100 + b"a]", "f:1: is nested more than 32 deep"),
        (b"a = " + b"{a = " * 100 + b"1" + b"}" * 100, "f:1: is nested more than 32 deep"),
        (b"[" + b"a." * 20 + b"a]\nb = " + b"{b = " * 20 + b"1" + b"}" * 20, "f:2: is nested more than 32 deep"),
        (b" " * (limits.TOML_BYTES + 1), "f: is larger than 1,048,576 bytes"),
    ],
)
def test_what_is_not_toml_is_refused_with_its_line(data, said):
    with pytest.raises(ProblemsError) as error:
        parse_toml(data, "f")
    assert str(error.value).startswith(said), str(error.value)
    assert len(error.value.problems) == 1


@pytest.mark.parametrize(
    "piece", ["a" + ".a" * 30 + ".b{i} = 1\n", "[a.b.k{i}]\n", "[[a.b]]\n", "k{i} = [[],[{{}}]]\n"]
)
def test_the_worst_file_allowed_is_read_in_seconds(piece):
    """Without a limit on depth the first kind takes hours."""
    pieces = [piece.format(i=i) for i in range(limits.TOML_BYTES // 4 // len(piece))]
    start = time.perf_counter()
    try:
        parse_toml("".join(pieces).encode(), "f")
    except ProblemsError:
        pass
    assert time.perf_counter() - start < 10


def test_files_that_are_none_are_refused(tmp_path):
    large = tmp_path / "large"
    large.write_bytes(bytes(limits.TOML_BYTES + 1))
    for path, said in [
        (tmp_path, "is a folder, not a file"),
        (tmp_path / "none", "there is no such file"),
        (large, "is larger than 1,048,576 bytes"),
        ("nul\0", "no such file"),
        ("/dev/zero", "is not a regular file"),
    ]:
        with pytest.raises(ProblemsError) as error:
            read_bytes(path)
        assert said in str(error.value) or "null" in str(error.value)
