"""Pieces of HTML. Every text that comes in is escaped here: folder names, notes and file names are anybody's."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

FIGURE = ' class="figure"'


def text(value: object) -> str:
    """As text, whatever it holds; a figure and its interval stay on one line."""
    return html.escape(str(value), quote=True).replace(" ± ", "\u00a0±\u00a0")


def paragraph(value: object, kind: str = "") -> str:
    return f"<p{_class(kind)}>{text(value)}</p>"


def items(values: Iterable[object]) -> str:
    """A list; nothing of nothing."""
    rows = "".join(f"<li>{text(value)}</li>" for value in values)
    return f"<ul>{rows}</ul>" if rows else ""


def table(
    caption: str, head: Sequence[object], rows: Iterable[Sequence[object]], figures: bool = True
) -> str:
    """The first column heads its row; figures: the others are numbers, to the right."""
    top = "".join(
        f'<th scope="col"{FIGURE if figures and i else ""}>{text(cell)}</th>'
        for i, cell in enumerate(head)
    )
    kind = FIGURE if figures else ""
    body = "".join(
        f'<tr><th scope="row">{text(first)}</th>{"".join(f"<td{kind}>{text(cell)}</td>" for cell in rest)}</tr>'
        for first, *rest in rows
    )
    named = f"<caption>{text(caption)}</caption>" if caption else ""
    columns = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f'<div class="wide"><table>{named}{columns}<tbody>{body}</tbody></table></div>'


def section(title: str, *content: str) -> str:
    return f"<section><h2>{text(title)}</h2>{''.join(content)}</section>"


def pair(*content: str) -> str:
    """Side by side where there is room."""
    return f'<div class="pair">{"".join(f"<div>{one}</div>" for one in content)}</div>'


def fold(title: str, content: str, kind: str = "") -> str:
    """Closed until it is asked for."""
    return f"<details{_class(kind)}><summary>{text(title)}</summary>{content}</details>"


def chart(name: str, figure: Mapping[str, Any], said: str) -> str:
    """A place for a chart, what it shows in words, and its data for charts.js."""
    source = embedded(figure, f'class="chart" data-into="{text(name)}"')
    place = f'<div id="{text(name)}" class="chart" role="img" aria-label="{text(said)}"></div>'
    return f"<figure>{place}<figcaption>{text(said)}</figcaption></figure>{source}"


def embedded(value: Any, attributes: str) -> str:
    """JSON in the page. No text in it can end the script element."""
    inside = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" {attributes}>{inside}</script>'


def _class(kind: str) -> str:
    return f' class="{text(kind)}"' if kind else ""
