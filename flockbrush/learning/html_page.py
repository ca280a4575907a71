"""A page of HTML that needs nothing but itself: headings, sentences, tables and pictures that lie within it."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --ink: #26302c; --muted: #5a655f; --quiet: #6d7771; --rule: #d8d4c8;
        --line: #ebe8de; --shade: #f7f5ef; --link: #075f95; --good: #1d6b49; --bad: #b3361f; }
@media screen and (prefers-color-scheme: dark) {
  :root { --paper: #161a18; --ink: #dfe3dd; --muted: #9fa9a2; --quiet: #8b958f; --rule: #3b423e; --line: #2a302d;
          --shade: #1f2522; --link: #7cc0ee; --good: #6fcf9f; --bad: #f08a72; }
  img.drawn { filter: invert(1) hue-rotate(180deg) contrast(.87); mix-blend-mode: lighten; }
  img.filmed { filter: brightness(.86); }
}
body { font: 16px/1.55 Georgia, "Times New Roman", serif; color: var(--ink); background: var(--paper); margin: 0 auto;
       max-width: 980px; padding: 2.2rem 1.4rem 4rem; overflow-wrap: break-word; }
h1 { font-size: 1.9rem; margin: 0 0 .4rem; line-height: 1.2; }
h2 { font-size: 1.3rem; margin: 2.8rem 0 .7rem; border-bottom: 1px solid var(--rule); padding-bottom: .25rem; }
p { margin: .5rem 0; max-width: 44rem; }
.lead { font-size: 1.14rem; } .option { white-space: nowrap; }
.small, figcaption, caption { color: var(--muted); font-size: .9rem; }
figcaption { max-width: 48rem; margin-top: .5rem; }
nav { margin: 1rem 0 0; font-size: .9rem; } nav a { margin-right: 1.1rem; white-space: nowrap; }
a { color: var(--link); } summary { cursor: pointer; color: var(--muted); font-size: .9rem; }
.wide { overflow-x: auto; margin: .8rem 0 1.2rem; }
table { border-collapse: collapse; font: 14px/1.45 system-ui, "Segoe UI", Helvetica, sans-serif;
        font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; color: var(--muted); border-bottom: 1.5px solid var(--ink);
     padding: .25rem 1.1rem .25rem 0; vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); padding: .25rem 1.1rem .25rem 0; vertical-align: top;
     overflow-wrap: normal; }
th.number, td.number { text-align: right; } td.number { white-space: nowrap; }
tr.chief td { font-weight: 600; background: var(--shade); }
.good { color: var(--good); } .bad { color: var(--bad); } .quiet { color: var(--quiet); }
figure { margin: 1.2rem 0 1.6rem; }
.beside { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 400px), 1fr)); gap: 1rem 1rem; }
img { max-width: 100%; height: auto; display: block; }
pre { font: 13px/1.5 ui-monospace, "DejaVu Sans Mono", Menlo, monospace; background: var(--shade); padding: .8rem 1rem;
      overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere; border-radius: 4px; }
ul { max-width: 44rem; padding-left: 1.2rem; } li { margin: .2rem 0; }
ul.checks { list-style: none; padding: 0; } .checks li { padding-left: 1.5rem; text-indent: -1.5rem; }
.checks b { display: inline-block; width: 1.5rem; text-indent: 0; }
dl { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr; gap: .2rem 1.2rem; margin: .6rem 0; }
dt { color: var(--muted); } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 520px) { body { padding: 1.2rem .9rem 3rem; } h1 { font-size: 1.5rem; } dl { display: block; }
                            dd { margin: 0 0 .5rem; } table { font-size: 13px; } th, td { padding-right: .7rem; } }
@media print { @page { margin: 16mm 15mm; } body { max-width: none; padding: 0; font-size: 10pt; }
               nav { display: none; }
               h1 { font-size: 18pt; } h2 { font-size: 13pt; margin-top: 1.6rem; break-after: avoid; }
               table { font-size: 8.5pt; } .wide { overflow: visible; break-inside: avoid; } pre { font-size: 8pt; }
               .beside { grid-template-columns: 1fr 1fr; } .beside.one { grid-template-columns: 1fr; }
               img, tr, pre.short, .checks, dl { break-inside: avoid; } p, h2, caption { break-after: avoid; } }
"""
MADE_BY = '<meta name="generator" content="Flockbrush"/>'
# marks before a sentence: limit met, limit missed, information
MARKS = {True: ("✓", "good"), False: ("✗", "bad"), None: ("·", "quiet")}


def is_report(path) -> bool:
    """Whether a file is a page that Flockbrush made; earlier ones have the same colours and no mark."""
    try:
        page = Path(path).read_bytes()
    except OSError:
        return False
    return any(mark.encode() in page for mark in (MADE_BY, STYLE.strip().splitlines()[0]))


class ReportPage:
    """Written from top to bottom; every text is escaped here, nowhere else."""

    def __init__(self, title: str, words: Callable[[str], str] = str):
        self.title, self._words = title, words  # by which all texts are told, but those that are quoted
        self._heads: list[str] = []
        self._contents = 0  # before which part the contents stand; 0 for none
        self._parts: list[str] = [f"<h1>{_safe(title)}</h1>"]

    def head(self, text: str):
        """Begin a section."""
        self._heads.append(text := self._words(text))
        self._parts.append(f'<h2 id="part-{len(self._heads)}">{_safe(text)}</h2>')

    def contents(self):
        """Here stand the names of all sections, each leading there."""
        self._contents = len(self._parts)

    def say(self, text: str, kind: str = ""):
        """A paragraph; ``kind`` is "lead", "small" or nothing."""
        self._parts.append(f"<p{_kind(kind)}>{_unbroken(self._words(text))}</p>")

    def notes(self, texts: Iterable[str]):
        """Sentences below one another."""
        items = "".join(f"<li>{_unbroken(self._words(text))}</li>" for text in texts)
        if items:
            self._parts.append(f"<ul>{items}</ul>")

    def checks(self, told: Iterable[tuple[bool | None, str]]):
        """Sentences below one another, each with a mark: True met, False missed, None neither."""
        marks = {met: f'<b class="{kind}" aria-hidden="true">{mark}</b>' for met, (mark, kind) in MARKS.items()}
        items = [f"<li>{marks[met]}{_safe(self._words(text))}</li>" for met, text in told]
        if items:
            self._parts.append(f'<ul class="checks">{"".join(items)}</ul>')

    def facts(self, pairs: Iterable[tuple[str, object]]):
        """Words and what they stand for."""
        told = ((_safe(self._words(str(one))) for one in pair) for pair in pairs)
        self._parts.append("<dl>" + "".join(f"<dt>{a}</dt><dd>{b}</dd>" for a, b in told) + "</dl>")

    def table(self, columns: Sequence[str], rows: Iterable[Sequence], words=1, chief: Sequence[int] = ()):
        """Rows of cells; the first ``words`` columns are text, the others numbers; ``chief`` rows stand out.

        A cell is a text, or (text, kind) with kind "good", "bad" or "quiet".
        """
        sides = [""] * words + ["number"] * (len(columns) - words)
        names = [_safe(self._words(column)) for column in columns]
        head = "".join(f'<th scope="col"{_kind(side)}>{c}</th>' for c, side in zip(names, sides, strict=True))
        body = []
        for k, row in enumerate(rows):
            cells = "".join(_cell(cell, side, self._words) for cell, side in zip(row, sides, strict=True))
            body.append(f"<tr{_kind('chief' if k in chief else '')}>{cells}</tr>")
        made = f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"
        self._parts.append(f'<div class="wide">{made}</div>')

    def pictures(
        self, images: Sequence[tuple[np.ndarray, str]], caption="", scale: float = 1.0, photograph=False, paper=None
    ):
        """Pictures (h, w, 3) uint8 RGB beside one another, or below one another where the page is narrow.

        Parameters
        ----------
        images : sequence of (picture, str)
            Each with its alternative text.
        caption : str
            Below them all.
        scale : float
            Pixels of a picture to one of the page.
        photograph : bool
            Filmed, not drawn.
        paper : bool
            Drawn on white paper, which is dark on a dark page; what is no photograph by default.
        """
        paper = not photograph if paper is None else paper
        shown = "".join(_image(image, self._words(words), scale, photograph, paper) for image, words in images)
        below = f"<figcaption>{_safe(self._words(caption))}</figcaption>" if caption else ""
        kind = "beside" if len(images) > 1 else "beside one"
        self._parts.append(f'<figure><div class="{kind}">{shown}</div>{below}</figure>')

    def lines(self, text: str, folded: str = ""):
        """A preformatted text: commands, files; collapsed under the title ``folded``, if given."""
        made = f"<pre{_kind('' if text.count(chr(10)) > 30 else 'short')}>{_safe(text)}</pre>"
        self._parts.append(f"<details><summary>{_safe(folded)}</summary>{made}</details>" if folded else made)

    def links(self, ways: Iterable[tuple[str, str, str]]):
        """(where to, its name, a sentence about it) below one another."""
        items = "".join(f'<li><a href="{_safe(to)}">{_safe(name)}</a>: {_safe(text)}</li>' for to, name, text in ways)
        self._parts.append(f"<ul>{items}</ul>")

    def text(self) -> str:
        """The whole page."""
        parts = list(self._parts)
        if self._contents:
            parts.insert(self._contents, self._ways())
        body = "\n".join(parts)
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
            f'<meta name="viewport" content="width=device-width, initial-scale=1"/>{MADE_BY}'
            f"<title>{_safe(self.title)}</title><style>{STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
        )

    def _ways(self):
        ways = [f'<a href="#part-{k + 1}">{_safe(text)}</a>' for k, text in enumerate(self._heads)]
        return f"<nav>{' '.join(ways)}</nav>"


def _safe(text) -> str:
    return html.escape(str(text), quote=True)


def _unbroken(text) -> str:
    """The text, and no option of a command is parted at the end of a line."""
    return re.sub(r"--[a-z][a-z-]*", r'<span class="option">\g<0></span>', _safe(text))


def _kind(name: str) -> str:
    return f' class="{name}"' if name else ""


def _cell(cell, side, words):
    text, kind = cell if isinstance(cell, tuple) else (cell, "")
    return f"<td{_kind(' '.join(filter(None, (side, kind))))}>{_safe(words(str(text)))}</td>"


def _image(image, words, scale, photograph, paper):
    """A picture within the page."""
    data, kind = _encoded(image, photograph)
    width, height = round(image.shape[1] / scale), round(image.shape[0] / scale)
    size = f'width="{width}" height="{height}"'
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    made = "drawn" if paper else "filmed"
    return f'<img class="{made}" {size} alt="{_safe(words)}" src="{source}"/>'


def _encoded(image, photograph):
    """The bytes of a picture, and of which kind: JPEG for what was filmed, PNG for what was drawn."""
    import cv2

    ending, options = (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 88]) if photograph else (".png", [])
    done, data = cv2.imencode(ending, np.ascontiguousarray(image[:, :, ::-1]), options)
    if not done:
        raise ValueError(f"a picture of {image.shape[1]}x{image.shape[0]} cannot be written")
    return data.tobytes(), {".jpg": "jpeg", ".png": "png"}[ending]
