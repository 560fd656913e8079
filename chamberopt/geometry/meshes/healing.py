"""Join loose triangles to one closed surface that faces outward, and repair small faults.

Each change gives a note for the user. Faults that only a guess could repair are refused.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.surface_error import OpenSurfaceError, SurfaceError, format_point
from chamberopt.geometry.triangles import (
    areas,
    connected_pieces,
    edge_keys,
    find_shells,
    shell_winding,
    side_pairs,
    sides_of,
    unique_rows,
)

# Small holes and cracks of a surface are closed. Large openings are left for the user to close.
#
# The rim of a hole with n edges gets the n - 2 triangles with the least total area, found by
# dynamic programming.
#
# Source: G. Barequet and M. Sharir, Computer Aided Geometric Design 12 (1995) 207.

# share of the part's diagonal: width of the widest hole that is closed automatically
MAX_WIDTH = 0.03
MAX_RIM_EDGES = 64  # the time for a rim grows with the cube of its edges


def close_holes(
    points: np.ndarray, triangles: np.ndarray, open_edges: np.ndarray, tolerance: float
) -> tuple[np.ndarray, list[str]]:
    """Return new triangles (k, 3) that close small holes and cracks, and notes for the user.

    The triangles face as their neighbours do.

    Args:
        open_edges: edges (j, 2) that belong to only one triangle.
        tolerance: width [m] up to which a crack of any length is closed.
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
    """Return the number of holes of a surface: the connected pieces of its open edges (k, 2)."""
    ends, numbers = np.unique(edges, return_inverse=True)
    a, b = numbers.reshape(-1, 2).T
    return connected_pieces(a, b, len(ends))[0]


def _simple_rims(triangles: np.ndarray, edges: np.ndarray) -> list[list[int]]:
    """Return the rims of holes: closed loops of points, in the direction that new triangles need.

    The triangles beside a hole run along its rim in the opposite direction. Holes that touch in a
    corner are left out.

    Args:
        edges: open edges of the surface, (k, 2).
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
        # A walk that ends elsewhere met a corner where holes touch, or an earlier walk to such a
        # corner.
        if here == start and 3 <= len(rim) <= MAX_RIM_EDGES:
            against = (sides == (rim[1], rim[0])).all(axis=1).any()
            rims.append(rim if against else rim[::-1])
    return rims


def _least_area_patch(corners: np.ndarray) -> tuple[float, list[tuple[int, int, int]]]:
    """Return the least area [m²] that closes a hole, and the triangles that have this area.

    Args:
        corners: corners of the hole's rim in order, (n, 3) [m].
    """
    n = len(corners)
    # least[i, j]: least area over the part of the rim from i to j. apex[i, j]: third corner of the
    # triangle at the side from i to j.
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


STRAY_SHARE = 0.01  # share of the area: a larger share of loose facets is not there by mistake
WELD = 1e-6  # share of the bounding box's diagonal: rounding of a text format with 6 digits


class SewnSurface(NamedTuple):
    """Triangles that share vertices, and notes on the changes that were made to join them."""

    points: np.ndarray  # (n, 3) [m]
    triangles: np.ndarray  # (k, 3), rows of the points
    source: np.ndarray  # (k,), the given triangle of each; -1 if the triangle closes a hole
    notes: list[str]  # one sentence for each change


def sew_bodies(path: Path, corners: np.ndarray, bodies: np.ndarray) -> SewnSurface:
    """Join triangles (m, 3, 3) [m] into a closed surface for each body.

    Bodies that touch keep their own vertices.

    Args:
        bodies: number of the body of each triangle, (m,).
    """
    rows = [np.flatnonzero(bodies == body) for body in np.unique(bodies)]
    sewn = [sew(path, corners[own]) for own in rows]
    first = np.cumsum([0, *(len(one.points) for one in sewn)])
    return SewnSurface(
        np.concatenate([one.points for one in sewn]),
        np.concatenate([one.triangles + k for one, k in zip(sewn, first, strict=False)]),
        np.concatenate(
            [
                np.where(one.source >= 0, own[one.source], -1)
                for one, own in zip(sewn, rows, strict=True)
            ]
        ),
        [note for one in sewn for note in one.notes],
    )


def sew(path: Path, corners: np.ndarray) -> SewnSurface:
    """Join triangles (m, 3, 3) [m] into a surface with two triangles at each edge.

    Raises SurfaceError if that is not possible.
    """
    first, numbers = unique_rows(corners.reshape(-1, 3))
    surface = _drop_useless(
        corners.reshape(-1, 3)[first], numbers.reshape(-1, 3), np.arange(len(corners))
    )
    tolerance = WELD * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    open_edges = _edges(surface.triangles, count=1)
    if len(open_edges):  # perhaps only the file's rounding keeps the edges apart
        points, renumbered = _weld(surface.points, tolerance)
        welded = _drop_useless(points, renumbered[surface.triangles], surface.source)
        if len(_edges(welded.triangles, count=1)) < len(open_edges):
            merged = len(surface.points) - len(welded.points)
            note = f"merged {merged} vertices less than {1e3 * tolerance:.2g} mm apart"
            surface = welded._replace(notes=[*surface.notes, note, *welded.notes])
            open_edges = _edges(surface.triangles, count=1)
    if len(open_edges):
        surface = _drop_strays(surface)
        open_edges = _edges(surface.triangles, count=1)
    if len(open_edges):
        more, notes = close_holes(surface.points, surface.triangles, open_edges, tolerance)
        surface = surface._replace(
            triangles=np.concatenate([surface.triangles, more]),
            source=np.r_[surface.source, np.full(len(more), -1)],
            notes=[*surface.notes, *notes],
        )
    _require_closed(path, surface.points, surface.triangles)
    return surface


def _require_closed(path: Path, points: np.ndarray, triangles: np.ndarray) -> None:
    """Raise SurfaceError unless each edge belongs to exactly two triangles."""
    open_edges = _edges(triangles, count=1)
    if len(open_edges):
        holes = count_holes(open_edges)
        a, b = map(format_point, points[open_edges[0]])
        message = (
            f"{path}: the surface is not closed: {len(open_edges)} open edges in {holes} "
            f"hole{'s' * (holes > 1)}, the first from {a} to {b}; close it in the CAD program"
        )
        raise OpenSurfaceError(message, points[triangles], points[open_edges])
    crowded = _edges(triangles, count=3)
    if len(crowded):
        a, b = map(format_point, points[crowded[0]])
        message = (
            f"{path}: not manifold: {len(crowded)} edges belong to more than two triangles, "
            f"the first from {a} to {b}; make the bodies overlap or leave a gap there"
        )
        raise SurfaceError(message, points[triangles], points[crowded])


def _drop_useless(points: np.ndarray, triangles: np.ndarray, source: np.ndarray) -> SewnSurface:
    """Return the surface without triangles that have two equal corners, or that come twice.

    The other triangles keep their order.
    """
    notes = []
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if flat.any():
        first = source[flat][0] + 1
        notes.append(f"dropped {flat.sum()} triangles without area, the first is triangle {first}")
        triangles, source = triangles[~flat], source[~flat]
    lowest_first = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    rotated = np.take_along_axis(triangles, lowest_first, axis=1)
    kept = np.sort(unique_rows(rotated)[0])
    if len(kept) < len(triangles):
        notes.append(f"dropped {len(triangles) - len(kept)} triangles that were there twice")
        triangles, source = triangles[kept], source[kept]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return SewnSurface(points[used], renumbered.reshape(-1, 3), source, notes)


def _drop_strays(surface: SewnSurface) -> SewnSurface:
    """Return the surface without stray triangles, which belong to no closed surface.

    Triangles form a piece where exactly two of them meet at each edge. A piece is stray if it has
    at least as many open edges as triangles. A body with a hole has few open edges.
    """
    points, triangles = surface.points, surface.triangles
    _, edge, times = np.unique(edge_keys(triangles), return_inverse=True, return_counts=True)
    joined = np.flatnonzero(times[edge] == 2)
    a, b = (joined[np.argsort(edge[joined], kind="stable")].reshape(-1, 2) // 3).T
    count, piece = connected_pieces(a, b, len(triangles))
    open_edges = np.bincount(piece, (times[edge] == 1).reshape(-1, 3).sum(axis=1), count)
    stray = (open_edges >= np.bincount(piece, minlength=count))[piece]
    area = areas(points, triangles)
    if not stray.any() or area[stray].sum() > STRAY_SHARE * area.sum():
        return surface
    first, many = np.flatnonzero(stray)[0], int(stray.sum())
    note = (
        f"dropped {many} stray triangle{'s' * (many > 1)} of no closed surface, "
        f"the first is triangle {surface.source[first] + 1} "
        f"at {format_point(points[triangles[first]].mean(axis=0))}"
    )
    used, numbers = np.unique(triangles[~stray], return_inverse=True)
    source = surface.source[~stray]
    return SewnSurface(points[used], numbers.reshape(-1, 3), source, [*surface.notes, note])


def _weld(points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge points (n, 3) that are closer than a tolerance [m].

    Returns:
        The remaining points, and the index among them of each given point, (n,).
    """
    from scipy.spatial import cKDTree

    a, b = cKDTree(points).query_pairs(tolerance, output_type="ndarray").T
    _, group = connected_pieces(a, b, len(points))
    _, first, renumbered = np.unique(group, return_index=True, return_inverse=True)
    return points[first], renumbered.reshape(-1)


def _edges(triangles: np.ndarray, count: int) -> np.ndarray:
    """Return the edges (k, 2) that belong to one triangle if `count` is 1.

    If `count` is 3, return the edges that belong to at least three triangles.
    """
    keys, times = np.unique(edge_keys(triangles), return_counts=True)
    chosen = keys[times == 1] if count == 1 else keys[times >= count]
    return np.stack(np.divmod(chosen, int(triangles.max()) + 1), axis=1)


def turn_outward(
    path: Path, vertices: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Return the triangles (m, 3) of a closed surface, turned to face outward, and notes.

    Raises InputError if the surface is one-sided, or if a piece of it encloses no volume.
    """
    notes = []
    wrong = _against_neighbours(path, triangles)
    if wrong.any():
        notes.append(f"turned {wrong.sum()} triangles that faced against their neighbours")
        triangles = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    shells, volumes = find_shells(vertices, triangles)
    for k in np.flatnonzero(volumes < 0.0).tolist():
        others = (other for other in range(len(volumes)) if other != k)
        if any(abs(shell_winding(vertices, triangles, shells, one, k)) > 0.5 for one in others):
            continue  # the wall of a void in another piece, which may face either way
        triangles = np.where((shells == k)[:, None], triangles[:, ::-1], triangles)
        which = "it was" if len(volumes) == 1 else f"body {k + 1} of {len(volumes)} was"
        notes.append(f"{which} inside out: turned its normals outward")
    if (volumes == 0.0).any():
        raise InputError(f"{path}: a closed piece of the surface encloses no volume; remove it")
    return triangles, notes


def _against_neighbours(path: Path, triangles: np.ndarray) -> np.ndarray:
    """Return marks (m,) of the triangles to turn over, so that neighbours face the same way.

    Of each connected piece of the surface, the fewest possible triangles are marked.

    In a graph each triangle has two nodes: the triangle as it is, and the triangle turned over.
    Nodes of neighbours that face the same way are linked. Each piece of the surface then falls into
    two halves, of which each is the other half turned over. Only a one-sided surface does not fall
    apart.
    """
    m, pairs, sides = len(triangles), side_pairs(triangles), sides_of(triangles)
    agree = sides[pairs[:, 0], 0] != sides[pairs[:, 1], 0]
    if agree.all():
        return np.zeros(m, dtype=bool)
    a, b = (pairs // 3).T
    b_as_is, b_turned = np.where(agree, b, b + m), np.where(agree, b + m, b)
    count, half = connected_pieces(np.r_[a, a + m], np.r_[b_as_is, b_turned], 2 * m)
    as_is, turned = half[:m], half[m:]
    if (as_is == turned).any():
        raise InputError(
            f"{path}: the surface has no inside (one-sided, like a Moebius band); redraw it"
        )
    size = np.bincount(as_is, minlength=count)
    fewer = size[as_is] < size[turned]
    return np.asarray(fewer | ((size[as_is] == size[turned]) & (as_is > turned)))
