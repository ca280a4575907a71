"""A page of HTML that needs nothing but itself: headings, sentences, tables and pictures that lie within it."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

import numpy as np

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.55 Georgia, "Times New Roman", serif; color: #26302c; background: #fff; margin: 0 auto;
       max-width: 980px; padding: 2.2rem 1.4rem 4rem; }
h1 { font-size: 1.9rem; margin: 0 0 .2rem; line-height: 1.2; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .6rem; border-bottom: 1px solid #d8d4c8; padding-bottom: .25rem; }
p { margin: .5rem 0; max-width: 44rem; }
.lead { font-size: 1.08rem; }
.small, figcaption, td.small { color: #66716a; font-size: .88rem; }
table { border-collapse: collapse; margin: .8rem 0 1.2rem; font: 14px/1.45 system-ui, "Segoe UI", Helvetica, sans-serif;
        font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; color: #66716a; border-bottom: 1.5px solid #26302c;
     padding: .25rem .9rem .25rem 0; vertical-align: bottom; }
td { border-bottom: 1px solid #ebe8de; padding: .25rem .9rem .25rem 0; vertical-align: top; }
th.number, td.number { text-align: right; }
tr.chief td { font-weight: 600; }
.good { color: #1d6b49; } .bad { color: #b3361f; } .quiet { color: #8a938d; }
figure { margin: 1rem 0 1.4rem; } img { max-width: 100%; height: auto; display: block; }
pre { font: 13px/1.5 ui-monospace, "DejaVu Sans Mono", Menlo, monospace; background: #f7f5ef; padding: .8rem 1rem;
      overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere; border-radius: 4px; }
ul { max-width: 44rem; padding-left: 1.2rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1.2rem; margin: .6rem 0; }
dt { color: #66716a; } dd { margin: 0; overflow-wrap: anywhere; }
@media print { body { max-width: none; padding: 0; font-size: 10.5pt; } h2 { break-after: avoid; }
               figure, table, pre { break-inside: avoid; } }
"""


class Page:
    """Written from top to bottom; every text is escaped here, nowhere else.

    Parameters
    ----------
    title : str
    """

    def __init__(self, title: str):
        self.title = title
        self._parts: list[str] = [f"<h1>{_safe(title)}</h1>"]

    def head(self, text: str):
        """Begin a section."""
        self._parts.append(f"<h2>{_safe(text)}</h2>")

    def say(self, text: str, kind: str = ""):
        """A paragraph; ``kind`` is "lead", "small" or nothing."""
        self._parts.append(f"<p{_kind(kind)}>{_safe(text)}</p>")

    def notes(self, texts: Iterable[str]):
        """Sentences below one another."""
        items = "".join(f"<li>{_safe(text)}</li>" for text in texts)
        if items:
            self._parts.append(f"<ul>{items}</ul>")

    def facts(self, pairs: Iterable[tuple[str, object]]):
        """Words and what they stand for."""
        self._parts.append("<dl>" + "".join(f"<dt>{_safe(a)}</dt><dd>{_safe(b)}</dd>" for a, b in pairs) + "</dl>")

    def table(self, columns: Sequence[str], rows: Iterable[Sequence], words=1, chief: Sequence[int] = ()):
        """Rows of cells; the first ``words`` columns are text, the others numbers; ``chief`` rows stand out.

        A cell is a text, or (text, kind) with kind "good", "bad" or "quiet".
        """
        sides = [""] * words + ["number"] * (len(columns) - words)
        head = "".join(f"<th{_kind(side)}>{_safe(c)}</th>" for c, side in zip(columns, sides, strict=True))
        body = []
        for k, row in enumerate(rows):
            cells = "".join(_cell(cell, side) for cell, side in zip(row, sides, strict=True))
            body.append(f"<tr{_kind('chief' if k in chief else '')}>{cells}</tr>")
        self._parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>")

    def picture(self, image: np.ndarray, caption: str, scale: float = 1.0, photograph: bool = False):
        """A picture (h, w, 3) uint8 RGB within the page, ``scale`` of its pixels to one of the page."""
        data, kind = _encoded(image, photograph)
        width, height = round(image.shape[1] / scale), round(image.shape[0] / scale)
        size = f'width="{width}" height="{height}"'
        source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
        shown = f'<img {size} alt="{_safe(caption)}" src="{source}"/>'
        self._parts.append(f"<figure>{shown}<figcaption>{_safe(caption)}</figcaption></figure>")

    def lines(self, text: str):
        """A text as it is: commands, files."""
        self._parts.append(f"<pre>{_safe(text)}</pre>")

    def text(self) -> str:
        """The whole page."""
        body = "\n".join(self._parts)
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
            '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
            f"<title>{_safe(self.title)}</title><style>{STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
        )


def _safe(text) -> str:
    return html.escape(str(text), quote=True)


def _kind(name: str) -> str:
    return f' class="{name}"' if name else ""


def _cell(cell, side):
    text, kind = cell if isinstance(cell, tuple) else (cell, "")
    return f"<td{_kind(' '.join(filter(None, (side, kind))))}>{_safe(text)}</td>"


def _encoded(image, photograph):
    """The bytes of a picture, and of which kind: JPEG for what was filmed, PNG for what was drawn."""
    import cv2

    ending, options = (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 88]) if photograph else (".png", [])
    done, data = cv2.imencode(ending, np.ascontiguousarray(image[:, :, ::-1]), options)
    if not done:
        raise ValueError(f"a picture of {image.shape[1]}x{image.shape[0]} cannot be written")
    return data.tobytes(), {".jpg": "jpeg", ".png": "png"}[ending]
