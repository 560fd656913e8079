"""A document: sections of sentences, tables and charts, which any printer can show.

Documents know no printer, and printers know no capability.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chamberopt.pictures.part3d import PartScene


@dataclass(frozen=True)
class Sentence:
    """A paragraph; `kind` says how much it matters to the reader."""

    text: str
    kind: Literal["", "sentence", "warning", "soft"] = ""


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    texts: Sequence[str]


@dataclass(frozen=True)
class Table:
    """A table whose first column heads its row.

    head: names of the columns; empty for a table of names and values.
    numbers: the other columns hold numbers, set to the right.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = True


@dataclass(frozen=True)
class Chart:
    """A chart with its caption.

    name: unique in the document.
    tooltips: texts at the markers of a line, by the gid of the line.
    """

    name: str
    figure: Figure
    caption: str
    tooltips: Mapping[str, Sequence[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Tile:
    """A figure of the answer, with its value at the start of a study."""

    label: str
    value: str
    start: str = ""


@dataclass(frozen=True)
class Tiles:
    """The main figures of the answer."""

    tiles: Sequence[Tile]


@dataclass(frozen=True)
class TextFile:
    """A file that the reader can save."""

    name: str
    text: str


@dataclass(frozen=True)
class PartView:
    """Parts in their chambers in three dimensions, side by side, which turn together."""

    scenes: Sequence[PartScene]


@dataclass(frozen=True)
class Beside:
    """Columns of blocks, side by side where the page is wide enough."""

    columns: Sequence[Sequence[Block]]


@dataclass(frozen=True)
class Fold:
    """Blocks that are hidden until their title is chosen; `printed` shows them on paper."""

    title: str
    content: Sequence[Block]
    printed: bool = False


Block: TypeAlias = Sentence | Items | Table | Chart | Tiles | TextFile | PartView | Beside | Fold


@dataclass(frozen=True)
class Section:
    """Blocks below a title; the answer stands out."""

    title: str
    content: Sequence[Block]
    is_answer: bool = False


@dataclass(frozen=True)
class AnswerLine:
    """A sentence that belongs to the answer.

    about: the candidate or thing that the sentence speaks of; "best" is the result itself.
    warns: a limit is not certainly met, or the calibration has something to know.
    """

    about: Literal["zone", "best", "start", "other", "calibration"]
    text: str
    warns: bool


@dataclass(frozen=True)
class Document:
    """All that is said of a result.

    answer: the answer in one sentence.
    answer_lines: sentences that belong to it.
    """

    name: str
    subtitle: str
    answer: str
    answer_lines: Sequence[AnswerLine]
    sections: Sequence[Section]

    @property
    def scenes(self) -> list[PartScene]:
        """The parts in three dimensions."""
        views = (one for one in self.blocks() if isinstance(one, PartView))
        return [scene for view in views for scene in view.scenes]

    def blocks(self) -> Iterator[Block]:
        """Every block, also those inside others."""
        for section in self.sections:
            yield from _inside(section.content)


def _inside(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        yield block
        if isinstance(block, Beside):
            for column in block.columns:
                yield from _inside(column)
        elif isinstance(block, Fold):
            yield from _inside(block.content)
