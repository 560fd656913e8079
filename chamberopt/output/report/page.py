"""The pages: one HTML file each, with all it needs inside. A policy in its head forbids it any request."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.output.report import html
from chamberopt.output.report.facts import START, design_file, facts
from chamberopt.output.report.part3d import Scene, part_scene, quantities
from chamberopt.output.report.sections import sections
from chamberopt.output.results.load import load_result, summary

REPORT = "report.html"
GENERATOR = '<meta name="generator" content="chamberopt'
# The browser itself holds the page to it: nothing is fetched, whatever the texts on it say.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; worker-src blob:; font-src data:; base-uri 'none'; form-action 'none'"
)
HOW = "Drag to turn, wheel to zoom; point at a triangle for its figures."


def write_report(result: str | Path, path: str | Path | None = None) -> tuple[Path, dict[str, Any]]:
    """Write the report of a results folder; the file, and what it says as plain values.

    path: RESULT/report.html if left out. Raises InputError for a folder that is no finished result, and for a path
    that holds anything but such a page.
    """
    said = facts(result)
    loaded = load_result(result)
    path = free_page(loaded.folder / REPORT if path is None else path)
    scene = part_scene(loaded, said["name"])
    before = loaded.folder / START
    with_start = said["kind"] == "study" and (before / "coverage.vtp").is_file()
    start = part_scene(load_result(before), START, 0) if with_start else None
    shown = ({START: start} if start else {}) | {
        "best" if said["kind"] == "study" else "result": scene
    }
    body = sections(said, viewer([scene]), shown, design_file(loaded.folder))
    head = f"<header><h1>{html.text(said['name'])}</h1>{html.paragraph(_subtitle(said), 'soft')}</header>"
    write_page(path, f"{said['name']}: report", head + body, [scene])
    return path, {**said, "remarks": list(scene.remarks)}


def write_part_page(results: Sequence[Path], path: Path) -> list[str]:
    """Write a page of the parts in three dimensions alone, side by side, turning together; returns remarks.

    Raises InputError as write_report does, and when a part is too large for a page.
    """
    path = free_page(path)
    loaded = [load_result(one) for one in results]
    names = _names([one.folder.resolve() for one in loaded])
    scenes = [part_scene(one, name) for one, name in zip(loaded, names, strict=True)]
    for scene, one in zip(scenes, loaded, strict=True):
        if scene.data is None:
            raise InputError(f"{one.folder}: {scene.remarks[-1]}")
    if len(scenes) > 1:
        named = (
            tuple(f"{name}: {remark}" for remark in scene.remarks)
            for name, scene in zip(names, scenes, strict=True)
        )
        scenes = [
            replace(scene, remarks=remarks) for scene, remarks in zip(scenes, named, strict=True)
        ]
    said = [f"{name}: {summary(one)}" for name, one in zip(names, loaded, strict=True)]
    title = ", ".join(names)
    content = html.section("Part in its chamber", html.items(said), viewer(scenes))
    write_page(path, title, f"<header><h1>{html.text(title)}</h1></header>{content}", scenes)
    return [remark for scene in scenes for remark in scene.remarks]


def _names(folders: Sequence[Path]) -> list[str]:
    """The folders' names, with the folder above where they are not told apart, or are a study's start."""
    names = [folder.name for folder in folders]
    alone = len(set(names)) == len(names) and START not in names
    return names if alone else ["/".join(folder.parts[-2:]) for folder in folders]


def free_page(path: str | Path) -> Path:
    """A path that may be written: free, or a page of ours. Else InputError."""
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: a report is one .html file; give such a name (--out FILE.html)")
    if not path.resolve().parent.is_dir():
        raise InputError(f"{path}: the folder does not exist; make it first")
    try:
        if os.path.lexists(path) and (
            not path.is_file() or GENERATOR.encode() not in path.read_bytes()[:2000]
        ):
            raise InputError(
                f"{path}: is there, and no report of ours to replace; give another name (--out FILE.html)"
            )
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; give another name (--out FILE.html)"
        ) from None
    return path


def viewer(scenes: Sequence[Scene]) -> str:
    """The place of the parts with their controls, which part.js brings to life."""
    drawn = [scene.data for scene in scenes if scene.data]
    remarks = "".join(
        html.paragraph(remark, "soft") for scene in scenes for remark in scene.remarks
    )
    if not drawn:
        return remarks
    options = "".join(f"<option>{html.text(one['label'])}</option>" for one in quantities(drawn))
    most = max(
        max((time for time, _ in one["curve"]), default=3.0 * one["treatment"]) for one in drawn
    )
    now = max(one["treatment"] for one in drawn)
    panels = "".join(
        f'<figure><div class="part" id="part-{i}" role="img" aria-label="{html.text(one["title"])}: the part in its '
        f'chamber in three dimensions, coloured by the chosen quantity"></div>'
        + (f"<figcaption>{html.text(one['title'])}</figcaption>" if len(drawn) > 1 else "")
        + "</figure>"
        for i, one in enumerate(drawn)
    )
    return (
        f'<div class="controls"><label>Colour by <select id="quantity">{options}</select></label>'
        '<label><input type="checkbox" id="glass" checked> show the chamber</label>'
        '<label><input type="checkbox" id="fit"> fit the colours to what is there</label>'
        f'<span id="times"><label for="time">after</label><input type="range" id="time" min="0" max="{most:g}" '
        f'step="{now / 60.0:.15g}" value="{now:g}"><output id="at" for="time"></output></span></div>'
        f'<div class="panels">{panels}</div><div id="label" role="status" hidden></div>'
        f"{html.paragraph(f'{HOW} Grey: not in the target, or out of reach; light grey: never hit.', 'soft')}{remarks}"
        "<noscript><p>The pictures of this page are drawn by a script, which this browser does not run.</p></noscript>"
    )


def write_page(path: Path, title: str, body: str, scenes: Sequence[Scene]) -> None:
    """Put a page together and write it, whole or not at all. Raises InputError where it cannot be written."""
    from plotly.offline import get_plotlyjs

    drawn = [scene.data for scene in scenes if scene.data]
    carried = {"quantities": quantities(drawn), "scenes": drawn, "scales": _colour_scales(drawn)}
    parts = html.embedded(carried, 'id="parts"') if drawn else ""
    scripts = "".join(
        f"<script>{script}</script>"
        for script in (get_plotlyjs(), _own("part.js"), _own("charts.js"))
    )
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'{GENERATOR} {html.text(version("chamberopt"))}"><meta name="viewport" content="width=device-width">'
        f"<title>{html.text(title)}</title><style>{_own('style.css')}</style></head>\n"
        f"<body><main>{body}</main>\n{parts}\n{scripts}</body></html>\n"
    )
    try:
        write_text(path, page)
    except OSError as error:
        why = f"{path}: cannot be written: {error.strerror}; give another place (--out FILE.html)"
        raise InputError(why) from None


def _subtitle(said: dict[str, Any]) -> str:
    what = {
        "study": "Report of a study: the best chamber found",
        "simulation": "Report of one simulated chamber",
    }
    made = f"simulated {said['made'][:10]}, " if said["made"] else ""
    return (
        f"{what.get(said['kind'], '')}; {made}report made {datetime.now(UTC).date()} by chamberopt"
    )


def _colour_scales(drawn: Sequence[dict[str, Any]]) -> dict[str, list[str]]:
    from plotly.colors import sequential

    return {
        name: getattr(sequential, name.title())
        for name in {one["colours"] for one in quantities(drawn)}
    }


@cache
def _own(name: str) -> str:
    """A script or style that lies beside this file."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
