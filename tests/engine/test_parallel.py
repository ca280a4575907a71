"""Threads: the same numbers on one and on many, and errors that come out where they belong."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from flockbrush.engine import parallel
from flockbrush.engine.maths import exp_
from flockbrush.engine.parallel import over_rows, set_threads, threads
from numba import njit


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    """Two threads, and all work worth them."""
    monkeypatch.setattr(parallel, "WORTH", 0)
    before = set_threads(2)
    yield
    set_threads(before)


@njit(nogil=True)
def warm(lo, hi, x, out):
    for i in range(lo, hi):
        out[i] = exp_(-x[i]) + i


def test_any_number_of_threads_gives_the_same_bits():
    x = np.random.default_rng(0).random(20_001)
    results = []
    for count in (1, 2, 3, 5):
        set_threads(count)
        out = np.empty_like(x)
        over_rows(warm, len(x), x, out)
        results.append(out.tobytes())
    assert len(set(results)) == 1


@pytest.mark.parametrize("count", [0, 1, 2048, 2049, 10_000])
def test_every_row_is_done_once(count):
    done = np.zeros(count, int)

    def add(lo, hi):
        done[lo:hi] += 1

    over_rows(add, count)
    assert (done == 1).all()


def test_a_small_herd_stays_in_its_thread():
    seen = set()
    over_rows(lambda lo, hi: seen.add(threading.get_ident()), parallel.SMALL)
    assert seen == {threading.get_ident()}


def test_quick_work_stays_in_its_thread(monkeypatch):
    monkeypatch.setattr(parallel, "WORTH", 10**12)
    seen, done = set(), np.zeros(50_000, int)

    def add(lo, hi):
        seen.add(threading.get_ident())
        done[lo:hi] += 1

    over_rows(add, len(done))
    assert seen == {threading.get_ident()}
    assert (done == 1).all()


def test_the_cost_of_a_kernel_is_measured_once(monkeypatch):
    monkeypatch.setattr(parallel, "WORTH", 10**12)
    calls, count = [], 5_000

    def note(lo, hi):
        calls.append((lo, hi))

    over_rows(note, count)
    over_rows(note, count)
    assert calls == [(0, parallel.PROBE), (parallel.PROBE, count), (0, count)]


@pytest.mark.parametrize("count", [1_000, 50_000])
def test_slow_work_is_shared(count):
    seen, both = set(), threading.Barrier(2, timeout=120)

    def meet(lo, hi):
        if lo and threading.get_ident() not in seen:
            seen.add(threading.get_ident())
            both.wait()  # nobody gets past here alone

    over_rows(meet, count)
    assert len(seen) == 2


def test_the_error_of_the_lowest_rows_comes_out_when_all_have_ended():
    running = []

    def fail(lo, hi):
        running.append(lo)
        try:
            if lo:  # the probe goes well
                raise ArithmeticError(f"rows {lo} to {hi}")
        finally:
            running.remove(lo)

    for _ in range(20):
        with pytest.raises(ArithmeticError, match="rows"):
            over_rows(fail, 100_000)
        assert running == []
    done = np.zeros(9000, int)
    over_rows(lambda lo, hi: done[lo:hi].__iadd__(1), 9000)  # and life goes on
    assert (done == 1).all()


def test_an_error_stops_what_has_not_begun():
    begun = []

    def fail(lo, hi):
        begun.append(lo)
        if lo:
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        over_rows(fail, 2048 * 500)
    assert len(begun) <= 1 + 2 * threads()


def test_a_kernel_may_call_another_without_a_deadlock():
    done = np.zeros((6, 5000), int)

    def inner(lo, hi, row):
        done[row, lo:hi] += 1

    def outer(lo, hi):
        for row in range(lo, hi):
            over_rows(inner, 5000, row)

    over_rows(outer, 6, chunk=1)
    finished = np.zeros(6000, int)

    def nested(lo, hi):
        over_rows(lambda a, b: finished[lo + a : lo + b].__iadd__(1), hi - lo, chunk=100)

    over_rows(nested, 6000, chunk=3000)
    assert (done == 1).all()
    assert (finished == 1).all()


def test_a_kernel_within_a_kernel_stays_in_its_thread():
    strayed = []

    def outer(lo, hi):
        here = threading.get_ident()
        if lo:  # behind the probe
            over_rows(lambda a, b: strayed.append(threading.get_ident() != here), 9000)

    over_rows(outer, 9000)
    assert strayed and not any(strayed)


def test_several_herds_at_once_do_not_wait_for_each_other_forever():
    x, outs = np.random.default_rng(0).random(30_000), np.empty((4, 30_000))

    def live(k):
        for _ in range(20):
            over_rows(warm, len(x), x, outs[k])

    herds = [threading.Thread(target=live, args=(k,)) for k in range(4)]
    for herd in herds:
        herd.start()
    for _ in range(10):
        set_threads(3)
        set_threads(2)
    for herd in herds:
        herd.join(timeout=120)
    assert not any(herd.is_alive() for herd in herds)
    assert (outs == outs[0]).all()


def test_cores_are_counted_where_affinity_is_unknown(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert parallel.cores() == os.cpu_count()


@pytest.mark.parametrize("wanted, count", [("3", 3), ("", None), ("many", None), ("0", None)])
def test_the_environment_may_say_how_many(monkeypatch, recwarn, wanted, count):
    monkeypatch.setenv("FLOCKBRUSH_THREADS", wanted)
    assert parallel._threads_at_start() == (count or parallel.cores())
    assert bool(recwarn.list) == (wanted in ("many", "0"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_makes_its_own_threads():
    program = """
import os, numpy as np
from flockbrush.engine import parallel
from flockbrush.engine.parallel import over_rows, set_threads
set_threads(2)
parallel.WORTH = 0
done = np.zeros(9000, int)
def add(lo, hi): done[lo:hi] += 1
over_rows(add, 9000)
child = os.fork()
if child == 0:
    over_rows(add, 9000)
    os._exit(int((done != 2).any()))
os._exit(os.waitpid(child, 0)[1])
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], cwd=Path(__file__).parents[2], timeout=240, check=False
    )
    assert done.returncode == 0
