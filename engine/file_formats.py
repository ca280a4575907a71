"""The format that a file states: a kind and a version, such as ``flockbrush.sweep/1``."""

from __future__ import annotations


def newer_format(given: object, schema: str) -> str:
    """What to say of a file that states a newer version of a format than the one that is read; "" of any other.

    Examples
    --------
    >>> newer("flockbrush.sweep/2", "flockbrush.sweep/1")[:46]
    "'flockbrush.sweep/2' is of a newer Flockbrush;"
    >>> newer("flockbrush.sweep/1", "flockbrush.sweep/1") or newer("another/2", "flockbrush.sweep/1")
    ''
    """
    kind, _, version = schema.rpartition("/")
    its, _, number = given.rpartition("/") if isinstance(given, str) else ("", "", "")
    if its != kind or not (number.isdecimal() and len(number) < 9 and int(number) > int(version)):
        return ""
    return f"{given!r} is of a newer Flockbrush; this one reads {schema!r}: update Flockbrush"


def format_error(given: object, schema: str) -> str:
    """Why a file that states this format is not read; "" if it is."""
    if given == schema:
        return ""
    shown = repr(given)
    return newer_format(given, schema) or f"must be {schema!r}, got {shown if len(shown) < 60 else shown[:57] + '...'}"
