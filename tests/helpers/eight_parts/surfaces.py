"""Closed surfaces of rows of points, for parts that are built by script; any unit of length."""

from __future__ import annotations

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]  # points (n, 3), and triangles (m, 3) that face outward


def tube(rings: np.ndarray, around: bool = False) -> np.ndarray:
    """Triangles between successive rings of points, (k, n, 3), numbered row by row.

    Args:
        around: whether the last ring is joined to the first, as in a torus.
    """
    k, n, _ = rings.shape
    i, j = np.meshgrid(np.arange(k if around else k - 1), np.arange(n), indexing="ij")
    i, j, above, right = i.ravel(), j.ravel(), (i.ravel() + 1) % k, (j.ravel() + 1) % n
    a, b, c, d = i * n + j, i * n + right, above * n + right, above * n + j
    return np.stack([np.c_[a, b, c], np.c_[a, c, d]], axis=1).reshape(-1, 3)


def zip_up(n: int) -> np.ndarray:
    """Triangles that close a ring of n points (n even): point j is across from point n - j."""
    a = np.arange(n // 2)
    b, c, d = a + 1, -(a + 1) % n, -a % n
    both = np.stack([np.c_[a, b, c], np.c_[a, c, d]], axis=1).reshape(-1, 3)
    return both[(both != np.roll(both, 1, axis=1)).all(axis=1)]


def closed_tube(rings: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """A tube with both ends closed, and for each triangle 0 (side), 1 (first end), 2 (last end)."""
    k, n, _ = rings.shape
    parts = [tube(rings), zip_up(n)[:, ::-1], zip_up(n) + (k - 1) * n]
    return (rings.reshape(-1, 3), np.concatenate(parts)), np.repeat(
        [0, 1, 2], list(map(len, parts))
    )


def smooth_step(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, and smooth between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
