"""The command `report`: write a result as an HTML page, or as a process sheet to print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.console import print_json, show
from chamberopt.cli.options import Json, app

_PAGE = (
    "The page (.html), by default RESULT/report.html; with --sheet a .pdf, by default "
    "RESULT/process_sheet.pdf."
)
Page = Annotated[Path | None, Parameter(name="--out", help=_PAGE)]


@app.command
def report(
    result: Path,
    /,
    *,
    sheet: bool = False,
    revision: str = "",
    json: Json = False,
    out: Page = None,
) -> None:
    """Write a result as one HTML page: the answer with its uncertainty, the chamber in 3D, and how
    it was found.

    The page needs no network. It replaces an older report, but no other file.

    Parameters
    ----------
    result
        Results folder of a study or a simulation.
    sheet
        Write a process sheet instead: A4 (.pdf) to print, with drawing, settings, what to
        expect and what to measure first.
    revision
        Revision in the title block of the process sheet; without it there is room to write one.
    """
    from chamberopt.common.errors import InputError
    from chamberopt.common.progress import step
    from chamberopt.printers.json_values import json_values
    from chamberopt.printers.report_page import write_report
    from chamberopt.printers.sheet_page import write_sheet

    if revision and not sheet:
        raise InputError("--revision: it is printed on the process sheet; add --sheet")
    with step(f"writing the {'sheet' if sheet else 'page'}"):
        if sheet:
            path, document = write_sheet(result, out, revision)
        else:
            path, document = write_report(result, out)
    if json:
        print_json({**json_values(document), "sheet" if sheet else "report": str(path)})
        return
    size = f"{path.stat().st_size / 1e6:.1f} MB"
    written = f"process sheet in {path}" if sheet else f"report in {path}, {size}"
    lines = [one.text for one in document.answer_lines]
    remarks = [remark for scene in document.scenes for remark in scene.remarks]
    show([document.answer, *lines, *remarks, written])
