"""Few faces in place of a flat's many: its outline, cut square by square until each piece is simple.

The pieces need not share corners as the triangles of a mesh do, since faces overlap by the seam; so squares are large
inside and small along a curved rim, and their number follows the outline, not the mesh.
"""

import numpy as np
import shapely

SIMPLE = 6  # corners of a piece that is cut no further; 4 to 8 gave the same query times
DEEPEST = 16  # halvings: a square of 1e-5 of the flat
# A rim corner nearer than this [m] to the line of its neighbours is left out; a hundredth of the seam between faces.
STRAIGHT = 1e-10


def cover(outline: np.ndarray, area: float) -> np.ndarray | None:
    """Convex quadrangles (k, 4, 2) [m], counter-clockwise, that cover the inside of an outline; a triangle has its
    last corner twice. None if that cannot be done.

    ``outline`` (n, 2, 2) [m]: the border's segments, in any order; holes are what lies inside an odd number of them.
    ``area`` [m²] is what the inside must measure: a border that crosses itself is not understood, and then says so by
    its area.
    """
    region = shapely.build_area(shapely.multilinestrings(shapely.linestrings(outline)))
    region = shapely.simplify(region, STRAIGHT)
    if region.is_empty or not region.is_valid:
        return None
    pieces = np.concatenate([_quadrangles(piece) for piece in _cut(region)])
    covered = 0.5 * _turn(pieces[:, 0], pieces[:, 1], pieces[:, 2]) + 0.5 * _turn(
        pieces[:, 0], pieces[:, 2], pieces[:, 3]
    )
    if abs(covered.sum() - area) > 1e-9 * area:
        return None
    return np.asarray(pieces[covered > 0.0])


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area [m²] of triangles with these corners (n, 2)."""
    one, two = b - a, c - a
    return np.asarray(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


def _cut(region: shapely.Geometry) -> list[shapely.Geometry]:
    """Simple pieces of a region: those of its four quarters, and so on until each has few corners."""
    simple = []
    todo = [(region, 0)]
    while todo:
        piece, depth = todo.pop()
        for polygon in shapely.get_parts(piece):
            if shapely.get_dimensions(polygon) < 2 or shapely.is_empty(polygon):
                continue  # a quarter that misses the piece, or touches it in a point or along a line
            if depth == DEEPEST or shapely.get_num_coordinates(polygon) - 1 <= SIMPLE:
                simple.append(polygon)
                continue
            x0, y0, x1, y1 = shapely.bounds(polygon)
            wide, high = (
                x1 - x0 >= 0.5 * (y1 - y0),
                y1 - y0 >= 0.5 * (x1 - x0),
            )  # a strip is cut across only
            x = [x0, 0.5 * (x0 + x1), x1] if wide else [x0, x1]
            y = [y0, 0.5 * (y0 + y1), y1] if high else [y0, y1]
            quarters = [
                shapely.box(x[i], y[j], x[i + 1], y[j + 1])
                for i in range(len(x) - 1)
                for j in range(len(y) - 1)
            ]
            todo += [(part, depth + 1) for part in shapely.intersection(polygon, quarters)]
    return simple


def _quadrangles(polygon: shapely.Geometry) -> np.ndarray:
    """A polygon without holes as convex quadrangles (k, 4, 2), no corner added."""
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon))[:-1]
    convex = shapely.get_num_interior_rings(polygon) == 0 and bool(
        (_turn(np.roll(ring, 1, axis=0), ring, np.roll(ring, -1, axis=0)) >= 0.0).all()
    )
    if convex:  # a fan of quadrangles
        last = len(ring) - 1
        return np.array([ring[[0, k, k + 1, min(k + 2, last)]] for k in range(1, last, 2)])
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = np.array(
        [shapely.get_coordinates(shapely.orient_polygons(part))[:3] for part in parts]
    )
    return corners.reshape(-1, 3, 2)[:, [0, 1, 2, 2]]  # none of a piece that is but a line
