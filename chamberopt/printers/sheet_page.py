"""Lay the process sheet out on one A4 page and write it as PDF."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.files import claim_file, write_bytes
from chamberopt.documents.document import Block, Document, Sentence, Table
from chamberopt.documents.sheet import process_sheet
from chamberopt.pictures.charts.colours import BLACK, DARK_GREY, GREY
from chamberopt.pictures.charts.figure_style import ignore_settings_here
from chamberopt.pictures.part_drawing import LEGEND, RASTER, draw_chamber
from chamberopt.pictures.section import face_size_mm
from chamberopt.printers.report_page import PageFile, require_free_page
from chamberopt.results.arrays_file import load_chamber
from chamberopt.results.load import load_result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties

    from chamberopt.chamber.build import Chamber

SHEET = "process_sheet.pdf"
CREATOR = "chamberopt process sheet"  # marks a sheet, so that a newer sheet may replace it
SHEET_FILE = PageFile("process sheet", (".pdf",), lambda content: CREATOR.encode() in content)
WIDTH, HEIGHT, MARGIN, GAP = 210.0, 297.0, 12.0, 6.0  # mm
INNER = WIDTH - 2.0 * MARGIN
SIZES = (8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0)  # pt of the text; the largest size that fits is used
# Height of the drawing with its caption [mm]: the least for each pt of the text, and the most.
DRAWING_PER_PT, MOST_DRAWING = 13.0, 125.0
CAPTION, SIGNATURES = 7.0, 14.0  # mm
SIGNED = ("Set up by", "Date", "Checked by", "Date")
COLUMNS = (88.0, 62.0, 36.0)  # mm, of a table with a head
MM_PER_PT = 25.4 / 72.0
LEADING = 1.25  # height of a line over the size of its letters
NAMES = 0.52  # share of a column's width that names may take at most
MOST_LINES = 4  # lines of a text; a longer text ends in an ellipsis


class Writer:
    """A writer of texts and tables on a page. A position [mm] is the top left corner of a text.

    A Writer without axes writes nothing and only measures heights.
    """

    def __init__(self, axes: Axes | None, size: float) -> None:
        """Prepare to write letters of `size` [pt] on `axes`."""
        self.axes, self.size = axes, size

    @property
    def line(self) -> float:
        """Height of a line of text [mm]."""
        return self.size * LEADING * MM_PER_PT

    def write(
        self, text: str, x: float, top: float, width: float, bold: bool = False, grey: bool = False
    ) -> float:
        """Write a text in lines of limited width and return the height of its bottom [mm]."""
        lines = broken(text, width, self.size, bold)
        for number, one in enumerate(lines):
            if self.axes is not None:
                self.axes.text(
                    x,
                    top - number * self.line,
                    one,
                    size=self.size,
                    weight="bold" if bold else "normal",
                    color=DARK_GREY if grey else BLACK,
                    va="top",
                    parse_math=False,
                )
        return top - len(lines) * self.line

    def values(self, table: Table, x: float, top: float, width: float) -> float:
        """Write a table of names and values and return the height of its bottom on the page [mm].

        A value with an empty name takes the whole width.
        """
        y = self.write(table.caption, x, top, width, bold=True) - 0.1 * self.line
        self.rule(x, y, width)
        y -= 0.25 * self.line
        longest = max(text_width(name, self.size) for name, _ in table.rows)
        names = min(NAMES * width, longest + 2.0)
        for name, value in table.rows:
            if name:
                low = self.write(name, x, y, names - 1.5, grey=True)
                y = min(low, self.write(value, x + names, y, width - names))
            else:
                y = self.write(value, x, y - 0.15 * self.line, width)
        return y

    def columns(self, tables: Sequence[Table], top: float) -> float:
        """Write tables of names and values in two columns of similar length.

        Returns:
            Height of the bottom of the longer column [mm].
        """
        width, measure = 0.5 * (INNER - GAP), Writer(None, self.size)
        heights = [0.8 * self.line - measure.values(one, 0.0, 0.0, width) for one in tables]
        split = min(range(len(tables) + 1), key=lambda k: max(sum(heights[:k]), sum(heights[k:])))
        for column, chosen in enumerate((tables[:split], tables[split:])):
            y = top
            for one in chosen:
                y = self.values(one, MARGIN + column * (width + GAP), y, width) - 0.8 * self.line
        return top - max(sum(heights[:split]), sum(heights[split:]))

    def table(self, table: Table, top: float) -> float:
        """Write a table with its head, as wide as the page. Return the bottom's height [mm]."""
        y = top
        for number, row in enumerate([table.head, *table.rows]):
            x, ends = MARGIN, []
            for text, width in zip(row, COLUMNS, strict=True):
                ends.append(self.write(text, x, y, width - 2.0, bold=number == 0))
                x += width
            y = min(ends) - 0.35 * self.line
            self.rule(MARGIN, y, INNER)
            y -= 0.35 * self.line
        return y

    def rule(self, x: float, y: float, width: float, colour: str = GREY) -> None:
        """Draw a thin horizontal line."""
        if self.axes is not None:
            self.axes.plot([x, x + width], [y, y], color=colour, lw=0.5)


def broken(text: str, width: float, size: float, bold: bool = False) -> list[str]:
    """Return a text broken into lines no wider than `width` [mm]. A wider word is cut.

    A number stays on a line with its interval and unit. A letter not in the font becomes "?".
    """
    lines, line = [], ""
    known = "".join(one if ord(one) in _letters(bold) else "?" for one in " ".join(text.split()))
    text = re.sub(r" (?=±|%)|(?<=±) ", "\u00a0", known)
    for word in text.split(" "):
        while text_width(word, size, bold) > width:
            room = next(
                k
                for k in range(len(word) - 1, 0, -1)
                if k == 1 or text_width(word[:k], size, bold) <= width
            )
            if line:
                lines.append(line)
            lines.append(word[:room])
            line, word = "", word[room:]
        longer = f"{line} {word}".strip()
        if text_width(longer, size, bold) <= width:
            line = longer
        else:
            lines.append(line)
            line = word
    lines.append(line)
    if len(lines) <= MOST_LINES:
        return lines
    last = lines[MOST_LINES - 1]
    while last and text_width(f"{last} …", size, bold) > width:
        last = last[:-1]
    return [*lines[: MOST_LINES - 1], f"{last} …"]


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a line of text [mm]. `size` is the size of the letters [pt]."""
    return _width_over_size(text, bold) * size * MM_PER_PT


@cache
def _width_over_size(text: str, bold: bool) -> float:
    """Return the width of a line of text divided by the size of its letters [mm/pt]."""
    from matplotlib.textpath import TextToPath

    font = _font(bold)
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0])


@cache
def _letters(bold: bool) -> frozenset[int]:
    """Return the code points of the characters that the page's font has."""
    from matplotlib.font_manager import findfont, get_font

    return frozenset(get_font(findfont(_font(bold))).get_charmap())


def _font(bold: bool) -> FontProperties:
    """Return the font of the page, 1 pt high."""
    from matplotlib.font_manager import FontProperties

    return FontProperties(size=1.0, weight="bold" if bold else "normal")


def write_sheet(result: str | Path, path: str | Path | None = None) -> tuple[Path, Document]:
    """Write the process sheet of a results folder.

    Args:
        path: path of the page, by default RESULT/process_sheet.pdf.

    Returns:
        Path of the page, and the document on it.

    Raises:
        InputError: the folder is no finished result, or the path holds anything but a sheet.
    """
    loaded = load_result(result)
    path = require_free_page(loaded.folder / SHEET if path is None else path, SHEET_FILE)
    with claim_file(path):
        chamber = load_chamber(loaded)
        sheet = process_sheet(loaded, face_size_mm(chamber))
        _save(path, draw_sheet(sheet, chamber), sheet.name)
    return path, sheet


def draw_sheet(sheet: Document, chamber: Chamber) -> Figure:
    """Return a process sheet, a document of one section, as a figure of one page.

    The page has a heading, a drawing of the chamber, the content, and lines for signatures.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    ignore_settings_here()
    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4), dpi=RASTER)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, WIDTH), ylim=(0.0, HEIGHT))
    axes.axis("off")
    (section,) = sheet.sections
    top, foot = _heading(axes, section.title, sheet), MARGIN + SIGNATURES
    for size in SIZES:
        room = top - foot + _content(Writer(None, size), section.content, 0.0)
        if room >= DRAWING_PER_PT * size:
            break
    tall = min(MOST_DRAWING, room) - CAPTION
    scale = draw_chamber(axes, chamber, MARGIN, top, (INNER, tall))
    caption = f"Section A–A and plan, scale {scale}, {LEGEND}"
    Writer(axes, 6.0).write(caption, MARGIN, top - tall, INNER, grey=True)
    _content(Writer(axes, size), section.content, top - tall - CAPTION)
    _signatures(axes)
    return figure


def _heading(axes: Axes, title: str, sheet: Document) -> float:
    """Write title, name and answer of the sheet. Return the height of their bottom [mm]."""
    y = Writer(axes, 15.0).write(title, MARGIN, HEIGHT - MARGIN, 60.0, bold=True)
    beside, width = MARGIN + 62.0, INNER - 62.0
    name = Writer(axes, 9.0).write(sheet.name, beside, HEIGHT - MARGIN, width, bold=True)
    y = min(y, Writer(axes, 7.0).write(sheet.subtitle, beside, name, width, grey=True)) - 1.5
    y = Writer(axes, 8.0).write(sheet.answer, MARGIN, y, INNER) - 1.5
    Writer(axes, 8.0).rule(MARGIN, y, INNER, BLACK)
    return y


def _content(write: Writer, content: Sequence[Block], top: float) -> float:
    """Write tables of names and values in two columns, and the other blocks below these tables.

    Returns:
        Height of the bottom of the content [mm].
    """
    tables = [one for one in content if isinstance(one, Table)]
    y = write.columns([one for one in tables if not one.head], top) - 0.3 * write.line
    for one in content:
        if isinstance(one, Table) and one.head:
            y = write.table(one, y)
        elif isinstance(one, Sentence):
            y = write.write(one.text, MARGIN, y, INNER)
    return y


def _signatures(axes: Axes) -> None:
    """Draw lines for signatures at the foot of the page."""
    width, write = (INNER - 3.0 * GAP) / len(SIGNED), Writer(axes, 7.0)
    for number, what in enumerate(SIGNED):
        x = MARGIN + number * (width + GAP)
        write.rule(x, MARGIN + 3.5, width, BLACK)
        write.write(what, x, MARGIN + 3.0, width, grey=True)


def _save(path: Path, figure: Figure, title: str) -> None:
    """Write the page as a PDF file with text that can be selected, whole or not at all."""
    from matplotlib import rc_context

    content = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):
        title = title.encode(errors="replace").decode()  # the name of a folder may be no valid text
        about = {"Creator": CREATOR, "Title": f"{title}: process sheet"}
        figure.savefig(content, format="pdf", metadata=about)
    write_bytes(path, content.getvalue())
