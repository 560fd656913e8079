"""Read the part of a design, choose and mesh its target, and pose it in the chamber."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.target import chosen_triangles
from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.part_mesh import PartMesh, read_part_cached
from chamberopt.geometry.mesh_io.readers.step.tessellation import Tessellation
from chamberopt.geometry.remesh import remesh, triangle_quality
from chamberopt.geometry.solids import snap_to_grid
from chamberopt.geometry.triangles import areas, rotation_matrix

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.part import Selection, Target

Axis = tuple[np.ndarray, np.ndarray]

MAX_ELEMENTS = 3e5  # makes a few minutes of meshing, and slow steps after it


@dataclass(frozen=True)
class PartOfFile:
    """What a result needs of the part's file once it has been read; without groups and notes."""

    simulated: PartMesh  # in the file's frame
    original: PartMesh | None  # with the file's own triangles, if target.element_mm asks for others
    rotation: np.ndarray  # from the file's frame to the chamber's, (3, 3), applied before the shift
    shift: np.ndarray  # [m], (3,)


@dataclass(frozen=True)
class Part:
    """The part in the chamber's frame.

    It has the user's own triangles in the file's order, unless target.element_mm asks for others.
    It is closed, unless its file draws it as the piece that bounds the room of a whole set-up.
    """

    vertices: np.ndarray  # [m], (n, 3)
    triangles: np.ndarray  # (m, 3) int32
    area: np.ndarray  # [m²], (m,)
    target: np.ndarray  # (m,), whether a triangle must be covered
    name: str
    sha256: str = ""  # of the mesh file as it was read
    unit: str = ""  # of the numbers in the file
    names: tuple[str, ...] = ()  # of the file's groups
    file: PartOfFile | None = None  # None only in parts that no file has
    zones: dict[str, np.ndarray] = field(default_factory=dict)  # triangles of each zone, (m,) bool

    @property
    def elements(self) -> np.ndarray:
        """The file's element that a triangle belongs to, (m,) int64, as in ElementNumbers."""
        if self.file is None:
            return np.arange(1, len(self.triangles) + 1)
        return self.file.simulated.elements


def posed_part(design: Design) -> tuple[Part, list[str]]:
    """The part in the chamber's frame, and notes on its file.

    It is turned about the file's x, then y, then z, its box is centred on the axis, and it is moved
    sideways by the offset, and up or down until its lowest point is at the sonotrode distance. A
    part that is drawn with its chamber stays as it is drawn.

    Raises:
        InputError: the file cannot be used, or the target is empty.
    """
    mesh, target = _meshed_part(design)
    turn, shift = _pose(mesh, design)
    vertices = snap_to_grid(mesh.vertices @ turn.T + shift)
    area = areas(vertices, mesh.triangles)
    simulated = replace(mesh, groups={}, notes=())
    is_remeshed = design.part.target.element is not None
    original = replace(_part_of_file(design), groups={}, notes=()) if is_remeshed else None
    file = PartOfFile(simulated, original, turn, shift)
    of_file = mesh.sha256, mesh.unit, tuple(mesh.groups), file
    zones = {
        zone.name: chosen_triangles(mesh, zone.target, f"zones.{k}.target")
        for k, zone in enumerate(design.zones)
    }
    name = design.part.mesh_path.name
    part = Part(vertices, mesh.triangles, area, target, name, *of_file, zones)
    return part, list(mesh.notes)


@dataclass(frozen=True)
class PartPreview:
    """The part as its file has it, with the place and the target that a design gives it."""

    mesh: PartMesh  # with the file's own triangles (m, 3), in the file's frame
    rotation: np.ndarray  # from the file's frame to the chamber's, (3, 3), applied before the shift
    shift: np.ndarray  # [m], (3,)
    target: np.ndarray  # (m,)
    zones: dict[str, np.ndarray]  # (m,) bool each

    @property
    def vertices(self) -> np.ndarray:
        """In the chamber's frame [m], (n, 3)."""
        return np.asarray(self.mesh.vertices @ self.rotation.T + self.shift)


def preview_part(design: Design) -> PartPreview:
    """What `posed_part` begins with, at once: before target.element_mm and rounding.

    Raises:
        InputError: the file cannot be used, or target or zone are empty.
    """
    mesh, part = _part_of_file(design), design.part
    file = part.mesh_path, part.unit, part.limits

    def chosen(wanted: Selection, field: str) -> np.ndarray:
        if design.chamber.setup() is not None:
            return chosen_triangles(mesh, wanted, field)
        return _chosen(file, wanted, field, mesh.sha256)

    target = chosen(part.target, "part.target")
    zones = {
        one.name: chosen(one.target, f"zones.{k}.target") for k, one in enumerate(design.zones)
    }
    return PartPreview(mesh, *_pose(mesh, design), target, zones)


def turning_axis(design: Design, part: Part) -> Axis | None:
    """Point [m] and direction, (3,) each, of effects.part_turn's axis in the chamber's frame.

    None for a part that does not turn.
    """
    turn, file = design.effects.part_turn, part.file
    if turn is None or file is None:
        return None
    point = file.rotation @ np.array(turn.through) + file.shift
    return point, file.rotation @ np.array(turn.axis)


def _part_of_file(design: Design) -> PartMesh:
    """The part as its file has it; a file is read once, also if many chambers are built from it."""
    part, setup = design.part, design.chamber.setup()
    if setup is not None:
        return setup.part
    return read_part_cached(part.mesh_path, part.unit, part.limits)


def _meshed_part(design: Design) -> tuple[PartMesh, np.ndarray]:
    """The part with the triangles to simulate, and which of them are the target."""
    part, mesh = design.part, _part_of_file(design)
    if part.target.element is None:
        return mesh, chosen_triangles(mesh, part.target)
    file = part.mesh_path, part.unit, part.limits
    return _remeshed(file, part.target, part.target.element, mesh.sha256)


@lru_cache(maxsize=16)
def _chosen(
    file: tuple[Path, str, Tessellation | None], wanted: Selection, field: str, _sha256: str
) -> np.ndarray:
    return chosen_triangles(read_part_cached(*file), wanted, field)


@lru_cache(maxsize=4)
def _remeshed(
    file: tuple[Path, str, Tessellation | None], wanted: Target, size: float, _sha256: str
) -> tuple[PartMesh, np.ndarray]:
    """The part with its target in triangles with sides of about a size [m], and that target."""
    mesh = read_part_cached(*file)
    target = chosen_triangles(mesh, wanted)
    area = float(areas(mesh.vertices, mesh.triangles)[target].sum())
    count = area / (np.sqrt(3.0) / 4.0 * size * size)
    if count > MAX_ELEMENTS:
        fits = 1e3 * size * np.sqrt(count / MAX_ELEMENTS)
        raise InputError(
            f"part.target.element_mm: given {1e3 * size:g}, which makes some {1e-6 * count:.3g} "
            f"million triangles of the target's {1e6 * area:.4g} mm²; give at least {fits:.2g}"
        )
    vertices, triangles, source = remesh(
        mesh.vertices, mesh.triangles, target, target.astype(np.int64), size
    )
    chosen = target[source]
    sides = vertices[triangles[chosen]]
    longest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max(axis=1)
    shape = triangle_quality(vertices, triangles[chosen])
    note = (
        f"target.element_mm = {1e3 * size:g}: the target's {target.sum()} triangles became "
        f"{chosen.sum()}, longest sides {1e3 * np.median(longest):.3g} mm in the middle and "
        f"{1e3 * longest.max():.3g} mm at most, shape {shape.min():.2f} at worst (1: equilateral)"
    )
    origin = _find_origin(mesh, vertices[triangles], source)
    meshed = replace(
        mesh,
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        numbering=mesh.numbering.select(origin),
        groups={name: mask[origin] for name, mask in mesh.groups.items()},
        notes=(*mesh.notes, note),
    )
    return meshed, chosen


def _find_origin(mesh: PartMesh, corners: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The triangle of the mesh in whose area the middle of each new triangle lies, (k,).

    Args:
        corners: of the new triangles [m], shape (k, 3, 3).
        source: triangle of the mesh in the same flat face, shape (k,); already right where the new
            triangle has its corners.
    """
    from sim_core import TriangleMesh, closest_points

    moved = np.flatnonzero((corners != mesh.vertices[mesh.triangles[source]]).any(axis=(1, 2)))
    tags = np.zeros(len(mesh.triangles), dtype=np.uint8)
    surface, far = TriangleMesh(mesh.vertices, mesh.triangles, tags), float(np.ptp(mesh.vertices))
    origin = source.copy()
    origin[moved] = closest_points(surface, corners[moved].mean(axis=1), far).triangle
    return origin


def _pose(mesh: PartMesh, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """From the part file's frame to the chamber's: rotation (3, 3), then shift (3,) [m]."""
    setup, distance = design.chamber.setup(), design.chamber.sonotrode_distance
    if setup is not None:
        return setup.turn, setup.shift + np.array([0.0, 0.0, distance - setup.distance])
    turn = rotation_matrix(design.part.rotate_deg)
    vertices = mesh.vertices @ turn.T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y = design.part.offset
    foot = np.r_[(low[:2] + high[:2]) / 2.0, low[2]]
    return turn, np.array([x, y, distance]) - foot
