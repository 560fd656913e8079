"""Compute plane cuts of meshes, the areas inside them, and the sonotrode's size for drawings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.design.shape_surface import TAG_SONOTRODE
from chamberopt.geometry.triangles import border_edges

if TYPE_CHECKING:
    from matplotlib.path import Path
    from shapely import Point

    from chamberopt.chamber.build import Chamber

# Shift of the plane [m], so that it goes through no corner of a mesh.
OFF_THE_CORNERS = 1.7e-8
SAME = 0.02  # mm: lengths that differ by less count as equal
FEWEST_CORNERS = 8  # of a face that is drawn as round


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


def inside(lines: np.ndarray) -> Path | None:
    """Return the areas inside the outlines of closed bodies, which may overlap.

    None if there are no lines.
    """
    import shapely
    from matplotlib.path import Path

    apart = lines[(lines[:, 0] != lines[:, 1]).any(axis=1)]
    if not len(apart):
        return None
    crossing_at_ends = shapely.node(shapely.multilinestrings(shapely.linestrings(apart)))
    rings = []
    for face in shapely.get_parts(shapely.polygonize([crossing_at_ends])):
        if _turns_around(apart, shapely.point_on_surface(face)):
            whole = shapely.geometry.polygon.orient(face)
            rings += [np.asarray(ring.coords) for ring in (whole.exterior, *whole.interiors)]
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
