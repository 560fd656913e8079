"""What a reader returns: triangles as the file gives them, with element numbers and group names."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np


@dataclass(frozen=True)
class ElementNumbers:
    """The element of the file to which each of m triangles belongs; results can be exported by it.

    The triangles of a quadrilateral share a number. If the file does not number its elements (`own`
    is false), the number is the position from 1 of the triangle, polygon (OBJ) or cell (VTK).
    """

    elements: np.ndarray  # (m,) int64, the element's number; 0: not in the file
    faces: np.ndarray  # (m,) int8, face of a solid element, from 1 as Abaqus's S1, S2 ...; 0: shell
    own: bool = False  # whether the numbers are the file's own
    instance: str = ""  # the Abaqus instance in which the numbers count, if any

    def select(self, rows: np.ndarray) -> ElementNumbers:
        """Numbers of some triangles, by a mask (m,) or by indices; index -1: not in the file."""
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        elements, faces = (
            np.where(rows >= 0, column[rows], 0) for column in (self.elements, self.faces)
        )
        return replace(self, elements=elements, faces=faces)


def number_by_position(count: int) -> ElementNumbers:
    """Numbers for a file that has none: its triangles from 1 on."""
    return ElementNumbers(np.arange(1, count + 1), np.zeros(count, dtype=np.int8))


@dataclass(frozen=True)
class RawMesh:
    """The triangles of a file, before they are checked.

    Groups are the file's sets, groups, properties or colours: name -> triangles, (m,) bool.
    """

    corners: np.ndarray  # (m, 3, 3), in the file's numbers and order
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str | None = None  # of the file's numbers, if the file states one
    notes: tuple[str, ...] = ()  # what was left out or turned into triangles
    numbering: ElementNumbers | None = None  # None if the file has only triangles
    bodies: np.ndarray | None = None  # (m,), the body of each, if each is closed by itself
    normals: np.ndarray | None = None  # of the surface at the corners, (m, 3, 3); 0: not known
    is_exact: bool = False  # whether the triangles were made of the surface itself


def read_scene(file: BinaryIO | Path, kind: str) -> RawMesh:
    """Read a file of a kind ("stl", "3mf", "glb") with trimesh; meshes of one name are a group."""
    import trimesh

    scene = trimesh.load_scene(file, file_type=kind, process=False)
    names, corners = [""], [np.zeros((0, 3, 3))]
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        mesh: Any = scene.geometry[key]
        if hasattr(mesh, "faces") and len(mesh.faces):  # no lines and points
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
