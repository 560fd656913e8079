"""Write plate_setup.bdf: the plate's whole set-up as a mesher writes it.

Sonotrode, chamber and part are groups. The room under plate.stl is a cylinder of 50 mm, 15 mm high.
The piece of the plate that closes it is PART, with plate.stl's own triangles in its middle. As
drawn in CAD, the chamber lies on its side: the sonotrode, at x = 120, faces -x.

Run `python designs/parts/plate_setup.py`. Lengths are in millimetres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plate import EDGE, square_face
from surfaces import GRID_MM, Patch, planar, rings_of_points, tube

RADIUS, HEIGHT, FACETS, SONOTRODE_AT = 25.0, 15.0, 64, 120.0
MIDDLE = 14.0  # half the side of the square with the triangles of plate.stl
SPACING = 3.0  # of points between that square and the wall, and on the sonotrode
GROUPS = ("PART", "SONOTRODE", "WALL")


def lid() -> list[Patch]:
    """The plate's face over the room: its middle, and the ring around it."""
    points, triangles = square_face(HEIGHT, up=True)
    inside = (np.abs(points[triangles][..., :2]) <= MIDDLE + 1e-9).all(axis=(1, 2))
    count = round(2 * MIDDLE / EDGE)
    line = -MIDDLE + EDGE * np.arange(count)
    side = np.full(count, MIDDLE)
    square = np.concatenate(
        [np.c_[line, -side], np.c_[side, line], np.c_[-line, side], np.c_[-side, -line]]
    )
    between = rings_of_points(np.arange(MIDDLE, RADIUS, SPACING), SPACING, 4)
    return [
        (points, triangles[inside]),
        planar([circle(), square], between, SPACING, HEIGHT, up=True),
    ]


def circle() -> np.ndarray:
    """Corners (64, 2) of the wall in plan."""
    angle = 2 * np.pi * np.arange(FACETS) / FACETS
    return RADIUS * np.c_[np.cos(angle), np.sin(angle)]


def main(path: Path) -> None:
    floor = planar(
        [circle()],
        rings_of_points(np.arange(SPACING, RADIUS, SPACING), SPACING, 4),
        SPACING,
        0.0,
        up=False,
    )
    levels = np.linspace(0.0, HEIGHT, 6)
    wall = tube(np.stack([np.c_[circle(), np.full(FACETS, z)] for z in levels]))
    patches = [(1, patch) for patch in lid()] + [(2, floor), (3, wall)]
    corners = np.concatenate([points[triangles] for _, (points, triangles) in patches])
    group = np.repeat(
        [number for number, _ in patches], [len(triangles) for _, (_, triangles) in patches]
    )
    cells, nodes = np.unique(
        np.round(corners.reshape(-1, 3) / GRID_MM).astype(np.int64), axis=0, return_inverse=True
    )
    x, y, z = (cells * GRID_MM).T
    lines = ["$ millimetres, written by plate_setup.py", "CEND", "BEGIN BULK"]
    lines += [
        f"$ANSA_NAME_COMMENT;{number};PSHELL;{name}" for number, name in enumerate(GROUPS, start=1)
    ]
    lines += [
        f"GRID,{number},,{SONOTRODE_AT - up:.4f},{across:.4f},{along:.4f}"
        for number, (up, across, along) in enumerate(zip(z, y, x, strict=True), start=1)
    ]
    lines += [
        f"CTRIA3,{number},{pid},{a + 1},{b + 1},{c + 1}"
        for number, (pid, (a, b, c)) in enumerate(
            zip(group, nodes.reshape(-1, 3), strict=True), start=1
        )
    ]
    path.write_text("\n".join([*lines, "ENDDATA"]) + "\n", encoding="ascii", newline="\n")
    print(f"{path.name}: {len(corners)} triangles, {len(cells)} nodes")


if __name__ == "__main__":
    main(Path(__file__).with_suffix(".bdf"))
