"""Compute plane cuts of meshes, the areas inside them, and the sonotrode's size for drawings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import EDGE, find_openings
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import border_edges, connected_pieces
from sim_core import computed_once

if TYPE_CHECKING:
    from matplotlib.path import Path
    from shapely import Point
    from shapely.geometry.base import BaseGeometry

    from chamberopt.chamber.build import Chamber

# Shift of the plane [m], so that it goes through no corner of a mesh.
OFF_THE_CORNERS = 1.7e-8
SAME = 0.02  # mm: lengths that differ by less count as equal
FEWEST_CORNERS = 8  # of a face that is drawn as round
TRIED = 16  # planes in each direction
ENOUGH = 0.8  # share of the part's outline that one section must show; below it there are two
# Weights of the area of the cut, and of the line of the target in it, beside its span.
AREA, OUTLINE = 0.5, 0.5
# Share of a score that counts off the chamber's axis, and of the best score from which on the plane
# along the longer side is taken.
AS_GOOD = 0.9
EVEN = 0.02  # of the width: most distance of a cut's centroid from its middle
SQUARE = 0.7  # cosine between a wall's normal and an axis, from which on the wall is across it
SPECK = 1e-3  # share of the cut area below which a piece is none


@dataclass(frozen=True)
class SectionPlane:
    """An upright plane in which a chamber is cut for a drawing.

    right: axis of the chamber (0, 1) that points to the right in the section.
    at: place of the plane on the other horizontal axis [mm].
    span: product of the shares of the part's width and height between the ends of its cut.
    """

    right: int
    at: float
    span: float


@computed_once(4)
def section_planes(chamber: Chamber) -> list[SectionPlane]:
    """Return one plane that shows the part best, or two across each other if one does not do.

    Of planes that show the part about alike, the one through the chamber's axis is taken, or
    through the part's middle, best along the longer side of the chamber. It is taken too where it
    shows most of the part in one piece, or its two sides alike, as of a ring. Planes that miss the
    target are taken only if all do, and then planes off the middle with pieces that seem to float.
    There is a second one too, through the axis, where the first does not show how the part goes
    out: the walls that it goes out through, or a lid, as it is as wide as the room.
    """
    size = np.ptp(chamber.vertices, axis=0)
    longer = int(size[1] > size[0] + 1e-3 * SAME)
    found = every = [_planes(chamber, right) for right in (longer, 1 - longer)]
    for shows in (_shows_target, lambda one: one.is_central or _is_whole(one)):
        showing = [[one for one in planes if shows(one)] for planes in found]
        found = [planes for planes in showing if planes] or found
    cuts = [one for planes in found for one in planes]
    most = max(one.area for one in cuts) or 1.0, max(one.target for one in cuts) or 1.0
    best = [_best_cut(planes, most) for planes in found]
    top = max(score for _, score in best)
    best.sort(key=lambda one: (one[1] < AS_GOOD * top, not one[0].is_central))
    planes = [one.plane for one, _ in best]
    if planes[0].span >= ENOUGH and _hides_way_out(chamber, planes[0].right):
        return [planes[0], every[int(planes[0].right == longer)][0].plane]
    return planes[: 1 if planes[0].span >= ENOUGH else 2]


def _hides_way_out(chamber: Chamber, right: int) -> bool:
    """Return whether a section along an axis shows no wall that the part goes out through.

    Walls across the section are not in it. Nor is a lid, if an opening of the ceiling leaves none
    beside the part along the axis.
    """
    room = float(np.ptp(chamber.vertices[:, right]))
    openings = find_openings(chamber)
    through = [one for one in openings if one.wall != CEILING and not one.is_end]
    lids = [one for one in openings if one.wall == CEILING]
    return any(abs(one.way[1 - right]) > SQUARE for one in through) or any(
        one.size[right] > room - EDGE and one.size[1 - right] > EDGE for one in lids
    )


class _Cut(NamedTuple):
    """A plane, and what of the part is in it."""

    plane: SectionPlane
    area: float  # [m²]
    target: float  # length of the target's line [m]
    pieces: int  # in which the part is seen
    is_central: bool  # through the chamber's axis, or through the middle of the part
    is_even: bool  # as much of the part is on either side of the middle, where nothing is


def _shows_target(one: _Cut) -> bool:
    return one.target > 0.0


def _is_whole(one: _Cut) -> bool:
    return one.pieces == 1 or one.is_even


def _best_cut(planes: list[_Cut], most: tuple[float, float]) -> tuple[_Cut, float]:
    """Return the best of parallel planes with its score, of which central ones have an advantage.

    Args:
        planes: the planes.
        most: largest of all areas and lengths, also of the planes across.
    """
    area, length = most

    def score(one: _Cut) -> float:
        own = one.plane.span + AREA * one.area / area + OUTLINE * one.target / length
        return own if one.is_central else AS_GOOD * own

    best = max(planes, key=score)  # the first of equal ones
    whole = [
        one
        for one in planes
        if one.is_central and _is_whole(one) and one.plane.span >= ENOUGH * best.plane.span
    ]
    if not best.is_central and whole:
        best = max(whole, key=score)
    return best, score(best)


def _planes(chamber: Chamber, right: int) -> list[_Cut]:
    """Return parallel planes through the part.

    The plane through the chamber's axis is the first if it meets the part there. The next is the
    plane through the middle of the part in the chamber.
    """
    part, other = chamber.part, 1 - right
    inside = chamber.vertices[np.unique(chamber.triangles[chamber.tags == TAG_PART])]
    low, high = inside[:, other].min(), inside[:, other].max()
    central = [0.0] * bool(low < 0.0 < high) + [0.5 * float(low + high)]
    places = [*central, *np.linspace(low, high, TRIED + 2)[1:-1]]
    whole, found = np.ptp(part.vertices[:, [right, 2]], axis=0), []
    for number, at in enumerate(places):
        lines, cut_ones = cut(part.vertices, part.triangles, other, at)
        ends = lines.reshape(-1, 2)
        span = float(np.prod(np.ptp(ends, axis=0) / whole)) if len(ends) else 0.0
        area = abs(float(_turned(lines).sum()))
        plane = SectionPlane(right, 1e3 * float(at), span)
        on_target = np.linalg.norm(np.diff(lines[part.target[cut_ones]], axis=1), axis=2)
        is_central = number < len(central)
        pieces, is_even = _pieces(lines), _is_even(lines)
        found.append(_Cut(plane, area, float(on_target.sum()), pieces, is_central, is_even))
    return found


def _turned(lines: np.ndarray) -> np.ndarray:
    """Return the area to the left of each line of a cut, seen from the origin, (k,) [m²].

    The lines go round the part, so that by the shoelace formula the sum is the area of the cut,
    whatever their order.
    """
    (x1, y1), (x2, y2) = lines[:, 0].T, lines[:, 1].T
    return np.asarray(0.5 * (x1 * y2 - x2 * y1))


def _is_even(lines: np.ndarray) -> bool:
    """Return whether a cut with lines (k, 2, 2) has two sides alike, and nothing between them.

    The centroid of those of a ring lies in the middle of their width.
    """
    if not len(lines):
        return False
    turned, places = _turned(lines), lines[..., 0]
    middle, area = 0.5 * float(places.min() + places.max()), float(turned.sum())
    if ((places.min(axis=1) < middle) & (places.max(axis=1) > middle)).any():
        return False
    aside = float(turned @ places.sum(axis=1)) / 3.0 - area * middle
    return abs(aside) < EVEN * abs(area) * float(np.ptp(places))


def _pieces(lines: np.ndarray) -> int:
    """Return the number of areas that lines (k, 2, 2) of a cut go round, without their holes."""
    if not len(lines):
        return 0
    ends, numbers = np.unique(lines.reshape(-1, 2), axis=0, return_inverse=True)
    one, two = numbers.reshape(-1, 2).T
    count, loop = connected_pieces(one, two, len(ends))
    turned = np.bincount(loop[one], _turned(lines), count)
    least = SPECK * abs(turned.sum())
    return int((turned * np.sign(turned.sum()) > least).sum())


def cut(
    vertices: np.ndarray, triangles: np.ndarray, axis: int, at: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lines in which a plane square to an axis cuts a mesh.

    Args:
        vertices: vertices of the mesh, (n, 3) [m].
        triangles: triangles of the mesh, (m, 3).
        axis: 0, 1 or 2, the axis along the plane's normal.
        at: coordinate of the plane on the axis [m].
    Returns:
        Ends of the lines (k, 2, 2) [m] in the two other axes, and the triangle of each line, (k,).
        All lines go round a body in the same sense. Ends that meet are equal to the last bit.
    """
    height = vertices[:, axis] - (at + OFF_THE_CORNERS)
    above = (height > 0.0)[triangles]
    cut_ones = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    above, corners = above[cut_ones], triangles[cut_ones]
    # The plane cuts the two edges from the corner that is alone on its side.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(corners))
    ends = []
    for step in (1, 2):
        edge = np.sort([corners[row, alone], corners[row, (alone + step) % 3]], axis=0)
        low, high = height[edge]
        share = (low / (low - high))[:, None]
        ends.append(vertices[edge[0]] + share * (vertices[edge[1]] - vertices[edge[0]]))
    lines = np.delete(np.stack(ends, axis=1), axis, axis=2)
    turned = above.sum(axis=1) == 1
    lines[turned] = lines[turned, ::-1]
    return lines, cut_ones


def inside(lines: np.ndarray) -> BaseGeometry:
    """Return the areas inside the outlines (k, 2, 2) of closed bodies, which may overlap."""
    import shapely

    apart = lines[(lines[:, 0] != lines[:, 1]).any(axis=1)]
    if not len(apart):
        return shapely.Polygon()
    crossing_at_ends = shapely.node(shapely.multilinestrings(shapely.linestrings(apart)))
    faces = shapely.get_parts(shapely.polygonize([crossing_at_ends]))
    return shapely.union_all([
        face for face in faces if _turns_around(apart, shapely.point_on_surface(face))
    ])  # fmt: skip


def outline_path(area: BaseGeometry) -> Path | None:
    """Return the outlines of an area as one path, or None of an empty one.

    Its holes go round in the other sense.
    """
    import shapely
    from matplotlib.path import Path

    pieces = [one for one in shapely.get_parts(area) if isinstance(one, shapely.Polygon)]
    rings = [
        np.asarray(ring.coords)
        for one in map(shapely.geometry.polygon.orient, pieces)
        if not one.is_empty
        for ring in (one.exterior, *one.interiors)
    ]
    return Path.make_compound_path(*(Path(one, closed=True) for one in rings)) if rings else None


def _turns_around(lines: np.ndarray, point: Point) -> int:
    """Return how often the lines, which close to outlines, go round a point.

    It is the number of upward lines minus the number of downward lines to the right of the point.
    """
    (x1, y1), (x2, y2) = lines[:, 0].T, lines[:, 1].T
    way = (y2 > point.y).astype(int) - (y1 > point.y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = point.x < x1 + (point.y - y1) / (y2 - y1) * (x2 - x1)
    return int(way[right & (way != 0)].sum())


def face_size_mm(chamber: Chamber) -> tuple[float, ...]:
    """Return the size of the sonotrode's face [mm].

    It is the diameter of a round face, or the lengths of another face along x and y.
    """
    face = chamber.triangles[chamber.tags == TAG_SONOTRODE]
    rim = np.unique(border_edges(face))
    rim = rim if len(rim) else np.unique(face)
    corners = 1e3 * chamber.vertices[rim, :2]
    radius = np.hypot(*corners.T)
    if len(rim) >= FEWEST_CORNERS and np.ptp(radius) < SAME:
        return (2.0 * float(radius.max()),)
    return tuple(np.ptp(corners, axis=0).tolist())
