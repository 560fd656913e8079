"""Draw the chamber to scale with its dimensions: a section through its axis, and a plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.fixture import size_in_words
from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.outline import fitted_circle
from chamberopt.geometry.triangles import border_edges
from chamberopt.pictures.charts.colours import (
    BLACK,
    BLUE,
    DARK_GREY,
    FIXTURE_COLOURS,
    KINDS,
    SONOTRODE,
)
from chamberopt.pictures.section import (
    SAME,
    SectionPlane,
    cut,
    face_size_mm,
    inside,
    section_planes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle
    from numpy.typing import ArrayLike

    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.design.sonotrode import Face

# All lengths are in mm on the page.

Point = tuple[float, float]
Limits = Mapping[str, tuple[float, float, float]]  # value, least and largest value [mm] by key
SIZE, WIDTH = 7.0, 0.4  # pt, of the text and of the lines
SHORT = 9.0  # mm: a shorter dimension has its arrows and its text outside
STUB = 3.5  # mm, of arrows outside


def dimension(
    axes: Axes, start: Point, end: Point, away: float, text: str, upright: bool = False
) -> None:
    """Draw a dimension: the horizontal or, if upright, the vertical distance of two points.

    Args:
        away: distance of the dimension line below the points, or left of the points if upright.
        text: text at the line.
    """

    def turn(x: float, y: float) -> Point:
        return (y, x) if upright else (x, y)

    (x1, y1), (x2, y2) = turn(*start), turn(*end)
    line, past = y1 - away, 1.0 if away > 0 else -1.0
    for x, y in ((x1, y1), (x2, y2)):
        axes.plot(
            *zip(turn(x, y - 0.5 * past), turn(x, line - past), strict=True),
            color=DARK_GREY,
            lw=WIDTH,
        )
    arrow = {"lw": WIDTH, "color": DARK_GREY, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 5.0}
    if x2 - x1 >= SHORT:
        ends = [(x1, x2, "<|-|>")]
        place = 0.5 * (x1 + x2)
    else:
        ends = [(x1 - STUB, x1, "-|>"), (x2 + STUB, x2, "-|>"), (x1, x2, "-")]
        place = x2 + STUB + 1.0
    for a, b, style in ends:
        arrowed = {**arrow, "arrowstyle": style}
        axes.annotate("", turn(b, line), turn(a, line), arrowprops=arrowed, annotation_clip=False)
    inline = {"fc": "white", "ec": "none", "pad": 0.6}
    middle = x2 - x1 >= SHORT
    x, y = turn(place, line)
    ha = "center" if middle or upright else "left"
    va = "bottom" if upright and not middle else "center"
    rotation = 90.0 if upright else 0.0
    axes.text(x, y, text, size=SIZE, ha=ha, va=va, rotation=rotation, bbox=inline, parse_math=False)


def across_line(axes: Axes, start: Point, end: Point, name: str = "") -> None:
    """Draw a dash-dotted line: an axis, or a section's plane with its name at both ends."""
    axes.plot(*zip(start, end, strict=True), color=DARK_GREY, lw=0.5, ls=(0, (9, 2, 1.5, 2)))
    if name:
        length = math.dist(start, end)
        for (x, y), (from_x, from_y) in ((start, end), (end, start)):
            x, y = x + 2.0 * (x - from_x) / length, y + 2.0 * (y - from_y) / length
            axes.text(x, y, name, size=8.0, ha="center", va="center", weight="bold")


_STEPS = np.outer(10.0 ** np.arange(4), (1.0, 2.0, 5.0)).ravel()  # ISO 5455
SCALES = np.concatenate([_STEPS[::-1], 1.0 / _STEPS[1:]])  # from large to small
# Room on paper [mm] round a view for its dimensions: left and right, above, below.
BESIDE, ABOVE, BELOW = 11.0, 9.0, 12.0
WIDER = 0.1  # mm: a cavity that is wider than its sonotrode by more has its own dimension
# mm on paper, lower left and upper right of what is round a plan without words and dimensions
FREE = (-8.0, -8.0), (8.0, 2.0)
FACE = 2.5  # mm on paper, thickness of the drawn sonotrode
MOST_OUTSIDE = 15.0  # mm on paper, most of the part that is drawn outside the chamber
BEYOND = 0.1  # mm on paper that a part goes on at least where it is broken off
BREAK, WAVE = 0.5, 3.0  # mm, height and length of the waves of a line where the part is broken off
# mm on paper: jaws that hold the part outside begin so far from the wall, with so much of it beyond
# them, and are so long and thick.
JAWS_FROM, JAWS_LONG, JAWS_THICK = 2.5, 4.0, 2.0
# They are drawn where the part's sides are parallel, at so many places, within so many mm on paper.
JAW_PLACES, JAWS_OFF = 5, 0.2
OFF_AXIS = 0.05  # mm: a section that is farther beside the axis has its place dimensioned
ROOM, PART, TARGET = "#e8f1f7", "#c9ced3", KINDS["target"].colour
RASTER = 200  # dots an inch, for the part in the plan
LEGEND = (
    "dimensions in mm, without a tolerance by ISO 2768-m. Blue: target, in the plan also where it "
    "is hidden. Hatched or grey: part. Orange: sonotrode."
)
LABEL = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}


@dataclass(frozen=True)
class View:
    """A view of the chamber, such as its plan: its position and scale on the page.

    Attributes:
        right: axis of the chamber (0, 1, 2) that points to the right.
        scale: length on the page over length in the chamber.
        corner: lower left corner of the cavity on the page [mm].
        low, high: corners of the cavity in the chamber, (2,) [mm].
        outside: drawn length of the part beyond the cavity, [left and right, above] on the page
            [mm].
    """

    right: int
    scale: float
    corner: np.ndarray
    low: np.ndarray
    high: np.ndarray
    outside: np.ndarray

    def place(self, points: ArrayLike) -> np.ndarray:
        """Return the points on the page [mm] that show points (..., 2) [mm] of the chamber."""
        return np.asarray(self.corner + self.scale * (np.asarray(points) - self.low))

    def chamber_point(self, place: Point) -> Point:
        """Return the point [mm] of the chamber that is drawn at a place on the page [mm]."""
        x, y = self.low + (np.array(place) - self.corner) / self.scale
        return float(x), float(y)

    def window(self, axes: Axes) -> Rectangle:
        """Return the rectangle of the page that the view takes, at which drawings are cut off."""
        from matplotlib.patches import Rectangle

        sides, above = self.outside
        size = self.scale * (self.high - self.low) + np.array([2.0 * sides, above])
        return Rectangle(
            tuple(self.corner - np.array([sides, 0.0])), *size, transform=axes.transData
        )


def draw_chamber(
    axes: Axes,
    chamber: Chamber,
    left: float,
    top: float,
    size: Point,
    limits: Limits = MappingProxyType({}),
    face: Face | None = None,
) -> str:
    """Draw sections and plan of a chamber on a page, and return what they are, with their scale.

    Args:
        axes: axes of the whole page, in mm.
        left, top: upper left corner of the drawing.
        size: width and height that it may have.
        limits: what the keys of [chamber] may be, for dimensions that show one of them.
        face: on which the chamber stands, whose joints the plan shows, and its rim where it is
            larger than the floor.
    """
    (low, high), has_jaws = _ends(chamber), False
    planes = section_planes(chamber)
    scale, outside, needs, is_below = _fit(chamber, planes, size)
    deep = scale * (high - low)[1]
    # The middle of the sections is that of their row, and the plan's that of its own.
    of_plan = top - needs[1] + 0.5 * (ABOVE + BELOW + deep) if is_below else top - 0.5 * size[1]
    middle = top - 0.5 * (needs[1] - ABOVE - BELOW - deep if is_below else size[1])
    x = left + 0.5 * (size[0] - needs[0])
    tall, under = scale * (high - low)[2], x + BESIDE
    for name, plane, more in zip("AB", planes, outside, strict=False):
        axis = np.array([plane.right, 2])
        corner = np.array([x + BESIDE + more[0], middle - 0.5 * (tall + more[1]) + 1.0])
        view = View(plane.right, scale, corner, low[axis], high[axis], more)
        has_jaws |= _draw_section(axes, chamber, view, plane.at, name, limits)
        x = corner[0] + scale * (high - low)[plane.right] + more[0] + BESIDE
        if plane.right == 0:
            under = corner[0]
    corner = np.array([under if is_below else x + BESIDE, of_plan - 0.5 * deep + 1.0])
    view = View(0, scale, corner, low[:2], high[:2], np.zeros(2))
    _draw_plan(axes, chamber, view, planes, limits)
    dashed = [] if face is None else _draw_face(axes, chamber, view, face)
    text = _scale_in_words(scale)
    what = "Section A–A" if len(planes) == 1 else "Sections A–A and B–B"
    jaws = ", white and hatched: jaws" if has_jaws else ""
    dashes = f", dashed: {' and '.join(dashed)}" if dashed else ""
    return f"{what} and plan, scale {text}{dashes}{jaws}"


def drawing_height(chamber: Chamber, size: Point) -> float:
    """Return the height [mm] that the drawing of a chamber takes of a width and height."""
    return float(_fit(chamber, section_planes(chamber), size).needs[1])


def drawing_scale(chamber: Chamber, size: Point) -> float:
    """Return the scale of the drawing of a chamber in a width and height [mm]."""
    return _fit(chamber, section_planes(chamber), size).scale


def _ends(chamber: Chamber) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest x, y and z of a cavity [mm], (3,) each."""
    mm = 1e3 * chamber.vertices
    return mm.min(axis=0), mm.max(axis=0)


class _Arrangement(NamedTuple):
    """How the views of a chamber lie on a page.

    outside: how much of the part beyond the cavity is drawn in each section, to a side and upwards,
        on the page, (n, 2) [mm].
    needs: width and height of all views [mm].
    is_below: the plan is below the sections, not beside them.
    """

    scale: float
    outside: np.ndarray
    needs: np.ndarray
    is_below: bool


def _fit(chamber: Chamber, planes: Sequence[SectionPlane], size: Point) -> _Arrangement:
    """Return the arrangement with the largest scale at which sections and plan fit on a page.

    Args:
        planes: planes of the sections.
        size: width and height that the drawing may have [mm].
    """
    low, high = _ends(chamber)
    cavity, part = high - low, 1e3 * chamber.part.vertices
    least, most = part.min(axis=0), part.max(axis=0)
    beyond = np.maximum(0.0, [
        (max(low[k] - least[k], most[k] - high[k]), most[2] - high[2])
        for k in (one.right for one in planes)
    ])  # fmt: skip
    for scale in SCALES:
        outside = np.minimum(MOST_OUTSIDE, scale * beyond)
        sections = scale * sum(cavity[one.right] for one in planes) + 2.0 * outside[:, 0].sum()
        sections += 2.0 * len(planes) * BESIDE
        plan = scale * cavity[0] + 2.0 * BESIDE
        high, deep = scale * cavity[2] + outside[:, 1].max() + FACE, scale * cavity[1]
        for is_below, wide, tall in (
            (False, sections + plan, max(high, deep)),
            (True, max(sections, plan), high + deep + ABOVE + BELOW),
        ):
            found = _Arrangement(
                float(scale), outside, np.array([wide, tall + ABOVE + BELOW]), is_below
            )
            if (found.needs <= np.asarray(size)).all():
                return found
    return found._replace(is_below=False)


def _with_limits(text: str, length: float, limits: Limits, *keys: str) -> str:
    """Return the text of a dimension with the tolerance of the key that it shows, if any.

    Args:
        length: the dimension [mm]. A key with another value is not what is drawn.
        keys: keys of [chamber] whose value the dimension may be.
    """
    for key in keys:
        value, low, high = limits.get(key, (math.inf, 0.0, 0.0))
        if abs(value - length) < SAME:
            down, up = value - low, high - value
            if abs(up - down) < 1e-9 * value:
                return f"{text} ±{plain(up)}"
            lower = f"{'−' if down > 0.0 else '+'}{plain(abs(down))}" if down else "0"
            return f"{text} +{plain(up)}/{lower}"
    return text


def _draw_section(
    axes: Axes, chamber: Chamber, view: View, at: float, name: str, limits: Limits
) -> bool:
    """Draw a section. Return whether jaws are in it, which hold the part outside.

    Args:
        at: place of the section's plane [mm].
        name: letter of the section.
        limits: those of draw_chamber.
    """
    other = 1 - view.right
    side = ("length_mm", "width_mm")[view.right]
    lines, row = cut(chamber.vertices, chamber.triangles, other, 1e-3 * at)
    own, _ = cut(chamber.part.vertices, chamber.part.triangles, other, 1e-3 * at)
    window = view.window(axes)
    _fill(axes, view, lines, window, facecolor=ROOM, lw=0.0)
    _fill(axes, view, own, window, facecolor=PART, edgecolor=DARK_GREY, hatch="////", lw=0.5)
    _draw_breaks(axes, view, own)
    has_jaws = "holder" not in chamber.fixtures and _draw_jaws(axes, view, own)
    tags, target = chamber.tags[row], chamber.on_target[row]
    _lines(axes, view, lines[tags == TAG_WALL], BLACK, 1.1)
    _lines(axes, view, lines[tags > TAG_WALL], SONOTRODE, 2.5)
    _lines(axes, view, lines[target], BLUE, 2.0)
    _draw_fixtures(axes, chamber, view, 1e-3 * at)
    (axis_at, y), (_, top) = view.place([[0.0, 0.0], [0.0, view.high[1]]])
    above = top + view.outside[1]
    across_line(axes, (axis_at, y - FACE - 1.0), (axis_at, above + 1.0))
    words = f"{name}–{name}: {'xy'[view.right]} to the right, z up"
    _label(axes, view.corner[0], above + 2.5, words)
    # The sonotrode is a band below its mean face, at z = 0.
    face_wide = 0.0
    face = 1e3 * lines[tags == TAG_SONOTRODE][..., 0]
    if face.size:
        x1, x2 = view.place([[face.min(), 0.0], [face.max(), 0.0]])[:, 0]
        look: Any = {"facecolor": "white", "edgecolor": SONOTRODE, "hatch": "xxxx", "lw": 1.0}
        axes.fill_between([x1, x2], y - FACE, y, **look)
        size = face_size_mm(chamber)
        face_wide = size[0] if len(size) == 1 else float(np.ptp(face))
        text = f"Ø {plain(face_wide)}" if len(size) == 1 else plain(face_wide)
        text = _with_limits(text, face_wide, limits, "diameter_mm", side)
        if len(size) == 1:  # the plane may cut a round face beside its axis
            x1, x2 = view.place([[-0.5 * face_wide, 0.0], [0.5 * face_wide, 0.0]])[:, 0]
        dimension(axes, (x1, y - FACE), (x2, y - FACE), 4.0, text)
    wide = float((view.high - view.low)[0])
    if wide > face_wide + WIDER:
        low, high = view.place([[view.low[0], 0.0], [view.high[0], 0.0]])[:, 0]
        text = _with_limits(plain(wide), wide, limits, side)
        dimension(axes, (low, y - FACE), (high, y - FACE), 8.5, text)
    lowest = 1e3 * chamber.lowest_of_part
    left, low_at = view.place([view.low[0], lowest]) - np.array([view.outside[0], 0.0])
    right = view.place(view.high)[0] + view.outside[0]
    text = _with_limits(plain(lowest), lowest, limits, "sonotrode_distance_mm")
    dimension(axes, (left, y), (left, low_at), 4.5, text, upright=True)
    text = _with_limits(plain(view.high[1]), float(view.high[1]), limits, "height_mm")
    dimension(axes, (right, y), (right, top), -4.5, text, upright=True)
    return has_jaws


def _draw_breaks(axes: Axes, view: View, lines: np.ndarray) -> None:
    """Draw a wave wherever a part is broken off, as it goes on beyond what is drawn of it.

    Args:
        lines: lines of the part's section, (k, 2, 2) [m].
    """
    sides, above = view.outside
    low, high = view.place([view.low, view.high])
    ends = view.place(1e3 * lines)
    for axis, edge, way in (
        (0, low[0] - sides, -BEYOND),
        (0, high[0] + sides, BEYOND),
        (1, high[1] + above, BEYOND),
    ):
        places = _crossings(ends, axis, edge, way)
        for start, end in places[: len(places) // 2 * 2].reshape(-1, 2):
            along = np.linspace(start, end, max(9, int(8.0 * (end - start) / WAVE)))
            wave = edge + BREAK * np.sin(2.0 * np.pi * (along - start) / WAVE)
            x, y = (wave, along) if axis == 0 else (along, wave)
            axes.plot(x, y, color=BLACK, lw=0.6)


def _draw_jaws(axes: Axes, view: View, lines: np.ndarray) -> bool:
    """Draw jaws at both sides of a part, wherever it stands far enough out of the chamber.

    There its sides have to be parallel. Return whether there are any jaws.

    Args:
        lines: lines of the part's section, (k, 2, 2) [m].
    """
    from matplotlib.patches import Rectangle

    (sides, above), has_jaws = view.outside, False
    low, high = view.place([view.low, view.high])
    ends = view.place(1e3 * lines)
    beyond = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    ways = (0, low[0], -1.0, sides), (0, high[0], 1.0, sides), (1, high[1], 1.0, above)
    for axis, wall, way, drawn in ways:
        stands_out = way * (beyond[int(way > 0.0)][axis] - wall)
        if min(drawn, stands_out) < JAWS_FROM + JAWS_LONG:
            continue
        start = wall + way * JAWS_FROM
        zone = np.linspace(start, start + way * JAWS_LONG, JAW_PLACES)
        crossed = [_crossings(ends, axis, place) for place in zone]
        if not all(map(len, crossed)):
            continue
        edges = [(float(one[0]), float(one[-1])) for one in crossed]
        if np.ptp(edges, axis=0).max() > JAWS_OFF:
            continue
        # Sides beyond a line where the part is broken off are not drawn.
        shown = (-math.inf, high[1] + above) if axis == 0 else (low[0] - sides, high[0] + sides)
        if edges[0][0] < shown[0] - JAWS_OFF or edges[0][1] > shown[1] + JAWS_OFF:
            continue
        has_jaws = True
        for edge, outwards in zip(edges[0], (-1.0, 1.0), strict=True):
            corner = min(start, start + way * JAWS_LONG), min(edge, edge + outwards * JAWS_THICK)
            size = JAWS_LONG, JAWS_THICK
            x, wide = (corner, size) if axis == 0 else (corner[::-1], size[::-1])
            look: Any = {"facecolor": "white", "edgecolor": BLACK, "hatch": "\\\\\\\\", "lw": 0.7}
            axes.add_patch(Rectangle(x, *wide, **look))
    return has_jaws


def _crossings(ends: np.ndarray, axis: int, place: float, beyond: float = 0.0) -> np.ndarray:
    """Return where lines cross a place along an axis of the page, in order, (k,) [mm].

    Args:
        ends: of the lines on the page, (n, 2, 2) [mm].
        beyond: how far beyond that place a line has to go on to count [mm].
    """
    one, two = ends[:, 0], ends[:, 1]
    crossing = (one[:, axis] > place + beyond) != (two[:, axis] > place + beyond)
    one, two = one[crossing], two[crossing]
    share = (place - one[:, axis]) / (two - one)[:, axis]
    return np.sort((one + share[:, None] * (two - one))[:, 1 - axis])


def _draw_fixtures(axes: Axes, chamber: Chamber, view: View, at: float) -> None:
    """Draw holder and mask in the section, each with its name and size.

    Args:
        at: place of the section's plane [m].
    """
    window = view.window(axes)
    for name, one in chamber.fixtures.items():
        lines, _ = cut(one.vertices, one.triangles, 1 - view.right, at)
        look: Any = {"facecolor": FIXTURE_COLOURS[name], "edgecolor": BLACK, "lw": 0.7}
        _fill(axes, view, lines, window, hatch="....", **look)
        if len(lines):
            (left, low), (right, high) = view.place(
                1e3 * np.array([lines.min(axis=(0, 1)), lines.max(axis=(0, 1))])
            )
            middle = 0.5 * (left + right), 0.5 * (low + high)
            area = inside(1e3 * lines)
            size = size_in_words(one.kind, [1e3 * side for side in one.size], unit="")
            text = f"{name}\n{size}".strip()
            style: Any = {"size": 5.0, "va": "center", "bbox": LABEL}
            in_body = area is not None and area.contains_point(view.chamber_point(middle))
            if in_body and right - left > SHORT:
                axes.text(middle[0], middle[1], text, ha="center", **style)
            else:
                axes.text(right + 1.0, middle[1], text, ha="left", **style)


def _draw_plan(
    axes: Axes, chamber: Chamber, view: View, planes: Sequence[SectionPlane], limits: Limits
) -> None:
    from matplotlib.collections import PolyCollection

    part, target = chamber.tags == TAG_PART, chamber.on_target
    for colour, rows in ((PART, part & ~target), (TARGET, target)):
        corners = view.place(1e3 * chamber.vertices[chamber.triangles[rows]][:, :, :2])
        seen = PolyCollection(list(corners), facecolors=colour, edgecolors=colour, lw=0.4)
        seen.set_rasterized(True)
        axes.add_collection(seen)
    halfway, row = cut(chamber.vertices, chamber.triangles, 2, 0.5 * chamber.height)
    _lines(axes, view, halfway[chamber.tags[row] == TAG_WALL], BLACK, 0.7)
    face = chamber.triangles[chamber.tags == TAG_SONOTRODE]
    _lines(axes, view, chamber.vertices[border_edges(face)][:, :, :2], SONOTRODE, 1.1)
    (left, bottom), (right, top) = view.place([view.low, view.high])
    x, y = view.place([0.0, 0.0])
    is_upright = False
    for name, plane in zip("AB", planes, strict=False):
        at_x, at_y = view.place([plane.at, plane.at])
        beside = plain(round(abs(plane.at), 1)) if abs(plane.at) > OFF_AXIS else ""
        if plane.right == 0:
            across_line(axes, (left - 3.0, at_y), (right + 3.0, at_y), name=name)
            ends = (left, min(y, at_y)), (left, max(y, at_y))
            if beside:
                dimension(axes, *ends, 8.5, beside, upright=True)
        else:
            across_line(axes, (at_x, bottom - 3.0), (at_x, top + 3.0), name=name)
            ends = (min(x, at_x), top), (max(x, at_x), top)
            if beside:
                dimension(axes, *ends, -3.5, beside)
            is_upright = True
    if len(planes) == 1:  # the other axis, and the length that the section does not show
        across = planes[0].right
        if across == 0:
            across_line(axes, (x, bottom - 1.0), (x, top + 1.0))
        else:
            across_line(axes, (left - 1.0, y), (right + 1.0, y))
        length = float((view.high - view.low)[1 - across])
        text = _with_limits(plain(length), length, limits, ("width_mm", "length_mm")[across])
        if len(face_size_mm(chamber)) > 1 and across == 0:
            dimension(axes, (right, bottom), (right, top), -9.5, text, upright=True)
        elif len(face_size_mm(chamber)) > 1:
            dimension(axes, (left, bottom), (right, bottom), 9.5, text)
    _label(axes, left, top + (6.5 if is_upright else 2.5), "plan: x to the right, y up")


def _draw_face(axes: Axes, chamber: Chamber, view: View, face: Face) -> list[str]:
    """Draw the joints between blocks on the floor, and the rim of a face that goes beyond it.

    Return what was drawn, in words.
    """
    from matplotlib.patches import Rectangle
    from matplotlib.path import Path
    from matplotlib.transforms import Bbox

    floor = chamber.triangles[chamber.tags == TAG_SONOTRODE]
    area = inside(1e3 * chamber.vertices[border_edges(floor)][:, :, :2])
    assert area is not None
    in_view = type(area)(view.place(area.vertices), area.codes)
    look: dict[str, Any] = {"ls": (0, (6, 2)), "lw": 0.8}
    for axis, places in enumerate(face.joints_mm):
        for at in places:
            ends = np.array([view.low, view.high])
            ends[:, axis] = at
            (line,) = axes.plot(*view.place(ends).T, color=SONOTRODE, **look)
            line.set_clip_path(in_view, axes.transData)
    found = ["the joints of the floor's blocks"] if face.count > 1 else []
    if (np.array(face.sides_mm) > np.ptp(area.vertices, axis=0) + WIDER).any():
        rim = view.place(1e3 * face.outline[[*range(len(face.outline)), 0]])
        low, high = view.place(np.array([view.low, view.high])) + np.array(FREE)
        if Path(rim).intersects_bbox(Bbox([low, high]), filled=False):
            (line,) = axes.plot(*rim.T, color=SONOTRODE, zorder=0.5, **look)  # below words
            line.set_clip_path(Rectangle(tuple(low), *(high - low), transform=axes.transData))
            found.append("the sonotrode's rim")
    return found


def _fill(axes: Axes, view: View, lines: np.ndarray, window: Rectangle, **look: Any) -> None:
    from matplotlib.patches import PathPatch

    area = inside(1e3 * lines)
    if area is not None:
        patch = PathPatch(type(area)(view.place(area.vertices), area.codes), **look)
        axes.add_patch(patch)
        patch.set_clip_path(window)


def _lines(axes: Axes, view: View, lines: np.ndarray, colour: str, width: float) -> None:
    from matplotlib.collections import LineCollection

    if len(lines):
        drawn = LineCollection(list(view.place(1e3 * lines)), colors=colour, linewidths=width)
        drawn.set_capstyle("round")
        axes.add_collection(drawn)


def _label(axes: Axes, x: float, y: float, text: str) -> None:
    axes.text(x, y, text, size=6.5, color=DARK_GREY, va="bottom", bbox=LABEL)


OPENINGS_A_ROW = 2
CAPTION = 14.0  # mm, of the words above the outline of an opening, and of the places of corners
# Of an outline: turn of two sides at a corner, and of those in a straight line [rad]; how far an
# arc may be off a circle, over its radius; corners that are told at most; and mm on paper between
# two, and of the tick at each.
CORNER, STRAIGHT, OFF_CIRCLE, MOST_CORNERS, APART, TICK = 0.35, 1e-3, 0.01, 8, 2.5, 2.0
ENDS = 0.15  # mm from an end of the outline up to which a corner is at it


def draw_openings(
    axes: Axes, openings: Sequence[tuple[str, Opening]], left: float, top: float, size: Point
) -> str:
    """Draw the outlines of openings with their two dimensions, and return their scale in words.

    Args:
        axes: axes of the whole page, in mm.
        openings: openings with an outline, each with its words.
        left, top: upper left corner of the drawing.
        size: width and height that it may have.
    """
    room = size[0] / OPENINGS_A_ROW - 2.0 * BESIDE
    rows = [openings[k : k + OPENINGS_A_ROW] for k in range(0, len(openings), OPENINGS_A_ROW)]
    wide = 1e3 * max(one.size[0] for _, one in openings)
    tall = [1e3 * max(one.size[1] for _, one in row) for row in rows]
    words = len(rows) * (CAPTION + BELOW)
    scale = next(
        (x for x in SCALES if x * wide <= room and x * sum(tall) + words <= size[1]), SCALES[-1]
    )
    y = top
    for row, height in zip(rows, tall, strict=True):
        low = y - CAPTION - scale * height
        for column, (text, one) in enumerate(row):
            x = left + column * size[0] / OPENINGS_A_ROW + BESIDE
            _draw_opening(axes, one, (x, low), scale)
            axes.text(x, y, text, size=SIZE, va="top", parse_math=False)
        y = low - BELOW
    return _scale_in_words(scale)


def _draw_opening(axes: Axes, one: Opening, corner: Point, scale: float) -> None:
    """Draw the outline of an opening above and right of a corner on the page [mm]."""
    assert one.outline is not None
    half = 500.0 * np.array(one.size)
    view = View(0, scale, np.array(corner), -half, half, np.zeros(2))
    edges = _closing(one.outline)
    closed = np.concatenate([one.outline, edges])
    look: Any = {"facecolor": PART, "edgecolor": DARK_GREY, "hatch": "////", "lw": 0.0}
    _fill(axes, view, closed, view.window(axes), **look)
    _lines(axes, view, one.outline, BLACK, 1.1)
    for line in view.place(1e3 * edges):
        axes.plot(*line.T, color=BLACK, lw=0.6, ls=(0, (4, 3)))
    (x1, y1), (x2, y2) = view.place([-half, half])
    wide, tall = (plain(round(float(2.0 * side), 1)) for side in half)
    dimension(axes, (x1, y1), (x2, y1), 5.0, wide)
    dimension(axes, (x1, y1), (x1, y2), 5.0, tall, upright=True)
    corners, arc = _corners(one.outline)
    for k, (start, far) in enumerate(((x1, y2), (y1, x2))):
        places = np.unique(np.round(1e3 * corners[:, k] + half[k], 1))
        places = places[(places > ENDS) & (places < 2.0 * half[k] - ENDS)]  # dimensioned already
        _ordinates(axes, places, start, far, scale, upright=k == 1)
    if len(arc) and (circle := _circle(arc)) is not None:
        middle, radius = circle
        ((x, y),) = view.place([1e3 * middle])
        axes.text(
            x, y, f"Ø {plain(round(2e3 * radius, 1))}", size=SIZE, ha="center", va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0}, parse_math=False,
        )  # fmt: skip


def _corners(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of an outline (n, 2), and the sides (k, 2, 2) of its arcs.

    An outline that ends at an edge of its wall has corners there.
    """
    along = outline[:, 1] - outline[:, 0]
    way = np.arctan2(along[:, 1], along[:, 0])
    start = {tuple(side[0]): k for k, side in enumerate(outline)}
    after = np.array([start.get(tuple(side[1]), -1) for side in outline])
    turn = np.abs((way[after] - way + np.pi) % (2.0 * np.pi) - np.pi)
    is_corner = (after < 0) | (turn > CORNER)
    follows = set(after.tolist())
    loose = [side[0] for k, side in enumerate(outline) if k not in follows]
    corners = np.concatenate([outline[is_corner, 1], np.reshape(loose, (-1, 2))])
    bends = (after >= 0) & (turn > STRAIGHT) & ~is_corner
    is_arc = bends.copy()
    is_arc[after[bends]] = True
    return corners, outline[is_arc]


def _circle(arc: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return middle and radius of the circle on which arcs lie, None if they lie on no one circle.

    Args:
        arc: sides (k, 2, 2) [m].
    """
    middle, radius = fitted_circle(arc.reshape(-1, 2))
    off = np.abs(np.linalg.norm(arc.reshape(-1, 2) - middle, axis=1) - radius).max()
    length = np.linalg.norm(arc[:, 1] - arc[:, 0], axis=1).sum()
    return (middle, radius) if off < OFF_CIRCLE * radius and length > radius else None


def _ordinates(
    axes: Axes, places: np.ndarray, start: float, far: float, scale: float, upright: bool
) -> None:
    """Write how far corners are from an end of an outline, with a tick each, at its far side.

    Args:
        places: distances from that end [mm], rising.
        start, far: place of the end along the page, and of the far side across it.
        upright: True for distances upwards, at the right; False for those to the right, above.
    """
    last = -math.inf
    for place in places.tolist() if len(places) <= MOST_CORNERS else ():
        at = start + scale * place
        if at - last < APART:
            continue
        last = at
        ends = [(far, at), (far + TICK, at)] if upright else [(at, far), (at, far + TICK)]
        axes.plot(*zip(*ends, strict=True), color=DARK_GREY, lw=WIDTH)
        look: Any = {"ha": "left", "va": "center"}
        if not upright:
            look = {"ha": "center", "va": "bottom", "rotation": 90.0}
        text = plain(round(place, 1))
        x, y = ends[1]
        axes.text(x, y, f" {text}", size=5.5, color=DARK_GREY, parse_math=False, **look)


def _closing(outline: np.ndarray) -> np.ndarray:
    """Return the lines that close an outline where the part goes on over an edge of its wall.

    Args:
        outline: directed sides (k, 2, 2), all round the part in the same sense.
    Returns:
        Lines (n, 2, 2), one from the end of each open row of sides.
    """
    following = {tuple(one): tuple(two) for one, two in outline.tolist()}
    starts = [one for one in following if one not in {*following.values()}]
    last = {}
    for one in starts:
        end = one
        while end in following:
            end = following[end]
        last[one] = end
    lines = [
        (end, min([x for x in starts if x != own] or [own], key=lambda x: math.dist(x, end)))
        for own, end in last.items()
    ]
    return np.array(lines).reshape(-1, 2, 2)


def _scale_in_words(scale: float) -> str:
    return f"{plain(scale)}:1" if scale >= 1.0 else f"1:{plain(1.0 / scale)}"
