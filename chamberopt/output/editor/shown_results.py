"""Results below the design's folder: their list, one or two in 3D, and their difference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.output.compare.comparison import compare
from chamberopt.output.compare.table import comparison_text
from chamberopt.output.report.page import REPORT, parts_content
from chamberopt.output.report.sheet.page import SHEET
from chamberopt.output.results.load import load_result, summary

RESULT = "result.json"
DEEPEST = 4  # folders below the design's in which results are looked for


def list_results(folder: Path) -> list[dict[str, Any]]:
    """Results below a folder, the newest first, each with its figures in one line."""
    found = []
    for depth in range(1, DEEPEST + 1):
        found += list(folder.glob("/".join(["*"] * depth + [RESULT])))
    rows = []
    for file in sorted(found, key=lambda one: one.lstat().st_mtime, reverse=True):
        where = file.parent
        if not where.resolve().is_relative_to(folder):
            continue  # a link to elsewhere
        row: dict[str, Any] = {"folder": where.relative_to(folder).as_posix()}
        row |= {name: (where / name).is_file() for name in (REPORT, SHEET)}
        try:
            result = load_result(where)
            row["text"] = summary(result)
        except InputError as error:
            row["text"], row["unusable"] = str(error), True
        rows.append(row)
    return rows


def shown(folders: Sequence[Path]) -> dict[str, Any]:
    """Content of the 3D view of results, side by side; of several, also how they differ.

    Raises:
        InputError: one is no usable result, or they cannot be compared.
    """
    html, content = parts_content(folders)
    text = comparison_text(compare(folders)) if len(folders) > 1 else ""
    return {"content": content, "html": html, "comparison": text}
