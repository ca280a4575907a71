"""Tables from outside: read whatever ends their lines, and refused with the line that is to blame."""

import numpy as np
import pytest
from flockbrush.behaviours.formation.marked_birds import read_marks
from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError

from flockbrush.film.tracks import read_tracks
from flockbrush.lifting.flight_table import read_flight

TRACKS = "frame,id,x,y\n" + "".join(f"{k},1,{10 + k},20\n" for k in range(5))
FLIGHT = "frame,id,x,y,z\n" + "".join(f"{k},1,{10 + k},20,3\n" for k in range(5))
MARKS = "bird,x_b,y_b\n" + "".join(f"{k},{k},{-abs(k - 3)}\n" for k in range(7))


@pytest.fixture
def table(tmp_path):
    def write(text):
        (tmp_path / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
        return tmp_path / "a.csv"

    return write


def rows(path, most_bytes=10_000_000, most_rows=1000):
    return list(read_table(path, most_bytes, most_rows))


def refusal(path, read=rows):
    with pytest.raises(ProblemsError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"{path}")


@pytest.mark.parametrize("end", ["\r", "\r\n", "\n"], ids=["old Mac", "Windows", "Unix"])
def test_lines_end_as_any_system_ends_them(table, end):
    assert np.array_equal(read_tracks(table(TRACKS)).px, read_tracks(table(TRACKS.replace("\n", end))).px)
    assert np.array_equal(read_flight(table(FLIGHT)).xyz, read_flight(table(FLIGHT.replace("\n", end))).xyz)
    assert np.array_equal(read_marks(table(MARKS))[0].x, read_marks(table(MARKS.replace("\n", end)))[0].x)


def test_rows_come_with_their_lines(table):
    assert rows(table("a,b\n\n ,\n1,2\n\n3\n")) == [(1, ["a", "b"]), (4, ["1", "2"]), (6, ["3"])]


def test_a_line_that_is_no_text_is_named(table):
    assert refusal(table(b"a,b\n1,2\n1,\xff\n")) == ":3: is not UTF-8 text"
    assert refusal(table(b"a,b\n1,2\n1,\0\n")) == ":3: is not a table: it contains zero bytes"


def test_a_table_without_end_is_refused(table):
    assert refusal(table("a" * (limits.TABLE_LINE + 1))).startswith(":1: the line is longer than 100,000 characters")
    assert "has more than 1,000 rows" in refusal(table("1\n" * 2000))
    assert (
        refusal(table("1\n" * 10), lambda path: rows(path, 10))
        == ": is larger than 10 bytes, the maximum for this kind of file"
    )


def test_a_quote_that_never_closes_is_refused(table):
    assert "is not a table: field larger than field limit" in refusal(table("a,b\n" + '"' + "1,2\n" * 100_000))


def test_places_that_are_out_of_all_bounds_are_named(table):
    for line, said in (("1,1,9,9,9", "bird 1 is in frame 1 twice, here and in line"), ("7.4,1,0,0,0", "got 7.4")):
        assert said in refusal(table(f"{FLIGHT}{line}\n"), read_flight)
    told = refusal(table(FLIGHT + "5,1,1e300,0,0\n"), read_flight)
    assert told == ":7: x: must be a finite number, at most 1e+12, got '1e300'"
    assert "frames 0 to 999000 with 11 birds are too many; split it into parts" in refusal(
        table(FLIGHT + "".join(f"999000,{k},0,0,0\n" for k in range(2, 12))), read_flight
    )


def test_more_birds_than_any_formation_has_are_refused(table):
    many = "bird,x_b,y_b\n" + "".join(f"{k},{k},0\n" for k in range(limits.FORMATION_BIRDS + 1))
    assert "frame '0' has 2,001 birds; there can be 2,000" in refusal(table(many), read_marks)
