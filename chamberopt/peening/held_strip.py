"""How an Almen strip is held in the lid of a chamber, in the place of the part.

     _____________________________
    |            block            |
    |____                     ____|___  ceiling
    |    |___________________|    |
    |      o|____strip____|o      |     level, of the face that is peened
    |    heads of the screws      |

The strip lies on a steel block that closes the room as the lid does, and stands into it where the
target is lower than the ceiling. The heads of four screws beside its long edges hold it, beyond
the balls of the gauge. Where a whole strip has no room with them, a piece is cut from one: of its
whole width if that goes, as the gauge then takes it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import find_openings, walls_end_at
from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.design.almen_strip import STRIPS, StripType
from chamberopt.peening.strip import GAUGE, StripSize
from chamberopt.peening.strip_holder import FIT_MM, growth, lid_outline_mm, sides_of

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.design import Design

SCREW_MM, HEAD_MM = 5.0, 9.5  # M5 with the widest usual head, a pan head of ISO 7045: by heart
WIDEST_MM = 19.05  # of the widths that SAE J442 allows, as shops quote it
WHOLE_MM = 1e3 * STRIPS["A"].length, 1e3 * STRIPS["A"].width
# Heads are beyond the gauge's balls if the piece is long enough for that.
SCREWS_AT_MM = 1e3 * GAUGE[0] + 0.5 * HEAD_MM
# Pieces are tried in steps of so much [mm], down to the narrowest; the shortest goes over the
# gauge's balls with 2.5 mm beyond each.
STEP_MM, NARROWEST_MM, SHORTEST_MM = 0.5, 5.0, 2e3 * GAUGE[0] + 5.0


class HeldStrip(NamedTuple):
    """A strip in the lid in the place of the part, or that there is no room for any.

    Attributes:
        type: of the strip, or of what it is cut from.
        size: None if neither a strip nor a piece of one has room.
        along: the axis along which it lies, "x" or "y".
        level_mm: from the sonotrode to its peened face.
        block_mm: how far its block stands into the room from the ceiling.
        why_no_whole: why no whole strip is held there, in words; "" if one is.
        walls: those beside the room that take a whole strip where the lid does not, such as
            "at −x and +x"; "" for none.
    """

    type: StripType
    size: StripSize | None
    along: str
    level_mm: float
    block_mm: float
    why_no_whole: str = ""
    walls: str = ""

    @property
    def is_whole(self) -> bool:
        """Whether it is a whole strip, whose arc heights are mmA, mmN or mmC."""
        return self.size is not None and not self.why_no_whole

    @property
    def screws_mm(self) -> tuple[float, float]:
        """How far the screws are from the middle of the strip, along and across it [mm]."""
        assert self.size is not None
        return _screws(1e3 * self.size.length, 1e3 * self.size.width)

    @property
    def options(self) -> str:
        """The options of `chamberopt strip` for it."""
        given = "" if self.type == "A" else f" --type {self.type}"
        if self.size is not None and not self.is_whole:
            given += f" --size-mm {1e3 * self.size.length:g} {1e3 * self.size.width:g}"
        return f"{given.strip()} --distance-mm {self.level_mm:g}".strip()

    @property
    def size_in_words(self) -> str:
        """Length and width of a piece, such as "53 × 19 mm"."""
        assert self.size is not None
        return f"{plain(1e3 * self.size.length)} × {plain(1e3 * self.size.width)} mm"

    @property
    def is_on_gauge(self) -> bool:
        """Whether the gauge of whole strips takes it: it is as wide as they are."""
        return self.size is not None and 1e3 * self.size.width > WHOLE_MM[1] - FIT_MM


def width_with_screws_mm() -> float:
    """Return how wide a whole strip is with the heads of the screws beside it [mm]."""
    return round(2.0 * _screws(*WHOLE_MM)[1] + HEAD_MM, 1)


def held_strip(design: Design, chamber: Chamber, strip: StripType) -> HeldStrip | None:
    """Return how a strip is held in the lid of a chamber; None if the chamber takes no lid.

    Args:
        strip: the type of the strip.
    """
    end = walls_end_at(find_openings(chamber))
    ceiling = 1e3 * (chamber.height if end is None else end)
    thick = 1e3 * STRIPS[strip].thickness
    block = max(0.0, round(ceiling - target_level_mm(chamber) - thick, 1))
    level = round(ceiling - block - thick, 1)
    outline = lid_outline_mm(design, level)
    if outline is None:
        return None
    why, walls = "", ""
    found = _with_axis(outline, WHOLE_MM[1], WHOLE_MM[0])
    if found is None:
        why, walls = _why_no_whole(outline), _walls(design, ceiling)
        found = _piece(outline)
    if found is None:
        return HeldStrip(strip, None, "", level, block, why, walls)
    length, width, along = found
    size = StripSize() if not why else StripSize(1e-3 * length, 1e-3 * width)
    return HeldStrip(strip, size, along, level, block, why, walls)


def target_level_mm(chamber: Chamber) -> int:
    """Return how far from the sonotrode a chamber's target lies on the average [mm].

    A strip is set there: farther away it saturates later.
    """
    part = chamber.part
    height = part.vertices[part.triangles].mean(axis=1)[:, 2]
    area = np.where(part.target, chamber.exposed_area, 0.0)
    return round(1e3 * float(np.average(height, weights=area + 1e-30)))


def _piece(outline: np.ndarray) -> tuple[float, float, str] | None:
    """Return length and width [mm] of the widest piece of a strip with room, and its axis."""
    for width in np.arange(WHOLE_MM[1], NARROWEST_MM - FIT_MM, -STEP_MM).tolist():
        for length in np.arange(WHOLE_MM[0] // STEP_MM * STEP_MM, SHORTEST_MM, -STEP_MM).tolist():
            if found := _with_axis(outline, width, length):
                return found
    return None


def _with_axis(outline: np.ndarray, width: float, length: float) -> tuple[float, float, str] | None:
    """Return a strip of a size [mm] with its axis if it and its screws are in an outline."""
    screws = _corners(*_screws(length, width))
    for along in ("x", "y"):
        turn = slice(None, None, 1 if along == "x" else -1)
        strip, heads = _corners(0.5 * length, 0.5 * width)[:, turn], screws[:, turn]
        if growth(strip, outline) >= 1.0 - FIT_MM and _have_room(heads, outline):
            return length, width, along
    return None


def _screws(length: float, width: float) -> tuple[float, float]:
    """Return how far screws are from the middle of a strip, along and across it, all in mm."""
    widest = WIDEST_MM if width > WHOLE_MM[1] - FIT_MM else width
    along = min(SCREWS_AT_MM, 0.5 * (length - HEAD_MM))
    return math.floor(10.0 * along) / 10.0, math.ceil(5.0 * (widest + SCREW_MM)) / 10.0


def _corners(x: float, y: float) -> np.ndarray:
    return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])


def _have_room(heads: np.ndarray, outline: np.ndarray) -> bool:
    """Return whether the heads of screws at some places (n, 2) [mm] are inside an outline [mm]."""
    normal, reach = sides_of(outline)
    return bool(((heads @ normal.T).max(axis=0) + 0.5 * HEAD_MM <= reach + FIT_MM).all())


def _why_no_whole(outline: np.ndarray) -> str:
    """Return in words why no whole strip is held in a room with an outline (n, 2) [mm]."""
    whole = _corners(0.5 * WHOLE_MM[0], 0.5 * WHOLE_MM[1])
    if max(growth(edge, outline) for edge in (whole, whole[:, ::-1])) < 1.0 - FIT_MM:
        return f"a strip of {plain(WHOLE_MM[0])} × {plain(WHOLE_MM[1])} mm has no room in the lid"
    wide = plain(width_with_screws_mm())
    room = plain(round(float(np.ptp(outline, axis=0).min()), 1))
    return (
        f"a strip has room in the lid, but not the heads of the screws beside it: with those of "
        f"M{plain(SCREW_MM)} it is {wide} mm wide, and the room {room} mm"
    )


def _walls(design: Design, ceiling: float) -> str:
    """Return the walls of a box that take a whole strip with its screws, "" for none."""
    sides = [getattr(design.chamber, key, 0.0) for key in ("width_mm", "length_mm")]
    if design.chamber.shape != "box" or ceiling < width_with_screws_mm():
        return ""
    fit = [name for name, side in zip("xy", sides, strict=True) if side >= WHOLE_MM[0]]
    return " or ".join(f"at −{name} or +{name}" for name in fit)
