"""Design -> Part: the triangles of the part's file, its target chosen and meshed, posed in the chamber."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.errors import InputError
from chamberopt.mesh_io import PartMesh, read_part
from chamberopt.remesh import quality, remeshed
from chamberopt.solids import snapped
from chamberopt.target import chosen_triangles
from chamberopt.triangles import areas

if TYPE_CHECKING:
    from chamberopt.design import Design, Target
    from chamberopt.design import Part as PartTable

MOST_ELEMENTS = 3e5  # a few minutes of meshing; what follows is slow too


@dataclass(frozen=True)
class Part:
    """The user's own triangles, in the file's order (unless target.element_mm asks for others), in the chamber.

    vertices (n, 3) m · triangles (m, 3) int32 · area (m,) m² · target (m,) bool: what must be covered · name ·
    sha256 of the mesh file as it was read · unit that its numbers were taken in · names that the file gives.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    area: np.ndarray
    target: np.ndarray
    name: str
    sha256: str = ""
    unit: str = ""
    names: tuple[str, ...] = ()


def posed_part(design: Design) -> tuple[Part, list[str]]:
    """The part turned about the file's x, then y, then z, its box centred on the axis, then moved; and notes.

    Sideways by the offset, up or down so that its lowest point is at the sonotrode distance. Raises InputError
    when the file cannot be used or the target is empty.
    """
    mesh, target = _mesh(design.part)
    rotation, shift = _pose(mesh, design)
    vertices = snapped(mesh.vertices @ rotation.T + shift)
    area = areas(vertices, mesh.triangles)
    name, names = design.part.mesh_path.name, tuple(mesh.groups)
    return Part(vertices, mesh.triangles, area, target, name, mesh.sha256, mesh.unit, names), list(mesh.notes)


def turning_axis(design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Point [m] and direction, (3,) each, of the axis that effects.part_turn names, in the chamber's frame."""
    turn = design.effects.part_turn
    if turn is None:
        raise ValueError("nothing turns in this design")
    rotation, shift = _pose(_mesh(design.part)[0], design)
    return rotation @ np.array(turn.through) + shift, rotation @ np.array(turn.axis)


def _mesh(part: PartTable) -> tuple[PartMesh, np.ndarray]:
    """The part's mesh and target, read once per file: a study builds a hundred chambers around the same part."""
    try:
        stamp = part.mesh_path.stat()
    except OSError:
        read_part(part.mesh_path, part.unit)  # says what is wrong
        raise
    return _meshed_once(part.mesh, part.unit, part.target, stamp.st_mtime_ns, stamp.st_size)


@lru_cache(maxsize=4)
def _meshed_once(mesh: str, unit: str, target: Target, changed: int, size: int) -> tuple[PartMesh, np.ndarray]:
    part = _read_once(mesh, unit, changed, size)
    chosen = chosen_triangles(part, target)
    return (part, chosen) if target.element is None else _in_elements(part, chosen, target.element)


@lru_cache(maxsize=4)
def _read_once(mesh: str, unit: str, _changed: int, _size: int) -> PartMesh:
    return read_part(Path(mesh), unit)


def _in_elements(mesh: PartMesh, target: np.ndarray, size: float) -> tuple[PartMesh, np.ndarray]:
    """The part with its target in triangles with sides of about size [m], and that target."""
    area = float(areas(mesh.vertices, mesh.triangles)[target].sum())
    count = area / (np.sqrt(3.0) / 4.0 * size * size)
    if count > MOST_ELEMENTS:
        fits = 1e3 * size * np.sqrt(count / MOST_ELEMENTS)
        raise InputError(
            f"part.target.element_mm: given {1e3 * size:g}, which makes some {1e-6 * count:.3g} million triangles of "
            f"the target's {1e6 * area:.4g} mm²; give at least {fits:.2g}"
        )
    vertices, triangles, source = remeshed(mesh.vertices, mesh.triangles, target, target.astype(np.int64), size)
    chosen = target[source]
    sides = vertices[triangles[chosen]]
    longest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max(axis=1)
    shape = quality(vertices, triangles[chosen])
    note = (
        f"target.element_mm = {1e3 * size:g}: the target's {target.sum()} triangles became {chosen.sum()}, longest "
        f"sides {1e3 * np.median(longest):.3g} mm in the middle and {1e3 * longest.max():.3g} mm at most, shape "
        f"{shape.min():.2f} at worst (1: equilateral)"
    )
    groups = {name: mask[source] for name, mask in mesh.groups.items()}
    triangles = triangles.astype(np.int32)
    return replace(mesh, vertices=vertices, triangles=triangles, groups=groups, notes=(*mesh.notes, note)), chosen


def _pose(mesh: PartMesh, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """From the part file's frame to the chamber's: matrix (3, 3), then shift (3,) [m]."""
    rotation = _rotation(design.part.rotate_deg)
    vertices = mesh.vertices @ rotation.T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = (low + high) / 2.0
    x, y = design.part.offset
    return rotation, np.array([x - centre[0], y - centre[1], design.chamber.sonotrode_distance - low[2]])


def _rotation(degrees: tuple[float, float, float]) -> np.ndarray:
    """Matrix (3, 3) of turns about the fixed axes x, then y, then z; exact for quarter turns."""
    matrix = np.eye(3)
    for axis, angle in enumerate(degrees):
        turns, rest = divmod(angle, 90.0)
        s, c = np.sin(np.radians(rest)), np.cos(np.radians(rest))
        for _ in range(int(turns) % 4):
            s, c = c, -s
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
        matrix = turn @ matrix
    return matrix
