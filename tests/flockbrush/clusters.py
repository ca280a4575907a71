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
    keys = (
        []
        if tls is None
        else [f"--tls-{name}={file}" for name, file in zip(("ca-file", "cert", "key"), tls, strict=True)]
    )
    begun = [] if begun is None else begun

    def dask(*arguments):
        begun.append(
            subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments, *keys, "--no-dashboard"],
                cwd=cwd,
                env=environment(**variables),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        return begun[-1]

    try:
        dask(
            "scheduler", "--host", "127.0.0.1", "--protocol", address.split(":")[0], "--port", address.rsplit(":", 1)[1]
        )
        found = [dask("worker", address, "--nthreads", "1", "--no-nanny") for _ in range(workers)]
        _wait_for(address, workers, tls)
        yield address, found
    finally:
        for process in begun:
            process.kill()
            process.wait()


def _wait_for(address, workers, tls):
    from distributed import Client, Security

    files = (
        {}
        if tls is None
        else dict(zip(("tls_ca_file", "tls_client_cert", "tls_client_key"), map(str, tls), strict=True))
    )

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
