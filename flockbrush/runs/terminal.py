"""Terminal output of commands: progress, notices, error messages, tables; and the handling of Ctrl-C.

Everything here goes to stderr: stdout is for results alone.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import contextmanager
from contextvars import ContextVar
from numbers import Number

import flockbrush
from flockbrush.engine.locks import Advice
from flockbrush.engine.plain_text import plain, plain_json
from flockbrush.engine.problems import ProblemsError
from flockbrush.runs.streams import speaks_unicode

PROBLEM, USAGE, INTERRUPTED, PIPE = 1, 2, 130, 141


class Stopped(Exception):
    """A run was stopped by Ctrl-C; open files have been closed."""


def debugging():
    """Whether tracebacks are requested (FLOCKBRUSH_DEBUG)."""
    return os.environ.get("FLOCKBRUSH_DEBUG", "") not in ("", "0")


_words: ContextVar[Callable[[str], str]] = ContextVar("words", default=str)


@contextmanager
def saying(words: Callable[[str], str]):
    """A context in which `say` passes its texts through ``words``, for callers whose options are arguments."""
    before = _words.set(words)
    try:
        yield
    finally:
        _words.reset(before)


def say(text):
    """Print one line to stderr, separate from results."""
    if sys.stderr is None:  # print would take stdout
        return
    try:
        print(plain(_words.get()(str(text))), file=sys.stderr, flush=True)
    except (OSError, ValueError):  # nobody listens
        pass


def show_advice_plainly():
    """Show `Advice` as a line to the person, and other warnings as Python does."""
    usual = warnings.showwarning

    def shown(message, category, *rest):
        say(str(message)) if issubclass(category, Advice) else usual(message, category, *rest)

    warnings.showwarning = shown


def is_terminal(stream):
    try:
        return stream.isatty()
    except (AttributeError, ValueError):
        return False


def print_line(text):
    """Print a text as a result."""
    print(plain(text))


def any_refused(files, check, show=print_line) -> bool:
    """Call ``check`` with each file and show its problems; whether there were any."""
    refused = False
    for name in files:
        try:
            check(name)
        except ProblemsError as error:
            refused = True
            show(error)
    return refused


def styled(pattern, *values):
    """A text with rich's markup in it, as ``styled("[bold]{}[/]", title)``: what stands in the values is no markup."""
    from rich.markup import escape
    from rich.text import Text

    return Text.from_markup(pattern.format(*(escape(plain(value)) for value in values)), emoji=False)


def show(renderable):
    """Print a table or a text as a result, in its full width unless a width is set; a string is not markup."""
    from rich.console import Console

    if isinstance(renderable, str):
        renderable = styled("{}", renderable)
    wide = None if is_terminal(sys.stdout) or "COLUMNS" in os.environ else 160
    Console(width=wide, highlight=False, soft_wrap=False).print(renderable)


def table(*columns, rows=(), title=None, right=()):
    """A plain table; the columns named in ``right`` hold numbers.  Strings are not markup: `styled` makes that.

    Cells that are numbers are shown as `number` writes them.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    class Plain(Table):
        def add_row(self, *cells, **options):
            texts = (number(cell) if cell is None or isinstance(cell, Number) else cell for cell in cells)
            super().add_row(*(styled("{}", cell) if isinstance(cell, str) else cell for cell in texts), **options)

    title = title and styled("{}", title)
    plain_table = Plain(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, title_style="bold")
    for column in columns:
        plain_table.add_column(styled("{}", column), justify="right" if column in right else "left", overflow="fold")
    for cells in rows:
        plain_table.add_row(*cells)
    return plain_table


def number(value, digits=4):
    """A number as text: four significant digits, "-" for NaN."""
    if value is None or value != value:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.{digits}g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.{digits - 1}e}"


def measure(value, digits=3):
    """A measure for people: so many places after the point, however small, fewer where it is large."""
    if value is None or not abs(value) < float("inf"):
        return "-"
    places = digits if abs(value) < 10 else max(0, digits - len(f"{abs(value):.0f}") + 1)
    return f"{value:.{places}f}".replace("-0.000", "0.000")


def finite(values):
    """A copy fit for JSON: NaN and infinity become None, numpy's numbers become plain ones."""
    if isinstance(values, dict):
        return {str(key): finite(value) for key, value in values.items()}
    if isinstance(values, (list, tuple)):
        return [finite(value) for value in values]
    if hasattr(values, "tolist"):
        return finite(values.tolist())
    if isinstance(values, float) and not abs(values) < float("inf"):
        return None
    return values


def print_json(values, indent: int | None = 2):
    """One JSON object on stdout; in one line where the indent is None."""
    import json

    print(plain_json(json.dumps(finite(values), indent=indent, ensure_ascii=not speaks_unicode(sys.stdout))))


# progress --------------------------------------------------------------------------


class _Silent:
    """Progress without output."""

    def __call__(self, done, text=None, total=None):
        pass


class _Bar:
    """A bar on stderr, drawn at most a few times a second."""

    def __init__(self, bar, task):
        self._bar, self._task, self._next = bar, task, 0.0

    def __call__(self, done, text=None, total=None):
        now = time.monotonic()
        if text is not None or now >= self._next:
            self._next = now + 0.1
            changed = ({"description": plain(text)} if text else {}) | ({} if total is None else {"total": total})
            self._bar.update(self._task, completed=done, **changed)


@contextmanager
def progress(text, total):
    """A function ``(done, text=None, total=None)`` that moves a bar, where stderr is a terminal."""
    if not is_terminal(sys.stderr) or total <= 1:
        yield _Silent()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield _Bar(bar, bar.add_task(plain(text), total=total))


def tell_kernel_cache():
    """Say where kernels are kept if that is not usual."""
    if flockbrush.KERNEL_CACHE:
        say(flockbrush.KERNEL_CACHE)


@contextmanager
def compiling(meet=None):
    """Say so when numba has to compile, before the wait begins, and where kernels are kept if that is not usual.

    Parameters
    ----------
    meet : callable, optional
        Is given each kernel that is about to be compiled, and numba's types of its arguments.
    """
    tell_kernel_cache()
    from numba.core import event

    listener = _listener(event)(meet)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


def _listener(event):
    class Compiles(event.Listener):
        """Tells of the first compilation; those that follow belong to it."""

        said = False

        def __init__(self, meet):
            self._meet, self._depth = meet, threading.local()

        def on_start(self, event):
            if not Compiles.said:
                Compiles.said = True
                say("compiling kernels; this takes about a minute, only at the first start ...")
            depth = getattr(self._depth, "value", 0)
            self._depth.value = depth + 1
            if self._meet is not None and depth == 0:
                self._meet(event.data["dispatcher"], event.data["args"])

        def on_end(self, event):
            self._depth.value -= 1

    return Compiles


# being stopped ---------------------------------------------------------------------------


class Interrupts:
    """Handling of Ctrl-C and SIGTERM: the first ends a run between two ticks, the second at once.

    Until `gently` is called, the first one too ends at once: nothing has been written yet that it could cut.
    """

    def __init__(self):
        self.asked = 0
        self._gentle = False
        self._before: dict[int, object] = {}

    def __enter__(self):
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._hear)
        return self

    def __exit__(self, *_):
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _hear(self, number, frame):
        self.asked += 1
        if not self._gentle or self.asked > 1:
            raise KeyboardInterrupt

    def gently(self):
        """From now on wait for the end of a tick."""
        self._gentle = True

    def check(self):
        """Between two ticks: raises Stopped if a stop was requested."""
        if self.asked:
            raise Stopped


# mistakes ------------------------------------------------------------------------------------


def exit_code_of(error) -> int:
    """Print an error message; returns the exit code."""
    from flockbrush.engine.commands import CommandError
    from flockbrush.engine.problems import ProblemsError
    from flockbrush.engine.recording import RecordingError

    if debugging():
        import traceback

        traceback.print_exception(error)
        return PROBLEM
    if isinstance(error, (ProblemsError, RecordingError, CommandError)) or type(error) is LookupError:
        say(str(error))
    elif isinstance(error, MemoryError):
        say("not enough memory; try fewer animals (--agents)")
    elif isinstance(error, OSError):
        say(_of_system(error))
    else:
        say(f"this is a bug in Flockbrush: {type(error).__name__}: {error}")
        say("please report it with the traceback that FLOCKBRUSH_DEBUG=1 in the environment prints")
    return PROBLEM


def _of_system(error):
    name = getattr(error, "filename", None)
    reason = error.strerror or str(error)
    if isinstance(error, FileNotFoundError) and _is_gone(os.curdir):
        return f"{name or 'working folder'}: the current folder was deleted; change to another folder"
    return f"{name}: {reason}" if name else reason


def _is_gone(folder):
    try:
        return not os.stat(folder).st_nlink
    except OSError:
        return True
