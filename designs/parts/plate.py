"""Write plate.stl: a flat test plate, its middle on the z axis, its lower face at z = 0.

Run `python designs/parts/plate.py`. Lengths are in millimetres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from surfaces import Patch, save, tube

SIDE = 60.0
THICKNESS = 10.0
EDGE = 2.0  # wanted edge of triangles


def square_face(z: float, up: bool) -> Patch:
    """A face of squares, each split in two by alternating diagonals."""
    count = round(SIDE / EDGE)
    line = np.linspace(-SIDE / 2, SIDE / 2, count + 1)
    rows = np.stack([np.c_[line, np.full_like(line, y), np.full_like(line, z)] for y in line])
    points, triangles = tube(rows, closed=False)
    return points, triangles if up else triangles[:, ::-1]


def outline(z: float) -> np.ndarray:
    """The border (n, 3) at height z, counter-clockwise."""
    count = round(SIDE / EDGE)
    line = np.linspace(-SIDE / 2, SIDE / 2, count + 1)[:-1]
    side = np.full_like(line, SIDE / 2)
    border = np.concatenate(
        [np.c_[line, -side], np.c_[side, line], np.c_[-line, side], np.c_[-side, -line]]
    )
    return np.c_[border, np.full(len(border), z)]


def main(path: Path) -> None:
    levels = np.linspace(0.0, THICKNESS, 1 + round(THICKNESS / EDGE))
    sides = tube(np.stack([outline(z) for z in levels]))
    save(path, [square_face(0.0, up=False), sides, square_face(THICKNESS, up=True)])


if __name__ == "__main__":
    main(Path(__file__).with_suffix(".stl"))
