"""Draw the outlines of openings of walls with their dimensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.geometry.outline import fitted_circle
from chamberopt.pictures.charts.colours import BLACK, DARK_GREY
from chamberopt.pictures.drawing.arrangement import BELOW, BESIDE, SCALES, scale_in_words
from chamberopt.pictures.drawing.cuts import inside
from chamberopt.pictures.drawing.dimensions import SIZE, WIDTH, Point, dimension
from chamberopt.pictures.drawing.view import PART, View, draw_lines, fill

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.chamber.checks.openings import Opening

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
    return scale_in_words(scale)


def _draw_opening(axes: Axes, one: Opening, corner: Point, scale: float) -> None:
    """Draw the outline of an opening above and right of a corner on the page [mm]."""
    assert one.outline is not None
    half = 500.0 * np.array(one.size)
    view = View(0, scale, np.array(corner), -half, half, np.zeros(3))
    edges = _closing(one.outline)
    closed = np.concatenate([one.outline, edges])
    look: Any = {"facecolor": PART, "edgecolor": DARK_GREY, "hatch": "////", "lw": 0.0}
    fill(axes, view, inside(1e3 * closed), view.window(axes), **look)
    draw_lines(axes, view, one.outline, BLACK, 1.1)
    for line in view.place(1e3 * edges):
        axes.plot(*line.T, color=BLACK, lw=0.6, ls=(0, (4, 3)))
    (x1, y1), (x2, y2) = view.place([-half, half])
    wide, tall = (plain(round(float(2.0 * side), 1)) for side in half)
    dimension(axes, (x1, y1), (x2, y1), 5.0, wide)
    dimension(axes, (x1, y1), (x1, y2), 5.0, tall, upright=True)
    corners, _ = _corners(one.outline)
    for k, (start, far) in enumerate(((x1, y2), (y1, x2))):
        places = np.unique(np.round(1e3 * corners[:, k] + half[k], 1))
        places = places[(places > ENDS) & (places < 2.0 * half[k] - ENDS)]  # dimensioned already
        _ordinates(axes, places, start, far, scale, upright=k == 1)
    if (circle := round_of(one.outline)) is not None:
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


def round_of(outline: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return middle (2,) and radius [m] of the circle on which all arcs of an outline lie, if any.

    Args:
        outline: directed sides (k, 2, 2) [m].
    """
    _, arc = _corners(outline)
    if not len(arc):
        return None
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
