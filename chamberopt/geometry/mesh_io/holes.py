"""Close small holes and cracks of a surface; large openings are left for the user to close.

The rim of a hole with n edges gets the n - 2 triangles that have the least area together, found by
dynamic programming.

Source: G. Barequet and M. Sharir, Computer Aided Geometric Design 12 (1995) 207.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from chamberopt.geometry.mesh_io.surface_error import format_point
from chamberopt.geometry.triangles import connected_pieces, sides_of

MAX_WIDTH = 0.03  # of the part's diagonal: the widest hole that is closed automatically
MAX_RIM_EDGES = 64  # the time for a rim grows with the cube of its edges


def close_holes(
    points: np.ndarray, triangles: np.ndarray, open_edges: np.ndarray, tolerance: float
) -> tuple[np.ndarray, list[str]]:
    """Triangles (k, 3) that close the small holes, facing as their neighbours do, and notes.

    Args:
        open_edges: edges (j, 2) that belong to one triangle only.
        tolerance: a crack no wider than this [m] is closed however long it is.
    """
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    more: list[tuple[int, int, int]] = []
    widest, where, holes, cracks = 0.0, points[0], 0, 0
    for rim in _simple_rims(triangles, open_edges):
        corners = points[rim]
        width = float(np.linalg.norm(np.ptp(corners, axis=0)))
        length = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())
        area, patch = _least_area_patch(corners)
        is_crack = area <= tolerance * length
        if not is_crack and width > MAX_WIDTH * diagonal:
            continue
        more += [(rim[a], rim[b], rim[c]) for a, b, c in patch]
        holes, cracks = holes + (not is_crack), cracks + is_crack
        if not is_crack and width > widest:
            widest, where = width, corners.mean(axis=0)
    notes = []
    if holes:
        place = f"the widest {1e3 * widest:.3g} mm at {format_point(where)}"
        notes.append(f"closed {holes} small hole{'s' * (holes > 1)}, {place}")
    if cracks:
        width_text = f"less than {1e3 * tolerance:.2g} mm wide"
        notes.append(f"closed {cracks} crack{'s' * (cracks > 1)} {width_text}")
    return np.array(more, dtype=np.int64).reshape(-1, 3), notes


def count_holes(edges: np.ndarray) -> int:
    """Number of connected pieces that open edges (k, 2) form."""
    ends, numbers = np.unique(edges, return_inverse=True)
    a, b = numbers.reshape(-1, 2).T
    return connected_pieces(a, b, len(ends))[0]


def _simple_rims(triangles: np.ndarray, edges: np.ndarray) -> list[list[int]]:
    """Closed loops of open edges, each in the direction that new triangles need.

    That is against the side of the triangle beside its first edge. Holes that touch in a corner
    are left out.
    """
    neighbours: dict[int, list[int]] = defaultdict(list)
    for a, b in edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    sides, rims, walked = sides_of(triangles), [], set()
    for start in sorted(neighbours):
        rim: list[int] = []
        here = start
        while here not in walked and len(neighbours[here]) == 2:
            walked.add(here)
            rim.append(here)
            one, other = neighbours[here]
            here = other if len(rim) > 1 and one == rim[-2] else one
        # A walk that stops elsewhere met a corner where holes touch, or an earlier walk to one.
        if here == start and 3 <= len(rim) <= MAX_RIM_EDGES:
            against = (sides == (rim[1], rim[0])).all(axis=1).any()
            rims.append(rim if against else rim[::-1])
    return rims


def _least_area_patch(corners: np.ndarray) -> tuple[float, list[tuple[int, int, int]]]:
    """Least area [m²] that closes a rim with corners (n, 3) [m], and its triangles."""
    n = len(corners)
    # least[i, j]: least area over the part of the rim from i to j; apex[i, j]: the third corner of
    # the triangle at the side from i to j.
    least, apex = np.zeros((n, n)), np.zeros((n, n), dtype=int)
    for span in range(2, n):
        for i in range(n - span):
            j = i + span
            between = np.arange(i + 1, j)
            vectors = np.cross(corners[between] - corners[i], corners[j] - corners[i])
            area = 0.5 * np.linalg.norm(vectors, axis=1)
            total = least[i, between] + least[between, j] + area
            best = int(total.argmin())
            least[i, j], apex[i, j] = total[best], between[best]
    patch, waiting = [], [(0, n - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i >= 2:
            k = int(apex[i, j])
            patch.append((i, k, j))
            waiting += [(i, k), (k, j)]
    return float(least[0, n - 1]), patch
