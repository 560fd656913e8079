"""Closes small holes and cracks; a big opening is a question to the engineer, not to the program.

A hole's rim of n edges gets the n - 2 triangles of least area together: the dynamic programme of G. Barequet and
M. Sharir, Computer Aided Geometric Design 12 (1995) 207.
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.mesh_io.surface_error import format_point

SMALL = 0.03  # of the part's diagonal: widest hole that is closed unasked
LONGEST_RIM = 64  # edges; the programme takes the cube of this


def filled(
    points: np.ndarray, triangles: np.ndarray, open_edges: np.ndarray, reach: float
) -> tuple[np.ndarray, list[str]]:
    """Triangles (k, 3) that close the small holes among open_edges (j, 2), facing as their neighbours; and notes.

    reach [m]: a crack no wider than this is closed however long it is, since nothing is made up there.
    """
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    more: list[tuple[int, int, int]] = []
    widest, where, holes, cracks = 0.0, points[0], 0, 0
    for rim in _rims(triangles, open_edges):
        corners = points[rim]
        width = float(np.linalg.norm(np.ptp(corners, axis=0)))
        length = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())
        area, patch = _patch(corners)
        crack = area <= reach * length
        if not crack and width > SMALL * diagonal:
            continue
        more += [(rim[a], rim[b], rim[c]) for a, b, c in patch]
        holes, cracks = holes + (not crack), cracks + crack
        if not crack and width > widest:
            widest, where = width, corners.mean(axis=0)
    notes = []
    if holes:
        told = f"the widest {1e3 * widest:.3g} mm at {format_point(where)}"
        notes.append(f"closed {holes} small hole{'s' * (holes > 1)}, {told}")
    if cracks:
        notes.append(
            f"closed {cracks} crack{'s' * (cracks > 1)} less than {1e3 * reach:.2g} mm wide"
        )
    return np.array(more, dtype=np.int64).reshape(-1, 3), notes


def hole_count(edges: np.ndarray) -> int:
    """Number of connected pieces that open edges (k, 2) form."""
    return int(_pieces(edges)[0])


def _pieces(edges: np.ndarray) -> tuple[int, np.ndarray]:
    """How many connected pieces edges (k, 2) form, and which one each edge is in."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    used, numbers = np.unique(edges, return_inverse=True)
    a, b = numbers.reshape(-1, 2).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(used), len(used)))
    count, piece = connected_components(graph, directed=False)
    return count, piece[a]


def _rims(triangles: np.ndarray, edges: np.ndarray) -> list[list[int]]:
    """The simple loops among open edges, each run through against the triangle beside its first edge."""
    count, piece = _pieces(edges)
    rims = []
    for k in np.flatnonzero(np.bincount(piece, minlength=count) <= LONGEST_RIM):
        beside: dict[int, list[int]] = {}
        for a, b in edges[piece == k].tolist():
            beside.setdefault(a, []).append(b)
            beside.setdefault(b, []).append(a)
        if len(beside) < 3 or any(len(ends) != 2 for ends in beside.values()):
            continue  # two holes that touch in a corner
        rim = [min(beside)]
        rim.append(beside[rim[0]][0])
        while len(rim) < len(beside):
            a, b = beside[rim[-1]]
            rim.append(b if a == rim[-2] else a)
        rims.append(rim if _runs_along(triangles, rim[1], rim[0]) else rim[::-1])
    return rims


def _runs_along(triangles: np.ndarray, a: int, b: int) -> bool:
    """Does a triangle have the side from a to b, in that direction?"""
    return bool(((triangles == a) & (np.roll(triangles, -1, axis=1) == b)).any())


def _patch(corners: np.ndarray) -> tuple[float, list[tuple[int, int, int]]]:
    """Least area [m²] that closes a rim (n, 3) m, and its triangles."""
    n = len(corners)
    least = np.zeros((n, n))
    middle = np.zeros((n, n), dtype=int)
    for span in range(2, n):
        for first in range(n - span):
            last = first + span
            between = np.arange(first + 1, last)
            across = np.cross(corners[between] - corners[first], corners[last] - corners[first])
            total = (
                least[first, between] + least[between, last] + 0.5 * np.linalg.norm(across, axis=1)
            )
            best = int(total.argmin())
            least[first, last], middle[first, last] = total[best], between[best]
    patch, waiting = [], [(0, n - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first >= 2:
            apex = int(middle[first, last])
            patch.append((first, apex, last))
            waiting += [(first, apex), (apex, last)]
    return float(least[0, n - 1]), patch
