"""What herds do does not change unnoticed: the state of every shipped level after ten seconds, bit for bit."""

import json

import pytest
from golden_hashes import FILE, hash_of

from flockbrush.runs.run import shipped_levels

GOLDEN = json.loads(FILE.read_text())


def test_every_shipped_level_has_a_golden_hash():
    assert sorted(GOLDEN) == sorted(shipped_levels())


@pytest.mark.parametrize("level", shipped_levels())
def test_a_level_is_after_ten_seconds_what_it_was(level):
    """After a change that is meant: ``python tests/golden_hashes.py``, and a CHANGELOG line marked **herd**."""
    assert hash_of(level) == GOLDEN[level]
