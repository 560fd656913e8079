"""Lay grids on curved faces with four sides: fine across a fillet or a tooth, coarse along it.

A grid has as many rows in each of its two directions as the curvature of its lines there asks for.
Opposite edges have the same number; faces that share an edge pass it on to each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

SAMPLES = 13  # in each direction: enough for the curvature of a fillet or an aerofoil
ON_EDGE = 0.01  # of a face's parameters
MOST_TIMES_LONGER = 6.0  # one side of a grid's cell than the other
# A line whose curvature varies so much that even rows would be this many times more is no grid's.
MOST_TIMES_MORE = 3.0
Grid = tuple[tuple[int, int, int], tuple[int, int, int]]  # in each direction: two edges, rows


def lay_grids(model: Any, faces: list[int], side_at: Callable[[float], float]) -> None:
    """Lay grids where faces have four sides, and leave all others to the mesher.

    Args:
        model: gmsh.model.
        side_at: wanted side of triangles by the radius of curvature.
    """
    curved = (face for face in faces if model.getType(2, face) != "Plane")
    grids = {face: grid for face in curved if (grid := _find_grid(model, face, side_at))}
    rows: dict[int, int] = {}
    is_new = True
    while is_new:
        is_new = False
        for one, other, wanted in (line for grid in grids.values() for line in grid):
            most = max(wanted, rows.get(one, 0), rows.get(other, 0))
            is_new |= (rows.get(one), rows.get(other)) != (most, most)
            rows[one] = rows[other] = most
    for edge, count in rows.items():
        model.mesh.setTransfiniteCurve(edge, count + 1)
    for face in grids:
        model.mesh.setTransfiniteSurface(face, "AlternateLeft")


def _find_grid(model: Any, face: int, side_at: Callable[[float], float]) -> Grid | None:
    """The edges at the four ends of a face's parameters and the rows between, if it has such."""
    edges = [tag for _, tag in model.getBoundary([(2, face)], oriented=False)]
    low, high = map(np.array, model.getParametrizationBounds(2, face))
    at_end: dict[tuple[int, int], int] = {}
    for edge in edges if len(set(edges)) == len(edges) == 4 else ():
        first, last = model.getParametrizationBounds(1, edge)
        along = np.linspace(first[0], last[0], 5)
        places = np.reshape(model.reparametrizeOnSurface(1, edge, along, face), (-1, 2))
        shares = (places - low) / (high - low)
        for axis, end in ((0, 0), (0, 1), (1, 0), (1, 1)):
            if np.abs(shares[:, axis] - end).max() < ON_EDGE:
                at_end[axis, end] = edge
    if len(set(at_end.values())) < 4:
        return None
    u, v = np.meshgrid(*np.linspace(low, high, SAMPLES).T, indexing="ij")
    flat = np.stack([u, v], axis=-1).ravel()
    points = np.reshape(model.getValue(2, face, flat), (SAMPLES, SAMPLES, 3))
    lines = [_line(points, side_at), _line(points.transpose(1, 0, 2), side_at)]
    if any(more > MOST_TIMES_MORE for _, _, more in lines):
        return None
    (along_u, side_u, _), (along_v, side_v, _) = lines
    side_u = min(side_u, MOST_TIMES_LONGER * side_v)
    side_v = min(side_v, MOST_TIMES_LONGER * side_u)
    return (
        (at_end[1, 0], at_end[1, 1], math.ceil(along_u / side_u)),
        (at_end[0, 0], at_end[0, 1], math.ceil(along_v / side_v)),
    )


def _line(points: np.ndarray, side_at: Callable[[float], float]) -> tuple[float, float, float]:
    """The longest of lines (points of each, lines, 3), their shortest wanted side, and waste.

    Waste is how many times more rows of that side are than rows of the side wanted in each place.
    """
    steps = np.diff(points, axis=0)
    length = np.maximum(np.linalg.norm(steps, axis=2), 1e-12)
    ahead = steps / length[..., None]
    turn = np.arccos(np.clip((ahead[1:] * ahead[:-1]).sum(axis=2), -1.0, 1.0))
    between = (length[1:] + length[:-1]) / 2
    radius = (between / np.maximum(turn, 1e-9)).min(axis=1)
    side = np.array([side_at(one) for one in radius.tolist()])
    waste = (between.max(axis=1) / side.min()).sum() / (between.max(axis=1) / side).sum()
    return float(length.sum(axis=0).max()), float(side.min()), float(waste)
