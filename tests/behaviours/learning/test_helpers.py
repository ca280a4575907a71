"""Processes that help with learning: all tasks are done once, by this process too, and errors come back."""

import os

import pytest

from flockbrush.film.observations import CannotObserve
from flockbrush.learning.helpers import Helpers


def who_doubles(number):
    return 2 * number, os.getpid()


def who_multiplies(common, number):
    return common.value * number, os.getpid()


def refuses(number):
    raise CannotObserve("clip.mp4", f"no animals in {number}", {"animals": number})


@pytest.mark.parametrize(("jobs", "sent"), [(1, 0), (2, 0), (2, 99)])
def test_every_task_is_done_and_numbered(jobs, sent):
    with Helpers(jobs) as helpers:
        common = helpers.common(2)
        common.sent = sent  # so often that the process has got it, as far as this one knows
        found = dict(helpers.run(who_multiplies, [(common, k) for k in range(12)]))
    assert {k: double for k, (double, _) in found.items()} == {k: 2 * k for k in range(12)}
    by = {who for _, who in found.values()}
    assert os.getpid() in by and len(by) <= jobs


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_needed_later_is_worked_out_once(jobs):
    with Helpers(jobs) as helpers:
        later = [helpers.later(who_doubles, k) for k in range(3)]
        assert [one.result()[0] for one in later] == [0, 2, 4]


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_comes_back_with_what_was_seen(jobs):
    with Helpers(jobs) as helpers, pytest.raises(CannotObserve, match="clip.mp4: no animals in 3") as error:
        helpers.later(refuses, 3).result()
    assert error.value.seen == {"animals": 3}


def test_work_that_is_stopped_ends():
    class Asked(Exception):
        pass

    def stop():
        raise Asked

    with Helpers(2) as helpers, pytest.raises(Asked):
        list(helpers.run(who_doubles, [(1,), (2,)], stop))
