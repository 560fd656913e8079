"""Pieces of HTML. All text is escaped here, because names of folders and files may hold markup."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from typing import Any

NUMBER = ' class="number"'


def text(value: object) -> str:
    """The value as escaped text; a number and its interval stay on one line."""
    return html.escape(str(value), quote=True).replace(" ± ", "\u00a0±\u00a0")


def paragraph(value: object, kind: str = "") -> str:
    return f"<p{_class(kind)}>{text(value)}</p>"


def items(values: Iterable[object]) -> str:
    """An HTML list; an empty string for no items."""
    rows = "".join(f"<li>{text(value)}</li>" for value in values)
    return f"<ul>{rows}</ul>" if rows else ""


def table(
    caption: str, head: Sequence[object], rows: Iterable[Sequence[object]], numbers: bool = True
) -> str:
    """A table whose first column heads its row.

    Args:
        numbers: whether the other columns are numbers, set to the right.
    """
    kind = NUMBER if numbers else ""
    top = "".join(
        f'<th scope="col"{kind if i else ""}>{text(cell)}</th>' for i, cell in enumerate(head)
    )
    body = "".join(
        f'<tr><th scope="row">{text(first)}</th>'
        f"{''.join(f'<td{kind}>{text(cell)}</td>' for cell in rest)}</tr>"
        for first, *rest in rows
    )
    named = f"<caption>{text(caption)}</caption>" if caption else ""
    columns = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f'<div class="wide"><table>{named}{columns}<tbody>{body}</tbody></table></div>'


def section(title: str, *content: str) -> str:
    return f"<section><h2>{text(title)}</h2>{''.join(content)}</section>"


def pair(*content: str) -> str:
    """Pieces side by side where the page is wide enough."""
    return f'<div class="pair">{"".join(f"<div>{one}</div>" for one in content)}</div>'


def fold(title: str, content: str, kind: str = "") -> str:
    """Content that is hidden until its title is clicked."""
    return f"<details{_class(kind)}><summary>{text(title)}</summary>{content}</details>"


def chart(name: str, svg: str, caption: str) -> str:
    """A chart with a caption, which is also its description for screen readers."""
    place = f'<div id="{text(name)}" class="chart" role="img" aria-label="{text(caption)}">{svg}'
    return f"<figure>{place}</div><figcaption>{text(caption)}</figcaption></figure>"


def embedded_json(value: Any, name: str) -> str:
    """JSON in a script element with this id, which no text in it can end."""
    inside = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{text(name)}">{inside}</script>'


def _class(kind: str) -> str:
    return f' class="{text(kind)}"' if kind else ""
