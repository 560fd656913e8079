"""Write HTML pages of results. A page is a single file and fetches nothing from a network."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_PROVEN
from chamberopt.common.files import claim_file, read_file, require_place, write_text
from chamberopt.documents.coverage import TELLS_APART, summary
from chamberopt.documents.document import Document, Items, PartView, Section
from chamberopt.documents.report import report
from chamberopt.pictures.charts.colours import KINDS, hex_colours
from chamberopt.pictures.part3d import PartScene, part_scene, quantities_in_all
from chamberopt.pictures.quantities import TIME_TO_98
from chamberopt.printers import html
from chamberopt.results.load import START, Result, load_result

REPORT = "report.html"
GENERATOR = '<meta name="generator" content="chamberopt'
# The policy lets the browser fetch nothing, even if a text of the result held markup.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; worker-src blob:; font-src data:; base-uri 'none'; form-action 'none'"
)
VIEW = "view/view3d.js", "view/section.js", "view/round.js", "view/measure.js", "view/tools.js"
SCRIPTS = "three/three.min.js", *VIEW, "part.js"
WHY_TIME = (
    "A map of coverage would be of one colour, 95 % and more, wherever dents suffice to tell it, "
    "so the picture begins with another quantity."
)
IN_DOUBT = (
    f"After the treatment time the coverage is about full, {NOT_PROVEN}. The picture begins with "
    "the time to 98 %, which is not proven either."
)
HELP = (
    "Drag to turn, use the wheel to zoom after a click or with Ctrl, point at the target to see "
    "its numbers there; a click keeps them in a list."
)


@dataclass(frozen=True)
class PageFile:
    """A kind of output file, such as a report.

    A new file may replace an older file of the same kind, but no other file.

    endings: allowed endings of the file's name, the usual ending first.
    is_one: function that tells from a file's content whether the file is of this kind.
    """

    name: str
    endings: tuple[str, ...]
    is_one: Callable[[bytes], bool]


REPORT_FILE = PageFile(
    "report", (".html", ".htm"), lambda content: GENERATOR.encode() in content[:2000]
)


def write_report(result: str | Path, path: str | Path | None = None) -> tuple[Path, Document]:
    """Write the report of a results folder.

    Args:
        path: path of the page, by default RESULT/report.html.

    Returns:
        Path of the page, and the document on it.

    Raises:
        InputError: the folder is no finished result, or the path holds anything but a report.
    """
    loaded = load_result(result)
    path = require_free_page(loaded.folder / REPORT if path is None else path)
    with claim_file(path):
        document = report(loaded)
        sections = {f"section-{k}": one for k, one in enumerate(document.sections, 1)}
        links = " ".join(
            f'<a href="#{name}">{html.text(one.title)}</a>' for name, one in sections.items()
        )
        body = (
            f"<header><h1>{html.text(document.name)}</h1>"
            f"{html.paragraph(document.subtitle, 'soft')}"
            f'<nav class="contents" aria-label="Contents">{links}</nav></header>'
            f"{''.join(html.section(one, viewer, name) for name, one in sections.items())}"
        )
        write_page(path, f"{document.name}: report", body, document.scenes)
    return path, document


def write_part_page(results: Sequence[Path], path: Path) -> list[str]:
    """Write a page with the parts of results in 3D, side by side. They turn together.

    Returns:
        Remarks, e.g. on triangles that were left out.

    Raises:
        InputError: a folder is no finished result, a part is too large for a page, or the path
            holds anything but a page of this program.
    """
    with claim_file(require_free_page(path)):
        page, remarks = part_page([load_result(one) for one in results])
        write_text(path, page)
    return remarks


def part_page(loaded: Sequence[Result]) -> tuple[str, list[str]]:
    """Return the text of a page with the parts of results in 3D, side by side, and remarks.

    Raises:
        InputError: a part is too large for a page.
    """
    names, scenes = _scenes(loaded)
    summaries = [f"{name}: {summary(one)}" for name, one in zip(names, loaded, strict=True)]
    title = ", ".join(names)
    parts = Section("Part in its chamber", [Items(summaries), PartView(scenes)])
    content = html.section(parts, viewer)
    page = page_text(title, f"<header><h1>{html.text(title)}</h1></header>{content}", scenes)
    return page, [remark for scene in scenes for remark in scene.remarks]


def parts_content(results: Sequence[Path]) -> tuple[str, dict[str, object]]:
    """Return the HTML of the parts of results in 3D, and the data that part.js draws there.

    Raises:
        InputError: a folder is no finished result, or a part is too large for a page.
    """
    _, scenes = _scenes([load_result(one) for one in results])
    return viewer(scenes), _content([scene.data for scene in scenes if scene.data])


def _scenes(loaded: Sequence[Result]) -> tuple[list[str], list[PartScene]]:
    """Return the names of results and their parts in 3D.

    For several results, each remark begins with the name of its result.
    """
    names = _unique_names([one.folder.resolve() for one in loaded])
    scenes = [part_scene(one, name) for one, name in zip(loaded, names, strict=True)]
    for scene, one in zip(scenes, loaded, strict=True):
        if scene.data is None:
            raise InputError(f"{one.folder}: {scene.remarks[-1]}")
    if len(scenes) > 1:
        scenes = [
            replace(scene, remarks=tuple(f"{name}: {remark}" for remark in scene.remarks))
            for name, scene in zip(names, scenes, strict=True)
        ]
    return names, scenes


def _unique_names(folders: Sequence[Path]) -> list[str]:
    """Return a name for each folder: its own name, or PARENT/NAME for all folders.

    PARENT/NAME is used if two folders have the same name or if a folder is named "start", which is
    the folder of a study's first design.
    """
    names = [folder.name for folder in folders]
    unique = len(set(names)) == len(names) and START not in names
    return names if unique else ["/".join(folder.parts[-2:]) for folder in folders]


def require_free_page(path: str | Path, file: PageFile = REPORT_FILE) -> Path:
    """Return `path`, to which a page may be written.

    Raises InputError if the path has a wrong ending, or if a file there is not of the kind `file`.
    """
    path, first = Path(path), file.endings[0]
    remedy = f"give another name (--out FILE{first})"
    if path.suffix.lower() not in file.endings:
        raise InputError(
            f"{path}: a {file.name} is one {first} file; give such a name (--out FILE{first})"
        )
    try:
        is_own = path.is_file() and file.is_one(read_file(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; {remedy}") from None
    if os.path.lexists(path) and not is_own:
        raise InputError(
            f"{path}: this file exists and is no {file.name}, so it is not replaced; {remedy}"
        )
    require_place(path)
    return path


def viewer(scenes: Sequence[PartScene]) -> str:
    """Return the HTML in which the page's script part.js draws parts in 3D, with their controls."""
    drawn = [scene.data for scene in scenes if scene.data]
    remarks = "".join(
        html.paragraph(remark, "soft") for scene in scenes for remark in scene.remarks
    )
    if not drawn:
        return remarks
    saturated = all(scene.is_saturated for scene in scenes)
    first = TIME_TO_98.name if saturated else "coverage"
    options = "".join(
        f"<option{' selected' if one['name'] == first else ''}>{html.text(one['label'])}</option>"
        for one in quantities_in_all(drawn)
    )
    last = max(
        time for one in drawn for time in (one["treatment"], *(row[0] for row in one["curve"]))
    )
    now = min(one["treatment"] for one in drawn)  # after which all are known
    told = all(scene.tells_coverage for scene in scenes)
    text = f"{WHY_TIME} {TELLS_APART}" if told else IN_DOUBT
    why = html.paragraph(text, "soft") if saturated else ""
    panels = ""
    for i, one in enumerate(drawn):
        title = html.text(one["title"])
        description = (
            f"{title}: the part in its chamber in three dimensions, coloured by the chosen quantity"
        )
        caption = f"<figcaption>{title}</figcaption>" if len(drawn) > 1 else ""
        panels += (
            f'<figure><div class="part" id="part-{i}" role="img" aria-label="{description}"></div>'
            f"{caption}</figure>"
        )
    return (
        f'{why}<div class="controls">'
        f'<label>Colour by <select id="quantity">{options}</select></label>'
        '<label><input type="checkbox" id="fit"> fit the colours to the values shown</label>'
        '<span id="times"><label for="time">after</label>'
        f'<input type="range" id="time" min="0" max="{last:g}" step="{now / 60.0:.15g}" '
        f'value="{now:g}"><output id="at" for="time"></output></span></div>'
        f'<div class="panels">{panels}</div><ul id="kinds" class="legend"></ul>'
        '<div id="label" role="status" hidden></div>'
        '<div id="places" hidden></div>'
        f"{html.paragraph(HELP, 'soft')}{remarks}"
        "<noscript><p>A script draws the part in 3D; this browser does not run it.</p></noscript>"
    )


def write_page(path: Path, title: str, body: str, scenes: Sequence[PartScene]) -> None:
    """Write an HTML page, as `page_text` returns it, whole or not at all."""
    write_text(path, page_text(title, body, scenes))


def page_text(title: str, body: str, scenes: Sequence[PartScene]) -> str:
    """Return the text of an HTML page from the HTML of its body.

    Args:
        scenes: parts in 3D that the body shows.
    """
    data = ""
    if drawn := [scene.data for scene in scenes if scene.data]:
        data = html.embedded_json(_content(drawn), "parts")
    scripts = "</script><script>".join(map(_asset, SCRIPTS))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'{GENERATOR} {html.text(version("chamberopt"))}">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{html.text(title)}</title><style>{_asset('style.css')}</style></head>\n"
        f"<body><main>{body}</main>\n{data}\n"
        f"<script>{scripts}</script></body></html>\n"
    )


def _content(drawn: Sequence[dict[str, object]]) -> dict[str, object]:
    """Return the data for part.js: parts in 3D, quantities, colour scales and kinds of surface."""
    quantities = quantities_in_all(drawn)
    scales = {name: hex_colours(name) for name in {one["colours"] for one in quantities}}
    return {"quantities": quantities, "scenes": drawn, "scales": scales, "kinds": KINDS}


@cache
def _asset(name: str) -> str:
    """Return the text of a script or style sheet of the pages."""
    return read_file(Path(__file__).parents[1] / "page" / "browser" / name, follow=True).decode()
