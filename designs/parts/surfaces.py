"""Patches of triangles [mm], joined into one closed surface and written as binary STL.

Every coordinate is rounded to a grid before it is used. So the triangles do not depend on the last
bit of a sine on some processor: the same script gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

# Grid of all corners, so that patches share corners: 0.1 µm, far below any dent.
GRID_MM = 1e-4

# Corners (n, 3) mm, and triangles (m, 3), counter-clockwise seen from outside.
Patch = tuple[np.ndarray, np.ndarray]


def tube(rings: np.ndarray, closed: bool = True) -> Patch:
    """Quads between successive rings, each split in two by alternating diagonals; normals outward.

    Args:
        rings: shape (k, n, 3), mm; ring i + 1 lies above ring i, each counter-clockwise from above.
    """
    k, n, _ = rings.shape
    i, j = np.meshgrid(np.arange(k - 1), np.arange(n if closed else n - 1), indexing="ij")
    i, j = i.ravel(), j.ravel()
    a, b = i * n + j, i * n + (j + 1) % n
    c, d = (i + 1) * n + (j + 1) % n, (i + 1) * n + j
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.c_[a, b, c], np.c_[a, b, d])
    second = np.where(even, np.c_[a, c, d], np.c_[b, c, d])
    return rings.reshape(-1, 3), np.stack([first, second], axis=1).reshape(-1, 3)


def planar(loops: list[np.ndarray], inner: np.ndarray, spacing: float, z: float, up: bool) -> Patch:
    """A flat face at height z inside loops (even-odd), with inner points that are then relaxed.

    Args:
        loops: closed polygons (n, 2) mm whose edges must all appear in the mesh.
        inner: points (p, 2) mm; those closer to a loop than half the spacing are left out.
    Raises:
        ValueError: a loop is too coarse for one of its edges to appear.
    """
    border = np.round(np.concatenate(loops) / GRID_MM) * GRID_MM
    starts = np.concatenate([np.roll(np.arange(len(loop)), 0) for loop in loops])
    offsets = np.repeat(
        np.cumsum([0] + [len(loop) for loop in loops[:-1]]), [len(loop) for loop in loops]
    )
    lengths = np.repeat([len(loop) for loop in loops], [len(loop) for loop in loops])
    edges = np.c_[starts + offsets, (starts + 1) % lengths + offsets]

    points = np.asarray(inner, dtype=float).reshape(-1, 2)
    points = points[_inside(points, border, edges)]
    points = points[_distance(points, border, edges) > 0.55 * spacing]
    for _ in range(15):
        triangles = _fill(border, edges, points)
        points = _average_of_neighbours(np.r_[border, points], triangles)[len(border) :]
    triangles = _fill(border, edges, points)

    present = {
        tuple(sorted(edge)) for edge in triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
    }
    missing = [edge for edge in edges.tolist() if tuple(sorted(edge)) not in present]
    if missing:
        raise ValueError(
            f"{len(missing)} edges of the border are missing from the face, the first is "
            f"{border[missing[0]]}"
        )
    flat = np.r_[border, points]
    return np.c_[flat, np.full(len(flat), z)], triangles if up else triangles[:, ::-1]


def rings_of_points(radii: np.ndarray, spacing: float, symmetry: int) -> np.ndarray:
    """Points (n, 2) mm on staggered circles, about `spacing` apart, in multiples of `symmetry`."""
    rings = []
    for index, radius in enumerate(radii):
        count = max(symmetry, symmetry * round(2 * np.pi * radius / spacing / symmetry))
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (index % 2)) / count
        rings.append(radius * np.c_[np.cos(angle), np.sin(angle)])
    return np.concatenate(rings)


def save(path: Path, patches: list[Patch]) -> None:
    """Join the patches, check that they are closed and face outward, and write a binary STL."""
    shift = np.cumsum([0] + [len(points) for points, _ in patches[:-1]])
    points = np.concatenate([points for points, _ in patches])
    triangles = np.concatenate(
        [tri + start for (_, tri), start in zip(patches, shift, strict=True)]
    )
    cells = np.round(points / GRID_MM).astype(np.int64)
    _, first, welded = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    corners = (np.round(points / GRID_MM) * GRID_MM)[first].astype(np.float32) + np.float32(0.0)
    triangles = welded.reshape(-1)[triangles]

    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    twice = {tuple(edge) for edge in directed.tolist()}
    if len(twice) != len(directed) or any((b, a) not in twice for a, b in twice):
        raise ValueError(f"{path.name}: the patches do not close into one surface")
    facets = corners[triangles].astype(np.float64)
    normal = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    if (facets[:, 0] * normal).sum() <= 0:
        raise ValueError(f"{path.name}: the surface is inside out")

    record = np.zeros(
        len(facets), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")]
    )
    record["normal"] = np.round(normal / np.linalg.norm(normal, axis=1)[:, None], 6) + 0.0
    record["corners"] = facets
    header = f"{path.stem}, millimetres, closed, written by {path.stem}.py".encode().ljust(80)
    path.write_bytes(header + np.uint32(len(facets)).tobytes() + record.tobytes())
    size = corners.max(axis=0) - corners.min(axis=0)
    print(
        f"{path.name}: {len(facets)} triangles, {' x '.join(f'{length:.3f}' for length in size)} mm"
    )


def _fill(border: np.ndarray, edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Counter-clockwise Delaunay triangles inside the border, in a fixed order."""
    points = np.round(np.r_[border, points] / GRID_MM) * GRID_MM
    triangles = np.asarray(Delaunay(points).simplices, dtype=np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (
        c[:, 0] - a[:, 0]
    )
    triangles = np.where((twice_area < 0)[:, None], triangles[:, ::-1], triangles)
    keep = (np.abs(twice_area) > 1e-6) & _inside((a + b + c) / 3, border, edges)
    triangles = triangles[keep]
    # Each triangle starts at its lowest corner, and the triangles are sorted: one fixed order.
    first = np.argmin(triangles, axis=1)
    triangles = np.take_along_axis(triangles, (first[:, None] + np.arange(3)) % 3, axis=1)
    return triangles[np.lexsort(triangles.T[::-1])]


def _average_of_neighbours(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    pairs = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    total, count = np.zeros_like(points), np.zeros(len(points))
    np.add.at(total, pairs[:, 0], points[pairs[:, 1]])
    np.add.at(count, pairs[:, 0], 1.0)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1.0)[:, None], points)


def _inside(points: np.ndarray, border: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Whether a ray to the right crosses the border an odd number of times, for each point."""
    a, b = border[edges[:, 0]], border[edges[:, 1]]
    x, y = points[:, 0, None], points[:, 1, None]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    return (spans & (x < a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise)).sum(axis=1) % 2 == 1


def _distance(points: np.ndarray, border: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Distance of each point to the nearest border edge [mm]."""
    a, along = border[edges[:, 0]], border[edges[:, 1]] - border[edges[:, 0]]
    away = points[:, None] - a
    t = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(away - t[..., None] * along, axis=2).min(axis=1)
