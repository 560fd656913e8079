"""report: a result as a page."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.options import Json, app

Page = Annotated[
    Path | None, Parameter(name="--out", help="The page, .html; RESULT/report.html if left out.")
]


@app.command
def report(result: Path, /, *, json: Json = False, out: Page = None) -> None:
    """Write a result as one HTML page to hand on: the answer with its uncertainty, the chamber in 3D, how it was found.
    It needs no network. An older report in its place is replaced, any other file is not.

    Parameters
    ----------
    result
        Results folder of a study or a simulation.
    """
    from chamberopt.output.report import write_report

    path, said = write_report(result, out)
    if json:
        print(json_format.dumps({**said, "report": str(path)}, indent=2))
    else:
        print(
            "\n".join(
                [
                    said["answer"],
                    *said["remarks"],
                    f"report in {path}, {path.stat().st_size / 1e6:.1f} MB",
                ]
            )
        )
