"""Text on a page: lines broken to a width, and blocks of names and values in two columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from chamberopt.output.plots.colours import BLACK, DARK_GREY, GREY
from chamberopt.output.report.sheet.blocks import Block

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.font_manager import FontProperties

MM_PER_PT = 25.4 / 72.0
LEADING = 1.25  # height of a line over the size of its letters
NAMES = 0.52  # share of a column's width that names may take at most
MOST_LINES = 4  # of one text: more end in an ellipsis


class Writer:
    """Writes text from its top left corner, in page mm; without axes it only measures."""

    def __init__(self, axes: Axes | None, size: float) -> None:
        """size: of the letters [pt]."""
        self.axes, self.size = axes, size

    @property
    def line(self) -> float:
        """Height of a line [mm]."""
        return self.size * LEADING * MM_PER_PT

    def write(
        self, text: str, x: float, top: float, width: float, bold: bool = False, grey: bool = False
    ) -> float:
        """Write a text in lines no wider than a width; return where its bottom is."""
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

    def block(self, block: Block, x: float, top: float, width: float) -> float:
        """Write a block; return where its bottom is."""
        y = self.write(block.title, x, top, width, bold=True) - 0.1 * self.line
        if self.axes is not None:
            self.axes.plot([x, x + width], [y, y], color=GREY, lw=0.5)
        y -= 0.25 * self.line
        longest = max(text_width(name, self.size) for name, _ in block.rows)
        names = min(NAMES * width, longest + 2.0)
        for name, value in block.rows:
            if name:
                low = self.write(name, x, y, names - 1.5, grey=True)
                y = min(low, self.write(value, x + names, y, width - names))
            else:
                y = self.write(value, x, y - 0.15 * self.line, width)
        return y

    def columns(
        self, blocks: Sequence[Block], x: float, top: float, sizes: tuple[float, float]
    ) -> float:
        """Write blocks in two columns as even as can be; return where the longer one ends.

        Args:
            sizes: width of a column, and the gap between them.
        """
        width, gap = sizes
        measure = Writer(None, self.size)
        heights = [0.8 * self.line - measure.block(one, 0.0, 0.0, width) for one in blocks]
        split = min(range(len(blocks) + 1), key=lambda k: max(sum(heights[:k]), sum(heights[k:])))
        for column, chosen in enumerate((blocks[:split], blocks[split:])):
            y = top
            for one in chosen:
                y = self.block(one, x + column * (width + gap), y, width) - 0.8 * self.line
        return top - max(sum(heights[:split]), sum(heights[split:]))


def broken(text: str, width: float, size: float, bold: bool = False) -> list[str]:
    """Lines of a text that are no wider than a width [mm]; words that are wider are cut.

    A number stays on one line with its interval and its unit. A letter that the font lacks is "?".
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
    """Width of a line of text [mm]."""
    return _width_over_size(text, bold) * size * MM_PER_PT


@cache
def _width_over_size(text: str, bold: bool) -> float:
    """Width of a line of text over the size of its letters: the same for all sizes."""
    from matplotlib.textpath import TextToPath

    font = _font(bold)
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0])


@cache
def _letters(bold: bool) -> frozenset[int]:
    """The characters that the font has."""
    from matplotlib.font_manager import findfont, get_font

    return frozenset(get_font(findfont(_font(bold))).get_charmap())


def _font(bold: bool) -> FontProperties:
    """The font of the page, 1 pt high."""
    from matplotlib.font_manager import FontProperties

    return FontProperties(size=1.0, weight="bold" if bold else "normal")
