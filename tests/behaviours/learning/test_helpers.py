"""Processes that help with learning: all tasks are done once, by this process too, and errors come back."""

import os
import time
from concurrent.futures import Future

import pytest
from flockbrush.engine.problems import ProblemsError

from flockbrush.film.observations import CannotObserve
from flockbrush.learning.helpers import Helpers


def who_doubles(number):
    return 2 * number, os.getpid()


def who_multiplies(common, number):
    return common.value * number, os.getpid()


def refuses(number):
    raise CannotObserve("clip.mp4", f"no animals in {number}", {"animals": number})


def ends_helpers(parent):
    if os.getpid() != parent:
        os._exit(1)


@pytest.mark.parametrize(("jobs", "sent"), [(1, 0), (2, 0), (2, 99), (4, 99)])
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


def test_nobody_waits_for_what_is_not_wanted_any_more():
    with Helpers(2) as helpers:
        begun = helpers.later(time.sleep, 60.0)
        while not begun.future.running():
            time.sleep(0.05)
        (process,) = helpers._pool._processes.values()
    process.join(20.0)
    assert not process.is_alive()


def test_work_that_is_stopped_ends():
    class Asked(Exception):
        pass

    def stop():
        raise Asked

    with Helpers(2) as helpers, pytest.raises(Asked):
        list(helpers.run(who_doubles, [(1,), (2,)], stop))


def test_a_process_that_is_killed_is_told():
    with Helpers(2) as helpers, pytest.raises(ProblemsError, match="is not running any more"):
        list(helpers.run(ends_helpers, 4 * [(os.getpid(),)]))


def test_work_is_finished_here_when_no_helper_takes_more(monkeypatch):
    """The pool ends after its first task: the second one, which nobody has begun, is not lost."""
    sent = []

    def once(function, args):
        sent.append(args)
        if len(sent) > 1:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future = Future()
        future.set_result(function(*args))
        return future

    with Helpers(2) as helpers:
        monkeypatch.setattr(helpers, "_submit", once)
        found = dict(helpers.run(who_doubles, [(k,) for k in range(6)]))
    assert len(sent) == 2 and {k: double for k, (double, _) in found.items()} == {k: 2 * k for k in range(6)}
