"""Arguments of what people call from Python: checked by their annotations, and told by their names."""

from __future__ import annotations

import functools
import inspect
import math
import os
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
from operator import index

import numpy as np

P = typing.ParamSpec("P")
R = typing.TypeVar("R")
_MANY = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
_WORDS = {
    int: "a whole number",
    float: "a number",
    str: "a string",
    os.PathLike: "a path",
    bytes: "bytes",
    np.ndarray: "an array",
}


def checked(**meant: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Have the arguments of a function checked by its annotations, before anything is done.

    A number is finite, and no bool is one.  What has no annotation, or one of another kind than a class, a union or a
    sequence of classes, is not checked.

    Parameters
    ----------
    **meant : str
        What the argument of this name must be, where the words for its annotation say too little.

    Raises
    ------
    TypeError, ValueError
        From the function: when an argument is of another kind, or a number that is not finite.

    Examples
    --------
    >>> @checked(seed="a whole number, such as 7")
    ... def begin(seed: int, width: float = 1.0): ...
    >>> begin("7")
    Traceback (most recent call last):
    TypeError: seed must be a whole number, such as 7, got '7'
    >>> begin(7, width=math.nan)
    Traceback (most recent call last):
    ValueError: width must be a finite number, got nan
    """

    def of(function):
        signature = inspect.signature(function)
        hints = functools.cache(lambda: typing.get_type_hints(function))  # asked when all classes are known

        @functools.wraps(function)
        def called(*args, **kwargs):
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:
                return function(*args, **kwargs)  # Python's own words for an argument too many, or one that lacks
            for name, value in given.items():
                if name in hints() and signature.parameters[name].kind not in _MANY:
                    _check(name, value, hints()[name], meant.get(name))
            return function(*args, **kwargs)

        return called

    return of


def whole(name: str, value) -> int:
    """A whole number that somebody gave under this name; TypeError for anything else."""
    _check(name, value, int)
    return index(value)


def _check(name, value, hint, meant=None):
    if not _fits(value, hint):
        raise TypeError(f"{name} must be {meant or _words(hint)}, got {_shown(value)}")
    is_whole = isinstance(value, Integral) and int in (hint, *typing.get_args(hint))
    if isinstance(value, Real) and not is_whole and not _is_finite(value):
        raise ValueError(f"{name} must be a finite number, got {_shown(value)}")


def _is_finite(value) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def _shown(value) -> str:
    text = repr(value) if not isinstance(value, np.floating) else str(value)
    return text if len(text) < 200 else text[:190] + "..."


def _fits(value, hint) -> bool:
    kind, parts = typing.get_origin(hint) or hint, typing.get_args(hint)
    if kind in (typing.Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if kind is int:
        return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if kind is float:
        return isinstance(value, Real) and not isinstance(value, bool)
    if kind in (Sequence, tuple):
        return isinstance(value, Sequence) and not isinstance(value, str) and all(_fits(v, parts[0]) for v in value)
    if getattr(kind, "_is_protocol", False) and isinstance(value, (Mapping, type)):
        return False  # a dict has the method get of a library, and a class the methods of its objects
    return not isinstance(kind, type) or kind in (bool, typing.Any) or isinstance(value, kind)


def _words(hint) -> str:
    kind, parts = typing.get_origin(hint) or hint, typing.get_args(hint)
    if kind in (typing.Union, types.UnionType):
        return " or ".join(_words(part) for part in parts if part is not type(None))
    if kind in (Sequence, tuple):
        return f"a sequence of {_words(parts[0]).removeprefix('a ')}"
    return _WORDS.get(kind, f"a {kind.__name__}")
