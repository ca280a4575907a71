"""Safe writing to standard output and error: closed, full, or with a limited encoding."""

from __future__ import annotations

import codecs
import errno
import io
import os
import sys
import unicodedata

OUTPUT = "standard output"
_SPELLED = {
    "×": "x", "·": ".", "–": "-", "—": "-", "−": "-", "±": "+-", "°": " degrees", "→": "->", "←": "<-", "≤": "<=",
    "≥": ">=", "≈": "~", "█": "#", "│": "|", "─": "-", "‘": "'", "’": "'", "“": '"', "”": '"', "ß": "ss",
}  # fmt: skip


def prepare():
    """Let this program print whatever it has to say: called once, at its start."""
    _hold_numbers()
    codecs.register_error("flockbrush", _spelled)
    if sys.stdout is None:
        sys.stdout = _Closed()
    elif isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout = sys.__stdout__ = _Output.instead_of(sys.stdout)  # type: ignore[misc]
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")
    elif isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors="flockbrush")


def speaks_unicode(stream) -> bool:
    """Whether a stream takes every letter."""
    return str(getattr(stream, "encoding", None) or "utf-8").lower().startswith("utf")


def let_go():
    """Write nothing more to standard output: Python would complain at its end of what it could not."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError, AttributeError):  # it is no file
        pass


class _Output(io.TextIOWrapper):
    """Standard output whose errors name it."""

    @classmethod
    def instead_of(cls, stream):
        """The same stream, that spells what its encoding does not know."""
        encoding, line, through = stream.encoding, stream.line_buffering, stream.write_through
        stream.flush()
        replacement = cls(stream.buffer, encoding, "flockbrush", line_buffering=line, write_through=through)
        replacement.before = stream  # a debugger goes on writing to it; were it collected, it would close the file
        return replacement

    def write(self, text):
        return _named(super().write, text)

    def flush(self):
        return _named(super().flush)


def _named(do, *arguments):
    try:
        return do(*arguments)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, OUTPUT) from None


class _Closed(io.TextIOBase):
    """Standard output of a program that was started without one."""

    def write(self, text):
        raise OSError(errno.EBADF, "the stream is closed", OUTPUT)


def _hold_numbers():
    """Keep files that are opened later from becoming standard input, output or error."""
    while (held := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(held)


def _spelled(error):
    """What stands for letters that a stream does not know, as codecs want it: (text, where to go on)."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_letter, error.object[error.start : error.end])), error.end


def _letter(letter):
    """A letter in ASCII: its own shape, or its name where it is Greek."""
    if "\ud800" <= letter <= "\udfff":
        return f"\\u{ord(letter):04x}"  # a byte of a file's name
    kind, _, name = unicodedata.name(letter, "").rpartition(" LETTER ")
    if kind.startswith("GREEK") or letter == "µ":
        return name.split()[0].title() if "CAPITAL" in kind else name.split()[0].lower() if name else "u"
    plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return _SPELLED.get(letter) or plain or "?"
