"""Lay the process sheet out on one A4 page and write it as PDF."""

from __future__ import annotations

import io
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import claim_file, write_bytes
from chamberopt.output.plots.colours import BLACK, GREY
from chamberopt.output.plots.figure_style import ignore_settings_here
from chamberopt.output.report.page import PageFile, require_free_page
from chamberopt.output.report.report_data import report_contents
from chamberopt.output.report.sheet.blocks import Sheet, calibrated_to, first_checks, setting_blocks
from chamberopt.output.report.sheet.drawing import LEGEND, RASTER, draw_chamber
from chamberopt.output.report.sheet.section import face_size_mm
from chamberopt.output.report.sheet.text import Writer
from chamberopt.output.results.chamber_file import load_chamber
from chamberopt.output.results.load import load_result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.chamber.build import Chamber

SHEET = "process_sheet.pdf"
CREATOR = "chamberopt process sheet"  # by which an older sheet is known
SHEET_FILE = PageFile("process sheet", (".pdf",), lambda content: CREATOR.encode() in content)
WIDTH, HEIGHT, MARGIN, GAP = 210.0, 297.0, 12.0, 6.0  # mm
INNER = WIDTH - 2.0 * MARGIN
SIZES = (8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0)  # pt of the text; the largest with which all fits
# Height of the drawing with its caption [mm]: at least, for each pt of the text; and at most.
DRAWING_PER_PT, MOST_DRAWING = 13.0, 125.0
CAPTION, SIGNATURES = 7.0, 14.0  # mm
SIGNED = ("Set up by", "Date", "Checked by", "Date")
EXPECTED, MEASURED = 88.0, 150.0  # mm from the margin: columns of what to measure first
KINDS = {
    "study": "The best chamber of a study, confirmed on fresh seeds",
    "simulation": "One simulated chamber",
}


def write_sheet(result: str | Path, path: str | Path | None = None) -> tuple[Path, dict[str, Any]]:
    """Write the process sheet of a results folder.

    Args:
        path: of the page; RESULT/process_sheet.pdf if left out.

    Returns:
        Path of the page, and what it says as plain JSON values.

    Raises:
        InputError: the folder is no finished result, or the path holds anything but a sheet.
    """
    loaded = load_result(result)
    path = require_free_page(loaded.folder / SHEET if path is None else path, SHEET_FILE)
    with claim_file(path):
        contents, chamber = report_contents(result), load_chamber(loaded)
        kind = f"{KINDS[loaded.record.kind]}; simulated {contents['made'][:10]}"
        sheet = Sheet(
            f"{contents['question']['part']}: {contents['name']}",
            kind,
            contents["answer"],
            setting_blocks(loaded, contents, face_size_mm(chamber)),
            first_checks(loaded),
            calibrated_to(loaded),
        )
        _save(path, draw_sheet(sheet, chamber), sheet.name)
    return path, asdict(sheet)


def draw_sheet(sheet: Sheet, chamber: Chamber) -> Figure:
    """The page: heading, drawing, blocks in two columns, what to measure first, signatures."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    ignore_settings_here()
    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4), dpi=RASTER)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, WIDTH), ylim=(0.0, HEIGHT))
    axes.axis("off")
    top, foot = _heading(axes, sheet), MARGIN + SIGNATURES
    for size in SIZES:
        room = top - foot + _text(Writer(None, size), sheet, 0.0)
        if room >= DRAWING_PER_PT * size:
            break
    tall = min(MOST_DRAWING, room) - CAPTION
    scale = draw_chamber(axes, chamber, MARGIN, top, (INNER, tall))
    caption = f"Section A–A and plan, scale {scale}, {LEGEND}"
    Writer(axes, 6.0).write(caption, MARGIN, top - tall, INNER, grey=True)
    _text(Writer(axes, size), sheet, top - tall - CAPTION)
    _signatures(axes)
    return figure


def _heading(axes: Axes, sheet: Sheet) -> float:
    """Title, name and answer; returns where they end."""
    y = Writer(axes, 15.0).write("Process sheet", MARGIN, HEIGHT - MARGIN, 60.0, bold=True)
    beside, width = MARGIN + 62.0, INNER - 62.0
    name = Writer(axes, 9.0).write(sheet.name, beside, HEIGHT - MARGIN, width, bold=True)
    y = min(y, Writer(axes, 7.0).write(sheet.kind, beside, name, width, grey=True)) - 1.5
    y = Writer(axes, 8.0).write(sheet.answer, MARGIN, y, INNER) - 1.5
    axes.plot([MARGIN, WIDTH - MARGIN], [y, y], color=BLACK, lw=0.8)
    return y


def _text(write: Writer, sheet: Sheet, top: float) -> float:
    """The blocks, and the table of what to measure first; returns where they end."""
    column = 0.5 * (INNER - GAP)
    y = write.columns(sheet.blocks, MARGIN, top, (column, GAP)) - 0.3 * write.line
    head = ("Measure first", "expected", "measured")
    places, widths = (0.0, EXPECTED, MEASURED), (EXPECTED - 2.0, MEASURED - EXPECTED - 2.0, 36.0)
    for number, row in enumerate([head, *((c.what, c.expected, "") for c in sheet.measure_first)]):
        ends = [
            write.write(text, MARGIN + place, y, width, bold=number == 0)
            for text, place, width in zip(row, places, widths, strict=True)
        ]
        y = min(ends) - 0.35 * write.line
        if write.axes is not None:
            write.axes.plot([MARGIN, WIDTH - MARGIN], [y, y], color=GREY, lw=0.4)
        y -= 0.35 * write.line
    return write.write(sheet.calibration, MARGIN, y, INNER) if sheet.calibration else y


def _signatures(axes: Axes) -> None:
    """Lines to sign on at the foot of the page."""
    width = (INNER - 3.0 * GAP) / len(SIGNED)
    for number, what in enumerate(SIGNED):
        x = MARGIN + number * (width + GAP)
        axes.plot([x, x + width], [MARGIN + 3.5] * 2, color=BLACK, lw=0.6)
        Writer(axes, 7.0).write(what, x, MARGIN + 3.0, width, grey=True)


def _save(path: Path, figure: Figure, title: str) -> None:
    """Write the page, with text that can be selected, whole or not at all."""
    from matplotlib import rc_context

    content = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):
        title = title.encode(errors="replace").decode()  # of a folder's name, which may be no text
        about = {"Creator": CREATOR, "Title": f"{title}: process sheet"}
        figure.savefig(content, format="pdf", metadata=about)
    write_bytes(path, content.getvalue())
