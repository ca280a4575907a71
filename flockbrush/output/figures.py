"""Charts drawn with matplotlib (curves, categories, parameters, neighbour maps), as PNG, SVG or PDF.

matplotlib comes with the extra ``report`` and is imported where something is drawn, and nowhere else.  A kind of panel
is a class with a `draw`, which gets axes and a theme.
"""

from __future__ import annotations

import importlib.util
import logging
import math
import textwrap
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from flockbrush.engine.files import refused, whole
from flockbrush.render.style import PALETTE, scale_colours, theme_of
from flockbrush.systems.measures import measures

FORMATS = ".png", ".svg", ".pdf"
MARKERS = "os^D"  # curves can be told apart without colours
EVEN = 0.01  # of the values, by which a curve must change to have a scale of its own
SIZE = 4.6, 2.9  # inches of a panel
LETTERS = 11  # of a heading, an inch
ROW = 0.19  # inches of a parameter in its panel
DOTS = 192  # pixels an inch
BAND = 0.16  # opacity of what lies within the bounds
CLIP, HERD, OTHER = "#26302c", "#d0402b", "#097abe"  # what was filmed, what was simulated, a third


class ChartPanel(Protocol):
    """Base class of the contents of one panel of a figure."""

    @property
    def title(self) -> str: ...

    def height(self) -> float:
        """Inches."""

    def draw(self, axes, look) -> None:
        """Fill the axes, in the colours of a `Theme`."""


class ChartCurve(NamedTuple):
    """One curve of a panel; NaN interrupts it."""

    name: str
    x: np.ndarray
    y: np.ndarray
    error: np.ndarray | None = None  # of y, each way
    band: tuple[np.ndarray, np.ndarray] | None = None  # the lowest and the highest that would do
    colour: str = ""  # by its place by default
    marker: str = ""  # of matplotlib
    width: float = 1.5  # points
    alpha: float = 1.0


class CurveChart(NamedTuple):
    """Curves over numbers or categories; each category is a row."""

    title: str
    across: str
    curves: list[ChartCurve]
    words: list[str] | None = None  # x counts these
    span: tuple[float, float] | None = None  # of the measured axis; as the curves need by default
    logarithmic: bool = False
    note: str = ""  # below the title

    def height(self) -> float:
        """Inches."""
        return SIZE[1]

    def draw(self, axes, look):
        """Curves, their errors and bands."""
        if not any(np.isfinite(np.asarray(curve.y, float)).any() for curve in self.curves):
            axes.text(0.5, 0.5, "no data", ha="center", va="center", color=_web(look.muted), transform=axes.transAxes)
            axes.set(xticks=[], yticks=[])
            return
        names = list(dict.fromkeys(curve.name for curve in self.curves if curve.name))
        for k, curve in enumerate(self.curves):
            kind = names.index(curve.name) if curve.name else k
            _draw_curve(axes, curve, curve.colour or PALETTE[kind % len(PALETTE)], bool(self.words))
        measured, other = (axes.xaxis, axes.yaxis) if self.words else (axes.yaxis, axes.xaxis)
        if self.words:
            other.set_ticks(range(len(self.words)), self.words)
            axes.invert_yaxis()
        else:
            axes.set_xlabel(self.across)
            own = np.unique(np.concatenate([np.asarray(curve.x, float) for curve in self.curves]))
            chosen = len(own) <= 8 and all(float(f"{x:.3g}") == x for x in own)  # by a person, not measured
            if chosen and any(curve.marker for curve in self.curves):
                other.set_ticks(own, [f"{x:g}" for x in own])
        self._scale(axes, measured)

    def _scale(self, axes, measured):
        """The measured axis: as given, logarithmic, or from 0 if the curves come near it or hardly change."""
        limits = axes.set_xlim if self.words else axes.set_ylim
        if self.logarithmic:
            axes.set_yscale("log", subs=())
            measured.get_major_locator().set_params(subs=(1.0, 2.0, 5.0))
            measured.set_major_formatter(lambda value, _: f"{value:g}")
        elif self.span is not None:
            low, high = self.span
            slack = 0.03 * (high - low) if high > low else 0.5
            limits(low - slack, high + slack)
        else:
            low, high = measured.get_view_interval()
            values = np.concatenate([np.asarray(curve.y, float) for curve in self.curves])
            least, most = float(np.nanmin(values)), float(np.nanmax(values))
            if least > 0 and most - least < EVEN * most:  # what hardly changes is no curve of its rounding errors
                limits(0.0, 1.25 * most)
            elif 0 <= least < 0.6 * most:
                limits(min(0.0, low) if low < 0 and _has_errors(self.curves) else 0.0, high)


class ParamRow(NamedTuple):
    """One parameter: its value, the values of all starts, and whether it is identifiable."""

    name: str
    value: float
    others: np.ndarray  # what other starts came to
    told: bool = True
    group: str = ""
    alike: np.ndarray = np.zeros(0)  # what those came to that describe the clip about as well


class Rows(NamedTuple):
    """A panel of parameters, one row each, on a common axis."""

    title: str
    rows: list[ParamRow]
    span: tuple[float, float] = (0.0, 1.0)
    note: str = ""

    def height(self) -> float:
        """Inches."""
        return 0.9 + ROW * len(self.rows)

    def draw(self, axes, look):
        """Draw a disc at the value of each parameter, and small discs at the values of other starts."""
        groups = list(dict.fromkeys(row.group for row in self.rows))
        at = [k + 0.5 * groups.index(row.group) for k, row in enumerate(self.rows)]
        for y, row in zip(at, self.rows, strict=True):
            colour = HERD if row.told else _web(look.muted)
            for values, size, alpha in ((row.others, 2.5, 0.3), (row.alike, 4.0, 0.6)):
                axes.plot(values, np.full(len(values), y), "o", ms=size, color=colour, alpha=alpha, mew=0)
            if len(row.alike):
                ends = np.array([*row.alike, row.value])
                axes.plot([np.nanmin(ends), np.nanmax(ends)], [y, y], color=colour, alpha=0.3, lw=2.5)
            axes.plot([row.value], [y], "o", ms=6, color=colour, mec=_web(look.paper))
        axes.set_yticks(at, [row.name for row in self.rows])
        for label, row in zip(axes.get_yticklabels(), self.rows, strict=True):
            label.set_color(_web(look.ink if row.told else look.muted))
        axes.invert_yaxis()
        low, high = self.span
        axes.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))


class Maps(NamedTuple):
    """Maps side by side, with a common colour scale."""

    title: str
    names: list[str]
    squares: list[np.ndarray]  # (bins, bins), row 0 is behind
    reach: float  # from the middle to a side
    unit: str
    note: str = ""

    def height(self) -> float:
        """Inches."""
        return SIZE[1]

    def draw(self, axes, look):
        """Draw maps: darker is denser; the animal in the middle faces up."""
        from matplotlib.colors import ListedColormap

        known = [float(np.nanmax(square)) for square in self.squares if np.isfinite(square).any()]
        colours = ListedColormap(scale_colours(look.name) / 255)
        axes.set_axis_off()
        shares = np.linspace(0, 1, len(self.squares) + 1)[:-1]
        for left, name, square in zip(shares, self.names, self.squares, strict=True):
            part = axes.inset_axes((left, 0.0, 0.86 / len(self.squares), 1.0))
            sides = (-self.reach, self.reach, -self.reach, self.reach)
            shown = part.imshow(
                square, colours, vmin=0, vmax=max(known, default=1.0) or 1.0, origin="lower", extent=sides
            )
            part.plot([0, 0], [-0.3, 0.3], color=CLIP, lw=2.5)
            part.plot([0], [0.32], "o", ms=2.5, color="#ffffff", mew=0)
            _frame(part, look)
            part.grid(False)
            part.set_title(name, fontsize=8, color=_web(look.muted), loc="left")
            part.set_xlabel("body lengths to the right", fontsize=8)
        bar = axes.figure.colorbar(shown, ax=axes, fraction=0.05, pad=0.02)
        bar.set_label(self.unit, fontsize=8, color=_web(look.muted))
        bar.ax.tick_params(labelsize=8, colors=_web(look.muted))
        bar.outline.set_visible(False)


def draw_series(path, series, title, unit="m"):
    """Draw measures over time, one panel each; measures without data are left out.

    Parameters
    ----------
    path : path
        Of one of the `FORMATS`.
    series : dict of str to list
        ``time`` in seconds, and the measures; NaN where there is none.
    unit : str
        Of lengths.
    """
    panels: list[ChartPanel] = []
    for name, known in measures().items():
        if not (known.plotted and name in series and np.isfinite(np.array(series[name], float)).any()):
            continue
        span = None if known.low is None or known.high is None else (known.low, known.high)
        colour = PALETTE[len(panels) % len(PALETTE)]
        curve = ChartCurve("", np.array(series["time"], float), np.array(series[name], float), colour=colour)
        panels.append(CurveChart(known.axis(unit), "time, s", [curve], span=span, note=known.meaning))
    write_figure(path, figure_of(panels, title, columns=2))


def figure_of(panels, title="", note="", columns=3, theme="light"):
    """A figure of panels in rows and columns, with one legend.

    Parameters
    ----------
    panels : sequence of ChartPanel
    title : str
        Above all.
    note : str
        Below the title: what lines and bars are.  Both are wrapped where the figure ends.

    Returns
    -------
    matplotlib.figure.Figure
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it tells of caches and fonts
    from matplotlib.figure import Figure

    look = theme_of(theme)
    columns = max(1, min(columns, len(panels)))
    rows = [panels[k : k + columns] for k in range(0, len(panels), columns)] or [[]]
    heights = [max((panel.height() for panel in row), default=SIZE[1]) for row in rows]
    fitting = math.floor(columns * SIZE[0] * LETTERS)
    heading = [line for words in (title, *note.splitlines()) for line in textwrap.wrap(words, fitting)]
    head = 0.15 * bool(title) + 0.2 * len(heading)
    made = Figure((columns * SIZE[0], sum(heights) + head), dpi=DOTS, layout="constrained", facecolor=_web(look.paper))
    grid = made.add_gridspec(len(rows), columns, height_ratios=heights)
    for k, panel in enumerate(panels):
        axes = made.add_subplot(grid[k // columns, k % columns])
        _frame(axes, look)
        panel.draw(axes, look)
        below = f"\n{panel.note}" if panel.note else ""
        axes.set_title(panel.title, fontsize=10, color=_web(look.ink), loc="left", pad=18 if below else 6)
        if below:
            axes.annotate(
                panel.note, (0, 1), (0, 5), "axes fraction", "offset points", fontsize=8, color=_web(look.muted)
            )  # fmt: skip
    if heading:
        made.suptitle("\n".join(heading), x=0.01, ha="left", fontsize=11, color=_web(look.ink))
    _legend(made, look)
    return made


def write_figure(path, figure) -> None:
    """Write a figure in the format of the file extension; the same figure gives the same bytes.

    Raises
    ------
    NotWritten
        When it cannot be written.
    """
    import matplotlib

    kind = Path(path).suffix.lower()
    nameless = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {"Software": None}}[kind]
    with whole(path) as temporary, matplotlib.rc_context({"svg.hashsalt": "flockbrush"}):
        figure.savefig(temporary, format=kind[1:], metadata=nameless)


def pixels_of(figure) -> np.ndarray:
    """A figure as a picture, (h, w, 3) uint8 RGB."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[:, :, :3])


def drawing_problems(subject) -> list:
    """Problems that prevent drawing figures, such as a missing package, reported for `subject`."""
    if importlib.util.find_spec("matplotlib") is not None:
        return []
    return refused(subject, 'charts need matplotlib: pip install "flockbrush[report]"').problems


def _web(colour):
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _has_errors(curves):
    return any(curve.error is not None for curve in curves)


def _frame(axes, look):
    """Set up axes without a box, with a thin grid."""
    axes.set_facecolor(_web(look.paper))
    axes.grid(color=_web(look.muted), alpha=0.2, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_web(look.muted), labelsize=8, length=0)
    axes.xaxis.label.set(color=_web(look.muted), fontsize=9)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _draw_curve(axes, curve, colour, by_rows):
    """Draw one curve over numbers or categories; single points are dots."""
    x, y = np.asarray(curve.x, float), np.asarray(curve.y, float)
    if curve.band is not None:
        axes.fill_between(x, *(np.broadcast_to(side, y.shape) for side in curve.band), color=colour, alpha=BAND, lw=0)
    style = {"color": colour, "alpha": curve.alpha, "label": curve.name or None}
    style |= {"marker": curve.marker, "ms": 5}
    if by_rows:
        axes.errorbar(y, x, xerr=curve.error, ls="", elinewidth=1, **style)
        return
    axes.errorbar(x, y, yerr=curve.error, lw=curve.width, elinewidth=1, capsize=2.5, **style)
    known = np.concatenate([[False], np.isfinite(y), [False]])
    alone = known[1:-1] & ~known[:-2] & ~known[2:]
    if not curve.marker and alone.any():
        axes.plot(x[alone], y[alone], "o", ms=2 * curve.width, color=colour, alpha=curve.alpha)


def _legend(figure, look):
    """Draw a legend above the panels, each name once."""
    handles = {}
    for axes in figure.axes:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(name, handle)
    if handles:
        across = max(1, math.floor(figure.get_figwidth() / 1.6))
        figure.legend(
            handles.values(), handles.keys(), loc="outside lower left", ncols=min(len(handles), across), frameon=False,
            fontsize=8, labelcolor=_web(look.muted),
        )  # fmt: skip
