"""Decks of tetrahedra made for tests: slabs and hollow balls, and what CalculiX says of them."""

import subprocess
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
import trimesh

from chamberopt.geometry.meshes.elements import EDGES

Tets = tuple[np.ndarray, np.ndarray]  # points (n, 3), corners (e, 4)


def slab(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Tets:
    """A block with planes at these places, six tetrahedra in each of its cells."""
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(len(x), len(y), len(z))
    ends = [
        number[tuple(slice(k, k - 1 or None) for k in at)].ravel() for at in np.ndindex(2, 2, 2)
    ]
    cell = np.stack(ends, axis=1).reshape(-1, 2, 2, 2)
    tets = []
    for order in permutations(range(3)):  # Kuhn: from one corner to the opposite one, side by side
        at, way = [0, 0, 0], [(0, 0, 0)]
        for axis in order:
            at[axis] = 1
            way.append(tuple(at))
        tets.append(np.stack([cell[:, i, j, k] for i, j, k in way], axis=1))
    return points, outward(points, np.concatenate(tets))


def hollow_ball(radii: Sequence[float], splits: int) -> Tets:
    """A ball with a hole, of layers between these radii, three tetrahedra below each triangle."""
    shell = trimesh.creation.icosphere(splits, 1.0)
    count, faces = len(shell.vertices), np.sort(shell.faces, axis=1)
    points = np.concatenate([radius * shell.vertices for radius in radii])
    tets = []
    for k in range(len(radii) - 1):
        (a, b, c), (d, e, f) = (faces + k * count).T, (faces + (k + 1) * count).T
        tets += [np.stack(one, axis=1) for one in ((a, b, c, f), (a, b, e, f), (a, d, e, f))]
    return points, outward(points, np.concatenate(tets))


def outward(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    wrong = np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) < 0.0
    return np.where(wrong[:, None], tets[:, [0, 2, 1, 3]], tets)


def with_middles(mesh: Tets) -> Tets:
    """The mesh with a node in the middle of each edge: C3D10 of C3D4."""
    points, tets = mesh
    pairs = np.sort(np.stack([tets[:, edge] for edge in EDGES["tetra"]], axis=1), axis=2)
    edges, which = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middles = points[edges].mean(axis=1)
    return np.concatenate([points, middles]), np.hstack([tets, which.reshape(-1, 6) + len(points)])


def deck_of(mesh: Tets) -> str:
    """Nodes and elements of a deck, in the set ALL, numbered from 1 and from 1001 on."""
    points, tets = mesh
    rows = [", ".join(f"{x:.12g}" for x in point) for point in points.tolist()]
    lines = ["*NODE, NSET=NALL", *(f"{k}, {row}" for k, row in enumerate(rows, start=1))]
    lines.append(f"*ELEMENT, TYPE=C3D{tets.shape[1]}, ELSET=ALL")
    for k, nodes in enumerate((tets + 1).tolist(), start=1001):
        lines.append(", ".join(map(str, (k, *nodes))))
    return "\n".join(lines) + "\n"


def balanced(
    folder: Path, mesh: Tets, include: Path, elastic: tuple[float, float], held: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Let CalculiX balance the initial stress of an included file, without loads.

    Args:
        elastic: Young's modulus [MPa] and Poisson's ratio.
        held: data lines of *BOUNDARY.

    Returns:
        Movements of the nodes (n, 3), and places and stresses of the integration points, (p, 3) and
        (p, 6).
    """
    job = folder / "job.inp"
    lines = ["*MATERIAL, NAME=METAL", "*ELASTIC", f"{elastic[0]:g}, {elastic[1]:g}"]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=METAL", f"*INCLUDE, INPUT={include.name}"]
    lines += ["*STEP", "*STATIC", "*BOUNDARY", *held, "*NODE PRINT, NSET=NALL", "U"]
    lines += ["*EL PRINT, ELSET=ALL", "S, COORD", "*END STEP"]
    job.write_text(deck_of(mesh) + "\n".join(lines) + "\n")
    subprocess.run(["ccx", "job"], cwd=folder, check=True, capture_output=True, timeout=200)
    rows = [line.split() for line in (folder / "job.dat").read_text().splitlines()]
    rows = [row for row in rows if row and row[0].isdigit()]
    moved, stress, place = (np.array([row for row in rows if len(row) == n], dtype=float)
                            for n in (4, 8, 5))  # fmt: skip
    return moved[:, 1:], place[:, 2:], stress[:, 2:]
