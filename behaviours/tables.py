"""Tables from outside: rows of a CSV one after the other, with their lines, and refused in plain words."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator
from pathlib import Path

from flockbrush.behaviours.tomlfile import check_plain
from flockbrush.engine import limits
from flockbrush.engine.problems import Problem, ProblemsError

SEPARATORS = ",", ";", "\t"


def read_table(path, most_bytes: int, most_rows: int) -> Iterator[tuple[int, list[str]]]:
    """(line, cells) of every row that is not blank, the header first.

    Cells are separated by commas, semicolons or tabs, whichever the header has most of.  Lines may end as Unix, Windows
    or old Macs end them.

    Parameters
    ----------
    most_bytes, most_rows : int
        A larger file is refused before it is read, a longer one when it turns out to be.

    Raises
    ------
    ProblemsError
        When there is no such file, it is too large, it is no table in UTF-8, or a row is longer than the header.
    """
    name, count, wide = str(path), 0, 0
    check_plain(path, most_bytes)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            lines, before = _lines(file, name), []
            for line in lines:  # up to the header
                before.append(line)
                if line.strip():
                    break
            mark = max(SEPARATORS, key="".join(before[-1:]).count)
            reader = csv.reader(itertools.chain(before, lines), delimiter=mark)
            for row in reader:
                if not any(map(str.strip, row)):
                    continue
                wide = wide or len(row)
                if any(map(str.strip, row[wide:])):
                    message = f"has {len(row)} cells, the header has {wide}; decimals need a point"
                    raise ProblemsError([Problem(name, reader.line_num, None, message)])
                yield reader.line_num, row
                count += 1
                if count > most_rows:
                    message = f"has more than {most_rows:,} rows; cut it into parts"
                    raise ProblemsError([Problem(name, reader.line_num, None, message)])
        if not count:
            raise ProblemsError([Problem(name, None, None, "is empty")])
    except OSError as error:
        raise ProblemsError([Problem(name, None, None, f"cannot be read: {error.strerror or error}")]) from None
    except UnicodeDecodeError:
        raise ProblemsError([Problem(name, _bad_line(path), None, "is not UTF-8 text")]) from None
    except csv.Error as error:
        raise ProblemsError([Problem(name, reader.line_num, None, f"is not a table: {error}")]) from None


def _lines(file, name):
    """The lines of a text file, none longer than `limits.TABLE_LINE`."""
    number = 0
    while line := file.readline(limits.TABLE_LINE + 1):
        number += 1
        if len(line) > limits.TABLE_LINE:
            message = f"the line is longer than {limits.TABLE_LINE.text}; this is not a table"
            raise ProblemsError([Problem(name, number, None, message)])
        if "\0" in line:
            raise ProblemsError([Problem(name, number, None, "is not a table: it contains zero bytes")])
        yield line


def _bad_line(path):
    """The line with the first byte that is not UTF-8."""
    data = Path(path).read_bytes()
    try:
        data.decode()
    except UnicodeDecodeError as error:
        return data.count(b"\n", 0, error.start) + 1
    return None
