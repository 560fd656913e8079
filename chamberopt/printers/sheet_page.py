"""Lay the process sheet out on A4 pages and write it as PDF.

All of it is on one page if that can be read, else what is measured first, limits and warnings go on
further pages.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.fillets import radii_of_target
from chamberopt.chamber.checks.flat_faces import largest_flat_face
from chamberopt.chamber.checks.openings import find_openings, mounting, part_is_ceiling
from chamberopt.chamber.checks.strips import strip_of_target
from chamberopt.chamber.checks.usual import usual_for_target
from chamberopt.chamber.fixture import plugs_of
from chamberopt.chamber.layout.grip import outside_clamp
from chamberopt.chamber.layout.screws import holes_for_screws
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_PROVEN
from chamberopt.common.files import claim_file, private_folder, write_bytes
from chamberopt.common.number_text import held_together
from chamberopt.coverage.metrics import tells_coverage
from chamberopt.documents.document import Block, Document, Section, Sentence, Table
from chamberopt.documents.sheet import (
    AsBuilt,
    chamber_limits,
    clearance_of,
    cut_of,
    drawn_openings,
    outlines_in_words,
    process_sheet,
    reference_limits,
    slit_limits,
)
from chamberopt.documents.wanted import strip_for
from chamberopt.geometry.triangles import tetrahedron_volumes
from chamberopt.peening.held_strip import held_strip
from chamberopt.pictures.charts.colours import BLACK, DARK_GREY, GREY
from chamberopt.pictures.charts.figure_style import ignore_settings_here
from chamberopt.pictures.coverage import draw_coverage
from chamberopt.pictures.drawing.chamber import (
    LEGEND,
    NOTHING_BESIDE,
    RASTER,
    Shown,
    draw_chamber,
    drawing_height,
    drawing_scale,
)
from chamberopt.pictures.drawing.cuts import face_size_mm
from chamberopt.pictures.drawing.openings import draw_openings
from chamberopt.printers.report_page import PageFile, require_free_page
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import load_result
from chamberopt.results.looked_places import looked_places
from chamberopt.results.shot_push import push_of_shot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties

    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.results.looked_places import LookedPlace

SHEET = "process_sheet.pdf"
CREATOR = "chamberopt process sheet"  # marks a sheet, so that a newer sheet may replace it
SHEET_FILE = PageFile("process sheet", (".pdf",), lambda content: CREATOR.encode() in content)
WIDTH, HEIGHT, MARGIN, GAP = 210.0, 297.0, 12.0, 6.0  # mm
INNER = WIDTH - 2.0 * MARGIN
SIZES = (8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0)  # pt of the text; the largest size that fits is used
LEAST_ALONE = 6.5  # pt: with smaller letters than these on one page there are further pages
# Height of the drawing with its caption [mm]: the least for each pt of the text, and the most.
DRAWING_PER_PT, MOST_DRAWING = 13.0, 125.0
LEAST_OPENINGS = 110.0  # mm: with less room below the coverage they have a page of their own
LEAST_SCALE = 0.5  # of the first page's drawing, below which there is a larger one on its own page
CAPTION, ROW = 9.5, 8.0  # mm, of the caption of three lines, and of a row of the title block
FIELDS = 6  # in a row of the title block
FOOT = MARGIN + 2.0 * ROW + 3.0  # mm, where the content ends
RED = "#C00000"
PRINTED = 2  # times as many pixels along a side of the coverage as on a screen: about 380 an inch
VIEWS_A_ROW = 2  # of the picture of the coverage, where no outlines are below it on its page
NO_COVERAGE = "No page shows the coverage by place: {}."
COVERAGE_HEAD = 20.0  # mm, of title and sentences above the picture of the coverage
COVERAGE = (
    "Share of the surface that is dented after the treatment time, simulated, in windows round "
    "each place. Numbers: where to look, see Acceptance, also for one that no view shows."
)
NOT_TOLD = f"How much of it is dented after the treatment time is {NOT_PROVEN}."
COLUMNS = (88.0, 62.0, 36.0)  # mm, of a table with a head
MM_PER_PT = 25.4 / 72.0
LEADING = 1.25  # height of a line over the size of its letters
HINTED = 1.04  # width of a text on a screen, whose letters take whole pixels, over that on paper
NAMES = 0.52  # share of a column's width that names may take at most
MOST_LINES = 4  # lines of a name in a heading; a longer one ends in an ellipsis
MOST_REVISION = 20  # characters


Written = Callable[["Writer", float], float]
"""Writes something from a height of the page on [mm], and returns that of its bottom."""


class Writer:
    """A writer of texts and tables on a page. A position [mm] is the top left corner of a text.

    A Writer without axes writes nothing and only measures heights.
    """

    def __init__(self, axes: Axes | None, size: float, most: int | None = None) -> None:
        """Prepare to write letters of `size` [pt] on `axes`, and at most `most` lines of a text.

        A text is written whole if `most` is None.
        """
        self.axes, self.size, self.most = axes, size, most

    @property
    def line(self) -> float:
        """Height of a line of text [mm]."""
        return self.size * LEADING * MM_PER_PT

    def write(
        self, text: str, x: float, top: float, width: float, bold: bool = False, colour: str = BLACK
    ) -> float:
        """Write a text in lines of limited width and return the height of its bottom [mm]."""
        lines = broken(text, width, self.size, bold, self.most)
        for number, one in enumerate(lines):
            if self.axes is not None:
                self.axes.text(
                    x,
                    top - number * self.line,
                    one,
                    size=self.size,
                    weight="bold" if bold else "normal",
                    color=colour,
                    va="top",
                    parse_math=False,
                )
        return top - len(lines) * self.line

    def values(self, table: Table, x: float, top: float, width: float) -> float:
        """Write a table of names and values and return the height of its bottom on the page [mm].

        A value with an empty name takes the whole width.
        """
        y = self.caption(table.caption, x, top, width)
        for row in table.rows:
            y = self.row(row, x, y, width, self.names(table, width))
        return y

    def caption(self, text: str, x: float, top: float, width: float) -> float:
        """Write the caption of a table with a line below. Return the bottom's height [mm]."""
        y = self.write(text, x, top, width, bold=True) - 0.1 * self.line
        self.rule(x, y, width)
        return y - 0.25 * self.line

    def names(self, table: Table, width: float) -> float:
        """Return the width of the column of names of a table [mm]."""
        longest = max(text_width(name, self.size) for name, _ in table.rows)
        return min(NAMES * width, longest + 2.0)

    def row(self, row: Sequence[str], x: float, top: float, width: float, names: float) -> float:
        """Write a name and its value. Return the height of their bottom [mm]."""
        name, value = row
        if not name:
            return self.write(value, x, top - 0.15 * self.line, width)
        low = self.write(name, x, top, names - 1.5, colour=DARK_GREY)
        return min(low, self.write(value, x + names, top, width - names))

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
        y = self.table_row(table.head, top, bold=True)
        for row in table.rows:
            y = self.table_row(row, y)
        return y

    def table_row(self, row: Sequence[str], top: float, bold: bool = False) -> float:
        """Write a row of a table with a head, and a line below. Return the bottom's height [mm]."""
        x, ends = MARGIN, []
        for text, width in zip(row, COLUMNS, strict=True):
            ends.append(self.write(text, x, top, width - 2.0, bold=bold))
            x += width
        y = min(ends) - 0.35 * self.line
        self.rule(MARGIN, y, INNER)
        return y - 0.35 * self.line

    def rule(self, x: float, y: float, width: float, colour: str = GREY) -> None:
        """Draw a thin horizontal line."""
        if self.axes is not None:
            self.axes.plot([x, x + width], [y, y], color=colour, lw=0.5)


def broken(
    text: str, width: float, size: float, bold: bool = False, most: int | None = None
) -> list[str]:
    """Return a text broken into lines no wider than `width` [mm].

    A wider word is cut. If there may be at most `most` lines, what is beyond the last one is
    replaced by an ellipsis.
    A number stays on a line with its interval and unit. A letter not in the font becomes "?".
    """
    lines, line = [], ""
    known = "".join(one if ord(one) in _letters(bold) else "?" for one in " ".join(text.split()))
    text = held_together(known)
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
    if most is None or len(lines) <= most:
        return lines
    last = lines[most - 1]
    while last and text_width(f"{last} …", size, bold) > width:
        last = last[:-1]
    return [*lines[: most - 1], f"{last} …"]


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a line of text [mm] at most. `size` is the size of the letters [pt]."""
    return HINTED * _width_over_size(text, bold) * size * MM_PER_PT


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


def write_sheet(
    result: str | Path, path: str | Path | None = None, revision: str = ""
) -> tuple[Path, Document]:
    """Write the process sheet of a results folder.

    Args:
        path: path of the page, by default RESULT/process_sheet.pdf.
        revision: for the title block, at most MOST_REVISION characters; empty: room to write it.

    Returns:
        Path of the page, and the document on it.

    Raises:
        InputError: the folder is no finished result, the path holds anything but a sheet, or the
            revision is too long or cannot be printed.
    """
    if len(revision) > MOST_REVISION or not revision.isprintable():
        allowed = f"allowed: at most {MOST_REVISION} characters that can be printed"
        raise InputError(f"revision: given {revision!r}; {allowed}")
    loaded = load_result(result)
    path = require_free_page(loaded.folder / SHEET if path is None else path, SHEET_FILE)
    with claim_file(path):
        arrays = load_result_arrays(loaded)
        chamber = arrays.chamber
        places = looked_places(arrays, 1e-6 * loaded.record.field.gauge_mm2)
        push = push_of_shot(loaded, arrays)
        design, part, openings = loaded.design, chamber.part, find_openings(chamber)
        clear = clearance_of(loaded)
        held = held_strip(design, chamber, strip_for(design, loaded.metrics))
        built = AsBuilt(
            face_size_mm(chamber),
            openings,
            [mounting(part, one, clear) for one in openings],
            strip_of_target(design, part),
            plugs_of(design, part),
            usual_for_target(design, part),
            [find_openings(step) for step in chamber.steps[1:]],
            held,
            radii_of_target(design, part),
            largest_flat_face(part),
            part_is_ceiling(chamber),
            outside_clamp(chamber, design.effects.part_turn is not None).text,
            "" if design.effects.part_turn else holes_for_screws(chamber),
            None if push is None else (float(push[0]), float(push[1]), float(push[2])),
            float(tetrahedron_volumes(part.vertices, part.triangles).sum()),
            places,
            part.file,
        )
        sheet = process_sheet(loaded, built, revision)
        limits = slit_limits(loaded) | chamber_limits(loaded) | reference_limits(loaded, openings)
        outlines = drawn_openings(built)
        pages = draw_sheet(
            sheet,
            chamber,
            Shown(limits, design.sonotrode.face, cut_of(loaded), held),
            outlines,
            coverage_map(loaded.folder, 3 if outlines else VIEWS_A_ROW, places),
            "" if tells_coverage(loaded.metrics) else NOT_TOLD,
        )
        _save(path, pages, sheet.name)
    return path, sheet


def coverage_map(
    folder: Path, columns: int, places: Sequence[LookedPlace] = ()
) -> np.ndarray | str:
    """Return the picture of a result's coverage, drawn anew, or why it cannot be drawn here.

    It has so many columns of views, and numbers at places to look at. The picture in the folder may
    not be that of the result, as it has no digest.
    """
    from matplotlib.image import imread

    marks = [[*map(float, 1e3 * one.at), *map(float, one.normal)] for one in places]
    with private_folder() as own:
        picture = Path(own) / "coverage.png"
        if reason := draw_coverage([folder], [""], picture, columns, marks, PRINTED):
            return reason.removeprefix(f"{picture.name} ").removeprefix("skipped: ")
        return np.asarray(imread(picture))[..., :3]


def draw_sheet(
    sheet: Document,
    chamber: Chamber,
    shown_beside: Shown = NOTHING_BESIDE,
    openings: Sequence[tuple[str, Opening]] = (),
    coverage: np.ndarray | str | None = None,
    doubt: str = "",
) -> list[Figure]:
    """Return a process sheet as figures of its pages.

    The first page has a heading, sentences in red, a drawing of the chamber and the content. Where
    its scale is small, a page of its own has a larger one. Each further step in which the part
    stands otherwise has a page with its drawing. The coverage by place is under the last tables or
    the larger drawing if it has room there, else on a page of its own. The last page has the
    outlines of openings. Each page has the title block at its foot.

    Args:
        sheet: a document as process_sheet makes it.
        shown_beside: what drawings show beside the chamber.
        openings: those that are cut along the part's section, each with its words.
        coverage: picture of the coverage, red, green and blue of each pixel, or why there is none.
        doubt: a sentence above that picture on what is not told of the coverage.
    """
    ignore_settings_here()
    first, further, block = sheet.sections
    axes = _page()
    pages = [axes]
    red = [one for one in first.content if isinstance(one, Sentence) and one.kind == "warning"]
    content = [one for one in first.content if one not in red]
    if isinstance(coverage, str):
        content.append(Sentence(NO_COVERAGE.format(coverage)))
    whole = [*content, *further.content]
    top = _heading(axes, first.title, sheet, red)
    settings = [one for one in content if isinstance(one, Table) and not one.head]
    texts = (whole, settings, top - FOOT)
    shown, _, room = _laid_out(*texts, [DRAWING_PER_PT * size for size in SIZES])
    if shown is not whole:  # with somewhat smaller letters the drawing may have a larger scale
        room = max(room, top - FOOT + _content(Writer(None, LEAST_ALONE), shown, 0.0))
    # A drawing of that scale is lower than its room: with less room the letters may be larger.
    tall = drawing_height(chamber, (INNER, min(MOST_DRAWING, room) - CAPTION))
    shown, size, _ = _laid_out(*texts, [CAPTION + tall] * len(SIZES))
    _drawing(axes, chamber, top, tall, shown_beside)
    _content(Writer(axes, size), shown, top - tall - CAPTION)
    under: tuple[Axes, float] | None = None
    if shown is not whole:
        left = [one for one in content if one not in shown]
        tables, bottom = _further_pages(further, left, sheet.name)
        pages += tables
        under = tables[-1], bottom
    if drawing_scale(chamber, (INNER, tall)) < LEAST_SCALE:
        larger, y = _further_page("Drawing", sheet.name)
        tall = drawing_height(chamber, (INNER, y - FOOT - CAPTION))
        _drawing(larger, chamber, y, tall, shown_beside)
        pages.append(larger)
        under = larger, y - tall - CAPTION
    pages += _further_steps(chamber, sheet.name, shown_beside)
    y = 0.0
    if isinstance(coverage, np.ndarray):
        last, y = _coverage_page(coverage, f"{doubt} {COVERAGE}".strip(), sheet.name, under)
        pages += [last] * (last not in pages)
    if openings:
        if y - FOOT < LEAST_OPENINGS:
            last, y = _further_page("Openings", sheet.name)
            pages.append(last)
        else:
            y = Writer(last, 12.0).write("Openings", MARGIN, y - 6.0, INNER, bold=True) - 3.0
        scale = draw_openings(last, openings, MARGIN, y - CAPTION, (INNER, y - FOOT - CAPTION))
        text = f"{outlines_in_words(shown_beside.opening)} Scale {scale}, dimensions in mm."
        Writer(last, 6.0).write(text, MARGIN, y, INNER, colour=DARK_GREY)
    for number, one in enumerate(pages, 1):
        (fields,) = block.content
        assert isinstance(fields, Table)
        _title_block(one, [*fields.rows, ("sheet", f"{number} of {len(pages)}")])
    return [figure for one in pages if (figure := one.get_figure(root=True))]


def _laid_out(
    whole: Sequence[Block], settings: Sequence[Block], room: float, needed: Sequence[float]
) -> tuple[Sequence[Block], float, float]:
    """Return what the first page shows, the size of its letters, and what they leave room for.

    The first page has all, or where its letters would be too small, the first part of it. If that
    does not fit with the smallest letters, its last tables are left to further pages.

    Args:
        whole, settings: all that is to be shown, and the tables that are its first part.
        room: height for the text and the drawing above it [mm].
        needed: height of the drawing with its caption for each of SIZES [mm].
    Returns:
        What is shown, the size [pt], and the height that is left [mm].
    """
    parts = [settings[:count] for count in range(len(settings), 0, -1)]
    for shown, least in ((whole, LEAST_ALONE), *((one, 0.0) for one in parts)):
        for size, height in zip(SIZES, needed, strict=True):
            left = room + _content(Writer(None, size), shown, 0.0)
            if left >= height or size <= least:
                break
        if left >= height:
            break
    return shown, size, left


def _page() -> Axes:
    """Return the axes of a new page, in mm."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4), dpi=RASTER)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, WIDTH), ylim=(0.0, HEIGHT))
    axes.axis("off")
    return axes


def _heading(axes: Axes, title: str, sheet: Document, red: Sequence[Sentence]) -> float:
    """Write title, name and answer of the sheet, and sentences in red.

    Returns:
        Height of their bottom [mm].
    """
    y = Writer(axes, 15.0).write(title, MARGIN, HEIGHT - MARGIN, 60.0, bold=True)
    beside, width = MARGIN + 62.0, INNER - 62.0
    name = Writer(axes, 9.0, MOST_LINES).write(
        sheet.name, beside, HEIGHT - MARGIN, width, bold=True
    )
    y = min(y, Writer(axes, 7.0).write(sheet.subtitle, beside, name, width, colour=DARK_GREY)) - 1.5
    y = Writer(axes, 8.0).write(sheet.answer, MARGIN, y, INNER) - 1.5
    for one in red:
        y = Writer(axes, 8.0).write(one.text, MARGIN, y, INNER, bold=True, colour=RED) - 1.0
    Writer(axes, 8.0).rule(MARGIN, y, INNER, BLACK)
    return y


def _further_pages(section: Section, left: Sequence[Block], name: str) -> tuple[list[Axes], float]:
    """Return pages with the tables of a section, and the height of the bottom of the last one [mm].

    The tables are one below the other, as wide as the page.

    Args:
        left: what the first page has no room for. It stands above them.
    """
    axes, top = _further_page(section.title, name)
    pages = [axes]
    measure, write, y = Writer(None, SIZES[0]), Writer(axes, SIZES[0]), top
    measured = [one for one in left if not isinstance(one, Table) or one.head]
    for block in (*measured, *(one for one in left if one not in measured), *section.content):
        head, rows = _in_rows(block, measure)
        is_begun = False
        for row in rows:
            tall = -row(measure, 0.0) - (0.0 if is_begun else head(measure, 0.0))
            if y - tall <= FOOT and y < top:
                axes, y = _further_page(section.title, name)
                pages.append(axes)
                write, is_begun = Writer(axes, SIZES[0]), False
            y = y if is_begun else head(write, y)
            y, is_begun = row(write, y) - 0.3 * write.line, True
        y -= 0.8 * write.line
    return pages, y


def _in_rows(block: Block, measure: Writer) -> tuple[Written, list[Written]]:
    """Return what writes the head of a block as wide as the page, and each row of it.

    Args:
        measure: of the size of the letters, by which columns are as wide as their names.
    """

    def of_columns(row: Sequence[str], bold: bool = False) -> Written:
        return lambda write, y: write.table_row(row, y, bold)

    def of_names(row: Sequence[str], names: float) -> Written:
        return lambda write, y: write.row(row, MARGIN, y, INNER, names)

    def nothing(_: Writer, y: float) -> float:
        return y

    if isinstance(block, Sentence):
        return nothing, [of_names(("", block.text), 0.0)]
    assert isinstance(block, Table)
    if block.head:
        return of_columns(block.head, bold=True), [*map(of_columns, block.rows)]
    names, caption = measure.names(block, INNER), block.caption
    rows = [of_names(row, names) for row in block.rows]
    return (lambda write, y: write.caption(caption, MARGIN, y, INNER)), rows


def _drawing(axes: Axes, chamber: Chamber, top: float, tall: float, beside: Shown) -> None:
    """Draw a chamber as wide as the page, with its legend below.

    Args:
        top, tall: upper edge and height of the drawing [mm].
        beside: what it shows beside the chamber.
    """
    views = draw_chamber(axes, chamber, MARGIN, top, (INNER, tall), beside)
    Writer(axes, 6.0).write(f"{views} {LEGEND}", MARGIN, top - tall, INNER, colour=DARK_GREY)


def _further_steps(chamber: Chamber, name: str, beside: Shown) -> Iterator[Axes]:
    """Yield pages with a drawing of each further step in which the part stands otherwise.

    Args:
        name: name of the sheet.
        beside: what it shows beside the chamber.
    """
    known = [chamber.part.vertices]
    for number, room in enumerate(chamber.steps[1:], start=2):
        posed = room.part.vertices
        if not any(one.shape == posed.shape and np.allclose(one, posed) for one in known):
            axes, y = _further_page(f"Step {number}", name)
            tall = drawing_height(room, (INNER, MOST_DRAWING))
            _drawing(axes, room, y, tall, beside)
            known.append(posed)
            yield axes


def _coverage_page(
    picture: np.ndarray, text: str, name: str, under: tuple[Axes, float] | None = None
) -> tuple[Axes, float]:
    """Return a page with the picture of the coverage, and the height of its bottom [mm].

    It is as wide as the page if it is low enough.

    Args:
        text: what stands above it.
        under: a page and the height of its bottom [mm], to which it goes if that has room for it.
    """
    title, (rows, columns) = "Coverage by place", picture.shape[:2]
    if under is not None and under[1] - FOOT > COVERAGE_HEAD + INNER * rows / columns:
        axes, y = under
        y = Writer(axes, 12.0).write(title, MARGIN, y - 2.0, INNER, bold=True) - 3.0
    else:
        axes, y = _further_page(title, name)
    y = Writer(axes, 7.0).write(text, MARGIN, y, INNER) - 3.0
    size = np.array([columns, rows]) * min(INNER / columns, (y - FOOT) / rows)
    axes.imshow(picture, extent=(MARGIN, MARGIN + size[0], y - size[1], y), interpolation="none")
    axes.set(xlim=(0.0, WIDTH), ylim=(0.0, HEIGHT), aspect="auto")
    return axes, float(y - size[1])


def _further_page(title: str, name: str) -> tuple[Axes, float]:
    """Return a new page with its heading, and the height of the heading's bottom [mm]."""
    axes = _page()
    y = Writer(axes, 12.0).write(title, MARGIN, HEIGHT - MARGIN, 96.0, bold=True)
    beside, width = MARGIN + 98.0, INNER - 98.0
    return axes, min(
        y, Writer(axes, 9.0, MOST_LINES).write(name, beside, HEIGHT - MARGIN, width)
    ) - 3.0


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


def _title_block(axes: Axes, fields: Sequence[Sequence[str]]) -> None:
    """Draw the title block at the foot of a page. A field without a value is room to write."""
    from matplotlib.patches import Rectangle

    width = INNER / FIELDS
    for number, (name, value) in enumerate(fields):
        row, column = divmod(number, FIELDS)
        x, y = MARGIN + column * width, MARGIN + (1 - row) * ROW
        axes.add_patch(Rectangle((x, y), width, ROW, facecolor="none", edgecolor=BLACK, lw=0.5))
        top = Writer(axes, 5.5).write(name, x + 1.0, y + ROW - 0.8, width - 2.0, colour=DARK_GREY)
        size = 6.5 if len(broken(value, width - 2.0, 6.5)) == 1 else 5.0  # two lines have room
        Writer(axes, size, most=2).write(value, x + 1.0, top - 0.2, width - 2.0)


def _save(path: Path, pages: Sequence[Figure], title: str) -> None:
    """Write pages as a PDF file with text that can be selected, whole or not at all."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    content = io.BytesIO()
    title = title.encode(errors="replace").decode()  # the name of a folder may be no valid text
    about = {"Creator": CREATOR, "Title": f"{title}: process sheet"}
    with rc_context({"pdf.fonttype": 42}), PdfPages(content, metadata=about) as file:
        for page in pages:
            page.savefig(file, format="pdf")
    write_bytes(path, content.getvalue())
