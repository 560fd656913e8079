"""Turn the blocks of a document into HTML.

All text is escaped, because file names and other texts may contain HTML tags.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Callable, Iterable, Sequence

from chamberopt.documents.document import (
    Beside,
    Block,
    Chart,
    Fold,
    Items,
    PartView,
    Section,
    Sentence,
    Table,
    TextFile,
    Tile,
    Tiles,
)
from chamberopt.pictures.charts.figure_style import svg_text
from chamberopt.pictures.part3d import PartScene

NUMBER = ' class="number"'


def text(value: object) -> str:
    """Return a value as escaped HTML text. A number and its interval stay on one line."""
    return html.escape(str(value), quote=True).replace(" ± ", "\u00a0±\u00a0")


def paragraph(value: object, kind: str = "") -> str:
    return f"<p{_class(kind)}>{text(value)}</p>"


def items(values: Iterable[object]) -> str:
    """Return an HTML list of the values, or an empty text if there are none."""
    rows = "".join(f"<li>{text(value)}</li>" for value in values)
    return f"<ul>{rows}</ul>" if rows else ""


def section(printed: Section, view: Callable[[Sequence[PartScene]], str], name: str = "") -> str:
    """Return the HTML of a section with its title.

    Args:
        view: function that returns the HTML of parts in 3D.
        name: id of the section, for links to it.
    """
    kind = "answer" if printed.is_answer else ""
    content = "".join(block(one, view) for one in printed.content)
    place = f' id="{text(name)}"' if name else ""
    return f"<section{place}{_class(kind)}><h2>{text(printed.title)}</h2>{content}</section>"


def block(printed: Block, view: Callable[[Sequence[PartScene]], str]) -> str:
    """Return the HTML of a block (paragraph, table, chart etc.) of a section.

    Args:
        view: function that returns the HTML of parts in 3D.
    """
    match printed:
        case Sentence():
            return paragraph(printed.text, printed.kind)
        case Items():
            return items(printed.texts)
        case Table():
            return _table(printed)
        case Chart():
            return _chart(printed)
        case Tiles():
            return f'<dl class="tiles">{"".join(map(_tile, printed.tiles))}</dl>'
        case TextFile():
            return _text_file(printed)
        case PartView():
            return view(printed.scenes)
        case Beside():
            columns = ("".join(block(one, view) for one in column) for column in printed.columns)
            return f'<div class="pair">{"".join(f"<div>{one}</div>" for one in columns)}</div>'
        case Fold():
            inside = "".join(block(one, view) for one in printed.content)
            kind = _class("print" if printed.printed else "")
            return f"<details{kind}><summary>{text(printed.title)}</summary>{inside}</details>"


def _table(printed: Table) -> str:
    kind = NUMBER if printed.numbers else ""
    top = "".join(
        f'<th scope="col"{kind if i else ""}>{text(cell)}</th>'
        for i, cell in enumerate(printed.head)
    )
    body = "".join(
        f'<tr><th scope="row">{text(first)}</th>'
        f"{''.join(f'<td{kind}>{text(cell)}</td>' for cell in rest)}</tr>"
        for first, *rest in printed.rows
    )
    named = f"<caption>{text(printed.caption)}</caption>" if printed.caption else ""
    columns = f"<thead><tr>{top}</tr></thead>" if printed.head else ""
    return f'<div class="wide"><table>{named}{columns}<tbody>{body}</tbody></table></div>'


def _tile(printed: Tile) -> str:
    start = f'<dd class="start">start: {text(printed.start)}</dd>' if printed.start else ""
    return f"<div><dt>{text(printed.label)}</dt><dd>{text(printed.value)}</dd>{start}</div>"


def _text_file(printed: TextFile) -> str:
    content = base64.b64encode(printed.text.encode()).decode()
    link = f"data:text/plain;charset=utf-8;base64,{content}"
    name = text(printed.name)
    save = f'<p><a download="{name}" href="{link}">Save {name}</a></p>'
    return f"{save}<pre>{text(printed.text)}</pre>"


def _chart(printed: Chart) -> str:
    """Return the HTML of a chart. Its caption is also its description for screen readers."""
    name, caption = text(printed.name), text(printed.caption)
    svg = svg_text(printed.figure, printed.name, printed.tooltips)
    place = f'<div id="{name}" class="chart" role="img" aria-label="{caption}">{svg}'
    return f"<figure>{place}</div><figcaption>{caption}</figcaption></figure>"


def embedded_json(value: object, name: str) -> str:
    """Return a script element with the id `name` that holds a value as JSON.

    A "</script>" in the value is escaped, so it cannot end the element.
    """
    inside = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{text(name)}">{inside}</script>'


def _class(kind: str) -> str:
    return f' class="{text(kind)}"' if kind else ""
