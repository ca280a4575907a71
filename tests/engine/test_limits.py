"""The one table of limits, and the page that shows it."""

from pathlib import Path

from flockbrush.engine import limits


def test_the_page_shows_the_table():
    page = Path(__file__).parents[2] / "docs" / "limits.md"
    assert page.read_text(encoding="utf-8") == limits.page(), "python -m flockbrush.engine.limits > docs/limits.md"


def test_every_limit_says_of_what_it_is_one():
    assert len(limits.table()) > 30
    assert all(limit > 0 and limit.of for limit in limits.table().values())


def test_limits_are_told_with_their_units():
    assert limits.LEVEL_FILE_BYTES.text == "64 MiB"
    assert limits.ANIMALS.text == "1,000,000 animals"
