"""Where compiled kernels are kept: beside the sources or in the user's cache; else in a temporary folder, or nowhere.

Read before numba is imported, so it must not import it: numba asks for its folder when it meets the first kernel, and
raises an error where it may write nowhere, as in containers whose package and home are read-only.
"""

from __future__ import annotations

import gc
import hashlib
import os
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

from flockbrush.engine import locks
from flockbrush.engine.files import cache_folder, private_folder
from flockbrush.engine.shipped_kernels import use_shipped_kernels

BESIDE = Path(__file__).with_name("__pycache__")  # what is true of this folder is true of those of other rooms
LOCK = "flockbrush.lock"  # in each folder of kernels
WAIT = 5.0  # s; storing a kernel takes milliseconds
LAST = "set NUMBA_CACHE_DIR to a permanent folder that is writable"


def prepare(house, version) -> str:
    """Choose numba's cache folder; a sentence for the person where it is not a usual one, else "".

    Parameters
    ----------
    house : path
        The folder with the package's sources.
    version : str

    Notes
    -----
    Kernels of a package that pip has installed are kept in the user's cache: in `__pycache__` they would outlive ``pip
    uninstall``.  The folder's name holds a hash of the installed files, since numba takes a kernel for current when its
    own file is, even when what it calls came with another version.
    """
    configured, own = os.environ.get("NUMBA_CACHE_DIR"), cache_folder().with_name("numba")
    if configured and can_write(configured):
        return ""
    installed = _place_of_installed(Path(house), version)
    if not configured and installed is not None and can_write(installed):
        use_shipped_kernels(house, installed)
        _use(installed)
        return ""
    if can_write(BESIDE) or can_write(own):
        return ""  # numba finds it
    tried = " and ".join(str(place) for place in (configured, BESIDE.parent, installed or own) if place)
    private = private_folder()
    place = private and private / "kernels"
    if place is None or not can_write(place):  # numba unpickles these files: only we may write there
        _keep_nothing()
        return f"compiled kernels cannot be stored, every start compiles them again: not writable: {tried}; {LAST}"
    use_shipped_kernels(house, place)
    _use(place)
    return f"compiled kernels are stored in {place}: not writable: {tried}; {LAST}"


def forget_stale_kernels():
    """Have numba compile again where a stored kernel names a class that is gone, which it takes for an error.

    It unpickles the types of all arguments before it compares the time of the sources: without this a checkout whose
    classes were renamed would have to be cleared by hand.
    """
    from numba.core.caching import IndexDataCacheFile

    load = IndexDataCacheFile._load_index
    if getattr(load, "forgets", False):
        return

    def load_index(self):
        try:
            return load(self)
        except (AttributeError, ImportError):
            return {}

    load_index.forgets = True  # type: ignore[attr-defined]
    IndexDataCacheFile._load_index = load_index


def save_one_at_a_time():
    """Have processes that share a cache take turns when they store kernels.

    Numba numbers the files of a kernel: two processes that store it for different types would give both one number, and
    a third one would load code for the wrong types.
    """
    from numba.core.caching import IndexDataCacheFile

    save = IndexDataCacheFile.save
    if getattr(save, "takes_turns", False):
        return

    def save_alone(self, key, data):
        with _turn(self._cache_path):
            save(self, key, data)

    save_alone.takes_turns = True  # type: ignore[attr-defined]
    IndexDataCacheFile.save = save_alone


def compile_without_collecting():
    """Have Python look for no garbage while a kernel is compiled: that took a seventh of the time."""
    from numba.core import event

    class Compiling(event.Listener):
        depth, enabled = 0, True  # a kernel's callees are compiled within it

        def on_start(self, _):
            if self.depth == 0:
                self.enabled = gc.isenabled()
                gc.disable()
            self.depth += 1

        def on_end(self, _):
            self.depth -= 1
            if self.depth == 0 and self.enabled:
                gc.enable()

    event.register("numba:compile", Compiling())


@contextmanager
def _turn(place):
    """Wait for the lock of a folder, but not for ever, and go on without where files cannot be locked."""
    try:
        file = open(Path(place) / LOCK, "ab")
    except OSError:
        yield
        return
    with file:
        deadline = time.monotonic() + WAIT
        while locks.take(file) is False and time.monotonic() < deadline:
            time.sleep(0.002)
        yield


def folder() -> Path | None:
    """The folder that kernels of this room are kept in."""
    configured = os.environ.get("NUMBA_CACHE_DIR")
    places = [*([Path(configured)] if configured else []), BESIDE, cache_folder().with_name("numba")]
    return next((place for place in places if can_write(place)), None)


def can_write(folder) -> bool:
    """Whether files can be made in a folder, which is made for that."""
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _place_of_installed(house, version):
    """The folder for kernels of a package that pip installed; None for a checkout."""
    record = house / f"flockbrush-{version}.dist-info" / "RECORD"
    try:
        key = hashlib.sha256(str(house).encode() + record.read_bytes()).hexdigest()[:12]
        return cache_folder() / f"kernels-{version}-{key}"
    except OSError:
        return None


def _use(place):
    os.environ["NUMBA_CACHE_DIR"] = str(place)
    if "numba" in sys.modules:
        sys.modules["numba"].config.reload_config()


def _keep_nothing():
    """Have numba compile without keeping anything."""
    from numba.core.dispatcher import Dispatcher

    Dispatcher.enable_caching = lambda self: None
