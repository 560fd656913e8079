"""Define a document: sections of sentences, tables and charts, which any printer can show.

Documents import no printer. Printers know only the blocks of this module, not their subjects.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chamberopt.pictures.part3d import PartScene


# Subjects of the sentences that qualify an answer, what changes the process most first.
About: TypeAlias = Literal[
    "process", "step", "zone", "best", "start", "other", "calibration", "ranges"
]


@dataclass(frozen=True)
class Sentence:
    """A paragraph. `kind` says how much the paragraph matters to the reader.

    about: subject of a sentence that qualifies an answer; empty for any other.
    """

    text: str
    kind: Literal["", "sentence", "warning", "soft"] = ""
    about: About | Literal[""] = ""


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    texts: Sequence[str]


@dataclass(frozen=True)
class Table:
    """A table. The first cell of each row names the row.

    head: names of the columns. Empty for a table of names and values.
    numbers: True if all columns but the first hold numbers, which are aligned to the right.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = True


def values(caption: str, rows: Mapping[str, str]) -> Table:
    """Return a table with two columns, names and values."""
    return Table(caption, (), [*rows.items()], numbers=False)


@dataclass(frozen=True)
class Chart:
    """A chart with its caption.

    name: name that is unique in the document.
    tooltips: texts that appear over the points of a curve, by the curve's id (gid) in the figure.
    """

    name: str
    figure: Figure
    caption: str
    tooltips: Mapping[str, Sequence[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Tile:
    """A number of a result to show large, as text, with its value for a study's start design."""

    label: str
    value: str
    start: str = ""


@dataclass(frozen=True)
class Tiles:
    """The main numbers of a result (tiles), shown large beside one another."""

    tiles: Sequence[Tile]


@dataclass(frozen=True)
class TextFile:
    """A text file, such as the design, that the reader can save from the page."""

    name: str
    text: str


@dataclass(frozen=True)
class PartView:
    """A 3D view of parts in their chambers, side by side. The reader turns all of them together."""

    scenes: Sequence[PartScene]


@dataclass(frozen=True)
class Beside:
    """Columns of blocks, side by side if the page is wide enough."""

    columns: Sequence[Sequence[Block]]


@dataclass(frozen=True)
class Fold:
    """Blocks that are hidden until the reader opens their title, and on paper unless `printed`."""

    title: str
    content: Sequence[Block]
    printed: bool = False


Block: TypeAlias = Sentence | Items | Table | Chart | Tiles | TextFile | PartView | Beside | Fold


@dataclass(frozen=True)
class Section:
    """Blocks below a title. The section with the document's answer is emphasised."""

    title: str
    content: Sequence[Block]
    is_answer: bool = False


@dataclass(frozen=True)
class AnswerLine:
    """A sentence that qualifies the answer of a result, such as a limit that is not met.

    about: subject of the sentence, such as the name of a zone. "best" is the result itself.
    warns: True if the sentence is a warning, e.g. that a limit is not certainly met.
    """

    about: About
    text: str
    warns: bool

    def sentence(self) -> Sentence:
        """Return this line as a paragraph."""
        return Sentence(self.text, "warning" if self.warns else "", self.about)


@dataclass(frozen=True)
class Document:
    """The whole report of a result.

    answer: the answer in one sentence.
    answer_lines: further sentences that qualify the answer.
    """

    name: str
    subtitle: str
    answer: str
    answer_lines: Sequence[AnswerLine]
    sections: Sequence[Section]

    @property
    def scenes(self) -> list[PartScene]:
        """All parts that the document shows in three dimensions."""
        views = (one for one in self.blocks() if isinstance(one, PartView))
        return [scene for view in views for scene in view.scenes]

    def blocks(self) -> Iterator[Block]:
        """Yield every block of the document, also the blocks inside other blocks."""
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
