"""A scanned knuckle of three arms: noise, small holes, and a facet that belongs to nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh

NOISE_MM = 0.015
ARMS = np.array([[26.0, 0.0, 4.0], [-14.0, 22.0, 0.0], [-15.0, -20.0, -3.0]])  # ends [mm]


def scan(folder: Path) -> Path:
    """The knuckle, 54 x 55 x 22 mm: binary PLY in mm with noise and five holes of 2 mm."""
    points, triangles = _scanned()
    return _write(folder / "scan.ply", points, triangles)


def scan_with_stray_facet(folder: Path) -> Path:
    """The same, with a triangle of 2 mm that floats 3 mm above the surface."""
    points, triangles = _scanned()
    top = points[points[:, 2].argmax()] + np.array([0.0, 0.0, 3.0])
    facet = top + np.array([[0.0, 0.0, 0.0], [2.0, 0.2, 0.1], [0.7, 1.8, 0.4]])
    whole = np.concatenate([triangles, len(points) + np.arange(3)[None]])
    return _write(folder / "scan_stray.ply", np.concatenate([points, facet]), whole)


def _scanned() -> tuple[np.ndarray, np.ndarray]:
    step = 0.9
    axes = [np.arange(low, high, step) for low, high in ((-28, 38), (-34, 36), (-16, 18))]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    grid = pv.ImageData(
        dimensions=tuple(map(len, axes)), spacing=(step,) * 3, origin=(-28, -34, -16)
    )
    grid["distance"] = _distance(places.reshape(-1, 3)).reshape(places.shape[:3]).ravel(order="F")
    surface = grid.contour([0.0], scalars="distance")
    mesh = trimesh.Trimesh(surface.points, surface.regular_faces[:, ::-1], process=True)
    trimesh.smoothing.filter_taubin(mesh, iterations=10)  # evens out the thin triangles
    rng = np.random.default_rng(8)
    noise = rng.normal(0.0, NOISE_MM, (len(mesh.vertices), 1))
    points, triangles = np.asarray(mesh.vertices + mesh.vertex_normals * noise), mesh.faces
    middle = points[triangles].mean(axis=1)
    for centre in middle[rng.choice(len(middle), 5, replace=False)]:
        near = np.linalg.norm(middle - centre, axis=1) < 0.55
        triangles, middle = triangles[~near], middle[~near]
    return points, triangles


def _distance(places: np.ndarray) -> np.ndarray:
    """Distance (n,) [mm], negative inside: three arms and a hub, blended, and a flat below."""
    parts = [np.linalg.norm(places * [1, 1, 1.25], axis=1) - 13.0]
    for end in ARMS:
        t = np.clip(places @ end / (end @ end), 0.0, 1.0)
        parts.append(np.linalg.norm(places - t[:, None] * end, axis=1) - (8.0 - 1.5 * t))
    blended = -2.5 * np.log(sum(np.exp(-d / 2.5) for d in parts))
    return np.maximum(blended, -10.0 - places[:, 2])


def _write(path: Path, points: np.ndarray, triangles: np.ndarray) -> Path:
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(triangles), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, triangles
    path.write_bytes(head.encode() + points.astype("<f4").tobytes() + rows.tobytes())
    return path
