"""Print tables and sentences on a terminal, a line for each row and each sentence."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import zip_longest

from chamberopt.documents.document import Table


def text(content: Iterable[Table | str]) -> str:
    """Return tables and sentences as text."""
    return "\n".join(one if isinstance(one, str) else _aligned(one) for one in content)


def _aligned(table: Table) -> str:
    """Return a table in columns as wide as their longest cell, with two spaces between."""
    rows = [table.head, *table.rows]
    widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
    align = str.rjust if table.numbers else str.ljust
    return "\n".join(
        "  ".join([first.ljust(widths[0]), *map(align, others, widths[1:])]).rstrip()
        for first, *others in rows
    )
