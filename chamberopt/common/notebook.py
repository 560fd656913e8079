"""Let notebooks show objects whose packages know no sentences, tables or pictures.

A notebook asks an object for its HTML by the method `_repr_html_`. Designs, studies and results are
defined below documents, printers and pictures, and must not import them. Their classes therefore
ask the function `html_of`, to which chamberopt.api adds what shows each of them. Objects of which
nobody has told how they are shown are shown as text.
"""

from __future__ import annotations

from functools import singledispatch


@singledispatch
def html_of(value: object) -> str | None:
    """Return an object as HTML for a notebook; None if it is only shown as text."""
    return None


class ShownInNotebook:
    """Mix-in of classes whose objects a notebook shows as HTML."""

    def _repr_html_(self) -> str | None:
        return html_of(self)
