"""Draw the section of a chamber with what holds its part, and its dimensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.checks.openings import find_openings, walls_end_at
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.chamber.fixture import size_in_words
from chamberopt.chamber.layout.grip import outside_clamp
from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.design.shape_surface import TAG_SONOTRODE, TAG_WALL
from chamberopt.pictures.charts.colours import BLACK, BLUE, DARK_GREY, FIXTURE_COLOURS, SONOTRODE
from chamberopt.pictures.drawing.arrangement import FACE, WALL
from chamberopt.pictures.drawing.centres import centres, distinct
from chamberopt.pictures.drawing.cuts import SAME, SectionPlane, cut, face_size_mm, inside
from chamberopt.pictures.drawing.dimensions import (
    SHORT,
    Limits,
    across_line,
    dimension,
    fits_in_line,
    reference,
    toleranced,
    with_limits,
)
from chamberopt.pictures.drawing.view import LABEL, PART, View, draw_lines, fill, label
from chamberopt.pictures.drawing.walls import draw_walls

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely.geometry.base import BaseGeometry

    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.design.fixture import OpeningCut
    from chamberopt.pictures.drawing.dimensions import Point

WIDER = 0.1  # mm: a cavity that is wider than its sonotrode by more has its own dimension
BEYOND = 0.1  # mm on paper that a part goes on at least where it is broken off
BREAK, WAVE = 0.5, 3.0  # mm, height and length of the waves of a line where the part is broken off
# mm on paper: jaws that hold the part outside begin so far from the wall, are so long where it
# stands out so far, as long as that at least, and so thick.
JAWS_FROM, JAWS_LONG, JAWS_LEAST, JAWS_THICK = 2.5, 4.0, 2.0, 2.0
# They are drawn where the part's sides are parallel, at so many places, within so many mm on paper.
JAW_PLACES, JAWS_OFF = 5, 0.2
INSIDE = 1e-3  # mm on paper: so far inside of its end a part is looked at
JAWS = "xxxxxx"  # their hatch
OF_JAWS: dict[str, Any] = {"facecolor": "white", "edgecolor": BLACK, "hatch": JAWS, "lw": 0.7}
PRESSED = 0.9  # cosine from which on jaws press along an axis
# mm on paper from the walls to the first dimension of a height, and to each further one.
FIRST_ROW, ROWS = 4.0, 4.2
CROSS = 4.0  # mm on paper, of the lines that cross in the middle of an opening
MOST_CENTRES = 1  # heights of openings on each side of a section
# mm on paper, of a name of a holder: width of a letter, height of a line, room beside it, and
# between it and the walls
LETTER, LINE, BESIDE_NAME, EDGE = 1.0, 2.2, 1.0, 0.5
# mm on paper, from the part to the dimension of the opening above it, and what that takes more
# where its text stands above its line
OPENING, ABOVE_LINE = 3.0, 1.2
ROOM = "#e8f1f7"


def draw_section(
    axes: Axes,
    chamber: Chamber,
    view: View,
    planes: Sequence[SectionPlane],
    number: int,
    limits: Limits,
    opening: OpeningCut,
) -> bool:
    """Draw a section. Return whether jaws or clamps are in it, which hold the part outside.

    Args:
        planes: planes of all sections.
        number: of this section among them, from 0.
        limits, opening: those of draw_chamber.
    """
    at, name = planes[number].at, "AB"[number]
    other = 1 - view.right
    side = ("length_mm", "width_mm")[view.right]
    lines, row = cut(chamber.vertices, chamber.triangles, other, 1e-3 * at)
    own, _ = cut(chamber.part.vertices, chamber.part.triangles, other, 1e-3 * at)
    window = view.window(axes)
    fill(axes, view, inside(1e3 * lines), window, facecolor=ROOM, lw=0.0)
    draw_walls(axes, chamber, view, other, 1e-3 * at)
    look: Any = {"facecolor": PART, "edgecolor": DARK_GREY, "hatch": "////", "lw": 0.5}
    fill(axes, view, inside(1e3 * own), window, **look)
    _draw_breaks(axes, view, own)
    has_jaws = "holder" not in chamber.fixtures
    if has_jaws and walls_end_at(find_openings(chamber)) is not None:
        has_jaws = _draw_clamps(axes, chamber, view, own)
    elif has_jaws:
        has_jaws = _draw_jaws(axes, chamber, view, own)
    tags, target = chamber.tags[row], chamber.on_target[row]
    draw_lines(axes, view, lines[tags == TAG_WALL], BLACK, 1.1)
    draw_lines(axes, view, lines[tags > TAG_WALL], SONOTRODE, 2.5)
    draw_lines(axes, view, lines[target], BLUE, 2.0)
    named = _draw_fixtures(axes, chamber, view, 1e-3 * at, inside(1e3 * lines))
    (axis_at, y), (_, top) = view.place([[0.0, 0.0], [0.0, view.high[1]]])
    *sides, above = np.maximum(view.outside, WALL).tolist()
    above += float(top)
    across_line(axes, (axis_at, y - FACE - 1.0), (axis_at, above + 1.0))
    words = f"{name}–{name}: {'xy'[view.right]} to the right, z up"
    dimensioned = _draw_ceiling(axes, chamber, view, above, opening)
    label(axes, view.corner[0], max(above + 2.5 + dimensioned, named + BESIDE_NAME), words)
    # The sonotrode is a band below its mean face, at z = 0.
    face_wide = 0.0
    face = 1e3 * lines[tags == TAG_SONOTRODE][..., 0]
    if face.size:
        x1, x2 = view.place([[face.min(), 0.0], [face.max(), 0.0]])[:, 0]
        look = {"facecolor": "white", "edgecolor": SONOTRODE, "hatch": "xxxx", "lw": 1.0}
        axes.fill_between([x1, x2], y - FACE, y, **look)
        size = face_size_mm(chamber)
        face_wide = size[0] if len(size) == 1 else float(np.ptp(face))
        text = f"Ø {plain(face_wide)}" if len(size) == 1 else plain(face_wide)
        text = with_limits(text, face_wide, limits, "diameter_mm", side)
        if len(size) == 1:  # the plane may cut a round face beside its axis
            x1, x2 = view.place([[-0.5 * face_wide, 0.0], [0.5 * face_wide, 0.0]])[:, 0]
        dimension(axes, (x1, y - FACE), (x2, y - FACE), 4.0, text)
    wide = float((view.high - view.low)[0])
    if wide > face_wide + WIDER:
        low, high = view.place([[view.low[0], 0.0], [view.high[0], 0.0]])[:, 0]
        text = with_limits(plain(wide), wide, limits, side)
        dimension(axes, (low, y - FACE), (high, y - FACE), 8.5, text)
    lowest, high = 1e3 * chamber.lowest_of_part, float(view.high[1])
    text = with_limits(plain(lowest), lowest, limits, "sonotrode_distance_mm")
    total = with_limits(plain(high), high, limits, "height_mm")
    if abs(high - lowest) < SAME:  # the part is the ceiling
        total = reference(plain(high))
    heights = _draw_centres(axes, chamber, view, planes, [lowest, high])
    if "holder" in chamber.fixtures and any(heights.values()):  # its axis is what is made
        text = reference(plain(lowest))
        heights = {
            side: [(z, _as_far(z, lowest, limits)) for z, _ in found]
            for side, found in heights.items()
        }
    for way, wall, out, rows in (
        (-1, view.low, sides[0], [(lowest, text), *heights[-1]]),
        (1, view.high, sides[1], [*heights[1], (high, total)]),
    ):
        x = view.place(wall)[0] + way * out
        for number, (height, words) in enumerate(rows):
            away = -way * (FIRST_ROW + number * ROWS)
            end = x, view.place([0.0, height])[1]
            dimension(axes, (x, y), end, away, words, upright=True)
    return has_jaws


def _as_far(height: float, lowest: float, limits: Limits) -> str:
    """Return the text of the height of a holder's axis, with the tolerance of the part's distance.

    Args:
        height, lowest: of the axis and of the part's lowest point [mm].
    """
    value, *ends = limits.get("sonotrode_distance_mm", (lowest, lowest, lowest))
    low, high = (height + end - value for end in ends)
    shown = plain(round(height, 1))
    return toleranced(shown, height, low, high) if high > low else shown


def _draw_ceiling(
    axes: Axes, chamber: Chamber, view: View, above: float, opening: OpeningCut
) -> float:
    """Dimension the opening of the ceiling above a section. Return its height there [mm on paper].

    Args:
        above: height on the page of the part's upper end [mm].
        opening: how it is cut.
    """
    room = float((view.high - view.low)[0])
    for one in find_openings(chamber):
        wide = 1e3 * one.size[view.right] + 2.0 * opening.clearance_mm
        if one.wall == CEILING and one.form in ("rectangle", "round") and wide < room - WIDER:
            middle, top = 1e3 * one.place[view.right], float(view.high[1])
            ends = view.place([[middle - 0.5 * wide, top], [middle + 0.5 * wide, top]])
            (low, y), (high, _) = ends.tolist()
            text = f"{'Ø ' * (one.form == 'round')}{plain(round(wide, 1))}"
            text = f"{text} {opening.limits_in_words}".strip()
            dimension(axes, (low, y), (high, y), y - above - OPENING, text)
            return OPENING if fits_in_line(high - low, text) else OPENING + ABOVE_LINE
    return 0.0


def _draw_centres(
    axes: Axes, chamber: Chamber, view: View, planes: Sequence[SectionPlane], known: Sequence[float]
) -> dict[int, list[tuple[float, str]]]:
    """Draw the axes of holder and openings that go out sideways.

    Return their heights [mm] with the words of their dimensions, to the left (-1) and right (1).
    One that is seen from its end is dimensioned to the left, unless the other section has it.

    Args:
        known: heights that are dimensioned anyway [mm].
    """
    heights: dict[int, list[float]] = {-1: [], 1: []}
    (low, _), (high, _) = view.place([view.low, view.high])
    for one in centres(chamber):
        z = one.place[2]
        x, y = view.place([one.place[view.right], z])
        if one.axis == view.right:
            x = high if one.outwards > 0 else low
            across_line(axes, (x - CROSS, y), (x + CROSS, y))
            heights[one.outwards].append(z)
        elif one.axis == 1 - view.right and one.axis not in [plane.right for plane in planes]:
            across_line(axes, (low - WALL, y), (x + CROSS, y))
            across_line(axes, (x, y - CROSS), (x, y + CROSS))
            heights[-1].append(z)
    found = {1: distinct(heights[1], known)}
    found[-1] = distinct(heights[-1], [*known, *found[1]])
    return {
        side: [(one, plain(round(one, 1))) for one in several[:MOST_CENTRES]]
        for side, several in found.items()
    }


def _draw_breaks(axes: Axes, view: View, lines: np.ndarray) -> None:
    """Draw a wave wherever a part is broken off, as it goes on beyond what is drawn of it.

    Args:
        lines: lines of the part's section, (k, 2, 2) [m].
    """
    left, right, above = view.outside
    low, high = view.place([view.low, view.high])
    ends = view.place(1e3 * lines)
    for axis, edge, way in (
        (0, low[0] - left, -BEYOND),
        (0, high[0] + right, BEYOND),
        (1, high[1] + above, BEYOND),
    ):
        places = _crossings(ends, axis, edge, way)
        for start, end in places[: len(places) // 2 * 2].reshape(-1, 2):
            along = np.linspace(start, end, max(9, int(8.0 * (end - start) / WAVE)))
            wave = edge + BREAK * np.sin(2.0 * np.pi * (along - start) / WAVE)
            x, y = (wave, along) if axis == 0 else (along, wave)
            axes.plot(x, y, color=BLACK, lw=0.6)


def _draw_jaws(axes: Axes, chamber: Chamber, view: View, lines: np.ndarray) -> bool:
    """Draw jaws at both sides of a part, wherever it stands far enough out of the chamber.

    There its sides have to be parallel. Where flat faces are clamped, jaws are on these alone.
    Return whether there are any jaws.

    Args:
        lines: lines of the part's section, (k, 2, 2) [m].
    """
    from matplotlib.patches import Rectangle

    (left, right, above), has_jaws = view.outside, False
    pressed = outside_clamp(chamber).way
    low, high = view.place([view.low, view.high])
    ends = view.place(1e3 * lines)
    beyond = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    ways = (0, low[0], -1.0, left), (0, high[0], 1.0, right), (1, high[1], 1.0, above)
    for axis, wall, way, drawn in ways:
        stands_out = way * (beyond[int(way > 0.0)][axis] - wall)
        press = 2 if axis == 0 else view.right
        is_held = pressed is None or abs(pressed[press]) > PRESSED
        long = min(JAWS_LONG, drawn - JAWS_FROM, stands_out - JAWS_FROM)
        if not is_held or long < JAWS_LEAST:
            continue
        start = wall + way * JAWS_FROM
        zone = np.linspace(start, start + way * (long - INSIDE), JAW_PLACES)
        crossed = [_crossings(ends, axis, place) for place in zone]
        if not all(map(len, crossed)):
            continue
        edges = [(float(one[0]), float(one[-1])) for one in crossed]
        if np.ptp(edges, axis=0).max() > JAWS_OFF:
            continue
        # Sides beyond a line where the part is broken off are not drawn.
        shown = (-math.inf, high[1] + above) if axis == 0 else (low[0] - left, high[0] + right)
        if edges[0][0] < shown[0] - JAWS_OFF or edges[0][1] > shown[1] + JAWS_OFF:
            continue
        has_jaws = True
        for edge, outwards in zip(edges[0], (-1.0, 1.0), strict=True):
            corner = min(start, start + way * long), min(edge, edge + outwards * JAWS_THICK)
            size = long, JAWS_THICK
            x, wide = (corner, size) if axis == 0 else (corner[::-1], size[::-1])
            axes.add_patch(Rectangle(x, *wide, **OF_JAWS))
    return has_jaws


def _draw_clamps(axes: Axes, chamber: Chamber, view: View, lines: np.ndarray) -> bool:
    """Draw a clamp on the part over each wall on which it lies. Return whether there is any.

    Args:
        lines: lines of the part's section, (k, 2, 2) [m].
    """
    from matplotlib.patches import Rectangle

    ends, has_clamps = view.place(1e3 * lines), False
    low, high = view.place([view.low, view.high])
    for way, wall in ((-1.0, low[0]), (1.0, high[0])):
        middle = wall + 0.5 * way * WALL
        crossed = _crossings(ends, 0, middle)
        lies = any(one.is_end and way * one.way[view.right] > PRESSED for one in _aside(chamber))
        if lies and len(crossed):
            corner = middle - 0.5 * JAWS_LONG, float(crossed[-1])
            axes.add_patch(Rectangle(corner, JAWS_LONG, JAWS_THICK, **OF_JAWS))
            has_clamps = True
    return has_clamps


def _aside(chamber: Chamber) -> list[Opening]:
    """Return the openings of a chamber's side walls."""
    return [one for one in find_openings(chamber) if one.wall != CEILING]


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


def _draw_fixtures(
    axes: Axes, chamber: Chamber, view: View, at: float, room: BaseGeometry
) -> float:
    """Draw holder and mask in the section, each with its name and size.

    Return the height on the page up to which names stand above the room [mm]; 0 if none does.

    Args:
        at: place of the section's plane [m].
        room: what is left for the shot in the section [mm of the chamber].
    """
    window, top = view.window(axes), 0.0
    for name, one in chamber.fixtures.items():
        lines, _ = cut(one.vertices, one.triangles, 1 - view.right, at)
        look: Any = {"facecolor": FIXTURE_COLOURS[name], "edgecolor": BLACK, "lw": 0.7}
        area = inside(1e3 * lines)
        fill(axes, view, area, window, hatch="....", **look)
        if len(lines):
            size = size_in_words(one.kind, [1e3 * side for side in one.size], unit="")
            text = f"{name}\n{size}".strip()
            place, is_above = _place_of_name(view, text, area, room)
            axes.text(*place, text, size=5.0, bbox=LABEL, ha="center", va="center")
            if is_above:
                top = max(top, place[1] + 0.5 * _size_of_name(text)[1])
    return top


def _size_of_name(text: str) -> Point:
    """Return width and height of a name of a holder or mask on the page [mm]."""
    rows = text.split("\n")
    return LETTER * max(map(len, rows)), LINE * len(rows)


def _place_of_name(
    view: View, text: str, area: BaseGeometry, room: BaseGeometry
) -> tuple[Point, bool]:
    """Return the middle of the name of a holder or mask on the page [mm].

    It is on the body, or near it in the room, where nothing else is. If there is no such place, it
    is above the body, whatever is there, and the second value is true.

    Args:
        area, room: what the body takes of the section, and what the shot does [mm of the chamber].
    """
    import shapely

    wide, tall = _size_of_name(text)
    left, low, right, high = view.place(np.reshape(area.bounds, (2, 2))).ravel().tolist()
    x, y = 0.5 * (left + right), 0.5 * (low + high)
    if right - left > max(SHORT, wide) and area.contains(shapely.Point(view.chamber_point((x, y)))):
        return (x, y), False
    before, behind = left - 0.5 * wide - BESIDE_NAME, right + 0.5 * wide + BESIDE_NAME
    under, over = low - 0.5 * tall - BESIDE_NAME, high + 0.5 * tall + BESIDE_NAME
    ends = right - 0.5 * wide - EDGE, left + 0.5 * wide + EDGE
    places = [(behind, y), (before, y), *((one, z) for z in (under, over) for one in ends)]
    for place in places:
        corners = [
            view.chamber_point((place[0] + k * 0.5 * wide, place[1] + k * 0.5 * tall))
            for k in (-1.0, 1.0)
        ]
        if room.contains(shapely.box(*corners[0], *corners[1])):
            return place, False
    walls = view.place([view.low, view.high])[:, 0]
    above = high + WALL + EDGE + 0.5 * tall
    return (min(x, walls[1] - 0.5 * wide - EDGE), above), True
