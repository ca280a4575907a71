"""A Dask scheduler on this machine and its workers, each a process of its own."""

import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from processes import environment


@contextmanager
def dask_cluster(workers=2, cwd=None, begun=None, tls=None, **variables):
    """(address, worker processes), which have these environment variables; skips where dask is not installed.

    ``begun``, a list, gets all processes, the scheduler first; ``tls`` is (authority, certificate, key), files.
    """
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"{'tcp' if tls is None else 'tls'}://127.0.0.1:{free.getsockname()[1]}"
    names = ("ca-file", "cert", "key")
    keys = [f"--tls-{name}={file}" for name, file in zip(names, tls or [], strict=tls is not None)]
    begun = [] if begun is None else begun
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def dask(*arguments):
        words = [sys.executable, "-m", "dask", *arguments, *keys, "--no-dashboard"]
        begun.append(subprocess.Popen(words, cwd=cwd, env=environment(**variables), **quiet))
        return begun[-1]

    try:
        protocol, _, port = address.split(":")
        dask("scheduler", "--host", "127.0.0.1", "--protocol", protocol, "--port", port)
        found = [dask("worker", address, "--nthreads", "1", "--no-nanny") for _ in range(workers)]
        _wait_for(address, workers, tls)
        yield address, found
    finally:
        for process in begun:
            process.kill()
            process.wait()


def _wait_for(address, workers, tls):
    from distributed import Client, Security

    names = ("tls_ca_file", "tls_client_cert", "tls_client_key")
    files = dict(zip(names, map(str, tls or []), strict=tls is not None))
    end = time.monotonic() + 240
    while True:
        try:
            with Client(address, timeout="5s", set_as_default=False, security=Security(**files)) as client:
                client.wait_for_workers(workers, timeout=240)
            return
        except (OSError, TimeoutError):
            if time.monotonic() > end:
                raise
            time.sleep(0.2)
