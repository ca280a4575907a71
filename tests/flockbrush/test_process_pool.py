"""Processes that begin do not hear Ctrl-C, from their first moment on; the one that begins them does."""

import signal

from flockbrush.runs.process_pool import ProcessPool

_first = []


def _look():
    _first.append(signal.getsignal(signal.SIGINT))


def _seen():
    return _first[0] is signal.SIG_IGN


def test_a_process_ignores_ctrl_c_before_its_initializer():
    before = signal.getsignal(signal.SIGINT)
    with ProcessPool(1, _look) as pool:
        seen = pool.submit(_seen)
        assert signal.getsignal(signal.SIGINT) is before
        assert seen.result()
