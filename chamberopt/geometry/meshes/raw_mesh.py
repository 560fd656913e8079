"""Define the result of each mesh reader: a file's triangles, element numbers and groups."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np


@dataclass(frozen=True)
class ElementNumbers:
    """Numbers of the file's elements to which m triangles belong, for export by element.

    The triangles of a quadrilateral share a number. If the file does not number its elements (`own`
    is false), the number is the position from 1 of the triangle, polygon (OBJ) or cell (VTK).
    """

    elements: np.ndarray  # (m,) int64, number of the element; 0: not in the file
    # (m,) int8, face of a solid element, from 1 as in Abaqus's S1, S2 ...; 0: shell
    faces: np.ndarray
    own: bool = False  # True if the numbers are the file's own
    instance: str = ""  # Abaqus instance in which the numbers count, if any
    # (m,), number of the CAD file's face, -1 for none; None if the file has no such faces
    cad_face: np.ndarray | None = None

    def select(self, rows: np.ndarray) -> ElementNumbers:
        """Return the numbers of some triangles.

        Args:
            rows: marks (m,) of the triangles, or their indices, -1 for a triangle that is not in
                the file.
        """
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        elements, faces = (
            np.where(rows >= 0, column[rows], 0) for column in (self.elements, self.faces)
        )
        of = self.cad_face
        cad_face = None if of is None else np.where(rows >= 0, of[rows], -1)
        return replace(self, elements=elements, faces=faces, cad_face=cad_face)


def number_by_position(count: int) -> ElementNumbers:
    """Return the numbers for a file without element numbers: its triangles from 1 on."""
    return ElementNumbers(np.arange(1, count + 1), np.zeros(count, dtype=np.int8))


@dataclass(frozen=True)
class RawMesh:
    """Triangles of a mesh file as they were read, before they are checked.

    Groups are the file's sets, groups, properties or colours: triangles (m,) bool by name.
    """

    corners: np.ndarray  # (m, 3, 3), in the file's unit and order
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str | None = None  # unit of the file's numbers, if the file states a unit
    notes: tuple[str, ...] = ()  # one sentence for each omission or conversion
    numbering: ElementNumbers | None = None  # None if the file has only triangles
    # (m,), body of each triangle, if each body is closed by itself
    bodies: np.ndarray | None = None
    normals: np.ndarray | None = None  # surface normals at the corners, (m, 3, 3); 0: not known
    is_exact: bool = False  # True if the triangles were made from the exact surface


def read_scene(file: BinaryIO | Path, kind: str) -> RawMesh:
    """Read a file of the kind "stl", "3mf" or "glb" with trimesh.

    The triangles of all meshes with one name become a group.
    """
    import trimesh

    scene = trimesh.load_scene(file, file_type=kind, process=False)
    names, corners = [""], [np.zeros((0, 3, 3))]
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        mesh: Any = scene.geometry[key]
        if hasattr(mesh, "faces") and len(mesh.faces):  # lines and points have no faces
            points = np.asarray(mesh.vertices, dtype=np.float64)
            points = points @ transform[:3, :3].T + transform[:3, 3]
            names.append(str(mesh.metadata.get("name") or node))
            corners.append(points[mesh.faces])
    mesh_of = np.repeat(np.arange(len(corners)), list(map(len, corners)))
    groups: dict[str, np.ndarray] = {}
    for k, name in enumerate(names):
        if name and not name.startswith("geometry_"):
            groups[name] = groups.get(name, False) | (mesh_of == k)
    return RawMesh(np.concatenate(corners), groups)
