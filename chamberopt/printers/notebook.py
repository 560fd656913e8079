"""Show a design, a study or what they give in a notebook: an overview, often beside a picture.

The HTML holds its picture, fetches nothing and runs no script. printers.html escapes all text. Only
the 3D view of results needs a script, which a frame keeps from the notebook.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.files import private_folder, read_file
from chamberopt.documents.coverage import summary
from chamberopt.documents.document import Section
from chamberopt.documents.overview import (
    comparison_overview,
    design_overview,
    result_overview,
    study_overview,
    sweep_overview,
)
from chamberopt.pictures.coverage import draw_coverage
from chamberopt.pictures.part import draw_part
from chamberopt.pictures.part3d import PartScene
from chamberopt.printers import html
from chamberopt.printers.report_page import part_page

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.results.compare.comparison import Comparison
    from chamberopt.results.load import Result
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.search.study import Study

PNG = b"\x89PNG\r\n\x1a\n"
PICTURE = "coverage.png"  # of a results folder


def design_html(design: Design) -> str:
    """Return the overview of a design as HTML, with its target drawn in its chamber."""
    chamber, problem = _built(design)
    return _shown(design_overview(design, chamber, problem), *_drawn(chamber))


def study_html(study: Study) -> str:
    """Return the overview of a study as HTML, with the design from which it starts drawn."""
    chamber, _ = _built(study.design)
    return _shown(study_overview(study), *_drawn(chamber))


def result_html(result: Result) -> str:
    """Return the overview of a result as HTML, with the coverage drawn on its part."""
    return _shown(result_overview(result), *_coverage(result))


def sweep_html(sweep: SweepResult) -> str:
    """Return the overview of a sweep as HTML."""
    return _shown(sweep_overview(sweep), b"", "")


def comparison_html(comparison: Comparison) -> str:
    """Return the overview of a comparison as HTML."""
    return _shown(comparison_overview(comparison), b"", "")


@dataclass(frozen=True)
class PartsView:
    """The parts of results in 3D, side by side, for the end of a notebook's cell.

    It is the view of the report and of the page in the browser, in a frame of its own: its script
    reaches nothing of the notebook, and fetches nothing.
    """

    results: Sequence[Result]
    height: int = 760  # of the frame, in pixels

    def _repr_html_(self) -> str:
        page, _ = part_page(self.results)
        style = f"width:100%;height:{self.height}px;border:0"
        inside = escape(page, quote=True)
        return f'<iframe sandbox="allow-scripts" style="{style}" srcdoc="{inside}"></iframe>'


def _built(design: Design) -> tuple[Chamber | None, str]:
    """Return the chamber of a design, or None and the reason why it cannot be built."""
    try:
        return build_chamber(design), ""
    except InputError as error:
        return None, str(error)


def _drawn(chamber: Chamber | None) -> tuple[bytes, str]:
    """Return a picture of a part with its target in its chamber, or why there is none."""
    if chamber is None:
        return b"", ""
    part = chamber.part
    corners = part.vertices[part.triangles]
    with private_folder() as folder:
        file = Path(folder) / "part.png"
        remark = draw_part(corners, part.name, file, part.target, chamber=chamber)
        return (b"", remark) if remark else (read_file(file), "")


def _coverage(result: Result) -> tuple[bytes, str]:
    """Return the picture of a result's coverage, or why there is none.

    It is the one in the results folder. Where that is missing, as after a run without OpenGL, it is
    drawn.
    """
    try:
        content = read_file(result.folder / PICTURE)
        if content.startswith(PNG):
            return content, ""
    except (OSError, InputError):
        pass
    with private_folder() as folder:
        file = Path(folder) / PICTURE
        title = f"{result.folder.resolve().name}\n{summary(result)}"
        remark = draw_coverage([result.folder.resolve()], [title], file)
        return (b"", remark) if remark else (read_file(file), "")


def _shown(overview: Section, picture: bytes, remark: str) -> str:
    """Return the HTML of an overview, with a PNG picture above it or a remark below it."""
    drawn = ""
    if picture:
        data = base64.b64encode(picture).decode()
        title = html.text(overview.title)
        drawn = f'<img alt="{title}" style="max-width:100%" src="data:image/png;base64,{data}">'
    told = html.paragraph(remark) if remark else ""
    return f'<div class="chamberopt">{html.section(overview, _no_view)}{drawn}{told}</div>'


def _no_view(scenes: Sequence[PartScene]) -> str:
    """Return nothing for parts in 3D, of which an overview has none."""
    return ""
