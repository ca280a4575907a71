"""A Dask cluster: connecting, checking that its workers run the same code, and submitting work.

Workers may join at any time, so every piece of work says for which code it is (`work_as`).
"""

from __future__ import annotations

import logging
import platform
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.runs.builds import build_of_worker, differences
from flockbrush.runs.terminal import say

ADDRESS = re.compile(r"(?:(?:tcp|tls|ucx|wss?)://)?(?:\[[0-9a-fA-F:]+\]|[\w.-]+):\d{1,5}")
ANSWERS = "10s"  # a scheduler that says nothing for so long is not there
_ONE_WORLD = threading.Lock()  # esper has one world at a time; workers of a cluster may have several threads


class OtherCode(Exception):
    """This process runs other code than the one that hands out the work."""


class MixedCode(ProblemsError):
    """A worker runs other code: its results cannot be compared with the others."""


class ClusterGone(ProblemsError):
    """The cluster has no workers any more."""


def work_as(code: str, function: Callable, *arguments):
    """``function(*arguments)``, unless this process runs other code (`build_of_worker`); OtherCode."""
    own_code = build_of_worker().code
    if own_code != code:
        raise OtherCode(f"a worker on {platform.node()} has code {own_code[:12]}; here it is {code[:12]}")
    with _ONE_WORLD:
        return function(*arguments)


def let_go(executor: Executor):
    """Shut an executor down and end its processes without waiting for their work."""
    processes = list((getattr(executor, "_processes", None) or {}).values())  # of a pool on this machine
    try:
        executor.shutdown(wait=False, cancel_futures=True)
    except TypeError:  # executors of clusters have no ``cancel_futures``
        executor.shutdown(wait=False)
    for process in processes:
        process.terminate()


@dataclass(frozen=True)
class Tls:
    """The files of an encrypted connection to a scheduler, in PEM; what is None comes from the settings of Dask."""

    ca: Path | None = None  # certificate of who signed those of the cluster
    cert: Path | None = None  # of this program
    key: Path | None = None  # of this program


class Cluster(NamedTuple):
    """The connection to the workers of a cluster."""

    address: str
    width: int  # threads of workers
    open: Callable[[], Executor]
    share: Callable[[Any], Any]  # what many pieces of work need, sent to each worker once; stands for it in `submit`
    gone: tuple[type[BaseException], ...]  # what a piece of work ends in when nobody is left who could do it


@contextmanager
def cluster(address: str, tls: Tls | None = None) -> Iterator[Cluster]:
    """The workers of a Dask cluster.

    Parameters
    ----------
    address : str
        Of its scheduler.
    tls : Tls, optional
        Nothing is sent unless it is encrypted, and both sides show a certificate.

    Raises
    ------
    ProblemsError
        When dask is not installed, nobody answers, or its workers run other code.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise refused("--cluster", "dask is not installed: pip install 'flockbrush[cluster]'") from None
    if not ADDRESS.fullmatch(address):
        raise refused("--cluster", f"an address must be a host and a port, such as tcp://host:8786, got {address!r}")
    _silence("distributed", "tornado", "asyncio")  # what matters of it is said in our own words
    client = Client.__new__(Client)
    try:
        client.__init__(address, timeout=ANSWERS, set_as_default=False, security=_security(address, tls))  # type: ignore[misc]
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        client.status = "closed"  # or its destructor prints a traceback
        raise refused(address, f"no Dask scheduler answers at this address{_needs(address, tls)}: {error}") from None
    try:
        try:
            _same_code(client, address)
            workers = sum(client.nthreads().values())
        except (OSError, ValueError, CancelledError) as error:  # TimeoutError is an OSError
            raise refused(address, f"the scheduler cannot be reached any more, or has no workers: {error}") from None
        yield Cluster(
            address,
            workers,
            lambda: client.get_executor(pure=False),
            lambda data: client.scatter(data, broadcast=True),
            (CancelledError, KilledWorker),
        )
    finally:
        client.close(timeout=2)


def _security(address, tls):
    """The security settings for Dask; None leaves them to the address and the settings of Dask."""
    if tls is None or tls == Tls():
        return None
    from distributed.security import Security

    if not address.startswith(("tls://", "wss://")):
        raise refused("--cluster", f"with --tls-..., the address must begin with tls://, got {address!r}")
    for name, path in (("--tls-ca", tls.ca), ("--tls-cert", tls.cert), ("--tls-key", tls.key)):
        if path is not None and not Path(path).is_file():
            raise refused(path, f"there is no such file; {name} must be a PEM file")
    options = {"tls_ca_file": tls.ca, "tls_client_cert": tls.cert, "tls_client_key": tls.key}
    return Security(require_encryption=True, **{name: str(path) for name, path in options.items() if path is not None})


def _needs(address, tls):
    """A hint about missing certificates for an encrypted scheduler."""
    plain = tls in (None, Tls()) and address.startswith("tls://")
    return " without certificates (--tls-ca, --tls-cert and --tls-key, or the settings of Dask)" if plain else ""


def _silence(*libraries):
    """Keep libraries from writing log lines and tracebacks between ours."""
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] in libraries:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _same_code(client, address):
    """Workers of other code would mix results that cannot be compared; other libraries are named."""
    if not client.nthreads():
        client.wait_for_workers(1, timeout=30)
    libraries = set()
    for worker, build in sorted(client.run(_build, on_error="return").items()):
        if not isinstance(build, dict):
            raise refused(
                address, f"worker {worker} runs another version of Flockbrush, or none: {' '.join(str(build).split())}"
            )
        apart = differences(build, build_of_worker())
        if "code" in apart:
            raise refused(
                address, f"worker {worker} has {apart['code']}; install the same version there and restart the worker"
            )
        libraries |= {apart[name] for name in ("libraries",) if name in apart}
    for library in sorted(libraries):
        say(f"{address}: workers have {library}: their results may differ in the last bits")


def _build():
    return build_of_worker().as_json()
