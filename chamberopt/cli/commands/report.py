"""The command `report`: a result as an HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.console import print_json, show
from chamberopt.cli.options import Json, app

Page = Annotated[
    Path | None, Parameter(name="--out", help="The page (.html), by default RESULT/report.html.")
]


@app.command
def report(result: Path, /, *, json: Json = False, out: Page = None) -> None:
    """Write a result as one HTML page: the answer with its uncertainty, the chamber in 3D, and how
    it was found.

    The page needs no network. It replaces an older report, but no other file.

    Parameters
    ----------
    result
        Results folder of a study or a simulation.
    """
    from chamberopt.output.report import write_report

    path, facts = write_report(result, out)
    if json:
        print_json({**facts, "report": str(path)})
        return
    size = f"{path.stat().st_size / 1e6:.1f} MB"
    show([facts["answer"], *facts["remarks"], f"report in {path}, {size}"])
