"""A soup of triangles -> one closed surface that faces outward; every change is told, the rest refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.holes import filled, hole_count
from chamberopt.geometry.mesh_io.surface_error import OpenSurfaceError, SurfaceError, format_point
from chamberopt.geometry.triangles import edge_keys, find_shells, unique_rows, winding_number

WELD = 1e-6  # of the bounding box's diagonal: what a text format with 6 digits rounds away


def sewn(path: Path, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Corners (m, 3, 3) [m] as vertices (n, 3), triangles (k, 3) with two triangles at each edge, and notes.

    Also of which given triangle each one is: (k,), -1 for one that closes a hole. Raises SurfaceError for what
    stays open or is not manifold.
    """
    first, numbers = unique_rows(corners.reshape(-1, 3))
    points = corners.reshape(-1, 3)[first]
    source = np.arange(len(corners))
    points, triangles, source, notes = _without_repeats(points, numbers.reshape(-1, 3), source)
    reach = WELD * float(np.linalg.norm(np.ptp(points, axis=0)))
    if len(_edges(triangles, count=1)):  # perhaps only the file's rounding keeps the edges apart
        closer, renumbered = _welded(points, reach)
        points2, triangles2, source2, notes2 = _without_repeats(
            closer, renumbered[triangles], source
        )
        if len(_edges(triangles2, count=1)) < len(_edges(triangles, count=1)):
            merged = len(points) - len(points2)
            notes += [f"merged {merged} vertices less than {1e3 * reach:.2g} mm apart", *notes2]
            points, triangles, source = points2, triangles2, source2
    if len(_edges(triangles, count=1)):
        more, told = filled(points, triangles, _edges(triangles, count=1), reach)
        triangles, source = np.concatenate([triangles, more]), np.r_[source, np.full(len(more), -1)]
        notes += told
    open_edges = _edges(triangles, count=1)
    if len(open_edges):
        holes = hole_count(open_edges)
        a, b = points[open_edges[0]]
        where = f"{len(open_edges)} open edges in {holes} hole{'s' * (holes > 1)}"
        raise OpenSurfaceError(
            f"{path}: the surface is not closed: {where}, the first from {format_point(a)} to {format_point(b)}; "
            "close it in the CAD program",
            points[triangles],
            points[open_edges],
        )
    crowded = _edges(triangles, count=3)
    if len(crowded):
        a, b = points[crowded[0]]
        raise SurfaceError(
            f"{path}: not manifold: {len(crowded)} edges belong to more than two triangles, the first from "
            f"{format_point(a)} to {format_point(b)}; make the bodies overlap or leave a gap there",
            points[triangles],
            points[crowded],
        )
    return points, triangles, source, notes


def _without_repeats(
    points: np.ndarray, triangles: np.ndarray, source: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Drops triangles with two corners in one place, and second copies of a triangle; keeps the order."""
    notes = []
    a, b, c = triangles.T
    flat = (a == b) | (b == c) | (c == a)
    if flat.any():
        notes.append(
            f"dropped {flat.sum()} triangles without area, the first is triangle {source[flat][0] + 1}"
        )
        triangles, source = triangles[~flat], source[~flat]
    turned = np.take_along_axis(
        triangles, (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1
    )
    first = np.sort(unique_rows(turned)[0])
    if len(first) < len(triangles):
        notes.append(f"dropped {len(triangles) - len(first)} triangles that were there twice")
        triangles, source = triangles[first], source[first]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return points[used], renumbered.reshape(-1, 3), source, notes


def _welded(points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Points with those within reach [m] of each other made one, and the new number of each old point."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    _, group = connected_components(graph, directed=False)
    _, first, renumbered = np.unique(group, return_index=True, return_inverse=True)
    return points[first], renumbered.reshape(-1)


def _edges(triangles: np.ndarray, count: int) -> np.ndarray:
    """Edges (k, 2) that belong to one triangle (count=1), or to three and more (count=3)."""
    keys, times = np.unique(edge_keys(triangles), return_counts=True)
    chosen = keys[times == 1] if count == 1 else keys[times >= count]
    return np.stack(np.divmod(chosen, int(triangles.max()) + 1), axis=1)


def outward(
    path: Path, vertices: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Closed triangles (m, 3) turned so that neighbours agree and every body encloses a positive volume."""
    notes = []
    against = _against_neighbours(path, triangles)
    if against.any():
        notes.append(f"turned {against.sum()} triangles that faced against their neighbours")
        triangles = np.where(against[:, None], triangles[:, ::-1], triangles)
    shells, volumes = find_shells(vertices, triangles)
    for k in np.flatnonzero(volumes < 0.0):
        if _stands_in_another(vertices, triangles, shells, k):
            continue  # the wall of a void
        triangles = np.where((shells == k)[:, None], triangles[:, ::-1], triangles)
        which = "it was" if len(volumes) == 1 else f"body {k + 1} of {len(volumes)} was"
        notes.append(f"{which} inside out: turned its normals outward")
    if (volumes == 0.0).any():
        raise InputError(f"{path}: a closed piece of the surface encloses no volume; remove it")
    return triangles, notes


def _against_neighbours(path: Path, triangles: np.ndarray) -> np.ndarray:
    """Which triangles (m,) to turn so that neighbours agree, the fewest of each piece.

    Each triangle is there twice, as it is and turned; what agrees across an edge is linked. A piece of the
    surface falls into two halves, one the other's mirror; a one-sided surface does not.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m = len(triangles)
    order = np.argsort(edge_keys(triangles), kind="stable").reshape(
        -1, 2
    )  # the two sides of each edge
    sides = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    agree = sides[order[:, 0], 0] != sides[order[:, 1], 0]
    if agree.all():
        return np.zeros(m, dtype=bool)
    a, b = (order // 3).T
    b_plain, b_turned = np.where(agree, b, b + m), np.where(agree, b + m, b)
    links = np.r_[a, a + m], np.r_[b_plain, b_turned]
    graph = coo_array((np.ones(len(links[0]), dtype=np.int8), links), shape=(2 * m, 2 * m))
    count, half = connected_components(graph, directed=False)
    plain, turned = half[:m], half[m:]
    if (plain == turned).any():
        raise InputError(
            f"{path}: the surface has no inside (one-sided, like a Moebius band); redraw it"
        )
    as_they_are = np.bincount(plain, minlength=count)
    fewer = as_they_are[plain] < as_they_are[turned]
    return fewer | ((as_they_are[plain] == as_they_are[turned]) & (plain > turned))


def _stands_in_another(
    vertices: np.ndarray, triangles: np.ndarray, shells: np.ndarray, k: np.integer
) -> bool:
    """Is closed piece k inside another closed piece (whichever way that one faces)?"""
    points = vertices[triangles[shells == k]].mean(axis=1)
    points = points[:: max(1, len(points) // 8)]
    others = (other for other in range(int(shells.max()) + 1) if other != k)
    return any(
        abs(np.median(winding_number(points, vertices[triangles[shells == other]]))) > 0.5
        for other in others
    )
