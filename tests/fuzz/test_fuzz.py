"""Fifteen hundred changed files, always the same, are read to an end or to a sentence; more by hand: `fuzzer.py`."""

import json
import random

import pytest
from fuzzer import cases_of, fuzz, kinds, run_case

from flockbrush.studies import sweep

CASES, SEED = 1500, 12


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@pytest.mark.parametrize("kind", sorted(kinds("")))
def test_changed_files_end_in_a_result_or_a_sentence(folder, kind):
    share = cases_of(kinds(folder), CASES)[kind]
    found = list(fuzz(folder, share, SEED, kind))
    again = [f"python tests/fuzz/fuzzer.py --kind {kind} --seed {SEED} --case {bad.number}" for bad in found]
    assert not found, "\n".join([*again, found[0].what])


def test_there_are_as_many_cases_as_asked_for():
    assert abs(sum(cases_of(kinds(""), CASES).values()) - CASES) < 10


def test_what_is_not_changed_is_read_without_a_complaint(folder):
    for name, kind in kinds(folder / "sound").items():
        if name in ("flights", "tilesets"):  # one of theirs is empty; all of theirs are needed at once
            continue
        for data in kind.sound:
            kind.folder.mkdir(parents=True, exist_ok=True)
            path = kind.folder / f"sound{kind.ending}"
            path.write_bytes(data)
            kind.read(path)


def test_a_fault_is_found(folder, monkeypatch):
    """A reader that trusts its file ends in something that is no sentence."""
    monkeypatch.setattr(sweep, "_row", json.loads)
    journals = kinds(folder / "broken")["journals"]
    journals.folder.mkdir(parents=True)
    assert any(run_case(journals, "journals", SEED, number) for number in range(60))


def test_a_case_is_the_same_every_time(folder):
    one, other = (list(_files(folder / name)) for name in ("one", "other"))
    assert one == other


def _files(folder):
    for name, kind in kinds(folder).items():
        kind.folder.mkdir(parents=True, exist_ok=True)
        if name not in ("recordings", "levels", "tilesets", "films", "fieldfiles"):  # theirs hold dates and paths
            yield kind.case(random.Random(f"3 {name} 7"))
