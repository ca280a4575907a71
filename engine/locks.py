"""Lock files: which running program has something to itself, told apart from what a killed one left.

A lock is one of the operating system on an open file: it is gone when the program ends, however it ends.
"""

from __future__ import annotations

import contextlib
import datetime
import errno
import json
import os
import socket
import stat
import sys
import time
import warnings
from pathlib import Path

MARKER = "flockbrush lock 1"  # first line of every lock file of ours
RETRIES = (0.0, 0.05, 0.2)  # s; a lock may be held for a moment by a program that looks whether it is free
FAR = 1 << 30  # the locked byte; on Windows locked bytes cannot be read
_UNSUPPORTED = {getattr(errno, name, None) for name in ("ENOLCK", "ENOTSUP", "EOPNOTSUPP", "ENOSYS", "EINVAL")}


class InUse(OSError):
    """Another program has this; ``strerror`` says which."""


class Advice(UserWarning):
    """Something a person should know about the machine, in one sentence."""


class Lock:
    """A lock file that belongs to this process until it is released or the process ends.

    Parameters
    ----------
    path : path
        Made if it is not there; its folder must exist.

    Raises
    ------
    InUse
        When another holder has it.
    OSError
        When the file cannot be made.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.file = _locked_file(self.path)
        try:
            self.file.truncate(0)
            self.file.write(f"{MARKER}\n{json.dumps(_ourselves())}\n".encode())
            self.file.flush()
        except BaseException:  # such as a disk that is full
            self.remove()
            raise

    def remove(self):
        """Give the lock back and take the file away, unless somebody has it already."""
        if self.file.closed:
            return
        if os.name == "posix":
            with contextlib.suppress(OSError):
                self.path.unlink()
            self.file.close()
        else:  # a file that is open cannot be removed: ours not yet, and not if another program has opened it since
            self.file.close()
            with contextlib.suppress(OSError):
                self.path.unlink()

    def release(self):
        """Give the lock back; the file stays."""
        self.file.close()


def _locked_file(path):
    """The open lock file, held by us and still under its name."""
    for wait in RETRIES:
        time.sleep(wait)
        file = open(path, "a+b")
        try:
            held = take(file)
            if held is None:
                warnings.warn(
                    Advice(
                        f"{path.parent}: this file system has no locks; do not let two programs write the same file"
                    ),
                    stacklevel=4,
                )
            if held is not False and _is_still(file, path):
                return file
        except BaseException:
            file.close()
            raise
        file.close()
    raise InUse(errno.EBUSY, holder_of(path), str(path))


def _is_still(file, path):
    """Whether the file was still there after opening and locking it."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), os.stat(path))
    except FileNotFoundError:
        return False


def take(file):
    """Lock an open file: True, False when another has it, None when this file system has no locks."""
    try:
        _lock_byte(file)
    except OSError as error:
        return None if error.errno in _UNSUPPORTED else False
    return True


def _lock_byte(file):
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        os.lseek(file.fileno(), FAR, os.SEEK_SET)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _ourselves():
    """What a lock file says about its holder."""
    program = " ".join([Path(sys.argv[0]).name if sys.argv else "python", *sys.argv[1:]])
    now = datetime.datetime.now().astimezone()
    return {
        "process": os.getpid(),
        "host": socket.gethostname(),
        "program": program[:200],
        "since": now.isoformat(" ", "seconds"),
    }


def holder_of(lock):
    """Who holds a lock file, in a clause."""
    try:
        with open(lock, "rb") as file:
            holder = json.loads(file.read(10_000).decode().split("\n")[1])
        process, host, program, since = (holder[name] for name in ("process", "host", "program", "since"))
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return "another program is writing it"
    if (process, host) == (os.getpid(), socket.gethostname()):
        return "this program is already writing it"
    return f"process {process} on {host} ({program}) has been writing it since {since}"


def is_marked(lock) -> bool:
    """Whether a lock file is one that we made."""
    try:
        if not stat.S_ISREG(os.lstat(lock).st_mode):
            return False
        with open(lock, "rb") as file:
            return file.read(len(MARKER) + 1) == MARKER.encode() + b"\n"
    except OSError:
        return False


def is_held(lock) -> bool:
    """Whether a process holds a lock file, as far as this file system can tell."""
    try:
        with open(lock, "r+b") as file:
            return take(file) is False
    except FileNotFoundError:
        return False
    except OSError:
        return True


def abandoned(path) -> Lock | None:
    """The lock of a file of ours that is not locked, now held; None if there is no such file."""
    if not is_marked(path):
        return None
    try:
        file = open(path, "r+b")
    except OSError:
        return None
    if take(file) and _is_still(file, path):
        lock = Lock.__new__(Lock)
        lock.path, lock.file = Path(path), file
        return lock
    file.close()
    return None
