"""Which kernels a piece of work calls, found before anything is compiled; and compiling one for such a call.

Python itself runs the work once, as under ``NUMBA_DISABLE_JIT=1``: a small herd takes seconds, where the compiler takes
most of a minute.  What it calls, and with what types, is then compiled by several processes.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import sys
import threading
from dataclasses import dataclass


@dataclass(frozen=True)
class KernelCall:
    """A way in which a kernel is called."""

    module: str
    name: str  # of the module's attribute
    types: tuple  # numba's types of the arguments
    weight: int  # bytes of Python's code in all that the call ran: more take longer to compile

    @property
    def key(self):
        """What tells this from other calls."""
        return key_of(self.module, self.name, self.types)

    def compile(self):
        """Compile the kernel for this call, or load it from numba's cache."""
        getattr(importlib.import_module(self.module), self.name).compile(self.types)


def key_of(module, name, types):
    """What tells the call of a kernel from others, the same in every process."""
    return f"{module}.{name}{types}"


def watch(tell):
    """From now on have ``numba.njit`` leave functions to Python, and tell of each new way they are called.

    To be called before a file with kernels is imported, where ``NUMBA_DISABLE_JIT`` is set.

    Parameters
    ----------
    tell : callable
        Is given a `KernelCall` after the call came to its end, and only for calls from outside of kernels.
    """
    import numba

    reported, inside = set(), threading.local()

    def njit(*functions, **options):
        if functions and callable(functions[0]):
            return watched(functions[0])
        return watched

    def watched(function):
        parameters = inspect.signature(function)

        @functools.wraps(function)
        def call(*args, **named):
            running = getattr(inside, "running", None)
            if running is not None:
                running.add(function.__code__)
                return function(*args, **named)
            inside.running = {function.__code__}
            try:
                types = _types(parameters, args, named)  # before the call may change what it is given
                return function(*args, **named)
            finally:
                ran, inside.running = inside.running, None
                name = _name_of(call)
                if name and types is not None and (name, types) not in reported:
                    reported.add((name, types))
                    tell(KernelCall(*name, types, sum(len(code.co_code) for code in ran)))

        return call

    numba.njit = njit


def _types(parameters, args, named):
    """Numba's types for the arguments of a call; None where it has none."""
    from numba import types
    from numba.core.errors import NumbaError
    from numba.core.typing.typeof import Purpose, typeof

    bound = parameters.bind(*args, **named).arguments
    try:
        return tuple(
            typeof(bound[name], Purpose.argument) if name in bound else types.Omitted(parameter.default)
            for name, parameter in parameters.parameters.items()
        )
    except (NumbaError, TypeError, ValueError):
        return None


_names: dict[int, tuple[str, str]] = {}


def _name_of(function):
    """(module, attribute) under which a function of ours is found; None when it has no place of its own."""
    if id(function) not in _names:
        for module in _our_modules():
            for name, value in vars(module).items():
                if callable(value):
                    _names.setdefault(id(value), (module.__name__, name))
    return _names.get(id(function))


def _our_modules():
    return [module for name, module in list(sys.modules.items()) if name.startswith("flockbrush") and module]


def stored_kernels():
    """How many kernels that are imported by now numba's cache has for this processor."""
    from numba.core.dispatcher import Dispatcher

    kernels = {id(value): value for module in _our_modules() for value in vars(module).values()}
    return sum(_is_stored(kernel) for kernel in kernels.values() if isinstance(kernel, Dispatcher))


def _is_stored(kernel):
    index = getattr(kernel._cache, "_cache_file", None)  # numba does not tell it otherwise
    machine = kernel.targetctx.codegen().magic_tuple()
    return index is not None and any(key[1] == machine for key in index._load_index())


def is_cached(kernel):
    """Whether numba stores what it compiles of a kernel."""
    return kernel._cache.cache_path is not None
